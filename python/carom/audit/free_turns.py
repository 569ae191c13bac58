"""Where clumps, and all bodies, would be at the end of an interval by their weight, and clumps by their loads: by Euler's
equations, with what moments give in the mean of the step (algorithm, section 15).

Attraction is known from there (`cohesion`), and what it gives clumps is part of their flight (`flights`).
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit import carried, clump_loads, rigid, wrenches
from carom.audit.block import Block, once
from carom.audit.vectors import cross, dot, norm


@once
def rows(block: Block) -> F64:
    """(B, C, 13) the motion of clumps without contacts; not a number where they turn too far."""
    run, dt, old = block.run, block.dt[:, None, None], block.c0
    loads = clump_loads.of_block(block)
    loaded = (loads.way[..., 3:] != 0.0).any(axis=-1, keepdims=True)
    found = block.c1.copy()
    # The mean momentum of the step turns it.
    given = run.clumps.turning(old[..., 3:7], loads.way[..., 3:]) / dt
    spin = np.where(loaded, old[..., 10:] + given, old[..., 10:]).reshape(-1, 3)
    many = np.tile(np.arange(len(run.clumps)), block.count)
    start = old.reshape(-1, 13)
    times = np.repeat(np.asarray(block.dt, dtype=np.float64), len(run.clumps))
    turned = rigid.free(run.clumps.inertia[many], start[:, 3:7], spin, times)
    found[..., 3:7] = turned.reshape(*found.shape[:2], 4)
    of_box, first = carried.of_block(block), run.clumps.first
    found[..., :3] = old[..., :3] + dt * old[..., 7:10] + 0.5 * dt * dt * run.gravity + of_box.way[:, first]
    found[..., 7:10] = old[..., 7:10] + dt * run.gravity + of_box.velocity[:, first]
    found[..., :3] += loads.way[..., :3] / run.clumps.mass[:, None]
    found[..., 7:10] += loads.impulse[..., :3] / run.clumps.mass[:, None]
    found[..., 10:] = run.clumps.turning(found[..., 3:7], run.clumps.momenta(old) + loads.impulse[..., 3:])
    return found


@once
def places(block: Block) -> F64:
    """(B, N, 3) places of all bodies, m."""
    run, dt = block.run, block.dt[:, None, None]
    found = block.x0 + dt * block.v0 + 0.5 * dt * dt * run.falls + carried.of_block(block).way
    if run.clumps:
        free, balls = rows(block), run.clumps.balls
        found[:, balls] = free[:, run.clumps.of, :3] + run.clumps.levers(free)
    return found


@once
def loaded_places(block: Block) -> tuple[F64, F64]:
    """(B, N, 3) places of all bodies moved by loads but attraction, too, and (B, N) how far off these may be, m: where the
    smooth motion ends, before anything touches. What contacts give is no part of it: a lid that balls hold up has the way of
    its force here.
    """
    run, dt = block.run, block.dt
    way, off = np.zeros(block.x0.shape), np.zeros(block.x0.shape[:2])
    anywhere = run.jointed.copy()
    for load in run.loads:
        if load["kind"] == "force":
            body = int(load["body"])
            if wrenches.carried(run, body):
                continue
            forms = (*load["force"], *load["torque"])
            shift = wrenches.filtered(run, forms)[1][:, :3]
            loose = wrenches.loose(run, forms, wrenches.varied(run, forms))[:, :3]
            for j in range(3):
                way[:, body, j] += block.total(shift[:, j]) / run.mass[body]
                off[:, body] += block.total(loose[:, j]) * dt / run.mass[body]
        elif load["kind"] == "callable":
            anywhere[:] = True
        elif load["kind"] != "cohesion":
            for node, (mean, slack) in clump_loads.of_motion(block, load).items():
                if node >= 0 and not wrenches.carried(run, node):
                    way[:, node] += 0.5 * dt[:, None] * mean[:, :3] / run.mass[node]
                    off[:, node] += dt * slack[:, 0] / run.mass[node]
    found = places(block) + way
    if run.clumps:
        slack = clump_loads.of_block(block).way_slack
        slack = slack[..., 0] / run.clumps.mass + 2.0 * run.clumps.reach * slack[..., 1] / run.clumps.least
        off[:, run.clumps.balls] = slack[:, run.clumps.of]
    # What joints, and functions of the user, do before anything touches is on no record.
    told = np.nan_to_num(norm(block.x1 - found))
    return found, np.nan_to_num(off) + np.where(anywhere, told, 0.0)


@once
def levers(block: Block) -> F64:
    """(B, N, 3) centres of balls of clumps from the centres of mass half-way, m; 0 of other bodies."""
    run, found = block.run, np.zeros((block.count, block.run.bodies, 3))
    if run.clumps:
        found[:, run.clumps.balls] = run.clumps.levers(half_way(block.c0, rows(block)))
    return found


def half_way(first: F64, last: F64) -> F64:
    """Rows (B, C, 13) like `last`, turned half-way from those at `first`."""
    found, q, end = last.copy(), first[..., 3:7], last[..., 3:7]
    both = end + np.where((q * end).sum(axis=-1, keepdims=True) < 0.0, -q, q)
    found[..., 3:7] = both / norm(both)[..., None]
    return found


def inverse_mass(block: Block, k: I64, body: I64, along: F64) -> F64:
    """(K,) 1/kg, inverse masses of bodies (walls: 0) at their centres along directions (K, 3) in the intervals `k`."""
    run = block.run
    found = 1.0 / np.append(run.mass, np.inf)[np.minimum(body, run.bodies)]
    mine = np.flatnonzero(run.in_clump[np.minimum(body, run.bodies - 1)] & (body < run.bodies))
    if mine.size:
        number = run.clump_of[body[mine]]
        arm = cross(levers(block)[k[mine], body[mine]], along[mine])
        turned = run.clumps.turning(rows(block)[k[mine], number, 3:7], arm, number)
        found[mine] = 1.0 / run.clumps.mass[number] + dot(arm, turned)
    return np.asarray(found)
