"""Points of a study: grids, tables, Latin hypercubes and Sobol sequences over named axes."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom import units
from carom.arrays import F64
from carom.errors import CaromError, did_you_mean, extra, nearest
from carom.numeric import is_finite, masked
from carom.scene.tables.laws import parse
from carom.scene.toml.formulas import blank, is_formula

RANDOM = ("lhs", "sobol")
KINDS = ("grid", "table", *RANDOM)
#: Points of a study at most: what is listed in memory several times.
MOST_POINTS = 20_000_000


@dataclass(frozen=True)
class Axis:
    """What varies: listed `values`, or a range from `low` to `high` with `count` points on a grid, evenly spaced in the
    logarithm if `log`. With `crossed` every point of any design is taken with each of the values: seeds, repetitions.
    """

    name: str
    values: tuple[float, ...] = ()
    low: float = 0.0
    high: float = 0.0
    count: int | None = None
    log: bool = False
    crossed: bool = False
    quantity: str | None = None
    """A text with a unit that was given; others have its dimension, or no unit."""

    @classmethod
    def of(cls, name: str, given: Any) -> Axis:
        """From `[1, 2, 3]`, a number, `(low, high)`, or a table with `values`, `low`, `high`, `count`, `log` or `seeds`."""
        if isinstance(given, tuple) and len(given) == 2:
            given = {"low": given[0], "high": given[1]}
        if isinstance(given, Mapping):
            return cls._of_table(name, dict(given))
        if masked(given):
            raise CaromError(
                f"parameters.{name}: some of the values are masked; fill them, or leave them out"
            )
        values = np.atleast_1d(np.asarray(given, dtype=object)).tolist()
        return cls(name, _numbers(name, values), quantity=with_unit(values))

    @classmethod
    def _of_table(cls, name: str, given: dict[str, Any]) -> Axis:
        known = ("values", "low", "high", "count", "log", "seeds")
        for key in given:
            if key not in known:
                cure = did_you_mean(key, known)
                # TOML takes a name with a point for a table.
                if isinstance(given[key], (list, dict)) and not nearest(key, known):
                    cure = f'for a place of this name write it in quotes: "{name}.{key}" = ...'
                raise CaromError(f"parameters.{name}: unknown key {key}; {cure}")
        if "seeds" in given:
            count = _whole(f"parameters.{name}.seeds", given.pop("seeds"))
            if given:
                raise CaromError(f"parameters.{name}: seeds stands alone, found {', '.join(given)} too")
            return cls(name, tuple(float(k + 1) for k in range(count)), crossed=True)
        if "values" in given:
            values = given.pop("values")
            if given or not isinstance(values, (list, tuple)):
                raise CaromError(f"parameters.{name}: give values = [...] alone, or low and high")
            return cls(name, _numbers(name, values), quantity=with_unit(values))
        if not {"low", "high"} <= set(given):
            raise CaromError(f"parameters.{name}: give values = [...], or low and high, or seeds")
        ends = [given["low"], given["high"]]
        low, high = _numbers(name, ends)
        points = None if "count" not in given else _whole(f"parameters.{name}.count", given["count"])
        log = given.get("log", False)
        if not isinstance(log, bool):
            raise CaromError(f"parameters.{name}.log: expected true or false, found {log!r}")
        if not low < high or (log and low <= 0):
            rule = "0 < low < high" if log else "low < high"
            raise CaromError(f"parameters.{name}: low = {low:g}, high = {high:g}; wanted {rule}")
        return cls(name, (), low, high, points, log, quantity=with_unit(ends))

    def on_grid(self) -> F64:
        """Its points on a grid."""
        if self.values:
            return np.array(self.values)
        if self.count is None:
            raise CaromError(f"parameters.{self.name}: a grid needs count = N points from low to high")
        return self.at(np.linspace(0.0, 1.0, self.count))

    def at(self, share: F64) -> F64:
        """Values at shares in [0, 1) of the way; of listed values each has an equal part of it."""
        if self.values:
            place = np.minimum((share * len(self.values)).astype(int), len(self.values) - 1)
            return np.asarray(np.array(self.values)[place])
        if self.log:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + (self.high - self.low) * share)


@dataclass(frozen=True)
class Design:
    """How points are chosen: `kind` of `KINDS`; `count` and `seed` of the random ones, columns of a `table`.

    A Sobol sequence with a greater count begins with the same points, so such a study can grow; a Latin hypercube cannot.
    """

    kind: str = "grid"
    count: int | None = None
    seed: int = 0
    table: Mapping[str, Sequence[float | str]] | None = None

    def points(self, axes: Sequence[Axis]) -> dict[str, F64]:
        """Values of every axis, (cases,) each; axes that are `crossed` vary fastest."""
        if self.kind not in KINDS:
            raise CaromError(
                f"design.kind: no design is called {self.kind!r}; {did_you_mean(self.kind, KINDS)}"
            )
        plain = [axis for axis in axes if not axis.crossed]
        self._used(plain)
        if self.kind == "grid":
            found = _grid([*plain, *(axis for axis in axes if axis.crossed)])
        else:
            found = self._table(plain) if self.kind == "table" else self._sampled(plain)
            for axis in axes:
                if axis.crossed:
                    rows = len(next(iter(found.values()), np.zeros(1)))
                    _fits(rows * len(axis.values), "study")
                    found = {name: np.repeat(values, len(axis.values)) for name, values in found.items()}
                    found[axis.name] = np.tile(axis.values, rows)
        cases = len(next(iter(found.values()), ()))
        if not cases:
            raise CaromError("the study has no case: give [parameters], or a table with rows")
        return found

    def _used(self, axes: Sequence[Axis]) -> None:
        """Refuse what this design would leave aside without a word."""
        if self.kind in RANDOM:
            counted = [axis.name for axis in axes if axis.count is not None]
            if counted:
                raise CaromError(
                    f"parameters.{counted[0]}: count belongs to a grid; {self.kind} takes design.count = N points in all"
                )
            if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
                raise CaromError(f"design.seed: expected a whole number from 0, found {self.seed!r}")
        elif self.count is not None:
            cure = (
                "give each range its count" if self.kind == "grid" else "the rows of the table are the points"
            )
            raise CaromError(f"design.count belongs to {' and '.join(RANDOM)}; {cure}")

    def _table(self, axes: Sequence[Axis]) -> dict[str, F64]:
        if axes:
            names = ", ".join(axis.name for axis in axes)
            raise CaromError(
                f"a design of kind table takes its columns from the table; leave out {names} (seeds may stay)"
            )
        if not self.table:
            raise CaromError(
                "design.kind = table needs design.file, a CSV file with one column per parameter"
            )
        columns = {name: np.array(_numbers(name, values)) for name, values in self.table.items()}
        if len({len(values) for values in columns.values()}) > 1:
            told = ", ".join(f"{name} {len(values)}" for name, values in columns.items())
            raise CaromError(f"the columns of the table must be equally long, found {told} rows")
        return columns

    def _sampled(self, axes: Sequence[Axis]) -> dict[str, F64]:
        if self.count is None:
            raise CaromError(f"design.kind = {self.kind} needs design.count = N points")
        _whole("design.count", self.count)
        if not axes:
            raise CaromError(f"design.kind = {self.kind} needs [parameters] to choose points of")
        qmc = extra("scipy.stats.qmc", f"the design {self.kind} needs scipy", "cluster")
        engine = qmc.Sobol if self.kind == "sobol" else qmc.LatinHypercube
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", UserWarning
            )  # that 2^m points are balanced best; the manual says so
            shares = engine(len(axes), rng=self.seed).random(self.count)
        return {axis.name: axis.at(shares[:, i]) for i, axis in enumerate(axes)}


def _grid(axes: Sequence[Axis]) -> dict[str, F64]:
    values = [axis.on_grid() for axis in axes]
    _fits(math.prod(len(v) for v in values), "grid")
    mesh = np.meshgrid(*values, indexing="ij") if values else []
    return {axis.name: m.ravel() for axis, m in zip(axes, mesh, strict=True)}


def _fits(size: int, what: str) -> None:
    if size > MOST_POINTS:
        cure = ", or a design lhs or sobol" if what == "grid" else ""
        raise CaromError(f"the {what} has {size} points, more than {MOST_POINTS}; take fewer{cure}")


def _numbers(name: str, values: Any) -> tuple[float, ...]:
    found = [quantity(f"parameters.{name}", value, with_unit(values)) for value in values]
    if not found:
        raise CaromError(f"parameters.{name}: the list of values is empty")
    return tuple(found)


def with_unit(values: Iterable[Any]) -> str | None:
    """The first of some values that is a quantity with a unit."""
    return next((value for value in values if isinstance(value, str) and not is_formula(value)), None)


def quantity(place: str, value: Any, like: str | None = None) -> float:
    """A finite number in SI, also of a text as in `[parameters]` of a scenario: a quantity of the dimension of `like`, or an
    expression of numbers.
    """
    if isinstance(value, str):
        try:
            value = parse(blank(value)).evaluate({}) if is_formula(value) else units.parse(value, like=like)
        except ValueError as error:
            raise CaromError(f"{place}: {error}") from error
    return number(place, value)


def number(place: str, value: Any) -> float:
    """A finite number; `place` says in the message where it was given."""
    if not is_finite(value):
        raise CaromError(f"{place}: expected numbers in SI units, found {value!r}")
    return float(value)


def _whole(place: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_POINTS:
        raise CaromError(f"{place}: expected a whole number from 1 to {MOST_POINTS}, found {value!r}")
    return value
