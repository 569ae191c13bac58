"""What sections 5.2 and 5.3 share: a cue ball "cue" that hits a ball "object" once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from carom.paper import study
from carom.paper.document import Counts, Curve, Figure
from carom.paper.memory import Trace

LEVELS: tuple[Literal["position", "velocity"], ...] = ("position", "velocity")


def hit_step(run: Trace) -> int:
    """Number of the step with the hit: the index of the first state after it; its row in `steps` is the one before."""
    return int(run.hits("cue", "object")["step"][0])


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


def residuals(example: str, number: str, run: Trace, caption: str) -> Figure:
    """Residuals of Newton's iterations in the step of the hit."""
    curves = []
    for body, level in enumerate(LEVELS):
        for problem, history in enumerate(run.histories(hit_step(run), level)):
            label = level if problem == 0 else f"{level}, problem {problem + 1}"
            values = np.maximum(history, 1e-18)
            curves.append(Curve(label, np.arange(len(values), dtype=np.float64), values, "line", body))
    return Figure(
        number,
        example,
        "Residual of Newton's iterations in the step of the hit",
        "iteration",
        "relative residual (eq. 44)",
        tuple(curves),
        caption,
        yscale="log",
    )
