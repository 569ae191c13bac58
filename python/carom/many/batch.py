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
from pathlib import Path
from typing import Any

from carom.errors import CaromError, CaromWarning
from carom.many.batch_result import Batch
from carom.many.cases import Overrides, Values
from carom.many.threads import Runner
from carom.numeric import is_whole
from carom.run.simulate import scene_of
from carom.run.watch import Stop, Watch, check_function
from carom.scene.scene import Scene
from carom.scene.tables.model import SINGLE


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
    `carom.simulate`; those of `[record]` are refused. `threads` is by default the number of processors. With `frames` a
    frame is kept after each so many steps, and of the start, but none of an end that lies between; scenes of a list must
    have one step then. With `impacts` the tables of all impacts and transitions. `progress(done, cases)` is called ten times
    a second and at the end, in this thread; what it raises, and Ctrl-C, end the batch, with the cases that are done as
    `error.result`.

    `stop`, as in `carom.simulate`, ends a case with the outcome "stopped" where it returns True or a text: each case asks a
    copy of it, in the thread that computes it, after every `callback_every` steps (by default at about 1000 times). Frames
    after the end are NaN.

    A case that fails (`not_converged`, balls that overlap at its start, numbers that are unusable) says so in `outcome`
    and `message`, has NaN for a final state and stops no other. A wrong scene or wrong names raise `ScenarioError` or
    `CaromError`.
    """
    check_function("simulate_batch", "progress", progress, "done, cases: print(done)")
    refuse_records("simulate_batch", options)
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


def usable_processors() -> int:
    """Processors that this process may use; all of the machine where the system (macOS, Windows) does not tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _threads(given: int | None) -> int:
    if given is None:
        return usable_processors()
    if not is_whole(given) or given < 1:
        raise CaromError(f"simulate_batch: threads must be a whole number from 1 on, found {given!r}")
    return given


def refuse_records(caller: str, options: Mapping[str, Any]) -> None:
    """Raise for keys of `[record]`: what a batch keeps is said by arguments of its own."""
    for key in SINGLE["record"].model_fields:
        if key in options:
            frames = key == "every" and caller == "simulate_batch"
            cure = "frames=10 records every tenth step" if frames else "leave it out"
            raise CaromError(f"{caller}: {key} does nothing here; {cure}")


def _advise(scene: Scene) -> None:
    for advice in scene.validate():
        warnings.warn(str(advice), CaromWarning, stacklevel=4)
