"""Surfaces of triangles in NumPy: how far points are from them. For checks, the auditor and what a result tells of a mesh.

The core has this geometry in code of its own (`crates/carom-geom/src/mesh.rs`).
"""

from __future__ import annotations

from collections.abc import Iterator
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
ONE = 1e-5
"""Angle (rad), seen from a point, between places that are one, and from the normal of a triangle that the point is over."""
NEARER = 1e-12
"""Share by which a triangle has to be nearer than another one for that: rounding of distances; below the square of `ONE`."""


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

    def minima(self, x: F64, reach: F64) -> tuple[I64, I64, F64]:
        """Where the distance from points (N, 3) has local minima of up to `reach` (N,), m: there balls touch. Numbers of the
        points in rising order, parts as in the column `part` of results (planes before edges before corners), and places on
        the surface (K, 3).
        """
        point, triangle = self.near(x, reach)
        foot = self.closest(x[point], triangle)
        away = np.linalg.norm(x[point] - foot, axis=1)
        what = self._features(x[point], triangle, foot, away)
        order = np.lexsort((triangle, what, point))
        order = order[(away <= reach[point])[order]]
        point, triangle, what, foot, away = (
            point[order],
            triangle[order],
            what[order],
            foot[order],
            away[order],
        )
        # A place that a nearer triangle has as well is no minimum, and one that several have is one.
        kept = np.ones(len(point), dtype=bool)
        for i, j in _pairs_of_rows(point):
            gap = np.linalg.norm(foot[i] - foot[j], axis=1)
            kept[i[(j < i) & (gap < ONE * away[i])]] = False
            asked = np.flatnonzero((away[j] < away[i] * (1.0 - NEARER)) & kept[i])
            i, j = i[asked], j[asked]
            low, high = self.at[triangle[j]].min(axis=1), self.at[triangle[j]].max(axis=1)
            slack = 1e-9 * away[i]
            inside = ((foot[i] >= low - slack[:, None]) & (foot[i] <= high + slack[:, None])).all(axis=1)
            i, j, slack = i[inside], j[inside], slack[inside]
            off = np.linalg.norm(self.closest(foot[i], triangle[j]) - foot[i], axis=1)
            kept[i[off < slack]] = False
        return point[kept], (7 * triangle + what)[kept], foot[kept]

    def at_part(self, x: F64, part: I64, reach: F64) -> F64:
        """How far points (N, 3) are from where the surface is nearest to their feet on its parts (N,), which go on beyond
        their ends, (N,), m: from the parts where the points are over them. Infinite where no surface is within `reach` (N,),
        m, of a foot.
        """
        triangle, what = np.divmod(part, 7)
        start = np.maximum(what - 1, 0) % 3
        corner = self.at[triangle, start]
        along = self.at[triangle, (start + 1) % 3] - corner
        arm, normal = x - corner, self.normal[triangle]
        on_edge = (np.sum(arm * along, axis=1) / np.sum(along * along, axis=1))[:, None] * along
        on_plane = arm - np.sum(arm * normal, axis=1)[:, None] * normal
        foot = corner + np.select(
            [what[:, None] == 0, what[:, None] < 4], [on_plane, on_edge], np.zeros_like(arm)
        )
        found, least = np.full(len(x), np.inf), np.full(len(x), np.inf)
        for point, near in self._blocks(foot, reach):
            place = self.closest(foot[point], near)
            off = np.linalg.norm(place - foot[point], axis=1)
            order = np.lexsort((off, point))
            point, first = np.unique(point[order], return_index=True)
            first = order[first]
            better = off[first] < np.minimum(least[point], reach[point])
            point, first = point[better], first[better]
            least[point] = off[first]
            found[point] = np.linalg.norm(x[point] - place[first], axis=1)
        return found

    def _features(self, x: F64, triangle: I64, foot: F64, away: F64) -> I64:
        """What of triangles their places nearest to points are: 0 right below these, 1 to 3 on an edge, 4 to 6 a corner."""
        at = self.at[triangle]
        along = np.roll(at, -1, axis=1) - at
        length = np.linalg.norm(along, axis=2)
        arm, near = foot[:, None] - at, 1e-9 * length.max(axis=1, initial=0.0)[:, None]
        corner = np.linalg.norm(arm, axis=2) < near
        edge = np.linalg.norm(np.cross(along / length[:, :, None], arm), axis=2) < near
        beside = np.linalg.norm(np.cross(x - foot, self.normal[triangle]), axis=1) >= ONE * away
        kinds = [~beside, corner.any(axis=1), edge.any(axis=1)]
        return np.select(kinds, [0, 4 + corner.argmax(axis=1), 1 + edge.argmax(axis=1)], 0)

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
        some = np.flatnonzero(hi > lo)
        point, lo, count = point[some], lo[some], (hi - lo)[some]
        pairs: list[tuple[I64, I64]] = []
        for rows in _shares(count):
            of = np.repeat(point[rows], count[rows])
            both = np.unique(of * len(low) + owner[_ranges(lo[rows], count[rows])])
            pairs.append((both // len(low), both % len(low)))
        for k in wide.tolist():
            near = np.flatnonzero(
                ((x + reach[:, None] >= low[k]) & (x - reach[:, None] <= high[k])).all(axis=1)
            )
            pairs.append((near, np.full(len(near), k)))
        return pairs


def _shares(count: I64) -> list[I64]:
    """Rows cut such that their `count` (K,) sum up to some `BLOCK` in each share."""
    ends = np.cumsum(count)
    cuts = np.searchsorted(ends, np.arange(BLOCK, count.sum(), BLOCK))
    return [rows for rows in np.split(np.arange(len(count)), cuts) if len(rows)]


def _ranges(first: I64, count: I64) -> I64:
    """`count` numbers (K,) from `first` (K,) on, end to end."""
    ends = np.cumsum(count)
    return np.repeat(first - (ends - count), count) + np.arange(int(count.sum()))


def _pairs_of_rows(point: I64) -> Iterator[tuple[I64, I64]]:
    """All ordered pairs of rows that have the same number (K,); numbers rise. In shares."""
    _, first, count = np.unique(point, return_index=True, return_counts=True)
    first, count = np.repeat(first, count), np.repeat(count, count)
    for rows in _shares(count):
        yield np.repeat(rows, count[rows]), _ranges(first[rows], count[rows])


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
