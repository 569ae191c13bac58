"""Method `events`: how balls come from one row of /transitions to the next, and what impacts did to them there.

In a time `t` between two rows, or a row and a frame, a ball moves in one mode (`docs/theory/events.md`):

    flight         x' = x + v t + g t^2/2,   v' = v + g t
    roll, slide    x' - x - v t is level, and no longer than (b/2) t^2: b = mu g, of a roll (rho g/r)/(1 + kappa). But in
                   slides with rolling resistance the acceleration is constant: v' = 2 (x' - x)/t - v
    spin, rest     x' = x,   v' = v = 0

A row has the velocity after it. Where it is no impact that is `v'`. Where it is one, `m` times the change is the sum of the
impulses of its time in /impacts, and the speeds recorded there are those of `v'` and of the impulses up to them.

Bound: rounding of the places and times, and below that the ends of bounces: a ball joins a surface from 1e-9 of its radius,
and from speeds that end within 1e-9 s, or are 1e-11 of the fastest. What gives a ball less than 1e-9 of the fastest speed
has no row in /impacts. Of balls that press one another nsga makes steps, which are on no record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import hits
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.hits import Hits
from carom.audit.rates import compliance
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, add_at, dot, norm, unit
from carom.result.tables import Transitions

FLIGHT, SLIDE, ROLL, SPIN, REST, STEPPED = (
    Transitions.MODES.index(name) for name in ("flight", "slide", "roll", "spin", "rest", "stepped")
)
IMPACT = Transitions.EVENTS.index("impact")
#: Mode before an event, and after it, where there is but one.
BEFORE = {"slip ends": "slide", "roll ends": "roll", "release": "stepped"}
AFTER = {"outlet": "gone", "press": "stepped"}
JOINS, SHORT, NOTHING = 1e-9, 1e-9, 1e-11
"""Radii, s, and share of the fastest speed at which a bounce has ended."""
UNTOLD = 2e-9
"""Share of the fastest speed that impacts may give without a row."""
WHY = "bodies pressed one another: the steps of nsga within the step are on no record"


@dataclass(frozen=True)
class Knots:
    """Rows of /transitions of a block, ball by ball."""

    k: I64
    step: I64
    body: I64
    other: I64
    time: F64
    kind: I64
    before: I64
    after: I64
    x: F64
    v: F64
    first: Bool
    """Rows that are the first of their ball in their interval."""


def judge(block: Block, tally: Tally) -> None:
    """All rows of /transitions and /impacts in a block."""
    if block.run.method != "events":
        return
    rows, calm = _rows(block), ~_stepped(block)
    for kind in ("position", "momentum"):
        tally.skip(kind, WHY, "use nsga", int((~calm[rows.k, rows.body]).sum()))
    came, slack = _legs(block, tally, rows, calm)
    if block.run.has_impacts:
        _impacts(block, tally, rows, came, slack, calm)


@once
def _turns(run: Run) -> F64:
    """(K, 3) ball, and the numbers of the first and the last step in which nsga made steps of it."""
    table = run.result.transitions
    mode, body, step = (np.asarray(table[name]) for name in ("mode", "body", "step"))
    turns, found = np.flatnonzero((mode == STEPPED).any(axis=1)), []
    begun: dict[int, float] = {}
    for ball, number, (before, after) in zip(
        body[turns, 0].tolist(), step[turns].tolist(), mode[turns].tolist(), strict=True
    ):
        first = begun.pop(ball, number if before != STEPPED else 0)
        if before == STEPPED:
            found.append((ball, first, number))
        if after == STEPPED:
            begun[ball] = first
    return np.array([*found, *((ball, first, np.inf) for ball, first in begun.items())]).reshape(-1, 3)


def _stepped(block: Block) -> Bool:
    """(B, N) whether nsga made steps of a ball in an interval, or of one with which it hangs together by hits there."""
    run, made = block.run, block.total(block.run.steps["stepped"]) > 0.0
    found = np.zeros((block.count, run.balls), dtype=bool)
    if not made.any():
        return found
    for ball, first, last in _turns(run).tolist():
        found[:, int(ball)] |= (block.s1 >= first) & (block.s0 < last)
    found[made & ~found.any(axis=1)] = True
    h = hits.of_block(block)
    both = h.b < run.balls
    k, a, b = h.k[both], h.a[both], h.b[both]
    while (met := found[k, a] != found[k, b]).any():
        found[k[met], a[met]] = found[k[met], b[met]] = True
    return found


@once
def _rows(block: Block) -> Knots:
    table, run = block.run.result.transitions, block.run
    low, high = np.searchsorted(np.asarray(table["step"]), [block.s0[0] + 1, block.s1[-1] + 1])
    step, time, body, kind, mode, x, v = (
        np.asarray(table[name][low:high])
        for name in ("step", "time", "body", "kind", "mode", "position", "velocity")
    )
    (body, other), mode = body.reshape(-1, 2).astype(np.int64).T, mode.reshape(-1, 2).astype(np.int64)
    k = np.searchsorted(block.s1, step.astype(np.int64))
    order = np.argsort(k * run.balls + body, kind="stable")
    k, body, step = k[order], body[order], step[order].astype(np.int64)
    first = np.diff(k * run.balls + body, prepend=-1) != 0
    rest = (time[order], kind[order].astype(np.int64), mode[order, 0], mode[order, 1], x[order], v[order])
    return Knots(k, step, body, other[order], *rest, first)


def _legs(block: Block, tally: Tally, r: Knots, calm: Bool) -> tuple[F64, F64]:
    """(K, 3) velocities with which balls came to the rows, m/s, and (K,) how far they may be off: infinite if unknown."""
    run, last = block.run, np.append(r.first[1:], True)[: len(r.k)]
    k, body = r.k, r.body
    before = np.where(r.first, -1, np.arange(len(k)) - 1)
    x, v = (
        np.where(r.first[:, None], of[k, body], own[before]) for of, own in ((block.x0, r.x), (block.v0, r.v))
    )
    since = np.where(r.first, block.t0[k], r.time[before])
    came, slack, off, bound = _leg(block, k, body, r.before, (since, x, v), (r.time, r.x))
    place = _of(block, k, body)
    known = calm[k, body] & np.isfinite(slack)
    tally.measure("position", off, bound, place, known)
    follows = r.first | (r.before == r.after[before])
    for told, words in ((r.before, BEFORE), (r.after, AFTER)):
        wanted = np.full(len(Transitions.EVENTS), -1)
        for event, mode in words.items():
            wanted[Transitions.EVENTS.index(event)] = Transitions.MODES.index(mode)
        follows &= (wanted[r.kind] < 0) | (told == wanted[r.kind])
    tally.measure("counts", ~follows, 0.0, place, calm[k, body])
    smooth, mass = known & (r.kind != IMPACT), run.mass[body]
    tally.measure("momentum", mass * norm(r.v - came), mass * slack, place, smooth)
    # From the last row on to the frame after it.
    k, body = k[last], body[last]
    of_row = (r.time[last], r.x[last], r.v[last])
    on, on_slack, off, bound = _leg(block, k, body, r.after[last], of_row, (block.t1[k], block.x1[k, body]))
    place, known_too = _of(block, k, body), calm[k, body] & np.isfinite(on_slack) & block.there[k, body]
    tally.measure("position", off, bound, place, known_too)
    mass = run.mass[body]
    tally.measure("momentum", mass * norm(block.v1[k, body] - on), mass * on_slack, place, known_too)
    return came, np.where(known, slack, np.inf)


def _of(block: Block, k: I64, body: I64) -> Callable[[int], Place]:
    return lambda i: block.place(int(k[i]), int(body[i]))


def _leg(
    block: Block, k: I64, body: I64, mode: I64, begin: tuple[F64, F64, F64], end: tuple[F64, F64]
) -> tuple[F64, F64, F64, F64]:
    """Of balls that move in one mode from times, places and velocities to times and places: velocities at the end, and how
    far they may be off; how far the places are off, and how far they may be.
    """
    run, ((since, x, v), (then, there)) = block.run, (begin, end)
    dt, g = np.maximum(then - since, 0.0), np.broadcast_to(run.gravity, x.shape)
    weight = float(norm(run.gravity))
    down = np.broadcast_to(unit(run.gravity) if weight else np.zeros(3), x.shape)
    most, friction, turning = _pulls(block, mode, body)
    flies = mode == FLIGHT
    held = np.isin(mode, (SLIDE, ROLL, SPIN, REST))
    bounce = np.where(held, SHORT * weight + NOTHING * _fastest(block), 0.0)
    fast = norm(v) + weight * dt
    rounding = 32.0 * EPS * (norm(x) + norm(there) + run.radius[body] + fast * (np.abs(then) + dt))
    off = there - x - v * dt[:, None] - np.where(flies[:, None], 0.5 * g * (dt * dt)[:, None], 0.0)
    upright = np.where(held, dot(off, down), 0.0)
    level = off - upright[:, None] * down
    # In level modes the height is that of the surface, the rest has friction.
    noise = rounding + bounce * friction * dt
    parts = np.maximum(norm(level) - np.where(held, 0.5 * most * dt * dt, 0.0), 0.0), np.abs(upright)
    bounds = noise, rounding + JOINS * run.radius[body] + bounce * dt
    worse = parts[1] * bounds[0] > parts[0] * bounds[1]
    steady = 2.0 * level / np.where(dt > 0.0, dt, 1.0)[:, None]
    by_place = np.where(held & ~turning & (dt > 0.0), 4.0 * noise / np.where(dt > 0.0, dt, 1.0), np.inf)
    by_pull = np.where(held, most * dt, 0.0)
    gained = np.where((held & (by_place < by_pull))[:, None], steady, 0.0)
    gained = np.where(flies[:, None], g * dt[:, None], gained)
    slack = (
        32.0 * EPS * (fast + weight * np.abs(then))
        + (1.0 + friction) * bounce
        + np.minimum(by_place, by_pull)
    )
    slack = np.where(flies | held, slack, np.inf)
    came = v - np.where(held, dot(v, down), 0.0)[:, None] * down + gained
    return came, slack, np.where(worse, *parts[::-1]), np.where(worse, *bounds[::-1])


def _pulls(block: Block, mode: I64, body: I64) -> tuple[F64, F64, Bool]:
    """(K,) the largest deceleration of a level mode, m/s^2, the largest friction, and whether its direction may turn."""
    run = block.run
    walls = run.bodies + np.arange(run.given_walls)
    pair = (np.repeat(np.arange(run.balls), len(walls)), np.tile(walls, run.balls))
    index, weight = run.law_index(*pair), float(norm(run.gravity))

    def largest(name: str) -> F64:
        of = np.nan_to_num(run.coefficient(name, index)).reshape(run.balls, -1)
        return np.asarray(of.max(axis=1, initial=0.0)[body])

    friction, rolling, r = largest("friction"), largest("rolling_radius"), run.radius[body]
    kappa = run.inertia[body] / (run.mass[body] * r * r)
    pulls = np.select([mode == SLIDE, mode == ROLL], [friction, rolling / r / (1.0 + kappa)], 0.0)
    return weight * pulls, friction, (mode == SLIDE) & (rolling > 0.0)


@once
def _fastest(block: Block) -> float:
    """The fastest speed of a ball, or of its surface, at a frame or after a row, m/s; twice that: it spins faster within."""
    run, top = block.run, _rows(block).v
    ends = ((block.v0, block.w0), (block.v1, block.w1))
    found = [np.nan_to_num(norm(v) + run.radius * norm(w)).max(initial=0.0) for v, w in ends]
    return 2.0 * float(max(*found, norm(top).max(initial=0.0)))


def _impacts(block: Block, tally: Tally, r: Knots, came: F64, slack: F64, calm: Bool) -> None:
    """Impulses and speeds of /impacts, by the velocities with which balls came to their times and left them."""
    run, h = block.run, hits.of_block(block)
    known = calm[h.k, h.a]
    for kind in ("impact sum", "impact speeds"):
        tally.skip(kind, WHY, "use nsga", int((~known).sum()))
    low, high = np.searchsorted(run.impact_step, [block.s0[0] + 1, block.s1[-1] + 1])
    time = np.asarray(run.result.impacts["time"][low:high])[known]
    h, here = h.of(known), np.flatnonzero((r.kind == IMPACT) & calm[r.k, r.body])
    # Both ends of the rows: which ball, and with which sign it gets the impulse.
    row = np.concatenate([np.arange(len(h)), np.flatnonzero(h.b < run.balls)])
    who, sign = np.append(h.a, h.b[h.b < run.balls]), np.where(np.arange(len(row)) < len(h), 1.0, -1.0)
    keys = np.column_stack([np.append(r.time[here], time[row]), np.append(r.body[here], who)])
    number = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    of_knot, of_end = number[: len(here)], number[len(here) :]
    many = number.max(initial=-1) + 1
    knots = np.bincount(of_knot, minlength=many)
    late = (knots[of_end] == 0) * run.h
    tally.measure("clock", late, 0.0, lambda i: run.step_place(int(h.step[row[i]]), int(who[i])))
    # Of a ball with several impacts at one time it is not told which rows are of which.
    once_only = knots == 1
    untold = UNTOLD * _fastest(block) * float(run.mass.max())
    size = np.bincount(of_end, norm(h.impulse)[row], minlength=many)
    given = np.zeros((many, 3))
    add_at(given, (of_end,), sign[:, None] * h.impulse[row])
    mass = run.mass[r.body[here]]
    off = norm(mass[:, None] * (r.v[here] - came[here]) - given[of_knot])
    bound = mass * slack[here] + untold + 64.0 * EPS * (size[of_knot] + mass * norm(r.v[here]))
    place = _of(block, r.k[here], r.body[here])
    tally.measure("impact sum", off, bound, place, once_only[of_knot] & np.isfinite(slack[here]))
    start, doubt = np.zeros((many, 3)), np.full(many, np.inf)
    start[of_knot], doubt[of_knot] = came[here], np.where(once_only[of_knot], slack[here], np.inf)
    ends = _within(start, of_end, h.problem[row], sign[:, None] * h.impulse[row] / run.mass[who, None])
    second = np.full(len(h), -1)
    second[row[len(h) :]] = np.arange(len(h), len(row))
    with_ball = second >= 0
    places = np.full((many, 3), np.nan)
    places[of_knot] = r.x[here]
    _met(block, tally, h, time, places[of_end[: len(h)]], places[of_end[second]])
    # What did it is one of those that the ball met then, unless that has no row.
    pairs = np.column_stack([number, np.concatenate([r.other[here], h.b, h.a[row[len(h) :]]])])
    pair = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1)
    weak = (r.before[here] != r.after[here]) & (mass * norm(r.v[here] - came[here]) <= bound)
    tally.measure("counts", ~(np.isin(pair[: len(here)], pair[len(here) :]) | weak), 0.0, place)
    left = np.sqrt(np.bincount(h.k, norm(h.impulse) ** 2, minlength=block.count))
    own = compliance(run, h.a, h.b)[0]
    bound = 2.0 * own * ((8.0 * block.tolerance * left)[h.k] + untold) + doubt[of_end[: len(h)]]
    bound = bound + np.where(with_ball, doubt[of_end[second]], 0.0)
    bound = bound + 64.0 * EPS * (norm(h.impulse) * own + _fastest(block))
    why = "of piles one row per contact and step was recorded, over several problems"
    tally.skip("impact speeds", why, 'impacts = "every" in [record]', int(block.summed[h.k].sum()))
    judged = ~block.summed[h.k] & np.isfinite(bound)
    for told, velocity in zip((h.approach, h.separation), ends, strict=True):
        found = dot(velocity[: len(h)] - np.where(with_ball[:, None], velocity[second], 0.0), h.normal)
        tally.measure("impact speeds", np.abs(told - found), bound, hits.place(block, h), judged)


def _met(block: Block, tally: Tally, h: Hits, time: F64, x: F64, y: F64) -> None:
    """Bodies of an impact touch then, along its normal."""
    run, known = block.run, np.isfinite(x[:, 0]) & ((h.b >= block.run.balls) | np.isfinite(y[:, 0]))
    gap, normal = run.meet(time, h.a, h.b, x, y)
    smallest = np.minimum(run.radius[h.a], run.length[np.minimum(h.b, run.bodies)])
    rounding = 64.0 * EPS * (np.abs(x).max(axis=1, initial=0.0) + run.radius[h.a])
    place = hits.place(block, h)
    tally.measure("gap", np.abs(gap), 2.0 * JOINS * smallest + rounding, place, known)
    tally.measure("normal", norm(h.normal - normal), 16.0 * EPS + rounding / smallest, place, known)


def _within(start: F64, of: I64, problem: I64, gained: F64) -> tuple[F64, F64]:
    """(K, 3) velocities before and after the problem of each row, which gains so much: (K, 3), m/s; `of` numbers `start`."""
    keys, where = np.unique(np.column_stack([of, problem]), axis=0, return_inverse=True)
    where, whose = where.reshape(-1), keys[:, 0]
    each = np.zeros((len(keys), 3))
    add_at(each, (where,), gained)
    after = np.cumsum(each, axis=0)
    first = np.searchsorted(whose, whose)
    after = start[whose] + after - (after - each)[first]
    return (after - each)[where], after[where]
