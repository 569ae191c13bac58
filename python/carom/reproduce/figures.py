"""Draws a `Figure` of the paper in the style of Carom's own figures, and writes its numbers beside it."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.reproduce.document import Curve, Figure
from carom.show.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: One column of a page, in.
SIZE = (4.6, 3.1)
#: Height of a row of the legend, in, and the most columns.
ROW, MOST_COLUMNS = 0.17, 5
#: A curve of points with more than this many shows every n-th, so that markers stay apart.
MOST_MARKERS = 45
MARKERS = "osD^vPX*"
#: A curve is dashed where it lies on another for more than this share of its points; length of a dash in line widths.
COVERED, DASH = 0.2, 3.0


def draw(figure: Figure, directory: Path, formats: Sequence[str]) -> list[str]:
    """Write `<name>.<format>` and `<name>.csv` into `directory`; the same figure gives the same bytes."""
    from matplotlib.figure import Figure as Canvas

    with style.styled():
        canvas = Canvas(figsize=SIZE, layout="constrained")
        axes = canvas.subplots()
        colours = _colours(figure.curves)
        for k, (curve, colour) in enumerate(zip(figure.curves, colours, strict=True)):
            axes.plot(curve.x, curve.y, label=curve.label, **_look(curve, colour, k, figure))
        _slopes(axes, figure)
        axes.set(xscale=figure.xscale, yscale=figure.yscale, xlabel=figure.xlabel, ylabel=figure.ylabel)
        left, right, bottom, top = figure.limits
        axes.set_xlim(left, right)
        axes.set_ylim(bottom, top)
        if figure.equal:
            axes.set_aspect("equal")
        _ticks(axes, figure)
        _legend(canvas, axes)
    files = style.save(style.Chart(canvas, _numbers(figure)), directory, figure.name, formats)
    return [file.name for file in files]


def _look(curve: Curve, colour: str, k: int, figure: Figure) -> dict[str, Any]:
    """A line under a dashed one of the same body, a closed form, is broad and pale: both are seen where they coincide."""
    if curve.kind in ("line", "marked"):
        if any(c.kind == "dashed" and c.body == curve.body is not None for c in figure.curves):
            return {"color": colour, "linewidth": 3.0, "alpha": 0.45}
        look = {"color": colour, "linewidth": 1.5, "linestyle": _dashes(k, figure)}
        if curve.kind == "marked":
            look |= {"marker": MARKERS[k % len(MARKERS)], "markersize": 4.5, "markerfacecolor": "none"}
        return look
    if curve.kind == "dashed":
        return {"color": _darker(colour), "linewidth": 1.0, "linestyle": (0, (4, 2)), "zorder": 3}
    apart = max(1, -(-len(curve.x) // MOST_MARKERS))
    marker = MARKERS[k % len(MARKERS)]
    return {
        "color": colour,
        "linestyle": "none",
        "marker": marker,
        "markersize": 4.5,
        "markevery": apart,
        "markerfacecolor": "none",
        "zorder": 4,
    }


def _dashes(k: int, figure: Figure) -> str | tuple[float, tuple[float, float]]:
    """A curve that lies on earlier ones leaves gaps through which each of them is seen."""
    levels: list[int] = []
    for n, curve in enumerate(figure.curves):
        under = [
            levels[j]
            for j, other in enumerate(figure.curves[:n])
            if other.kind in ("line", "marked") and _coincide(curve, other)
        ]
        levels.append(1 + max(under) if under and curve.kind in ("line", "marked") else 0)
    if figure.yscale == "log" or levels[k] == 0:
        return "-"
    # Each level has its own place in a period: no two dashes are drawn over each other.
    most = max(levels)
    return DASH * (most + 1 - (levels[k] - 1)), (DASH, DASH * most)


def _coincide(one: Curve, other: Curve) -> bool:
    """Whether a good part of two curves lies less than a line's width apart, as those of balls at rest or mirror images."""
    if one.x.shape != other.x.shape or not np.array_equal(one.x, other.x):
        return False
    near = np.abs(one.y - other.y) <= 2e-3 * max(np.ptp(one.y), np.ptp(other.y))
    return bool(np.mean(near) > COVERED)


def _colours(curves: Sequence[Curve]) -> list[str]:
    """The colour of a body is its own in all figures; curves of none take what is left, in order."""
    taken = {curve.body for curve in curves}
    free = [c for k, c in enumerate(style.COLOURS) if k not in taken] or list(style.COLOURS)
    colours = []
    for curve in curves:
        if curve.body is None:
            colours.append(free[0])
            free = [*free[1:], free[0]]
        else:
            colours.append(style.COLOURS[curve.body % len(style.COLOURS)])
    return colours


def _darker(colour: str) -> str:
    from matplotlib.colors import to_hex, to_rgb

    hue, lightness, saturation = colorsys.rgb_to_hls(*to_rgb(colour))
    return str(to_hex(colorsys.hls_to_rgb(hue, 0.45 * lightness, saturation)))


def _named(slope: float) -> str:
    return f"slope {slope:g}"


def _slopes(axes: Axes, figure: Figure) -> None:
    """Straight lines that end under the last point of the lowest curve; only their direction means something."""
    if not figure.slopes:
        return
    x = np.concatenate([curve.x for curve in figure.curves])
    lowest = min(float(curve.y[np.argmax(curve.x)]) for curve in figure.curves)
    ends = np.array([x.min(), x.max()])
    for k, slope in enumerate(figure.slopes):
        heights = 0.4 * lowest * (ends / ends[1]) ** slope
        dashes = ((0, (1, 1.5)), (0, (6, 2, 1, 2)), "-")[k % 3]
        axes.plot(ends, heights, color=style.GREY, linestyle=dashes, linewidth=1.0, label=_named(slope))


def _ticks(axes: Axes, figure: Figure) -> None:
    """Numbers that can be read: whole ones for iterations; 1, 2, 5 where a logarithmic axis spans little."""
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter

    for axis, scale, values in (
        (axes.xaxis, figure.xscale, np.concatenate([curve.x for curve in figure.curves])),
        (axes.yaxis, figure.yscale, np.concatenate([curve.y for curve in figure.curves])),
    ):
        if scale == "linear":
            if np.all(values == np.round(values)) and np.ptp(values) < 2 * MOST_MARKERS:
                axis.set_major_locator(MaxNLocator(integer=True))
            continue
        axis.set_minor_formatter(NullFormatter())
        low, high = axis.get_view_interval()
        decades = np.floor(np.log10(high)) - np.ceil(np.log10(low)) + 1
        if decades < 2:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf)))


def _legend(canvas: Any, axes: Axes) -> None:
    """The legend above the axes, in as many columns as there is room for; its rows do not make the axes smaller."""
    labels = axes.get_legend_handles_labels()[1]
    for columns in range(min(len(labels), MOST_COLUMNS), 0, -1):
        style.legend(canvas, axes, columns=columns)
        legend = canvas.legends[-1]
        if columns == 1 or legend.get_window_extent().width < 0.98 * canvas.bbox.width:
            break
        legend.remove()
    rows = -(-len(labels) // columns)
    canvas.set_size_inches(SIZE[0], SIZE[1] + ROW * (rows - 1))


def _numbers(figure: Figure) -> dict[str, Any]:
    """One row per point: name of the curve, x, y."""
    names = [curve.label for curve in figure.curves for _ in curve.x]
    # Where both axes have one label, the columns need two names.
    heads = (figure.xlabel, figure.ylabel) if figure.xlabel != figure.ylabel else ("x", "y")
    return {
        "curve": np.array(names, dtype=object),
        heads[0]: np.concatenate([curve.x for curve in figure.curves]),
        heads[1]: np.concatenate([curve.y for curve in figure.curves]),
    }
