"""`carom.simulate_batch`: many small scenes in one call, on several threads, without files.

A billiard break costs milliseconds, of which a scene, a run directory and a result would take most. Here the scene is
resolved once; each case is a handful of arrays of it, changed by the overrides (`carom.many.cases`), one object of
the core, and a few numbers that stay. The interpreter lock is released while the core computes. Each case has the bits that
`carom.simulate(batch.scene(i))` gives it, whatever the number of threads.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from carom.errors import CaromError, CaromWarning, counted, extra
from carom.many.cases import WIDTHS, Overrides, Values
from carom.result.kinematics import QUANTITIES, Body
from carom.run.simulate import scene_of
from carom.run.watch import Watch
from carom.show.notebook import of_batch

if TYPE_CHECKING:
    import pandas

    from carom.run.watch import Stop
    from carom.scene.scene import Scene

F64 = NDArray[np.float64]

ENDED = ("done", "stopped")
"""Outcomes of cases that ended well."""
KINEMATICS = {name: len(letters) for name, (letters, _) in QUANTITIES.items()}


def simulate_batch(
    scenes: Scene | str | Path | Sequence[Scene],
    parameters: Mapping[str, Values] | None = None,
    *,
    threads: int | None = None,
    frames: int | None = None,
    impacts: bool = False,
    progress: Callable[[int, int], None] | None = None,
    stop: Stop | None = None,
    callback_every: int | None = None,
    **options: Any,
) -> Batch:
    """Simulate B cases and return their final states as arrays: of one scene with `parameters`, or one of each scene.

    `parameters` names what differs and gives B values of each, in SI:

    - `"velocity"`, `"position"`, `"angular_velocity"` (B, N, 3), `"orientation"` (B, N, 4), `"radius"`, `"mass"`,
      `"inertia"` (B, N): of all balls
    - `"cue.velocity"` (B, 3), `"cue.velocity.x"` (B,), `"cue.mass"` (B,): of one
    - `"ball/cloth.friction"` (B,): of the contact law of two materials
    - `"gravity"` (B, 3)

    Where `mass` or `radius` is given and `inertia` is not, I / (m r^2) stays. `options` are keys of `[run]`, as in
    `carom.simulate`. `threads` is by default the number of processors. With `frames` a frame is kept after each so many
    steps, and of the start, but none of an end that lies between; scenes of a list must have one step then. With `impacts`
    the tables of all impacts and transitions. `progress(done, cases)` is called ten times a second and at the end, in this
    thread; what it raises, and Ctrl-C, end the batch, with the cases that are done as `error.result`.

    `stop`, as in `carom.simulate`, ends a case with the outcome "stopped" where it returns True or a text: each case asks a
    copy of it, in the thread that computes it, after every `callback_every` steps (by default at about 1000 times). Frames
    after the end are NaN.

    A case that fails (`not_converged`, balls that overlap at its start, numbers that are unusable) says so in `outcome`
    and `message`, has NaN for a final state and stops no other. A wrong scene or wrong names raise `ScenarioError` or
    `CaromError`.
    """
    from carom.many.threads import Runner

    if parameters is not None and not isinstance(parameters, Mapping):
        raise CaromError(
            f'simulate_batch: parameters must be a table of names and values, as {{"cue.velocity.x": [1.0, 2.0]}},'
            f" found {type(parameters).__name__}"
        )
    if isinstance(scenes, Sequence) and not isinstance(scenes, str):
        if parameters:
            raise CaromError("simulate_batch: parameters change one scene; a list of scenes takes none")
        sources = [scene_of(s, "simulate_batch").with_options(**options) for s in scenes]
        if not sources:
            raise CaromError("simulate_batch: the list of scenes is empty; give one scene for each case")
        overrides = None
    else:
        scene = scene_of(scenes, "simulate_batch").with_options(**options)
        _advise(scene)
        overrides = Overrides(scene, parameters or {})
        sources = [scene]
    watch = Watch.of(None, stop, callback_every, "simulate_batch")
    return Runner(sources, overrides, frames, impacts, watch).run(_threads(threads), progress)


@dataclass(frozen=True, eq=False)
class Batch:
    """B finished cases of N balls each. Rows of failed ones are NaN."""

    names: list[str]
    """Names of the balls."""
    outcome: NDArray[Any]
    """(B,) "done", "stopped" by the condition, or what went wrong: "not_converged", "overlap", "bad_model", "not_run" ..."""
    message: NDArray[Any]
    """(B,) where and why, with advice; empty where all is well."""
    time: F64
    """(B,) time of the final state, s."""
    position: F64
    """(B, N, 3) centres, m."""
    orientation: F64
    """(B, N, 4) unit quaternions, scalar part first."""
    velocity: F64
    """(B, N, 3), m/s."""
    angular_velocity: F64
    """(B, N, 3) in the world frame, rad/s."""
    present: NDArray[np.bool_]
    """(B, N) which balls are there at the end; all, unless the scene has inflows or outlets."""
    left_at: F64
    """(B, N, 3) where a ball that left was then, m; NaN for the others."""
    monitors: Mapping[str, F64]
    """Totals (B,): penetration, energies (J), counts of what the solver had to do."""
    parameters: Mapping[str, NDArray[Any]]
    """The overrides, as arrays."""
    impacts: Mapping[str, NDArray[Any]]
    """The tables of impacts end to end, with the column `case`; empty unless they were asked for."""
    events: Mapping[str, NDArray[Any]]
    """Balls that entered (`kind` 1) or left (0), with the column `case`; empty without inflows and outlets."""
    transitions: Mapping[str, NDArray[Any]]
    """The tables of transitions end to end, with the column `case`; with `impacts`, and of method `events` alone."""
    frame_time: F64
    """(T,) times of the frames, s; T is 0 unless they were asked for."""
    frames: Mapping[str, F64]
    """position (B, T, N, 3), velocity, angular_velocity, orientation (B, T, N, 4) of the frames."""
    wall_s: float
    """Seconds that the batch took."""
    threads: int
    _scenes: Sequence[Scene]
    _overrides: Overrides | None

    def __len__(self) -> int:
        return len(self.outcome)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(B,) which cases reached their end, or were stopped by the condition."""
        return np.isin(self.outcome, ENDED)

    @property
    def per_second(self) -> float:
        """Cases a second, over the seconds that the batch took."""
        return len(self) / self.wall_s if self.wall_s > 0 else 0.0

    def __getitem__(self, name: str) -> Body:
        return Body.of(self, name)

    def _of_ball(self, name: str, index: int) -> Any:
        return getattr(self, name)[:, index]

    def scene(self, case: int) -> Scene:
        """The scene of one case, to simulate it again with everything recorded: the same bits.

        `carom.simulate(batch.scene(7)).view()`; -1 is the last case, and one that there is not raises `IndexError`.
        """
        if not -len(self) <= case < len(self):
            raise IndexError(f"no case {case}; there are {len(self)}, numbered from 0")
        case = range(len(self))[case]
        return self._scenes[case] if self._overrides is None else self._overrides.scene(case)

    def to_pandas(self) -> pandas.DataFrame:
        """One row per case: parameters, outcome, monitors, and the final state of each ball."""
        pandas = extra("pandas", "to_pandas needs pandas", "interop")
        rows = pandas.RangeIndex(len(self), name="case")
        return pandas.DataFrame(dict(self.columns()), index=rows)

    def columns(self) -> dict[str, NDArray[Any]]:
        """The same table as arrays (B,), by name: `parameter cue.velocity.x`, `outcome`, `penetration_max` ..., and
        `cue.velocity.x` of the final state.
        """
        found: dict[str, NDArray[Any]] = {}
        for key, values in self.parameters.items():
            ends = [f".{name}" for name in self.names] if values.ndim > 1 and key in WIDTHS else [""]
            width = WIDTHS.get(key.rpartition(".")[2], 3)
            if values.ndim > 1 and width:
                ends = [f"{end}.{x}" for end in ends for x in ("wxyz" if width == 4 else "xyz")]
            flat = values.reshape(len(self), -1)
            found |= {f"parameter {key}{end}": flat[:, i] for i, end in enumerate(ends)}
        found |= {"outcome": self.outcome, "message": self.message, "time": self.time, **self.monitors}
        for quantity, width in KINEMATICS.items():
            letters = "wxyz" if width == 4 else "xyz"
            values = getattr(self, quantity)
            for body, name in enumerate(self.names):
                found |= {f"{name}.{quantity}.{x}": values[:, body, i] for i, x in enumerate(letters)}
        return found

    def __repr__(self) -> str:
        failed = len(self) - int(self.ok.sum())
        what = f"{failed} failed" if failed else "all done"
        return (
            f"<carom.Batch: {counted(len(self), 'case')} of {counted(len(self.names), 'ball')}, {what};"
            f" {self.wall_s:.3g} s on {counted(self.threads, 'thread')}, {self.per_second:.3g} a second>"
        )

    def _repr_html_(self) -> str:
        return of_batch(self)


def usable_processors() -> int:
    """Processors that this process may use; all of the machine where the system (macOS, Windows) does not tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _threads(given: int | None) -> int:
    if given is None:
        return usable_processors()
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise CaromError(f"simulate_batch: threads must be a whole number from 1 on, found {given!r}")
    return given


def _advise(scene: Scene) -> None:
    for advice in scene.validate():
        warnings.warn(str(advice), CaromWarning, stacklevel=4)
