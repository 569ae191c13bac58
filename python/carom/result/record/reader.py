"""Reads the segments of a run as one record: only what was committed, and only as much as is asked for."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate, zip_longest
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from carom.arrays import Array
from carom.errors import CaromError
from carom.files import Anchored
from carom.result.record.layout import MEANINGS, OPTIONAL, POSITIVE, STATIC, TEXTS, VALUES, Rows, tables
from carom.result.record.opening import (
    DAMAGED,
    attributes_of,
    damaged,
    first_rows,
    reaches,
    static_of,
    table_of,
    written,
)
from carom.result.record.shared import Part, Shared, alone

#: A column up to this size is read whole at first use: one read of 3000 frames is as cheap as a read of one.
CACHE_BYTES = 64 * 1024 * 1024


class Column(NDArrayOperatorsMixin):
    """A column of a table as a lazy array: reads what is indexed, acts as a NumPy array where one is needed.

    `column[10:20]`, `column[-1]`, `column[:, 0]`, `np.asarray(column)`, `2 * column` and the methods of an
    array (`column.max()`) give NumPy arrays. Small columns are read once and kept; a large one is read piece
    by piece.
    """

    def __init__(
        self,
        parts: Sequence[tuple[Any, int]],  # `Part`s or arrays, and how many of their rows count
        unit: str = "",
        owner: Segments | None = None,
        kept: list[Array] | None = None,
    ) -> None:
        # As long as a column is held its files stay open, even if nobody holds the result. What was read is kept by
        # the owner in `kept` and not here: they must not hold each other, or only the garbage collector frees them.
        self._owner = owner
        self._kept = [] if kept is None else kept
        self._parts = [(dataset, rows) for dataset, rows in parts if rows > 0]
        model = parts[0][0]
        self.dtype: np.dtype[Any] = model.dtype
        self.shape: tuple[int, ...] = (sum(rows for _, rows in self._parts), *model.shape[1:])
        self.unit = unit

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def nbytes(self) -> int:
        return self.size * self.dtype.itemsize

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[Any]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> Any:
        if self.nbytes <= CACHE_BYTES:
            return self._whole[key]
        first, *rest = key if isinstance(key, tuple) else (key,)
        if isinstance(first, (int, np.integer)):
            row = int(first) + (len(self) if first < 0 else 0)
            if not 0 <= row < len(self):
                raise IndexError(f"row {int(first)} of a column with {len(self)} rows")
            return self._rows(row, row + 1)[(0, *rest)]
        if isinstance(first, slice):
            start, stop, stride = first.indices(len(self))
            if stride > 0:
                return self._rows(start, max(start, stop), stride)[(slice(None), *rest)]
        return np.asarray(self)[key]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        whole = self._whole if self.nbytes <= CACHE_BYTES else self._rows(0, len(self))
        if dtype is not None and whole.dtype != dtype:
            return whole.astype(dtype)
        return whole.copy() if copy else whole

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        arrays = [np.asarray(i) if isinstance(i, Column) else i for i in inputs]
        return getattr(ufunc, method)(*arrays, **kwargs)

    def __getattr__(self, name: str) -> Any:
        # Methods of an array (max, mean, reshape ...); private names stay missing so that copying and
        # pickling behave.
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(np.asarray(self), name)

    def __reduce__(self) -> Any:
        # Files cannot be sent: what is in the column can.
        return type(self), ([(np.asarray(self), len(self))], self.unit)

    def __repr__(self) -> str:
        unit = f", unit {self.unit}" if self.unit not in ("", "1") else ""
        return f"<column of shape {self.shape}, {self.dtype}{unit}>"

    @property
    def _whole(self) -> Array:
        if not self._kept:
            whole = self._rows(0, len(self))
            whole.flags.writeable = False  # shared between all who index it
            self._kept.append(whole)
        return self._kept[0]

    def _rows(self, start: int, stop: int, stride: int = 1) -> Array:
        """Rows `start:stop:stride` over all segments."""
        pieces, offset = [], 0
        for part, rows in self._parts:
            low = max(start, offset)
            low += (start - low) % stride
            high = min(stop, offset + rows)
            if low < high:
                pieces.append(part[low - offset : high - offset : stride])
            offset += rows
        if not pieces:
            return np.empty((0, *self.shape[1:]), self.dtype)
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)


class Segments:
    """All segments of a run, opened for reading while they may still be written to. Row counts are those at
    opening; with `upto` rows beyond it do not count, as if a further segment began there.
    """

    @alone
    def __init__(self, paths: Sequence[Path], upto: Rows | None = None) -> None:
        if not paths:
            raise CaromError("results.h5 is missing")
        self._paths = [Anchored(path) for path in paths]
        self._shared = [Shared.of(path, self) for path in paths]
        firsts = [first_rows(file) for file in self._files]
        ends = firsts if upto is None else [*firsts, upto]
        # A later segment overrules every row from its start on, in all segments before it.
        self._limits = list(accumulate(reversed(ends), lambda later, end: Rows(*map(min, later, end))))[::-1]
        self._rows: list[Rows] = []
        for file, first, limit in zip_longest(self._files, firsts, self._limits[1 : len(paths) + 1]):
            whole = written(file)
            left = whole if limit is None else map(operator.sub, limit, first)
            self._rows.append(Rows(*(max(0, min(pair)) for pair in zip(whole, left, strict=True))))
        self._closed = False
        self._found: dict[tuple[str, str], tuple[list[tuple[Any, int]], str, list[Array]]] = {}

    def __reduce__(self) -> Any:
        # Who gets it opens the files anew; of a run that goes on it has the same rows.
        return type(self), ([path.whole for path in self._paths], self.rows)

    @property
    def _files(self) -> list[h5py.File]:
        return [shared.file for shared in self._shared]

    @property
    def rows(self) -> Rows:
        """Whole rows of each table over all segments."""
        return sum(self._rows, Rows())

    @property
    @alone
    def starts(self) -> dict[str, int]:
        """The names of the files, and after which step each begins."""
        return {
            Path(file.filename).name: int(attributes_of(file).get("start_step", 0)) for file in self._files
        }

    def lack(self, steps: int | None = None) -> str | None:
        """What says that rows are not there: each segment, and what `upto` stands for, begins where those before it end, the
        first at the start. With `steps` the rows must reach to that step.
        """
        names = list(self.starts)
        for k, (wanted, there) in enumerate(
            zip(self._limits, accumulate(self._rows, initial=Rows()), strict=False)
        ):
            if there != wanted:
                table = next(name for name in Rows._fields if getattr(there, name) != getattr(wanted, name))
                of = f"{getattr(wanted, table)} rows of {table} before {(*names, 'the checkpoint')[k]}"
                return _lack(of, getattr(there, table), names[:k])
        start = next(iter(self.starts.values()))
        if steps is not None and start + self.rows.steps < steps:
            return _lack(f"{steps - start} steps of the run", self.rows.steps, names)
        return None

    @property
    @alone
    def attributes(self) -> Mapping[str, Any]:
        """Attributes of the first segment: gravity, step, versions."""
        return attributes_of(self._files[0])

    @alone
    def columns(self, table: str) -> list[str]:
        """Names of the columns of a table; none of one that the run has not."""
        return _listed(self._files[0], table)

    @alone
    def column(self, table: str, name: str) -> Column:
        """One column over all segments."""
        found = self._found.get((table, name))
        if found is None:
            if self._closed:
                raise CaromError(f"the result is closed, and {name} was not read before")
            counts = [rows.values if (table, name) == VALUES else getattr(rows, table) for rows in self._rows]
            pieces = [
                Part(shared, f"{table}/{name}", n) for shared, n in zip(self._shared, counts, strict=True)
            ]
            try:
                unit = _text(pieces[0].dataset.attrs.get("unit", ""))
            except DAMAGED as error:
                raise damaged(self._files[0], f"/{table}/{name}: its unit", error) from error
            found = self._found[table, name] = (list(zip(pieces, counts, strict=True)), unit, [])
        parts, unit, kept = found
        return Column(parts, unit, self, kept)

    @alone
    def static(self, table: str) -> dict[str, Array]:
        """A table of what does not change (empty if there is none); text as an array of `str`."""
        group = table_of(self._files[0], table)
        if group is None:
            return {"name": np.zeros(0, dtype=object)}
        columns = {name: static_of(self._files[0], f"{table}/{name}", name in TEXTS) for name in group}
        if _known(table) - columns.keys() or len({len(values) for values in columns.values()}) > 1:
            raise damaged(self._files[0], f"/{table}", "its columns differ in length, or one is missing")
        for name in POSITIVE:
            if table == "bodies" and not np.all(np.isfinite(columns[name]) & (columns[name] > 0)):
                raise damaged(self._files[0], f"/{table}/{name}", "not all are above 0")
        return columns

    @alone
    def of_this_layout(self) -> None:
        """Raise if a segment was written before one of the columns there was: its own list has not got it."""
        for file in self._files:
            for table in tables(file):
                lost = sorted(_known(table) - set(_listed(file, table)))
                if lost:
                    raise CaromError(
                        f"{file.filename}: /{table} has no column {', '.join(lost)}: an older Carom wrote this run;"
                        " take that one, or run the scenario again"
                    )

    @alone
    def verify(self) -> None:
        """Raise if a part that counts cannot be read; where the values lie is looked at, the values are not."""
        self.of_this_layout()
        for table in STATIC:
            self.static(table)
        for table in tables(self._files[0]):
            for name in self.columns(table):
                for part, rows in self.column(table, name)._parts:
                    reaches(part.dataset, rows)

    def damage(self, place: str, cause: str) -> CaromError:
        """What is said of a table that contradicts itself."""
        return damaged(self._files[0], place, cause)

    @alone
    def close(self) -> None:
        """Close the files; what was read stays."""
        self._closed = True
        self._found = {
            key: ([(kept[0], len(kept[0]))], unit, kept)
            for key, (_, unit, kept) in self._found.items()
            if kept
        }
        for shared in self._shared:
            shared.leave(self)


def _lack(of: str, there: int, names: Sequence[str]) -> str:
    told = ", ".join(names) or "no file"
    return f"of the {of} {there} are in {told}: a results file was removed, replaced or cut (put it back if you can)"


def _known(table: str) -> set[str]:
    """The columns that a file of this layout has of a table."""
    return {key.removeprefix(f"{table}/") for key in MEANINGS if key.startswith(f"{table}/")} - OPTIONAL


def _listed(file: h5py.File, table: str) -> list[str]:
    """The columns that a file says a table has; none of one that it has not."""
    group = table_of(file, table)
    if group is None:
        return []
    try:
        return [_text(name) for name in group.attrs["columns"]]
    except DAMAGED as error:
        raise damaged(file, f"/{table}: its list of columns", error) from error


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)
