"""The strike of a cue: from tip offset, elevation and speed to the velocities of the ball.

The tip does not slip on the ball. With the cue moving at V along the unit vector d, the point p from the centre of the ball
where it touches and the moment of inertia I, an impulse J changes the velocity of that point of the ball by C J,

    C = (1/m) 1 + (|p|^2 1 - p p^T)/I,

and that of the tip by -J/M along d, M the mass of the cue, and by -J/m_e across it: sideways only the front end of the
shaft, of mass m_e, goes along within the millisecond of the contact. Afterwards ball and tip part along d with e V, e the
restitution of the tip (1: no energy is lost; 0: they go on together), and do not move across each other:

    (C + d d^T/M + (1 - d d^T)/m_e) J = (1 + e) V d,   v = J/m,   w = p x J/I.

Without m_e, in the limit m_e -> 0, J is along the cue,

    J = (1 + e) V/(1/M + 1/m + |p x d|^2/I),

which for e = 1 is the result of W. Leckie and M. Greenspan, An event-based pool physics simulator (2006), eqs. for v and
w, and of D. Alciatore, TP A.30. With it the ball starts off the cue's line, away from the side on which it is struck: at
an offset of s radii across the cue by the angle

    tan a = 5/2 s sqrt(1 - s^2)/(1 + m/m_e + 5/2 (1 - s^2)),

for an offset to the side Alciatore's squirt (TP A.31, eq. 13). Of the energy of cue, end mass and ball (1 - e) V J/2 is
lost.

A cue that points down gives a downward velocity. The bed answers to it in the first step of the run, with its own
restitution and friction. The tip is gone then: a real one is still above the ball, so that hops are too high here.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, CaromWarning, did_you_mean
from carom.scene.billiards.arguments import angle, sphere, vector
from carom.scene.billiards.data import TIPS
from carom.scene.tables.balls import Sphere
from carom.units import number

CUE_MASS = 19 * 0.028349523125
"""A cue of 19 oz, kg."""
MISCUE = 0.5
"""Offset over radius beyond which tips slip: sin(atan(mu)) with the mu = 0.6 of a chalked tip (`data.ALCIATORE`) is 0.51."""


@dataclass(frozen=True)
class Strike:
    """What a strike gives: SI, world frame."""

    velocity: F64
    """(3,) of the centre, m/s."""
    angular_velocity: F64
    """(3,) rad/s."""
    impulse: float
    """J along the cue, N s."""
    cue_speed: float
    """Of the cue before, m/s."""
    cue_speed_after: float
    """Of the cue along its axis afterwards, m/s."""
    squirt: float
    """Angle by which the ball starts off the direction of the cue, seen from above, to the left if above 0, rad."""


def cue_impulse(
    *,
    radius: float | str,
    mass: float | str,
    inertia: float | str,
    direction: float | str,
    speed: float | str | None = None,
    ball_speed: float | str | None = None,
    side: float = 0.0,
    height: float = 0.0,
    elevation: float | str = 0.0,
    cue_mass: float | str = CUE_MASS,
    restitution: float | str = "leather",
    end_mass: float | str | None = None,
) -> Strike:
    """The velocities of a ball at rest after a strike; arguments are numbers in SI or texts with a unit ("30 deg").

    `speed` is that of the cue, or `ball_speed` |v| of the ball after the strike, m/s. The tip touches `side` radii to the
    right of the cue's line through the centre and `height` radii above it, both across the cue as the player sees it.
    `elevation` is that of the butt; `cue_mass` the mass that moves along the cue, that of the stick and of what of the hand
    holds it firmly (kg); `restitution` that of the tip, "leather" or "phenolic" (`data.TIPS`), or a number: 1 is the
    textbook's, which loses no energy. With `end_mass`, the mass of the shaft's front end (kg), the ball squirts: it starts
    off the line of the cue, away from the side on which it is struck, also upwards if struck low; without it, along the cue.
    """
    return _struck("cue_impulse", **locals())


def strike(
    ball: Sphere,
    *,
    direction: float | str | Sequence[float] = 0.0,
    speed: float | str | None = None,
    ball_speed: float | str | None = None,
    side: float = 0.0,
    height: float = 0.0,
    elevation: float | str = 0.0,
    cue_mass: float | str = CUE_MASS,
    restitution: float | str = "leather",
    end_mass: float | str | None = None,
) -> Strike:
    """Strike a ball of a scene that lies still: sets its velocity and angular velocity, and returns what it set.

    `direction` is an angle from x towards y, in rad or with its unit ("30 deg"), or a vector in the plane of the table.
    The other arguments are those of `cue_impulse`: `speed="20 mph"`.
    """
    ball = sphere("strike", "ball", ball)
    if any(ball.velocity) or any(ball.angular_velocity):
        raise CaromError(f"strike: {ball.name!r} moves already; strike a ball that lies still")
    if not isinstance(direction, str | Real):
        x, y, z = [*vector("strike", "direction", direction), 0.0][:3]
        if z or not math.hypot(x, y) > 0:
            raise CaromError(
                "strike: direction must be an angle or a vector (x, y) within the table that is not zero,"
                f" found {direction!r}; a cue that points down has an elevation"
            )
        direction = math.atan2(y, x)
    found = _struck(
        "strike",
        radius=ball.radius,
        mass=ball.mass_kg(),
        inertia=ball.inertia_kg_m2(),
        direction=direction,
        speed=speed,
        ball_speed=ball_speed,
        side=side,
        height=height,
        elevation=elevation,
        cue_mass=cue_mass,
        restitution=restitution,
        end_mass=end_mass,
    )
    ball.velocity = tuple(found.velocity.tolist())
    ball.angular_velocity = tuple(found.angular_velocity.tolist())
    return found


def _struck(
    call: str,
    *,
    radius: float | str,
    mass: float | str,
    inertia: float | str,
    direction: float | str,
    speed: float | str | None,
    ball_speed: float | str | None,
    side: float,
    height: float,
    elevation: float | str,
    cue_mass: float | str,
    restitution: float | str,
    end_mass: float | str | None,
) -> Strike:
    """`cue_impulse`, with what messages name: the function that was called."""
    if (speed is None) == (ball_speed is None):
        raise CaromError(f"{call}: give speed (of the cue) or ball_speed, one of them, in m/s")
    restitution = _tip(call, restitution)
    direction = angle(call, "direction", direction)
    elevation = angle(
        call, "elevation", elevation, lambda a: 0 <= a < math.pi / 2, "must be from 0 to below 90 deg"
    )
    radius, mass = _above_0(call, "radius", radius, "length"), _above_0(call, "mass", mass, "mass")
    inertia, cue_mass = (
        _above_0(call, "inertia", inertia, "moment of inertia"),
        _above_0(call, "cue_mass", cue_mass, "mass"),
    )
    speed = None if speed is None else _above_0(call, "speed", speed, "speed")
    ball_speed = None if ball_speed is None else _above_0(call, "ball_speed", ball_speed, "speed")
    end_mass = None if end_mass is None else _above_0(call, "end_mass", end_mass, "mass")
    side = number(call, "side", side, unit="of radii of the ball")
    height = number(call, "height", height, unit="of radii of the ball")
    offset = math.hypot(side, height)
    if not offset < 1:
        raise CaromError(
            f"{call}: the tip misses the ball: side and height put it {offset:.3g} of a radius off the centre"
        )
    if offset > MISCUE:
        told = f"{call}: the tip is {offset:.2g} of a radius off the centre; beyond {MISCUE:g} real tips slip (a miscue)"
        warnings.warn(told, CaromWarning, stacklevel=3)
    flat = np.array([math.cos(direction), math.sin(direction), 0.0])
    along = np.array([*(math.cos(elevation) * flat[:2]), -math.sin(elevation)])
    right = np.array([math.sin(direction), -math.cos(direction), 0.0])
    above = np.cross(right, along)
    depth = math.sqrt(1.0 - offset * offset)
    point = radius * (side * right + height * above - depth * along)
    # The impulse is along `line`, of which the part along the cue is 1; the compliance is that along the cue.
    line = along
    lever = np.cross(point, along)
    compliance = 1.0 / cue_mass + 1.0 / mass + float(lever @ lever) / inertia
    if end_mass is not None:
        ball = np.eye(3) / mass + ((point @ point) * np.eye(3) - np.outer(point, point)) / inertia
        across = np.eye(3) - np.outer(along, along)
        unit = np.linalg.solve(ball + np.outer(along, along) / cue_mass + across / end_mass, along)
        compliance = 1.0 / float(unit @ along)
        line = compliance * unit
        lever = np.cross(point, line)
    if speed is None:
        assert ball_speed is not None
        speed = mass * ball_speed * compliance / ((1.0 + restitution) * float(np.linalg.norm(line)))
    impulse = (1.0 + restitution) * speed / compliance
    return Strike(
        velocity=impulse / mass * line,
        angular_velocity=impulse / inertia * lever,
        impulse=impulse,
        cue_speed=speed,
        cue_speed_after=speed - impulse / cue_mass,
        squirt=math.atan2(0.0 - float(line @ right), float(line @ flat)),  # 0, not -0, along the cue
    )


def _above_0(call: str, name: str, given: float | str, dimension: str) -> float:
    value = number(call, name, given, dimension)
    if not value > 0:
        raise CaromError(f"{call}: {name} must be above 0, found {given!r}")
    return value


def _tip(call: str, given: float | str) -> float:
    """A restitution, or that of a tip by its name."""
    if not isinstance(given, str):
        if not 0 <= number(call, "restitution", given, unit="without a unit") <= 1:
            raise CaromError(f"{call}: restitution must be from 0 to 1, found {given!r}")
        return float(given)
    if given not in TIPS:
        raise CaromError(
            f"{call}: restitution: no tip is called {given!r}; {did_you_mean(given, list(TIPS))}"
        )
    return float(TIPS[given])
