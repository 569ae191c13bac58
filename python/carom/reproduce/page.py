"""The page as Markdown: what agrees, what the paper has wrong, what falls short. `web.py` makes HTML of the same text."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from carom import _core
from carom.reproduce.document import Counts, Example, Figure, Row, Verdict
from carom.reproduce.errata import ERRATA, Erratum
from carom.reproduce.runner import Failure, Report

TITLE = "The examples of the paper, reproduced"
#: A verdict is shown by a mark and a word, never by colour alone.
MARKS: Mapping[Verdict, str] = {"ok": "✓ ok", "paper in error": "✎ paper in error", "short": "✗ short"}
#: Significant digits of a number: enough to see its tolerance, at least and at most these.
FEWEST, MOST = 2, 10
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
#: A space at which no line ends.
_HARD = "\N{NO-BREAK SPACE}"
#: A space at which no line of the Markdown ends, and which is an ordinary one in the page.
_TIED = "\ue000"
_LINE = 100
_ERRATA = "Errors found in the paper"
_FAILURES = "What failed"


def markdown(report: Report, folder: str, facts: Mapping[str, str]) -> str:
    """The whole page. `folder` is where the figures are, seen from the page; `facts` are what is said at its end."""
    blocks = [f"# {TITLE}", *_introduction(report), _contents(report), _reading()]
    blocks += [*_failures(report), *_errata(report)]
    for example in report.examples:
        blocks += _section(example, report.files.get(example.id, {}), folder)
    blocks += [
        *_options(report.examples),
        f"## {_SOURCE}",
        _source(),
        "## This page",
        table(("", ""), facts.items()),
    ]
    return "\n\n".join(map(wrapped, blocks)) + "\n"


def wrapped(block: str) -> str:
    """A paragraph or a list in lines of at most 100 characters; tables, headings, pictures and code as they are."""
    if re.match(r"[#|!<`]|    ", block):
        return block
    # Code stays on one line, and no line begins with what would make it an item of a list.
    tied = re.sub(r"`[^`]+`", lambda code: re.sub(r"\s", _TIED, code[0]), block)
    filled = []
    for item in re.split(r"\n(?=- |\d+\. )", tied):
        begin = re.match(r"(?:- |\d+\. )?", item)
        text = re.sub(r"[ \n]+(?=(?:[-+*#>]|\d+[.)])[ \n])", _TIED, re.sub(r"[ \n]+", " ", item))
        indent = " " * len(begin[0]) if begin else ""
        lines = textwrap.wrap(
            text, _LINE, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
        filled += lines
    return "\n".join(filled).replace(_TIED, " ")


def heading(example: Example) -> str:
    """The heading of an example."""
    return f"{label(example.id)}{':' if example.id.isalpha() else ''} {example.title}"


def label(name: str) -> str:
    """`5.1`, `Appendix A`."""
    return f"Appendix {name}" if name.isalpha() else name


def anchor(title: str) -> str:
    """What a heading is linked by: as GitHub and MyST make it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def table(head: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] = ()) -> str:
    """A table; the columns `right` are flush right."""
    ends = set(right)
    ruler = ["---:" if k in ends else "---" for k in range(len(head))]
    cells = [[str(cell).replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in [list(head), ruler, *cells])


def number(value: float | str | None, tolerance: float | None = None) -> str:
    """A number with the digits that its tolerance makes worth reading; what is none is a dash."""
    if value is None:
        return "–"
    if isinstance(value, str) or value == 0:
        return value if isinstance(value, str) else "0"  # not -0
    digits = 7
    if tolerance:
        digits = math.floor(math.log10(abs(value) / tolerance)) + 2
    return format(value, f".{min(MOST, max(FEWEST, digits))}g") if value != int(value) else f"{value:.10g}"


def _introduction(report: Report) -> list[str]:
    count, rest = report.verdicts, ""
    told = [f"{count['ok']} agree{'s' * (count['ok'] == 1)}"]
    if count["paper in error"]:
        shown = _shown(report)
        errors = sum(1 for _, rows in shown if rows)
        why = f"{errors} errors of the paper" if errors > 1 else "one error of the paper"
        if len(shown) > errors:
            rest = f" Of the {len(shown)} errors listed below {len(shown) - errors} change no number here."
        some = count["paper in error"]
        verbs = ("agrees", "differs") if some == 1 else ("agree", "differ")
        told.append(
            f"{some} {verbs[0]} with the corrected theory and {verbs[1]} from the paper's because of {why}"
        )
    told.append(f"**{count['short']} short**" if count["short"] else "none falls short")
    quick = (
        " This is the quick form: the same tables and tolerances, from fewer points."
        if report.context.quick
        else ""
    )
    return [
        "This page lists every number that the paper prints beside theory and Carom's result. The paper is *Simulation of"
        " impacts between spherical rigid bodies with frictional effects*. Carom ran all of its examples anew.",
        f"{len(report.rows)} numbers: {', '.join(told)}.{rest}{quick}",
    ]


def _contents(report: Report) -> str:
    rows = []
    for example in report.examples:
        verdicts = [row.verdict for row in example.rows]
        link = f"[{heading(example)}](#{anchor(heading(example))})"
        counts = [str(verdicts.count(verdict)) for verdict in MARKS]
        rows.append((link, *counts, str(len(example.figures))))
    ran = {example.id for example in report.examples}
    for name in dict.fromkeys(failure.example for failure in report.failures if failure.example not in ran):
        rows.append((f"[{label(name)}](#{anchor(_FAILURES)}) ⚠ failed", *["–"] * (len(MARKS) + 1)))
    total = [str(report.verdicts[verdict]) for verdict in MARKS]
    rows.append(("all", *total, str(sum(len(example.figures) for example in report.examples))))
    return table(("example", *MARKS.values(), "figures"), rows, right=range(1, 5))


def _failures(report: Report) -> list[str]:
    if not report.failures:
        return []
    told = [f"- ⚠ **{label(f.example)}** failed: {escaped(f.error)}{_place(f)}" for f in report.failures]
    return [f"## {_FAILURES}", "\n".join(told)]


def _place(failure: Failure) -> str:
    return f" ({escaped(failure.place)})" if failure.place else ""


_SOURCE = "Authors and journal of the paper"


def _source() -> str:
    """What could be found out about where the paper was published, and what could not."""
    return (
        "The manuscript that Carom follows names neither authors nor journal. Searches for its title in public code,"
        " documentation and web pages (November 2026) found neither a DOI nor a published version. So Carom cites the"
        " title alone (`carom cite`, `CITATION.cff`). The text says that its computations ran in the code Oofelie. It"
        " builds on two works of Cosimo et al. and on one of Sánchez et al. Whether these are its authors could not be"
        " verified. If you know the publication, please open an issue."
    )


def _reading() -> str:
    return (
        "*Paper*: what is printed there. *Analytic*: a closed form, corrected where the paper errs. The value that Carom's"
        " is compared with is **bold**. *Difference* is Carom minus that value. *Tolerance* is the largest difference that"
        " is admitted; the letter beside it says under the table where it comes from. Verdicts: ✓ ok; ✎ paper in error,"
        " Carom agrees with the corrected value; ✗ short, the difference is greater than the tolerance."
    )


def _errata(report: Report) -> list[str]:
    """One entry for each error of the paper, and a table of all rows that show one."""
    shown = _shown(report)
    if not shown:
        return []
    ran = {example.id: heading(example) for example in report.examples}
    told, lines = [], []
    for k, (error, rows) in enumerate(shown, 1):
        place = f" ([{label(error.example)}](#{anchor(ran[error.example])}))" if error.example in ran else ""
        numbers = f" It shows in {len(rows)} number{'s' * (len(rows) != 1)} below." if rows else ""
        told.append(f"{k}. **{error.where[0].upper()}{error.where[1:]}**{place}: {error.told}{numbers}")
        for row in rows:
            values = (_quantity(value, row) for value in (row.paper, row.analytic, row.carom))
            lines.append((str(k), label(row.example), row.quantity, *values))
    blocks = [f"## {_ERRATA}", "\n".join(told)]
    if lines:
        head = ("error", "example", "quantity", "paper", "corrected", "Carom")
        blocks.append(table(head, lines, right=(3, 4, 5)))
    return [*blocks, "Slips of print in the equations of the method are listed in Appendix A."]


def _shown(report: Report) -> list[tuple[Erratum, list[Row]]]:
    """The errors that belong to an example of the report or are shown by a row of it, in the paper's order."""
    grouped: dict[str, list[Row]] = {}
    unnamed: list[tuple[Erratum, list[Row]]] = []
    for row in report.rows:
        if row.paper_in_error and row.erratum:
            grouped.setdefault(row.erratum, []).append(row)
        elif row.paper_in_error:
            unnamed.append((Erratum("", row.quantity, row.example, f"{row.note.rstrip('.')}."), [row]))
    ran = {example.id for example in report.examples}
    listed = [(error, grouped.get(error.key, [])) for error in ERRATA]
    return [(error, rows) for error, rows in listed if rows or error.example in ran] + unnamed


def _quantity(value: float | str | None, row: Row) -> str:
    return number(value, row.tolerance) + (
        f" {row.unit}" if _has_unit(row) and not isinstance(value, str) else ""
    )


def _has_unit(row: Row) -> bool:
    return row.unit not in ("", "1")


def _section(example: Example, files: Mapping[str, Sequence[str]], folder: str) -> list[str]:
    blocks = [f"## {heading(example)}", *example.texts]
    if example.scenarios:
        named = ", ".join(f"`scenarios/paper/{name}`" for name in example.scenarios)
        blocks.append(f"Scenarios: {named}.")
    if example.rows:
        blocks += _rows(example.rows)
    if example.counts:
        blocks += _counts(example.counts)
    for figure in example.figures:
        if figure.number in files:
            blocks += _figure(figure, files[figure.number], folder)
    return blocks


def _rows(rows: Sequence[Row]) -> list[str]:
    notes = list(dict.fromkeys(row.note for row in rows if row.note))
    origins = list(dict.fromkeys(row.origin for row in rows))
    lines = []
    for row in rows:
        mark = f"{_HARD}{str(notes.index(row.note) + 1).translate(SUPERSCRIPTS)}" if row.note else ""
        # What the paper prints stands there with all its digits.
        values = {
            "paper": number(_nothing(row.paper, row.tolerance)),
            "analytic": number(_nothing(row.analytic, row.tolerance), row.tolerance),
        }
        values[row.against] = f"**{values[row.against]}**"
        lines.append(
            (
                row.quantity + (f" ({row.unit})" if _has_unit(row) else "") + mark,
                values["paper"],
                values["analytic"],
                number(row.carom, row.tolerance),
                f"{row.difference + 0.0:.2g}",
                f"{row.tolerance:.2g}{_HARD}({_letter(origins.index(row.origin))})",
                MARKS[row.verdict],
            )
        )
    head = ("quantity", "paper", "analytic", "Carom", "difference", "tolerance", "verdict")
    blocks = [table(head, lines, right=range(1, 6))]
    blocks.append("Tolerances:")
    blocks.append("\n".join(f"- ({_letter(k)}) {origin}" for k, origin in enumerate(origins)))
    if notes:
        blocks.append("\n".join(f"{k}. {note}" for k, note in enumerate(notes, 1)))
    return blocks


def _nothing(value: float | str | None, tolerance: float) -> float | str | None:
    """Zero for what a formula gives by rounding where it means nothing, as sin(pi)."""
    return 0.0 if isinstance(value, float) and abs(value) < 1e-6 * tolerance else value


def _letter(k: int) -> str:
    return chr(ord("a") + k) if k < 26 else f"{_letter(k // 26 - 1)}{_letter(k % 26)}"


def _counts(counts: Sequence[Counts]) -> list[str]:
    lines = []
    for count in counts:
        cells = []
        for level in ("smooth", "position", "velocity", "line_search"):
            most, other = getattr(count, level)
            told = f"{most:g} / {other:g}" if level == "line_search" else f"{most:g} / {other:.2f}"
            cells.append(told.replace(" ", _HARD))
            printed = count.paper.get(level)
            if printed is not None:
                theirs = f"(paper {' / '.join(number(value) for value in printed)})"
                cells[-1] += " " + theirs.replace(" ", _HARD)
        numbers = (str(count.unconverged), str(count.fallbacks))
        lines.append((count.case, f"{count.step:g}", f"{count.tolerance:g}", *cells, *numbers))
    head = (
        "run",
        "h (s)",
        "tolerance",
        "smooth",
        "position",
        "velocity",
        "line searches",
        "unconverged",
        "fallbacks",
    )
    return [
        "Iterations, largest / mean over the steps; line searches in all, position / velocity level:",
        table(head, lines, right=range(1, 9)),
    ]


def _figure(figure: Figure, files: Sequence[str], folder: str) -> list[str]:
    shown = shown_file(files)
    others = [file for file in files if file != shown]
    links = ", ".join(f"[{_kind(file)}]({folder}/{file})" for file in others)
    curves = ", ".join(curve.label for curve in figure.curves)
    # A figure without a number is not in the paper; "17b-detail" is of the paper's figure 17b.
    numbered = figure.number[0].isdigit()
    name = f"Figure {figure.number.replace('-', ', ')}" if numbered else "Not in the paper"
    alt = f"{name}: {figure.title}. {figure.ylabel} over {figure.xlabel}: {curves}"
    caption = f"**{name}.** {figure.title}. {figure.caption}"
    return [f"![{escaped(alt)}]({folder}/{shown})", caption + (f" ({links})" if links else "")]


def shown_file(files: Sequence[str]) -> str:
    """The file of a figure that a browser shows best."""
    return min(files, key=lambda file: ("svg", "png", "pdf", "csv").index(file.rsplit(".", 1)[-1]))


def _kind(file: str) -> str:
    end = file.rsplit(".", 1)[-1]
    return "numbers" if end == "csv" else end.upper()


def _options(examples: Sequence[Example]) -> list[str]:
    """What the runs set, and the defaults of everything else."""
    lines = [
        (f"{example.id} {name}", assigned(run))
        for example in examples
        for name, run in example.options.items()
    ]
    return [
        "## Options",
        table(("runs", "set"), lines),
        'The scenarios with contacts set `position_friction = "paper"`, the position level as printed.',
        f"What a run does not set has its default: {assigned(_core.defaults())}.",
    ]


def assigned(options: Mapping[str, Any]) -> str:
    """`key = value` of each option, as in a scenario file."""
    return ", ".join(f"`{key} = {_toml(value)}`" for key, value in options.items())


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return (
        f'"{value}"' if isinstance(value, str) else f"{value:.4g}" if isinstance(value, float) else str(value)
    )


def escaped(text: str) -> str:
    """Text that Markdown shall show as it is."""
    return re.sub(r"([\\`*_\[\]<>|#])", r"\\\1", text)
