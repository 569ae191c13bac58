"""`[billiard_table]`: says that the walls of a scene are those of a table of the billiards kit, and its measures."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from carom.errors import CaromError
from carom.scene.tables.base import Table
from carom.scene.tables.fields import Bounds, Quantity, Text, refuse
from carom.scene.tables.quantities import Distance, Length, Mass, unit

RIGHT_ANGLE, STRAIGHT = 1.5707963267948966, 3.141592653589793
Angle = Annotated[float, Quantity("angle", Bounds(ge=RIGHT_ANGLE, lt=STRAIGHT))]


def _metres(meaning: str, **more: Any) -> Any:
    return Field(description=meaning, json_schema_extra=unit("m"), **more)


class BilliardTable(Table):
    """The measures by which pages, films and figures draw a table; `carom.billiards` writes them. No law of motion uses
    them: balls meet the walls and outlets of the scene, which are given besides.
    """

    section: ClassVar[str] = "billiard_table"

    name: Annotated[str, Text()] = Field(description="kind of table", examples=["9ft"])
    length: Length = _metres("playing area along x, from nose to nose", examples=[2.54])
    width: Length = _metres("playing area along y", examples=[1.27])
    ball_radius: Length = _metres("radius of its balls", examples=[0.028575])
    ball_mass: Annotated[Mass, Field(json_schema_extra=unit("kg"))] = Field(
        description="mass of its balls", examples=[0.17]
    )
    nose_height: Length = _metres("of the cushions' noses above the bed", examples=[0.0363])
    corner_mouth: Distance = _metres(
        "distance of the points of a corner pocket; 0: no pockets", examples=[0.116]
    )
    side_mouth: Distance = _metres("likewise of a side pocket", examples=[0.129])
    corner_angle: Angle = Field(
        description="between nose and facing at a corner pocket",
        examples=["142 deg"],
        json_schema_extra=unit("rad"),
    )
    side_angle: Angle = Field(
        description="likewise at a side pocket", examples=["104 deg"], json_schema_extra=unit("rad")
    )
    corner_shelf: Distance = _metres(
        "from the middle of a corner pocket's mouth to the edge of the slate", examples=[0.041]
    )
    side_shelf: Distance = _metres("likewise at a side pocket", examples=[0.005])

    @model_validator(mode="after")
    def _fits(self) -> Self:
        from carom.scene.billiards.data import Spec
        from carom.scene.billiards.measures import checked

        try:
            checked(Spec(**self.written(everything=True)))
        except CaromError as error:
            raise refuse(str(error).removeprefix("table: "), "give measures of a table that can be") from None
        return self
