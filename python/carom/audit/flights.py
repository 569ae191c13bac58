"""Free flight of clumps: where they would be at the end of an interval without contacts, by Euler's equations.

    x = x_0 + dt v_0 + dt^2 g/2,    L = const,    dR/dt = (J(R)^-1 L) x R

with loads and joints (`clump_loads`), and with what attraction gives their balls in a step, whose ways have half of it.
Loads of contacts are solved at these places (`loads_once`); what contacts give comes on top.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64
from carom.audit import carried, clump_loads, cohesion, free_turns, rigid
from carom.audit.block import Block, once
from carom.audit.vectors import conjugate, cross, dot, exponential, norm, product, rotated, rotation_vector

Motion = tuple[F64, F64, F64, F64]


class Flights(NamedTuple):
    """Of a block."""

    rows: F64
    """(B, C, 13) the motion of clumps."""
    x: F64
    """(B, N, 3) places of bodies: of balls of clumps those that follow, others as they are."""
    v: F64
    """(B, N, 3) velocities of balls of clumps."""
    off: F64
    """(B, C) rad by which the scheme may be off in how clumps turn."""
    pulled: F64
    """(B, C, 3) impulses of attraction, N s."""
    push: F64
    """(B, C, 3) impulses of attraction, loads and joints, N s, and moments of them about the centres of mass, N m s."""
    kick: F64
    push_off: F64
    """(B, C) how far these may be off."""
    kick_off: F64
    way_off: F64
    """(B, C) how far the centres may be off, m."""


@once
def of_block(block: Block) -> Flights:
    """The flights of all clumps."""
    run, clumps, dt = block.run, block.run.clumps, block.dt[:, None]
    rows, old, loads = free_turns.rows(block).copy(), block.c0, clump_loads.of_block(block)
    (given, slack), arm = cohesion.on_bodies(block), np.zeros(run.bodies)
    slack = slack + cohesion.most(block) * dt
    arm[clumps.balls] = clumps.arm
    pulled, kick = clumps.sum(given), clumps.sum(cross(free_turns.levers(block), given))
    push_off, kick_off = clumps.sum(slack), clumps.sum(slack * arm)
    rows[..., :3] += (0.5 * dt / clumps.mass)[..., None] * pulled
    rows[..., 7:10] += pulled / clumps.mass[:, None]
    turn = rotation_vector(product(rows[..., 3:7], conjugate(old[..., 3:7])))
    turn = turn + 0.5 * dt[..., None] * clumps.turning(rows[..., 3:7], kick)
    kicked = (kick != 0.0).any(axis=-1, keepdims=True)
    rows[..., 3:7] = np.where(kicked, product(exponential(turn), old[..., 3:7]), rows[..., 3:7])
    kick = kick + loads.impulse[..., 3:]
    rows[..., 10:] = clumps.turning(rows[..., 3:7], clumps.momenta(old) + kick)
    spin = np.maximum(norm(old[..., 10:]), norm(block.c1[..., 10:]))
    turn_off = kick_off * dt + loads.way_slack[..., 1]
    off = block.updates[:, None] * rigid.scheme(spin, run.h) + turn_off / clumps.least
    off[np.isnan(rows[..., 3])] = np.inf
    way_off = (push_off * dt + loads.way_slack[..., 0]) / clumps.mass
    push_off, kick_off = push_off + loads.slack[..., 0], kick_off + loads.slack[..., 1]
    x, _, v, _ = rigid.placed(run, block.x1, block.q1, rows)
    known = np.isfinite(x)
    return Flights(rows, np.where(known, x, block.x1), np.where(known, v, block.v1), off,
                   pulled, pulled + loads.impulse[..., :3], kick, push_off, kick_off, way_off)  # fmt: skip


@once
def speeds_of_turning(block: Block) -> F64:
    """(B, N) by how much the velocities of balls of clumps change in a step as the clumps turn, m/s."""
    run, found = block.run, np.zeros((block.count, block.run.bodies))
    if not run.clumps:
        return found
    smooth = block.v0 + block.dt[:, None, None] * run.gravity + carried.of_block(block).velocity
    gained = norm(of_block(block).v - smooth)
    clumps, several = run.clumps, np.maximum(norm(block.c0[..., 10:]), norm(block.c1[..., 10:]))
    most = 2.0 * run.h * ((clumps.most / clumps.least * several) ** 2)[:, clumps.of] * clumps.arm
    found[:, clumps.balls] = np.where(block.single[:, None], gained[:, clumps.balls], most)
    return found


def energy_of_balls(block: Block, at: I64, motion: F64) -> F64:
    """(M,) kinetic energy of the clumps, at the places of the second frames, of which balls have the `motion` (M, 6), J;
    `at` is interval times N plus ball.
    """
    run, (k, ball) = block.run, np.divmod(at, block.run.bodies)
    number = run.clump_of[ball]
    q, w = block.c1[k, number, 3:7], motion[:, 3:]
    v = motion[:, :3] - cross(w, rotated(q, run.clumps.offsets[ball]))
    turning = dot(w, run.clumps.momentum(q, w, number))
    return np.asarray(0.5 * (run.clumps.mass[number] * dot(v, v) + turning))


@once
def half_way(block: Block) -> F64:
    """(B, N + 1, 3) from the centres of balls of clumps to where they are half-way between both ends of an interval, as
    their clumps turn, m; 0 for other bodies, and for walls at last. Loads of a step act there.
    """
    run = block.run
    found = np.zeros((block.count, run.bodies + 1, 3))
    if not run.clumps:
        return found
    rows = free_turns.half_way(block.c0, block.c1)
    found[:, run.clumps.balls] = run.clumps.levers(rows) - run.clumps.levers(block.c1)
    return found


def at_half_way(block: Block, k: I64, a: I64, b: I64, motion: Motion) -> Motion:
    """Velocities of pairs of bodies (K,) where these are half-way between both ends of the intervals `k`."""
    v_a, w_a, v_b, w_b = motion
    if not block.run.clumps:
        return motion
    of = half_way(block)
    off = (cross(w, of[k, np.minimum(body, block.run.bodies)]) for w, body in ((w_a, a), (w_b, b)))
    return v_a + next(off), w_a, v_b + next(off), w_b
