"""Slopes of the residuals by differences of runs, and whether they are slopes.

Twice the width must give nearly the same slopes. Where results jump, as they do when an impact falls into another step, an
error of jump over width is left. It falls as the width grows, and that of curvature grows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.many.fit.calibration import STEP
from carom.many.fit.points import Points

#: Steps over the range that are tried where runs are noisy, and how often the change must exceed its noise.
NOISY_STEPS, SIGNAL = (0.05, 0.1, 0.2), 3.0
#: Errors of a slope that do not matter: over itself, over the least singular value, and over the uncertainties for the
#: whole range. Errors over the least singular value from which differences are no slopes.
SMALL, BESIDE, NOTHING, FAR = 0.01, 0.1, 0.4, 0.5
#: Widest difference that is tried where results jump.
WIDEST = 0.2


@dataclass
class Slopes:
    """The change of the residuals with the shares, and how it was found."""

    jacobian: F64
    """(data, parameters)."""
    floor: float
    """Singular values up to here may be errors of the differences."""
    by: str
    steps: F64
    """Steps of the differences over the ranges."""
    jumps: dict[int, float]
    """Parameters with which results jump, and the steps whose differences are no slopes."""


def steps_of(points: Points, centre: F64) -> F64:
    """Steps of central differences: as given, else 0.01; where runs are noisy the least that stands out of the noise."""
    given, n = points.calibration.difference, len(centre)
    if given is not None or points.calibration.seeds == 1:
        return np.full(n, given or STEP)
    steps = np.full(n, NOISY_STEPS[-1])
    for k in range(n):
        for step in NOISY_STEPS:
            low, high = points.at(np.array(sides(centre, k, step)))
            change = points.residuals[high] - points.residuals[low]
            noise = (points.noise[high] ** 2 + points.noise[low] ** 2) / points.sigma**2
            if np.sum(change**2) > SIGNAL**2 * np.sum(noise):
                steps[k] = step
                break
    return steps


def sides(centre: F64, k: int, step: float) -> tuple[F64, F64]:
    """The points on both sides of one, within the bounds."""
    low, high = centre.copy(), centre.copy()
    low[k], high[k] = max(0.0, centre[k] - step), min(1.0, centre[k] + step)
    return low, high


def jacobian(points: Points, centre: F64, steps: F64) -> F64:
    """Central differences of the residuals; one-sided beside a bound and beside a point that failed."""
    points.at(np.array([centre, *(side for k, step in enumerate(steps) for side in sides(centre, k, step))]))
    found = [_slope(points, centre, k, step) for k, step in enumerate(steps)]
    for k, column in enumerate(found):
        if column is None:
            name = points.calibration.names[k]
            value = points.calibration.values(centre)[k]
            raise CaromError(
                f"runs on both sides of {name} = {value:g} fail, so no slope is known; give a smaller search.difference,"
                " or other bounds"
            )
    return np.stack([column for column in found if column is not None], axis=-1)


def _slope(points: Points, centre: F64, k: int, step: float) -> F64 | None:
    """One column of it; None where the runs on both sides fail."""
    here, *beside = points.at(np.array([centre, *sides(centre, k, step)]))
    low, high = (j if points.good[j] else here for j in beside)
    if low == high:
        return None
    width = points.shares[high, k] - points.shares[low, k]
    return np.asarray((points.residuals[high] - points.residuals[low]) / width)


def slopes(points: Points, best: int, steps: F64) -> Slopes:
    """The Jacobian at the best point, and how far it may be wrong."""
    centre = points.shares[best]
    wide = jacobian(points, centre, steps)
    if points.calibration.seeds > 1:
        noise = np.sqrt(2 * np.sum(points.scatter**2)) / (2 * steps.min())
        why = ", chosen by the noise" if points.calibration.difference is None else ""
        over = ", ".join(f"{step:.3g}" for step in steps)
        return Slopes(wide, float(noise), f"central differences over {over} of the ranges{why}", steps, {})
    fine, steps, jumps = jacobian(points, centre, steps / 2), steps / 2, {}
    errors, least = np.linalg.norm(wide - fine, axis=0), np.linalg.svd(fine, compute_uv=False).min()
    matters = np.maximum(np.maximum(NOTHING, BESIDE * least), SMALL * np.linalg.norm(fine, axis=0))
    for k in np.flatnonzero(errors > matters).tolist():
        column, wider, step = _widened(points, centre, k, steps[k], (fine[:, k], wide[:, k]))
        if step > steps[k] and errors[k] > FAR * least:
            jumps[k] = float(steps[k])
        fine[:, k], wide[:, k], steps[k] = column, wider, step
    over = f"{steps[0]:.3g}" if np.ptp(steps) == 0 else ", ".join(f"{step:.3g}" for step in steps)
    floor = float(np.linalg.norm(wide - fine, 2))
    return Slopes(fine, floor, f"central differences over {over} of the ranges", steps, jumps)


def _widened(
    points: Points, centre: F64, k: int, step: float, pair: tuple[F64, F64]
) -> tuple[F64, F64, float]:
    """The slopes over a step and twice that which agree best. Where the first wider ones agree less, results are smooth."""
    first = error = np.linalg.norm(pair[1] - pair[0])
    best, fine, wide = (*pair, step), pair[0], pair[1]
    while 4 * step <= WIDEST:
        step, fine, next_ = 2 * step, wide, _slope(points, centre, k, 4 * step)
        if next_ is None or (wide is pair[1] and np.linalg.norm(next_ - wide) > first):
            break
        wide = next_
        if np.linalg.norm(wide - fine) < error:
            error, best = np.linalg.norm(wide - fine), (fine, wide, step)
    return best
