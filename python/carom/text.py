"""Tables: of text that fit a terminal (the first column keeps its width, the others give way), and for notebooks."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Collection, Iterable, Sequence
from html import escape
from itertools import takewhile, zip_longest

#: Characters in a line that goes to a file or a pipe.
WIDTH = 160
GAP = "  "
#: Between words that stay together when a cell wraps; it is printed as a space.
TIE = "\u00a0"
#: Balls and walls that are listed by name in tables for notebooks.
LISTED = 20
#: Characters of a name in a label of a figure; the page has the same number (viewer/src/dom.ts).
LONGEST = 32


def columns() -> int:
    """Characters in a line of standard output: those of the terminal, `WIDTH` in a file or a pipe."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else WIDTH


def table(
    rows: Sequence[Sequence[str]],
    width: int | None = None,
    *,
    head: bool = False,
    left: Collection[int] = (0,),
) -> str:
    """Rows as aligned columns in lines of at most `width` characters (default: as `columns`).

    The first row is a `head` with a line below it, if there is one; a row of one cell is a heading.
    The columns in `left` start at their left edges, the others end at their right edges.
    Where the lines are too long, long cells wrap between words. Where that is not enough, the columns stand in
    several blocks, one below the other, each with the first column.
    """
    width = columns() if width is None else width
    cells = [row for row in rows if len(row) > 1]
    count = max(map(len, cells), default=1)
    filled = [[row[i] if i < len(row) else "" for row in cells] for i in range(count)]
    natural = [max(map(len, column), default=0) for column in filled]
    least = [max((len(word) for cell in column for word in cell.split(" ")), default=0) for column in filled]
    blocks = [
        _block(rows, _widths(natural, least, kept, width), width, head, left)
        for kept in _split(least, natural[0] if cells else 0, width)
    ]
    return "\n\n".join(blocks)


def _split(least: Sequence[int], first: int, width: int) -> list[list[int]]:
    """The columns of each block: as many as fit if every column but the first is as narrow as its longest word."""
    blocks: list[list[int]] = [[0]]
    room = width - first
    for i, need in enumerate(least[1:], start=1):
        if need + len(GAP) > room and len(blocks[-1]) > 1:
            blocks.append([0])
            room = width - first
        blocks[-1].append(i)
        room -= need + len(GAP)
    return blocks


def _widths(natural: Sequence[int], least: Sequence[int], kept: Sequence[int], width: int) -> dict[int, int]:
    """The width of each column of a block; those that are too much are taken from the widest columns."""
    room = width - natural[0] - len(GAP) * (len(kept) - 1)
    found = {i: natural[i] for i in kept}
    for limit in range(max(natural), 0, -1):
        found |= {i: min(natural[i], max(least[i], limit)) for i in kept[1:]}
        if sum(found[i] for i in kept[1:]) <= room:
            break
    return found


def _block(
    rows: Sequence[Sequence[str]], widths: dict[int, int], width: int, head: bool, left: Collection[int]
) -> str:
    lines = []
    for number, row in enumerate(rows):
        if len(row) == 1:
            lines += ["", *(textwrap.wrap(row[0], width) or [""])]
            continue
        wrapped = [
            textwrap.wrap(row[i], w, drop_whitespace=i > 0, break_on_hyphens=False) if i < len(row) else []
            for i, w in widths.items()
        ]
        for parts in zip_longest(*wrapped, fillvalue=""):
            padded = [
                part.ljust(w) if i in left else part.rjust(w)
                for (i, w), part in zip(widths.items(), parts, strict=True)
            ]
            lines.append(GAP.join(padded).replace(TIE, " ").rstrip())
        if head and number == 0:
            lines.append("-" * (sum(widths.values()) + len(GAP) * (len(widths) - 1)))
    return "\n".join(lines)


def page(
    title: str, facts: Sequence[tuple[str, str]], head: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    """HTML for notebooks: a title, facts as a table of two columns, and a table below them; every text is escaped."""
    told = "".join(
        f"<tr><th style='text-align:left'>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in facts
    )
    text = f"<div class='carom'><strong>{escape(title)}</strong><table>{told}</table>"
    if rows:
        columns = "".join(f"<th>{escape(name)}</th>" for name in head)
        cells = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
        text += f"<table><thead><tr>{columns}</tr></thead><tbody>{cells}</tbody></table>"
    return text + "</div>"


def shortened(name: str, most: int = LONGEST, among: Iterable[str] = ()) -> str:
    """A name of at most `most` characters: what is too much goes from the middle, as names often differ at their ends.

    If others `among` which it stands would read alike, what they share goes, or they are numbered.
    """
    if len(name) <= most:
        return name
    end = (most - 1) // 3
    cut = f"{name[: most - 1 - end].rstrip()}…{name[len(name) - end :].lstrip()}"
    alike = sorted({name, *(other for other in among if shortened(other, most) == cut)})
    if len(alike) == 1:
        return cut
    start = _shared(alike)
    tail = _shared([other[start:][::-1] for other in alike])
    own = name[start : len(name) - tail]
    if len(own) > most - 2:
        number = f" {alike.index(name) + 1}"
        return shortened(name, most - len(number)) + number
    return f"{name[: min(start, most - 2 - len(own))].rstrip()}…{own}…"


def _shared(names: Sequence[str]) -> int:
    """Characters with which all of them begin."""
    return sum(1 for _ in takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False)))


def vector(values: Sequence[float]) -> str:
    """`(1, 2, 3)`, four digits of each."""
    return "(" + ", ".join(f"{x:.4g}" for x in values) + ")"


def seconds(value: float) -> str:
    """A duration in the unit in which it is read."""
    if value < 1e-3:
        return f"{value * 1e6:.0f} us"
    if value < 1:
        return f"{value * 1e3:.3g} ms"
    if value < 120:
        return f"{value:.3g} s"
    minutes, rest = divmod(round(value), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
