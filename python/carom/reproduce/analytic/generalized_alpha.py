"""The smooth part of Algorithm 1 for a linear oscillator, as a matrix (eqs. 6 and 7).

    q_{n+1} = q_n + h v_n + h^2 (1/2 - beta) a_n + h^2 beta a_{n+1}
    v_{n+1} = v_n + h (1 - gamma) a_n + h gamma a_{n+1}
    (1 - alpha_m) a_{n+1} + alpha_m a_n = (1 - alpha_f) v'_{n+1} + alpha_f v'_n        v' = -omega^2 q

(eq. 6c with accelerations on its right side: the paper prints velocities there, which have another unit.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64


@dataclass(frozen=True)
class GeneralizedAlpha:
    """Eq. 7: coefficients from the spectral radius at infinity rho_inf in [0, 1)."""

    spectral_radius: float

    @property
    def alpha_m(self) -> float:
        """Weight of the old pseudo acceleration."""
        return (2 * self.spectral_radius - 1) / (self.spectral_radius + 1)

    @property
    def alpha_f(self) -> float:
        """Weight of the old acceleration."""
        return self.spectral_radius / (self.spectral_radius + 1)

    @property
    def gamma(self) -> float:
        """Newmark's gamma; 1/2 + alpha_f - alpha_m makes the scheme of second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """Newmark's beta."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def step(self, h: float, omega: float) -> F64:
        """Matrix (3, 3) of a step: state (q, v, a) at t_n to that at t_{n+1}; h in s, omega in rad/s."""
        am, af, gamma, beta = self.alpha_m, self.alpha_f, self.gamma, self.beta
        stiff = omega * omega
        new = np.array(
            [[1, 0, -h * h * beta], [0, 1, -h * gamma], [(1 - af) * stiff, 0, 1 - am]], dtype=np.float64
        )
        old = np.array(
            [[1, h, h * h * (0.5 - beta)], [0, 1, h * (1 - gamma)], [-af * stiff, 0, -am]], dtype=np.float64
        )
        return np.asarray(np.linalg.solve(new, old))


def radius_of(matrix: F64) -> float:
    """Spectral radius: greatest modulus of an eigenvalue."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


def scaled(matrix: F64, h: float) -> F64:
    """The matrix for the state (q, h v, h^2 a): the same eigenvalues, and numbers of one size."""
    units = np.array([1.0, h, h * h])
    return np.asarray(matrix * units[:, np.newaxis] / units[np.newaxis, :])
