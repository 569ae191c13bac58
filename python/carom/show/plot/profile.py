"""Performance profiles of contact solvers: how much slower than the best, and how many problems after which time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64
from carom.show.plot.style import COLOURS, GREY, Chart, entry, legend, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from carom.problem.profile import Profile


#: Lines differ by more than colour: several solvers may share a step.
STYLES = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)))
#: The axis reaches this much further than the last step, so that the share solved in all is seen as a level.
BEYOND = 1.6


def performance(profile: Profile, title: str = "") -> Chart:
    """The share of problems that each solver solves within a factor of the best, over that factor (Dolan and Moré)."""
    factor, share = profile.curves()
    return _chart(
        profile,
        title,
        factor,
        share,
        start=1.0,
        label="time over the best time of the problem",
        column="factor (1)",
    )


def times(profile: Profile, title: str = "") -> Chart:
    """The share of problems that each solver has solved by a time, over that time."""
    at, share = profile.solved()
    start = float(at[0]) / BEYOND if len(at) else 1.0
    return _chart(profile, title, at, share, start=start, label="time (s)", column="time (s)")


def _chart(
    profile: Profile, title: str, at: F64, share: F64, *, start: float, label: str, column: str
) -> Chart:
    with styled():
        figure, (axes,) = panels(1, 3.6, title)
        end = BEYOND * float(at[-1]) if len(at) else 10.0 * start
        for k, name in enumerate(profile.solvers):
            style = STYLES[k % len(STYLES)]
            x = np.concatenate([[start], at, [end]])
            y = np.concatenate([[0.0], share[:, k], share[-1:, k] if len(at) else [0.0]])
            if len(at) and at[0] == start:
                x, y = x[1:], y[1:]
            axes.plot(
                x,
                y,
                drawstyle="steps-post",
                color=COLOURS[k % len(COLOURS)],
                linestyle=style,
                label=entry(name),
            )
        _scales(axes, start, end, profile.problems)
        axes.set_xlabel(label)
        legend(figure, axes)
    numbers = {column: at, **{f"share of {name} (1)": share[:, k] for k, name in enumerate(profile.solvers)}}
    return Chart(figure, numbers)


def _scales(axes: Axes, start: float, end: float, problems: int) -> None:
    axes.set_xscale("log")
    if start > 1e-3 and end < 1e6:  # short enough to be written out
        axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    axes.set_xlim(start, end)
    axes.set_ylim(0.0, 1.04)
    axes.axhline(1.0, color=GREY, linewidth=0.7, zorder=1)
    axes.set_ylabel(f"share of {problems} problems solved")
