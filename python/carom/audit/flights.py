"""Free flight of clumps: where they would be at the end of an interval without contacts, by Euler's equations.

    x = x_0 + dt v_0 + dt^2 g/2,    L = const,    dR/dt = (J(R)^-1 L) x R

Loads of a step are solved at these places (`loads_once`); what contacts give comes on top.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64
from carom.audit import forces, rigid
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.vectors import EPS, cross, dot, norm, rotated


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


@once
def of_block(block: Block) -> Flights:
    """The flights of all clumps."""
    run, dt = block.run, block.dt[:, None]
    rows = block.c1.copy()
    off = np.zeros(rows.shape[:2])
    many = np.tile(np.arange(len(run.clumps)), block.count)
    start, times = (
        block.c0.reshape(-1, 13),
        np.repeat(np.asarray(block.dt, dtype=np.float64), len(run.clumps)),
    )
    turned = rigid.free(run.rigid.inertia[many], start[:, 3:7], start[:, 10:], times)
    rows[..., 3:7] = turned.reshape(*rows.shape[:2], 4)
    for number, clump in enumerate(run.clumps):
        old, new = block.c0[:, number], rows[:, number]
        q, w = old[:, 3:7], old[:, 10:]
        new[:, :3] = old[:, :3] + dt * old[:, 7:10] + 0.5 * dt * dt * run.gravity
        new[:, 7:10] = old[:, 7:10] + dt * run.gravity
        new[:, 10:] = clump.turning(new[:, 3:7], clump.momentum(q, w))
        fast = np.where((norm(w) > norm(block.c1[:, number, 10:]))[:, None], w, block.c1[:, number, 10:])
        off[:, number] = block.updates * clump.scheme(fast, run.h)
        off[np.isnan(new[:, 3]), number] = np.inf
    x, _, v, _ = rigid.placed(run, block.x1, block.q1, rows)
    known = np.isfinite(x)
    return Flights(rows, np.where(known, x, block.x1), np.where(known, v, block.v1), off)


@once
def speeds_of_turning(block: Block) -> F64:
    """(B, N) by how much the velocities of balls of clumps change in a step as the clumps turn, m/s."""
    run, found = block.run, np.zeros((block.count, block.run.bodies))
    if not run.clumps:
        return found
    gained = norm(of_block(block).v - block.v0 - block.dt[:, None, None] * run.gravity)
    for number, clump in enumerate(run.clumps):
        several = np.max([norm(rows[:, number, 10:]) for rows in (block.c0, block.c1)], axis=0)
        ratio = clump.inertia.max() / clump.inertia.min()
        most = 2.0 * run.h * ((ratio * several) ** 2)[:, None] * norm(clump.offsets)
        found[:, clump.balls] = np.where(block.single[:, None], gained[:, clump.balls], most)
    return found


@once
def turned_on(block: Block) -> tuple[F64, F64]:
    """(B, N, 3) velocities and angular velocities of balls of clumps, of the first frames at the places of the second."""
    rows = block.c1.copy()
    rows[..., 7:] = block.c0[..., 7:]
    found = rigid.placed(block.run, block.x1, block.q1, rows)
    return found[2], found[3]


def energy_of_balls(block: Block, at: I64, motion: F64) -> F64:
    """(M,) kinetic energy of the clumps, at the places of the second frames, of which balls have the `motion` (M, 6), J;
    `at` is interval times N plus ball.
    """
    run, (k, ball) = block.run, np.divmod(at, block.run.bodies)
    number = run.clump_of[ball]
    q, w = block.c1[k, number, 3:7], motion[:, 3:]
    v = motion[:, :3] - cross(w, rotated(q, run.rigid.offsets[ball]))
    turning = dot(w, run.rigid.momentum(number, q, w))
    return np.asarray(0.5 * (run.rigid.mass[number] * dot(v, v) + turning))


def energy_of_turning(block: Block) -> tuple[F64, F64]:
    """(B, N) by how much the energy of clumps changes in the step as they turn, where their angular momenta stay, and how
    far that may be off, J: exact where the interval is one whole step. It is of the first ball of each.

    Contacts turn clumps at the position level, and the scheme turns free ones not quite as their energy asks. Turned by an
    angle, a clump has at most that much of `L^2 (1/J_min - 1/J_max)/2` more.
    """
    run = block.run
    found, off = np.zeros((2, block.count, run.bodies))
    for number, clump in enumerate(run.clumps):
        old, new = block.c0[:, number], block.c1[:, number]
        exact = rigid.turned_energy(clump, old, new)
        momenta = [norm(clump.momentum(row[:, 3:7], row[:, 10:])) for row in (old, new)]
        pushed, turned = (of[:, clump.balls] for of in (forces.pushes(block)[0], forces.shifts(block)[1]))
        largest = np.maximum(*momenta) + clump.reach * pushed.max(axis=1)
        angle = np.minimum(turned.max(axis=1) + of_block(block).off[:, number], np.pi)
        most = 0.5 * largest**2 * (1.0 / clump.inertia.min() - 1.0 / clump.inertia.max()) * angle
        found[:, clump.first] = np.where(block.single, exact, 0.0)
        off[:, clump.first] = np.where(block.single, 0.0, most)
    return found, off


def risen(run: Run, motion: F64) -> F64:
    """(S,) by how much the energy of clumps may rise in each step as they turn (`energy_of_turning`), J; `motion` (S,) is
    the kinetic energy. Without the frames of a step: contacts correct places by at most the way of a step.
    """
    found = np.zeros(len(motion))
    if not run.clumps:
        return found
    touched = run.steps["contacts"] > 0
    lightest = run.mass[run.in_clump].min()
    for clump in run.clumps:
        least, most = clump.inertia.min(), clump.inertia.max()
        fastest = np.sqrt(2.0 * motion / least)
        angle = np.where(touched, run.h * np.sqrt(2.0 * motion / lightest * clump.mass / least), 0.0)
        angle = angle + rigid.SCHEME * np.minimum(run.h * fastest, 1.0) ** 7
        found += motion * (most / least - 1.0) * np.minimum(angle, 1.0)
    whole = np.flatnonzero((np.diff(run.step) == 1) & ~run.cut[run.step[1:] - 1])
    exact = np.zeros(len(motion))
    size = max(1, 100_000 // len(run.clumps))
    for first in range(0, len(whole), size):
        mine = whole[first : first + size]
        rows = run.motion_of_clumps(slice(int(mine[0]), int(mine[-1]) + 2))
        old, new = rows[mine - mine[0]], rows[mine - mine[0] + 1]
        for number, clump in enumerate(run.clumps):
            gained = rigid.turned_energy(clump, old[:, number], new[:, number])
            exact[run.step[mine]] += gained
    at = run.step[whole]
    found[at] = np.maximum(exact[at], 0.0) + 64.0 * EPS * motion[at]
    return found
