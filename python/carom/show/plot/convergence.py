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

    Errors that are rounding are counted, and left out as they are from the fits, unless there are no others.
    """
    h = np.array(study.steps)
    numbers: dict[str, Array] = {"h (s)": h}
    ordered: list[float] = []
    rounding = study.rounding
    least = rounding if any(e > rounding for row in study.errors.values() for e in row) else 0.0
    with styled():
        figure, (axes,) = panels(1, 4.2, headed(study.title, f"against {study.reference}"))
        for i, (name, row) in enumerate(study.errors.items()):
            errors = np.array(row)
            numbers[f"error of {name} (1)"] = errors
            colour, shown, order = COLOURS[i % len(COLOURS)], errors > least, study.orders[name]
            told = "no order"
            if order is not None:
                spread = f" ± {order.uncertainty:.2f}" if order.uncertainty == order.uncertainty else ""
                told = f"order {order.value:.2f}{spread}"
                axes.loglog(h, order.factor * h**order.value, color=colour, linewidth=0.8)
                ordered += errors[shown].tolist()
            if small := int(np.sum(errors <= rounding)):
                told += f", {counted(small, 'error')} below {rounding:g}"
            marker = MARKERS[i % len(MARKERS)]
            axes.loglog(
                h[shown], errors[shown], marker, color=colour, markersize=4.5, label=f"{entry(name)}: {told}"
            )
        if ordered:
            _slopes(axes, h, 0.3 * min(ordered))
        axes.set_xlabel("step h (s)")
        axes.set_ylabel("relative error")
        legend(figure, axes, columns=2)
    return Chart(figure, numbers)


def _slopes(axes: Axes, h: Array, start: float) -> None:
    """Dashed lines of order 1 and 2 from one point, to compare slopes with."""
    coarse = float(np.max(h))
    left = float(np.sqrt(coarse * np.min(h)))
    for order, side in ((1, "top"), (2, "bottom")):
        end = start * (coarse / left) ** order
        axes.loglog([left, coarse], [start, end], color=GREY, linewidth=0.8, linestyle=(0, (4, 2)))
        axes.annotate(f" {order}", (coarse, end), color=GREY, ha="left", va=side, fontsize=8)
