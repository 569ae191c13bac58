"""`carom.converge`: how the error of a scene depends on the step h, and the order that this shows.

Runs are made in memory, several at once in threads (the core releases the interpreter), and reported in the order
of their steps: the result does not depend on the number of threads.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from carom.arrays import F64, I64
from carom.errors import CaromError
from carom.many.batch import usable_processors
from carom.many.order import FINER, ROUNDING, Order, clear_order, doubts, error_of
from carom.many.quantity import QUANTITIES, USUAL, Quantity
from carom.many.reference_solution import Formulas, Frames, Function, Truth
from carom.many.sheets import of_convergence, titled
from carom.numeric import is_number
from carom.run import summary
from carom.run.loop import begin, drive
from carom.run.result import Result, load
from carom.run.simulate import scene_of
from carom.run.sinks import Instants
from carom.scene.arguments import renamed
from carom.scene.plan import Plan
from carom.show.plot import require_matplotlib
from carom.show.plot.convergence import convergence
from carom.units import is_quantity, number, numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from carom.run.result import Result
    from carom.scene.scene import Scene


#: Instants of one run that enter eq. 45, and numbers of their states, at most.
MOST_INSTANTS, MOST_NUMBERS = 10_000, 20_000_000
#: The method whose motion is exact, and parts of the finest step that are tried for its rows.
EXACT: Literal["events"] = "events"
MOST_PARTS = 100
LEFT_OUT = "errors leave out balls at times at which they are not there in both runs"


@dataclass(frozen=True)
class StepRun:
    """One run of a study: its step (s), how it ended, and what it cost."""

    h: float
    steps: int
    outcome: str
    unconverged: int
    penetration_max: float
    core_s: float

    @property
    def ok(self) -> bool:
        """Whether it reached its end with every sub-problem solved to its tolerance."""
        return self.outcome == "done" and self.unconverged == 0


@dataclass(frozen=True)
class Convergence:
    """Errors of each quantity at each step, coarse to fine, and the orders they show.

    `errors["velocity"]` has one number for each of `steps` (s), by eq. 45 over the instants of that run up to
    `until` (s), or over the instants `at` alone; NaN where a run stopped. `orders["velocity"]` is None where fewer
    than two errors stand clear of rounding. `runs` are those of `steps`, then that of the reference if it was one.
    """

    title: str
    steps: tuple[float, ...]
    reference: str
    until: float
    at: tuple[float, ...]
    errors: Mapping[str, tuple[float, ...]]
    orders: Mapping[str, Order | None]
    runs: tuple[StepRun, ...]
    case: str | None = None
    remarks: tuple[str, ...] = ()
    """Why an order should not be believed, or the reference."""
    rounding: ClassVar[float] = ROUNDING
    """Errors up to this are rounding: they show no order."""

    def __str__(self) -> str:
        return str(of_convergence(self))

    def __repr__(self) -> str:
        orders = ", ".join(f"{n} {'-' if o is None else f'{o.value:.3f}'}" for n, o in self.orders.items())
        return f"<Convergence {titled(self.title, self.case)!r}, {len(self.steps)} steps: order of {orders}>"

    @property
    def ok(self) -> bool:
        """Whether every run reached its end with every sub-problem solved."""
        return all(run.ok for run in self.runs)

    @property
    def where(self) -> str:
        """The times of the errors, in words."""
        if self.at:
            return f"at t = {', '.join(f'{t:g}' for t in self.at)} s"
        return f"over 0 to {self.until:g} s"

    def to_dict(self) -> dict[str, Any]:
        """Plain values: the document of `carom converge --json`."""
        quantities = {}
        for name, errors in self.errors.items():
            order = self.orders[name]
            quantities[name] = {"errors": list(errors), "order": order and summary.plain(vars(order))}
        return {
            "title": self.title,
            "case": self.case,
            "steps": list(self.steps),
            "reference": self.reference,
            "until": self.until,
            "at": list(self.at),
            "quantities": quantities,
            "runs": [vars(run) for run in self.runs],
            "remarks": list(self.remarks),
        }

    def plot(self) -> Figure:
        """Errors over steps with their fits, a figure of matplotlib."""
        require_matplotlib()
        return convergence(self).figure


@renamed
def converge(
    scene: Scene | str | Path,
    steps: Sequence[float | str],
    reference: float | str | Path | Result | Function,
    quantities: Sequence[str] | None = None,
    *,
    until: float | str | None = None,
    at: float | str | Sequence[float | str] = (),
    threads: int | None = None,
    case: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    **options: Any,
) -> Convergence:
    """Simulate a scene, or a scenario file, with several steps and fit the order of the error in h.

    Steps and times are numbers in s, or texts with a unit, `"0.5 ms"`.

    `reference` is a step finer than all others, which it must divide; or a run (`Result` or directory) whose frames
    hold all instants; or "events", the exact method; or a TOML file with formulas of t; or a function of the time (s)
    that returns values such as `{"velocity:cue": (vx, vy, vz)}`. `quantities` are `position`, `velocity`,
    `angular_velocity` or `orientation` of all spheres, or of one (`velocity:cue`), or one component
    (`velocity:cue:x`); by default the first three, or what the formulas give.
    Errors are those of eq. 45 over the instants of each run up to `until` (s), or at the
    times `at` (s) alone, of which the last ends the runs. `case` and `parameters` choose a variant of a file, as in
    `Scene.from_toml`; `options` are keys of `[run]`, for all runs. What makes an order doubtful is in `remarks`.
    """
    scene = scene_of(scene, "converge", case=case, parameters=parameters)
    at = numbers("converge", "at", at, "time")
    scene = scene.overridden(options, dict.fromkeys(options, "converge"))
    chosen = sorted({_positive(h) for h in numbers("converge", "steps", steps, "time")}, reverse=True)
    if len(chosen) < 2:
        raise CaromError("give at least two different steps: an order is a slope")
    end = _end(scene, until, at, chosen[0])
    # The step of the scene is none of the study, and says nothing of its end.
    scene = scene.overridden({"until": end, "step": chosen[-1]}, dict.fromkeys(("until", "step"), "converge"))
    scene.validate()
    if at and not all(0 <= t <= end for t in at):
        raise CaromError(f"at: give times from 0 to the end of the runs, {end:g} s")
    names = scene.names
    instants = {h: _instants(h, end, at, len(names)) for h in chosen}
    jobs = list(instants.items())
    truth: Truth | None = None
    if isinstance(reference, str) and is_quantity(reference) and not Path(reference).exists():
        reference = number("converge", "reference", reference, "time")
    if is_number(reference):
        jobs.append((h := _positive(reference), _shared(h, instants)))
    else:
        truth = _exact(scene, instants) if reference == EXACT else _truth(reference, scene)
    wanted = [
        Quantity.of(text, names, _others(scene))
        for text in quantities or (truth and truth.offered()) or USUAL
    ]
    for quantity in wanted:
        if truth:  # before anything runs
            truth.values(quantity, np.array([0.0 if not at else min(at)]))
    found = _run_all(scene, jobs, threads)
    if truth is None:
        h = float(reference)  # type: ignore[arg-type]
        truth = Frames(f"h = {h:g} s", names, _times(h, jobs[-1][1]), found[-1][0], h)
    errors, left_out = {}, False
    for quantity in wanted:
        row = []
        for (h, own), (states, run) in zip(instants.items(), found, strict=False):
            true = truth.values(quantity, _times(h, own))
            mine = quantity.aligned(quantity.of_states(states, names), true)
            both = np.isfinite(mine - true).all(axis=-1)
            # Of runs that stopped what is missing stays so.
            if run.outcome == "done" == found[-1][1].outcome and both.any():
                left_out, mine, true = left_out or not both.all(), mine[both], true[both]
            row.append(error_of(mine, true))
        errors[quantity.text] = tuple(row)
    return Convergence(
        title=scene.title,
        steps=tuple(chosen),
        reference=truth.told,
        until=end,
        at=tuple(sorted(at)),
        errors=errors,
        orders={name: clear_order(chosen, row) for name, row in errors.items()},
        runs=tuple(run for _, run in found),
        case=scene.case,
        remarks=(
            *_coarse(truth, chosen[-1]),
            *[LEFT_OUT] * left_out,
            *(told for name, row in errors.items() for told in doubts(name, chosen, row)),
        ),
    )


def _coarse(truth: Truth, finest: float) -> list[str]:
    """What is to be said of a reference whose own error is not small beside those that it measures."""
    if truth.step is None or truth.step * FINER <= finest * (1 + 1e-9):
        return []
    return [
        f"the step of the reference, {truth.step:g} s, is not {FINER} times finer than {finest:g} s: its own error"
        " enters those of the finest steps"
    ]


def _times(h: float, numbers: I64) -> F64:
    return np.asarray(h * numbers, dtype=np.float64)


def _others(scene: Scene) -> dict[str, str]:
    """Clumps and walls, and what is said of who takes them for spheres."""
    said = {
        clump.name: f"it is a clump of the balls {', '.join(clump.ball_names())}" for clump in scene.clumps
    }
    for wall in scene._walls():
        kind = "free wall" if wall.free is not None else "wall"
        said[wall.name] = f"it is a {kind}, and errors are those of spheres"
    return said


def _end(scene: Scene, until: float | str | None, at: Sequence[float], longest: float) -> float:
    """The end of the runs, s: `until`, or the last of the times `at`, or that of the scene."""
    if until is not None:
        return number("converge", "until", until, "time")
    if not at:
        if scene.run.until is None:
            raise CaromError("the scenario does not say how long to simulate; give until")
        return scene.run.until
    end = max(at)
    if end < longest * (1 - 1e-9):
        raise CaromError(
            f"at: the runs would end at {end:g} s, before the first step of {longest:g} s; give a later time"
        )
    return end


def _positive(h: Any) -> float:
    if not 0 < h < math.inf:
        raise CaromError(f"a step of {h:g} s; steps must be above 0")
    return float(h)


def _instants(h: float, end: float, at: Sequence[float], spheres: int) -> I64:
    """Numbers of the steps that enter eq. 45."""
    if at:
        numbers = np.unique(np.rint(np.asarray(at) / h).astype(np.int64))
        off = [t for t in at if abs(round(t / h) * h - t) > 1e-9 * max(t, h)]
        if off:
            raise CaromError(
                f"h = {h:g} s does not reach t = {off[0]:g} s in whole steps; give steps that do"
            )
        return numbers
    last = math.floor(end / h * (1 + 1e-12) + 1e-9)
    if last < 1:
        raise CaromError(f"h = {h:g} s is longer than the whole simulation of {end:g} s")
    each = sum(len(letters) for letters, _ in QUANTITIES.values()) * spheres
    stride = -(-(last + 1) // max(1, min(MOST_INSTANTS, MOST_NUMBERS // each)))
    return np.arange(0, last + 1, stride, dtype=np.int64)


def _exact(scene: Scene, instants: Mapping[float, I64]) -> Frames:
    """What method `events` has at all instants: rows of the longest step that divides all others."""
    if scene.run.method == EXACT:
        raise CaromError('the runs of the study are exact themselves; give them a step with method = "nsga"')
    finest = min(instants)
    shared = (finest / k for k in range(1, MOST_PARTS + 1))
    h = next((h for h in shared if all(abs(round(c / h) * h - c) <= 1e-9 * c for c in instants)), None)
    if h is None:
        raise CaromError("the steps have no common part; take them from one row, as 1e-2,5e-3,2e-3")
    numbers = np.unique(np.concatenate([own * round(coarse / h) for coarse, own in instants.items()]))
    [(states, run)] = _run_all(scene.overridden({"method": EXACT}, {"method": "converge"}), [(h, numbers)], 1)
    if not run.ok:
        raise CaromError(f"method events is no reference here, it stops: {run.outcome.replace('_', ' ')}")
    return Frames("method events", scene.names, _times(h, numbers), states, None)


def _shared(h: float, instants: Mapping[float, I64]) -> I64:
    """Steps of size `h` at which some run of the study has an instant."""
    if h > (finest := min(instants)) * (1 - 1e-9):
        raise CaromError(
            f"the reference step {h:g} s must be finer than all steps, the finest of which is {finest:g} s"
        )
    numbers = []
    for coarse, own in instants.items():
        ratio = round(coarse / h)
        if abs(ratio * h - coarse) > 1e-9 * coarse:
            raise CaromError(
                f"the reference step {h:g} s must divide every step, and {coarse:g} s is not a multiple of it;"
                " take steps and reference from one row, as 1e-2,5e-3,2e-3 and 1e-4"
            )
        numbers.append(own * ratio)
    return np.unique(np.concatenate(numbers))


def _truth(reference: object, scene: Scene) -> Truth:
    if isinstance(reference, (str, Path)):
        path = Path(reference)
        if not path.is_dir() and path.suffix == ".toml":
            return Formulas.read(path, scene.names)
        reference = load(path)
    if isinstance(reference, Result):
        return Frames.of(reference, scene)
    if callable(reference):
        return Formulas("function", reference, scene.names)
    raise CaromError(
        'reference must be a step, "events", a run, a TOML file with formulas, or a function of the time'
    )


def _run_all(
    scene: Scene, jobs: Sequence[tuple[float, I64]], threads: int | None
) -> list[tuple[dict[str, F64], StepRun]]:
    """All runs, in the order of the jobs. Those with most steps begin first, so that none is left alone at the end."""
    models = {h: scene.overridden({"step": h}, {"step": "converge"}).to_model() for h, _ in jobs}
    stop = threading.Event()
    with ThreadPoolExecutor(threads or usable_processors()) as pool:
        begun = {
            h: pool.submit(_run, models[h], h, numbers, stop)
            for h, numbers in sorted(jobs, key=lambda job: job[1][-1], reverse=True)
        }
        try:
            return [begun[h].result() for h, _ in jobs]
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise


def _run(
    model: Mapping[str, Any], h: float, numbers: I64, stop: threading.Event
) -> tuple[dict[str, F64], StepRun]:
    """States after the steps `numbers`, each (T, N, components); NaN for those that were not reached."""
    simulation, kept = begin(model), Instants(numbers)
    ending = drive(simulation, Plan(int(numbers[-1]), kept.every, h, False), [kept], stop.is_set)
    totals = simulation.monitors()
    run = StepRun(
        h,
        simulation.step,
        ending.kind,
        int(totals["unconverged"]),
        float(totals["penetration_max"]),
        ending.core_s,
    )
    return {key: kept.frames[key] for key in QUANTITIES}, run
