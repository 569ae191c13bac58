"""Which bodies come near each other in an interval, found anew from the frames.

A body is somewhere within its *way*: the distance between its two places, or what its speeds at both frames and its weight
allow, whichever is more. Ways are cut at some radii, beyond which pairs are too many to look at; of a body whose way is
cut, nothing is concluded from having met nobody. Where several steps lie between frames of many bodies, the distance itself
is cut as well, and pairs that touch at the end are looked for there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool, connected
from carom.audit import carried, closing, cohesion, drift
from carom.audit.block import ALL_PAIRS, Block
from carom.audit.data import Run
from carom.audit.forces import fastest
from carom.audit.loads import of_loads
from carom.audit.rates import compliance
from carom.audit.vectors import norm
from carom.scene.packing.neighbours import ascending
from carom.scene.packing.neighbours import pairs as neighbours

LONGEST = 8.0
"""Ways are cut at this many radii, of many bodies at a quarter of it."""
MARGIN = 1e-2
"""Pairs are listed that come within so many radii: the step looks at those (`docs/theory/algorithm.md`, section 3)."""


@dataclass(frozen=True)
class Near:
    """Pairs that may have touched, M of them: interval, bodies A and B (walls from N on), gaps and normals at both ends."""

    k: I64
    a: I64
    b: I64
    gap0: F64
    normal0: F64
    gap1: F64
    normal1: F64
    free: Bool
    """(B, N) bodies that can have touched nothing."""
    far: Bool
    """(B, N) bodies that went farther than pairs were looked for."""


def near(block: Block) -> Near:
    """All pairs of a block that may have touched."""
    run = block.run
    travelled = carried.ways(block)
    fast = fastest(block) * block.dt[:, None]
    possible = fast + norm(run.gravity) * block.dt[:, None] ** 2
    if run.free_walls:  # light ones are pushed farther by their forces than any ball falls
        free_walls = slice(run.balls, None)
        gained = of_loads(block).spread[:, free_walls, 0] / run.mass[free_walls]
        possible[:, free_walls] += gained * block.dt[:, None]
    if run.cohesive:
        pulled = norm(cohesion.on_bodies(block)[0]) + cohesion.most(block) * block.dt[:, None]
        run.clumps.share(np.add, pulled)
        possible = possible + pulled / run.mass * block.dt[:, None]
    longest = LONGEST * run.radius * (1.0 if run.bodies <= ALL_PAIRS else 0.25)
    far = block.there & (travelled > longest) & (block.n > 1)[:, None] & (run.bodies > ALL_PAIRS)
    far[:, run.balls :] = False
    way = np.where(block.there, np.maximum(travelled, np.minimum(possible, longest)), 0.0)
    balls, walls = _balls(block, np.where(far, longest, way), far), _walls(block, way)
    k, a, b, reach = (np.concatenate(parts) for parts in zip(balls, walls, strict=True))
    other = np.minimum(b, run.bodies - 1)
    gap0, normal0 = run.meet(block.t0[k], a, b, block.x0[k, a], block.x0[k, other])
    gap1, normal1 = run.meet(block.t1[k], a, b, block.x1[k, a], block.x1[k, other])
    free = block.there & (possible < longest)
    ball = b < run.bodies
    met = gap0 <= reach
    free[k[met], a[met]] = False
    met &= ball
    free[k[met], b[met]] = False
    for interval in np.flatnonzero(far.any(axis=1) & free.any(axis=1)):
        hit = _reached(block, int(interval), way[interval], far[interval], free[interval])
        free[interval, hit] = False
    _apart_from_passing(block, possible, free)
    _apart_from_meshes(block, way, free)
    run.clumps.share(np.logical_and, free)
    return Near(k, a, b, gap0, normal0, gap1, normal1, free, far)


def _apart_from_passing(block: Block, possible: F64, free: Bool) -> None:
    """Takes out of the `free` those that a body may have touched that came or went."""
    run, passing = block.run, block.passing[:, : block.run.balls]
    radius = run.radius[: run.balls] * (1.0 + MARGIN)
    unseen = passing.copy()
    for x, time in ((block.x0, block.t0), (block.x1, block.t1)):
        seen = np.asarray(np.isfinite(x[:, : run.balls]).all(axis=2))
        for k in np.flatnonzero((passing & seen).any(axis=1)):
            here = np.flatnonzero(seen[k])
            reach = radius[here] + possible[k, here]
            a, b = (here[of] for of in neighbours(x[k, here], reach, run.box.packed(time[k])))
            one = passing[k, a] | passing[k, b]
            free[k, a[one]] = free[k, b[one]] = False
        unseen &= ~seen
    free[unseen.any(axis=1)] = False  # it came and went: where, no frame tells
    free[passing.any(axis=1), run.balls :] = False


def _apart_from_meshes(block: Block, way: F64, free: Bool) -> None:
    """Takes out of the `free` what may have come near to a mesh on its way, in intervals of several steps."""
    run = block.run
    for wall in run.walls[: run.given_walls]:
        asked = free & (block.n > 1)[:, None] & np.isfinite(block.x1).all(axis=2)
        k, body = np.nonzero(asked[:, : run.balls])
        if wall.mesh is None or not len(k):
            continue
        reach = run.radius[body] * (1.0 + MARGIN) + way[k, body]
        if wall.travels:
            ends = ((block.t0, block.x0, False), (block.t1, block.x1, True))
            speed = [norm(wall.velocity(time[k], x[k, body], end=end)[0]) for time, x, end in ends]
            reach = reach + 2.0 * np.maximum(*speed) * block.dt[k]
        x = wall.local(block.t1[k], block.x1[k, body])
        point, triangle = wall.mesh.near(x, reach)
        away = norm(x[point] - wall.mesh.closest(x[point], triangle))
        met = point[away <= reach[point]]
        free[k[met], body[met]] = False


def _balls(block: Block, way: F64, far: Bool) -> tuple[I64, I64, I64, F64]:
    run = block.run
    touch = run.radius * (1.0 + MARGIN)
    # As the box deforms, what is so far apart comes nearer by a share of it at most.
    reach = (touch + way) * (1.0 + carried.strain(block))[:, None]
    if run.bodies <= ALL_PAIRS:
        a, b = np.triu_indices(run.balls, 1)
        time = np.repeat(block.t0, len(a))
        d = run.between(time, block.x0[:, a].reshape(-1, 3), block.x0[:, b].reshape(-1, 3))
        d = d.reshape(block.count, -1, 3)
        with np.errstate(invalid="ignore"):
            close = norm(d) <= reach[:, a] + reach[:, b]
        close &= block.there[:, a] & block.there[:, b]
        k, pair = np.nonzero(close)
        return _free(block, way, k, a[pair], b[pair])
    found = []
    for interval in range(block.count):
        here = np.flatnonzero(block.there[interval, : run.balls])
        box = run.box.packed(block.t0[interval])
        first, second = neighbours(block.x0[interval, here], reach[interval, here], box)
        if far[interval].any():
            end = neighbours(block.x1[interval, here], touch[here], run.box.packed(block.t1[interval]))
            both = ascending(np.concatenate([a * len(here) + b for a, b in ((first, second), end)]))
            first, second = both // len(here), both % len(here)
        found.append((np.full(len(first), interval), here[first], here[second]))
    return _free(block, way, *(np.concatenate(part) for part in zip(*found, strict=True)))


def _reached(block: Block, k: int, way: F64, far: Bool, free: Bool) -> I64:
    """Which of the free balls those that went far may have met somewhere on their way."""
    run = block.run
    here = np.flatnonzero((far | free)[: run.balls])
    reach = (run.radius * (1.0 + MARGIN) + way) * (1.0 + carried.strain(block)[k])
    a, b = neighbours(block.x0[k, here], reach[here], run.box.packed(block.t0[k]))
    a, b = here[a], here[b]
    one = far[a] != far[b]
    return np.asarray(np.where(far[a], b, a)[one])


def _free(block: Block, way: F64, k: I64, a: I64, b: I64) -> tuple[I64, I64, I64, F64]:
    """The pairs that no joint keeps from meeting, with the ways of both; images of such a pair may meet."""
    run = block.run
    apart = block.x0[k, a] - block.x0[k, b]
    nearest = run.between(block.t0[k], block.x0[k, a], block.x0[k, b])
    itself = np.isclose(nearest, apart, rtol=0.0, atol=1e-9).all(axis=1)
    rows = np.flatnonzero(~(run.held_apart.holds(a, b) & itself))
    k, a, b = k[rows], a[rows], b[rows]
    return k, a, b, way[k, a] + way[k, b]


def _walls(block: Block, way: F64) -> tuple[I64, I64, I64, F64]:
    run = block.run
    found = [(np.zeros(0, np.int64),) * 3 + (np.zeros(0),)]
    ks, bodies = np.nonzero(block.there[:, : run.balls])
    for w, free in enumerate(run.free_walls):
        gap, _ = free.meet(block.x0[ks, bodies], block.x0[ks, run.balls + w], run.radius[bodies])
        reach = way[ks, bodies] + way[ks, run.balls + w]
        close = gap <= reach + MARGIN * run.radius[bodies]
        found.append((ks[close], bodies[close], np.full(int(close.sum()), run.balls + w), reach[close]))
    for w, wall in enumerate(run.walls[: run.given_walls]):
        if wall.mesh is not None:
            found.append(_parts(block, w, way))
            continue
        x = block.x0[ks, bodies]
        gap, _ = wall.meet(block.t0[ks], x, run.radius[bodies])
        reach = way[ks, bodies]
        if wall.travels:
            for end, time, place in ((False, block.t0, block.x0), (True, block.t1, block.x1)):
                speed = norm(wall.velocity(time[ks], place[ks, bodies], end=end)[0])
                reach = np.maximum(reach, way[ks, bodies] + 2.0 * speed * block.dt[ks])
        close = gap <= reach + MARGIN * run.radius[bodies]
        found.append((ks[close], bodies[close], np.full(int(close.sum()), run.bodies + w), reach[close]))
    parts = list(zip(*found, strict=True))
    return tuple(np.concatenate(p) for p in parts)  # type: ignore[return-value]


def _parts(block: Block, w: int, way: F64) -> tuple[I64, I64, I64, F64]:
    """What of a mesh is near a ball at the end of the interval."""
    run, wall = block.run, block.run.walls[w]
    ks, bodies = np.nonzero((block.there & np.isfinite(block.x1).all(axis=2))[:, : run.balls])
    radius = run.radius[bodies]
    x = wall.local(block.t1[ks], block.x1[ks, bodies])
    row, part = run.parts.near(w, x, radius * (1.0 + MARGIN))
    there = wall.there(block.t1[ks[row]])
    row, part = row[there], part[there]
    return ks[row], bodies[row], run.bodies + part, way[ks[row], bodies[row]] + MARGIN * radius[row]


def deepest(run: Run, block: Block, k: I64, a: I64, b: I64) -> F64:
    """(K,) how deep pairs may overlap, m.

    nsga: `gap_tolerance r` and 16 roundings of the largest coordinate of the bodies that one problem may join. Beyond
    `dense_contacts` contacts that is an aim: what eq. 44 leaves of `p gap`, p = 0.5/D_cc, stays where gaps contradict one
    another (jammed balls). In piles the solver aims at `Block.pile_overlap`, ten times that after its patience ended (a
    fallback is counted then), and so do the smaller ones where contacts were not recorded.
    Moreau-Jean, without projection: a contact is seen where the middle of a step overlaps and closes until the step's
    end, so the way of one step; it keeps that overlap, so at the largest speeds of the run, of walls too. What closes more
    slowly than the closing tolerance (rule R3) is left alone in each step, and adds up (`closing.left`); so does what curved
    walls add to overlaps (`drift`). Penalty: the
    elastic energy `K d^(n+1)/(n+1)` is at most the largest kinetic energy of the run; twice the indentation under the
    whole weight comes on top.
    """
    other = run.length[np.minimum(b, run.bodies)]
    r = np.minimum(run.radius[a], other)
    rounding = 16.0 * np.finfo(float).eps * np.maximum(_extent(block, k, a, b), r)
    if run.method == "penalty":
        return np.asarray(_compressed(run, a, b) + rounding)
    t = run.loosest
    if run.method == "moreau" and not run.projects:
        of_image = run.h * carried.image_speed(block, k, block.image(k, a, b))
        bent = np.zeros(len(k))
        for w, grown in drift.of_run(run).items():
            mine = b == run.bodies + w
            bent[mine] = grown[block.first + k[mine], a[mine]]
        return np.asarray(_way(run, a, b) + of_image + closing.left(run)[block.first + k] + bent + rounding)
    many = block.piled[k]
    known = block.kept[k] & run.has_contacts
    many |= block.large[k] & ~known
    left = 2.0 * compliance(run, a, b)[0] * (block.left(norm(block.rows.position_impulse)) + block.floor)[k]
    tired = block.over(run.steps["fallbacks"])[k] > 0
    aim = np.maximum(t["gap_tolerance"], block.pile_overlap[k] * np.where(tired, 10.0, 1.0))
    bound = np.where(many, aim, t["gap_tolerance"]) * r + np.where(block.large[k] & known, left, 0.0)
    return np.asarray(bound + rounding)


def _extent(block: Block, k: I64, a: I64, b: I64) -> F64:
    """(K,) the largest coordinate of a pair, or of all that it may have one problem of gaps with, and of the box, m."""
    run, n = block.run, block.run.bodies
    far = np.nan_to_num(np.maximum(*(np.abs(x).max(axis=2) for x in (block.x0, block.x1)))).ravel()
    first = k * n + a
    second = np.where(b < n, k * n + b, first)  # a wall has no place of its own
    if run.method == "nsga" or run.projects:
        linked = np.arange(block.count)[:, None] * n + run.joined(run.loads)
        group = connected(
            len(far), np.concatenate([np.arange(len(far)), first]), np.append(linked.ravel(), second)
        )
        most = np.zeros(len(far))
        np.maximum.at(most, group, far)
        far = most[group]
    return np.asarray(np.maximum(far[first], far[second]) + run.lengths(block.t1)[k])


def _way(run: Run, a: I64, b: I64) -> F64:
    fastest = run.top_speeds
    speed = fastest[a] + np.append(fastest, 0.0)[np.minimum(b, run.bodies)]
    on_wall = b >= run.bodies
    # Between frames, where no speed is looked at, a wall may be faster.
    speed[on_wall] += 2.0 * run.top_wall_speeds[run.given(b[on_wall]) - run.bodies, a[on_wall]]
    return np.asarray(run.h * (speed + norm(run.gravity) * run.h))


def stiffness(run: Run, a: I64, b: I64) -> F64:
    """(K,) K of the elastic force `K d^n` of method penalty, N/m^n."""
    o = run.options
    if o["penalty_stiffness"] > 0.0:
        return np.full(len(a), float(o["penalty_stiffness"]))
    effective = 0.5 * o["penalty_young_modulus"] / (1.0 - o["penalty_poisson_ratio"] ** 2)
    curvature = 1.0 / run.radius[a] + np.append(1.0 / run.radius, 0.0)[np.minimum(b, run.bodies)]
    return np.asarray(4.0 / 3.0 * effective / np.sqrt(curvature))


def _compressed(run: Run, a: I64, b: I64) -> F64:
    n = float(run.options["penalty_exponent"])
    # A curved wall may be softer than a plane: at least the contact with an equal ball.
    k = stiffness(run, a, b) * np.where(b >= run.bodies, np.sqrt(0.5), 1.0)
    kinetic = float(np.max(run.steps["energy_kinetic"], initial=0.0))
    weight = float(run.mass.sum() * norm(run.gravity))
    return np.asarray(((n + 1.0) * kinetic / k) ** (1.0 / (n + 1.0)) + 2.0 * (weight / k) ** (1.0 / n))
