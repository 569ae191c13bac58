"""Section 5.4: how the frictional case converges with the step h. Figure 19."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.many.order import Order, error_of, order_of
from carom.reproduce import study
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.analytic.line import LineHit
from carom.reproduce.document import Context, Curve, Figure
from carom.reproduce.memory import trace
from carom.scene.scene import Scene

SCENARIO = "5.4_three_balls.toml"
#: Study of convergence. Steps h = UNIT / M meet AFTER, before the balls strike again, and LATE, when all roll.
UNIT, AFTER, LATE = 0.033, 0.33, 0.99
MIDDLE, END = 0.5, 1.0 - 1e-3
ROUND = (1e-3, 5e-4, 2e-4, 1e-4)
KEYS = {"v": "velocity", "w": "angular_velocity", "x": "position"}


@dataclass(frozen=True)
class Point:
    """One step of the study: errors just after the impact, and states of the whole run (eq. 45)."""

    h: float
    after: dict[str, float]  # of v and w at AFTER, against the closed form
    state: dict[str, F64]  # (T, 3, 3) at the common instants
    unconverged: int


def scene(case: str) -> Scene:
    """The scenario of a case."""
    return Scene.from_toml(Context.scenario(SCENARIO), case=case)


def hit_of(model: dict[str, Any]) -> tuple[Approach, LineHit]:
    """Closed forms from the numbers of the scenario: until the impact, and the impact."""
    way = Approach.of(model)
    mu_b = float(model["friction"][0])
    return way, LineHit(way.contact_speed, way.kappa, way.mu, mu_b, way.gravity)


def after_impact(way: Approach, hit: LineHit, t: float) -> dict[str, F64]:
    """Closed form between the impact and the next hit, (3, 3): balls 1 and 3 fly, ball 2 slides back."""
    dt, r, kappa = t - way.contact_time, way.radius, way.kappa
    v, w = np.zeros((3, 3)), np.zeros((3, 3))
    v[0] = hit.back_1, 0.0, hit.up_1 - way.gravity * dt
    v[1, 0] = hit.back_2 - way.slowing * dt
    v[2] = hit.ahead_2, 0.0, hit.lift_3 - way.gravity * dt
    push = hit.up_1 / hit.mu_b
    w[0, 1] = (hit.speed - hit.up_1 / kappa) / r
    # Spun back by ball 1, forward by the bed under its pressure, by ball 3, by the bed again.
    back = -(hit.mu_b - way.mu * hit.mu_b) * push + hit.lift_3 + way.mu * hit.lift_3
    w[1, 1] = (back / kappa + way.slowing * dt / kappa) / r
    w[2, 1] = hit.lift_3 / kappa / r
    return {"velocity": v, "angular_velocity": w}


# --- the study of convergence, in processes of its own --------------------------------------------------------------


def _instants() -> list[float]:
    return [UNIT * k for k in range(1, round(LATE / UNIT) + 1)]


def _steps(quick: bool) -> list[float]:
    near = [1e-3 * 10 ** (-k / 3) for k in range(4 if quick else 6)]
    return study.grid_steps(UNIT, Approach.of(scene("frictional").to_model()).contact_time, near, MIDDLE)


def _point(h: float, instants: list[float], tolerance: float) -> Point:
    balls = scene("frictional")
    way, hit = hit_of(balls.to_model())
    run = trace(balls, at=instants, step=h, tolerance=tolerance)
    kept = [run.index(t) for t in instants]
    exact, at = after_impact(way, hit, AFTER), run.index(AFTER)
    errors = {short: error_of(getattr(run, KEYS[short])[at], exact[KEYS[short]]) for short in "vw"}
    state = {short: getattr(run, name)[kept] for short, name in KEYS.items()}
    return Point(h, errors, state, run.unconverged)


def points(context: Context) -> list[Point]:
    """Steps that have the impact in their middle, coarse first."""
    return [_point(h, _instants(), study.default_tolerance(context)) for h in _steps(context.quick)]


def round_points(context: Context) -> list[Point]:
    """Steps as a person would choose them: their impact is late by anything between 0 and h."""
    return [_point(h, [AFTER], study.default_tolerance(context)) for h in ROUND]


def reference(context: Context) -> Point:
    """The fine run that whole runs are compared with, as in the paper; its step ends on the impact."""
    event = Approach.of(scene("frictional").to_model()).contact_time
    [h] = study.grid_steps(UNIT, event, [2e-5 if context.quick else 5e-6], END)
    return _point(h, _instants(), study.default_tolerance(context))


def orders_of(found: list[Point], fine: Point) -> tuple[dict[str, Order], dict[str, list[float]]]:
    """Orders just after the impact (v, w) and over the run (x, v), and all errors."""
    errors = {f"{short}, {AFTER} s": [p.after[short] for p in found] for short in "vw"}
    for short in "xv":
        errors[f"{short}, 0 to {LATE} s"] = [error_of(p.state[short], fine.state[short]) for p in found]
    errors[f"v, {LATE} s"] = [error_of(p.state["v"][-1], fine.state["v"][-1]) for p in found]
    return {name: order_of([p.h for p in found], e) for name, e in errors.items()}, errors


def figure(found: list[Point], coarse: list[Point], errors: dict[str, list[float]]) -> Figure:
    """Figure 19: errors of all quantities against the step."""
    h = np.array([p.h for p in found])
    round_h, round_e = ([p.h for p in coarse], [p.after["v"] for p in coarse])
    return study.convergence(
        "19",
        "Convergence with the step, frictional case",
        (
            *(Curve(name, h, np.array(e), "marked") for name, e in errors.items()),
            Curve(f"v, {AFTER} s, round steps", np.array(round_h), np.array(round_e), "points"),
        ),
        (
            f"At {AFTER} s, between the impact and the next hit, against the closed form. Over the whole run, at common "
            "instants, against a fine run, as in the paper (which takes h = 1e-5 s and reports a linear rate). All steps of "
            "the lines have the impact in their middle. Points: round steps; their impact comes late by anything "
            "between 0 and h, and their errors scatter by as much."
        ),
        xlabel="step h in s",
    )
