"""A table as walls and outlets.

Lengths run along x from 0 to L, widths along y from 0 to W, the bed is z = 0, as in `scenarios/paper/5.6_break.toml`.

**Cushions.** The nose of a cushion is a line at the height h above the bed, above the centre of the ball. It is the edge of
a horizontal rectangle: a ball on the bed touches it with a normal that points down by theta, sin theta = (h - r)/r. The
bed, on which its weight holds the ball, answers in the same impact (rule R2, `docs/theory/algorithm.md` section 5: contacts
that the load closes act together with it), so that without friction e comes back of the speed across the rail, and the
ball does not hop. One that is in the air is pressed down, and (1 + e) cos^2 theta - 1 of its speed comes back.

**Pockets.** The points of a pocket are the ends of the noses; its facings are rectangles too, so that balls rattle. A ball
is taken out (by outlets) once its centre is behind the edge of the slate, a straight line here; a ball that is over a rail
and higher than the nose has left the table.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from carom.scene.billiards.data import Spec
from carom.scene.tables.billiard import FACING

if TYPE_CHECKING:
    from carom.scene.scene import Scene

FAR = 10.0
"""Where outlets end, m."""
STAIRS = 8
"""Boxes that stand for the slanted edge of the slate in a corner."""
RAIL = 3.0
"""Width of the rectangle behind a nose, in radii of a ball."""


def noses(spec: Spec) -> list[tuple[str, tuple[float, float], tuple[float, float]]]:
    """Name and ends of each straight piece of nose and facing; the table is to the left of the way between them."""
    length, width = spec.length, spec.width
    if not spec.corner_mouth:
        corners = [(0.0, 0.0), (length, 0.0), (length, width), (0.0, width)]
        names = ("right", "foot", "left", "head")
        return [(f"cushion {n}", corners[k], corners[(k + 1) % 4]) for k, n in enumerate(names)]
    a, b = spec.corner_mouth / math.sqrt(2), 0.5 * spec.side_mouth
    middle = 0.5 * length
    straight = {
        "right head": ((a, 0.0), (middle - b, 0.0), "corner", "side"),
        "right foot": ((middle + b, 0.0), (length - a, 0.0), "side", "corner"),
        "foot": ((length, a), (length, width - a), "corner", "corner"),
        "left foot": ((length - a, width), (middle + b, width), "corner", "side"),
        "left head": ((middle - b, width), (a, width), "side", "corner"),
        "head": ((0.0, width - a), (0.0, a), "corner", "corner"),
    }
    found = []
    for name, (start, end, before, after) in straight.items():
        found.append((f"cushion {name}", start, end))
        way = np.subtract(end, start) / math.dist(start, end)
        out = np.array([way[1], -way[0]])
        reach = FACING * spec.ball_radius
        for kind, point, along, tip in ((before, start, -way, "a"), (after, end, way, "b")):
            angle = spec.corner_angle if kind == "corner" else spec.side_angle
            turn = math.pi - angle  # off the line of the nose, outwards
            far = np.array(point) + reach * (math.cos(turn) * along + math.sin(turn) * out)
            deep = (float(far[0]), float(far[1]))
            ends = (deep, point) if tip == "a" else (point, deep)
            found.append((f"facing {name} {tip}", *ends))
    return found


def rail(scene: Scene, name: str, start: tuple[float, float], end: tuple[float, float], spec: Spec) -> None:
    """A rectangle at the height of the nose that faces down; its inner edge is the nose."""
    reach = RAIL * spec.ball_radius
    way = np.subtract(end, start)
    length = float(np.linalg.norm(way))
    way = way / length
    out = np.array([way[1], -way[0]])
    middle = 0.5 * np.add(start, end) + 0.5 * reach * out
    scene.plane(
        name,
        point=(float(middle[0]), float(middle[1]), spec.nose_height),
        normal=(0, 0, -1),
        size=(length, reach),
        side=(float(way[0]), float(way[1]), 0.0),
        material="cushion",
    )


def nearest_cushion(spec: Spec, point: tuple[float, float, float]) -> tuple[str, float]:
    """The cushion or facing nearest to a point, and its distance, m: that of the rectangle of `rail`."""
    found = []
    for name, start, end in noses(spec):
        length = math.dist(start, end)
        way = np.subtract(end, start) / length
        apart = np.subtract(point[:2], start)
        along = float(apart @ way)
        out = float(apart[0] * way[1] - apart[1] * way[0])
        past = along - min(max(along, 0.0), length)
        behind = out - min(max(out, 0.0), RAIL * spec.ball_radius)
        found.append((math.hypot(past, behind, point[2] - spec.nose_height), name))
    away, name = min(found)
    return name, away


def outlets(spec: Spec) -> list[tuple[list[float], list[float]]]:
    """Boxes: over the rails, and behind the edge of the slate in the pockets."""
    length, width, top = spec.length, spec.width, spec.nose_height
    low_x, high_x, low_y, high_y = -FAR, length + FAR, -FAR, width + FAR
    boxes = [
        ([low_x, low_y, top], [0.0, high_y, FAR]),
        ([length, low_y, top], [high_x, high_y, FAR]),
        ([0.0, low_y, top], [length, 0.0, FAR]),
        ([0.0, width, top], [length, high_y, FAR]),
    ]
    if not spec.corner_mouth:
        return boxes
    r = spec.ball_radius
    # The edge of the slate in a corner: x + y = 2 c in its own axes, stairs of boxes under it.
    c = 0.5 * (spec.corner_mouth / math.sqrt(2) - math.sqrt(2) * spec.corner_shelf)
    steps = np.linspace(c - r, c + r, STAIRS)
    half = 0.5 * float(steps[1] - steps[0])
    for corner_x, sign_x in ((0.0, 1.0), (length, -1.0)):
        for corner_y, sign_y in ((0.0, 1.0), (width, -1.0)):
            for u in steps.tolist():
                # Stairs reach as far before the edge as they stay behind it, half / sqrt(2).
                xs = sorted((corner_x - sign_x * FAR, corner_x + sign_x * (u + half)))
                ys = sorted((corner_y - sign_y * FAR, corner_y + sign_y * (2 * c - u)))
                boxes.append(([xs[0], ys[0], -FAR], [xs[1], ys[1], FAR]))
    b = 0.5 * spec.side_mouth + r
    middle, shelf = 0.5 * length, spec.side_shelf
    boxes.append(([middle - b, low_y, -FAR], [middle + b, -shelf, FAR]))
    boxes.append(([middle - b, width + shelf, -FAR], [middle + b, high_y, FAR]))
    return boxes
