"""Seen from above: the paths of the balls between the walls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from carom.plot.motion import MOST_LINES, of_present, selection, upward
from carom.plot.style import COLOURS, DASHES, GREY, Chart, fitted, legend, styled, width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.result import Result

F64 = NDArray[np.float64]

#: Height of a figure over its width at most, and at least.
TALLEST, FLATTEST = 1.2, 0.3
#: Above so many balls their paths would fill the figure: the balls at the end are drawn alone, the highest on top.
CROWD = 200


def trajectories(result: Result, bodies: Sequence[str] | None = None) -> Chart:
    """Paths of the centres seen against gravity, m, with the balls at the start (outlined) and at the end (filled).

    Of more than 200 balls no paths: the balls at the end, the highest on top.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    names, columns, frames = selection(result, bodies)
    across, along, letters = _plane(result)
    centre = of_present(result, "position", frames, columns)
    x, y = centre @ across, centre @ along
    radius = np.asarray(result.bodies["radius"])[columns]
    few = len(names) <= MOST_LINES
    low = np.array([np.nanmin(x - radius, initial=np.inf), np.nanmin(y - radius, initial=np.inf)])
    high = np.array([np.nanmax(x + radius, initial=-np.inf), np.nanmax(y + radius, initial=-np.inf)])
    lines = [line for line in _walls(result, across, along) if _near(line, low, high)]
    middle = 0.5 * (low + high)
    for point, direction in lines:  # its place nearest to the paths comes into the view
        foot = point + ((middle - point) @ direction) * direction
        low, high = np.minimum(low, foot), np.maximum(high, foot)
    margin = 0.03 * float(np.max(high - low))
    with styled():
        aspect = float(np.clip((high - low)[1] / max((high - low)[0], 1e-12), FLATTEST, TALLEST))
        figure = Figure(figsize=(width(), width() * aspect + 0.9), layout="constrained")
        axes = figure.subplots()
        axes.set_title(fitted(result.title), loc="left")
        axes.set_aspect("equal")
        for point, direction in lines:
            axes.axline(tuple(point), tuple(point + direction), color=GREY, linewidth=1.6, zorder=1)
        if len(names) > CROWD:
            _heap(axes, x, y, centre @ upward(result), radius)
        for i, name in enumerate(names if len(names) <= CROWD else ()):
            colour = COLOURS[i] if few else COLOURS[0]
            look: dict[str, Any] = {"label": name, "linestyle": DASHES[i % 2]} if few else {"alpha": 0.5}
            axes.plot(x[:, i], y[:, i], color=colour, linewidth=1.0 if few else 0.4, zorder=3, **look)
            there = np.flatnonzero(np.isfinite(x[:, i]))
            if len(there):
                first, last = there[0], there[-1]
                axes.add_patch(
                    Circle(
                        (x[first, i], y[first, i]),
                        radius[i],
                        fill=False,
                        color=colour,
                        linewidth=0.8,
                        zorder=2,
                    )
                )
                axes.add_patch(
                    Circle(
                        (x[last, i], y[last, i]), radius[i], color=colour, alpha=0.45, linewidth=0, zorder=2
                    )
                )
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_xlabel(f"${letters[0]}$ (m)")
        axes.set_ylabel(f"${letters[1]}$ (m)")
        if few:
            legend(figure, axes)
    numbers: dict[str, NDArray[Any]] = {"time (s)": np.asarray(result.time[frames])}
    for i, name in enumerate(names):
        numbers |= {f"{name} {letters[0]} (m)": x[:, i], f"{name} {letters[1]} (m)": y[:, i]}
    return Chart(figure, numbers)


def _heap(axes: Axes, x: F64, y: F64, height: F64, radius: F64) -> None:
    """The balls (B,) where each was last, of `x`, `y`, `height` (T, B), seen from above."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    there = np.isfinite(x)
    last = len(x) - 1 - there[::-1].argmax(axis=0)
    seen = np.flatnonzero(there.any(axis=0))
    order = seen[np.argsort(height[last[seen], seen], kind="stable")]
    balls = [Circle((x[last[i], i], y[last[i], i]), radius[i]) for i in order]
    axes.add_collection(
        PatchCollection(balls, facecolor=COLOURS[0], edgecolor="white", linewidth=0.4, zorder=2)
    )


def _plane(result: Result) -> tuple[F64, F64, str]:
    """The two axes of the world that are most nearly level, and their names."""
    up = int(np.argmax(np.abs(upward(result))))
    first, second = ((1, 2), (0, 2), (0, 1))[up]
    return np.eye(3)[first], np.eye(3)[second], "xyz"[first] + "xyz"[second]


def _walls(result: Result, across: F64, along: F64) -> list[tuple[F64, F64]]:
    """Planes without end that stand upright, as lines: a point, and a direction."""
    found = []
    planes = result.planes
    for point, normal in zip(planes["point"], planes["normal"], strict=True):
        flat = np.array([normal @ across, normal @ along])
        size = float(np.linalg.norm(flat))
        if size > 0.99:
            found.append((np.array([point @ across, point @ along]), np.array([-flat[1], flat[0]]) / size))
    return found


def _near(line: tuple[F64, F64], low: F64, high: F64) -> bool:
    """Whether a line is not farther from the paths than they are wide."""
    point, direction = line
    normal = np.array([-direction[1], direction[0]])
    return abs(float((0.5 * (low + high) - point) @ normal)) < 1.5 * float(np.max(high - low))
