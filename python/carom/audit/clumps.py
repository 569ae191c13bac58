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
from carom.audit import carried, closing, clump_loads, flights, forces, groups, hits, recorded, rigid, turning
from carom.audit.block import Block, Rows, once
from carom.audit.loads import of_loads, solved_again
from carom.audit.motion import CONTACTS, RECORD, Ways, largest, rounding, untouched
from carom.audit.report import Tally
from carom.audit.vectors import EPS, conjugate, norm, product, rotation_vector

TURNED = 4.0
"""Roundings in a step of an angular momentum that becomes an angular velocity and back: four rotations by quaternions."""
KINDS = ("momentum", "spin", "position", "rotation")


def laws(block: Block, free: Bool) -> Laws | None:
    """Of all clumps, if there are any; `free` (B, N) are bodies that cannot have touched anything."""
    run = block.run
    if not run.clumps:
        return None
    if not run.has_contacts:
        free = untouched(block, free)
    return Laws(block, np.asarray(run.clumps.over(np.logical_and, free)))


def judge(block: Block, tally: Tally, of_clumps: Laws | None) -> None:
    """All clumps, once joints have had what they may give (`motion.judge`)."""
    run = block.run
    if of_clumps is None:
        return
    _as_one(block, tally)
    apart, there = of_clumps.apart, np.asarray(run.clumps.over(np.logical_and, block.there))
    pulled = of_loads(block).unknown[:, run.clumps.first] | clump_loads.of_block(block).unknown
    there &= ~pulled  # what is not judged of them is counted with the balls
    known = np.asarray(there & (apart | (block.kept & run.has_contacts)[:, None]))
    unseen = int((there & ~known).sum())
    for kind in KINDS:
        if run.has_contacts:
            why = "the last frame of a run that stopped early has no impulses"
            tally.skip(kind, why, "resume the run", unseen)
        else:
            tally.skip(kind, CONTACTS, RECORD, unseen)
    of_clumps.judge(tally, known)


def _as_one(block: Block, tally: Tally) -> None:
    """Balls are where their clump has them, and move as it does. Bound: rounding; of orientations that of all steps."""
    run = block.run
    x, q, v, w = rigid.placed(run, block.x1, block.q1, block.c1)
    reach = run.clumps.reach[run.clump_of[run.in_clump]]
    fast = forces.absolute(block)[:, run.in_clump]
    spin = recorded.pushes(block)[1] / run.inertia + np.maximum(norm(block.w0), norm(block.w1))
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


class Laws:
    """Of all clumps in a block: (B, C)."""

    def __init__(self, block: Block, apart: Bool) -> None:
        self.block, self.clumps, self.apart = block, block.run.clumps, apart
        self.old, self.new = block.c0, block.c1
        self.momenta = [self.clumps.momenta(rows) for rows in (self.old, self.new)]
        self.sums, self.flights = forces.of_contacts(block), flights.of_block(block)
        #: Whether contacts may have acted on it, one of which what is left is on record.
        self.touched = ~apart & (self.clumps.sum(self.sums.count) > 0)
        self.rounding = rounding(block)[:, self.clumps.first]
        self.spin = np.maximum(norm(self.old[..., 10:]), norm(self.new[..., 10:]))
        self.dt, self.single = block.dt[:, None], block.single[:, None]
        #: Impulses of its contacts, and of the largest of all contacts, N s.
        self.struck = recorded.strokes(block)[0][:, self.clumps.first]
        self.largest = largest(block)[:, :1]
        (ways, way_bound), (turns, turn_bound) = self._position(), self._rotation()
        self.ways = Ways(
            [np.concatenate([ways, turn], axis=-1) for turn in turns],
            np.stack([way_bound, turn_bound], axis=-1),
        )

    def judge(self, tally: Tally, known: Bool) -> None:
        """Momenta and ways of those that are `known`."""
        block = self.block
        for kind, (value, bound) in (("momentum", self._momentum()), ("spin", self._spin())):
            tally.measure(kind, value, bound, block.per_clump, known)
        off, bound = self.ways.off, self.ways.bound
        ways, turns = (np.minimum(*(norm(of[..., part]) for of in off)) for part in (slice(3), slice(3, 6)))
        tally.measure("position", ways, bound[..., 0], block.per_clump, known)
        told = ~self.touched | self.single
        why = "contacts turned a clump in one of several steps, or of parts of one, between the frames"
        block.skip(tally, "rotation", why, np.nonzero(known & ~told)[0])
        tally.measure("rotation", turns, bound[..., 1], block.per_clump, known & told)

    def _momentum(self) -> tuple[F64, F64]:
        block, clumps, first = self.block, self.clumps, self.clumps.first
        old, new, of_box = self.old[..., 7:10], self.new[..., 7:10], carried.of_block(block)
        mass = clumps.mass[:, None]
        weight = mass * (block.run.gravity * self.dt[..., None] + of_box.velocity[:, first])
        pulled, loose = self.flights.push, self.flights.push_off
        value = norm(mass * (new - old) - weight - pulled - clumps.sum(self.sums.impulse))
        size = (
            clumps.mass * (norm(old) + norm(new)) + norm(weight) + norm(pulled) + clumps.sum(self.sums.size)
        )
        return value, self.rounding * (size + self.largest) + loose + clumps.mass * of_box.slack[:, first]

    def _spin(self) -> tuple[F64, F64]:
        block, s, clumps = self.block, self.sums, self.clumps
        angle = self._corrected()
        moments = (turning.moment(block, s.impulse, own) for own in s.moments)
        value = np.minimum(*(self._off(given, angle) for given in moments))
        arm = np.zeros(block.run.bodies)
        arm[clumps.balls] = clumps.arm
        pushed = clumps.sum(s.size * arm)
        own = 2.0 * clumps.most * self.spin
        size = own + pushed + clumps.sum(s.moment_size)
        size = size + np.where(self.touched, clumps.reach * self.largest, 0.0)
        bound = (
            self.rounding * (size + norm(self.flights.kick)) + clumps.sum(s.turned) + self.flights.kick_off
        )
        bound = bound + TURNED * EPS * block.updates[:, None] * own
        # Impulses of several steps may cancel in their sum: the normal ones do not.
        index = block.run.law_index(block.rows.a, block.rows.b)
        mu = np.nan_to_num(block.run.friction(index, np.zeros(len(index)))).max(initial=0.0)
        if not block.run.has_impacts:  # of loads and impacts together nothing tells which is which
            several = (block.over(block.run.steps["impact_problems"]) > 1)[:, None]
            off = norm(flights.half_way(block)[:, :-1])
            bound = bound + np.where(several, clumps.sum(off * s.size), 0.0)
        angle = np.where(self.single, 0.0, np.minimum(self._rate() * self.dt, 2.0))
        struck = np.maximum(pushed * (1.0 + 2.0 * mu), self.struck * clumps.reach)
        return value, bound + angle * struck

    def _off(self, given: F64, angle: F64) -> F64:
        """By how much the momentum before impacts is off, that at the end less what contacts gave: its size, and its
        direction beyond the angle by which corrections of positions may have turned it.
        """
        # What joints answered to contacts is turned by no correction.
        answered = turning.before(self.block).answered
        before = self.momenta[1] - given - answered
        first = self.momenta[0] + self.flights.kick - answered
        size = norm(first)
        beyond = norm(before - first) - angle * size
        # Nor is what they gave to mend velocities once positions were corrected.
        given_by = 2.0 * angle * norm(turning.by_loads(self.block))
        return np.maximum(np.abs(norm(before) - size) - given_by, beyond)

    def _corrected(self) -> F64:
        """By how much corrections of positions may turn it at most, rad.

        Those may take back what loads have turned it by, too, of which nothing is left on record: about that of its own.
        """
        clumps, run = self.clumps, self.block.run
        own = run.h * clumps.mass * clumps.over(np.maximum, closing.fall(self.block))
        found = np.where(self.touched, self._turned(own) / clumps.least, 0.0)
        if not run.joints:
            return found
        # Of joints no multiplier of positions is on record; but where the clump is found shows their turn.
        q = self.new[..., 3:7], conjugate(self.flights.rows[..., 3:7])
        seen = norm(rotation_vector(product(*q))) + self.rounding
        seen = seen + clump_loads.of_block(self.block).turn_slack / clumps.least
        return found + np.minimum(of_loads(self.block).corrected[:, clumps.first], seen)

    def _turned(self, besides: F64 | float = 0.0) -> F64:
        """Moments that position impulses, those of loads and some `besides` have at most, N m s^2."""
        clumps, s = self.clumps, self.sums
        pushed = s.shift_size[:, clumps.first] + clumps.sum(_by_loads(self.block)) + besides
        return clumps.reach * pushed + clumps.sum(norm(s.shift_moments[0]))

    def _rate(self) -> F64:
        """How fast it turns at most, rad/s."""
        momentum = np.maximum(*map(norm, self.momenta))
        return np.asarray((momentum + self.struck * self.clumps.reach) / self.clumps.least)

    def _position(self) -> tuple[F64, F64]:
        """(B, C, 3) by how much centres are off, m, and may be, (B, C)."""
        block, clumps, first = self.block, self.clumps, self.clumps.first
        moved = self.sums.shift_size[:, first] / clumps.mass
        free = self.flights.rows[..., :3]
        value = self.new[..., :3] - free - clumps.sum(self.sums.shift) / clumps.mass[:, None]
        size = norm(self.old[..., :3]) + norm(self.new[..., :3]) + moved
        size = size + self.dt * (norm(self.old[..., 7:10]) + norm(self.new[..., 7:10]))
        size = size + np.where(self.touched, clumps.reach, 0.0)
        left = (block.left(norm(block.rows.position_impulse)) + block.floor)[:, None] / clumps.mass
        reach = np.where(self.single, 0.0, 2.0 * (self.struck * self.dt / clumps.mass + moved))
        bound = self.rounding * size + carried.of_block(block).slack_way[:, first]
        bound = bound + self.flights.way_off
        return value, bound + np.where(self.touched, left + reach, 0.0)

    def _rotation(self) -> tuple[list[F64], F64]:
        """(B, C, 3) by how much they are turned otherwise, rad, by either reading of the moments, and may be, (B, C)."""
        block, s, clumps = self.block, self.sums, self.clumps
        free, q = self.flights, self.new[..., 3:7]
        off = rotation_vector(product(q, conjugate(free.rows[..., 3:7])))
        given = (clumps.turning(q, turning.moment(block, s.shift, own)) for own in s.shift_moments)
        value = [off - psi for psi in given]
        ratio = clumps.most / clumps.least
        way = self.dt * self.spin * ratio
        bound = self.rounding * (8.0 + way) * ratio + free.off
        angle = self._turned() / clumps.least
        doubt = clumps.sum(s.shift_turned + s.shift_again * solved_again(block)[:, None]) / clumps.least
        # Of forces and moments each by itself: no less than of both.
        left, turned = (
            block.left(norm(of)) for of in (block.rows.position_impulse, block.rows.position_moment)
        )
        left = ((left + block.floor)[:, None] * clumps.reach + turned[:, None]) / clumps.least
        turns = 2.0 * ratio * (way + angle) * angle
        return value, bound + np.where(self.touched, doubt + left + turns, 0.0)
