"""The Gaussian processes of a fit's residuals, by scikit-learn.

A curve of hundreds of values changes with a few parameters in a few ways only. The residuals of all points are turned to
their principal directions, which keeps chi squared. Each direction along which they change has a process of its own.

Chi squared is the sum of the squares along the directions and of what is the same at all points. It is never negative. So
its distribution is taken for a gamma distribution, and no point can be expected to gain more than there is. With means m
and deviations s, its mean is the sum of m^2 + s^2 and its variance that of 4 m^2 s^2 + 2 s^4.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import extra
from carom.many.fit.points import Points

#: Samples about the best point, for each of these distances over the ranges.
LOCAL, DISTANCES = 128, (0.1, 0.03, 0.01, 0.003, 0.001)
#: Bounds of the variance of a process and of its noise, over the variance of its values, and of its lengths over the ranges.
VARIANCE, NOISE, LENGTHS = (1e-3, 1e3), (1e-10, 1.0), (0.05, 50.0)
#: Length over the ranges and noise with which the search for the kernel's parameters begins.
START_LENGTH, START_NOISE = 1.0, 1e-6
#: Variance of known noise at least, so that points next to each other can be told apart.
ROUNDING = 1e-10
#: Distance over the ranges within which points count as one.
SAME = 1e-6
#: Deviation from point to point, over the uncertainties, below which the residuals along a direction count as the same.
SMALL = 0.03


class Direction:
    """The process of the values along one direction, of unit variance; `noise` is their known one, 0 if it is fitted."""

    def __init__(self, shares: F64, values: F64, noise: float) -> None:
        gp = extra("sklearn.gaussian_process", "a fit by a Gaussian process needs scikit-learn", "fit")
        kernels, n = gp.kernels, shares.shape[1]
        known = noise > 0
        white = kernels.WhiteKernel(*((ROUNDING, "fixed") if known else (START_NOISE, NOISE)))
        matern = kernels.Matern(np.full(n, START_LENGTH), LENGTHS, nu=2.5)
        self._process: Any = gp.GaussianProcessRegressor(
            kernels.ConstantKernel(1.0, VARIANCE) * matern + white, alpha=max(noise, ROUNDING)
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a parameter of the kernel is at its bound
            self._process.fit(shares, values)
        self._white = self._process.kernel_.k2.noise_level

    def at(self, shares: F64) -> tuple[F64, F64]:
        """Mean and standard deviation of the values without noise, (points,) each."""
        mean, deviation = self._process.predict(shares, return_std=True)
        return mean, np.sqrt(np.maximum(deviation**2 - self._white, 0.0))


class Process:
    """The processes of all points so far whose runs ended. Next to a point that failed nothing is expected."""

    def __init__(self, points: Points) -> None:
        good = points.good
        residuals, self.shares = points.residuals[good], points.shares[good]
        self._asked, self._good = points.shares, good
        self._offset = residuals.mean(axis=0)
        _, size, turned = np.linalg.svd(residuals - self._offset, full_matrices=False)
        self._spread = size / np.sqrt(len(residuals))
        kept = self._spread > SMALL
        self._spread, self._turned = self._spread[kept], turned[kept]
        values = (residuals - self._offset) @ self._turned.T / self._spread
        # The seeds tell the noise of the runs; without them it is fitted.
        noise = (self._turned**2 @ points.scatter**2) / self._spread**2
        self._along = [Direction(self.shares, v, w) for v, w in zip(values.T, noise.tolist(), strict=True)]
        self._centre = self._turned @ self._offset
        self._same = np.linalg.norm(self._offset - self._centre @ self._turned)
        self._noisy = bool(points.scatter.any())
        self._least = max(0.0, float(points.chi2.min() - self._same**2))
        self._rng = np.random.default_rng([points.calibration.seed, len(good)])

    def _predicted(self, shares: F64) -> tuple[F64, F64]:
        shares = np.atleast_2d(shares)
        found = np.array([one.at(shares) for one in self._along]).reshape(-1, 2, len(shares))
        return found[:, 0].T * self._spread + self._centre, found[:, 1].T * self._spread

    def mean(self, shares: F64) -> F64:
        """Expected residuals, (points, data)."""
        return np.asarray((self._predicted(shares)[0] - self._centre) @ self._turned + self._offset)

    def deviation(self, shares: F64) -> F64:
        """Their standard deviations, (points, data)."""
        return np.asarray(np.sqrt(self._predicted(shares)[1] ** 2 @ self._turned**2))

    def _chi2(self, shares: F64) -> tuple[F64, F64]:
        m, s = self._predicted(shares)
        return np.sum(m**2 + s**2, axis=1), np.sum(4 * m**2 * s**2 + 2 * s**4, axis=1)

    def most_promising(self, samples: F64) -> tuple[float, F64]:
        """The greatest expected improvement of chi squared among the `samples` and about the best point, and its place."""
        special = extra("scipy.special", "a fit needs scipy", "fit")
        known = self._chi2(self.shares)[0]
        best = self.shares[np.argmin(known)]
        least = self.least(samples)
        near = [
            c + d * self._rng.standard_normal((LOCAL, len(best))) for d in DISTANCES for c in (best, least)
        ]
        asked = np.clip(np.vstack([samples, least, *near]), 0.0, 1.0)
        mean, variance = self._chi2(asked)
        mean = np.maximum(mean, 1e-100)
        variance = np.maximum(variance, 1e-12 * mean**2)
        # Of runs without noise the least chi squared is known, and no expected one can lie above it.
        most = known.min() if self._noisy else min(known.min(), self._least)
        shape = mean**2 / variance
        limit = most * mean / variance
        expected = most * special.gammainc(shape, limit) - mean * special.gammainc(shape + 1, limit)
        apart = np.abs(asked[:, None] - self._asked).max(axis=2)
        useless = (apart.min(axis=1) < SAME) | ~self._good[apart.argmin(axis=1)]
        expected[useless] = 0.0
        chosen = int(np.argmax(expected))
        return float(expected[chosen]), asked[chosen]

    def least(self, samples: F64) -> F64:
        """Where the expected residuals have the least sum of squares."""
        optimize = extra("scipy.optimize", "a fit needs scipy", "fit")
        asked = np.vstack([samples, self.shares])
        start = asked[np.argmin(np.sum(self._predicted(asked)[0] ** 2, axis=1))]
        found = optimize.least_squares(
            lambda shares: np.append(self._predicted(shares)[0], self._same), start, bounds=(0.0, 1.0)
        )
        return np.asarray(found.x)
