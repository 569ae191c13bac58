"""The walls of a scene in the order of the core: planes without end first, then all others, in the order of their tables.

Here a wall is one surface with its place at the start; a `[[box]]` is up to six of them. What the core gets, what the
checks measure and what is recorded all come from this list.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from carom.scenario.laws import as_core
from carom.scenario.motion import Motion
from carom.scenario.quantities import Vec3
from carom.scenario.table import Table
from carom.scenario.vectors import cross, dot, scaled
from carom.scenario.walls import PARALLEL, BallWall, Box, Cone, Cylinder, Plane, Wall

X, Y, Z = AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
PLANE = "plane"
"""Kind of the half-spaces, which the core keeps apart from the other shapes."""
FLAT = (PLANE, "rectangle", "disc")
"""Kinds of flat walls, whose first parameter is the normal."""

Shape = tuple[Any, ...]
"""Kind and parameters: `("rectangle", normal, side, [a, b])` and so on, see `_core.pyi`."""


@dataclass(frozen=True)
class Placed:
    """One surface at the start."""

    name: str
    section: str
    index: int
    """Place of its table."""
    material: str
    shape: Shape
    point: Vec3
    motion: Motion | None
    pivot: Vec3
    """Point of the axis of rotation where the motion does not name one, m."""

    @property
    def kind(self) -> str:
        return str(self.shape[0])


def placed_walls(entries: Mapping[str, Sequence[tuple[int, Table]]]) -> list[Placed]:
    """All walls of the tables, in the order of the core."""
    found: list[Placed] = []
    for section in ("plane", "box", "cylinder", "ball_wall", "cone"):
        for i, table in entries.get(section, ()):
            assert isinstance(table, Wall)
            found += _surfaces(table, section, i)
    return sorted(found, key=lambda wall: wall.kind != PLANE)  # stable


def _surfaces(table: Wall, section: str, index: int) -> list[Placed]:
    if isinstance(table, Box):
        return [_side(table, section, index, side) for side in table.sides()]
    assert isinstance(table, Plane | Cylinder | BallWall | Cone)
    shape = _shape(table)
    return [Placed(table.name, section, index, table.material, shape, table.point, table.motion, table.point)]


def _shape(table: Plane | Cylinder | BallWall | Cone) -> Shape:
    if isinstance(table, Cylinder):
        length = math.inf if table.length is None else table.length
        return "cylinder", _unit(table.axis), table.radius, length, table.inside
    if isinstance(table, Cone):
        return "cone", _unit(table.axis), table.radius, table.radius_end, table.length, table.inside
    if isinstance(table, BallWall):
        return "sphere", table.radius, table.inside
    normal = _unit(table.normal)
    if table.size is not None:
        return "rectangle", normal, _in_plane(table.side, normal), list(table.size)
    if table.radius is not None:
        return "disc", normal, table.radius, table.hole or 0.0
    return PLANE, normal


def _side(box: Box, section: str, index: int, side: str) -> Placed:
    """The wall on one side of a box; a finite one is a rectangle."""
    end, _, letter = side.partition("_")
    k = "xyz".index(letter)
    sign = 1.0 if end == "low" else -1.0
    normal = [sign * c + 0.0 for c in AXES[k]]
    corner = box.low if end == "low" else box.high
    middle = list(box.centre())
    middle[k] = corner[k]
    shape: Shape = (PLANE, normal)
    if box.finite:
        first, second = (j for j in range(3) if j != k)
        size = [box.high[j] - box.low[j] for j in (first, second)]
        shape = ("rectangle", normal, list(AXES[first]), size)
    x, y, z = middle
    return Placed(
        box.side_name(side), section, index, box.material, shape, (x, y, z), box.motion, box.centre()
    )


def _in_plane(side: Vec3 | None, normal: list[float]) -> list[float]:
    """The direction of the first side of a rectangle: `side`, or x (y), made perpendicular to the normal."""
    n = scaled(normal)
    along = scaled(side) if side is not None else X
    if side is None and math.hypot(*cross(X, n)) < PARALLEL:
        along = Y
    return _unit([a - dot(along, n) * c for a, c in zip(along, n, strict=True)])


def _unit(direction: Sequence[float]) -> list[float]:
    return [c + 0.0 for c in scaled(direction)]  # no negative zeros


def motion_for_core(wall: Placed) -> dict[str, Any]:
    """The motion of a wall as the core takes it: all points and laws written out."""
    motion = wall.motion
    assert motion is not None
    turn, slide = motion.rotation, motion.surface_rotation
    return {
        "translation": None if motion.translation is None else [as_core(law) for law in motion.translation],
        "rotation": None
        if turn is None
        else (_unit(turn.axis), list(turn.point or wall.pivot), as_core(turn.law())),
        "surface_velocity": None if motion.surface_velocity is None else list(motion.surface_velocity),
        "surface_rotation": None
        if slide is None
        else (_unit(slide.axis), list(slide.point or wall.pivot), slide.rate),
    }
