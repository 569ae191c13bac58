"""A figure of each case: its curves beside the published ones, and a slice through the grains."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from scenes import SETTLING, Drum, Silo

if TYPE_CHECKING:
    from report import Found

STYLE = Path(__file__).parent.parent.parent / "docs" / "matplotlibrc"
COLOURS = {"M1": "C4", "M2": "C0"}
#: Colours of the bands of grains in the silo, by their height before it opened.
BANDS = ("C5", "C0")


def draw(found: Found, path: Path) -> None:
    """Write the figure."""
    with mpl.rc_context(fname=STYLE):
        figure = Figure(figsize=(7.0, 3.4))
        if isinstance(found.case, Silo):
            left, *slices = figure.subplots(1, 3, width_ratios=(2.2, 1, 1))
            _silo(found, found.case, left)
        else:
            upper, lower = figure.subfigures(2, 1, height_ratios=(1, 1.1))
            figure.set_size_inches(7.0, 5.6)
            _drum(found, upper.subplots(1, 2))
            slices = list(lower.subplots(1, 3))
        _slices(found, slices)
        figure.savefig(path, dpi=110)


def _silo(found: Found, case: Silo, axes: Axes) -> None:
    name = "grains_above_orifice"
    for program, curves in found.others.items():
        axes.plot(curves.time, curves.counts[name], label=program, lw=1)
    axes.plot(found.ours.time, found.ours.counts[name], "k.", ms=3, label="Carom")
    n = found.numbers
    if "rate" in n:
        t = np.array([n["line_from_s"], n["line_to_s"]])
        inner = (found.ours.time >= t[0] - 1e-9) & (found.ours.time <= t[1] + 1e-9)
        through = np.mean(found.ours.counts[name][inner]) + n["rate"] * np.mean(found.ours.time[inner])
        axes.plot(t, through - n["rate"] * t, "k-", lw=0.7, label=f"{n['rate']:.0f} grains/s")
    # A run that goes on is shown as far as it has come.
    least = 0.0 if found.ended else 0.99 * float(found.ours.counts[name].min())
    last = 1.1 * float(found.ours.time[-1])
    axes.set(xlabel="time since it opened (s)", ylabel="grains above the orifice")
    axes.set(xlim=(0, last), ylim=(least, 1.01 * case.grains))
    axes.legend()


def _drum(found: Found, both: np.ndarray) -> None:
    for axes, zone in zip(both, ("zone1", "zone2"), strict=True):
        for kind, colour in COLOURS.items():
            for (program, curves), style in zip(found.others.items(), ("-", "--"), strict=False):
                axes.plot(
                    curves.time, curves.counts[f"{zone}_{kind}"], style, c=colour, lw=1,
                    label=f"{kind}, {program}" if zone == "zone1" else None,
                )  # fmt: skip
            axes.plot(
                found.ours.time, found.ours.counts[f"{zone}_{kind}"], ".", c=colour, ms=5, mec="k", mew=0.4,
                label=f"{kind}, Carom" if zone == "zone1" else None,
            )  # fmt: skip
        where = "x > 0, z > 0" if zone == "zone1" else "x < 0, z < 0"
        axes.set(xlabel="time since it turns (s)", ylabel="grains", title=f"zone {zone[-1]}: {where}")
    both[0].get_figure().legend(loc="outside upper center", ncols=6, fontsize=7, columnspacing=1.0)


def _slices(found: Found, several: list[Axes]) -> None:
    """What the plane y = 0 cuts of the grains: when all begins, at the end or half empty, and between if there is room."""
    result, case = found.result, found.case
    assert result is not None
    times = np.asarray(result.time)
    start = int(np.argmin(np.abs(times - SETTLING)))
    first, end = result.position[start], len(times) - 1
    if not isinstance(case, Drum):
        above = np.interp(
            times, np.asarray(found.ours.time) + SETTLING, found.ours.counts["grains_above_orifice"]
        )
        end = max(start, int(np.flatnonzero(above >= 0.5 * above[start])[-1]))
    frames = np.linspace(start, end, len(several)).round().astype(int)
    radius = np.asarray(result.bodies["radius"])
    if isinstance(case, Drum):
        small = radius < sum(case.diameters) / 4
        colours = np.where(small, COLOURS["M1"], COLOURS["M2"])
        corner = (-case.radius, -case.radius), (case.radius, case.radius)
    else:
        band = np.floor((first[:, 2] - case.lip) / (6 * case.diameter)).astype(int) % 2
        colours = np.array(BANDS)[band]
        highest = float(first[:, 2].max()) + 2 * case.diameter
        corner = (-case.tube, case.lip - 5 * case.diameter), (case.tube, highest)
    for axes, frame in zip(several, frames, strict=True):
        at = result.position[int(frame)]
        near = np.flatnonzero(np.abs(at[:, 1]) < radius)
        size = 2 * np.sqrt(radius[near] ** 2 - at[near, 1] ** 2)
        circles = EllipseCollection(
            size, size, np.zeros_like(size), units="xy", offsets=at[near][:, [0, 2]], offset_transform=axes.transData,
            facecolors=colours[near], edgecolors="none",
        )  # fmt: skip
        axes.add_collection(circles)
        axes.set(xlim=(corner[0][0], corner[1][0]), ylim=(corner[0][1], corner[1][1]), aspect="equal")
        axes.set(title=f"{times[frame] - SETTLING:.2f} s", xticks=[], yticks=[])
        axes.grid(visible=False)
