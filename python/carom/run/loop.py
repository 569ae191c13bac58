"""The loop that advances the core: blocks of steps, each handed to sinks that keep, show, save or end the run.

Everything that simulates goes through `begin` and `advance`: `carom.simulate`, `carom.Simulation`, batches, studies. The
core decides nothing about files, and this page nothing about physics.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from carom import _core
from carom.errors import CaromError
from carom.scene.plan import Plan

if TYPE_CHECKING:
    from carom._core import Block, Simulation

#: Seconds of computing between two looks at the clock, the progress bar and the interrupt flag.
BLOCK_SECONDS = 0.1
#: Steps in one call of the core, at most: its reports of every step are handed on before they fill memory.
BLOCK_STEPS = 100_000


def begin(model: Mapping[str, Any]) -> Simulation:
    """The model (`_core.pyi`) in the core, at its start; `CaromError` if it is none that can be simulated."""
    try:
        return _core.Simulation(dict(model))
    except _core.ModelError as error:
        raise CaromError(str(error)) from error


class Sink:
    """What a run hands its blocks to. One that derives from this needs only the methods that it has a use for."""

    def start(self, simulation: Simulation) -> None:
        """Before the first step."""

    def next(self, step: int) -> float:
        """The step after `step` by which it must be asked."""
        return math.inf

    def take(self, simulation: Simulation, block: Block) -> Mapping[str, Any] | None:
        """After every block; what it returns is the outcome of the run, which ends there."""

    def end(self, simulation: Simulation) -> None:
        """After the last step, whatever the outcome: the sinks in their opposite order."""


@dataclass
class Ending:
    """How a run ended: `kind` is "done", "stopped" (by the user's condition), "interrupted" or the core's word for what
    went wrong.
    """

    outcome: dict[str, Any]
    wall_s: float = 0.0
    core_s: float = 0.0
    error: Exception | None = None
    """What a load function raised, if that ended the run."""

    @property
    def kind(self) -> str:
        return str(self.outcome["kind"])


def drive(
    simulation: Simulation, plan: Plan, sinks: Sequence[Sink], stop: Callable[[], bool] = lambda: False
) -> Ending:
    """A run from the simulation's step to the last one of the plan, or to where `stop` returns True between two blocks."""
    for sink in sinks:
        sink.start(simulation)
    ending = advance(simulation, plan.grid_end, plan.every, sinks, stop, contacts=plan.contacts)
    if ending.kind == "done" and simulation.step < plan.steps:
        last = advance(simulation, plan.steps, 1, sinks, stop, contacts=plan.contacts)
        last.wall_s, last.core_s = ending.wall_s + last.wall_s, ending.core_s + last.core_s
        ending = last
    start = time.perf_counter()
    for sink in reversed(sinks):
        sink.end(simulation)
    ending.wall_s += time.perf_counter() - start
    return ending


def advance(
    simulation: Simulation,
    steps: int,
    every: int,
    sinks: Sequence[Sink],
    stop: Callable[[], bool] = lambda: False,
    *,
    contacts: bool = False,
) -> Ending:
    """Advance to the step `steps`, with a frame after each `every` of them (0: none), and hand every block to the sinks.

    `KeyboardInterrupt` and `SystemExit` of a load function go on, when the sinks have all steps before.
    """
    start = time.perf_counter()
    core_s = 0.0
    outcome: Mapping[str, Any] | None = None
    error: Exception | None = None
    while simulation.step < steps and outcome is None and not stop():
        here = simulation.step
        until = min(steps, here + BLOCK_STEPS, *(sink.next(here) for sink in sinks))
        # Intervals are measured by `perf_counter`, which no change of the clock moves.
        entered = time.perf_counter()
        block = simulation.advance(int(until) - here, every, contacts, BLOCK_SECONDS)
        block["core_s"] = time.perf_counter() - entered
        core_s += block["core_s"]
        outcome = block["outcome"]
        raised = (block["outcome"] or {}).pop("error", None)
        for sink in sinks:
            ended = sink.take(simulation, block)
            outcome = ended if outcome is None else outcome
        if isinstance(raised, Exception):
            error = raised
        elif raised is not None:
            raise raised
    if outcome is None:
        kind = "done" if simulation.step >= steps else "interrupted"
        outcome = {"kind": kind, "step": simulation.step, "time": simulation.time}
    return Ending(dict(outcome), time.perf_counter() - start, core_s, error)
