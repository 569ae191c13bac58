"""Errors over the step with the order that they show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import Array
from carom.errors import counted
from carom.show.plot.style import COLOURS, GREY, Chart, entry, headed, legend, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.many.converge import Convergence

MARKERS = "osD^vP*X"


def convergence(study: Convergence) -> Chart:
    """Relative errors of each quantity over h, both axes logarithmic, with the fitted lines, and below them slopes 1 and 2.

    Errors that are rounding are counted, and left out as they are from the fits, unless there are no others. A quantity
    that has no point has no entry in the legend.
    """
    h = np.array(study.steps)
    numbers: dict[str, Array] = {"h (s)": h}
    least_shown, least_end = np.inf, np.inf
    rounding = study.rounding
    least = rounding if any(e > rounding for row in study.errors.values() for e in row) else 0.0
    with styled():
        figure, (axes,) = panels(
            1, 4.2, headed(study.title, f"error {study.where} against {study.reference}")
        )
        for i, (name, row) in enumerate(study.errors.items()):
            errors = np.array(row)
            numbers[f"error of {name} (1)"] = errors
            colour, shown, order = COLOURS[i % len(COLOURS)], errors > least, study.orders[name]
            told = "no order"
            if order is not None:
                spread = f" ± {order.uncertainty:.2f}" if order.uncertainty == order.uncertainty else ""
                told = f"order {order.value:.2f}{spread}"
                axes.loglog(h, order.factor * h**order.value, color=colour, linewidth=0.8)
                least_shown = min(least_shown, float(errors[shown].min()))
                least_end = min(least_end, order.at(float(h.max())))
            if small := int(np.sum(errors <= rounding)):
                told += f", {counted(small, 'error')} below {rounding:g}"
            marker, label = MARKERS[i % len(MARKERS)], f"{entry(name)}: {told}" if shown.any() else None
            axes.loglog(h[shown], errors[shown], marker, color=colour, markersize=4.5, label=label)
        if least_shown < np.inf:
            _slopes(axes, h, least_shown, least_end)
        axes.set_xlabel("step h (s)")
        axes.set_ylabel("relative error")
        legend(figure, axes, columns=2)
    return Chart(figure, numbers)


def _slopes(axes: Axes, h: Array, least: float, end: float) -> None:
    """Dashed lines of order 1 and 2 from one point, to compare slopes with: in the corner below the lowest fit, which ends
    at `end`, about as low as the `least` error.
    """
    coarse = float(np.max(h))
    left = float(coarse**0.75 * np.min(h) ** 0.25)
    start = min(0.9 * least, 0.8 * end * (left / coarse) ** 2)
    for order, side in ((1, "top"), (2, "bottom")):
        end = start * (coarse / left) ** order
        axes.loglog([left, coarse], [start, end], color=GREY, linewidth=0.8, linestyle=(0, (4, 2)))
        axes.annotate(f" {order}", (coarse, end), color=GREY, ha="left", va=side, fontsize=8)
