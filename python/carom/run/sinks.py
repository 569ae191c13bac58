"""What a run hands its blocks of steps to: the recorder, the progress bar, checkpoints; and the flag of Ctrl-C.

(`carom.run.watch` has callbacks and stop conditions, `carom.run.problems` the contact problems that are kept.)
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np

from carom import _core
from carom.result.kinematics import QUANTITIES
from carom.run import checkpoint
from carom.run.loop import Sink
from carom.scene.plan import Plan

if TYPE_CHECKING:
    from carom._core import Block, Simulation
    from carom.result.directory import RunDir
    from carom.result.record import Memory, Writer

#: Bytes of results the core may hold in one block.
BLOCK_BYTES = 64 * 1024 * 1024
#: Where the scenario says nothing else, a checkpoint is written this many seconds after the last one, at first
#: sooner, and never for more than 2 % of the time.
CHECKPOINT_SECONDS = 30.0
FIRST_CHECKPOINT_SECONDS = 3.0
CHECKPOINT_SHARE = 0.02


class Recorder(Sink):
    """Appends frames and tables to a file or to memory, from the start to the last state of a run."""

    def __init__(self, store: Writer | Memory, plan: Plan, bodies: int) -> None:
        self.store, self._plan = store, plan
        self._most = max(1, BLOCK_BYTES // max(1, plan.frame_bytes(bodies))) * max(1, plan.every)

    def start(self, simulation: Simulation) -> None:
        block = simulation.advance(0, self._plan.every, self._plan.contacts, 0.0)  # all columns and no rows
        if not any(self.store.first):
            block = with_frame(block, simulation.frame(), simulation.step)
        self.store.append(block)
        self.store.commit()

    def next(self, step: int) -> float:
        return step + self._most

    def take(self, simulation: Simulation, block: Block) -> None:
        self.store.append(block)

    def end(self, simulation: Simulation) -> None:
        """The last good state of a run that failed or was interrupted, unless a frame shows it already."""
        on_grid = (
            simulation.step % self._plan.every == 0
        )  # then it is in an earlier segment, if not in this one
        shown = self.store.last_frame
        if shown != simulation.step and not (shown is None and on_grid):
            empty = simulation.advance(0, 0, False, 0.0)
            # What joints and walls have got since the last frame stays in the core.
            state = with_frame(empty, simulation.frame(), simulation.step, given=np.nan)
            self.store.append(state)
        self.store.commit()


def with_frame(block: Mapping[str, Any], frame: Mapping[str, Any], step: int, given: float = 0.0) -> Any:
    """`block` (without rows) with one frame: the state as it stands, without contacts. `given` stands for the impulses on
    joints and walls since the frame before: 0 at the start, not a number where they are not known.
    """
    columns = dict(block["frames"])
    for name, values in columns.items():
        if name == "step":
            columns[name] = np.array([step], dtype=np.uint64)
        elif name == "contact_end":
            columns[name] = np.zeros(1, dtype=np.uint64)
        elif name in ("joint_impulse", "walls"):
            columns[name] = np.full((1, *values.shape[1:]), given, values.dtype)
        else:
            columns[name] = np.asarray(frame[name])[np.newaxis].astype(values.dtype)
    return {**block, "frames": columns}


#: The quantities of a state.
STATE = ("time", *QUANTITIES)


class Instants(Sink):
    """Keeps the states after chosen `steps`, in `frames["position"]` (T, N, 3) and others: NaN where one is not reached.

    Frames are to be taken after each `every` steps.
    """

    def __init__(self, steps: Iterable[int]) -> None:
        self.steps = np.unique(np.fromiter(steps, np.int64))
        self.every = int(np.gcd.reduce(self.steps))
        self.frames: dict[str, Any] = {}

    def start(self, simulation: Simulation) -> None:
        first = simulation.frame()
        for key in STATE:
            self.frames[key] = np.full((len(self.steps), *np.shape(first[key])), np.nan)
            self.frames[key][self.steps == simulation.step] = first[key]

    def take(self, simulation: Simulation, block: Block) -> None:
        reached = np.asarray(block["frames"]["step"], dtype=np.int64)
        kept = np.isin(reached, self.steps)
        rows = np.searchsorted(self.steps, reached[kept])
        for key, values in self.frames.items():
            values[rows] = np.asarray(block["frames"][key])[kept]


@dataclass(frozen=True)
class Progress:
    """Where a run stands, for a progress bar: numbers of the last step, and the pace so far."""

    step: int
    steps: int
    time: float
    until: float
    contacts: int
    iterations_position: int
    iterations_velocity: int
    wall_s: float
    steps_per_s: float
    eta_s: float


class Shown(Sink):
    """Tells a callback where the run stands, after every block."""

    def __init__(self, callback: Callable[[Progress], None], plan: Plan) -> None:
        self._callback, self._plan = callback, plan

    def start(self, simulation: Simulation) -> None:
        self._begin, self._first = time.perf_counter(), simulation.step

    def take(self, simulation: Simulation, block: Block) -> None:
        plan, wall = self._plan, time.perf_counter() - self._begin
        pace = (simulation.step - self._first) / wall if wall > 0 else 0.0
        counts = ("contacts", "iterations_position", "iterations_velocity")
        columns: Mapping[str, Any] = block["steps"]
        self._callback(
            Progress(
                step=simulation.step,
                steps=plan.steps,
                time=simulation.time,
                until=plan.until,
                wall_s=wall,
                steps_per_s=pace,
                eta_s=(plan.steps - simulation.step) / pace if pace > 0 else math.inf,
                **{key: int(columns[key][-1]) if len(columns.get(key, ())) else 0 for key in counts},
            )
        )


@dataclass(frozen=True)
class Cadence:
    """When checkpoints are written: every so many `steps`, every so much simulated `time` (s), every so much
    `wall` time (s), whichever comes first. Without any of them it is left to the constants above.
    """

    steps: int | None = None
    time: float | None = None
    wall: float | None = None

    def next_step(self, step: int, size: float) -> int | None:
        """The first step after `step` that is due by steps or simulated time; `size` is that of a step, s."""
        due = []
        if self.steps is not None:
            due.append((step // self.steps + 1) * self.steps)
        if self.time is not None:
            # Rounded as `whole_steps` rounds: a time that is a step up to rounding is that step.
            passed = math.floor(step * size / self.time + 1e-9)
            due.append(max(step + 1, math.ceil((passed + 1) * self.time / size - 1e-9)))
        return min(due, default=None)

    def first_wall(self) -> float:
        """Seconds from the start of the process to its first checkpoint."""
        return self._wall(FIRST_CHECKPOINT_SECONDS)

    def next_wall(self, spent: float) -> float:
        """Seconds from one checkpoint, which took `spent` seconds, to the next."""
        return self._wall(max(CHECKPOINT_SECONDS, spent / CHECKPOINT_SHARE))

    def _wall(self, otherwise: float) -> float:
        if self.wall is not None:
            return self.wall
        return otherwise if self.steps is None and self.time is None else math.inf


class Checkpoints(Sink):
    """Writes states from which the run continues, each with the rows that belong to it.

    No checkpoint is taken off the grid of frames: the last step may be computed by itself (`Plan.grid_end`), and a later
    extension of the run must not be disturbed by a frame that it would not have.
    """

    def __init__(
        self, writer: Writer, directory: RunDir, plan: Plan, cadence: Cadence, identity: str
    ) -> None:
        self._writer, self._directory, self._plan = writer, directory, plan
        self._cadence, self._identity = cadence, identity

    def start(self, simulation: Simulation) -> None:
        self._last, self._wall = time.perf_counter(), self._cadence.first_wall()
        self._begun, self._core = self._last, 0.0
        self._due = self._cadence.next_step(simulation.step, self._plan.step)
        if simulation.step == self._plan.grid_end < self._plan.steps:
            self._save(simulation)

    def next(self, step: int) -> float:
        return math.inf if self._due is None else self._due

    def take(self, simulation: Simulation, block: Block) -> None:
        step, plan = simulation.step, self._plan
        self._core += block.get("core_s", 0.0)
        due = step == self._due or time.perf_counter() - self._last > self._wall
        before_last = step == plan.grid_end < plan.steps
        if block["outcome"] is None and (before_last or (due and step < plan.grid_end)):
            self._save(simulation)

    def end(self, simulation: Simulation) -> None:
        # At a failure the state is the last good one: from there other options may lead on.
        if simulation.step <= self._plan.grid_end:
            self._save(simulation)

    def _save(self, simulation: Simulation) -> None:
        start = time.perf_counter()
        writer = self._writer
        # Rows first, then the state that belongs to them: a state must never be ahead of what can be read,
        # not even after the power failed.
        writer.commit()
        writer.sync()
        rows = writer.first + writer.committed
        state = simulation.state()
        path = checkpoint.save(
            self._directory.path,
            checkpoint.Checkpoint(
                simulation.step,
                simulation.time,
                rows,
                self._identity,
                state,
                _core.__version__,
                checkpoint.build(),
                (start - self._begun, self._core),
            ),
        )
        self._last = time.perf_counter()
        spent = self._last - start
        self._wall = self._cadence.next_wall(spent)
        self._due = self._cadence.next_step(simulation.step, self._plan.step)
        self._directory.log("checkpoint", step=simulation.step, file=path.name, seconds=round(spent, 4))


class Interrupt:
    """A flag that Ctrl-C (or the given signals) sets, so that a run stops between two blocks and not inside a
    write.

    A second signal of the same kind acts as if this object were not there.
    """

    def __init__(self) -> None:
        self.signal: int | None = None

    def __bool__(self) -> bool:
        return self.signal is not None

    @contextmanager
    def listening(self, *signals: int) -> Iterator[Interrupt]:
        """Listen while the block runs. Only the main thread may; elsewhere nothing is caught."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        old = {number: signal.getsignal(number) for number in signals}

        def note(number: int, frame: FrameType | None) -> None:
            self.signal = number
            signal.signal(number, old[number])

        for number in signals:
            signal.signal(number, note)
        try:
            yield self
        finally:
            for number, handler in old.items():
                signal.signal(number, handler)
