"""Where the velocity level of a step has the balls that meet walls: walls that turn have their velocities there."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit.answers import before_contacts
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.loads import of_loads


@once
def centres(block: Block) -> F64:
    """(B, N, 3) centres of the balls in the last step of each interval, m: as in the frame; Moreau-Jean takes the end of the
    smooth motion.
    """
    run = block.run
    if not _smooth(run):
        return block.x1
    theta, dt = float(run.options["theta"]), block.dt[:, None, None]
    if run.has_contacts:
        smooth = before_contacts(block)[..., :3]
        mean = (1.0 - theta) * block.v0 + theta * smooth
        return np.asarray(block.x0 + dt * mean + of_loads(block).shift[..., :3])
    gained = of_loads(block).impulse[..., :3] / run.mass[:, None] + dt * run.falls
    return np.asarray(block.x0 + dt * (block.v0 + theta * gained) + of_loads(block).shift[..., :3])


def at_walls(block: Block, k: I64, a: I64, b: I64, normal: F64) -> F64:
    """(K, 3) centres of balls `a` for the velocities of walls `b` after a step, m: of loads that are solved once it is the
    surface that moves, and a ball may have left it.
    """
    centre, run = centres(block)[k, a], block.run
    if not run.loads_once:
        return centre
    gap, _ = run.meet(block.t1[k], a, b, block.x1[k, a], block.x1[k, np.minimum(b, run.bodies - 1)])
    return np.asarray(centre - gap[:, None] * normal)


def wall_slack(block: Block, k: I64, a: I64, b: I64) -> F64:
    """(K,) by how much the velocity of wall `b` at ball `a` is off, m/s: without recorded contacts loads that depend on the
    motion are known to their slack, and so are the `centres` of Moreau-Jean.
    """
    found, run = np.zeros(len(k)), block.run
    if not (_smooth(run) and run.loads) or run.has_contacts:
        return found
    way = float(run.options["theta"]) * block.dt[:, None] * of_loads(block).slack[..., 0] / run.mass
    for w, wall in enumerate(run.walls):
        rows = np.flatnonzero(b == run.bodies + w)
        found[rows] = wall.turning(block.t1[k[rows]]) * way[k[rows], a[rows]]
    return found


def _smooth(run: Run) -> bool:
    return run.method == "moreau" and any(wall.moves for wall in run.walls)
