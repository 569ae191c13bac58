"""The scenario format, stated once: the tables, their keys, types and defaults.

The JSON Schema, the reference page, the messages and `carom.Scene` all follow from these classes. Rules that
concern more than one table (names, pairs of materials, overlaps) are in `checks`; the numerical options are
in `options`.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import model_validator

from carom.errors import quoted
from carom.scene.tables.balls import Lattice, Rack, Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.billiard import BilliardTable
from carom.scene.tables.clumps import Clump
from carom.scene.tables.deformation import Deformation
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
    refuse,
)
from carom.scene.tables.flow import Inflow, Outlet, Region
from carom.scene.tables.free import Free
from carom.scene.tables.joints import Joint
from carom.scene.tables.laws import Law, LawValue
from carom.scene.tables.lists import Lengths, Vector
from carom.scene.tables.loads import Drag, Load, LoadFunction, Spring
from carom.scene.tables.motion import Motion, Rotation, SurfaceRotation
from carom.scene.tables.options import Run
from carom.scene.tables.packing import Packing
from carom.scene.tables.quantities import FARTHEST, ZEROS, Distance, Name, Position, Vec3, key
from carom.scene.tables.walls import WALLS, BallWall, Box, Cone, Cylinder, Mesh, Plane

FORMAT = 1


class Record(Table):
    """What is kept of a run; step counts are always whole."""

    section: ClassVar[str] = "record"

    every: Annotated[int, Integer(Bounds(ge=1))] | None = key(
        "steps between frames; if omitted, thinned to 1000 frames", default=None, examples=[1]
    )
    contacts: Annotated[bool, Flag()] = key(
        "record the impulses of each contact, accumulated since the last frame", default=True
    )
    impacts: Annotated[bool | str, FlagOr(("every", "history"))] = key(
        "record the table of impacts; piles of thousands fill gigabytes with it."
        ' "every": in piles too a row for each impact problem, not for each step alone.'
        ' "history": that, and how impulses grow within each impact',
        default=True,
        examples=["every"],
    )
    walls: Annotated[bool, Flag()] | None = key(
        "record the impulse on each wall since the last frame; if omitted, where a wall moves",
        default=None,
        examples=[True],
    )
    checkpoint_steps: Annotated[int, Integer(Bounds(ge=1))] | None = key(
        "steps between checkpoints", default=None, examples=[10_000]
    )
    checkpoint_time: Annotated[float, Quantity("time", POSITIVE)] | None = key(
        "simulated time between checkpoints", "s", default=None, examples=[0.5]
    )
    checkpoint_wall: Annotated[float, Quantity("time", POSITIVE)] | None = key(
        "real time between checkpoints; without any of the three about 30 s, at most 2 % of the run",
        "s",
        default=None,
        examples=[600.0],
    )


class World(Table):
    """What acts on all bodies."""

    section: ClassVar[str] = "world"

    gravity: Annotated[Vec3, Vector("acceleration", most=1e15)] = key(
        "acceleration of gravity; zeros for none", "m/s^2", examples=[[0.0, 0.0, -9.8]]
    )
    periodic: Annotated[Vec3, Lengths(bounds=Bounds(ge=0, le=FARTHEST))] | None = key(
        "periods of the world along x, y, z; 0: none along that axis",
        "m",
        default=None,
        examples=[[0.1, 0.1, 0.0]],
    )
    origin: Position = key("lowest corner of the periodic box", "m", default=ZEROS)
    deformation: Deformation | None = key(
        "how the periodic box changes its size or is sheared; its centre stays", default=None
    )


class Material(Table):
    """A name that contact laws refer to; the constants belong to pairs of materials."""

    section: ClassVar[str] = "material"

    name: Name = key("name, unique among materials", examples=["ball"])


class Contact(Table):
    """The contact law of a pair of materials. Every pair that can meet needs one."""

    section: ClassVar[str] = "contact"

    between: Annotated[tuple[str, str], Pair()] = key(
        "the two materials, in any order; the same twice for contact among equals",
        examples=[["ball", "cloth"]],
    )
    friction: Annotated[LawValue, Law("v", bounds=NOT_NEGATIVE)] = key(
        "coefficient mu of sliding friction, a number or a law of the slip speed v", examples=[0.2]
    )
    restitution: Annotated[LawValue, Law("v", bounds=Bounds(ge=0, le=1))] = key(
        "normal restitution e_N, from 0 (no rebound) to 1, a number or a law of the approach speed v",
        examples=[0.9],
    )
    tangential_restitution: Annotated[float, Quantity("number", Bounds(gt=-1, le=1))] = key(
        "tangential restitution e_T, above -1 (slip stays) to 1 (slip turns round); "
        "law poisson has its own, compliant and binary have none",
        default=0.0,
        examples=[0.0],
    )
    stiffness_ratio: Annotated[float, Quantity("number", Bounds(gt=0))] = key(
        "stiffness over that of other pairs of equal radii, for impacts through springs", default=1.0
    )
    rolling_radius: Distance = key("rho: bound of the rolling moment over the normal force", "m", default=0.0)
    spinning_radius: Distance = key(
        "delta: bound of the spinning moment over the normal force", "m", default=0.0
    )
    cohesion: Annotated[float, Quantity("force", NOT_NEGATIVE)] = key(
        "attraction of the surfaces where they touch: the pull-off force", "N", default=0.0
    )
    rupture_distance: Distance = key(
        "gap at which cohesion, which falls linearly with the gap, is gone", "m", default=0.0
    )

    @model_validator(mode="after")
    def _cohesion_has_a_reach(self) -> Self:
        if self.cohesion and not self.rupture_distance:
            cure = "give the gap at which it is gone, in m; one that is small beside the balls makes a pull-off force"
            raise refuse("cohesion needs a rupture_distance above 0", cure)
        if self.rupture_distance and "cohesion" not in self.model_fields_set:
            cure = "add the pull-off force, in N (0 for none), or leave rupture_distance out"
            raise refuse("rupture_distance is given without cohesion", cure)
        return self

    def label(self) -> str:
        return f"scene.contact({', '.join(map(quoted, self.between))})"


class Scenario(Table):
    """A whole scenario file."""

    format: Annotated[int, Version(FORMAT)] = key("version of this format", examples=[FORMAT])
    title: Annotated[str, Text()] = key("one line that says what this is", default="")
    run: Run = key("how to compute", default_factory=Run)
    record: Record = key("what to keep", default_factory=Record)
    world: World = key("what acts on all bodies")
    billiard_table: BilliardTable | None = key(
        "measures of a table of the billiards kit, for pictures", default=None
    )
    material: list[Material] = key("names for contact laws", default_factory=list)
    contact: list[Contact] = key("one per pair of materials that can meet", default_factory=list)
    sphere: list[Sphere] = key("single balls", default_factory=list)
    rack: list[Rack] = key("billiard racks", default_factory=list)
    lattice: list[Lattice] = key("grids of balls", default_factory=list)
    clump: list[Clump] = key("rigid bodies made of spheres", default_factory=list)
    packing: list[Packing] = key("random packings of balls", default_factory=list)
    inflow: list[Inflow] = key("balls or clumps that enter in the course of the run", default_factory=list)
    outlet: list[Outlet] = key("boxes in which balls and clumps leave the run", default_factory=list)
    plane: list[Plane] = key("half-spaces and pieces of planes", default_factory=list)
    cylinder: list[Cylinder] = key("circular tubes as walls", default_factory=list)
    ball_wall: list[BallWall] = key("spheres as walls", default_factory=list)
    cone: list[Cone] = key("cones as walls", default_factory=list)
    box: list[Box] = key("up to six planes around a room", default_factory=list)
    mesh: list[Mesh] = key("surfaces of triangles as walls", default_factory=list)
    joint: list[Joint] = key("constraints of the motion", default_factory=list)
    load: list[Load] = key("forces and torques", default_factory=list)
    spring: list[Spring] = key("springs and dampers", default_factory=list)
    drag: list[Drag] = key("viscous drag", default_factory=list)
    load_function: list[LoadFunction] = key(
        "places of Python functions that give loads", default_factory=list
    )

    def clumps(self) -> list[Clump]:
        """All clumps in the order of the core: those of tables `[[clump]]`, then those that enter."""
        return [*self.clump, *(clump for inflow in self.inflow for clump in inflow.clumps())]


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
    "clump": Clump,
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
    "deformation": Deformation,
    "motion": Motion,
    "free": Free,
    "rotation": Rotation,
    "surface_rotation": SurfaceRotation,
    "region": Region,
}
"""Tables that are values of a key."""
