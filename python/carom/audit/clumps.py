"""Laws of clumps (`rigid`): their balls move as one body, and momentum, angular momentum and ways follow from its contacts.

    M (v' - v) = M g dt + sum Lambda          L' - R_c L = sum d' x Lambda + moments of the balls about their centres
    x' = x + dt v + dt^2 g/2 + sum nu/M       R' = exp(psi) R_free,  psi = J^-1 (sum d x nu + moments)

over the contacts of all balls of a clump, with `R_free` of free flight (`flights`). `R_c` is the turn by what corrects
positions: it takes the angular velocity along, and is known to a bound. Levers `d'` are those of the end of the
step, of loads those half-way. The turn by contacts is known to the product of both turns, of which each may be the first.
Over several steps levers turn by no more than the clump. It is where its impulses, each at any time, can have brought it.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, Bool
from carom.audit import carried, flights, forces, gaps, groups, hits, rigid
from carom.audit.block import Block, Rows, once
from carom.audit.loads import solved_again
from carom.audit.motion import CONTACTS, RECORD, largest, rounding
from carom.audit.report import Tally
from carom.audit.rigid import Clump
from carom.audit.vectors import EPS, conjugate, cross, norm, product, rotation_vector

TURNED = 4.0
"""Roundings in a step of an angular momentum that becomes an angular velocity and back: four rotations by quaternions."""
KINDS = ("momentum", "spin", "position", "rotation")


def judge(block: Block, tally: Tally, free: Bool) -> None:
    """All clumps; `free` (B, N) are bodies that cannot have touched anything."""
    run = block.run
    if not run.clumps:
        return
    _as_one(block, tally)
    for number, clump in enumerate(run.clumps):
        if not block.there[:, clump.balls].any():
            continue
        apart, there = (np.asarray(of[:, clump.balls].all(axis=1)) for of in (free, block.there))
        known = np.asarray(there & (apart | (block.kept & run.has_contacts)))
        unseen = int((there & ~known).sum())
        for kind in KINDS:
            if run.has_contacts:
                why = "the last frame of a run that stopped early has no impulses"
                tally.skip(kind, why, "resume the run", unseen)
            else:
                tally.skip(kind, CONTACTS, RECORD, unseen)
        _Clump(block, number, clump, apart).judge(tally, known)


def _as_one(block: Block, tally: Tally) -> None:
    """Balls are where their clump has them, and move as it does. Bound: rounding; of orientations that of all steps."""
    run = block.run
    x, q, v, w = rigid.placed(run, block.x1, block.q1, block.c1)
    reach = np.array([clump.reach for clump in run.clumps])[run.clump_of[run.in_clump]]
    fast = forces.absolute(block)[:, run.in_clump]
    spin = forces.pushes(block)[1] / run.inertia + np.maximum(norm(block.w0), norm(block.w1))
    spin = spin[:, run.in_clump]
    mine = np.flatnonzero(run.in_clump)
    for value, size, scale in (
        (block.x1 - x, norm(block.x1)[:, mine] + reach, reach),
        (block.v1 - v, fast + spin * reach, fast + spin * reach),
        (block.w1 - w, spin, spin),
    ):
        off = norm(value[:, mine])
        least = np.maximum(scale, 1e-300)
        _measure(block, tally, off / least, 32.0 * EPS * size / least)
    turned = norm(rotation_vector(product(block.q1[:, mine], conjugate(q[:, mine]))))
    _measure(block, tally, turned, np.asarray(EPS * (64.0 + 8.0 * block.s1))[:, None])


def _measure(block: Block, tally: Tally, value: F64, bound: F64) -> None:
    mine = np.flatnonzero(block.run.in_clump)
    tally.measure(
        "rigid",
        value,
        np.broadcast_to(bound, value.shape),
        lambda i: block.place(i // len(mine), int(mine[i % len(mine)])),
        block.run.present(slice(block.first, block.first + block.count))[:, mine],
    )


@once
def _by_loads(block: Block) -> F64:
    """(B, N) position impulses of loads on each body, N s^2, of which positions may have taken back all."""
    run, c = block.run, block.rows
    size = np.zeros((block.count, run.bodies + 1))
    struck = groups.struck(block)[c.k, c.a] & run.has_impacts
    tables: list[tuple[Rows | hits.Hits, F64]] = [(c, np.where(struck, 0.0, norm(c.impulse)))]
    if run.has_impacts:
        r = hits.of_block(block)
        tables.append((r, np.where(r.problem == 0, norm(r.impulse), 0.0)))
    for table, given in tables:
        for body in (table.a, np.minimum(table.b, run.bodies)):
            np.add.at(size, (table.k, body), given)
    return np.asarray(run.h * size[:, :-1])


class _Clump:
    """One clump in a block."""

    def __init__(self, block: Block, number: int, clump: Clump, apart: Bool) -> None:
        self.block, self.number, self.clump = block, number, clump
        self.old, self.new = block.c0[:, number], block.c1[:, number]
        self.momenta = [clump.momentum(row[:, 3:7], row[:, 10:]) for row in (self.old, self.new)]
        self.lever = clump.levers(self.new)
        self.sums = forces.of_contacts(block)
        #: (B,) whether contacts may have acted on it, one of which what is left is on record.
        self.touched = ~apart & (self.sums.count > 0).any(axis=1)
        self.rounding = rounding(block)[:, clump.first]
        self.spin = np.maximum(norm(self.old[:, 10:]), norm(self.new[:, 10:]))
        self.offset = norm(clump.offsets)

    def judge(self, tally: Tally, known: Bool) -> None:
        """Its momenta and ways in the intervals `known` (B,)."""
        laws = ("momentum", self._momentum()), ("spin", self._spin()), ("position", self._position())
        for kind, (value, bound) in laws:
            self._tell(tally, kind, value, bound, known)
        turning = ~self.touched | self.block.single
        why = "contacts turned a clump in one of several steps, or of parts of one, between the frames"
        self.block.skip(tally, "rotation", why, np.flatnonzero(known & ~turning))
        self._tell(tally, "rotation", *self._rotation(), known & turning)

    def _tell(self, tally: Tally, kind: str, value: F64, bound: F64, known: Bool) -> None:
        block, first = self.block, self.clump.first
        tally.measure(kind, value, bound, lambda k: block.place(k, first), known)

    def _of_balls(self, values: F64) -> F64:
        """Sums (B, ...) over its balls."""
        return np.asarray(values[:, self.clump.balls].sum(axis=1))

    def _momentum(self) -> tuple[F64, F64]:
        block, m = self.block, self.clump.mass
        old, new, weight = self.old[:, 7:10], self.new[:, 7:10], m * block.run.gravity * block.dt[:, None]
        first, of_box = self.clump.first, carried.of_block(block)
        weight = weight + m * of_box.velocity[:, first]
        value = norm(m * (new - old) - weight - self._of_balls(self.sums.impulse))
        size = m * (norm(old) + norm(new)) + norm(weight) + self._of_balls(self.sums.size)
        bound = self.rounding * (size + largest(block)[:, 0])
        return value, bound + m * of_box.slack[:, first]

    def _moment(self, given: F64, own: F64) -> F64:
        """(B, 3) moment about the centre of impulses (B, N, 3) on balls, and of moments (B, N, 3) about theirs."""
        b = self.clump.balls
        return np.asarray((cross(self.lever, given[:, b]) + own[:, b]).sum(axis=1))

    def _spin(self) -> tuple[F64, F64]:
        block, s, clump = self.block, self.sums, self.clump
        angle = self._corrected()
        value = np.minimum(*(self._off(self._moment(s.impulse, moment), angle) for moment in s.moments))
        pushed = s.size[:, clump.balls] @ self.offset
        own = 2.0 * clump.inertia.max() * self.spin
        size = own + pushed + self._of_balls(s.moment_size)
        size = size + np.where(self.touched, clump.reach * largest(block)[:, 0], 0.0)
        bound = self.rounding * size + self._of_balls(s.turned)
        bound = bound + TURNED * EPS * block.updates * own
        # Impulses of several steps may cancel in their sum: the normal ones do not.
        index = block.run.law_index(block.rows.a, block.rows.b)
        mu = np.nan_to_num(block.run.friction(index, np.zeros(len(index)))).max(initial=0.0)
        if not block.run.has_impacts:  # of loads and impacts together nothing tells which is which
            several = block.over(block.run.steps["impact_problems"]) > 1
            off = norm(flights.half_way(block)[:, clump.balls])
            bound = bound + np.where(several, (off * s.size[:, clump.balls]).sum(axis=1), 0.0)
        angle = np.where(block.single, 0.0, np.minimum(self._rate() * block.dt, 2.0))
        struck = np.maximum(pushed * (1.0 + 2.0 * mu), forces.strokes(block)[0][:, clump.first] * clump.reach)
        return value, bound + angle * struck

    def _off(self, given: F64, angle: F64) -> F64:
        """(B,) by how much the momentum before impacts is off, that at the end less what contacts gave: its size, and its
        direction beyond the angle by which corrections of positions may have turned it.
        """
        before, size = self.momenta[1] - given, norm(self.momenta[0])
        beyond = norm(before - self.momenta[0]) - angle * size
        return np.maximum(np.abs(norm(before) - size), beyond)

    def _corrected(self) -> F64:
        """(B,) by how much corrections of positions may turn it at most, rad.

        Those may take back what loads have turned it by, too, of which nothing is left on record: about that of its own.
        """
        s, clump = self.sums, self.clump
        own = self.block.run.h * clump.mass * gaps.fall(self.block)[:, clump.balls].max(axis=1)
        by_loads = _by_loads(self.block)[:, clump.balls].sum(axis=1)
        turned = clump.reach * (s.shift_size[:, clump.first] + by_loads + own)
        angle = (turned + self._of_balls(norm(s.shift_moments[0]))) / clump.inertia.min()
        return np.where(self.touched, angle, 0.0)

    def _rate(self) -> F64:
        """(B,) how fast it turns at most, rad/s."""
        momentum = np.maximum(*map(norm, self.momenta))
        given = forces.strokes(self.block)[0][:, self.clump.first] * self.clump.reach
        return np.asarray((momentum + given) / self.clump.inertia.min())

    def _position(self) -> tuple[F64, F64]:
        block, s, m = self.block, self.sums, self.clump.mass
        shift, moved = self._of_balls(s.shift), s.shift_size[:, self.clump.first]
        free = flights.of_block(block).rows[:, self.number, :3]
        value = norm(self.new[:, :3] - free - shift / m)
        size = norm(self.old[:, :3]) + norm(self.new[:, :3]) + moved / m
        size = size + block.dt * (norm(self.old[:, 7:10]) + norm(self.new[:, 7:10]))
        size = size + np.where(self.touched, self.clump.reach, 0.0)
        left = (block.left(norm(block.rows.position_impulse)) + block.floor) / m
        struck = forces.strokes(block)[0][:, self.clump.first]
        reach = np.where(block.single, 0.0, 2.0 * (struck * block.dt + moved) / m)
        bound = self.rounding * size + carried.of_block(block).slack_way[:, self.clump.first]
        return value, bound + np.where(self.touched, left + reach, 0.0)

    def _rotation(self) -> tuple[F64, F64]:
        block, s, clump = self.block, self.sums, self.clump
        free, q = flights.of_block(block), self.new[:, 3:7]
        off = rotation_vector(product(q, conjugate(free.rows[:, self.number, 3:7])))
        least, ratio = clump.inertia.min(), clump.inertia.max() / clump.inertia.min()
        given = [clump.turning(q, self._moment(s.shift, own)) for own in s.shift_moments]
        value = np.minimum(*(norm(off - psi) for psi in given))
        way = block.dt * self.spin * ratio
        bound = self.rounding * (8.0 + way) * ratio + free.off[:, self.number]
        by_loads = _by_loads(block)[:, clump.balls].sum(axis=1)
        turned = clump.reach * (s.shift_size[:, clump.first] + by_loads)
        angle = (turned + self._of_balls(norm(s.shift_moments[0]))) / least
        doubt = self._of_balls(s.shift_turned + s.shift_again * solved_again(block)[:, None]) / least
        size = norm(block.rows.position_impulse) * clump.reach + norm(block.rows.position_moment)
        left = (block.left(size) + block.floor * clump.reach) / least
        turns = 2.0 * ratio * (way + angle) * angle
        return value, bound + np.where(self.touched, doubt + left + turns, 0.0)
