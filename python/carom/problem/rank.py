"""Rank and nullity of W: where contacts are redundant, multipliers are not unique.

W falls into blocks that do not touch (islands). Singular values are counted block by block, against the largest
of all: exact up to `dense_rows` rows in a block. A larger block is cut into levels, each coupled to the next
only (breadth first from a row far outside), and eliminated level after level. By Sylvester's law of inertia the
Schur complements of W - s 1 together have as many negative eigenvalues as W has below s, so that two
eliminations count those between -s and s. In floating point that is an estimate, and is called so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64
from carom.problem.errors import refuse
from carom.problem.matrix import Csr, components

#: Consecutive levels are joined up to this many rows, below which elimination costs more in calls than in work.
JOINED_ROWS = 256
#: The widest level that is looked at (three dense matrices of this size).
MAX_LEVEL = 4000
#: An eigenvalue of a Schur complement below this part of the threshold is moved there: it would drown all others.
TINY = 1e-3


@dataclass(frozen=True)
class Rank:
    """Number of singular values of W above `rtol` times the largest, and of the others."""

    rank: int
    nullity: int
    rtol: float
    exact: bool
    """False if a block was too large for singular values: then both are estimates."""

    def __str__(self) -> str:
        about = "" if self.exact else ", estimated"
        return f"rank {self.rank} of {self.rank + self.nullity}, nullity {self.nullity}{about}"


def rank_of(w: Csr, rtol: float = 1e-10, dense_rows: int = 2000) -> Rank:
    """Rank of a square, (nearly) symmetric positive semidefinite matrix."""
    n = w.shape[0]
    if not 0.0 < rtol < 1.0:
        raise refuse("rtol", f"{rtol:g}", "it must be between 0 and 1")
    island = components(w)
    order = np.argsort(island, kind="stable")
    sizes = np.bincount(island, minlength=1)
    parts = np.split(order, np.cumsum(sizes)[:-1])
    spectra = [np.linalg.svd(_block(w, p, p), compute_uv=False) for p in parts if 0 < len(p) <= dense_rows]
    large = [p for p in parts if len(p) > dense_rows]
    largest = max([float(s[0]) for s in spectra] + [_largest(w) if large else 0.0])
    found = sum(int(np.count_nonzero(s > rtol * largest)) for s in spectra)
    found += sum(_eliminate(w, p, rtol * largest) for p in large)
    return Rank(found, n - found, rtol, not large)


def _block(w: Csr, rows: I64, columns: I64) -> F64:
    """(len(rows), len(columns)) dense part of w."""
    at = np.full(w.shape[1], -1)
    at[columns] = np.arange(len(columns))
    source, counts = w.places(rows)
    target = at[w.indices[source]]
    there = target >= 0
    out = np.zeros((len(rows), len(columns)))
    out[np.repeat(np.arange(len(rows)), counts)[there], target[there]] = w.data[source[there]]
    return out


def _largest(w: Csr) -> float:
    """Largest eigenvalue by 50 steps of the power method: enough for a threshold of many decades."""
    v = np.cos(np.arange(w.shape[0]) + 1.0)  # any start without a pattern, the same every time
    value = 0.0
    for _ in range(50):
        v /= np.linalg.norm(v)
        v = w.dot(v)
        value = float(np.linalg.norm(v))
        if value == 0.0:
            break
    return value


def _levels(w: Csr, rows: I64) -> list[I64]:
    """The rows of a block by their distance from one that is far outside."""
    start = int(rows[0])
    levels: list[I64] = []
    for _ in range(2):
        seen = np.zeros(w.shape[0], dtype=bool)
        front = np.array([start])
        seen[front] = True
        levels = []
        while len(front):
            levels.append(front)
            reached = np.unique(w.indices[w.places(front)[0]])
            front = reached[~seen[reached]]
            seen[front] = True
        start = int(levels[-1][0])
    joined = [levels[0]]
    for level in levels[1:]:
        if len(joined[-1]) + len(level) <= JOINED_ROWS:
            joined[-1] = np.concatenate([joined[-1], level])
        else:
            joined.append(level)
    return joined


def _eliminate(w: Csr, rows: I64, cut: float) -> int:
    """Rank of one large block: its rows less the eigenvalues between -cut and cut."""
    symmetric = w.symmetric
    levels = _levels(symmetric, rows)
    widest = max(map(len, levels))
    if widest > MAX_LEVEL:
        cause = f"{widest} rows of it must be looked at together"
        raise refuse("W", cause, f"a rank is estimated up to {MAX_LEVEL}")
    return len(rows) - _below(symmetric, levels, cut) + _below(symmetric, levels, -cut)


def _below(symmetric: Csr, levels: list[I64], value: float) -> int:
    """How many eigenvalues of a block are below `value`: negative ones of the Schur complements of W - value 1."""
    found = 0
    reduction: F64 | float = 0.0
    for here, following in zip(levels, [*levels[1:], None], strict=True):
        a = _block(symmetric, here, here) - value * np.eye(len(here)) - reduction
        values, vectors = np.linalg.eigh(0.5 * (a + a.T))
        found += int(np.count_nonzero(values < 0.0))
        if following is not None:
            coupling = vectors.T @ _block(symmetric, here, following)
            safe = np.where(np.abs(values) < TINY * abs(value), TINY * abs(value), values)
            reduction = coupling.T @ (coupling / safe[:, None])
    return found
