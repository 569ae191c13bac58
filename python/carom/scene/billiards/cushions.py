"""Models of a cushion from the literature: the velocities of a ball on the bed after it, beside the rails of a table.

The ball moves towards +x and meets the nose of a cushion along y, at height h: n points from its centre to the nose and
rises by theta, sin theta = h/r - 1. Impulses are over the mass; J at the arm p changes the angular velocity by
5/(2 r^2) p x J.

- `han_2005`: the nose alone, in closed form. What would lift the ball or press it down goes into the bed, without friction.
  I. Han, "Dynamics in carom and three cushion billiards", J. Mech. Sci. Technol. 19 (2005) 976-984, eqs. 14 to 23.
- `mathavan_2010`: nose and bed with friction, integrated over the impulse of the nose; its work in expansion is e^2 of
  that in compression. S. Mathavan, M. R. Jackson and R. M. Parkin, "A theoretical analysis of billiard ball dynamics under
  cushion impacts", Proc. IMechE C 224 (2010) 1863-1873.

The rails of a table take both contacts in one impact, with friction by the slip at its end and Newton's restitution,
and with the resistance of the bed to rolling.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64
from carom.errors import CaromError, CaromWarning
from carom.numeric import is_whole
from carom.units import number

UP = np.array([0.0, 0.0, 1.0])
STEPS = 5000
"""Steps of the integration over an impulse, about: its error is of first order in them."""
FEWEST = 100
"""Of them: velocities are off by 1.4 % of the speed then, by 8 % with 20 steps, and with 5 balls gain energy."""
ON_BED = 1e-9
"""Velocity up or down, over the speed, that rounding gives a ball on the bed."""
WEDGED = 20
"""So many times the impulse without friction that stops no ball: nose and bed hold it between them."""


def han_2005(
    velocity: ArrayLike,
    spin: ArrayLike,
    *,
    radius: float,
    nose_height: float,
    restitution: float,
    friction: float,
) -> tuple[F64, F64]:
    """Velocities and angular velocities (..., 3) after the cushion, of those before; SI.

    What the nose gives upwards or downwards is dropped, so that without friction `1 - (1 + e) cos^2 theta` of v_x is left.
    With a `restitution` e below `tan^2 theta`, or a spin that drives it on, a ball goes on into the cushion, v_x > 0: that
    is beyond the model, and warned of.
    """
    _check("han_2005", radius, nose_height, restitution, friction=friction)
    v, w = _moving("han_2005", velocity, spin)
    arm = radius * _towards(radius, nose_height)
    n = arm / radius
    normal = (1 + restitution) * np.maximum(v @ n, 0.0)[..., None]
    slip = _slip(v, w, arm)
    speed = np.linalg.norm(slip, axis=-1, keepdims=True)
    # Stopping the slip takes 2/7 of it; friction gives no more than mu times the normal impulse.
    impulse = -normal * n - np.minimum(2 / 7 * speed, friction * normal) * _unit(slip)
    after = (v + impulse) * (1 - UP)
    _warn_of_ways_in(v, after, n, restitution)
    return after, w + 2.5 / radius**2 * np.cross(arm, impulse)


def mathavan_2010(
    velocity: ArrayLike,
    spin: ArrayLike,
    *,
    radius: float,
    nose_height: float,
    restitution: float,
    friction: float,
    bed_friction: float,
    steps: int = STEPS,
) -> tuple[F64, F64]:
    """Velocities and angular velocities (..., 3) after the cushion, of those before; SI.

    A nose below the centre throws the ball up. With little restitution it then goes on over the cushion, v_x > 0.
    """
    _check("mathavan_2010", radius, nose_height, restitution, friction=friction, bed_friction=bed_friction)
    if not is_whole(steps) or steps < FEWEST:
        raise CaromError(f"mathavan_2010: steps must be a whole number from {FEWEST} on, found {steps!r}")
    v, w = _moving("mathavan_2010", velocity, spin)
    n = _towards(radius, nose_height)
    arm, down = radius * n, -radius * UP
    step = ((1 + restitution) * np.maximum(v @ n, 0.0) / steps)[..., None]
    compression, work = (np.zeros(v.shape[:-1]) for _ in range(2))
    acts = v @ n > 0
    for _ in range(WEDGED * steps):
        if not acts.any():
            return v, w
        nose = -n - friction * _unit(_slip(v, w, arm))
        bed = np.maximum(-nose @ UP, 0.0)[..., None] * (UP - bed_friction * _unit(_slip(v, w, down)))
        by = np.where(acts[..., None], step, 0.0)
        before = v @ n
        v += by * (nose + bed)
        w += 2.5 / radius**2 * by * (np.cross(arm, nose) + np.cross(down, bed))
        done = 0.5 * by[..., 0] * (before + v @ n)
        compression += np.maximum(done, 0.0)
        work += np.maximum(-done, 0.0)
        acts &= (v @ n > 0) | (work < restitution**2 * compression)
    raise CaromError(
        f"mathavan_2010: with friction {friction:g} and bed_friction {bed_friction:g} nose and bed wedge the ball;"
        " give less of them"
    )


def _warn_of_ways_in(v: F64, after: F64, n: F64, restitution: float) -> None:
    """Han's bed holds balls down and turns none of them back."""
    if count := int(
        np.count_nonzero((v[..., 0] > 0) & (after[..., 0] > ON_BED * np.linalg.norm(v, axis=-1)))
    ):
        least = (n[2] / n[0]) ** 2
        told = f"{count} of {v[..., 0].size} balls go on into the cushion, which is beyond the model"
        cure = (
            f"it needs a restitution above tan^2 theta = {least:.3g} (here {restitution:g}), and little spin"
        )
        warnings.warn(f"han_2005: {told}; {cure}", CaromWarning, stacklevel=3)


def _check(call: str, radius: float, nose_height: float, restitution: float, **friction: float) -> None:
    """Refuse what no cushion has: all but these gives velocities that look like some."""
    if not number(call, "radius", radius) > 0:
        raise CaromError(f"{call}: radius must be above 0, found {radius!r}")
    if not 0 < number(call, "nose_height", nose_height) < 2 * radius:
        span = f"must be above 0 and below the top of the ball, {2 * radius:g} m"
        raise CaromError(f"{call}: nose_height {span}, found {nose_height!r}")
    if not 0 <= number(call, "restitution", restitution) <= 1:
        raise CaromError(f"{call}: restitution must be from 0 to 1, found {restitution!r}")
    for name, value in friction.items():
        if number(call, name, value) < 0:
            raise CaromError(f"{call}: {name} must not be negative, found {value!r}")


def _moving(call: str, velocity: ArrayLike, spin: ArrayLike) -> tuple[F64, F64]:
    """Copies of the velocities and angular velocities of balls on the bed, of one shape (..., 3)."""
    try:
        v, w = (np.array(x, dtype=np.float64) for x in np.broadcast_arrays(velocity, spin))
    except (TypeError, ValueError):  # texts, ragged lists, shapes that do not go together
        v = w = np.array(np.nan)
    if v.shape[-1:] != (3,) or not (np.isfinite(v) & np.isfinite(w)).all():
        raise CaromError(
            f"{call}: velocity and spin must be (..., 3) finite numbers, of shapes that go together"
        )
    if (np.abs(v[..., 2]) > ON_BED * np.linalg.norm(v, axis=-1)).any():
        raise CaromError(f"{call}: the model is of a ball on the bed; its velocity must have v_z = 0")
    return v, w


def _towards(radius: float, nose_height: float) -> F64:
    """From the centre to the nose, over the radius."""
    rise = nose_height / radius - 1
    return np.array([np.sqrt(1 - rise**2), 0.0, rise])


def _slip(v: F64, w: F64, arm: F64) -> F64:
    """Velocity of the surface at an arm, without its part along it."""
    moves = v + np.cross(w, arm)
    n = arm / np.linalg.norm(arm)
    return np.asarray(moves - (moves @ n)[..., None] * n)


def _unit(x: F64) -> F64:
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    return np.asarray(np.divide(x, size, out=np.zeros_like(x), where=size > 0))
