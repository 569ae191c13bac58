"""Drives the core through a run: blocks of steps, each recorded, shown and now and then saved.

One loop serves `carom.simulate`, `carom run` and `carom resume`. The core decides nothing about files and
this page nothing about physics. Order matters at three places and is explained there: checkpoints, the last
frame, interruption.
"""

from __future__ import annotations

import hashlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np

from carom import checkpoint
from carom.record import Writer
from carom.rundir import RunDir

if TYPE_CHECKING:
    from carom._core import Simulation
    from carom.record.problem import Problems
    from carom.watching import Watch

#: Seconds of computing between two looks at the clock, the progress bar and the interrupt flag.
BLOCK_SECONDS = 0.1
#: Bytes of results the core may hold in one block.
BLOCK_BYTES = 64 * 1024 * 1024
#: Where the scenario says nothing else, a checkpoint is written this many seconds after the last one, at first
#: sooner, and never for more than 2 % of the time.
CHECKPOINT_SECONDS = 30.0
FIRST_CHECKPOINT_SECONDS = 3.0
CHECKPOINT_SHARE = 0.02


@dataclass(frozen=True)
class Plan:
    """What to compute and keep: steps in all, steps between frames, step size (s), whether contacts are kept."""

    steps: int
    every: int
    step: float
    contacts: bool

    @property
    def until(self) -> float:
        """Time at the last step, s."""
        return self.steps * self.step

    @classmethod
    def of(cls, until: float, step: float, every: int | None, contacts: bool) -> Plan:
        """The plan for `until` seconds; without `every` about 1000 frames are kept."""
        steps = max(1, math.ceil(until / step - 1e-9))
        return cls(steps, every or thinned(steps), step, contacts)


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
            # Rounded as `Plan.of` rounds: a time that is a step up to rounding is that step.
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


def thinned(steps: int, frames: int = 1000) -> int:
    """Steps between frames for about `frames` of them; if possible a divisor of `steps`, so that the last
    step is one.
    """
    least = max(1, math.ceil(steps / frames))
    return next((n for n in range(least, 2 * least) if steps % n == 0), least)


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


@dataclass
class Ending:
    """How a call of `drive` ended: `kind` is "done", "stopped" (by the user's condition), "interrupted" or the core's
    word for what went wrong.
    """

    outcome: dict[str, Any]
    wall_s: float = 0.0
    core_s: float = 0.0

    @property
    def kind(self) -> str:
        return str(self.outcome["kind"])


def drive(
    simulation: Simulation,
    writer: Writer,
    directory: RunDir,
    plan: Plan,
    *,
    bodies: int,
    identity: str,
    checkpoints: Cadence | None,
    stop: Interrupt,
    progress: Callable[[Progress], None] | None,
    problems: Problems | None = None,
    watch: Watch | None = None,
) -> Ending:
    """Advance from the simulation's step to the plan's last one; everything recorded is committed when it
    returns. Without `checkpoints` none are written. `problems` are the contact problems to keep, `watch` is asked between
    steps.
    """
    from carom import _core

    begin = last_saved = time.perf_counter()
    first_step = simulation.step
    core_s = 0.0
    failure: dict[str, Any] | None = None
    ended: dict[str, Any] | None = None
    # Intervals are measured by `perf_counter`, which no change of the clock moves.
    cadence = checkpoints or Cadence()
    next_save = cadence.first_wall()
    due = cadence.next_step(first_step, plan.step)
    # Where the last step is no frame of the grid, it is computed by itself and framed: results then end at
    # `until`. The checkpoint is taken before it, so that a later extension of the run is not disturbed by a
    # frame off the grid.
    grid_end = plan.steps if plan.steps % plan.every == 0 else plan.steps - 1

    if problems is not None:
        problems.begin(simulation)

    def save() -> None:
        nonlocal last_saved, next_save, due
        start = time.perf_counter()
        # Rows first, then the state that belongs to them: a state must never be ahead of what can be read,
        # not even after the power failed.
        writer.commit()
        writer.sync()
        rows = writer.first + writer.committed
        state = simulation.state()
        path = checkpoint.save(
            directory.path,
            checkpoint.Checkpoint(
                simulation.step, simulation.time, rows, identity, state, _core.__version__, checkpoint.build()
            ),
        )
        last_saved = time.perf_counter()
        spent = last_saved - start
        next_save = cadence.next_wall(spent)
        due = cadence.next_step(simulation.step, plan.step)
        directory.log("checkpoint", step=simulation.step, file=path.name, seconds=round(spent, 4))

    while simulation.step < plan.steps and failure is None and ended is None and not stop:
        last = simulation.step >= grid_end
        to_go = grid_end - simulation.step if due is None else min(grid_end, due) - simulation.step
        if watch is not None:
            to_go = min(to_go, watch.next(simulation.step) - simulation.step)
        steps = 1 if last else min(to_go, _block_steps(bodies, plan))
        if last and checkpoints:
            save()
        start = time.perf_counter()
        block = simulation.advance(steps, 1 if last else plan.every, plan.contacts, BLOCK_SECONDS)
        core_s += time.perf_counter() - start
        failure = block["outcome"]
        writer.append(block)
        if problems is not None:
            problems.take(simulation)
        now = time.perf_counter()
        if progress is not None:
            progress(_progress(block, simulation, plan, now - begin, first_step))
        if watch is not None and failure is None:
            ended = watch.ask(simulation, block, last=simulation.step >= plan.steps)
        is_due = simulation.step == due or now - last_saved > next_save
        if checkpoints and is_due and failure is None and simulation.step < grid_end:
            save()

    if failure is not None or ended is not None:
        outcome = dict(failure or ended or {})
    else:
        kind = "done" if simulation.step >= plan.steps else "interrupted"
        outcome = {"kind": kind, "step": simulation.step, "time": simulation.time}
    # At a failure the state is the last good one: from there other options may lead on.
    if checkpoints and simulation.step <= grid_end:
        save()
    # After the checkpoint: a run that is continued has frames of the grid only.
    writer.append(_last_frame(simulation, writer, plan))
    writer.commit()
    if problems is not None:
        problems.take(simulation, end=True)
    return Ending(outcome, time.perf_counter() - begin, core_s)


def identify(model: Mapping[str, Any]) -> str:
    """SHA-256 of everything a state depends on: the arrays and options of the model, threads aside."""
    digest = hashlib.sha256()

    def feed(name: str, value: Any) -> None:
        if isinstance(value, Mapping):
            for key in sorted(value):
                feed(f"{name}/{key}", value[key])
        elif isinstance(value, list):  # joints, loads, laws: numbers and texts; functions show their names
            digest.update(f"{name} {value!r}".encode())
        elif name != "/options/threads":
            array = np.asarray(value)
            digest.update(f"{name} {array.dtype.kind} {array.shape}".encode())
            digest.update(repr(array.tolist()).encode() if array.dtype.kind in "OU" else array.tobytes())

    feed("", model)
    return digest.hexdigest()


def empty_block(simulation: Simulation, plan: Plan) -> dict[str, Any]:
    """A block without rows, which still tells all columns and their types."""
    return dict(simulation.advance(0, plan.every, plan.contacts, 0.0))


def with_frame(block: Mapping[str, Any], frame: Mapping[str, Any], step: int) -> dict[str, Any]:
    """`block` (without rows) with one frame: the state as it stands, no impulses of contacts, joints and walls."""
    columns = dict(block["frames"])
    for name, values in columns.items():
        if name == "step":
            columns[name] = np.array([step], dtype=np.uint64)
        elif name == "contact_end":
            columns[name] = np.zeros(1, dtype=np.uint64)
        elif name in ("joint_impulse", "walls"):
            columns[name] = np.zeros((1, *values.shape[1:]), values.dtype)
        else:
            columns[name] = np.asarray(frame[name])[np.newaxis].astype(values.dtype)
    return {**block, "frames": columns}


def _last_frame(simulation: Simulation, writer: Writer, plan: Plan) -> dict[str, Any]:
    """The last good state of a run that failed or was interrupted, unless a frame shows it already."""
    empty = dict(simulation.advance(0, 0, False, 0.0))
    on_grid = simulation.step % plan.every == 0  # then it is in an earlier segment, if not in this one
    if writer.last_frame == simulation.step or (writer.last_frame is None and on_grid):
        return empty
    return with_frame(empty, simulation.frame(), simulation.step)


def _block_steps(bodies: int, plan: Plan) -> int:
    per_frame = bodies * (104 + (3 * 250 if plan.contacts else 0))  # state, and about three contacts a body
    frames = max(1, BLOCK_BYTES // max(1, per_frame))
    return min(frames * plan.every, 100_000)


def _progress(
    block: Mapping[str, Any], simulation: Simulation, plan: Plan, wall: float, first: int
) -> Progress:
    def last(column: str) -> int:
        values = block["steps"].get(column, ())
        return int(values[-1]) if len(values) else 0

    pace = (simulation.step - first) / wall if wall > 0 else 0.0
    return Progress(
        step=simulation.step,
        steps=plan.steps,
        time=simulation.time,
        until=plan.until,
        contacts=last("contacts"),
        iterations_position=last("iterations_position"),
        iterations_velocity=last("iterations_velocity"),
        wall_s=wall,
        steps_per_s=pace,
        eta_s=(plan.steps - simulation.step) / pace if pace > 0 else math.inf,
    )
