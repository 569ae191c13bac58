"""Writes the results of a run (`results.h5`) so that a reader can open them at any moment, even after `kill
-9`.

The order is the whole idea: every dataset exists before single-writer-multiple-readers mode begins; rows go
in by batches; when they are out of our hands a row of `/commit` states how many of each table are whole.
Readers trust nothing else. No compression: it buys 10-16 % of the size for ten times the work
(docs/reference/results.md). No metadata are written that a kill could tear (`carom.result.record.blank`).
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, ClassVar

import h5py
import numpy as np

from carom.arrays import Array
from carom.files import Anchored, RecordError, unwritable, write_new
from carom.result.record import blank
from carom.result.record.layout import ENDS, FORMAT, Rows, count, tables

Table = Mapping[str, Any]

#: Rows wait in memory until there are this many bytes of them, or the oldest is this many seconds old.
BATCH_BYTES = 16 * 1024 * 1024
BATCH_SECONDS = 1.0
#: Bytes of a file that cannot be written on up to which it is copied into memory to be closed.
MOST_COPIED = 1024**3


class Writer:
    """The writer of a segment, and of those `further` ones that a long run needs. Blocks are appended; `commit` makes what
    was appended durable for readers.

    `bodies` and `walls` (`planes`, `walls` and so on) are the static tables (name, radius, ...). `first` counts the rows
    of the whole run before this segment: what earlier segments hold beyond it was written after the
    checkpoint from which this one starts, and no longer counts. `expected` is a guess of the row counts, used
    only to avoid large chunks in small files. Columns in `leave_out` (table, name) are not written. `further` names the file
    in which to go on when this one is full; without it the file grows on, and a kill may then cost a column.
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
        attributes: Mapping[str, Any],
        first: Rows | None = None,
        expected: Rows | None = None,
        leave_out: Collection[tuple[str, str]] = (),
        further: Callable[[], Path] | None = None,
        **walls: Table,
    ) -> None:
        self._anchored = [Anchored(path)]  # of all files that were begun
        self.first = first or Rows()
        self.rows = Rows()  # of this segment, appended, committed or not
        self.committed = Rows()
        self.last_frame: int | None = None  # step of the newest frame of this segment
        self._attributes = dict(attributes, format=FORMAT)
        self._static = {"bodies": bodies, **walls}
        self._expected = expected or Rows()
        self._leave_out = frozenset(leave_out)
        self._further = further
        self._unsynced: list[Anchored] = []  # those that were full
        self._file: Any = None
        self._handle = -1
        self._commit: h5py.Dataset = None
        self._columns: dict[str, dict[str, h5py.Dataset]] = {}
        self._pending: list[dict[str, dict[str, Any]]] = []
        self._pending_bytes = 0
        self._pending_since = 0.0
        self._worker: threading.Thread | None = None
        self._failure: BaseException | None = None

    @property
    def path(self) -> Path:
        """The file that is written."""
        return self._anchored[-1].path

    @property
    def paths(self) -> list[Path]:
        """All files that were begun."""
        return [file.path for file in self._anchored]

    def append(self, block: Mapping[str, Any]) -> None:
        """Take over a block as `Simulation.advance` returns it; the first one fixes columns and types of the file."""
        if self._file is None:
            try:
                with _explained(self.path):
                    self._create(block)
            except BaseException:
                self.abandon()  # before HDF5 tries to write what there is no room for, which it does not survive
                raise
        counts = count(block)
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
            self._write(*self._next_batch())
        return self.committed

    def _write_meanwhile(self) -> None:
        """Write while the core computes: it needs no interpreter, and the copying costs a tenth of a fast run."""
        self._wait()
        batch = self._next_batch()

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

    def _next_batch(self) -> tuple[list[dict[str, dict[str, Any]]], Rows]:
        """What is to be written, and the rows that the segment will then have; nothing is being written meanwhile."""
        batch, self._pending, self._pending_bytes = self._pending, [], 0
        if self._further is not None and batch and not self._room(batch):
            try:
                with _explained(self.path):
                    self._turn_over(batch[0])
            except BaseException as error:
                self._failure = error
                raise
        return batch, self.rows

    def _room(self, batch: list[dict[str, dict[str, Any]]]) -> bool:
        return blank.fits(self._commit, 1) and all(
            blank.fits(dataset, sum(len(block[table][name]) for block in batch))
            for table, columns in self._columns.items()
            for name, dataset in columns.items()
        )

    def _turn_over(self, block: Mapping[str, Any]) -> None:
        """Go on in a further segment, which is made after the columns of `block`; all that was written is committed."""
        assert self._further is not None
        steps = self._columns["steps"]["step"]
        if self.committed.steps:
            self._attributes["start_step"] = int(steps[self.committed.steps - 1])
        # It will be as long as this one at least, and takes what is waiting.
        self._expected = Rows(*map(max, self._expected, self.rows))
        self._file.close()
        self._file = None
        self._unsynced.append(self._anchored[-1])
        self._anchored.append(Anchored(self._further()))
        self.first = self.first + self.committed
        self.rows = Rows(*(all_ - done for all_, done in zip(self.rows, self.committed, strict=True)))
        self.committed = Rows()
        self._create(block)

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
                for file in self._unsynced:
                    # Windows syncs nothing that is open for reading only.
                    handle = os.open(file.path, os.O_RDWR)
                    try:
                        os.fsync(handle)
                    finally:
                        os.close(handle)
                self._unsynced.clear()
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
        # Until it is in SWMR mode nobody can read the file, nor could anybody ever if we were killed before: it gets
        # its name when it can be read.
        unborn = self.path.with_name(f".{self.path.name}.{os.getpid()}.tmp")
        image = blank.image(
            f"{unborn}.memory",
            block,
            attributes={**self._attributes, "first_rows": np.array(self.first, dtype=np.uint64)},
            static=self._static,
            expected=self._expected,
            leave_out=self._leave_out,
        )
        try:
            write_new(unborn, image)
        except OSError:
            unborn.unlink(missing_ok=True)
            raise
        self._open(unborn, block)
        try:
            os.replace(unborn, self.path)
        except (
            PermissionError
        ):  # Windows moves no file that is open; for a moment nobody can read it under its name
            self._file.close()
            os.replace(unborn, self.path)
            self._open(self.path, block)

    def _open(self, path: Path, block: Mapping[str, Any]) -> None:
        """Open a file that holds a blank table for each part of `block`, so that others can read what is appended."""
        file = h5py.File(path, "r+", libver="latest")
        self._file = file
        # Kept, since a file that HDF5 failed to close cannot be asked for it any more.
        self._handle = int(file.id.get_vfd_handle())
        self._columns = {
            table: {name: file[table][name] for name in file[table].attrs["columns"]}
            for table in tables(block)
        }
        self._commit = file["commit"]
        file.swmr_mode = True


def _divert(handle: int) -> None:
    """Let what HDF5 still holds go to a place where it can be written.

    HDF5 keeps what it could not write and tries again when the file is closed and when the process ends; where
    that fails too, the process ends in a segmentation fault. Under its feet the file is therefore exchanged for
    an anonymous one. The real file stays as the last successful write left it, as readers of a killed run expect.
    """
    in_memory = hasattr(os, "memfd_create")
    with open(os.memfd_create(""), "w+b") if in_memory else tempfile.TemporaryFile() as anonymous:
        # Pages that it has let go of are read again while the file is closed.
        with suppress(OSError, AttributeError):  # where the system cannot, it is closed without them
            at, size = 0, os.fstat(handle).st_size
            while at < size <= MOST_COPIED:
                sent = os.sendfile(anonymous.fileno(), handle, at, size - at)
                size = size if sent else 0
                at += sent
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


def _extend(dataset: h5py.Dataset, rows: Array) -> None:
    if len(rows):
        start = dataset.shape[0]
        dataset.resize(start + len(rows), axis=0)
        dataset[start:] = rows


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
