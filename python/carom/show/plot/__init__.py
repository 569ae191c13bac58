"""Figures of a run, drawn from its directory alone: `result.plot.velocities()`, `result.plot.save("figures")`.

Each figure is a `Chart`: a matplotlib figure and the numbers in it, which are written beside every picture as CSV.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import CaromError, did_you_mean, extra
from carom.show.plot import contact, motion, solver, table
from carom.show.plot.style import column_width, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from carom.result.data import RunData
    from carom.show.plot.style import Chart

#: What can be drawn, in the order of `carom plot --what all`.
KINDS = (
    *("velocities", "angular-velocities", "heights", "trajectories", "energies"),
    *("phases", "impacts", "iterations", "residuals"),
)
FORMATS = ("png", "svg", "pdf")
#: What is chosen for figures, and for which.
CHOSEN = {
    "bodies": ("velocities", "angular-velocities", "heights", "trajectories"),
    "step": ("impacts", "residuals"),
}


class Plots:
    """The figures of one result. Every method returns a matplotlib figure; `save` writes files."""

    def __init__(self, result: RunData) -> None:
        self._result = result

    def velocities(self, bodies: Sequence[str] | None = None) -> Figure:
        """The three components of the velocity over time."""
        return self.chart("velocities", bodies=bodies).figure

    def angular_velocities(self, bodies: Sequence[str] | None = None) -> Figure:
        """The three components of the angular velocity over time, world frame."""
        return self.chart("angular-velocities", bodies=bodies).figure

    def heights(self, bodies: Sequence[str] | None = None) -> Figure:
        """Height over time, opposite to gravity."""
        return self.chart("heights", bodies=bodies).figure

    def energies(self) -> Figure:
        """Kinetic, potential and total energy over time."""
        return self.chart("energies").figure

    def trajectories(self, bodies: Sequence[str] | None = None) -> Figure:
        """Paths of the balls seen from above, between upright walls."""
        return self.chart("trajectories", bodies=bodies).figure

    def phases(self) -> Figure:
        """When each pair of bodies sticks, slips, or is apart."""
        return self.chart("phases").figure

    def impacts(self, step: int | None = None) -> Figure:
        """The impact sequence of one step: pairs over problems; by default of the step with most."""
        return self.chart("impacts", step=step).figure

    def iterations(self) -> Figure:
        """Iterations of the sub-problems and impact problems, step by step."""
        return self.chart("iterations").figure

    def residuals(self, step: int | None = None) -> Figure:
        """Residual of every iteration of one step; by default of the step with the most iterations."""
        return self.chart("residuals", step=step).figure

    def chart(self, what: str, *, bodies: Sequence[str] | None = None, step: int | None = None) -> Chart:
        """A figure with its numbers; `what` is one of `KINDS`."""
        drawn: dict[str, Callable[[], Chart]] = {
            "velocities": lambda: motion.velocities(self._result, bodies),
            "angular-velocities": lambda: motion.angular_velocities(self._result, bodies),
            "heights": lambda: motion.heights(self._result, bodies),
            "trajectories": lambda: table.trajectories(self._result, bodies),
            "phases": lambda: contact.phases(self._result),
            "impacts": lambda: contact.impacts(self._result, step),
            "energies": lambda: solver.energies(self._result),
            "iterations": lambda: solver.iterations(self._result),
            "residuals": lambda: solver.residuals(self._result, step),
        }
        _known(what)
        require_matplotlib()
        return drawn[what]()

    def save(
        self,
        directory: str | Path,
        what: Sequence[str] | None = None,
        *,
        formats: Sequence[str] = ("png",),
        bodies: Sequence[str] | None = None,
        step: int | None = None,
        width: str = "double",
    ) -> list[Path]:
        """Write figures, and the numbers of each as CSV; returns the files. The same run gives the same bytes.

        Without `what` all that the run has something for. `width` is `single` or `double`: one column of a page or two.
        """
        formats = list(dict.fromkeys(formats))
        for chosen in formats:
            if chosen not in FORMATS:
                raise CaromError(f"no format is called {chosen!r}; {did_you_mean(chosen, FORMATS)}")
        chosen_kinds = self.available(step) if what is None else list(dict.fromkeys(what))
        for name in chosen_kinds:  # before anything is written
            _known(name)
        for option, kinds in CHOSEN.items():
            given = {"bodies": bodies, "step": step}[option]
            if what is not None and given is not None and not set(kinds) & set(chosen_kinds):
                cause = f"no figure of {', '.join(chosen_kinds)} takes it"
                raise CaromError(f"{option}: {cause}; leave it out, or draw one of {', '.join(kinds)}")
        files: list[Path] = []
        for name in chosen_kinds:
            with column_width(width):
                chart = self.chart(name, bodies=bodies, step=step)
            files += save(chart, Path(directory), name.replace("-", "_"), formats)
        return files

    def available(self, step: int | None = None) -> list[str]:
        """The figures that the run has something for; those of a step only if it has them."""
        result = self._result
        if step is not None:
            steps = np.asarray(result.steps["step"])
            if step not in steps:
                reach = f"from {steps[0]} to {steps[-1]}" if len(steps) else "of a run that has begun"
                raise CaromError(f"the run has no step {step}; give one {reach}")
        lacking = {
            "phases": not len(result.contacts),
            "impacts": not len(result.impacts)
            or (step is not None and step not in np.asarray(result.impacts["step"])),
            "residuals": not len(result.residuals)
            or (step is not None and not result.residuals.history(step)),
        }
        return [kind for kind in KINDS if not lacking.get(kind)]

    def __repr__(self) -> str:
        return f"<figures of {self._result.origin}: {', '.join(k.replace('-', '_') for k in KINDS)}>"


def _known(what: str) -> None:
    if what not in KINDS:
        raise CaromError(f"no plot is called {what!r}; {did_you_mean(what, KINDS)}")


def require_matplotlib() -> None:
    try:
        extra("matplotlib", "plots need matplotlib", "plot")
    except CaromError:
        raise
    except ValueError as error:  # it reads its settings when it is imported
        why = str(error).partition("; supported")[0]
        raise CaromError(f"matplotlib does not start ({why}); unset MPLBACKEND, or mend it") from error
