"""The files as such: finite numbers, unit quaternions, times and counts that fit, bodies and start of the scenario."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from carom.arrays import F64, I64
from carom.audit import flows
from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.references import at
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, norm
from carom.result.kinematics import QUANTITIES

ROWS = 200_000
"""Rows that are read at a time."""


def judge(run: Run, tally: Tally) -> None:
    """What concerns whole tables."""
    _numbers(run, tally)
    _clock(run, tally)
    _scenario(run, tally)


def frames(block: Block, tally: Tally) -> None:
    """Numbers and quaternions of the second frames of a block."""
    run = block.run
    here = run.present(slice(block.first, block.first + block.count))
    for values in (block.x1, block.v1, block.w1, block.q1):
        wrong = (~np.isfinite(values)).sum(axis=-1) * here
        tally.measure("numbers", wrong, 0.0, block.per_body)
    if run.clumps:
        wrong = (~np.isfinite(block.c1)).sum(axis=-1) * here[:, run.clumps.first]
        tally.measure("numbers", wrong, 0.0, block.per_clump)
        off = np.abs(norm(block.c1[..., 3:7]) - 1.0)
        tally.measure("quaternion", off, 8.0 * EPS, block.per_clump)
    off = np.abs(norm(block.q1) - 1.0)
    # The simulator normalises after every step; what the scenario gives is normalised too.
    tally.measure("quaternion", off, 8.0 * EPS, block.per_body, here)
    _absent(block, tally)


def _absent(block: Block, tally: Tally) -> None:
    """What is absent has no place and no velocity, and keeps its orientation to rounding, if it has not come meanwhile."""
    run, rows = block.run, slice(block.first - 1, block.first + block.count)
    x, v, w, q = run.state(rows)
    gone = ~run.present(rows)
    still = gone[1:] & gone[:-1] & ~flows.entered(block)
    tables = [(x, v, w, q, gone, still, block.per_body)]
    if run.clumps:
        c, first = run.motion_of_clumps(rows), run.clumps.first
        of_clumps = (c[..., :3], c[..., 7:10], c[..., 10:], c[..., 3:7])
        tables.append((*of_clumps, gone[:, first], still[:, first], block.per_clump))
    for place, fast, spin, turn, away, stays, where in tables:
        told = np.isfinite(place) | (fast != 0.0) | (spin != 0.0)
        tally.measure("numbers", told[1:].sum(axis=-1), 0.0, where, away[1:])
        turned = norm(turn[1:] - turn[:-1]) > 8.0 * EPS * block.n[:, None]  # which each step normalises
        tally.measure("numbers", turned, 0.0, where, stays)


def _numbers(run: Run, tally: Tally) -> None:
    segments = run.result._segments
    for table in ("contacts", "impacts", "steps"):
        for name in segments.columns(table):
            column = segments.column(table, name)
            if column.dtype.kind != "f":
                continue
            for first in range(0, len(column), ROWS):
                values = np.asarray(column[first : first + ROWS])
                wrong = values.size - np.count_nonzero(np.isfinite(values))
                tally.measure("numbers", [wrong], 0.0, at(f"/{table}/{name}"))


def _clock(run: Run, tally: Tally) -> None:
    """Times are step numbers times h; frames and steps follow one another, each step has its row, impacts their steps."""
    h, steps = run.h, run.steps
    tally.measure("clock", np.abs(run.time - run.step * h), 2.0 * EPS * run.step * h, run.frame_place)
    number = steps["step"].astype(np.int64)
    tally.measure("clock", np.abs(steps["time"] - number * h), 2.0 * EPS * number * h,
                  lambda i: run.step_place(int(number[i])))  # fmt: skip
    order = np.abs(number - np.arange(1, len(number) + 1)) * h
    tally.measure("clock", order, 0.0, lambda i: run.step_place(i + 1))
    backwards = (np.diff(run.step) <= 0) * h
    tally.measure("clock", backwards, 0.0, lambda i: run.frame_place(i + 1))
    late = np.maximum(0, run.step - len(number)) * h
    tally.measure("clock", late, 0.0, run.frame_place)
    for table in (run.result.impacts, run.result.impulses, run.result.events, run.result.transitions):
        at = np.asarray(table["step"]).astype(np.int64)
        if not at.size:
            continue
        time = np.asarray(table["time"])
        back = np.maximum(0.0, -np.diff(time, prepend=time[0]))
        late = time - at * h
        if run.method == "events":  # whose impacts lie within the step
            slack = 2.0 * EPS * at * h
            late = np.where((-h - slack <= late) & (late <= 0.0), 0.0, late)
        off = np.abs(late) + back + h * ((at > len(number)) | (np.diff(at, prepend=0) < 0))
        tally.measure("clock", off, 2.0 * EPS * at * h, _steps(run, at))
    ends = np.asarray(run.result._segments.column("frames", "contact_end")).astype(np.int64)
    tally.measure("clock", (np.diff(ends, prepend=0) < 0) * h, 0.0, run.frame_place)


def _scenario(run: Run, tally: Tally) -> None:
    """Bodies are those of the scenario, and the first frame is its start. Decimals of a file are read to one rounding."""
    for name in ("radius", "mass", "inertia"):
        wanted, found = np.asarray(run.model[name]), np.asarray(run.result.bodies[name])
        if wanted.shape != found.shape:
            tally.measure("scenario", [np.inf], 0.0, at(f"/bodies/{name}"))
            return
        tally.measure(
            "scenario", np.abs(found / wanted - 1.0), 8.0 * EPS, lambda i: Place(who=(run.names[i],))
        )
    _walls(run, tally)
    _clumps(run, tally)
    _box(run, tally)
    world = (("gravity", run.gravity), ("periodic", np.zeros(3) if run.period is None else run.period))
    for name, found in world:
        given = run.model.get(name)
        _compare(tally, np.zeros(3) if given is None else given, found, f"/ ({name})")
    _compare(tally, run.names[: run.balls], run.result.names, "/bodies/name")
    _compare(tally, run.material, run.result.bodies["material"], "/bodies/material")
    if not run.frames or int(run.step[0]) != 0:
        return
    # What enters at the start has places drawn.
    present = np.asarray(run.result.present[0]) & ~flows.coming(run)
    for name in QUANTITIES:
        wanted, found = np.asarray(run.model[name]), np.asarray(getattr(run.result, name)[0])
        size = norm(wanted) + run.radius[: run.balls] * (1.0 if name == "position" else 0.0)
        if name == "velocity":  # given against the mean flow
            places = np.array(run.model["position"])
            places[run.clumps.balls] = run.clumps.start[run.clumps.of, :3]  # whose flow their balls have
            flow = _flow(run, places)
            away = norm(places) + float(norm(run.box.middle))
            rate = float(run.box.strain_rate(np.zeros(1))[0])
            wanted, size = wanted + flow, size + 4.0 * norm(flow) + rate * away
        off = norm(found - wanted) / (size + 1e-300)
        tally.measure("scenario", off, 8.0 * EPS, lambda i: run.frame_place(0, i), present)
    if run.clumps:
        given = run.clumps.start.copy()
        given[:, 7:10] += _flow(run, given[:, :3])[:, :3]
        for part, least in (
            (slice(0, 3), run.clumps.reach),
            (slice(3, 7), 1.0),
            (slice(7, 10), 0.0),
            (slice(10, 13), 0.0),
        ):
            off = norm(run.motion_of_clumps(slice(0, 1))[0, :, part] - given[:, part])
            off = off / (norm(given[:, part]) + least + 1e-300)
            place, there = (lambda i: run.frame_place(0, int(run.clumps.first[i]))), present[run.clumps.first]
            tally.measure("scenario", off, 8.0 * EPS, place, there)
    if run.free_walls:
        along = np.asarray(run.result._segments.column("frames", "free_walls")[0])
        given = np.array([[0.0, wall.velocity] for wall in run.free_walls])
        off = np.abs(along - given).max(axis=1) / np.maximum(np.abs(given[:, 1]), 1.0)
        tally.measure("scenario", off, 8.0 * EPS, lambda i: run.frame_place(0, run.balls + i))


def _box(run: Run, tally: Tally) -> None:
    """Its lengths, and the offset of its images, are those of the law at each frame. Bound: rounding of these, and of the
    time at which they are taken.
    """
    box, segments = run.box, run.result._segments
    names = set(segments.columns("frames"))
    missing = ("box" in names) != box.deforms
    tally.measure("scenario", [np.inf if missing else 0.0], 0.0, at("/frames/box"))
    if not box.deforms or "box" not in names:
        return
    for name, axis in (("box_flow", box.flow), ("box_gradient", box.gradient)):
        _compare(tally, axis, segments.attributes.get(name, -1), f"/ ({name})")
    found = np.asarray(segments.column("frames", "box"))
    (lengths, offset), (fast, drift) = box.edges(run.time), box.rates(run.time)
    wanted = np.column_stack([lengths, offset])
    size = np.abs(wanted).max(axis=1) + box.first.max()
    size = size + run.time * np.abs(np.column_stack([fast, drift])).max(axis=1)
    off = np.abs(found - wanted).max(axis=1) / size
    tally.measure("scenario", off, 32.0 * EPS, run.frame_place)


def _flow(run: Run, x: F64) -> F64:
    """(K, 3) velocities of the mean flow of the periodic box at the start at places (K, 3), m/s."""
    start = np.zeros(1)
    return run.box.along(run.box.rates(start), run.box.share(run.box.edges(start), np.asarray(x)))


def _walls(run: Run, tally: Tally) -> None:
    """The tables of walls, column by column, as far as the file has them."""
    for table, columns in run.wall_tables.items():
        found = run.result._segments.static(table)
        for name in sorted({*columns, *found}):
            _compare(tally, columns.get(name, ()), found.get(name, ()), f"/{table}/{name}")


def _clumps(run: Run, tally: Tally) -> None:
    """The table of clumps."""
    if not run.clumps:
        return
    columns, found = run.clump_table, run.result._segments.static("clumps")
    for name in sorted({*columns, *found}):
        _compare(tally, columns.get(name, ()), found.get(name, ()), f"/clumps/{name}")


def _compare(tally: Tally, wanted: Any, found: Any, dataset: str) -> None:
    """A column of the files against the scenario: texts the same, numbers to rounding, none where there is none."""
    wanted, found = np.asarray(wanted), np.asarray(found)
    if wanted.shape != found.shape:
        off = np.array([np.inf])
    elif wanted.dtype.kind in "fiub" and found.dtype.kind in "fiub":
        wanted, found = wanted.astype(np.float64), found.astype(np.float64)
        off = np.abs(found - wanted) / np.maximum(np.abs(wanted), 1.0)
        off = np.where(np.isnan(wanted) & np.isnan(found) | (wanted == found), 0.0, off)
    else:
        off = (wanted.astype(str) != found.astype(str)).astype(np.float64)
    tally.measure("scenario", off, 8.0 * EPS, at(dataset))


def _steps(run: Run, step: I64) -> Callable[[int], Place]:
    return lambda i: run.step_place(int(step[i]))
