"""Impulses in their cones, and maximum dissipation: friction against the slip at its bound, moments against the rolling.

    Lambda_N >= 0,  |Lambda_T| <= mu Lambda_N,  |M_R| <= rho Lambda_N,  |M_S| <= delta Lambda_N
    Lambda_T = -mu Lambda_N z/|z| where z != 0                                                   (eqs. 15, 16, 18, 23)

Solvers satisfy them up to `Block.left`. An impulse gathered over several steps lies in the cone of its last normal
widened by the angle by which the normal has turned (`forces.turn`): cones are convex, and so are their sums.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import carried, flights, forces, groups, loads_once, recorded, works
from carom.audit.block import Block, once
from carom.audit.bounds import floor, gain
from carom.audit.centres import at_walls, riding
from carom.audit.data import Run
from carom.audit.loads import turned_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Tally
from carom.audit.vectors import EPS, across, dot, norm, unit

#: Share of its bound from which on friction is said to slip, less than 1 by this much.
ALMOST = 1e-9
#: Share of `closing_tolerance_speed` by which normals may turn before loads are solved again, rad.
KEPT = 0.1
PARTS = "several steps, or parts of one, lie between the frames"


def judge(block: Block, tally: Tally) -> None:
    """Signs, cones and directions of the recorded contacts."""
    if not block.run.has_contacts:
        for kind in ("sign", "friction cone", "rolling cone", "spinning cone", "slip", "roll"):
            tally.skip(
                kind, "impulses of contacts were not recorded", "contacts = true in [record]", block.count
            )
        return
    c = block.rows
    if not len(c):
        return
    mu = friction(block)
    levels = [loads_once.stated(block)]
    if block.run.loads_once:
        _pushed(block, tally)
    elif block.run.method == "nsga":
        levels.append((c.position_impulse, c.position_moment))
    for impulse, moment in levels:
        _cones(block, tally, mu, impulse, moment)
    _directions(block, tally, mu)


def _pushed(block: Block, tally: Tally) -> None:
    """Positions that follow loads are corrected along normals alone: what moves the bodies pushes. Its friction is that of
    the loads, across the normal half-way between those where they were solved; where they were solved again, half-way
    between both ends of the step.
    """
    c, first = block.rows, loads_once.firsts(block)
    size = norm(c.position_impulse)
    angle = np.maximum(norm(c.normal - block.start[1]), np.where(block.single[c.k], 0.0, forces.turn(block)))
    solved = unit(np.add(*loads_once.solved_at(block, forces.of_contacts(block).shift)))
    pushed = np.maximum(*(dot(c.position_impulse, of) for of in (solved, unit(first + c.normal))))
    pulled = -pushed - 0.5 * angle * size
    # Where positions take back what loads had moved, what is left is what eq. 44 leaves however small it is.
    bound = (block.left(size) + block.floor)[c.k] + 16.0 * EPS * size
    bound = bound + np.where(block.piled[c.k], forces.bent(block)[c.k, c.a], 0.0)
    tally.measure("sign", np.maximum(pulled, 0.0), bound, block.contact)


def friction(block: Block) -> F64:
    """(K,) mu of each contact: that of the slip at the start of the step, or the largest of all speeds that may have
    occurred where several steps or parts of one lie between the frames. NaN where there is no law.
    """
    run, c = block.run, block.rows
    index = run.law_index(c.a, c.b)
    if not run.friction_varies:
        return run.friction(index, np.zeros(len(c)))
    lever = block.start[1]
    slip = norm(_rates(block, lever, lever, start=True).slip)
    mu = run.friction(index, slip)
    loose = ~block.single[c.k]
    if loose.any():
        speed = forces.speeds(block) * 2.0
        ball = np.minimum(c.b, run.bodies - 1)
        spin = np.maximum(norm(block.w0), norm(block.w1)) * run.radius * 4.0
        top = (speed + spin)[c.k, c.a] + (speed + spin)[c.k, ball]
        most = np.max([run.friction(index, share * top) for share in np.linspace(0.0, 1.0, 65)], axis=0)
        mu = np.where(loose, np.maximum(mu, most), mu)
    return mu


def _rates(block: Block, normal: F64, lever: F64, *, start: bool = False) -> Rates:
    run, c = block.run, block.rows
    t, motion = block.t0 if start else block.t1, block.motion(c.k, c.a, c.b, start=start)
    centre = block.x0[c.k, c.a] if start else at_walls(block, c.k, c.a, c.b, normal)
    image = block.image(c.k, c.a, c.b, end=not start)
    pairs = Pairs(c.a, c.b, t[c.k], centre, normal, not start, image, riding(block, c.k, c.a, start=start))
    return rates(run, pairs, motion, normal, lever)


def _cones(block: Block, tally: Tally, mu: F64, impulse: F64, moment: F64) -> None:
    run, c = block.run, block.rows
    size = norm(impulse)
    left = block.left(size)[c.k] + 16.0 * EPS * size
    # Of the whole impulse some part, itself in the cone, may act along the other normal.
    left = left + np.sqrt(1.0 + np.square(np.nan_to_num(mu))) * size * loads_once.unsure(block, 0)
    angle = np.where(block.single[c.k], 0.0, forces.turn(block))
    angle = np.where(angle > 0.0, np.maximum(angle, norm(c.normal - block.start[1])), 0.0)
    parts = forces.split(impulse, c.normal, block.start[1])
    judged = angle < 0.5 * np.pi
    for kind in ("sign", "friction cone"):
        why = "the normal may have turned by more than a right angle between frames"
        block.skip(tally, kind, why, c.k[~judged])
    # A normal that turned by `angle` makes of a push at most so much of a pull.
    pulled = np.minimum(*(-p.normal for p in parts)) - size * np.sin(np.minimum(angle, 0.5 * np.pi))
    tally.measure("sign", np.maximum(pulled, 0.0), left, block.contact, judged)
    wide = np.arctan(mu) + angle
    slope = np.where(wide < 0.5 * np.pi - 1e-3, np.tan(np.minimum(wide, 0.5 * np.pi - 1e-3)), np.inf)
    with np.errstate(invalid="ignore"):
        excess = np.minimum(
            *(norm(p.sliding) - np.where(p.normal > 0.0, slope * p.normal, 0.0) for p in parts)
        )
    excess = np.where(np.isinf(slope) | (norm(impulse) == 0.0), 0.0, excess)
    bound = left * (1.0 + np.where(np.isfinite(slope), slope, 0.0))
    noise = _regularised(block)
    bound = bound + noise[0]
    tally.measure("friction cone", np.maximum(excess, 0.0), bound, block.contact, judged)
    index = run.law_index(c.a, c.b)
    for kind, name in (("rolling cone", "rolling_radius"), ("spinning cone", "spinning_radius")):
        radius = run.coefficient(name, index)
        if not norm(moment).any() and not radius.any():
            continue
        # Of the whole normal impulse: a turned normal has not made it more than its length.
        pushed = np.where(angle > 0.0, size, np.maximum(*(p.normal for p in parts)))
        spins = [np.abs(dot(moment, p.lever)) for p in parts]
        rolls = [norm(across(moment, p.lever)) for p in parts]
        # Moments of several steps may cancel: each is at most that of both radii.
        both = sum(run.coefficient(of, index) for of in ("rolling_radius", "spinning_radius"))
        turned = np.maximum(norm(moment), both * size) * np.sin(np.minimum(angle, 0.5 * np.pi))
        value = np.minimum(*(rolls if kind == "rolling cone" else spins)) - turned
        bound = left * np.maximum(radius, 0.0) + left * run.radius[c.a] + 16.0 * EPS * norm(moment) + noise[1]
        tally.measure(kind, np.maximum(value - radius * pushed, 0.0), bound, block.contact)


def _regularised(block: Block) -> tuple[F64, F64]:
    """(K,) rounding of frictions, N s, and of moments, N m s, of method penalty: each half of a substep has them from the
    difference of the speeds before and after, hence to a rounding of the momenta; 0 for others.
    """
    run, c = block.run, block.rows
    if run.method != "penalty":
        return np.zeros(len(c)), np.zeros(len(c))
    fast, spin = _within(block)
    halves = 4.0 * EPS * block.updates[c.k]
    return halves * forces.together(block, run.mass * fast), halves * forces.together(
        block, run.inertia * spin
    )


def _within(block: Block) -> tuple[F64, F64]:
    """(B, N) bounds on how fast surfaces go, m/s, and bodies spin, rad/s, within intervals."""
    run = block.run
    spin = np.maximum(norm(block.w0), norm(block.w1)) + recorded.pushes(block)[1] / run.inertia
    return np.asarray(forces.speeds(block) + run.radius * spin), np.asarray(spin)


@once
def struck(block: Block) -> Bool:
    """(K,) contacts that took part in an impact of their interval: its law is another (`impacts`)."""
    run, c = block.run, block.rows
    table = run.result.impacts
    step = run.impact_step
    low, high = np.searchsorted(step, [block.s0[0] + 1, block.s1[-1] + 1])
    body = run.pairs(table, int(low), int(high))
    k = np.searchsorted(block.s1, step[low:high])
    many = len(run.names)
    return np.isin((c.k * many + c.a) * many + c.b, (k * many + body[:, 0]) * many + body[:, 1])


def _directions(block: Block, tally: Tally, mu: F64) -> None:
    """In a whole step without an impact at the contact its impulse is of one problem, with `z` the velocity at the end."""
    run, c = block.run, block.rows
    if run.method == "penalty":
        why = "penalty smooths friction over the slip speeds of its substeps"
        tally.skip("slip", why, "use nsga or moreau", len(c))
        return
    single = block.single[c.k]
    block.skip(tally, "slip", PARTS, c.k[~single])
    if not run.has_impacts:
        tally.skip(
            "slip", "which contacts had an impact was not recorded", "impacts = true in [record]", len(c)
        )
        return
    index = run.law_index(c.a, c.b)
    odd = (run.impact_law.restitution == "printed") & (
        run.coefficient("tangential_restitution", index) != 0.0
    )
    tally.skip(
        "slip",
        "the printed law restores slip in every problem",
        "impact = sequence",
        int((single & odd).sum()),
    )
    # Later problems of a pile may change the impulse of a contact that has no row in the table.
    quiet = ~block.summed | (block.over(run.steps["impact_problems"]) <= 1)
    why = "piles do not record which contacts took part in later impact problems"
    tally.skip("slip", why, 'impacts = "every" in [record]', int((single & ~quiet[c.k]).sum()))
    block.skip_companions(tally, "slip", c.k[single])
    odd = odd | ~quiet[c.k] | block.companion[c.k] | ~block.stayed(c.k, c.a, c.b)
    hit = struck(block)
    impulse = loads_once.stated(block)[0]
    size = norm(impulse)
    judged = single & ~odd & ~hit & (size > 0.0)
    if not judged.any():
        return
    left = block.left(size)[c.k] + 16.0 * EPS * size
    left = left + turned_loads(block, c.k, loads_once.firsts(block), c.normal)
    fastest = (np.nan_to_num(forces.absolute(block))).max(axis=1, initial=0.0)
    left = left + np.where(block.large, floor(block, fastest), 0.0)[c.k]
    defects, bounds = [], []
    of_images = carried.image_speed(block, c.k, block.image(c.k, c.a, c.b))
    fast, spin = (kept(run) * forces.together(block, np.nan_to_num(of)) for of in _within(block))
    for part in forces.split(impulse, c.normal, block.start[1]):
        found = _rates(block, c.normal, part.lever)
        push = np.maximum(part.normal, 0.0)
        scale = np.maximum(*(norm(v[c.k, c.a]) + run.radius[c.a] * norm(w[c.k, c.a]) for v, w in
                             ((block.v0, block.w0), (block.v1, block.w1))))  # fmt: skip
        scale = scale + of_images
        noise = 64.0 * EPS * scale + fast
        own = compliance(run, c.a, c.b)
        still = 2.0 * own[1] * left + noise
        defect = opposed(part.sliding, found.slip, mu * push, still)
        # Who is said to stick does not slip, and who is said to slip has all of its friction. Who slips may have a little
        # less, as much as the solver may leave, and is said to stick then.
        short = np.maximum(0.0, mu * push - norm(part.sliding))
        nearly = (short > ALMOST * mu * push) & (short <= left * (1.0 + mu))
        moving = np.maximum(0.0, norm(found.slip) - still) / own[1] * ((mu > 0.0) & ~nearly)
        told = np.select([c.status == 1, c.status == 2], [moving, short], np.inf)
        defects.append(np.maximum(defect, told))
        bounds.append(left * (1.0 + mu))
    best = np.argmin([d / np.maximum(b, 1e-300) for d, b in zip(defects, bounds, strict=True)], axis=0)
    value, bound = (np.where(best == 0, x[0], x[1]) for x in (defects, bounds))
    tally.measure("slip", value, bound, block.contact, judged)
    _turning(block, tally, judged, left, spin)


def kept(run: Run) -> float:
    """Share of speeds by which a motion may be off: loads are not solved again where their normals turned by next to nothing
    since. Their impulses turn with these, what they hold does not: attraction, and the speeds before.
    """
    return 2.0 * KEPT * run.loosest["closing_tolerance_speed"] * run.loads_once


def opposed(force: F64, slip: F64, most: F64, still: F64) -> F64:
    """How far a friction (K, 3) is from `-most slip/|slip|`, beyond what a slip error of `still` may turn or weaken it.

    A slip below `still` may as well be none: then the cone alone binds, and the defect is 0.
    """
    speed = norm(slip)
    moving = speed > still
    wanted = -most[:, None] * np.divide(slip, speed[:, None], out=np.zeros_like(slip), where=moving[:, None])
    allowed = 2.0 * most * np.minimum(1.0, np.divide(still, speed, out=np.ones_like(speed), where=moving))
    return np.where(moving, np.maximum(0.0, norm(force - wanted) - allowed), 0.0)


def _turning(block: Block, tally: Tally, judged: Bool, left: F64, off: F64) -> None:
    run, c = block.run, block.rows
    found = []
    impulse, moment = loads_once.stated(block)
    for part in forces.split(impulse, c.normal, block.start[1]):
        turning = _rates(block, c.normal, part.lever).turning
        noise = 64.0 * EPS * norm(block.w1[c.k, c.a]) + off
        found.append(turned(run, (c.a, c.b), (part.normal, moment, part.lever), turning, left, noise))
    value = np.minimum(*(of.value for of in found))
    tally.measure("roll", value, found[0].bound, block.contact, judged & found[0].any)


class Turned(NamedTuple):
    """How far moments are from their bounds against the motion, N m s, and how far they may be; whether there is a law."""

    value: F64
    bound: F64
    any: Bool


def turned(
    run: Run, pair: tuple[I64, I64], given: tuple[F64, F64, F64], turning: F64, left: F64, noise: F64
) -> Turned:
    """Maximum dissipation of rolling and spinning (eqs. 18, 23) for given normal impulses (K,), moments and levers (K, 3),
    and the relative angular velocity after them; `left` is that of the solver, N s, `noise`, rad/s, what else may be off.
    """
    (a, b), (normal, moment, n) = pair, given
    push = np.maximum(normal, 0.0)
    index = run.law_index(a, b)
    rho, delta = (run.coefficient(name, index) for name in ("rolling_radius", "spinning_radius"))
    still = 2.0 * compliance(run, a, b)[2] * left * run.radius[a] + noise
    roll = opposed(across(moment, n), across(turning, n), rho * push, still)
    spun = opposed(dot(moment, n)[:, None] * n, dot(turning, n)[:, None] * n, delta * push, still)
    value = np.where(rho > 0.0, roll, 0.0) + np.where(delta > 0.0, spun, 0.0)
    return Turned(value, left * (run.radius[a] + rho + delta), (rho > 0.0) | (delta > 0.0))


def passivity(block: Block, tally: Tally) -> None:
    """The contacts of a group do no work together (rule R4): each impact problem may gain 1e-10 of the kinetic energy by
    rounding, problems of piles a hundredth of tol_r, and the problem of the loads `tol_r` of the work itself.
    """
    run, c = block.run, block.rows
    if not run.has_contacts:
        tally.skip(
            "passivity", "work of contacts was not recorded", "contacts = true in [record]", block.count
        )
        return
    if not run.guarded:
        tally.skip("passivity", "the run lets impacts gain energy", "energy_safeguard = true", block.count)
        return
    columns = c.work
    if run.method == "penalty":
        if run.options["penalty_friction"] == "spring":
            cure = "penalty_friction = regularised"
            tally.skip("passivity", "springs of friction give back what they hold", cure, block.count)
            return
        columns = c.work[:, 1:]  # normal forces give back what they took: between frames they may do work
    n, redone = run.bodies + 1, groups.redone(block)[c.k, c.a]
    # In whole steps the replay of impacts has the sum that counts.
    hidden = np.unique(c.k[redone & ~(block.single[c.k] & run.has_impacts)])
    block.skip(tally, "passivity", groups.REDONE, hidden, "" if run.has_impacts else "impacts = true")
    rows = np.flatnonzero(block.kept[c.k] & ~redone)
    group, mine = np.unique(groups.labels(block)[c.k, c.a][rows], return_inverse=True)
    k = group // n
    # Works of loads that are solved once are those along the mean of two normals, and along the last one they do none.
    turned = norm(c.impulse) * norm(c.normal - block.start[1]) * forces.together(block, forces.speeds(block))
    # So do loads of clumps, which act half-way.
    spin = _within(block)[1]
    turned = turned + norm(c.impulse) * forces.together(block, norm(flights.half_way(block)[:, :-1]) * spin)
    stepped = (run.method != "events") | (block.total(run.steps["stepped"]) > 0.0)
    once = run.loads_once_within & stepped[c.k]
    # Joints hold to the tolerance, and what they push against that is work.
    held = np.where(groups.held(block)[c.k, c.a], works.bound(block, c), 0.0)
    given = columns.sum(axis=1), np.abs(columns).sum(axis=1), turned * once + held
    work, size, off = (np.bincount(mine, of[rows], minlength=len(group)) for of in given)
    problems = block.total(run.steps["impact_problems"] + 1.0)[k]
    top = block.over(run.steps["energy_kinetic"])[k]
    bound = problems * gain(block)[k] * top + block.tolerance[k] * size + 64.0 * EPS * (size + top) + off
    tally.measure(
        "passivity",
        np.maximum(work, 0.0),
        bound,
        lambda i: block.place(int(k[i]), *_of_group(block, int(group[i]))),
    )


def _of_group(block: Block, group: int) -> list[int]:
    """The first body of a group; none of what works from outside."""
    body = group % (block.run.bodies + 1)
    return [body] if body < block.run.bodies else []
