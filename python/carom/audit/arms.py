"""The arms with which reactions of joints act, where a frame shows others.

Reactions `J_s` of the smooth motion act where it ends, those that answer contacts where the step ends (of Moreau-Jean all of
them act there), and the record is their sum `J`. Between both the position level turns a body by what its impulses and the
answer of the joints to them give, an angle `phi`: with the arm `a` of the frame the moment has `-(phi x a) x J_s` besides.
What answers the impulses `P` of contacts is `J_i = m dV - P` of a body with one joint; with more only sizes are known. Nor
do sums over several steps tell their products: there `phi x a` is at most what contacts move bodies by that joints hold.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64
from carom.audit import answers, forces, recorded, wrenches
from carom.audit.block import Block
from carom.audit.vectors import cross, norm


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
    of_joined = moved_at_all, struck_at_all = np.zeros((2, block.count, run.bodies))
    for nodes, _ in wrenches.groups(run):
        bodies = np.isin(run.node, nodes)
        for found, of_each in zip(
            of_joined, (recorded.shifts(block)[0], recorded.strokes(block)[0]), strict=True
        ):
            found[:, bodies] = of_each[:, bodies].sum(axis=1, keepdims=True)
    twist = norm(sums.shift_moments[0]) / run.inertia
    joints = np.bincount([body for _, body, _, _ in ends], minlength=run.bodies)
    for j, body, sign, arm in ends:
        reach, own = wrenches.reach(run, body, arm), answered[:, body]
        later[:, body] += reach * way[:, body] * norm(own)
        known = block.single & (joints[body] == 1)
        swung = cross(angle[:, body], wrenches.lever(block, body, arm, 1))
        moment[known, body] = -cross(swung, sign * given[:, j] - own)[known]
        moved = np.where(
            block.single, reach * norm(angle[:, body]), moved_at_all[:, body] + reach * twist[:, body]
        )
        size = norm(given[:, j]) + np.where(block.single, norm(own), struck_at_all[:, body])
        off[~known, body] += (moved * size)[~known]
    before: _Handed | None = run.known.get(_Handed)
    follows = before is not None and before.first == block.first
    last = before.moment if before and follows else np.zeros((run.bodies, 3))
    later += off + norm(np.diff(moment, axis=0, prepend=last[None]))
    first = before.echo if before and follows else (later[0], later[0])
    echo, after = wrenches.echo(run, later, first)
    run.known[_Handed] = _Handed(block.first + block.count, moment[-1], after)
    return Turned(moment, later + echo)
