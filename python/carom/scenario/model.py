"""The scenario format, stated once: the tables, their keys, types and defaults.

The JSON Schema, the reference page, the messages and `carom.Scene` all follow from these classes. Rules that
concern more than one table (names, pairs of materials, overlaps) are in `checks`; the numerical options are
in `options`.
"""

from __future__ import annotations

from math import isqrt, pi
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from carom.scenario.fields import (
    NOT_NEGATIVE,
    Bounds,
    Choice,
    Direction,
    Flag,
    Integer,
    Integers,
    Pair,
    Quantity,
    Quaternion,
    Text,
    Vector,
    Version,
    exactly_one,
    refuse,
)
from carom.scenario.joints import Joint
from carom.scenario.laws import Law, LawValue
from carom.scenario.loads import Drag, Load, LoadFunction, Spring
from carom.scenario.options import Run
from carom.scenario.quantities import (
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
    unit,
)
from carom.scenario.table import Table
from carom.scenario.vectors import cross, norm

FORMAT = 1

MOST_BALLS = 10_000_000
"""Balls of one generator at most: no input may make Carom allocate without bound."""


class Record(Table):
    """What is kept of a run; impacts and step counts are always whole."""

    section: ClassVar[str] = "record"

    every: Annotated[int, Integer(Bounds(ge=1))] | None = Field(
        None, description="steps between frames; if omitted, thinned to 1000 frames", examples=[1]
    )
    contacts: Annotated[bool, Flag()] = Field(
        True, description="keep the impulses of each contact, accumulated since the last frame"
    )


class World(Table):
    """What acts on all bodies."""

    section: ClassVar[str] = "world"

    gravity: Annotated[Vec3, Vector("acceleration", most=1e15)] = Field(
        description="acceleration of gravity, m/s^2; zeros for none",
        examples=[[0.0, 0.0, -9.8]],
        json_schema_extra=unit("m/s^2"),
    )


class Material(Table):
    """A name that contact laws refer to; the constants belong to pairs of materials."""

    section: ClassVar[str] = "material"

    name: Name = Field(description="name, unique among materials", examples=["ball"])


class Contact(Table):
    """The contact law of a pair of materials. Every pair that can meet needs one."""

    section: ClassVar[str] = "contact"

    between: Annotated[tuple[str, str], Pair()] = Field(
        description="the two materials, in any order; the same twice for contact among equals",
        examples=[["ball", "cloth"]],
    )
    friction: Annotated[LawValue, Law("v", bounds=NOT_NEGATIVE)] = Field(
        description="coefficient mu of sliding friction, a number or a law of the slip speed v",
        examples=[0.2],
    )
    restitution: Annotated[float, Quantity("number", Bounds(ge=0, le=1))] = Field(
        description="normal restitution e_N, from 0 (no rebound) to 1", examples=[0.9]
    )
    tangential_restitution: Annotated[float, Quantity("number", Bounds(gt=-1, lt=1))] = Field(
        0.0, description="tangential restitution e_T", examples=[0.0]
    )
    rolling_radius: Distance = Field(
        0.0,
        description="rho: bound of the rolling moment over the normal force",
        json_schema_extra=unit("m"),
    )
    spinning_radius: Distance = Field(
        0.0,
        description="delta: bound of the spinning moment over the normal force",
        json_schema_extra=unit("m"),
    )

    def label(self) -> str:
        return f'scene.contact("{self.between[0]}", "{self.between[1]}")'


class Ball(Table):
    """What single spheres and generators have in common: one kind of ball."""

    name: Name
    material: Name = Field(description="name of its material", examples=["ball"])
    radius: Length = Field(
        description="radius r", examples=["28.575 mm", 0.028575], json_schema_extra=unit("m")
    )
    mass: Mass | None = Field(
        None, description="mass m (or give density)", examples=[0.17, "170 g"], json_schema_extra=unit("kg")
    )
    density: Density | None = Field(
        None, description="density, instead of mass", examples=[1700.0], json_schema_extra=unit("kg/m^3")
    )
    inertia: Inertia | None = Field(
        None,
        description="moment of inertia about any axis; if omitted, 2/5 m r^2 (homogeneous)",
        examples=[5.5e-5],
        json_schema_extra=unit("kg m^2"),
    )

    @model_validator(mode="after")
    def _one_mass(self) -> Self:
        wrong = exactly_one(self.__dict__, "mass", "density")
        if wrong:
            raise wrong
        return self

    def mass_kg(self) -> float:
        """Mass, kg, whichever way it was given."""
        if self.mass is not None:
            return self.mass
        assert self.density is not None  # by _one_mass
        return self.density * (
            4.0 / 3.0 * pi * self.radius * self.radius * self.radius
        )  # a power would raise OverflowError

    def inertia_kg_m2(self) -> float:
        """Moment of inertia, kg m^2."""
        return 0.4 * self.mass_kg() * self.radius * self.radius if self.inertia is None else self.inertia


class Sphere(Ball):
    """One ball."""

    section: ClassVar[str] = "sphere"

    name: Name = Field(description="name, unique among spheres and planes", examples=["cue"])
    position: Position = Field(
        description="centre at the start", examples=[[0.0, 0.0, 0.028575]], json_schema_extra=unit("m")
    )
    velocity: Velocity = Field(ZEROS, description="velocity at the start", json_schema_extra=unit("m/s"))
    angular_velocity: AngularVelocity = Field(
        ZEROS, description="angular velocity at the start, in fixed axes", json_schema_extra=unit("rad/s")
    )
    orientation: Annotated[tuple[float, float, float, float], Quaternion()] = Field(
        (1.0, 0.0, 0.0, 0.0), description="unit quaternion [w, x, y, z], body to fixed axes"
    )


class Plane(Table):
    """A fixed half-space; spheres live on the side of its normal."""

    section: ClassVar[str] = "plane"

    name: Name = Field(description="name, unique among spheres and planes", examples=["bed"])
    material: Name = Field(description="name of its material", examples=["cloth"])
    point: Position = Field(
        description="any point of the plane", examples=[[0.0, 0.0, 0.0]], json_schema_extra=unit("m")
    )
    normal: Annotated[Vec3, Direction()] = Field(
        description="points to the side where spheres live; any length but zero", examples=[[0.0, 0.0, 1.0]]
    )


class Generator(Ball):
    """A table that stands for many balls, numbered from `first_number`: `name = "ball"` makes ball1, ball2,
    ...
    """

    name: Name = Field(description="prefix of the names; the number is appended", examples=["ball"])
    first_number: Annotated[int, Integer(Bounds(ge=0))] = Field(1, description="number of the first ball")
    jitter: Distance = Field(
        0.0,
        description="each centre is moved at random by at most this along each axis",
        json_schema_extra=unit("m"),
    )
    seed: Seed | None = Field(
        None, description="seed of the jitter (PCG64); needed if jitter is not zero", examples=[1]
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

    shape: Annotated[str, Choice(("triangle", "diamond"))] = Field(
        "triangle", description="triangle: rows of 1, 2, 3, ...; diamond: 1, 2, 3, 2, 1"
    )
    balls: Annotated[int, Integer(Bounds(ge=1, le=MOST_BALLS))] | None = Field(
        None,
        description="number of balls: 3, 6, 10, 15, ... in a triangle; 4, 9, 16, ... in a diamond",
        examples=[15],
    )
    rows: Annotated[int, Integer(Bounds(ge=1, le=3000))] | None = Field(
        None, description="number of rows, instead of balls (odd in a diamond)", examples=[5]
    )
    apex: Position = Field(
        description="centre of the first ball",
        examples=[[1.905, 0.635, 0.028575]],
        json_schema_extra=unit("m"),
    )
    direction: Annotated[Vec3, Direction(example="[1.0, 0.0, 0.0]")] = Field(
        description="from the apex to the last row, any length", examples=[[1.0, 0.0, 0.0]]
    )
    up: Annotated[Vec3, Direction()] = Field(
        (0.0, 0.0, 1.0), description="normal of the table that the rack lies on, any length"
    )
    gap: Distance = Field(
        0.0, description="distance between the surfaces of neighbours", json_schema_extra=unit("m")
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        wrong = exactly_one(self.__dict__, "balls", "rows")
        if wrong:
            raise wrong
        if self.shape == "diamond" and self.rows is not None and self.rows % 2 == 0:
            raise refuse(
                f"a diamond has an odd number of rows, found {self.rows}", f"give rows = {self.rows + 1}"
            )
        full = sum(self.row_lengths())
        if self.balls is not None and self.balls != full:
            near = f"{full} or {sum(self.row_lengths(1))}"
            raise refuse(f"{self.balls} balls do not fill a {self.shape}", f"give {near} balls")
        if norm(cross(self.direction, self.up)) < 1e-6 * norm(self.direction) * norm(self.up):
            raise refuse("direction and up are parallel", "give a direction within the table")
        return self

    def row_lengths(self, more: int = 0) -> list[int]:
        """Balls in each row, apex first: the largest rack with at most `balls` balls (and `more` sizes above
        it).
        """
        if self.shape == "triangle":
            rows = self.rows if self.rows is not None else (isqrt(8 * (self.balls or 1) + 1) - 1) // 2
            return list(range(1, rows + more + 1))
        half = (self.rows + 1) // 2 if self.rows is not None else isqrt(self.balls or 1)
        half += more
        return [*range(1, half + 1), *range(half - 1, 0, -1)]

    def size(self) -> int:
        return sum(self.row_lengths())


class Lattice(Generator):
    """Balls on a regular grid, numbered with x fastest, then y, then z."""

    section: ClassVar[str] = "lattice"

    kind: Annotated[str, Choice(("cubic", "hcp"))] = Field(
        "cubic", description="simple cubic, or hexagonal close packing (layers normal to z)"
    )
    counts: Annotated[tuple[int, int, int], Integers(3, Bounds(ge=1, le=MOST_BALLS))] = Field(
        description="number of balls along x, y and z", examples=[[3, 3, 3]]
    )
    origin: Position = Field(description="centre of the first ball", json_schema_extra=unit("m"))
    spacing: Length | None = Field(
        None, description="distance of neighbouring centres; if omitted, 2 r", json_schema_extra=unit("m")
    )
    velocity: Velocity = Field(
        ZEROS, description="velocity of all its balls at the start", json_schema_extra=unit("m/s")
    )

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        if self.size() > MOST_BALLS:
            raise refuse(f"makes {self.size()} balls, more than {MOST_BALLS}", "reduce counts")
        return self

    def size(self) -> int:
        a, b, c = self.counts
        return a * b * c


class Scenario(Table):
    """A whole scenario file."""

    format: Annotated[int, Version(FORMAT)] = Field(description="version of this format", examples=[FORMAT])
    title: Annotated[str, Text()] = Field("", description="one line that says what this is")
    run: Run = Field(default_factory=Run, description="how to compute")
    record: Record = Field(default_factory=Record, description="what to keep")
    world: World = Field(description="what acts on all bodies")
    material: list[Material] = Field(default_factory=list, description="names for contact laws")
    contact: list[Contact] = Field(
        default_factory=list, description="one per pair of materials that can meet"
    )
    sphere: list[Sphere] = Field(default_factory=list, description="single balls")
    rack: list[Rack] = Field(default_factory=list, description="billiard racks")
    lattice: list[Lattice] = Field(default_factory=list, description="grids of balls")
    plane: list[Plane] = Field(default_factory=list, description="fixed half-spaces")
    joint: list[Joint] = Field(default_factory=list, description="constraints of the motion")
    load: list[Load] = Field(default_factory=list, description="forces and torques")
    spring: list[Spring] = Field(default_factory=list, description="springs and dampers")
    drag: list[Drag] = Field(default_factory=list, description="viscous drag")
    load_function: list[LoadFunction] = Field(
        default_factory=list, description="places of Python functions that give loads"
    )


SINGLE: dict[str, type[Table]] = {"run": Run, "record": Record, "world": World}
"""Tables written `[name]`."""

REPEATED: dict[str, type[Table]] = {
    "material": Material,
    "contact": Contact,
    "sphere": Sphere,
    "rack": Rack,
    "lattice": Lattice,
    "plane": Plane,
    "joint": Joint,
    "load": Load,
    "spring": Spring,
    "drag": Drag,
    "load_function": LoadFunction,
}
"""Tables written `[[name]]`, any number of times."""
