"""Results files that are open in this process, each once, whoever reads it.

HDF5 shows a file that is open already as it was when it was first opened, however much has been written since. So whoever
comes later opens it anew, and for all: the rows that earlier ones count are there as before.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, ParamSpec, TypeVar
from weakref import WeakSet, WeakValueDictionary

import h5py
import numpy as np

from carom.arrays import Array
from carom.files import Anchored
from carom.result.record.opening import column_of, open_results, read_rows

P = ParamSpec("P")
R = TypeVar("R")
_ALONE = threading.RLock()


def alone(method: Callable[P, R]) -> Callable[P, R]:
    """A function during which no other thread opens a file anew."""

    @functools.wraps(method)
    def with_lock(*args: P.args, **kwargs: P.kwargs) -> R:
        with _ALONE:
            return method(*args, **kwargs)

    return with_lock


class Shared:
    """A results file for all who read it."""

    _open: ClassVar[WeakValueDictionary[tuple[int, int], Shared]] = WeakValueDictionary()

    def __init__(self, path: Path) -> None:
        self._at, self._file = Anchored(path), open_results(path)
        self._readers: WeakSet[object] = WeakSet()

    @classmethod
    @alone
    def of(cls, path: Path, reader: object) -> Shared:
        """The file for one more reader, with what was written up to now."""
        try:
            about = path.stat()
        except OSError:
            return cls(path)  # says what is wrong
        found = cls._open.get((about.st_dev, about.st_ino))
        if found is None or not found._readers:
            found = cls._open[about.st_dev, about.st_ino] = cls(path)
        elif found._file and found._file.id.get_intent() & h5py.h5f.ACC_SWMR_READ:  # its writer may go on
            found._file.close()
        found._at = Anchored(path)
        found._readers.add(reader)
        return found

    @property
    def file(self) -> h5py.File:
        """As it is open now."""
        if not self._file:
            self._file = open_results(self._at.path)
        return self._file

    def leave(self, reader: object) -> None:
        """Close the file, if nobody else reads it."""
        self._readers.discard(reader)
        if not self._readers:
            self._file.close()


class Part:
    """A column of one file, of which `rows` rows count; it is found again where the file was opened anew."""

    def __init__(self, shared: Shared, key: str, rows: int) -> None:
        self._shared, self._key, self._rows = shared, key, rows
        self._in = shared.file
        self._dataset = column_of(self._in, key, rows)
        self.dtype, self.shape = np.dtype(self._dataset.dtype), tuple(self._dataset.shape)

    @property
    def dataset(self) -> h5py.Dataset:
        """The column in the file as it is open now."""
        if self._in is not self._shared.file:
            self._in = self._shared.file
            self._dataset = column_of(self._in, self._key, self._rows)
        return self._dataset

    @alone
    def __getitem__(self, rows: slice) -> Array:
        return read_rows(self.dataset, rows)
