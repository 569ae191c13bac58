"""Tables as CSV: units in the headings, numbers as the shortest text that reads back as the same bits."""

from __future__ import annotations

import csv
from pathlib import Path

from carom.export.atomic import whole_file
from carom.export.frames import Selection
from carom.export.tables import sheets


def write(selection: Selection, directory: Path) -> list[Path]:
    """`frames.csv` and a file for every other table that has rows."""
    files = []
    for sheet in sheets(selection):
        path = directory / f"{sheet.name}.csv"
        headings = [name if unit in ("1", "") else f"{name} ({unit})" for name, unit in sheet.units.items()]
        if sheet.empty:
            if _headings(path) == headings:  # of an earlier export, and no file of the user's own
                path.unlink()
            continue
        with whole_file(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(headings)
            for piece in sheet.pieces():
                writer.writerows(zip(*(piece[name].tolist() for name in sheet.units), strict=True))
        files.append(path)
    return sorted(files, key=lambda path: path.stem != "frames")


def _headings(path: Path) -> list[str] | None:
    """The first line of a table, if it can be read."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return next(csv.reader(file), None)
    except (OSError, ValueError, csv.Error):
        return None
