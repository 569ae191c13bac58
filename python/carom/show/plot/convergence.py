"""Errors over the step with the order that they show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import Array
from carom.show.plot.style import COLOURS, GREY, Chart, entry, legend, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.many.converge import Convergence

MARKERS = "osD^vP*X"


def convergence(study: Convergence) -> Chart:
    """Relative errors of each quantity over h, both axes logarithmic, with the fitted lines and slopes 1 and 2."""
    h = np.array(study.steps)
    numbers: dict[str, Array] = {"h (s)": h}
    with styled():
        figure, (axes,) = panels(1, 4.2, f"{study.title}: against {study.reference}")
        for i, (name, row) in enumerate(study.errors.items()):
            errors = np.array(row)
            numbers[f"error of {name} (1)"] = errors
            colour, shown = COLOURS[i % len(COLOURS)], errors > 0
            order = study.orders[name]
            label = f"{entry(name)}: no order"
            if order is not None:
                spread = f" ± {order.uncertainty:.2f}" if order.uncertainty == order.uncertainty else ""
                label = f"{entry(name)}: order {order.value:.2f}{spread}"
                axes.loglog(h, order.factor * h**order.value, color=colour, linewidth=0.8)
            marker = MARKERS[i % len(MARKERS)]
            axes.loglog(h[shown], errors[shown], marker, color=colour, markersize=4.5, label=label)
        _slopes(
            axes, h, np.array([e for name, row in study.errors.items() if study.orders[name] for e in row])
        )
        axes.set_xlabel("step h (s)")
        axes.set_ylabel("relative error")
        legend(figure, axes, columns=2)
    return Chart(figure, numbers)


def _slopes(axes: Axes, h: Array, errors: Array) -> None:
    """Dashed lines of order 1 and 2 from one point below the errors that show an order, to compare slopes with."""
    positive = errors[errors > 0]
    if not len(positive):
        return
    coarse = float(np.max(h))
    left = float(np.sqrt(coarse * np.min(h)))
    start = 0.3 * float(np.min(positive))
    for order in (1, 2):
        end = start * (coarse / left) ** order
        axes.loglog([left, coarse], [start, end], color=GREY, linewidth=0.8, linestyle=(0, (4, 2)))
        axes.annotate(f" {order}", (coarse, end), color=GREY, ha="left", va="center", fontsize=8)
