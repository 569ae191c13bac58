"""Where balls may lie on a table: its spots by name, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from carom.errors import CaromError
from carom.scene.billiards.data import BAULK, BLACK, D_RADIUS, SNOOKER, Spec
from carom.scene.billiards.walls import nearest_cushion, outlets
from carom.scene.checks.walls import TOUCHING
from carom.scene.tables.billiard import nose_misfit

if TYPE_CHECKING:
    from carom.scene.billiards.table import Table

QUARTERS = {"head spot": 0.25, "centre spot": 0.5, "foot spot": 0.75}
"""Spots on the long axis, over the length."""


def spots_of(spec: Spec) -> dict[str, tuple[float, float]]:
    """Spots by name (x, y), m; on a snooker table also those of the colours."""
    length, middle = spec.length, 0.5 * spec.width
    spots = {name: (x * length, middle) for name, x in QUARTERS.items()}
    if spec.name == "snooker":
        places = [(BAULK, middle - D_RADIUS), (BAULK, middle + D_RADIUS), (BAULK, middle)]
        places += [(0.5 * length, middle), (0.75 * length, middle), (length - BLACK, middle)]
        spots |= zip(SNOOKER, places, strict=True)
    return spots


def overlap(a: Sequence[float], radius: float, b: Sequence[float], other: float) -> bool:
    """Whether balls with centres at `a` and `b` are in one another by more than a run admits."""
    return math.dist(a, b) < radius + other - TOUCHING * min(radius, other)


def check_place(table: Table, name: str, at: tuple[float, float, float], radius: float) -> None:
    """Refuse a ball that no nose fits, without slate under its centre, or deeper in the bed or a cushion than runs admit."""
    spec, (x, y, z) = table.spec, at
    told = f"ball: {name!r} at ({x:g}, {y:g}) m"
    if unfit := nose_misfit(radius, spec.nose_height):
        least, most = 0.5 * spec.nose_height, spec.nose_height
        raise CaromError(f"{told}: {unfit}; take a radius between {least:.4g} and {most:.4g} m")
    shelf = spec.side_shelf if abs(x - 0.5 * spec.length) < 0.5 * spec.side_mouth else 0.0
    if not (0 <= x <= spec.length and -shelf <= y <= spec.width + shelf):
        raise CaromError(
            f"{told} is outside of the rails:"
            f" the bed is 0 to {spec.length:g} m along x and 0 to {spec.width:g} m along y"
        )
    for low, high in outlets(spec):
        if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= spec.ball_radius:
            pocket = min(table.pockets, key=lambda pocket: math.dist(table.pockets[pocket], (x, y)))
            raise CaromError(f"{told} is behind the edge of the slate, in the pocket {pocket!r}")
    least = radius * (1.0 - TOUCHING)
    if z < least:
        raise CaromError(
            f"{told} overlaps the bed: its centre is at a height of {z:g} m, its radius is {radius:g} m;"
            " leave z out, as in at=(x, y), for a ball on the bed"
        )
    cushion, away = nearest_cushion(spec, at)
    if away < least:
        raise CaromError(
            f"{told} overlaps the {cushion} by {1000 * (radius - away):.3g} mm;"
            f" the centre of a ball of the table is {table.reach:.4g} m or more from the line of a nose"
        )
