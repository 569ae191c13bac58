"""`carom fit`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from carom.cli.options import Json, Quiet
from carom.cli.output import DONE, NOT_CONVERGED, emit, guarded, note
from carom.cli.progress import LineBar, going_on
from carom.cli.sweep import (
    MeasureFile,
    Plots,
    RetryFailed,
    Scheduler,
    Workers,
    figures,
    function,
)
from carom.errors import counted

if TYPE_CHECKING:
    from carom.many.fit import Fit, State


@guarded
def fit(
    calibration: Annotated[Path, typer.Argument(metavar="FIT", help="Fit file (TOML).", show_default=False)],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder of the fit. Default: fits/FIT.")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    measure: MeasureFile = None,
    plots: Plots = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Fit parameters of a scenario to measured numbers and curves.

    Points that are there are not run again: after a crash the same command continues the fit.

    Example: carom fit restitution.toml -o restitution --workers 2
    """
    from carom.many.fit import fit as compute

    folder = out or Path("fits") / calibration.stem
    bar = _Bar() if not (quiet or as_json) else None
    with going_on(bar, f"the points so far are in {folder}"):
        found = compute(
            calibration,
            folder,
            workers=workers,
            scheduler=scheduler,
            retry_failed=retry_failed,
            measure=function(measure),
            progress=bar,
        )
    files = [found.path / "fit.json", *figures(found, plots)]
    if as_json:
        emit({**found.summary, "files": [str(f) for f in files]})
    elif not quiet:
        _print(found, files)
    elif not found.converged:
        for remark in found.remarks:
            note(remark)
    return DONE if found.converged else NOT_CONVERGED


def _print(found: Fit, files: list[Path]) -> None:
    facts = found.summary
    width = max(map(len, found.best))
    for name, value in found.best.items():
        ends = found.interval[name]
        told = f"95 %: {ends[0]:.5g} to {ends[1]:.5g}" if ends else "no interval"
        print(f"{name.ljust(width)}  {value:.6g}  ({told})")
    print(
        f"chi squared {facts['chi2']:.4g} with {counted(facts['degrees_of_freedom'], 'degree')} of freedom;"
        f" {counted(facts['points'], 'point')}, {counted(facts['runs'], 'run')}"
    )
    print(f"intervals by {facts['interval_by']}")
    if found.step_shift is not None:
        moves = (f"{name} by {by:.2g}" for name, by in found.step_shift.items() if by is not None)
        print(f"about half the step moves {', '.join(moves) or 'what is not determined'}")
    for remark in found.remarks:
        print(f"  {remark}")
    print("\n".join(map(str, files)))


class _Bar(LineBar):
    def __call__(self, now: State) -> None:
        told = f"{counted(now.points, 'point')}  {now.failed} failed  least chi squared {now.best:.4g}"
        self.tell(now.points, now.most, told, now.wall_s)
