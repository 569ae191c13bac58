"""What callers give: numbers and places that can be computed with, or a sentence that says which is not."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from carom.errors import CaromError
from carom.scene.tables.balls import Sphere
from carom.units import number


def angle(
    call: str, name: str, value: Any, fits: Callable[[float], bool] = math.isfinite, span: str = ""
) -> float:
    """An angle in rad that `fits`: a number in rad, or a text with a unit; `span` says what fits.

    More than a turn is taken for forgotten degrees.
    """
    found = number(call, name, value, "angle")
    if not isinstance(value, str) and abs(found) > math.tau:
        raise CaromError(f"{call}: {name}: {found:g} rad is more than a turn; write '{found:g} deg'")
    if not fits(found):
        raise CaromError(f"{call}: {name} {span}, found {math.degrees(found):g} deg")
    return found


def sphere(call: str, name: str, value: Any) -> Sphere:
    """A ball of a scene."""
    if not isinstance(value, Sphere):
        raise CaromError(
            f"{call}: {name} must be a ball of a scene, as table.cue_ball(scene) returns it, found {value!r}"
        )
    return value


def vector(call: str, name: str, value: Any, dimension: str | None = None) -> list[float]:
    """A vector of two numbers (`number`), or of three."""
    if (
        isinstance(value, str)
        or not (hasattr(value, "__len__") or isinstance(value, Sequence))
        or len(value) not in (2, 3)
    ):
        raise CaromError(f"{call}: {name} must be (x, y), found {value!r}")
    return [number(call, name, c, dimension) for c in tuple(value)]


def place(call: str, name: str, value: Any, dimension: str | None = None) -> tuple[float, float]:
    """The x and y of a vector of two numbers."""
    found = vector(call, name, value, dimension)
    if len(found) > 2:
        raise CaromError(f"{call}: {name} must be (x, y), found {value!r}")
    return found[0], found[1]
