"""`[billiard_table]`: says that the walls of a scene are those of a table of the billiards kit, and its measures."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import model_validator

from carom.errors import CaromError
from carom.scene.tables.base import Table
from carom.scene.tables.fields import Bounds, Quantity, Text, refuse
from carom.scene.tables.quantities import Distance, Length, Mass, key

RIGHT_ANGLE, STRAIGHT = 1.5707963267948966, 3.141592653589793
Angle = Annotated[float, Quantity("angle", Bounds(ge=RIGHT_ANGLE, lt=STRAIGHT))]


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
        from carom.scene.billiards.data import Spec
        from carom.scene.billiards.measures import checked

        try:
            checked(Spec(**self.written(everything=True)))
        except CaromError as error:
            raise refuse(str(error).removeprefix("table: "), "give measures of a table that can be") from None
        return self
