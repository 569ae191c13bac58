"""The angular momenta of clumps before the impacts of a step, and what the energy changes by as clumps turn.

Loads turn a clump while its angular momentum stays. What corrects positions turns its angular velocity along, so that the
momentum turns with it and keeps its size. What is before impacts is what is after them less what contacts gave. Turned by
an angle, a clump has at most that much of `L^2 (1/J_min - 1/J_max)/2` more.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import flights, forces, rigid
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.vectors import EPS, cross, dot, norm


@once
def momenta(block: Block) -> F64:
    """(B, C, 3) angular momenta before impacts, N m s; at first where contacts are unknown, or of several steps, and of
    clumps that leave.
    """
    run, sums = block.run, forces.of_contacts(block)
    found = np.zeros((block.count, len(run.clumps), 3))
    for number, clump in enumerate(run.clumps):
        old, new, b = block.c0[:, number], block.c1[:, number], clump.balls
        first = clump.momentum(old[:, 3:7], old[:, 10:])
        last = clump.momentum(new[:, 3:7], new[:, 10:])
        lever = clump.levers(new)
        given = [(cross(lever, sums.impulse[:, b]) + own[:, b]).sum(axis=1) for own in sums.moments]
        before = [last - moment for moment in given]
        nearer = norm(before[0]) - norm(first), norm(before[1]) - norm(first)
        one = np.abs(nearer[0]) <= np.abs(nearer[1])
        both = np.where(one[:, None], before[0], before[1])
        known = block.single & run.has_contacts & block.kept & block.there[:, clump.first]
        found[:, number] = np.where(known[:, None], both, first)
    return found


@once
def turned_on(block: Block) -> tuple[F64, F64]:
    """(B, N, 3) velocities and angular velocities of balls of clumps, of the first frames at the places of the second, with
    the angular velocities before impacts: impact problems have them so.
    """
    rows = block.c1.copy()
    rows[..., 7:10] = block.c0[..., 7:10]
    for number, clump in enumerate(block.run.clumps):
        rows[:, number, 10:] = clump.turning(rows[:, number, 3:7], momenta(block)[:, number])
    found = rigid.placed(block.run, block.x1, block.q1, rows)
    return found[2], found[3]


def of_block(block: Block) -> tuple[F64, F64]:
    """(B, N) by how much the energy of clumps changes in the step as they turn, where their angular momenta stay, and how
    far that may be off, J: exact where the interval is one whole step, in which the clump stays and it is on record which
    impulses are impacts. It is of the first ball of each.
    """
    run = block.run
    found, off = np.zeros((2, block.count, run.bodies))
    for number, clump in enumerate(run.clumps):
        old, new = block.c0[:, number], block.c1[:, number]
        before, first = momenta(block)[:, number], clump.momentum(old[:, 3:7], old[:, 10:])
        exact = 0.5 * dot(before, clump.turning(new[:, 3:7], before))
        exact = exact - 0.5 * dot(first, clump.turning(old[:, 3:7], first))
        sizes = [norm(clump.momentum(row[:, 3:7], row[:, 10:])) for row in (old, new)]
        pushed, turned = (of[:, clump.balls] for of in (forces.pushes(block)[0], forces.shifts(block)[1]))
        largest = np.maximum(*sizes) + clump.reach * pushed.max(axis=1)
        angle = np.minimum(turned.max(axis=1) + flights.of_block(block).off[:, number], np.pi)
        most = 0.5 * largest**2 * (1.0 / clump.inertia.min() - 1.0 / clump.inertia.max()) * angle
        known = block.single & block.there[:, clump.first]
        found[:, clump.first] = np.where(known, exact, 0.0)
        off[:, clump.first] = np.where(known & run.has_impacts, 0.0, most)
    return found, off


def risen(run: Run, motion: F64) -> F64:
    """(S,) by how much the energy of clumps may rise in each step as they turn (`of_block`), J; `motion` (S,) is
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
