"""Newton's impact law with Coulomb friction for a few spheres, solved at one instant: the limit h -> 0 of a time step.

At the instant of an impact only impulses matter; weight and other finite forces do nothing. Contacts that are closed and
not opening take part: the hit itself, and resting contacts that it loads (a ball pressed on the table). Friction obeys
the law of the paper (eqs. 16, 17) with e_T = 0: the impulse opposes the slip *after* the impact. For a single contact
between spheres that is the direction of the slip before, and the closed forms of eqs. 50 and 63 follow. With the table,
or with a locked axis of rotation, the slip turns and there is no closed form; the law is then solved here by projected
Gauss-Seidel sweeps, in world vectors and without a line of the simulation's code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carom.errors import CaromError

F64 = NDArray[np.float64]

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
    velocity = np.array([ball.velocity for ball in balls], dtype=np.float64)
    spin = np.array([ball.spin for ball in balls], dtype=np.float64)
    impulse = np.zeros((len(touches), 3))
    # Restitution asks for this relative normal velocity after the impact; a contact at rest asks for 0.
    wanted = [
        -touch.restitution * min(0.0, float(touch.normal @ _relative(balls, touch, velocity, spin)))
        for touch in touches
    ]
    compliance = [_compliance(balls, touch) for touch in touches]
    for _ in range(MOST_SWEEPS):
        change = 0.0
        for c, touch in enumerate(touches):
            new = _local(impulse[c], touch, wanted[c], compliance[c], _relative(balls, touch, velocity, spin))
            step = new - impulse[c]
            impulse[c] = new
            _apply(balls, touch, step, velocity, spin)
            change = max(change, float(np.abs(step).max()))
        if change <= CONVERGED * float(np.abs(impulse).max(initial=0.0)):
            return Outcome(velocity, spin, impulse)
    raise CaromError(
        f"the impact law did not converge in {MOST_SWEEPS} sweeps; the last changed an impulse by {change:g}"
    )


def _sides(balls: Sequence[Ball], touch: Touch) -> list[tuple[int, float, F64]]:
    """Ball, sign of its part in the relative velocity, and arm from its centre to the contact point."""
    sides = [(touch.a, 1.0, -balls[touch.a].radius * touch.normal)]
    if touch.b is not None:
        sides.append((touch.b, -1.0, balls[touch.b].radius * touch.normal))
    return sides


def _relative(balls: Sequence[Ball], touch: Touch, velocity: F64, spin: F64) -> F64:
    """Velocity of the contact point of a relative to that of b, (3,) m/s (eq. 34)."""
    total = np.zeros(3)
    for ball, sign, arm in _sides(balls, touch):
        total += sign * (velocity[ball] + np.cross(spin[ball], arm))
    return total


def _apply(balls: Sequence[Ball], touch: Touch, impulse: F64, velocity: F64, spin: F64) -> None:
    for ball, sign, arm in _sides(balls, touch):
        velocity[ball] += sign * impulse / balls[ball].mass
        spin[ball] += balls[ball].mobility @ np.cross(arm, sign * impulse)


def _compliance(balls: Sequence[Ball], touch: Touch) -> tuple[float, float]:
    """Change of relative velocity by an impulse, 1/kg: along the normal, and the greatest along a tangent."""
    normal = tangent = 0.0
    for ball, _, arm in _sides(balls, touch):
        lever = np.array([np.cross(arm, axis) for axis in np.eye(3)])
        normal += 1 / balls[ball].mass
        turning = lever @ balls[ball].mobility @ lever.T
        tangent += 1 / balls[ball].mass + float(np.linalg.eigvalsh(turning)[-1])
    return normal, tangent


def _local(impulse: F64, touch: Touch, wanted: float, compliance: tuple[float, float], relative: F64) -> F64:
    """One contact brought to its law with the others held: normal part first, then friction on its disc."""
    n = touch.normal
    speed = float(n @ relative)
    old = float(n @ impulse)
    normal = max(0.0, old - (speed - wanted) / compliance[0])
    # The normal impulse goes through the centres: it changes no slip of its own contact.
    friction = impulse - old * n - (relative - speed * n) / compliance[1]
    bound, size = touch.friction * normal, float(np.linalg.norm(friction))
    return normal * n + (friction if size <= bound else friction * (bound / size))
