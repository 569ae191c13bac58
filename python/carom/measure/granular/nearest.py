"""Which image of each ball belongs to a heap, in a world that repeats itself: told by the balls, never by the borders.

Everything here is the same, but for rounding, if all balls are shifted by any vector and each by any number of periods.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.scene.packing.neighbours import separation

_ROUNDS = 50  # of moving a middle to the mean of the nearest images; a few are enough


def opened(x: F64, period: F64 | None) -> F64:
    """Images (N, 3), m, of places that lie within one period, cut where along each axis the balls leave the widest gap.

    So nothing is cut whose shadow on the axis leaves a part of the period free. Other axes keep their coordinates.
    """
    if period is None or not len(x):
        return x
    found = np.array(x)
    for axis in np.flatnonzero(period > 0):
        place = np.mod(x[:, axis], period[axis])
        order = np.sort(place)
        gaps = np.diff(order, append=order[0] + period[axis])
        first = order[(int(np.argmax(gaps)) + 1) % len(order)]
        found[:, axis] = np.where(place < first, place + period[axis], place)
    return found


def around(x: F64, middle: F64, period: F64 | None) -> F64:
    """The images (N, 3), m, nearest to a place (3,), m."""
    if period is None or not (period > 0).any():
        return x
    return np.asarray(middle + separation(x - middle, period))


def middle(x: F64, weight: F64, period: F64 | None) -> F64:
    """Weighted mean of places (N, 3), m, at least one; along periodic axes that of the images nearest to it."""
    share = weight / weight.sum()
    found = share @ x
    if period is None or not (period > 0).any():
        return np.asarray(found)
    for axis in np.flatnonzero(period > 0):
        # On a circle no place is the first, and the mean direction is near the mean of what is not spread all round.
        turn = 2.0 * np.pi * x[:, axis] / period[axis]
        found[axis] = np.arctan2(share @ np.sin(turn), share @ np.cos(turn)) * period[axis] / (2.0 * np.pi)
    for _ in range(_ROUNDS):
        step = share @ separation(x - found, period)
        found = found + step
        if (np.abs(step) <= 1e-13 * np.maximum(period, np.abs(found))).all():
            break
    return np.asarray(found)
