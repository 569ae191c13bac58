"""What joints and springs move with a ball: the ball itself, or the clump that it is a part of."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.mechanics import GROUND_INDEX, numbers, spring_ends
from carom.scene.assembly.rotations import product, rotated, rotated_back
from carom.scene.tables.clumps import Clump
from carom.scene.tables.loads import Spring

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts


class Carrier(NamedTuple):
    """A rigid body at the start."""

    number: int
    """That of the ball; of a clump that of its first ball."""
    balls: range
    """Its balls, by number."""
    name: str
    mass: float
    moments: tuple[float, float, float]
    """Principal moments of inertia, kg m^2."""
    centre: F64
    axes: F64 | None
    """Unit quaternion (4,), w first, from the principal axes to the fixed ones; None of a ball, which has none."""
    arms: F64
    """(n, 3) from the centre to those of its balls, in the principal axes, m."""
    velocity: F64
    angular_velocity: F64

    def turning(self, vector: F64) -> F64:
        """A vector (3,) in fixed axes along those in which the inertia is diagonal."""
        return vector if self.axes is None else rotated_back(self.axes, vector)

    def turning_back(self, vector: F64) -> F64:
        """The opposite."""
        return vector if self.axes is None else rotated(self.axes, vector)

    def lever(self, point: F64, along: F64) -> F64:
        """(6,) what a unit impulse at a point (3,) along a unit vector (3,) does to `sqrt(m) v` and `sqrt(J) w`."""
        arm = self.turning(np.cross(point - self.centre, along))
        return np.concatenate([self.turning(along) / np.sqrt(self.mass), arm / np.sqrt(self.moments)])


class Carriers:
    """Of all balls of a scene; only clumps that are there from the start can be held."""

    def __init__(self, parts: Parts) -> None:
        self._bodies = bodies = parts.bodies()
        clumps = dict(parts.tables(Clump))
        self._clumps = {
            ball: (range(s.start, s.stop), clumps[s.index])
            for s in bodies.segments
            if s.section == Clump.section
            for ball in range(s.start, s.stop)
        }

    def of(self, ball: int) -> Carrier:
        """What moves with a ball."""
        bodies = self._bodies
        if ball not in self._clumps:
            j = float(bodies.inertia[ball])
            return Carrier(
                ball,
                range(ball, ball + 1),
                bodies.names[ball],
                float(bodies.mass[ball]),
                (j, j, j),
                bodies.position[ball],
                None,
                np.zeros((1, 3)),
                bodies.velocity[ball],
                bodies.angular_velocity[ball],
            )
        return clump_carrier(*self._clumps[ball])


def clump_carrier(balls: range, clump: Clump) -> Carrier:
    """A clump whose balls have these numbers."""
    body = clump.body()
    arms = np.array(clump.spheres)[:, :3] - body.centre
    return Carrier(
        balls.start,
        balls,
        clump.name,
        body.mass,
        body.moments,
        clump.middle(),
        product(clump.turn(), body.axes),
        rotated_back(np.array(body.axes), arms),
        np.array(clump.velocity),
        np.array(clump.angular_velocity),
    )


class Held(NamedTuple):
    """A spring between bodies."""

    number: int
    """Its place among the tables."""
    spring: Spring
    ends: list[tuple[Carrier, F64]]
    """The bodies, and their levers along it."""

    @property
    def inverse_mass(self) -> float:
        """1/kg, between its ends along it: a body may be turned far more easily than moved."""
        return float(sum(lever @ lever for _, lever in self.ends))


def springs(parts: Parts) -> Iterator[Held]:
    """Each spring with what it holds."""
    listed = parts.tables(Spring)
    if not listed:
        return
    bodies, carriers = parts.bodies(), Carriers(parts)
    number = numbers(bodies)
    for i, spring in listed:
        a, b, *points = spring_ends(spring, bodies, number)
        span = points[0] - points[1]
        size = float(np.linalg.norm(span))
        along = span / size if size else np.array([1.0, 0.0, 0.0])
        held = [(carriers.of(k), at) for k, at in zip((a, b), points, strict=True) if k != GROUND_INDEX]
        yield Held(i, spring, [(carrier, carrier.lever(at, along)) for carrier, at in held])
