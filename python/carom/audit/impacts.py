"""Impacts: their impulses and speeds are those of the frames, and Newton's law holds (`replay`), none left out.

Where the frames do not show the state before and after each step, the recorded speeds are held against one another alone:
approach and `V^-` differ by what loads give in a step, and by the impulses of problem 0 that an impact takes back: those
carry at most the whole weight, or what was recorded of them, which is more where balls are jammed. Impacts slower than that
are not judged.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit import answers, bounds, carried, flights, forces, hits, loads_once, recorded, replay
from carom.audit.block import Block
from carom.audit.centres import at_walls, riding
from carom.audit.closing import closing
from carom.audit.cones import struck
from carom.audit.hits import Hits
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Tally
from carom.audit.surfaces import Surface
from carom.audit.vectors import EPS, dot, norm


def judge(block: Block, tally: Tally) -> None:
    """All impacts of a block."""
    run = block.run
    if not run.has_impacts:
        for kind in ("impact", "impact speeds", "impact sum"):
            tally.skip(
                kind, "impacts were not recorded", 'impacts = true in [record], in piles "every"', block.count
            )
        return
    rows = hits.of_block(block)
    _missing(block, tally)
    if not len(rows):
        return
    _begun(block, tally, rows)
    _sign(block, tally, rows)
    _unit(block, tally, rows)
    if run.method == "penalty":
        tally.skip(
            "impact",
            "penalty has a law of forces, of which restitution follows",
            "use nsga or moreau",
            len(rows),
        )
        return
    piled = block.summed[rows.k]
    why = "of piles one row per contact and step was recorded, over several problems"
    tally.skip("impact", why, 'impacts = "every" in [record]', int(piled.sum()))
    for kind in ("impact speeds", "impact sum") if run.method != "events" else ():  # `courses` judges them
        block.skip(tally, kind, "a frame shows the end of several steps", rows.k[~block.single[rows.k]])
    seen = np.flatnonzero(block.single[rows.k])
    group = hits.groups(block, rows.of(seen))
    # Who enters or leaves within a step takes what it gave its neighbours along.
    gone = ~block.stayed(rows.k, rows.a, rows.b)[seen]
    known = np.bincount(group, gone)[group] == 0
    seen, group = seen[known], group[known]
    whole = np.zeros(len(rows), dtype=bool)
    whole[seen] = run.has_contacts
    whole &= ~piled
    _recorded(block, tally, rows.of(~whole & ~piled))
    whole = answers.sure(block, tally, "impact", whole, rows)
    _ends(block, tally, rows.of(seen), group)
    _said(block, tally, rows.of(seen), group)
    remained = np.zeros(len(rows), dtype=bool)
    if run.has_contacts:
        summed = seen[~piled[seen] & block.kept[rows.k[seen]]]
        some = rows.of(summed)
        remained[summed], value, bound = hits.kept(block, some)
        tally.measure("impact sum", value, bound, hits.place(block, some))
    if whole.any():
        replay.judge(block, tally, rows.of(whole), remained[whole], group[whole[seen]])


def _unit(block: Block, tally: Tally, r: Hits) -> None:
    """Normals are unit vectors; after one whole step of nsga those of the places; factors on restitution are shares."""
    run = block.run
    tally.measure("normal", np.abs(norm(r.normal) - 1.0), 16.0 * EPS, hits.place(block, r))
    tally.measure("counts", ~((r.scale >= 0.0) & (r.scale <= 1.0)), 0.0, hits.place(block, r))
    if run.method == "nsga":
        one = r.of(block.single[r.k] & block.stayed(r.k, r.a, r.b))
        other = np.minimum(one.b, run.bodies - 1)
        _, normal = run.meet(block.t1[one.k], one.a, one.b, block.x1[one.k, one.a], block.x1[one.k, other])
        extent = np.abs(block.x1[one.k, one.a]).max(axis=1) + run.radius[one.a]
        extent = extent + run.lengths(block.t1[one.k])
        bound = 16.0 * EPS * (1.0 + extent / run.radius[one.a])
        tally.measure("normal", norm(one.normal - normal), bound, hits.place(block, one))


def _motion(block: Block, r: Hits, *, start: bool = False) -> Rates:
    """At some rows for the velocities of the frame before or after the step, along the recorded normals."""
    run = block.run
    t, normal = block.t0 if start else block.t1, r.normal
    if start and run.loads_once:  # whose openings are those of t_n
        centre = block.x0[r.k, r.a]
        _, normal = run.meet(t[r.k], r.a, r.b, centre, block.x0[r.k, np.minimum(r.b, run.bodies - 1)])
    else:
        centre = at_walls(block, r.k, r.a, r.b, normal, start=start)
    motion = block.motion(r.k, r.a, r.b, start=start)
    image = block.image(r.k, r.a, r.b, end=not start)
    pairs = Pairs(r.a, r.b, t[r.k], centre, normal, not start, image, riding(block, r.k, r.a, start=start))
    return rates(run, pairs, motion, normal, normal)


def _ends(block: Block, tally: Tally, r: Hits, group: I64) -> None:
    """After the last problem of its `group` (`hits.groups`) the pair separates as the frame says. Rows of piles that are
    sums over the step are all of its end: surely those of groups of more contacts than islands have that are no piles.
    """
    run = block.run
    last = np.zeros(group.max(initial=-1) + 1, dtype=np.int64)
    np.maximum.at(last, group, r.problem)
    # Piles have neither clumps nor joints, nor loads that depend on the motion. Which islands have these is not recorded:
    # closed contacts without impulse join them, too.
    free = not (run.clumps or run.answering.any())
    sums = block.summed[r.k] & (hits.pairs(block, r, group) > block.least) & free
    final = r.of((r.problem == last[group]) | (sums & (r.problem > 0)))
    own = compliance(run, final.a, final.b)[0]
    scale = (norm(block.v1) + run.radius * norm(block.w1) + norm(run.gravity) * run.h)[final.k, final.a]
    ball = np.minimum(final.b, run.bodies - 1)
    scale = scale + norm(block.v1)[final.k, ball] + own * norm(final.impulse)
    scale = scale + carried.image_speed(block, final.k, block.image(final.k, final.a, final.b))
    # Speeds are recorded as the solver left them, velocities follow from its impulses.
    squares = np.bincount(r.k, norm(r.impulse) ** 2, minlength=block.count)
    left = 2.0 * own * (8.0 * block.tolerance * np.sqrt(squares))[final.k]
    off = np.abs(final.separation - _motion(block, final).normal)
    tally.measure("impact speeds", off, 640.0 * EPS * scale + left, hits.place(block, final))


def _said(block: Block, tally: Tally, r: Hits, group: I64) -> None:
    """A contact is said to stick, or slip, as its impact is in the last problem of its `group`: in a later one it may have
    had no impulse, and no row.
    """
    run = block.run
    if not run.has_contacts:
        return
    last = np.zeros(group.max(initial=-1) + 1, dtype=np.int64)
    np.maximum.at(last, group, r.problem)
    contact, known = r.contacts(block)
    sure = (
        known
        & (r.problem == last[group])
        & ~block.large[r.k]
        & ~block.cascaded[r.k]
        & ~block.companion[r.k]
        & block.kept[r.k]
    )
    told = block.rows.status[contact[sure]]
    one = r.of(sure)
    tally.measure("slip", np.where(told == one.status, 0.0, norm(one.impulse)), 0.0, hits.place(block, one))


def _missing(block: Block, tally: Tally) -> None:
    """A contact that approached before the step and got an impulse in it had an impact (R2, R3): it is in the table."""
    run, c = block.run, block.rows
    if run.method == "penalty" or run.impact_law.restitution == "printed" or not run.has_contacts:
        return
    judged = block.single & ~block.summed & block.there.all(axis=1) & block.kept
    rows = np.flatnonzero(judged[c.k] & (dot(c.impulse, c.normal) > 0.0) & ~struck(block))
    if not rows.size:
        return
    k, a, b = c.k[rows], c.a[rows], c.b[rows]
    zero = np.zeros(len(rows))
    of_contact = (c.status[rows], c.normal[rows], c.impulse[rows], c.moment[rows])
    one = Hits(k, block.s1[k], k, a, b, *of_contact, zero, zero, zero)
    speed = np.nan_to_num(norm(block.v0) + run.radius * norm(block.w0)).max(axis=1, initial=0.0)
    # Where loads are solved once the islands of these tell who approaches: they may be larger than those of closed contacts.
    islands = "candidates" if run.loads_once else "largest_island"
    top = speed[k] + carried.image_speed(block, k, block.image(k, a, b))
    bound = closing(block, k, a, b, islands) + 64.0 * EPS * top
    tally.measure(
        "impact", np.maximum(0.0, -_motion(block, one, start=True).normal), bound, hits.place(block, one)
    )


def _begun(block: Block, tally: Tally, r: Hits) -> None:
    """A ball alone on a wall has an impact where it closes by more than its closing tolerance (rule R3), not below."""
    run, t = block.run, block.run.loosest
    if run.method != "nsga" or not run.impact_law.loads_first or run.loads or run.joints:
        return
    # From one part of a mesh to the next the weight closes what the loads did not know of.
    still = np.array([not wall.moves and not wall.part for wall in run.walls], dtype=bool)
    alone = block.single & (block.over(run.steps["largest_island"]) == 1) & (carried.jolted(block) == 0.0)
    rows = alone[r.k] & (r.problem == 1) & (r.b >= run.bodies) & block.there[r.k, r.a]
    rows[rows] = still[r.b[rows] - run.bodies]
    why = "which speed a clump closes with is known to what its turn adds in a step"
    tally.skip("approach", why, "a smaller step", int((rows & run.in_clump[r.a]).sum()))
    rows &= ~run.in_clump[r.a]
    one = r.of(rows)
    load, speed = norm(run.gravity) * run.h, (norm(block.v0) + run.radius * norm(block.w0))[one.k, one.a]
    by_speed = t["closing_tolerance_speed"] * np.maximum(speed, load)
    least = np.maximum(run.load_share(np.ones(1, dtype=np.int64)) * load, by_speed)
    short = np.maximum(0.0, least + dot(one.normal, block.v0[one.k, one.a]))
    tally.measure("approach", short, 64.0 * EPS * (speed + load), hits.place(block, one))


def _sign(block: Block, tally: Tally, r: Hits) -> None:
    """Impulses of impacts push, with friction in its cone and at least the recorded speed after as before the law allows."""
    run = block.run
    size = norm(r.impulse)
    left = 4.0 * block.tolerance[r.k] * size + 16.0 * EPS * size
    place = hits.place(block, r)
    loose = block.summed[r.k] | ~block.single[r.k]
    pulled = -dot(r.impulse, r.normal)
    # Rows of piles and of penalty add up impulses while the normal turns: a pull is what points away from it altogether.
    tally.measure("sign", np.maximum(pulled, 0.0), left + np.where(loose, 0.5 * size, 0.0), place)
    if run.friction_varies:
        return
    mu = run.friction(run.law_index(r.a, r.b), np.zeros(len(r)))
    other = np.minimum(r.b, run.bodies - 1)
    _, start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, other])
    impulse = r.impulse
    if run.loads_once:
        first = loads_once.first_normals(run, r.a, r.b, start, r.normal)
        mean = loads_once.along_mean(impulse, first, r.normal)
        impulse = np.where((r.problem == 0)[:, None], mean.stated, impulse)
    parts = forces.split(impulse, r.normal, start)
    excess = np.minimum(*(norm(p.sliding) - mu * np.maximum(p.normal, 0.0) for p in parts))
    whole = np.sqrt(np.bincount(r.k, size * size, minlength=block.count))[r.k]
    bound = 8.0 * block.tolerance[r.k] * whole * (1.0 + mu) + 16.0 * EPS * size
    tally.measure("friction cone", np.maximum(excess, 0.0), bound, place, ~loose)
    if run.method != "penalty":
        # Who has all of the friction that the bound allows slips, and nobody else; rows of piles may be of either frame.
        room = np.stack([mu * np.maximum(p.normal, 0.0) * (1.0 - 1e-12) - norm(p.sliding) for p in parts])
        off = np.select(
            [r.status == 1, r.status == 2], [np.maximum(-room, 0.0), np.maximum(room, 0.0)], np.inf
        )
        sure = ~loose & ~block.cascaded[r.k] & ~block.companion[r.k]
        tally.measure("slip", np.min(off, axis=0), 64.0 * EPS * size, place, sure)


def _recorded(block: Block, tally: Tally, r: Hits) -> None:
    """The law between recorded approach and separation."""
    run = block.run
    if not len(r):
        return
    missing = "" if run.has_contacts else "contacts = true"
    if run.loads or run.joints or run.impact_law.restitution != "newton":
        why = "loads, joints or another law than Newton's stand between the recorded speeds"
        block.skip(tally, "impact", why, r.k, missing)
        return
    block.skip_companions(tally, "impact", r.k)
    r = r.of(~block.companion[r.k])
    index = run.law_index(r.a, r.b)
    e = np.where(r.problem == 0, 0.0, run.restitution(index, -r.approach))
    slow = -r.approach < run.options["restitution_threshold"]
    load = float(norm(run.gravity) * run.h) + flights.speeds_of_turning(block).max(axis=1, initial=0.0)[r.k]
    for w, mine in run.on_walls(r.b):
        wall = run.walls[w]
        if wall.moves:
            load = load + float(_wall_change(block, r.of(mine), wall).max())
    # Both bodies and images go with the flow: what differs is the flow from the one to the other.
    load = load + (carried.strained(block) * 2.0 * run.radius.max())[r.k]
    z = r.separation - r.scale * np.where(slow, 0.0, e) * np.maximum(0.0, -r.approach)
    scaled = (r.scale > 0.0) & (r.scale < 1.0)
    push = np.where(scaled, 0.0, dot(r.impulse, r.normal))
    value = bounds.misfit(z, push, compliance(run, r.a, r.b)[0])
    size = norm(r.impulse)
    whole = np.sqrt(np.bincount(r.k, size * size, minlength=block.count))[r.k]
    fastest = np.nan_to_num(forces.absolute(block)).max(axis=1, initial=0.0)
    least = np.where(block.large, bounds.floor(block, fastest), 0.0)
    left = (8.0 * block.tolerance[r.k] * whole + least[r.k]) * compliance(run, r.a, r.b)[0]
    # An impact takes back what carried the weight above its contact: at most all of it, on the lighter body.
    lightest = np.minimum(run.mass[r.a], np.append(run.mass, np.inf)[np.minimum(r.b, run.bodies)])
    load = load * 2.0 + np.maximum(load * run.whole_mass / lightest, _taken_back(block, r))
    unknown = e * (load + run.options["restitution_threshold"]) + run.rebound(index, -r.approach, load)
    noise = np.abs(r.approach) + np.abs(r.separation)
    noise = noise + carried.image_speed(block, r.k, block.image(r.k, r.a, r.b))
    bound = unknown + left + 64.0 * EPS * noise + _turned(block, r)
    # What loads may have added grows with the weight of all bodies: where it reaches the speeds of the impact, only a value
    # beyond it says anything, and one within it is no proof.
    speed = np.maximum(np.abs(r.approach), np.abs(r.separation))
    blunt = (unknown > 0.0) & (unknown >= speed) & (value <= bound)
    shown = (block.n == 1)[r.k] & run.has_contacts
    why = "loads may have changed the speeds between the recorded ones by more than the speeds of the impact"
    block.skip(tally, "impact", why, r.k[blunt & ~shown], missing)
    block.skip(tally, "impact", why, r.k[blunt & shown])
    sharp = np.flatnonzero(~blunt)
    tally.measure("impact", value[sharp], bound[sharp], hits.place(block, r.of(sharp)))


def _turned(block: Block, r: Hits) -> F64:
    """(K,) m/s by which the recorded speeds of loads that are solved once differ from those of their law, which holds along
    another normal; also of those within steps of `events` in which bodies pressed one another.
    """
    run, other = block.run, np.minimum(r.b, block.run.bodies - 1)
    _, start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, other])
    fast = forces.speeds(block) + recorded.strokes(block)[0] / run.mass
    both = fast[r.k, r.a] + np.where(r.b < run.bodies, fast[r.k, other], 0.0)
    return np.where((r.problem == 0) & run.loads_once_within, norm(r.normal - start) * both, 0.0)


def _taken_back(block: Block, r: Hits) -> F64:
    """(K,) how much the recorded impulses of problem 0 can have changed the relative velocity at a row, m/s."""
    run = block.run
    loads, size = np.flatnonzero(r.problem == 0), norm(r.impulse)
    given, ball = np.zeros(block.count * run.bodies), r.b < run.bodies
    for body, rows in ((r.a, loads), (r.b, loads[ball[loads]])):
        np.add.at(given, r.k[rows] * run.bodies + body[rows], size[rows] / run.mass[body[rows]])
    run.clumps.share(np.add, given.reshape(block.count, -1))  # an impulse on one ball moves all
    other = r.k * run.bodies + np.minimum(r.b, run.bodies - 1)
    return np.asarray(given[r.k * run.bodies + r.a] + np.where(ball, given[other], 0.0))


def _wall_change(block: Block, r: Hits, wall: Surface) -> F64:
    """(K,) by how much the velocity of a wall differs between the ends of a step, at the places where balls meet it, m/s: by
    its change in time; and where it turns, by that rate times the way of the place. That is the way of the ball, and its
    radius times the turn of its normal: by the wall, and along a face of curvature `k` by the way over `1/k - r`.
    """
    run, then = block.run, block.t1[r.k]
    point = np.broadcast_to(wall.point, (len(r), 3))
    change = norm(wall.velocity(then, point, end=True)[1] - wall.velocity(then - run.h, point)[1])
    rate, radius = wall.turning(then), run.radius[r.a]
    way = run.h * forces.speeds(block)[r.k, r.a]
    bend = np.where(wall.curvature * radius < 1.0, wall.curvature / (1.0 - wall.curvature * radius), np.inf)
    with np.errstate(invalid="ignore"):
        turned = np.fmin(2.0, np.where(way > 0.0, way * bend, 0.0) + rate * run.h)
    return np.asarray(change + rate * (way + radius * turned))
