"""Exact motion of one ball on a cloth: flights, bounces, sliding, rolling, from event to event.

Between events the centre moves on a parabola and the spin changes linearly, so a motion is a list of such pieces. A
bounce is the impact law of a single contact (eq. 17 with e_T = 0), which has a closed form: the normal impulse is `(1 +
e) m |v_z|`, friction takes at most mu times as much, or the slip whole: `m |u|/(1 + m r^2/I)`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carom.arrays import F64
from carom.errors import CaromError

#: Below this speed of bouncing (m/s) a ball counts as resting on the cloth.
REST = 1e-12
#: A ball with 0 < e < 1 bounces infinitely often in finite time; the flights end at REST long before this number.
MOST_PIECES = 10_000


@dataclass(frozen=True)
class Piece:
    """Motion from `start` (s) on: centre x, velocity v, acceleration a, angular velocity w and its rate, (3,) each."""

    start: float
    x: F64
    v: F64
    a: F64
    w: F64
    rate: F64


@dataclass(frozen=True)
class TableMotion:
    """The motion of a ball; x counts from the centre at t = 0, so that x[2] is the height of the ball above the cloth."""

    pieces: tuple[Piece, ...]

    def position(self, t: ArrayLike) -> F64:
        """Way of the centre at the times t >= 0 (T,), (T, 3) m."""
        time, number = self._at(t)
        x, v, a = (np.array([getattr(piece, key) for piece in self.pieces])[number] for key in "xva")
        return np.asarray(x + v * time + a * time**2 / 2)

    def velocity(self, t: ArrayLike) -> F64:
        """(T, 3) m/s; at the instant of an event, after it."""
        time, number = self._at(t)
        v, a = (np.array([getattr(piece, key) for piece in self.pieces])[number] for key in "va")
        return np.asarray(v + a * time)

    def angular_velocity(self, t: ArrayLike) -> F64:
        """(T, 3) rad/s."""
        time, number = self._at(t)
        w, rate = (np.array([getattr(piece, key) for piece in self.pieces])[number] for key in ("w", "rate"))
        return np.asarray(w + rate * time)

    @property
    def final_velocity(self) -> F64:
        """Velocity in the last piece, (3,) m/s: of the rolling ball, or its last bounce."""
        return self.pieces[-1].v

    def _at(self, t: ArrayLike) -> tuple[F64, NDArray[np.intp]]:
        """Times (T, 1) since the start of the pieces that they fall in, s, and the numbers (T,) of these."""
        time = np.atleast_1d(np.asarray(t, dtype=np.float64))
        starts = np.array([piece.start for piece in self.pieces])
        number = np.maximum(np.searchsorted(starts, time, side="right") - 1, 0)
        return (time - starts[number])[:, np.newaxis], number


def motion(
    velocity: F64,
    spin: F64,
    *,
    radius: float,
    friction: float,
    restitution: float,
    gravity: float,
    until: float,
    kappa: float = 0.4,
) -> TableMotion:
    """Motion up to the time `until` (s) of a ball that starts on the cloth with `velocity` and `spin` (3,), v_z >= 0.

    `kappa` = I/(m r^2). Spin about the vertical does not matter and is kept.
    """
    t, x, v, w = 0.0, np.zeros(3), np.array(velocity, dtype=np.float64), np.array(spin, dtype=np.float64)
    if v[2] < 0:
        raise CaromError("a ball on the cloth cannot start downwards")
    pieces: list[Piece] = []
    down, rest = np.array([0.0, 0.0, -gravity]), np.zeros(3)
    while t <= until and len(pieces) < MOST_PIECES:
        if v[2] > REST:
            pieces.append(Piece(t, x, v, down, w, rest))
            flight = 2 * v[2] / gravity
            t, x = t + flight, x + v * np.array([flight, flight, 0.0])
            v, w = _bounce(v, w, radius, friction, restitution, kappa)
            continue
        v = v * np.array([1.0, 1.0, 0.0])
        slip = _slip(v, w, radius)
        speed = float(np.linalg.norm(slip))
        if speed <= REST:
            pieces.append(Piece(t, x, v, rest, w, rest))
            break
        a = -friction * gravity * slip / speed
        rate = _turning(a, radius, kappa)
        pieces.append(Piece(t, x, v, a, w, rate))
        sliding = speed / (friction * gravity * (1 + 1 / kappa)) if friction > 0 else math.inf
        if t + sliding > until:
            break
        t, x, v, w = t + sliding, x + v * sliding + a * sliding**2 / 2, v + a * sliding, w + rate * sliding
    return TableMotion(tuple(pieces))


def _slip(v: F64, w: F64, radius: float) -> F64:
    """Velocity of the lowest point, (3,), horizontal."""
    return np.array([v[0] - radius * w[1], v[1] + radius * w[0], 0.0])


def _turning(a: F64, radius: float, kappa: float) -> F64:
    """Change of angular velocity by a force at the lowest point that changes the velocity by a."""
    return np.array([a[1], -a[0], 0.0]) / (kappa * radius)


def _bounce(
    v: F64, w: F64, radius: float, friction: float, restitution: float, kappa: float
) -> tuple[F64, F64]:
    """Velocities after a flight that began with v[2] upwards."""
    slip = _slip(v, w, radius)
    speed = float(np.linalg.norm(slip))
    share = (
        0.0 if speed == 0 else min(friction * (1 + restitution) * float(v[2]) / speed, 1 / (1 + 1 / kappa))
    )
    change = -share * slip
    return np.array([v[0] + change[0], v[1] + change[1], restitution * v[2]]), w + _turning(
        change, radius, kappa
    )
