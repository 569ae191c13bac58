"""The key `motion` of walls: how a wall moves, and how its surface does while it stands."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Self

from pydantic import model_validator

from carom.scene.tables.base import Table
from carom.scene.tables.fields import POSITIVE, Quantity, exactly_one, refuse
from carom.scene.tables.laws import Law, LawValue, LawVector, value_at
from carom.scene.tables.lists import Direction
from carom.scene.tables.loads import LawVec3
from carom.scene.tables.quantities import Position, Vec3, Velocity, key

AngularRate = Annotated[float, Quantity("angular speed")]


class Rotation(Table):
    """Rotation of a wall about a fixed axis, from where it stands at the start."""

    section: ClassVar[str] = "rotation"

    axis: Annotated[Vec3, Direction()] = key("axis in fixed axes, any length", examples=[[0.0, 1.0, 0.0]])
    point: Position | None = key(
        "a point of the axis at the start, carried by the translation; if omitted, that of the wall",
        "m",
        default=None,
        examples=[[0.0, 0.0, 0.0]],
    )
    angle: Annotated[LawValue, Law("t", "angle", moves=True)] | None = key(
        "a law of the time t that is 0 at the start",
        "rad",
        default=None,
        examples=[{"expression": "0.1*sin(10*t)"}],
    )
    rate: AngularRate | None = key(
        "constant rate, instead of angle", "rad/s", default=None, examples=["20 rpm"]
    )

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        exactly_one(self.__dict__, "angle", "rate")
        if self.angle is not None:
            _starts_at_zero(self.angle, ("angle",))
        return self

    def law(self) -> LawValue:
        """The angle as a law of the time, rad."""
        if self.angle is not None:
            return self.angle
        assert self.rate is not None  # by _one_law
        return {"polynomial": [0.0, self.rate]}


class SurfaceRotation(Table):
    """Rotation of the material of a wall's surface within its shape, which stands."""

    section: ClassVar[str] = "surface_rotation"

    axis: Annotated[Vec3, Direction()] = key("axis in fixed axes, any length", examples=[[0.0, 0.0, 1.0]])
    point: Position | None = key(
        "a point of the axis; if omitted, that of the wall", "m", default=None, examples=[[0.0, 0.0, 0.0]]
    )
    rate: AngularRate = key("rate", "rad/s", examples=["20 rpm"])


class Motion(Table):
    """How a wall moves: prescribed, so that no ball moves it."""

    section: ClassVar[str] = "motion"

    translation: Annotated[LawVec3, LawVector("t", "length", moves=True)] | None = key(
        "displacement from the start: numbers or laws of the time t that are 0 at the start",
        "m",
        default=None,
        examples=[[0.0, 0.0, {"expression": "0.002*sin(100*t)"}]],
    )
    rotation: Rotation | None = key("rotation about an axis", default=None)
    surface_velocity: Velocity | None = key(
        "velocity of the material while the shape stands (conveyor)",
        "m/s",
        default=None,
        examples=[[0.5, 0.0, 0.0]],
    )
    surface_rotation: SurfaceRotation | None = key(
        "rotation of the material while the shape stands (turntable, smooth drum)", default=None
    )
    until: Annotated[float, Quantity("time", POSITIVE)] | None = key(
        "when the wall is taken away; if omitted, it stays", "s", default=None, examples=[0.5]
    )

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if not any(getattr(self, key) is not None for key in KEYS):
            raise refuse(
                f"none of {', '.join(KEYS)} is given", "give one, or leave motion out: the wall stands"
            )
        for k, law in enumerate(self.translation or ()):
            _starts_at_zero(law, ("translation", k))
        return self

    @property
    def moves_shape(self) -> bool:
        """Whether the shape moves, not only its surface."""
        return self.translation is not None or self.rotation is not None

    def label(self) -> str:
        return "motion"


KEYS = tuple(Motion.model_fields)


def _starts_at_zero(law: LawValue, part: tuple[str | int, ...]) -> None:
    """A wall stands at the start where its table says; a law with another start would hide that place."""
    start = value_at(law, 0.0)
    if math.isfinite(start) and abs(start) > 1e-12:
        if isinstance(law, dict) and "expression" in law:
            cure = f'write "{law["expression"]} - ({start:.12g})", or move the wall itself'
        else:
            cure = "subtract its first value, or move the wall itself"
        raise refuse(f"must be 0 at t = 0, where the wall stands as written; found {start:.6g}", cure, part)
