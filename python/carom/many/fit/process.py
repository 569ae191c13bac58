"""The Gaussian process of a fit's residuals, by scikit-learn.

One kernel serves all residuals, each less its mean and over its spread. `mean` and `deviation` are of the residuals without
the noise of the runs. Chi squared is the sum of their squares: with means m and deviations s its mean is the sum of
m^2 + s^2. Its deviation is at most the sum of
sqrt(4 m^2 s^2 + 2 s^4), reached where all errors go together as those of a curve do.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import extra
from carom.many.fit.points import Points

#: Samples about the best point, for each of these distances over the ranges.
LOCAL, DISTANCES = 128, (0.1, 0.03, 0.01, 0.003)
#: Bounds of the length scales over the ranges, and of the variance of the noise over that of the residuals.
LENGTHS, NOISE = (0.05, 50.0), (1e-10, 1.0)
#: Distance over the ranges within which points count as one.
SAME = 1e-6
#: Other starts of the search for the kernel's parameters.
RESTARTS = 2


class Process:
    """The process of all points so far whose runs ended. Next to a point that failed nothing is expected."""

    def __init__(self, points: Points) -> None:
        gp = extra("sklearn.gaussian_process", "a fit by a Gaussian process needs scikit-learn", "fit")
        good = points.good
        residuals, self.shares, n = points.residuals[good], points.shares[good], points.shares.shape[1]
        self._asked, self._good = points.shares, good
        self._offset, spread = residuals.mean(axis=0), residuals.std(axis=0)
        self._scale = np.where(spread > 0, spread, 1.0)
        # The seeds tell the noise of the runs; without them it is fitted.
        known = float(np.mean((points.scatter / self._scale) ** 2))
        white = gp.kernels.WhiteKernel(1e-4, NOISE) if known == 0 else gp.kernels.WhiteKernel(1e-10, "fixed")
        matern = gp.kernels.Matern(np.ones(n), LENGTHS, nu=2.5)
        self._process: Any = gp.GaussianProcessRegressor(
            gp.kernels.ConstantKernel(1.0, (1e-3, 1e3)) * matern + white,
            alpha=max(known, 1e-10),
            n_restarts_optimizer=RESTARTS,
            random_state=points.calibration.seed,
        )
        self._rng = np.random.default_rng([points.calibration.seed, len(good)])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a parameter of the kernel is at its bound
            self._process.fit(self.shares, (residuals - self._offset) / self._scale)
        self._white = self._process.kernel_.k2.noise_level

    def _predicted(self, shares: F64) -> tuple[F64, F64]:
        mean, deviation = self._process.predict(np.atleast_2d(shares), return_std=True)
        mean, deviation = (np.reshape(x, (len(mean), -1)) for x in (mean, deviation))
        true = np.sqrt(np.maximum(deviation**2 - self._white, 0.0))
        return mean * self._scale + self._offset, true * self._scale

    def mean(self, shares: F64) -> F64:
        """Expected residuals, (points, data)."""
        return self._predicted(shares)[0]

    def deviation(self, shares: F64) -> F64:
        """Their standard deviations, (points, data)."""
        return self._predicted(shares)[1]

    def _chi2(self, shares: F64) -> tuple[F64, F64]:
        m, s = self._predicted(shares)
        return np.sum(m**2 + s**2, axis=1), np.sum(np.sqrt(4 * m**2 * s**2 + 2 * s**4), axis=1)

    def most_promising(self, samples: F64) -> tuple[float, F64]:
        """The greatest expected improvement of chi squared among the `samples` and about the best point, and its place."""
        norm = extra("scipy.stats", "a fit needs scipy", "fit").norm
        known = self._chi2(self.shares)[0]
        best = self.shares[np.argmin(known)]
        near = [best + d * self._rng.standard_normal((LOCAL, len(best))) for d in DISTANCES]
        asked = np.clip(np.vstack([samples, *near]), 0.0, 1.0)
        mean, deviation = self._chi2(asked)
        deviation = np.maximum(deviation, 1e-300)
        gain = known.min() - mean
        expected = gain * norm.cdf(gain / deviation) + deviation * norm.pdf(gain / deviation)
        apart = np.abs(asked[:, None] - self._asked).max(axis=2)
        useless = (apart.min(axis=1) < SAME) | ~self._good[apart.argmin(axis=1)]
        expected[useless] = 0.0
        chosen = int(np.argmax(expected))
        return float(expected[chosen]), asked[chosen]

    def least(self, samples: F64) -> F64:
        """Where the expected residuals have the least sum of squares."""
        optimize = extra("scipy.optimize", "a fit needs scipy", "fit")
        asked = np.vstack([samples, self.shares])
        start = asked[np.argmin(np.sum(self.mean(asked) ** 2, axis=1))]
        found = optimize.least_squares(lambda shares: self.mean(shares)[0], start, bounds=(0.0, 1.0))
        return np.asarray(found.x)
