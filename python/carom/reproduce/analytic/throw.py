"""Throw of an object ball by a spinning cue ball (section 5.3, eqs. 50 and 51).

The cue ball moves along +x and hits the object ball in the direction (cos phi, sin phi). With the spin w_z about the
vertical and the rolling part w_y about +y its contact point slips sideways, along t = (sin phi, -cos phi), by v sin phi -
R w_z, and downwards by R w_y cos phi (the paper, which shoots along y, calls it w_x). The object ball is thrown towards
+t.

Eq. 50 is right for two balls in free space: e = 1 and kappa = I/(m r^2) = 2/5. On a table it holds only where the cue
ball does not roll: friction of a rolling cue ball presses the object ball down, the table pushes back, and the slip turns
(`on_table`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.reproduce.analytic.impact import Ball, Outcome, Touch, collide

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Shot:
    """A shot of section 5.3: `speed` v (m/s), `phi` cut angle (rad), `spin` w_z and `roll` w_y of the cue ball (rad/s).

    Equal homogeneous balls; `friction` is mu_b between them, from eq. 51 if None; `restitution` e_N.
    """

    speed: float
    phi: float
    spin: float
    roll: float
    mass: float
    radius: float
    friction: float | None = None
    restitution: float = 1.0

    @classmethod
    def of(cls, model: Mapping[str, Any]) -> Shot:
        """The shot that the arrays of a scenario describe: cue ball first, its path through the origin at the hit.

        A law of friction in place of a number is taken to be eq. 51.
        """
        target, laws = model["position"][1], model.get("friction_law")
        law = laws[0] if laws is not None else None
        return cls(
            speed=float(model["velocity"][0][0]),
            phi=math.atan2(target[1], target[0]),
            spin=float(model["angular_velocity"][0][2]),
            roll=float(model["angular_velocity"][0][1]),
            mass=float(model["mass"][0]),
            radius=float(model["radius"][0]),
            friction=float(model["friction"][0]) if law is None else None,
            restitution=float(model["restitution"][0]),
        )

    @property
    def slip(self) -> tuple[float, float]:
        """Slip of the cue ball on the object ball before the impact, m/s: sideways (along t) and upwards."""
        sideways = self.speed * math.sin(self.phi) - self.radius * self.spin
        return sideways, -self.radius * self.roll * math.cos(self.phi)

    @property
    def slip_speed(self) -> float:
        """v_rel of eq. 50, m/s."""
        return math.hypot(*self.slip)

    @property
    def mu(self) -> float:
        """mu_b of this shot."""
        return friction_of(self.slip_speed) if self.friction is None else self.friction

    @property
    def sticks(self) -> bool:
        """Whether slip ends within the impact (the bound 1/7 of eq. 50)."""
        return self.slip_speed == 0 or self.mu * self._closing / self.slip_speed >= 1 / 7

    @property
    def direction(self) -> F64:
        """From the cue ball to the object ball, (3,)."""
        return np.array([math.cos(self.phi), math.sin(self.phi), 0.0])

    @property
    def sideways(self) -> F64:
        """t, (3,): where a positive throw goes."""
        return np.array([math.sin(self.phi), -math.cos(self.phi), 0.0])

    @property
    def _closing(self) -> float:
        """(1 + e)/2 v cos phi, m/s: normal velocity of the object ball after the impact."""
        return (1 + self.restitution) / 2 * self.speed * math.cos(self.phi)


def friction_of(slip_speed: float) -> float:
    """Eq. 51: mu_b for a slip speed in m/s (Marlow's measurements)."""
    return 9.951e-3 + 0.108 * math.exp(-1.088 * slip_speed)


def free_throw(shot: Shot) -> float:
    """Eq. 50, rad, for any e_N: throw of the object ball where only the two balls touch."""
    sideways, _ = shot.slip
    share = 1 / 7 if shot.sticks else shot.mu * shot._closing / shot.slip_speed
    return math.atan(share * sideways / shot._closing)


def impact(shot: Shot, *, table: bool) -> Outcome:
    """The impact law solved for the two balls, cue ball first; with `table`, they lie on a frictionless one."""
    resting = np.zeros(3)
    inertia = 0.4 * shot.mass * shot.radius**2
    along, spins = np.array([shot.speed, 0.0, 0.0]), np.array([0.0, shot.roll, shot.spin])
    cue = Ball(shot.mass, shot.radius, inertia, along, spins)
    target = Ball(shot.mass, shot.radius, inertia, resting, resting)
    hit = Touch(0, 1, -shot.direction, shot.mu, shot.restitution)
    beds = [Touch(ball, None, UP, 0.0, 0.0) for ball in (0, 1)]
    return collide([cue, target], [hit, *beds] if table else [hit])


def on_table(shot: Shot) -> float:
    """Throw, rad, with the object ball on a frictionless table that keeps it from moving down."""
    return angle_of(impact(shot, table=True).velocity[1], shot.direction)


def angle_of(velocity: F64, direction: F64) -> float:
    """Throw, rad: angle from the line of centres `direction` (3,) to the horizontal velocity (3,), positive towards t."""
    sideways = velocity[0] * direction[1] - velocity[1] * direction[0]
    return math.atan2(float(sideways), float(velocity[0] * direction[0] + velocity[1] * direction[1]))
