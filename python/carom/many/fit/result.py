"""`carom.fit`, and `carom.Fit`: best values, how well the data determine them, and how the search went."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import carom
from carom.arrays import F64
from carom.errors import CaromError, CaromWarning
from carom.files import csv_bytes, finite, inside, json_bytes, write_whole
from carom.many.fit import checks, plot, remarks
from carom.many.fit.calibration import Calibration
from carom.many.fit.intervals import told
from carom.many.fit.points import Points, State
from carom.many.fit.search import Found, search
from carom.many.fit.smaller_step import shift
from carom.many.sweep.folder import Folder
from carom.many.sweep.run import Team
from carom.many.sweep.study import Measure
from carom.many.sweep.table import Sweep
from carom.run.watch import check_function
from carom.show.plot import require_matplotlib
from carom.show.plot.style import save


def fit(
    calibration: Calibration | str | Path,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    measure: Measure | None = None,
    progress: Callable[[State], None] | None = None,
) -> Fit:
    """Fit parameters of a scenario to measured numbers and curves; the folder `out` keeps all points.

    The arguments are those of `carom.sweep`, with a `Calibration` or the file of one. A second call computes only points
    that the folder lacks, and gives the same answer. `measure(result)` returns `{name: number}`, or for curves
    `{name: (times, values)}`.
    """
    check_function("fit", "progress", progress, "state: print(state)")
    if not isinstance(calibration, Calibration):
        calibration = Calibration.from_toml(calibration, measure)
    elif measure is not None:
        raise CaromError("fit: give measure to Calibration.of, or the path of a fit and measure here")
    if coarse := checks.coarse(calibration):
        warnings.warn(coarse, CaromWarning, stacklevel=2)
    folder = Folder(Path(out).absolute(), keep=True)
    with folder.driving(), Team.of(workers, scheduler) as team:
        points = Points(calibration, folder, team, retry_failed, progress)
        found = Fit(points, search(points))
    found.write()
    return found


class Fit:
    """The end of a fit. `fit.best` has the values, `fit.interval` their 95 % intervals."""

    def __init__(self, points: Points, found: Found) -> None:
        """The end of a search; runs with a smaller step follow it."""
        self.calibration, self._points, self._found = points.calibration, points, found
        self._residuals = points.residuals[found.best]
        noise = points.scatter if found.noise is None else found.noise
        here, slopes = points.shares[found.best], found.slopes
        self._told = told(
            slopes.jacobian, self._residuals, noise, here, slopes.floor, bool(slopes.jumps), self.converged
        )
        self._shift = shift(points, found.best, self._told)

    @property
    def path(self) -> Path:
        """The folder."""
        return self._points.sweep.path

    @property
    def sweep(self) -> Sweep:
        """All runs as those of a sweep."""
        return self._points.sweep

    @property
    def converged(self) -> bool:
        """Whether the search ended by itself."""
        return bool(self._found.converged)

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals over their variance (uncertainty and noise of the runs)."""
        return self._told.chi2

    @cached_property
    def best(self) -> dict[str, float]:
        """The best values."""
        return self._at(self._points.shares[self._found.best])

    def _at(self, shares: F64) -> dict[str, float]:
        return dict(zip(self.calibration.names, self.calibration.values(shares).tolist(), strict=True))

    @cached_property
    def interval(self) -> dict[str, tuple[float, float] | None]:
        """95 % confidence intervals within the bounds; None where the data do not determine one."""
        here, half = self._points.shares[self._found.best], self._told.half
        low, high = (self._at(np.clip(here + side * half, 0.0, 1.0)) for side in (-1, 1))
        return {name: (low[name], high[name]) if low[name] == low[name] else None for name in low}

    @property
    def correlation(self) -> F64:
        """Of the parameters, (n, n), in the order of `best`; NaN where there is no interval."""
        return self._told.correlation

    @cached_property
    def remarks(self) -> list[str]:
        """What the numbers alone do not say: what is not determined, a poor fit, a search that was cut short."""
        names, slopes = self.calibration.names, self._found.slopes
        found = [] if self.converged else [remarks.of_search(self._found.message, names, self._told)]
        coarse = checks.coarse(self.calibration)
        found += [coarse] if coarse else []
        found += remarks.of_gaps(self.calibration.targets) + remarks.of_data(self._told, names)
        if slopes.jumps:
            method = self.calibration.study.targeting.base.run.method
            found.append(remarks.of_jumps(slopes, names, self._told, method))
        if self._shift is not None and self._shift.large.any():
            found.append(remarks.of_step(self._shift, names, self.step_shift, self._told))
        bad = int((~self._points.good).sum())
        return found + ([remarks.of_failures(bad, self.sweep)] if bad else [])

    @cached_property
    def step_shift(self) -> dict[str, float | None] | None:
        """How far each best value moves where the runs have about half the step; None for runs without a step."""
        if self._shift is None:
            return None
        here = self._points.shares[self._found.best]
        before, after = (self.calibration.values(x) for x in (here, here + self._shift.shares))
        return dict(zip(self.calibration.names, finite((after - before).tolist()), strict=True))

    @property
    def residuals(self) -> dict[str, list[Any]]:
        """Measured, fitted and residual values, as columns: quantity, time (s), and the rest in SI."""
        points, best = self._points, self._found.best
        targets = self.calibration.targets
        return {
            "quantity": [t.quantity for t in targets for _ in t.value],
            "time": [x for t in targets for x in (t.time or [np.nan] * len(t.value))],
            "measured": points.measured.tolist(),
            "uncertainty": points.sigma.tolist(),
            "fitted": points.predicted[best].tolist(),
            "noise": points.noise[best].tolist(),
            "residual over uncertainty": self._residuals.tolist(),
        }

    @property
    def summary(self) -> Mapping[str, Any]:
        """Plain values: `fit.json`, and the document of `carom fit --json`."""
        state, points = self._told, self._points
        return {
            "title": self.calibration.study.title,
            "directory": str(self.path),
            "table": str(self.path / "sweep.parquet"),
            "search": self.calibration.search,
            "converged": self.converged,
            "message": self._found.message,
            "best": self.best,
            "interval_95": self.interval,
            "interval_by": self._found.slopes.by,
            "correlation": self.correlation.tolist(),
            "chi2": state.chi2,
            "degrees_of_freedom": state.freedom,
            "likelihood": state.likelihood,
            "widened": state.widened,
            "step_shift": self.step_shift,
            "remarks": self.remarks,
            "points": len(points.shares),
            "failed_points": int((~points.good).sum()),
            "runs": len(points.sweep) + points.beside_runs,
            "failures": points.sweep.failures,
            "targets": [
                {
                    "place": target.place,
                    "quantity": target.quantity,
                    "values": len(target.value),
                    "left_out": target.left_out,
                    "chi2": chi2,
                }
                for target, chi2 in zip(self.calibration.targets, self._shares_of_chi2(), strict=True)
            ],
            "carom": carom.__version__,
        }

    def _shares_of_chi2(self) -> list[float]:
        ends = np.cumsum([len(target.value) for target in self.calibration.targets])[:-1]
        return [float(np.sum(part**2)) for part in np.split(self._residuals, ends)]

    def write(self) -> None:
        """Write `fit.json` and `residuals.csv`; `carom.fit` has done so."""
        write_whole(inside(self.path, "fit.json"), json_bytes(finite(self.summary), indent=2), durable=False)
        rows = csv_bytes([self.residuals, *zip(*self.residuals.values(), strict=True)])
        write_whole(inside(self.path, "residuals.csv"), rows, durable=False)

    def plot(self, directory: str | Path | None = None, formats: Sequence[str] = ("png",)) -> list[Path]:
        """Measured beside fitted values, residuals, and the path of the search, to `plots` in the folder."""
        require_matplotlib()
        where = Path(directory) if directory is not None else inside(self.path, "plots")
        return save(plot.curves(self), where, "fit", formats) + save(
            plot.path(self._points), where, "search", formats
        )

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in self.best.items())
        return f"<carom.Fit {self.calibration.study.title!r}: {values}; {self.path}>"
