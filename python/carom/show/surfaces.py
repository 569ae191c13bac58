"""Walls as triangles: what the live view draws, what films show and what ParaView gets.

A wall is described by its row of `result.planes` or of `/walls` (`Wall.facts`). Its triangles are relative to
its point, where it is at the start; a wall that moves carries them along. Seen from where the balls live, corners go round
counter-clockwise. What has no end ends a little beyond the box of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from carom.arrays import F64
from carom.scene.assembly.rotations import rotated
from carom.scene.assembly.triangles import Triangles
from carom.show.facing import facing

if TYPE_CHECKING:
    from carom.export.frames import Selection
    from carom.result.walls import Wall

Faces = npt.NDArray[np.int32]

#: Sides of a circle, a multiple of `MERIDIANS`, and rings of a sphere from pole to pole.
ROUND = 72
RINGS = 36
#: Lines along what is round, by which its turning shows.
MERIDIANS = 12
#: Cosine of the angle of two directions from which on they count as parallel.
PARALLEL = 0.999
#: Cosine of the angle between two triangles of a mesh up to which the edge between them is drawn.
CREASE = 0.95


@dataclass(frozen=True)
class Surface:
    """A wall as `vertices` (V, 3), m, relative to its point, `faces` (F, 3) and `lines` (L, 2), both of indices.

    The lines are the outline and, of what is round, some along it.
    """

    wall: Wall
    vertices: F64
    faces: Faces
    lines: Faces

    def placed(self, position: F64, orientation: F64) -> F64:
        """The vertices (V, 3), m, where the wall's point is at `position` (3,) and it has turned by a quaternion (4,); of
        many, (K, 1, 3) and (K, 1, 4), all of them (K, V, 3).
        """
        return position + rotated(orientation, self.vertices)


def surfaces(
    walls: Sequence[Wall],
    low: F64,
    high: F64,
    up: F64,
    closed: Sequence[bool] = (False, False, False),
) -> list[Surface]:
    """The triangles of all walls around balls that stay within the box from `low` to `high`, (3,) each, m.

    Planes without end are cut where others stand on them: those at rest by those at rest, moving ones by all, where they are
    at the start. `up` is against gravity, any length: planes reach beyond the box to the sides, not upwards, and not along
    the axes that are `closed`.
    """
    planes = [wall for wall in walls if wall.shape == "plane"]
    low, high = room(planes, low, high, up, closed)
    found = []
    for wall in walls:
        cuts = [
            other.facts
            for other in planes
            if other is not wall and (wall.motion.moves or not other.motion.moves)
        ]
        if wall.mesh is not None:
            vertices = wall.mesh.vertices - np.asarray(wall.facts["point"])
            found.append(Surface(wall, vertices, facing(wall).astype(np.int32), sharp_edges(wall.mesh)))
            continue
        vertices, faces = wall_mesh(wall.shape, wall.facts, low, high, cuts if wall.shape == "plane" else ())
        if len(faces):
            found.append(Surface(wall, vertices, faces, _lines(wall.shape, vertices)))
    return found


def room(planes: Sequence[Wall], low: F64, high: F64, up: F64, closed: Sequence[bool]) -> tuple[F64, F64]:
    """The box that planes fill: that of the balls, out to walls that are near enough to matter, else with a margin."""
    extent = float((high - low).max())
    level = 1.0 - np.abs(_unit(up)) if np.any(up) else np.ones(3)
    margin = np.where(closed, 0.0, 0.12 * extent * level)
    ends = [low - margin, high + margin]
    for wall in planes:
        normal = _unit(np.asarray(wall.facts["normal"], dtype=np.float64))
        k = int(np.argmax(np.abs(normal)))
        if wall.motion.moves or closed[k] or abs(normal[k]) < PARALLEL:
            continue
        side = 0 if normal[k] > 0 else 1
        place, edge = float(wall.facts["point"][k]), (low, high)[side][k]
        if abs(place - edge) < 1.5 * extent:
            ends[side][k] = place
    return ends[0], ends[1]


def wall_mesh(
    shape: str, facts: Mapping[str, Any], low: F64, high: F64, cuts: Sequence[Mapping[str, Any]] = ()
) -> tuple[F64, Faces]:
    """Vertices (V, 3) relative to the wall's point, m, and faces (F, 3), none where `cuts` leave nothing of a plane.

    What has no end reaches as far as the box from `low` to `high`, (3,) each, m, demands; a plane ends at the planes `cuts`
    too, of which the side of the balls is kept.
    """
    point = np.asarray(facts["point"], dtype=np.float64)
    normal = facts["normal"] if shape == "plane" else facts.get("axis")
    axis = (
        np.array([0.0, 0.0, 1.0])
        if normal is None or not np.isfinite(normal).all()
        else _unit(np.asarray(normal, dtype=np.float64))
    )
    if shape == "rectangle":
        u = _unit(np.asarray(facts["side"], dtype=np.float64))
        return _fan(
            _corners(u, np.cross(axis, u), -np.asarray(facts["size"]) / 2, np.asarray(facts["size"]) / 2)
        )
    frame = _frame(axis)
    if shape == "plane":
        flat = (_box_corners(low, high) - point) @ frame[:2].T
        polygon = _corners(frame[0], frame[1], flat.min(axis=0), flat.max(axis=0))
        return _fan(_cut(polygon, point, axis, cuts))
    radius = float(facts["radius"])
    length = float(facts.get("length", np.nan))
    if shape == "disc":
        hole = float(facts.get("hole", np.nan))
        # From the rim inwards, so that the side of the normal is that of the balls.
        rings, height = np.array([radius, hole if np.isfinite(hole) else 0.0]), np.zeros(2)
    elif shape == "sphere":
        angle = np.linspace(np.pi, 0.0, RINGS + 1)
        rings, height = radius * np.sin(angle), radius * np.cos(angle)
    elif shape == "cone":
        rings, height = np.array([radius, float(facts["radius_end"])]), np.array([0.0, length])
    elif np.isfinite(length):
        rings, height = np.full(2, radius), np.array([-length / 2, length / 2])
    else:
        along = (_box_corners(low, high) - point) @ axis
        rings, height = np.full(2, radius), np.array([along.min(), along.max()])
    vertices, faces = revolved(rings, height, frame, ROUND)
    return vertices, faces[:, ::-1] if shape != "disc" and facts.get("inside") else faces


def revolved(radius: F64, height: F64, frame: F64, sides: int) -> tuple[F64, Faces]:
    """A profile turned about the third row of `frame`; normals point away from the axis if the height grows."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = radius[:, np.newaxis, np.newaxis] * (ring @ frame[:2])[np.newaxis]
    vertices = (flat + height[:, np.newaxis, np.newaxis] * frame[2]).reshape(-1, 3)
    faces = []
    for k in range(len(radius) - 1):
        a = k * sides + np.arange(sides)
        b = k * sides + (np.arange(sides) + 1) % sides
        faces += [np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)]
    return vertices, np.concatenate(faces).astype(np.int32)


def _unit(vector: F64) -> F64:
    found: F64 = vector / np.linalg.norm(vector)
    return found


def _frame(axis: F64) -> F64:
    """Rows u, v and the axis, right-handed; u along x, y or z as far as it can be."""
    k = int(np.argmin(np.abs(axis)))
    u = _unit(np.eye(3)[k] - axis[k] * axis)
    return np.stack([u, np.cross(axis, u), axis])


def _box_corners(low: F64, high: F64) -> F64:
    """The corners of a box, (8, 3)."""
    return np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])


def _corners(u: F64, v: F64, low: Any, high: Any) -> F64:
    """A rectangle (4, 3) about the point, from its lowest to its highest coordinates along u and v."""
    around = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    return np.array([a * u + b * v for a, b in around])


def _cut(polygon: F64, point: F64, normal: F64, cuts: Sequence[Mapping[str, Any]]) -> F64:
    """What is left of a convex polygon, (n, 3) relative to `point`, on the free sides of other planes."""
    for other in cuts:
        direction = _unit(np.asarray(other["normal"], dtype=np.float64))
        if abs(direction @ normal) > PARALLEL:
            continue
        gap = (polygon + point - np.asarray(other["point"])) @ direction
        # An edge of the other plane that is already there must not shed a sliver by rounding.
        gap[np.abs(gap) < 1e-12 * np.abs(polygon).max(initial=0.0)] = 0.0
        kept = []
        for k in range(len(polygon)):
            after = (k + 1) % len(polygon)
            if gap[k] >= 0.0:
                kept.append(polygon[k])
            if gap[k] * gap[after] < 0.0:
                share = gap[k] / (gap[k] - gap[after])
                kept.append(polygon[k] + share * (polygon[after] - polygon[k]))
        polygon = np.array(kept).reshape(-1, 3)
    return polygon


def _fan(polygon: F64) -> tuple[F64, Faces]:
    """A convex polygon as triangles."""
    last = np.arange(2, max(2, len(polygon)))
    return polygon, np.stack([np.zeros_like(last), last - 1, last], axis=1).astype(np.int32)


def _lines(shape: str, vertices: F64) -> Faces:
    """Pairs of vertices of the outline and of the lines along what is round."""
    if shape in ("plane", "rectangle"):
        corner = np.arange(len(vertices))
        return np.stack([corner, np.roll(corner, -1)], axis=1).astype(np.int32)
    rings = np.arange(len(vertices)).reshape(-1, ROUND)
    # A sphere has no rim, but an equator.
    circles = [rings[len(rings) // 2]] if shape == "sphere" else [rings[0], rings[-1]]
    found = [np.stack([ring, np.roll(ring, -1)], axis=1) for ring in circles]
    along = rings[:, :: ROUND // MERIDIANS]
    found.append(np.stack([along[:-1].ravel(), along[1:].ravel()], axis=1))
    return np.concatenate(found).astype(np.int32)


def sharp_edges(mesh: Triangles) -> Faces:
    """The edges (L, 2) of a mesh where it ends or has a crease."""
    ends = np.sort(mesh.corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edge, number, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    of = np.repeat(np.arange(len(mesh.corners)), 3)[np.argsort(number.ravel(), kind="stable")]
    first = np.cumsum(count) - count
    other = of[np.minimum(first + 1, len(of) - 1)]
    bend = np.abs(np.sum(mesh.normal[of[first]] * mesh.normal[other], axis=1))
    found: Faces = edge[(count != 2) | (bend < CREASE)].astype(np.int32)
    return found


def box(selection: Selection) -> tuple[F64, F64]:
    """Lowest and highest corner, (3,) each, m, of what the balls take up in all frames."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for block in selection.blocks():
        stack = block.stack()
        if len(stack.body):
            position, radius = stack.quantities["position"], stack.quantities["radius"][:, None]
            low = np.minimum(low, (position - radius).min(axis=0))
            high = np.maximum(high, (position + radius).max(axis=0))
    if not np.isfinite(low).all():
        return np.zeros(3), np.ones(3)
    return low, high
