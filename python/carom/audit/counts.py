"""What the rows of the steps count and sum up, against the tables and frames that show it.

    contacts            not below the rows of /contacts of the frame after one whole step (closed ones may push nothing), and
                        of nsga all pairs with an impulse or a gap within the touching tolerance, no more and no fewer,
                        and with loads solved once (algorithm, section 12) some of those that touched before;
                        of moreau all pairs that overlap in the middle of the step, and these are its candidates
    islands, largest_island     the groups that these make        candidates: pairs near after the smooth motion
    impact_problems     not below the number of any problem in /impacts          restitution_scale: the least of theirs
    truncated           not 0 where /impacts has the problem that ends a sequence
    entered, removed    rows of /events of the step        energy_in: of those that enter, as the frame after it has them
    penetration         the deepest overlap of all pairs at the frame, and over the radius of the smaller body
    iterations, residuals       not below those of the history that /residuals keeps of the step, one for each level

How a solver came to them, sweeps and the like are its own affair; nothing else in a run tells them.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import Array, Bool, connected
from carom.audit import closing, cohesion, flows, free_turns, rigid
from carom.audit.block import Block
from carom.audit.data import LEVELS, Run
from carom.audit.near import MARGIN, Near
from carom.audit.report import Tally
from carom.audit.vectors import EPS, norm

PARTS = 8
"""Parts of a mesh that a ball meets at most where no frame shows its place."""


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
        # A wall that is taken away takes the energy of the springs at it along.
        alone = (found == 0) & ~(_wall_ends(run) if name == "removed" else np.zeros(steps, dtype=bool))
        brought = np.where(alone, np.abs(s[energy]), 0.0)
        tally.measure("energy record", brought, 0.0, lambda i: run.step_place(i + 1))
    if not _works(run):
        tally.measure("energy record", np.abs(s["energy_work"]), 0.0, lambda i: run.step_place(i + 1))
    if run.method == "moreau":  # which looks at what is closed in the middle of the step, and at nothing else
        off = s["candidates"] != s["contacts"]
        tally.measure("counts", off, 0.0, lambda i: run.step_place(i + 1), ~run.cut)
    if run.has_impacts:
        _impacts(run, tally)
    _histories(run, tally)


def _wall_ends(run: Run) -> Bool:
    """In which steps a wall has just been taken away, and contacts were springs."""
    ends = [wall.last / run.h for wall in run.walls] if run.method == "penalty" else []
    return np.isin(run.steps["step"] - 1, np.rint(ends))


def _works(run: Run) -> bool:
    """Whether anything but weight and contacts can do work."""
    held = (row[4][0] == "constant" for joint in run.joints for row in joint["rows"])
    driven = run.box.deforms or any(wall.moves for wall in run.walls)
    return bool(run.loads) or not all(held) or driven


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
        scaled = (np.asarray(table["restitution_scale"]) != 1.0).sum() + (s["restitution_scale"] != 1.0).sum()
        tally.measure("counts", scaled, 0.0, lambda i: run.frame_place(0))
        return
    # Where no sequence was cut there is none.
    uncut = s["truncated"][step[ended] - 1] == 0
    tally.measure("counts", uncut, 0.0, lambda i: run.step_place(int(step[ended[i]])))
    # One through springs that was cut goes on by Newton's sequence.
    unbounded = (s["truncated"] > 0) & (run.impact_law.restitution == "energetic")
    most = np.minimum(s["impact_problems"], np.where(unbounded, np.inf, run.impact_law.problems or np.inf))
    beyond = np.maximum(0, highest - most)
    tally.measure("counts", beyond, 0.0, lambda i: run.step_place(i + 1))
    # Sub-steps that are given up and made anew may have scaled more than those that count.
    scale = s["restitution_scale"]
    off = np.where(run.cut, least < scale, least != scale) | ~((scale >= 0.0) & (scale <= 1.0))
    # What is given up where it is not solved counts as a fallback, and may leave no impulse to tell of it.
    off &= ~((scale == 0.0) & (least == 1.0) & (s["fallbacks"] > 0))
    tally.measure("counts", off, 0.0, lambda i: run.step_place(i + 1))


def _histories(run: Run, tally: Tally) -> None:
    """Where the first solver succeeded in a whole step; what others left behind may be longer and end higher."""
    s, table = run.steps, run.result.residuals
    step, level, problem, contacts = (
        np.asarray(table[name]).astype(np.int64) for name in ("step", "level", "problem", "contacts")
    )
    ends, values = (run.result._segments.column("residuals", name) for name in ("end", "value"))
    end = np.asarray(ends).astype(np.int64)
    each = np.arange(len(LEVELS)) == level[:, None]

    def told(name: str) -> Array:
        columns = np.stack([s[f"{name}_{of}"] for of in LEVELS], axis=1)
        return np.asarray(columns[step - 1][each])

    beyond = np.maximum(0.0, np.asarray(values)[end - 1] - told("residual"))
    beyond += np.maximum(0, np.diff(end, prepend=0) - 1 - told("iterations").astype(np.int64))
    last = run.ends(problem) & (level == 2) & (s["truncated"][step - 1] > 0)
    beyond += np.where(
        last, 0, np.maximum(0, problem - np.where(level == 2, s["impact_problems"][step - 1], 0))
    )
    # The projection of Moreau-Jean looks for pairs of its own, at the end of the step.
    projected = (level == 1) & (run.method == "moreau")
    beyond += np.where(projected, 0, np.maximum(0, contacts - s["candidates"][step - 1].astype(np.int64)))
    beyond += np.diff(step * len(LEVELS) + level, prepend=0) <= 0
    whole = ~run.cut[step - 1] & (s["fallbacks"][step - 1] == 0)
    tally.measure("counts", beyond, 0.0, lambda i: run.step_place(int(step[i])), whole)


def of_frames(block: Block, near: Near, tally: Tally) -> None:
    """What the frames show of the step before them."""
    run = block.run
    if run.has_contacts:
        # What `moreau` projects alone has no part in its problem of velocities, whose contacts are counted.
        counted = norm(block.rows.impulse) > 0.0 if run.method == "moreau" else np.ones(len(block.rows), bool)
        rows = np.bincount(block.rows.k[counted], minlength=block.count)
        off = np.maximum(0, rows - run.steps["contacts"][block.s1 - 1].astype(np.int64))
        tally.measure("counts", off, 0.0, block.place, block.single & block.kept)
    _closed(block, near, tally)
    _candidates(block, near, tally)
    _penetration(block, near, tally)
    _entered(block, tally)


def _closed(block: Block, near: Near, tally: Tally) -> None:
    """Closed contacts, the groups that they make, and the largest of these: pairs with an impulse, or with a gap at the end
    of the step within the touching tolerance, of Moreau-Jean with an overlap in the middle of the step. Gaps at that
    tolerance to rounding may count or not, and so may what loads may close, or has come apart since they were solved.
    """
    run, n = block.run, block.run.bodies
    # Which part of a mesh is touched in the middle of a step no frame shows.
    known = run.method == "nsga" or (run.method == "moreau" and not run.parts.meshes)
    if not known or not run.has_contacts:
        return
    judged = block.single & block.kept & block.there.all(axis=1)
    length = np.minimum(run.radius[near.a], run.length[np.minimum(near.b, n)])
    touching, gap = run.held_to("touching_tolerance"), near.gap1
    noise = np.abs(block.x1[near.k, near.a]).max(axis=1) + run.radius[near.a]
    noise = 16.0 * EPS * (noise + run.lengths(block.t1[near.k]))
    lawful = run.law_index(near.a, near.b) >= 0
    many, c = len(run.names), block.rows
    pushed = (c.k * many + c.a) * many + c.b
    if run.method == "moreau":  # what only the projection pushed is not counted
        pushed = pushed[norm(c.impulse) > 0.0]
        middle = block.x0 + 0.5 * run.h * block.v0
        x, y = middle[near.k, near.a], middle[near.k, np.minimum(near.b, n - 1)]
        gap = run.meet(block.t0[near.k] + 0.5 * run.h, near.a, near.b, x, y)[0]
    own = (near.k * many + near.a) * many + near.b
    sure = np.union1d(pushed, own[lawful & (gap <= min(touching) * length - noise)])
    unsure = gap <= max(touching) * length + noise
    if run.loads_once or run.method == "moreau":
        loads = closing.given(block)
        loads = np.maximum(loads[near.k, near.a], loads[near.k, run.given(near.b)])
        slow = 0.5 * loads + closing.closing(block, near.k, near.a, near.b, "candidates")
        unsure |= near.gap0 <= max(touching) * length + noise + run.h * slow
    open_ones = np.setdiff1d(own[lawful & unsure], sure)
    k = sure // many**2
    least, doubt = (np.bincount(keys // many**2, minlength=block.count) for keys in (sure, open_ones))
    told = run.steps["contacts"][block.s1 - 1].astype(np.int64)
    off = np.maximum(0, np.maximum(least - told, told - least - doubt))
    tally.measure("counts", off, 0.0, block.place, judged)
    sound = judged & (doubt == 0) & (off == 0)
    a, b = sure // many % many, sure % many
    linked = run.joined(run.loads)
    first = k * n + linked[a]
    second = np.where(b < n, k * n + linked[np.minimum(b, n - 1)], first)
    group = connected(block.count * n, first, second)[first]
    size = np.bincount(group, minlength=block.count * n).reshape(block.count, n)
    for name, found in (("islands", (size > 0).sum(axis=1)), ("largest_island", size.max(axis=1, initial=0))):
        off = np.abs(found - run.steps[name][block.s1 - 1].astype(np.int64))
        tally.measure("counts", off, 0.0, block.place, sound)


def _candidates(block: Block, near: Near, tally: Tally) -> None:
    """Pairs that are near after the smooth motion of the step; where more came to overlap, not fewer. Of bodies with joints
    or loads, whose smooth motion is no free fall, any number.
    """
    run, n = block.run, block.run.bodies
    if run.method != "nsga":
        return
    fall = free_turns.places(block)
    fall = np.where(np.isfinite(fall), fall, block.x1)
    of_mesh = np.isin(run.given(near.b) - n, list(run.parts.meshes))
    found = [(near.k[~of_mesh], near.a[~of_mesh], near.b[~of_mesh])]
    reach = (1.0 + 2.0 * MARGIN) * run.radius
    for w, wall in run.parts.meshes.items():  # of which balls may meet other parts than at either frame
        k, a = np.nonzero(wall.there(block.t1)[:, None] & block.there[:, : run.balls])
        row, part = run.parts.near(w, wall.local(block.t1[k], fall[k, a]), reach[a])
        found.append((k[row], a[row], n + part))
    k, a, b = (np.concatenate(each) for each in zip(*found, strict=True))
    ball = np.minimum(b, n - 1)
    gap, _ = run.meet(block.t1[k], a, b, fall[k, a], fall[k, ball])
    length = np.minimum(run.radius[a], run.length[np.minimum(b, n)])
    noise = np.abs(fall[k, a]).max(axis=1) + run.radius[a] + run.lengths(block.t1[k])
    noise = 64.0 * EPS * noise
    loaded = run.loaded | (run.cohesive and not run.loads_once)  # else they are looked for before it pulls
    loose = loaded[a] | loaded[ball] & (b < n)
    lawful = run.law_index(a, b) >= 0
    near_by = (~loose & (gap <= MARGIN * length - noise), loose | (gap <= MARGIN * length + noise))
    least, most = (np.bincount(k[lawful & of], minlength=block.count) for of in near_by)
    told = run.steps["candidates"][block.s1 - 1].astype(np.int64)
    more = run.steps["relisted"][block.s1 - 1] > 0
    elsewhere = np.unique((near.k * n + near.a)[of_mesh & loaded[near.a]]) // n
    most = most + PARTS * np.bincount(elsewhere, minlength=block.count)
    off = np.maximum(0, np.maximum(least - told, np.where(more, 0, told - most)))
    tally.measure("counts", off, 0.0, block.place, block.single & block.there.all(axis=1))


def _penetration(block: Block, near: Near, tally: Tally) -> None:
    run = block.run
    other = run.length[np.minimum(near.b, run.bodies)]
    length = np.minimum(run.radius[near.a], other)
    depth = np.where(np.isfinite(near.gap1), np.maximum(0.0, -near.gap1), 0.0)
    extent = np.nanmax(np.abs(block.x1), axis=(1, 2), initial=0.0) + run.radius.max(initial=0.0)
    extent = extent + run.lengths(block.t1)
    # Where a step was made in parts, or the method divides steps, the deepest may have been within it; of balls that
    # come and go the frames do not show all.
    last = run.cut[block.s1 - 1] | run.divides | ~block.there.all(axis=1)
    # What Moreau-Jean touches of a mesh is that of the middle of the step, and goes on beyond its ends.
    last |= bool(run.parts.meshes) and run.method == "moreau"
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
    """Energy of what entered after the last step before a frame: they are as they entered."""
    run = block.run
    k, step, body, kind = flows.events(block)
    chosen = (kind == 1) & (step == block.s1[k])
    if not chosen.any():
        return
    k, body = k[chosen], body[chosen]
    motion = rigid.kinetic(run, block.v1, block.w1, block.c1)[k, body]
    height = rigid.weight(run, block.x1, block.c1)[k, body]
    found, size = np.zeros(block.count), np.zeros(block.count)
    np.add.at(found, k, motion - height)
    np.add.at(size, k, motion + np.abs(height))
    without = block.x1.copy()
    without[k, body] = np.nan
    whole, less = (cohesion.potential(run, block.t1, x) for x in (block.x1, without))
    found, size = found + whole[0] - less[0], size + np.abs(whole[0]) + np.abs(less[0])
    value = np.abs(found - run.steps["energy_in"][block.s1 - 1])
    here = np.isin(np.arange(block.count), k)
    tally.measure("energy record", value, 64.0 * EPS * size + whole[1] + less[1], block.place, here)
