"""Balls that enter and leave: by the tables `[[inflow]]` and `[[outlet]]`, and by the events that tell of them.

    outlet      no ball of a frame is where it would have left, and a ball that left had come to such a place
    inflow      the k-th body enters no sooner than `start + k/rate`, in the region, with its velocity within the spread,
                not turning, and a clump with its orientation if it has a given one
    frames      have the balls that events and the scenario say

Balls with joints or loads stay. Places and velocities of a body that entered are those of the frame of its step. Balls
of a clump enter and leave together, and their place is its centre of mass.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import forces
from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, conjugate, norm, product, rotation_vector


def judge(run: Run, tally: Tally) -> None:
    """What concerns the table of events: who was there, and when balls entered."""
    inflows, (step, body, kind) = run.model.get("inflow") or (), _all_events(run)
    if not (inflows or run.model.get("outlet") or len(step)):
        return
    here = ~coming(run)
    done = 0
    for frame in range(run.frames):
        while done < len(step) and step[done] <= run.step[frame]:
            here[body[done]] = kind[done] == 1
            done += 1
        wrong = np.flatnonzero(np.asarray(run.result.present[frame]) != here)
        tally.measure("flow", [float(len(wrong))], 0.0, lambda i: run.frame_place(frame, *wrong[:1]))  # noqa: B023
    clumps = run.clumps
    for which in (0, 1):
        at = np.full(run.balls, -1)
        at[body[kind == which]] = step[kind == which]
        last, first = (clumps.over(of, at[None])[0] for of in (np.maximum, np.minimum))
        tally.measure("flow", last - first, 0.0, _of_steps(run, at[clumps.first], clumps.first))
    for flow in inflows:
        balls, each = _balls(run, flow)
        mine = np.flatnonzero((kind == 1) & np.isin(body, balls[::each]))
        number = (body[mine] - balls[0]) // each
        due = flow["start"] + (number / flow["rate"] if flow["rate"] > 0.0 else 0.0)
        place = _of_steps(run, step[mine], body[mine])
        tally.measure("flow", np.maximum(0.0, due / run.h - step[mine]), 1e-5, place)
        tally.measure("flow", np.abs(number - np.arange(len(mine))), 0.0, place)


def coming(run: Run) -> Bool:
    """(N,) which balls are those of inflows."""
    found = np.zeros(run.balls, dtype=bool)
    for flow in run.model.get("inflow") or ():
        found[_balls(run, flow)[0]] = True
    return found


def entered(block: Block) -> Bool:
    """(B, N) which balls entered in each interval."""
    k, _, body, kind = events(block)
    found = np.zeros((block.count, block.run.bodies), dtype=bool)
    found[k[kind == 1], body[kind == 1]] = True
    return found


def events(block: Block) -> tuple[I64, I64, I64, I64]:
    """What came and went in the intervals of a block: interval, step, ball, and 1 for what came, each (E,)."""
    step, body, kind = _all_events(block.run)
    k = np.minimum(np.searchsorted(block.s1, step), block.count - 1)
    now = (step > block.s0[k]) & (step <= block.s1[k])
    return k[now], step[now], body[now], kind[now]


def _all_events(run: Run) -> tuple[I64, I64, I64]:
    """Step, ball and kind of all events, each (E,)."""
    table = run.result.events
    step, body, kind = (
        np.asarray(table[name]).astype(np.int64) if len(table) else np.zeros(0, np.int64)
        for name in ("step", "body", "kind")
    )
    return step, body, kind


def _balls(run: Run, flow: Mapping[str, Any]) -> tuple[I64, int]:
    """(n,) the balls of an inflow, and how many each of its bodies has."""
    first, count = flow["bodies"]
    if first < run.balls:
        return np.arange(first, first + count), 1
    clumps = np.arange(first - run.balls, first - run.balls + count)
    return run.clumps.balls_of(clumps)[1], int(run.clumps.many[clumps[0]])


def _of_steps(run: Run, step: I64, body: I64) -> Callable[[int], Place]:
    return lambda i: run.step_place(int(step[i]), int(body[i]))


def of_frames(block: Block, tally: Tally) -> None:
    """Where balls are, enter and leave."""
    run = block.run
    outlets, inflows = run.model.get("outlet") or (), run.model.get("inflow") or ()
    free = ~run.loaded & (not run.cohesive)
    free[run.balls :] = False  # free walls neither enter nor leave
    present = run.present(slice(block.first - 1, block.first + block.count))
    here = present[1:] & free
    if not (outlets or inflows):
        return
    k, step, body, kind = events(block)
    entered = (kind == 1) & (step == block.s1[k])
    here[k[entered], body[entered]] = False  # who leaves is asked before others enter
    start, end = (
        _of_bodies(run, *of) for of in ((block.x0, block.c0[..., :3]), (block.x1, block.c1[..., :3]))
    )
    velocity = _of_bodies(run, block.v1, block.c1[..., 7:10])
    for outlet in outlets:
        inside = _depth(run, outlet, end)
        tally.measure("flow", np.where(here, inside, 0.0) / run.radius, 0.0, block.per_body)
    gone = np.flatnonzero((kind == 0) & present[k, body])
    if outlets and gone.size and run.has_contacts:
        at = (k[gone], body[gone])
        way = (forces.speeds(block)[at] + norm(run.gravity) * block.dt[k[gone]]) * block.dt[k[gone]]
        short = np.min([np.maximum(0.0, -_depth(run, o, start)[at]) for o in outlets], axis=0)
        tally.measure("flow", short, 2.0 * way, _of_steps(run, step[gone], body[gone]))
    come = np.flatnonzero(entered)
    for flow in inflows:
        mine = come[np.isin(body[come], _balls(run, flow)[0])]
        at, given = (k[mine], body[mine]), np.asarray(flow["velocity"])
        place = _of_steps(run, step[mine], body[mine])
        off = np.abs(velocity[at] - given).max(axis=1, initial=0.0) - flow["spread"]
        tally.measure("flow", np.maximum(off, 0.0), 1e-12 * float(norm(given) + flow["spread"]), place)
        size = np.abs(end[at]).max(axis=1, initial=0.0) + run.radius[body[mine]]
        tally.measure("flow", norm(block.w1[at]), 0.0, place)
        if flow.get("turned") is False:
            given_turn = run.clumps.start[run.clump_of[body[mine]], 3:7]
            turned = block.c1[k[mine], run.clump_of[body[mine]], 3:7]
            off = norm(rotation_vector(product(turned, conjugate(given_turn))))
            tally.measure("flow", off, 16.0 * EPS, place)
        tally.measure("flow", _outside(flow["region"], end[at]), 64.0 * EPS * size, place)


def _of_bodies(run: Run, of_balls: F64, of_clumps: F64) -> F64:
    """(B, N, 3) what balls have, those of clumps what their clump (B, C, 3) has: places by which they enter and leave."""
    if run.clumps:
        of_balls = np.where(run.in_clump[:, None], of_clumps[:, run.clump_of], of_balls)
    return of_balls


def _depth(run: Run, outlet: tuple[Any, ...], x: F64) -> F64:
    """(...) how far places (..., 3) are within an outlet, m; negative where they are not in it. Any image counts."""
    low, high, inside = np.asarray(outlet[0]), np.asarray(outlet[1]), bool(outlet[2])
    if run.period is not None:
        length = np.where(run.period > 0.0, run.period, np.inf)
        repeats = np.isfinite(length)
        with np.errstate(invalid="ignore"):
            above = x + np.where(repeats, np.ceil((low - x) / length) * run.period, 0.0)
        # Of the images next to its low side the deeper one counts: a place a rounding below it is not a period within.
        images = [above, above - np.where(repeats, run.period, 0.0)]
    else:
        images = [x]
    depth = np.max([np.minimum(at - low, high - at) for at in images], axis=0).min(axis=-1)
    return np.asarray(depth if inside else -depth)


def _outside(region: tuple[Any, ...], x: F64) -> F64:
    """(K,) how far places (K, 3) are from a region of an inflow, m."""
    if region[0] == "box":
        low, high = np.asarray(region[1]), np.asarray(region[2])
        return np.asarray(np.maximum(np.maximum(low - x, x - high), 0.0).max(axis=1, initial=0.0))
    point, normal, radius = np.asarray(region[1]), np.asarray(region[2]), float(region[3])
    d = x - point
    along = np.abs(d @ normal)
    return np.asarray(np.maximum(along, np.maximum(norm(d - (d @ normal)[:, None] * normal) - radius, 0.0)))
