"""Section 5.6: the velocities just after the break against their limit for h -> 0, by step and law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64
from carom.many.order import Order, error_of, order_of
from carom.reproduce import study
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.analytic.break_shot import impact_of
from carom.reproduce.document import Context, Curve, Figure, Kind
from carom.reproduce.memory import trace
from carom.scene.scene import Scene

LAWS = ("sequence", "sequence-paper")
FREE, BRAKED = CASES = ("5.6_break", "5.6_break_rolling")
NAMES = {FREE: "no rolling resistance", BRAKED: "rolling resistance"}
ROUND = (1e-3, 5e-4, 2e-4, 1e-4)
LINE: Kind = "marked"
POINTS: Kind = "points"
KEYS = {"v": "velocity", "w": "angular_velocity"}


@dataclass(frozen=True)
class Point:
    """One step under one law: velocities (4, 3) at the end of the step of the impact, and their errors (eq. 45)."""

    h: float
    law: str
    velocity: F64
    angular_velocity: F64
    errors: dict[str, float]
    unconverged: int


def scene(case: str) -> Scene:
    """The scenario of a case."""
    return Scene.from_toml(Context.scenario(f"{case}.toml"))


def point(h: float, law: str, tolerance: float) -> Point:
    """A run until the end of the step of the impact."""
    balls = scene(CASES[0])
    model = balls.to_model()
    exact = impact_of(model)[-1]
    last = math.ceil(Approach.of(model).contact_time / h) * h
    run = trace(balls, at=[last], step=h, impact=law, tolerance=tolerance)
    v, w = run.velocity[-1], run.angular_velocity[-1]
    errors = {"v": error_of(v, exact.velocity), "w": error_of(w, exact.spin)}
    return Point(h, law, v, w, errors, run.unconverged)


def points(context: Context) -> list[Point]:
    """Steps with the impact in their middle, coarse first, under both laws."""
    near = [1e-3 * 10 ** (-k / 3) for k in range(4 if context.quick else 6)]
    event = Approach.of(scene(CASES[0]).to_model()).contact_time
    steps = [event / (round(event / h) - 0.5) for h in near]
    return [point(h, law, study.default_tolerance(context)) for law in LAWS for h in steps]


def round_points(context: Context) -> list[Point]:
    """Round steps, whose impact is late by anything between 0 and h."""
    return [point(h, law, study.default_tolerance(context)) for law in LAWS for h in ROUND]


def of(law: str, found: Sequence[Point]) -> list[Point]:
    """The points of one law."""
    return [p for p in found if p.law == law]


def orders(found: Sequence[Point]) -> dict[tuple[str, str], Order]:
    """Order of v and w by law."""
    return {
        (law, short): order_of([p.h for p in of(law, found)], [p.errors[short] for p in of(law, found)])
        for law in LAWS
        for short in KEYS
    }


def _errors(found: Sequence[Point], short: str) -> tuple[F64, F64]:
    return np.array([p.h for p in found]), np.array([p.errors[short] for p in found])


def figure(found: Sequence[Point], coarse: Sequence[Point]) -> Figure:
    """Errors at the impact against the step: not in the paper."""
    curves = [
        Curve(f"{short}, {law}{more}", *_errors(of(law, points), short), kind)
        for law in LAWS
        for short in KEYS
        for points, more, kind in ((found, "", LINE), (coarse, ", round steps", POINTS))
    ]
    return study.convergence(
        "order",
        "Convergence of the velocities just after the impact",
        curves,
        "Against the sequence of impacts solved at the exact instant. Lines: steps with the impact in "
        "their middle. Points: round steps, whose impact is late by anything between 0 and h.",
        xlabel="step h in s",
    )
