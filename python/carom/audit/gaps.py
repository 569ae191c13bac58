"""Gaps: nothing overlaps, records are those of the positions, only closed contacts push and none goes on closing."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import carried, forces, hits, loads_once
from carom.audit.block import Block
from carom.audit.closing import closing, fastest, given
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

    Moreau-Jean asks the middle of the step, and what loads may close besides. Where the step was made in
    parts, or several lie between the frames, or with method penalty, the contact may have opened since: by no more than its
    bodies can have moved (`forces.speeds`).
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
    for w, mine in run.on_walls(c.b):
        wall = run.walls[w]
        if wall.travels:
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
        fallen = given(block).max(axis=1)
        reach = forces.together(block, moved / run.mass) + 2.0 * run.h * fallen[c.k]
        # What an impact has taken all impulses from pushes no more.
        reach[norm(c.impulse) == 0.0] = np.inf
        bound = bound + np.where(
            loads_once.holds_gap(block, of_contacts.shift), run.loosest["gap_tolerance"] * length, reach
        )
    if run.method == "moreau":
        loads = given(block)
        loads = np.maximum(loads[c.k, c.a], loads[c.k, run.given(c.b)])
        bound = bound + run.h * (loads + 0.5 * closing(block, c.k, c.a, c.b, "candidates"))
    bound = bound + np.where(single, 0.0, way)
    taken = np.zeros(len(c), dtype=bool)
    for w, mine in run.on_walls(c.b):
        first, last = (run.walls[w].there(time[c.k[mine]]) for time in (block.t0, block.t1))
        taken[mine] = first & ~last & ~single[mine]
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
    of_box = carried.of_block(block).velocity
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
    bound = bound + 64.0 * EPS * (fastest(block)[k] + carried.image_speed(block, k, image))
    tally.measure("approach", np.maximum(0.0, -found.normal), bound,
                  lambda i: block.place(int(k[i]), int(a[i]), int(b[i])))  # fmt: skip
