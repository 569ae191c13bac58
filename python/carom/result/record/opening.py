"""Opens a results file and takes nothing in it on trust: it may be damaged, or made by others.

What cannot be read becomes a `CaromError` with file and place; nothing outside the file is followed, and no column takes
more memory than its bytes can fill (`carom.result.record.untrusted`).
"""

from __future__ import annotations

import ctypes  # noqa: TID251 a setting of HDF5 that h5py has not
import functools
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from carom.arrays import Array
from carom.errors import CaromError
from carom.files import regular
from carom.result.record.layout import ATTRIBUTES, FORMAT, MEANINGS, NEEDED, TABLES, VALUES, Rows, tables
from carom.result.record.untrusted import Untrusted, child, dataset, first_line

#: What h5py raises over damaged files.
DAMAGED = (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, OverflowError)
#: The head of a file: its signature, the version of its layout, at byte 11 what its writer does, from 28 on its end.
HEAD, SIGNATURE = 48, b"\x89HDF\r\n\x1a\n"
#: Bytes that may be missing at the end of a file whose writer was killed: announced and never used. The library
#: writes the announcement last.
MISSING_END = 4096
#: Rows of a table: no file has more, and sums of so many fit an index.
MOST_ROWS = 2**53
#: Times that metadata are read in the hope that a living writer completes them; the pauses add up to half a second.
READ_ATTEMPTS = 29
#: Seconds that a living writer is given to write what it has announced.
PATIENCE = 0.5


def open_results(path: Path) -> h5py.File:
    cut = None
    try:
        cut = _cut(regular(path))
        file = _open_swmr(path)
    except OSError as error:
        if not path.exists():
            raise CaromError(f"{path}: no such file") from error
        raise CaromError(
            f"{path} cannot be read as results of a run: {cut or str(error).splitlines()[0]}"
        ) from error
    try:
        found = int(file.attrs.get("format", -1))
        whole = all(table_of(file, table) is not None for table in TABLES) and "commit" in file
        if cut is not None and whole and not _holds_what_counts(file, path.stat().st_size):
            raise CaromError(cut)
    except (CaromError, *DAMAGED) as error:
        file.close()
        if cut is not None:
            raise CaromError(f"{path} cannot be read as results of a run: {cut}") from error
        raise damaged(path, "/", error) from error
    if found != FORMAT:
        file.close()
        raise CaromError(
            f"{path} is not a results file of this version of Carom (format {found}, wanted {FORMAT})"
        )
    if not whole:
        lost = [f"/{name}" for name in (*TABLES, "commit") if name not in file]
        file.close()
        raise CaromError(
            f"{path} has no whole {' and '.join(lost) or 'tables'}; restore the file, or run the scenario again"
        )
    try:
        attributes_of(file)
    except CaromError:
        file.close()
        raise
    return file


def _open_swmr(path: Path) -> h5py.File:
    # A file that was closed is opened as one: of a damaged one the library then says so, where it would read on for ever
    # in the hope that a writer mends it.
    if not _may_be_written(path):
        return h5py.File(path, "r")
    try:
        return _open_written(path, locking=True)
    except OSError as error:
        if "unable to lock" not in str(error):
            raise
        # Network file systems may have no locks, or keep that of a writer that died.
        return _open_written(path, locking=False)


def _open_written(path: Path, *, locking: bool) -> h5py.File:
    """Open beside a writer, or what a killed one left, and give up on what it left half written."""
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_libver_bounds(h5py.h5f.LIBVER_LATEST, h5py.h5f.LIBVER_LATEST)
    if not locking:
        access.set_file_locking(False, False)
    limit = _attempts_setter()
    if limit is not None:
        limit(access.id, READ_ATTEMPTS)
    return h5py.File(h5py.h5f.open(os.fsencode(path), h5py.h5f.ACC_RDONLY | h5py.h5f.ACC_SWMR_READ, access))


@functools.cache
def _attempts_setter() -> Callable[[int, int], int] | None:
    """`H5Pset_metadata_read_attempts`, which h5py has not; None where its library cannot be found.

    A reader that finds a wrong checksum takes it for work in progress and reads again, after a pause that doubles each
    time, a hundred times by default: for ever, if the writer was killed in the middle.
    """
    try:
        mapped = Path("/proc/self/maps").read_text(encoding="utf-8")
        library = next(re.finditer(r"\S*/libhdf5[-.][^/\s]*\.so\S*|\S*/libhdf5_serial[-.]\S*", mapped))
        found = ctypes.CDLL(library[0]).H5Pset_metadata_read_attempts
    except (OSError, StopIteration, AttributeError):
        return None
    found.argtypes, found.restype = (ctypes.c_int64, ctypes.c_uint), ctypes.c_int
    return found


def _may_be_written(path: Path) -> bool:
    """Whether the head of a file says that a process has it open for writing (or was killed while it had)."""
    head = _head(path)
    return head is not None and bool(head[11])


def _head(path: Path) -> bytes | None:
    with open(path, "rb") as file:
        head = file.read(HEAD)
    known = len(head) == HEAD and head.startswith(SIGNATURE) and head[8] >= 3
    return head if known else None  # the library says what is wrong


def _cut(path: Path) -> str | None:
    """What is missing at the end of a file that was not closed; None if nothing is, or may come yet.

    That is so after a kill and on a full disk, where only what was announced and never used may be missing, and in a file
    that somebody cut.
    """
    begin = time.monotonic()
    while True:
        head = _head(path)
        if head is None or not head[11]:
            return None
        end, size = int.from_bytes(head[28:36], "little"), path.stat().st_size
        if end <= size + MISSING_END:
            return None
        if time.monotonic() - begin > PATIENCE:
            told = f"truncated file: {size} of {end} bytes"
            if _attempts_setter() is None:  # the library would wait for the rest, and for ever
                raise OSError(told)
            return told
        time.sleep(0.01)


def _holds_what_counts(file: h5py.File, size: int) -> bool:
    """Whether the rows that were committed lie in the first `size` bytes of the file; HDF5 reads zeros beyond."""
    rows = written(file)
    for table in tables(file):
        group = table_of(file, table)
        if group is None:
            return False
        for name in group:
            count = rows.values if (table, name) == VALUES else getattr(rows, table)
            if not _reaches(dataset(file, f"{table}/{name}", rows=count), count, size):
                return False
    return _reaches(file["commit"], len(file["commit"]), size)


def reaches(column: h5py.Dataset, rows: int) -> None:
    """Raise if the first `rows` rows of a column do not all lie in its file."""
    try:
        if _reaches(column, rows, os.fstat(column.file.id.get_vfd_handle()).st_size):
            return
    except DAMAGED as error:
        raise damaged(column.file, column.name, error) from error
    raise damaged(column.file, column.name, f"not all of the {rows} rows that count are there")


def _reaches(column: h5py.Dataset, rows: int, size: int) -> bool:
    """Whether the first `rows` rows of a column lie in the first `size` bytes of its file."""
    if rows == 0:
        return True
    seen = 0
    last = 0

    def look(chunk: Any) -> None:
        nonlocal seen, last
        here = min(column.chunks[0], rows - chunk.chunk_offset[0])
        if here > 0:
            seen += here
            last = max(last, chunk.byte_offset + -(-chunk.size * here // column.chunks[0]))

    column.id.chunk_iter(look)
    return seen >= rows and last <= size


# --- nothing on trust: a file may have been damaged, or made by others ----------------------------------------------


def damaged(file: h5py.File | Path, place: str, error: object) -> CaromError:
    path = file if isinstance(file, Path) else file.filename
    cause = first_line(error) if isinstance(error, BaseException) else str(error)
    return CaromError(
        f"{path}: {place} cannot be read ({cause}); the file is damaged: take a copy, or run again"
    )


def read_rows(part: Any, rows: slice) -> Array:
    try:
        return np.asarray(part[rows])
    except DAMAGED as error:
        raise damaged(part.file, part.name, error) from error


def table_of(file: h5py.File, table: str) -> h5py.Group | None:
    """A table as a group of the file itself; None if it is not there."""
    found = child(file, table)
    return found if isinstance(found, h5py.Group) else None


def column_of(file: h5py.File, key: str, rows: int) -> h5py.Dataset:
    """A column of which `rows` rows count."""
    try:
        return _as_laid_out(dataset(file, key, rows=rows), key)
    except Untrusted as error:
        raise damaged(file, error.place, error.cause) from error


def _as_laid_out(found: h5py.Dataset, key: str) -> h5py.Dataset:
    """A column whose rows have the shape that the layout says; one that it does not know may have any."""
    meaning = MEANINGS.get(key)
    if meaning is None:
        return found
    row, wanted = found.shape[1:], meaning.row
    if len(row) != len(wanted) or any(w not in (None, n) for n, w in zip(row, wanted, strict=True)):
        told = " x ".join("n" if n is None else str(n) for n in wanted) or "one number"
        raise Untrusted(f"/{key}", f"its rows have shape {row}, not {told}", "the file is damaged")
    return found


def static_of(file: h5py.File, key: str, text: bool) -> Array:
    """A column of a table that does not change in a run."""
    try:
        found = _as_laid_out(dataset(file, key, "OS" if text else "biuf"), key)
        return np.array(found.asstr()[:], dtype=object) if text else np.asarray(found[()])
    except (Untrusted, AttributeError, *DAMAGED) as error:
        raise damaged(file, f"/{key}", error) from error


def attributes_of(file: h5py.File) -> dict[str, Any]:
    """The attributes of a file; those that are numbers as the layout says."""
    try:
        found = dict(file.attrs)
        for name in (*NEEDED, *(name for name in ATTRIBUTES if name in found)):
            value = np.asarray(found[name])
            if (
                value.dtype.kind not in "iuf"
                or value.shape != ATTRIBUTES[name]
                or not np.isfinite(value).all()
            ):
                raise ValueError(
                    f"{name} is not {'3 finite numbers' if ATTRIBUTES[name] else 'a finite number'}"
                )
        if not (found["step"] > 0 and found["every"] >= 1):
            raise ValueError("step and every are above 0")
    except DAMAGED as error:
        raise damaged(file, "its attributes", error) from error
    return found


def first_rows(file: h5py.File) -> Rows:
    """How many rows earlier segments have."""
    try:
        return _rows(file.attrs["first_rows"])
    except DAMAGED as error:
        raise damaged(file, "first_rows", error) from error


def written(file: h5py.File) -> Rows:
    """How many rows of the file are whole."""
    try:
        commit = dataset(file, "commit", "iu", rows=len(file["commit"]))
        return _rows(commit[-1]) if len(commit) else Rows()
    except (Untrusted, *DAMAGED) as error:
        raise damaged(file, "/commit", error) from error


def _rows(numbers: Any) -> Rows:
    found = Rows(*(int(n) for n in numbers))
    if min(found) < 0 or max(found) > MOST_ROWS:
        raise ValueError(f"{min(found) if min(found) < 0 else max(found)} rows")
    return found
