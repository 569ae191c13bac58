"""Loads of a step that were solved once, for velocities and positions (the default; algorithm, section 12).

Impulses `P0` of the loads act in the frame half-way between those at both ends of the step, `Gm`: its normal is `n_0 + n_1`
over its length, and its tangents are those of `n_0` turned the shortest way. The laws of contact hold of their components,
in the frame of `n_1`. Positions follow half of the velocities that they give,

    x' = x + h v + h^2 g/2 + (h/2) W0 + M^-1 (nu - (h/2) P0_N) n,      W0 = M^-1 Gm^T P0

which the recorded position impulses tell as one. Contacts of balls with joints have one frame, that of `n_1`. An impact
takes `P0` of its contacts back, positions keep them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import carried, cohesion, free_turns, groups, hits, recorded
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.formula import law
from carom.audit.vectors import add_at, cross, dot, norm, unit

#: Share of a position impulse above which its normal part is one: frames turn within the step, and lend it less of friction.
SURELY = 1e-2


class Mean(NamedTuple):
    """Impulses (K, 3) in the frame half-way between two."""

    normal: F64
    """Their normal components, (K,)."""
    stated: F64
    """The impulses of the same components in the frame of the second normal."""
    arm: F64
    """What is `n x P_T` where there is one frame: moments are `-r` times it."""


def along_mean(impulse: F64, first: F64, second: F64) -> Mean:
    """Impulses in the frame half-way between those of the normals `first` and `second`, (K, 3) each."""
    middle = unit(first + second)
    normal, slide = parts(impulse, middle)
    both = middle + second
    stated = impulse - (dot(impulse, both) / (1.0 + dot(middle, second)))[:, None] * both
    stated += 2.0 * normal[:, None] * second
    return Mean(normal, stated, np.asarray(cross(middle, slide)))


def first_normals(run: Run, a: I64, b: I64, start: F64, end: F64) -> F64:
    """(K, 3) `n_0` of contacts with these normals at both ends of the step."""
    jointed = np.append(run.jointed, False)
    one = jointed[a] | jointed[np.minimum(b, run.bodies)]
    return np.where(one[:, None], end, start)


@once
def firsts(block: Block) -> F64:
    """(K, 3) `n_0` of the recorded contacts."""
    c = block.rows
    return first_normals(block.run, c.a, c.b, block.start[1], c.normal)


def parts(impulse: F64, normal: F64) -> tuple[F64, F64]:
    """(K,) and (K, 3): the part of impulses along a unit normal, and the rest."""
    along = dot(impulse, normal)
    return along, impulse - along[:, None] * normal


class Loads(NamedTuple):
    """Impulses and moments of the loads at each recorded contact that no impact took back, (K, 3) each."""

    remained: F64
    remained_moment: F64


@once
def of_loads(block: Block) -> Loads:
    """Of a group without impacts all that it has, else the rows of problem 0."""
    c, run = block.rows, block.run
    if not run.has_impacts:
        return Loads(c.impulse, c.moment)
    r, alone = hits.of_block(block), ~groups.struck(block)[c.k, c.a, None]
    remained, moment = (np.where(alone, of, 0.0) for of in (c.impulse, c.moment))
    contact, known = r.contacts(block)
    rows = known & (r.problem == 0) & hits.kept(block, r)[0]
    add_at(remained, (contact[rows],), r.impulse[rows])
    add_at(moment, (contact[rows],), r.moment[rows])
    return Loads(remained, moment)


@once
def stated(block: Block) -> tuple[F64, F64]:
    """(K, 3) recorded impulses and moments as laws of contact have them: of one frame, that of the recorded normal."""
    c = block.rows
    if not block.run.loads_once:
        return c.impulse, c.moment
    loads, first = of_loads(block), firsts(block)
    return (
        c.impulse - loads.remained + along_mean(loads.remained, first, c.normal).stated,
        c.moment - loads.remained_moment + along_mean(loads.remained_moment, first, c.normal).stated,
    )


def unsure(block: Block, problems: int) -> F64:
    """(K,) rad by which recorded impulses may be turned against the frame of the loads, since those of impacts act along the
    last normal. 0 where it is on record which ones those are, and in steps of no more than so many problems: in a step
    with one problem the impulses of a group are all of impacts or all of loads.
    """
    c, run = block.rows, block.run
    if run.has_impacts or not run.loads_once:
        return np.zeros(len(c))
    hit = block.over(run.steps["impact_problems"])[c.k] > problems
    return np.where(hit, norm(unit(firsts(block) + c.normal) - c.normal), 0.0)


def arms(block: Block) -> tuple[F64, F64]:
    """(K, 3) `n x P_T` of the recorded impulses; if those of a group may all be of impacts, a second reading as such."""
    c, loads = block.rows, of_loads(block).remained
    of_impacts = cross(c.normal, c.impulse - loads)
    of_loads_too = np.asarray(of_impacts + along_mean(loads, firsts(block), c.normal).arm)
    return of_loads_too, of_loads_too if block.run.has_impacts else np.asarray(cross(c.normal, c.impulse))


class Turns(NamedTuple):
    """What turned the bodies of each contact at the position level."""

    arm: F64
    """(K, 3) `n x` what moved them across the frame of the loads, N s^2."""
    unknown: F64
    """(K,) by how much that may be off, N s^2."""
    again: F64
    """(K,) and which share of what loads change by where they are solved again (`loads.solved_again`)."""


def turns(block: Block, shift: F64) -> Turns:
    """What moved a contact's bodies is `(h/2) P0` in the frame of the loads, and the rest along its last normal. Across that
    normal the rest is what loads have changed by since, but for the share of its frame's normal.

    Where `P0` is not on record, or joints and loads that depend on the motion may have moved the bodies too, all of it is
    taken for the loads. So it is after a fallback: jammed spheres have many loads, and those of velocities, which are on
    record, may be others than those of positions.
    """
    c, run = block.rows, block.run
    first, then = solved_at(block, shift)
    middle = unit(first + then)
    loads, known = _of_step(block)
    normal, slide = parts(loads, unit(first + c.normal))
    both = middle + unit(first + c.normal)
    slide = slide - (dot(slide, both) / (0.5 * dot(both, both)))[:, None] * both  # turned the shortest way
    slide = 0.5 * run.h * slide
    rest = c.position_impulse - slide - (0.5 * run.h * normal)[:, None] * middle
    closed, across = parts(rest, c.normal)
    slide = slide + across
    apart = norm(cross(middle, c.normal))
    return Turns(
        np.where(known[:, None], cross(middle, slide), along_mean(c.position_impulse, first, then).arm),
        # A jam may multiply what its loads change by; the whole correction of its gaps is then theirs.
        np.where(known, apart * np.abs(closed), unknown_across(block, shift)),
        np.where(known, apart, 1.0),
    )


def _of_step(block: Block) -> tuple[F64, Bool]:
    """(K, 3) impulses of the loads of a whole step, those that impacts took back too, and whether they are on record, with
    the normals that they had.
    """
    c, run = block.rows, block.run
    if not run.has_impacts:
        return c.impulse, np.zeros(len(c), dtype=bool)
    r, struck = hits.of_block(block), groups.struck(block)[c.k, c.a]
    found = np.where(struck[:, None], 0.0, c.impulse)
    contact, known = r.contacts(block)
    rows = known & (r.problem == 0)
    rows[rows] = struck[contact[rows]]
    add_at(found, (contact[rows],), r.impulse[rows])
    answers = np.append(run.answering, False)
    moved = answers[c.a] | answers[np.minimum(c.b, run.bodies)]
    sure = block.single & (block.over(run.steps["fallbacks"]) == 0)
    return found, sure[c.k] & ~moved & ~(struck & block.summed[c.k])


def holds_gap(block: Block, shift: F64) -> Bool:
    """(K,) whether positions were corrected along the normal of a contact: part of what moved its bodies surely is. A normal
    that turned since the loads lends it part of theirs, also where positions have taken nearly all of that back.
    """
    c = block.rows
    first, then = solved_at(block, shift)
    middle, size = unit(first + then), norm(c.position_impulse)
    normal, turned = dot(c.position_impulse, middle), norm(middle - c.normal)
    lent = turned * np.maximum(size, 0.5 * block.run.h * norm(c.impulse))
    return np.asarray(normal > SURELY * size + lent + (block.left(size) + block.floor)[c.k])


def unknown_across(block: Block, shift: F64) -> F64:
    """(K,) N s^2 by how much the part across the frame of the loads of what moved bodies is not known. Where a contact has
    opened since, what loads moved it by along the normal was taken back along another one.
    """
    c, run = block.rows, block.run
    first, then = solved_at(block, shift)
    gained = norm(block.v1 - block.v0 - carried.of_block(block).velocity)
    by_loads = norm(c.impulse) + run.heavy[c.a] * (norm(run.gravity) * run.h + gained[c.k, c.a])
    by_loads = by_loads + _through(block)[c.k]
    size = 0.5 * run.h * by_loads * norm(unit(first + then) - c.normal)
    return np.where(holds_gap(block, shift), 0.0, size)


def _through(block: Block) -> F64:
    """(B,) N s at most that free walls press on through balls in a step: their forces, their weights, and what they lost."""
    run, found = block.run, np.zeros(block.count)
    for w, wall in enumerate(run.free_walls):
        force = np.maximum(*(np.abs(law(wall.force, time)[0]) for time in (block.t0, block.t1)))
        lost = norm(block.v1 - block.v0)[:, run.balls + w]
        found += run.h * force + wall.mass * (run.h * float(norm(run.gravity)) + lost)
    return found


def _put_back(block: Block, shift: F64) -> F64:
    """(B, N, 3) balls of clumps without the ways that position impulses (B, N, 3) gave these, to first order; others as they
    are.
    """
    run, clumps, c, x = block.run, block.run.clumps, block.rows, block.reached.copy()
    other = np.minimum(c.b, run.bodies)
    own = [run.reach[body][:, None] * cross(c.position_impulse, c.normal) for body in (c.a, other)]
    moments = recorded.of_bodies(block, c, *(own[0] + c.position_moment, own[1] - c.position_moment))
    levers = clumps.levers(block.c1)
    moments[:, clumps.balls] += cross(levers, shift[:, clumps.balls])
    way = clumps.sum(shift) / clumps.mass[:, None]
    turn = clumps.turning(block.c1[..., 3:7], clumps.sum(moments))
    x[:, clumps.balls] -= way[:, clumps.of] + cross(turn[:, clumps.of], levers)
    return x


def solved_at(block: Block, shift: F64) -> tuple[F64, F64]:
    """Both normals (K, 3) of the frame of the loads; `shift` (B, N, 3) is all that moved a body since they were solved, but
    for attraction, and a clump since its free flight.
    """
    c, run = block.rows, block.run
    pulled = 0.5 * run.h * cohesion.on_bodies(block)[0]
    x, other = block.reached - (shift + pulled) / run.mass[:, None], np.minimum(c.b, run.bodies - 1)
    if run.clumps:
        free = free_turns.places(block)
        x = np.where(run.in_clump[:, None] & np.isfinite(free), free, x)
        held = run.in_clump & run.loaded
        if held.any():  # what loads and joints moved them by is not so well on record
            x = np.where(held[:, None], _put_back(block, shift + pulled), x)
    _, then = run.meet(block.t1[c.k], c.a, c.b, x[c.k, c.a], x[c.k, other])
    return first_normals(run, c.a, c.b, block.start[1], then), then
