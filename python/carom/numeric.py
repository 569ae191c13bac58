"""Whether what a caller gives, in Python or in a file, is a number, or an array of them: asked before all else."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from numbers import Integral, Real
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, quoted


def is_number(value: Any) -> bool:
    """Whether a value, Python's or NumPy's, is a number; true and false are not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number, of a kind that counts."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def is_finite(value: Any) -> bool:
    """Whether a value is a finite number."""
    try:
        return is_number(value) and isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def three(owner: str, **given: Any) -> None:
    """Refuses what is not three finite numbers, along x, y and z."""
    for name, value in given.items():
        try:
            entries = [] if isinstance(value, str) else list(value)
        except TypeError:  # a single number
            entries = []
        if len(entries) != 3 or not all(map(is_finite, entries)):
            raise CaromError(f"{owner}: {name} = {value!r}; give three finite numbers, along x, y and z")


def reals(values: Any) -> F64:
    """A copy of an array, or of lists, of real numbers; `ValueError` says what is none: true, a text, what is masked."""
    if masked(values):
        raise ValueError("some of them are masked")
    of_numbers = getattr(getattr(values, "dtype", None), "kind", "O") in "fiu"
    # Lists may mix kinds, as [1.0, True].
    each: Iterable[Any] = () if of_numbers else np.array(values, dtype=object).flat
    each = (x[()] if isinstance(x, np.ndarray) else x for x in each)  # arrays of one number without axes
    for wrong in (x for x in each if not is_number(x)):
        raise ValueError(f"found {quoted(wrong.item() if isinstance(wrong, np.generic) else wrong)}")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError:
        raise ValueError("one of them is too large") from None


def masked(values: Any) -> bool:
    """Whether numbers of NumPy's are masked, also in lists of arrays."""
    if isinstance(values, list | tuple):
        return any(map(masked, values))
    return bool(np.ma.is_masked(values))
