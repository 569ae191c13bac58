"""What loads and joints give clumps: forces on their balls, summed, and moments about the centres of mass (`wrenches`).

The scheme filters forces and moments alike (eqs. 5 and 6): those of a step lie between their values at its ends, with the
lag of the filter between those of a step before. So twice their change bounds the error, as of loads that depend on the
motion of balls (`loads`). Moments do even of a constant force, as its lever turns; of forces of the time what moves a centre
is exact. Impulses of joints are on record; their levers are those of the second frame, and off by their turn in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64, Bool
from carom.audit import wrenches
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.recorded import shifts, strokes
from carom.audit.vectors import cross, norm

#: Frames of which reactions are read at once.
MANY = 10_000


@dataclass
class OnClumps:
    """Over each interval, of C clumps."""

    impulse: F64
    """(B, C, 6) N s, N m s."""
    slack: F64
    """(B, C, 2) how far these may be off."""
    way: F64
    """(B, C, 6) N s^2, N m s^2: what moves and turns them in the step, times mass and inertia."""
    way_slack: F64
    """(B, C, 2) how far these may be off."""
    turn_slack: F64
    """(B, C) N m s^2: the same of the turn where nothing corrects it."""
    unknown: Bool
    """(B, C) clumps of which the loads cannot be known."""


@once
def of_block(block: Block) -> OnClumps:
    """All of them."""
    run, shape = block.run, (block.count, len(block.run.clumps))
    impulse, slack, way, way_slack = (np.zeros((*shape, columns)) for columns in (6, 2, 6, 2))
    found = OnClumps(impulse, slack, way, way_slack, np.zeros(shape), np.zeros(shape, dtype=bool))
    if not len(run.clumps):
        return found
    for load in run.loads:
        if load["kind"] == "callable":
            found.unknown[:] = True
        elif load["kind"] == "force":
            if load["body"] < run.balls and run.in_clump[load["body"]]:
                _pushed(block, load, found)
        elif load["kind"] != "cohesion":
            _of_motion(block, load, found)
    for j in range(len(run.joints)):
        _joint(block, j, found)
    return found


def of_motion(block: Block, load: dict[str, Any]) -> dict[int, tuple[F64, F64]]:
    """Of each node that a spring or drag acts on: (B, 6) its impulse and moment, and (B, 2) how far they may be off."""
    first, last = (wrenches.wrench(block, load, end) for end in (0, 1))
    jump, rounding = wrenches.jumps(block, load), wrenches.rounding(block, load)
    kink = wrenches.kinked(block, load)
    return {node: _between(block, first[node], last[node], jump[node] + kink + rounding) for node in first}


def _between(block: Block, start: F64, end: F64, jump: F64) -> tuple[F64, F64]:
    """Of forces and moments (B, 6) at both ends, which may be off by `jump` (B, 2) before contacts."""
    mean = 0.5 * (start + end) * block.dt[:, None]
    own = wrenches.sizes(end - start) + jump
    # What was before a block is not known: the force itself, at its first interval.
    first = wrenches.sizes(start[0]) * (block.first > 1)
    earlier, _ = wrenches.echo(block.run, own, (first, first))
    return mean, 2.0 * (own + earlier) * block.dt[:, None]


def _of_motion(block: Block, load: dict[str, Any], out: OnClumps) -> None:
    bodies = {int(load[key]) for key in ("a", "b", "body") if int(load.get(key, -1)) >= 0}
    if not block.run.in_clump[list(bodies)].any():
        return
    for node, (mean, slack) in of_motion(block, load).items():
        if wrenches.carried(block.run, node):
            number = int(block.run.clump_of[node])
            _add(block, out, number, mean, slack, 0.5 * block.dt[:, None] * mean)
            out.unknown[:, number] |= ~block.single


def _add(block: Block, out: OnClumps, number: int, mean: F64, slack: F64, way: F64) -> None:
    out.impulse[:, number] += mean
    out.slack[:, number] += slack
    out.way[:, number] += way
    out.way_slack[:, number] += slack * block.dt[:, None]
    out.turn_slack[:, number] += slack[:, 1] * block.dt


def turned_moments(block: Block, load: dict[str, Any]) -> tuple[F64, F64]:
    """(B, 3) angular impulses by the lever of a force of the time that acts on a ball of a clump, and (B,) how far these may
    be off.
    """
    run, body = block.run, int(load["body"])
    force = wrenches.at_steps(run, tuple(load["force"]))
    zeros = np.zeros((block.count, 3))
    ends = [
        np.hstack([zeros, cross(wrenches.centre_of_ball(block, body, end), force[steps])])
        for end, steps in ((0, block.s0), (1, block.s1))
    ]
    reach = float(norm(run.clumps.offsets[body]))
    largest = np.maximum(norm(force[block.s0]), norm(force[block.s1]))
    inner = np.abs(np.diff(wrenches.at_steps(run, tuple(load["force"]), wrenches.PARTS_OF_STEP), axis=0))
    varied = norm(inner.reshape(-1, wrenches.PARTS_OF_STEP, 3).sum(axis=1))
    jump = reach * (largest * shifts(block)[1][:, body] + block.over(varied))
    mean, slack = _between(block, ends[0], ends[1], np.stack([np.zeros(block.count), jump], axis=1))
    return mean[:, 3:], slack[:, 1]


def _pushed(block: Block, load: dict[str, Any], out: OnClumps) -> None:
    """A force and torque of the time."""
    run, number = block.run, int(block.run.clump_of[load["body"]])
    (impulse, way), loose = wrenches.filtered(run, (*load["force"], *load["torque"])), _loose(block, load)
    mean = np.stack([block.total(impulse[:, j]) for j in range(6)], axis=1)
    slack = np.stack([block.total(loose[:, 3 * k : 3 * k + 3].sum(axis=1)) for k in (0, 1)], axis=1)
    moved = np.stack([block.total(way[:, j]) for j in range(6)], axis=1)
    moment, off = turned_moments(block, load)
    mean[:, 3:] += moment
    moved[:, 3:] += 0.5 * block.dt[:, None] * moment
    slack[:, 1] += off
    _add(block, out, number, mean, slack, moved)
    out.unknown[:, number] |= ~block.single


def _loose(block: Block, load: dict[str, Any]) -> F64:
    """(S, 6) how far the impulses of a force and torque of the time may be off in each step."""
    run, forms = block.run, (*load["force"], *load["torque"])
    return np.asarray(wrenches.loose(run, forms, wrenches.varied(run, forms)))


def _joint(block: Block, j: int, out: OnClumps) -> None:
    """Recorded reactions."""
    run, joint = block.run, block.run.joints[j]
    given = np.nan_to_num(run.result.joint_impulse[block.first : block.first + block.count])[:, j]
    for body, sign, arm in ((joint["a"], 1.0, joint["rows"][0][2]), (joint["b"], -1.0, joint["rows"][0][3])):
        if wrenches.carried(run, body):
            number = int(run.clump_of[body])
            mean, slack = reaction(block, j, given, body, arm)
            _add(block, out, number, sign * mean, slack, 0.5 * sign * block.dt[:, None] * mean)
            size = wrenches.sizes(mean)
            out.way_slack[:, number] += block.dt[:, None] * size
            # Reactions act in the middle of a step, but for their change from one step to the next.
            before = np.concatenate([np.zeros((1, 3)), mean[:-1, 3:]])
            out.turn_slack[:, number] += 2.0 * block.dt * norm(mean[:, 3:] - before)
            out.unknown[:, number] |= ~block.kept


def reaction(block: Block, j: int, given: F64, body: int, arm: Any) -> tuple[F64, F64]:
    """(B, 6) impulse and moment that a joint with the recorded reactions `given` (B, 6) gives the node of a body, if that is
    its first one, and (B, 2) how far these may be off.
    """
    run, joint = block.run, block.run.joints[j]
    impulse, couple = given[:, :3], given[:, 3:]
    node = int(run.node[joint["a"]])
    # Reactions of the smooth motion and of impacts are solved to the tolerance; those that hardly act against all others of
    # their bodies.
    own = _reacted(run)[node][block.first : block.first + block.count] + _struck(block)[:, node]
    solved = 4.0 * block.tolerance * (own + run.heavy.max() * norm(run.gravity) * run.h)
    lever = wrenches.lever(block, body, arm, 1)
    reach = norm(lever)
    turned = 2.0 * reach * wrenches.turned_since(block, j, body, wrenches.reach(run, body, arm))
    slack = np.stack([solved, solved * (2.0 * reach + run.node_reach[run.node[body]]) + turned], axis=1)
    return np.hstack([impulse, cross(lever, impulse) + couple]), slack


@once
def _reacted(run: Run) -> dict[int, F64]:
    """By bodies (F,) the largest reactions up to each frame of all joints together that hold them, N s. In trusses that may
    be stressed without loads, or nearly so, those of the smooth motion and of impacts cancel in the record, and what is
    left of a stress fades over many steps: how large it was is seen where it arose.
    """
    found: dict[int, F64] = {}
    every = np.zeros((run.frames, len(run.joints)))
    radii = np.array([run.radius[run.node[joint["a"]]] for joint in run.joints])
    for k in range(0, run.frames, MANY):
        given = np.nan_to_num(run.result.joint_impulse[k : k + MANY])
        every[k : k + MANY] = norm(given[..., :3]) + norm(given[..., 3:]) / radii
    for bodies, joints in wrenches.groups(run):
        mine = [any(joint is one for one in joints) for joint in run.joints]
        found |= dict.fromkeys(map(int, bodies), np.maximum.accumulate(every[:, mine].sum(axis=1)))
    return found


@once
def _struck(block: Block) -> F64:
    """(B, N) what contacts give all bodies together that joints hold together with each, N s."""
    found = np.zeros((block.count, block.run.bodies))
    for bodies, _ in wrenches.groups(block.run):
        found[:, bodies] = strokes(block)[0][:, bodies].sum(axis=1)[:, None]
    return found
