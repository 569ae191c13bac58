"""Where balls meet walls: there the laws of a step have the velocities of walls that move."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit.block import Block


def at_walls(block: Block, k: I64, a: I64, b: I64, normal: F64, *, start: bool = False) -> F64:
    """(K, 3) centres of balls `a` for the velocities of walls `b`, of their shapes, at the ends of the steps `k` or at their
    starts, m. Both are where the normals are, which is where the step ends, and with Moreau-Jean the middle; the point that
    the wall turns about takes them along. Of loads that are solved once it is the surface that moves, and a ball may have
    left it.
    """
    run = block.run
    if run.method == "moreau":
        centre = block.x0[k, a] + 0.5 * run.h * block.v0[k, a]
        passed = 0.5
    else:
        centre, passed = block.x1[k, a], 1.0
    if run.loads_once:
        gap, _ = run.meet(block.t1[k], a, b, block.x1[k, a], block.x1[k, np.minimum(b, run.bodies - 1)])
        centre = centre - gap[:, None] * normal
    return centre + (float(not start) - passed) * _way(block, k, b)


def riding(block: Block, k: I64, a: I64, *, start: bool = False) -> F64 | None:
    """(K, 3) the same for the material of walls, where it has others: where the ball is at either time, with Moreau-Jean by
    its velocity before the step. With those of one place what rides on a turning wall would spiral outwards.
    """
    if start:
        return np.asarray(block.x0[k, a])
    return np.asarray(block.x0[k, a] + block.run.h * block.v0[k, a]) if block.run.method == "moreau" else None


def half_way(block: Block, k: I64, a: I64, b: I64) -> tuple[F64, F64]:
    """(K, 3) centres of balls `a` where loads act, with walls `b` as they are at both ends of the steps, m."""
    passed, way = passed_half_way(block), _way(block, k, b)
    centre = block.x0[k, a] + ways_half_way(block)[k, a]
    return centre - passed * way, centre + (1.0 - passed) * way


def passed_half_way(block: Block) -> float:
    """The share of a step that has passed where its loads act."""
    return 1.0 - float(block.run.options["theta"]) if block.run.method == "moreau" else 0.5


def ways_half_way(block: Block) -> F64:
    """(B, N, 3) ways of the bodies until then, m: of Moreau-Jean as angular momentum asks for."""
    if block.run.method == "moreau":
        return passed_half_way(block) * block.run.h * block.v0
    return 0.5 * (block.x1 - block.x0)


def _way(block: Block, k: I64, b: I64) -> F64:
    """(K, 3) by how much the points move that walls turn about, m."""
    run, found = block.run, np.zeros((len(k), 3))
    for w, rows in run.on_walls(b):
        wall = run.walls[w]
        if wall.travels:
            found[rows] = wall.pose(block.t1[k[rows]])[1] - wall.pose(block.t0[k[rows]])[1]
    return found
