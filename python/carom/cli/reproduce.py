"""`carom reproduce`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from carom.cli.options import Formats, Json, Quiet, can_draw, figure_formats, option
from carom.cli.output import (
    CRASH,
    DONE,
    NOT_CONVERGED,
    emit,
    guarded,
    note,
    seconds,
)
from carom.cli.progress import counting_bar
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
    format_: Formats = "png",
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
    drawn = (figures if figures is not None else not quick or docs is not None) and can_draw()
    if docs is not None and (quick or chosen != _chosen(["all"]) or not drawn):
        raise CaromError(
            "--docs writes the page of all examples with figures; leave out --quick, --no-figures and names"
        )
    # Processes all start at once; two for an example are as many as have work (its heavy parts, or its figures).
    workers = jobs or min(usable_processors(), 2 * len(chosen))
    with folder.replacing(out, force=force) as directory:
        with counting_bar(not (quiet or as_json)) as progress:
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
    formats = figure_formats(text)
    if docs is not None:
        formats.append("svg")
    if not {"png", "svg"} & set(formats):
        formats.append("png")
    return tuple(dict.fromkeys(formats))


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
