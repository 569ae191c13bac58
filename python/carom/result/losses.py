"""What a step of first order takes from the energy of a finished run, estimated from its frames.

on a curved wall, pressed by N    h N v^2/(2 rho) a second
at a joint with the reaction F    h F . a/2 a second, a the centripetal acceleration that F gives

Both are told over the kinetic energy and what these forces give from rest in a step: of slower motion, rounding where a
scene is at rest, there is nothing to take.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from carom.arrays import F64, I64
from carom.scene.assembly.arrays import bodies
from carom.scene.assembly.distances import gaps
from carom.scene.assembly.mechanics import joints_for_core, numbers
from carom.scene.assembly.rotations import rotated
from carom.scene.checks.curved_walls import CLOSE, CURVED, FEW_BALLS, MOST_CHANGE, below, way_on
from carom.scene.tables.options import loads_once, stepping

if TYPE_CHECKING:
    from carom.result.data import RunData

#: Frames, evenly spread, from which a loss is estimated.
MOST_FRAMES = 2000
#: Joints times frames that are looked at; more take memory and time, and make no better estimate.
MOST_REACTIONS = 200_000


class _Motion(NamedTuple):
    """All balls in F frames, and the largest kinetic energy of the steps."""

    frames: I64
    time: F64
    position: F64
    velocity: F64
    largest: float
    """J."""


def on_walls(result: RunData) -> dict[str, Any] | None:
    """The force on the wall is that of gravity and of the curved path in the frames; other balls press besides."""
    scene = result.scene
    hollow = [w for w in scene._walls() if w.kind in CURVED and w.shape[-1] and w.motion is None]
    if not hollow or len(result.names) > FEW_BALLS or scene.run.method == "penalty":
        return None
    steps = stepping(scene.run.options())
    if loads_once(steps) or not result.summary or len(result.time) < 2:
        return None
    motion = _motion(result, MOST_FRAMES)
    count = len(motion.time)
    position, velocity = motion.position.reshape(-1, 3), motion.velocity.reshape(-1, 3)
    masses, radii = (np.tile(np.asarray(result.bodies[key]), count) for key in ("mass", "radius"))
    power, given = np.zeros((2, len(masses)))
    for wall in hollow:
        on = np.flatnonzero(gaps(wall, position, radii) <= CLOSE * radii)
        way = way_on(wall, position[on], velocity[on], np.array(scene.gravity))
        bent = way.curvature * way.speed**2
        pressed = np.maximum(0.0, way.load + bent)
        power[on] += 0.5 * steps["step"] * masses[on] * pressed * bent
        given[on] += 0.5 * masses[on] * (steps["step"] * pressed) ** 2
    lost = float(np.trapezoid(power.reshape(count, -1).sum(axis=1), motion.time))
    if scene.run.method == "events":  # what moves in closed form loses nothing
        lost *= min(1.0, result.summary["stepped"] / result.summary["time"])
    key = "pressing_step" if scene.run.method == "events" else "step"
    return _facts(lost, motion.largest + given.sum() / count, key, steps["step"])


def at_joints(result: RunData) -> dict[str, Any] | None:
    """Moreau-Jean has joints in the direction in which the smooth motion of a step ends, a turn of one step away."""
    scene = result.scene
    if not scene.joints or scene.run.method != "moreau" or not result.summary or len(result.time) < 2:
        return None
    motion = _motion(result, max(2, MOST_REACTIONS // len(scene.joints)))
    last = motion.frames[1:]
    length = np.asarray(result.time)[last] - np.asarray(result.time)[last - 1]
    # Not a number at the last frame of a run that stopped.
    force = np.nan_to_num(_rows(result.joint_impulse, last))[:, :, :3] / length[:, None, None]
    spin, turn = (_rows(column, last) for column in (result.angular_velocity, result.orientation))
    x, v = motion.position[1:], motion.velocity[1:]
    balls = bodies(scene._tree)
    power, given, mass = np.zeros(len(last)), 0.0, np.asarray(result.bodies["mass"])
    for k, joint in enumerate(joints_for_core(scene.joints, balls, numbers(balls))):
        kind, _, arm_a, arm_b, _ = joint["rows"][0]
        if kind == "rotation":  # about axes that stay
            continue
        point, speed, bent = np.zeros((3, len(last), 3))
        per_mass = sum(1.0 / mass[body] for body in (joint["a"], joint["b"]) if body >= 0)
        given += 0.5 * per_mass * scene.run.step**2 * (force[:, k] ** 2).sum(axis=1).mean()
        for body, arm, sign in ((joint["a"], arm_a, 1.0), (joint["b"], arm_b, -1.0)):
            if body < 0:
                point += sign * np.array(arm)
                continue
            lever, w = rotated(turn[:, body], np.array(arm)), spin[:, body]
            rate = np.cross(w, lever)
            point += sign * (x[:, body] + lever)
            speed += sign * (v[:, body] + rate)
            bent += sign * np.cross(w, rate)
        if kind == "distance":
            away = point / np.linalg.norm(point, axis=1)[:, None]
            across = speed - (speed * away).sum(axis=1)[:, None] * away
            bent += away * ((across**2).sum(axis=1) / np.linalg.norm(point, axis=1))[:, None]
        power -= 0.5 * scene.run.step * (force[:, k] * bent).sum(axis=1)
    lost = float((power * np.diff(motion.time)).sum())
    return _facts(lost, motion.largest + given, "step", scene.run.step)


def _motion(result: RunData, most: int) -> _Motion:
    frames = spread(len(result.time), min(most, MOST_FRAMES))
    velocity = np.nan_to_num(_rows(result.velocity, frames))  # 0 of absent balls
    largest = float(np.asarray(result.steps["energy_kinetic"]).max(initial=0.0))
    return _Motion(frames, np.asarray(result.time)[frames], _rows(result.position, frames), velocity, largest)


def spread(count: int, most: int) -> I64:
    """At most so many of so many frames, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, most).astype(np.int64))


def _rows(column: Any, frames: I64) -> F64:
    return np.stack([column[k] for k in frames])


def _facts(lost: float, largest: float, key: str, step: float) -> dict[str, Any] | None:
    if lost <= MOST_CHANGE * largest:
        return None
    left = max(largest - lost, 0.01 * largest)  # what is lost at first is not there to be lost later
    return {"percent": 100 * lost / largest, "key": key, "step": below(step * MOST_CHANGE * left / lost)}
