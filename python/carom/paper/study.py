"""What the examples share: counts beside the paper's, rows that must be zero, steps for an order of convergence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from carom import _core
from carom.convergence import Order
from carom.paper.document import Context, Counts, Row
from carom.paper.memory import Trace

#: tol_r of eq. 44 in all examples of the paper.
PAPER_TOLERANCE = 1e-5
#: Energy may rise by this share of its total in the paper's examples: reliability contract.
ENERGY_RISE = 1e-12

Printed = Mapping[str, tuple[float | None, float | None]]


def default_tolerance(context: Context) -> float:
    """tol_r beside the paper's: Carom's default, or the one that was asked for."""
    return context.tolerance if context.tolerance is not None else float(_core.defaults()["tolerance"])


def counts(case: str, run: Trace, tolerance: float, printed: Printed) -> Counts:
    """Iterations and line searches of a run beside those that the paper prints."""
    searched = run.monitors["line_search"]
    return Counts(
        case=case,
        smooth=run.iterations("smooth"),
        position=run.iterations("position"),
        velocity=run.iterations("velocity"),
        line_search=(int(searched["position"]), int(searched["velocity"])),
        paper=printed,
        unconverged=run.unconverged,
        fallbacks=int(run.monitors["fallbacks"]),
        tolerance=tolerance,
        step=run.h,
    )


def unconverged(example: str, tolerance: float, runs: Iterable[Trace]) -> Row:
    """No step of these runs may be left unsolved at a tolerance."""
    runs = list(runs)
    steps = sum(int(run.monitors["steps"]) for run in runs)
    return Row(
        example,
        f"unconverged steps, tolerance {tolerance:g}",
        "1",
        None,
        0.0,
        float(sum(run.unconverged for run in runs)),
        0.0,
        f"none of {steps} steps in {len(runs)} runs at the paper's h",
        "analytic",
    )


def energy_rise(example: str, quantity: str, runs: Iterable[Trace]) -> Row:
    """Greatest rise of the total energy in a step of these runs, over the energy at the start."""
    worst = max(float(run.monitors["energy"]["max_rise_relative"]) for run in runs)
    return Row(
        example, quantity, "1", None, 0.0, worst, ENERGY_RISE, "reliability contract: rounding", "analytic"
    )


def penetration(example: str, runs: Iterable[Trace]) -> Row:
    """Deepest overlap after a step, in radii; the paper: none."""
    worst = max(0.0, *(float(run.monitors["penetration_max_relative"]) for run in runs))
    return Row(
        example,
        "deepest penetration after a step",
        "radii",
        "none",
        0.0,
        worst,
        1e-10,
        "gap tolerance of the position level, 1e-10 r",
        "analytic",
    )


def first_order(example: str, quantity: str, order: Order, note: str = "") -> Row:
    """An observed order beside the paper's "linear"."""
    return Row(
        example,
        f"order of convergence, {quantity}",
        "1",
        "linear",
        1.0,
        order.value,
        0.05,
        "slope of a fit, first order",
        "analytic",
        note or f"between neighbouring steps {', '.join(f'{pair:.2f}' for pair in order.pairwise)}",
    )


def limit(steps: Sequence[float], values: Sequence[float]) -> float:
    """Value for h -> 0 by the two finest of steps that have the event at one place of the step: error O(h^2)."""
    (h1, v1), (h2, v2) = sorted(zip(steps, values, strict=True))[:2]
    return (h2 * v1 - h1 * v2) / (h2 - h1)


def grid_steps(unit: float, event: float, near: Iterable[float], place: float) -> list[float]:
    """Steps h = unit / M, near those of `near`, that put `event` at the fraction `place` of its step, coarse first.

    In a scheme that finds an event at the end of its step, the delay is then the same share of every h, and
    the error is a smooth function of h: the order can be read from it. Steps taken blindly delay the event by
    anything between 0 and h, and their errors scatter by as much.
    """
    found: set[float] = set()
    for h in near:
        # Coarse steps leave few candidates, so the search is wide; the smallest miss of the wanted place wins.
        candidates = np.arange(math.floor(unit / h / 1.33), math.ceil(unit / h * 1.33) + 1)
        candidates = candidates[candidates > 0]
        miss = np.abs((event / unit * candidates) % 1.0 - place)
        found.add(unit / int(candidates[np.argmin(miss)]))
    return sorted(found, reverse=True)
