"""`carom.Result`: the data of a run with what is made of it, figures, pages, files of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carom.result.data import RunData
from carom.result.data import UnfinishedRun as UnfinishedRun

if TYPE_CHECKING:
    from carom.result.directory import RunDir
    from carom.scene.billiards import Shot
    from carom.show.plot import Plots
    from carom.show.viewer import ViewInfo


def load(path: str | Path) -> Result:
    """The result of a run directory, also of one that is still being written or was killed."""
    return Result.load(path)


class Result(RunData):
    """A run: its scene, T frames of N bodies, its impacts, contacts and steps. Obtained by `carom.simulate`,
    `carom.Simulation.result` or `carom.load`.

    What was committed when the object was made is what it shows; load again to see more of a run in progress.
    """

    #: What a load function raised in this process, if that ended the run.
    _raised: Exception | None = None

    # What is made of a run is imported at first use: a run that is not plotted need not wait for it.

    @property
    def plot(self) -> Plots:
        """Figures: `result.plot.velocities()` returns one of matplotlib, `result.plot.save("figures")` writes all."""
        from carom.show.plot import Plots

        return Plots(self)

    @property
    def shots(self) -> list[Shot]:
        """On a table of the billiards kit, for each ball that was struck: whom it hit, cushions, pocketed balls, scratch."""
        from carom.scene.billiards.marked import shots_of

        return shots_of(self)

    def view(
        self,
        path: str | Path | None = None,
        *,
        open_browser: bool = False,
        title: str | None = None,
        max_mb: float = 100.0,
    ) -> ViewInfo:
        """Write the run as one HTML page that plays offline, by default `view.html` in the run directory. A page that is
        there is replaced. It has at most `max_mb` megabytes.
        """
        from carom.show.viewer import write_html

        info = write_html(self, Path(path) if path else self.path / "view.html", title=title, max_mb=max_mb)
        if open_browser:
            import webbrowser

            webbrowser.open(info.path.resolve().as_uri())
        return info

    def export(
        self, directory: str | Path | None = None, format: str | Sequence[str] = "vtkhdf", **options: Any
    ) -> list[Path]:
        """Write the run as `vtkhdf`, `vtp`, `csv`, `parquet`, `extxyz`, `gsd`, `mp4`, `gif` or `png`, by default in `export`
        of the run; several as a list, or with commas between them. Files of these formats that are there are replaced.

        `options`: `every`, `start`, `stop` (s, or texts as `"250 ms"`), `contacts`, as in `carom.export.export`,
        and of films `speed`, `camera`, `follow` and others. Returns the files to open.
        """
        from carom.export import export

        return export(self, directory, format, **options)

    def _write_problem(self, directory: RunDir, outcome: dict[str, Any]) -> None:
        if self._problem is not None:
            from carom.problem.run_files import keep_failing

            keep_failing(directory, self._problem, outcome)

    def _repr_html_(self) -> str:
        from carom.result.notebook import of_result

        return of_result(self)
