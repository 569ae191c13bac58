"""Which spheres overlap, in a time proportional to their number, with NumPy alone.

Spheres are sorted into classes of similar radius. Those of one class are put into cubic cells as wide as
their largest diameter, and every sphere of the same or a smaller class looks into the 27 cells around it.
Cells are found by a linear hash of their integer coordinates: neighbouring cells then differ by a constant,
and a collision only costs a test more.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from carom.arrays import F64, I64

_MULTIPLIERS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
_BLOCK = 1 << 20  # candidate pairs tested at once: about 100 MB, whatever the input

Overlap = tuple[int, int, float]
"""Two spheres (lower number first) and their gap, m, which is negative."""


def overlaps(
    position: F64,
    radius: F64,
    tolerance: float = 1e-9,
    most: int = 20,
    periods: Sequence[float] | None = None,
    together: I64 | None = None,
) -> list[Overlap]:
    """The first pairs found whose gap is below `-tolerance` times the smaller radius, at most about `most` of
    them.

    The search ends early once it has `most`: spheres that do not overlap cannot crowd a cell, so a crowded
    cell (which would make the search slow) always ends it. `position` (N, 3) and `radius` (N,), both finite,
    m. `periods` (3,) m are those of a periodic world, 0 along axes without: then balls also meet the images of others.
    Of the spheres with the same number in `together` (N,), if it is not negative, no overlap counts.
    """
    if together is None:
        together = np.full(len(radius), -1)
    if periods is not None and any(periods):
        return _across_periods(position, radius, tolerance, most, periods, together)
    found: list[Overlap] = []
    size_class = (
        np.floor(np.log2(radius / radius.min())).astype(np.int64) if len(radius) else np.zeros(0, np.int64)
    )
    for level in np.unique(size_class):
        members = np.flatnonzero(size_class == level)
        smaller = np.flatnonzero(size_class < level)
        width = 2.0 * float(radius[members].max())
        keys = _keys(position[members], width)
        order = np.argsort(keys, kind="stable")
        members, keys = members[order], keys[order]
        cells, first = np.unique(keys, return_index=True)
        last = np.append(first[1:], len(keys))
        for queries, same in ((members, True), (smaller, False)):
            if len(queries) == 0:
                continue
            query_keys = _keys(position[queries], width)
            for shift in product((-1, 0, 1), repeat=3):
                if same and shift < (0, 0, 0):
                    continue  # the other half sees these pairs from the other side
                moved = query_keys + _hash(np.array(shift, dtype=np.int64)[None, :])
                cell = np.minimum(np.searchsorted(cells, moved), len(cells) - 1)
                here = cells[cell] == moved
                lo = np.where(here, first[cell], 0)
                hi = np.where(here, last[cell], 0)
                if same and shift == (0, 0, 0):
                    lo = np.maximum(lo, np.arange(1, len(queries) + 1))  # each pair of the cell once
                found += _touching(
                    queries, members, lo, np.maximum(hi, lo), position, radius, tolerance, most, together
                )
                if len(found) >= most:
                    return sorted(found)[:most]
    return sorted(found)


def _across_periods(
    position: F64, radius: F64, tolerance: float, most: int, periods: Sequence[float], together: I64
) -> list[Overlap]:
    """As `overlaps`, for periods of at least four radii: balls near a border get an image beyond the other one."""
    wrapped, owner = position.copy(), np.arange(len(radius))
    reach = 2.0 * float(radius.max(initial=0.0))
    for k, period in enumerate(periods):
        if period > 0:
            wrapped[:, k] -= period * np.floor(wrapped[:, k] / period)
            near = np.flatnonzero(wrapped[:, k] < reach)
            images = wrapped[near]
            images[:, k] += period
            wrapped, owner = np.concatenate([wrapped, images]), np.concatenate([owner, owner[near]])
    found: dict[tuple[int, int], float] = {}
    for i, j, gap in overlaps(wrapped, radius[owner], tolerance, 8 * most, None, together[owner]):
        a, b = sorted((int(owner[i]), int(owner[j])))
        found[a, b] = gap
    return [(a, b, gap) for (a, b), gap in sorted(found.items())][:most]


def _touching(
    queries: I64,
    members: I64,
    lo: I64,
    hi: I64,
    position: F64,
    radius: F64,
    tolerance: float,
    most: int,
    together: I64,
) -> list[Overlap]:
    """Overlaps of each query with the members lo..hi of its cell."""
    found: list[Overlap] = []
    counts = hi - lo
    ends = np.cumsum(counts)
    total = int(ends[-1])
    for block in range(0, total, _BLOCK):
        pair = np.arange(block, min(block + _BLOCK, total))
        row = np.searchsorted(ends, pair, side="right")
        other = members[lo[row] + pair - (ends[row] - counts[row])]
        this = queries[row]
        distance = np.sqrt(((position[this] - position[other]) ** 2).sum(axis=1))
        gap = distance - radius[this] - radius[other]
        deep = gap < -tolerance * np.minimum(radius[this], radius[other])
        deep &= (together[this] < 0) | (together[this] != together[other])
        for k in np.flatnonzero(deep)[:most]:
            a, b = sorted((int(this[k]), int(other[k])))
            found.append((a, b, float(gap[k])))
        if len(found) >= most:
            break
    return found


def _keys(position: F64, width: float) -> NDArray[np.uint64]:
    cell = np.clip(np.floor(position / width), -(2.0**60), 2.0**60)
    return _hash(cell.astype(np.int64))


def _hash(cell: I64) -> NDArray[np.uint64]:
    hashed: NDArray[np.uint64] = (cell.astype(np.uint64) * _MULTIPLIERS).sum(axis=1, dtype=np.uint64)
    return hashed
