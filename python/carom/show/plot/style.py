"""How figures look, and how they are written: for print and for eyes that confuse red and green."""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError, CaromWarning, did_you_mean
from carom.files import csv_bytes, write_whole
from carom.text import LONGEST, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

#: The colours of Okabe and Ito, those that are dark enough on white first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
GREY = "#888888"
#: Without width, before names that matplotlib would leave out of legends.
SEEN = "\u200b"
#: Every other line is dashed: mirror images coincide, and both shall be seen.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)))

#: Widths of figures, in: one and two columns of a journal page.
WIDTHS = {"single": 3.4, "double": 7.0}
#: Of text in the size of a title.
LETTERS_PER_INCH = 13.0
#: Height of a line of a title or a label, in.
LINE = 0.15
#: The same of a legend.
ENTRY = 0.18
_width: ContextVar[str] = ContextVar("width", default="double")
DPI = 200

RC: Any = {
    "font.size": 8.5,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.3,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.direction": "out",
    # Letters stay letters: editors of a journal change fonts, and search finds text.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "carom",
    "path.simplify": True,
}


@dataclass
class Chart:
    """A figure and the numbers it shows: one dictionary of equally long columns, headed with their units."""

    figure: Figure
    data: dict[str, Array] = field(default_factory=dict)
    more: dict[str, dict[str, Array]] = field(default_factory=dict)
    """Further tables of numbers, by what their files' names have besides."""


@contextmanager
def column_width(name: str) -> Iterator[None]:
    """Draw figures as wide as one column of a page (`single`) or two (`double`)."""
    if name not in WIDTHS:
        raise CaromError(f"no width is called {name!r}; {did_you_mean(name, list(WIDTHS))}")
    token = _width.set(name)
    try:
        yield
    finally:
        _width.reset(token)


def width() -> float:
    """Width of a figure, in."""
    return WIDTHS[_width.get()]


def literal(text: str) -> str:
    """Text of a user as matplotlib has to get it: a dollar begins no formula. Every name and title goes through here."""
    return text.replace("$", "\\$")


def named(name: str, most: int = LONGEST, among: Iterable[str] = ()) -> str:
    """The name of a ball, a wall or a pair of them as a label, shortened if it is very long, unlike others `among` it."""
    return literal(shortened(name, most, among))


def entry(name: str, among: Iterable[str] = ()) -> str:
    """The same as an entry of a legend."""
    return seen(named(name, among=among))


def seen(label: str) -> str:
    """An entry of a legend with a mark that `unmarked` takes away: matplotlib hides what begins with _."""
    return f"{SEEN}{label}" if label.startswith("_") else label


def paired(names: Sequence[str], among: Iterable[str] = ()) -> str:
    """Two names as the label of a row, or with `seen` as an entry of a legend."""
    return " - ".join(named(name, 18 if width() > 5 else 10, among) for name in names)


def headed(title: str, *said: str) -> str:
    """The title of a scene, which may have none, and what a figure says besides."""
    return ": ".join(filter(None, (title, *said)))


def fitted(text: str, indent: float = 0.6) -> str:
    """Text broken into lines that the figure is wide enough for, less `indent` in; not at no-break spaces.

    What is like a formula in it stays as it is written.
    """
    lines = textwrap.fill(text, max(16, int(LETTERS_PER_INCH * (width() - indent))))
    return literal(lines.replace("\u00a0", " "))


@contextmanager
def styled() -> Iterator[None]:
    """The style of Carom's figures, without changing matplotlib for anybody else."""
    import matplotlib

    with matplotlib.rc_context(RC):
        yield


def sheet(height: float, title: str, indent: float = 0.6) -> tuple[Figure, str]:
    """An empty figure and its title in lines: `height`, in, is that with one line, and grows with each further one.

    `indent`: room that the title lacks beside the width of the figure, in.
    """
    from carom.show.plot.figure import Drawing

    head = fitted(title, indent)
    return Drawing(figsize=(width(), height + LINE * head.count("\n")), layout="constrained"), head


def panels(
    count: int, height: float, title: str, indent: float = 0.6, ratios: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """A `sheet` with panels above each other that share the horizontal axis; with `ratios` of their heights nothing."""
    figure, head = sheet(height, title, indent)
    axes = figure.subplots(count, 1, sharex=ratios is None, squeeze=False, height_ratios=ratios)[:, 0]
    if title:
        axes[0].set_title(head, loc="left")
    return figure, list(axes)


def legend(figure: Figure, axes: Axes, columns: int = 8) -> None:
    """One legend for all panels, above them; the figure grows with each further line of it."""
    handles, labels = axes.get_legend_handles_labels()
    if not labels:
        return
    # As many beside each other as there is room for.
    longest = max(map(len, labels), default=1)
    columns = max(1, min(columns, int(11 * width() / (longest + 6)), len(labels)))
    shown = figure.legend(handles, labels, loc="outside upper left", ncols=columns)
    unmarked(shown)
    lines = max(sum(1 + label.count("\n") for label in part) for part in np.array_split(labels, columns))
    whole = figure.figure  # of which it may be a part
    whole.set_figheight(whole.get_figheight() + ENTRY * (lines - 1))


def unmarked(legend: Legend) -> None:
    """Take the marks of `entry` away from a legend that has taken its entries."""
    for text in legend.get_texts():
        text.set_text(text.get_text().removeprefix(SEEN))


def opened(axes: Axes, least: float) -> None:
    """Let the vertical axis span `least` at least: what is smaller is rounding, which would look like more."""
    low, high = axes.get_ylim()
    if high - low < least:
        axes.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def whole_numbers(axis: Axis, at_most: int) -> None:
    """So many ticks at most, at whole numbers."""
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(nbins=at_most, integer=True))


@contextmanager
def _letters() -> Iterator[None]:
    """Says once which letters the font lacks, where matplotlib warns of each in its own words."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    lacking = dict.fromkeys(
        chr(int(found[1])) for w in caught if (found := re.match(r"Glyph (\d+)", str(w.message)))
    )
    for told in {str(w.message) for w in caught if not str(w.message).startswith("Glyph ")}:
        warnings.warn(told, stacklevel=2)
    if lacking:
        told = f"the font of figures has no {' '.join(lacking)}: there are boxes in their place"
        warnings.warn(told, CaromWarning, stacklevel=2)


def save(chart: Chart, directory: Path, name: str, formats: Sequence[str]) -> list[Path]:
    """Write a chart as `<name>.<format>` and `<name>.csv`, further tables beside it; the same chart gives the same bytes."""
    files = []
    # Without these the files would hold the time at which they were made.
    dates: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}
    with styled():
        for chosen in formats:
            buffer = io.BytesIO()
            with _letters():
                chart.figure.savefig(buffer, format=chosen, dpi=DPI, metadata=dates[chosen])
            files.append(directory / f"{name}.{chosen}")
            write_whole(files[-1], buffer.getbuffer(), durable=False, parents=True)
    for besides, data in {"": chart.data, **chart.more}.items():
        files.append(directory / f"{name}{besides}.csv")
        rows = zip(*(np.asarray(column).tolist() for column in data.values()), strict=True)
        write_whole(files[-1], csv_bytes([data, *rows]), durable=False, parents=True)
    return files
