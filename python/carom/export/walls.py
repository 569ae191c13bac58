"""The walls of a run for ParaView: triangles that go along with their motion, each with the number of its wall."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Array
from carom.export.frames import Selection
from carom.show.surfaces import Surface, box, surfaces

#: Bytes of corners that are computed at a time.
PART_BYTES = 4 * 1024 * 1024


@dataclass(frozen=True)
class Walls:
    """Triangles (F, 3) of all walls, arrays of them (F,) by name, and where their corners are.

    Walls that are taken away come last, the first of them at the very end: what is there at a frame is the beginning of all
    triangles and of all corners.
    """

    triangles: Array
    cells: dict[str, Array]
    """`id`, that of the wall as contacts have it (`body_b`), and `material`, a number."""
    moves: bool
    """Whether any wall moves."""
    points: Callable[[slice], F64]
    """Corners (n, 3), m, at some of the chosen frames end to end."""
    corners: I64
    """How many corners are there at each chosen frame, (K,)."""
    faces: I64
    """The same of triangles."""

    def parts(self) -> Iterator[slice]:
        """The chosen frames some megabytes at a time; of walls at rest the first, which stands for all."""
        if not self.moves:
            yield slice(0, 1)
            return
        count = len(self.corners)
        size = max(1, PART_BYTES // (24 * (int(self.triangles.max()) + 1)))
        for first in range(0, count, size):
            yield slice(first, min(first + size, count))


def walls(selection: Selection) -> Walls | None:
    """The walls of a run, those without end cut at the box of the balls in all chosen frames; None without walls."""
    result = selection.result
    if not result.walls:
        return None
    low, high = box(selection)
    found = surfaces(list(result.walls.values()), low, high, -result.gravity)
    if not found:
        return None
    times = selection.time[np.array(selection.frames)]
    found.sort(key=lambda surface: -int(surface.wall.motion.there(times).sum()))
    there = np.stack([surface.wall.motion.there(times) for surface in found], axis=1)  # (K, W)
    corners = np.array([len(surface.vertices) for surface in found])
    faces = np.array([len(surface.faces) for surface in found])
    first = np.cumsum(corners) - corners
    poses = [_poses(surface, times) for surface in found]

    def points(part: slice) -> F64:
        placed = [
            surface.placed(position[part, None], orientation[part, None])
            for surface, (position, orientation) in zip(found, poses, strict=True)
        ]
        return np.concatenate(placed, axis=1)[np.repeat(there[part], corners, axis=1)]

    return Walls(
        np.concatenate([surface.faces + start for surface, start in zip(found, first, strict=True)]).astype(
            np.int64
        ),
        {
            "id": np.repeat([len(result.names) + surface.wall.index for surface in found], faces),
            "material": np.repeat([int(surface.wall.facts["material"]) for surface in found], faces),
        },
        any(surface.wall.motion.moves for surface in found),
        points,
        there @ corners,
        there @ faces,
    )


def _poses(surface: Surface, times: F64) -> tuple[F64, F64]:
    """Where the wall's point is (T, 3), m, and how it has turned (T, 4) at some times, s."""
    motion, point = surface.wall.motion, np.asarray(surface.wall.facts["point"], dtype=np.float64)
    return motion.position(point, times), motion.orientation(times)
