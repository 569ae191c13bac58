"""Centres and orientations follow from velocities, loads and position impulses; momentum and spin from impulses.

In one step of the nonsmooth generalized-alpha scheme (eqs. 5a-b, 6a-b; weight alone) with the recorded multipliers

    x' = x + h v + h^2 g/2 + sum nu/m          m (v' - v) = m g h + sum Lambda
    R' = exp(psi) R, psi = h w + sum l x nu/I  I (w' - w) = sum l x Lambda + couples,   l = -r n

and of Moreau-Jean `x' = x + h (theta v' + (1 - theta) v) + sum nu/m`. Momentum adds up over any number of steps. A way does
not: over several steps, or parts of one, a body is free to be where its recorded impulses, each at any time of the interval,
can have brought it: within `2 dt sum |Lambda|/m` of free flight, twice as impulses of turning normals cancel in their sum.

Bounds: `M U = G^T nu` is solved to the tolerance of eq. 44 (`Block.left`, `Block.floor`); velocities are sums of impulses to
rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import answers, arms, carried, forces, loads_once, recorded, rigid
from carom.audit.block import Block
from carom.audit.centres import passed_half_way, ways_half_way
from carom.audit.cohesion import on_bodies, pulls
from carom.audit.cones import PARTS
from carom.audit.forces import Sums
from carom.audit.loads import Loads, of_loads, solved_again
from carom.audit.report import Place, Tally
from carom.audit.vectors import (
    EPS,
    add_at,
    conjugate,
    cross,
    exponential,
    norm,
    product,
    rotation_vector,
    unit,
)
from carom.audit.wrenches import groups, memory

CONTACTS = "impulses of contacts were not recorded; bodies in free flight were judged"
RECORD = "contacts = true in [record]"


@dataclass
class Ways:
    """How far clumps are off their laws of ways and turns."""

    off: list[F64]
    """(B, C, 6) m and rad, by either reading of the moments."""
    bound: F64
    """(B, C, 2) how far they may be."""


def judge(block: Block, tally: Tally, free: Bool, of_clumps: Ways | None) -> None:
    """`free` (B, N): bodies that cannot have touched anything; without recorded contacts only they are judged. Joints take
    away from `of_clumps` what they may give, together with that of other bodies.
    """
    run = block.run
    sums, loads = forces.of_contacts(block), of_loads(block)
    known = block.there & ~loads.unknown
    if run.has_contacts:
        lost = known & ~block.kept[:, None] & ~free
        for kind in ("momentum", "spin", "position", "rotation"):
            tally.skip(
                kind,
                "the last frame of a run that stopped early has no impulses",
                "resume the run",
                lost.sum(),
            )
        known &= block.kept[:, None] | free
    else:
        free = untouched(block, free)
        of_walls = _momentum_of_walls(block, tally, loads, known)
        for kind in ("momentum", "spin", "position", "rotation"):
            unseen = known & ~free
            if kind != "position":
                unseen[:, run.balls :] &= ~of_walls & (kind == "momentum")
            tally.skip(kind, CONTACTS, RECORD, int(unseen.sum()))
        known &= free
        known[:, run.balls :] &= ~of_walls
    hidden = np.nonzero(block.there & loads.unknown)[0]
    if run.opaque:
        cure = "judge the run with a load that a scenario can hold"
        tally.skip("momentum", f"the Python load {run.opaque[0]} is in no file", cure, len(hidden))
    else:
        block.skip(tally, "momentum", "cohesion, springs and drag: " + PARTS, hidden)
    known = known & ~run.in_clump  # whose clumps have the momenta (`clumps`)
    _momentum(block, tally, sums, loads, known)
    # A contact whose multiplier vanishes within the tolerance is not on record; what it left of a correction is.
    touched = (sums.count > 0) | (~free & (sums.count > 0).any(axis=1, keepdims=True))
    turning = known & (np.arange(run.bodies) < run.balls)  # nothing turns a free wall
    _spin(block, tally, sums, loads, turning, touched)
    ways, way_bound = _position(block, tally, sums, loads, touched)
    turns, turn_bound = _rotation(block, sums, loads, touched)
    bound = np.stack([way_bound, turn_bound], axis=-1)
    off = [np.concatenate([ways, turn], axis=-1) for turn in turns]
    if of_clumps is not None:
        bound[:, run.clumps.first] = of_clumps.bound
        for one, other in zip(off, of_clumps.off, strict=True):
            one[:, run.clumps.first] = other
    found = [answers.unheld(block, one, bound, loads.shift_held) for one in off]
    if of_clumps is not None:
        of_clumps.off = [one[:, run.clumps.first] for one, _ in found]
        of_clumps.bound = found[0][1][:, run.clumps.first]
    for k, kind in enumerate(("position", "rotation")):
        value = np.minimum(*(norm(off[..., 3 * k : 3 * k + 3]) for off, _ in found))
        tally.measure(
            kind, value, found[0][1][..., k], block.per_body, turning if kind == "rotation" else known
        )


def untouched(block: Block, free: Bool) -> Bool:
    """(B, N) the `free` bodies, of those that joints hold together only if all are, and were until the filter of the scheme
    has forgotten it: joints hand on what contacts give.
    """
    run, found = block.run, free.copy()
    steps = run.steps
    touched = np.flatnonzero((steps["contacts"] > 0) | (steps["impact_problems"] > 0) | run.cut) + 1.0
    before = touched[touched <= block.s0[0]].max(initial=-np.inf)
    kept = memory(run)
    long = np.log(EPS**2) / np.log(kept) if kept > 0.0 else 0.0
    for bodies, _ in groups(run):
        last = np.where(free[:, bodies].all(axis=1), -np.inf, block.s1)
        since = block.s0 - np.maximum(np.maximum.accumulate(last), before)
        found[:, bodies] = (since >= long)[:, None]
    return found


def rounding(block: Block) -> F64:
    """(B, N) roundings that may have gathered: a few for every step, or substep; and of piles those of every sweep, which
    adds the change of each contact and what goes on of the last one, of three contacts a ball or more.
    """
    swept = np.where(block.large, 16.0, 1.0)  # larger islands add impulses in many sweeps, which may cancel
    sums = block.total(block.run.steps["sweeps_position"] + block.run.steps["sweeps_velocity"])
    count = 2.0 * np.maximum(3.0, forces.of_contacts(block).count)
    return np.asarray(EPS * ((swept * (8.0 + 2.0 * block.updates))[:, None] + count * sums[:, None]))


def largest(block: Block) -> F64:
    """(B, 1) largest impulse of a contact in each interval, N s: sums and cancellations in sweeps have its rounding."""
    found = np.zeros(block.count)
    np.maximum.at(found, block.rows.k, norm(block.rows.impulse))
    return found[:, None]


def _momentum(block: Block, tally: Tally, s: Sums, loads: Loads, known: Bool) -> None:
    run = block.run
    m = run.mass[:, None]
    weight = m * run.falls * block.dt[:, None, None]
    value = norm(m * (block.v1 - block.v0) - weight - loads.impulse[..., :3] - s.impulse)
    bound = rounding(block) * _momenta(block, s, loads) + loads.slack[..., 0]
    tally.measure("momentum", value, bound, block.per_body, known)


def _momenta(block: Block, s: Sums, loads: Loads) -> F64:
    """(B, N) N s, the sizes of all that a velocity is the sum of, and may cancel in it, times mass."""
    m = block.run.mass
    weight = m * norm(block.run.falls) * block.dt[:, None]
    ends = m * (norm(block.v0) + norm(block.v1))
    return np.asarray(ends + weight + loads.size[..., 0] + s.size + largest(block))


def _recorded_on_walls(block: Block) -> F64 | None:
    """(B, W, 6) what contacts gave all walls in each interval, N s and N m s; None where it was not recorded."""
    segments = block.run.result._segments
    if "walls" not in segments.columns("frames"):
        return None
    return np.asarray(segments.column("frames", "walls")[block.first : block.first + block.count])


def _of_wall(block: Block, body: int, k: int) -> Place:
    """The place of a body at the end of an interval."""
    return block.place(k, body)


def _momentum_of_walls(block: Block, tally: Tally, loads: Loads, known: Bool) -> Bool:
    """Without recorded contacts: the momentum of each free wall, from the impulse on it. (B, F) where it was judged."""
    run, given = block.run, _recorded_on_walls(block)
    if given is None or not run.free_walls:
        return np.zeros((block.count, len(run.free_walls)), dtype=bool)
    judged = known[:, run.balls :] & block.kept[:, None]
    attracted = on_bodies(block)[0]  # which the impulse on the wall has
    for w, wall in enumerate(run.free_walls):
        body, m = run.balls + w, wall.mass
        speeds = block.v0[:, body] @ wall.normal, block.v1[:, body] @ wall.normal
        of_contacts = given[:, w, :3] @ wall.normal
        of_load = (loads.impulse[:, body, :3] - attracted[:, body]) @ wall.normal
        weight = m * float(run.falls[body] @ wall.normal) * block.dt
        value = np.abs(m * (speeds[1] - speeds[0]) - weight - of_load - of_contacts)
        size = m * (np.abs(speeds[0]) + np.abs(speeds[1])) + np.abs(weight) + loads.size[:, body, 0]
        bound = rounding(block)[:, body] * (size + norm(given[:, w, :3])) + loads.slack[:, body, 0]
        tally.measure("momentum", value, bound, partial(_of_wall, block, body), judged[:, w])
    return judged


def _spin(block: Block, tally: Tally, s: Sums, loads: Loads, known: Bool, touched: Bool) -> None:
    run = block.run
    inertia = run.inertia[:, None]
    turned = arms.turned(block)
    change = inertia * (block.w1 - block.w0) - loads.impulse[..., 3:] - turned.moment
    value = np.minimum(*(norm(change - moment) for moment in s.moments))
    size = inertia[:, 0] * (norm(block.w0) + norm(block.w1)) + loads.size[..., 1] + s.moment_size
    # Moments that cancel in the sweeps over a contact were as large as those of the weight.
    size = size + np.where(touched, run.radius * run.mass * norm(run.gravity), 0.0) * block.dt[:, None]
    size = size + np.where(touched, run.radius * largest(block), 0.0)
    bound = rounding(block) * size + loads.slack[..., 1] + s.turned + turned.off
    tally.measure("spin", value, bound, block.per_body, known)


def _position(block: Block, tally: Tally, s: Sums, loads: Loads, touched: Bool) -> tuple[F64, F64]:
    """(B, N, 3) by how much centres are off, m, and may be, (B, N)."""
    run = block.run
    dt, g = block.dt[:, None, None], run.falls
    smooth = loads.shift[..., :3]
    moreau = run.method == "moreau"
    theta = float(run.options["theta"])
    # Free flight of n steps: sum of h (theta v_{k+1} + (1 - theta) v_k) for Moreau-Jean, exact else.
    lag = (theta - 0.5) * run.h if moreau else 0.0
    flight = dt * block.v0 + (0.5 * dt * dt + lag * dt) * g + smooth
    # The theta rule holds with impulses too, in whole steps.
    whole = dt * (theta * block.v1 + (1.0 - theta) * block.v0) + smooth if moreau else flight
    single = block.single
    way = np.where(single[:, None, None], whole, flight) + s.shift / run.mass[:, None]
    size = norm(block.x0) + norm(block.x1) + block.dt[:, None] * _momenta(block, s, loads) / run.mass
    size = size + np.where(s.count > 0, run.radius, 0.0)  # gaps are differences of lengths
    size = size + s.shift_size / run.mass
    given = norm(loads.impulse[..., :3] - run.mass[:, None] * carried.of_block(block).velocity)
    given = (given + loads.spread[..., 0]) / run.mass * block.dt[:, None]
    known = single[:, None] | ((np.arange(run.bodies) >= run.balls) & ~block.cut[:, None])
    bound = rounding(block) * size + loads.shift_slack[..., 0] + np.where(known, 0.0, given)
    if moreau and run.has_contacts:  # along which normal a projection moved a ball that left is on no record
        c = block.rows
        off = np.where(block.stayed(c.k, c.a, c.b), 0.0, norm(c.position_impulse) * forces.turn(block))
        bound += recorded.of_bodies(block, c, off, off) / run.mass
    # Parts of a step are shorter, and lag the less.
    bound += np.where(block.cut, abs(lag) * block.dt * float(norm(g).max(initial=0.0)), 0.0)[:, None]
    if run.method == "penalty":  # it has no position level
        c = block.rows
        given = norm(c.position_impulse) / run.mass[c.a]
        tally.measure("position", given, 0.0, block.contact)
    left = block.left(norm(block.rows.position_impulse)) + block.floor
    left = left[:, None] / run.mass
    reach = 2.0 * (recorded.strokes(block)[0] * block.dt[:, None] + s.shift_size) / run.mass
    turned = np.where(block.piled[:, None], forces.bent(block) / run.mass, 0.0)
    bound = bound + np.where(touched, left + turned + np.where(single[:, None], 0.0, reach), 0.0)
    return block.x1 - block.x0 - way, bound


def _rotation(block: Block, s: Sums, loads: Loads, touched: Bool) -> tuple[list[F64], F64]:
    """(B, N, 3) by how much orientations are off, rad, by either reading of the moments, and may be, (B, N)."""
    run = block.run
    dt = block.dt[:, None, None]
    inertia = run.inertia[:, None]
    moreau = run.method == "moreau"
    theta = float(run.options["theta"])
    whole = dt * (theta * block.w1 + (1.0 - theta) * block.w0) if moreau else dt * block.w0
    single = block.single
    psi = np.where(single[:, None, None], whole, dt * block.w0) + loads.shift[..., 3:]
    turned = product(block.q1, conjugate(block.q0))
    found = [
        rotation_vector(product(conjugate(exponential(psi + m / inertia)), turned)) for m in s.shift_moments
    ]
    bound = rounding(block) * (4.0 + norm(dt * block.w0)) + loads.shift_slack[..., 1]
    bound = bound + (s.shift_turned + s.shift_again * solved_again(block)[:, None]) / inertia[:, 0]
    bound = bound + np.where(
        single[:, None],
        0.0,
        (norm(loads.impulse[..., 3:]) + loads.spread[..., 1]) / inertia[:, 0] * block.dt[:, None],
    )
    size = norm(block.rows.position_impulse) * run.radius[block.rows.a] + norm(block.rows.position_moment)
    left = (block.left(size)[:, None] + block.floor[:, None] * run.radius) / inertia[:, 0]
    left = left + np.where(block.piled[:, None], forces.bent(block) * run.radius / inertia[:, 0], 0.0)
    struck = recorded.strokes(block)[1] * block.dt[:, None]
    reach = 2.0 * (struck + s.shift_size * run.radius) / inertia[:, 0]
    bound = bound + np.where(touched, left + np.where(single[:, None], 0.0, reach), 0.0)
    return found, bound


def walls(block: Block, tally: Tally) -> None:
    """Impulses on walls (where recorded) are those of their contacts, with the opposite sign.

    Bound: rounding of sums of as many terms as there are steps and contacts.
    """
    run, c = block.run, block.rows
    if not run.walls and not run.free_walls:
        return
    given = _recorded_on_walls(block)
    if given is None:
        tally.skip("wall impulse", "impulses on walls were not recorded", "walls = true in [record]")
        return
    if not run.has_contacts:
        _whole_momentum(block, tally, given)
        return
    summed, size = np.zeros((*given.shape[:2], 3)), np.zeros(given.shape[:2])
    rows = c.b >= run.balls
    at = (c.k[rows], run.wall_number(c.b[rows]))
    add_at(summed, at, -c.impulse[rows])
    add_at(size, at, norm(c.impulse[rows]))
    known = np.ones(block.count, dtype=bool)
    if run.cohesive:
        known = block.single
        block.skip(tally, "wall impulse", "cohesion: " + PARTS, np.flatnonzero(~known))
        pairs, _, impulse, slack = pulls(block)
        pulled = pairs.b >= run.balls
        at = (pairs.k[pulled], run.wall_number(pairs.b[pulled]))
        add_at(summed, at, -impulse[pulled])
        add_at(size, at, norm(impulse[pulled]) + slack[pulled] / EPS)
    value = norm(given[..., :3] - summed)
    bound = (
        EPS
        * (16.0 + 2.0 * block.updates)[:, None]
        * size
        * np.sqrt(1.0 + np.bincount(c.k, minlength=block.count))[:, None]
    )
    judged = np.broadcast_to((block.kept & known)[:, None], value.shape)
    tally.measure("wall impulse", value, bound, block.per_wall, judged)
    _wall_moments(block, tally, given, rows)


def _wall_moments(block: Block, tally: Tally, given: F64, rows: Bool) -> None:
    """Moments about the places of the walls, after one step alone: impacts act at its end, loads half-way through it.

    So does all that Moreau-Jean has. Where impacts are not on record, either may be the lever.
    """
    run, c = block.run, block.rows
    judged = block.single & block.kept & (run.method in ("nsga", "moreau"))
    if run.method in ("nsga", "moreau"):
        block.skip(tally, "wall moment", PARTS, np.flatnonzero(~judged))
    else:
        tally.skip("wall moment", f"contacts move within the step of {run.method}", "use nsga", block.count)
    k, a, b = c.k[rows], c.a[rows], run.wall_number(c.b[rows])
    judged = np.repeat(judged[:, None], given.shape[1], axis=1)
    gone = ~block.there[k, a]  # whose place is not known
    judged[k[gone], b[gone]] = False
    centre, back = (np.zeros((len(k), 3)) for _ in range(2))
    for w in range(given.shape[1]):
        mine = np.flatnonzero(b == w)
        centre[mine], back[mine] = _levers(block, w, k[mine], a[mine])
    r, impulse, normal = run.radius[a][:, None], c.impulse[rows], c.normal[rows]
    first, loads = normal, impulse if run.method == "moreau" else np.zeros_like(impulse)
    if run.loads_once:
        first, loads = loads_once.firsts(block)[rows], loads_once.of_loads(block).remained[rows]
    lever, half_way = centre - r * normal, centre - back - r * unit(first + normal)
    summed, size = np.zeros((*given.shape[:2], 3)), np.zeros(given.shape[:2])
    add_at(summed, (k, b), -cross(half_way, loads) - cross(lever, impulse - loads) - c.moment[rows])
    extent = norm(lever) + norm(block.x1[k, a]) + run.radius[a]
    given_in_all = norm(loads) + norm(impulse - loads)
    add_at(size, (k, b), extent * given_in_all + norm(c.moment[rows]))
    # Which part of it the loads are is on record with impacts alone, and to what solvers leave.
    slack = np.zeros(given.shape[:2])
    hit = block.over(run.steps["impact_problems"])[k] > 0
    known = block.tolerance[k] if run.has_impacts else 1.0
    unknown = np.where(hit & run.loads_once, known, 0.0)
    # One problem after the loads may push without an impact; what moved no place is of either.
    either = hit & run.loads_once & (not run.impact_law.loads_first)
    unknown[either & ~c.position_impulse[rows].any(axis=1)] = 1.0
    add_at(slack, (k, b), unknown * norm(half_way - lever) * norm(impulse))
    if run.cohesive:
        _pulled_moments(block, summed, size)
    value, bound = norm(given[..., 3:] - summed), 64.0 * EPS * size + slack
    tally.measure("wall moment", value, bound, block.per_wall, judged)


def _levers(block: Block, w: int, k: I64, a: I64) -> tuple[F64, F64]:
    """(K, 3) from the point of wall `w` to centres at the ends of intervals `k`, and what led there since half-way."""
    run, free = block.run, len(block.run.free_walls)

    def place(t: F64, x: F64) -> F64:
        if w < free:
            return np.asarray(run.free_walls[w].point + x[k, run.balls + w])
        return run.walls[w - free].place(t[k])

    start, end = place(block.t0, block.x0), place(block.t1, block.x1)
    centre = run.between(block.t1[k], block.x1[k, a], end)
    way = (block.x1[k, a] - block.x0[k, a]) - (end - start)
    ways = ways_half_way(block)
    of_wall = ways[k, run.balls + w] if w < free else passed_half_way(block) * (end - start)
    return centre, way - (ways[k, a] - of_wall)


def _pulled_moments(block: Block, summed: F64, size: F64) -> None:
    """Adds the moments of cohesion on walls, and their sizes: as those of loads, half-way."""
    run, (pairs, along, impulse, slack) = block.run, pulls(block)
    number = np.where(pairs.b >= run.balls, run.wall_number(pairs.b), -1)
    for w in range(summed.shape[1]):
        mine = np.flatnonzero(number == w)
        k, a = pairs.k[mine], pairs.a[mine]
        centre, back = _levers(block, w, k, a)
        lever = centre - back - run.radius[a][:, None] * along[mine]
        extent = norm(lever) + norm(block.x1[k, a]) + run.radius[a]
        at = (k, np.full(len(mine), w))
        add_at(summed, at, -cross(lever, impulse[mine]))
        add_at(size, at, extent * (norm(impulse[mine]) + slack[mine] / EPS))


def _whole_momentum(block: Block, tally: Tally, given: F64) -> None:
    """Without contacts: the momentum of all balls together changes by weight and by the impulses on the walls."""
    run = block.run
    judged = block.there.all(axis=1) & block.kept & (not run.loads_on_balls and not run.joints)
    tally.skip(
        "wall impulse", "momentum as a whole: bodies come and go, or loads act", RECORD, int((~judged).sum())
    )
    alone = np.flatnonzero(~run.in_clump[: run.balls])
    mass = np.append(run.mass[alone], run.clumps.mass)
    v0, v1 = (
        np.concatenate([v[:, alone], rows[..., 7:10]], axis=1)
        for v, rows in ((block.v0, block.c0), (block.v1, block.c1))
    )
    weight = mass.sum() * run.gravity * block.dt[:, None]
    bodies = np.append(alone, run.clumps.first)
    of_box = carried.of_block(block)
    weight = weight + (mass[:, None] * of_box.velocity[:, bodies]).sum(axis=1)
    value = norm((mass[:, None] * (v1 - v0)).sum(axis=1) - weight + given[..., :3].sum(axis=1))
    size = (mass * (norm(v0) + norm(v1))).sum(axis=1) + norm(given[..., :3]).sum(axis=1)
    bound = EPS * (16.0 + 2.0 * block.updates) * (size + norm(weight)) * np.sqrt(run.bodies)
    bound = bound + (mass * of_box.slack[:, bodies]).sum(axis=1)
    tally.measure("wall impulse", value, bound, block.place, judged)


def kinetic(block: Block) -> tuple[F64, F64]:
    """Kinetic energy at both frames of each interval, (B,), J; of bodies that are there."""
    run = block.run
    ends = ((block.v0, block.w0, block.c0), (block.v1, block.w1, block.c1))
    first, second = (np.nansum(rigid.kinetic(run, *end), axis=1) for end in ends)
    return first, second
