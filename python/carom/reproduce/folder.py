"""The directory that `carom reproduce` writes: whole or not at all, and nothing of anybody else is deleted.

index.html    the page
report.md     the same as Markdown
report.json   the same as JSON, and the list of the files
figures/      every figure in the formats asked for, and its numbers as CSV
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from carom import __version__
from carom.errors import CaromError
from carom.files import unwritable, write_whole
from carom.reproduce.document import to_json
from carom.reproduce.html import html_page
from carom.reproduce.page import markdown
from carom.reproduce.runner import Report
from carom.run.summary import versions

FIGURES = "figures"
JSON = "report.json"
#: Where the page of the documentation has its figures.
DOCS_FIGURES = "paper"
#: By this a directory is known as one of ours.
MADE_BY = "carom reproduce"


@contextmanager
def replacing(path: Path, *, force: bool = False) -> Iterator[Path]:
    """A new directory beside `path` that takes its place at the end; if something is raised, all stays as it was.

    An earlier reproduction is replaced. Anything else is refused, or with `force` set aside under another name.
    """
    check(path, force=force)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent))
    except OSError as error:
        raise _unwritable(path, error) from error
    try:
        new.chmod(0o777 & ~_umask())  # mkdtemp lets nobody else read
        yield new
        _swap(new, path)
    finally:
        shutil.rmtree(new, ignore_errors=True)


def check(path: Path, *, force: bool) -> None:
    """Refuse a place that must not be replaced, before anything is computed."""
    if not path.exists() and not path.is_symlink():
        return
    if not path.is_dir():
        raise CaromError(f"{path} is a file; choose another directory with -o")
    strangers = _strangers(path)
    if strangers and not force:
        what = f"holds files that {MADE_BY} did not write ({strangers[0]})"
        raise CaromError(f"{path} {what}; choose another directory with -o, or give --force to set it aside")


def _strangers(path: Path) -> list[str]:
    """Files in a directory that its own `report.json` does not name."""
    present = sorted(f.relative_to(path).as_posix() for f in path.rglob("*") if not f.is_dir())
    try:
        about = json.loads((path / JSON).read_text(encoding="utf-8"))
        known = set(about["files"]) if about["made_by"] == MADE_BY else set()
    except (OSError, ValueError, KeyError, TypeError):
        known = set()
    return [name for name in present if name not in known]


def _swap(new: Path, path: Path) -> None:
    try:
        if not path.exists():
            new.rename(path)
            return
        ours = not _strangers(path)
        aside = new.with_suffix(".old") if ours else _free(path)
        path.rename(aside)
        try:
            new.rename(path)
        except OSError:
            aside.rename(path)
            raise
    except OSError as error:
        raise _unwritable(path, error) from error
    if ours:
        shutil.rmtree(aside, ignore_errors=True)


def _free(path: Path) -> Path:
    """The first name `<path>.before-<n>` that is not taken."""
    n = 1
    while (found := path.with_name(f"{path.name}.before-{n}")).exists():
        n += 1
    return found


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _unwritable(path: Path, error: OSError) -> CaromError:
    return CaromError(f"cannot write {path}: {unwritable(error)}")


def write(report: Report, directory: Path, command: str) -> dict[str, Any]:
    """Write page and report into `directory`, where the figures are already; returns what `report.json` holds."""
    text = markdown(report, FIGURES, facts(report, command))
    (directory / "index.html").write_text(html_page(text), encoding="utf-8")
    (directory / "report.md").write_text(text, encoding="utf-8")
    about = as_json(report)
    files = [f.relative_to(directory).as_posix() for f in directory.rglob("*") if not f.is_dir()]
    about["files"] = sorted([*files, JSON])
    told = json.dumps(about, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    (directory / JSON).write_text(told, encoding="utf-8")
    return about


def write_docs(report: Report, directory: Path, figures: Path, command: str) -> list[Path]:
    """`paper.md` for the documentation, with its figures as SVG beside it.

    It holds no date and no machine: a difference to the page of an earlier build is one of Carom.
    """
    target = directory / DOCS_FIGURES
    drawn = [f"{figure.name}.svg" for example in report.examples for figure in example.figures]
    for name in drawn:
        write_whole(target / name, (figures / name).read_bytes(), durable=False, parents=True)
    for old in target.glob("*_figure_*.svg"):
        if old.name not in drawn:
            old.unlink()
    only_svg = {
        example: {number: [n for n in names if n.endswith(".svg")] for number, names in found.items()}
        for example, found in report.files.items()
    }
    about = {"made by": f"`{command}`", "Carom": __version__}
    text = markdown(replace(report, files=only_svg), DOCS_FIGURES, about)
    page = directory / "paper.md"
    write_whole(page, text.encode(), durable=False)
    return [page, *(target / name for name in drawn)]


def as_json(report: Report) -> dict[str, Any]:
    """The report with plain values; what is drawn stands in the CSV files of the figures."""
    found: dict[str, Any] = {
        "made_by": MADE_BY,
        "quick": report.context.quick,
        "verdicts": {"ok": 0, "paper in error": 0, "short": 0} | dict(report.verdicts),
        "rows": to_json(report.rows),
        "examples": [],
        "failures": to_json(report.failures),
        "wall_s": report.wall_s,
        "jobs": report.jobs,
        "versions": versions(),
    }
    for example in report.examples:
        keys = ("id", "title", "texts", "counts", "options", "scenarios", "wall_s")
        about = {key: to_json(getattr(example, key)) for key in keys}
        names = report.files.get(example.id, {})
        about["figures"] = [
            {"number": f.number, "title": f.title, "caption": f.caption}
            | {"files": [f"{FIGURES}/{name}" for name in names.get(f.number, [])]}
            for f in example.figures
        ]
        found["examples"].append(about)
    return found


def facts(report: Report, command: str) -> Mapping[str, str]:
    """What is said at the end of the page: made by what, when, on what, in which time."""
    about = versions()
    processes = "1 process" if report.jobs == 1 else f"{report.jobs} processes beside each other"
    return {
        "made by": f"`{command}`",
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        "Carom": f"{about['carom']}, core {about['core']}",
        "Python, NumPy": f"{about['python']}, {about['numpy']}",
        "machine": f"{about['system']}, {about['architecture']}, {os.cpu_count()} CPUs",
        "time": f"{report.wall_s:.3g} s in {processes}; "
        + ", ".join(f"{example.id}: {example.wall_s:.2g} s" for example in report.examples),
    }
