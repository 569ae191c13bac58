"""Newton's law at every recorded impact, by a replay of the impact problems of a step.

From `V = v_{n+1}` less what all impulses gave (`answers`: joints, dampers and drag answer them), the velocities that the
loads have left, the impulses of problem after problem are added. Before each problem the recorded approach, after it the
recorded separation must be those of `V`; and where a contact has an impulse

    gamma_N^+ = -s e_N min(0, G_N V^-),   V^- = v_n + (W - W_0)       (eqs. 16, 24, 27; algorithm, section 5)

with the jump `W` by the problems before, `W_0` that of problem 0 (loads), `s` the recorded share of restitution. Where
0 < s < 1 this is the least that `gamma_N^+` may be, and friction is anywhere in its cone. Else friction is held against
`z_T = gamma_T^+ + s e_T G_T V^-` as in `cones`. The contacts of a problem do no work together (rule R4), the first one
counted from the motion that problem 0 has left. It takes back what joints and loads answered to impulses of problem 0 that
remain, and answers them anew. The problem that ends a sequence which was cut obeys the same law; that of
`sequence-paper` has no restitution. By Poisson's law the first problem has none, and the second gives at least e_N of the
impulses of compression (`compression`). An impact through springs is no contact problem: energy, cones and speeds of it
are judged. It only adds to the loads, with what joints answered to them, and problem 2 after it has no restitution. One that
was cut goes on by Newton's law: problems 2, 3, ... of its bodies have it.
Bounds: `bounds`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import answers, bounds, carried, compression, flights, forces, loads_once, turning, works
from carom.audit.block import Block
from carom.audit.centres import at_walls
from carom.audit.cohesion import on_bodies
from carom.audit.cones import KEPT, opposed, turned
from carom.audit.hits import Hits, after_cut, groups, pairs, place
from carom.audit.loads import of_loads, turned_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Tally
from carom.audit.vectors import EPS, across, add_at, cross, dot, norm


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


def judge(block: Block, tally: Tally, r: Hits, kept: Bool, group: I64) -> None:
    """The impact problems of the whole steps of a block; `kept` are the rows of problem 0 whose impulses remained
    (`hits.kept`), `group` numbers those that balls join (`hits.groups`). Rows of piles, at either level, are of the frame of
    `t_{n+1}`, others of that of `t_n` (`forces`). Which islands were solved as piles the files do not say for sure: where a
    step may have had one, a row may be of either frame, and the better one counts. The other is tried where the likelier
    one finds fault.
    """
    order = np.argsort(r.problem, kind="stable")
    r, kept, group = r.of(order), kept[order], group[order]
    either = (block.piled | block.cascaded) & (block.run.method != "moreau")
    end = either[r.k]
    if end.any():
        end = end & (pairs(block, r, group) > block.least)
    found, pressed = _read(block, r, kept, end, np.zeros(len(r), dtype=bool), None)
    if pressed is not None:
        # Who is blamed by impulses of compression is asked whether these are the only ones.
        blamed = [found[kind].blamed for kind in ("impact", "slip") if kind in found]
        joined = groups(block, r)
        doubted = np.isin(joined, joined[np.concatenate(blamed)]) & (pressed.unknown == "")
        if doubted.any():
            found, pressed = _read(block, r, kept, end, doubted, pressed)
    where = place(block, r)
    block.skip_companions(tally, "impact", r.k)
    if block.run.impact_law.restitution == "energetic":
        why = "no contact problem stands for an impact through springs"
        tally.skip("impact", why, "another impact law", int((r.problem == 1).sum()))
    if pressed is not None:
        causes, counts = np.unique(pressed.unknown[r.problem > 1].astype(str), return_counts=True)
        for cause, count in zip(causes, counts, strict=True):
            for kind in ("impact", "slip") if cause else ():
                why = f"how far Poisson's law expands {cause} is not computed"
                tally.skip(kind, why, "fewer bodies at once, or another impact law", int(count))
    for kind, told in found.items():
        tally.measure(kind, told.value, told.bound, lambda i, rows=told.rows: where(int(rows[i])))  # type: ignore[misc]


def _read(
    block: Block, r: Hits, kept: Bool, end: Bool, doubted: Bool, known: compression.Compression | None
) -> tuple[dict[str, Told], compression.Compression | None]:
    """What the laws say of the rows in the likelier of their frames (`end`), and in the other where that finds fault;
    `doubted`, `known`: see `compression.of_rows`.
    """
    either = (block.piled | block.cascaded) & (block.run.method != "moreau")
    replay = Replay(block, r, kept, end, (doubted, known))
    found = replay.run_all()
    doubt = np.zeros(block.count, dtype=bool)
    for told in found.values():
        doubt[r.k[told.blamed]] = True
    again = np.flatnonzero((doubt & either)[r.k])
    if again.size:
        other = Replay(block, r.of(again), kept[again], ~end[again], (doubted[again], None)).run_all()
        found.update({kind: _better(found[kind], other[kind], again) for kind in found if kind in other})
    return found, replay.pressed


def _better(one: Told, other: Told, again: I64) -> Told:
    """Of the rows `again`, which were read in another way too, the reading that fits better. Whether a slow contact restores
    slip may be sure in one of them alone: then nothing is reported.
    """
    rows = one.rows, again[other.rows]
    size = max((int(of.max(initial=-1)) for of in (*rows, again)), default=-1) + 1
    worst = np.full((2, size), -np.inf)
    for ratio, at, told in zip(worst, rows, (one, other), strict=True):
        np.maximum.at(ratio, at, told.value / np.maximum(told.bound, 1e-300))
    twice = np.isfinite(worst).all(axis=0)
    second = twice & (worst[1] < worst[0])
    first = twice & ~second
    first[np.setdiff1d(np.arange(size), again)] = True
    mine, theirs = one.of(first[rows[0]]), other.of(second[rows[1]])._replace(rows=rows[1][second[rows[1]]])
    return Told(*(np.concatenate(part) for part in zip(mine, theirs, strict=True)))


class Replay:
    """The impact problems of all whole steps of a block, problem after problem: islands of a step share no bodies.

    Rows are in the order of their problems. `end` (K,): tangential rows in the frame of `t_{n+1}`, and not in that of `t_n`.
    Motions are (B N, 6), velocity and angular velocity of each body in each interval.
    """

    def __init__(
        self, block: Block, r: Hits, kept: Bool, end: Bool, asked: tuple[Bool, compression.Compression | None]
    ) -> None:
        self.block, self.r, self.kept = block, r, kept
        self.told: dict[str, list[Told]] = {}
        #: The first impact problem drops what joints and loads answered to the loads; springs and Poisson's law add to it.
        self.anew = block.run.impact_law.restitution not in ("energetic", "poisson")
        self.work = np.zeros((len(r), 4))
        self.spent = np.zeros(block.count)
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
        where, gained = self._moved(given)
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
        self.pressed: compression.Compression | None = None
        if run.impact_law.restitution == "poisson":
            whole, joined = slice(0, len(r)), groups(block, r)
            before = self._rates(whole, (self.old[self.at[0]], self.old[self.at[1]]), old=True)
            causes = (
                (answering[r.k], "groups with joints or dampers"),
                (np.append(run.in_clump, False)[r.a], "groups with clumps"),
                (np.append(run.in_clump, False)[np.minimum(r.b, run.bodies)], "groups with clumps"),
            )
            self.pressed = compression.of_rows(
                run, r, joined, self.lever, (before.normal, before.slip), self.mu, causes, *asked
            )

    def run_all(self) -> dict[str, Told]:
        """Problem 0, then 1, 2, ...; what the laws say of each."""
        r, solved = self.r, np.zeros(self.block.count)
        numbers, first = np.unique(r.problem, return_index=True)
        begin = int(np.searchsorted(r.problem, 1))
        loads = slice(0, begin)
        at, offset = self._moved(loads)
        before = self._terms(loads, at, offset)
        remained = np.flatnonzero(self.kept[loads])
        at_kept, change = self._moved(remained, free=self.anew)
        chosen = np.append(remained, np.arange(begin, int(np.searchsorted(r.problem, 2))))
        at_first, first_change = self._moved(chosen)
        then = self._terms(chosen, at_first, first_change)
        self.scratch[at_kept] = change
        first_change -= self.scratch[at_first]
        self.scratch[at_kept] = 0.0
        # Before the first problem V^- is v_n itself, also where it took impulses of the loads back.
        minus = self.old.copy()
        minus[at] -= offset
        minus[at_kept] += change
        for problem, low, high in zip(numbers, first, [*first[1:], len(r)], strict=True):
            rows = slice(int(low), int(high))
            if problem > 0:
                solved = before if problem == 1 else np.maximum(before, then)
            where, own = (at_first, first_change) if problem == 1 else self._moved(rows)
            self._problem(rows, where, own, solved, minus if problem > 1 else self.old)
            if problem == 0:
                self.loaded = self.now.copy()
                self.loaded[where] += own
                where, own = at_kept, change
                self._works(rows, where, own)
            else:
                minus[where] += own
            self.now[where] += own
        self._tell_works()
        self._tell_missing()
        return {
            kind: Told(*map(np.concatenate, zip(*parts, strict=True))) for kind, parts in self.told.items()
        }

    def _works(self, rows: slice, at: I64, change: F64) -> None:
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

    def _tell_works(self) -> None:
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
        self._tell("work", last[mine][order], value[order], spread[mine][order])

    def _tell_missing(self) -> None:
        """Contacts that were compressed have a row of the expansion, where no restitution was taken back in the step.

        Rule R4 takes all of it back, and leaves no row that says so, where bodies have none of the compression either: the
        loads hold them at rest, and any expansion is a gain.
        """
        if self.pressed is None:
            return
        run, r, first = self.block.run, self.r, self.pressed.first
        expanded = np.isin(first, first[r.problem > 1])
        whole = run.steps["restitution_scale"][r.step - 1] == 1.0
        struck, ball = np.zeros(len(self.now), dtype=bool), r.b < run.bodies
        of_impacts = r.problem > 0
        struck[self.at[0][of_impacts]] = struck[self.at[1][of_impacts & ball]] = True
        held = ~struck[self.at[0]] & ~(struck[self.at[1]] & ball)
        rows = np.flatnonzero((first == np.arange(len(r))) & ~expanded & whole & ~held)
        normal, own = self.pressed.normal[rows], self.compliance[0][rows]
        least = self._least(rows, normal)[0]
        left = 8.0 * self.block.tolerance[r.k[rows]] * self.plain[r.k[rows]]
        bound = (
            2.0 * own * left * (1.0 + np.nan_to_num(self.pressed.gain[rows]))
            + 64.0 * EPS * self.top[r.k[rows]]
        )
        self._tell("impact", rows, own * np.nan_to_num(least), bound)

    def _least(self, rows: slice | I64, normal: F64) -> tuple[F64, F64]:
        """(K,) normal impulses of expansion at least, of those of compression, and the approach speeds of these."""
        run, index = self.block.run, self.law[rows]
        speed = normal * self.compliance[0][rows]
        acts = (speed > 0.0) & (speed >= run.options["restitution_threshold"])
        return np.where(acts, run.restitution(index, speed), 0.0) * normal, speed

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

    def _moved(self, rows: slice | I64, *, free: bool = False) -> tuple[I64, F64]:
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

    def _shared(self, rows: slice) -> I64:
        """(K,) how many rows act on one of both bodies, the larger number."""
        a, b = (at[rows] for at in self.at)
        # What does not move has no rows in common.
        moves = self.r.b[rows] < self.block.run.bodies
        ends = np.concatenate([a, np.where(moves, b, -1 - np.arange(len(b)))])
        _, which, many = np.unique(ends, return_inverse=True, return_counts=True)
        shared: I64 = many[which].reshape(2, -1).max(axis=0)
        return shared

    def _terms(self, rows: slice | I64, at: I64, change: F64) -> F64:
        """(B,) `bounds.terms` of some rows and of the velocities that they change."""
        return bounds.terms(self.block, self.r.k[rows], self.squares[rows], at, change * self.inertia[at])

    def _rates(
        self, rows: slice | I64, motion: tuple[F64, F64], *, old: bool = False, printed: bool = False
    ) -> Rates:
        """At some rows for motions of their bodies, (K, 6); `old`: walls as at t_n; `printed`: all of t_n."""
        p = (self.printed if printed else self.pairs[0 if old else 1]).of(rows)
        (a, b), lever = motion, self.lever[rows]
        normal = lever if printed else self.r.normal[rows]
        return rates(self.block.run, p, (a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]), normal, lever)

    def _problem(self, rows: slice, at: I64, change: F64, solved: F64, before_impact: F64) -> None:
        """One problem of every step, which changes the velocities of the bodies `at`; `before_impact` is V^-."""
        run, r = self.block.run, self.r.of(rows)
        a, b = (of[rows] for of in self.at)
        now = self.now[a], self.now[b]
        before = self._rates(rows, now)
        self.scratch[at] = change
        after = self._rates(rows, (now[0] + self.scratch[a], now[1] + self.scratch[b]))
        self.scratch[at] = 0.0
        minus = self._rates(rows, (before_impact[a], before_impact[b]), old=True)
        rho = bounds.left(self.block, self.plain, self._terms(rows, at, change), solved, self.speed)
        turned_by = turned_loads(self.block, r.k, self.first[rows], r.normal) if r.problem[0] == 0 else 0.0
        left, own, push = (
            rho[r.k] + turned_by + self.swung[rows],
            [of[rows] for of in self.compliance],
            self.push[rows],
        )
        weight = self.loads_give[r.k]
        scale = self.top[r.k]
        # Speeds follow from recorded impulses to rounding, and to the residual of all rows of both bodies: the solver's
        # speeds belong to multipliers before their last projection, and recorded impulses are after it.
        noise = 64.0 * EPS * (own[1] * norm(r.impulse) + scale + weight)
        told = np.maximum(np.abs(before.normal - r.approach), np.abs(after.normal - r.separation))
        every = np.arange(rows.start, rows.stop)
        of_all = 2.0 * own[0] * np.sqrt(self._shared(rows)) * left
        self._tell("impact speeds", every, told, 10.0 * noise + of_all)
        o, index = run.options, self.law[rows]
        newtons, printed = (run.impact_law.restitution == law for law in ("newton", "printed"))
        acts = (r.problem > 0) & (newtons | self.cut[rows] | (printed & ~run.ends(r.problem)))
        restores = acts & ~self.cut[rows]  # springs restore no slip, nor what goes on after them
        e_t = np.where(restores, run.coefficient("tangential_restitution", index), 0.0)
        towards = minus.normal
        if printed:
            towards = self._rates(rows, (before_impact[a], before_impact[b]), printed=True).normal
        else:
            acts &= -towards >= o["restitution_threshold"]
            # Whether a contact that hardly approaches restores slip is for the closing tolerance to say.
            clear = towards < -(weight + 1e-6 * scale)
            e_t = np.where(clear | (e_t == 0.0), e_t, np.where(towards >= 0.0, 0.0, np.nan))
            towards = np.minimum(towards, 0.0)
        e_n = np.where(acts, run.restitution(index, -towards), 0.0)
        unsure = self.unsure[rows]
        # Between the solutions without restitution and with it (rule R4) nothing closes, no more.
        given, slip, spread = self._expansion(rows, own, left)
        e_t = np.where(np.isnan(given), np.nan, e_t)
        scaled = (r.scale > 0.0) & (r.scale < 1.0)
        if scaled.any():
            # What balls join has one share.
            joined = groups(self.block, r)
            low, high = (np.full(joined.max() + 1, start) for start in (1.0, 0.0))
            np.minimum.at(low, joined, r.scale)
            np.maximum.at(high, joined, r.scale)
            self._tell("counts", every, high[joined] - low[joined], np.zeros(len(every)))
        remaining = np.where(scaled | np.isnan(given), 0.0, push - np.nan_to_num(given))
        value = bounds.misfit(after.normal + r.scale * e_n * towards, remaining, own[0])
        value = np.where(unsure, np.minimum(value, bounds.misfit(after.normal, remaining, own[0])), value)
        short = own[0] * np.maximum(np.nan_to_num(given) - push, 0.0)
        value = np.where(scaled, value, np.maximum(value, short))
        if run.loads_once and r.problem[0] == 0:
            # Loads are not solved again where their normals turned by next to nothing since.
            fast = [norm(of[:, :3]) + run.radius[r.a] * norm(of[:, 3:]) for of in now]
            fast[1] = np.where(r.b < run.bodies, fast[1], 0.0)
            noise = noise + 2.0 * KEPT * run.loosest["closing_tolerance_speed"] * (fast[0] + fast[1])
        left_speed = 2.0 * own[0] * left + noise
        begun = r.scale * self.begun[rows]
        rebound = e_n * begun + run.rebound(index, -towards, left_speed + begun)
        self._tell("impact", every, value, left_speed + own[0] * spread + rebound)
        mu = self.mu[rows]
        z = after.slip + slip + (r.scale * np.nan_to_num(e_t))[:, None] * minus.slip
        most = mu * np.maximum(push, 0.0)
        restored = np.abs(np.nan_to_num(e_t)) * begun
        defect = opposed(self.slide[rows], z, most, 2.0 * own[1] * left + noise + own[1] * spread + restored)
        sure = np.flatnonzero(np.isfinite(e_t) & (mu > 0.0) & ~scaled)
        limit = (left * (1.0 + mu) + 64.0 * EPS * norm(r.impulse))[sure]
        self._tell("slip", every[sure], defect[sure], limit)
        if r.problem[0] > 0:
            self.work[rows] = works.done(push, self.slide[rows], r.moment, self.lever[rows], before, after)
        self._turning(rows, left, after, np.flatnonzero(~scaled))
        self._energy(rows, (at, change), rho, before, after)
        reach = np.abs(self.now[at]) + np.abs(change)
        k, body = np.divmod(at, run.bodies)
        np.maximum.at(self.top, k, norm(reach[:, :3]) + run.radius[body] * norm(reach[:, 3:]))

    def _expansion(self, rows: slice, own: list[F64], left: F64) -> tuple[F64, F64, F64]:
        """Least normal impulses (K,) and what is added to the slip (K, 3) by Poisson's law, not a number where they are not
        known; how much the solver's may differ. None but in an expansion.
        """
        run, r, index = self.block.run, self.r.of(rows), self.law[rows]
        least, slip, spread = np.zeros(len(r)), np.zeros((len(r), 3)), np.zeros(len(r))
        if self.pressed is None or r.problem[0] < 2:
            return least, slip, spread
        normal, sliding = self.pressed.normal[rows], self.pressed.sliding[rows]
        least, speed = self._least(rows, normal)
        e_t = run.coefficient("tangential_restitution", index)
        slip = -(e_t * own[1])[:, None] * np.nan_to_num(sliding)
        spread = np.nan_to_num(self.pressed.gain[rows]) * 2.0 * left
        spread = spread + run.rebound(index, speed, own[0] * spread) / own[0]
        spread = np.where(np.isnan(spread), np.inf, spread)  # how far it expands is not known
        # The safeguard may have taken the expansion back.
        return r.scale * least, r.scale[:, None] * slip, spread

    def _turning(self, rows: slice, left: F64, after: Rates, sure: I64) -> None:
        """Moments of a problem in their bounds, and against the motion after it: these know no restitution."""
        run, r, push, lever = self.block.run, self.r.of(rows), self.push[rows], self.lever[rows]
        moment = r.moment
        if run.loads_once and r.problem[0] == 0:
            moment = loads_once.along_mean(moment, self.first[rows], r.normal).stated
        for kind, name in (("rolling cone", "rolling_radius"), ("spinning cone", "spinning_radius")):
            size = norm(across(moment, lever)) if name == "rolling_radius" else np.abs(dot(moment, lever))
            beyond = size - run.coefficient(name, self.law[rows]) * np.maximum(push, 0.0)
            bound = left * run.radius[r.a] + 16.0 * EPS * norm(moment)
            self._tell(kind, np.arange(rows.start, rows.stop), np.maximum(beyond, 0.0), bound)
        spin = self.top[r.k] / run.radius[r.a]
        found = turned(run, (r.a, r.b), (push, moment, lever), after.turning, left, spin)
        chosen = sure[found.any[sure]]
        self._tell(
            "roll",
            rows.start + chosen,
            found.value[chosen],
            found.bound[chosen] + 64.0 * EPS * norm(moment)[chosen],
        )

    def _tell(self, kind: str, rows: I64, value: F64, bound: F64) -> None:
        if kind in ("impact", "slip", "roll"):
            springs = self.block.run.impact_law.restitution == "energetic"
            lawful = ~self.block.companion[self.r.k[rows]] & ~(springs & (self.r.problem[rows] == 1))
            rows, value, bound = rows[lawful], value[lawful], bound[lawful]
        self.told.setdefault(kind, []).append(Told(rows, value, bound))

    def _energy(self, rows: slice, moved: tuple[I64, F64], rho: F64, before: Rates, after: Rates) -> None:
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
        self._tell("passivity", rows.start + largest, value[k], bound[k])

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
        first, last = (self._rates(rows, (of[a], of[b])) for of in (self.loaded, motion))
        found = works.done(self.push[rows], self.slide[rows], r.moment, self.lever[rows], first, last)
        return np.asarray(found.sum(axis=1))
