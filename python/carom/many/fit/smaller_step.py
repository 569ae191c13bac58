"""What the step of the runs does to the best values: a few runs there with about half of it.

With the inverse A of the slopes and the change dr of the residuals, the best shares would move by -A dr.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from carom.arrays import F64, Bool
from carom.many.fit.intervals import Told
from carom.many.fit.points import Points
from carom.many.sweep.design import Design
from carom.many.sweep.study import Study
from carom.scene.plan import Plan

#: Methods whose results depend on the step.
STEPPED = ("nsga", "moreau", "penalty")
#: Steps of these runs over those of the fit. An impact is placed at the end of its step. With twice as many steps it is
#: at the same time in every other run, and nothing would be seen.
RATIOS = (3**0.5, 5**0.5)
#: Folder of these runs in that of the fit.
FOLDER = "smaller_step"
#: Shift in standard errors from which it is remarked, and how often it must exceed the noise of the runs. A search ends
#: where noise lowers chi squared, so that twice the noise is common.
LARGE, SIGNAL = 0.5, 4.0


@dataclass(frozen=True)
class Shift:
    """Of the shares, by the run that moves each the most, (parameters,); NaN where there is none."""

    step: float
    """Of the fit's runs, s."""
    shares: F64
    large: Bool
    """Whether it matters beside the interval."""


def shift(points: Points, best: int, told: Told) -> Shift | None:
    """How far the best values would move; None where no step is known, or all such runs fail."""
    calibration = points.calibration
    plan, run = calibration.plan, calibration.study.targeting.base.run
    if plan is None or run.method not in STEPPED:
        return None
    predicted, noise = points.beside(_study(points, best, plan), FOLDER)
    changed = (predicted - points.predicted[best]) / points.sigma
    changed = changed[np.isfinite(changed).all(axis=1)]
    if not len(changed):
        return None
    moved = -changed @ told.inverse.T
    largest = np.take_along_axis(moved, np.abs(np.nan_to_num(moved)).argmax(axis=0)[None], axis=0)[0]
    scatter = np.sqrt(np.nanmax(noise**2, axis=0) + points.noise[best] ** 2) / points.sigma
    error = np.sqrt(told.inverse**2 @ scatter**2)
    large = (np.abs(largest) > LARGE * told.error) & (np.abs(largest) > SIGNAL * error)
    return Shift(plan.step, largest, large)


def _study(points: Points, best: int, plan: Plan) -> Study:
    """The best values with other steps, which end and have frames at about the same times."""
    calibration = points.calibration
    study, values = calibration.study, calibration.values(points.shares[best]).tolist()
    steps = [round(plan.steps * ratio) for ratio in RATIOS]
    table = {name: [value] * len(steps) for name, value in zip(calibration.names, values, strict=True)}
    table["run.step"] = [plan.until / n for n in steps]
    table["run.every"] = [max(1, n * plan.every // plan.steps) for n in steps]
    ours = {"step", "every", "until"} & set(study.targeting.of_run)
    kept = {k: v for k, v in study.targets.items() if k.rpartition(".")[2] not in ours}
    return replace(
        study, design=Design("table", table=table), targets=kept, run={**study.run, "until": plan.until}
    )
