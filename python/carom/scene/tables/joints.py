"""The table `[[joint]]`: bilateral constraints of the motion, which hold exactly at every step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Self

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from carom.errors import quoted
from carom.scene.assembly.vectors import cross, dot, scaled
from carom.scene.tables.base import Table
from carom.scene.tables.fields import POSITIVE, Choice, refuse
from carom.scene.tables.laws import Law, LawValue
from carom.scene.tables.lists import Direction, Vectors
from carom.scene.tables.loads import Ends, Points, check_ends, check_points
from carom.scene.tables.quantities import Name, Position, Vec3, key
from carom.scene.toml.literal import literal


@dataclass(frozen=True)
class Keys:
    """What a type of joint takes besides `name` and `type`: all of `needs`, one of the groups `either`, any of `may`."""

    needs: tuple[str, ...]
    may: tuple[str, ...] = ()
    either: tuple[tuple[str, ...], ...] = ()


TYPES: dict[str, Keys] = {
    "fix": Keys(("body",), ("point",)),  # a point of the body stays where it is
    "line": Keys(("body", "direction"), ("point",)),  # it moves along a line
    "plane": Keys(("body", "normal"), ("point",)),  # it moves in a plane
    "lock": Keys((), ("axes",), (("body",), ("between",))),  # no rotation, or no relative one, about the axes
    "ball": Keys(("between", "point")),  # two bodies share a point
    "rod": Keys(("between",), ("points", "length")),  # the distance of two points is given
    "motion": Keys(
        ("body",), ("point",), (("direction", "displacement"), ("axis", "angle"))
    ),  # as laws of the time
}
PARALLEL = 1e-6
"""Sine of the angle below which axes count as parallel."""


class Joint(Table):
    """A joint between a sphere and the ground or between two spheres."""

    section: ClassVar[str] = "joint"

    name: Name | None = key(
        "name, unique among joints; if omitted, joint and its number: joint1, joint2, ...",
        default=None,
        examples=["axle"],
    )
    type: Annotated[str, Choice(tuple(TYPES))] = key(
        f"what the joint does: {', '.join(TYPES)}", examples=["fix"]
    )
    body: Name | None = key(
        "the sphere that is joined to the ground (not in ball and rod)", default=None, examples=["a"]
    )
    between: Ends | None = key(
        'two spheres, or one and "ground" (in lock, ball, rod)', default=None, examples=[["a", "b"]]
    )
    point: Position | None = key(
        "the point at the start, in fixed axes, carried by its body; if omitted, the centre (not in ball)",
        "m",
        default=None,
        examples=[[0.0, 0.0, 1.0]],
    )
    points: Points | None = key(
        "the ends of a rod at the start; if omitted, the centres",
        "m",
        default=None,
        examples=[[[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]],
    )
    direction: Annotated[Vec3, Direction()] | None = key(
        "of the line or the motion, any length", default=None, examples=[[1.0, 0.0, 0.0]]
    )
    normal: Annotated[Vec3, Direction()] | None = key(
        "of the plane of motion, any length", default=None, examples=[[0.0, 0.0, 1.0]]
    )
    axes: Annotated[tuple[Vec3, ...], Vectors(Direction(), 1, 3)] | None = key(
        "fixed axes about which a lock allows no rotation; if omitted, all",
        default=None,
        examples=[[[0.0, 0.0, 1.0]]],
    )
    axis: Annotated[Vec3, Direction()] | None = key(
        "fixed axis of the given rotation", default=None, examples=[[0.0, 0.0, 1.0]]
    )
    length: Annotated[LawValue, Law("t", "length", POSITIVE, moves=True)] | None = key(
        "of the rod, a number or a law of the time t; if omitted, that at the start",
        "m",
        default=None,
        examples=[0.5],
    )
    displacement: Annotated[LawValue, Law("t", "length", moves=True)] | None = key(
        "along direction, from the start: a law of the time t",
        "m",
        default=None,
        examples=[{"expression": "0.01*sin(10*t)"}],
    )
    angle: Annotated[LawValue, Law("t", "angle", moves=True)] | None = key(
        "about axis, from the start: a law of the time t",
        "rad",
        default=None,
        examples=[{"polynomial": [0.0, 20.0]}],
    )

    @model_validator(mode="after")
    def _keys_of_its_type(self) -> Self:
        wrong = misfit(self.type, {key for key in KEYS if getattr(self, key) is not None})
        if wrong is not None:
            raise wrong
        if self.between is not None:
            check_ends(self.between)
            if self.type == "rod":
                check_points(self.between, self.points)
        if self.axes is not None and not independent(self.axes):
            cause = f"the {len(self.axes)} axes are parallel or lie in a plane"
            raise refuse(cause, "leave out those that the others imply", ("axes",))
        return self

    def label(self) -> str:
        return f'scene.joint("{self.type}"{f", name={quoted(self.name)}" if self.name else ""})'


KEYS = tuple(key for key in Joint.model_fields if key not in ("name", "type"))


def misfit(kind: str, given: set[str]) -> PydanticCustomError | None:
    """The error if these are not the keys of a joint of this type."""
    keys = TYPES[kind]
    groups = [group for group in keys.either if given.intersection(group)]
    choice = " or ".join(" and ".join(group) for group in keys.either)
    if len(groups) > 1:
        key = next(key for key in groups[1] if key in given)
        return refuse(f"a joint of type {quoted(kind)} has either {choice}", "give one of the two", (key,))
    if keys.either and not groups:
        return refuse(f"neither {choice.replace(' or ', ' nor ')} is given", f"give {choice}")
    needs = (*keys.needs, *(groups[0] if groups else ()))
    may = tuple(key for key in keys.may if not (kind == "motion" and "axis" in needs))
    for key in KEYS:
        if key in given and key not in (*needs, *may):
            chosen = f" with {' and '.join(groups[0])}" if groups else ""
            what = f"a joint of type {quoted(kind)}{chosen} has no key {key}"
            return refuse(what, f"remove it; {kind}{chosen} takes {', '.join((*needs, *may))}", (key,))
    for key in needs:
        if key not in given:
            example = literal((Joint.model_fields[key].examples or ["..."])[0])
            return refuse(f"is missing in a joint of type {quoted(kind)}", f"add {key} = {example}", (key,))
    return None


def independent(axes: tuple[Vec3, ...]) -> bool:
    """Whether no axis is a combination of the others."""
    unit_axes = [scaled(a) for a in axes]
    if len(axes) == 3:
        return abs(dot(unit_axes[0], cross(unit_axes[1], unit_axes[2]))) > PARALLEL
    return len(axes) < 2 or sum(c * c for c in cross(*unit_axes)) > PARALLEL**2


def default_name(index: int) -> str:
    """The name of the joint number `index` (from 0) if it has none of its own."""
    return f"joint{index + 1}"
