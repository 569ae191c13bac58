"""`carom run` and the summary at its end."""

from __future__ import annotations

import re
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from carom.cli.options import Case, Json, Quiet, Scenario, Set, Until, option, scene
from carom.cli.output import BAD_INPUT, DONE, INTERRUPTED, NOT_CONVERGED, emit, fail, guarded, note
from carom.cli.progress import progress_bar
from carom.errors import counted

if TYPE_CHECKING:
    from carom.run.result import Result


@guarded
def run(
    scenario: Scenario,
    out: Annotated[
        Path | None,
        option("-o", "--out", "DIR", "Run directory. Default: runs/SCENARIO-<n> or runs/SCENARIO-CASE-<n>."),
    ] = None,
    force: Annotated[bool, option("--force", "Replace the run in DIR.")] = False,
    until: Until = None,
    case: Case = None,
    set_: Set = None,
    save_problems: Annotated[
        str | None,
        option(
            "--save-problems",
            "STEPS",
            "Save the contact problems of these steps in DIR/problems: all, 100,200:300:50 (first:last:stride), or"
            " worst:10 (the 10 with most iterations).",
        ),
    ] = None,
    form: Annotated[str, option("--form", "local|global", "Form of the saved problems.")] = "local",
    on_nonconvergence: Annotated[
        str | None,
        option(
            "--on-nonconvergence",
            "stop|warn",
            "If a step cannot be solved: stop (default), or mark it in the results and go on.",
        ),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Simulate a scenario and save the results in a run directory.

    Ctrl-C writes a checkpoint and exits with code 130. `carom resume` then continues the run, bit for bit.

    Example: carom run break.toml -o runs/fine --set step=1e-4

    Example: carom run cut.toml --case "f=0.25" --set v=2.0

    Example: carom run corner.toml --save-problems 200:300:50,worst:5
    """
    from carom.result.directory import RunDir
    from carom.run.launch import launch
    from carom.run.simulate import chosen
    from carom.run.sinks import Interrupt

    if on_nonconvergence is not None:
        set_ = [*(set_ or []), f"run.on_nonconvergence={on_nonconvergence}"]
    described = scene(scenario, case, set_, until)
    for advice in described.validate():
        note(f"warning: {advice}")
    problems = chosen(described, save_problems, form, "--save-problems")

    def create() -> RunDir:
        return RunDir.create(out, force=force) if out is not None else RunDir.next(run_name(scenario, case))

    stop = Interrupt()
    with stop.listening(signal.SIGINT, signal.SIGTERM), progress_bar(not (quiet or as_json)) as bar:
        result = launch(described, create, stop=stop, progress=bar, source=str(scenario), problems=problems)
    if problems is not None and not quiet:
        from carom.problem.run_files import FOLDER, kept_files
        from carom.run.problems import unmet

        kept = kept_files(result.path)
        megabytes = sum(file.path.stat().st_size for file in kept) / 1e6
        if kept:
            note(f"{counted(len(kept), 'contact problem')} in {result.path / FOLDER}, {megabytes:.3g} MB")
        if wrong := unmet(problems, result, "--save-problems"):
            note(f"warning: {wrong}")
    code = report(result, quiet=quiet, as_json=as_json, scenario=str(scenario))
    return INTERRUPTED if stop else code


def run_name(scenario: Path, case: str | None) -> str:
    """What the run directory is called: after the file, and the case with letters that every file system takes."""
    if case is None:
        return scenario.stem
    return f"{scenario.stem}-" + re.sub(r"[^\w.=+-]+", "_", case, flags=re.ASCII)[:80]


def report(result: Result, *, quiet: bool, as_json: bool, scenario: str | None = None) -> int:
    """Print how a run ended; returns the exit code."""
    from carom.result.remarks import remarks

    summary = {**result.summary, "directory": str(result.path)}
    if scenario is not None:
        summary["scenario"] = scenario
    if as_json:
        emit({**summary, "warnings": remarks(result)})
    elif not quiet:
        from carom.cli.summary import text

        print(text(summary, result))
    else:
        if not result.outcome.failed:
            for told in remarks(result):
                note(f"warning: {told}")
        if summary.get("unconverged"):
            accepted = counted(summary["unconverged"], "sub-problem")
            note(f"{accepted} accepted unconverged: carom check {result.path}")
    outcome = result.outcome
    if outcome.ok:
        return DONE
    if outcome.kind == "interrupted":
        note(f"interrupted at t = {outcome.time:g} s; continue with: carom resume {result.path}")
        return INTERRUPTED
    if outcome.kind == "error":
        return fail(outcome.advice, BAD_INPUT)
    told = str(outcome)
    if outcome.kind == "not_converged":
        told += (
            f"; carom resume {result.path} --set KEY=VALUE goes on from there with other numerical options"
        )
    code = fail(told, NOT_CONVERGED)
    if quiet and not as_json:
        # Behind the message: why there is no result comes before what may be wrong in it.
        for remark in remarks(result):
            note(f"warning: {remark}")
    return code
