"""Measures of a table: which can be, and how a scene writes them down, in `[billiard_table]`."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from carom.errors import CaromError
from carom.scene.billiards.arguments import angle
from carom.scene.billiards.data import Spec
from carom.scene.tables.billiard import misfit
from carom.units import number

if TYPE_CHECKING:
    from carom.scene.scene import Scene


def mark(spec: Spec) -> dict[str, Any]:
    """The keys of `[billiard_table]`."""
    return {field.name: getattr(spec, field.name) for field in fields(Spec) if field.name != "source"}


def same_table(call: str, what: str, spec: Spec, scene: Scene) -> None:
    """Refuse a scene that says that it is another table than `spec`: its places and pockets are elsewhere."""
    if scene.billiard_table is None:
        return
    other = scene.billiard_table.written(everything=True)
    for key, own in mark(spec).items():
        if key != "name" and not math.isclose(own, other[key], rel_tol=1e-9):
            raise CaromError(
                f"{call}: {what} is of the table {other['name']!r} with {key} {other[key]:g},"
                f" this table is {spec.name!r} with {key} {own:g}; take the table that made the scene"
            )


def checked(spec: Spec) -> Spec:
    """The measures as numbers in SI; a CaromError where no table can have them."""
    given: dict[str, Any] = {}
    for name in ("length", "width", "ball_radius", "ball_mass", "nose_height"):
        given[name] = number("table", name, getattr(spec, name), "mass" if name == "ball_mass" else "length")
        if not given[name] > 0:
            raise CaromError(f"table: {name} must be above 0, found {getattr(spec, name)!r}")
    for name in ("corner_mouth", "side_mouth", "corner_shelf", "side_shelf"):
        given[name] = number("table", name, getattr(spec, name), "length")
        if not given[name] >= 0:
            raise CaromError(f"table: {name} must not be below 0, found {getattr(spec, name)!r}")
    for name in ("corner_angle", "side_angle"):
        given[name] = angle(
            "table",
            name,
            getattr(spec, name),
            lambda a: math.pi / 2 <= a < math.pi,
            "is that between nose and facing, from 90 deg to below 180 deg",
        )
    spec = replace(spec, **given)
    if told := misfit(spec):
        raise CaromError(f"table: {told}")
    return spec
