"""`carom.compare`: one scene by several methods in time, and how far apart they end.

A method is written as the scenario writes it, with further choices after plus signs: `moreau+projection`,
`nsga+one-shot`. All run on the same grid of steps, one after the other, so that their times can be compared.

(The module is not called `compare`: importing it would hide the function of that name in the package.)
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

import carom
from carom import _core
from carom.arrays import F64
from carom.errors import CaromError, CaromWarning, Problem, ScenarioError, did_you_mean
from carom.files import inside
from carom.many.absent import absent_at, there_only, told
from carom.many.impulses import growing, half
from carom.many.quantity import USUAL
from carom.many.sheets import of_comparison, titled
from carom.run.launch import OnProgress
from carom.run.loop import begin
from carom.run.result import Result
from carom.run.simulate import RunFailed, scene_of
from carom.run.summary import plain
from carom.scene.arguments import renamed
from carom.scene.plan import Plan
from carom.scene.scene import Scene
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.keywords import Options
from carom.scene.tables.options import OPTIONS
from carom.show.plot import require_matplotlib
from carom.show.plot.comparison import beside
from carom.units import numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Numbers of a run's summary that stand side by side, as far as the method has them.
NUMBERS = (
    *("wall_s", "core_s", "steps", "substeps", "halvings", "penetration_max", "penetration_max_relative"),
    *("energy", "iterations", "impact_problems", "unconverged", "fallbacks", "missed_impacts"),
)
#: Frames of a run that is compared, besides those that are asked for, at most.
FRAMES = 200
#: Radii (radii per step) below which a position (velocity) is no size to compare with.
SMALL = 1e-8
#: Share of the greatest speed of a run that is rounding, or what solvers leave: no component of this size is shown.
STILL = 1e-6
_PROJECTION = "projection"


@dataclass(frozen=True)
class Difference:
    """How far a method is from the first one in one quantity at one time.

    `greatest` is the largest difference of a vector, in the unit of the quantity, and `body` the one that has
    it; `relative` is the measure of eq. 45 over all bodies, relative to the largest size that the sum below the
    line has in any frame of the first run: at rest it would vanish. A size below `SMALL` radii (velocities: radii
    per step) per body is taken as that.
    """

    time: float
    quantity: str
    greatest: float
    body: str
    relative: float


@dataclass(frozen=True)
class MethodRun:
    """One method: its options beyond the scene's, its numbers, and its differences from the first method.

    `states` has an array (K, N, 3) for each quantity, NaN for balls that are not there and times that were not reached.
    `numbers` are those
    of `carom run --json` that compare, and `impacts`, the rows of its table of impacts.
    """

    name: str
    options: Mapping[str, Any]
    outcome: str
    ok: bool
    numbers: Mapping[str, Any]
    states: Mapping[str, F64]
    differences: tuple[Difference, ...]
    directory: Path | None
    impulses: Mapping[str, F64] = field(default_factory=dict)
    """Of impact laws: the first pairs that impacts move, in their order, as `carom.many.impulses.growing` has them."""
    ends: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """The two names of each of these pairs."""

    @property
    def order(self) -> tuple[str, ...]:
        """The first pairs that impacts move, in the order in which they have half of their impulse."""
        return tuple(self.impulses)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; without the states."""
        return {
            "method": self.name,
            "options": dict(self.options),
            "outcome": self.outcome,
            **plain(self.numbers),
            "impulses": {
                pair: {"half_at": half(points), "impulse": points[-1, 1]}
                for pair, points in self.impulses.items()
            },
            "differences": [vars(d) for d in self.differences],
            "directory": None if self.directory is None else str(self.directory),
        }


@dataclass(frozen=True)
class Comparison:
    """The runs of `carom.compare`, in the order of the methods; `comparison["moreau"]` is one of them.

    `times` (K,), s, are the instants that are compared, the last one the end; `bodies` the names of the N spheres.
    """

    title: str
    step: float
    times: tuple[float, ...]
    bodies: tuple[str, ...]
    runs: tuple[MethodRun, ...]
    case: str | None = None
    laws: bool = False
    """Whether impact laws are compared, each as a method of its own."""
    remarks: tuple[str, ...] = ()
    """What a reader must know of it: which method was left out, and why."""
    still: float = 0.0
    """Slower than this, m/s, is at rest: what solvers and rounding leave of the speeds of the first run."""

    def __getitem__(self, method: str) -> MethodRun:
        for run in self.runs:
            if run.name == method:
                return run
        raise CaromError(f"{method!r} was not compared; {did_you_mean(method, [r.name for r in self.runs])}")

    def __iter__(self) -> Iterator[MethodRun]:
        return iter(self.runs)

    def __len__(self) -> int:
        return len(self.runs)

    def __str__(self) -> str:
        return str(of_comparison(self))

    def __repr__(self) -> str:
        names = ", ".join(run.name for run in self.runs)
        return f"<Comparison {titled(self.title, self.case)!r}: {names} at t = {', '.join(f'{t:g}' for t in self.times)} s>"

    @property
    def ok(self) -> bool:
        """Whether every run reached its end."""
        return all(run.ok for run in self.runs)

    @property
    def directions(self) -> list[int]:
        """The axes, 0 to 2, along which some body moves at the end; x where all rest."""
        last = np.nan_to_num([np.abs(run.states["velocity"][-1]) for run in self]).max(axis=(0, 1))
        return [k for k in range(3) if last[k] > self.still] or [0]

    def plot(self) -> Figure:
        """Velocity of each body at the end by each method, and how impulses grow by impact laws, a figure of matplotlib."""
        require_matplotlib()
        return beside(self).figure

    def to_dict(self) -> dict[str, Any]:
        """Plain values: the document of `carom compare --json`."""
        return {
            "title": self.title,
            "case": self.case,
            "step": self.step,
            "times": list(self.times),
            "reference": self.runs[0].name,
            "methods": [run.to_dict() for run in self.runs],
            "remarks": list(self.remarks),
        }


def default_methods() -> list[str]:
    """Every method with a step, the default one first, and Moreau-Jean with projection too."""
    return [
        name
        for m in _core.choices()["method"]
        if m != "events"  # which refuses much, and is asked for
        for name in ([m, f"{m}+{_PROJECTION}"] if m == "moreau" else [m])
    ]


def _tried(
    scene: Scene, chosen: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, CaromError], dict[str, list[str]]]:
    """Of the methods that cannot take the scene, what they say: contact forces know no joints, for one; and each warning
    about it with the methods that it holds for. An option is for those of the methods that read it.
    """
    refused: dict[str, CaromError] = {}
    advice: dict[tuple[object, ...], list[tuple[str, Problem, list[str]]]] = {}
    usual, methods = _core.defaults(), {extra["method"] for extra in chosen.values()}
    for name, extra in chosen.items():
        keys = {
            key: usual[key]
            for key, option in OPTIONS.items()
            if extra["method"] not in option.methods and methods & {*option.methods}
        } | dict(extra)
        try:
            varied = scene.overridden(keys, dict.fromkeys(keys, "compare"))
            told = varied.validate()
            begin(varied.to_model())
        except CaromError as error:
            refused[name] = error
        else:
            words = "|".join(re.escape(value) for value in extra.values() if isinstance(value, str))
            for one in told:
                parts = re.split(rf"\b({words})\b", one.cause)
                key = (one.where, one.line, one.key, *parts[::2])  # what is said of each with its name is one
                advice.setdefault(key, []).append((name, one, parts))
    return refused, {_joined(found): [name for name, _, _ in found] for found in advice.values()}


def _joined(found: list[tuple[str, Problem, list[str]]]) -> str:
    """A warning in parts that are the same for all methods, or a name that each has there."""
    parts = zip(*(parts for _, _, parts in found), strict=True)
    return str(replace(found[0][1], cause="".join(" or ".join(dict.fromkeys(part)) for part in parts)))


def _able(
    scene: Scene, chosen: dict[str, dict[str, Any]], named: bool
) -> tuple[dict[str, dict[str, Any]], tuple[str, ...], list[str]]:
    """The methods that can take the scene, what is to be said of others, and warnings: of some only, with their names. Those
    that were `named` must all take it.
    """
    refused, advice = _tried(scene, chosen)
    able = {name: extra for name, extra in chosen.items() if name not in refused}
    first = next(iter(refused.values()), None)
    if first and (len(refused) == 1 if named else not able):
        raise first
    causes = {name: _cause(error) for name, error in refused.items()}
    if refused and named:
        why = "; ".join(f"{name}: {cause}" for name, cause in causes.items())
        cure = (
            f"compare {', '.join(able)}, which can take the scene" if able else str(first).partition("; ")[2]
        )
        raise CaromError(f"{why}; {cure}")
    if causes and len(able) == 1:
        why = "; ".join(f"{name}: {cause}" for name, cause in causes.items())
        of_laws = any("impact" in extra for extra in chosen.values())
        cure = "simulate it by that" if of_laws else 'compare its impact laws, with laws="all" or --laws all'
        raise CaromError(f"nothing is left to compare {next(iter(able))} with: {why}; {cure}")
    remarks = tuple(f"{name} is left out: {cause}" for name, cause in causes.items())
    told = [a if len(of) == len(able) else f"{', '.join(of)}: {a}" for a, of in advice.items()]
    return able, remarks, told


def _cause(error: CaromError) -> str:
    """Why a method cannot take a scene, without the place, which is the method itself, and without a cure."""
    if isinstance(error, ScenarioError) and (first := error.problems[0]).where == "compare":
        return first.cause
    return str(error).partition("; ")[0].removeprefix("option ")


def method_options(name: str) -> dict[str, Any]:
    """The keys of `[run]` that a name such as `moreau+projection` stands for."""
    choices = _core.choices()
    method, *modifiers = name.split("+")
    if method not in choices["method"]:
        raise CaromError(f"no method is called {method!r}; {did_you_mean(method, choices['method'])}")
    options: dict[str, Any] = {"method": method}
    values = {value: key for key, admitted in choices.items() if key != "method" for value in admitted}
    for modifier in modifiers:
        if modifier == _PROJECTION and method == "moreau":
            options["position_projection"] = True
        elif modifier in values:
            options[values[modifier]] = modifier
        else:
            known = [_PROJECTION, *values] if method == "moreau" else list(values)
            raise CaromError(
                f"{name}: {modifier!r} is no choice of {method}; {did_you_mean(modifier, known)}"
            )
    return options


@renamed
def compare(
    scene: Scene | str | Path,
    methods: str | Sequence[str] | None = None,
    *,
    laws: str | Sequence[str] | None = None,
    at: float | str | Sequence[float | str] = (),
    out: str | Path | None = None,
    force: bool = False,
    progress: OnProgress | None = None,
    case: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    **options: Unpack[Options],
) -> Comparison:
    """Simulate a scene, or a scenario file, by several methods and hold each against the first.

    With `laws` impact laws are compared by the scene's own method: "all" that can take the scene, or names such as
    `("sequence", "poisson")`. `methods` are names as `("nsga", "moreau", "moreau+projection")`, by default all but "events"
    that can take the scene. `at` are times on the grid of the steps (s, or texts with a unit) that are compared besides the
    end. `case` and `parameters` choose a variant of a file, as in `Scene.from_toml`; `options` are keys of `[run]` and
    `[record]` for all runs. With `out` every method leaves its run directory there; without, nothing is kept. A run that
    stops before its end is no error here: its `outcome` says so.
    """
    scene = scene_of(scene, "compare", case=case, parameters=parameters)
    at = numbers("compare", "at", at, "time")
    if laws is not None:
        if methods is not None:
            raise CaromError("give methods or laws, not both; a method with a law is named as nsga+poisson")
        found = list(LAWS) if laws == "all" else [laws] if isinstance(laws, str) else list(laws)
        for law in found:
            if law not in LAWS:
                raise CaromError(f"no impact law is called {law!r}; {did_you_mean(law, list(LAWS))}")
        methods = [f"{scene.run.method}+{law}" for law in found]
    named, given = laws != "all" and methods is not None, default_methods() if methods is None else methods
    names = [given] if isinstance(given, str) else list(given)
    if not names:
        raise CaromError("name at least one method to compare")
    if len(dict.fromkeys(names)) < len(names):
        raise CaromError(f"a method is named twice among {', '.join(names)}")
    chosen = {name: method_options(name) for name in names}
    if clash := sorted({"every", *(k for o in chosen.values() for k in o)} & options.keys()):
        cure = "name it with the method, as nsga+one-shot" if clash != ["every"] else "give the times with at"
        raise CaromError(f"{clash[0]} is set by the comparison; {cure}")
    scene = scene.overridden(options, dict.fromkeys(options, "compare")) if options else scene
    if scene.run.until is None:
        raise CaromError("the scenario does not say how long to simulate; give until")
    h = scene.run.step
    plan = Plan.of(scene.run.until, h, 1, False)
    wanted = sorted({*(_grid(t, h, plan.steps) for t in at), plan.steps})
    every = _spacing(math.gcd(*wanted), plan.steps)
    chosen, remarks, advice = _able(scene, chosen, named)
    for one in advice:
        warnings.warn(one, CaromWarning, stacklevel=3)
    if methods is None:
        pair = "events,nsga" if scene.run.method == "events" else f"{scene.run.method},events"
        remarks += (f"events is left out: it takes fewer scenes and is named, as {pair}",)
    floors = _floors(scene)
    sizes: Mapping[str, float] = {}
    still = 0.0
    frames, absent = [n // every for n in wanted], np.zeros((len(wanted), len(scene.names)), dtype=bool)
    runs: list[MethodRun] = []
    for name, extra in chosen.items():
        directory = None if out is None else inside(Path(out), name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)  # told above, once for all methods
            try:
                result = carom.simulate(
                    scene, out=directory, force=force, progress=progress, every=every, **extra
                )
            except RunFailed as error:
                result = error.result
        sizes = sizes or {q: max(floor, _largest(getattr(result, q))) for q, floor in floors.items()}
        still = still or STILL * float(np.nanmax(np.abs(result.velocity), initial=0.0))
        run = _measured(name, extra, result, frames, runs, sizes, directory)
        if laws is not None:
            grown = {"-".join(pair): (pair, points) for pair, points in growing(scene, extra, result).items()}
            ends = {name: pair for name, (pair, _) in grown.items()}
            run = replace(run, impulses={name: points for name, (_, points) in grown.items()}, ends=ends)
        absent |= absent_at(frames, result)
        runs.append(run)
        result.close()
    times, bodies = tuple(n * h for n in wanted), tuple(scene.names)
    remarks += told(times, bodies, absent) if len(runs) > 1 else ()
    return Comparison(
        scene.title, h, times, bodies, tuple(runs), scene.case, laws is not None, remarks, still
    )


def _spacing(most: int, steps: int) -> int:
    """Steps between frames: a divisor of `most`, if one gives at most `FRAMES` of them."""
    return next((n for n in range(1, most) if most % n == 0 and steps // n <= FRAMES), most)


def _largest(column: Any) -> float:
    """The largest sum below the line of eq. 45 of any frame, of a column (T, N, 3)."""
    return float(np.max(np.nansum(np.abs(np.asarray(column)), axis=(1, 2))))


def _floors(scene: Scene) -> dict[str, float]:
    """Sums of all bodies below which a quantity is at rest: `SMALL` radii, or radii per step."""
    radius = np.asarray(scene.to_model()["radius"], dtype=np.float64)
    length, h = SMALL * float(radius.sum()), scene.run.step
    return {"position": length, "velocity": length / h, "angular_velocity": SMALL * len(radius) / h}


def _grid(t: float, h: float, steps: int) -> int:
    n = round(t / h)
    if abs(n * h - t) > 1e-9 * max(t, h) or not 0 <= n <= steps:
        raise CaromError(
            f"at: {t:g} s is not among the steps of {h:g} s up to {steps * h:g} s; give a multiple of the step"
        )
    return n


def _measured(
    name: str,
    options: Mapping[str, Any],
    result: Result,
    frames: Sequence[int],
    before: Sequence[MethodRun],
    sizes: Mapping[str, float],
    directory: Path | None,
) -> MethodRun:
    reached, there = len(result.time), result.present
    nowhere = np.full((len(result.names), 3), np.nan)
    states: dict[str, F64] = {}
    for quantity in USUAL:
        column = getattr(result, quantity)
        rows = [there_only(column[k], there[k]) if k < reached else nowhere for k in frames]
        states[quantity] = np.asarray(rows)
    times = [float(result.time[k]) if k < reached else math.nan for k in frames]
    numbers = {key: result.summary[key] for key in NUMBERS if key in result.summary}
    numbers["impacts"] = len(result.impacts)
    reference = before[0].states if before else states
    differences = tuple(_differences(times, result.names, states, reference, sizes))
    outcome = str(result.outcome)
    return MethodRun(
        name,
        options,
        outcome,
        result.outcome.ok,
        numbers,
        states,
        differences if before else (),
        directory,
    )


def _differences(
    times: Sequence[float],
    bodies: Sequence[str],
    states: Mapping[str, F64],
    reference: Mapping[str, F64],
    sizes: Mapping[str, float],
) -> Iterator[Difference]:
    for k, time in enumerate(times):
        for quantity in USUAL:
            found, first = states[quantity][k], reference[quantity][k]
            off = np.linalg.norm(found - first, axis=1)
            if np.isnan(off).all():
                continue  # one of the runs stopped before, or no ball is there in both
            worst = int(np.nanargmax(off))
            relative = float(np.nansum(np.abs(found - first))) / sizes[quantity]
            yield Difference(time, quantity, float(off[worst]), bodies[worst], relative)
