"""Methods or impact laws side by side as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import Array
from carom.show.plot.style import COLOURS, Chart, legend, panels, styled

if TYPE_CHECKING:
    from carom.many.compare import Comparison


def speeds(found: Comparison) -> Chart:
    """Bars for every body: its velocity at the end along the direction in which the bodies move most."""
    numbers: dict[str, Array] = {}
    last = [run.states["velocity"][-1] for run in found]
    axis = int(np.nanargmax(np.nansum(np.abs(last), axis=(0, 1))))
    place, width = np.arange(len(found.bodies)), 0.8 / len(found)
    with styled():
        figure, (axes,) = panels(1, 3.6, f"{found.title}: velocities at {found.times[-1]:g} s")
        for i, (run, velocity) in enumerate(zip(found, last, strict=True)):
            numbers[f"{run.name} (m/s)"] = velocity[:, axis]
            label = run.name.partition("+")[2] if found.laws else run.name
            at = place - 0.4 + (i + 0.5) * width
            axes.bar(at, velocity[:, axis], width, color=COLOURS[i % len(COLOURS)], label=label)
        axes.set_xticks(place, found.bodies)
        axes.set_ylabel(f"v_{'xyz'[axis]} (m/s)")
        legend(figure, axes, columns=3)
    return Chart(figure, numbers)
