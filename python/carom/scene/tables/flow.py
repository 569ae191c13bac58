"""The tables of balls that come and go: `[[inflow]]` and `[[outlet]]`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from carom.arrays import F64
from carom.scene.assembly.vectors import scaled, unit
from carom.scene.packing import Sizes, Stream
from carom.scene.packing.sizes import Rare
from carom.scene.tables.balls import MOST_BALLS, not_too_many, volume
from carom.scene.tables.base import Table
from carom.scene.tables.clumps import ROD, Clump, Spheres
from carom.scene.tables.fields import NOT_NEGATIVE, Bounds, Flag, Integer, Quantity, exactly_one, refuse
from carom.scene.tables.lists import Direction, Quaternion
from carom.scene.tables.quantities import (
    ZEROS,
    Density,
    Inertia,
    Length,
    Mass,
    Name,
    Position,
    Seed,
    Vec3,
    Velocity,
    key,
)
from carom.scene.tables.sizes import Sized

_BOX, _DISC = ("low", "high"), ("point", "normal", "radius")
OF_SIZES = ("radius", "diameter", "mean", "deviation", "smallest", "largest", "classes", "inertia", "shares")
"""Keys of an inflow that say what `spheres` says of clumps."""
_CURE = "give low and high (a box), or point, normal and radius (a disc)"


class Region(Table):
    """Where the centres of mass of what enters are: a box or a flat disc."""

    section: ClassVar[str] = "region"

    low: Position | None = key("lowest corner of a box", "m", default=None, examples=[[0.0, 0.0, 0.3]])
    high: Position | None = key(
        "highest corner of a box; equal coordinates make it flat",
        "m",
        default=None,
        examples=[[0.1, 0.1, 0.3]],
    )
    point: Position | None = key("centre of a disc", "m", default=None, examples=[[0.0, 0.0, 0.3]])
    normal: Annotated[Vec3, Direction()] | None = key(
        "normal of a disc, any length", default=None, examples=[[0.0, 0.0, 1.0]]
    )
    radius: Length | None = key("radius of a disc", "m", default=None, examples=[0.05])

    @model_validator(mode="after")
    def _box_or_disc(self) -> Self:
        given = {key for key in (*_BOX, *_DISC) if getattr(self, key) is not None}
        if given & set(_BOX) and given & set(_DISC):
            raise refuse(f"{' and '.join(sorted(given))} do not go together", _CURE)
        wanted = _DISC if given & set(_DISC) else _BOX
        missing = [key for key in wanted if key not in given]
        if missing:
            raise refuse(f"is incomplete: {' and '.join(missing)} missing", _CURE)
        if self.low is not None and self.high is not None:
            for k, axis in enumerate("xyz"):
                if self.high[k] < self.low[k]:
                    raise refuse(
                        f"is below low along {axis}", "give the highest corner of the box", ("high", k)
                    )
        return self

    def centre(self) -> Vec3:
        """Middle of the region, m."""
        if self.low is not None and self.high is not None:
            x, y, z = (0.5 * (a + b) for a, b in zip(self.low, self.high, strict=True))
            return x, y, z
        assert self.point is not None  # by _box_or_disc
        return self.point

    def as_core(self) -> tuple[Any, ...]:
        """`("box", low, high)` or `("disc", point, normal, radius)`."""
        if self.low is not None and self.high is not None:
            return "box", list(self.low), list(self.high)
        assert self.point is not None  # by _box_or_disc
        assert self.normal is not None
        assert self.radius is not None
        return "disc", list(self.point), list(scaled(self.normal)), self.radius

    def label(self) -> str:
        return "region"


class _Kind(Table):
    """What an inflow says of its balls or clumps besides the laws of sizes."""

    name: Name = key("prefix of the names; the number is appended", examples=["grain"])
    material: Name = key("name of its material", examples=["grain"])
    radius: Length | None = key(
        "radius r of all balls; or give `diameter`, or `sizes` and its keys, or `spheres`",
        "m",
        default=None,
        examples=["5 mm"],
    )
    spheres: Spheres | None = key(
        "let clumps enter, each of these spheres: centres and radii [x, y, z, radius] in own axes",
        "m",
        default=None,
        examples=[ROD],
    )
    orientation: Annotated[tuple[float, float, float, float], Quaternion()] | None = key(
        "of clumps, unit quaternion [w, x, y, z], own to fixed axes, with which they enter; if omitted, at random",
        default=None,
    )
    mass: Mass | None = key(
        "mass m of each ball or clump, if all have one size (or give density)",
        "kg",
        default=None,
        examples=["1.3 g"],
    )
    density: Density | None = key("density, instead of mass", "kg/m^3", default=None, examples=[2500.0])
    inertia: Inertia | None = key(
        "moment of inertia about any axis, if all have one size; if omitted, 2/5 m r^2 (homogeneous)",
        "kg m^2",
        default=None,
        examples=[5.2e-9],
    )


class Inflow(Sized, _Kind):
    """Balls or clumps that enter in the course of the run; `name = "grain"` makes grain1, grain2, ...

    Clumps are called grain1-, grain2-, ..., their balls grain1-1, grain1-2, ...
    """

    section: ClassVar[str] = "inflow"

    first_number: Annotated[int, Integer(Bounds(ge=0))] = key("number of the first one", default=1)
    count: Annotated[int, Integer(Bounds(ge=1, le=MOST_BALLS))] = key(
        "number of balls or clumps that enter in all", examples=[1000]
    )
    region: Region = key(
        "where they enter: `{ low, high }` of a box, or `{ point, normal, radius }` of a disc",
        examples=[{"low": [0.0, 0.0, 0.3], "high": [0.1, 0.1, 0.3]}],
    )
    rate: Annotated[float, Quantity("frequency", NOT_NEGATIVE)] = key(
        "balls or clumps per second; 0: as fast as there is room", "1/s", default=0.0, examples=[500.0]
    )
    start: Annotated[float, Quantity("time", NOT_NEGATIVE)] = key(
        "when the first may enter", "s", default=0.0
    )
    velocity: Velocity = key("velocity with which they enter", "m/s", default=ZEROS)
    spread: Annotated[float, Quantity("speed", NOT_NEGATIVE)] = key(
        "each component of that velocity is changed at random by at most this", "m/s", default=0.0
    )
    seed: Seed = key("seed of sizes, places, turns and velocities", examples=[1])

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        exactly_one(self.__dict__, "mass", "density")
        not_too_many(self.size(), "count")
        if self.sizes != "equal":
            for key in ("mass", "inertia"):
                if getattr(self, key) is not None:
                    raise refuse(f"{key} is that of one ball, and sizes differ", "give density alone")
        try:
            self.radii()
        except Rare as error:
            raise refuse(str(error), "widen smallest and largest, or move mean between them") from None
        return self

    def _sizes_given(self) -> Mapping[str, Any]:
        given = self.__dict__
        if self.spheres is not None:
            others = [
                key for key in (*OF_SIZES, "sizes") if given[key] != type(self).model_fields[key].default
            ]
            if others:
                raise refuse(f"both spheres and {others[0]} are given", "remove one of them")
            return {**given, "diameter": 2.0 * max(radius for *_, radius in self.spheres)}
        if self.orientation is not None:
            raise refuse("orientation is given without spheres", "balls are round: leave it out")
        if self.radius is None:
            if self.sizes == "equal" and self.diameter is None:
                raise refuse(
                    "no size is given", "give radius, or diameter, or sizes and its keys, or spheres"
                )
            return given
        if self.sizes != "equal" or self.diameter is not None:
            other = "diameter" if self.diameter is not None else "sizes"
            raise refuse(f"both radius and {other} are given", "remove one of them")
        return {**given, "diameter": 2.0 * self.radius}

    def shape(self) -> Clump | None:
        """The first of its clumps as it waits, with its centre of mass in the middle of the region; None of balls."""
        if self.spheres is None:
            return None
        given = {key: getattr(self, key) for key in ("name", "material", "spheres", "mass", "density")}
        clump = Clump.model_construct(**given, position=ZEROS, inertia=None, centre=None)
        turn = np.array(unit(self.orientation or (1.0, 0.0, 0.0, 0.0)))
        return clump.placed(np.array(self.region.centre()), turn).called(self.name, self.first_number)

    def clumps(self) -> list[Clump]:
        """Its clumps in the order in which they enter; none of balls."""
        shape, numbers = self.shape(), range(self.first_number, self.first_number + self.count)
        return [] if shape is None else [shape.called(self.name, k) for k in numbers]

    def radii(self) -> F64:
        """Radii of its balls in the order in which they enter, (n,), m: independent draws from the law of sizes."""
        shape = self.shape()
        return _radii(self.law(), self.seed, self.count) if shape is None else self._each(shape.radii())

    def least(self) -> tuple[F64, F64]:
        """Balls that what enters takes up in any case: centres (k, 3) from that of mass, and radii (k,), m.

        Of clumps that are turned at random it is a ball about the centre of mass, or nothing but that point.
        """
        shape = self.shape()
        if shape is None:
            return np.zeros((1, 3)), np.array([self.radii().max()])
        offsets, radii = shape.centres() - shape.middle(), shape.radii()
        if self.orientation is not None:
            return offsets, radii
        about = max(0.0, float((radii - np.linalg.norm(offsets, axis=1)).max()))
        return np.zeros((1, 3)), np.array([about])

    def _each(self, values: F64) -> F64:
        """Those of the balls of one clump for all of them."""
        return np.tile(values, self.count)

    def masses(self) -> F64:
        """Masses of its balls, (n,), kg."""
        if (shape := self.shape()) is not None:
            return self._each(shape.masses())
        if self.mass is not None:
            return np.full(self.count, self.mass)
        assert self.density is not None  # by _consistent
        return self.density * volume(self.radii())

    def inertias(self) -> F64:
        """Moments of inertia of its balls, (n,), kg m^2."""
        if (shape := self.shape()) is not None:
            return self._each(shape.inertias())
        if self.inertia is not None:
            return np.full(self.count, self.inertia)
        radius = self.radii()
        return 0.4 * self.masses() * radius * radius

    def size(self) -> int:
        """Number of balls."""
        return self.count * len(self.spheres or ((),))

    def ball_names(self) -> list[str]:
        """Names of the balls, in the order in which they enter."""
        if self.spheres is not None:
            return [name for clump in self.clumps() for name in clump.ball_names()]
        return [f"{self.name}{k}" for k in range(self.first_number, self.first_number + self.count)]

    def as_core(self, first: int) -> dict[str, Any]:
        """As the core takes it; `first` is the number of its first body, a ball or a clump."""
        turned = {} if self.spheres is None else {"turned": self.orientation is None}
        return {
            **turned,
            "bodies": (first, self.count),
            "region": self.region.as_core(),
            "rate": self.rate,
            "start": self.start,
            "velocity": list(self.velocity),
            "spread": self.spread,
            "seed": self.seed,
        }


@lru_cache(maxsize=8)  # a scene is looked at several times before it runs
def _radii(law: Sizes, seed: int, count: int) -> F64:
    found = 0.5 * law.draw(count, Stream(seed))
    found.flags.writeable = False
    return found


class Outlet(Table):
    """A box: bodies whose centre is in it (or outside of it) leave the run. In a periodic world any image counts."""

    section: ClassVar[str] = "outlet"

    low: Position = key("lowest corner", "m", examples=[[-1.0, -1.0, -0.2]])
    high: Position = key("highest corner", "m", examples=[[1.0, 1.0, -0.1]])
    inside: Annotated[bool, Flag()] = key(
        "true: bodies inside (in a periodic world: an image inside) leave; false: all others leave",
        default=True,
    )

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        for k, axis in enumerate("xyz"):
            if self.high[k] <= self.low[k]:
                raise refuse(f"is not above low along {axis}", "give the highest corner", ("high", k))
        return self

    def as_core(self) -> tuple[list[float], list[float], bool]:
        """As the core takes it."""
        return list(self.low), list(self.high), self.inside

    def label(self) -> str:
        return "scene.outlet"
