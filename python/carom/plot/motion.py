"""Velocities, angular velocities and heights over time: one line per body, or the spread where there are many."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from carom.plot.style import COLOURS, DASHES, GREY, Chart, legend, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.result import Result

F64 = NDArray[np.float64]

#: Up to this many bodies each has a line and a name; of more, the middle and the spread are shown.
MOST_LINES = len(COLOURS)
#: Frames drawn at most; more cannot be seen, and would fill the memory for large runs.
MOST_FRAMES = 6000


def velocities(result: Result, bodies: Sequence[str] | None = None) -> Chart:
    """The components of the velocity, m/s."""
    return _components(result, bodies, "velocity", "v", "m/s")


def angular_velocities(result: Result, bodies: Sequence[str] | None = None) -> Chart:
    """The components of the angular velocity in the world frame, rad/s."""
    return _components(result, bodies, "angular_velocity", "\\omega", "rad/s")


def heights(result: Result, bodies: Sequence[str] | None = None) -> Chart:
    """Height of the lowest point of each body above the plane on which things rest, where that is at the time; of its centre
    without one."""
    names, columns, frames = selection(result, bodies)
    up = upward(result)
    centre = of_present(result, "position", frames, columns) @ up
    floor = _floor(result, up)
    if floor is None:
        values, label = centre, "height of the centre"
    else:
        level = result.walls[floor].position[frames] @ up
        values = centre - level[:, np.newaxis] - np.asarray(result.bodies["radius"])[columns]
        label = f"height above {floor}"
    # A ball that hops is seen in millimetres.
    scale, unit = (1e3, "mm") if np.nanmax(np.abs(values), initial=0.0) < 0.5 else (1.0, "m")
    with styled():
        figure, (axes,) = panels(1, 2.8, result.title)
        time = np.asarray(result.time[frames])
        data = _draw(axes, time, values * scale, names)
        axes.set_ylabel(f"{label} ({unit})")
        axes.set_xlabel("time (s)")
        legend(figure, axes)
    return Chart(
        figure, {"time (s)": time, **{f"{name} height ({unit})": column for name, column in data.items()}}
    )


def _components(result: Result, bodies: Sequence[str] | None, quantity: str, symbol: str, unit: str) -> Chart:
    names, columns, frames = selection(result, bodies)
    values = of_present(result, quantity, frames, columns)
    time = np.asarray(result.time[frames])
    plain = symbol.replace("\\", "")
    numbers: dict[str, NDArray[Any]] = {"time (s)": time}
    with styled():
        figure, axes = panels(3, 5.2, result.title)
        for i, (axis, letter) in enumerate(zip(axes, "xyz", strict=True)):
            data = _draw(axis, time, values[:, :, i], names)
            numbers |= {f"{name} {plain}_{letter} ({unit})": column for name, column in data.items()}
            axis.set_ylabel(f"${symbol}_{letter}$ ({unit})")
        axes[-1].set_xlabel("time (s)")
        figure.align_ylabels(axes)
        legend(figure, axes[0])
    return Chart(figure, numbers)


def _draw(axes: Axes, time: F64, values: F64, names: list[str]) -> dict[str, F64]:
    """Draw `values` (frames, bodies); returns the numbers drawn by name."""
    axes.margins(x=0.01)
    if _flat(values):
        # Rounding would fill the panel: show that there is nothing.
        axes.set_ylim(-1, 1)
    if len(names) <= MOST_LINES:
        for i, name in enumerate(names):
            axes.plot(time, values[:, i], color=COLOURS[i], linestyle=DASHES[i % 2], label=name)
        return {name: values[:, i] for i, name in enumerate(names)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of frames without any body: nothing is drawn
        least, low, middle, high, most = np.nanquantile(values, [0.0, 0.05, 0.5, 0.95, 1.0], axis=1)
    axes.fill_between(
        time, low, high, color=COLOURS[5], alpha=0.35, linewidth=0, label="5 to 95 % of the bodies"
    )
    axes.plot(time, middle, color=COLOURS[0], label=f"median of {len(names)} bodies")
    # One fast ball among many is outside the band, and often the one that matters.
    thin: dict[str, Any] = {"color": GREY, "linewidth": 0.5}
    axes.plot(time, least, **thin, label="least and greatest (single bodies: --bodies A,B)")
    axes.plot(time, most, **thin)
    return {"5 %": low, "median": middle, "95 %": high, "least": least, "greatest": most}


def _flat(values: F64) -> bool:
    return bool(np.nanmax(np.abs(values), initial=0.0) < 1e-9)


def selection(result: Result, bodies: Sequence[str] | None) -> tuple[list[str], Any, Any]:
    """Names, their columns and the frames to draw."""
    names = list(bodies) if bodies else result.names
    columns: Any = [result[name].index for name in names] if bodies else slice(None)
    stride = max(1, -(-len(result.time) // MOST_FRAMES))
    return names, columns, slice(None, None, stride)


def of_present(result: Result, quantity: str, frames: Any, columns: Any) -> F64:
    """A quantity (T, n, 3) of the chosen bodies, not a number where they are absent: before they enter, after they left."""
    there = np.asarray(result.present[frames])[:, columns]
    values = np.asarray(getattr(result, quantity)[frames])[:, columns]
    return np.where(there[:, :, np.newaxis], values, np.nan)


def upward(result: Result) -> F64:
    gravity = result.gravity
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])


def _floor(result: Result, up: F64) -> str | None:
    """Name of the first plane that faces upwards."""
    planes = result.planes
    for name, normal in zip(planes["name"], planes["normal"], strict=True):
        if normal @ up > 1 - 1e-9:
            return str(name)
    return None
