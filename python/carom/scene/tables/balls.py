"""The tables that are balls: `[[sphere]]`, and the generators of many, `[[rack]]` and `[[lattice]]`."""

from __future__ import annotations

from math import isqrt, pi
from typing import Annotated, ClassVar, Self, TypeVar

from pydantic import model_validator

from carom.arrays import F64
from carom.scene.assembly.vectors import cross, norm
from carom.scene.tables.base import Table
from carom.scene.tables.fields import Bounds, Choice, Integer, exactly_one, refuse
from carom.scene.tables.lists import Direction, Integers, Quaternion
from carom.scene.tables.quantities import (
    ZEROS,
    AngularVelocity,
    Density,
    Distance,
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

Radius = TypeVar("Radius", float, F64)

MOST_BALLS = 1_000_000
"""Balls of one generator at most: no input may make Carom allocate without bound."""


def volume(radius: Radius) -> Radius:
    """Volume of balls of that radius, or of each of these, m^3."""
    return 4.0 / 3.0 * pi * radius * radius * radius  # a power would raise OverflowError


class Ball(Table):
    """What single spheres and generators have in common: one kind of ball."""

    name: Name
    material: Name = key("name of its material", examples=["ball"])
    radius: Length = key("radius r", "m", examples=["28.575 mm", 0.028575])
    mass: Mass | None = key("mass m (or give density)", "kg", default=None, examples=[0.17, "170 g"])
    density: Density | None = key("density, instead of mass", "kg/m^3", default=None, examples=[1700.0])
    inertia: Inertia | None = key(
        "moment of inertia about any axis; if omitted, 2/5 m r^2 (homogeneous)",
        "kg m^2",
        default=None,
        examples=[5.5e-5],
    )

    @model_validator(mode="after")
    def _one_mass(self) -> Self:
        exactly_one(self.__dict__, "mass", "density")
        return self

    def mass_kg(self) -> float:
        """Mass, kg, whichever way it was given."""
        if self.mass is not None:
            return self.mass
        assert self.density is not None  # by _one_mass
        return self.density * volume(self.radius)

    def inertia_kg_m2(self) -> float:
        """Moment of inertia, kg m^2."""
        return 0.4 * self.mass_kg() * self.radius * self.radius if self.inertia is None else self.inertia


class Sphere(Ball):
    """One ball."""

    section: ClassVar[str] = "sphere"

    name: Name = key("name, unique among balls, clumps and walls", examples=["cue"])
    position: Position = key("centre at the start", "m", examples=[[0.0, 0.0, 0.028575]])
    velocity: Velocity = key("velocity at the start", "m/s", default=ZEROS)
    angular_velocity: AngularVelocity = key(
        "angular velocity at the start, in fixed axes", "rad/s", default=ZEROS
    )
    orientation: Annotated[tuple[float, float, float, float], Quaternion()] = key(
        "unit quaternion [w, x, y, z], body to fixed axes", default=(1.0, 0.0, 0.0, 0.0)
    )


def not_too_many(balls: int, key: str) -> None:
    """Refuse a number of balls before anything is built from it."""
    if balls > MOST_BALLS:
        raise refuse(f"makes {balls} balls, more than {MOST_BALLS}", f"reduce {key}")


class Generator(Ball):
    """A table that stands for many balls, numbered from `first_number`: `name = "ball"` makes ball1, ball2, ..."""

    name: Name = key("prefix of the names; the number is appended", examples=["ball"])
    first_number: Annotated[int, Integer(Bounds(ge=0))] = key("number of the first ball", default=1)
    jitter: Distance = key("each centre is moved at random by at most this along each axis", "m", default=0.0)
    seed: Seed | None = key(
        "seed of the jitter (PCG64); needed if jitter is not zero", default=None, examples=[1]
    )

    @model_validator(mode="after")
    def _jitter_has_seed(self) -> Self:
        if self.jitter > 0 and self.seed is None:
            raise refuse(
                "jitter is given without a seed", "add seed = 1, so that the same file makes the same balls"
            )
        return self

    def size(self) -> int:
        """Number of balls."""
        raise NotImplementedError

    def ball_names(self) -> list[str]:
        return [f"{self.name}{k}" for k in range(self.first_number, self.first_number + self.size())]


class Rack(Generator):
    """A billiard rack: rows of touching balls, numbered from the apex, each row from left to right."""

    section: ClassVar[str] = "rack"

    shape: Annotated[str, Choice(("triangle", "diamond"))] = key(
        "triangle: rows of 1, 2, 3, ...; diamond: 1, 2, 3, 2, 1", default="triangle"
    )
    balls: Annotated[int, Integer(Bounds(ge=1, le=MOST_BALLS))] | None = key(
        "number of balls: 3, 6, 10, 15, ... in a triangle; 4, 9, 16, ... in a diamond",
        default=None,
        examples=[15],
    )
    rows: Annotated[int, Integer(Bounds(ge=1, le=MOST_BALLS))] | None = key(
        "number of rows, instead of balls (odd in a diamond)", default=None, examples=[5]
    )
    apex: Position = key("centre of the first ball", "m", examples=[[1.905, 0.635, 0.028575]])
    direction: Annotated[Vec3, Direction(example="[1.0, 0.0, 0.0]")] = key(
        "from the apex to the last row, any length", examples=[[1.0, 0.0, 0.0]]
    )
    up: Annotated[Vec3, Direction()] = key(
        "normal of the table that the rack lies on, any length", default=(0.0, 0.0, 1.0)
    )
    gap: Distance = key("distance between the surfaces of neighbours", "m", default=0.0)

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        exactly_one(self.__dict__, "balls", "rows")
        if self.shape == "diamond" and self.rows is not None and self.rows % 2 == 0:
            raise refuse(
                f"a diamond has an odd number of rows, found {self.rows}", f"give rows = {self.rows + 1}"
            )
        not_too_many(self.size(), "rows")
        full = sum(self.row_lengths())
        if self.balls is not None and self.balls != full:
            near = f"{full} or {sum(self.row_lengths(1))}"
            raise refuse(f"{self.balls} balls do not fill a {self.shape}", f"give {near} balls")
        if norm(cross(self.direction, self.up)) < 1e-6 * norm(self.direction) * norm(self.up):
            raise refuse("direction and up are parallel", "give a direction within the table")
        return self

    def row_lengths(self, more: int = 0) -> list[int]:
        """Balls in each row, apex first: the largest rack with at most `balls` balls (and `more` sizes above it)."""
        if self.shape == "triangle":
            rows = self.rows if self.rows is not None else (isqrt(8 * (self.balls or 1) + 1) - 1) // 2
            return list(range(1, rows + more + 1))
        half = (self.rows + 1) // 2 if self.rows is not None else isqrt(self.balls or 1)
        half += more
        return [*range(1, half + 1), *range(half - 1, 0, -1)]

    def size(self) -> int:
        if self.balls is not None or self.rows is None:
            return self.balls or 1
        half = (self.rows + 1) // 2
        return half * half if self.shape == "diamond" else self.rows * (self.rows + 1) // 2


class Lattice(Generator):
    """Balls on a regular grid, numbered with x fastest, then y, then z."""

    section: ClassVar[str] = "lattice"

    kind: Annotated[str, Choice(("cubic", "bcc", "fcc", "hcp"))] = key(
        "simple, body-centred or face-centred cubic, or hexagonal close packing (layers normal to z)",
        default="cubic",
    )
    counts: Annotated[tuple[int, int, int], Integers(3, Bounds(ge=1, le=MOST_BALLS))] = key(
        "number of balls along x, y and z", examples=[[3, 3, 3]]
    )
    origin: Position = key("centre of the first ball", "m")
    spacing: Length | None = key("distance of neighbouring centres; if omitted, 2 r", "m", default=None)
    velocity: Velocity = key("velocity of all its balls at the start", "m/s", default=ZEROS)

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        not_too_many(self.size(), "counts")
        return self

    def size(self) -> int:
        a, b, c = self.counts
        return a * b * c
