"""`[billiard_table]`: says that the walls of a scene are those of a table of the billiards kit, and its measures."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Self

from pydantic import model_validator

from carom.scene.tables.base import Table
from carom.scene.tables.fields import Bounds, Quantity, Text, refuse
from carom.scene.tables.quantities import Distance, Length, Mass, key

FACING = 2.8
"""Length of a facing, in radii of a ball."""
Angle = Annotated[float, Quantity("angle", Bounds(ge=math.pi / 2, lt=math.pi))]


class BilliardTable(Table):
    """The measures by which pages, films and figures draw a table; `carom.billiards` writes them. No law of motion uses
    them: balls meet the walls and outlets of the scene, which are given besides.
    """

    section: ClassVar[str] = "billiard_table"

    name: Annotated[str, Text()] = key("kind of table", examples=["9ft"])
    length: Length = key("playing area along x, from nose to nose", "m", examples=[2.54])
    width: Length = key("playing area along y", "m", examples=[1.27])
    ball_radius: Length = key("radius of its balls", "m", examples=[0.028575])
    ball_mass: Mass = key("mass of its balls", "kg", examples=[0.17])
    nose_height: Length = key("of the cushions' noses above the bed", "m", examples=[0.0363])
    corner_mouth: Distance = key(
        "distance of the points of a corner pocket; 0: no pockets", "m", examples=[0.116]
    )
    side_mouth: Distance = key("likewise of a side pocket", "m", examples=[0.129])
    corner_angle: Angle = key("between nose and facing at a corner pocket", "rad", examples=["142 deg"])
    side_angle: Angle = key("likewise at a side pocket", "rad", examples=["104 deg"])
    corner_shelf: Distance = key(
        "from the middle of a corner pocket's mouth to the edge of the slate", "m", examples=[0.041]
    )
    side_shelf: Distance = key("likewise at a side pocket", "m", examples=[0.005])

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if told := misfit(self):
            raise refuse(told, "give measures of a table that can be")
        return self


def nose_misfit(radius: float, nose_height: float) -> str | None:
    """Why a ball and a nose do not go together; None if they do."""
    if 0 < radius < nose_height < 2 * radius:
        return None
    return (
        f"nose_height must be above the centre of the ball and below its top, {radius:g} to {2 * radius:g} m,"
        f" found {nose_height:g}"
    )


def misfit(table: Any) -> str | None:
    """Why no table has these measures (the attributes of a `BilliardTable`, SI); None if one can."""
    r, length, width = table.ball_radius, table.length, table.width
    corner, side = table.corner_mouth, table.side_mouth
    if told := nose_misfit(r, table.nose_height):
        return told
    if min(length, width) < 10 * r:
        return f"{length:g} m x {width:g} m is too small for balls of {r:g} m"
    if bool(corner) != bool(side):
        return "give corner_mouth and side_mouth both, or both 0 for a table without pockets"
    # Each piece of nose must be longer than nothing.
    a, b = corner / math.sqrt(2), 0.5 * side
    if not (0.5 * length > a + b and width > 2 * a):
        return (
            f"pockets of {corner:g} m (corner_mouth) and {side:g} m (side_mouth) leave no cushion on"
            f" {length:g} m x {width:g} m"
        )
    return _pocket_misfit(table, "corner", 135.0) or _pocket_misfit(table, "side", 90.0) if corner else None


def _pocket_misfit(table: Any, kind: str, parallel: float) -> str | None:
    """Why no pocket of a kind is like that: facings, `parallel` at that angle (deg), lead from mouth to slate's edge."""
    mouth, shelf, angle = (getattr(table, f"{kind}_{key}") for key in ("mouth", "shelf", "angle"))
    lean, length = angle - math.radians(parallel), FACING * table.ball_radius
    if 2 * length * math.sin(lean) >= mouth:
        told = f"{kind}_angle of {math.degrees(angle):g} deg"
        return f"{told} crosses the facings behind a {kind}_mouth of {mouth:g} m; they are {length:g} m long"
    if shelf > length * math.cos(lean):
        deep = length * math.cos(lean)
        return f"{kind}_shelf of {shelf:g} m puts the edge of the slate behind the facings, which are {deep:g} m deep"
    # Facings that converge are nearest at the edge of the slate, else the points are: half the way between them there.
    along = min(max(shelf * math.cos(lean) + 0.5 * mouth * math.sin(lean), 0.0), length)
    edge = math.hypot(shelf - along * math.cos(lean), 0.5 * mouth - along * math.sin(lean))
    room = 2 * min(0.5 * mouth, edge)
    radius, above = table.ball_radius, table.nose_height - table.ball_radius
    if room <= (ball := 2 * math.sqrt(radius**2 - above**2)):  # as wide as it is at the height of the noses
        return (
            f"a ball on the bed is {ball:.4g} m wide at the noses and cannot pass a {kind}_mouth of {mouth:g} m, which"
            f" leaves {room:.4g} m"
        )
    return None
