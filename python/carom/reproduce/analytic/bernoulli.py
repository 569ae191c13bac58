"""Bernoulli's problem (section 5.5): one ball strikes two others at once.

Ball 2 moves along x with v and touches balls 1 and 3, whose centres lie in the directions (cos alpha, +-sin alpha).
Equal balls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64


@dataclass(frozen=True)
class Bernoulli:
    """`speed` v (m/s), `alpha` (rad), `restitution` e, `radius` r (m), `kappa` = I/(m r^2)."""

    speed: float
    alpha: float
    restitution: float = 1.0
    radius: float = 1.0
    kappa: float = 0.4

    @property
    def velocity(self) -> F64:
        """Velocities of balls 1, 2, 3 after the impact without friction, (3, 3), m/s: eq. 53, for any e.

        The impulse on balls 1 and 3 is u = v c (1 + e)/(1 + 2 c^2) along the lines of centres, c = cos alpha; with e
        = 1 this is eq. 53: 2 v/(3 + tan^2 alpha) = u c.
        """
        c, s = math.cos(self.alpha), math.sin(self.alpha)
        u = self.speed * c * (1 + self.restitution) / (1 + 2 * c * c)
        return np.array([[u * c, u * s, 0.0], [self.speed - 2 * u * c, 0.0, 0.0], [u * c, -u * s, 0.0]])

    def turn(self, h: float) -> float:
        """Angle by which the normals have turned when a scheme of step `h` (s) solves the impact, to first order, rad.

        The balls touch at t = 0 and the impact is solved at t = h: ball 2 is predicted h v too deep, and the position
        level pushes the balls apart along the old normals, which leaves d alpha = h v sin(alpha)/(2 r (1 + 2 cos^2
        alpha)).
        """
        c, s = math.cos(self.alpha), math.sin(self.alpha)
        return h * self.speed * s / (2 * self.radius * (1 + 2 * c * c))

    def first_order_error(self, h: float) -> float:
        """Greatest change of a velocity component by `turn(h)`, m/s: what an exact impact at turned normals is off."""
        turned = Bernoulli(
            self.speed, self.alpha + self.turn(h), self.restitution, self.radius, self.kappa
        ).velocity
        return float(np.max(np.abs(turned - self.velocity)))

    def rise_as_printed(self, h: float) -> float:
        """Relative gain of kinetic energy under the law as printed (eqs. 16, 24, 43), e = 1, no friction, to O(h).

        Such a law asks for n'.dv+ = -n.dv-, with the old normal n and the new one n', dv the velocity of ball 1 or 3
        relative to ball 2. The work of an impulse is L n'.(dv- + dv+)/2 = L (n' - n).dv-/2 and vanishes only where
        the normal stays; here (n' - n).dv- = v sin(alpha) turn at either contact.
        """
        c, s = math.cos(self.alpha), math.sin(self.alpha)
        impulse = 2 * self.speed * c / (1 + 2 * c * c)
        return 2 * impulse * s * self.turn(h) / self.speed

    @property
    def energy_with_sticking(self) -> float:
        """T after / T before where the balls stick to each other at the contact: by Newton's law it grows at e = 1.

        Ball 2 keeps x v: x = (1 - 2 c^2 e)/(1 + 2 c^2 + 2 s^2/(1 + 1/kappa)), normal impulse c (e + x) m v on either
        side and tangential one x s/(1 + 1/kappa) m v: 38/37 at alpha = 30 degrees, e = 1, homogeneous balls (kappa =
        0.4).
        """
        c, s, e = math.cos(self.alpha), math.sin(self.alpha), self.restitution
        stick = 1 + 1 / self.kappa
        x = (1 - 2 * c * c * e) / (1 + 2 * c * c + 2 * s * s / stick)
        normal, tangential = c * (e + x), x * s / stick
        # Balls 1 and 3: translation by both impulses, spin by the tangential one. The two spin up ball 2 in opposite senses.
        outer = normal**2 + tangential**2 * stick
        return x * x + 2 * outer

    @property
    def friction_to_stick(self) -> float:
        """Least mu at which they stick."""
        c, s, e = math.cos(self.alpha), math.sin(self.alpha), self.restitution
        stick = 1 + 1 / self.kappa
        x = (1 - 2 * c * c * e) / (1 + 2 * c * c + 2 * s * s / stick)
        return abs(x) * s / (stick * c * (e + x))
