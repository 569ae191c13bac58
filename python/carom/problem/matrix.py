"""Sparse matrices of contact problems: compressed rows in three NumPy arrays.

SciPy is not among the packages that Carom needs, so what is wanted here (products, transposes, the inverse of
a block diagonal matrix) is written on NumPy. SciPy's matrices are accepted wherever a matrix is: they are
recognised by their method `tocsr`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Array, connected
from carom.problem.errors import refuse
from carom.problem.given import of_contacts, reals

#: Terms of a product that are held at once (32 bytes each).
PRODUCT_TERMS = 4_000_000


@dataclass(frozen=True, eq=False)
class Csr:
    """An (m, n) matrix in canonical compressed rows: columns rise within a row and none occurs twice.

    Row `k` has its values in `data[indptr[k]:indptr[k+1]]` and their columns in the same part of `indices`. The
    arrays are read-only. Build one with `from_any`, `from_compressed` or `from_triplets`, which check.
    """

    indptr: I64  # (m + 1,)
    indices: I64  # (entries,)
    data: F64  # (entries,)
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        for array in (self.indptr, self.indices, self.data):
            array.setflags(write=False)

    @classmethod
    def from_triplets(
        cls, rows: Any, columns: Any, values: Any, shape: tuple[int, int], name: str = "W"
    ) -> Csr:
        """From row, column and value of each entry, in any order; entries of the same place are summed."""
        r, c = _indices(rows, name), _indices(columns, name)
        x = reals(values, name, 1)
        if not len(r) == len(c) == len(x):
            cause = f"{len(r)} row indices, {len(c)} column indices and {len(x)} values"
            raise refuse(name, cause, "an entry has one of each")
        for what, index, bound in (("row", r, shape[0]), ("column", c, shape[1])):
            if len(index) and (index.min() < 0 or index.max() >= bound):
                bad = int(index[(index < 0) | (index >= bound)][0])
                limit = f"{what}s are 0 to {bound - 1}" if bound else f"there are no {what}s"
                raise refuse(name, f"{what} index {bad} is out of range", limit)
        key = r * max(shape[1], 1) + c
        if len(key) and not bool(np.all(key[1:] > key[:-1])):
            order = np.argsort(key, kind="stable")
            key, r, c, x = key[order], r[order], c[order], x[order]
            first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
            r, c, x = r[first], c[first], np.add.reduceat(x, first)
        indptr = np.concatenate([[0], np.cumsum(np.bincount(r, minlength=shape[0]))]).astype(np.int64)
        return cls(indptr, c, x, (int(shape[0]), int(shape[1])))

    @classmethod
    def from_compressed(
        cls,
        starts: Any,
        indices: Any,
        values: Any,
        shape: tuple[int, int],
        *,
        by: str = "rows",
        name: str = "W",
    ) -> Csr:
        """From compressed rows, or with `by="columns"` from compressed columns (indices are rows then).

        `indices` and `values` may be longer than what `starts` speaks of; the rest is not read.
        """
        lines = shape[0] if by == "rows" else shape[1]
        p = _indices(starts, name)
        if len(p) != lines + 1:
            raise refuse(name, f"{len(p)} starts of {lines} {by}", f"there must be {lines + 1}")
        if p[0] != 0 or np.any(np.diff(p) < 0):
            raise refuse(name, f"the starts of its {by} do not rise from 0", "the matrix is damaged")
        entries = int(p[-1])
        i, x = _indices(indices, name), reals(values, name, 1)
        if min(len(i), len(x)) < entries:
            cause = f"{entries} entries announced, {len(i)} indices and {len(x)} values there"
            raise refuse(name, cause, "the matrix is damaged")
        line = np.repeat(np.arange(lines), np.diff(p))
        r, c = (line, i[:entries]) if by == "rows" else (i[:entries], line)
        return cls.from_triplets(r, c, x[:entries], shape, name)

    @classmethod
    def from_any(cls, matrix: Any, name: str = "W") -> Csr:
        """From a `Csr`, a SciPy sparse matrix or array of any format, or whatever NumPy makes an array of."""
        if isinstance(matrix, Csr):
            return matrix
        if hasattr(matrix, "tocsr"):
            csr = matrix.tocsr()
            rows, columns = (int(k) for k in csr.shape)
            return cls.from_compressed(csr.indptr, csr.indices, csr.data, (rows, columns), name=name)
        dense = reals(matrix, name, 2)
        height, width = dense.shape
        values = dense.reshape(-1)
        at = np.flatnonzero(values)
        r, c = np.divmod(at, max(width, 1))
        return cls.from_triplets(r, c, values[at], (height, width), name)

    @cached_property
    def rows(self) -> I64:
        """(entries,) row of every entry."""
        return np.repeat(np.arange(self.shape[0]), np.diff(self.indptr))

    @property
    def entries(self) -> int:
        """How many entries are stored."""
        return len(self.data)

    @cached_property
    def transpose(self) -> Csr:
        """The (n, m) transpose."""
        return Csr.from_triplets(self.indices, self.rows, self.data, (self.shape[1], self.shape[0]))

    def plus(self, other: Csr, factor: float = 1.0) -> Csr:
        """`self + factor * other`, of the same shape."""
        rows, columns = (self.rows, other.rows), (self.indices, other.indices)
        values = np.concatenate((self.data, factor * other.data))
        return Csr.from_triplets(np.concatenate(rows), np.concatenate(columns), values, self.shape)

    @property
    def symmetric(self) -> Csr:
        """The symmetric part: products leave a rounding on one side of the diagonal that the other has not."""
        both = self.plus(self.transpose)
        return Csr(both.indptr, both.indices, 0.5 * both.data, self.shape)

    def places(self, rows: I64) -> tuple[I64, I64]:
        """(K,) where the entries of some rows stand, row after row, and (len(rows),) how many each has."""
        counts = np.diff(self.indptr)[rows]
        return np.arange(counts.sum()) + np.repeat(
            self.indptr[rows] - (np.cumsum(counts) - counts), counts
        ), counts

    def diagonal(self) -> F64:
        """(min(m, n),) diagonal, 0 where nothing is stored."""
        out = np.zeros(min(self.shape))
        on = self.rows == self.indices
        out[self.indices[on]] = self.data[on]
        return out

    def to_dense(self) -> F64:
        """(m, n) array."""
        out = np.zeros(self.shape)
        out[self.rows, self.indices] = self.data
        return out

    def to_scipy(self) -> Any:
        """The same as `scipy.sparse.csr_array`, where SciPy is installed."""
        from scipy.sparse import csr_array

        return csr_array((self.data.copy(), self.indices.copy(), self.indptr.copy()), shape=self.shape)

    def dot(self, vector: F64) -> F64:
        """(m,) product with an (n,) vector; terms of a row are summed from left to right."""
        terms = self.data * vector[self.indices]
        # Of no terms at all bincount gives whole numbers.
        return np.bincount(self.rows, terms, self.shape[0]).astype(np.float64, copy=False)

    def __matmul__(self, vector: F64) -> F64:
        """`W @ r` with an (n,) vector."""
        return self.dot(of_contacts(vector, "vector", self.shape[1], 1))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """Dense, for `numpy.asarray`."""
        return self.to_dense() if dtype is None else self.to_dense().astype(dtype)

    def multiply(self, other: Csr) -> Csr:
        """The product `self @ other`, in groups of rows that keep the terms below `PRODUCT_TERMS`."""
        if self.shape[1] != other.shape[0]:
            raise ValueError(f"a product of {self.shape} and {other.shape}")
        shape = (self.shape[0], other.shape[1])
        counts = np.diff(other.indptr)[self.indices]  # terms that each entry of self gives
        before = np.concatenate([[0], np.cumsum(counts)])[self.indptr]  # terms before each row
        parts: list[Csr] = []
        row = 0
        while row < shape[0]:
            end = int(np.searchsorted(before, before[row] + PRODUCT_TERMS, side="right")) - 1
            end = min(max(end, row + 1), shape[0])
            part = slice(int(self.indptr[row]), int(self.indptr[end]))
            source, n = other.places(self.indices[part])
            values = np.repeat(self.data[part], n) * other.data[source]
            target = np.repeat(self.rows[part] - row, n)
            parts.append(Csr.from_triplets(target, other.indices[source], values, (end - row, shape[1])))
            row = end
        if not parts:
            return Csr.from_triplets([], [], [], shape)
        starts = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(part.indptr) for part in parts]))])
        return Csr(
            starts.astype(np.int64),
            np.concatenate([part.indices for part in parts]),
            np.concatenate([part.data for part in parts]),
            shape,
        )


def asymmetry(a: Csr) -> float:
    """Largest entry of `a - a^T` over the largest of `a`; 0 for an empty matrix."""
    largest = float(np.abs(a.data).max(initial=0.0))
    return float(np.abs(a.plus(a.transpose, -1.0).data).max()) / largest if largest > 0.0 else 0.0


def components(a: Csr) -> I64:
    """(n,) number of the block of each row of a square matrix whose blocks do not touch one another.

    Blocks are numbered in the order of their first rows.
    """
    found = connected(a.shape[0], a.rows, a.indices)
    return np.unique(found, return_inverse=True)[1].reshape(-1)


def blocks(a: Csr, label: I64) -> Iterator[tuple[I64, F64]]:
    """Rows (k, s) and dense values (k, s, s) of the blocks that `components` found in a, k of one size s together."""
    sizes = np.bincount(label, minlength=1)
    order = np.argsort(label, kind="stable")
    place = np.empty(len(label), dtype=np.int64)  # of a row within its block
    place[order] = np.arange(len(label)) - np.repeat(np.cumsum(sizes) - sizes, sizes)[: len(label)]
    of_entry = label[a.rows]
    for size in np.unique(sizes[sizes > 0]):
        mine = np.flatnonzero(sizes == size)
        slot = np.full(len(sizes), -1)
        slot[mine] = np.arange(len(mine))
        e = sizes[of_entry] == size
        dense = np.zeros((len(mine), size, size))
        dense[slot[of_entry[e]], place[a.rows[e]], place[a.indices[e]]] = a.data[e]
        yield order[np.flatnonzero(sizes[label[order]] == size)].reshape(len(mine), size), dense


def of_blocks(parts: Sequence[tuple[I64, F64]], shape: tuple[int, int], name: str = "W") -> Csr:
    """The matrix of such blocks."""
    rows = [np.repeat(members, members.shape[1], axis=1).reshape(-1) for members, _ in parts]
    columns = [np.tile(members, (1, members.shape[1])).reshape(-1) for members, _ in parts]
    values = [dense.reshape(-1) for _, dense in parts]
    if not parts:
        return Csr.from_triplets([], [], [], shape, name)
    return Csr.from_triplets(
        np.concatenate(rows), np.concatenate(columns), np.concatenate(values), shape, name
    )


def _indices(values: Any, name: str) -> I64:
    array = np.asarray(values)
    if array.ndim != 1:
        raise refuse(name, f"its indices have {array.ndim} dimensions", "they are a list")
    if array.dtype.kind not in "iu" and len(array):
        raise refuse(name, f"its indices are of type {array.dtype}", "they must be whole numbers")
    return array.astype(np.int64)
