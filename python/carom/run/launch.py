"""A run from its start, or from a checkpoint on, to its end: in memory, or in a run directory."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import carom
from carom import _core
from carom.errors import CaromError
from carom.result.directory import RunDir, now
from carom.result.record import Memory, Rows, Writer, clumps
from carom.result.record.walls import tables
from carom.result.run_json import continued
from carom.run import changes, checkpoint, restart, summary
from carom.run.allocator import release_early
from carom.run.loop import Ending, Sink, begin, drive
from carom.run.result import Result, load
from carom.run.sinks import Cadence, Checkpoints, Interrupt, Progress, Recorder, Shown
from carom.run.watch import Watch
from carom.scene.assembly.arrays import identify
from carom.scene.checks.areas import first_area_to_go
from carom.scene.checks.attachments import check_rods
from carom.scene.checks.rules import check_times
from carom.scene.plan import Plan
from carom.scene.scene import Scene

if TYPE_CHECKING:
    from carom._core import Simulation
    from carom.run.problems import Choice

OnProgress = Callable[[Progress], None]
LoadFunctions = Callable[..., Any] | Sequence[Callable[..., Any]]
"""One Python function that gives loads, or several."""


def launch(
    scene: Scene,
    create: Callable[[], RunDir] | None,
    *,
    stop: Interrupt,
    progress: OnProgress | None = None,
    source: str | None = None,
    keep: bool = True,
    problems: Choice | None = None,
    watch: Watch | None = None,
) -> Result:
    """Run a validated scene to its end, failure or interruption: the result says which. Without `create` it is in memory.

    The directory is created last, so that a wrong scene neither leaves one behind nor replaces an old one.
    `source` is the scenario file, for the summary. Without `keep` no checkpoints are written (nobody could
    use them), and the directory goes with the result.
    """
    run = Run(scene, source)
    if problems is not None:  # a run that is continued goes on keeping them
        run.about["save_problems"] = {"choice": problems.text, "form": problems.form}
    if create is None:
        return run.in_memory(stop, progress, watch)
    directory = create()
    with directory.writing():
        try:
            directory.write_scenario(run.scene.to_toml(resolved=True))
            run.about["scenario"]["identity"] = identify(run.model)
            writer = run.writer(directory)
            run.open_segment(writer)
            directory.write(run.about)
        except BaseException:
            directory.remove()
            raise
        run.in_directory(directory, writer, stop=stop, progress=progress, keep=keep, watch=watch)
    result = run.raised_by(load(directory.path))
    result.scene = run.scene
    if not keep:  # files that are still open go when they are closed
        weakref.finalize(result._segments, directory.remove)
    return result


def relaunch(
    directory: RunDir,
    options: Mapping[str, Any] | None = None,
    *,
    places: Mapping[str, str] | None = None,
    stop: Interrupt,
    progress: OnProgress | None = None,
    load_functions: LoadFunctions = (),
    wish: restart.Wish | None = None,
    watch: Watch | None = None,
) -> Result:
    """Continue the run in `directory` from its newest checkpoint, or from the start if it came to none.

    `options` are `until` and numerical options of the core; `places` says how messages call them. With a `wish` it
    goes on from another checkpoint.
    """
    wish = wish or restart.Wish()
    options = dict(options or {})
    changes.refuse_other_physics(options, places or {})
    old = Scene.from_toml(directory.scenario)
    changes.restore_functions(directory, old, load_functions)
    scene = old
    if options:
        scene = old.overridden(options, places or {})
    # `until` may be later than that of the run that began.
    scene._judged(lambda parts: [*check_times(parts), *check_rods(parts)], advice=lambda parts: ())
    run = Run(scene)
    if (gone := first_area_to_go(scene._walls(), scene.world.periodic)) is not None:
        gone.refuse(run.plan.until, "until")
    about = continued(directory)
    before = old.to_model() if options else run.model
    was = identify(before)
    if was not in changes.identities(about):
        raise CaromError(
            f"{directory.scenario} was changed since the run began, and a run continues only with the same scenario;"
            " start a new one with `carom run`"
        )
    if directory.is_finished(run.plan.steps) and wish.checkpoint == "newest":
        return load(directory.path)
    if identify(run.model) == was:
        changes.refuse_to_fail_again(directory, about)
    with directory.writing():
        about = continued(directory)
        saved = restart.choose(directory, about, wish)
        if saved is not None:
            reached = max(saved.time, (about.get("outcome") or {}).get("time") or 0.0)
            if run.plan.until < reached - 0.5 * run.plan.step:
                raise CaromError(
                    f"the run has reached t = {reached:g} s already; give --until (until=) a later time"
                )
            _restore(run.simulation, saved)
        aside = restart.put_aside(directory, saved, wish)
        if aside:
            directory.log("put aside", files=aside)
        for remark in [*restart.remarks(saved, wish), *restart.of_frames(_plan(old), run.plan)]:
            wish.tell(remark)
            directory.log("remark", message=remark)
        if wish.anew:  # those of the old results, which are put aside
            about["segments"] = []
        restart.end_killed(about["segments"], saved)
        changes.note_changes(directory, about, before, run.model, run.simulation.step)
        about.update(status="running", outcome=None)
        # The last two are of records that were kept in memory.
        for of_the_old in ("summary", "finished", "bare_end", "restored"):
            about.pop(of_the_old, None)
        run.about = about
        writer = run.writer(directory, saved.rows if saved else Rows())
        run.open_segment(writer)
        # Before the scenario: run.json knows the identity of the old one and of the new.
        directory.write(about)
        if options:
            directory.write_scenario(run.scene.to_toml(resolved=True))
        run.in_directory(directory, writer, stop=stop, progress=progress, keep=True, watch=watch)
    return run.raised_by(load(directory.path))


def _restore(simulation: Simulation, saved: checkpoint.Checkpoint) -> None:
    try:
        simulation.restore(dict(saved.state))
    except _core.ModelError as error:  # the state of another version may be made otherwise
        raise CaromError(f"the checkpoint of step {saved.step} does not fit this Carom: {error}") from error


def _plan(scene: Scene) -> Plan:
    assert scene.run.until is not None
    return Plan.of(scene.run.until, scene.run.step, scene.record.every, scene.record.contacts)


class Run:
    """A scene in the core with the plan of its run, and what `run.json` says of it; the scene is a copy of its own."""

    def __init__(self, scene: Scene, source: str | None = None) -> None:
        if scene.run.until is None:
            raise CaromError(
                "the scenario does not say how long to simulate; set `until` in [run], or pass until=..."
            )
        self.model = scene.to_model()
        release_early(len(self.model["radius"]))
        self.simulation = begin(self.model)
        self.error: Exception | None = None
        self.plan = _plan(scene)
        # The frames are thinned once and for all: a run that is extended keeps its grid.
        self.scene = scene.resolved()
        self.scene.record.every = self.plan.every
        self.names, self.wall_names = self.scene.names, self.scene.wall_names
        variant: dict[str, Any] = {}
        if scene.parameters:
            variant = {"case": scene.case, "parameters": scene.parameters}
        if scene.study:
            variant["study"] = scene.study
        self.about: dict[str, Any] = {
            "format": 1,
            "status": "running",
            "outcome": None,
            "scenario": {
                "title": scene.title,
                "file": source and Path(source).name,
                **variant,
            },
            "seed": getattr(scene, "seed", None),
            "versions": dict(summary.versions()),
            "created": now(),
            "segments": [],
        }

    def in_memory(self, stop: Interrupt, progress: OnProgress | None, watch: Watch | None) -> Result:
        """The run and its result, without files."""
        self.plan.refuse_to_fill_memory(len(self.names))
        memory = Memory(**self.described())
        segment = {"from_step": self.simulation.step, "started": now()}
        ending = self._drive(memory, [], stop, progress, watch)
        problem = self.conclude(ending, segment)
        return self.raised_by(Result(self.about, memory, scene=self.scene, problem=problem))

    def in_directory(
        self,
        directory: RunDir,
        writer: Writer,
        *,
        stop: Interrupt,
        progress: OnProgress | None,
        keep: bool,
        watch: Watch | None = None,
    ) -> None:
        """The run, into the segment of `writer`; `run.json` says how it ended."""
        simulation, plan, about = self.simulation, self.plan, self.about
        more: list[Sink] = []
        kept = about.get("save_problems")
        if kept is not None:
            from carom.run.problems import Choice, Problems

            more.append(Problems(directory, Choice.of(kept["choice"], kept["form"])))
        if keep:
            record = self.scene.record
            cadence = Cadence(record.checkpoint_steps, record.checkpoint_time, record.checkpoint_wall)
            more.append(Checkpoints(writer, directory, plan, cadence, about["scenario"]["identity"]))
        segment = about["segments"][-1]
        directory.log(
            "start", step=simulation.step, steps=plan.steps, segment=writer.path.name, **about["versions"]
        )
        try:
            ending = self._drive(writer, more, stop, progress, watch)
            writer.close()
            if len(writer.paths) > 1:
                segment["files"] = [path.name for path in writer.paths]
            problem = self.conclude(ending, segment)
            if problem is not None:
                from carom.problem.run_files import keep_failing

                keep_failing(directory, problem, about["outcome"])
            directory.write(about)
            directory.log("end", status=about["status"], outcome=about["outcome"])
        except BaseException as error:
            _note_failure(directory, writer, about, error)
            raise

    def _drive(
        self,
        store: Writer | Memory,
        more: Sequence[Sink],
        stop: Interrupt,
        progress: OnProgress | None,
        watch: Watch | None,
    ) -> Ending:
        sinks: list[Sink] = [Recorder(store, self.plan, len(self.names))]
        if progress is not None:
            sinks.append(Shown(progress, self.plan))
        if watch is not None:
            watch.begin(self.names, self.model, self.plan)
            sinks.append(watch)
        ending = drive(self.simulation, self.plan, [*sinks, *more], stop.__bool__)
        self.error = ending.error
        return ending

    def raised_by(self, result: Result) -> Result:
        """The result with what a load function raised, if that ended the run."""
        result._raised = self.error
        return result

    def described(self) -> dict[str, Any]:
        """What a record says of the run besides its rows: arguments of `Writer` and `Memory`."""
        scene, model, plan = self.scene, self.model, self.plan
        bodies = {
            "name": list(self.names),
            **{k: model[k] for k in ("radius", "mass", "inertia", "material")},
        }
        attributes: dict[str, Any] = {
            "title": scene.title or "",
            "carom_version": carom.__version__,
            "step": plan.step,
            "every": plan.every,
            "gravity": np.asarray(model["gravity"], dtype=np.float64),
            "start_step": self.simulation.step,
            **{key: model[key] for key in ("periodic", "periodic_origin") if key in model},
        }
        if "deformation" in model:
            attributes |= {f"box_{axis}": model["deformation"][axis] for axis in ("flow", "gradient")}
        return {
            "bodies": bodies,
            **tables(list(self.wall_names), model),
            **clumps.table(scene.clumps, model),
            "attributes": attributes,
            "leave_out": [("frames", "walls")] if scene.record.walls is False else [],
        }

    def writer(self, directory: RunDir, first: Rows | None = None) -> Writer:
        """The writer of the next segment, after the `first` rows."""
        plan = self.plan
        frames = plan.steps // plan.every + 2
        balls = len(self.names)
        return Writer(
            directory.next_segment(),
            **self.described(),
            first=first,
            expected=Rows(frames, 2 * balls * frames, plan.steps, 256, plan.steps, 4 * plan.steps),
            further=directory.next_segment,
        )

    def open_segment(self, writer: Writer) -> None:
        """List the part of the run that begins in `about`: one that is killed stays there (`restart.end_killed`)."""
        begun = {"file": writer.path.name, "from_step": self.simulation.step, "started": now()}
        self.about["segments"].append({**begun, "wall_s": 0.0, "core_s": 0.0})

    def conclude(self, ending: Ending, segment: dict[str, Any]) -> dict[str, Any] | None:
        """Say in `about` how the run ended; returns the contact problem that could not be solved, if there is one."""
        simulation, about, scene = self.simulation, self.about, self.scene
        failed = ending.kind not in ("done", "stopped", "interrupted")
        problem = simulation.failing_problem() if failed else None
        segment |= {"to_step": simulation.step, "wall_s": ending.wall_s, "core_s": ending.core_s}
        phases = summary.plain(simulation.phases())  # estimates of sampled steps: only their shares are known
        part = ending.core_s / (sum(phases.values()) or 1.0)
        segment["phases"] = {name: part * seconds for name, seconds in phases.items()}
        about["segments"] = [*(part for part in about["segments"] if part is not segment), segment]
        about["status"] = "failed" if failed else ending.kind
        about["outcome"] = summary.named(ending.outcome, self.names, self.wall_names, scene.joint_names)
        about["finished"] = now()
        about["summary"] = summary.summary(scene, simulation, self.plan, about)
        return problem


def _note_failure(directory: RunDir, writer: Writer, about: dict[str, Any], error: BaseException) -> None:
    """Leave a directory that does not claim to be more than it is, whatever the error; the error itself goes on."""
    try:
        writer.close()
    except Exception:
        writer.abandon()
    kind = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
    message = str(error) or type(error).__name__
    about.update(
        status=kind,
        outcome={"kind": "error" if kind == "failed" else kind, "advice": message},
        finished=now(),
    )
    directory.log("end", status=kind, message=message)
    try:
        directory.write(about)
    except CaromError:
        directory.write_in_place(about)
