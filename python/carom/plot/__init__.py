"""Figures of a run, drawn from its directory alone: `result.plot.velocities()`, `result.plot.save("figures")`.

Each figure is a `Chart`: a matplotlib figure and the numbers in it, which are written beside every picture as CSV.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from carom.errors import CaromError, did_you_mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from carom.plot.style import Chart
    from carom.result import Result

#: What can be drawn, in the order of `carom plot --what all`.
KINDS = ("velocities", "angular-velocities", "heights", "energies", "iterations", "residuals")
FORMATS = ("png", "svg", "pdf")


class Plots:
    """The figures of one result. Every method returns a matplotlib figure; `save` writes files."""

    def __init__(self, result: Result) -> None:
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

    def iterations(self) -> Figure:
        """Iterations of the sub-problems and impact problems, step by step."""
        return self.chart("iterations").figure

    def residuals(self, step: int | None = None) -> Figure:
        """Residual of every iteration of one step; by default of the step with the most iterations."""
        return self.chart("residuals", step=step).figure

    def chart(self, what: str, *, bodies: Sequence[str] | None = None, step: int | None = None) -> Chart:
        """A figure with its numbers; `what` is one of `KINDS`."""
        from carom.plot import motion, solver

        drawn: dict[str, Callable[[], Chart]] = {
            "velocities": lambda: motion.velocities(self._result, bodies),
            "angular-velocities": lambda: motion.angular_velocities(self._result, bodies),
            "heights": lambda: motion.heights(self._result, bodies),
            "energies": lambda: solver.energies(self._result),
            "iterations": lambda: solver.iterations(self._result),
            "residuals": lambda: solver.residuals(self._result, step),
        }
        if what not in drawn:
            raise CaromError(f"no plot is called {what!r}; {did_you_mean(what, KINDS)}")
        require_matplotlib()
        return drawn[what]()

    def save(
        self,
        directory: str | Path,
        what: Sequence[str] = KINDS,
        *,
        formats: Sequence[str] = ("png",),
        bodies: Sequence[str] | None = None,
        step: int | None = None,
    ) -> list[Path]:
        """Write figures, and the numbers of each as CSV; returns the files. The same run gives the same bytes."""
        from carom.plot.style import save

        for chosen in formats:
            if chosen not in FORMATS:
                raise CaromError(f"no format is called {chosen!r}; {did_you_mean(chosen, FORMATS)}")
        files: list[Path] = []
        for name in what:
            chart = self.chart(name, bodies=bodies, step=step)
            files += save(chart, Path(directory), name.replace("-", "_"), formats)
        return files

    def __repr__(self) -> str:
        return f"<figures of {self._result.path}: {', '.join(k.replace('-', '_') for k in KINDS)}>"


def require_matplotlib() -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise CaromError("plots need matplotlib: pip install 'carom[plot]'") from error
