"""Newton's law at every recorded impact, by a replay of the impact problems of a step from the state at its start.

From `V = v_n + h g` (weight and loads of the step) the impulses of problem after problem are added. Before each problem the
recorded approach, after it the recorded separation must be those of `V`; and where a contact has an impulse

    gamma_N^+ = -s e_N min(0, G_N V^-),   V^- = v_n + (W - W_0)       (eqs. 16, 24, 27; algorithm, section 5)

with the jump `W` by the problems before, `W_0` that of problem 0 (loads), `s` the recorded factor of the energy safeguard.
Friction is held against `z_T = gamma_T^+ + s e_T G_T V^-` as in `cones`. The contacts of a problem do no work together
(rule R4). Problems beyond `max_problems` end a sequence that was cut, without restitution. Bounds: `bounds`.
"""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carom.audit import bounds, forces
from carom.audit.block import Block
from carom.audit.cones import opposed
from carom.audit.hits import Hits, place
from carom.audit.loads import of_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Tally
from carom.audit.vectors import EPS, dot, norm

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


class Told(NamedTuple):
    """What a law says of some rows, ascending, or of the problem of one of them: how far off they are, and the bound."""

    kind: str
    rows: I64
    value: F64
    bound: F64


def judge(block: Block, tally: Tally, r: Hits, kept: Bool) -> None:
    """The impact problems of the whole steps of a block; `kept` are the rows of problem 0 whose impulses remained
    (`hits.kept`). Where a step may have had a pile, rows may be of either frame (`forces`): both readings are admitted.
    """
    piled = block.cascaded[r.k]
    for rows, ends in ((np.flatnonzero(~piled), (False,)), (np.flatnonzero(piled), (False, True))):
        if not rows.size:
            continue
        readings = [Replay(block, r.of(rows), kept[rows], end=end).run_all() for end in ends]
        for same in zip(*readings, strict=True):
            # Whether a slow contact restores slip may be sure in one reading alone.
            both = reduce(np.intersect1d, [told.rows for told in same])
            found = [
                (told.value[at], told.bound[at]) for told in same for at in [np.searchsorted(told.rows, both)]
            ]
            value, bound = (np.stack(parts) for parts in zip(*found, strict=True))
            best = np.argmin(value / np.maximum(bound, 1e-300), axis=0), np.arange(len(both))
            tally.measure(same[0].kind, value[best], bound[best], place(block, r.of(rows[both])))


class Replay:
    """The impact problems of all whole steps of a block, problem after problem: islands of a step share no bodies.

    `end`: tangential rows in the frame of `t_{n+1}`, as those of piles, and not in that of `t_n`.
    """

    def __init__(self, block: Block, r: Hits, kept: Bool, *, end: bool) -> None:
        self.block, self.r, self.kept = block, r, kept
        self.told: list[Told] = []
        run = block.run
        loads = of_loads(block)
        self.inertia = np.repeat(np.stack([run.mass, run.inertia], axis=1), 3, axis=1)
        self.old = np.concatenate([block.v0, block.w0], axis=-1)
        self.check = self.old + loads.impulse / self.inertia
        self.check[..., :3] += run.gravity * block.dt[:, None, None]
        reach = np.abs(np.nan_to_num(self.check))
        #: (B,) largest speed of a body, at the start or after any problem.
        self.top = (norm(reach[..., :3]) + run.radius * norm(reach[..., 3:])).max(axis=1, initial=0.0)
        # Frames of tangential rows: those of t_n, of Moreau-Jean the recorded ones of the middle of the step.
        other = np.minimum(r.b, run.bodies - 1)
        start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, other])[1]
        # Not of the contacts of the frame: one whose impulse was taken back has none there.
        pairs = Pairs(r.a, r.b, block.t0[r.k], block.x0[r.k, r.a], start)
        motion = (block.v0[r.k, r.a], block.w0[r.k, r.a], block.v0[r.k, other], block.w0[r.k, other])
        slip = norm(rates(run, pairs, motion, start, start).slip)
        self.mu = run.friction(run.law_index(r.a, r.b), slip)
        end = end or run.method == "moreau"
        self.lever = r.normal if end else start
        part = forces.split(r.impulse, r.normal, self.lever)[0 if end else 1]
        self.push, self.slide = part.normal, part.sliding
        self.wrench = self._wrenches()
        self.left = bounds.left(block, r, kept, self.wrench, self.top)

    def run_all(self) -> list[Told]:
        """Problem 0, then 1, 2, ...; what the laws say of each."""
        r = self.r
        loads = np.flatnonzero(r.problem == 0)
        offset, self.jump, self.own = (np.zeros_like(self.old) for _ in range(3))
        self._add(offset, loads)
        self._problem(loads, (self.old,))
        self._add(self.jump, loads[self.kept[loads]])
        order = np.argsort(r.problem, kind="stable")
        numbers, first = np.unique(r.problem[order], return_index=True)
        for problem, now in zip(numbers, np.split(order, first[1:]), strict=True):
            if problem > 0:
                # Before the first problem V^- is v_n itself, also where it took impulses of the loads back.
                self._problem(now, (self.old, self.jump, -offset) if problem > 1 else (self.old,))
                self._add(self.jump, now)
        return self.told

    def _wrenches(self) -> tuple[F64, F64]:
        """What each row gives its two bodies, impulse and moment, (K, 6); nothing at walls."""
        run, r = self.block.run, self.r
        reach = np.append(run.radius, 0.0)
        arm = np.cross(self.lever, self.slide)
        ball = (r.b < run.bodies)[:, None]
        of_a = np.hstack([r.impulse, r.moment - reach[r.a][:, None] * arm])
        of_b = np.hstack([-r.impulse, -r.moment - reach[np.minimum(r.b, run.bodies)][:, None] * arm])
        return of_a, np.where(ball, of_b, 0.0)

    def _add(self, motion: F64, rows: I64) -> None:
        """Add the velocity jumps by the impulses of some rows to a motion (B, N, 6)."""
        r = self.r
        for body, wrench in ((r.a, self.wrench[0]), (np.minimum(r.b, len(self.inertia) - 1), self.wrench[1])):
            at = body[rows]
            np.add.at(motion, (r.k[rows], at), wrench[rows] / self.inertia[at])

    def _rates(
        self, rows: I64, motions: tuple[F64, ...], *, old: bool = False, printed: bool = False
    ) -> Rates:
        """At some rows for the sum of motions (B, N, 6); `old`: walls as at t_n; `printed`: the normal of t_n."""
        run, block, r = self.block.run, self.block, self.r.of(rows)
        ball = np.minimum(r.b, run.bodies - 1)
        time, x = (block.t0, block.x0) if old else (block.t1, block.centres)
        of_a, of_b = (sum(m[r.k, body] for m in motions) for body in (r.a, ball))
        foot = self.lever[rows] if old else r.normal
        pairs = Pairs(r.a, r.b, time[r.k], x[r.k, r.a], foot)
        parts = (of_a[:, :3], of_a[:, 3:], of_b[:, :3], of_b[:, 3:])  # type: ignore[index]
        return rates(run, pairs, parts, self.lever[rows] if printed else r.normal, self.lever[rows])

    def _problem(self, rows: I64, before_impact: tuple[F64, ...]) -> None:
        """One problem of every step; `before_impact` are motions that sum up to V^-."""
        if not rows.size:
            return
        run, r, left = self.block.run, self.r.of(rows), self.left[rows]
        before = self._rates(rows, (self.check, self.jump))
        self._add(self.own, rows)
        after = self._rates(rows, (self.check, self.jump, self.own))
        minus = self._rates(rows, before_impact, old=True)
        own = compliance(run, r.a, r.b)
        weight = norm(run.gravity) * run.h
        scale = self.top[r.k]
        # Speeds follow from recorded impulses without any solver, to rounding of both.
        noise = 64.0 * EPS * (own[1] * norm(r.impulse) + scale + weight)
        told = np.maximum(np.abs(before.normal - r.approach), np.abs(after.normal - r.separation))
        self._tell("impact speeds", rows, told, 10.0 * noise + 2.0 * own[0] * left)
        o, index = run.options, run.law_index(r.a, r.b)
        acts = (r.problem > 0) & (r.problem <= o["max_problems"])
        e_n = np.where(acts, run.coefficient("restitution", index), 0.0)
        e_t = np.where(acts, run.coefficient("tangential_restitution", index), 0.0)
        towards = minus.normal
        if o["impact"] == "sequence-paper":
            towards = self._rates(rows, before_impact, old=True, printed=True).normal
        else:
            e_n = np.where(-towards < o["restitution_threshold"], 0.0, e_n)
            # Whether a contact that hardly approaches restores slip is for the closing tolerance to say.
            clear = towards < -(weight + 1e-6 * scale)
            e_t = np.where(clear | (e_t == 0.0), e_t, np.where(towards >= 0.0, 0.0, np.nan))
            towards = np.minimum(towards, 0.0)
        value = bounds.misfit(after.normal + r.scale * e_n * towards, self.push[rows], own[0])
        self._tell("impact", rows, value, 2.0 * own[0] * left + noise)
        mu = self.mu[rows]
        z = after.slip + (r.scale * np.nan_to_num(e_t))[:, None] * minus.slip
        most = mu * np.maximum(self.push[rows], 0.0)
        defect = opposed(self.slide[rows], z, most, left, 2.0 * own[1] * left + noise)
        sure = np.flatnonzero(np.isfinite(e_t) & (mu > 0.0))
        limit = (left * (1.0 + mu) + 64.0 * EPS * norm(r.impulse))[sure]
        self._tell("slip", rows[sure], defect[sure], limit)
        self._energy(rows, before, after)
        self._forget(rows)

    def _tell(self, kind: str, rows: I64, value: F64, bound: F64) -> None:
        self.told.append(Told(kind, rows, value, bound))

    def _kinetic(self, rows: I64) -> F64:
        """(B,) kinetic energy, before a problem, of the bodies that it moves, J."""
        k, body = self._moved(rows)
        now = self.check[k, body] + self.jump[k, body]
        each = 0.5 * (self.inertia[body] * now * now).sum(axis=1)
        return np.bincount(k, each, minlength=self.block.count).astype(np.float64)

    def _forget(self, rows: I64) -> None:
        """Take the jump of a problem off again: `run_all` adds what remained. The largest speeds are kept."""
        k, body = self._moved(rows)
        now = np.abs(self.check[k, body] + self.jump[k, body]) + np.abs(self.own[k, body])
        speed = norm(now[:, :3]) + self.block.run.radius[body] * norm(now[:, 3:])
        np.maximum.at(self.top, k, speed)
        self.own[k, body] = 0.0

    def _moved(self, rows: I64) -> tuple[I64, I64]:
        """The bodies of some rows, each once: intervals and bodies."""
        r, bodies = self.r.of(rows), len(self.inertia)
        k, body = np.divmod(
            np.unique(np.concatenate([r.k * bodies + r.a, (r.k * bodies + r.b)[r.b < bodies]])), bodies
        )
        return k, body

    def _energy(self, rows: I64, before: Rates, after: Rates) -> None:
        """Rule R4 in each problem: works of impulses by the mean of the velocities before and after them.

        Bound: `bounds.gain` of the kinetic energy; and what a residual `rho` (`bounds`) can do, which is at most `rho` times
        the velocities after the problem and those of `2 D_cc` times the impulses.
        """
        run, r, count = self.block.run, self.r.of(rows), self.block.count
        if not run.options["energy_safeguard"] or run.options["impact"] == "sequence-paper":
            return

        def total(values: F64) -> F64:
            return np.bincount(r.k, values, minlength=count).astype(np.float64)

        pushed = 0.5 * self.push[rows] * (before.normal + after.normal)
        slid = 0.5 * dot(self.slide[rows], before.slip + after.slip)
        work = pushed + slid + 0.5 * dot(r.moment, before.turning + after.turning)
        # A wall moves at most with what the ball has against it and by itself.
        moving = np.isin(r.b, [run.bodies + w for w, wall in enumerate(run.walls) if wall.moves])
        own = norm(self.check[r.k, r.a, :3] + self.jump[r.k, r.a, :3])
        driven = run.mass[r.a] * (before.normal**2 + norm(before.slip) ** 2 + own**2)
        kinetic = self._kinetic(rows) + total(np.where(moving, driven, 0.0))
        rho = np.zeros(count)
        np.maximum.at(rho, r.k, self.left[rows])
        given = 2.0 * compliance(run, r.a, r.b)[1] * norm(r.impulse)
        fast = np.sqrt(total(after.normal**2 + norm(after.slip) ** 2)) + np.sqrt(total(given**2))
        bound = bounds.gain(self.block) * kinetic + rho * fast
        bound = bound + 64.0 * EPS * (kinetic + total(np.abs(work)))
        # Told of the row with the largest impulse.
        largest = rows[np.lexsort((norm(r.impulse), r.k))]
        largest = largest[np.flatnonzero(np.append(np.diff(self.r.k[largest]), 1))]
        k = self.r.k[largest]
        order = np.argsort(largest)
        self._tell("passivity", largest[order], np.maximum(total(work), 0.0)[k][order], bound[k][order])
