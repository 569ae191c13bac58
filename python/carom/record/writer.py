"""Writes one segment of a run (`results.h5`) so that a reader can open it at any moment, even after `kill
-9`.

The order is the whole idea: every dataset exists before single-writer-multiple-readers mode begins; rows go
in by batches; when they are out of our hands a row of `/commit` states how many of each table are whole.
Readers trust nothing else. No compression: it buys 10-16 % of the size for ten times the work
(docs/reference/results.md).
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, ClassVar

import h5py
import numpy as np
from numpy.typing import NDArray

from carom.files import RecordError, unwritable
from carom.record.layout import ENDS, FORMAT, MEANINGS, TEXTS, VALUES, Meaning, Rows, tables

Table = Mapping[str, Any]

#: A chunk of a dataset is as many whole rows as fit in this, at most MAX_CHUNK_ROWS; a frame of many bodies
#: is one chunk.
CHUNK_BYTES = 128 * 1024
MAX_CHUNK_ROWS = 4096
#: Rows wait in memory until there are this many bytes of them, or the oldest is this many seconds old.
BATCH_BYTES = 16 * 1024 * 1024
BATCH_SECONDS = 1.0


class Writer:
    """The writer of one segment. Blocks are appended; `commit` makes what was appended durable for readers.

    `bodies`, `planes` and, if there are others, `walls` are the static tables (name, radius, ...). `first` counts the rows
    of the whole run before this segment: what earlier segments hold beyond it was written after the
    checkpoint from which this one starts, and no longer counts. `expected` is a guess of the row counts, used
    only to avoid large chunks in small files. Columns in `leave_out` (table, name) are not written.
    """

    #: Files that could not even be abandoned (a limit on the size of files holds for anonymous ones too). HDF5 crashes
    #: when they are collected, hence this list, and at the end of the process: a program with nothing else to lose
    #: should leave by `os._exit` if there are any.
    unclosable: ClassVar[list[Any]] = []

    def __init__(
        self,
        path: Path,
        *,
        bodies: Table,
        planes: Table,
        walls: Table | None = None,
        attributes: Mapping[str, Any],
        first: Rows | None = None,
        expected: Rows | None = None,
        leave_out: Collection[tuple[str, str]] = (),
    ) -> None:
        self.path = path
        self.first = first or Rows()
        self.rows = Rows()  # of this segment, appended, committed or not
        self.committed = Rows()
        self.last_frame: int | None = None  # step of the newest frame of this segment
        self._attributes = dict(attributes, format=FORMAT, first_rows=np.array(self.first, dtype=np.uint64))
        self._static = {"bodies": bodies, "planes": planes, **({} if walls is None else {"walls": walls})}
        self._expected = expected or Rows()
        self._leave_out = frozenset(leave_out)
        self._file: Any = None
        self._handle = -1
        self._commit: h5py.Dataset = None
        self._columns: dict[str, dict[str, h5py.Dataset]] = {}
        self._pending: list[dict[str, dict[str, Any]]] = []
        self._pending_bytes = 0
        self._pending_since = 0.0
        self._worker: threading.Thread | None = None
        self._failure: BaseException | None = None

    def append(self, block: Mapping[str, Any]) -> None:
        """Take over a block as `Simulation.advance` returns it; the first one fixes columns and types of the
        file.
        """
        if self._file is None:
            try:
                with _explained(self.path):
                    self._create(block)
            except BaseException:
                self.abandon()  # before HDF5 tries to write what there is no room for, which it does not survive
                raise
        counts = _count(block)
        parts = {name: dict(block[name]) for name in tables(self._columns)}
        for (table, column), target in ENDS.items():
            offset = np.uint64(getattr(self.first, target) + getattr(self.rows, target))
            parts[table][column] = np.asarray(parts[table][column], dtype=np.uint64) + offset
        self.rows = self.rows + counts
        if counts.frames:
            self.last_frame = int(parts["frames"]["step"][-1])
        if not any(counts):
            return
        if not self._pending:
            self._pending_since = time.monotonic()
        self._pending.append(parts)
        self._pending_bytes += sum(np.asarray(c).nbytes for t in parts.values() for c in t.values())
        if self._pending_bytes >= BATCH_BYTES or time.monotonic() - self._pending_since >= BATCH_SECONDS:
            self._write_meanwhile()

    def commit(self) -> Rows:
        """Write all that was appended, then say so in `/commit`. Returns the committed row counts."""
        self._wait()
        if self._file is not None and self.rows != self.committed:
            self._write(*self._batch())
        return self.committed

    def _write_meanwhile(self) -> None:
        """Write while the core computes: it needs no interpreter, and the copying costs a tenth of a fast run."""
        self._wait()
        batch = self._batch()

        def work() -> None:
            try:
                self._write(*batch)
            except BaseException as error:
                self._failure = error

        self._worker = threading.Thread(target=work, name="carom-writer")
        self._worker.start()

    def _wait(self) -> None:
        if self._worker is not None:
            self._worker.join()
            self._worker = None
        if self._failure is not None:
            raise self._failure

    def _batch(self) -> tuple[list[dict[str, dict[str, Any]]], Rows]:
        batch, self._pending, self._pending_bytes = self._pending, [], 0
        return batch, self.rows

    def _write(self, batch: list[dict[str, dict[str, Any]]], rows: Rows) -> None:
        try:
            with _explained(self.path):
                for table, columns in self._columns.items():
                    for name, dataset in columns.items():
                        parts = [np.asarray(block[table][name]) for block in batch]
                        _extend(dataset, parts[0] if len(parts) == 1 else np.concatenate(parts))
                self._file.flush()
                _extend(self._commit, np.array([rows], dtype=np.uint64))
                self._commit.flush()
                self._check_place()
        except BaseException as error:
            self._failure = error  # what was lost cannot be made good: nothing more is written to this file
            raise
        self.committed = rows

    def _check_place(self) -> None:
        """Raise if nobody can find what was written: a file that was removed or replaced goes on taking it all in."""
        with suppress(FileNotFoundError):
            if os.path.samestat(os.stat(self.path), os.fstat(self._handle)):
                return
        raise RecordError(
            f"{self.path} was removed or replaced while the run wrote it; put it back and continue the run with"
            " `carom resume`, or compute it anew"
        )

    def sync(self) -> None:
        """Force what was committed to the disk, so that it outlives a power failure."""
        self._wait()
        if self._file is not None:
            with _explained(self.path):
                os.fsync(self._handle)

    def close(self) -> None:
        """Commit the rest and close the file."""
        if self._file is None:
            return
        try:
            self.commit()
        except BaseException:
            self.abandon()
            raise
        with _explained(self.path):
            self._file.close()
        self._file = None

    def abandon(self) -> None:
        """Close without committing, after a failed write; whatever was committed before stays readable."""
        if self._worker is not None:
            self._worker.join()
        self._pending.clear()
        if self._file is not None:
            with _no_limit_on_files():
                with suppress(Exception):
                    _divert(self._handle)
                for scrap in self.path.parent.glob(f".{self.path.name}.*.tmp"):
                    scrap.unlink(missing_ok=True)
                try:
                    self._file.close()
                except Exception:
                    Writer.unclosable.append((self._file, self._columns, self._commit))
            self._file = None

    def _create(self, block: Mapping[str, Any]) -> None:
        # HDF5 does not survive to run out of room while it sets up a file: it does so in memory.
        with h5py.File("segment", "w", driver="core", backing_store=False, libver="latest") as empty:
            self._set_up(empty, block)
            empty.flush()
            image = empty.id.get_file_image()
        # Until it is in SWMR mode nobody can read the file, nor could anybody ever if we were killed before: it gets
        # its name when it can be read.
        unborn = self.path.with_name(f".{self.path.name}.{os.getpid()}.tmp")
        try:
            unborn.write_bytes(image)
        except OSError:
            unborn.unlink(missing_ok=True)
            raise
        file = h5py.File(unborn, "r+", libver="latest")
        self._file = file
        # Kept, since a file that HDF5 failed to close cannot be asked for it any more.
        self._handle = int(file.id.get_vfd_handle())
        self._columns = {
            table: {name: file[table][name] for name in file[table].attrs["columns"]}
            for table in tables(block)
        }
        self._commit = file["commit"]
        file.swmr_mode = True
        os.rename(unborn, self.path)

    def _set_up(self, file: h5py.File, block: Mapping[str, Any]) -> None:
        """Everything that a segment has before its first row."""
        for key, value in self._attributes.items():
            file.attrs[key] = value
        for table, columns in self._static.items():
            group = file.create_group(table)
            for name, values in columns.items():
                text = name in TEXTS
                data = np.array(values, dtype=h5py.string_dtype()) if text else np.asarray(values)
                _describe(group.create_dataset(name, data=data), f"{table}/{name}")
        for table in tables(block):
            group = file.create_group(table)
            guess = getattr(self._expected, table)
            written = []
            for name, values in block[table].items():
                if (table, name) in self._leave_out:
                    continue
                rows = self._expected.values if (table, name) == VALUES else guess
                _new_column(group, table, name, np.asarray(values), rows)
                written.append(name)
            group.attrs["columns"] = written
        width = len(Rows._fields)
        commit = file.create_dataset(
            "commit", (0, width), np.uint64, maxshape=(None, width), chunks=(128, width)
        )
        commit.attrs["columns"] = list(Rows._fields)
        commit.attrs["description"] = "rows of each table that are whole; the last row counts"


def _divert(handle: int) -> None:
    """Let what HDF5 still holds go to a place where it can be written.

    HDF5 keeps what it could not write and tries again when the file is closed and when the process ends; where
    that fails too, the process ends in a segmentation fault. Under its feet the file is therefore exchanged for
    an anonymous one. The real file stays as the last successful write left it, as readers of a killed run expect.
    """
    in_memory = hasattr(os, "memfd_create")
    with open(os.memfd_create(""), "wb") if in_memory else tempfile.TemporaryFile() as anonymous:
        os.dup2(anonymous.fileno(), handle)


@contextmanager
def _no_limit_on_files() -> Iterator[None]:
    """Raise the limit on the size of files (`ulimit -f`) as far as we may: it holds for anonymous files too."""
    try:
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    except (ImportError, OSError, ValueError):  # no such limits on this system
        yield
        return
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _new_column(group: h5py.Group, table: str, name: str, values: NDArray[Any], guess: int) -> None:
    dtype = np.uint64 if (table, name) in ENDS else values.dtype
    shape = values.shape[1:]
    row_bytes = max(1, int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize)
    rows = min(max(1, CHUNK_BYTES // row_bytes), MAX_CHUNK_ROWS)
    if guess:
        rows = min(rows, max(64, guess))
    dataset = group.create_dataset(
        name, (0, *shape), dtype, maxshape=(None, *shape), chunks=(rows, *(max(1, n) for n in shape))
    )
    _describe(dataset, f"{table}/{name}")


def _describe(dataset: h5py.Dataset, key: str) -> None:
    meaning = MEANINGS.get(key, Meaning("", ""))
    dataset.attrs["unit"] = meaning.unit
    dataset.attrs["description"] = meaning.text


def _extend(dataset: h5py.Dataset, rows: NDArray[Any]) -> None:
    if len(rows):
        start = dataset.shape[0]
        dataset.resize(start + len(rows), axis=0)
        dataset[start:] = rows


def _count(block: Mapping[str, Any]) -> Rows:
    counts = {table: len(block[table]["gap" if table == "contacts" else "step"]) for table in tables(block)}
    return Rows(**counts, values=len(block["residuals"]["value"]))


class _explained:
    """Turns what HDF5 raises when the disk is full or the file unwritable into one line that says so."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        # h5py reports some failed writes as RuntimeError (from closing) instead of OSError.
        if isinstance(error, (OSError, RuntimeError)):
            raise RecordError(f"cannot write {self.path}: {unwritable(error)}") from error
