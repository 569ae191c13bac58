"""The walls of a scene in the order of the core: free planes first, then planes without end, meshes last, each in the order
of their tables.

Here a wall is one surface with its place at the start; a `[[box]]` is up to six of them. What the core gets, what the
checks measure and what is recorded all come from this list.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from carom.scene.tables.base import Table
from carom.scene.tables.laws import as_core
from carom.scene.tables.walls import MESH, PLANE, WALLS, Piece, Wall, direction_of

FLAT = (PLANE, "rectangle", "disc")
"""Kinds of flat walls, whose first parameter is the normal."""


@dataclass(frozen=True, kw_only=True)
class Placed(Piece):
    """One surface at the start, with the table that it comes from."""

    section: str
    index: int
    """Place of its table."""
    material: str

    @property
    def kind(self) -> str:
        return str(self.shape[0])


def placed_walls(entries: Mapping[str, Sequence[tuple[int, Table]]]) -> list[Placed]:
    """All walls of the tables, in the order of the core."""
    found: list[Placed] = []
    for section in WALLS:
        for i, table in entries.get(section, ()):
            assert isinstance(table, Wall)
            found += [
                Placed(**vars(piece), section=section, index=i, material=table.material)
                for piece in table.pieces()
            ]

    def order(wall: Placed) -> tuple[bool, ...]:
        return wall.free is None, wall.kind != PLANE, wall.kind == MESH

    return sorted(found, key=order)  # stable


def motion_for_core(wall: Placed) -> dict[str, Any]:
    """The motion of a wall as the core takes it: all points and laws written out."""
    motion = wall.motion
    assert motion is not None
    turn, slide = motion.rotation, motion.surface_rotation
    return {
        "translation": None if motion.translation is None else [as_core(law) for law in motion.translation],
        "rotation": None
        if turn is None
        else (direction_of(turn.axis), list(turn.point or wall.pivot), as_core(turn.law())),
        "surface_velocity": None if motion.surface_velocity is None else list(motion.surface_velocity),
        "surface_rotation": None
        if slide is None
        else (direction_of(slide.axis), list(slide.point or wall.pivot), slide.rate),
        **({} if motion.until is None else {"until": motion.until}),
    }
