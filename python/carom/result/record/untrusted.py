"""Reads pieces of HDF5 files that others wrote, and takes nothing on trust.

A file of HDF5 can send its reader elsewhere (soft and external links, virtual datasets, storage in other files) and can
announce arrays of any size with nothing behind them. None of that occurs in a file of a contact problem or a run, so it
is refused before anything is read: only what lies in the file itself counts, and its arrays take no more memory than the
bytes of the file can fill.
"""

from __future__ import annotations

import math
from typing import Any

import h5py
import numpy as np

from carom.arrays import Array
from carom.errors import CaromError

#: Bytes of memory that one byte of a file can fill: deflate reaches 1032.
INFLATION = 1100
INSIDE = "copy the data itself into the file"
WHOLE = "the file is damaged: take it from its source again"
MISSING = "there must be numbers here"
#: Bytes that an array may take whatever the file holds: the fill values of a chunk that was never written.
FREE = 1 << 20


class Untrusted(CaromError):
    """A part of a file that cannot be used: `place`, `cause` and `cure`."""

    def __init__(self, place: str, cause: str, cure: str) -> None:
        super().__init__(f"{place}: {cause}; {cure}")
        self.place, self.cause, self.cure = place, cause, cure


def child(parent: h5py.Group, key: str) -> Any:
    """The group or dataset of that name within the same file, or None; links to elsewhere are refused.

    `key` may be a path, `vectors/q`: every part of it is looked at.
    """
    found: Any = parent
    for part in key.split("/"):
        if not isinstance(found, h5py.Group):
            return None
        try:
            link = found.get(part, getlink=True)
            if link is None:
                return None
            if not isinstance(link, h5py.HardLink):
                kind = "an external link" if isinstance(link, h5py.ExternalLink) else "a soft link"
                raise Untrusted(
                    _place(found, part), f"{kind} to {link.path!r}, which is not followed", INSIDE
                )
            found = found[part]
        except (KeyError, RuntimeError, OSError, ValueError) as error:
            raise Untrusted(_place(found, part), f"damaged ({first_line(error)})", WHOLE) from error
    return found


def dataset(parent: h5py.Group, key: str, kinds: str = "biuf", rows: int | None = None) -> h5py.Dataset:
    """The dataset of numbers of that name, of one of the `kinds` of NumPy's types, which may be read whole.

    With `rows` only so many of its first rows have to be there: a file that is being written may announce more.
    """
    found = child(parent, key)
    place = _place(parent, key)
    if not isinstance(found, h5py.Dataset):
        raise Untrusted(place, "missing" if found is None else "no dataset", MISSING)
    try:
        shape, kind, virtual, external = found.shape, found.dtype, found.is_virtual, found.external
        stored = found.id.get_storage_size()
    except (TypeError, ValueError, RuntimeError, OSError, OverflowError) as error:
        raise Untrusted(place, f"damaged ({first_line(error)})", WHOLE) from error
    if shape is None:
        raise Untrusted(place, "missing (a dataset without a shape)", MISSING)
    if kind.kind not in kinds:
        raise Untrusted(place, f"of type {kind}", "numbers are wanted")
    if virtual or external:
        raise Untrusted(place, "kept in other files, which are not followed", INSIDE)
    if rows is not None:
        if not shape or not 0 <= rows <= shape[0]:
            raise Untrusted(place, f"has not the {rows} rows that count", WHOLE)
        shape = (rows, *shape[1:])
    size = math.prod((*map(int, shape), kind.itemsize))
    if size > FREE + INFLATION * stored:
        text = f"announces {'x'.join(map(str, shape))} values and holds {stored} bytes of them"
        raise Untrusted(place, text, WHOLE)
    return found


def read(parent: h5py.Group, key: str, kinds: str = "biuf") -> Array:
    """All values of a dataset of numbers."""
    found = dataset(parent, key, kinds)
    try:
        return np.asarray(found[()])
    except (OSError, RuntimeError, ValueError, TypeError, KeyError) as error:
        raise Untrusted(_place(parent, key), f"damaged ({first_line(error)})", WHOLE) from error


def first_line(error: BaseException) -> str:
    """The first line of what a library says of an error."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _place(parent: h5py.Group, key: str) -> str:
    name = parent.name or ""
    return f"{name.rstrip('/')}/{key}"
