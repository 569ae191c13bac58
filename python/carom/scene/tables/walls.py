"""The tables of what stands or moves as prescribed: `[[plane]]`, `[[box]]` and the others of `WALLS`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import GetCoreSchemaHandler, PrivateAttr, model_validator
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from carom.errors import quoted
from carom.scene.assembly import mesh_files
from carom.scene.assembly.rotations import rotated
from carom.scene.assembly.triangles import Triangles
from carom.scene.assembly.vectors import cross, dot, norm, scaled, unit
from carom.scene.tables.base import Table
from carom.scene.tables.fields import (
    POSITIVE,
    Checked,
    Choice,
    Flag,
    Quantity,
    Text,
    exactly_one,
    inside,
    refuse,
)
from carom.scene.tables.free import Free
from carom.scene.tables.lists import Direction, Lengths, Quaternion, as_list, each
from carom.scene.tables.motion import Motion
from carom.scene.tables.quantities import ZEROS, Distance, Length, Name, Position, Vec3, key

SIDES = ("low_x", "high_x", "low_y", "high_y", "low_z", "high_z")
"""The sides of a box, in the order in which they become walls."""
PARALLEL = 1e-6
"""Sine of the angle below which two directions count as parallel."""
PLANE = "plane"
"""Kind of the half-spaces, which the core keeps apart from the other shapes."""
MESH = "mesh"
"""Kind of the surfaces of triangles, which the core keeps behind all others; its one parameter is a `Triangles`."""
X, Y, Z = AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

Shape = tuple[Any, ...]
"""Kind and parameters: `("rectangle", normal, side, [a, b])` and so on, see `_core.pyi`. The last parameter is a truth
value, whether spheres live inside, of shapes that have an inside and an outside, and of no others.
"""


@dataclass(frozen=True)
class Piece:
    """One surface that a table stands for, where it is at the start."""

    name: str
    shape: Shape
    point: Vec3
    motion: Motion | None
    pivot: Vec3
    """Point of the axis of rotation where the motion does not name one, m."""
    free: Free | None = None
    """How it moves where nothing prescribes it."""


@dataclass(frozen=True)
class Sides(Checked):
    """Some of the sides of a box, each once."""

    def check(self, value: Any) -> tuple[str, ...]:
        value = as_list(value)
        if not isinstance(value, list | tuple):
            cure = 'write a list of sides, as ["high_z"]'
            raise refuse(f"expected a list of sides, found {quoted(value)}", cure)
        sides = each(value, Choice(SIDES).check)
        if len(set(sides)) < len(sides):
            twice = next(s for s in sides if sides.count(s) > 1)
            raise refuse(f"names {quoted(twice)} twice", "name each side once")
        return tuple(sides)

    def json_schema(self) -> dict[str, Any]:
        return {"type": "array", "items": {"enum": list(SIDES)}, "uniqueItems": True}


_MOTION: Any = key(
    "how it moves, see below; if omitted, it stands",
    default=None,
    examples=[{"translation": [0.0, 0.0, {"expression": "0.002*sin(100*t)"}]}],
)
_INSIDE: Any = key("true: spheres live inside; false: they live outside", default=True)


class Wall(Table):
    """What all walls have in common."""

    name: Name = key("name, unique among balls, clumps and walls", examples=["bed"])
    material: Name = key("name of its material", examples=["cloth"])

    def pieces(self) -> list[Piece]:
        """The surfaces that the table stands for."""
        raise NotImplementedError

    def wall_names(self) -> list[str]:
        """Their names."""
        return [piece.name for piece in self.pieces()]


class Plane(Wall):
    """A half-space; spheres live on the side of its normal. With `size` or `radius` it is a piece of a plane."""

    section: ClassVar[str] = "plane"

    point: Position = key("any point of the plane; of a piece, its centre", "m", examples=[[0.0, 0.0, 0.0]])
    normal: Annotated[Vec3, Direction()] = key(
        "points to the side where spheres live; any length but zero", examples=[[0.0, 0.0, 1.0]]
    )
    size: Annotated[tuple[float, float], Lengths(size=2)] | None = key(
        "lengths of a rectangle along `side` and across it; if omitted, the plane has no end",
        "m",
        default=None,
        examples=[[0.2, 0.1]],
    )
    side: Annotated[Vec3, Direction(example="[1.0, 0.0, 0.0]")] | None = key(
        "direction of the first side of the rectangle, made perpendicular to the normal;"
        " if omitted, x, or y where the normal is along x",
        default=None,
        examples=[[1.0, 0.0, 0.0]],
    )
    radius: Length | None = key("radius of a disc", "m", default=None, examples=[0.1])
    hole: Distance | None = key(
        "radius of the hole of a disc, which makes it a ring", "m", default=None, examples=[0.02]
    )
    motion: Motion | None = _MOTION
    free: Free | None = key(
        "how it moves freely along its normal, see below; if omitted, it stands or moves as prescribed",
        default=None,
        examples=[{"mass": 0.5, "pressure": "1 kPa", "area": 0.01}],
    )

    @model_validator(mode="after")
    def _one_outline(self) -> Self:
        if self.free is not None and self.motion is not None:
            raise refuse("both motion and free are given", "give one of them", ("free",))
        if self.free is not None and (self.size is not None or self.radius is not None):
            outline = "size" if self.size is not None else "radius"
            cause = f"a free wall is a plane without end, and {outline} is given"
            raise refuse(cause, f"leave {outline} out", (outline,))
        if self.size is not None and self.radius is not None:
            cause = "both size (a rectangle) and radius (a disc) are given"
            raise refuse(cause, "give one of them", ("radius",))
        if self.side is not None and self.size is None:
            raise refuse("side is given without size", "add size = [a, b] (m)", ("side",))
        if self.hole is not None and (self.radius is None or self.hole >= self.radius):
            cause = "hole is given without radius" if self.radius is None else "is not below radius"
            raise refuse(cause, "give a radius greater than that of the hole", ("hole",))
        if self.side is not None:
            across = norm(cross(self.side, self.normal))
            if across < PARALLEL * norm(self.side) * norm(self.normal):
                raise refuse("is parallel to the normal", "give a direction within the plane", ("side",))
        return self

    def pieces(self) -> list[Piece]:
        normal = direction_of(self.normal)
        shape: Shape = (PLANE, normal)
        if self.size is not None:
            shape = ("rectangle", normal, _in_plane(self.side, normal), list(self.size))
        elif self.radius is not None:
            shape = ("disc", normal, self.radius, self.hole or 0.0)
        return [Piece(self.name, shape, self.point, self.motion, self.point, self.free)]


class Cylinder(Wall):
    """A circular tube, with open ends; its covers are discs."""

    section: ClassVar[str] = "cylinder"

    point: Position = key("middle of its axis", "m", examples=[[0.0, 0.0, 0.0]])
    axis: Annotated[Vec3, Direction(example="[0.0, 1.0, 0.0]")] = key(
        "direction of its axis, any length", examples=[[0.0, 1.0, 0.0]]
    )
    radius: Length = key("radius", "m", examples=[0.1])
    length: Length | None = key("length; if omitted, the tube has no end", "m", default=None, examples=[0.2])
    inside: Annotated[bool, Flag()] = _INSIDE
    motion: Motion | None = _MOTION

    def pieces(self) -> list[Piece]:
        length = math.inf if self.length is None else self.length
        shape = ("cylinder", direction_of(self.axis), self.radius, length, self.inside)
        return [Piece(self.name, shape, self.point, self.motion, self.point)]


class BallWall(Wall):
    """A sphere as a wall: a bowl that holds all, or a ball that stands or moves as prescribed."""

    section: ClassVar[str] = "ball_wall"

    point: Position = key("centre", "m", examples=[[0.0, 0.0, 0.0]])
    radius: Length = key("radius", "m", examples=[0.1])
    inside: Annotated[bool, Flag()] = _INSIDE
    motion: Motion | None = _MOTION

    def pieces(self) -> list[Piece]:
        shape = ("sphere", self.radius, self.inside)
        return [Piece(self.name, shape, self.point, self.motion, self.point)]


class Cone(Wall):
    """A circular cone or a piece of one between two rings, with open ends."""

    section: ClassVar[str] = "cone"

    point: Position = key("centre of its first ring", "m", examples=[[0.0, 0.0, 0.0]])
    axis: Annotated[Vec3, Direction()] = key(
        "from the first ring to the last, any length", examples=[[0.0, 0.0, 1.0]]
    )
    radius: Distance = key("radius of the first ring, 0 for a tip", "m", examples=[0.02])
    radius_end: Distance = key("radius of the last ring, 0 for a tip", "m", examples=[0.1])
    length: Length = key("distance of the rings along the axis", "m", examples=[0.1])
    inside: Annotated[bool, Flag()] = _INSIDE
    motion: Motion | None = _MOTION

    @model_validator(mode="after")
    def _is_a_cone(self) -> Self:
        if self.radius == self.radius_end:
            cure = "write a [[cylinder]], whose point is the middle of its axis"
            raise refuse("radius and radius_end are equal: this is a cylinder", cure, ("radius_end",))
        return self

    def pieces(self) -> list[Piece]:
        shape = ("cone", direction_of(self.axis), self.radius, self.radius_end, self.length, self.inside)
        return [Piece(self.name, shape, self.point, self.motion, self.point)]


class Box(Wall):
    """Up to six planes around a room; they move together. They are called `name.low_x`, `name.high_x` ..."""

    section: ClassVar[str] = "box"

    low: Position = key("lowest corner", "m", examples=[[0.0, 0.0, 0.0]])
    high: Position = key("highest corner", "m", examples=[[0.1, 0.1, 0.2]])
    open: Annotated[tuple[str, ...], Sides()] = key(
        f"sides without a wall, of {', '.join(SIDES)}", default=(), examples=[["high_z"]]
    )
    finite: Annotated[bool, Flag()] = key(
        "true: the sides end at the edges of the box; false: they are planes without end", default=False
    )
    motion: Motion | None = _MOTION

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        for k, axis in enumerate("xyz"):
            if self.high[k] <= self.low[k]:
                cause = f"is not above low along {axis}: {self.high[k]:g} m after {self.low[k]:g} m"
                raise refuse(cause, "give the highest corner, each coordinate above that of low", ("high", k))
        if len(self.open) == len(SIDES):
            raise refuse("all six sides are open", "leave a side out of open, or remove the box", ("open",))
        return self

    def pieces(self) -> list[Piece]:
        return [self._side(side) for side in SIDES if side not in self.open]

    def _side(self, side: str) -> Piece:
        """The wall on one side, a rectangle if it is finite. The box turns about its centre."""
        end, _, letter = side.partition("_")
        k = "xyz".index(letter)
        x, y, z = (0.5 * (a + b) for a, b in zip(self.low, self.high, strict=True))
        middle = [x, y, z]
        sign, middle[k] = (1.0, self.low[k]) if end == "low" else (-1.0, self.high[k])
        normal = [sign * c + 0.0 for c in AXES[k]]
        shape: Shape = (PLANE, normal)
        if self.finite:
            first, second = (j for j in range(3) if j != k)
            size = [self.high[j] - self.low[j] for j in (first, second)]
            shape = ("rectangle", normal, list(AXES[first]), size)
        return Piece(f"{self.name}.{side}", shape, (middle[0], middle[1], middle[2]), self.motion, (x, y, z))


@dataclass(frozen=True)
class Rows(Checked):
    """A list of rows of three numbers, of `kind` "f" or whole ones "i", as a NumPy array that cannot be written to."""

    kind: str

    def check(self, value: Any) -> np.ndarray[Any, Any]:
        try:
            found = np.array(value)
        except (ValueError, OverflowError):
            found = np.zeros(0)
        kinds = "iuf" if self.kind == "f" else "iu"
        if found.ndim != 2 or found.shape[1] != 3 or not len(found) or found.dtype.kind not in kinds:
            what = "numbers" if self.kind == "f" else "whole numbers"
            raise refuse(f"expected rows of three {what}", "write [[0, 1, 2], [1, 3, 2]], a row for each")
        found = found.astype(np.float64 if self.kind == "f" else np.int64)
        found.flags.writeable = False
        return found

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        as_rows = core_schema.plain_serializer_function_ser_schema(
            lambda rows: None if rows is None else rows.tolist()
        )
        return core_schema.no_info_plain_validator_function(self.check, serialization=as_rows)

    def json_schema(self) -> dict[str, Any]:
        item = {"type": "number" if self.kind == "f" else "integer"}
        row = {"type": "array", "items": item, "minItems": 3, "maxItems": 3}
        return {"type": "array", "items": row, "minItems": 1}


class Mesh(Wall):
    """A surface of triangles, from a file or from lists; a sheet with two faces, closed or not."""

    section: ClassVar[str] = "mesh"

    file: Annotated[str, Text(1, 4096)] | None = key(
        "STL, OBJ or PLY file, from the place of the scenario file on", default=None, examples=["hopper.stl"]
    )
    vertices: Annotated[Any, Rows("f")] | None = key(
        "points, in place of a file, before `scale`",
        default=None,
        examples=[[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]],
    )
    triangles: Annotated[Any, Rows("i")] | None = key(
        "three points each, counted from 0", default=None, examples=[[[0, 1, 2]]]
    )
    scale: Annotated[float, Quantity("number", POSITIVE)] = key(
        "length in m of the unit of the points: 0.001 for a file in millimetres",
        default=1.0,
        examples=[0.001],
    )
    point: Position = key("where the origin of the points is placed", "m", default=ZEROS)
    orientation: Annotated[tuple[float, float, float, float], Quaternion()] = key(
        "how the points are turned about their origin, a unit quaternion, w first",
        default=(1.0, 0.0, 0.0, 0.0),
    )
    clean: Annotated[bool, Flag()] = key(
        "true: triangles without an area are left out; false: they are refused", default=False
    )
    motion: Motion | None = _MOTION

    _read: tuple[tuple[str, bool], Triangles] | None = PrivateAttr(None)
    _placed: Triangles | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _is_a_mesh(self) -> Self:
        exactly_one(self.__dict__, "file", "vertices")
        if (self.vertices is None) != (self.triangles is None):
            given, missing = ("triangles", "vertices") if self.vertices is None else ("vertices", "triangles")
            raise refuse(f"{given} are given without {missing}", f"add {missing}", (given,))
        at = "file" if self.file is not None else "triangles"
        try:
            made = self._surface()
            placed = rotated(np.array(unit(self.orientation)), self.scale * made.vertices)
            placed += np.array(self.point)
            self._placed = Triangles(placed, made.corners)
        except PydanticCustomError as error:
            raise inside(at, error) from None
        return self

    def _surface(self) -> Triangles:
        """The triangles as they are given. A file is read once, so that a scene stays what it was read as."""
        if self.file is None:
            assert self.vertices is not None
            assert self.triangles is not None
            return mesh_files.checked(self.vertices, self.triangles, clean=self.clean)
        if self._read is None or self._read[0] != (self.file, self.clean):
            made = mesh_files.surface(self.file, clean=self.clean)
            self._read = ((self.file, self.clean), made)
        return self._read[1]

    @property
    def read(self) -> dict[tuple[str, bool], Triangles]:
        """What was read of its file, for `mesh_files.kept`."""
        return dict([self._read]) if self._read is not None else {}

    def pieces(self) -> list[Piece]:
        return [Piece(self.name, (MESH, self._placed), self.point, self.motion, self.point)]

    def resolved(self) -> Mesh:
        """The same with the points and triangles of its file."""
        made = self._surface()
        given = self.written() | {"vertices": made.vertices, "triangles": made.corners}
        return Mesh(**{name: value for name, value in given.items() if name not in ("file", "clean")})


def _in_plane(side: Vec3 | None, normal: list[float]) -> list[float]:
    """The direction of the first side of a rectangle: `side`, or x (y), made perpendicular to the normal."""
    n = scaled(normal)
    along = scaled(side) if side is not None else X
    if side is None and math.hypot(*cross(X, n)) < PARALLEL:
        along = Y
    return direction_of([a - dot(along, n) * c for a, c in zip(along, n, strict=True)])


def direction_of(direction: Sequence[float]) -> list[float]:
    """The unit vector along a direction."""
    return [c + 0.0 for c in scaled(direction)]  # no negative zeros


WALLS: dict[str, type[Wall]] = {
    "plane": Plane,
    "box": Box,
    "cylinder": Cylinder,
    "ball_wall": BallWall,
    "cone": Cone,
    "mesh": Mesh,
}
"""Tables of walls by section, in the order in which results and messages count walls."""
