"""`carom sweep`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carom.cli.options import Force, Json, Quiet, listed, option, refuse_existing
from carom.cli.output import DONE, NOT_CONVERGED, emit, guarded, note
from carom.cli.progress import LineBar, going_on, left
from carom.errors import CaromError, counted

if TYPE_CHECKING:
    from carom.many.fit import Fit
    from carom.many.sweep import Progress, Sweep

#: Failures that are printed.
SHOWN = 10

Workers = Annotated[
    int | None,
    option(
        "--workers",
        "N",
        "Processes on this machine. Default: one per processor. 0: run in this process.",
        min=0,
    ),
]
Scheduler = Annotated[
    str | None, option("--scheduler", "ADDRESS", "Address of a running dask scheduler: tcp://host:8786.")
]
RetryFailed = Annotated[bool, option("--retry-failed", "Run failed cases again.")]
MeasureFile = Annotated[
    str | None,
    option(
        "--measure",
        "FILE.py:FUNCTION",
        "Python function that takes the Result of a case and returns {name: number}.",
    ),
]
Plots = Annotated[
    bool | None,
    option("--plots/--no-plots", "Draw summary figures. Default: if matplotlib is installed."),
]


@guarded
def sweep(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)],
    out: Annotated[
        Path | None, option("-o", "--out", "DIR", "Folder of the study. Default: sweeps/STUDY.")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    measure: MeasureFile = None,
    plots: Plots = None,
    columns: Annotated[str | None, option("--columns", "A,B", "Columns for the figures and --csv.")] = None,
    csv: Annotated[Path | None, option("--csv", "FILE", "Also write the table as CSV.")] = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Run all cases of a study, on several processes or a cluster.

    Finished cases are not run again: after a crash the same command continues the study.

    Example: carom sweep break_study.toml -o break_study --workers 2
    """
    from carom.many.sweep import Study
    from carom.many.sweep import sweep as compute

    refuse_existing("--csv", csv, force)
    described = Study.from_toml(study, function(measure))
    described.check_columns(chosen := listed("--columns", columns))
    folder = out or Path("sweeps") / study.stem
    bar = _Bar() if not (quiet or as_json) else None
    with going_on(bar, f"what was computed is in {folder}"):
        found = compute(
            described,
            folder,
            workers=workers,
            scheduler=scheduler,
            retry_failed=retry_failed,
            progress=bar,
        )
    for name in chosen if found.ok.any() else ():
        found[name]  # of a measure, too: refused where it is not there
    files = [found.to_csv(csv, chosen)] if csv is not None else []
    files += figures(found, plots, columns=chosen) if found.ok.any() else []
    if as_json:
        emit({**found.summary, "files": [str(f) for f in files]})
    elif not quiet:
        _print(found, files)
    else:
        for line in _failed(found):
            note(line)
    return NOT_CONVERGED if found.failures else DONE


def figures(found: Sweep | Fit, wanted: bool | None, **options: Any) -> list[Path]:
    """Figures if they are wanted, by default if matplotlib is there."""
    if wanted is None:
        from importlib.util import find_spec

        wanted = find_spec("matplotlib") is not None
    return found.plot(**options) if wanted else []


def _print(found: Sweep, files: list[Path]) -> None:
    from carom.many.sweep.origin import listed

    facts = found.summary
    text = f"{counted(facts['done'], 'case')} done, {facts['failed']} failed"
    if facts["new"]:
        text += f"; {facts['new']} new in {facts['wall_s']:.3g} s, {facts['per_second']:.3g} a second"
    else:
        text += "; nothing was missing"
    print(text)
    if len(found.origins) > 1:
        print(f"  {listed(found.origins)}")
    for line in _failed(found):
        print(f"  {line}")
    print("\n".join(str(f) for f in [facts["table"], *files]))


def _failed(found: Sweep) -> Iterator[str]:
    """A line for each case that failed, up to `SHOWN` of them."""
    for row in found.failures[:SHOWN]:
        values = ", ".join(f"{name} = {row[name]:.6g}" for name in found.parameters)
        yield f"case {row['case']} ({values}): {row['outcome']}: {row['message']}"
    if (more := len(found.failures) - SHOWN) > 0:
        yield f"and {more} more, in {found.path / 'sweep.json'}"


class _Bar(LineBar):
    def __call__(self, now: Progress) -> None:
        told = f"{now.done}/{now.cases}  {now.failed} failed  {now.per_second:.3g}/s  ETA {left(now.eta_s)}"
        self.tell(now.done, now.cases, told, now.wall_s)


def function(named: str | None) -> Callable[[Any], dict[str, float]] | None:
    """The function of `FILE.py:FUNCTION`."""
    if named is None:
        return None
    import runpy  # noqa: TID251 the function that the user names with --measure

    file, _, name = named.rpartition(":")
    if not file or not Path(file).is_file():
        raise CaromError(f"--measure {named}: write FILE.py:FUNCTION with a file that is there")
    try:
        found = runpy.run_path(file).get(name)
    except Exception as error:
        raise CaromError(f"--measure {named}: {type(error).__name__}: {error}") from error
    if not callable(found):
        raise CaromError(f"--measure {named}: {file} has no function {name}")
    return found  # type: ignore[no-any-return]
