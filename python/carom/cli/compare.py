"""`carom compare`: one scenario by several methods, side by side."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carom.cli.options import Case, Json, Quiet, Scenario, Set, scene
from carom.cli.output import DONE, NOT_CONVERGED, emit, fail, guarded, note, seconds
from carom.cli.progress import progress_bar
from carom.cli.tables import show_table

if TYPE_CHECKING:
    from carom.comparison import Comparison, MethodRun


@guarded
def compare(
    scenario: Scenario,
    methods: Annotated[
        str | None,
        typer.Option(
            "--methods",
            metavar="A,B",
            help="Methods, the first is the reference; choices follow a plus sign: moreau+projection, nsga+one-shot."
            " Default all.",
        ),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="TIME", help="Compare at this time (s) too; several with commas."),
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", help="Simulated time, s or with a unit.")
    ] = None,
    case: Case = None,
    set_: Set = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Keep the runs there; default nothing.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the runs in DIR.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Run a scenario by several methods in time and show how far apart they end, and what each costs.

    Example: carom compare three_balls.toml --methods nsga,moreau --at 0.02
    """
    from carom.comparison import compare as compare_methods
    from carom.run import CaromWarning

    described = scene(scenario, case, set_, until)
    for advice in described.validate():
        note(f"warning: {advice}")
    with progress_bar(not (quiet or as_json)) as bar, warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)  # told above
        found = compare_methods(
            described,
            _names(methods),
            at=_times(at or []),
            out=out,
            force=force,
            progress=bar,
        )
    if as_json:
        emit({"scenario": str(scenario), **found.to_dict()})
    elif not quiet:
        _show(found)
    stopped = [run for run in found if not run.ok]
    for run in stopped:
        fail(f"{run.name}: {run.outcome}", NOT_CONVERGED)
    return NOT_CONVERGED if stopped else DONE


def _names(methods: str | None) -> list[str] | None:
    return None if methods is None else [name.strip() for name in methods.split(",") if name.strip()]


def _times(given: list[str]) -> list[float]:
    try:
        return [float(t) for text in given for t in text.split(",")]
    except ValueError:
        raise typer.BadParameter(
            f"{','.join(given)!r} holds what is no time in s; write for example --at 0.1,0.2"
        ) from None


def _show(found: Comparison) -> None:
    """The table: a column for each method."""
    runs = list(found)
    rows: list[list[str]] = []

    def row(label: str, cell: Any) -> None:
        cells = [cell(run) for run in runs]
        if any(c != "-" for c in cells):
            rows.append([label, *cells])

    row("outcome", lambda r: "done" if r.ok else r.outcome.split(";")[0].split(" at ")[0])
    row("wall time", lambda r: seconds(r.numbers["wall_s"]))
    row("core time", lambda r: seconds(r.numbers["core_s"]))
    for key in ("steps", "substeps", "halvings"):
        row(key, lambda r, key=key: _count(r.numbers.get(key)))
    row("penetration (m)", lambda r: f"{max(0.0, r.numbers['penetration_max']):.1e}")
    row("final energy (J)", lambda r: f"{r.numbers['energy']['final']:.6g}")
    row("energy rise (J)", lambda r: f"{max(0.0, r.numbers['energy']['max_rise']):.1e}")
    for key, label in (
        ("impacts", "impulses of impacts"),
        ("unconverged", "unconverged"),
        ("fallbacks", "fallbacks"),
    ):
        row(label, lambda r, key=key: _count(r.numbers.get(key)))
    from carom.comparison import QUANTITIES

    for time in found.times:
        rows.append([f"off {runs[0].name} at {time:g} s, greatest and by eq. 45"])
        for quantity, unit in QUANTITIES.items():
            row(f"  {quantity.replace('_', ' ')} ({unit})", lambda r, q=quantity, t=time: _off(r, q, t))
    show_table(
        ["", *(run.name for run in runs)],
        rows,
        f"{found.title or 'comparison'}: h = {found.step:g} s to t = {found.times[-1]:g} s",
    )


def _count(value: Any) -> str:
    return f"{value:d}" if value else "-"


def _off(run: MethodRun, quantity: str, time: float) -> str:
    for d in run.differences:
        if d.quantity == quantity and abs(d.time - time) < 1e-12 + 1e-9 * time:
            return f"{d.greatest:.1e}  {d.relative:.0e}"
    return "-"
