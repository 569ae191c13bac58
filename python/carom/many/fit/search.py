"""Searches for the parameters with the least chi squared. All see shares of the ranges, from 0 to 1.

What a search asks for depends on its seed and on earlier answers alone: not on the number of workers, nor on the time.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import counted, extra
from carom.many.fit.calibration import STEP
from carom.many.fit.points import Exhausted, Points
from carom.many.fit.process import Process
from carom.many.fit.slopes import Slopes, jacobian, sides, slopes, steps_of

#: Relative changes below which least squares end: of chi squared and of the shares.
FTOL, XTOL = 1e-6, 1e-6
#: The same where runs are noisy.
NOISY_FTOL, NOISY_XTOL = 1e-2, 1e-2
#: Slope of chi squared up to which there is none: SciPy's method divides by it.
NO_SLOPE = float(np.finfo(float).eps)
#: Expected improvement of chi squared below which the Gaussian process ends.
IMPROVEMENT = 0.1
#: Multiple of it up to which a search that used all its points counts as converged.
SETTLED = 10.0
#: Points at the end where the process expects the least chi squared, one after the other: each may change what it expects.
REFINED = 2
#: Samples of the ranges among which the next point is looked for.
SAMPLES = 1024


@dataclass
class Found:
    """The end of a search."""

    best: int
    """Number of the best point."""
    converged: bool
    message: str
    slopes: Slopes
    noise: F64 | None = None
    """Standard deviation of the predicted residuals; None: the scatter of the seeds."""


def search(points: Points) -> Found:
    """The search that the calibration names."""
    return {
        "least_squares": least_squares,
        "differential_evolution": differential_evolution,
        "gaussian_process": gaussian_process,
    }[points.calibration.search](points)


def _needs(module: str, package: str) -> Any:
    return extra(module, f"a fit needs {package}", "fit")


def _sampled(points: Points, count: int) -> F64:
    qmc = _needs("scipy.stats.qmc", "scipy")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a count that is no power of 2 is good enough
        engine = qmc.Sobol(len(points.calibration.axes), rng=points.calibration.seed)
        return np.asarray(engine.random(count))


def _residuals(points: Points, shares: F64) -> F64:
    [number] = points.at(shares)
    return np.asarray(points.residuals[number])


def _chi2(points: Points, shares: F64) -> F64:
    numbers = points.at(shares)
    return np.asarray(points.chi2[numbers])


def least_squares(points: Points) -> Found:
    """scipy's trust region reflective method from one or several starts; once more where its differences were no slopes."""
    calibration = points.calibration
    starts = np.vstack([calibration.first, _sampled(points, calibration.first_points - 1)])
    good = [start for start, number in zip(starts, points.at(starts), strict=True) if points.good[number]]
    steps, message = np.full(len(calibration.axes), STEP), ""
    ends: list[int] = []
    try:
        steps = steps_of(points, good[0])
        for start in good:
            number, told = _minimum(points, start, steps)
            ends, message = [*ends, number], message or told
    except Exhausted:
        message = _out_of_points(points)
    best = min(ends, key=points.chi2.__getitem__) if ends else int(np.argmin(points.chi2))
    found = _ended(points, best, len(ends) == len(good), message, steps)
    return _again(points, found) if found.converged and found.slopes.jumps else found


def _minimum(points: Points, start: F64, steps: F64) -> tuple[int, str]:
    """Number of the point at which the search from one start ends, and why it does."""
    noisy = points.calibration.seeds > 1
    found = _needs("scipy.optimize", "scipy").least_squares(
        lambda shares: _residuals(points, shares),
        start,
        jac=lambda shares: jacobian(points, shares, steps),
        bounds=(0.0, 1.0),
        ftol=NOISY_FTOL if noisy else FTOL,
        xtol=NOISY_XTOL if noisy else XTOL,
        gtol=NO_SLOPE,
    )
    return points.at(found.x)[0], str(found.message)


def _again(points: Points, found: Found) -> Found:
    """The search with the wider differences, from where it ended."""
    points.limited, steps, jumps = True, 2 * found.slopes.steps, found.slopes.jumps
    try:
        best, message = _minimum(points, points.shares[found.best], steps)
    except Exhausted:
        points.limited = False
        return replace(found, converged=False, message=_out_of_points(points))
    ended = _ended(points, best, True, message, steps)
    return replace(ended, slopes=replace(ended.slopes, jumps={**ended.slopes.jumps, **jumps}))


def _out_of_points(points: Points) -> str:
    most = counted(points.calibration.points, "point")
    return f"the search ended after its {most}; raise search.points"


def _ended(points: Points, best: int, converged: bool, message: str, steps: F64) -> Found:
    """The end of a search with the slopes at its best point."""
    points.limited = False
    return Found(best, converged, message, slopes(points, best, steps))


def differential_evolution(points: Points) -> Found:
    """scipy's differential evolution; a generation is computed at once."""
    optimize = _needs("scipy.optimize", "scipy")
    calibration = points.calibration
    n, size = len(calibration.axes), calibration.first_points
    converged = False
    try:
        found = optimize.differential_evolution(
            lambda shares: _chi2(points, shares.T),
            [(0.0, 1.0)] * n,
            init=np.vstack([calibration.first, _sampled(points, size - 1)]),
            maxiter=max(1, calibration.points // size),
            updating="deferred",
            vectorized=True,
            polish=False,
            rng=calibration.seed,
        )
        converged, message = bool(found.success), str(found.message)
    except Exhausted:
        message = _out_of_points(points)
    points.limited = False
    best = int(np.argmin(points.chi2))
    return _ended(points, best, converged, message, steps_of(points, points.shares[best]))


def gaussian_process(points: Points) -> Found:
    """Expected improvement by Gaussian processes of the residuals, until they expect none worth a point some times running.

    The best point is where the processes have the least chi squared, and slopes are theirs; of runs without noise it is the
    best one that was computed, and slopes are differences of runs.
    """
    calibration = points.calibration
    n = len(calibration.axes)
    points.at(np.vstack([calibration.first, _sampled(points, calibration.first_points - 1)]))
    samples = _sampled(points, SAMPLES)
    points.limited, settled = False, 0
    while True:
        process, count = Process(points), len(points.shares)
        gain, share = process.most_promising(samples)
        worth = gain >= _enough(points) and count < calibration.points
        if settled >= REFINED and not worth:
            break
        [best] = points.at(share if worth else process.least(samples))
        if worth and len(points.shares) == count:  # a point that is known already
            break
        settled = 0 if worth else settled + 1
    converged = gain < SETTLED * _enough(points)
    message = f"another point is expected to lower chi squared by {gain:.2g}"
    message += "" if converged else "; raise search.points"
    if calibration.seeds == 1:  # differences of runs are slopes, where a process only guesses between them
        best = int(np.argmin(points.chi2))
        return _ended(points, best, converged, message, steps_of(points, points.shares[best]))
    centre = points.shares[best]
    found = np.zeros((len(points.measured), n))
    steps = np.full(n, calibration.difference or STEP)
    for k in range(n):
        low, high = sides(centre, k, steps[k])
        found[:, k] = (process.mean(high) - process.mean(low))[0] / (high[k] - low[k])
    noise = process.deviation(centre)[0]
    floor = 2 * float(np.linalg.norm(noise))
    known = Slopes(found, floor, "slopes of the fitted Gaussian process", steps, {})
    return Found(best, converged, message, known, noise)


def _enough(points: Points) -> float:
    """The expected improvement that is not worth a point: more where noise adds to chi squared."""
    return IMPROVEMENT * max(1.0, float(np.sum(points.scatter**2)))
