"""What loads beside the weight do on what contacts give the bodies that they push.

Loads `L` act before contacts, which begin at `u = v + dV_L`, and whose works on record are by `(u + v')/2`. So `L` gives the
kinetic energy `L . (v + u)/2`, while on record, as the change of a potential or as a work, there is

    springs and forces on free walls, nsga      L . x/h,  x = h (v + u)/2 + y
    all others, and Moreau-Jean                 L . (v + v')/2,  v' = u + dV_P

with the ways `y` and the velocities `dV_P` that position impulses and impulses of contacts give, and what joints, dampers
and drag answer (`answers`). So the energy falls by `L . y/h`, or by `L . dV_P/2`, beyond all works. That is exact for loads
that do not change in the step, and of second order in their change. `L` is that of the laws (`loads`), of clumps at their
first balls, about their centres. Of functions of the user it is what the frames leave of balls that no joint holds.
The weight is a load, too: on impulses of contacts themselves it is part of the balance (`energy`), on answers to them here.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import answers, carried, clump_loads, cohesion, forces, wrenches
from carom.audit.block import Block
from carom.audit.loads import of_loads
from carom.audit.vectors import cross, dot


def on_bodies(block: Block) -> F64:
    """(B, N) J, in whole steps; 0 in other intervals."""
    run, h = block.run, block.run.h
    if all(load["kind"] == "cohesion" for load in run.loads):
        return np.zeros((block.count, run.bodies))
    begun = answers.before_contacts(block)
    first, last = (np.concatenate(of, axis=-1) for of in ((block.v0, block.w0), (block.v1, block.w1)))
    given, stored = np.nan_to_num(of_loads(block).alone), np.zeros_like(begun)
    given[..., :3] -= cohesion.on_bodies(block)[0] + run.mass[:, None] * carried.of_block(block).velocity
    if any(load["kind"] == "callable" for load in run.loads):
        held = np.isin(np.arange(run.bodies), [body for bodies, _ in wrenches.groups(run) for body in bodies])
        free = ~held & ~run.in_clump
        pushed = run.mass[:, None] * (begun - first)[..., :3] - run.mass[:, None] * h * run.falls
        given[:, free, :3] = (pushed - cohesion.on_bodies(block)[0])[:, free]
    for load in run.loads:
        if load["kind"] == "spring":
            for node, (mean, _) in clump_loads.of_motion(block, {**load, "damping": 0.0}).items():
                stored[:, node] += mean
    stored[:, run.balls :] = given[:, run.balls :]
    half = 0.5 * (last - begun)
    ways = h * half
    if run.method == "nsga":
        sums = forces.of_contacts(block)
        ways = answers.given(block, np.concatenate([sums.shift, sums.shift_moments[0]], axis=-1))
    for moved in (half, ways):
        _to_centres(block, moved)
    each = (stored * ways / h + (given - stored) * half).sum(axis=-1)
    return np.where(block.single[:, None], np.nan_to_num(each), 0.0)


def by_weight(block: Block) -> F64:
    """(B, N) J of Moreau-Jean, in whole steps, by the weight on what joints, dampers and drag answer; 0 in others."""
    run = block.run
    if run.method != "moreau" or not run.answering.any():
        return np.zeros((block.count, run.bodies))
    sums = forces.of_contacts(block)
    given = answers.given(block, np.concatenate([sums.impulse, sums.moments[0]], axis=-1))
    _to_centres(block, given)
    nodes = np.where(run.node == np.arange(run.bodies), run.heavy, 0.0)
    each = nodes * dot(given[..., :3], run.falls) - dot(sums.impulse, run.falls)
    return np.where(block.single[:, None], 0.5 * run.h * each, 0.0)


def _to_centres(block: Block, moved: F64) -> None:
    """Makes ways (B, N, 6) of the first balls of clumps those of the clumps."""
    for body in block.run.clumps.first:
        moved[:, body, :3] -= cross(moved[:, body, 3:], wrenches.centre_of_ball(block, body, 1))
