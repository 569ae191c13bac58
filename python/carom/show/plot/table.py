"""Seen from above: the paths of the balls between the walls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64, Array
from carom.errors import CaromError
from carom.scene.assembly.rotations import rotated, upward
from carom.scene.billiards.look import BallLook, ball_looks
from carom.scene.billiards.marked import table_of
from carom.scene.billiards.shape import Shape
from carom.show.plot.billiards import draw_ball, draw_ghost, draw_path, draw_table
from carom.show.plot.motion import MOST_LINES, blocks, level_axes, selection, shown_frames
from carom.show.plot.style import COLOURS, DASHES, GREY, Chart, entry, legend, sheet, styled, width
from carom.show.surfaces import surfaces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from carom.result.data import RunData
    from carom.result.walls import Wall


#: Height of a figure over its width at most, and at least.
TALLEST, FLATTEST = 1.2, 0.15
#: Above so many balls their paths would fill the figure: the balls at the end are drawn alone, the highest on top.
CROWD = 200
#: Of a box, as pairs of its corners.
EDGES = np.array([(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1])


def trajectories(result: RunData, bodies: Sequence[str] | None = None) -> Chart:
    """Paths of the centres seen against gravity, m, with the balls at the start (outlined) and at the end (filled), or
    where they left (dotted), and the edges of a periodic box.

    On a table of the billiards kit with the table, and in the colours of the balls. Of more than 200 balls no paths: the
    balls at the end, the highest on top.
    """
    names, columns = selection(result, bodies)
    if not names or not len(result.time):
        raise CaromError("the run holds no balls or no frames: there are no paths to draw")
    axis = level_axes(upward(result.gravity))
    radius = np.asarray(result.bodies["radius"])[columns]
    if len(names) > CROWD:
        return _crowd(result, names, columns, axis, radius)
    frames = shown_frames(result)
    parts = [part[:, :, axis] for _, part in blocks(result, "position", columns, frames)]
    place = np.concatenate(parts)
    few = len(names) <= MOST_LINES
    table = table_of(result)
    shape = None if table is None or axis != (0, 1) else Shape(table)
    figure, axes = _sheet(result, place, radius, axis, shape)
    with styled():
        if table is not None and shape is not None:
            draw_table(axes, shape)
            looks = dict(zip(result.names, ball_looks(result, table), strict=True))
            _on_table(axes, place, radius, [looks[name] for name in names])
        for i, name in enumerate(names if shape is None else ()):
            colour = COLOURS[i] if few else COLOURS[0]
            look: dict[str, Any] = (
                {"label": entry(name, names), "linestyle": DASHES[i % 2]} if few else {"alpha": 0.5}
            )
            axes.plot(*place[:, i].T, color=colour, linewidth=1.0 if few else 0.4, zorder=3, **look)
            _ends(axes, place[:, i], float(radius[i]), colour)
        if few and shape is None:
            legend(figure, axes)
    numbers: dict[str, Array] = {"time (s)": np.asarray(result.time)[frames]}
    for i, name in enumerate(names):
        numbers |= {f"{name} {'xyz'[k]} (m)": place[:, i, j] for j, k in enumerate(axis)}
    return Chart(figure, numbers)


def _on_table(axes: Axes, place: F64, radius: F64, looks: list[BallLook]) -> None:
    """Balls (n,) on a table of the kit, with their ways (T, n, 2); those that left are pale where they were last."""
    for i, look in enumerate(looks):
        there = np.flatnonzero(np.isfinite(place[:, i, 0]))
        if not len(there):
            continue
        draw_ghost(axes, place[there[0], i], float(radius[i]), look)
        draw_path(axes, place[:, i], look)
        left = there[-1] < len(place) - 1
        draw_ball(
            axes,
            place[there[-1], i],
            float(radius[i]),
            look,
            zorder=4 + i / len(looks),
            alpha=0.6 if left else 1.0,
        )


def _sheet(
    result: RunData, place: F64, radius: F64, axis: tuple[int, int], shape: Shape | None = None
) -> tuple[Figure, Axes]:
    """An empty sheet for balls of some radii (n,) that were at `place` (T, n, 2), m, with the walls near them at the end;
    with a table of the kit and without its walls if there is one.
    """
    from matplotlib.collections import LineCollection

    rim = radius[:, np.newaxis]
    low = np.nanmin(place - rim, axis=(0, 1), initial=np.inf)
    high = np.nanmax(place + rim, axis=(0, 1), initial=-np.inf)
    across, along = np.eye(3)[list(axis)]
    hidden = set() if shape is None else shape.walls
    if shape is not None:
        low, high = shape.box[0][:2], shape.box[1][:2]
    lines = [line for line in _walls(result, across, along) if _near(line, low, high)]
    edges = _edges(result, axis, low, high, hidden)
    middle, far = 0.5 * (low + high), 1.5 * float(np.max(high - low))
    for ends in edges:  # walls of about this size come into the view whole
        if (np.abs(ends - middle) < far).all():
            low, high = np.minimum(low, ends.min(axis=(0, 1))), np.maximum(high, ends.max(axis=(0, 1)))
    for point, direction in lines:  # its place nearest to the paths comes into the view
        foot = point + ((middle - point) @ direction) * direction
        low, high = np.minimum(low, foot), np.maximum(high, foot)
    # What is flatter than the sheet has room above and below within the axes, not around them.
    lacking = np.array([0.0, 0.5 * max(0.0, FLATTEST * float((high - low)[0]) - float((high - low)[1]))])
    low, high = low - lacking, high + lacking
    margin = 0.03 * float(np.max(high - low))
    with styled():
        aspect = float(np.clip((high - low)[1] / max((high - low)[0], 1e-12), FLATTEST, TALLEST))
        height = width() * aspect + 1.15 if shape is None else 0.92 * width() * aspect + 0.75  # no legend
        figure, head = sheet(height, result.title)
        axes = figure.subplots()
        axes.set_title(head, loc="left")
        axes.set_aspect("equal")
        for point, direction in lines:
            axes.axline(tuple(point), tuple(point + direction), color=GREY, linewidth=1.6, zorder=1)
        for ends in edges:
            axes.add_collection(
                LineCollection(list(ends), color=GREY, linewidth=0.8, zorder=1), autolim=False
            )
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_xlabel(f"${'xyz'[axis[0]]}$ (m)")
        axes.set_ylabel(f"${'xyz'[axis[1]]}$ (m)")
    return figure, axes


def _ends(axes: Axes, path: F64, radius: float, colour: str) -> None:
    """A ball where its path (T, 2) begins, outlined, and where it is at the end, filled; dotted where it left before."""
    from matplotlib.patches import Circle

    there = np.flatnonzero(np.isfinite(path[:, 0]))
    if not len(there):
        return
    first, last = path[there[0]], path[there[-1]]
    axes.add_patch(Circle(tuple(first), radius, fill=False, color=colour, linewidth=0.8, zorder=2))
    if there[-1] == len(path) - 1:
        axes.add_patch(Circle(tuple(last), radius, color=colour, alpha=0.45, linewidth=0, zorder=2))
    else:
        axes.add_patch(
            Circle(tuple(last), radius, fill=False, color=colour, linewidth=1.0, linestyle=":", zorder=2)
        )


def _crowd(result: RunData, names: list[str], columns: Any, axis: tuple[int, int], radius: F64) -> Chart:
    """The balls where each was last, seen from above, those that left dotted; those that never came are not there."""
    from matplotlib.collections import EllipseCollection

    last = np.full((len(names), 3), np.nan)
    for _, part in blocks(result, "position", columns, np.arange(len(result.time))[::-1]):
        for frame in part:
            if np.isfinite(last).all():
                break
            last = np.where(np.isfinite(last), last, frame)
    seen = np.flatnonzero(np.isfinite(last).all(axis=1))
    order = seen[np.argsort(last[seen] @ upward(result.gravity), kind="stable")]
    place, there = last[order][:, axis], np.asarray(result.present[-1])[columns][order]
    figure, axes = _sheet(result, place[np.newaxis], radius[order], axis)
    with styled():
        balls = EllipseCollection(
            *(2.0 * radius[order], 2.0 * radius[order], np.zeros(len(order))),
            units="xy",
            offsets=place,
            offset_transform=axes.transData,
            facecolors=np.where(there, COLOURS[0], "none"),
            edgecolors=np.where(there, "white", COLOURS[0]),
            linestyles=np.where(there, "-", ":"),
            linewidth=0.4,
            zorder=2,
        )
        axes.add_collection(balls)
    return Chart(
        figure,
        {
            "ball": np.array([names[i] for i in order]),
            **{f"{'xyz'[k]} (m)": place[:, j] for j, k in enumerate(axis)},
            "radius (m)": radius[order],
        },
    )


def _walls(result: RunData, across: F64, along: F64) -> list[tuple[F64, F64]]:
    """Planes without end that stand upright, as lines: a point at the last frame, and a direction."""
    found = []
    for wall in _left(result):
        if wall.shape != "plane":
            continue
        normal = rotated(wall.orientation[-1], np.asarray(wall.facts["normal"]))
        point = wall.position[-1]
        flat = np.array([normal @ across, normal @ along])
        size = float(np.linalg.norm(flat))
        if size > 0.99:
            found.append((np.array([point @ across, point @ along]), np.array([-flat[1], flat[0]]) / size))
    return found


def _left(result: RunData) -> list[Wall]:
    """The walls that are still there at the last frame."""
    return [wall for wall in result.walls.values() if bool(wall.present[-1])]


def _edges(result: RunData, axis: tuple[int, int], low: F64, high: F64, hidden: set[str]) -> list[F64]:
    """Of each wall that has an outline its lines (L, 2, 2), m, at the last frame, and those of a periodic box; of what has
    no end from `low` to `high` (2,), m.
    """
    walls = [
        wall
        for wall in _left(result)
        if wall.shape != "plane" and (wall.motion.moves or wall.name not in hidden)
    ]
    box = np.zeros((2, 3))
    box[:, list(axis)] = low, high
    found = [
        surface.placed(surface.wall.position[-1], surface.wall.orientation[-1])[surface.lines]
        for surface in surfaces(walls, box[0], box[1], upward(result.gravity))
    ]
    periodic = result.box(-1)
    if periodic is not None:
        found.append(periodic.tilted.corners(*box)[EDGES])
    return [lines[:, :, list(axis)] for lines in found]


def _near(line: tuple[F64, F64], low: F64, high: F64) -> bool:
    """Whether a line is not farther from the paths than they are wide."""
    point, direction = line
    normal = np.array([-direction[1], direction[0]])
    return abs(float((0.5 * (low + high) - point) @ normal)) < 1.5 * float(np.max(high - low))
