"""Advice on speed along curved walls, where the printed scheme is of first order in energy (docs/theory/algorithm.md, 10).

Where loads are solved once it is of second order, and nothing is told.

In a step `h` a ball that runs at speed `v` on a path of radius `rho`, pressed on the wall by the force `N`, loses
`h^2 N v^2/(2 rho)` inside of the wall and gains as much outside. What this makes of a run is an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from carom.arrays import F64
from carom.errors import quoted
from carom.scene.assembly.distances import gaps, normals
from carom.scene.checks.walls import called
from carom.scene.messages import Finding
from carom.scene.tables.options import loads_once

if TYPE_CHECKING:
    from carom.scene.assembly.placing import Placed
    from carom.scene.checks.rules import Whole

CURVED = ("sphere", "cylinder", "cone")
"""Kinds of curved walls, whose last parameter says whether spheres live inside."""
MOST_CHANGE = 0.01
"""Part of the energy of a motion above which its change by the scheme is warned of."""
CLOSE = 1e-3
"""Gap, in radii, up to which a ball is taken to run on a wall."""
SLIGHT = 1e-3
"""Height, in radii, that a ball in a hollow must be able to climb; below it is taken to be at rest."""
FEW_BALLS = 20
"""Balls up to which this is looked at: among more, hits and friction take more than the scheme does."""
LOOP = 5.0
"""v^2/(g rho) at the lowest point from which a ball runs all round a hollow."""
SWING = 3.0 / 8.0
"""Mean of v^4 of a small swing over that of its lowest point; the mean of v^2 is a half."""
DESCENT = 0.25
"""Gain of a ball that slides down a fixed ball from its top until it leaves, over `h sqrt(g/rho)` of its kinetic energy:
0.22 to 0.25 in runs with h sqrt(g/rho) from 0.009 to 0.04.
"""


class Way(NamedTuple):
    """How balls run on a curved wall, each an array (N,)."""

    speed: F64
    """Along the curved direction of the surface, m/s."""
    rho: F64
    """Distance of the centre from that of the wall or from its axis, m."""
    curvature: F64
    """Of the surface of the centres in that direction, 1/m."""
    load: F64
    """Gravity against the wall where the ball is, m/s^2."""
    gravity: F64
    """Gravity across the axis, m/s^2."""
    fall: F64
    """Potential over that at the lowest point of the wall, m^2/s^2."""


def advise_curved(parts: Whole) -> Iterator[Finding]:
    """The ball that begins on a fixed curved wall and whose energy the scheme changes most, beyond `MOST_CHANGE`."""
    run, bodies = parts.run, parts.bodies()
    if loads_once(run.options()) or len(bodies.names) > FEW_BALLS:
        return
    most, told = MOST_CHANGE, None
    for wall in parts.walls():
        if wall.kind not in CURVED or wall.motion is not None:
            continue
        on = np.flatnonzero(
            bodies.present & (gaps(wall, bodies.position, bodies.radius) <= CLOSE * bodies.radius)
        )
        way = way_on(wall, bodies.position[on], bodies.velocity[on], np.array(parts.world.gravity))
        top = np.sqrt(way.speed**2 + 2.0 * way.fall)
        moves = top**2 > 2.0 * SLIGHT * way.gravity * bodies.radius[on]
        inside = bool(wall.shape[-1])
        change = run.step * (
            _rate(wall, way, top) * parts.until if inside else DESCENT * np.sqrt(way.gravity / way.rho)
        )
        change = np.where(moves if inside else way.load > 0.0, change, 0.0)
        k = int(change.argmax()) if len(on) else 0
        if len(on) and change[k] > most:
            most = float(change[k])
            told = quoted(bodies.names[on[k]]), wall, float(top[k]), float(way.rho[k])
    if told is None:
        return
    name, wall, speed, rho = told
    safe = f"step = {below(run.step * MOST_CHANGE / most):g} keeps it below 1 %"
    if loads_once(run.options() | {"position_friction": "once"}):
        safe = f'position_friction = "once" loses none, {safe}'
    if wall.shape[-1]:
        share = 100.0 * (1.0 - 1.0 / (1.0 + most))
        lost = f"{100.0 * most / parts.until:.2g} % of that energy a second, {share:.2g} % in the run"
        cause = f"{name} runs inside {called(wall)} at up to {speed:.3g} m/s, {rho:.3g} m from its middle"
        cause += f": a step of {run.step:g} s loses about {lost} (estimate without friction and hits)"
        yield Finding(("run", "step"), cause, safe)
    else:
        down = f"{name} rolls down {called(wall)}, {rho:.3g} m from its middle"
        down += f": a step of {run.step:g} s gains about {100.0 * most:.2g} % of its energy (estimate)"
        yield Finding(("run", "step"), down, safe)


def below(x: float) -> float:
    """`x` to one digit, not above it."""
    scale = 10.0 ** math.floor(math.log10(x))
    return float(f"{math.floor(x / scale * (1 + 1e-12)) * scale:.1g}")


def way_on(wall: Placed, position: F64, velocity: F64, gravity: F64) -> Way:
    """How balls at `position` (N, 3) m with `velocity` (N, 3) m/s run on a sphere, a cylinder or a cone."""
    away, normal = position - np.array(wall.point), normals(wall, position)
    along = velocity - np.einsum("ni,ni->n", velocity, normal)[:, None] * normal
    lean = np.ones(len(position))  # cosine of the angle of the normal to the plane across the axis
    across = np.array(gravity)
    if wall.kind != "sphere":
        axis = np.array(wall.shape[1])
        away = away - np.outer(away @ axis, axis)
        along = along - np.outer(along @ axis, axis)
        across = gravity - (gravity @ axis) * axis
        lean = np.sqrt(np.maximum(0.0, 1.0 - (normal @ axis) ** 2))
    rho = np.linalg.norm(away, axis=1)
    if wall.kind == "cone":  # only round the axis is it curved
        radial = away / rho[:, None]
        along = along - np.einsum("ni,ni->n", along, radial)[:, None] * radial
    size = float(np.linalg.norm(across))
    fall = np.zeros(len(rho)) if wall.kind == "cone" else np.maximum(0.0, size * rho - away @ across)
    return Way(
        np.linalg.norm(along, axis=1), rho, lean / rho, -(normal @ gravity), np.full(len(rho), size), fall
    )


def _rate(wall: Placed, way: Way, top: F64) -> F64:
    """Part of the energy of the motion that a step loses inside of a wall, over the square of its length, (N,), 1/s^2.

    `top` is the speed at the lowest point. On a cone the motion is taken to stay as it is at the start, round the axis.
    """
    square = np.maximum(top**2, np.finfo(float).tiny)
    if wall.kind == "cone":
        return np.asarray(way.curvature * np.maximum(0.0, way.load + way.curvature * square))
    swing = way.curvature * (0.5 * way.gravity + SWING * square * way.curvature)
    mean = np.maximum(0.0, square - 2.0 * way.gravity * way.rho)
    loop = way.curvature**2 * mean * (mean / square)
    return np.asarray(np.where(square >= LOOP * way.gravity * way.rho, loop, swing))
