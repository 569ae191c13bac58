"""Racks of 3 to 15 balls: places in a triangular lattice behind the apex, and which ball lies where by the rules."""

from __future__ import annotations

from math import sqrt

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, did_you_mean
from carom.numeric import is_whole
from carom.scene.assembly.bodies import uniform
from carom.units import number

FEWEST, MOST = 3, 15
DIAMOND = (1, 2, 3, 2, 1)
"""Rows of nine balls."""

GAMES = {"8-ball": 15, "9-ball": 9, "10-ball": 10}
"""Balls of a rack by game: WPA rules of play 3.2, 2.2 and 9.2."""
CENTRE = 4
"""The place in the middle of a triangle or a diamond, counted from 0 row by row."""
CORNERS = (10, 14)
"""Those at the ends of the last row of fifteen."""


def numbers_of(order: str, seed: int | None = None) -> list[int]:
    """The numbers of the balls of a game, place by place, row by row from the apex.

    The 1 is at the apex. In 9-ball and 10-ball the ball of that number is in the middle; in 8-ball the 8 is, and of the
    two corners behind one holds a solid ball and one a stripe. The rules want no pattern in the rest: `seed` draws it, 0
    where none is given.
    """
    if order not in GAMES:
        raise CaromError(f"rack: no game is called {order!r}; {did_you_mean(str(order), list(GAMES))}")
    _check_seed(seed)
    count = GAMES[order]
    middle = 8 if order == "8-ball" else count
    free = [number for number in range(2, count + 1) if number != middle]
    # A stream of its own: the jitter of a rack draws from that of the seed itself.
    drawn = np.random.SeedSequence([seed or 0, count]).generate_state(1)[0]
    free = [free[k] for k in np.argsort(uniform(int(drawn), (len(free),))).tolist()]
    placed = {0: 1, CENTRE: middle}
    if order == "8-ball":
        corners = [free[0], next(n for n in free if (n < 8) != (free[0] < 8))]
        placed |= dict(zip(CORNERS, corners, strict=True))
    rest = iter(number for number in free if number not in placed.values())
    return [placed[k] if k in placed else next(rest) for k in range(count)]


def rows_of(balls: int) -> list[int]:
    """Balls in each row, apex first: a triangle, of which the last row may be short; nine are a diamond."""
    if not is_whole(balls) or not FEWEST <= balls <= MOST:
        cure = f'; for the rack of a game write order="{balls}"' if str(balls) in GAMES else ""
        raise CaromError(f"rack: a rack has {FEWEST} to {MOST} balls, found {balls!r}{cure}")
    if balls == sum(DIAMOND):
        return list(DIAMOND)
    rows: list[int] = []
    while sum(rows) < balls:
        rows.append(min(len(rows) + 1, balls - sum(rows)))
    return rows


def rack_places(
    balls: int,
    radius: float | str,
    *,
    gap: float | str = 0.0,
    jitter: float | str = 0.0,
    seed: int | None = None,
) -> F64:
    """Centres (B, 2), m: along the rack and to its left, from the apex at the origin.

    Surfaces of neighbours are `gap` apart, and each centre is moved by up to `jitter` along each axis, drawn with `seed`
    (PCG64): a real rack is never tight, and the outcome of a break hangs on it. Lengths are numbers in m or texts with
    a unit.
    """
    rows = rows_of(balls)
    radius, gap, jitter = (
        number("rack", name, value, "length")
        for name, value in (("radius", radius), ("gap", gap), ("jitter", jitter))
    )
    _check_seed(seed)
    if not gap >= 0 or not jitter >= 0:
        raise CaromError(f"rack: gap and jitter must not be below 0, found {gap!r} and {jitter!r}")
    if jitter and seed is None:
        raise CaromError(
            "rack: jitter is given without a seed; add seed=1, so that the same call makes the same rack"
        )
    if jitter and gap < 2 * sqrt(2) * jitter:
        least = 2 * sqrt(2) * jitter
        raise CaromError(
            f"rack: with a jitter of {jitter:g} m balls may overlap; give gap={least:.3g} or more"
        )
    pitch = 2 * radius + gap
    places = []
    for k, count in enumerate(rows):
        # The places of a full row; a short one takes the middle of them. In a diamond rows narrow again.
        full = count if balls == sum(DIAMOND) else k + 1
        first = (full - count) // 2
        places += [(k * sqrt(3) / 2 * pitch, (0.5 * (full - 1) - first - i) * pitch) for i in range(count)]
    found = np.array(places)
    return found + jitter * uniform(seed, found.shape) if jitter and seed is not None else found


def _check_seed(seed: int | None) -> None:
    if seed is not None and (not is_whole(seed) or seed < 0):
        raise CaromError(f"rack: seed must be a whole number from 0, found {seed!r}")
