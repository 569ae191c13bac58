"""What the rows of the steps count and sum up, against the tables and frames that show it.

    contacts            not below the rows of /contacts of the frame after one whole step (closed ones may push nothing)
    impact_problems     not below the number of any problem in /impacts          restitution_scale: the least of theirs
    truncated           not 0 where /impacts has the problem that ends a sequence
    entered, removed    rows of /events of the step        energy_in: of those that enter, as the frame after it has them
    penetration         the deepest overlap of all pairs at the frame, and over the radius of the smaller body

Iterations, residuals and the like are the solver's own affair; nothing else in a run tells them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.near import Near
from carom.audit.report import Tally
from carom.audit.vectors import EPS, dot

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def judge(run: Run, tally: Tally) -> None:
    """What concerns the steps alone."""
    s, steps = run.steps, len(run.steps["step"])
    if not steps:
        return
    count = np.zeros((2, steps), dtype=np.int64)
    events = run.result.events
    if len(events):
        step, kind = (np.asarray(events[name]).astype(np.int64) for name in ("step", "kind"))
        later = step > 0  # what enters at the start belongs to no step
        np.add.at(count, (kind[later], step[later] - 1), 1)
    for name, found, energy in (("removed", count[0], "energy_out"), ("entered", count[1], "energy_in")):
        off = np.abs(found - s[name].astype(np.int64))
        tally.measure("counts", off, 0.0, lambda i: run.step_place(i + 1))
        brought = np.where(found == 0, np.abs(s[energy]), 0.0)
        tally.measure("energy record", brought, 0.0, lambda i: run.step_place(i + 1))
    if not _works(run):
        tally.measure("energy record", np.abs(s["energy_work"]), 0.0, lambda i: run.step_place(i + 1))
    if run.has_impacts:
        _impacts(run, tally)


def _works(run: Run) -> bool:
    """Whether anything but weight and contacts can do work."""
    held = (row[4][0] == "constant" for joint in run.joints for row in joint["rows"])
    return bool(run.loads) or not all(held) or any(wall.moves for wall in run.walls)


def _impacts(run: Run, tally: Tally) -> None:
    table, s = run.result.impacts, run.steps
    step, problem = (np.asarray(table[name]).astype(np.int64) for name in ("step", "problem"))
    # The problem that ends a sequence that was cut has a number of its own beyond the bound.
    ended = np.flatnonzero(run.ends(problem))
    problem[ended] = 0
    highest, least = np.zeros(len(s["step"]), dtype=np.int64), np.ones(len(s["step"]))
    np.maximum.at(highest, step - 1, problem)
    np.minimum.at(least, step - 1, np.asarray(table["restitution_scale"]))
    if run.method == "penalty":
        tally.measure("counts", (least != 1.0).sum(), 0.0, lambda i: run.frame_place(0))
        return
    # Where no sequence was cut there is none.
    uncut = s["truncated"][step[ended] - 1] == 0
    tally.measure("counts", uncut, 0.0, lambda i: run.step_place(int(step[ended[i]])))
    beyond = np.maximum(0, highest - s["impact_problems"].astype(np.int64))
    tally.measure("counts", beyond, 0.0, lambda i: run.step_place(i + 1))
    # Parts of a step that are given up and made anew may have scaled more than those that count.
    scale = s["restitution_scale"]
    off = np.where(run.cut, least < scale, least != scale) | ~((scale >= 0.0) & (scale <= 1.0))
    tally.measure("counts", off, 0.0, lambda i: run.step_place(i + 1))


def of_frames(block: Block, near: Near, tally: Tally) -> None:
    """What the frames show of the step before them."""
    run = block.run
    if run.has_contacts:
        rows = np.bincount(block.rows.k, minlength=block.count)
        kept = np.flatnonzero(block.single & block.kept)
        off = np.maximum(0, rows - run.steps["contacts"][block.s1 - 1].astype(np.int64))
        tally.measure("counts", off[kept], 0.0, lambda i: block.place(int(kept[i])))
    _penetration(block, near, tally)
    _entered(block, tally)


def _penetration(block: Block, near: Near, tally: Tally) -> None:
    run = block.run
    other = np.append(run.radius, np.inf)[np.minimum(near.b, run.bodies)]
    length = np.minimum(run.radius[near.a], other)
    depth = np.where(np.isfinite(near.gap1), np.maximum(0.0, -near.gap1), 0.0)
    extent = np.nanmax(np.abs(block.x1), axis=(1, 2), initial=0.0) + run.radius.max(initial=0.0)
    # Where a step was made in parts, or penalty counts its substeps, the deepest may have been within it; of balls that
    # come and go the frames do not show all.
    last = run.cut[block.s1 - 1] | (run.method == "penalty") | ~block.there.all(axis=1)
    for name, each, smallest in (
        ("penetration", depth, 1.0),
        ("penetration_relative", depth / length, float(run.radius.min(initial=np.inf))),
    ):
        deepest = np.zeros(block.count)
        np.maximum.at(deepest, near.k, each)
        told = np.asarray(run.steps[name][block.s1 - 1], dtype=np.float64)
        value = np.where(last, deepest - told, np.abs(deepest - told))
        value = np.where(np.isfinite(told) & (told >= 0.0), np.maximum(value, 0.0), np.inf)
        tally.measure("penetration record", value, 16.0 * EPS * extent / smallest, block.place)


def _entered(block: Block, tally: Tally) -> None:
    """Energy of the balls that entered after the last step before a frame: they are as they entered."""
    run, events = block.run, block.run.result.events
    if not len(events):
        return
    step, body, kind = (np.asarray(events[name]).astype(np.int64) for name in ("step", "body", "kind"))
    k = np.minimum(np.searchsorted(block.s1, step), block.count - 1)
    chosen = (kind == 1) & (step == block.s1[k]) & (step > 0)
    k, body = k[chosen], body[chosen]
    x, v, w = (a[k, body] for a in (block.x1, block.v1, block.w1))
    motion = 0.5 * (run.mass[body] * dot(v, v) + run.inertia[body] * dot(w, w))
    height = run.mass[body] * (x @ run.gravity)
    found, size = np.zeros(block.count), np.zeros(block.count)
    np.add.at(found, k, motion - height)
    np.add.at(size, k, motion + np.abs(height))
    here = np.unique(k)
    value = np.abs(found - run.steps["energy_in"][block.s1 - 1])[here]
    tally.measure("energy record", value, 64.0 * EPS * size[here], lambda i: block.place(int(here[i])))
