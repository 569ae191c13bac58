"""Runs kept in memory: nothing is written to disk, so a million steps of two balls take seconds.

`trace` is what `carom.simulate` is without a run directory: a scene, keys of `[run]`, and the states and reports of
the core as arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from carom.arrays import F64, I64
from carom.errors import CaromError
from carom.reproduce.document import Iterations, NotConverged
from carom.result.kinematics import Frames
from carom.result.names import Names
from carom.result.record import Memory
from carom.result.tables import Energy, Impacts, Residuals, Static, Steps
from carom.run.loop import advance, begin, drive
from carom.run.sinks import Instants, Recorder
from carom.scene.plan import Plan
from carom.scene.scene import Scene


@dataclass(frozen=True)
class Trace(Frames[F64]):
    """A run: states at T instants of N spheres, the first at t = 0, and what the core reports, as of a `carom.Result`.

    `steps` and `residuals` are empty where only chosen instants were kept; `impacts` are there always. `core_s` is the time
    in the core, s.
    """

    h: float
    states: Mapping[str, F64]
    step: I64
    bodies: Static
    steps: Steps
    impacts: Impacts
    residuals: Residuals
    monitors: dict[str, Any]
    core_s: float

    @property
    def time(self) -> F64:
        """Times of the states, (T,), s."""
        return self.states["time"]

    def _quantity(self, name: str) -> F64:
        return self.states[name]

    def index(self, t: float) -> int:
        """Index of the state at the time `t`, s; an error where none was kept."""
        n = int(np.argmin(np.abs(self.time - t)))
        if abs(float(self.time[n]) - t) > 1e-6 * self.h:
            raise CaromError(f"no state was kept at t = {t:g} s; the nearest is at {self.time[n]:g} s")
        return n

    @property
    def energy(self) -> Energy:
        """Energies after every step, (S,), J."""
        return Energy(self.steps)

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
    model, steps = scene.to_model(), _step(end, h)
    simulation, names = begin(model), list(scene.names)
    chosen = Instants(range(steps + 1) if at is None else [0, *(_step(t, h) for t in at)])
    memory = Memory(keep=("steps", "impacts", "residuals") if at is None else ("impacts",))
    plan = Plan(steps, chosen.every, h, False)
    ending = drive(simulation, plan, [chosen, Recorder(memory, plan, len(names))])
    if ending.kind != "done":
        raise NotConverged(f"{scene.title}, h = {h:g} s: the run stopped, {ending.outcome}")
    return Trace(
        h=h,
        states={**chosen.frames, "present": np.ones((len(chosen.steps), len(names)), dtype=bool)},
        step=chosen.steps,
        bodies=Static({"name": np.array(names), **{k: model[k] for k in ("radius", "mass", "inertia")}}),
        steps=Steps(memory),
        impacts=Impacts(memory, Names(names)),
        residuals=Residuals(memory),
        monitors=simulation.monitors(),
        core_s=ending.core_s,
    )


def timed(scene: Scene, runs: int, **run: Any) -> float:
    """Least time of the core for the whole scene, s, over `runs` runs that keep no states."""
    scene = scene.with_options(**run)
    assert scene.run.until is not None
    steps, model = _step(scene.run.until, scene.run.step), scene.to_model()

    def once() -> float:
        ending = advance(begin(model), steps, 0, [])
        if ending.kind != "done":
            raise NotConverged(f"{scene.title}: the run stopped, {ending.outcome}")
        return ending.core_s

    return min(once() for _ in range(runs))


def _step(t: float, h: float) -> int:
    n = round(t / h)
    if abs(n * h - t) > 1e-9 * max(t, h):
        raise CaromError(f"h = {h:g} s does not reach t = {t:g} s in whole steps")
    return n
