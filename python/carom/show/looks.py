"""How the balls of a run look, on pages and in films alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carom.result.clumps import rigid
from carom.scene.billiards.look import MOST_NUMBERED, BallLook, ball_looks, by_number

if TYPE_CHECKING:
    from carom.result.data import RunData
    from carom.scene.billiards.table import Table

#: Many grains: hues far apart, of like lightness (the page has the same, viewer/src/palette.ts).
GRAINS = ("#4f86c6", "#e08e45", "#5aa469", "#c8553d", "#8a6fb3", "#d9b44a", "#4aa3a2", "#c77d9b")


def few(result: RunData, every: int = 1) -> bool:
    """Whether each ball, of every so many, has a look of its own."""
    return bool(result.clumps) or len(result.names) <= MOST_NUMBERED * every


def looks(result: RunData, table: Table | None, every: int = 1) -> list[BallLook]:
    """The look of every so many of the balls: numbers where there are few, one colour and no number in a clump."""
    if result.clumps:
        found = [BallLook("grain", by_number(k)) for k in rigid(result).tolist()]
    elif few(result, every):
        found = ball_looks(result, table)
    else:
        found = [BallLook("grain", GRAINS[_scattered(n) % len(GRAINS)]) for n in range(len(result.names))]
    return found[::every]


def _scattered(n: int) -> int:
    """Neighbours in a lattice should not share a colour."""
    mixed = (n + 1) * 0x9E3779B1 & 0xFFFFFFFF
    return ((mixed ^ mixed >> 15) * 0x85EBCA6B & 0xFFFFFFFF) >> 16
