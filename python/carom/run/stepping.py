"""`carom.Simulation`: a scene that is advanced step by step from Python, for controllers and learning."""

from __future__ import annotations

import copy
import signal
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from carom import _core
from carom.arrays import Array
from carom.errors import CaromError, CaromWarning, did_you_mean
from carom.numeric import is_whole, masked
from carom.result.directory import now
from carom.result.record import Memory
from carom.run.launch import Run
from carom.run.loop import Ending, Sink, advance
from carom.run.placed import Placement
from carom.run.result import Result
from carom.run.simulate import RunFailed, scene_of
from carom.run.sinks import Interrupt, Recorder
from carom.run.watch import State, Watched
from carom.scene.assembly.arrays import identify
from carom.scene.checks.areas import first_area_to_go
from carom.scene.plan import MOST_STEPS

if TYPE_CHECKING:
    from carom._core import Block
    from carom.scene.scene import Scene
    from carom.scene.tables.keywords import Options

#: What messages call it.
_CALLED = "carom.Simulation"
#: Its keywords besides those of `[run]` and `[record]`.
_OWN = ("case", "parameters", "keep")
#: The core's bound (`outcome.rs`), one for m/s and rad/s: what moves or turns faster has blown up.
_FASTEST = 1e12


class _Last(Sink):
    """The newest block: it counts the contacts."""

    block: Block | None = None

    def take(self, simulation: _core.Simulation, block: Block) -> None:
        self.block = block


def _origin(model: Mapping[str, Any]) -> dict[str, Array]:
    """What a state tells of where it is from: its step (s), and a digest of the bodies."""
    bodies: dict[str, Any] = {key: model[key] for key in ("radius", "mass", "inertia")}
    bodies["clumps"] = [(clump["mass"], clump["inertia"]) for clump in model.get("clumps", ())]
    digest = bytes.fromhex(identify(bodies))
    step = np.array([model["options"]["step"]])
    step.flags.writeable = False  # all states of a simulation share it
    return {"step_size": step, "bodies": np.frombuffer(digest, np.uint8)}


def _whole(step: object) -> Array:
    """The number of steps that a state has made."""
    try:
        made = np.ravel(np.asarray(step))
    except ValueError:  # rows of unlike lengths
        made = np.empty(0)
    if len(made) == 1 and made.dtype.kind in "iuf" and 0 <= made[0] <= MOST_STEPS and made[0] == int(made[0]):
        return made.astype(np.uint64)
    raise CaromError(f"restore: step must be one whole number from 0 to 10^12, found {step!r}")


#: Kinds of numbers that are what an array of a kind holds.
_TAKEN = {"f": "fiu", "u": "iu", "i": "iu"}


def _rows(key: str, value: object, like: Array) -> Array:
    """An array of a state, in the type that the core takes; refused by name where that is another meaning or shape."""
    try:
        array = np.asarray(value)
    except ValueError:
        found = "rows of unlike lengths"
    else:
        kind, shape = array.dtype.kind, array.shape
        if (
            kind in _TAKEN.get(like.dtype.kind, like.dtype.kind)
            and array.ndim
            and shape[1:] == like.shape[1:]
        ):
            if like.dtype.kind == "u" and (array < 0).any():
                raise CaromError(f"restore: {key} must be 0 or more, found {array.min()}")
            return array.astype(like.dtype, copy=False)
        found = f"{array.dtype} {shape}" if shape else type(value).__name__
    wanted = ", ".join(["n", *map(str, like.shape[1:])])
    raise CaromError(f"restore: {key} must be an array of {like.dtype} ({wanted}), found {found}")


def _refuse_too_fast(key: str, motion: Array, unit: str) -> None:
    """Raise for what the next step would take for a motion that has left the numbers."""
    if _FASTEST < (fast := float(np.abs(motion).max(initial=0.0))) < np.inf:
        row = int(np.abs(motion).max(axis=1).argmax())
        cause = f"row {row} of {key} has {fast:g} {unit}, more than the {_FASTEST:g} {unit} of any run"
        raise CaromError(f"restore: {cause}; strike with less")


class Simulation(State):
    """A scene in the core: `sim.step(10)`, `sim.time`, `sim["cue"].position`, `sim.result()`.

    Of a file with `[parameters]`, `case` and `parameters` choose a variant; `options` are keys of `[run]` and `[record]`, as
    in `carom.simulate`. Without `until` the simulation has no end; with it, it may still be stepped further. What is
    recorded stays in memory: a frame after every `every` steps; by default 1000 up to `until`, and without
    `until` one after each step.
    With `keep=False` nothing is recorded, which is faster, and `result()` holds the state as it stands alone.

    Arrays are read-only copies. They keep their values when the simulation goes on.
    """

    def __init__(
        self,
        scene: Scene | str | Path,
        *,
        case: str | None = None,
        parameters: Mapping[str, Any] | None = None,
        keep: bool = True,
        **options: Unpack[Options],
    ) -> None:
        if not isinstance(keep, bool | np.bool_):
            raise CaromError(f"{_CALLED}: keep must be True or False, found {keep!r}")
        if unused := [key for key in options if key.startswith("checkpoint_")]:
            raise CaromError(f"{_CALLED}: {unused[0]}: it writes no checkpoints; keep what state() returns")
        scene = scene_of(scene, _CALLED, case=case, parameters=parameters)
        scene = scene.overridden(options, dict.fromkeys(options, _CALLED), _OWN) if options else scene
        if scene.run.until is None:
            endless = {"until": scene.run.step, "every": scene.record.every or 1}
            scene = scene.overridden(endless, dict.fromkeys(endless, _CALLED))
        for advice in scene.validate():
            warnings.warn(str(advice), CaromWarning, stacklevel=2)
        self._run, self._keep = Run(scene), bool(keep)
        self._gone = first_area_to_go(scene._walls(), scene.world.periodic)
        self._core = self._run.simulation
        self._origin = _origin(self._run.model)
        start = self._core.state()
        # Of each array of a state its type and the shape of a row.
        self._known = {
            key: np.empty((0, *np.shape(array)[1:]), array.dtype)
            for key, array in (start | self._origin).items()
        }
        # The sums since the last frame, as they are where a record begins.
        self._sums = {key: start[key] for key in start if key.startswith("open_")}
        self._placement: Placement | None = None  # made when a state is restored, if ever
        super().__init__(self._core, Watched(scene.names, self._run.model))
        self._begin()

    def _begin(self) -> None:
        """A new record, from the state as it stands."""
        self._frame = self._block = None
        self._watched = Watched(self.names, self._run.model)
        self._segment, self._ending = {"from_step": self.steps, "started": now()}, Ending({"kind": "done"})
        self._memory = Memory(**self._run.described())
        self._recorder = Recorder(self._memory, self._run.plan, len(self.names))
        self._recorder.start(self._core)

    @property
    def steps(self) -> int:
        """Number of steps made."""
        return int(self._core.step)

    def step(self, n: int = 1) -> None:
        """Advance by `n` steps. `RunFailed` where one cannot be solved: the state is then that of the last good step.

        Ctrl-C ends it between two steps with `KeyboardInterrupt`, and it can go on from there.
        """
        if not is_whole(n) or n < 0:
            raise CaromError(f"step: a number of steps from 0 on is needed, found {n!r}")
        plan, target = self._run.plan, self.steps + int(n)
        if target > MOST_STEPS:
            raise CaromError(f"step: {n} more are beyond step 10^12; make fewer steps")
        if self._gone is not None:
            self._gone.refuse(target * plan.step, "step")
        if self._keep:
            replace(plan, steps=target).refuse_to_fill_memory(len(self.names))
        last, halt = _Last(), Interrupt()
        sinks, every = ([last, self._recorder], plan.every) if self._keep else ([last], 0)
        contacts = plan.contacts and self._keep
        with halt.listening(signal.SIGINT):
            try:
                ended = advance(self._core, target, every, sinks, halt.__bool__, contacts=contacts)
            finally:
                self._frame = None  # last, for another thread may have looked in between
        before, self._block = self._ending, last.block or self._block
        self._ending = Ending(ended.outcome, before.wall_s + ended.wall_s, before.core_s + ended.core_s)
        if halt:
            raise KeyboardInterrupt(f"interrupted at t = {self.time:g} s")
        if ended.kind != "done":
            result = self.result()
            raise RunFailed(str(result.outcome), result) from ended.error

    def state(self) -> dict[str, Any]:
        """Everything that is needed to go on from here bit for bit, as a dictionary of arrays and numbers of its own."""
        return self._core.state() | self._origin

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go back (or on) to a `state` of this scene. What is recorded begins anew there.

        To strike a ball, change its row of `state["velocity"]` (M, 3), m/s, or `state["angular_velocity"]`, rad/s, before;
        M are the N balls, then the clumps, whose balls follow them, then the free walls. Rows of `position` and
        `orientation` place them anew. `CaromError` where it is not a state of this step and these bodies, where a ball of a
        clump is struck or placed by itself, or where a joint does not hold. Until the next step `contacts` is 0.
        """
        state = self._placed(self._checked(state))
        try:
            self._core.restore(state)
        except _core.ModelError as error:
            cure = "" if "; " in str(error) else "; give what state() of a simulation of this scene returned"
            raise CaromError(f"restore: {error}{cure}") from error
        self._run.about["restored"] = self.steps
        self._begin()

    def _placed(self, state: dict[str, Any]) -> dict[str, Any]:
        """The state with balls where their clumps have been placed; refused where a joint does not hold."""
        if self._placement is None:
            self._placement = Placement(self._run.scene, self._run.model)
        if not self._placement:
            return state
        here = self._core.state()
        state = self._placement.follow(state, here)
        self._placement.refuse_off_joints(state, here, self._run.plan.step)
        return state

    def _checked(self, state: object) -> dict[str, Any]:
        """What the core takes of a state of these bodies and this step."""
        if not isinstance(state, Mapping):
            given = "nothing" if state is None else type(state).__name__
            raise CaromError(f"restore: a state is needed, found {given}; give what state() returned")
        if unknown := [str(name) for name in state if name not in self._known]:
            cure = did_you_mean(unknown[0], list(self._known))
            raise CaromError(f"restore: a state of this scene has no {', '.join(unknown)}; {cure}")
        kept = dict(state)
        if holes := next((key for key, value in kept.items() if masked(value)), None):
            raise CaromError(f"restore: {holes} has masked numbers, which are none; fill them")
        if "step" in kept:
            kept["step"] = _whole(kept["step"])
        # A state of version 0.2.0 does not say where it is from.
        differs = {key for key, here in self._origin.items() if not np.array_equal(kept.pop(key, here), here)}
        if "bodies" in differs:
            cause = "the state is of other bodies: their number, radii, masses or inertias differ"
            raise CaromError(f"restore: {cause}; give what state() of a simulation of these bodies returned")
        if differs:
            cause = f"the state was made with another step than {self._run.plan.step:g} s"
            raise CaromError(f"restore: {cause}; give both simulations the same step")
        kept = {key: _rows(key, value, self._known[key]) for key, value in kept.items()}
        for key, unit in (("velocity", "m/s"), ("angular_velocity", "rad/s")):
            if key in kept:
                _refuse_too_fast(key, kept[key], unit)
        # The record begins anew: what was summed since a frame of the old one is not in the first frame of the new one, nor
        # are totals of the old one in the summary.
        for totals in ("monitor_int", "monitor_float"):
            kept.pop(totals, None)
        return kept | {key: sums for key, sums in self._sums.items() if key in kept}

    def result(self) -> Result:
        """All that was recorded so far, as `carom.simulate` up to this time returns it. Later steps do not change it.

        Off the grid of frames the last frame has the state alone, without contacts; impulses on walls and at joints are
        not a number there.
        """
        run = copy.copy(self._run)
        run.plan = replace(run.plan, steps=max(1, self.steps))
        run.scene = run.scene.with_options(until=run.plan.until)
        run.about = copy.deepcopy(run.about)
        memory = self._memory.snapshot() if self._keep else Memory(**run.described())
        recorder = Recorder(memory, run.plan, len(self.names))
        if not self._keep:
            recorder.start(self._core)
        shown = memory.last_frame
        recorder.end(self._core)
        if memory.last_frame != shown:  # off the grid, where runs that are done have whole frames
            run.about["bare_end"] = True
        here = {"step": self.steps, "time": self.time}
        ending = replace(self._ending, outcome={**here, **self._ending.outcome})
        return Result(run.about, memory, scene=run.scene, problem=run.conclude(ending, dict(self._segment)))

    def __reduce__(self) -> Any:
        """Copies would share the core, which no process can send."""
        raise CaromError(
            "a Simulation is neither copied nor pickled; make another one of the same scene, and let its"
            " restore(state) go on from the state() of this one"
        )

    def __repr__(self) -> str:
        place = f"step {self.steps}, t = {self.time:g} s"
        return f"<carom.Simulation {self._run.scene.title!r}: {place}, {len(self.names)} balls>"
