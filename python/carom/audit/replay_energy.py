"""Energy in a replay of impact problems: the works of contacts, and rule R4 (no problem is a source of energy)."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import bounds, flights, works
from carom.audit.block import Block
from carom.audit.hits import Hits, groups
from carom.audit.rates import Rates, rates
from carom.audit.replay_motion import Motion
from carom.audit.vectors import EPS, add_at, dot, norm


class Energy(Motion):
    """Works of the rows, and what the laws say of them."""

    def __init__(self, block: Block, r: Hits, kept: Bool, end: Bool) -> None:
        super().__init__(block, r, kept, end)
        #: (K, 4) works of each row, J.
        self.work = np.zeros((len(r), 4))
        #: (B,) what the compression of Poisson's law took, J.
        self.spent = np.zeros(block.count)

    def works_of_loads(self, rows: slice, at: I64, change: F64) -> None:
        """Works of the loads, of which those count that no impact took back."""
        a, b = (of[rows] for of in self.at)
        self.scratch[at] = change
        ends = [
            (u[:, :3], u[:, 3:], v[:, :3], v[:, 3:])
            for u, v in (
                (self.now[a], self.now[b]),
                (self.now[a] + self.scratch[a], self.now[b] + self.scratch[b]),
            )
        ]
        self.scratch[at] = 0.0
        run, r, pairs, lever = self.block.run, self.r.of(rows), self.pairs[1].of(rows), self.lever[rows]
        if run.loads_once:
            middle = [flights.at_half_way(self.block, r.k, r.a, r.b, motion) for motion in ends]
            found = works.along_mean(self.block, r.k, pairs, r.impulse, r.moment, self.first[rows], middle)
        else:
            before, after = (rates(run, pairs, motion, r.normal, lever) for motion in ends)
            found = works.done(self.push[rows], self.slide[rows], r.moment, lever, before, after)
        self.work[rows] = np.where(self.kept[rows, None], found, 0.0)

    def tell_works(self) -> None:
        """Works of a contact over all its rows, told of the last of these."""
        block, r, c = self.block, self.r, self.block.rows
        contact, known = r.contacts(block)
        rows = np.flatnonzero(known & block.kept[r.k])
        summed, spread = np.zeros((len(c), 4)), np.zeros(len(c))
        add_at(summed, (contact[rows],), self.work[rows])
        np.add.at(spread, contact[rows], works.bound(block, r)[rows])
        last = np.full(len(c), -1)
        np.maximum.at(last, contact[rows], rows)
        mine = np.flatnonzero(last >= 0)
        value = np.abs(c.work[mine] - summed[mine]).max(axis=1, initial=0.0)
        order = np.argsort(last[mine])
        self.tell("work", last[mine][order], value[order], spread[mine][order])

    def energy(self, rows: slice, moved: tuple[I64, F64], rho: F64, before: Rates, after: Rates) -> None:
        """Rule R4 in each problem: works of impulses by the mean of the velocities before and after them.

        Bound: `bounds.gain` of the kinetic energy of the bodies that the problem moves; and what a residual `rho` (`bounds`)
        can do, which is at most `rho` times the velocities after the problem and those of `2 D_cc` times the impulses.
        """
        block, run, r, count = self.block, self.block.run, self.r.of(rows), self.block.count
        at, change = moved
        if not run.guarded:
            return

        def total(values: F64) -> F64:
            return np.bincount(r.k, values, minlength=count).astype(np.float64)

        pushed = 0.5 * self.push[rows] * (before.normal + after.normal)
        slid = 0.5 * dot(self.slide[rows], before.slip + after.slip)
        work = pushed + slid + 0.5 * dot(r.moment, before.turning + after.turning)
        # A wall moves at most with what the ball has against it and by itself.
        moving = self.driven[rows]
        now = self.now[self.at[0][rows], :3]
        driven = run.mass[r.a] * (before.normal**2 + norm(before.slip) ** 2 + dot(now, now))
        each = 0.5 * np.einsum("ij,ij,ij->i", self.inertia[at], self.now[at], self.now[at])
        if run.clumps:  # of which each ball has a share
            mine = np.flatnonzero(run.in_clump[at % run.bodies])
            share = run.clumps.many[run.clump_of[at[mine] % run.bodies]]
            each[mine] = flights.energy_of_balls(block, at[mine], self.now[at[mine]]) / share
        kinetic = np.bincount(at // run.bodies, each, minlength=count) + total(np.where(moving, driven, 0.0))
        given = 2.0 * self.compliance[1][rows] * norm(r.impulse)
        fast = np.sqrt(total(after.normal**2 + norm(after.slip) ** 2)) + np.sqrt(total(given**2))
        bound = bounds.gain(self.block) * kinetic + rho * fast
        bound = bound + 64.0 * EPS * (kinetic + total(np.abs(work)))
        # Told of the row with the largest impulse.
        largest = np.lexsort((norm(r.impulse), r.k))
        largest = np.sort(largest[np.flatnonzero(np.append(np.diff(r.k[largest]), 1))])
        k, first = np.unique(r.k, return_index=True)
        gained = since = total(work)
        if r.problem[0] == 1:
            # From the velocities that the loads have left, less what those did that are solved anew.
            loads, motion = self.r.problem == 0, self.now.copy()
            motion[at] += change
            anew = np.flatnonzero(loads & ~self.kept)
            # What remains of them is answered anew: nothing holds the joints before this problem.
            redone = self.answering & (np.bincount(self.r.k, loads, minlength=count) > 0)
            # Who has given up restitution is not asked whether the loads alone had left less.
            given_up = np.zeros(len(motion), dtype=bool)
            ends = self.at[0], np.where(self.r.b < run.bodies, self.at[1], self.at[0])
            for of in ends:
                given_up[of[rows][r.scale == 0.0]] = True
            run.clumps.share(np.logical_or, given_up.reshape(count, -1))
            asked = ~(given_up[ends[0]] | given_up[ends[1]])
            since = total(self._work_since(rows, motion) * asked[rows])
            since = since - np.bincount(
                self.r.k[anew], self._work_since(anew, motion) * asked[anew], minlength=count
            )
            # Friction on clumps may take less in an impact than the loads would: restitution alone is held to these.
            restores = run.restitution(self.law[rows], np.maximum(-before.normal, 0.0)) > 0.0
            of_clumps = np.append(run.in_clump, False)
            clumped = of_clumps[r.a] | of_clumps[np.minimum(r.b, run.bodies)]
            loose = (np.bincount(r.k, clumped, minlength=count) > 0) & (
                np.bincount(r.k, restores, minlength=count) == 0
            )
            since = np.where(loose, gained, since)
            gained = np.where(redone, since, np.maximum(gained, since))
        if run.impact_law.restitution == "poisson":
            # An expansion gives back what its compression took.
            gained = since = since + (self.spent if r.problem[0] > 1 else 0.0)
            self.spent = since
        value = np.maximum(gained, 0.0)
        # Restitution is taken back as far as there is no gain, and no further.
        taken = (np.minimum.reduceat(r.scale, first) > 0.0) & (np.maximum.reduceat(r.scale, first) < 1.0)
        # (A collective impact may have less; how much less, a solution without restitution would tell.)
        taken &= run.impact_law.restitution == "newton" and not run.ends(r.problem[:1])[0]
        # (So may a group beside another one: they have one share where they would close a contact between them.)
        each = np.unique(np.stack([r.k, groups(self.block, r)]), axis=1)[0]
        shares = np.unique(np.stack([r.k.astype(np.float64), r.scale]), axis=1)[0].astype(np.int64)
        taken &= (np.bincount(each, minlength=count) == np.bincount(shares, minlength=count))[k]
        value[k[taken]] = np.maximum(value, np.abs(since))[k[taken]]
        self.tell("passivity", rows.start + largest, value[k], bound[k])

    def _work_since(self, rows: slice | I64, motion: F64) -> F64:
        """(K,) works of rows by the mean of the velocities that the loads have left and those of a `motion`."""
        a, b = (of[rows] for of in self.at)
        r, run = self.r.of(rows), self.block.run
        if run.loads_once and len(r) and r.problem[0] == 0:
            ends = [(of[a, :3], of[a, 3:], of[b, :3], of[b, 3:]) for of in (self.loaded, motion)]
            middle = [flights.at_half_way(self.block, r.k, r.a, r.b, of) for of in ends]
            pairs = self.pairs[1].of(rows)
            found = works.along_mean(self.block, r.k, pairs, r.impulse, r.moment, self.first[rows], middle)
            return np.asarray(found.sum(axis=1))
        first, last = (self.rates(rows, (of[a], of[b])) for of in (self.loaded, motion))
        found = works.done(self.push[rows], self.slide[rows], r.moment, self.lever[rows], first, last)
        return np.asarray(found.sum(axis=1))
