"""`carom compare`: one scenario by several methods, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from carom.cli.options import (
    Case,
    Json,
    Scenario,
    Set,
    Until,
    drawn,
    listed,
    option,
    refuse_existing,
    refuse_figure,
    scene,
    times,
)
from carom.cli.output import DONE, NOT_CONVERGED, emit, fail, guarded, note
from carom.cli.progress import keeping, progress_bar
from carom.many.sheets import of_comparison


@guarded
def compare(
    scenario: Scenario,
    methods: Annotated[
        str | None,
        option(
            "--methods",
            "A,B",
            "Methods; the first is the reference. Options follow a plus sign: moreau+projection, nsga+one-shot."
            " Default: all but events.",
        ),
    ] = None,
    laws: Annotated[
        str | None,
        option("--laws", "A,B", "Compare impact laws instead of methods; all: every law that fits."),
    ] = None,
    plot: Annotated[
        Path | None,
        option(
            "--plot",
            "FILE",
            "Also draw the velocities at the end, and of laws the impulses: .png, .svg or .pdf, and the numbers as CSV.",
        ),
    ] = None,
    at: Annotated[
        list[str] | None,
        option("--at", "TIME", "Also compare at this time, s or with a unit; several with commas."),
    ] = None,
    until: Until = None,
    case: Case = None,
    set_: Set = None,
    out: Annotated[
        Path | None, option("-o", "--out", "DIR", "Save the runs in DIR. Default: save nothing.")
    ] = None,
    force: Annotated[bool, option("--force", "Replace the runs in DIR, and the files of --plot.")] = False,
    quiet: Annotated[
        bool, option("--quiet", "-q", "Print the table only, without progress bar and notes.")
    ] = False,
    as_json: Json = False,
) -> int:
    """Run a scenario with several methods; compare results and cost.

    Example: carom compare three_balls.toml --methods nsga,moreau --at 0.02
    """
    from carom.many.compare import compare as compare_methods
    from carom.show.plot.comparison import IMPULSES, beside

    refuse_figure(plot, force)
    if plot is not None and laws is not None:
        refuse_existing("--plot", plot.with_name(f"{plot.stem}{IMPULSES}.csv"), force)
    described = scene(scenario, case, set_, until)
    kept = "nothing is kept without -o DIR" if out is None else f"the runs so far are in {out}"
    with keeping(kept), progress_bar(not (quiet or as_json)) as bar:
        found = compare_methods(
            described,
            listed("--methods", methods) or None,
            laws="all" if laws == "all" else listed("--laws", laws) or None,
            at=times("--at", *at or []),
            out=out,
            force=force,
            progress=bar,
        )
    drawn(beside, found, plot)
    if as_json:
        emit({"scenario": str(scenario), **found.to_dict()})
    else:
        of_comparison(found, scenario.name).show()
        for remark in () if quiet else found.remarks:
            note(f"note: {remark}")
    stopped = [run for run in found if not run.ok]
    for run in stopped:
        fail(f"{run.name}: {run.outcome}", NOT_CONVERGED)
    return NOT_CONVERGED if stopped else DONE
