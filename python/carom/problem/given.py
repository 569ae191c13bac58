"""Arrays as callers give them: real numbers, none of them masked, in as many dimensions as are wanted."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64
from carom.numeric import masked
from carom.problem.errors import refuse

#: Of how many dimensions an array is.
WORDS = {1: "one dimension", 2: "two dimensions"}


def reals(values: Any, name: str, *dimensions: int) -> F64:
    """A copy of an array of real numbers in one of so many `dimensions`, or an error that says what is wrong."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise refuse(name, "its rows differ in length", "give real numbers, as an array") from error
    if array.ndim not in dimensions or array.dtype.kind not in "fiub":
        cause = f"an array of {array.ndim} dimensions and type {array.dtype}"
        raise refuse(name, cause, f"give real numbers, in {' or '.join(WORDS[n] for n in dimensions)}")
    if masked(values):
        raise refuse(name, "some of its numbers are masked", "all numbers must be there")
    return np.array(array, dtype=np.float64)


def vector(values: Any, name: str, size: int | None = None) -> F64:
    """A read-only (size,) copy of finite numbers."""
    array = reals(values, name, 1)
    if size is not None and len(array) != size:
        raise refuse(name, f"{len(array)} values", f"there must be {size}")
    finite(array, name)
    array.setflags(write=False)
    return array


def of_contacts(values: Any, name: str, contacts: int, dimension: int) -> F64:
    """(d C,) of numbers given as (d C,) or (C, d), which need not be finite."""
    array = reals(values, name, 1, 2)
    rows = contacts * dimension
    if array.shape not in ((rows,), (contacts, dimension)):
        raise refuse(name, f"its shape is {array.shape}", f"it must be ({rows},)")
    return array.reshape(-1)


def finite(values: F64, name: str) -> None:
    """Refuse NaN and infinity."""
    bad = ~np.isfinite(values)
    if bad.any():
        k = int(np.argmax(bad))
        raise refuse(name, f"{values[k]} as value {k} (from 0)", "all numbers must be finite")
