"""Distributions of diameters, and diameters drawn from them: so many, or as many as fill a volume."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from math import inf
from typing import Any, Protocol

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.numeric import is_number
from carom.scene.packing.numbers import Stream, exp, log, total
from carom.scene.packing.region import in_metres

MOST_BALLS = 1_000_000
"""Of one packing: more would take hours to place."""
RAREST = 1e-3
"""Share of a normal or lognormal law that has to lie between its limits: others are thrown away."""


class Sizes(Protocol):
    """A law of diameters by number of balls."""

    def __hash__(self) -> int: ...

    def draw(self, count: int, stream: Stream) -> F64:
        """Independent diameters, (count,), m."""


def _check(law: Any) -> None:
    """Refuses what is no length, a `deviation` below 0, and a lognormal law whose mean has no logarithm."""
    in_metres(law, *(field.name for field in fields(law)))
    kind = type(law).__name__
    for name, value in ((field.name, getattr(law, field.name)) for field in fields(law)):
        least = 0.0 if name == "deviation" else -inf
        if not (is_number(value) and value >= least):
            cure = (
                "give 0 m, of which all are equal, or more" if name == "deviation" else "give a length in m"
            )
            raise CaromError(f"{kind}: {name} = {value!r}; {cure}")
    if isinstance(law, Lognormal) and not 0.0 < law.mean < inf:
        raise CaromError(f"Lognormal: mean = {law.mean:g} m; give a length above 0")


@dataclass(frozen=True)
class Equal:
    """Balls of one diameter, m."""

    diameter: float

    def __post_init__(self) -> None:
        _check(self)

    def draw(self, count: int, stream: Stream) -> F64:
        return np.full(count, self.diameter)


@dataclass(frozen=True)
class Uniform:
    """All diameters from `least` to `most`, m, equally often."""

    least: float
    most: float

    def __post_init__(self) -> None:
        _check(self)

    def draw(self, count: int, stream: Stream) -> F64:
        return self.least + (self.most - self.least) * stream.uniform(count)


@dataclass(frozen=True)
class Normal:
    """A normal law of `mean` and `deviation` (both m) of which only what lies from `least` to `most` is kept. A
    deviation of 0 gives balls that are all equal.
    """

    mean: float
    deviation: float
    least: float
    most: float

    def __post_init__(self) -> None:
        _check(self)

    def draw(self, count: int, stream: Stream) -> F64:
        return _within(self.least, self.most, count, lambda k: self.mean + self.deviation * stream.normal(k))


@dataclass(frozen=True)
class Lognormal:
    """A diameter whose logarithm is normal; `mean` and `deviation` (m) are its own, before what lies outside `least` to
    `most` is left out. A deviation of 0 gives balls that are all equal.
    """

    mean: float
    deviation: float
    least: float
    most: float

    def __post_init__(self) -> None:
        _check(self)

    def draw(self, count: int, stream: Stream) -> F64:
        ratio = self.deviation / self.mean
        variance, middle = log(np.array([1.0 + ratio * ratio, self.mean]))
        spread, centre = np.sqrt(variance), middle - 0.5 * variance
        return _within(self.least, self.most, count, lambda k: exp(centre + spread * stream.normal(k)))


@dataclass(frozen=True)
class Table:
    """Diameters, m, each with its share (any unit) of the number of balls, or of their mass if `by_mass`."""

    diameters: tuple[float, ...]
    shares: tuple[float, ...]
    by_mass: bool = False

    def __post_init__(self) -> None:
        in_metres(self, rows=["diameters"])
        if len(self.diameters) != len(self.shares) or not self.diameters:
            raise CaromError("Table: give as many shares as diameters, one at least")
        if not all(is_number(x) and 0 < x < inf for x in (*self.diameters, *self.shares)):
            raise CaromError("Table: diameters and shares must be numbers above 0; leave out empty classes")
        by_mass: Any = self.by_mass  # any text is true: "number" had meant shares of the mass
        if not isinstance(by_mass, bool | np.bool_):
            cure = "give True for shares of the mass, False for shares of the number"
            raise CaromError(f"Table: by_mass = {by_mass!r}; {cure}")

    def draw(self, count: int, stream: Stream) -> F64:
        diameters, weights = np.array(self.diameters), np.array(self.shares)
        if self.by_mass:
            scaled = diameters / diameters.max()
            weights = weights / (scaled * scaled * scaled)
        bounds = np.cumsum(weights)
        place = np.searchsorted(bounds, stream.uniform(count) * bounds[-1], side="right")
        found: F64 = diameters[np.minimum(place, len(diameters) - 1)]
        return found


class Rare(ValueError):
    """Almost nothing of a law lies between its limits."""


def _within(least: float, most: float, count: int, draw: Callable[[int], F64]) -> F64:
    """The first `count` of the numbers drawn that lie within the limits."""
    found: list[F64] = []
    drawn = kept = 0
    while kept < count:
        batch = draw(count - kept + 64)
        drawn += len(batch)
        found.append(batch[(batch >= least) & (batch <= most)])
        kept += len(found[-1])
        if drawn > 10_000 and kept < RAREST * drawn:
            raise Rare(f"only {kept} of {drawn} diameters lie between {least:g} m and {most:g} m")
    return np.concatenate(found)[:count]


def fill(sizes: Sizes, volume: float, stream: Stream, most: int) -> F64:
    """Diameters of balls of which the volumes add up to `volume`, m^3, as nearly as whole balls can; at least one.

    Stops soon after `most` of them.
    """
    found = sizes.draw(64, stream)
    sixth = np.pi / 6.0
    while len(found) <= most and sixth * total(found * found * found) < volume:
        found = np.concatenate([found, sizes.draw(len(found), stream)])
    sums = sixth * np.cumsum(found * found * found)
    above = int(np.searchsorted(sums, volume))  # the first sum that is not less
    if above > 0 and (above == len(sums) or volume - sums[above - 1] < sums[above] - volume):
        above -= 1
    return found[: above + 1]
