"""CSV files with names in the first line and numbers below: tables of studies, measurements of fits."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import NamedTuple

from carom.errors import CaromError

#: Between columns. In files with another than the first, numbers may have decimal commas.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
#: What a cell without a number holds, in lower case.
NONE = ("", "nan", "na", "n/a")


class Table(NamedTuple):
    """Columns by their names, and the line of the file that each row is from."""

    columns: dict[str, list[float]]
    lines: list[int]


def read_table(path: Path, gaps: bool = False) -> Table:
    """The numbers of a file. Empty lines, and those that begin with #, are skipped. With `gaps` cells may be NaN."""
    separator, rows = _rows(path)
    if len(rows) < 2:
        raise CaromError(f"{path}: expected a line with names and at least one with numbers")
    names = [name.strip() for name in rows[0][1]]
    if len(set(names)) < len(names) or "" in names:
        raise CaromError(f"{path}: the first line must name every column once, found {', '.join(names)}")
    found: dict[str, list[float]] = {name: [] for name in names}
    for line, row in rows[1:]:
        if len(row) != len(names):
            told = f"{len(row)} values for {len(names)} columns between {SEPARATORS[separator]}"
            raise CaromError(f"{path}, row {line}: {told}; give each row a value for each name")
        for name, text in zip(names, row, strict=True):
            text = text.strip() if separator == "," else text.strip().replace(",", ".")
            found[name].append(_number(f"{path}, row {line}: {name}", text, gaps))
    return Table(found, [line for line, _ in rows[1:]])


def _rows(path: Path) -> tuple[str, list[tuple[int, list[str]]]]:
    """The separator that makes the most columns of the line with names, and the cells of each line by its number."""
    try:
        text = path.read_text(encoding="utf-8-sig")
        found = []
        for separator in SEPARATORS:
            reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
            rows = [(reader.line_num, row) for row in reader if any(row) and not row[0].startswith("#")]
            found.append((separator, rows))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CaromError(
            f"{path} cannot be read as CSV: {getattr(error, 'strerror', None) or error}"
        ) from error
    return max(found, key=lambda one: len(one[1][0][1]) if one[1] else 0)


def _number(place: str, text: str, gaps: bool) -> float:
    if gaps and text.lower() in NONE:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        cure = "; leave the cell empty where nothing was measured" if gaps else ""
        raise CaromError(f"{place} is {text!r}, not a number{cure}")
    return value
