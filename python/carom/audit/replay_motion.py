"""The rows of the impact problems of a block, and the motion that each problem leaves: what `replay` judges.

Tangential rows have the frame of the start of their step or that of its end: `replay.judge` says which.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import answers, bounds, carried, flights, forces, loads_once, turning
from carom.audit.block import Block
from carom.audit.centres import at_walls, riding
from carom.audit.cohesion import on_bodies
from carom.audit.hits import Hits, after_cut
from carom.audit.loads import of_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.vectors import add_at, cross, norm


class Told(NamedTuple):
    """What a law says of some rows, ascending, or of the problem of one of them: how far off they are, and the bound."""

    rows: I64
    value: F64
    bound: F64

    def of(self, chosen: Bool | I64) -> Told:
        """Some of them."""
        return Told(self.rows[chosen], self.value[chosen], self.bound[chosen])

    @property
    def blamed(self) -> I64:
        """The rows that are off by more."""
        return self.rows[~(self.value <= self.bound)]


class Motion:
    """The impact problems of all whole steps of a block, problem after problem: islands of a step share no bodies.

    Rows are in the order of their problems. `end` (K,): tangential rows in the frame of `t_{n+1}`, and not in that of `t_n`.
    Motions are (B N, 6), velocity and angular velocity of each body in each interval.
    """

    def __init__(self, block: Block, r: Hits, kept: Bool, end: Bool) -> None:
        self.block, self.r, self.kept = block, r, kept
        self.told: dict[str, list[Told]] = {}
        run = block.run
        self.inertia = np.tile(
            np.repeat(np.stack([run.mass, run.inertia], axis=1), 3, axis=1), (block.count, 1)
        )
        self.answers, every = answers.of_block(block), np.arange(block.count)
        self.old, self.now = (
            np.concatenate(ends, axis=-1).reshape(-1, 6)
            for ends in ((block.v0, block.w0), (block.v1, block.w1))
        )
        # Impact problems have clumps where the step ends: so they have their velocities of its start.
        self.old[(every[:, None] * run.bodies + np.flatnonzero(run.in_clump)).ravel()] = np.concatenate(
            turning.turned_on(block), axis=-1
        )[:, run.in_clump].reshape(-1, 6)

        def of_both(each: F64) -> F64:
            of_b = np.where(r.b < run.bodies, each[r.k, np.minimum(r.b, run.bodies - 1)], 0.0)
            return np.asarray(each[r.k, r.a] + of_b)

        #: (K,) by how much the velocities of before may be off at each row, m/s.
        self.begun = of_both(turning.unsure(block))
        #: (K,) by how much loads may have answered otherwise, N s.
        self.swung = of_both(turning.swung(block))
        self.scratch = np.zeros_like(self.now)
        # Frames of tangential rows: those of t_n, of Moreau-Jean the recorded ones of the middle of the step.
        ball = np.minimum(r.b, run.bodies - 1)
        self.at = r.k * run.bodies + r.a, r.k * run.bodies + ball
        start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, ball])[1]
        # Not of the contacts of the frame: one whose impulse was taken back has none there.
        images = block.image(r.k, r.a, r.b), block.image(r.k, r.a, r.b, end=True)
        first = Pairs(r.a, r.b, block.t0[r.k], block.x0[r.k, r.a], start, end=False, image=images[0])
        motion = block.motion(r.k, r.a, r.b, start=True)
        self.law = run.law_index(r.a, r.b)
        self.mu = run.friction(self.law, norm(rates(run, first, motion, start, start).slip))
        once = run.loads_once
        end = end | (run.method == "moreau") | once
        both = forces.split(r.impulse, r.normal, start)
        self.lever = np.where(end[:, None], r.normal, start)
        self.push = np.where(end, both[0].normal, both[1].normal)
        self.slide = np.where(end[:, None], both[0].sliding, both[1].sliding)
        self.arm = cross(self.lever, self.slide)
        self.first = loads_once.first_normals(run, r.a, r.b, start, r.normal)
        if once:
            loads = (r.problem == 0)[:, None]
            mean = loads_once.along_mean(r.impulse, self.first, r.normal)
            self.push = np.where(loads[:, 0], mean.normal, self.push)
            self.slide = np.where(loads, mean.stated - mean.normal[:, None] * r.normal, self.slide)
            self.arm = np.where(loads, mean.arm, self.arm)
        # Places and times of the walls' own motion, at t_n and at t_{n+1}.
        self.printed = first._replace(foot=self.lever)
        self.pairs = tuple(
            Pairs(
                r.a,
                r.b,
                time[r.k],
                at_walls(block, r.k, r.a, r.b, r.normal, start=not last),
                r.normal,
                end=last,
                image=images[last],
                riding=riding(block, r.k, r.a, start=not last),
            )
            for time, last in ((block.t0, False), (block.t1, True))
        )
        of_images = carried.image_speed(block, r.k, images[1])
        self.cut, self.unsure = after_cut(block, r)
        #: (K,) rows with walls or images that move.
        self.driven = np.isin(r.b, [run.bodies + w for w, wall in enumerate(run.walls) if wall.moves])
        self.driven |= of_images > 0.0
        self.compliance = compliance(run, r.a, r.b)
        #: (B,) largest speed that the weight, the turn of a clump, or the force on a free wall gives in a step, m/s.
        self.loads_give = np.full(block.count, float(norm(run.gravity)) * run.h)
        self.loads_give += flights.speeds_of_turning(block).max(axis=1)
        self.loads_give += carried.strained(block) * 2.0 * run.radius.max()
        pulled, unsure = on_bodies(block)
        self.loads_give += ((norm(pulled) + unsure) / run.mass).max(axis=1, initial=0.0)
        if run.free_walls:
            walls = slice(run.balls, None)
            self.loads_give += (of_loads(block).spread[:, walls, 0] / run.mass[walls]).max(axis=1)
        self.squares = bounds.squares(run, r)
        self.wrench = self._wrenches()
        given = np.flatnonzero(kept | (r.problem > 0))
        where, gained = self.moved(given)
        self.now[where] -= gained
        #: Motion that problem 0 has left.
        self.loaded = self.now
        reach = np.abs(np.nan_to_num(self.now)).reshape(block.count, -1, 6)
        #: (B,) largest speed of a body, at the start or after any problem.
        self.top = (norm(reach[..., :3]) + run.radius * norm(reach[..., 3:])).max(axis=1, initial=0.0)
        np.maximum.at(self.top, r.k, of_images)
        self.speed = self.top.copy()
        #: (B,) size of all multipliers: reactions of joints are no more than what they answer, in the norm of the masses.
        self.plain = np.sqrt(np.bincount(r.k, self.squares, minlength=block.count))
        answering = np.zeros(block.count, dtype=bool)
        answering[where[self.answers.group_of[where % run.bodies] >= 0] // run.bodies] = True
        inert = (
            np.minimum(run.mass, run.inertia / run.radius**2),
            np.maximum(run.mass, run.inertia / run.radius**2),
        )
        self.plain *= np.where(answering, 1.0 + np.sqrt(inert[1].max() / inert[0].min()), 1.0)
        self.answering = answering

    def moved(self, rows: slice | I64, *, free: bool = False) -> tuple[I64, F64]:
        """The bodies that some rows move, each once, (M,), and the velocities that the rows give them together, (M, 6);
        `free`, where nothing answers them.
        """
        a, b = (at[rows] for at in self.at)
        hit = np.zeros(len(self.now), dtype=bool)
        hit[a] = hit[b[self.r.b[rows] < self.block.run.bodies]] = True
        for at, wrench in zip((a, b), self.wrench, strict=True):
            add_at(self.scratch, (at,), wrench[rows])
        where = np.flatnonzero(hit)
        found = self.scratch[where]
        self.scratch[where] = 0.0
        if free:
            return self.answers.of(where, found, free=True)
        return self.answers.of(where, found)

    def shared(self, rows: slice) -> I64:
        """(K,) how many rows act on one of both bodies, the larger number."""
        a, b = (at[rows] for at in self.at)
        # What does not move has no rows in common.
        moves = self.r.b[rows] < self.block.run.bodies
        ends = np.concatenate([a, np.where(moves, b, -1 - np.arange(len(b)))])
        _, which, many = np.unique(ends, return_inverse=True, return_counts=True)
        shared: I64 = many[which].reshape(2, -1).max(axis=0)
        return shared

    def terms(self, rows: slice | I64, at: I64, change: F64) -> F64:
        """(B,) `bounds.terms` of some rows and of the velocities that they change."""
        return bounds.terms(self.block, self.r.k[rows], self.squares[rows], at, change * self.inertia[at])

    def rates(
        self, rows: slice | I64, motion: tuple[F64, F64], *, old: bool = False, printed: bool = False
    ) -> Rates:
        """At some rows for motions of their bodies, (K, 6); `old`: walls as at t_n; `printed`: all of t_n."""
        p = (self.printed if printed else self.pairs[0 if old else 1]).of(rows)
        (a, b), lever = motion, self.lever[rows]
        normal = lever if printed else self.r.normal[rows]
        return rates(self.block.run, p, (a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]), normal, lever)

    def _wrenches(self) -> tuple[F64, F64]:
        """Momenta that each row gives its two bodies, (K, 6); none to walls that are not free."""
        run, r = self.block.run, self.r
        reach = run.reach
        arm = self.arm
        ball, moved = (r.b < run.balls)[:, None], (r.b < run.bodies)[:, None]
        of_a = np.hstack([r.impulse, r.moment - reach[r.a][:, None] * arm])
        turned_by = -r.moment - reach[np.minimum(r.b, run.bodies)][:, None] * arm
        if run.loads_once:
            off, load = flights.half_way(self.block), np.where((r.problem == 0)[:, None], r.impulse, 0.0)
            of_a[:, 3:] += cross(off[r.k, r.a], load)
            turned_by -= cross(off[r.k, np.minimum(r.b, run.bodies)], load)
        of_b = np.hstack([-run.taken(r.b, r.impulse), np.where(ball, turned_by, 0.0)])
        return of_a, np.where(moved, of_b, 0.0)

    def tell(self, kind: str, rows: I64, value: F64, bound: F64) -> None:
        if kind in ("impact", "slip", "roll"):
            springs = self.block.run.impact_law.restitution == "energetic"
            lawful = ~self.block.companion[self.r.k[rows]] & ~(springs & (self.r.problem[rows] == 1))
            rows, value, bound = rows[lawful], value[lawful], bound[lawful]
        self.told.setdefault(kind, []).append(Told(rows, value, bound))
