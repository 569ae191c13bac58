"""What the examples share: counts beside the paper's, rows that must be zero, steps for an order of convergence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from string import Template
from typing import Any, Literal

import numpy as np

from carom import _core
from carom.many.order import Order
from carom.reproduce.document import Context, Counts, Curve, Figure, Kind, Row
from carom.reproduce.memory import Trace, trace
from carom.scene.scene import Scene

#: tol_r of eq. 44 in all examples of the paper.
PAPER_TOLERANCE = 1e-5
#: Options that come closest to the paper's iterations: its law and tolerance; eq. 44 alone ends them (gaps need not be met
#: to 1e-10 r); Newton's matrix is that of the residual (the diagonal of the multipliers is hardly shifted).
AS_PRINTED: Mapping[str, Any] = {
    "tolerance": PAPER_TOLERANCE,
    "solver": "newton",
    "impact": "sequence-paper",
    "gap_tolerance": 1e-6,
    "proximal_shift": 1e-8,
}
#: Energy may rise by this share of its total in the paper's examples: reliability contract.
ENERGY_RISE = 1e-12

Level = Literal["position", "velocity"]
Printed = Mapping[str, tuple[float | None, float | None]]


def default_tolerance(context: Context) -> float:
    """tol_r beside the paper's: Carom's default, or the one that was asked for."""
    return context.tolerance if context.tolerance is not None else float(_core.defaults()["tolerance"])


def distinct(default: float) -> list[float]:
    """The paper's tolerance and the default one, once if they are the same."""
    return list(dict.fromkeys((PAPER_TOLERANCE, default)))


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


def counted(scene: Scene, **run: Any) -> Trace:
    """A whole run of which only counts are wanted: it keeps the last state alone."""
    until = scene.run.until
    assert until is not None
    return trace(scene, at=[until], **run)


def row(
    quantity: str,
    unit: str,
    carom: float,
    within: float,
    why: str,
    *,
    exact: float | None = None,
    paper: float | str | None = None,
    against: Literal["paper", "analytic"] | None = None,
    note: str = "",
    erratum: str = "",
) -> Row:
    """A row held against the exact value where there is one, otherwise against the paper's."""
    against = against or ("paper" if exact is None else "analytic")
    return Row(quantity, unit, paper, exact, float(carom), within, why, against, note, bool(erratum), erratum)


def iterations(
    runs: Mapping[str, Scene],
    tolerances: Iterable[float],
    printed: Mapping[str, Printed],
    as_printed: Iterable[str],
) -> tuple[Counts, ...]:
    """Counts of scenes by name: `newton` iterates on all contacts, as the paper does, `auto` solves single ones in closed
    form; then those `as_printed`.
    """
    found = [
        counts(f"{name}, {how}", counted(scene, tolerance=tol, solver=how), tol, printed[name])
        for name, scene in runs.items()
        for how in ("newton", "auto")
        for tol in tolerances
    ]
    for name in as_printed:
        run = counted(runs[name], **AS_PRINTED)
        found.append(counts(f"{name}, as printed", run, PAPER_TOLERANCE, printed[name]))
    return tuple(found)


def errors(
    label: str, points: Iterable[Any], of: str, kind: Kind = "points", body: int | None = None
) -> Curve:
    """An error of the points of a study, the attribute `of`, over their step `h`."""
    points = list(points)
    return Curve(
        label, np.array([p.h for p in points]), np.array([getattr(p, of) for p in points]), kind, body
    )


def convergence(
    number: str,
    title: str,
    curves: Iterable[Curve],
    caption: str,
    *,
    slopes: tuple[float, ...] = (1.0,),
    xlabel: str = "h in s",
    ylabel: str = "error (eq. 45)",
) -> Figure:
    """Errors over the step, both logarithmic, with reference slopes."""
    logarithmic: dict[str, Any] = {"xscale": "log", "yscale": "log", "slopes": slopes}
    return Figure(number, title, xlabel, ylabel, tuple(curves), caption, **logarithmic)


def paragraphs(text: str, **values: object) -> tuple[str, ...]:
    """Paragraphs of Markdown from a text with blank lines between them; `$name` stands for a value."""
    filled = Template(text).substitute({name: str(value) for name, value in values.items()})
    blocks = (block.strip("\n") for block in filled.split("\n\n"))
    return tuple(
        block if block.startswith("|") else " ".join(block.split()) for block in blocks if block.strip()
    )


def unconverged(tolerance: float, runs: Iterable[Trace]) -> Row:
    """No step of these runs may be left unsolved at a tolerance."""
    runs = list(runs)
    steps = sum(int(run.monitors["steps"]) for run in runs)
    left = sum(run.unconverged for run in runs)
    where = "one run" if len(runs) == 1 else f"{len(runs)} runs"
    why = f"none of {steps} steps in {where} at the paper's h"
    return row(f"unconverged steps, tolerance {tolerance:g}", "1", left, 0.0, why, exact=0.0)


def energy_rise(quantity: str, runs: Iterable[Trace]) -> Row:
    """Greatest rise of the total energy in a step of these runs, over the energy at the start."""
    worst = max(float(run.monitors["energy"]["max_rise_relative"]) for run in runs)
    return row(quantity, "1", worst, ENERGY_RISE, "reliability contract: rounding", exact=0.0)


def penetration(runs: Iterable[Trace]) -> Row:
    """Deepest overlap after a step, in radii; the paper: none."""
    worst = max(0.0, *(float(run.monitors["penetration_max_relative"]) for run in runs))
    why = "gap tolerance of the position level, 1e-10 r"
    return row("deepest penetration after a step", "radii", worst, 1e-10, why, exact=0.0, paper="none")


def first_order(quantity: str, order: Order, within: float = 0.05) -> Row:
    """An observed order beside the paper's "linear"; the note has the slopes between neighbouring steps."""
    name, why = f"order of convergence, {quantity}", "slope of a fit to a first-order error"
    note = f"between neighbouring steps {', '.join(f'{pair:.2f}' for pair in order.pairwise)}"
    return row(name, "1", order.value, within, why, exact=1.0, paper="linear", note=note)


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
