"""The points of a search: each is some cases of one sweep, whose folder keeps them. What is there is not computed again."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, Bool
from carom.errors import CaromError, CaromWarning, counted
from carom.many.fit.calibration import Calibration
from carom.many.sweep.folder import Folder
from carom.many.sweep.run import Team, complete
from carom.many.sweep.study import Study
from carom.many.sweep.table import Sweep


class Exhausted(Exception):
    """The search asked for more points than it may have."""


@dataclass(frozen=True)
class State:
    """Where a fit stands."""

    points: int
    most: int
    failed: int
    """Points of which a run failed."""
    best: float
    """Least chi squared so far."""
    wall_s: float


class Points:
    """Evaluates points in the order of the search, so that a search that is repeated asks for the same ones."""

    sweep: Sweep
    """All runs so far."""

    def __init__(
        self,
        calibration: Calibration,
        folder: Folder,
        team: Team,
        retry_failed: bool,
        progress: Callable[[State], None] | None,
    ) -> None:
        self.calibration = calibration
        self._folder, self._team, self._retry, self._progress = folder, team, retry_failed, progress
        self._start, self._warned = time.perf_counter(), False
        targets = calibration.targets
        self.measured = np.concatenate([t.value for t in targets])
        self.sigma = np.concatenate([t.uncertainty for t in targets])
        self._columns = [column for t in targets for column in t.columns]
        n, m = len(calibration.axes), len(self.measured)
        self._rows: dict[tuple[float, ...], int] = {}
        self.shares = np.zeros((0, n))
        self.predicted = np.zeros((0, m))
        """Mean over the seeds; NaN where a run failed."""
        self.noise = np.zeros((0, m))
        """Standard error of that mean; 0 for runs of one seed."""
        self.new, self.limited, self.beside_runs = 0, True, 0

    @property
    def residuals(self) -> F64:
        """Of all points so far, over the uncertainties, (points, data)."""
        return np.asarray((self.predicted - self.measured) / self.sigma)

    @property
    def chi2(self) -> F64:
        """Of all points so far; infinite where a run failed."""
        found = np.sum(self.residuals**2, axis=1)
        return np.where(np.isfinite(found), found, np.inf)

    @property
    def good(self) -> Bool:
        """Points whose runs all ended."""
        return np.isfinite(self.chi2)

    @property
    def scatter(self) -> F64:
        """Standard error of a point over the uncertainties, (data,): the root mean square over all points."""
        return np.asarray(np.sqrt(np.mean(self.noise[self.good] ** 2, axis=0)) / self.sigma)

    def at(self, shares: F64) -> list[int]:
        """Numbers of the points at these shares, (k, parameters): all that are new are computed at once."""
        shares = np.atleast_2d(shares)
        values = self.calibration.values(shares)
        keys = [tuple(row) for row in values.tolist()]
        new = list(dict.fromkeys(key for key in keys if key not in self._rows))
        if not new:
            return [self._rows[key] for key in keys]
        if self.limited and len(self._rows) + len(new) > self.calibration.points:
            raise Exhausted
        for key in new:
            self.shares = np.vstack([self.shares, shares[keys.index(key)]])
            self._rows[key] = len(self._rows)
        self._compute()
        return [self._rows[key] for key in keys]

    def _compute(self) -> None:
        study = self.calibration.study_of(np.array([*self._rows]))
        with warnings.catch_warnings():
            if self._warned:  # rows of another Carom are reported once
                warnings.simplefilter("ignore", CaromWarning)
            self.sweep = complete(study, self._folder, self._team, self._retry)
        self._warned |= self.sweep.progress.new > 0
        self.new += self.sweep.progress.new
        first = len(self.predicted)
        predicted, noise = self._read(self.sweep)
        self.predicted = np.vstack([self.predicted, predicted[first:]])
        self.noise = np.vstack([self.noise, noise[first:]])
        if not self.good.any():
            failures = self.sweep.failures
            reason = (
                f"{failures[0]['outcome']}: {failures[0]['message']}"
                if failures
                else "a target is not finite"
            )
            raise CaromError(
                f"all runs of the first {counted(len(self._rows), 'point')} failed, so no search can begin ({reason});"
                " give other bounds, or start values that can be simulated"
            )
        if self._progress is not None:
            elapsed = time.perf_counter() - self._start
            bad = int((~self.good).sum())
            best = float(self.chi2.min())
            self._progress(State(len(self._rows), self.calibration.points, bad, best, elapsed))

    def _read(self, sweep: Sweep) -> tuple[F64, F64]:
        """Mean over the seeds at each point of a sweep, and its standard error; NaN where a run failed."""
        seeds = self.calibration.seeds
        missing = [name for name in self._columns if name not in sweep.columns]
        if missing and sweep.ok.any():
            there = [name for name in sweep.columns if "." not in name]
            raise CaromError(f"no run gives {missing[0]}, a target; columns of the runs: {', '.join(there)}")
        values = [
            sweep[name] if name not in missing else np.full(len(sweep), np.nan) for name in self._columns
        ]
        runs = np.stack(values, axis=-1).reshape(len(sweep) // seeds, seeds, -1)
        runs[~np.asarray(sweep.ok).reshape(-1, seeds).all(axis=1)] = np.nan
        error = runs.std(axis=1, ddof=1) / np.sqrt(seeds) if seeds > 1 else np.zeros_like(runs[:, 0])
        return runs.mean(axis=1), np.nan_to_num(error)

    def beside(self, study: Study, name: str) -> tuple[F64, F64]:
        """The same of another study, whose folder is `name` in that of the points."""
        folder = Folder(self._folder.path / name, keep=True)
        with folder.driving():
            sweep = complete(study, folder, self._team, self._retry)
        self.beside_runs += len(sweep)
        return self._read(sweep)
