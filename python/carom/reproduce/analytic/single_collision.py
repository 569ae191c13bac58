"""A rolling cue ball hits a ball at rest (section 5.2 and Appendix C: eqs. 48, 49 and 63 to 67).

The cue ball rolls along +y and turns towards +x; the object ball leaves in the direction (-sin phi, cos phi). The hit
takes no time; then the cue ball slides on the cloth along a parabola until it rolls along a straight line.

Three things of the paper need care:

* Eq. 64 has a wrong sign: the velocity of the contact point is `v_y + R w_x`. With the printed sign a rolling ball slips.
* Eq. 63 assumes that the slip of the hit keeps its direction and ends nowhere, and that the table does nothing. The
  impact law (eq. 17) has friction against the slip *after* the impact. The two agree for free balls that do not stick,
  `mu_b <= 2/(7 (1 + e) cos phi)`. With the object ball on the table, or with rotation about the vertical locked, the slip
  turns: see `after_impact`.
* Friction throws the cue ball up. Where it is in the air eq. 67 does not hold; with e_N = 1 on the cloth it bounces for
  ever and is slowed by the bounces, on average as much as by sliding (`carom.reproduce.analytic.table_motion`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64
from carom.reproduce.analytic.impact import Ball, Outcome, Touch, collide

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Hit:
    """The hit of section 5.2: `speed` v of the rolling cue ball (m/s), cut angle `phi` (rad), `friction` mu_b and
    `restitution` e_N.

    Equal homogeneous balls of `mass` (kg) and `radius` R (m).
    """

    speed: float
    phi: float
    friction: float
    restitution: float
    mass: float
    radius: float

    @classmethod
    def of(cls, model: Mapping[str, Any]) -> Hit:
        """The hit that the arrays of a scenario describe: cue ball first, its path through the origin at the hit.

        A cue ball that slides at the start has come to roll by then.
        """
        target, radius = model["position"][1], float(model["radius"][0])
        start, spin = float(model["velocity"][0][1]), float(model["angular_velocity"][0][0])
        return cls(
            speed=(5 * start - 2 * radius * spin) / 7,
            phi=math.atan2(-target[0], target[1]),
            friction=float(model["friction"][0]),
            restitution=float(model["restitution"][0]),
            mass=float(model["mass"][0]),
            radius=radius,
        )

    @property
    def impulse(self) -> float:
        """Normal impulse of the hit, N s, where nothing but the two balls acts: `(1 + e)/2 m v cos phi`."""
        return (1 + self.restitution) / 2 * self.mass * self.speed * math.cos(self.phi)

    @property
    def keeps_slipping(self) -> bool:
        """Whether eq. 63 can hold: friction does not end the slip, which is v for a rolling cue ball."""
        return self.friction * self.impulse * 7 / self.mass <= self.speed

    @property
    def direction(self) -> F64:
        """From the cue ball to the object ball at the hit, (3,)."""
        return np.array([-math.sin(self.phi), math.cos(self.phi), 0.0])


def cut_angle(fraction: ArrayLike) -> F64:
    """phi, rad, for the hit fraction f of 0 (a miss) to 1 (full): `sin phi = 1 - f` (below eq. 48)."""
    return np.arcsin(1 - np.asarray(fraction, dtype=np.float64))


def deflection(phi: ArrayLike) -> F64:
    """Eq. 48: angle by which a rolling cue ball is turned in the end, rad; mu_b = 0 and e_N = 1."""
    angle = np.asarray(phi, dtype=np.float64)
    return np.arctan(np.sin(angle) * np.cos(angle) / (np.sin(angle) ** 2 + 2 / 5))


def eq_63(hit: Hit) -> tuple[F64, F64]:
    """Velocity and angular velocity of the cue ball after the hit by eq. 63, (3,) each; their z are left at 0."""
    v, e, mu = hit.speed, hit.restitution, hit.friction
    sin, cos = math.sin(hit.phi), math.cos(hit.phi)
    velocity = np.array([
        v / 2 * sin * cos * (1 + e - mu * (1 + e) * cos),
        v / 2 * (sin**2 * (2 - mu * (1 + e) * cos) + (1 - e) * cos**2),
        0.0,
    ])  # fmt: skip
    spin = v / hit.radius * np.array([
        5 / 4 * mu * (1 + e) * cos**3 - 1,
        5 / 4 * mu * (1 + e) * sin * cos**2,
        0.0,
    ])  # fmt: skip
    return velocity, spin


def after_impact(
    hit: Hit, *, locked: bool, table_friction: float | None, table_restitution: float = 1.0
) -> Outcome:
    """The impact law solved for the two balls, cue ball first.

    `locked`: neither ball turns about the vertical. `table_friction`: mu of the cloth below both balls, None without a
    table. A ball that rests on the cloth does not approach it, so that e_N of the cloth adds nothing within the hit.
    """
    rest, inertia = np.zeros(3), 0.4 * hit.mass * hit.radius**2
    axis = UP if locked else None
    rolling = np.array([-hit.speed / hit.radius, 0.0, 0.0])
    cue = Ball(hit.mass, hit.radius, inertia, np.array([0.0, hit.speed, 0.0]), rolling, axis)
    target = Ball(hit.mass, hit.radius, inertia, rest, rest, axis)
    touches = [Touch(0, 1, -hit.direction, hit.friction, hit.restitution)]
    if table_friction is not None:
        touches += [Touch(ball, None, UP, table_friction, table_restitution) for ball in (0, 1)]
    return collide([cue, target], touches)


@dataclass(frozen=True)
class Roll:
    """Slide and roll of the cue ball on the cloth after the hit, never leaving it (eqs. 49 and 64 to 67).

    `velocity` and `spin` (3,) right after the hit, m/s and rad/s; `friction` mu of the cloth. Times count from the hit.
    """

    velocity: F64
    spin: F64
    radius: float
    friction: float
    gravity: float

    @property
    def slip(self) -> F64:
        """Velocity of the contact point, (2,) m/s: eq. 64 with `v_y + R w_x`, the paper prints a minus."""
        r = self.radius
        return np.array([self.velocity[0] - r * self.spin[1], self.velocity[1] + r * self.spin[0]])

    @property
    def printed_slip(self) -> F64:
        """Eq. 64 as printed, (2,) m/s."""
        r = self.radius
        return np.array([self.velocity[0] - r * self.spin[1], self.velocity[1] - r * self.spin[0]])

    @property
    def t_roll(self) -> float:
        """When sliding ends, s (eq. 65)."""
        return self._end(self.slip)

    @property
    def printed_t_roll(self) -> float:
        """Eq. 65 with the slip of eq. 64 as printed, s."""
        return self._end(self.printed_slip)

    @property
    def final_velocity(self) -> F64:
        """Velocity of the rolling ball, (2,) m/s (eq. 66)."""
        r = self.radius
        return np.array([
            (5 * self.velocity[0] + 2 * r * self.spin[1]) / 7,
            (5 * self.velocity[1] - 2 * r * self.spin[0]) / 7,
        ])  # fmt: skip

    def position(self, t: ArrayLike) -> F64:
        """Way from the place of the hit, (T, 2) m, at the times t (T,): eqs. 49 and 67."""
        return self._way(t, self.slip, self.t_roll)

    def printed_position(self, t: ArrayLike) -> F64:
        """Eqs. 49 and 67 with the slip of eq. 64 as printed."""
        return self._way(t, self.printed_slip, self.printed_t_roll)

    def velocity_at(self, t: ArrayLike) -> F64:
        """Velocity, (T, 2) m/s."""
        return self._velocity(t, self.slip, self.t_roll)

    def _end(self, slip: F64) -> float:
        return 2 * float(np.linalg.norm(slip)) / (7 * self.friction * self.gravity)

    def _slowing(self, slip: F64) -> F64:
        size = float(np.linalg.norm(slip))
        return self.friction * self.gravity * slip / size if size > 0 else np.zeros(2)

    def _velocity(self, t: ArrayLike, slip: F64, t_roll: float) -> F64:
        sliding = np.minimum(np.asarray(t, dtype=np.float64), t_roll)[..., np.newaxis]
        return np.asarray(self.velocity[:2] - self._slowing(slip) * sliding)

    def _way(self, t: ArrayLike, slip: F64, t_roll: float) -> F64:
        time = np.asarray(t, dtype=np.float64)[..., np.newaxis]
        sliding = np.minimum(time, t_roll)
        curved = self.velocity[:2] * sliding - self._slowing(slip) * sliding**2 / 2
        return np.asarray(curved + self._velocity(t_roll, slip, t_roll) * (time - sliding))


def printed_rise(hit: Hit, h: float, table_friction: float, gravity: float) -> float:
    """Rise of the total energy in the step of a hit with e_N = 1 and mu_b = 0 under eqs. 16, 24, 43 as printed, J.

    First order in the step h (s), wherever in the step the hit falls. The printed law reverses the approach along the line
    of centres of t_n, but along that of t_{n+1}, which has turned by v sin(phi) h/(2 r): the balls part faster than they
    met. Meanwhile the cloth slows both balls, which slide by v cos(phi) after the hit: a half of it counts in this step.
    """
    across, along = hit.speed * math.sin(hit.phi), hit.speed * math.cos(hit.phi)
    gain = hit.mass * along * across**2 * h / (4 * hit.radius)
    return gain - table_friction * hit.mass * gravity * along * h
