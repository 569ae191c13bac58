"""Intervals between neighbouring frames, in blocks: the states at both ends, and what was recorded in between."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, wraps
from typing import Any, NamedTuple, TypeVar

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.audit.data import Run
from carom.audit.report import Place, Tally
from carom.audit.vectors import cross, rotated

T = TypeVar("T")
Of = TypeVar("Of", "Block", Run)

#: Numbers that a block holds of one frame column at most.
BLOCK = 100_000
#: Up to this many bodies all pairs are measured at once.
ALL_PAIRS = 64


def once(compute: Callable[[Of], T]) -> Callable[[Of], T]:
    """What several laws ask of a run or a block is computed once for each; nobody changes it."""

    @wraps(compute)
    def found(of: Of) -> T:
        if compute not in of.known:
            of.known[compute] = compute(of)
        return of.known[compute]  # type: ignore[no-any-return]

    return found


def blocks(run: Run) -> Iterator[Block]:
    """All intervals of a run, in blocks."""
    few = run.bodies <= ALL_PAIRS
    size = max(1, min(2000, BLOCK // (3 * run.bodies), 10 * BLOCK // run.bodies**2 if few else BLOCK))
    for first in range(1, run.frames, size):
        yield Block(run, first, min(run.frames, first + size))


@dataclass(frozen=True)
class Rows:
    """Contacts of a block, K rows: interval `k`, bodies, and what was recorded of them."""

    k: I64
    a: I64
    b: I64
    normal: F64
    gap: F64
    impulse: F64
    moment: F64
    position_impulse: F64
    position_moment: F64
    work: F64
    """Normal, sliding, rolling, spinning: (K, 4), J."""
    status: I64
    """0 open, 1 stick, 2 slip."""

    def __len__(self) -> int:
        return len(self.k)


class Point(NamedTuple):
    """A point that a body carries, in each interval: lever, place and velocity, (B, 3), m and m/s."""

    lever: F64
    place: F64
    velocity: F64


def of_many(contacts: F64) -> F64:
    """How much worse than in a small pile the worst of so many contacts may be: the 3/4th power of the contacts above 2500,
    at most five times.
    """
    return np.asarray(np.clip((np.asarray(contacts) / 2500.0) ** 0.75, 1.0, 5.0))


def pile_overlap(tolerance: float, contacts: F64) -> F64:
    """Overlap over the radius that the solver of piles may leave: 0.9 `tolerance`, more of many contacts, but not beyond
    4.5e-4 (or twice the 0.9, if that is more).
    """
    return np.asarray(np.minimum(0.9 * tolerance * of_many(contacts), max(4.5e-4, 1.8 * tolerance)))


class Block:
    """Intervals `first - 1 -> first` to `end - 2 -> end - 1` of the frames: B of them."""

    def __init__(self, run: Run, first: int, end: int) -> None:
        self.run = run
        #: What was computed of it (`once`).
        self.known: dict[Callable[[Block], Any], Any] = {}
        self.first = first
        self.count = end - first
        rows = slice(first - 1, end)
        x, v, w, q = run.state(rows)
        self.x0, self.v0, self.w0, self.q0 = x[:-1], v[:-1], w[:-1], q[:-1]
        self.x1, self.v1, self.w1, self.q1 = x[1:], v[1:], w[1:], q[1:]
        of_clumps = run.motion_of_clumps(rows)
        self.c0, self.c1 = of_clumps[:-1], of_clumps[1:]
        """(B, C, 13) the motion of clumps."""
        self.t0, self.t1 = run.time[rows][:-1], run.time[rows][1:]
        self.kink = np.zeros_like(self.v1)
        """(B, N, 3) what kinks in the law of a periodic box gave bodies after the last step of each interval, m/s. Neither
        `v1` nor `c1` has it: they are what the step left.
        """
        self.on_record = self.v1, self.c1
        """These with the kinks."""
        self._leave_out_kinks()
        self.s0, self.s1 = run.step[rows][:-1], run.step[rows][1:]
        self.n = self.s1 - self.s0
        """Steps of each interval."""
        self.dt = self.n * run.h
        present = run.present(rows)
        self.there = present[:-1] & present[1:]
        """(B, N) bodies that were there all the time."""
        self.passing = np.zeros_like(self.there)
        """(B, N) bodies that came or went within an interval."""
        self._leave_out_events()
        self.cut = self.over(run.cut) > 0
        """(B,) intervals with a step in parts."""
        self.single = (self.n == 1) & ~self.cut & (not run.divides)
        """(B,) intervals of one whole step: there all laws can be judged exactly."""
        self.updates = self.n + self.total(run.steps["substeps"] + run.steps["halvings"])
        """(B,) how often the state was written."""

    def _leave_out_kinks(self) -> None:
        box = self.run.box
        if not box.deforms:
            return
        last, then = box.rates(self.t1, end=True), box.rates(self.t1)
        self.kink = self.flow((then[0] - last[0], then[1] - last[1]), end=True)
        self.v1, self.c1 = self.v1 - self.kink, self.c1.copy()
        self.c1[..., 7:10] -= self.kink[:, self.run.clumps.first]

    def flow(self, edges: tuple[F64, F64], *, end: bool = False) -> F64:
        """(B, N, 3) what is as many `edges`, or rates of edges (B,), long as bodies are from the middle of the box at the
        first frames, or at the second ones, in edges of then: of balls of clumps the clump, and nothing of free walls.
        """
        run, box = self.run, self.run.box
        x, rows, time = (self.x1, self.c1, self.t1) if end else (self.x0, self.c0, self.t0)
        x = x.copy()
        x[:, run.clumps.balls] = rows[:, run.clumps.of, :3]
        x[:, run.balls :] = box.middle
        of, (lengths, offset) = box.edges(time), edges
        share = box.share((of[0][:, None], of[1][:, None]), x)
        return box.along((lengths[:, None], offset[:, None]), share)

    def image(self, k: I64, a: I64, b: I64, *, end: bool = False) -> F64 | None:
        """(K, 3) which images of bodies `b` are nearest to the bodies `a` in the intervals `k`, at their first frames, or at
        the second ones (`Run.image`).
        """
        x, time = (self.x1, self.t1) if end else (self.x0, self.t0)
        return self.run.image(time[k], b, x[k, a], x[k, np.minimum(b, self.run.bodies - 1)])

    def _leave_out_events(self) -> None:
        events = self.run.result.events
        if not len(events):
            return
        step, body = np.asarray(events["step"]).astype(np.int64), np.asarray(events["body"]).astype(np.int64)
        k = np.searchsorted(self.s1, step)
        here = (k < self.count) & (step > self.s0[np.minimum(k, self.count - 1)])
        self.passing[k[here], body[here]] = True
        self.there &= ~self.passing

    def over(self, column: Array) -> F64:
        """Largest value of a column of the steps in each interval, (B,)."""
        ends = np.clip(np.stack([self.s0, self.s1]), 0, len(column))
        return np.array([column[i:j].max(initial=0) for i, j in ends.T], dtype=np.float64)

    def total(self, column: Array) -> F64:
        """Sum of a column of the steps over each interval, (B,)."""
        ends = np.clip(np.stack([self.s0, self.s1]), 0, len(column))
        if len(column) and (ends[1] - ends[0] == 1).all():
            return np.asarray(column[ends[0]], dtype=np.float64)
        return np.array([column[i:j].sum() for i, j in ends.T], dtype=np.float64)

    def place(self, k: int, *bodies: int) -> Place:
        """A place at the end of an interval."""
        return self.run.frame_place(self.first + k, *bodies)

    def skip(self, tally: Tally, kind: str, why: str, k: I64, missing: str = "") -> None:
        """`Tally.skip` of intervals `k`, each with what would let it be judged as one whole step.

        `every = 1` is no advice for intervals of one step; `missing` is a key of [record] without which nothing is judged.
        """
        kept, several = self.kept[k], (self.n[k] > 1) & (not self.run.divides)
        whole = self.single[k] & bool(missing)
        finer = {"penalty": "use nsga or moreau", "events": "use nsga"}.get(self.run.method, "a smaller step")
        for cure, chosen in (
            ("resume the run", ~kept),
            (" and ".join(filter(None, (missing, "every = 1"))) + " in [record]", kept & several),
            (f"{missing} in [record]", kept & whole),
            (f"{missing} in [record], and {finer}" if missing else finer, kept & ~several & ~whole),
        ):
            tally.skip(kind, why, cure, int(chosen.sum()))

    def per_pair(self, k: I64, a: I64, b: I64) -> Callable[[int], Place]:
        """The places of pairs of bodies (K,) at the ends of the intervals `k`."""
        return lambda i: self.place(int(k[i]), int(a[i]), int(b[i]))

    def stayed(self, k: I64, a: I64, b: I64) -> Bool:
        """(K,) pairs of bodies that were there all the time of the intervals `k`."""
        ball = np.minimum(b, self.run.bodies - 1)
        return np.asarray(self.there[k, a] & (self.there[k, ball] | (b >= self.run.bodies)))

    def contact(self, row: int) -> Place:
        """The place of a contact of `rows`."""
        c = self.rows
        return self.place(int(c.k[row]), int(c.a[row]), int(c.b[row]))

    def motion(self, k: I64, a: I64, b: I64, *, start: bool) -> tuple[F64, F64, F64, F64]:
        """Velocities and angular velocities of A, then of B (any of walls), (K, 3) each, at an end of the intervals `k`."""
        ball = np.minimum(b, self.run.bodies - 1)
        v, w = (self.v0, self.w0) if start else (self.v1, self.w1)
        return v[k, a], w[k, a], v[k, ball], w[k, ball]

    def point(self, body: int, arm: Any, end: int) -> Point:
        """A point of a body, or of the ground (-1), at the first (0) or second (1) frames; `arm` in its own axes, m."""
        given = np.broadcast_to(np.asarray(arm, dtype=np.float64), (self.count, 3))
        if body < 0:
            return Point(np.zeros_like(given), given, np.zeros_like(given))
        x, v, w, q = (self.x1, self.v1, self.w1, self.q1) if end else (self.x0, self.v0, self.w0, self.q0)
        lever = rotated(q[:, body], given)
        return Point(lever, x[:, body] + lever, v[:, body] + cross(w[:, body], lever))

    def per_body(self, flat: int) -> Place:
        """The place of an entry of a (B, N) array."""
        k, body = divmod(flat, self.run.bodies)
        return self.place(k, body)

    def per_wall(self, flat: int) -> Place:
        """The place of an entry of a (B, W) array, of all walls."""
        k, wall = divmod(flat, len(self.run.free_walls) + self.run.given_walls)
        return self.place(k, self.run.balls + wall)

    def per_clump(self, flat: int) -> Place:
        """The place of an entry of a (B, C) array."""
        k, clump = divmod(flat, len(self.run.clumps))
        return self.place(k, int(self.run.clumps.first[clump]))

    @cached_property
    def kept(self) -> Bool:
        """(B,) whether the impulses of contacts and joints of the interval are whole: of a bare last frame they are not."""
        result = self.run.result
        return np.asarray(~(result._has_bare_end & (self.s1 == result.step[-1])))

    @cached_property
    def rows(self) -> Rows:
        """The contacts that were recorded in these intervals."""
        run = self.run
        ends = np.asarray(
            run.result._segments.column("frames", "contact_end")[self.first - 1 : self.first + self.count]
        )
        ends = ends.astype(np.int64)
        table = run.result.contacts
        low, high = int(ends[0]), int(ends[-1])

        def column(name: str) -> Any:
            return np.asarray(table[name][low:high])

        body = run.pairs(table, low, high)
        k = np.searchsorted(ends[1:], np.arange(low, high), side="right")
        moved = (column(name) for name in ("impulse", "moment", "position_impulse", "position_moment"))
        impulse, moment, position_impulse, position_moment = moved
        work = np.stack([column(f"work_{c}") for c in ("normal", "friction", "rolling", "spinning")], axis=1)
        return Rows(k, body[:, 0], body[:, 1], column("normal"), column("gap"),
                    impulse, moment, position_impulse, position_moment, work,
                    column("status").astype(np.int64))  # fmt: skip

    @cached_property
    def start(self) -> tuple[F64, F64]:
        """Gap and normal of the recorded contacts at the first frame of their interval."""
        return self._meet(self.x0, self.t0)

    @cached_property
    def end(self) -> tuple[F64, F64]:
        """The same at the second."""
        return self._meet(self.reached, self.t1)

    @cached_property
    def reached(self) -> F64:
        """(B, N, 3) places of the second frames, which bodies that left within the interval have by what is on record of a
        contact with one that stayed.
        """
        c, run, x = self.rows, self.run, self.x1.copy()
        apart = (c.gap + run.reach[c.a] + run.reach[np.minimum(c.b, run.bodies)])[:, None] * c.normal
        pairs = c.b < run.balls
        for one, other, way in ((c.a, c.b, -apart), (c.b, c.a, apart)):
            k, i, j = c.k[pairs], one[pairs], other[pairs]
            left = np.isnan(x[k, j, 0])
            x[k[left], j[left]] = self.x1[k[left], i[left]] + way[pairs][left]
        return x

    def _meet(self, x: F64, time: F64) -> tuple[F64, F64]:
        c = self.rows
        other = np.minimum(c.b, self.run.bodies - 1)
        return self.run.meet(time[c.k], c.a, c.b, x[c.k, c.a], x[c.k, other])

    @cached_property
    def large(self) -> Bool:
        """(B,) intervals in which an island may have been large, or a pile (`Run.small`); the projection does not count
        those that it looks at.
        """
        run = self.run
        return np.asarray((self.over(run.steps["candidates"]) > run.small) | run.projects)

    @cached_property
    def piled(self) -> Bool:
        """(B,) intervals in which an island may have been solved as a pile at the position level, where all pairs that are
        looked at count; islands with clumps are none, but which these are is not recorded.
        """
        return np.asarray(self.over(self.run.steps["candidates"]) > self.least)

    @cached_property
    def cascaded(self) -> Bool:
        """(B,) the same at the velocity level, where the closed contacts count, which the steps record."""
        return np.asarray(self.over(self.run.steps["largest_island"]) > self.least)

    @property
    def summed(self) -> Bool:
        """(B,) intervals in which rows of impacts may be sums over the problems of a step: those of piles, unless every
        problem was recorded.
        """
        return self.cascaded & (not isinstance(self.run.record.impacts, str))

    @property
    def least(self) -> float:
        """Contacts of an island up to which it is no pile (`docs/reference/scenario.md`, `pile_contacts`)."""
        o = self.run.options
        return self.run.small if o["pile_tolerance"] >= 1e-5 else self.run.loosest["pile_contacts"]

    @cached_property
    def tolerance(self) -> F64:
        """(B,) tol_r of eq. 44 as it held in each interval."""
        return np.where(self.companion, np.maximum(self._asked, self._residual), self._asked)

    @cached_property
    def _asked(self) -> F64:
        t = self.run.loosest
        return np.where(self.large, max(t["tolerance"], t["pile_tolerance"]), t["tolerance"])

    @cached_property
    def _residual(self) -> F64:
        s = self.run.steps
        return np.maximum(self.over(s["residual_velocity"]), self.over(s["residual_position"]))

    @cached_property
    def companion(self) -> Bool:
        """(B,) intervals with a step that a convex companion ended (`docs/theory/algorithm.md`, section 5): a fallback left
        more than the tolerance, and yet nothing was accepted without convergence.
        """
        s = self.run.steps
        fallen = (self.over(s["fallbacks"]) > 0) & (self.over(s["unconverged"]) == 0)
        return np.asarray(fallen & (self._residual > self._asked))

    def skip_companions(self, tally: Tally, kind: str, k: I64) -> None:
        """Friction and restitution of companions are not those of the laws."""
        why = "steps ended with convex companions (fallbacks, residual above the tolerance): what slides moves apart there"
        tally.skip(
            kind,
            why,
            "a smaller step, and no joints or contacts that repeat one another",
            int(self.companion[k].sum()),
        )

    @cached_property
    def pile_overlap(self) -> F64:
        """(B,) overlap over the radius that the solver of piles may leave."""
        return pile_overlap(self.run.loosest["pile_tolerance"], self.over(self.run.steps["candidates"]))

    def left(self, size: F64) -> F64:
        """(B,) what a solver may leave of multipliers `size` (K,) of the contacts: tol_r times the sum of the norms of
        eq. 44 (inertia, loads, contact forces, constraint and multiplier rows). Each is about the root of the sum of the
        squares of all contacts, that of the contact forces of balls with several of them more: eight times it in all.
        """
        squares = np.bincount(self.rows.k, size * size, minlength=self.count)
        return np.asarray(8.0 * self.tolerance * np.sqrt(squares))

    @cached_property
    def floor(self) -> F64:
        """(B,) what the position level may leave besides (N s^2), however small its multipliers: `tolerance_floor m r`, and
        where gaps may contradict one another, in islands of more than `dense_contacts`, `touching_tolerance m r`.
        """
        run, t = self.run, self.run.loosest
        least = t["tolerance_floor"]
        share = np.where(self.large, max(least, t["touching_tolerance"]), least)
        sizes = np.append(run.heavy * run.radius, run.clumps.mass * run.clumps.reach)
        return np.asarray(share * sizes.max())
