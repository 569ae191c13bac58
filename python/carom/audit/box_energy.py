"""How the energy changes with a periodic box that deforms, beyond the works on record (`energy`)."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import carried, forces
from carom.audit.block import Block
from carom.audit.vectors import norm


def carried_off(block: Block) -> F64:
    """(B, N) how far the energy of a body may be off, J, by what a periodic box that deforms gives it: that of its motion by
    the velocity, that of its weight by the way. They are known in a step, over several up to changes of the rate between.
    """
    run, of_box = block.run, carried.of_block(block)
    if not run.box.deforms:
        return np.zeros((block.count, run.bodies))
    mass = run.mass.copy()
    mass[run.clumps.balls] = 0.0
    mass[run.clumps.first] = run.clumps.mass
    moved = mass * np.maximum(norm(block.v0), norm(block.v1)) * of_box.slack
    pull = mass * norm(np.broadcast_to(run.falls, block.x0.shape))
    most = norm(of_box.way) + block.dt[:, None] * norm(of_box.velocity)
    slack = of_box.slack_way + block.dt[:, None] * of_box.slack
    return np.asarray(moved + pull * (slack + np.where(block.single[:, None], 0.0, most)))


def unsure(block: Block) -> F64:
    """(K,) J by which works of recorded contacts may be off over several steps: of images and the flow together it is the
    change of what bodies at a distance of their radii have, and what normals turn by.
    """
    run, c = block.run, block.rows
    if not run.box.deforms or not len(c):
        return np.zeros(len(c))
    flow = np.where(block.single, 0.0, carried.strained(block))
    lengths = run.radius[c.a] + run.reach[np.minimum(c.b, run.bodies)]
    found = flow[c.k] * lengths * norm(c.impulse)
    if run.loads_once:
        angle = np.where(block.single[c.k], norm(c.normal - block.start[1]), forces.turn(block))
        known = block.single & run.has_impacts
        speed = carried.image_speed(block, c.k, block.image(c.k, c.a, c.b))
        found = found + np.where(known[c.k], 0.0, angle * norm(c.impulse) * speed)
    return np.asarray(found)
