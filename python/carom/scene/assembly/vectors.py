"""The little vector arithmetic that checking a scenario needs, on tuples, safe for very long and very short vectors."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

Vec = Sequence[float]
#: By which the length of what has been divided by its length may differ from 1.
ROUNDING = 4.0 * sys.float_info.epsilon


def norm(a: Vec) -> float:
    """Length of `a` (math.hypot scales, so 1e-200 and 1e200 are fine)."""
    return math.hypot(*a)


def scaled(a: Vec) -> tuple[float, ...]:
    """`a` divided by its length, which must not be zero."""
    largest = max(map(abs, a))
    b = [x / largest for x in a]  # a denormal length would lose digits
    length = math.hypot(*b)
    return tuple(x / length for x in b)


def unit(q: Vec) -> tuple[float, ...]:
    """`q` divided by its length; as it is where that is 1 but for rounding, so that done twice it has the same bits."""
    return tuple(q) if abs(norm(q) - 1.0) <= ROUNDING else scaled(q)


def cross(a: Vec, b: Vec) -> tuple[float, float, float]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vec, b: Vec) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
