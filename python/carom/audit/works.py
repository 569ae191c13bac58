"""Work of each contact: its impulses by the mean of the velocities before and after the problem that gave them.

    W_N = P_N (G_N V + G_N V')/2        and so of sliding, rolling and spinning, with P_T, M_R and M_S

Over a step they add up over its problems (`replay`). In a group without impacts there is one problem, that of the loads: it
leaves what the frame after the step has, and begins with that less what its impulses gave (`answers`).

Bound: rounding, and what the solver may have left of the velocities for which it has the works (`Block.left`). However small
the impulses are it leaves `tol_r` of the largest speed, or the floor of eq. 44 if that is less.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit import answers, carried, flights, forces, groups, loads_once
from carom.audit.block import Block, Rows
from carom.audit.centres import at_walls, half_way, riding
from carom.audit.hits import Hits
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Tally
from carom.audit.vectors import EPS, across, dot, norm, unit

Motion = tuple[F64, F64, F64, F64]


def done(push: F64, slide: F64, moment: F64, lever: F64, before: Rates, after: Rates) -> F64:
    """(K, 4) works of impulses `push` (K,), `slide` (K, 3) and moments, J: normal, sliding, rolling, spinning."""
    turning, axis = before.turning + after.turning, dot(moment, lever)
    twice = (
        push * (before.normal + after.normal),
        dot(slide, before.slip + after.slip),
        dot(across(moment, lever), turning),
        axis * dot(turning, lever),
    )
    return np.asarray(0.5 * np.stack(twice, axis=1))


def along_mean(
    block: Block, k: I64, p: Pairs, impulse: F64, moment: F64, first: F64, motions: list[Motion]
) -> F64:
    """(K, 4) the same of loads that were solved once: half-way between the normals `first` and `p.foot`."""
    run, middle = block.run, unit(first + p.foot)
    push, slide = loads_once.parts(impulse, middle)
    there = p._replace(centre=half_way(block, k, p.a, p.b)[1], foot=middle)
    before, after = (rates(run, there, motion, middle, middle) for motion in motions)
    return done(push, slide, moment, middle, before, after)


def judge(block: Block, tally: Tally) -> None:
    """Contacts of the groups that had no impact in their step."""
    run, c = block.run, block.rows
    why = ""
    if not run.has_contacts:
        why, cure = "work of contacts was not recorded", "contacts = true in [record]"
    elif run.method == "penalty":
        why, cure = "work within substeps", "use nsga or moreau"
    elif not run.has_impacts:
        why, cure = "which contacts had an impact was not recorded", "impacts = true in [record]"
    if why:
        tally.skip("work", why, cure, block.count)
        return
    quiet = ~groups.struck(block)[c.k, c.a] & block.kept[c.k]
    block.skip(
        tally,
        "work",
        "several steps, or parts of one, lie between the frames",
        c.k[quiet & ~block.single[c.k]],
    )
    quiet &= block.single[c.k] & block.stayed(c.k, c.a, c.b)
    quiet = answers.sure(block, tally, "work", quiet, c)
    rows = np.flatnonzero(quiet)
    if not rows.size:
        return
    k, a, b = c.k[rows], c.a[rows], c.b[rows]
    ball = np.minimum(b, run.bodies - 1)
    normal, moment = c.normal[rows], c.moment[rows]
    centre = at_walls(block, k, a, b, normal)
    image = block.image(k, a, b, end=True)
    pairs = Pairs(a, b, block.t1[k], centre, normal, True, image, riding(block, k, a))

    def motion(of: F64) -> Motion:
        return of[k, a, :3], of[k, a, 3:], of[k, ball, :3], of[k, ball, 3:]

    start = [motion(answers.before_contacts(block, reading)) for reading in (0, 1)]
    end = block.v1[k, a], block.w1[k, a], block.v1[k, ball], block.w1[k, ball]
    impulse, first, values = c.impulse[rows], block.start[1][rows], []
    if run.loads_once:
        first = loads_once.firsts(block)[rows]
        middle = [flights.at_half_way(block, k, a, b, motion) for motion in (start[0], end)]
        found = along_mean(block, k, pairs, impulse, moment, first, middle)
        values.append(np.abs(c.work[rows] - found).max(axis=1))
    else:
        for part, begun in zip(forces.split(impulse, normal, first), start, strict=True):
            before, after = (rates(run, pairs, of, normal, part.lever) for of in (begun, end))
            value = np.abs(c.work[rows] - done(part.normal, part.sliding, moment, part.lever, before, after))
            values.append(value.max(axis=1))
    tally.measure(
        "work",
        np.min(values, axis=0),
        bound(block, c)[rows],
        block.per_pair(k, a, b),
    )


def bound(block: Block, r: Rows | Hits) -> F64:
    """(K,) how far works may be off for impulses of the rows `r`, J."""
    run, other = block.run, np.minimum(r.b, block.run.bodies - 1)
    push, own = norm(r.impulse) + norm(r.moment) / run.radius[r.a], compliance(run, r.a, r.b)
    spin = np.maximum(norm(block.w0), norm(block.w1))
    fast = np.maximum(norm(block.v0), norm(block.v1)) + run.radius * spin + norm(run.gravity) * run.h
    at = fast[r.k, r.a] + fast[r.k, other] + own[1] * push
    at = at + carried.image_speed(block, r.k, block.image(r.k, r.a, r.b))
    left = 2.0 * own[1] * block.left(norm(block.rows.impulse))[r.k]
    of_floor = 2.0 * own[1] * run.heavy.max() * run.loosest["tolerance_floor"]
    missed = np.minimum(block.tolerance[r.k], of_floor) * np.nan_to_num(fast).max(axis=1)[r.k]
    return np.asarray(push * (256.0 * EPS * at + left + missed) + 1e-250)
