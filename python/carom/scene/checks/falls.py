"""Steps so short that no ball gets far behind a plane in one: at its speed, and at that with which it falls there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, Bool, connected
from carom.errors import quoted
from carom.scene.assembly.bodies import Bodies
from carom.scene.assembly.mechanics import joint_rows, numbers, spring_ends
from carom.scene.assembly.placing import Placed
from carom.scene.assembly.vectors import dot
from carom.scene.checks.curved_walls import below
from carom.scene.messages import Finding
from carom.scene.tables.joints import Joint
from carom.scene.tables.loads import Spring
from carom.scene.tables.walls import PLANE

if TYPE_CHECKING:
    from carom.scene.checks.rules import Whole

PLANE_TRAVEL = 0.5
"""Travel per step, in radii, above which a ball may be deep behind a plane before it is noticed."""
FEW_BALLS = 200
"""Balls up to which falls are looked at before a run."""
ACROSS = 1e-9
"""Part of a unit direction along a fall from which a joint that holds this direction ties its ends there."""

Limit = tuple[float, Finding]
"""The longest step that is safe, s, and the advice to take it."""


def step_before_planes(parts: Whole) -> Iterator[Limit]:
    """Planes are flat, so that hits lose no accuracy; but a ball must not get far behind one in a step.

    What gravity adds to the speed within the first step counts too; of later speeds tells the summary of the run.
    """
    bodies = parts.bodies()
    step, safe, worst, met = parts.run.step, math.inf, 0.0, ""
    for plane in _planes(parts):
        normal = np.array(plane.shape[1])
        rate = np.maximum(0.0, -(bodies.velocity @ normal)) / bodies.radius
        fall = max(0.0, -dot(parts.world.gravity, plane.shape[1])) / bodies.radius
        travel = (rate + fall * step) * step
        body = int(travel.argmax())
        if travel[body] > max(PLANE_TRAVEL, worst):
            worst, met = float(travel[body]), f"{quoted(bodies.names[body])} towards {quoted(plane.name)}"
        with np.errstate(
            divide="ignore"
        ):  # the root of fall h^2 + rate h = PLANE_TRAVEL, also without gravity
            root = 2 * PLANE_TRAVEL / (rate + np.sqrt(rate * rate + 4 * fall * PLANE_TRAVEL))
        safe = min(safe, float(root.min()))
    if worst:
        cause = f"a step of {step:g} s moves {met} by {worst:.2g} radii: impacts on planes may be missed"
        safe = below(safe)
        yield safe, Finding(("run", "step"), cause, f"step = {safe:g} is safe")


def step_of_falls(parts: Whole) -> Iterator[Limit]:
    """What gravity will make of the speeds: a ball that falls freely onto a plane within the run, not tied to the ground and
    with no other one in its way.

    Only in scenes of a few balls: in heaps balls fall less far than their height, and the summary of the run tells.
    """
    run, bodies = parts.run, parts.bodies()
    if len(bodies.names) > FEW_BALLS:
        return
    worst = None
    for plane in _planes(parts):
        normal, point = np.array(plane.shape[1]), np.array(plane.point)
        pull = -dot(parts.world.gravity, plane.shape[1])
        if pull <= 0:
            continue
        height = (bodies.position - point) @ normal - bodies.radius
        towards = -(bodies.velocity @ normal)
        speed = np.sqrt(np.maximum(0.0, towards**2 * (towards > 0) + 2 * pull * np.maximum(0.0, height)))
        in_time = (speed - np.maximum(0.0, towards)) / pull <= parts.until
        travel = np.where(
            in_time & ~_held_up(bodies, normal) & ~_tied(parts, normal, (pull, height)),
            speed / bodies.radius * run.step,
            0.0,
        )
        body = int(travel.argmax())
        if travel[body] > PLANE_TRAVEL and (worst is None or travel[body] > worst[0]):
            worst = (float(travel[body]), float(speed[body]), bodies.names[body], plane.name)
    if worst is not None:
        travel_, speed_, name, met = worst
        cause = f"falling, {quoted(name)} reaches {speed_:.3g} m/s at {quoted(met)}"
        cause += f": a step of {run.step:g} s moves it by {travel_:.2g} radii"
        safe = below(PLANE_TRAVEL * run.step / travel_)
        yield safe, Finding(("run", "step"), cause, f"step = {safe:g} is safe")


def _held_up(bodies: Bodies, normal: F64) -> Bool:
    """Which balls have another one below them, (N,)."""
    height = bodies.position @ normal
    across = bodies.position - np.outer(height, normal)
    near = (
        np.linalg.norm(across[:, None] - across[None], axis=2) < bodies.radius[:, None] + bodies.radius[None]
    )
    return np.asarray((near & (height[None] < height[:, None])).any(axis=1))


def _tied(parts: Whole, normal: F64, fall: tuple[float, F64]) -> Bool:
    """Which balls joints and springs tie to the ground along a direction, through others too, (N,).

    Rods to the ground and springs do where they keep the ball above the plane: with `fall` (m/s^2, and heights over the
    plane, m) springs stretch by 2 m g/k. Joints that hold turns and directions across it alone do not.
    """
    bodies, (pull, height) = parts.bodies(), fall
    number, ground = numbers(bodies), len(bodies.names)

    def keeps(body: int, other: int, point: F64, length: float) -> bool:
        lowest = float(point @ normal) - length - float(bodies.position[body] @ normal - height[body])
        return other >= 0 or lowest >= 0.0

    pairs: list[tuple[int, int]] = []
    for _, spring in parts.tables(Spring):
        a, b, at_a, at_b = spring_ends(spring, bodies, number)
        balls = [i for i in (a, b) if i >= 0]
        stretch = 2 * pull * float(bodies.mass[balls].sum()) / max(spring.stiffness, 1e-300)
        rest = float(np.linalg.norm(at_a - at_b)) if spring.rest_length is None else spring.rest_length
        if stretch <= height[balls].min() and keeps(a, b, at_b, rest + stretch):
            pairs.append((a, b))
    for _, joint in parts.tables(Joint):
        of = joint_rows(joint, bodies, number)
        if any(
            keeps(of.a, of.b, row.point_b, float(np.linalg.norm(row.point_a - row.point_b)))
            if row.kind == "distance"
            else row.kind != "rotation" and abs(dot(row.direction, tuple(normal))) > ACROSS
            for row in of.rows
        ):
            pairs.append((of.a, of.b))
    parts_of = np.flatnonzero((np.diff(bodies.clump) == 0) & (bodies.clump[1:] >= 0))
    ends = np.concatenate(
        [np.array(pairs, dtype=np.int64).reshape(-1, 2), np.stack([parts_of, parts_of + 1], axis=1)]
    )
    ends[ends < 0] = ground
    label = connected(ground + 1, *ends.T)
    return np.asarray(label[:-1] == label[-1])


def _planes(parts: Whole) -> list[Placed]:
    return [wall for wall in parts.walls() if wall.kind == PLANE]
