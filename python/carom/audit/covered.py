"""Walls that cover one another: what of a wall is nearest to a ball is not touched where it lies on another wall as well, of
which a point is nearer (algorithm, section 13).
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit.data import Run

SLACK = 1e-7
"""Of the radius: how far from a wall a point may be and count as on it."""
ROUNDING = 1e-14
"""The same of the coordinates."""


def uncovered(run: Run, time: F64, k: I64, a: I64, b: I64, x: F64, y: F64) -> tuple[F64, F64]:
    """Gap (K,) and normal (K, 3) as `Run.meet` has them for pairs of frames `k`; the gap of covered walls is infinite."""
    gap, normal = run.meet(time, a, b, x, y)
    wall = np.flatnonzero((b >= run.bodies) & np.isfinite(gap))
    wall = wall[np.lexsort((b[wall], gap[wall], a[wall], k[wall]))]
    point = x - (run.radius[a] + gap)[:, None] * normal
    covered = np.zeros(len(k), dtype=bool)
    for far in range(1, len(wall)):
        both = (k[wall[far:]] == k[wall[:-far]]) & (a[wall[far:]] == a[wall[:-far]])
        if not both.any():
            break
        for by, of in ((wall[:-far][both], wall[far:][both]), (wall[far:][both], wall[:-far][both])):
            tie = ROUNDING * (np.abs(point[of]).max(axis=1) + run.radius[a[of]])
            nearer = (gap[by] < gap[of] - tie) | ((gap[by] <= gap[of] + tie) & (b[by] < b[of]))
            away = run.meet(time[of], a[of], b[by], point[of], y[of])[0] + run.radius[a[of]]
            slack = SLACK * run.radius[a[of]] + 2.0 * tie
            covered[of] |= nearer & (np.abs(away) <= slack)
    return np.where(covered, np.inf, gap), normal
