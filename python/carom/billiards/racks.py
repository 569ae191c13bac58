"""Racks of 3 to 15 balls: places in a triangular lattice behind the apex."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from carom.billiards.given import number
from carom.errors import CaromError
from carom.scenario.bodies import uniform

F64 = NDArray[np.float64]

FEWEST, MOST = 3, 15
DIAMOND = (1, 2, 3, 2, 1)
"""Rows of nine balls."""


def rows_of(balls: int) -> list[int]:
    """Balls in each row, apex first: a triangle, of which the last row may be short; nine are a diamond."""
    if isinstance(balls, bool) or not isinstance(balls, int) or not FEWEST <= balls <= MOST:
        raise CaromError(f"rack: a rack has {FEWEST} to {MOST} balls, found {balls!r}")
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
