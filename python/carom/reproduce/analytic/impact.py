"""Newton's impact law with Coulomb friction for a few spheres, solved at one instant: the limit h -> 0 of a time step.

At the instant of an impact only impulses matter; weight and other finite forces do nothing. Contacts that are closed and
not opening take part: the hit itself, and resting contacts that it loads (a ball pressed on the table). Friction obeys
the law of the paper (eqs. 16, 17) with e_T = 0: the impulse opposes the slip *after* the impact. For a single contact
between spheres that is the direction of the slip before, and the closed forms of eqs. 50 and 63 follow. With the table,
or with a locked axis of rotation, the slip turns and there is no closed form; the law is then solved here by projected
Gauss-Seidel sweeps, in world vectors and without a line of the simulation's code.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError

#: Sweeps end when no impulse changes by more than this fraction of the largest.
CONVERGED = 1e-15
MOST_SWEEPS = 20_000


@dataclass(frozen=True)
class Ball:
    """A sphere before an impact: `velocity` v (3,) m/s, `spin` w (3,) rad/s, fixed axes.

    `locked` (3,): a unit vector about which the ball cannot turn; zeros if it can turn about every axis.
    """

    mass: float
    radius: float
    inertia: float
    velocity: F64
    spin: F64
    locked: F64 | None = None

    @property
    def mobility(self) -> F64:
        """Change of angular velocity by an angular impulse, (3, 3), 1/(kg m^2)."""
        axis = np.zeros(3) if self.locked is None else self.locked
        return np.asarray((np.eye(3) - np.outer(axis, axis)) / self.inertia)


@dataclass(frozen=True)
class Touch:
    """A closed contact of ball `a` with ball `b`, or with a fixed plane if `b` is None.

    `normal` (3,) points from b to a; `restitution` e_N acts on the speed of approach.
    """

    a: int
    b: int | None
    normal: F64
    friction: float
    restitution: float


@dataclass(frozen=True)
class Outcome:
    """Velocities after the impact, (N, 3) m/s and rad/s, and the impulse on `a` of each contact, (C, 3) N s."""

    velocity: F64
    spin: F64
    impulse: F64


def collide(balls: Sequence[Ball], touches: Sequence[Touch]) -> Outcome:
    """Solve the impact law: all contacts at once, normals and levers as they are at the instant."""
    rows = np.array([_rows(balls, touch) for touch in touches])  # (C, 3, 6 N)
    before = np.concatenate([[*ball.velocity, *ball.spin] for ball in balls])
    response = _inverse_mass(balls)
    # Change of the relative velocity at one contact by an impulse at another, (C, C, 3, 3).
    compliance = np.einsum("aik,kl,bjl->abij", rows, response, rows)
    relative = rows @ before
    # Restitution asks for this relative normal velocity after the impact; a contact at rest asks for 0.
    local = [
        _Local(touch, -touch.restitution * min(0.0, float(touch.normal @ speed)), compliance[c, c])
        for c, (touch, speed) in enumerate(zip(touches, relative, strict=True))
    ]
    impulse = np.zeros((len(touches), 3))
    for _ in range(MOST_SWEEPS):
        change = 0.0
        for c, contact in enumerate(local):
            step = contact.solved(impulse[c], relative[c]) - impulse[c]
            impulse[c] += step
            relative += compliance[:, c] @ step
            change = max(change, float(np.abs(step).max()))
        if change <= CONVERGED * float(np.abs(impulse).max(initial=0.0)):
            break
    else:
        raise CaromError(
            f"the impact law did not converge in {MOST_SWEEPS} sweeps; the last changed an impulse by {change:g}"
        )
    after = before + response @ np.einsum("cik,ci->k", rows, impulse)
    bodies = after.reshape(len(balls), 2, 3)
    return Outcome(bodies[:, 0], bodies[:, 1], impulse)


class _Local:
    """One contact, brought to its law with the impulses of the others held."""

    def __init__(self, touch: Touch, wanted: float, compliance: F64) -> None:
        self.normal, self.friction, self.wanted = touch.normal, touch.friction, wanted
        self.along = float(self.normal @ compliance @ self.normal)
        # A locked axis makes the compliances along the tangents differ: the greatest keeps the sweeps from running away.
        self.across = float(np.linalg.eigvalsh(compliance)[-1])

    def solved(self, impulse: F64, relative: F64) -> F64:
        """The impulse for the relative velocity (3,) that there is: normal part first, then friction on its disc."""
        n = self.normal
        speed, old = float(n @ relative), float(n @ impulse)
        # The normal impulse goes through the centres: it changes no slip of its own contact.
        normal = max(0.0, old - (speed - self.wanted) / self.along)
        friction = impulse - old * n - (relative - speed * n) / self.across
        bound, size = self.friction * normal, math.sqrt(float(friction @ friction))
        return normal * n + (friction if size <= bound else friction * (bound / size))


def _rows(balls: Sequence[Ball], touch: Touch) -> F64:
    """Velocity of the contact point of a relative to that of b (eq. 34) from all velocities and spins, (3, 6 N)."""
    rows = np.zeros((3, 6 * len(balls)))
    sides = [(touch.a, 1.0, -balls[touch.a].radius * touch.normal)]
    if touch.b is not None:
        sides.append((touch.b, -1.0, balls[touch.b].radius * touch.normal))
    for ball, sign, arm in sides:
        turning = np.array([np.cross(axis, arm) for axis in np.eye(3)]).T  # w x arm
        rows[:, 6 * ball : 6 * ball + 6] = sign * np.hstack([np.eye(3), turning])
    return rows


def _inverse_mass(balls: Sequence[Ball]) -> F64:
    """Change of all velocities and spins by impulses and angular impulses, (6 N, 6 N)."""
    response = np.zeros((6 * len(balls), 6 * len(balls)))
    for n, ball in enumerate(balls):
        at = slice(6 * n, 6 * n + 3), slice(6 * n + 3, 6 * n + 6)
        response[at[0], at[0]] = np.eye(3) / ball.mass
        response[at[1], at[1]] = ball.mobility
    return response
