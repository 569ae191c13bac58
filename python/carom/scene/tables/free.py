"""The key `free` of planes: a wall with a mass that moves along its normal, by what presses it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import model_validator

from carom.scene.tables.base import Table
from carom.scene.tables.fields import POSITIVE, Flag, Quantity, refuse
from carom.scene.tables.laws import Law, LawValue, as_core, times
from carom.scene.tables.quantities import Mass, key

Area = Annotated[float, Quantity("area", POSITIVE)]


class Free(Table):
    """A plane that moves along its normal, pushed by `force` or `pressure` towards the balls, and by them the other way."""

    section: ClassVar[str] = "free"

    mass: Mass = key("mass", "kg", examples=[0.5])
    force: Annotated[LawValue, Law("t", "force")] | None = key(
        "force along the normal, towards the balls: a number or a law of the time t; if omitted, none",
        "N",
        default=None,
        examples=[10.0],
    )
    pressure: Annotated[LawValue, Law("t", "pressure")] | None = key(
        "force over area, in place of force", "Pa", default=None, examples=["1 kPa"]
    )
    area: Area | None = key(
        "area on which the pressure acts; if omitted, that between the planes or periods around, as they move",
        "m^2",
        default=None,
        examples=[0.01],
    )
    velocity: Annotated[float, Quantity("speed")] = key(
        "velocity along the normal at the start", "m/s", default=0.0
    )
    weight: Annotated[bool, Flag()] = key(
        "false: gravity does not act on the wall, only the force does", default=True
    )

    @model_validator(mode="after")
    def _one_force(self) -> Self:
        if self.force is not None and self.pressure is not None:
            cause = "both force and pressure are given"
            raise refuse(cause, "give one of them", ("pressure",))
        if self.area is not None and self.pressure is None:
            raise refuse("area is given without pressure", "add pressure", ("area",))
        return self

    def follows(self) -> bool:
        """Whether the area of the pressure is that of the walls around."""
        return self.pressure is not None and self.area is None

    def law(self) -> LawValue:
        """The force along the normal, N, as a law of the time; the pressure, Pa, where the area follows the walls around."""
        if self.pressure is not None:
            return self.pressure if self.area is None else times(self.pressure, self.area)
        return self.force if self.force is not None else 0.0

    def for_core(self, wall: int, area: Sequence[tuple[Any, ...]]) -> dict[str, Any]:
        """What the core takes of wall number `wall`, and of the sides of its `area` if it has one."""
        return {
            "wall": wall,
            "mass": self.mass,
            "velocity": self.velocity,
            "weighs": self.weight,
            "force": as_core(self.law()),
            **({"area": list(area)} if area else {}),
        }

    def label(self) -> str:
        return "free"
