"""What joints may move their bodies by at the position level, where no file records their multipliers.

By Gauss's principle joints move the bodies `G` that they hold together by the least correction that keeps the joints, in the
norm of the masses. So they move them by no more than what pushes the bodies off, for to take it back whole keeps the joints:

    sum_G m |d|^2 + I |phi|^2 <= E^2,    E^2 = sum_G P^2/m + Q^2/I,

`P = sum |nu| + h |impulse of loads|` of a body, `Q` its moment. Nor do they answer inertia by more than a motion that would:
at a joint the ends part by `h^2 (|u|^2/length + |w|^2 arm)`, and all on one side of it can follow, which adds that way times
`sqrt(sum_G m)`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64
from carom.audit import cohesion, forces, recorded
from carom.audit.block import Block
from carom.audit.formula import law
from carom.audit.vectors import norm
from carom.audit.wrenches import groups

if TYPE_CHECKING:
    from carom.audit.loads import Loads


def corrections(block: Block, loads: Loads) -> Iterator[tuple[list[int], F64, F64]]:
    """The bodies of each group, and E (B,), m sqrt(kg), with the part of inertia; `loads` are those without joints.

    The third is the same of velocities, m/s sqrt(kg), from the sizes of all impulses of contacts within the interval.
    """
    run, dt = block.run, block.dt
    contacts = (
        forces.of_contacts(block).shift_size if run.has_contacts else np.zeros((block.count, run.bodies))
    )
    strokes = (
        recorded.strokes(block) if run.has_contacts else (np.zeros_like(contacts), np.zeros_like(contacts))
    )
    pulled = norm(cohesion.on_bodies(block)[0])
    for bodies, joints in groups(run):
        grounded = any(joint["b"] < 0 for joint in joints)
        m, inertia, r = run.heavy[bodies], run.node_inertia[bodies], run.node_reach[bodies]
        given = norm(loads.impulse[:, bodies, :3]) + loads.slack[:, bodies, 0]
        given = given + (m * norm(run.gravity) * dt[:, None] if grounded else 0.0)
        couple = norm(loads.impulse[:, bodies, 3:]) + loads.slack[:, bodies, 1]
        if run.cohesive and run.clumps:  # of which more balls than the first are pulled
            all_of = _of_clumps(block, pulled)[:, bodies]
            given, couple = given + all_of, couple + r * all_of
        parted = np.sum([_parting(block, joint) for joint in joints], axis=0) * np.sqrt(m.sum())

        def size(push: F64, moment: F64) -> F64:
            return np.asarray(np.sqrt((push**2 / m + moment**2 / inertia).sum(axis=1)))  # noqa: B023

        moved = contacts[:, bodies]
        of_places = size(moved + dt[:, None] * given, 2.0 * r * moved + dt[:, None] * couple)
        struck, turned = (of[:, bodies] for of in strokes)
        turned = turned + np.where(run.in_clump[bodies], r * struck, 0.0)
        of_speeds = size(struck + given, turned + couple)
        yield bodies, of_places + parted, of_speeds + parted / dt


def _of_clumps(block: Block, pulled: F64) -> F64:
    """(B, N) sums of `pulled` (B, N) over the balls of each clump, at its first one; 0 of other bodies."""
    found, clumps = np.zeros_like(pulled), block.run.clumps
    found[:, clumps.first] = clumps.sum(pulled)
    return found


def _parting(block: Block, joint: dict[str, Any]) -> F64:
    """(B,) by how much the points of a joint part in a step of free motion, m, and by how much its laws bend."""
    # What may be left from the step before comes on top.
    left = block.run.loosest["gap_tolerance"] * block.run.radius[joint["a"]]
    bent, _ = swing(block, joint, 0)
    given = np.zeros(block.count)
    for kind, _, _, _, form in joint["rows"]:
        (start, rate), (end, _) = law(form, block.t0), law(form, block.t1)
        given += np.abs(end - start - block.dt * rate) * (
            block.run.radius[joint["a"]] if kind == "rotation" else 1.0
        )
    return np.asarray(left + block.dt**2 * bent + block.dt * kinks(block, joint) + given)


def kinks(block: Block, joint: dict[str, Any]) -> F64:
    """(B,) by how much the rates that a joint prescribes change within an interval, m/s."""
    radius, found = block.run.radius[joint["a"]], np.zeros(block.count)
    for kind, _, _, _, form in joint["rows"]:
        change = np.abs(law(form, block.t1)[1] - law(form, block.t0)[1])
        found += change * (radius if kind == "rotation" else 1.0)
    return found


def swing(block: Block, joint: dict[str, Any], end: int, fast: F64 | float = 0.0) -> tuple[F64, F64]:
    """(B,) acceleration by which the points of a joint part in free motion, m/s^2, and rate at which its directions turn,
    rad/s, at the first (0) or second (1) frames; at least as of bodies of speeds `fast` over the root of mass or inertia.
    """
    bent, turning = np.zeros((2, block.count))
    for kind, _, arm_a, arm_b, _ in joint["rows"]:
        (at_a, rate_a, spin_a, reach_a), (at_b, rate_b, spin_b, reach_b) = (
            _point(block, joint[side], arm, end, fast) for side, arm in (("a", arm_a), ("b", arm_b))
        )
        bent += spin_a**2 * reach_a + spin_b**2 * reach_b
        turned = spin_a + spin_b
        if kind == "distance":
            length = norm(at_a - at_b)
            speed = np.maximum(norm(rate_a - rate_b), fast * _lightness(block, joint))
            rate = np.divide(speed, length, out=np.zeros_like(speed), where=length > 0.0)
            bent, turned = bent + speed * rate, turned + rate
        turning = np.maximum(turning, turned)
    return bent, turning


def _lightness(block: Block, joint: dict[str, Any]) -> float:
    """Sum of `1/sqrt(m)` of the bodies of a joint."""
    return float(sum(block.run.mass[body] ** -0.5 for body in (joint["a"], joint["b"]) if body >= 0))


def _point(block: Block, body: int, arm: Any, end: int, fast: F64 | float) -> tuple[F64, F64, F64, F64]:
    """Place and velocity of a point of a body at the first (0) or second (1) frames, how fast it turns, rad/s, and its
    lever, m.
    """
    lever, place, velocity = block.point(body, arm, end)
    if body < 0:
        return place, velocity, np.zeros(block.count), np.zeros(block.count)
    w = (block.w1 if end else block.w0)[:, body]
    spin = np.maximum(norm(w), fast * block.run.node_inertia[block.run.node[body]] ** -0.5)
    away = float(norm(block.run.clumps.offsets[body]))
    return place, velocity, spin, norm(lever) + block.run.radius[body] + away
