"""Surfaces of triangles in NumPy: how far points are from them. For checks, the auditor and what a result tells of a mesh.

The core has this geometry in code of its own (`crates/carom-geom/src/mesh.rs`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from carom.arrays import F64, I64

BLOCK = 1 << 20
"""Pairs of a point and a triangle that are looked at together: some 200 MB."""
CELLS = 64
"""Cells along each axis into which triangles are sorted by place."""
WIDE = 512
"""A triangle whose box covers more cells than this is compared with all points."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Points `vertices` (V, 3), m, and `corners` (T, 3), their numbers, counterclockwise seen from the front."""

    vertices: F64
    corners: I64

    @cached_property
    def at(self) -> F64:
        """Places of the corners (T, 3, 3), m."""
        found: F64 = self.vertices[self.corners]
        return found

    @cached_property
    def across(self) -> F64:
        """Vectors across the triangles (T, 3), to the front, twice as long as their areas, m^2."""
        a, b, c = np.moveaxis(self.at, 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def normal(self) -> F64:
        """Unit normals (T, 3), to the front."""
        found: F64 = self.across / np.linalg.norm(self.across, axis=1, keepdims=True)
        return found

    def closest(self, x: F64, triangle: I64) -> F64:
        """The point (K, 3) of one triangle (K,) each that is closest to a point (K, 3)."""
        a, b, c = np.moveaxis(self.at[triangle], 1, 0)
        best, least = np.empty_like(x), np.full(len(x), np.inf)
        for p, q in ((a, b), (b, c), (c, a)):  # the nearest point of each edge
            along = q - p
            share = np.clip(np.sum((x - p) * along, axis=1) / np.sum(along * along, axis=1), 0.0, 1.0)
            foot = p + share[:, None] * along
            away = np.sum((x - foot) ** 2, axis=1)
            best[away < least], least = foot[away < least], np.minimum(away, least)
        normal = self.normal[triangle]
        height = np.sum((x - a) * normal, axis=1)
        inside = np.ones(len(x), dtype=bool)
        for p, q in ((a, b), (b, c), (c, a)):
            inside &= np.sum(np.cross(normal, q - p) * (x - p), axis=1) >= 0.0
        best[inside] = (x - height[:, None] * normal)[inside]
        return best

    def distance(self, x: F64, reach: F64) -> F64:
        """How far points (N, 3) are from the surface, (N,), m; infinite where that is more than `reach` (N,), m."""
        found = np.full(len(x), np.inf)
        for point, triangle in self._blocks(x, reach):
            away = np.linalg.norm(x[point] - self.closest(x[point], triangle), axis=1)
            np.minimum.at(found, point, away)
        return np.where(found <= reach, found, np.inf)

    def nearest(self, x: F64) -> F64:
        """The points (N, 3) of the surface that are closest to points (N, 3)."""
        found = np.empty_like(x)
        every = np.arange(len(self.corners))
        for k, point in enumerate(x):
            feet = self.closest(np.broadcast_to(point, (len(every), 3)), every)
            found[k] = feet[np.argmin(np.sum((feet - point) ** 2, axis=1))]
        return found

    def near(self, x: F64, reach: F64) -> tuple[I64, I64]:
        """Pairs of points and of triangles whose boxes come within reach."""
        blocks = self._blocks(x, reach) or [(np.zeros(0, np.int64),) * 2]
        return np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])

    def _blocks(self, x: F64, reach: F64) -> list[tuple[I64, I64]]:
        """Pairs of points and of triangles whose boxes come within reach, in blocks."""
        low, high = self.at.min(axis=1), self.at.max(axis=1)
        origin, size = low.min(axis=0), float((high.max(axis=0) - low.min(axis=0)).max()) / CELLS
        width = max(size, float(np.median(reach)) if len(reach) else 0.0) or 1.0
        first = np.floor((low - origin) / width).astype(np.int64)
        last = np.floor((high - origin) / width).astype(np.int64)
        count = np.prod(last - first + 1, axis=1)
        wide = np.flatnonzero(count > WIDE)
        narrow = np.flatnonzero(count <= WIDE)
        cell, owner = _cells(first[narrow], last[narrow])
        order = np.argsort(cell, kind="stable")
        cell, owner = cell[order], narrow[owner[order]]
        begin = np.floor((x - reach[:, None] - origin) / width).astype(np.int64)
        end = np.floor((x + reach[:, None] - origin) / width).astype(np.int64)
        begin, end = np.clip(begin, -1, CELLS + 1), np.clip(end, -1, CELLS + 1)
        asked, point = _cells(begin, end)
        lo, hi = np.searchsorted(cell, asked), np.searchsorted(cell, asked, side="right")
        pairs: list[tuple[I64, I64]] = []
        held, full = [], 0
        for k in np.flatnonzero(hi > lo):
            held.append((np.full(hi[k] - lo[k], point[k]), owner[lo[k] : hi[k]]))
            full += len(held[-1][0])
            if full > BLOCK:
                pairs.append(_joined(held))
                held, full = [], 0
        if held:
            pairs.append(_joined(held))
        for k in wide:
            near = np.flatnonzero(
                ((x + reach[:, None] >= low[k]) & (x - reach[:, None] <= high[k])).all(axis=1)
            )
            pairs.append((near, np.full(len(near), k)))
        return pairs


def _joined(held: list[tuple[I64, I64]]) -> tuple[I64, I64]:
    """Pairs, each once."""
    both = np.unique(np.concatenate([np.stack(pair, axis=1) for pair in held]), axis=0)
    return both[:, 0], both[:, 1]


def _cells(first: I64, last: I64) -> tuple[I64, I64]:
    """Numbers of all cells of boxes from `first` to `last` (K, 3), and to which box each belongs."""
    sides = np.maximum(last - first + 1, 0)
    count = np.prod(sides, axis=1)
    owner = np.repeat(np.arange(len(first)), count)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    across = sides[owner]
    i, rest = np.divmod(place, across[:, 1] * across[:, 2]) if len(owner) else (place, place)
    j, k = np.divmod(rest, across[:, 2]) if len(owner) else (rest, rest)
    cell = first[owner] + np.stack([i, j, k], axis=1) + 2
    wide = CELLS + 8
    return (cell[:, 0] * wide + cell[:, 1]) * wide + cell[:, 2], owner
