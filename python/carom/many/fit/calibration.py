"""What a fit is: a scenario, parameters with bounds, targets, a search. As a file, or in Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, counted, did_you_mean
from carom.many.fit import checks
from carom.many.fit.data import Measured, Target, read
from carom.many.sweep import study as files
from carom.many.sweep.design import Axis, Design, number, quantity
from carom.many.sweep.study import Measure, Study
from carom.scene.plan import Plan
from carom.scene.scene import Scene

SEARCHES = ("least_squares", "differential_evolution", "gaussian_process")
FILE_KEYS = {
    **{key: value for key, value in files.KEYS.items() if key != "design"},
    "": (*(key for key in files.KEYS[""] if key != "design"), "search", "target"),
    "search": ("kind", "points", "starts", "seed", "difference"),
}
#: Points at most, by method, where nothing else is said: a number, and a number for each parameter.
POINTS = {"least_squares": (0, 100), "differential_evolution": (0, 300), "gaussian_process": (10, 15)}
#: Step of finite differences over the range of a parameter, of runs without noise.
STEP = 0.01


@dataclass(frozen=True)
class Calibration:
    """Parameters of a scenario that are to be fitted to targets. Made by `Calibration.of`, or `Calibration.from_toml`."""

    study: Study
    """The start as a study of one point, with all seeds."""
    axes: tuple[Axis, ...]
    """The parameters with their bounds. Searches see shares of the way from the lower bound to the upper one."""
    start: tuple[float, ...]
    """Values that the search begins with."""
    targets: tuple[Target, ...]
    search: str = "least_squares"
    points: int = 100
    """Points at most; each has a run for each seed."""
    starts: int = 1
    seed: int = 0
    difference: float | None = None
    """Step of finite differences over the range of each parameter."""

    @classmethod
    def of(
        cls,
        scene: Scene | str | Path,
        parameters: Mapping[str, Any],
        targets: Sequence[Mapping[str, Any]],
        *,
        search: str = "least_squares",
        points: int | None = None,
        starts: int = 1,
        seed: int = 0,
        difference: float | None = None,
        measure: Measure | None = None,
        folder: str | Path = ".",
        **options: Any,
    ) -> Calibration:
        """A fit in Python; the arguments are the keys of a file, `options` those of `Study.of`.

        `parameters` has a pair `(low, high)` or a table with `low`, `high`, `start` and `log` for each parameter, and
        `{"seeds": N}` for a seed over which is averaged. `targets` are tables like `[[target]]`; their files are looked for
        in `folder`.
        """
        if search not in SEARCHES:
            raise CaromError(
                f"search.kind: no search is called {search!r}; {did_you_mean(str(search), SEARCHES)}"
            )
        axes, start = [], []
        for name, given in parameters.items():
            table = dict(given) if isinstance(given, Mapping) else given
            first = table.pop("start", None) if isinstance(table, dict) else None
            pair = isinstance(table, tuple) and len(table) == 2
            if not pair and not (
                isinstance(table, dict) and ({"low", "high"} <= set(table) or "seeds" in table)
            ):
                raise CaromError(
                    f"parameters.{name}: a fit needs bounds; write {name} = {{ low = A, high = B }}, or seeds = N for"
                    " seeds over which is averaged"
                )
            axis = Axis.of(name, table)
            if axis.count is not None or (axis.values and not axis.crossed):
                raise CaromError(
                    f"parameters.{name}: count and values are of a study; leave them out of a fit"
                )
            axes.append(axis)
            if axis.crossed and first is not None:
                raise CaromError(f"parameters.{name}: seeds stands alone, found start too")
            if not axis.crossed:
                value = (
                    float(axis.at(np.array(0.5)))
                    if first is None
                    else quantity(f"parameters.{name}.start", first, axis.quantity)
                )
                if not axis.low <= value <= axis.high:
                    raise CaromError(
                        f"parameters.{name}: start = {value:g} is outside {axis.low:g} to {axis.high:g}"
                    )
                start.append(value)
        fitted = tuple(axis for axis in axes if not axis.crossed)
        if not fitted:
            raise CaromError(
                "parameters: nothing to fit; write NAME = { low = A, high = B } below [parameters]"
            )
        found = [t for k, given in enumerate(targets, 1) for t in read(f"target {k}", given, Path(folder))]
        data = sum(len(target.value) for target in found)
        if data < len(fitted):
            raise CaromError(
                f"{counted(data, 'measured value')} cannot determine {counted(len(fitted), 'parameter')};"
                " give more targets, or fit fewer parameters"
            )
        curves = {(target.quantity, target.time) for target in found if target.time is not None}
        study = Study.of(
            scene, {axis.name: {"seeds": len(axis.values)} for axis in axes if axis.crossed},
            table={axis.name: [value] for axis, value in zip(fitted, start, strict=True)},
            measure=Measured(tuple(sorted(curves)), measure) if curves or measure is not None else None,
            check=False, **options,
        )  # fmt: skip
        base, each = POINTS[search]
        most = base + each * len(fitted) if points is None else points
        made = cls(study, fitted, tuple(start), tuple(found), search, most, starts, seed, difference)
        plan = made.plan  # refuses impossible bounds, from which an impossible start may follow
        study.targeting.check_units({axis.name: axis.quantity for axis in axes})
        study.check()
        made._check(measure is not None)
        if plan is not None:
            checks.times(made.targets, plan.until)
        return made

    @classmethod
    def from_toml(cls, path: str | Path, measure: Measure | None = None) -> Calibration:
        """The fit of a file; paths in it are relative to it."""
        path = Path(path)
        with files.named_in(path):
            raw = files.tables(path, FILE_KEYS)
            given = files.arguments(path, raw)
            for key in ("design", "table"):
                del given[key]
            targets = raw.get("target", [])
            if not isinstance(targets, list) or not targets:
                raise CaromError(
                    "no target; write [[target]] with quantity, value and uncertainty, or a file"
                )
            settings = dict(raw.get("search", {}))
            settings["search"] = settings.pop("kind", SEARCHES[0])
            return cls.of(
                **{**given, "parameters": raw.get("parameters", {})},
                targets=targets, measure=measure, folder=path.parent, **settings,
            )  # fmt: skip

    def _check(self, free: bool) -> None:
        """Refuse what cannot be searched. `free`: what a measure returns is not known before it is called."""
        for name, value, least in (
            ("points", self.points, 1),
            ("starts", self.starts, 1),
            ("seed", self.seed, 0),
        ):
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise CaromError(f"search.{name}: expected a whole number from {least}, found {value!r}")
        if self.starts > 1 and self.search != SEARCHES[0]:
            raise CaromError(
                f"search.starts: {self.search} has no starts; leave it out, or take kind = {SEARCHES[0]}"
            )
        if self.points < self.first_points:
            raise CaromError(
                f"search.points = {self.points}: {self.search} begins with {self.first_points} points; give at least those"
            )
        if self.difference is not None and not 0 < number("search.difference", self.difference) <= 0.5:
            raise CaromError(
                f"search.difference: expected a share of the range up to 0.5, found {self.difference!r}"
            )
        checks.quantities(self, free)

    @cached_property
    def plan(self) -> Plan | None:
        """Steps and frames of all runs; None if they depend on a parameter."""
        return checks.plan_of(self)

    @property
    def first_points(self) -> int:
        """Points that the search asks for at once at its beginning."""
        n = len(self.axes)
        return {
            "least_squares": self.starts,
            "differential_evolution": max(8, 8 * n),
            "gaussian_process": 4 * n + 4,
        }[self.search]

    @property
    def names(self) -> list[str]:
        """The parameters that are fitted."""
        return [axis.name for axis in self.axes]

    @cached_property
    def seeds(self) -> int:
        """Runs for each point."""
        return self.study.cases

    @property
    def first(self) -> F64:
        """The start as shares of the ranges."""
        return np.array([share_of(axis, value) for axis, value in zip(self.axes, self.start, strict=True)])

    def values(self, shares: F64) -> F64:
        """Values of the parameters at shares of their ranges, (..., parameters)."""
        return np.stack([axis.at(shares[..., k]) for k, axis in enumerate(self.axes)], axis=-1)

    def study_of(self, points: F64) -> Study:
        """The study with these values of the parameters, (points, parameters)."""
        table = {name: points[:, k].tolist() for k, name in enumerate(self.names)}
        return replace(self.study, design=Design("table", table=table))


def share_of(axis: Axis, value: float) -> float:
    """The inverse of `axis.at`."""
    if axis.log:
        return float(np.log(value / axis.low) / np.log(axis.high / axis.low))
    return (value - axis.low) / (axis.high - axis.low)
