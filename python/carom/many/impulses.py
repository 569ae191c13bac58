"""How the impulses of a run grow: the order of the pairs that impacts move, by an impact law."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

import carom
from carom.arrays import F64
from carom.errors import CaromWarning
from carom.run.result import Result
from carom.run.simulate import RunFailed
from carom.scene.scene import Scene

#: Pairs that a comparison follows, the first ones.
FIRST = 12
#: Impulses of a run that are looked at, about: springs have 500 points for each.
MOST = 2000


def growing(scene: Scene, options: Mapping[str, Any], result: Result) -> dict[tuple[str, str], F64]:
    """For each pair, in the order of `half`: (K, 2) the impact problems of the run so far, and its impulse, N s.

    It ends with the step in which the last of the `FIRST` pairs to begin does so. `result`, a run of this scene, says
    how far to look.
    """
    steps = np.asarray(result.impacts["step"])
    if not len(steps):
        return {}
    until = int(steps[min(len(steps), MOST) - 1]) * scene.run.step
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)
        try:
            found = carom.simulate(scene, **{**options, "impacts": "history", "until": until})
        except RunFailed as error:
            found = error.result
    return _by_pair(found)


def half(points: F64) -> float:
    """Impact problems of the run until a pair has half of its impulse. (Springs begin at once, and give it later.)"""
    return float(np.interp(0.5 * points[-1, 1], points[:, 1], points[:, 0]))


def _by_pair(result: Result) -> dict[tuple[str, str], F64]:
    table = result.impulses
    if not len(table):
        return {}
    step, at = np.asarray(table["step"]), np.asarray(table["at"])
    _, impact = np.unique(np.column_stack([step, table["time"]]), axis=0, return_inverse=True)
    # Problems of the impacts before.
    most = np.zeros(int(impact.max()) + 1)
    np.maximum.at(most, impact, at)
    at = at + (np.cumsum(most) - most)[impact]
    pairs, which = np.unique(np.asarray(table["body"]), axis=0, return_inverse=True)
    begin = np.full(len(pairs), np.inf)
    np.minimum.at(begin, which, at)
    chosen = np.argsort(begin, kind="stable")[:FIRST]
    last = step[which == chosen[-1]].min()
    names = [*result.names, *result.scene.wall_names]
    found = {}
    for k in chosen:
        rows = (which == k) & (step <= last)
        points = np.column_stack([at[rows], table["impulse"][rows]])
        # Impulses of an impact count from its begin on.
        ends = np.flatnonzero(np.diff(impact[rows])) + 1
        for end in ends:
            points[end:, 1] += points[end - 1, 1]
        points = np.vstack([points, [at[step <= last].max(), points[-1, 1]]])
        first, second = pairs[k].tolist()
        found[names[first], names[second]] = points
    return dict(sorted(found.items(), key=lambda one: half(one[1])))
