"""The scenario format, stated once: the tables, their keys, types and defaults.

The JSON Schema, the reference page, the messages and `carom.Scene` all follow from these classes. Rules that
concern more than one table (names, pairs of materials, overlaps) are in `checks`; the numerical options are
in `options`.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from carom.scene.tables.balls import Lattice, Rack, Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.billiard import BilliardTable
from carom.scene.tables.fields import (
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Flag,
    FlagOr,
    Integer,
    Pair,
    Quantity,
    Text,
    Version,
)
from carom.scene.tables.flow import Inflow, Outlet, Region
from carom.scene.tables.joints import Joint
from carom.scene.tables.laws import Law, LawValue
from carom.scene.tables.lists import Lengths, Vector
from carom.scene.tables.loads import Drag, Load, LoadFunction, Spring
from carom.scene.tables.motion import Motion, Rotation, SurfaceRotation
from carom.scene.tables.options import Run
from carom.scene.tables.packing import Packing
from carom.scene.tables.quantities import FARTHEST, ZEROS, Distance, Name, Position, Vec3, unit
from carom.scene.tables.walls import WALLS, BallWall, Box, Cone, Cylinder, Plane

FORMAT = 1


class Record(Table):
    """What is kept of a run; step counts are always whole."""

    section: ClassVar[str] = "record"

    every: Annotated[int, Integer(Bounds(ge=1))] | None = Field(
        None, description="steps between frames; if omitted, thinned to 1000 frames", examples=[1]
    )
    contacts: Annotated[bool, Flag()] = Field(
        True, description="keep the impulses of each contact, accumulated since the last frame"
    )
    impacts: Annotated[bool | str, FlagOr("every")] = Field(
        True,
        description="keep the table of impacts; piles of thousands fill gigabytes with it;"
        ' "every": in piles too a row for each impact problem, not for each step alone',
        examples=["every"],
    )
    walls: Annotated[bool, Flag()] | None = Field(
        None,
        description="keep the impulse on each wall since the last frame; if omitted, where a wall moves",
        examples=[True],
    )
    checkpoint_steps: Annotated[int, Integer(Bounds(ge=1))] | None = Field(
        None, description="steps between checkpoints", examples=[10_000]
    )
    checkpoint_time: Annotated[float, Quantity("time", POSITIVE)] | None = Field(
        None,
        description="simulated time between checkpoints",
        examples=[0.5],
        json_schema_extra=unit("s"),
    )
    checkpoint_wall: Annotated[float, Quantity("time", POSITIVE)] | None = Field(
        None,
        description="real time between checkpoints; without any of the three about 30 s, at most 2 % of the run",
        examples=[600.0],
        json_schema_extra=unit("s"),
    )


class World(Table):
    """What acts on all bodies."""

    section: ClassVar[str] = "world"

    gravity: Annotated[Vec3, Vector("acceleration", most=1e15)] = Field(
        description="acceleration of gravity, m/s^2; zeros for none",
        examples=[[0.0, 0.0, -9.8]],
        json_schema_extra=unit("m/s^2"),
    )
    periodic: Annotated[Vec3, Lengths(bounds=Bounds(ge=0, le=FARTHEST))] | None = Field(
        None,
        description="periods of the world along x, y, z; 0: none along that axis",
        examples=[[0.1, 0.1, 0.0]],
        json_schema_extra=unit("m"),
    )
    origin: Position = Field(
        ZEROS, description="lowest corner of the periodic box", json_schema_extra=unit("m")
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


class Scenario(Table):
    """A whole scenario file."""

    format: Annotated[int, Version(FORMAT)] = Field(description="version of this format", examples=[FORMAT])
    title: Annotated[str, Text()] = Field("", description="one line that says what this is")
    run: Run = Field(default_factory=Run, description="how to compute")
    record: Record = Field(default_factory=Record, description="what to keep")
    world: World = Field(description="what acts on all bodies")
    billiard_table: BilliardTable | None = Field(
        None, description="measures of a table of the billiards kit, for pictures"
    )
    material: list[Material] = Field(default_factory=list, description="names for contact laws")
    contact: list[Contact] = Field(
        default_factory=list, description="one per pair of materials that can meet"
    )
    sphere: list[Sphere] = Field(default_factory=list, description="single balls")
    rack: list[Rack] = Field(default_factory=list, description="billiard racks")
    lattice: list[Lattice] = Field(default_factory=list, description="grids of balls")
    packing: list[Packing] = Field(default_factory=list, description="random packings of balls")
    inflow: list[Inflow] = Field(
        default_factory=list, description="balls that enter in the course of the run"
    )
    outlet: list[Outlet] = Field(default_factory=list, description="boxes in which balls leave the run")
    plane: list[Plane] = Field(default_factory=list, description="half-spaces and pieces of planes")
    cylinder: list[Cylinder] = Field(default_factory=list, description="circular tubes as walls")
    ball_wall: list[BallWall] = Field(default_factory=list, description="spheres as walls")
    cone: list[Cone] = Field(default_factory=list, description="cones as walls")
    box: list[Box] = Field(default_factory=list, description="up to six planes around a room")
    joint: list[Joint] = Field(default_factory=list, description="constraints of the motion")
    load: list[Load] = Field(default_factory=list, description="forces and torques")
    spring: list[Spring] = Field(default_factory=list, description="springs and dampers")
    drag: list[Drag] = Field(default_factory=list, description="viscous drag")
    load_function: list[LoadFunction] = Field(
        default_factory=list, description="places of Python functions that give loads"
    )


SINGLE: dict[str, type[Table]] = {
    "run": Run,
    "record": Record,
    "world": World,
    "billiard_table": BilliardTable,
}
"""Tables written `[name]`; a scene may have no `billiard_table`."""

REPEATED: dict[str, type[Table]] = {
    "material": Material,
    "contact": Contact,
    "sphere": Sphere,
    "rack": Rack,
    "lattice": Lattice,
    "packing": Packing,
    "inflow": Inflow,
    "outlet": Outlet,
    **WALLS,
    "joint": Joint,
    "load": Load,
    "spring": Spring,
    "drag": Drag,
    "load_function": LoadFunction,
}
"""Tables written `[[name]]`, any number of times."""

NESTED: dict[str, type[Table]] = {
    "motion": Motion,
    "rotation": Rotation,
    "surface_rotation": SurfaceRotation,
    "region": Region,
}
"""Tables that are values of a key."""
