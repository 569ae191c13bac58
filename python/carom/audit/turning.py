"""The angular momenta of clumps before the impacts of a step, and what the energy changes by as clumps turn.

Loads turn a clump while its angular momentum stays. What corrects positions turns its angular velocity along, so that the
momentum turns with it and keeps its size. What is before impacts is what is after them less what contacts gave. Turned by
an angle, a clump has at most that much of `L^2 (1/J_min - 1/J_max)/2` more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, Bool
from carom.audit import answers, clump_loads, flights, forces, hits, loads_once, recorded, rigid
from carom.audit.block import Block, blocks, once
from carom.audit.data import Run
from carom.audit.vectors import EPS, conjugate, cross, dot, norm, product, rotated, rotation_vector


class Before(NamedTuple):
    """Of each clump, (B, C, 3), N m s."""

    momenta: F64
    """Angular momenta before impacts; at first where contacts are unknown, or of several steps, and of clumps that leave."""
    answered: F64
    """What joints and loads answered to contacts."""


@once
def before(block: Block) -> Before:
    """Of a block."""
    run, clumps, sums = block.run, block.run.clumps, forces.of_contacts(block)
    first, last = clumps.momenta(block.c0) + flights.of_block(block).kick, clumps.momenta(block.c1)
    given = [moment(block, sums.impulse, own) for own in sums.moments]
    found = [last - of for of in given]
    answering = answers.of_block(block).group_of[clumps.first] >= 0
    if answering.any():  # which have the rest of what they have now by joints and loads
        ends = (answers.before_contacts(block, k)[:, clumps.first, 3:] for k in (0, 1))
        held = [clumps.momentum(block.c1[..., 3:7], w) for w in ends]
        found = [np.where(answering[:, None], *of) for of in zip(held, found, strict=True)]
    # Loads and joints may have given more or less than that they answered to contacts.
    one, other = (
        np.abs(norm(of) - norm(first - (last - of - by))) for of, by in zip(found, given, strict=True)
    )
    least = (one <= other)[..., None]
    both, by = np.where(least, *found), np.where(least, *given)
    known = (block.single & run.has_contacts & block.kept)[:, None] & block.there[:, clumps.first]
    answered = np.where(known[..., None] & answering[:, None], last - both - by, 0.0)
    return Before(np.where(known[..., None], both, first), answered)


@once
def by_loads(block: Block) -> F64:
    """(B, C, 3) angular impulses of loads and joints before impacts, N m s."""
    return np.asarray(clump_loads.of_block(block).impulse[..., 3:] - before(block).answered)


def moment(block: Block, given: F64, own: F64) -> F64:
    """(B, C, 3) moments about the centres of clumps: of impulses (B, N, 3) on balls, and of moments (B, N, 3)."""
    found = own.copy()
    clumps = block.run.clumps
    found[:, clumps.balls] += cross(clumps.levers(block.c1), given[:, clumps.balls])
    return clumps.sum(found)


@once
def turned_on(block: Block) -> tuple[F64, F64]:
    """(B, N, 3) velocities and angular velocities of balls of clumps, of the first frames at the places of the second, with
    the angular velocities before impacts and loads: restitution is of those of the step's start, as it is of balls.
    """
    rows = block.c1.copy()
    rows[..., 7:10] = block.c0[..., 7:10]
    turned = block.run.clumps.turning(rows[..., 3:7], at_start(block)[0])
    rows[..., 10:] = np.where(jointed(block.run)[:, None], block.c0[..., 10:], turned)
    found = rigid.placed(block.run, block.x1, block.q1, rows)
    return found[2], found[3]


@once
def swung(block: Block) -> F64:
    """(B, N) impulses by which loads on clumps may be others than their states tell, N s: positions turn levers."""
    clumps, flight, given = block.run.clumps, flights.of_block(block), clump_loads.of_block(block).impulse
    turned = norm(rotation_vector(corrected(block)))
    # Both where the step ends and in what answers contacts there.
    size = 2.0 * (norm(given[..., :3]) + norm(given[..., 3:]) / clumps.reach)
    found = np.zeros((block.count, block.run.bodies))
    found[:, clumps.balls] = np.nan_to_num(np.minimum(turned + flight.off, 2.0) * size)[:, clumps.of]
    return found


def corrected(block: Block) -> F64:
    """(B, C, 4) what turned clumps in the step besides their flights."""
    flight = flights.of_block(block).rows[..., 3:7]
    return np.asarray(product(block.c1[..., 3:7], conjugate(flight)))


def jointed(run: Run) -> Bool:
    """(C,) clumps that joints hold: impacts find the spin of the step's start, and corrections turn no momentum."""
    return np.asarray(run.clumps.over(np.logical_or, run.jointed[None, : run.bodies])[0])


@once
def at_start(block: Block) -> tuple[F64, F64]:
    """(B, C, 3) momenta of the first frames, turned by what corrected positions since, and how far off (B, C) that may be.

    Without loads and joints they are those before impacts. With them they are turned from the end of the flight: by the
    corrections alone where contacts have no loads, that turn a clump and not its momentum.
    """
    run, clumps, flight = block.run, block.run.clumps, flights.of_block(block)
    loads = clump_loads.of_block(block)
    turned = rotated(corrected(block), clumps.momenta(block.c0) + flight.kick - loads.impulse[..., 3:])
    other = before(block).momenta - by_loads(block)
    free = (norm(by_loads(block)) == 0.0)[..., None]
    pressed = np.zeros((block.count, run.bodies + 1), dtype=bool)
    if run.loads_once and run.has_contacts:
        c = block.rows
        rows = np.flatnonzero(norm(loads_once.of_loads(block).remained) > 0.0)
        for body in (c.a[rows], np.minimum(c.b[rows], run.bodies)):
            pressed[c.k[rows], body] = True
    loaded = clumps.over(np.logical_or, pressed[:, : run.bodies])
    off = np.where(loaded & ~free[..., 0], norm(turned - other), 0.0)
    return np.where(free, other, turned), np.where(jointed(run), 0.0, off)


@once
def unsure(block: Block) -> F64:
    """(B, N) by how much the velocities of `turned_on` may be off at any point of a clump with loads or joints, m/s: what
    corrects positions turns what they gave by an angle that is on no record.
    """
    run, clumps, loads = block.run, block.run.clumps, clump_loads.of_block(block)
    flight, given = flights.of_block(block), norm(by_loads(block))
    turned = norm(rotation_vector(corrected(block)))
    angle = np.minimum(turned + flight.off, 2.0)
    found = np.zeros((block.count, run.bodies))
    hidden = np.where(loads.unknown, norm(before(block).momenta - clumps.momenta(block.c0)), 0.0)
    momenta, off = at_start(block)
    each = clumps.reach / clumps.least * (angle * given + loads.slack[..., 1] + hidden + off)
    # Turned by what is not known, the same momentum is another spin.
    apart = clumps.reach * (1.0 / clumps.least - 1.0 / clumps.most)
    each = each + np.where(given > 0.0, apart * norm(momenta) * flight.off, 0.0)
    found[:, clumps.balls] = np.nan_to_num(each)[:, clumps.of]
    return found


def of_block(block: Block) -> tuple[F64, F64]:
    """(B, N) by how much the energy of clumps changes in the step as they turn, where their angular momenta stay, and how
    far that may be off, J: exact where the interval is one whole step, in which the clump stays and it is on record which
    impulses are impacts. It is of the first ball of each.
    """
    run = block.run
    found, off = np.zeros((2, block.count, run.bodies))
    clumps, then = run.clumps, before(block).momenta
    ends = [clumps.momenta(rows) for rows in (block.c0, block.c1)]
    exact = 0.5 * dot(then, clumps.turning(block.c1[..., 3:7], then))
    exact = exact - 0.5 * dot(ends[0], clumps.turning(block.c0[..., 3:7], ends[0]))
    # Work of loads and joints is no turn by itself.
    loads, flight = clump_loads.of_block(block), flights.of_block(block)
    end = clumps.turning(flight.rows[..., 3:7], then)
    exact = exact - 0.5 * dot(by_loads(block), block.c0[..., 10:] + end)
    pushed, turned = (
        clumps.over(np.maximum, of) for of in (recorded.pushes(block)[0], recorded.shifts(block)[1])
    )
    largest = np.maximum(*map(norm, ends)) + clumps.reach * pushed
    angle = np.minimum(turned + flight.off, np.pi)
    most = 0.5 * largest**2 * (1.0 / clumps.least - 1.0 / clumps.most) * angle
    known = block.single[:, None] & block.there[:, clumps.first] & ~loads.unknown
    found[:, clumps.first] = np.where(known, exact, 0.0)
    fast = np.maximum(norm(block.c0[..., 10:]), norm(block.c1[..., 10:]))
    off[:, clumps.first] = np.where(known & run.has_impacts, loads.slack[..., 1] * fast, most)
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
    kinds = np.column_stack([run.clumps.mass, run.clumps.least, run.clumps.most])
    for (mass, least, most), many in zip(*np.unique(kinds, axis=0, return_counts=True), strict=True):
        fastest = np.sqrt(2.0 * motion / least)
        angle = np.where(touched, run.h * np.sqrt(2.0 * motion / lightest * mass / least), 0.0)
        angle = angle + rigid.scheme(fastest, run.h)
        found += many * motion * (most / least - 1.0) * np.minimum(angle, 1.0)
    whole = np.flatnonzero((np.diff(run.step) == 1) & ~run.cut[run.step[1:] - 1])
    exact = np.zeros(len(motion))
    size = max(1, 100_000 // len(run.clumps))
    for first in range(0, len(whole), size):
        mine = whole[first : first + size]
        rows = run.motion_of_clumps(slice(int(mine[0]), int(mine[-1]) + 2))
        old, new = rows[mine - mine[0]], rows[mine - mine[0] + 1]
        exact[run.step[mine]] = np.nansum(rigid.turned_energy(run.clumps, old, new), axis=1)
    at = run.step[whole]
    found[at] = np.maximum(exact[at], 0.0) + 64.0 * EPS * motion[at]
    return found


def lifted(run: Run, motion: F64) -> F64:
    """(S,) what the position correction may lift bodies by, J: by at most the way of a step, against gravity; `motion` (S,)
    is the kinetic energy.
    """
    way = run.h * np.sqrt(2.0 * motion * run.whole_mass)
    return np.where(run.steps["contacts"] > 0, float(norm(run.gravity)) * way, 0.0)


def rolled(run: Run, motion: F64) -> F64:
    """(S,) the same for a clump of one ball, which stays on flat walls that rest, by the impulses that loads gave, J.

    Its ball goes round the centre of mass at the distance `e`, so that the contact moves by `u = w x c`, `|c| = e`, beside
    the centre. Loads leave `u n = 0` at both ends of the step, and act half-way, where `u_0 + u_1` is off by

        u_m = (h/2) (w_0 - w_1) x c' + (h^2/4) w x c''          |c'| <= e w,  |c''| <= e (w' + w^2)

    So an impulse `P` works `P u_m/2`, at most `P h^2 e w (3 w' + w^2)/8`. The way of the contact is a mean of both ends,
    too, off by `h^3/12` of the second derivative of `u`, at most `e (w^3 + 5 w w')`. The position correction takes it back
    against the weight. With `h M g` for `P` that is at most twice the former, taken for both. Here `w' h` is at most
    what `P` and the moments turn, and Euler's equations. Gaps are known to `gap_tolerance`, and contacts may close with the
    closing tolerance.

    Where a contact begins to push, and in the step after an impact, which leaves it opening, `u n` is not 0 at the start.
    Then the correction may lift as it lifts what falls (`lifted`).
    """
    s, clumps, h = run.steps, run.clumps, run.h
    loose = lifted(run, motion)
    if not (run.loads_once and run.has_contacts and run.has_impacts):
        return loose
    push, moment = np.zeros((2, len(motion)))
    begins = np.zeros(len(motion), dtype=bool)
    for block in blocks(run):
        c, steps = block.rows, np.repeat(np.arange(block.count), block.n)
        sums = (np.bincount(c.k, norm(of), minlength=block.count) for of in (c.impulse, c.moment))
        mine = slice(int(block.s0[0]), int(block.s1[-1]))
        push[mine], moment[mine] = (of[steps] for of in sums)
        r = hits.of_block(block)
        begins[r.step[r.problem > 0] - 1] = True
    begins[1:] |= begins[:-1].copy()
    many = s["contacts"]
    begins |= (many > np.append(0, many[:-1])) | (np.append(0.0, push[:-1]) == 0.0)
    reach, arm, mass = float(clumps.reach[0]), float(clumps.arm[0]), float(clumps.mass[0])
    least, most = float(clumps.least[0]), float(clumps.most[0])
    spin = np.sqrt(2.0 * motion / least)
    change = (reach * push + moment) / least + h * (most / least - 1.0) * spin**2
    weight = mass * float(norm(run.gravity))
    closing = run.claimed["closing_tolerance_speed"] * (np.sqrt(2.0 * motion / mass) + reach * spin)
    closing = closing + run.load_share(many) * push * (1.0 / mass + reach**2 / least)
    gaps = weight * run.loosest["gap_tolerance"] * run.radius[clumps.first[0]] * many
    rolls = (push + h * weight) * h * arm * spin * (0.75 * change + 0.25 * h * spin**2)
    return np.where(begins, loose, np.minimum(loose, rolls + push * closing + gaps))
