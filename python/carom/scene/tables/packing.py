"""The table `[[packing]]`: balls at random, of one size or many, in a box, a cylinder or a sphere.

A packing stands for single spheres: `spheres()` of it are what the checks, the arrays and the resolved copy see.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import accumulate
from typing import Annotated, Any, ClassVar, Self

from pydantic import model_validator

from carom.errors import counted
from carom.scene.messages import Finding
from carom.scene.packing import (
    MOST_BALLS,
    Ball,
    Box,
    Cylinder,
    Packed,
    PackingError,
    Region,
    Sizes,
    Stream,
    draw,
    pack,
)
from carom.scene.tables.balls import Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.fields import Bounds, Choice, Integer, Quantity, exactly_one, refuse
from carom.scene.tables.lists import Direction
from carom.scene.tables.quantities import (
    ZEROS,
    Density,
    Distance,
    Length,
    Name,
    Position,
    Seed,
    Vec3,
    Velocity,
    key,
)
from carom.scene.tables.sizes import SIZES, Sized, exactly

REGIONS: dict[str, tuple[str, ...]] = {
    "box": ("low", "high"),
    "cylinder": ("point", "axis", "region_radius", "length"),
    "sphere": ("point", "region_radius"),
}
"""Keys that each region needs; it takes no others of them."""
FRACTION_OFF = 1.5
"""A fraction that is so many times that asked for is worth a word."""
AXES = ("", "x", "y", "z", "xy", "xz", "yz", "xyz")


class _Filling(Table):
    """What stands before the sizes."""

    name: Name = key("prefix of the names; the number is appended", examples=["grain"])
    material: Name = key("name of its material", examples=["grain"])
    density: Density = key("density of the balls", "kg/m^3", examples=[2500.0])
    seed: Seed = key("seed of sizes and places (PCG64)", examples=[1])
    count: Annotated[int, Integer(Bounds(ge=1, le=MOST_BALLS))] | None = key(
        "number of balls", default=None, examples=[1000]
    )
    fraction: Annotated[float, Quantity("number", Bounds(gt=0, le=0.95))] | None = key(
        "instead of count: volume of the balls over that of the region", default=None, examples=[0.6]
    )
    gap: Distance = key("kept free between any two balls, and half of it at walls", "m", default=0.0)


class Packing(Sized, _Filling):
    """Balls at random without overlaps, numbered from `first_number`: `name = "grain"` makes grain1, grain2, ..."""

    section: ClassVar[str] = "packing"

    region: Annotated[str, Choice(tuple(REGIONS))] = key(
        "what the balls lie in, as a whole: box, cylinder, sphere", default="box"
    )
    low: Position | None = key("box: lowest corner", "m", default=None, examples=[[0.0, 0.0, 0.0]])
    high: Position | None = key("box: highest corner", "m", default=None, examples=[[0.1, 0.1, 0.1]])
    periodic: Annotated[str, Choice(AXES)] = key(
        'box: axes without walls, "xy" for example; balls stick out there and fit the next box', default=""
    )
    point: Position | None = key(
        "cylinder: middle of the axis; sphere: centre", "m", default=None, examples=[[0.0, 0.0, 0.1]]
    )
    axis: Annotated[Vec3, Direction()] | None = key(
        "cylinder: its direction, any length", default=None, examples=[[0.0, 0.0, 1.0]]
    )
    region_radius: Length | None = key(
        "cylinder, sphere: radius of the region", "m", default=None, examples=[0.05]
    )
    length: Length | None = key("cylinder: its length", "m", default=None, examples=[0.2])
    velocity: Velocity = key("velocity of all its balls at the start", "m/s", default=ZEROS)
    first_number: Annotated[int, Integer(Bounds(ge=0))] = key("number of the first ball", default=1)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = self.__dict__
        exactly_one(given, "count", "fraction")
        exactly(given, "region", self.region, REGIONS)
        if self.periodic and self.region != "box":
            raise refuse(f"a {self.region} has no periodic axes", 'remove periodic, or give region = "box"')
        if self.low and self.high and not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise refuse("low is not below high along each axis", "exchange what is the wrong way round")
        return self

    def space(self) -> Region:
        """The region, for `carom.packing`."""
        if self.low and self.high:
            x, y, z = (axis in self.periodic for axis in "xyz")
            return Box(self.low, self.high, (x, y, z))
        assert self.point  # by _consistent
        assert self.region_radius
        if self.axis and self.length:
            return Cylinder(self.point, self.axis, self.region_radius, self.length)
        return Ball(self.point, self.region_radius)

    def size(self) -> int:
        """Number of balls."""
        return self.count or _size(self.space(), self.law(), self.seed, self.fraction)

    def ball_names(self) -> list[str]:
        return [f"{self.name}{k}" for k in range(self.first_number, self.first_number + self.size())]

    def packed(self) -> Packed:
        """The balls: centres, radii, and the fraction reached. Raises `PackingError` where there is no such packing."""
        found = _packed(self.space(), self.law(), self.seed, self.count, self.fraction, self.gap)
        if not isinstance(found, ValueError):
            return found
        raise found

    def fault(self) -> PackingError | None:
        """Why there is no such packing, or None if there is."""
        found = _packed(self.space(), self.law(), self.seed, self.count, self.fraction, self.gap)
        return found if isinstance(found, ValueError) else None

    def spheres(self) -> list[Sphere]:
        """Its balls one by one. Not checked again: all values come from checked ones."""
        found = self.packed()
        same: dict[str, Any] = {"material": self.material, "density": self.density}
        if "velocity" in self.model_fields_set:
            same["velocity"] = self.velocity
        rows = zip(self.ball_names(), found.radius.tolist(), map(tuple, found.position.tolist()), strict=True)
        # Copies of one: to construct each anew takes three times as long.
        one = Sphere.model_construct(name=self.name, radius=0.0, position=(0.0, 0.0, 0.0), **same)
        return [
            one.model_copy(update={"name": name, "radius": radius, "position": position})
            for name, radius, position in rows
        ]


def faults(packings: Sequence[Packing]) -> tuple[list[Finding], dict[int, Packing]]:
    """What is wrong with packings that cannot be had; and the others, by their place."""
    wrong, good = [], {}
    for i, packing in enumerate(packings):
        fault = packing.fault()
        if fault is None:
            good[i] = packing
        else:
            key = "count" if packing.count else "fraction"
            wrong.append(Finding(("packing", i, key), fault.cause, fault.cure))
    return wrong, good


def advise_packings(packings: Mapping[int, Packing]) -> Iterator[Finding]:
    """Packings of a few balls cannot have every fraction: whole balls are drawn, one at the least."""
    for i, packing in packings.items():
        if packing.fraction is None:
            continue
        found, balls = packing.packed().fraction, packing.size()
        if not 1.0 / FRACTION_OFF <= found / packing.fraction <= FRACTION_OFF:
            cause = f"{packing.fraction:g} cannot be had of whole balls:"
            cause += f" the fraction of {counted(balls, 'ball')} is {found:.4g}"
            yield Finding(("packing", i, "fraction"), cause, "give count, or a larger fraction or region")


class Places:
    """Where findings about the spheres of packings belong, which stand behind `spheres` single ones."""

    def __init__(self, spheres: int, packings: Mapping[int, Packing]) -> None:
        self._packings = packings
        self._first = list(accumulate((p.size() for p in packings.values()), initial=spheres))

    def found(self, findings: Iterable[Finding]) -> list[Finding]:
        """The findings, each once, with the packing in place of its spheres."""
        return list(dict.fromkeys(map(self._placed, findings)))

    def _placed(self, finding: Finding) -> Finding:
        section, *rest = finding.path
        if section != "sphere" or not rest or not isinstance(rest[0], int) or rest[0] < self._first[0]:
            return finding
        index, packing = list(self._packings.items())[bisect_right(self._first, rest[0]) - 1]
        key, cure = rest[1] if len(rest) > 1 else "name", finding.cure
        if key == "position":
            key = "low" if packing.region == "box" else "point"
            cure = "move the region of the packing, or give it a larger gap"
        elif key == "name":
            cure = "change name (the prefix) or first_number"
        elif key == "radius":
            key = SIZES[packing.sizes][0]
        return replace(finding, path=("packing", index, key), cure=cure)


@lru_cache(maxsize=16)
def _size(region: Region, law: Sizes, seed: int, fraction: float | None) -> int:
    return len(draw(region, law, Stream(seed), fraction=fraction))


@lru_cache(maxsize=8)  # a scene is looked at several times before it runs, and large packings take a minute
def _packed(
    region: Region, law: Sizes, seed: int, count: int | None, fraction: float | None, gap: float
) -> Packed | PackingError:
    try:
        found = pack(region, law, seed=seed, count=count, fraction=fraction, gap=gap)
    except PackingError as error:
        return error
    found.position.flags.writeable = found.radius.flags.writeable = False
    return found
