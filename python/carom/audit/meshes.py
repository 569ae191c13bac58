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

ALIKE = 1e-6
"""Directions, and places over the size of the mesh, that differ by less are those of one part."""


class Parts:
    """The parts of all meshes of a run that were met so far, as walls at the end of the list `walls`."""

    def __init__(self, walls: list[Surface], names: list[str], bodies: int) -> None:
        self.walls, self.names, self.bodies = walls, names, bodies
        self.owner = list(range(len(walls)))
        self.meshes = {w: wall for w, wall in enumerate(walls) if wall.mesh is not None}
        self._known: dict[tuple[int, str], tuple[F64, list[int]]] = {}
        self._coded: dict[tuple[int, int], int] = {}

    def of_rows(self, body: I64, part: I64) -> I64:
        """Bodies (K, 2) with parts in place of the meshes that rows name by their `part` (K,)."""
        body = body.copy()
        for w, wall in self.meshes.items():
            mesh = wall.mesh
            assert mesh is not None
            rows = np.flatnonzero(body[:, 1] == self.bodies + w)
            rows = rows[(part[rows] >= 0) & (part[rows] < 7 * len(mesh.corners))]
            body[rows, 1] = self.bodies + self._walls(w, part[rows])
        return body

    def near(self, w: int, x: F64, reach: F64) -> tuple[I64, I64]:
        """Which places (K, 3), in the axes of the mesh `w`, may touch which walls within `reach` (K,)."""
        mesh = self.walls[w].mesh
        assert mesh is not None
        point, part, _ = mesh.minima(x, reach)
        found = self._walls(w, part)
        order = np.lexsort((found, point))
        return point[order], found[order]

    def _walls(self, w: int, part: I64) -> I64:
        """The walls of parts (K,) of the mesh `w`."""
        codes, of = np.unique(part, return_inverse=True)
        for code in codes.tolist():
            if (w, code) not in self._coded:
                self._coded[w, code] = self._part(w, *divmod(code, 7))
        return np.array([self._coded[w, code] for code in codes.tolist()], dtype=np.int64)[of]

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
        kind = w, str(shape[0])
        known, numbers = self._known.get(kind, (np.zeros((0, len(key))), []))
        same = np.flatnonzero(np.abs(known - key).max(axis=1) < ALIKE)
        if same.size:
            return numbers[int(same[0])]
        made = Surface(shape, point, wall.material, wall.motion)
        made.part, made.last = True, wall.last
        self._known[kind] = np.vstack([known, key]), [*numbers, len(self.walls)]
        self.walls.append(made)
        self.owner.append(w)
        self.names.append(self.names[self.bodies + w])
        return len(self.walls) - 1
