"""What acted on each body in each interval: recorded impulses of contacts, as sums over the contacts of each body.

Moments of sliding impulses depend on the normal of their lever, `-r n x P_T` on either body. The scheme takes the normal of
`t_n` for the tangents beside that of `t_{n+1}` for the normal impulse (eqs. 39, 41); piles and Moreau-Jean have one frame.
Both readings of a recorded impulse are therefore admitted: `Impulse.split` gives them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from carom.arrays import F64
from carom.audit import carried, flights, loads_once
from carom.audit.block import Block, once
from carom.audit.formula import law
from carom.audit.recorded import of_bodies, pushes, shifts
from carom.audit.vectors import cross, dot, norm


@dataclass(frozen=True)
class Split:
    """An impulse (K, 3) as its normal part (K,), its sliding part (K, 3) and the lever's normal (K, 3)."""

    normal: F64
    sliding: F64
    lever: F64


def split(impulse: F64, end: F64, start: F64) -> tuple[Split, Split]:
    """Both readings: all rows in the frame of `end`; or the normal part along `end` and the rest across `start`."""
    normal = dot(impulse, end)
    one = Split(normal, impulse - normal[:, None] * end, end)
    aligned = dot(start, end)
    usable = aligned > 0.1
    normal = np.where(usable, dot(impulse, start) / np.where(usable, aligned, 1.0), normal)
    lever = np.where(usable[:, None], start, end)
    return one, Split(normal, impulse - normal[:, None] * end, lever)


@dataclass(frozen=True)
class Sums:
    """Sums over the contacts of each body: (B, N, ...)."""

    impulse: F64
    size: F64
    """Sum of the lengths of the impulses, N s."""
    moments: tuple[F64, F64]
    """Moment by either reading, N m s."""
    moment_size: F64
    turned: F64
    """What the moments may be off by the turn of normals within the interval, N m s."""
    shift: F64
    """Position impulses, N s^2."""
    shift_size: F64
    shift_moments: tuple[F64, F64]
    shift_turned: F64
    """What these may be off by, N m s^2."""
    shift_again: F64
    """Levers by which what loads change by in a step (`loads.solved_again`) may turn a body besides, m."""
    count: F64
    """Contacts of the body."""


@once
def of_contacts(block: Block) -> Sums:
    """Sums of the recorded contacts of a block."""
    c, run = block.rows, block.run
    reach = run.reach
    start = block.start[1]
    both = split(c.impulse, c.normal, start)
    pushed = projected(block)
    frame = (block.end[1], block.end[1]) if run.method == "moreau" else (c.normal, start)
    shifted = split(pushed, *frame)
    turned_too = (c.b < run.balls)[:, None]
    angle = turn(block)
    spread = np.where(block.single[c.k] | (angle == 0.0), 0.0, np.maximum(angle, norm(c.normal - start)))
    spread = np.maximum(spread, loads_once.unsure(block, 1))

    collect = partial(of_bodies, block, c)

    def moment(arm: F64, own: F64) -> F64:
        of_b = -own - reach[np.minimum(c.b, run.bodies)][:, None] * arm
        return collect(own - reach[c.a][:, None] * arm, np.where(turned_too, of_b, 0.0))

    def moments(parts: tuple[Split, Split], own: F64) -> tuple[F64, F64]:
        first, second = (moment(cross(s.lever, s.sliding), own) for s in parts)
        return first, second

    shift = collect(pushed, -run.taken(c.b, pushed))
    turned_by, shifted_by = moments(both, c.moment), moments(shifted, c.position_moment)
    unknown, again = np.zeros((2, len(c)))
    if run.loads_once:
        arm, unknown, again = loads_once.turns(block, shift)
        first, second = (moment(of, c.moment) for of in loads_once.arms(block))
        off, load = flights.half_way(block), loads_once.of_loads(block).remained
        ends = off[c.k, c.a], off[c.k, np.minimum(c.b, run.bodies)]
        levers = collect(cross(ends[0], load), -cross(ends[1], load))
        turned_by = first + levers, second + levers * run.has_impacts
        shifted_by = (moment(arm, c.position_moment),) * 2
    size, slide = norm(c.impulse), norm(both[0].sliding)

    def together_in_clumps(of_bodies: F64) -> F64:
        run.clumps.share(np.add, of_bodies)  # an impulse on one ball moves all
        return of_bodies

    ra, rb = reach[c.a], reach[np.minimum(c.b, run.bodies)]
    couple = norm(c.moment)
    return Sums(
        impulse=collect(c.impulse, -run.taken(c.b, c.impulse)),
        size=collect(size, size),
        moments=turned_by,
        moment_size=collect(ra * size + couple, rb * size + couple),
        turned=collect(ra * (size + slide) * spread, rb * (size + slide) * spread),
        shift=shift,
        shift_size=together_in_clumps(collect(norm(pushed), norm(pushed))),
        shift_moments=shifted_by,
        shift_turned=collect(ra * unknown, rb * unknown),
        shift_again=collect(ra * again, rb * again),
        count=together_in_clumps(collect(np.ones(len(c)), np.ones(len(c)))),
    )


def projected(block: Block) -> F64:
    """Position impulses (K, 3). The projection of Moreau-Jean acts along the normals of the places that it
    leaves, and is recorded along those of the middle of the step: size from the record, direction from the frame.
    """
    c, run = block.rows, block.run
    if run.method != "moreau":
        return c.position_impulse
    return np.asarray(norm(c.position_impulse)[:, None] * block.end[1])


@once
def speeds(block: Block) -> F64:
    """(B, N) a bound on the speed of each body within an interval, m/s, as `fastest`: the larger of both ends, what gravity
    gives, and all its recorded impulses together.
    """
    run = block.run
    return np.asarray(fastest(block) + norm(run.gravity) * block.dt[:, None] + pushes(block)[0] / run.mass)


@once
def fastest(block: Block) -> F64:
    """(B, N) speed of each body at either end of an interval, m/s, the larger one: of balls of clumps that which they may
    have within, as the clump turns. In a box that deforms it is that against the mean flow, at its surface: two of them
    together are no faster than that. Where there are walls, it is no less than the speed itself.
    """
    run = block.run
    found = ends(block).copy()
    clumps, balls = run.clumps, run.clumps.balls
    spin, along = (
        np.maximum(*(norm(of(rows)) for rows in (block.c0, block.c1)))
        for of in (clumps.momenta, lambda rows: rows[..., 7:10])
    )
    if run.box.deforms:
        against = carried.of_clumps(block)
        along = np.maximum(along, against) if run.walls or run.free_walls else against
    found[:, balls] = along[:, clumps.of] + (spin / clumps.least)[:, clumps.of] * clumps.arm
    found[:, balls] += carried.apart(block)[:, balls]
    return np.asarray(found)


@once
def ends(block: Block) -> F64:
    """(B, N) speeds of bodies at either end of an interval, m/s, as `fastest` but for clumps."""
    run, found = block.run, carried.own(block) + carried.apart(block)
    if run.walls or run.free_walls:
        found = np.maximum(found, np.maximum(norm(block.v0), norm(block.v1)))
    return np.asarray(found)


@once
def absolute(block: Block) -> F64:
    """(B, N) a bound on the speed of each body within an interval, m/s, with the mean flow of a box that deforms."""
    return np.asarray(speeds(block) + carried.flowing(block))


@once
def bent(block: Block) -> F64:
    """(B, N) by how much the position impulses of each body may be off where they turned the normals that they act along,
    as in piles, while they were solved: second order in the correction, N s^2; twice, since it may overshoot before.
    """
    c = block.rows
    way = together(block, shifts(block)[0])
    with np.errstate(invalid="ignore"):
        angle = np.where(way > 0.0, np.minimum(way * curvature(block), np.pi), 0.0)
    each = 2.0 * norm(c.position_impulse) * angle
    return of_bodies(block, c, each, each)


def together(block: Block, of: F64) -> F64:
    """(K,) the sum of what is given of both balls of each recorded contact, (B, N)."""
    c, last = block.rows, block.run.bodies - 1
    return np.asarray(of[c.k, c.a] + np.where(c.b <= last, of[c.k, np.minimum(c.b, last)], 0.0))


def curvature(block: Block) -> F64:
    """(K,) by how much the normal of each recorded contact turns on the way of its bodies, 1/m; 0 at flat walls."""
    c, run = block.rows, block.run
    curvature = 1.0 / (run.radius[c.a] + run.radius[np.minimum(c.b, run.bodies - 1)])
    curvature[run.is_free_wall(c.b)] = 0.0
    for k in np.unique(c.b[c.b >= run.bodies]):
        curvature[c.b == k] = run.walls[k - run.bodies].curvature
    return np.asarray(curvature)


@once
def turn(block: Block) -> F64:
    """(K,) a bound on the angle by which the normal of a contact turned within its interval, rad; 0 at flat walls that do
    not turn. The contact point moves at most at the speed of the bodies over the smallest radius of curvature.
    """
    c, run = block.rows, block.run
    speed = speeds(block)
    relative, curved = together(block, speed), curvature(block)
    spin = np.zeros(len(c))
    for k in np.unique(c.b[c.b >= run.bodies]):
        wall, rows = run.walls[k - run.bodies], np.flatnonzero(c.b == k)
        if wall.travels:
            for end, time in ((False, block.t0), (True, block.t1)):
                velocity, _, _ = wall.velocity(time[c.k[rows]], block.x1[c.k[rows], c.a[rows]], end=end)
                relative[rows] = np.maximum(relative[rows], speed[c.k[rows], c.a[rows]] + norm(velocity))
            if wall.rotation is not None:
                rate = np.maximum(
                    *(
                        np.abs(law(wall.rotation[2], t[c.k[rows]], before=end)[1])
                        for end, t in ((False, block.t0), (True, block.t1))
                    )
                )
                spin[rows] = 2.0 * rate
    with np.errstate(invalid="ignore"):
        angle = (np.where(relative > 0.0, curved * relative, 0.0) + spin) * block.dt[c.k]
    return np.minimum(angle, np.pi)
