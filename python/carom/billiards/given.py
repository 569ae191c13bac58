"""What callers give: numbers and places that can be computed with, or a sentence that says which is not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

from carom.errors import CaromError
from carom.units import UnitError, parse


def number(call: str, name: str, value: Any, dimension: str | None = None) -> float:
    """A finite number in SI; `call` and `name` say in the message where it was given.

    With a `dimension` (a key of `units.DIMENSIONS`) it may be a text with a unit.
    """
    if dimension is not None and isinstance(value, str):
        try:
            value = parse(value, dimension)
        except UnitError as error:
            raise CaromError(f"{call}: {name}: {error}") from None
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise CaromError(f"{call}: {name} must be a finite number in SI units, found {value!r}")
    return float(value)


def angle(call: str, name: str, value: Any) -> float:
    """An angle in rad: a number in rad, or a text with a unit. More than a turn is taken for forgotten degrees."""
    found = number(call, name, value, "angle")
    if not isinstance(value, str) and abs(found) > math.tau:
        raise CaromError(f"{call}: {name}: {found:g} rad is more than a turn; write '{found:g} deg'")
    return found


def place(call: str, name: str, value: Any, dimension: str | None = None) -> tuple[float, float]:
    """The x and y of a vector of two numbers (`number`), or of three, of which the last does not count."""
    if (
        isinstance(value, str)
        or not (hasattr(value, "__len__") or isinstance(value, Sequence))
        or len(value) not in (2, 3)
    ):
        raise CaromError(f"{call}: {name} must be (x, y), found {value!r}")
    x, y = (number(call, name, c, dimension) for c in tuple(value)[:2])
    return x, y
