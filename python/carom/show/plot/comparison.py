"""Methods or impact laws side by side as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import Array
from carom.show.plot.style import (
    COLOURS,
    DASHES,
    Chart,
    headed,
    legend,
    named,
    paired,
    seen,
    sheet,
    styled,
    unmarked,
    width,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.many.compare import Comparison

#: Panels of impulses beside each other.
BESIDE = 3
#: What the name of the table of impulses has besides that of the figure.
IMPULSES = "_impulses"


def beside(found: Comparison) -> Chart:
    """Velocities at the end as bars; of impact laws below them how impulses grow, a panel for each law."""
    grown = [run for run in found if run.impulses]
    lines = -(-len(grown) // BESIDE)
    with styled():
        heights = [1.9 + 1.7 * len(found.directions), 1.9 * lines]
        figure, head = sheet(sum(heights), headed(found.title, f"velocities at {found.times[-1]:g} s"))
        heights[0] += figure.get_figheight() - sum(heights)  # the title is in the first part
        parts: Any = figure.subfigures(2, 1, height_ratios=heights) if lines else [figure]
        chart = Chart(figure, _velocities(parts[0], found, head))
        if lines:
            numbers = _impulses(parts[1], found)
            longest = max(map(len, numbers.values()))
            chart.more[IMPULSES] = {
                name: np.pad(x, (0, longest - len(x)), constant_values=np.nan) for name, x in numbers.items()
            }
    return chart


def _label(found: Comparison, name: str) -> str:
    return name.partition("+")[2] if found.laws else name


def _velocities(part: Any, found: Comparison, head: str) -> dict[str, Array]:
    """A panel for each direction in which bodies move."""
    numbers: dict[str, Array] = {"body": np.array(found.bodies)}
    place, wide = np.arange(len(found.bodies)), 0.8 / len(found)
    panels: list[Axes] = list(part.subplots(len(found.directions), 1, sharex=True, squeeze=False).flat)
    panels[0].set_title(head, loc="left")
    for k, axes in zip(found.directions, panels, strict=True):
        for i, run in enumerate(found):
            velocity = run.states["velocity"][-1][:, k]
            numbers[f"{run.name} v_{'xyz'[k]} (m/s)"] = velocity
            at = place - 0.4 + (i + 0.5) * wide
            shown = np.where(np.abs(velocity) > found.still, velocity, 0.0 * velocity)
            axes.bar(at, shown, wide, color=COLOURS[i % len(COLOURS)], label=_label(found, run.name))
        axes.set_xticks(place, [named(name, 16, found.bodies) for name in found.bodies])
        axes.set_ylabel(f"$v_{'xyz'[k]}$ (m/s)")
    part.align_ylabels(panels)
    legend(part, panels[0], columns=6)
    return numbers


def _impulses(part: Any, found: Comparison) -> dict[str, Array]:
    """Of each pair over the impact problems of the run; a straight line where a law says no more."""
    numbers: dict[str, Array] = {}
    runs = [run for run in found if run.impulses]
    pairs = list(dict.fromkeys(pair for run in runs for pair in run.order))
    names = {name for run in runs for pair in run.impulses for name in run.ends[pair]}
    grid: Array = part.subplots(-(-len(runs) // BESIDE), BESIDE, sharey=True, squeeze=False)
    panels: list[Axes] = list(grid.flat)
    for axes, run in zip(panels, runs, strict=False):
        for pair, points in run.impulses.items():
            k = pairs.index(pair)
            style = {"color": COLOURS[k % len(COLOURS)], "ls": DASHES[k // len(COLOURS) % len(DASHES)]}
            axes.plot(*points.T, label=seen(paired(run.ends[pair], names)), lw=1.0, **style)
            numbers[f"{run.name} {pair} (impact problems)"], numbers[f"{run.name} {pair} (N s)"] = points.T
        axes.set_title(_label(found, run.name), loc="left")
        axes.margins(x=0)
        axes.locator_params(axis="x", nbins=4)
    for axes in panels[len(runs) :]:
        axes.set_visible(False)
    for axes in panels[: len(runs)][-BESIDE:]:
        axes.set_xlabel("impact problems")
    for axes in grid[:, 0]:
        axes.set_ylabel("impulse (N s)")
    handles = {
        text: line for axes in panels for line, text in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if handles:
        columns = max(1, min(9, int(13 * width() / (max(map(len, handles)) + 6))))
        unmarked(part.legend(list(handles.values()), list(handles), loc="outside lower left", ncols=columns))
    return numbers
