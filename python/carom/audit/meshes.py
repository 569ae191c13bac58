"""Meshes as the auditor sees them: planes, lines and points that balls touch, each a wall of its own behind all others.

What of a mesh a ball touches is where its distance has a local minimum: over a flat piece, at an edge or a tip. Rows of
contacts and impacts say it by their `part`; that of balls near a mesh is found anew from its triangles.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carom.arrays import F64, I64
from carom.audit.surfaces import Surface
from carom.scene.assembly.triangles import Triangles

ALIKE = 1e-6
"""Directions, and places over the size of the mesh, that differ by less are those of one part."""


NEARER = 1e-12
"""Share by which a triangle has to be nearer than another one for that: rounding of distances."""
ACROSS = 1e-5
"""Angle (rad) from the normal up to which a place is over the triangle, not beside it; above the square root of `NEARER`."""


class Parts:
    """The parts of all meshes of a run that were met so far, as walls at the end of the list `walls`."""

    def __init__(self, walls: list[Surface], names: list[str], bodies: int) -> None:
        self.walls, self.names, self.bodies = walls, names, bodies
        self.owner = list(range(len(walls)))
        self.meshes = {w: wall for w, wall in enumerate(walls) if wall.mesh is not None}
        self._known: dict[tuple[int, str], list[tuple[F64, int]]] = {}
        self._coded: dict[tuple[int, int], int] = {}

    def of_rows(self, body: I64, part: I64) -> I64:
        """Bodies (K, 2) with parts in place of the meshes that rows name by their `part` (K,)."""
        body = body.copy()
        for w, wall in self.meshes.items():
            mesh = wall.mesh
            assert mesh is not None
            rows = np.flatnonzero(body[:, 1] == self.bodies + w)
            for code in np.unique(part[rows]).tolist():
                if 0 <= code < 7 * len(mesh.corners):
                    if (w, code) not in self._coded:
                        self._coded[w, code] = self._part(w, *divmod(code, 7))
                    body[rows[part[rows] == code], 1] = self.bodies + self._coded[w, code]
        return body

    def near(self, w: int, x: F64, reach: F64) -> tuple[I64, I64]:
        """Which places (K, 3), in the axes of the mesh `w`, may touch which walls within `reach` (K,)."""
        mesh = self.walls[w].mesh
        assert mesh is not None
        points, walls = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        point, triangle = mesh.near(x, reach)
        foot = mesh.closest(x[point], triangle)
        away = np.linalg.norm(x[point] - foot, axis=1)
        close = away <= reach[point]
        point, triangle, foot, away = point[close], triangle[close], foot[close], away[close]
        for k in np.unique(point):
            rows = np.flatnonzero(point == k)
            found = set()
            for i in rows:
                # Nearest where it is, unless a triangle that has the same point is nearer.
                there = np.broadcast_to(foot[i], (len(rows), 3))
                same = np.linalg.norm(mesh.closest(there, triangle[rows]) - foot[i], axis=1) < 1e-9 * away[i]
                if not np.any(same & (away[rows] < away[i] * (1.0 - NEARER))):
                    what = _feature(mesh, int(triangle[i]), foot[i], x[k])
                    found.add(self._part(w, int(triangle[i]), what))
            points.append(np.full(len(found), k))
            walls.append(np.array(sorted(found), dtype=np.int64))
        return np.concatenate(points), np.concatenate(walls)

    def _part(self, w: int, triangle: int, what: int) -> int:
        """The wall of a part, made where there is none: 0 the plane of a triangle, 1 to 3 its edges, 4 to 6 its corners."""
        wall, mesh = self.walls[w], self.walls[w].mesh
        assert mesh is not None
        at, size = mesh.at[triangle], float(np.abs(mesh.vertices).max(initial=0.0)) or 1.0
        shape: tuple[Any, ...]
        if what == 0:
            normal = mesh.normal[triangle]
            normal = normal * math.copysign(1.0, normal[np.argmax(np.abs(normal) > 0.5)])
            shape, point = ("sheet", normal), at[0]
            key = np.append(normal, (at[0] @ normal) / size)
        elif what < 4:
            p, along = at[what - 1], at[what % 3] - at[what - 1]
            along = along / np.linalg.norm(along)
            along = along * math.copysign(1.0, along[np.argmax(np.abs(along) > 0.5)])
            shape, point = ("cylinder", along, 0.0, math.inf, False), p
            key = np.concatenate([along, (p - along * (along @ p)) / size])
        else:
            shape, point = ("sphere", 0.0, False), at[what - 4]
            key = point / size
        known = self._known.setdefault((w, str(shape[0])), [])
        for other, number in known:
            if np.abs(other - key).max() < ALIKE:
                return number
        made = Surface(shape, point, wall.material, wall.motion)
        made.part, made.last = True, wall.last
        known.append((key, len(self.walls)))
        self.walls.append(made)
        self.owner.append(w)
        self.names.append(self.names[self.bodies + w])
        return len(self.walls) - 1


def _feature(mesh: Triangles, triangle: int, foot: F64, x: F64) -> int:
    """What of a triangle its point nearest to `x` is: 0 a place below it, 1 to 3 on an edge, 4 to 6 a corner."""
    arm = x - foot
    if np.linalg.norm(np.cross(arm, mesh.normal[triangle])) < ACROSS * np.linalg.norm(arm):
        return 0
    at = mesh.at[triangle]
    along = np.roll(at, -1, axis=0) - at
    length = np.linalg.norm(along, axis=1)
    corner = np.linalg.norm(foot - at, axis=1) < 1e-9 * length.max()
    if corner.any():
        return 4 + int(np.argmax(corner))
    off = np.linalg.norm(np.cross(along / length[:, None], foot - at), axis=1)
    edge = off < 1e-9 * length.max()
    return 1 + int(np.argmax(edge)) if edge.any() else 0
