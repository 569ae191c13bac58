"""`carom.simulate` and `carom.resume`: from a scene to its `Result`, in memory or in a run directory.

(The module is not called `simulate`: importing it would hide the function of that name in the package.)
"""

from __future__ import annotations

import copy
import inspect
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from carom.errors import CaromError, CaromWarning
from carom.result.directory import RunDir, temporary
from carom.result.remarks import remarks
from carom.run import restart
from carom.run.launch import LoadFunctions, OnProgress, launch, relaunch
from carom.run.result import Result
from carom.run.sinks import Interrupt
from carom.run.watch import Callback, Stop, Watch, check_function
from carom.scene.arguments import renamed
from carom.scene.scene import Scene

if TYPE_CHECKING:
    from carom.run.problems import Choice, Given
    from carom.scene.scene import Scene
    from carom.scene.tables.keywords import Options

PRINTS = "progress: print(progress.time)"


class RunFailed(CaromError):
    """A run that stopped before its end. `result` holds all up to the last good step, `result.outcome` says why.

    What a load function raised is its `__cause__`.
    """

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process gets the result as files have it: Python functions, which may be local ones, stay here."""
        made, arguments, fields = super().__reduce__()
        result = self.result
        if result.origin == "memory":
            result = copy.copy(result)
            result._ran = result._ran._without_functions()
        return made, arguments, fields | {"result": result}


@renamed
def simulate(
    scene: Scene | str | Path,
    *,
    out: str | Path | None = None,
    force: bool = False,
    progress: OnProgress | None = None,
    case: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    save_problems: Given | None = None,
    problem_form: str = "local",
    callback: Callback | None = None,
    stop: Stop | None = None,
    callback_every: int | None = None,
    **options: Unpack[Options],
) -> Result:
    """Simulate a scene, or the scenario file of that path, and return its result.

    Of a file with `[parameters]`, `case` and `parameters` choose a variant, as in `Scene.from_toml`.
    `options` are the keys of `[run]` and `[record]` of a scenario and override those of the scene, which is
    not changed: `carom.simulate(scene, until=1.0, step=1e-4, every=10)`. The result is kept in memory, and `Result.save`
    writes it; with `out` it is written to that run directory while the run goes on (an existing one is refused without
    `force`), and Ctrl-C and SIGTERM leave a checkpoint. `progress` is called about ten times a second. Ctrl-C stops between
    two steps, then raises `KeyboardInterrupt`, whose attribute `result` has all that was computed.

    `save_problems` stores contact problems in `problems/` of the run directory (docs/reference/problems.md; without `out` a
    temporary one), in
    `problem_form` "local" or "global": of one step, of several (`[100, 200]`, `range(200, 301, 50)`, `"100,200:300:50"`,
    `"all"`), or the hardest of the run (`"worst:10"`).

    `callback` and `stop` are functions of a `carom.run.watch.View` of the state, `view.time`, `view["cue"].position`. They
    are called after every `callback_every` steps, by default when a frame is kept. Where `stop` returns True or a text the
    run ends well, with outcome "stopped". If one raises, the run ends between two steps and the exception goes on, with
    all that was computed as its attribute `result`.

    Raises `ScenarioError` if the scene is wrong, `RunFailed` if a step could not be solved (with the result
    so far).
    """
    scene = scene_of(scene, case=case, parameters=parameters)
    if options:
        own = [p.name for p in inspect.signature(simulate).parameters.values() if p.kind is p.KEYWORD_ONLY]
        scene = scene.overridden(options, dict.fromkeys(options, "carom.simulate"), own)
    for advice in scene.validate():
        warnings.warn(str(advice), CaromWarning, stacklevel=3)
    choice = chosen(scene, save_problems, problem_form)
    watch = Watch.of(callback, stop, callback_every)
    check_function("simulate", "progress", progress, PRINTS)
    create: Callable[[], RunDir] | None = None if choice is None else temporary
    if out is not None:
        create = partial(RunDir.create, out, force=force)
    halt = Interrupt()
    with halt.listening(signal.SIGINT, *([] if out is None else [signal.SIGTERM])):
        result = launch(
            scene, create, stop=halt, progress=progress, keep=out is not None, problems=choice, watch=watch
        )
    with _passed_on(halt, result, kept=out is not None):
        if watch is not None:
            watch.raise_with(result)
        if choice is not None and not result.outcome.failed:
            from carom.run.problems import unmet

            if wrong := unmet(choice, result):
                warnings.warn(wrong, CaromWarning, stacklevel=3)
        return _judged(result, 4)


def chosen(scene: Scene, problems: Given | None, form: str, label: str = "save_problems") -> Choice | None:
    """The contact problems to keep of a run of `scene`; `label` is what messages call the argument."""
    if problems is None:
        return None
    if scene.run.method == "penalty":
        raise CaromError(f"{label}: method penalty solves no contact problems; take method nsga or moreau")
    from carom.run.problems import Choice

    return Choice.of(problems, form, label)


def scene_of(
    given: object,
    caller: str = "simulate",
    *,
    case: str | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Scene:
    """The scene, or that of the scenario file whose path is given, in the variant of `case` and `parameters`.

    `caller` is what a message calls the function.
    """
    variant = {key: value for key, value in (("case", case), ("parameters", parameters)) if value is not None}
    if isinstance(given, (str, Path)):
        return Scene.from_toml(given, **variant)  # type: ignore[arg-type]
    if variant and isinstance(given, Scene):
        verb = "choose" if len(variant) > 1 else "chooses"
        raise CaromError(
            f"{caller}: {' and '.join(variant)} {verb} a variant of a file, and a scene is one already;"
            " give the path of the file, or Scene.from_toml(path, case=..., parameters=...)"
        )
    if not isinstance(given, Scene):
        found = "nothing" if given is None else f"{type(given).__name__}"
        raise CaromError(
            f"{caller} takes a Scene or the path of a scenario file, found {found}; make one with carom.Scene(...)"
        )
    return given


def resume(
    run: str | Path,
    *,
    until: float | str | None = None,
    checkpoint: str = "newest",
    any_version: bool = False,
    progress: OnProgress | None = None,
    load_functions: LoadFunctions = (),
    callback: Callback | None = None,
    stop: Stop | None = None,
    callback_every: int | None = None,
    **options: Any,
) -> Result:
    """Continue a run that was interrupted or killed, bit for bit as if nothing had happened; `until` (s)
    extends it.

    A run that failed goes on from its last good state with other numerical `options`, as `tolerance=1e-7`; what
    describes the physics, and the step, cannot change within a run. A run that has reached its end already is
    returned as it is. If the newest checkpoint cannot be used, `checkpoint` may be "previous", or "start" to compute
    the run anew; with `any_version` one of another version of Carom is taken. A run whose scene has Python functions
    (`Scene.load_function`) needs them again: `load_functions`, in the order in which they were added. `callback`, `stop` and
    `callback_every` are those of `carom.simulate`.
    """
    watch = Watch.of(callback, stop, callback_every)
    check_function("resume", "progress", progress, PRINTS)
    halt = Interrupt()
    if until is not None:
        options["until"] = until
    with halt.listening(signal.SIGINT, signal.SIGTERM):
        result = relaunch(
            RunDir.open(run, "resume"),
            options,
            places=dict.fromkeys(options, "carom.resume"),
            stop=halt,
            watch=watch,
            progress=progress,
            load_functions=load_functions,
            wish=restart.Wish(
                checkpoint, any_version, tell=lambda text: warnings.warn(text, CaromWarning, stacklevel=4)
            ),
        )
    with _passed_on(halt, result):
        if watch is not None:
            watch.raise_with(result)
        return _judged(result, 3)


@contextmanager
def _passed_on(stop: Interrupt, result: Result, *, kept: bool = True) -> Iterator[None]:
    """The signal that was noted is raised when all is said of a result, also of a run that had ended: loops must hear it."""
    try:
        yield
    finally:
        cut = result.outcome.kind == "interrupted"
        if stop.signal == signal.SIGTERM:  # it now does what it would have done without us
            signal.raise_signal(signal.SIGTERM)
        if stop and (cut or stop.signal == signal.SIGINT):  # what a callback raised ends a run, too
            at = f"at t = {result.outcome.time:g} s" if cut else "as the run ended"
            gone = "the attribute `result` of this exception, and out=... would keep it"
            where = f"in {result.path}" if kept else gone
            pressed = KeyboardInterrupt(f"interrupted {at}; what was computed is {where}")
            pressed.result = result  # type: ignore[attr-defined]
            raise pressed


def _judged(result: Result, level: int) -> Result:
    outcome = result.outcome
    told = remarks(result)
    if not outcome.failed:
        for remark in told:
            warnings.warn(remark, CaromWarning, stacklevel=level)
    if outcome.ok or outcome.kind == "interrupted":
        return result
    stopped = RunFailed(str(outcome), result)
    for remark in told:  # behind the message: why there is no result comes before what may be wrong in it
        stopped.add_note(f"warning: {remark}")
    raise stopped from result._raised
