"""Tables as CSV: units in the headings, numbers as the shortest text that reads back as the same bits."""

from __future__ import annotations

import csv
from pathlib import Path

from carom.export.atomic import whole_file
from carom.export.frames import Selection
from carom.export.tables import Sheet, written


def write(selection: Selection, directory: Path) -> list[Path]:
    """`frames.csv` and a file for every other table that has rows."""
    return written(selection, directory, "csv", _write, _is_same)


def _write(sheet: Sheet, path: Path) -> None:
    with whole_file(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_headings(sheet))
        for piece in sheet.pieces():
            writer.writerows(zip(*(piece[name].tolist() for name in sheet.units), strict=True))


def _headings(sheet: Sheet) -> list[str]:
    return [name if unit in ("1", "") else f"{name} ({unit})" for name, unit in sheet.units.items()]


def _is_same(sheet: Sheet, path: Path) -> bool:
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return next(csv.reader(file), None) == _headings(sheet)
    except (OSError, ValueError, csv.Error):
        return False
