"""What is said of a fit beside its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from carom.errors import counted
from carom.many.fit.data import Target
from carom.many.fit.intervals import Told
from carom.many.fit.slopes import Slopes
from carom.many.fit.smaller_step import Shift
from carom.many.sweep.table import Sweep

#: Correlations from here on are reported.
STRONG = 0.9


def listed(words: Sequence[str]) -> str:
    """`a, b and c`."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def of_search(message: str, names: Sequence[str], told: Told) -> str:
    """Why the search did not end by itself, and what has no interval for that."""
    which = [names[k] for k in np.flatnonzero(told.leaves).tolist()]
    without = f"; the slopes lead {listed(which)} out of the interval, so there is none" if which else ""
    return f"the search has not converged: {message}{without}"


def of_data(told: Told, names: Sequence[str]) -> list[str]:
    """What the data do not determine, and whether they contradict the model."""
    found = []
    for group in told.directions:
        which = listed([names[k] for k in group])
        found.append(
            f"the data do not determine {which} within its bounds"
            if len(group) == 1
            else f"the data do not tell {which} apart"
        )
    grouped = {k for group in told.directions + told.unclear for k in group}
    for k, name in enumerate(names):
        if told.at_bound[k]:
            found.append(
                f"{name} is at a bound, so it has no interval; give wider bounds if that makes sense"
            )
        elif told.hidden[k] and k not in grouped:
            found.append(f"the data do not determine {name} within its bounds")
    strong = np.triu(np.abs(np.nan_to_num(told.correlation)) > STRONG, 1)
    for i, j in zip(*np.nonzero(strong), strict=True):
        found.append(f"{names[i]} and {names[j]} are correlated by {told.correlation[i, j]:.3f}")
    if told.widened > 1:
        wider = f"; the intervals are widened by {told.widened:.3g}" if np.isfinite(told.half).any() else ""
        found.append(
            f"chi squared is {told.chi2:.4g} where {told.freedom} is expected: the model or the uncertainties are"
            f" not right{wider}"
        )
    return found


def of_gaps(targets: Sequence[Target]) -> list[str]:
    """How many rows of the files have no number."""
    which = [
        f"{target.left_out} of {target.left_out + len(target.value)} of {target.quantity}"
        for target in targets
        if target.left_out
    ]
    return [f"rows without a number are left out: {listed(which)}"] if which else []


def of_jumps(slopes: Slopes, names: Sequence[str], told: Told, method: str) -> str:
    """With which parameters results jump, and what becomes of the intervals."""
    over = listed(list(dict.fromkeys(f"{step:.3g}" for step in slopes.jumps.values())))
    cures = [] if method == "events" else ['method = "events"', "a smaller run.step"]
    without = sorted({k for group in told.unclear for k in group})
    if without:
        end = f"intervals of {listed([names[k] for k in without])} are not known"
        cures.append("a larger search.difference")
    else:
        used = listed(list(dict.fromkeys(f"{slopes.steps[k]:.3g}" for k in slopes.jumps)))
        end = f"intervals are by those over {used} and leave the jumps out"
    cure = f"; use {' or '.join(cures)}" if cures else ""
    return (
        f"results jump with {listed([names[k] for k in slopes.jumps])}: differences over {over} of the range are no"
        f" slopes; {end}{cure}"
    )


def of_step(shift: Shift, names: Sequence[str], moved: Mapping[str, float | None] | None, told: Told) -> str:
    """Which best values depend on the step, and by how much."""
    which = []
    for k in np.flatnonzero(shift.large).tolist():
        by, errors = (moved or {})[names[k]], abs(shift.shares[k]) / told.error[k]
        which.append(f"{names[k]} moves by {by:.2g}, {errors:.2g} standard errors")
    return (
        f"with about half of run.step = {shift.step:g} s {listed(which)}; the intervals leave this error out:"
        ' take a smaller run.step, or method = "events"'
    )


def of_failures(bad: int, sweep: Sweep) -> str:
    """How many points failed, and the first reason."""
    row = sweep.failures[0] if sweep.failures else None
    why = f"; the first: {row['outcome']}: {row['message']}" if row else ": a target is not finite"
    return f"{counted(bad, 'point')} failed and counted as bad{why}"
