"""A study at a glance: histograms of its columns, and each of them against what varied."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, Array
from carom.errors import CaromError, did_you_mean
from carom.many.sweep.study import RESERVED
from carom.scene.assembly.rotations import upward
from carom.show.plot.motion import level_axes
from carom.show.plot.style import (
    COLOURS,
    GREY,
    LETTERS_PER_INCH,
    Chart,
    headed,
    literal,
    named,
    sheet,
    styled,
    width,
)
from carom.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from carom.many.sweep.table import Sweep


#: Columns that are drawn if nothing else is said.
MOST_COLUMNS = 6
#: Points of a scatter plot: of more an evenly spread part is drawn.
MOST_DOTS = 4000
#: The same of places, whose dots are many small ones.
MOST_PLACES = 20_000
MOST_BALLS = 4
BINS = 40
#: Bands of a parameter.
BANDS = 15
#: Kinds of columns of the final state that are drawn, the simplest first.
END = ("position", "velocity")
#: Share that is explained of a column by chance, with few cases and many parameters.
TOLD = 0.3
#: What is left out of the choice: spans below this, in SI units or of the widest of the kind, and greater rank correlations.
LEAST, LEAST_SHARE, ALIKE = 1e-9, 0.01, 0.97
#: Height of a panel of responses, in.
PANEL = 1.5
#: Cases from which on medians are drawn.
LINED = 20


def histograms(sweep: Sweep, columns: Sequence[str] = ()) -> Chart:
    """How the values of each column spread over the cases that reached their end."""
    chosen = chosen_columns(sweep, columns)
    numbers: dict[str, Array] = {}
    with styled():
        figure, head, axes = _panels(sweep, len(chosen), 1.7)
        for axis, name in zip(axes, chosen, strict=False):
            values = _finite(sweep, name)
            counts, edges = np.histogram(values, bins=_bins(values))
            axis.stairs(counts, edges, fill=True, color=COLOURS[0], alpha=0.75)
            middle = float(np.median(values)) if len(values) else np.nan
            axis.axvline(middle, color=COLOURS[1], linewidth=1.0)
            axis.set_title(f"median {middle:.4g}", loc="right", color=COLOURS[1], fontsize=8)
            axis.set_xlabel(_label(sweep, name, 0.8 * width() / _columns(len(chosen))))
            axis.set_ylabel("cases")
            unit = sweep.label(name).removeprefix(name)
            numbers[f"{name}: from{unit}"] = _filled(edges[:-1], BINS)
            numbers[f"{name}: to{unit}"] = _filled(edges[1:], BINS)
            numbers[f"{name}: cases"] = _filled(counts.astype(float), BINS)
        figure.suptitle(head, x=0.01, ha="left", fontsize=9)
    return Chart(figure, numbers)


def responses(sweep: Sweep, columns: Sequence[str] = ()) -> Chart:
    """Each column against each parameter that varies: one dot per case, the median in bands of it, and what it explains.

    The number above a panel is the share of the variance of the column's ranks that lies between bands of the parameter.
    """
    chosen = chosen_columns(sweep, columns)[:4]
    varied = [name for name in sweep.parameters if np.ptp(np.asarray(sweep[name], float)) > 0][:4]
    varied = varied or sweep.parameters[:1]
    stride = max(1, -(-int(sweep.ok.sum()) // MOST_DOTS))
    rows = np.flatnonzero(sweep.ok)[::stride]
    lined = int(sweep.ok.sum()) >= LINED
    size = _dot(len(rows))
    numbers: dict[str, Array] = {"case": sweep["case"][rows]}
    with styled():
        title = _title(sweep) + "; line: median; %: what the parameter explains" * lined
        figure, head = sheet(PANEL * len(chosen) + 0.7, title, 0.2)
        grid = figure.subplots(len(chosen), len(varied), sharex="col", sharey="row", squeeze=False)
        for i, column in enumerate(chosen):
            y = np.asarray(sweep[column], float)
            numbers[sweep.label(column)] = y[rows]
            for j, name in enumerate(varied):
                x = np.asarray(sweep[name], float)
                numbers[sweep.label(name)] = x[rows]
                axis = grid[i, j]
                axis.plot(
                    x[rows], y[rows], ".", color=COLOURS[0], markersize=size, alpha=0.45, rasterized=True
                )
                _median(axis, x[sweep.ok], y[sweep.ok])
                if lined:
                    share = explained(_some(sweep, name), _ranks(_some(sweep, column)))
                    numbers[f"{column}: explained by {name}"] = _filled(np.array([share]), len(rows))
                    axis.set_title(f"{share:.0%}", loc="right", color=GREY, fontsize=8, pad=2)
                if j == 0:
                    axis.set_ylabel(_label(sweep, column, PANEL))
                if i == len(chosen) - 1:
                    axis.set_xlabel(_label(sweep, name, 0.8 * width() / len(varied)))
                    axis.locator_params(axis="x", nbins=_ticks(len(varied)))
        figure.align_ylabels()
        figure.suptitle(head, x=0.01, ha="left", fontsize=9)
    return Chart(figure, numbers)


def places(sweep: Sweep, by: str | None = None) -> Chart:
    """Where up to four balls end, seen from above, m: dots coloured by the parameter `by`, or that which tells most."""
    names = [name.removesuffix(".position.x") for name in sweep.columns if name.endswith(".position.x")][
        :MOST_BALLS
    ]
    if not names:
        raise CaromError("the study kept no positions; name balls in keep.bodies")
    by = _telling(sweep, [f"{name}.position.{x}" for name in names for x in "xyz"]) if by is None else by
    colour = np.asarray(sweep[by], float)
    letters = ["xyz"[k] for k in level_axes(upward(sweep.study.targeting.base.gravity))]
    rows = np.flatnonzero(sweep.ok)[:: max(1, -(-int(sweep.ok.sum()) // MOST_PLACES))]
    numbers: dict[str, Array] = {"case": sweep["case"][rows], sweep.label(by): colour[rows]}
    columns = 1 if len(names) == 1 else 2
    with styled():
        lines = -(-len(names) // columns)
        ends = [np.concatenate([sweep[f"{n}.position.{x}"][rows] for n in names]) for x in letters]
        (left, right), (low, high) = ((np.nanmin(of), np.nanmax(of)) for of in ends)
        tall = float(np.clip((high - low) / max(right - left, 1e-12), 0.3, 1.2))
        wide = 0.55 * max(right - left, (high - low) / tall, 1e-12)  # half of a panel
        height = 0.75 + lines * (0.3 + tall * 0.76 * width() / columns)
        figure, head = sheet(height, f"{_title(sweep)}; places at the end", 0.2)
        axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axis, name in zip(axes, names, strict=False):
            x, y = (sweep[f"{name}.position.{letter}"][rows] for letter in letters)
            numbers |= {f"{name} {letters[0]} (m)": x, f"{name} {letters[1]} (m)": y}
            # Translucent, so that of those at one place all are told from one.
            dots = axis.scatter(
                *(x, y),
                c=colour[rows],
                s=_dot(len(rows)) ** 2,
                alpha=0.6,
                cmap="viridis",
                linewidth=0,
                rasterized=True,
            )
            axis.set_aspect("equal")
            axis.set_xlim(0.5 * (left + right) - wide, 0.5 * (left + right) + wide)
            axis.set_ylim(0.5 * (low + high) - tall * wide, 0.5 * (low + high) + tall * wide)
            axis.set_title(named(name), loc="left")
            axis.set_xlabel(f"${letters[0]}$ (m)")
            axis.set_ylabel(f"${letters[1]}$ (m)")
        for axis in axes[len(names) :]:
            axis.set_visible(False)
        for axis in axes:
            axis.label_outer()
        for axis in axes[max(0, len(names) - columns) : len(names)]:  # nothing stands below
            axis.tick_params(labelbottom=True)
            axis.set_xlabel(f"${letters[0]}$ (m)")
        figure.colorbar(dots, ax=list(axes), label=_label(sweep, by, height - 1.0), aspect=40, shrink=0.8)
        figure.suptitle(head, x=0.01, ha="left", fontsize=9)
    return Chart(figure, numbers)


def _telling(sweep: Sweep, columns: Sequence[str]) -> str:
    """The parameter that explains most of some columns, on the average over them."""
    ranks = [_ranks(_some(sweep, column)) for column in columns]
    return max(sweep.parameters, key=lambda name: sum(explained(_some(sweep, name), rank) for rank in ranks))


def explained(x: F64, y: F64) -> float:
    """The share of the variance of `y`, (n,), that its means in bands of `x`, (n,), have: its first-order Sobol' index.

    Of ranks as `y`, outliers weigh no more than others. Source: Saltelli et al., Global Sensitivity Analysis (2008), 4.5.
    """
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    if len(y) == 0 or np.var(y) == 0:
        return 0.0
    distinct, place = np.unique(x, return_inverse=True)
    if len(distinct) > BANDS:
        edges = np.unique(np.quantile(x, np.linspace(0, 1, BANDS + 1)))[1:-1]
        place = np.searchsorted(edges, x, side="right")
    count = np.bincount(place)
    mean = np.bincount(place, y) / np.maximum(count, 1)
    return float(np.var(mean[place]) / np.var(y))


def _ranks(values: F64) -> F64:
    """From 1; equal values share the mean of theirs, and what is not a number has none."""
    found = np.full(len(values), np.nan)
    finite = np.isfinite(values)
    _, place, count = np.unique(values[finite], return_inverse=True, return_counts=True)
    found[finite] = (np.cumsum(count) - 0.5 * (count - 1))[place]
    return found


def _some(sweep: Sweep, name: str) -> F64:
    """A column over the cases that reached their end; of very many an evenly spread part, enough to rank columns by."""
    rows = np.flatnonzero(sweep.ok)
    return np.asarray(sweep[name], float)[rows[:: max(1, -(-len(rows) // MOST_DOTS))]]


def moved(sweep: Sweep) -> bool:
    """Whether the places at the end differ, as seen from above, so that `places` has something to show."""
    letters = ["xyz"[k] for k in level_axes(upward(sweep.study.targeting.base.gravity))]
    ends = tuple(f".position.{letter}" for letter in letters)
    return any(name.endswith(ends) and _span(sweep, name) > LEAST for name in sweep.columns)


def chosen_columns(sweep: Sweep, columns: Sequence[str]) -> list[str]:
    """The columns to draw: those named, or what a measure gave and of the end what the parameters tell most about."""
    if columns:
        for name in columns:
            if name not in sweep.columns:
                raise CaromError(f"the study has no column {name!r}; {did_you_mean(name, sweep.columns)}")
            if sweep[name].dtype == object:
                raise CaromError(f"the column {name!r} holds text, which no figure shows")
        return list(columns)
    free = [name for name in sweep.columns if name not in {*RESERVED, *sweep.parameters} - {"energy_final"}]
    measured = [name for name in free if name.count(".") < 2 and name != "energy_final"]
    found = [name for name in measured if len(_finite(sweep, name))]
    varying = [name for name in found if _span(sweep, name) > LEAST]
    return ((varying or found) + _of_the_end(sweep, free))[:MOST_COLUMNS]


def _of_the_end(sweep: Sweep, free: Sequence[str]) -> list[str]:
    """Places and velocities at the end, that first whose order over the cases the parameters explain best, and the energy.

    The energy follows from the speeds that were given, whatever happened; so it comes after all of which something is told.

    Left out are columns that hardly vary beside others of their kind, and those that repeat one before them, as the
    velocity of a ball that rolled on does its place.
    """
    order: dict[str, F64] = {}
    for kind in END:
        spans = {name: _span(sweep, name) for name in free if f".{kind}." in name}
        least = max(LEAST, LEAST_SHARE * max(spans.values(), default=0.0))
        order |= {name: _ranks(_some(sweep, name)) for name, span in spans.items() if span > least}
    varied = {name: _some(sweep, name) for name in sweep.parameters}
    # Rounded, so that of equally well explained ones the simpler kind comes first.
    worth = {name: round(sum(explained(x, y) for x in varied.values()), 2) for name, y in order.items()}
    chosen: list[str] = []
    for name in sorted(order, key=lambda name: -worth[name]):
        if len(chosen) == MOST_COLUMNS - 1:
            break
        if not any(_alike(order[name], order[other]) for other in chosen):
            chosen.append(name)
    told = [name for name in chosen if worth[name] > TOLD]
    energy = ["energy_final"] * (not chosen or _span(sweep, "energy_final") > LEAST)
    return told + energy + chosen[len(told) :]


def _span(sweep: Sweep, name: str) -> float:
    return float(np.ptp(values)) if len(values := _finite(sweep, name)) else 0.0


def _alike(a: F64, b: F64) -> bool:
    keep = np.isfinite(a) & np.isfinite(b)
    if keep.sum() < LINED:  # a few cases are alike by chance
        return False
    return bool(abs(np.corrcoef(a[keep], b[keep])[0, 1]) > ALIKE)


def _dot(count: int) -> float:
    """Size of each of so many dots, points: a few are to be seen."""
    return 1.6 if count > 1000 else 3.0 if count >= LINED else 7.0


def _title(sweep: Sweep) -> str:
    failed = int((~sweep.ok).sum())
    cases = f"{int(sweep.ok.sum())} cases" + (f", {failed} failed" if failed else "")
    return headed(sweep.study.title, cases)


def _label(sweep: Sweep, column: str, room: float) -> str:
    """The column with its unit as a label with so much `room`, in: in lines, the name of a ball in the first."""
    most, text = max(8, int(LETTERS_PER_INCH * room)), sweep.label(column)
    if len(text) <= most:
        return literal(text)
    ball, *rest = text.rsplit(".", 2)
    if len(rest) < 2:
        return literal("\n".join(textwrap.wrap(shortened(text, 2 * most), most)))
    return literal(f"{shortened(ball, most)}\n{'.'.join(rest)}")


def _finite(sweep: Sweep, name: str) -> F64:
    values = np.asarray(sweep[name], dtype=float)[sweep.ok]
    return np.asarray(values[np.isfinite(values)])


def _bins(values: F64) -> Array | int:
    distinct = np.unique(values[: 10 * MOST_DOTS])
    if 1 < len(distinct) <= BINS and np.allclose(distinct, np.round(distinct)):  # counts
        return np.arange(distinct[0] - 0.5, distinct[-1] + 1.0) if distinct[-1] - distinct[0] < BINS else BINS
    return int(np.clip(2 * np.sqrt(len(values)), 8, BINS))


def _filled(values: F64, rows: int) -> F64:
    return np.concatenate([values, np.full(rows - len(values), np.nan)])


def _median(axis: Axes, x: F64, y: F64) -> None:
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    if len(x) < LINED:
        return
    distinct = np.unique(x)
    bands = min(BANDS, max(2, len(x) // 20))
    edges = (
        np.quantile(x, np.linspace(0, 1, bands + 1)) if len(distinct) > 15 else np.append(distinct, np.inf)
    )
    band = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    places = [k for k in range(len(edges) - 1) if (band == k).sum() >= 3]
    axis.plot(
        [float(np.median(x[band == k])) for k in places], [float(np.median(y[band == k])) for k in places],
        color=COLOURS[1], linewidth=1.3, marker="o" if len(places) < 8 else "", markersize=3,
    )  # fmt: skip


def _panels(sweep: Sweep, count: int, height: float) -> tuple[Figure, str, list[Axes]]:
    """A sheet with its title in lines, and panels in rows."""
    columns = _columns(count)
    rows = -(-count // columns)
    figure, head = sheet(height * rows + 0.4, _title(sweep), 0.2)
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axis in axes[count:]:
        axis.set_visible(False)
    for axis in axes:
        axis.grid(color=GREY, alpha=0.2)
        axis.locator_params(axis="x", nbins=_ticks(columns))
    return figure, head, axes


def _columns(count: int) -> int:
    """Panels beside each other."""
    return 1 if count == 1 else 2 if count in (2, 4) else 3


def _ticks(columns: int) -> int:
    """Numbers below a panel at most, so that those with five digits do not run into each other."""
    return max(2, int(1.4 * width() / columns))
