"""Section 5.6 until the balls meet: a ball that slides on a level bed.

    v(t) = v0 - mu g t            friction, while the lowest point slides
    w(t) = mu m g r t / I         spin about the axis normal to the motion, from rest
    gap  = v0 t - mu g t^2 / 2    at the contact

The scheme reproduces both velocities and the position to rounding (the force is constant), so these are exact
for every step h. After the impact there is no closed form: friction and several impacts at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Slide:
    """The cue ball on its way, from the numbers of the scenario."""

    speed: float  # at the start, m/s
    slowing: float  # mu g, m/s^2
    spinning_up: float  # mu m g r / I, rad/s^2
    gap: float  # to the next ball, m

    @classmethod
    def of(cls, model: dict[str, Any]) -> Slide:
        """From the core's arrays: sphere 0 moves along x towards sphere 1 on plane 0."""
        pair = (int(model["material"][0]), int(model["plane_material"][0]))
        laws = zip(model["law_a"], model["law_b"], model["friction"], strict=True)
        [mu] = [float(f) for a, b, f in laws if (int(a), int(b)) in (pair, pair[::-1])]
        g = -float(model["gravity"][2])
        mass, inertia, radius = (float(model[key][0]) for key in ("mass", "inertia", "radius"))
        gap = float(model["position"][1][0] - model["position"][0][0]) - radius - float(model["radius"][1])
        return cls(float(model["velocity"][0][0]), mu * g, mu * mass * g * radius / inertia, gap)

    @property
    def contact_speed(self) -> float:
        """Speed at the contact, m/s."""
        return math.sqrt(self.speed**2 - 2 * self.slowing * self.gap)

    @property
    def contact_time(self) -> float:
        """Time of the contact, s."""
        return 2 * self.gap / (self.speed + self.contact_speed)

    def velocity(self, t: float) -> float:
        """Along x, m/s."""
        return self.speed - self.slowing * t

    def spin(self, t: float) -> float:
        """About y, rad/s."""
        return self.spinning_up * t

    def travelled(self, t: float) -> float:
        """Along x since the start, m."""
        return self.speed * t - 0.5 * self.slowing * t**2
