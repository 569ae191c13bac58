"""`carom reproduce`."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carom.cli.options import Json, Quiet, option
from carom.cli.output import CRASH, DONE, NOT_CONVERGED, emit, guarded, note, seconds
from carom.errors import CaromError, did_you_mean
from carom.text import table

if TYPE_CHECKING:
    from carom.reproduce.runner import Report


@guarded
def reproduce(
    examples: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="EXAMPLE",
            help="Sections and appendices of the paper: 5.1 to 5.6, A, B, C; default all.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path, option("-o", "--out", "DIR", "Output directory; an earlier reproduction is replaced.")
    ] = Path("reproduction"),
    force: Annotated[bool, option("--force", "Rename DIR if it holds anything else.")] = False,
    quick: Annotated[
        bool, option("--quick", "Same tables and tolerances with fewer points and no figures.")
    ] = False,
    figures: Annotated[
        bool | None,
        option("--figures/--no-figures", "Draw the figures (needs matplotlib).", show_default=False),
    ] = None,
    format_: Annotated[
        str, option("--format", "FORMAT", "File formats: png, svg, pdf; several with commas.")
    ] = "png",
    jobs: Annotated[
        int | None, option("--jobs", "-j", "N", "Processes at a time. Default: one per CPU.", min=1)
    ] = None,
    docs: Annotated[
        Path | None,
        option("--docs", "DIR", "Also write DIR/paper.md and its figures, for Carom's documentation."),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Run the paper's examples and compare every number with theory.

    Writes a page (HTML and Markdown) with a table and the figures of each example. The exit code is 1 if a number misses
    its tolerance or an example fails.

    Example: carom reproduce 5.4 5.6 --format png,pdf
    """
    from carom.many.batch import usable_processors
    from carom.reproduce import folder
    from carom.reproduce.document import Context
    from carom.reproduce.runner import Drawing, run

    chosen = _chosen(examples or ["all"])
    formats = _formats(format_, docs)
    drawn = _drawable(figures if figures is not None else not quick or docs is not None)
    if docs is not None and (quick or chosen != _chosen(["all"]) or not drawn):
        raise CaromError(
            "--docs writes the page of all examples with figures; leave out --quick, --no-figures and names"
        )
    # Processes all start at once; two for an example are as many as have work (its heavy parts, or its figures).
    workers = jobs or min(usable_processors(), 2 * len(chosen))
    with _terminated_as_interrupted(), folder.replacing(out, force=force) as directory:
        with _bar(not (quiet or as_json)) as progress:
            drawing = Drawing(directory / folder.FIGURES, formats) if drawn else None
            report = run(chosen, Context(quick=quick), jobs=workers, drawing=drawing, progress=progress)
        about = folder.write(report, directory, _command(examples, quick))
        if docs is not None and report.failures:
            note(f"{docs} is left as it was: an example failed")
        elif docs is not None:
            folder.write_docs(report, docs, directory / folder.FIGURES, "make reproduce")
    for failure in report.failures:
        place = f" ({failure.place})" if failure.place else ""
        note(f"{failure.example} failed: {failure.error}{place}")
    if as_json:
        emit(about | {"directory": str(out)})
    elif not quiet:
        _print(report, out)
    return _code(report)


def _chosen(names: list[str]) -> list[str]:
    """The examples in the paper's order, each once."""
    from carom.reproduce.runner import MODULES

    known = list(MODULES)
    wanted = [name.upper() for name in names]
    for name, given in zip(wanted, names, strict=True):
        if name not in [*known, "ALL"]:
            raise CaromError(f"the paper has no example {given!r}; {did_you_mean(given, [*known, 'all'])}")
    return known if "ALL" in wanted else [name for name in known if name in wanted]


def _formats(text: str, docs: Path | None) -> tuple[str, ...]:
    """The formats asked for, and one that the page can show."""
    from carom.reproduce.figures import FORMATS

    formats = [part.strip() for part in text.split(",") if part.strip()]
    for given in formats:
        if given not in FORMATS:
            raise CaromError(f"--format: {given!r} is no format of a figure; {did_you_mean(given, FORMATS)}")
    if docs is not None:
        formats.append("svg")
    if not {"png", "svg"} & set(formats):
        formats.append("png")
    return tuple(dict.fromkeys(formats))


def _drawable(wanted: bool) -> bool:
    from importlib.util import find_spec

    if wanted and find_spec("matplotlib") is None:
        note("no figures: matplotlib is missing (pip install 'carom[plot]')")
        return False
    return wanted


def _command(examples: list[str] | None, quick: bool) -> str:
    return " ".join(["carom reproduce", *(examples or ["all"]), *(["--quick"] if quick else [])])


def _print(report: Report, out: Path) -> None:
    from carom.reproduce.page import MARKS

    lines = [("", *MARKS, "")]
    for example in report.examples:
        verdicts = [row.verdict for row in example.rows]
        counts = [str(verdicts.count(verdict)) for verdict in MARKS]
        lines.append((example.id, *counts, seconds(example.wall_s)))
    lines.append(("all", *(str(report.verdicts[verdict]) for verdict in MARKS), seconds(report.wall_s)))
    print(table(lines))
    for row in report.rows:
        if row.verdict == "short":
            beside = f"{row.reference:.8g} ({row.against}), admitted {row.tolerance:.2g}"
            print(f"short: {row.example} {row.quantity}: {row.carom:.8g} {row.unit} instead of {beside}")
    print(f"\n{out / 'index.html'}")


def _code(report: Report) -> int:
    if any(failure.not_converged for failure in report.failures):
        return NOT_CONVERGED
    return DONE if report.complete else CRASH


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM ends the work as Ctrl-C does: nothing half written stays, and the processes end too.

    SIGINT is set as well: a shell that starts a command in the background leaves it ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    old = {number: signal.signal(number, interrupt) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


@contextmanager
def _bar(wanted: bool) -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar of tasks, on a terminal only."""
    if not (wanted and sys.stderr.isatty()):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns: list[Any] = [BarColumn(bar_width=20), TaskProgressColumn(), TimeElapsedColumn()]
    with Progress(
        *columns, TextColumn("{task.description}"), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task("beginning", total=None)
        yield lambda done, known, what: bar.update(
            task, completed=done, total=known, description=f"{what} done"
        )
