"""Newton's law at every recorded impact, by a replay of the impact problems of a step from the state at its start.

From `V = v_n + h g` (weight and loads of the step) the impulses of problem after problem are added. Before each problem the
recorded approach, after it the recorded separation must be those of `V`; and where a contact has an impulse

    gamma_N^+ = -s e_N min(0, G_N V^-),   V^- = v_n + (W - W_0)       (eqs. 16, 24, 27; algorithm, section 5)

with the jump `W` by the problems before, `W_0` that of problem 0 (loads), `s` the recorded factor of the energy safeguard.
Friction is held against `z_T = gamma_T^+ + s e_T G_T V^-` as in `cones`. Bound: `2 D_cc` times what the solver may leave of
the impulses of the step.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from carom.audit import forces
from carom.audit.block import Block
from carom.audit.cones import opposed
from carom.audit.hits import Hits
from carom.audit.loads import of_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, norm

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


class Replay:
    """The impact problems of all whole steps of a block, problem after problem: islands of a step share no bodies.

    `kept` are the rows of problem 0 whose impulses remained (`hits.kept`).
    """

    def __init__(self, block: Block, tally: Tally, r: Hits, kept: Bool) -> None:
        self.block, self.tally, self.r, self.kept = block, tally, r, kept
        run = block.run
        loads = of_loads(block)
        scale = np.repeat(np.stack([run.mass, run.inertia], axis=1), 3, axis=1)
        self.inverse = 1.0 / scale
        self.old = np.concatenate([block.v0, block.w0], axis=-1)
        self.check = self.old + loads.impulse * self.inverse
        self.check[..., :3] += run.gravity * block.dt[:, None, None]
        size = np.bincount(r.k, norm(r.impulse) ** 2, minlength=block.count)
        self.left = (8.0 * block.tolerance * np.sqrt(size))[r.k]
        # Frames of tangential rows: those of t_n, of Moreau-Jean the recorded ones of the middle of the step.
        other = np.minimum(r.b, run.bodies - 1)
        start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, other])[1]
        # Not of the contacts of the frame: one whose impulse was taken back has none there.
        pairs = Pairs(r.a, r.b, block.t0[r.k], block.x0[r.k, r.a], start)
        motion = (block.v0[r.k, r.a], block.w0[r.k, r.a], block.v0[r.k, other], block.w0[r.k, other])
        slip = norm(rates(run, pairs, motion, start, start).slip)
        self.mu = run.friction(run.law_index(r.a, r.b), slip)
        self.lever = r.normal if run.method == "moreau" else start
        part = forces.split(r.impulse, r.normal, self.lever)[0 if run.method == "moreau" else 1]
        self.push, self.slide = part.normal, part.sliding

    def run_all(self) -> None:
        """Problem 0, then 1, 2, ..."""
        r = self.r
        loads = r.problem == 0
        offset, jump = self._jump(loads), self._jump(loads & self.kept)
        self._problem(np.flatnonzero(loads), self.check, self.old)
        for problem in np.unique(r.problem[~loads]):
            now = np.flatnonzero(r.problem == problem)
            # Before the first problem V^- is v_n itself, also where it took impulses of the loads back.
            minus = self.old + (jump - offset) if problem > 1 else self.old
            self._problem(now, self.check + jump, minus)
            jump = jump + self._jump(r.problem == problem)

    def _place(self, rows: I64) -> Callable[[int], Place]:
        r, run = self.r, self.block.run
        return lambda i: run.step_place(int(r.step[rows[i]]), int(r.a[rows[i]]), int(r.b[rows[i]]))

    def _jump(self, chosen: Bool) -> F64:
        """Velocity jumps (B, N, 6) by some impulses."""
        run, r = self.block.run, self.r
        out = np.zeros((self.block.count, run.bodies, 6))
        reach = np.append(run.radius, 0.0)
        arm = np.cross(self.lever, self.slide)
        np.add.at(
            out,
            (r.k[chosen], r.a[chosen]),
            np.hstack([r.impulse, r.moment - reach[r.a][:, None] * arm])[chosen],
        )
        ball = chosen & (r.b < run.bodies)
        back = np.hstack([-r.impulse, -r.moment - reach[np.minimum(r.b, run.bodies)][:, None] * arm])
        np.add.at(out, (r.k[ball], r.b[ball]), back[ball])
        return out * self.inverse

    def _rates(self, rows: I64, motion: F64, *, old: bool = False, printed: bool = False) -> Rates:
        """At some rows for the motion (B, N, 6); `old`: walls as at t_n; `printed`: the normal of t_n."""
        run, block, r = self.block.run, self.block, self.r.of(rows)
        ball = np.minimum(r.b, run.bodies - 1)
        time, x = (block.t0, block.x0) if old else (block.t1, block.centres)
        of_a, of_b = motion[r.k, r.a], motion[r.k, ball]
        foot = self.lever[rows] if old else r.normal
        pairs = Pairs(r.a, r.b, time[r.k], x[r.k, r.a], foot)
        parts = (of_a[:, :3], of_a[:, 3:], of_b[:, :3], of_b[:, 3:])
        return rates(run, pairs, parts, self.lever[rows] if printed else r.normal, self.lever[rows])

    def _problem(self, rows: I64, start: F64, before_impact: F64) -> None:
        """One problem of every step: `start` the velocities before it, `before_impact` V^-, (B, N, 6)."""
        if not rows.size:
            return
        run, r, tally = self.block.run, self.r.of(rows), self.tally
        left, place = self.left[rows], self._place(rows)
        chosen = np.zeros(len(self.r), dtype=bool)
        chosen[rows] = True
        before, after = self._rates(rows, start), self._rates(rows, start + self._jump(chosen))
        minus = self._rates(rows, before_impact, old=True)
        own = compliance(run, r.a, r.b)
        weight = norm(run.gravity) * run.h
        scale = np.nan_to_num(np.abs(start[..., :3]) + run.radius[:, None] * np.abs(start[..., 3:])).max(
            axis=(1, 2)
        )[r.k]
        # Speeds follow from recorded impulses without any solver, to rounding of both.
        noise = 64.0 * EPS * (own[1] * norm(r.impulse) + scale + weight)
        told = np.maximum(np.abs(before.normal - r.approach), np.abs(after.normal - r.separation))
        tally.measure("impact speeds", told, 10.0 * noise + 2.0 * own[0] * left, place)
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
        value = np.abs(after.normal + r.scale * e_n * towards)
        tally.measure("impact", value, 2.0 * own[0] * left + noise, place)
        mu = self.mu[rows]
        z = after.slip + (r.scale * np.nan_to_num(e_t))[:, None] * minus.slip
        most = mu * np.maximum(self.push[rows], 0.0)
        defect = opposed(self.slide[rows], z, most, left, 2.0 * own[1] * left + noise)
        sure = np.flatnonzero(np.isfinite(e_t) & (mu > 0.0))
        limit = (left * (1.0 + mu) + 64.0 * EPS * norm(r.impulse))[sure]
        tally.measure("slip", defect[sure], limit, self._place(rows[sure]))
