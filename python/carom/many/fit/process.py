"""The Gaussian processes of a fit's residuals.

A curve of hundreds of values changes with a few parameters in a few ways only. The residuals of all points are turned to
their principal directions, which keeps chi squared. Each direction along which they change has a process of its own.

Chi squared is the sum of the squares along the directions and of what is the same at all points. It is never negative. So
its distribution is taken for a gamma distribution, and no point can be expected to gain more than there is. With means m
and deviations s, its mean is the sum of m^2 + s^2 and its variance that of 4 m^2 s^2 + 2 s^4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64
from carom.errors import extra
from carom.many.fit.points import Points

#: Samples about the best point, for each of these distances over the ranges.
LOCAL, DISTANCES = 128, (0.1, 0.03, 0.01, 0.003, 0.001)
#: Bounds of the variance of a process over that of its values, of its lengths over the ranges, and of its noise over that.
VARIANCE, LENGTHS, NOISE = (1e-3, 1e3), (0.05, 50.0), (1e-10, 1.0)
#: Length over the ranges and noise with which the search for the kernel's parameters begins.
START_LENGTH, START_NOISE = 1.0, 1e-6
#: Logarithm of the likelihood below which a better kernel is not looked for.
ENOUGH = 1e-3
#: Part of the variance that the diagonal has more, so that points next to each other can be told apart.
ROUNDING = 1e-10
#: Distance over the ranges within which points count as one.
SAME = 1e-6
#: Deviation from point to point, over the uncertainties, below which the residuals along a direction count as the same.
SMALL = 0.03


@dataclass(frozen=True)
class Kernel:
    """v M(d) with d the distance over the lengths and M that of Matern with 5/2; noise w of the values."""

    variance: float
    lengths: F64
    noise: float

    @classmethod
    def of(cls, theta: F64) -> Kernel:
        """From the logarithms of variance, lengths and noise."""
        values = np.exp(theta)
        return cls(float(values[0]), values[1:-1], float(values[-1]))

    def of_squares(self, squares: F64) -> tuple[F64, F64]:
        """Covariances of the values without noise, and their derivatives by the logarithms of the lengths over the squared
        distances over these: from the squared distances over the ranges, (parameters, points a, points b).
        """
        d = np.sqrt(5.0 * np.tensordot(self.lengths**-2.0, squares, axes=1))
        decay = self.variance * np.exp(-d)
        return (1.0 + d + d * d / 3.0) * decay, 5.0 / 3.0 * (1.0 + d) * decay

    def between(self, a: F64, b: F64) -> F64:
        """Covariances of the values without noise, (points a, points b)."""
        return self.of_squares(_squares(a, b))[0]


def _squares(a: F64, b: F64) -> F64:
    return np.asarray((a.T[:, :, None] - b.T[:, None]) ** 2)


class Direction:
    """The process of the values along one direction, of unit variance; `noise` is their known one, 0 if it is fitted."""

    def __init__(self, shares: F64, values: F64, noise: float) -> None:
        self._shares, self._values, self._apart = shares, values, _squares(shares, shares)
        optimize = extra("scipy.optimize", "a fit needs scipy", "fit")
        n = shares.shape[1]
        bounds = np.log([VARIANCE, *[LENGTHS] * n, (noise, noise) if noise > 0 else NOISE])
        start = np.clip(np.log([1.0, *[START_LENGTH] * n, START_NOISE]), *bounds.T)
        found = optimize.minimize(
            self._unlikely, start, jac=True, method="SLSQP", bounds=bounds, options={"ftol": ENOUGH}
        )
        self.kernel = Kernel.of(found.x)
        covariance = self._with_noise(self.kernel, self.kernel.of_squares(self._apart)[0])
        self._root = np.linalg.cholesky(covariance)
        self._weights = np.linalg.solve(covariance, values)

    @staticmethod
    def _with_noise(kernel: Kernel, covariance: F64) -> F64:
        ridge = kernel.noise + ROUNDING * kernel.variance
        return np.asarray(covariance + ridge * np.eye(len(covariance)))

    def _unlikely(self, theta: F64) -> tuple[float, F64]:
        """Minus the logarithm of the likelihood of the values, less a constant, and its derivatives."""
        kernel = Kernel.of(theta)
        covariance, slope = kernel.of_squares(self._apart)
        whole = self._with_noise(kernel, covariance)
        inverse = np.linalg.inv(whole)
        weights = inverse @ self._values
        by = 0.5 * (inverse - np.outer(weights, weights))
        lengths = np.tensordot(self._apart, by * slope, axes=2) / kernel.lengths**2
        change = np.concatenate([[np.sum(by * covariance)], lengths, [kernel.noise * np.trace(by)]])
        likely = -0.5 * self._values @ weights - 0.5 * np.linalg.slogdet(whole)[1]
        return -float(likely), change

    def at(self, shares: F64) -> tuple[F64, F64]:
        """Mean and standard deviation of the values without noise, (points,) each."""
        across = self.kernel.between(shares, self._shares)
        known = np.sum(np.linalg.solve(self._root, across.T) ** 2, axis=0)
        return across @ self._weights, np.sqrt(np.maximum(self.kernel.variance - known, 0.0))


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
