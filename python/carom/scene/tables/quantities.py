"""Types of values that several tables have: names, lengths, positions, speeds."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from carom.scene.tables.fields import NOT_NEGATIVE, POSITIVE, Bounds, Integer, Quantity, Text
from carom.scene.tables.lists import Vector

Vec3 = tuple[float, float, float]

Name = Annotated[str, Text(1)]
Length = Annotated[float, Quantity("length", POSITIVE)]
Distance = Annotated[float, Quantity("length", NOT_NEGATIVE)]
Mass = Annotated[float, Quantity("mass", POSITIVE)]
Density = Annotated[float, Quantity("density", POSITIVE)]
Inertia = Annotated[float, Quantity("moment of inertia", POSITIVE)]
# The bounds are far from anything real; they keep squares and products from overflowing in what follows.
FARTHEST = 1e30
Position = Annotated[Vec3, Vector("length", most=FARTHEST)]
Velocity = Annotated[Vec3, Vector("speed", most=1e9)]
AngularVelocity = Annotated[Vec3, Vector("angular speed", most=1e9)]
Seed = Annotated[int, Integer(Bounds(ge=0))]

ZEROS: Vec3 = (0.0, 0.0, 0.0)


def unit(si: str) -> dict[str, Any]:
    """The unit of a key, as the reference page and the messages say it."""
    return {"unit": si}


def key(description: str, si: str = "", **more: Any) -> Any:
    """A key of a table: what it is, its unit, and what pydantic's `Field` takes."""
    if si:
        more["json_schema_extra"] = unit(si)
    return Field(description=description, **more)
