"""What the data tell of the parameters, from the slopes of the residuals at the best point.

With J = d(residuals)/d(shares) = U S V^T the covariance of the shares is A (1 + n^2) A^T, where A is the pseudo-inverse of J
and n the noise of the runs over the uncertainties. A direction of V whose singular value is no larger than the error of J is
not determined, nor is a parameter whose interval would be as wide as its bounds. A best value at a bound has no interval;
the others have theirs with it fixed there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, Array, Bool
from carom.errors import extra

#: Share of the range within which a best value that would go on beyond it counts as at a bound.
AT_BOUND = 0.01
#: Decrease of chi squared beyond the bounds below which a best value at a bound is there by chance.
GAIN = 0.01
#: Component of a direction from which a parameter takes part in it.
TAKES_PART = 0.1
#: Likelihood of a chi squared below which the intervals are widened by the square root of chi squared over its mean.
UNLIKELY = 0.01
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Told:
    """95 % intervals as half widths in shares; NaN where there is none."""

    half: F64
    correlation: F64
    at_bound: Bool
    hidden: Bool
    """Parameters that the data do not determine."""
    leaves: Bool
    """Parameters whose interval a search that has not settled would still leave."""
    directions: list[list[int]]
    """Parameters that the data do not tell apart, or of which they say nothing."""
    unclear: list[list[int]]
    """The same where it may be the jumps of the results that hide them."""
    chi2: float
    freedom: int
    """Data less the combinations of parameters that they determine."""
    likelihood: float
    """Of a greater chi squared, if model and uncertainties are right."""
    widened: float
    inverse: F64
    """Change of the shares with minus the residuals, (parameters, data); 0 at a bound, NaN where nothing is determined."""

    @property
    def error(self) -> F64:
        """Standard errors of the shares."""
        return self.half / _deviations(self.freedom if self.widened > 1 else None)


def _deviations(freedom: int | None = None) -> float:
    """Standard errors on each side of an interval: of known uncertainties, or where chi squared tells their size."""
    stats = extra("scipy.stats", "a fit needs scipy", "fit")
    # Where nothing is left over chi squared counts as that of one datum.
    law = stats.norm if freedom is None else stats.t(max(1, freedom))
    return float(law.ppf(0.5 + CONFIDENCE / 2))


def told(
    jacobian: F64,
    residuals: F64,
    noise: F64,
    shares: F64,
    floor: float,
    jumps: bool = False,
    settled: bool = True,
) -> Told:
    """From the slopes (data, parameters), residuals and noise of the runs (data,) over the uncertainties.

    With `jumps` it is the results that jump by the `floor`, which is no fault of the data. Where the search has not
    `settled`, chi squared says nothing of the model, nor has a parameter an interval that it would still leave.
    """
    stats = extra("scipy.stats", "a fit needs scipy", "fit")
    n = len(shares)
    step = -np.linalg.pinv(jacobian, rcond=1e-8) @ residuals
    outward = ((shares < AT_BOUND) & (step < -shares)) | ((shares > 1 - AT_BOUND) & (step > 1 - shares))
    at_bound = outward & (np.sum((jacobian @ step) ** 2) > GAIN)
    free = np.flatnonzero(~at_bound)
    variance = 1 + noise**2
    strength = np.linalg.svd(jacobian[:, free], compute_uv=False)
    # Combinations that the data determine within the bounds.
    fitted = int(np.sum(strength > max(floor, 2 * _deviations())))
    chi2, freedom = float(np.sum(residuals**2 / variance)), len(residuals) - fitted
    # Where nothing is left over chi squared should vanish: that of one datum bounds how far a search may be off.
    expected = max(1, freedom)
    likelihood = float(stats.chi2.sf(chi2, expected))
    widened = float(np.sqrt(chi2 / expected)) if settled and likelihood < UNLIKELY else 1.0
    wide = _deviations(freedom if widened > 1 else None) * widened
    half, correlation, inverse = np.full(n, np.nan), np.full((n, n), np.nan), np.zeros((n, len(residuals)))
    hidden, leaves, directions, unclear = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool), [], []
    if len(free):
        u, s, v = np.linalg.svd(jacobian[:, free], full_matrices=False)
        seen = s > max(floor, 1e-12 * s.max(initial=0.0), 1e-300)
        spread = (v.T / np.where(seen, s, np.inf)) @ u.T
        inverse[free] = spread
        spread = spread * np.sqrt(variance)
        covariance = spread @ spread.T
        sigma = np.sqrt(np.diag(covariance))
        blind = np.abs(v[~seen]) > TAKES_PART**2  # a small part in an unknown direction may be large
        hidden[free] = blind.any(axis=0) | (2 * wide * sigma >= 1)
        weak = ~seen | (2 * wide >= s)
        hazy = ~seen & (s + floor > 2 * wide) & jumps
        directions = _groups(free, v[weak & ~hazy])
        unclear = _groups(free, v[hazy])
        leaves[free] = ~hidden[free] & (np.abs(step[free]) > (np.inf if settled else wide * sigma))
        half[free] = np.where(hidden[free] | leaves[free], np.nan, wide * sigma)
        known = np.where(hidden[free] | (sigma == 0), np.nan, sigma)
        correlation[np.ix_(free, free)] = covariance / np.outer(known, known)
    inverse[hidden] = np.nan
    return Told(
        half, correlation, at_bound, hidden, leaves, directions, unclear, chi2, freedom, likelihood, widened,
        inverse,
    )  # fmt: skip


def _groups(free: Array, directions: F64) -> list[list[int]]:
    """The parameters that take part in some directions: each set once, and none that holds another."""
    sets = {frozenset(free[np.abs(row) > TAKES_PART].tolist()) for row in directions}
    return sorted(sorted(one) for one in sets if not any(other < one for other in sets))
