"""The arms with which reactions of joints act, where a frame shows others.

Reactions `J_s` of the smooth motion act where it ends, those that answer contacts where the step ends (of Moreau-Jean all of
them act there), and the record is their sum `J`. Between both the position level turns a body by what its impulses and the
answer of the joints to them give, an angle `phi`: with the arm `a` of the frame the moment has `-(phi x a) x J_s` besides.
What answers the impulses `P` of contacts is `J_i = m dV - P` of a body with one joint; with more only sizes are known. Nor
do sums over several steps tell their products: there `phi x a` is taken for at most `UNEVEN` times the mean of what contacts
move this body by, and that of its group which they move most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64
from carom.audit import answers, forces, recorded, wrenches
from carom.audit.block import Block
from carom.audit.loads import of_loads
from carom.audit.vectors import cross, norm

#: Largest step of an interval over the mean of its steps (1). Larger: faults are hidden; smaller: runs are accused.
UNEVEN = 4.0


class Turned(NamedTuple):
    """N m s."""

    moment: F64
    """(B, N, 3) moments of joints beside those about the points of the frame, in whole steps."""
    off: F64
    """(B, N) how far these may be off, as the filter of the scheme hands reactions of other steps on with their arms."""


class _Handed(NamedTuple):
    """From a block to the next one."""

    first: int
    """The first frame of that."""
    moment: F64
    """(N, 3) of the last interval."""
    echo: tuple[F64, F64]
    """(N,) each, as `wrenches.echo` has it of the first interval."""


def turned(block: Block) -> Turned:
    """Of a block; blocks are asked in their order, as what the filter keeps goes from each to the next."""
    run, sums = block.run, forces.of_contacts(block)
    moment, (off, later) = np.zeros((block.count, run.bodies, 3)), np.zeros((2, block.count, run.bodies))
    if not run.joints:
        return Turned(moment, off)
    pushed = np.concatenate([sums.shift, sums.shift_moments[0]], axis=-1)
    angle = answers.given(block, pushed)[..., 3:]
    way = block.dt[:, None] * np.maximum(norm(block.w0), norm(block.w1))
    struck = np.concatenate([sums.impulse, sums.moments[0]], axis=-1)
    answered = run.heavy[:, None] * answers.given(block, struck)[..., :3] - sums.impulse
    if run.method == "moreau":
        answered[:] = 0.0
    given = np.nan_to_num(run.result.joint_impulse[block.first : block.first + block.count, :, :3])
    ends = [
        (j, int(joint[side]), sign, arm)
        for j, joint in enumerate(run.joints)
        for side, sign, arm in zip("ab", (1.0, -1.0), joint["rows"][0][2:4], strict=True)
        if joint[side] >= 0
    ]
    moved, pressed = _over_steps(block)
    twist = UNEVEN / np.maximum(block.n, 1)[:, None] * norm(sums.shift_moments[0]) / run.inertia
    joints = np.bincount([body for _, body, _, _ in ends], minlength=run.bodies)
    for j, body, sign, arm in ends:
        reach, own = wrenches.reach(run, body, arm), answered[:, body]
        later[:, body] += reach * way[:, body] * norm(own)
        known = block.single & (joints[body] == 1)
        swung = cross(angle[:, body], wrenches.lever(block, body, arm, 1))
        moment[known, body] = -cross(swung, sign * given[:, j] - own)[known]
        angles = reach * norm(angle[:, body]), moved[:, body] + reach * twist[:, body]
        sizes = norm(own), pressed[:, body]
        turn, size = (np.where(block.single, one, many) for one, many in (angles, sizes))
        off[~known, body] += (turn * (norm(given[:, j]) + size))[~known]
    before: _Handed | None = run.known.get(_Handed)
    follows = before is not None and before.first == block.first
    last = before.moment if before and follows else np.zeros((run.bodies, 3))
    later += off + norm(np.diff(moment, axis=0, prepend=last[None]))
    first = before.echo if before and follows else (later[0], later[0])
    echo, after = wrenches.echo(run, later, first)
    run.known[_Handed] = _Handed(block.first + block.count, moment[-1], after)
    return Turned(moment, later + echo)


def _over_steps(block: Block) -> tuple[F64, F64]:
    """(B, N) for intervals of several steps: by how much contacts may turn the arms of joints in a step, m, and the sizes of
    what reactions may hold, N s.
    """
    run, steps = block.run, np.maximum(block.n, 1)[:, None]
    pushes = recorded.pushes(block)[0]
    own = recorded.shifts(block)[0] / steps
    if run.method == "moreau":  # each impulse moves for the rest of its step
        own = own - (1.0 - 1.0 / steps) * run.h * pushes / run.mass
    moved = own.copy()
    for nodes, _ in wrenches.groups(run):
        bodies = np.isin(run.node, nodes)
        moved[:, bodies] += own[:, bodies].max(axis=1, keepdims=True)
    return UNEVEN * moved, recorded.strokes(block)[0] + of_loads(block).spread[..., 0]
