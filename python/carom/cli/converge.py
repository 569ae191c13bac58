"""`carom converge`: the order of the error in the step."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carom.cli.options import (
    Case,
    Force,
    Json,
    Scenario,
    Set,
    Until,
    drawn,
    listed,
    number,
    option,
    refuse_figure,
    scene,
    settings,
    times,
)
from carom.cli.output import DONE, NOT_CONVERGED, emit, fail, guarded, note
from carom.cli.progress import keeping
from carom.many.sheets import of_convergence


@guarded
def converge(
    scenario: Scenario,
    steps: Annotated[str, option("--steps", "H,H,...", "Step sizes, s or with units.", show_default=False)],
    reference: Annotated[
        str,
        option(
            "--reference",
            "REF",
            "Exact solution: a finer step (with a unit, or s), method events, a run, or a TOML file with"
            " formulas of t.",
            show_default=False,
        ),
    ],
    quantities: Annotated[
        str | None,
        option(
            "--quantities",
            "Q,Q,...",
            "Quantities: position, velocity, angular_velocity, orientation. One sphere: velocity:cue. One component:"
            " velocity:cue:x. Default: the first three.",
        ),
    ] = None,
    until: Until = None,
    at: Annotated[
        list[str] | None,
        option(
            "--at",
            "TIME",
            "Measure the error at this time, s or with a unit, only; several with commas. Default: all steps.",
        ),
    ] = None,
    case: Case = None,
    set_: Set = None,
    plot: Annotated[
        Path | None,
        option("--plot", "FILE", "Also draw the errors: .png, .svg or .pdf, with the numbers as CSV."),
    ] = None,
    force: Force = False,
    threads: Annotated[
        int | None, option("--threads", "N", "Runs at once. Default: one per processor.", min=1)
    ] = None,
    quiet: Annotated[
        bool, option("--quiet", "-q", "Print the table only, without warnings and file names.")
    ] = False,
    as_json: Json = False,
) -> int:
    """Measure how the error of a scenario shrinks with the step.

    Runs the scenario with several steps, and fits the order of the error (eq. 45 of the paper).

    Example: carom converge 5.5_bernoulli.toml --steps 2e-3,1e-3,5e-4 --reference 1e-5
    """
    from carom.many.converge import converge as study_of
    from carom.show.plot.convergence import convergence

    if "step" in settings(set_ or []):
        raise typer.BadParameter("--set step: the steps are those of --steps; leave it out")
    described = scene(scenario, case, set_, until)
    refuse_figure(plot, force)
    with keeping("nothing is kept of the runs so far"):
        found = study_of(
            described,
            times("--steps", steps),
            number(reference),
            listed("--quantities", quantities) or None,
            until=described.run.until if until is not None else None,
            at=times("--at", *at or []),
            threads=threads,
        )
    files = drawn(convergence, found, plot)
    if as_json:
        emit({"scenario": str(scenario), **found.to_dict(), "files": files})
    else:
        of_convergence(found, scenario.name).show()
        if not quiet:
            for remark in found.remarks:
                note(f"warning: {remark}")
            print("\n".join(files))
    failed = [run for run in found.runs if not run.ok]
    for run in failed:
        why = (
            run.outcome.replace("_", " ") if run.outcome != "done" else f"{run.unconverged} problems unsolved"
        )
        fail(f"h = {run.h:g} s: {why} at t = {run.steps * run.h:g} s", NOT_CONVERGED)
    return NOT_CONVERGED if failed else DONE
