"""What sections 5.2 and 5.3 share: a cue ball "cue" that hits a ball "object" once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from carom.measure.events import hits
from carom.reproduce import study
from carom.reproduce.document import Counts, Curve, Figure, Row
from carom.reproduce.memory import Trace

#: Differences below this are rounding, in any of the units that occur (m, s, J, rad, deg).
SMALLEST = 1e-9
LEVELS: tuple[Literal["position", "velocity"], ...] = ("position", "velocity")


def hit_step(run: Trace) -> int:
    """Number of the step with the hit: the index of the first state after it; its row in `steps` is the one before."""
    return int(hits(run, "cue", "object")["step"][0])


def extrapolated(
    quantity: str,
    unit: str,
    printed: float | str | None,
    closed: float,
    at_h: float,
    at_half: float,
    note: str,
    erratum: str = "",
) -> Row:
    """A value of first order in h. The paper is in error, for the reason `note`, where its number is out of tolerance.

    The error at h is twice the difference between the values at h and h/2; half as much again is admitted.
    """
    tolerance = 3 * abs(at_h - at_half) + SMALLEST
    wrong = isinstance(printed, float) and abs(printed - closed) > tolerance
    why = "first order: 1.5 times the error that the runs with h and h/2 predict"
    told = (note, wrong, erratum) if wrong else ()
    return Row(quantity, unit, printed, closed, at_h, tolerance, why, "analytic", *told)


def together(case: str, runs: Sequence[Trace], tolerance: float, printed: study.Printed) -> Counts:
    """Counts of several runs as one: greatest numbers of any, means over all steps."""
    parts = [study.counts(case, run, tolerance, printed) for run in runs]
    steps = np.array([run.monitors["steps"] for run in runs], dtype=np.float64)

    def level(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
        return max(p[0] for p in pairs), float(np.average([p[1] for p in pairs], weights=steps))

    return Counts(
        case=case,
        smooth=level([p.smooth for p in parts]),
        position=level([p.position for p in parts]),
        velocity=level([p.velocity for p in parts]),
        line_search=(sum(p.line_search[0] for p in parts), sum(p.line_search[1] for p in parts)),
        paper=printed,
        unconverged=sum(p.unconverged for p in parts),
        fallbacks=sum(p.fallbacks for p in parts),
        tolerance=tolerance,
        step=runs[0].h,
    )


def newton_rows(run: Trace) -> list[Row]:
    """Quadratic convergence in the step of the hit: the exponent q of `r_{k+1} = r_k^q` in the last iteration.

    Residuals are relative (eq. 44), so that q is 2 for quadratic convergence with a factor near 1, and near 1 for linear.
    """
    rows = []
    for level in LEVELS:
        history = max(run.residuals.history(hit_step(run), level), key=len)
        before, last = (math.log(x) for x in history[history > 0][-2:])
        name = f"Newton's last iteration at the hit, {level} level: exponent of the residual"
        why = "factors of 1/30 to 30 before the square of a residual of 1e-6"
        note = "residuals " + ", ".join(f"{x:.1e}" for x in history)
        rows.append(study.row(name, "1", last / before, 0.25, why, exact=2.0, paper="quadratic", note=note))
    return rows


def residuals(number: str, run: Trace, caption: str) -> Figure:
    """Residuals of Newton's iterations in the step of the hit."""
    curves = []
    for body, level in enumerate(LEVELS):
        for problem, history in enumerate(run.residuals.history(hit_step(run), level)):
            label = level if problem == 0 else f"{level}, problem {problem + 1}"
            values = np.maximum(history, 1e-18)
            curves.append(Curve(label, np.arange(len(values), dtype=np.float64), values, "line", body))
    return Figure(
        number,
        "Residual of Newton's iterations in the step of the hit",
        "iteration",
        "relative residual (eq. 44)",
        tuple(curves),
        caption,
        yscale="log",
    )


def energies(run: Trace, kept: NDArray[np.integer]) -> tuple[Curve, Curve, Curve]:
    """Kinetic, potential and total energy after some steps, the latter two less the potential energy of the start."""
    time, kinetic, potential = (run.steps[key] for key in ("time", "energy_kinetic", "energy_potential"))
    rest = float(potential[0])
    return (
        Curve("kinetic", time[kept], kinetic[kept], "line", 0),
        Curve("potential, above rest", time[kept], potential[kept] - rest, "line", 1),
        Curve("total, above rest", time[kept], run.energy.total[kept] - rest, "dashed", 2),
    )
