"""Two touching spheres, one driven by a torque that grows with time (section 5.1, eqs. 46 and 47, corrected).

Sphere A rests on sphere B. A may rise and turn, B only turn. A torque of magnitude k t turns B; friction takes A along.
While the contact sticks the contact points move together, so that w_A = -w_B and half the torque goes to either sphere:
`f_T = k t/(2 r)`. It can grow to `mu m g`; from `t_lim` on A turns with constant acceleration and B runs away.

Two of the four printed formulas are wrong for t > t_lim; `printed_angular_velocity_b` and `printed_angle_b` keep them as
they stand in the paper, for the comparison.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64


@dataclass(frozen=True)
class SpherePair:
    """Two equal spheres of mass m (kg), radius r (m) and inertia I (kg m^2); friction mu, gravity g (m/s^2).

    `rate` is k of the torque T = k t on sphere B, N m/s. All functions of time take t >= 0 in s, of any shape. Angles and
    angular velocities are about the axis about which A turns forwards: A's are positive, B's negative.
    """

    mass: float
    radius: float
    inertia: float
    friction: float
    gravity: float
    rate: float

    @classmethod
    def of(cls, model: Mapping[str, Any]) -> SpherePair:
        """The pair that the arrays of a scenario describe: A first, a torque -k t about y on B."""
        (_, (_, slope)) = model["loads"][0]["torque"][1]
        return cls(
            mass=float(model["mass"][0]),
            radius=float(model["radius"][0]),
            inertia=float(model["inertia"][0]),
            friction=float(model["friction"][0]),
            gravity=-float(model["gravity"][2]),
            rate=-float(slope),
        )

    @property
    def normal_force(self) -> float:
        """f_N, N: the weight of sphere A."""
        return self.mass * self.gravity

    @property
    def greatest_friction_force(self) -> float:
        """Bound of f_T, N: mu m g."""
        return self.friction * self.normal_force

    @property
    def t_lim(self) -> float:
        """When sticking ends, s: `2 m g mu r/k` (below eq. 47)."""
        return 2 * self.greatest_friction_force * self.radius / self.rate

    def friction_force(self, t: ArrayLike) -> F64:
        """f_T, N: grows as k t/(2 r) and stays at mu m g."""
        time = np.asarray(t, dtype=np.float64)
        return np.minimum(self.rate * time / (2 * self.radius), self.greatest_friction_force)

    def angular_velocity_a(self, t: ArrayLike) -> F64:
        """Eq. 46, rad/s."""
        time, lim, k, inertia = self._split(t)
        return np.where(time <= lim, k * time**2 / (4 * inertia), k * lim / (2 * inertia) * (time - lim / 2))

    def angular_velocity_b(self, t: ArrayLike) -> F64:
        """Eq. 46 with the factor k/(4 I) where the paper prints 4 I/k for t > t_lim, rad/s."""
        time, lim, k, inertia = self._split(t)
        slip = -k / (4 * inertia) * (lim**2 + 2 * time * (time - lim))
        return np.where(time <= lim, -k * time**2 / (4 * inertia), slip)

    def angle_a(self, t: ArrayLike) -> F64:
        """Eq. 47, rad."""
        time, lim, k, inertia = self._split(t)
        slip = k * lim * time * (time - lim) / (4 * inertia) + k * lim**3 / (12 * inertia)
        return np.where(time <= lim, k * time**3 / (12 * inertia), slip)

    def angle_b(self, t: ArrayLike) -> F64:
        """Eq. 47 with its first term for t > t_lim positive and without the k within the bracket, rad."""
        time, lim, k, inertia = self._split(t)
        slip = k * lim * time * (time - lim) / (4 * inertia) + k / (6 * inertia) * (lim**3 / 2 - time**3)
        return np.where(time <= lim, -k * time**3 / (12 * inertia), slip)

    def printed_angular_velocity_b(self, t: ArrayLike) -> F64:
        """Eq. 46 as printed, rad/s: it jumps at t_lim."""
        time, lim, k, inertia = self._split(t)
        slip = -4 * inertia / k * (lim**2 + 2 * time * (time - lim))
        return np.where(time <= lim, -k * time**2 / (4 * inertia), slip)

    def printed_angle_b(self, t: ArrayLike) -> F64:
        """Eq. 47 as printed, rad: it jumps at t_lim, and its derivative is not the angular velocity."""
        time, lim, k, inertia = self._split(t)
        slip = -k * lim * time * (time - lim) / (4 * inertia) + k / (6 * inertia) * (k * lim**3 / 2 - time**3)
        return np.where(time <= lim, -k * time**3 / (12 * inertia), slip)

    def _split(self, t: ArrayLike) -> tuple[F64, float, float, float]:
        return np.asarray(t, dtype=np.float64), self.t_lim, self.rate, self.inertia
