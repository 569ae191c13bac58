"""CSV files with names in the first line and numbers below: tables of studies, measurements of fits."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import NamedTuple

from carom.errors import CaromError


class Table(NamedTuple):
    """Columns by their names, and the line of the file that each row is from."""

    columns: dict[str, list[float]]
    lines: list[int]


def read_table(path: Path) -> Table:
    """The numbers of a file. Empty lines, and those that begin with #, are skipped."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, row) for row in reader if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CaromError(
            f"{path} cannot be read as CSV: {getattr(error, 'strerror', None) or error}"
        ) from error
    if len(rows) < 2:
        raise CaromError(f"{path}: expected a line with names and at least one with numbers")
    names = [name.strip() for name in rows[0][1]]
    if len(set(names)) < len(names) or "" in names:
        raise CaromError(f"{path}: the first line must name every column once, found {', '.join(names)}")
    found: dict[str, list[float]] = {name: [] for name in names}
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise CaromError(f"{path}, row {line}: {len(row)} values for {len(names)} columns")
        for name, text in zip(names, row, strict=True):
            found[name].append(_number(f"{path}, row {line}: {name}", text.strip()))
    return Table(found, [line for line, _ in rows[1:]])


def _number(place: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CaromError(f"{place} is {text!r}, not a number")
    return value
