"""Cohesion: what attracting pairs gave each body in a step, from the frame before it, and their potential (algorithm,
section 13).

`F = f (1 - g/d)` at gaps `0 <= g < d`, `f` in touch. In a step that a pair begins at the gap `g`, opening at `u`, it is the
mean on the way that it leaves the pair, `y = h u - c F`, `c = h^2/2 (1/m_A + 1/m_B)`: with `W` the work of rupture from `g`
on, `y^2 - h u y + c W = 0` where this tears the pair apart, else `F` at the middle of the way. From beyond `d` the
way in `p = -y` has `p^2 - a p - c W' = 0`, with `a` that of the smooth motion alone and `W'` the work from where it ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import carried, free_turns, recorded
from carom.audit.block import Block, once
from carom.audit.covered import uncovered
from carom.audit.data import Run
from carom.audit.rates import Pairs, rates
from carom.audit.vectors import EPS, add_at, norm, unit
from carom.audit.wrenches import groups
from carom.scene.packing.neighbours import pairs as neighbours

RESOLVED = 0.5
"""Share of a way that its own change of the attraction takes, above which the attraction is that of the begin."""


class Cohesive(NamedTuple):
    """Pairs within their rupture distance: number of the frame, bodies, gaps, normals, forces in touch and distances."""

    k: I64
    a: I64
    b: I64
    gap: F64
    normal: F64
    force: F64
    reach: F64

    def of(self, rows: I64) -> Cohesive:
        """Some of them."""
        gap, force, reach = self.gap[rows], self.force[rows], self.reach[rows]
        return Cohesive(self.k[rows], self.a[rows], self.b[rows], gap, self.normal[rows], force, reach)


class Pulls(NamedTuple):
    """Of pairs of whole steps: normals along which they pull, impulses on A (K, 3), N s, and how far off these may be."""

    pairs: Cohesive
    along: F64
    impulse: F64
    slack: F64


def within(run: Run, time: F64, x: F64, beyond: F64 | None = None) -> Cohesive:
    """Pairs of frames with times (B,) and places (B, N, 3), which are no numbers where a body is absent; also of gaps as far
    beyond their distance (B,).
    """
    beyond = np.zeros(len(time)) if beyond is None else beyond
    reaches = beyond + float(np.max(run.model["rupture_distance"]))
    found: list[tuple[I64, I64, I64]] = [(np.zeros(0, np.int64),) * 3]
    frames, balls = np.nonzero(np.isfinite(x[:, : run.balls]).all(axis=2))
    for w, wall in run.parts.meshes.items():
        there = wall.there(time[frames])
        of, who = frames[there], balls[there]
        row, part = run.parts.near(w, wall.local(time[of], x[of, who]), run.radius[who] + reaches[of])
        found.append((of[row], who[row], run.bodies + part))
    for k in range(len(time)):
        here = np.flatnonzero(np.isfinite(x[k, : run.balls]).all(axis=1))
        for w in range(len(run.free_walls)):
            found.append((np.full(len(here), k), here, np.full(len(here), run.balls + w)))
        far = reaches[k]
        if len(here) > 1:
            first, second = neighbours(x[k, here], run.radius[here] + 0.6 * far, run.box.packed(time[k]))
            low, high = (f(here[first], here[second]) for f in (np.minimum, np.maximum))
            found.append((np.full(len(low), k), low, high))
        for w, wall in enumerate(run.walls[: run.given_walls]):
            if wall.mesh is None:
                found.append((np.full(len(here), k), here, np.full(len(here), run.bodies + w)))
    listed, a, b = (np.concatenate(part) for part in zip(*found, strict=True))
    ball = b < run.bodies
    apart = ~(run.held_apart.holds(a, np.minimum(b, run.bodies - 1)) & ball)
    law = run.law_index(a, b)
    force, reach = (np.nan_to_num(run.coefficient(name, law)) for name in ("cohesion", "rupture_distance"))
    ends = (x[listed, a], x[listed, np.minimum(b, run.bodies - 1)])
    gap, normal = uncovered(run, time[listed], listed, a, b, *ends)
    smaller = np.minimum(run.radius[a], run.length[np.minimum(b, run.bodies)])
    gap = np.where(gap <= run.loosest["touching_tolerance"] * smaller, 0.0, gap)
    rows = np.flatnonzero((force > 0.0) & (gap < reach + beyond[listed]) & apart)
    return Cohesive(listed[rows], a[rows], b[rows], gap[rows], normal[rows], force[rows], reach[rows])


def attraction(pairs: Cohesive, gap: F64) -> F64:
    """(K,) N, at other gaps than theirs."""
    return np.asarray(pairs.force * (1.0 - np.clip(gap, 0.0, pairs.reach) / pairs.reach))


def rupture(pairs: Cohesive, gap: F64) -> F64:
    """(K,) J, the work that takes them apart from other gaps than theirs."""
    left = pairs.reach - np.clip(gap, 0.0, pairs.reach)
    return np.asarray(0.5 * pairs.force * left**2 / pairs.reach)


def potential(run: Run, time: F64, x: F64) -> tuple[F64, F64]:
    """(B,) potential energy of frames, J, and its rounding."""
    if not run.cohesive:
        return np.zeros(len(time)), np.zeros(len(time))
    pairs = within(run, time, x)
    extent = np.abs(x[pairs.k, pairs.a]).max(axis=1) + run.radius[pairs.a]
    extent = extent + run.lengths(time[pairs.k])
    rounding = pairs.force * (16.0 * EPS * extent + run.loosest["touching_tolerance"] * run.radius[pairs.a])
    of = [np.bincount(pairs.k, each, minlength=len(time)) for each in (-rupture(pairs, pairs.gap), rounding)]
    return np.asarray(of[0]), np.asarray(of[1])


@once
def pulls(block: Block) -> Pulls:
    """Of the pairs that begin a whole step within their distance, or would come within it."""
    run, h = block.run, block.run.h
    walls = run.top_wall_speeds.max(initial=0.0)
    nearer = h * (2.0 * np.nan_to_num(carried.own(block)).max(axis=1, initial=0.0) + walls)
    widest = 2.0 * run.radius.max(initial=0.0) + float(np.max(run.model["rupture_distance"]))
    nearer = nearer + h * h * norm(run.gravity) + carried.strain(block) * widest
    if len(run.loads) > 1:  # the smooth motion has the way of other loads, which contacts may take back
        x, off = free_turns.loaded_places(block)
        nearer = nearer + 2.0 * (np.nan_to_num(norm(x - free_turns.places(block))) + off).max(axis=1)
    pairs = within(run, block.t0, block.x0, nearer)
    opening = _opening(block, pairs)
    along, end, off = _smooth(block, pairs)
    near = np.minimum(pairs.gap, end - off) < pairs.reach * (1.0 + 1e-9)
    rows = np.flatnonzero(block.single[pairs.k] & near & ~_gone(block, pairs))
    pairs, along = pairs.of(rows), along[rows]
    k, a, opening, end, off = pairs.k, pairs.a, opening[rows], end[rows], off[rows]
    image = block.image(k, a, pairs.b)
    inverse = sum(free_turns.inverse_mass(block, k, body, along) for body in (a, pairs.b))
    free, per_force = h * opening, 0.5 * h * h * inverse
    now, work = attraction(pairs, pairs.gap), rupture(pairs, pairs.gap)
    left = free**2 - 4.0 * per_force * work
    torn = 0.5 * (free + np.sqrt(np.maximum(left, 0.0)))
    leaves = (opening > 0.0) & (left > 0.0) & (torn >= pairs.reach - pairs.gap)
    change = 0.5 * per_force * pairs.force / pairs.reach
    resolved = change < RESOLVED
    way = np.where(
        resolved, (free - per_force * now) / np.where(resolved, 1.0 - change, 1.0), np.minimum(free, 0)
    )
    force = 0.5 * (now + attraction(pairs, pairs.gap + way))
    force = np.where(leaves, work / np.where(leaves, torn, 1.0), force)
    outside = pairs.gap >= pairs.reach
    in_way = _way_in(pairs.gap - pairs.reach, pairs.gap - end, np.where(resolved, change, 0.0))
    in_way = np.where(outside, np.minimum(in_way, pairs.gap), 1.0)
    force = np.where(outside, rupture(pairs, pairs.gap - in_way) / in_way, force)
    answered, doubt = _answered(block, pairs)
    touched = rupture(pairs, np.zeros(len(k))) - work
    until = 0.5 * (free + np.sqrt(free**2 + 4.0 * per_force * touched)) / per_force
    force = np.where(answered, force, np.minimum(force, until))
    turned = np.minimum(1.0, off / run.radius[a])
    extent = np.abs(block.x0[k, a]).max(axis=1) + run.radius[a] + run.lengths(block.t0[k])
    extent = extent + h * carried.image_speed(block, k, image)
    unsure = 64.0 * EPS * extent + run.loosest["touching_tolerance"] * run.radius[a]
    unsure = unsure + np.where(outside, off, 0.0)
    # Where nothing comes in, or nothing answers it, a rounding tells whether all of it acts.
    edge = (run.method == "moreau") & (np.abs(pairs.gap - pairs.reach) <= unsure) | doubt
    root = (unsure + np.sqrt(pairs.force * unsure * per_force)) / per_force
    unsure = np.where(answered, unsure, np.maximum(unsure, pairs.reach * root / pairs.force))
    unsure = np.where(edge, pairs.reach, np.minimum(unsure, pairs.reach))
    slack = h * pairs.force * (unsure / pairs.reach + turned + 64.0 * EPS * (1.0 + extent / run.radius[a]))
    return Pulls(pairs, along, -(h * force)[:, None] * along, slack)


def _gone(block: Block, pairs: Cohesive) -> Bool:
    """(K,) pairs with a wall that is not there any more in the step."""
    run, found = block.run, np.zeros(len(pairs.k), dtype=bool)
    on_wall = np.flatnonzero(pairs.b >= run.bodies)
    of = run.given(pairs.b[on_wall]) - run.bodies
    time = block.t0[pairs.k[on_wall]] + 0.5 * run.h
    for w in np.unique(of).tolist():
        mine = of == w
        found[on_wall[mine]] = ~run.walls[w].there(time[mine])
    return found


def _answered(block: Block, pairs: Cohesive) -> tuple[Bool, Bool]:
    """(K,) whether a contact may answer what pulls in the step, or it acts until they touch; and where a rounding tells: of
    Moreau-Jean only those are closed that touch in the middle of the step.
    """
    run = block.run
    if run.method != "moreau" or run.projects:
        return np.ones(len(pairs.k), dtype=bool), np.zeros(len(pairs.k), dtype=bool)
    k, a, b = pairs.k, pairs.a, np.minimum(pairs.b, run.bodies - 1)
    x = block.x0 + 0.5 * run.h * block.v0
    gap, _ = run.meet(block.t0[k] + 0.5 * run.h, a, pairs.b, x[k, a], x[k, b])
    least, most = (f(run.held_to("touching_tolerance")) for f in (min, max))
    smaller = np.minimum(run.radius[a], run.length[np.minimum(pairs.b, run.bodies)])
    noise = 16.0 * EPS * (np.abs(x[k, a]).max(axis=1) + run.radius[a] + run.lengths(block.t0[k]))
    return gap <= most * smaller, (gap > least * smaller - noise) & (gap < most * smaller + noise)


def _opening(block: Block, pairs: Cohesive) -> F64:
    """(K,) m/s, how fast they open at the first frame."""
    run, k, a, b = block.run, pairs.k, pairs.a, np.minimum(pairs.b, block.run.bodies - 1)
    motion = (block.v0[k, a], block.w0[k, a], block.v0[k, b], block.w0[k, b])
    image = block.image(k, a, pairs.b)
    at = Pairs(a, pairs.b, block.t0[k], block.x0[k, a], pairs.normal, end=False, image=image)
    return rates(run, at, motion, pairs.normal, pairs.normal).normal


def _way_in(beyond: F64, free: F64, change: F64) -> F64:
    """(K,) m, how far pairs come nearer that begin so far beyond their distance."""
    half = 0.5 * free - change * beyond
    root = np.sqrt(half**2 + (1.0 - change) * change * beyond**2)
    return np.asarray(np.where(free > beyond, (half + root) / (1.0 - change), beyond))


def _smooth(block: Block, pairs: Cohesive) -> tuple[F64, F64, F64]:
    """(K, 3) normals along which they pull, of the middle of the step, (K,) gaps at the end of it without attraction, and by
    how much bodies may be elsewhere then, m. Of Moreau-Jean nothing comes in: gaps are those of the begin.
    """
    run, h = block.run, block.run.h
    k, a, b = pairs.k, pairs.a, np.minimum(pairs.b, run.bodies - 1)
    if run.method == "moreau":
        x = block.x0 + 0.5 * h * block.v0
        _, normal = run.meet(block.t0[k] + 0.5 * h, a, pairs.b, x[k, a], x[k, b])
        return normal, pairs.gap, np.zeros(len(k))
    x, off = free_turns.loaded_places(block)
    off = off + _handed_on(block, pairs)
    end, last = run.meet(block.t1[k], a, pairs.b, x[k, a], x[k, b])
    one = run.jointed[a] | (run.jointed[b] & (pairs.b < run.bodies))
    middle = np.where(one[:, None] | (not run.loads_once), last, unit(pairs.normal + last))
    return middle, end, off[k, a] + np.where(pairs.b < run.bodies, off[k, b], 0.0)


def _handed_on(block: Block, pairs: Cohesive) -> F64:
    """(B, N) m, by how much joints move bodies at most as they hand on what pairs and contacts give in a step: as long as
    nothing does, they end elsewhere by that (`corrections`).
    """
    run, half = block.run, 0.5 * block.run.h**2
    found, pulled = np.zeros((2, block.count, run.bodies))
    if not run.joints:
        return found
    for body in (pairs.a, pairs.b):
        ball = np.flatnonzero(body < run.bodies)
        add_at(pulled, (pairs.k[ball], run.node[body[ball]]), half * pairs.force[ball])
    way, turned = recorded.shifts(block)
    reach = np.where(run.in_clump, run.node_reach, 0.0)
    push, moment = pulled + run.mass * way, reach * pulled + run.inertia * turned
    energy = push**2 / run.heavy + moment**2 / run.node_inertia
    give = 1.0 / run.heavy + reach**2 / run.node_inertia
    for bodies, _ in groups(run):
        moved = np.isin(run.node, bodies)
        found[:, moved] = np.sqrt(energy[:, bodies].sum(axis=1)[:, None] * give[run.node[moved]])
    return found


@once
def most(block: Block) -> F64:
    """(B, N) force that cohesion may have had on each body in several steps: of the pairs of both frames, N."""
    run = block.run
    found = np.zeros((block.count, run.bodies))
    if run.cohesive:
        for time, x in ((block.t0, block.x0), (block.t1, block.x1)):
            pairs = within(run, time, x)
            for body in (pairs.a, pairs.b):
                ball = body < run.bodies
                np.add.at(found, (pairs.k[ball], body[ball]), pairs.force[ball])
    return np.where(block.single[:, None], 0.0, found)


@once
def on_bodies(block: Block) -> tuple[F64, F64]:
    """(B, N, 3) impulses of cohesion in whole steps, N s, and (B, N) how far they may be off."""
    found, off = np.zeros((block.count, block.run.bodies, 3)), np.zeros((block.count, block.run.bodies))
    if block.run.cohesive:
        (pairs, _, impulse, slack), bodies = pulls(block), block.run.bodies
        for body, sign in ((pairs.a, 1.0), (pairs.b, -1.0)):
            ball = body < bodies
            add_at(found, (pairs.k[ball], body[ball]), sign * impulse[ball])
            add_at(off, (pairs.k[ball], body[ball]), slack[ball])
    return found, off
