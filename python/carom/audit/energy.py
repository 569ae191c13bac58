"""Energies on record are those of the motion, at each frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64
from carom.audit import (
    cohesion,
    rigid,
)
from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.near import Near, stiffness
from carom.audit.report import Tally
from carom.audit.vectors import EPS, norm, rotated


def judge(block: Block, near: Near, tally: Tally) -> None:
    """Kinetic and potential energies, for the intervals of a block."""
    potential = _potential(block, near)
    _record(block, tally, _motion(block), potential)


def scale(block: Block) -> F64:
    """(B,) sum of the absolute energies of all bodies at the second frame, J, before a kink or after it: what roundings are
    relative to.
    """
    states = block.on_record, (block.v1, block.c1)
    sizes = (rigid.sizes(block.run, block.x1, v, block.w1, rows) for v, rows in states)
    return np.asarray(np.nansum(np.maximum(*sizes), axis=1))


def _motion(block: Block) -> F64:
    """(B,) kinetic energy at the second frame, J, of bodies that are there."""
    v, rows = block.on_record
    return np.asarray(np.nansum(rigid.kinetic(block.run, v, block.w1, rows), axis=1))


def _potential(block: Block, near: Near) -> tuple[F64, F64] | None:
    """Potential energy at the second frame, (B,), J, and the rounding of that of springs; None where no frame tells it."""
    run, rounding = block.run, np.zeros(block.count)
    present = run.present(slice(block.first, block.first + block.count))
    found = -np.where(present, rigid.weight(run, np.nan_to_num(block.x1), block.c1), 0.0).sum(axis=1)
    if run.method == "penalty":
        if run.options["penalty_friction"] == "spring":
            return None
        n = float(run.options["penalty_exponent"])
        curved = [run.walls[b - run.bodies].kind not in ("plane", "rectangle", "disc")
                  for b in np.unique(near.b[near.b >= run.bodies])]  # fmt: skip
        if any(curved):
            return None
        depth = np.maximum(0.0, -np.where(np.isfinite(near.gap1), near.gap1, 0.0))
        each = stiffness(run, near.a, near.b) * depth ** (n + 1.0) / (n + 1.0)
        found = found + np.bincount(near.k, each, minlength=block.count)
    for load in run.loads:
        if load["kind"] == "spring":
            stored, off = of_spring(load, block.x1, block.q1)
            found, rounding = found + stored, rounding + off
    attracted = cohesion.potential(run, block.t1, block.x1)
    found, rounding = found + attracted[0], rounding + attracted[1]
    return np.asarray(found), rounding


def of_spring(load: dict[str, Any], x: F64, q: F64) -> tuple[F64, F64]:
    """Potential energy of a spring for places (B, N, 3) and orientations (B, N, 4), (B,), J, and its rounding: its length is
    known to one of the coordinates.
    """
    ends: list[F64] = []
    extent = np.full(len(x), abs(float(load["rest_length"])))
    for side in "ab":
        body, arm = int(load[side]), np.asarray(load[f"arm_{side}"], dtype=np.float64)
        at = np.broadcast_to(arm, (len(x), 3))
        ends.append(at if body < 0 else x[:, body] + rotated(q[:, body], at))
        extent = extent + norm(ends[-1]) + norm(arm)
    stretch = norm(ends[0] - ends[1]) - float(load["rest_length"])
    stiff, off = float(load["stiffness"]), 8.0 * EPS * extent
    return np.asarray(0.5 * stiff * stretch**2), np.asarray(stiff * off * (np.abs(stretch) + off))


def _last(block: Block, name: str) -> F64:
    """A column of the steps at the second frames."""
    return np.asarray(block.run.steps[name][block.s1 - 1], dtype=np.float64)


def _record(block: Block, tally: Tally, motion: F64, told: tuple[F64, F64] | None) -> None:
    """Bound: rounding of a sum over all bodies, in any order."""
    run = block.run
    bound = EPS * (16.0 + run.bodies) * scale(block) + 1e-300
    tally.measure("energy record", np.abs(_last(block, "energy_kinetic") - motion), bound, block.place)
    if told is None:
        why = "the potential of springs of friction, and of contacts with curved walls, is not in the frames"
        tally.skip("energy record", why, "use nsga or moreau", block.count)
        return
    potential, rounding = told
    size = bound + 16.0 * EPS * np.abs(potential) + rounding
    if run.method == "penalty":
        # An indentation is known to a rounding of the coordinates, its energy to that over the indentation.
        size = size + 1e-9 * np.abs(potential) + 1e-9 * motion
    tally.measure("energy record", np.abs(_last(block, "energy_potential") - potential), size, block.place)


def at_start(run: Run) -> tuple[float, float]:
    """Kinetic energy, and that of the weight and of springs, at the first frame of the run, J."""
    x, v, w, q = (of[0] for of in run.state(slice(0, 1)))
    here = run.present(slice(0, 1))[0]
    rows = run.motion_of_clumps(slice(0, 1))[0]
    motion, height = rigid.kinetic(run, v, w, rows), -rigid.weight(run, np.nan_to_num(x), rows)
    springs = sum(
        float(of_spring(load, x[None], q[None])[0][0]) for load in run.loads if load["kind"] == "spring"
    )
    springs += float(cohesion.potential(run, run.time[:1], np.where(here[:, None], x, np.nan)[None])[0][0])
    return float(np.where(here, motion, 0.0).sum()), float(np.where(here, height, 0.0).sum()) + springs
