"""Velocities, angular velocities and heights over time: one line per body, or the spread where there are many."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64, I64, Array
from carom.result.selection import chosen_bodies
from carom.scene.assembly.rotations import upward
from carom.show.plot.style import COLOURS, DASHES, GREY, Chart, entry, headed, legend, opened, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.result.data import RunData


#: Up to this many bodies each has a line and a name; of more, the middle and the spread are shown.
MOST_LINES = len(COLOURS)
#: Frames drawn at most; more cannot be seen.
MOST_FRAMES = 6000
#: Numbers of a quantity that are read at a time: a run of a million balls does not fit the memory.
BLOCK = 6_000_000


def velocities(result: RunData, bodies: Sequence[str] | None = None) -> Chart:
    """The components of the velocity, m/s."""
    return _components(result, bodies, "velocity", "v", "m/s")


def angular_velocities(result: RunData, bodies: Sequence[str] | None = None) -> Chart:
    """The components of the angular velocity in the world frame, rad/s."""
    return _components(result, bodies, "angular_velocity", "\\omega", "rad/s")


def heights(result: RunData, bodies: Sequence[str] | None = None) -> Chart:
    """Height of the lowest point of each body above the plane on which things rest, where that is at the time; of its centre
    without one."""
    names, columns = selection(result, bodies)
    frames = shown_frames(result)
    up = upward(result.gravity)
    floor = _floor(result, up)
    level = np.zeros(len(result.time)) if floor is None else result.walls[floor].position @ up
    radius = np.zeros(1) if floor is None else np.asarray(result.bodies["radius"])[columns]
    what = "height of the centre" if floor is None else "height"
    title = result.title if floor is None else headed(result.title, f"height above {floor}")

    def height(position: F64, rows: I64) -> F64:
        return np.asarray(position @ up - level[rows, np.newaxis] - radius)[:, :, np.newaxis]

    values = _read(result, "position", names, columns, frames, height)[:, :, 0]
    # A ball that hops is seen in millimetres.
    scale, unit = (1e3, "mm") if np.nanmax(np.abs(values), initial=0.0) < 0.5 else (1.0, "m")
    with styled():
        figure, (axes,) = panels(1, 2.8, title)
        time = np.asarray(result.time)[frames]
        data = _draw(axes, time, values * scale, names)
        opened(axes, 1e-6 * scale * float(np.max(np.asarray(result.bodies["radius"])[columns], initial=0.0)))
        axes.set_ylabel(f"{what} ({unit})")
        axes.set_xlabel("time (s)")
        legend(figure, axes)
    return Chart(
        figure, {"time (s)": time, **{f"{name} {what} ({unit})": column for name, column in data.items()}}
    )


def _components(
    result: RunData, bodies: Sequence[str] | None, quantity: str, symbol: str, unit: str
) -> Chart:
    names, columns = selection(result, bodies)
    frames = shown_frames(result)
    values = _read(result, quantity, names, columns, frames, lambda vectors, _: vectors)
    time = np.asarray(result.time)[frames]
    plain = symbol.replace("\\", "")
    numbers: dict[str, Array] = {"time (s)": time}
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


def _read(
    result: RunData, quantity: str, names: list[str], columns: Any, frames: I64, of: Callable[[F64, I64], F64]
) -> F64:
    """`of(vectors, rows)` of a quantity (T, n, 3) at the frames: (T, n, k) of a few bodies, of many the spread (T, 5, k)."""
    parts = [of(values, rows) for rows, values in blocks(result, quantity, columns, frames)]
    if len(names) > MOST_LINES:
        parts = [_spread(part) for part in parts]
    return np.concatenate(parts)


def _spread(values: F64) -> F64:
    """Least, 5 %, median, 95 % and greatest over the bodies, (T, 5, k) of (T, n, k)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of frames without any body: nothing is drawn
        found = np.nanquantile(values, [0.0, 0.05, 0.5, 0.95, 1.0], axis=1)
    return np.asarray(np.moveaxis(found, 0, 1))


def _draw(axes: Axes, time: F64, values: F64, names: list[str]) -> dict[str, F64]:
    """Draw `values` (frames, bodies), of many bodies their spread (frames, 5); returns the numbers drawn by name."""
    axes.margins(x=0.01)
    if _flat(values):
        # Rounding would fill the panel: show that there is nothing.
        axes.set_ylim(-1, 1)
    if len(names) <= MOST_LINES:
        for i, name in enumerate(names):
            axes.plot(time, values[:, i], color=COLOURS[i], linestyle=DASHES[i % 2], label=entry(name, names))
        return {name: values[:, i] for i, name in enumerate(names)}
    least, low, middle, high, most = values.T
    axes.fill_between(
        time, low, high, color=COLOURS[5], alpha=0.35, linewidth=0, label="5 to 95 % of the bodies"
    )
    axes.plot(time, middle, color=COLOURS[0], label=f"median of the bodies there ({len(names)} in all)")
    # One fast ball among many is outside the band, and often the one that matters.
    thin: dict[str, Any] = {"color": GREY, "linewidth": 0.5}
    axes.plot(time, least, **thin, label="least and greatest (single bodies: --bodies A,B)")
    axes.plot(time, most, **thin)
    return {"5 %": low, "median": middle, "95 %": high, "least": least, "greatest": most}


def _flat(values: F64) -> bool:
    return bool(np.nanmax(np.abs(values), initial=0.0) < 1e-9)


def selection(result: RunData, bodies: Sequence[str] | None) -> tuple[list[str], Any]:
    """Names of the bodies to draw, and their columns."""
    if not bodies:
        return result.names, slice(None)
    columns = chosen_bodies(result.names, bodies, result.clumps).tolist()
    return [result.names[k] for k in columns], columns


def shown_frames(result: RunData) -> I64:
    """Numbers of the frames to draw: all or one in several, the last in any case."""
    count = len(result.time)
    frames = np.arange(0, count, max(1, -(-count // MOST_FRAMES)))
    return np.append(frames, count - 1) if len(frames) and frames[-1] != count - 1 else frames


def blocks(result: RunData, quantity: str, columns: Any, frames: I64) -> Iterator[tuple[I64, F64]]:
    """Rising or falling frames in blocks, with a quantity (B, n, 3) of the chosen bodies; not a number where absent."""
    apart = int(np.abs(np.diff(frames)).max(initial=1))
    size = max(1, BLOCK // (3 * max(1, len(result.names)) * apart))  # all between two frames is read
    for first in range(0, max(1, len(frames)), size):
        rows = frames[first : first + size]
        low, high = (int(rows.min()), int(rows.max()) + 1) if len(rows) else (0, 0)
        here = rows - low
        there = np.asarray(result.present[low:high])[here][:, columns]
        values = np.asarray(getattr(result, quantity)[low:high])[here][:, columns]
        yield rows, np.where(there[:, :, np.newaxis], values, np.nan)


def level_axes(up: F64) -> tuple[int, int]:
    """The axes of the world that are most nearly level, as they point right and up on a sheet that is seen from above."""
    k = int(np.argmax(np.abs(up)))
    first, second = (k + 1) % 3, (k + 2) % 3
    return (first, second) if up[k] > 0 else (second, first)


def _floor(result: RunData, up: F64) -> str | None:
    """Name of the first flat wall that faces upwards: planes without end come first, then rectangles and discs."""
    for name, wall in result.walls.items():
        normal = wall.facts.get("axis" if wall.shape in ("rectangle", "disc") else "normal")
        if normal is not None and normal @ up > 1 - 1e-9:
            return name
    return None
