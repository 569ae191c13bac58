"""Pairs of balls that are near each other, in a time proportional to their number, with NumPy alone.

Balls are sorted into classes of similar reach. Those of one class lie in cubic cells as wide as twice its largest reach,
and every ball of the same or a smaller class looks into the 27 cells around it. Balls near a face of a periodic box have
images beyond the other face.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from carom.arrays import F64, I64
from carom.scene.packing.periodic import PeriodicBox

#: Gap over radius up to which bodies touch, unless it was larger while their contact was closed, as piles leave it within
#: their tolerance. Bodies that overlap touch.
TOUCHING = 1e-6

_SIDE = 1 << 20  # cells along an axis at most: three of them fit one integer
_AT_ONCE = 1 << 17  # balls whose neighbours are looked for at once: some 100 MB
_CANDIDATES = 1 << 20  # pairs that are compared at once, where a ball alone has no more: some 100 MB
_ALL = np.array(
    list(product((-1, 0, 1), repeat=2))
)  # columns of cells around one, by their steps along x and y
_HALF = _ALL[4:]  # the own one first


def pairs(position: F64, reach: F64, period: PeriodicBox | F64 | None = None) -> tuple[I64, I64]:
    """All pairs a < b whose centres are no further apart than the sum of their reaches, sorted by a, then b.

    `position` (N, 3) m, `reach` (N,) m; `period` is a periodic box, or its lengths (3,) m, 0 along other axes.
    Of a pair and its images the nearest counts.
    """
    n = len(position)
    if n < 2:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    owner = np.arange(n)
    box = PeriodicBox.of(period)
    if box is not None:
        position, owner = _with_images(position, float(reach.max()), box)
    first, second = _near(position, reach[owner], n)
    first, second = owner[first], owner[second]
    a, b = np.minimum(first, second), np.maximum(first, second)
    found = ascending((a * n + b)[a != b])  # a pair that is met across a face is met from both sides
    return found // n, found % n


def ascending(numbers: I64) -> I64:
    """The numbers in ascending order, each once: `np.unique`, which is slow by its hash table where there are millions."""
    ordered = np.sort(numbers)
    new = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=new[1:])
    return np.asarray(ordered[new])


def separation(delta: F64, period: PeriodicBox | F64 | None) -> F64:
    """Differences of positions (M, 3), to the nearest image in a periodic box."""
    box = PeriodicBox.of(period)
    return delta if box is None else box.nearest(delta)


def _with_images(position: F64, reach: float, box: PeriodicBox) -> tuple[F64, I64]:
    """The balls, brought into the box from its lowest position on, then the images that may touch them."""
    inside = np.array(position)
    owner = np.arange(len(position))
    vectors = box.vectors
    for axis in box.order:
        # An image along the gradient is displaced along the flow, which is folded after it.
        length, step, low = box.lengths[axis], vectors[axis], inside[:, axis].min()
        inside -= np.floor((inside[:, axis] - low) / length)[:, None] * step
        above = np.flatnonzero(inside[:, axis] < low + 2.0 * reach)
        below = np.flatnonzero(inside[:, axis] >= low + length - 2.0 * reach)
        inside = np.concatenate([inside, inside[above] + step, inside[below] - step])
        owner = np.concatenate([owner, owner[above], owner[below]])
    return inside, owner


def _near(position: F64, reach: F64, real: int) -> tuple[I64, I64]:
    """Pairs within reach of which one at least is among the first `real`; each once."""
    level = np.floor(np.log2(reach / reach.min())).astype(np.int64)
    low = position.min(axis=0)
    extent = float((position.max(axis=0) - low).max())
    found = []
    for size in np.unique(level):
        members = np.flatnonzero(level == size)
        smaller = np.flatnonzero(level < size)
        width = max(2.0 * float(reach[members].max()), np.finfo(float).tiny)
        cells = np.floor((position - low) / width) + 1.0  # a layer of empty cells around
        if extent > _SIDE * width:
            cells = np.stack([_closed_up(column) for column in cells.T], axis=1)
        cell = cells.astype(np.int64)
        sides = cell.max(axis=0) + 2
        keys = (cell[:, 0] * sides[1] + cell[:, 1]) * sides[2] + cell[:, 2]
        order = np.argsort(keys[members], kind="stable")
        members = members[order]
        sorted_keys = keys[members]
        for queries, same, first in _some(members, smaller):
            # Cells along z follow one another in the keys: a column of three is one range. Of one class the other half of
            # the columns sees these pairs from the other side.
            columns = _HALF if same else _ALL
            wanted = keys[queries] + ((columns[:, :1] * sides[1] + columns[:, 1:]) * sides[2])
            lo = np.searchsorted(sorted_keys, wanted - 1, side="left")
            hi = np.searchsorted(sorted_keys, wanted + 1, side="right")
            if same:
                lo[0] = np.arange(first + 1, first + len(queries) + 1)  # each pair of the own column once
            for some in _shares((hi - lo).sum(axis=0)):
                counts = (hi[:, some] - lo[:, some]).ravel()
                this = np.repeat(np.tile(queries[some], len(columns)), counts)
                start = np.repeat(lo[:, some].ravel() - (np.cumsum(counts) - counts), counts)
                other = members[start + np.arange(len(this))]
                delta = position[this] - position[other]
                limit = reach[this] + reach[other]
                near = np.einsum("ij,ij->i", delta, delta) <= limit * limit
                near &= (this < real) | (other < real)
                found.append((this[near], other[near]))
    return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def _some(members: I64, smaller: I64) -> Iterator[tuple[I64, bool, int]]:
    """Balls that look for others, `_AT_ONCE` at a time: whether they are of the class itself, and the place of the first."""
    for queries, same in ((members, True), (smaller, False)):
        for first in range(0, len(queries), _AT_ONCE):
            yield queries[first : first + _AT_ONCE], same, first


def _shares(counts: I64) -> Iterator[slice]:
    """Balls one after the other that have at most `_CANDIDATES` together, or one that has more."""
    ends, first = np.cumsum(counts), 0
    while first < len(counts):
        before = ends[first - 1] if first else 0
        end = max(first + 1, int(np.searchsorted(ends, before + _CANDIDATES, side="right")))
        yield slice(first, end)
        first = end


def _closed_up(cell: F64) -> F64:
    """Numbers of cells along an axis, from 1 on, with one empty cell in place of several."""
    values, place = np.unique(cell, return_inverse=True)
    return (1.0 + np.cumsum(np.minimum(np.diff(values, prepend=values[0]), 2.0)))[place]
