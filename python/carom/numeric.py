"""Whether what a caller gives, in Python or in a file, is a number: asked before anything is computed with it."""

from __future__ import annotations

from math import isfinite
from numbers import Integral, Real
from typing import Any

from carom.errors import CaromError


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
