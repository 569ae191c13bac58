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

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import bounds, compression, loads_once, works
from carom.audit.block import Block
from carom.audit.cones import kept, opposed, turned
from carom.audit.hits import Hits, groups, pairs, place
from carom.audit.loads import turned_loads
from carom.audit.rates import Rates
from carom.audit.replay_energy import Energy
from carom.audit.replay_motion import Told
from carom.audit.report import Tally
from carom.audit.vectors import EPS, across, dot, norm


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


class Replay(Energy):
    """Newton's law and its neighbours, problem after problem; `asked`: see `compression.of_rows`."""

    def __init__(
        self, block: Block, r: Hits, kept: Bool, end: Bool, asked: tuple[Bool, compression.Compression | None]
    ) -> None:
        super().__init__(block, r, kept, end)
        run = block.run
        #: The first impact problem drops what joints and loads answered to the loads; springs and Poisson's law add to it.
        self.anew = run.impact_law.restitution not in ("energetic", "poisson")
        self.pressed: compression.Compression | None = None
        if run.impact_law.restitution == "poisson":
            whole, joined = slice(0, len(r)), groups(block, r)
            before = self.rates(whole, (self.old[self.at[0]], self.old[self.at[1]]), old=True)
            causes = (
                (self.answering[r.k], "groups with joints or dampers"),
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
        at, offset = self.moved(loads)
        before = self.terms(loads, at, offset)
        remained = np.flatnonzero(self.kept[loads])
        at_kept, change = self.moved(remained, free=self.anew)
        chosen = np.append(remained, np.arange(begin, int(np.searchsorted(r.problem, 2))))
        at_first, first_change = self.moved(chosen)
        then = self.terms(chosen, at_first, first_change)
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
            where, own = (at_first, first_change) if problem == 1 else self.moved(rows)
            self._problem(rows, where, own, solved, minus if problem > 1 else self.old)
            if problem == 0:
                self.loaded = self.now.copy()
                self.loaded[where] += own
                where, own = at_kept, change
                self.works_of_loads(rows, where, own)
            else:
                minus[where] += own
            self.now[where] += own
        self.tell_works()
        self._tell_missing()
        return {
            kind: Told(*map(np.concatenate, zip(*parts, strict=True))) for kind, parts in self.told.items()
        }

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
        self.tell("impact", rows, own * np.nan_to_num(least), bound)

    def _least(self, rows: slice | I64, normal: F64) -> tuple[F64, F64]:
        """(K,) normal impulses of expansion at least, of those of compression, and the approach speeds of these."""
        run, index = self.block.run, self.law[rows]
        speed = normal * self.compliance[0][rows]
        acts = (speed > 0.0) & (speed >= run.options["restitution_threshold"])
        return np.where(acts, run.restitution(index, speed), 0.0) * normal, speed

    def _problem(self, rows: slice, at: I64, change: F64, solved: F64, before_impact: F64) -> None:
        """One problem of every step, which changes the velocities of the bodies `at`; `before_impact` is V^-."""
        run, r = self.block.run, self.r.of(rows)
        a, b = (of[rows] for of in self.at)
        now = self.now[a], self.now[b]
        before = self.rates(rows, now)
        self.scratch[at] = change
        after = self.rates(rows, (now[0] + self.scratch[a], now[1] + self.scratch[b]))
        self.scratch[at] = 0.0
        minus = self.rates(rows, (before_impact[a], before_impact[b]), old=True)
        rho = bounds.left(self.block, self.plain, self.terms(rows, at, change), solved, self.speed)
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
        of_all = 2.0 * own[0] * np.sqrt(self.shared(rows)) * left
        self.tell("impact speeds", every, told, 10.0 * noise + of_all)
        o, index = run.options, self.law[rows]
        newtons, printed = (run.impact_law.restitution == law for law in ("newton", "printed"))
        acts = (r.problem > 0) & (newtons | self.cut[rows] | (printed & ~run.ends(r.problem)))
        restores = acts & ~self.cut[rows]  # springs restore no slip, nor what goes on after them
        e_t = np.where(restores, run.coefficient("tangential_restitution", index), 0.0)
        towards = minus.normal
        if printed:
            towards = self.rates(rows, (before_impact[a], before_impact[b]), printed=True).normal
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
            self.tell("counts", every, high[joined] - low[joined], np.zeros(len(every)))
        remaining = np.where(scaled | np.isnan(given), 0.0, push - np.nan_to_num(given))
        value = bounds.misfit(after.normal + r.scale * e_n * towards, remaining, own[0])
        value = np.where(unsure, np.minimum(value, bounds.misfit(after.normal, remaining, own[0])), value)
        short = own[0] * np.maximum(np.nan_to_num(given) - push, 0.0)
        value = np.where(scaled, value, np.maximum(value, short))
        fast, off = self._kept(rows, now)
        noise = noise + fast
        left_speed = 2.0 * own[0] * left + noise
        begun = r.scale * self.begun[rows]
        rebound = e_n * begun + run.rebound(index, -towards, left_speed + begun)
        self.tell("impact", every, value, left_speed + own[0] * spread + rebound)
        mu = self.mu[rows]
        z = after.slip + slip + (r.scale * np.nan_to_num(e_t))[:, None] * minus.slip
        most = mu * np.maximum(push, 0.0)
        restored = np.abs(np.nan_to_num(e_t)) * begun
        defect = opposed(self.slide[rows], z, most, 2.0 * own[1] * left + noise + own[1] * spread + restored)
        sure = np.flatnonzero(np.isfinite(e_t) & (mu > 0.0) & ~scaled)
        limit = (left * (1.0 + mu) + 64.0 * EPS * norm(r.impulse))[sure]
        self.tell("slip", every[sure], defect[sure], limit)
        if r.problem[0] > 0:
            self.work[rows] = works.done(push, self.slide[rows], r.moment, self.lever[rows], before, after)
        self._turning(rows, left, after, np.flatnonzero(~scaled), off)
        self.energy(rows, (at, change), rho, before, after)
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

    def _kept(self, rows: slice, now: tuple[F64, F64]) -> list[F64]:
        """(K,) how much slips, m/s, and relative angular velocities, rad/s, may be off after the loads (`cones.kept`)."""
        run, r = self.block.run, self.r.of(rows)
        share = kept(run) * (r.problem == 0)
        ball = r.b < run.bodies
        spins = [norm(of[:, 3:]) for of in now]
        radii = run.radius[r.a], run.radius[np.minimum(r.b, run.bodies - 1)]
        fast = [norm(of[:, :3]) + radius * spin for of, radius, spin in zip(now, radii, spins, strict=True)]
        return [of[0] * share + np.where(ball, of[1] * share, 0.0) for of in (fast, spins)]

    def _turning(self, rows: slice, left: F64, after: Rates, sure: I64, off: F64) -> None:
        """Moments of a problem in their bounds, and against the motion after it: these know no restitution."""
        run, r, push, lever = self.block.run, self.r.of(rows), self.push[rows], self.lever[rows]
        moment = r.moment
        if run.loads_once and r.problem[0] == 0:
            moment = loads_once.along_mean(moment, self.first[rows], r.normal).stated
        for kind, name in (("rolling cone", "rolling_radius"), ("spinning cone", "spinning_radius")):
            size = norm(across(moment, lever)) if name == "rolling_radius" else np.abs(dot(moment, lever))
            beyond = size - run.coefficient(name, self.law[rows]) * np.maximum(push, 0.0)
            bound = left * run.radius[r.a] + 16.0 * EPS * norm(moment)
            self.tell(kind, np.arange(rows.start, rows.stop), np.maximum(beyond, 0.0), bound)
        noise = 64.0 * EPS * self.top[r.k] / run.radius[r.a] + off
        found = turned(run, (r.a, r.b), (push, moment, lever), after.turning, left, noise)
        chosen = sure[found.any[sure]]
        self.tell(
            "roll",
            rows.start + chosen,
            found.value[chosen],
            found.bound[chosen] + 64.0 * EPS * norm(moment)[chosen],
        )
