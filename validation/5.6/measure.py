"""Section 5.6: the measurements of order.py, as data.

Every run steps the compiled core from the scenario file; the closed form until the impact is that of
`carom reproduce` (`carom.reproduce.analytic.approach`), the reference after it a run with a step of about 1e-6 s that
ends on the impact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from carom.many.order import error_of, order_of
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.study import grid_steps
from common import F64, Run, model_of, run

LAWS = ("sequence", "sequence-paper")
SCENARIO = "5.6_break"
BALLS = ("ball2", "ball3", "ball4", "ball5")
BEFORE, AFTER, LATE = 0.11, 0.13, 3.0  # s
#: The cue ball is back on the bed before this, s; later it may be lifted again by other hits.
FIRST_FLIGHT = 0.15
#: Steps h = UNIT / M meet 0.11 s and 0.13 s exactly.
UNIT = 0.01
ROUND = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)
#: Steps at which whole runs of 3 s must converge.
WHOLE = (1e-3, 1e-4, 1e-5)
REFERENCE, QUICK_REFERENCE = 1e-6, 5e-6
#: Where the impact lies in a step: in the middle for the order, at the end for the reference.
MIDDLE, END = 0.5, 1.0 - 1e-4


@dataclass(frozen=True)
class Point:
    """What one step size gives under one law, as differences from the reference."""

    h: float
    delay: float  # from the exact contact to the end of the step that has it, s
    impact: dict[str, float]  # error of v and w at the end of that step
    after: dict[str, float]  # the same at AFTER
    by_ball: list[list[float]]  # at AFTER: per ball, error of v and w
    cue: list[float]  # velocity of the cue ball at the end of the step of the impact, m/s
    mirror: float  # at AFTER: distance between ball 4 and the mirror image of ball 5, m
    converged: bool


KEYS = {"v": "velocity", "w": "angular_velocity"}


def errors(run: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Errors of v and w over all balls, eq. 45."""
    return {short: error_of(run[key], reference[key], norm=2) for short, key in KEYS.items()}


def mirror(position: F64) -> float:
    """Largest coordinate by which ball 4 misses the mirror image of ball 5 in the plane of the cue ball's start, m."""
    axis = float(model_of(SCENARIO)["position"][0][1])
    return float(np.max(np.abs(position[2] - (position[3] * [1, -1, 1] + [0, 2 * axis, 0]))))


def at_impact(h: float, contact: float, law: str) -> tuple[Run, int]:
    """A run to AFTER that keeps the state at the end of the step of the impact."""
    step = math.ceil(contact / h)
    return run(SCENARIO, h, [BEFORE, AFTER], steps=[step], impact=law), step


def study(
    law: str, slide: Approach, families: dict[str, Sequence[float]], reference_h: float
) -> dict[str, list[Point]]:
    """The errors of all steps under one law."""
    contact = slide.contact_time
    reference, last = at_impact(reference_h, contact, law)
    found: dict[str, list[Point]] = {}
    for family, steps in families.items():
        for h in steps:
            this, step = at_impact(h, contact, law)
            pairs = [(this.frames[1][key], reference.frames[1][key]) for key in KEYS.values()]
            point = Point(
                h,
                step * h - contact,
                errors(this.states[step], reference.states[last]),
                errors(this.frames[1], reference.frames[1]),
                [[error_of(f[i : i + 1], r[i : i + 1], norm=2) for f, r in pairs] for i in range(len(BALLS))],
                this.states[step]["velocity"][0].tolist(),
                mirror(this.frames[1]["position"]),
                this.converged,
            )
            found.setdefault(family, []).append(point)
    return found


def before(slide: Approach, steps: Sequence[float]) -> float:
    """Greatest relative departure from the closed form at BEFORE, over velocities, spins and positions."""
    worst = 0.0
    for h in steps:
        frame = run(SCENARIO, h, [BEFORE]).frames[0]
        start = model_of(SCENARIO)["position"]
        pairs = [
            (frame["velocity"][0, 0], slide.velocity(BEFORE)),
            (frame["angular_velocity"][0, 1], slide.spin(BEFORE)),
            (frame["position"][0, 0] - start[0][0], slide.travelled(BEFORE)),
        ]
        worst = max(worst, *(abs(found / exact - 1) for found, exact in pairs))
        # The rack has not moved by a bit, nor the cue ball off its line.
        rest = [frame["velocity"][1:], frame["angular_velocity"][1:], frame["velocity"][0, 1:]]
        worst = max(worst, *(float(np.max(np.abs(x))) / slide.speed for x in rest))
    return worst


def whole(h: float, law: str, slide: Approach) -> dict[str, Any]:
    """A run of 3 s: convergence, conservation, symmetry, the jump of the cue ball, its state at the end."""
    step = math.ceil(slide.contact_time / h)
    this = run(SCENARIO, h, [LATE], steps=[step - 1, step], heights_until=FIRST_FLIGHT, impact=law)
    radius = float(model_of(SCENARIO)["radius"][0])
    bodies = np.asarray(this.impacts["body"])
    first = int(this.impacts["step"][np.flatnonzero((bodies == [0, 1]).all(axis=1))[0]])
    end = this.frames[0]["position"]
    last = this.states[step - 1]
    # The last state before the impact, carried on to the contact by the closed form.
    gap = float(last["position"][1, 0] - last["position"][0, 0]) - 2 * radius
    speed = math.sqrt(float(last["velocity"][0, 0]) ** 2 - 2 * slide.slowing * gap)
    time = float(last["time"]) + 2 * gap / (float(last["velocity"][0, 0]) + speed)
    monitors = this.monitors
    return {
        "h": h,
        "steps": monitors["steps"],
        "unconverged": monitors["unconverged"] if this.outcome is None else -1,
        "fallbacks": monitors["fallbacks"],
        "contact_step": first,
        "contact_step_expected": step,
        "contact_time": time,
        "contact_speed": speed,
        "penetration": monitors["penetration_max_relative"],
        "energy_rise": monitors["energy"]["max_rise_relative"],
        "jump": float(this.height[0]) - radius,
        "cue_vz": float(this.states[step]["velocity"][0, 2]),
        "mirror": mirror(end),
        "position": end.tolist(),
    }


def measure(quick: bool) -> dict[str, Any]:
    """Everything the command prints."""
    slide = Approach.of(model_of(SCENARIO))
    near = [1e-3 * 10 ** (-k / 4) for k in range(7 if quick else 9)]
    families: dict[str, Sequence[float]] = {
        "round": [h for h in ROUND if not quick or h > 3e-5],
        "middle": grid_steps(UNIT, slide.contact_time, near, MIDDLE),
    }
    [reference] = grid_steps(UNIT, slide.contact_time, [QUICK_REFERENCE if quick else REFERENCE], END)
    laws = {law: study(law, slide, families, reference) for law in LAWS}
    orders = {
        law: {
            f"{when} {short}": order_of(
                [p.h for p in points["middle"]], [getattr(p, when)[short] for p in points["middle"]]
            ).value
            for when in ("impact", "after")
            for short in KEYS
        }
        for law, points in laws.items()
    }
    steps = WHOLE[:2] if quick else WHOLE
    return {
        "exact": {"time": slide.contact_time, "speed": slide.contact_speed},
        "reference": reference,
        "before": before(slide, families["round"]),
        "laws": laws,
        "orders": orders,
        "whole": {law: [whole(h, law, slide) for h in steps] for law in LAWS},
    }
