"""Runs kept in memory: nothing is written to disk, so a million steps of two balls take seconds.

`trace` is what `carom.simulate` is without a run directory: a scene, keys of `[run]`, and the states and reports of
the core as arrays.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from carom import _core
from carom.errors import CaromError
from carom.paper.document import NotConverged

if TYPE_CHECKING:
    from carom.paper.document import Iterations
    from carom.scene import Scene

F64 = NDArray[np.float64]
Table = dict[str, NDArray[Any]]
#: Steps in one call of the core: its reports of every step are dropped or joined before they fill memory.
BLOCK = 10_000
LEVELS = {"position": 1, "velocity": 2}
STATE = ("time", "position", "orientation", "velocity", "angular_velocity")


@dataclass(frozen=True)
class Trace:
    """A run: states at T instants of N spheres, the first at t = 0, and what the core reports.

    `time` (T,) s; `position` (T, N, 3) m; `orientation` (T, N, 4), w first; `velocity` (T, N, 3) m/s;
    `angular_velocity` (T, N, 3) rad/s, fixed axes. `steps` and `residuals` are the core's tables, empty where only chosen
    instants were kept; `impacts` is there always. `core_s` is the time in the core, s.
    """

    h: float
    time: F64
    position: F64
    orientation: F64
    velocity: F64
    angular_velocity: F64
    steps: Table
    impacts: Table
    residuals: Table
    monitors: dict[str, Any]
    names: tuple[str, ...]
    core_s: float

    def index(self, t: float) -> int:
        """Index of the state at the time `t`, s; an error where none was kept."""
        n = int(np.argmin(np.abs(self.time - t)))
        if abs(float(self.time[n]) - t) > 1e-6 * self.h:
            raise CaromError(f"no state was kept at t = {t:g} s; the nearest is at {self.time[n]:g} s")
        return n

    def body(self, name: str) -> int:
        """Index of a sphere."""
        return self.names.index(name)

    def hits(self, a: str, b: str) -> Table:
        """Rows of `impacts` between two spheres, one per impact problem; problem 0 only offsets loads and is left out."""
        pair = sorted((self.body(a), self.body(b)))
        rows = (np.asarray(self.impacts["body"]) == pair).all(axis=1) & (self.impacts["problem"] > 0)
        return {key: column[rows] for key, column in self.impacts.items()}

    def histories(self, step: int, level: Literal["position", "velocity"]) -> list[F64]:
        """Relative residuals (eq. 44) of Newton's iterations, one array for each contact problem of a step and level."""
        table = self.residuals
        ends = np.concatenate([[0], table["end"]]).astype(np.int64)
        rows = np.flatnonzero((table["step"] == step) & (table["level"] == LEVELS[level]))
        return [np.asarray(table["value"][ends[r] : ends[r + 1]]) for r in rows]

    @cached_property
    def energy(self) -> F64:
        """Kinetic and potential energy after every step, (S,), J."""
        return np.asarray(self.steps["energy_kinetic"] + self.steps["energy_potential"])

    @property
    def unconverged(self) -> int:
        """Sub-problems that were not solved to their tolerance."""
        return int(self.monitors["unconverged"])

    def iterations(self, level: Literal["smooth", "position", "velocity"]) -> Iterations:
        """Greatest and mean number of iterations of a sub-problem over all steps."""
        found = self.monitors["iterations"][level]
        return float(found["max"]), float(found["mean"])


def trace(
    scene: Scene, *, at: Sequence[float] | None = None, until: float | None = None, **run: Any
) -> Trace:
    """Run a scene to its end (`until`, s; by default that of its file) and keep every state, or those at the times `at`, s.

    `run` are keys of `[run]`. Times must lie on the grid of the steps. A run that stops before its end raises
    `NotConverged`.
    """
    scene = scene.with_options(**run)
    h = scene.run.step
    end = max(at) if at else (until if until is not None else scene.run.until)
    if end is None:
        raise CaromError("how long to run? give until, or let the scenario say it")
    chosen = sorted({_step(t, h) for t in at}) if at is not None else None
    simulation = _core.Simulation(scene.to_model())
    kept: list[dict[str, NDArray[Any]]] = [_row(simulation)]
    tables: dict[str, list[Table]] = {"steps": [], "impacts": [], "residuals": []}
    core_s = 0.0
    for target in chosen if chosen is not None else [_step(end, h)]:
        while simulation.step < target:
            count = min(BLOCK, target - simulation.step)
            start = clock.perf_counter()
            block = simulation.advance(count, int(chosen is None), False, math.inf)
            core_s += clock.perf_counter() - start
            if block["outcome"] is not None:
                raise NotConverged(f"{scene.title}, h = {h:g} s: the run stopped, {block['outcome']}")
            tables["impacts"].append(block["impacts"])
            if chosen is None:
                kept.append({key: np.asarray(block["frames"][key]) for key in STATE})
                tables["steps"].append(block["steps"])
                tables["residuals"].append(_from(block["residuals"], tables["residuals"]))
        if chosen is not None and target > 0:
            kept.append(_row(simulation))
    state: dict[str, F64] = {key: np.concatenate([row[key] for row in kept]) for key in STATE}
    return Trace(
        h=h,
        time=state["time"],
        position=state["position"],
        orientation=state["orientation"],
        velocity=state["velocity"],
        angular_velocity=state["angular_velocity"],
        steps=_joined(tables["steps"]),
        impacts=_joined(tables["impacts"]),
        residuals=_joined(tables["residuals"]),
        monitors=simulation.monitors(),
        names=tuple(scene.names),
        core_s=core_s,
    )


def timed(scene: Scene, runs: int, **run: Any) -> float:
    """Least time of the core for the whole scene, s, over `runs` runs that keep no states."""
    scene = scene.with_options(**run)
    assert scene.run.until is not None
    steps, model = _step(scene.run.until, scene.run.step), scene.to_model()

    def once() -> float:
        simulation = _core.Simulation(model)
        start = clock.perf_counter()
        while simulation.step < steps:
            block = simulation.advance(min(BLOCK, steps - simulation.step), 0, False, math.inf)
            if block["outcome"] is not None:
                raise NotConverged(f"{scene.title}: the run stopped, {block['outcome']}")
        return clock.perf_counter() - start

    return min(once() for _ in range(runs))


def _step(t: float, h: float) -> int:
    n = round(t / h)
    if abs(n * h - t) > 1e-9 * max(t, h):
        raise CaromError(f"h = {h:g} s does not reach t = {t:g} s in whole steps")
    return n


def _row(simulation: _core.Simulation) -> dict[str, NDArray[Any]]:
    return {key: np.asarray(value)[np.newaxis] for key, value in simulation.frame().items()}


def _from(residuals: dict[str, Any], earlier: list[Table]) -> Table:
    """The residuals of a block with `end` counted from the start of the run."""
    return {**residuals, "end": residuals["end"] + np.uint64(sum(len(t["value"]) for t in earlier))}


def _joined(parts: list[Table]) -> Table:
    if not parts:
        return {}
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
