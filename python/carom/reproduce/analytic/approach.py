"""A ball on its way to the next one: it slides on a level bed, then rolls (sections 5.4 and 5.6).

    sliding    v' = -mu g        w' = (mu - rho/r) m g r/I       until the lowest point rests, v = r w
    rolling    v' = -rho g/(r (1 + kappa)),  w = v/r             kappa = I/(m r^2)

with rolling resistance rho (0 for a rigid ball). Friction is constant in either phase, so the scheme has velocities
and positions exactly at every h, but for the step in which sliding ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Approach:
    """A ball with `speed` (m/s) along x and no spin, `gap` (m) before the next; `radius` m, `kappa` = I/(m r^2)."""

    speed: float
    gap: float
    radius: float
    kappa: float
    mu: float
    rho: float
    gravity: float

    @classmethod
    def of(cls, model: Mapping[str, Any]) -> Approach:
        """From the core's arrays (`carom.Scene.to_model`): sphere 0 moves along x towards sphere 1 on plane 0."""
        pair = (int(model["material"][0]), int(model["plane_material"][0]))
        laws = [(int(a), int(b)) for a, b in zip(model["law_a"], model["law_b"], strict=True)]
        [law] = [i for i, materials in enumerate(laws) if materials in (pair, pair[::-1])]
        mass, inertia, radius = (float(model[key][0]) for key in ("mass", "inertia", "radius"))
        return cls(
            speed=float(model["velocity"][0][0]),
            gap=float(model["position"][1][0] - model["position"][0][0]) - radius - float(model["radius"][1]),
            radius=radius,
            kappa=inertia / (mass * radius**2),
            mu=float(model["friction"][law]),
            rho=float(model["rolling_radius"][law]),
            gravity=-float(model["gravity"][2]),
        )

    @property
    def slowing(self) -> float:
        """Deceleration while the ball slides, mu g, m/s^2."""
        return self.mu * self.gravity

    @property
    def rolling_slowing(self) -> float:
        """Deceleration while it rolls, rho g/(r (1 + kappa)), m/s^2."""
        return self.rho * self.gravity / (self.radius * (1 + self.kappa))

    @property
    def spinning_up(self) -> float:
        """Angular acceleration while it slides, rad/s^2."""
        return (self.mu - self.rho / self.radius) * self.gravity / (self.kappa * self.radius)

    @property
    def rolling_time(self) -> float:
        """When it begins to roll, s; infinite without friction."""
        ending = self.slowing + self.radius * self.spinning_up
        return self.speed / ending if ending > 0 else math.inf

    @property
    def contact_time(self) -> float:
        """When it meets the next ball, s."""
        rolls = self.rolling_time
        if self.travelled(rolls) < self.gap:
            return rolls + _time_of(
                self.gap - self.travelled(rolls), self.velocity(rolls), self.rolling_slowing
            )
        return _time_of(self.gap, self.speed, self.slowing)

    @property
    def contact_speed(self) -> float:
        """Its speed there, m/s."""
        return self.velocity(self.contact_time)

    def velocity(self, t: float) -> float:
        """Along x, m/s."""
        slid = min(t, self.rolling_time)
        return self.speed - self.slowing * slid - self.rolling_slowing * (t - slid)

    def spin(self, t: float) -> float:
        """About y, rad/s."""
        return self.spinning_up * t if t < self.rolling_time else self.velocity(t) / self.radius

    def travelled(self, t: float) -> float:
        """Along x since the start, m."""
        if math.isinf(t):
            return math.inf
        slid = min(t, self.rolling_time)
        rolled = t - slid
        return (
            self.speed * slid
            - 0.5 * self.slowing * slid**2
            + self.velocity(slid) * rolled
            - 0.5 * self.rolling_slowing * rolled**2
        )


def _time_of(distance: float, speed: float, slowing: float) -> float:
    """Time for a distance under constant deceleration, s."""
    return 2 * distance / (speed + math.sqrt(speed**2 - 2 * slowing * distance))
