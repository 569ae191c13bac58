"""Gaps: nothing overlaps, records are those of the positions, only closed contacts push and none goes on closing."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit import answers, carried, cohesion, flights, forces, hits, loads_once
from carom.audit.block import Block
from carom.audit.cones import PARTS
from carom.audit.loads import of_loads
from carom.audit.near import Near, deepest
from carom.audit.rates import Pairs, compliance, rates
from carom.audit.recorded import pushes
from carom.audit.report import Tally
from carom.audit.vectors import EPS, norm


def penetration(block: Block, near: Near, tally: Tally) -> None:
    """Overlap of every pair at every frame (eq. 14: `g_N >= 0`); bounds: `near.deepest`."""
    run = block.run
    bound = deepest(run, block, near.k, near.a, near.b)
    value = np.maximum(0.0, -near.gap1)
    tally.measure("penetration", value, bound, block.per_pair(near.k, near.a, near.b))


def recorded(block: Block, tally: Tally) -> None:
    """Gap and normal of each recorded contact against those of the positions of its frame.

    They are those of the last step in which the contact was closed, so they can be compared where one whole step lies
    between frames. Bound: 16 roundings of the coordinates, of a normal over the distance of the centres.
    """
    run, c = block.run, block.rows
    off = np.abs(norm(c.normal) - 1.0)
    tally.measure("normal", off, 16.0 * EPS, block.contact)
    if run.method == "penalty":
        for kind in ("gap", "normal"):
            tally.skip(kind, "penalty records them within its substeps", "use nsga or moreau", len(c))
        return
    single = block.single[c.k]
    for kind in ("gap", "normal"):
        block.skip(tally, kind, PARTS, c.k[~single])
    rows = np.flatnonzero(single & block.stayed(c.k, c.a, c.b))  # who has left has no place
    gap, normal = (x[rows] for x in block.end)
    if run.method == "moreau":
        # Frames of Moreau-Jean are those of the middle of the step; its gaps are those of the end.
        normal = _middle(block)[1][rows]
    extent = np.abs(block.x1[c.k, c.a]).max(axis=1)[rows] + run.radius[c.a[rows]]
    extent = extent + run.lengths(block.t1[c.k[rows]])
    place = block.per_pair(c.k[rows], c.a[rows], c.b[rows])
    tally.measure("gap", np.abs(c.gap[rows] - gap), 16.0 * EPS * extent, place)
    smallest = run.radius[c.a[rows]]
    bound = 16.0 * EPS * (1.0 + extent / smallest)
    off = norm(c.normal[rows] - normal)
    # Pairs that only overlap, or that only the projection pushed, keep a frame of their own.
    if run.method == "moreau":
        pushed = norm(c.impulse[rows]) > 0.0
        off, bound = off[pushed], bound[pushed]
        rows = rows[pushed]
    tally.measure("normal", off, bound, place)


def _middle(block: Block) -> tuple[F64, F64]:
    """Gaps and normals of the recorded contacts in the middle of a step, `x + (h/2) v`, walls where they are then."""
    run, c = block.run, block.rows
    x = block.x0 + 0.5 * run.h * block.v0
    other = np.minimum(c.b, run.bodies - 1)
    return run.meet(block.t0[c.k] + 0.5 * run.h, c.a, c.b, x[c.k, c.a], x[c.k, other])


def complementarity(block: Block, tally: Tally) -> None:
    """A contact with an impulse is closed (eqs. 8a, 14): `gap <= touching_tolerance r_c`, or what solvers leave.

    Moreau-Jean asks the middle of the step. Where the step was made in parts, or several lie between the frames, or with
    method penalty, the contact may have opened since: by no more than its bodies can have moved (`forces.speeds`).
    """
    run, c = block.run, block.rows
    if not len(c):
        return
    gap = np.array(block.end[0])
    single = block.single[c.k]
    if run.method == "moreau":
        pushed = norm(c.impulse) > 0.0
        gap = np.where(single & pushed, _middle(block)[0], gap)
    length = np.minimum(run.radius[c.a], run.length[np.minimum(c.b, run.bodies)])
    way = 2.0 * forces.together(block, forces.speeds(block)) * block.dt[c.k]
    for w, wall in enumerate(run.walls):
        mine = c.b == run.bodies + w
        if wall.travels and mine.any():
            at = (c.k[mine], c.a[mine])
            way[mine] += (
                2.0
                * norm(wall.velocity(block.t1[c.k[mine]], block.x1[at], end=True)[0])
                * block.dt[c.k[mine]]
            )
    extent = np.abs(block.x1[c.k, c.a]).max(axis=1) + run.lengths(block.t1[c.k])
    touching = np.maximum(run.loosest["touching_tolerance"] * length + 16.0 * EPS * extent, 0.0)
    bound = np.maximum(touching, np.where(block.large[c.k], block.pile_overlap[c.k] * length, 0.0))
    # Eq. 44 alone prevents gaps from opening. The bound is its residual of `p gap`, p = 0.5/D_cc.
    left = 2.0 * compliance(run, c.a, c.b)[0] * block.left(norm(c.position_impulse))[c.k]
    bound = bound + left
    if (
        run.loads_once
    ):  # loads press where the contact opens by less than they may bring back; positions keep the gap
        of_contacts = forces.of_contacts(block)
        moved = 0.5 * run.h * pushes(block)[0] + of_contacts.shift_size
        fallen = np.concatenate([fall(block), _walls(block)], axis=1).max(axis=1)
        reach = forces.together(block, moved / run.mass) + 2.0 * run.h * fallen[c.k]
        # What an impact has taken all impulses from pushes no more.
        reach[norm(c.impulse) == 0.0] = np.inf
        bound = bound + np.where(
            loads_once.holds_gap(block, of_contacts.shift), run.loosest["gap_tolerance"] * length, reach
        )
    bound = bound + np.where(single, 0.0, way)
    taken = np.zeros(len(c), dtype=bool)
    for w, wall in enumerate(run.walls):
        taken |= (c.b == run.bodies + w) & wall.there(block.t0[c.k]) & ~wall.there(block.t1[c.k]) & ~single
    tally.skip("complementarity", "the wall was taken away between the frames", "every = 1 in [record]",
               int(taken.sum()))  # fmt: skip
    there = block.stayed(c.k, c.a, c.b)
    value = np.maximum(gap, 0.0)
    value = np.where(np.isinf(value), 1e300, value)
    tally.measure("complementarity", value, bound, block.contact, there & ~taken)


def approach(block: Block, near: Near, tally: Tally) -> None:
    """At the end of a step no closed contact closes (eqs. 1f-h, rule 26): `gamma_N >= -tol`.

    `tol` is the closing tolerance (`closing`); what the solver leaves comes on top, `2 D_cc` times that of the impulses.
    Moreau-Jean and penalty leave overlaps that close; they are not judged.
    """
    run = block.run
    if run.method != "nsga":
        tally.skip(
            "approach",
            "holds for nsga alone: others let contacts close after the step",
            "use nsga",
            block.count,
        )
        return
    length = np.minimum(run.radius[near.a], run.length[np.minimum(near.b, run.bodies)])
    rows = np.flatnonzero(near.gap1 <= 0.5 * run.loosest["touching_tolerance"] * length)
    if not rows.size:
        return
    k, a, b = near.k[rows], near.a[rows], near.b[rows]
    ball, normal = np.minimum(b, run.bodies - 1), near.normal1[rows]
    motion = (block.v1[k, a], block.w1[k, a], block.v1[k, ball], block.w1[k, ball])
    image = block.image(k, a, b, end=True)
    pairs = Pairs(a, b, block.t1[k], block.x1[k, a], normal, end=True, image=image)
    found = rates(run, pairs, motion, normal, normal)
    fastest, of_box = _fastest(block), carried.of_block(block).velocity
    left = block.left(norm(block.rows.impulse))[k] * 2.0 * compliance(run, a, b)[0]
    if (
        not run.has_contacts
    ):  # what the solver may leave of impulses is not known, but of what the bodies lost
        change = norm(block.v1 - block.v0 - run.falls * block.dt[:, None, None] - of_box)
        left = 8.0 * (block.tolerance * np.sqrt(np.nansum(change**2, axis=1)))[k]
        if run.has_impacts:  # whose impulses may cancel in a jam
            r = hits.of_block(block)
            struck = np.sqrt(np.bincount(r.k, norm(r.impulse) ** 2, minlength=block.count))
            left = np.maximum(left, 16.0 * (block.tolerance * struck)[k] * compliance(run, a, b)[0])
        if run.clumps:  # which a contact far from the centre moves more than its impulse over the mass
            pushed = np.where(run.in_clump, 0.0, run.mass)[:, None] * (
                block.v1 - block.v0 - run.falls * block.dt[:, None, None] - of_box
            )
            gained = (block.c1 - block.c0)[..., 7:10] - run.gravity * block.dt[:, None, None]
            first = run.clumps.first
            pushed[:, first] = run.clumps.mass[:, None] * (gained - of_box[:, first])
            given = 8.0 * (block.tolerance * np.sqrt(np.nansum(norm(pushed) ** 2, axis=1)))[k]
            left = np.maximum(left, 2.0 * compliance(run, a, b)[0] * given)
        if run.free_walls:  # of which one may be far heavier than the balls that it presses
            pushed = run.mass[:, None] * (block.v1 - block.v0 - run.falls * block.dt[:, None, None])
            pushed = norm(pushed - of_loads(block).impulse[..., :3])
            given = 8.0 * (block.tolerance * np.sqrt(np.nansum(pushed**2, axis=1)))[k]
            left = np.maximum(left, 2.0 * compliance(run, a, b)[0] * given)
    bound = closing(block, k, a, b) + left
    bound = bound + 64.0 * EPS * (fastest[k] + carried.image_speed(block, k, image))
    tally.measure("approach", np.maximum(0.0, -found.normal), bound,
                  lambda i: block.place(int(k[i]), int(a[i]), int(b[i])))  # fmt: skip


def closing(block: Block, k: I64, a: I64, b: I64, contacts: str = "largest_island") -> F64:
    """(K,) closing tolerances of contacts, m/s (rule R3), in islands of at most as many `contacts` as steps say.

    A share of the speed that loads give its own bodies in a step, or its wall, and at least `closing_tolerance_speed` of
    the largest speed.
    """
    run, t = block.run, block.run.loosest
    bodies, walls = fall(block), _walls(block)
    every = np.concatenate([bodies, walls], axis=1)
    own, all_of = np.maximum(bodies[k, a], every[k, run.given(b)]), every.max(axis=1)[k]
    image = block.image(k, a, b)
    # Images of all contacts of an island count, as walls do.
    top, c = np.zeros(block.count), block.rows
    np.maximum.at(top, c.k, carried.image_speed(block, c.k, block.image(c.k, c.a, c.b)))
    np.maximum.at(top, k, carried.image_speed(block, k, image))
    own = np.maximum(own, norm(carried.image_change(block, k, image)))
    all_of = np.maximum(all_of, top[k])
    largest = block.over(run.steps[contacts])[k]
    by_speed = t["closing_tolerance_speed"] * np.maximum(_fastest(block)[k], all_of)
    return np.asarray(np.maximum(run.load_share(largest) * own, by_speed))


def _fastest(block: Block) -> F64:
    """(B,) largest `|v| + r |w|` of a body or clump at either end, m/s."""
    speed = np.maximum(
        norm(block.v0) + block.run.radius * norm(block.w0), norm(block.v1) + block.run.radius * norm(block.w1)
    )
    found = np.nan_to_num(speed).max(axis=1)
    for rows in (block.c0, block.c1):
        fast = norm(rows[..., 7:10]) + block.run.clumps.reach * norm(rows[..., 10:])
        found = np.maximum(found, np.nan_to_num(fast).max(axis=1, initial=0.0))
    return np.asarray(found)


def fall(block: Block) -> F64:
    """(B, N) speed that weight and other loads give each body in a step, m/s."""
    run = block.run
    weight = np.full((block.count, run.bodies), float(norm(run.gravity)) * run.h)
    weight += flights.speeds_of_turning(block) + norm(carried.of_block(block).velocity)
    if not run.loads and not run.joints:
        return weight
    given = of_loads(block)
    of_box = run.mass[:, None] * carried.of_block(block).velocity
    pushed = norm(given.impulse[..., :3] - of_box) + given.slack[..., 0]
    if run.clumps:  # a moment moves what is far from the centre
        first = run.clumps.first
        pushed[:, first] += (norm(given.impulse[:, first, 3:]) + given.slack[:, first, 1]) / run.clumps.reach
        run.clumps.share(np.maximum, pushed)
    walls = slice(run.balls, None)  # whose forces may cancel over several steps
    pushed[:, walls] = np.maximum(pushed[:, walls], given.spread[:, walls, 0])
    pushed = pushed / run.mass / np.maximum(block.n, 1)[:, None]
    if run.joints and run.has_contacts:
        # What joints answer to contacts is in their reactions, and may cancel what they give by themselves.
        alone = norm(answers.before_contacts(block)[..., :3] - block.v0)
        pushed = np.where(block.single[:, None], np.maximum(pushed, alone), pushed)
    return np.asarray(weight + pushed + run.h * cohesion.most(block) / run.mass)


def _walls(block: Block) -> F64:
    """(B, W) change of each moving wall's velocity in a step, m/s."""
    run, found = block.run, np.zeros((block.count, block.run.given_walls))
    for w, wall in enumerate(run.walls[: run.given_walls]):
        if wall.travels:
            p = np.broadcast_to(wall.point, (block.count, 3))
            before = wall.velocity(block.t1 - run.h, p)[1]
            found[:, w] = norm(wall.velocity(block.t1, p, end=True)[1] - before)
    return found
