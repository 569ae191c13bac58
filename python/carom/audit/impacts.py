"""Newton's law at every recorded impact, by a replay of the impact problems of a step from the state at its start.

From `V = v_n + h g` (weight and loads of the step) the impulses of problem after problem are added. Before each problem the
recorded approach, after it the recorded separation must be those of `V`; and where a contact has an impulse

    gamma_N^+ = -s e_N min(0, G_N V^-),   V^- = v_n + (W - W_0)       (eqs. 16, 24, 27; algorithm, section 5)

with the jump `W` by the problems before, `W_0` that of problem 0 (loads), `s` the recorded factor of the energy safeguard.
Friction is held against `z_T = gamma_T^+ + s e_T G_T V^-` as in `cones`. Bound: `2 D_cc` times what the solver may leave of
the impulses of the step.

Where the frames do not show the state before and after each step, the recorded speeds are held against one another alone:
approach and `V^-` differ by what loads give in a step, and by the impulses of problem 0 that an impact takes back: those
carry at most the whole weight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carom.audit import forces
from carom.audit.block import Block
from carom.audit.cones import friction, opposed
from carom.audit.loads import of_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, dot, norm

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class Rows:
    """Rows of the table of impacts in a block."""

    k: I64
    step: I64
    problem: I64
    a: I64
    b: I64
    normal: F64
    impulse: F64
    moment: F64
    approach: F64
    separation: F64
    scale: F64

    def __len__(self) -> int:
        return len(self.k)

    def of(self, chosen: Bool | I64) -> Rows:
        """Some of them."""
        return Rows(**{name: getattr(self, name)[chosen] for name in self.__dataclass_fields__})


def judge(block: Block, tally: Tally) -> None:
    """All impacts of a block."""
    run = block.run
    if not run.has_impacts:
        for kind in ("impact", "impact speeds", "impact sum"):
            tally.skip(kind, "impacts were not recorded", "impacts = true in [record]", block.count)
        return
    rows = _rows(block)
    if not len(rows):
        return
    _sign(block, tally, rows)
    if run.method == "penalty":
        tally.skip(
            "impact",
            "penalty has a law of forces, of which restitution follows",
            "use nsga or moreau",
            len(rows),
        )
        return
    piled = block.piled[rows.k]
    why = "piles record one row per contact and step, over several problems"
    tally.skip("impact", why, "pile_contacts above the contacts", int(piled.sum()))
    # Joints and loads that depend on the motion answer impacts within their problem.
    coupled = bool(run.joints) or any(load["kind"] != "force" for load in run.loads)
    whole = block.single[rows.k] & ~piled & run.has_contacts & (not coupled) & block.there.all(axis=1)[rows.k]
    _recorded(block, tally, rows.of(~whole & ~piled))
    if whole.any():
        _Replay(block, tally, rows.of(whole)).run_all()


def _rows(block: Block) -> Rows:
    table = block.run.result.impacts
    step = np.asarray(table["step"]).astype(np.int64)
    low, high = np.searchsorted(step, [block.s0[0] + 1, block.s1[-1] + 1])

    def column(name: str) -> F64:
        return np.asarray(table[name][low:high])

    body = column("body").astype(np.int64).reshape(-1, 2)
    k = np.searchsorted(block.s1, step[low:high])
    numbers = (
        column(n) for n in ("normal", "impulse", "moment", "approach", "separation", "restitution_scale")
    )
    return Rows(k, step[low:high], column("problem").astype(np.int64), body[:, 0], body[:, 1], *numbers)


def _sign(block: Block, tally: Tally, r: Rows) -> None:
    """Impulses of impacts push, with friction in its cone and at least the recorded speed after as before the law allows."""
    run = block.run
    size = norm(r.impulse)
    left = 4.0 * block.tolerance[r.k] * size + 16.0 * EPS * size

    def place(i: int) -> Place:
        return run.step_place(int(r.step[i]), int(r.a[i]), int(r.b[i]))

    loose = block.piled[r.k] | ~block.single[r.k]
    pulled = -dot(r.impulse, r.normal)
    # Rows of piles and of penalty add up impulses while the normal turns: a pull is what points away from it altogether.
    tally.measure("sign", np.maximum(pulled, 0.0), left + np.where(loose, 0.5 * size, 0.0), place)
    if run.friction_varies:
        return
    mu = run.friction(run.law_index(r.a, r.b), np.zeros(len(r)))
    kept = np.flatnonzero(~loose)
    other = np.minimum(r.b, run.bodies - 1)
    _, start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, other])
    parts = forces.split(r.impulse, r.normal, start)
    excess = np.minimum(*(norm(p.sliding) - mu * np.maximum(p.normal, 0.0) for p in parts))
    whole = np.sqrt(np.bincount(r.k, size * size, minlength=block.count))[r.k]
    bound = 8.0 * block.tolerance[r.k] * whole * (1.0 + mu) + 16.0 * EPS * size
    tally.measure("friction cone", np.maximum(excess, 0.0)[kept], bound[kept], lambda i: place(int(kept[i])))


def _recorded(block: Block, tally: Tally, r: Rows) -> None:
    """The law between recorded approach and separation."""
    run = block.run
    if not len(r):
        return
    if run.joints or run.loads or run.options["impact"] == "sequence-paper":
        tally.skip(
            "impact",
            "loads, joints or the printed law stand between the recorded speeds",
            "every = 1 in [record]",
            len(r),
        )
        return
    e = run.coefficient("restitution", run.law_index(r.a, r.b))
    e = np.where((r.problem == 0) | (r.problem > run.options["max_problems"]), 0.0, e)
    slow = -r.approach < run.options["restitution_threshold"]
    load = norm(run.gravity) * run.h
    for k in np.unique(r.b[r.b >= run.bodies]):
        wall, mine = run.walls[k - run.bodies], r.b == k
        if wall.moves:
            point = np.broadcast_to(wall.point, (int(mine.sum()), 3))
            then = block.t1[r.k[mine]]
            change = wall.velocity(then, point)[1] - wall.velocity(then - run.h, point)[1]
            load = load + float(norm(change).max(initial=0.0))
    value = np.abs(r.separation - r.scale * np.where(slow, 0.0, e) * np.maximum(0.0, -r.approach))
    size = norm(r.impulse)
    whole = np.sqrt(np.bincount(r.k, size * size, minlength=block.count))[r.k]
    left = 8.0 * block.tolerance[r.k] * whole * compliance(run, r.a, r.b)[0]
    # An impact takes back what carried the weight above its contact: at most all of it, on the lighter body.
    lightest = np.minimum(run.mass[r.a], np.append(run.mass, np.inf)[np.minimum(r.b, run.bodies)])
    load = load * (2.0 + run.mass.sum() / lightest)
    bound = (
        e * (load + run.options["restitution_threshold"])
        + left
        + 64.0 * EPS * (np.abs(r.approach) + np.abs(r.separation))
    )
    tally.measure("impact", value, bound, lambda i: run.step_place(int(r.step[i]), int(r.a[i]), int(r.b[i])))


class _Replay:
    """The impact problems of all whole steps of a block, problem after problem: bodies share none within a step."""

    def __init__(self, block: Block, tally: Tally, r: Rows) -> None:
        self.block, self.tally, self.r = block, tally, r
        run, c = block.run, block.rows
        loads = of_loads(block)
        scale = np.repeat(np.stack([run.mass, run.inertia], axis=1), 3, axis=1)
        self.inverse = 1.0 / scale
        self.old = np.concatenate([block.v0, block.w0], axis=-1)
        self.check = self.old + loads.impulse * self.inverse
        self.check[..., :3] += run.gravity * block.dt[:, None, None]
        many = len(run.names)
        keys = (c.k * many + c.a) * many + c.b
        self.key = (r.k * many + r.a) * many + r.b
        order = np.argsort(keys, kind="stable")
        found = np.minimum(np.searchsorted(keys[order], self.key), max(len(keys) - 1, 0))
        self.contact = order[found] if len(keys) else found
        self.known = keys[self.contact] == self.key if len(keys) else np.zeros(len(r), dtype=bool)
        self.mu = friction(block)[self.contact] if len(keys) else np.zeros(len(r))
        size = np.bincount(r.k, norm(r.impulse) ** 2, minlength=block.count)
        self.left = (8.0 * block.tolerance * np.sqrt(size))[r.k]
        # Frames of tangential rows: those of t_n, of Moreau-Jean the recorded ones of the middle of the step.
        other = np.minimum(r.b, run.bodies - 1)
        start = run.meet(block.t0[r.k], r.a, r.b, block.x0[r.k, r.a], block.x0[r.k, other])[1]
        self.lever = r.normal if run.method == "moreau" else start
        part = forces.split(r.impulse, r.normal, self.lever)[0 if run.method == "moreau" else 1]
        self.push, self.slide = part.normal, part.sliding

    def run_all(self) -> None:
        """Problem 0, then 1, 2, ..."""
        r = self.r
        loads = r.problem == 0
        kept = self._kept()
        offset, jump = self._jump(loads), self._jump(loads & kept)
        self._problem(np.flatnonzero(loads), self.check, self.old)
        for problem in np.unique(r.problem[~loads]):
            now = np.flatnonzero(r.problem == problem)
            # Before the first problem V^- is v_n itself, also where it took impulses of the loads back.
            minus = self.old + (jump - offset) if problem > 1 else self.old
            self._problem(now, self.check + jump, minus)
            jump = jump + self._jump(r.problem == problem)

    def _kept(self) -> Bool:
        """Which impulses of problem 0 remained: an impact takes those of its contacts back and solves them anew. Told by the
        contact's whole impulse of the step, which must be the sum with or without it.
        """
        r = self.r
        whole = np.where(self.known[:, None], self.block.rows.impulse[self.contact], 0.0)
        _, group = np.unique(self.key, return_inverse=True)
        sums, loads = np.zeros((len(r), 3)), np.zeros((len(r), 3))
        np.add.at(sums, group, np.where((r.problem > 0)[:, None], r.impulse, 0.0))
        np.add.at(loads, group, np.where((r.problem == 0)[:, None], r.impulse, 0.0))
        sums, loads = sums[group], loads[group]
        without, within = norm(whole - sums), norm(whole - sums - loads)
        bound = 32.0 * EPS * (norm(whole) + norm(sums) + norm(loads))
        value = np.minimum(without, within)
        self.tally.measure("impact sum", value, np.maximum(bound, 1e-300), self._place(np.arange(len(r))))
        return np.asarray(within <= without)

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
