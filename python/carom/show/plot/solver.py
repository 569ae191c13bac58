"""Energies, iterations and residual histories: what the solver did and whether the physics holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64, Array
from carom.errors import CaromError, counted
from carom.show.energies import energies as of_record
from carom.show.plot.style import COLOURS, GREY, Chart, fitted, headed, legend, panels, styled, whole_numbers

if TYPE_CHECKING:
    from carom.result.data import RunData


#: Histories with a line of their own; further ones of the same step are drawn thin and grey.
MOST_HISTORIES = 6
MARKERS = {"position": "o", "velocity": "s"}


def energies(result: RunData) -> Chart:
    """Kinetic, potential and total energy, J, at the start and after every step."""
    time, kinetic, potential = of_record(result)
    series = {"kinetic": kinetic, "potential": potential, "total": kinetic + potential}
    with styled():
        figure, (axes,) = panels(1, 2.8, result.title)
        looks = ((COLOURS[0], "-"), (COLOURS[1], "-"), (COLOURS[6], (0, (5, 2))))
        for (name, values), (colour, dash) in zip(series.items(), looks, strict=True):
            axes.plot(time, values, color=colour, linestyle=dash, label=name)
        axes.margins(x=0.01)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.set_xlabel("time (s)")
        axes.set_ylabel("energy (J)")
        legend(figure, axes)
    return Chart(figure, {"time (s)": time, **{f"{name} (J)": values for name, values in series.items()}})


def iterations(result: RunData) -> Chart:
    """Iterations of the position and velocity sub-problems and number of impact problems, step by step."""
    time = np.asarray(result.steps["time"])
    rows = {
        "position\niterations": "iterations_position",
        "velocity\niterations": "iterations_velocity",
        "impact\nproblems": "impact_problems",
    }
    numbers: dict[str, Array] = {"step": np.asarray(result.steps["step"]), "time (s)": time}
    with styled():
        figure, axes = panels(3, 4.6, result.title, 2.2)
        for axis, (label, column), colour in zip(axes, rows.items(), COLOURS, strict=False):
            values = np.asarray(result.steps[column])
            # Each step from its start to its end.
            ends, drawn = np.append(time[:1] - _step_size(result), time), np.append(values[:1], values)
            axis.plot(ends, drawn, color=colour, drawstyle="steps-pre", linewidth=0.9)
            whole_numbers(axis.yaxis, 4)
            axis.set_ylim(0, max(1.0, float(np.max(values, initial=0))) * 1.08)
            axis.margins(x=0.01)
            axis.set_ylabel(label)
            if len(values):
                # Beside the title: within the panel curves would run through it.
                said = f"most {values.max()}, mean {values.mean():.2f}"
                axis.set_title(said, loc="right", color="#444444", fontsize=8, pad=3)
            numbers[column] = values
        axes[-1].set_xlabel("time (s)")
        figure.align_ylabels(axes)
    return Chart(figure, numbers)


def residuals(result: RunData, step: int | None = None) -> Chart:
    """Residual norm of every Newton iteration of one step, beside what quadratic convergence would be."""
    step = hardest_step(result) if step is None else step
    table = result.residuals.where(np.asarray(result.residuals["step"]) == step)
    histories = [
        (_level(int(level)), int(problem), int(contacts), history)
        for level, problem, contacts, history in zip(
            np.asarray(table["level"]),
            np.asarray(table["problem"]),
            np.asarray(table["contacts"]),
            table.history(step),
            strict=True,
        )
    ]
    if not histories:
        last = int(result.steps["step"][-1]) if len(result.steps) else 0
        raise CaromError(
            f"no residuals were recorded for step {step}; the run has steps 1 to {last}, and only some are kept"
        )
    time = step * _step_size(result)
    with styled():
        figure, (axes,) = panels(
            1, 3.4, headed(result.title, f"step\u00a0{step}, t\u00a0=\u00a0{time:.4g}\u00a0s")
        )
        longest = max((h[3] for h in histories), key=len)
        order = sorted(range(len(histories)), key=lambda i: -len(histories[i][3]))[:MOST_HISTORIES]
        for i, (level, problem, contacts, history) in enumerate(histories):
            # Velocity problems are numbered as in the table of impacts: 0 is the resting solve, 1 the first impact.
            which = f", impact problem {problem}" if level == "velocity" else ""
            # All pairs of the island that may touch, of which the solve decides; fewer are closed after it.
            label = f"{level}{which}, {counted(contacts, 'candidate contact')}"
            look: dict[str, Any] = {"color": GREY, "linewidth": 0.6}
            if i in order:
                look = {
                    "color": COLOURS[order.index(i)],
                    "marker": MARKERS[level],
                    "markersize": 4,
                    "label": fitted(label, 1.2),
                }
            axes.semilogy(np.arange(len(history)), np.maximum(history, 1e-18), **look)
        reference = quadratic(longest)
        if reference is not None:
            start, values = reference
            axes.semilogy(
                start + np.arange(len(values)), values, color="black", linestyle=(0, (2, 2)), linewidth=1, zorder=5,
                label="quadratic: $r_{k+1} = C\\,r_k^2$",
            )  # fmt: skip
        whole_numbers(axes.xaxis, 12)
        axes.set_xlabel("Newton iteration")
        axes.set_ylabel("norm of the residual")
        legend(figure, axes, columns=2)
    return Chart(figure, _rows(histories))


def hardest_step(result: RunData) -> int:
    """The first of the steps with the most iterations among those whose residuals were recorded."""
    recorded = np.unique(np.asarray(result.residuals["step"]))
    if not len(recorded):
        raise CaromError("the run holds no residuals: no step needed a solve")
    steps = result.steps.where(np.isin(np.asarray(result.steps["step"]), recorded))
    if not len(steps):
        return int(recorded[0])
    total = np.asarray(steps["iterations_position"]).astype(np.int64) + np.asarray(
        steps["iterations_velocity"]
    )
    return int(steps["step"][int(np.argmax(total))])


def quadratic(history: F64) -> tuple[int, F64] | None:
    """Where and what a quadratically convergent sequence would be that shares two iterates with `history`.

    The two are those before the last; the third value is then a prediction that the last iterate can be held against.
    """
    positive = history[history > 0]
    if len(positive) < 3 or len(positive) != len(history):
        return None
    start = len(history) - 3
    first, second = float(history[start]), float(history[start + 1])
    if not second < first:
        return None
    factor = second / first**2
    return start, np.array([first, second, max(factor * second**2, 1e-18)])


def _rows(histories: list[tuple[str, int, int, F64]]) -> dict[str, Array]:
    rows = [
        (level, problem, contacts, k, value)
        for level, problem, contacts, history in histories
        for k, value in enumerate(history)
    ]
    names = ("level", "problem", "contacts", "iteration", "residual (1)")
    return {name: np.array([row[i] for row in rows]) for i, name in enumerate(names)}


def _level(number: int) -> str:
    return "position" if number == 1 else "velocity"


def _step_size(result: RunData) -> float:
    time, step = result.steps["time"], result.steps["step"]
    return float(time[0]) / float(step[0]) if len(time) else 0.0
