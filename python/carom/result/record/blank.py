"""A segment before its first row: its static tables, and columns that can be written while others read.

A process may be killed in the middle of a write: the kernel stops between two of its pages. A chunk of rows that were not
committed may be torn so, but what HDF5 needs to find any row (headers, and the index of the chunks of a column) may not:
half of it old and half of it new, its checksum fails, and with it the whole column. So none of it ever lies in two pages:

- the file is made of pages of `PAGE` bytes, and HDF5 keeps what is shorter than one inside one;
- a column has no more than `MAX_CHUNKS` chunks; before it would, the run goes on in the next segment. Its index is an
  extensible array (HDF5 File Format Specification, section VII.D), in blocks that grow with the number of chunks: 4
  addresses, then in turn 1 x 16, 1 x 32, 2 x 32, 2 x 64, 4 x 64, ... 16 x 256, and only then blocks of 512 addresses of
  8 bytes, the first of which would be longer than a page.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from carom.arrays import Array
from carom.result.record.layout import ENDS, MEANINGS, TEXTS, VALUES, Meaning, Rows, tables

#: Bytes that the kernel writes whole, or not at all: the smallest page of memory of any system that we know.
PAGE = 4096
#: Chunks of a column of one segment, at most: 4 + sum over k = 0..8 of 2^(k/2) 16 2^((k+1)/2), halves rounded down.
MAX_CHUNKS = 8180
#: A chunk of a dataset is as many whole rows as fit in this, at most MAX_CHUNK_ROWS; a frame of many bodies
#: is one chunk.
CHUNK_BYTES = 128 * 1024
MAX_CHUNK_ROWS = 4096


def image(
    name: Path | str,
    block: Mapping[str, Any],
    *,
    attributes: Mapping[str, Any],
    static: Mapping[str, Mapping[str, Any]],
    expected: Rows,
    leave_out: Collection[tuple[str, str]],
) -> bytes:
    """The bytes of a file with the columns of `block` and no rows, set up in memory under a `name` that is free.

    HDF5 does not survive to run out of room while it sets up a file. In memory too it knows files by their names, and runs
    of one process are set up at the same time.
    """
    pages = {"fs_strategy": "page", "fs_page_size": PAGE}
    with h5py.File(name, "w", driver="core", backing_store=False, libver="latest", **pages) as file:
        _set_up(file, block, attributes, static, expected, leave_out)
        file.flush()
        return bytes(file.id.get_file_image())


def fits(dataset: h5py.Dataset, rows: int) -> bool:
    """Whether a column may be given so many more rows."""
    return bool(dataset.shape[0] + rows <= MAX_CHUNKS * dataset.chunks[0])


def _set_up(
    file: h5py.File,
    block: Mapping[str, Any],
    attributes: Mapping[str, Any],
    static: Mapping[str, Mapping[str, Any]],
    expected: Rows,
    leave_out: Collection[tuple[str, str]],
) -> None:
    for key, value in attributes.items():
        file.attrs[key] = value
    for table, columns in static.items():
        group = file.create_group(table)
        for name, values in columns.items():
            data = np.array(values, dtype=h5py.string_dtype()) if name in TEXTS else np.asarray(values)
            _describe(group.create_dataset(name, data=data), f"{table}/{name}")
    for table in tables(block):
        group = file.create_group(table)
        written = []
        for name, values in block[table].items():
            if (table, name) in leave_out:
                continue
            guess = expected.values if (table, name) == VALUES else getattr(expected, table)
            _new_column(group, table, name, np.asarray(values), guess)
            written.append(name)
        group.attrs["columns"] = written
    width = len(Rows._fields)
    commit = file.create_dataset("commit", (0, width), np.uint64, maxshape=(None, width), chunks=(128, width))
    commit.attrs["columns"] = list(Rows._fields)
    commit.attrs["description"] = "rows of each table that are whole; the last row counts"


def _new_column(group: h5py.Group, table: str, name: str, values: Array, guess: int) -> None:
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
