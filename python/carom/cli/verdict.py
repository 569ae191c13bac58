"""What `carom check RUN` prints: the verdict on a run as a table, and whether it could be repeated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carom.cli.options import listed
from carom.cli.output import BAD_INPUT, DONE, NOT_CONVERGED, emit, fail, note
from carom.errors import counted
from carom.many.sheets import Sheet
from carom.text import TIE

if TYPE_CHECKING:
    from carom.audit import Report
    from carom.audit.report import Verdict
    from carom.audit.rerun import Rerun


def is_run(path: Path) -> bool:
    """Whether a path is that of a run, and not of a scenario: a directory, or a file of results in one."""
    return path.is_dir() or path.suffix == ".h5"


def judge(run: Path, *, rerun: bool, threads: str | None, as_json: bool) -> int:
    """Audit a run and say what was found; exit code 3 where a law is violated or a repetition differs."""
    from carom.audit import check

    counts = _threads(threads)
    if counts is None:
        return fail(
            f"--threads {threads}: expected numbers with commas; write for example --threads 1,2",
            BAD_INPUT,
            as_json,
        )
    report = check(run)
    again: Sequence[Rerun] = ()
    if rerun or threads is not None:
        from carom.audit.rerun import rerun as repeat

        again = repeat(run, counts)
    if as_json:
        document: dict[str, Any] = report.to_dict()
        if again:
            document["rerun"] = [r.to_dict() for r in again]
            document["ok"] = report.ok and all(r.ok for r in again)
        emit(document)
    else:
        show(report, again)
    return DONE if report.ok and all(r.ok for r in again) else NOT_CONVERGED


def show(report: Report, again: Sequence[Rerun]) -> None:
    """Print a report: first what the run says of itself, in whose light the table is to be read."""
    for warning in report.warnings:
        note(f"warning: {warning}")
    sheet(report).show()
    worst = report.findings
    words = f"{counted(len(worst), 'law')} violated, worst {worst[0]}" if worst else "no law is violated"
    words = f"{report.path}: {words}"
    partly = [v for v in report.verdicts.values() if v.unjudged and v.word != "nothing to judge"]
    if partly:  # the last line of a long list says that it is one
        words += f"; not judged, or not everywhere: {counted(len(partly), 'law')}, listed above"
    for verdict in partly:
        for unjudged in verdict.unjudged:
            print(
                f"not judged, {verdict.kind.name} ({unjudged.count}): {unjudged.why}; to judge it: {unjudged.cure}"
            )
    for r in again:
        found = f"every bit is the same ({counted(r.datasets, 'dataset')}, {r.numbers} numbers)"
        if r.first is not None:
            found = f"{len(r.differences)} of {counted(r.datasets, 'dataset')} differ; first {r.first}"
        print(f"run again on {counted(r.threads, 'thread')}: {found}")
    print(words)


def sheet(report: Report) -> Sheet:
    """The verdicts as a table, those without anything to judge left out."""
    head = ["law", "verdict", "judged", "violated", "worst", "bound", "where"]
    rows = [_row(v) for v in report.verdicts.values() if v.word != "nothing to judge"]
    if report.ok:  # a column of dashes is no help, and its room is
        for row in (head, *rows):
            del row[3]
    title = f"{report.title or report.path}: {report.method}, {counted(report.frames, 'frame')}"
    return Sheet(title, head, rows, left=(0, len(head) - 1))


def _row(verdict: Verdict) -> list[str]:
    numbers = ["-", "-", "-"]
    if (worst := verdict.worst) is not None:
        where = str(worst.place) if worst.value > 0 else "-"
        for pair in ("step ", " = ", " s"):
            where = where.replace(pair, pair.replace(" ", TIE))
        unit = "" if worst.unit == "1" else f" {worst.unit}"
        numbers = [f"{worst.value:.2g}{unit}".replace(" ", TIE), f"{worst.bound:.2g}", where]
    return [verdict.kind.name, verdict.word, str(verdict.judged), str(verdict.violations or "-"), *numbers]


def _threads(text: str | None) -> list[int] | None:
    """Numbers of threads, one if none are given; None where the text has none."""
    parts = listed("--threads", "1" if text is None else text)
    try:
        found = [int(part) for part in parts]
    except ValueError:
        return None
    return found if all(n > 0 for n in found) else None
