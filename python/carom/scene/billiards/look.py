"""The colours of tables and balls, for pages, films and figures alike."""

from __future__ import annotations

import colorsys
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from carom.scene.billiards.table import Table

COLOURS: dict[str, tuple[str, str]] = {
    "cloth": ("#1f8a63", "#136a55"),
    "wood": ("#8a5a33", "#5b3a22"),
    "liner": ("#35302c", "#2a2623"),
    "sight": ("#efe8d6", "#cfc7b3"),
    "line": ("#e6f0e6", "#b9c9bf"),
}
"""Of what a table is made, by day and in dark pages; cushions have the cloth's, pockets are the dark."""

MOST_NUMBERED = 64
"""Of more balls than this numbers could not be read."""

POOL = ("#f2b705", "#1747b5", "#d11f26", "#5b2a86", "#ee6c15", "#0c7a45", "#7c1d24", "#17181b")
"""Pool's own colours for 1 to 8; 9 to 15 repeat them as stripes."""
IVORY = "#f0e8d6"
PLAIN = {
    "white": IVORY,
    "yellow": "#f2c318",
    "green": "#0f7a4a",
    "brown": "#7a4a1e",
    "blue": "#1f5fc4",
    "pink": "#f08fa6",
    "black": "#17181b",
    "red": "#c3141c",
}
"""Balls of snooker and carom billiards, by their names."""

KINDS = ("cue", "solid", "stripe", "dotted", "grain")
"""What is on a ball: the cue ball's red dots, a number, a number on a stripe, ivory dots by which its rotation shows, two
tones and a cap."""


@dataclass(frozen=True)
class BallLook:
    """How a ball looks: one of `KINDS`, its colour, and what is written on it."""

    kind: str
    colour: str
    label: str = ""


def ball_looks(result: Any, table: Table | None) -> list[BallLook]:
    """The looks of all balls of a run of at most `MOST_NUMBERED`; of a `table` by the customs of its game."""
    names = [str(name) for name in result.names]
    cue = _cue_ball(result, names)
    others = [n for n in range(len(names)) if n != cue]
    looks = {n: _plain(names[n], k, table.spec.name) if table else None for k, n in enumerate(others)}
    numbers = iter(_numbers([names[n] for n in others if looks[n] is None]))
    return [
        BallLook("cue", IVORY) if n == cue else looks[n] or _numbered(next(numbers))
        for n in range(len(names))
    ]


def _plain(name: str, place: int, game: str) -> BallLook | None:
    """Of a ball without a number, `place` the how manieth besides the cue ball; None of pool's."""
    word = re.search("|".join(PLAIN), name.lower())
    if word:
        return BallLook("dotted", PLAIN[word[0]])
    if game in ("snooker", "carom"):
        return BallLook("dotted", PLAIN["yellow" if game == "carom" and place == 0 else "red"])
    return None


def _numbers(names: Sequence[str]) -> list[int]:
    """A number for each ball, none twice: that in its name for the first that has it, the least that is free for others."""
    found: list[int | None] = []
    for name in names:
        match = re.search(r"(\d{1,3})\D*$", name)
        number = int(match[1]) if match else None
        found.append(None if number in found else number)
    free = (number for number in count(1) if number not in found)
    return [next(free) if number is None else number for number in found]


def _numbered(number: int) -> BallLook:
    if 1 <= number <= 8:
        return BallLook("solid", POOL[number - 1], str(number))
    if 9 <= number <= 15:
        return BallLook("stripe", POOL[number - 9], str(number))
    return BallLook("solid" if number % 2 else "stripe", by_number(number), str(number))


def by_number(number: int) -> str:
    """A colour for each number: by the golden angle neighbours differ and none repeats."""
    rgb = colorsys.hls_to_rgb(number * 137.508 % 360 / 360, 0.45, 0.55)
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def _cue_ball(result: Any, names: Sequence[str]) -> int:
    """The ball called so, or the only one that moves at the start: players expect it white; -1 if there is none."""
    named = [n for n, name in enumerate(names) if re.search("cue|white", name, re.IGNORECASE)]
    if named or len(names) < 3:
        return named[0] if named else -1
    moving = np.flatnonzero(np.linalg.norm(np.asarray(result.velocity[0]), axis=1) > 1e-6)
    return int(moving[0]) if len(moving) == 1 else -1
