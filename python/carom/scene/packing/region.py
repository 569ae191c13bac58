"""Where a packing may be: a box, a cylinder or a sphere, each seen from its own centre and along its own axes.

Balls are placed and moved in this frame; `to_world` turns and shifts them at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import Any, Protocol

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.numeric import is_number, three
from carom.scene.assembly.vectors import cross, scaled
from carom.scene.tables.quantities import Vec3
from carom.units import number


class Region(Protocol):
    """What the growth of a packing asks of the space it fills."""

    def __hash__(self) -> int: ...

    @property
    def volume(self) -> float:
        """Of the empty region, m^3."""

    @property
    def half(self) -> F64:
        """Half the edges of the box around it, (3,) m."""

    @property
    def period(self) -> F64:
        """Lengths of the axes that are periodic, 0 for others, (3,) m."""

    @property
    def widest(self) -> float:
        """Radius of the largest ball that has room in it, m."""

    def depth(self, x: F64, radius: F64) -> tuple[F64, F64]:
        """How deep each ball is in the walls at the worst place, (N,) m, negative inside; and the sum of the vectors that
        bring it back from each wall, (N, 3) m.
        """

    def to_world(self, x: F64) -> F64:
        """Positions in fixed axes."""


def in_metres(given: Any, *lengths: str, rows: Sequence[str] = ()) -> None:
    """Reads the texts with a unit, as "1 cm", among lengths of a frozen record, and those in `rows` of lengths, as places
    are. Numbers stay as they are.
    """
    owner = type(given).__name__
    for name in (*lengths, *rows):
        value = getattr(given, name)
        if name in lengths and isinstance(value, str):
            object.__setattr__(given, name, number(owner, name, value, "length"))
        elif name in rows and isinstance(value, list | tuple) and any(isinstance(x, str) for x in value):
            read = tuple(number(owner, name, x, "length") for x in value)
            object.__setattr__(given, name, read)


def _positive(region: str, **lengths: float) -> None:
    for name, value in lengths.items():
        if not (is_number(value) and 0.0 < value < inf):
            found = f"{value:g} m" if is_number(value) else repr(value)
            raise CaromError(f"{region}: {name} = {found}; give a length above 0, in m")


@dataclass(frozen=True)
class Box:
    """A box along the fixed axes; `periodic` says which of them have no walls."""

    low: Vec3
    high: Vec3
    periodic: tuple[bool, bool, bool] = (False, False, False)

    def __post_init__(self) -> None:
        in_metres(self, rows=("low", "high"))
        three("Box", low=self.low, high=self.high)
        periodic: Any = self.periodic
        words = isinstance(
            periodic, str
        )  # of a scenario: `periodic = "xy"`; an array has no axes of this name
        if words or len(periodic) != 3 or not all(isinstance(x, bool | np.bool_) for x in periodic):
            meant = tuple(axis in periodic for axis in "xyz") if words else (True, True, False)
            cure = f"give True or False for each of x, y and z, for example {meant}"
            raise CaromError(f"Box: periodic = {periodic!r}; {cure}")
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if not -inf < low < high < inf:
                raise CaromError(f"Box: along {axis} low = {low:g} m is not below high = {high:g} m")

    @property
    def volume(self) -> float:
        x, y, z = 2.0 * self.half
        return float(x * y * z)

    @property
    def half(self) -> F64:
        edges: F64 = np.array(self.high) - np.array(self.low)
        return 0.5 * edges

    @property
    def period(self) -> F64:
        lengths: F64 = np.where(self.periodic, 2.0 * self.half, 0.0)
        return lengths

    @property
    def widest(self) -> float:
        return float(np.where(self.periodic, 0.5 * self.half, self.half).min())  # images: four radii

    def depth(self, x: F64, radius: F64) -> tuple[F64, F64]:
        deep = np.abs(x) + radius[:, None] - self.half
        deep[:, np.array(self.periodic)] = -np.inf
        return deep.max(axis=1), -np.sign(x) * np.maximum(deep, 0.0)

    def to_world(self, x: F64) -> F64:
        turns = np.floor((x + self.half) / (2.0 * self.half))
        inside = x - self.period * turns  # moves nothing along other axes
        moved: F64 = 0.5 * (np.array(self.low) + np.array(self.high)) + inside
        return moved


@dataclass(frozen=True)
class Cylinder:
    """A cylinder; `point` is the middle of its axis."""

    point: Vec3
    axis: Vec3
    radius: float
    length: float

    def __post_init__(self) -> None:
        in_metres(self, "radius", "length", rows=["point"])
        _positive("Cylinder", radius=self.radius, length=self.length)
        three("Cylinder", point=self.point, axis=self.axis)
        if not any(self.axis):
            raise CaromError("Cylinder: an axis of zeros has no direction; give the axis a direction")

    @property
    def volume(self) -> float:
        return pi * self.radius * self.radius * self.length

    @property
    def half(self) -> F64:
        return np.array([self.radius, self.radius, 0.5 * self.length])

    @property
    def period(self) -> F64:
        return np.zeros(3)

    @property
    def widest(self) -> float:
        return min(self.radius, 0.5 * self.length)

    def depth(self, x: F64, radius: F64) -> tuple[F64, F64]:
        off = np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1])
        aside = off + radius - self.radius
        along = np.abs(x[:, 2]) + radius - 0.5 * self.length
        back = np.zeros_like(x)
        back[:, :2] = x[:, :2] * (-np.maximum(aside, 0.0) / np.maximum(off, 1e-300))[:, None]
        back[:, 2] = -np.sign(x[:, 2]) * np.maximum(along, 0.0)
        return np.maximum(aside, along), back

    def to_world(self, x: F64) -> F64:
        axis = scaled(self.axis)
        least = min(range(3), key=lambda k: abs(axis[k]))
        first = scaled(cross(axis, [1.0 if k == least else 0.0 for k in range(3)]))
        second = cross(axis, first)
        moved: F64 = np.array(self.point) + (
            x[:, :1] * np.array(first) + x[:, 1:2] * np.array(second) + x[:, 2:] * np.array(axis)
        )
        return moved


@dataclass(frozen=True)
class Ball:
    """The inside of a sphere about `point`."""

    point: Vec3
    radius: float

    def __post_init__(self) -> None:
        in_metres(self, "radius", rows=["point"])
        _positive("Ball", radius=self.radius)
        three("Ball", point=self.point)

    @property
    def volume(self) -> float:
        return 4.0 / 3.0 * pi * self.radius * self.radius * self.radius

    @property
    def half(self) -> F64:
        return np.full(3, self.radius)

    @property
    def period(self) -> F64:
        return np.zeros(3)

    @property
    def widest(self) -> float:
        return self.radius

    def depth(self, x: F64, radius: F64) -> tuple[F64, F64]:
        off = np.sqrt((x * x).sum(axis=1))
        deep = off + radius - self.radius
        return deep, x * (-np.maximum(deep, 0.0) / np.maximum(off, 1e-300))[:, None]

    def to_world(self, x: F64) -> F64:
        return np.array(self.point) + x
