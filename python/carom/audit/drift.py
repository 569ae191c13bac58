"""Overlaps of Moreau-Jean that add up as balls go round within curved walls.

A contact has the normal `m` of the middle of the step, `m.v_{n+1} = 0`. Along a face of curvature `k` towards the ball the
next `m` has turned by `h k v`, so that `m.v_n = -h k v^2`; and since `x_{n+1} = x_n + h (theta v_{n+1} + (1-theta) v_n)`
the gap of each step falls by

    (1 - theta) h^2 k v^2

No law takes that back without projection: it stays as long as the contact does. Along a face that bends away from the ball
it is a gap that opens.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, Bool
from carom.audit.block import once
from carom.audit.data import Run
from carom.audit.surfaces import Surface
from carom.audit.vectors import norm


@once
def of_run(run: Run) -> dict[int, F64]:
    """(F, N) m by how much the overlap of each ball with a wall may have grown so at each frame, since they were apart: by
    the numbers of walls that bend towards balls.
    """
    walls = {w: wall for w, wall in enumerate(run.walls[: run.given_walls]) if _bends(wall)}
    found = {w: np.zeros((run.frames, run.balls)) for w in walls}
    size = max(1, 1_000_000 // run.balls)
    for first in range(1, run.frames, size):
        x, v = (of[:, : run.balls] for of in run.state(slice(first - 1, first + size))[:2])
        time = run.time[first - 1 : first + size]
        flat, times = x.reshape(-1, 3), np.repeat(time, run.balls)
        radius = np.tile(run.radius[: run.balls], len(time))
        for w, wall in walls.items():
            curved = curvature(wall, wall.local(times, flat))
            against = norm(v.reshape(-1, 3) - wall.velocity(times, flat)[0])
            speed = np.maximum(norm(v), against.reshape(norm(v).shape))
            apart = (wall.meet(times, flat, radius)[0] > 0.0).reshape(speed.shape)
            _add(run, found[w], first, speed, curved.reshape(speed.shape), apart)
    return found


def _add(run: Run, found: F64, first: int, speed: F64, curved: F64, apart: Bool) -> None:
    """Adds up what the intervals after the frames from `first - 1` on may add."""
    fast = np.nan_to_num(np.maximum(speed[:-1], speed[1:]))
    steps = np.diff(run.step[first - 1 : first - 1 + len(speed)])[:, None]
    fast = fast + steps * run.h * float(norm(run.gravity))
    # Nothing comes nearer by more than it goes.
    turn = np.minimum(1.0, run.h * fast * np.nan_to_num(np.maximum(curved[:-1], curved[1:]), nan=0.0))
    more = (1.0 - float(run.options["theta"])) * steps * run.h * fast * turn
    for i in range(len(more)):
        found[first + i] = np.where(apart[i] & apart[i + 1], 0.0, found[first + i - 1] + more[i])


def _bends(wall: Surface) -> bool:
    return wall.kind == "cone" or (
        wall.kind in ("cylinder", "sphere") and not wall.part and (bool(wall.parameters[-1]) or wall.sheet)
    )


def curvature(wall: Surface, local: F64) -> F64:
    """(K,) 1/m, largest of the surface on which centres at places in the wall's own axes go round in a wall."""
    away = local - wall.point
    slope = 1.0
    if wall.kind != "sphere":
        along = np.outer(away @ wall.parameters[0], wall.parameters[0])
        away = away - along
    if wall.kind == "cone":
        start, end, length = (float(p) for p in wall.parameters[1:4])
        slope = length / np.hypot(length, end - start)
    with np.errstate(divide="ignore"):
        return np.asarray(slope / norm(away))
