"""A fit at a glance: measured beside fitted values, and how the search went."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import Array
from carom.many.fit.data import moving
from carom.many.fit.points import Points
from carom.result.kinematics import QUANTITIES
from carom.show.plot.style import (
    COLOURS,
    GREY,
    Chart,
    literal,
    opened,
    panels,
    sheet,
    styled,
    whole_numbers,
)
from carom.text import shortened

if TYPE_CHECKING:
    from carom.many.fit.result import Fit

#: Quantities that are drawn, the first ones.
MOST = 6
#: Of chi squared that the axis shows at least, as a share: what changes less is flat.
SPAN = 0.1
#: Letters beside a panel.
LETTERS = 20


def curves(fit: Fit) -> Chart:
    """Each target with its uncertainty and the fitted values, and beside it what is left over the uncertainty."""
    table = {name: np.array(values) for name, values in fit.residuals.items()}
    numbers = {name: values for name, values in table.items() if values.dtype.kind != "U"}
    chosen = list(dict.fromkeys(table["quantity"].tolist()))[:MOST]
    with styled():
        figure, head = sheet(1.6 * len(chosen) + 0.5, fit.calibration.study.title, 0.2)
        grid = figure.subplots(len(chosen), 2, squeeze=False, width_ratios=(3, 2))
        for (axis, rest), name in zip(grid, chosen, strict=True):
            rows = np.flatnonzero(table["quantity"] == name)
            x, y, sigma, found, noise, left = (
                table[key][rows]
                for key in ("time", "measured", "uncertainty", "fitted", "noise", "residual over uncertainty")
            )
            curve = bool(np.isfinite(x).all())
            x = x if curve else np.arange(1.0, len(rows) + 1)
            order = np.argsort(x)
            axis.errorbar(
                x, y, sigma, fmt=".", color=COLOURS[0], markersize=3, linewidth=0.8, label="measured"
            )
            style = "-" if curve else "x"
            shown = noise[order] if noise.any() else None
            axis.errorbar(
                x[order], found[order], shown, fmt=style, color=COLOURS[1], linewidth=0.9, label="fitted"
            )
            axis.set_ylabel(_label(name))
            rest.axhspan(-2, 2, color=GREY, alpha=0.15, linewidth=0)
            rest.plot(x, left, ".", color=COLOURS[0], markersize=3)
            for side in (axis, rest):
                side.set_xlabel("time (s)" if curve else "")
                if not curve:
                    side.set_xticks(x, [""] * len(x))
                    side.set_xlim(0.5, len(rows) + 0.5)
        figure.align_ylabels(grid[:, 0])
        grid[0, 0].legend()
        grid[0, 1].set_title("residual over uncertainty", loc="left")
        figure.suptitle(head, x=0.01, ha="left", fontsize=9)
    return Chart(figure, {"target": table["quantity"], **numbers})


def _label(name: str) -> str:
    """A quantity with its unit where that is known, in lines that its panel has room for."""
    known = moving(name)
    if known is None:
        return literal("\n".join(textwrap.wrap(shortened(name, 2 * LETTERS), LETTERS)))
    ball, quantity, component = known
    unit = QUANTITIES[quantity][1]
    return literal(f"{shortened(ball, LETTERS)}\n{quantity}.{component}" + f" ({unit})" * (unit != "1"))


def path(points: Points) -> Chart:
    """Chi squared and the parameters of each point, in the order of the search; crosses are points that failed."""
    values, names = points.calibration.values(points.shares), points.calibration.names
    chi2 = np.where(points.good, points.chi2, np.nan)
    order = np.arange(1, len(chi2) + 1)
    numbers: dict[str, Array] = {"point": order, "chi squared": chi2}
    with styled():
        figure, axes = panels(1 + len(names), 1.2 * (1 + len(names)) + 0.6, points.calibration.study.title)
        axes[0].plot(order, chi2, ".", color=COLOURS[0], markersize=3)
        axes[0].plot(order, np.fmin.accumulate(chi2), color=COLOURS[1], label="least so far")
        least, most = np.nanmin(chi2), np.nanmax(chi2)
        if 0 < 10 * least < most:
            axes[0].set_yscale("log")
        else:
            opened(axes[0], SPAN * most)
        axes[0].set_ylabel("chi squared")
        axes[0].legend()
        for k, name in enumerate(names):
            numbers[name] = values[:, k]
            axis = axes[1 + k]
            axis.plot(order[points.good], values[points.good, k], ".", color=COLOURS[0], markersize=3)
            axis.plot(order[~points.good], values[~points.good, k], "x", color=COLOURS[1], markersize=4)
            axis.set_ylabel(literal(name))
            bounds = points.calibration.axes[k]
            axis.set_ylim(*bounds.at(np.array([-0.05, 1.05])))
            if bounds.log:
                axis.set_yscale("log")
        axes[-1].set_xlabel("point")
        whole_numbers(axes[-1].xaxis, 12)
    return Chart(figure, numbers)
