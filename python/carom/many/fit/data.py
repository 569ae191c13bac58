"""What a fit is fitted to: measured numbers and curves with their uncertainties, in SI units."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from carom import units
from carom.arrays import F64
from carom.errors import CaromError, counted, did_you_mean, quoted
from carom.many.sweep.study import Measure, identity_of
from carom.many.sweep.table_file import read_table
from carom.numeric import is_finite, reals
from carom.result.kinematics import QUANTITIES
from carom.run.result import Result

#: Keys of a target without a file, and of one with it.
NUMBERS = ("quantity", "value", "uncertainty", "time")
OF_FILE = ("file", "columns", "ball", "uncertainty", "time", "unit", "time_unit")
KEYS = tuple(dict.fromkeys((*NUMBERS, *OF_FILE)))
#: What to do with a key that the target has no use for, beside a file and without one.
BESIDE_FILE = {
    "quantity": 'name it in columns, as columns = { "x1" = "BALL.position.x" }',
    "value": "leave it out, or write a target of its own for it",
}
WITHOUT_FILE = {
    "columns": 'write file = "FILE.csv" as well, or leave it out',
    "ball": 'write quantity = "BALL.position.x", or file = "FILE.csv" with columns x, y and z',
    "unit": 'write the unit with the value, as value = "0.5 mm"',
    "time_unit": 'write the unit with the times, as time = ["10 ms", "20 ms"]',
}
#: Names of the column of times, where the target names none.
TIMES = ("time", "t")
#: Share of the end of a run by which times may be beyond it: they are rounded, as 1/30 s in a table of six digits is.
ROUNDED = 1e-5
#: Dimension of each quantity of a ball that moves.
DIMENSIONS = {"position": "length", "velocity": "speed", "angular_velocity": "angular speed"}
_HEADING = re.compile(r"(.*?)\s*[(\[]([^)\]]*)[)\]]\s*")


@dataclass(frozen=True)
class Target:
    """One measured number (`time` is None), or one measured curve."""

    place: str
    """Where it was given, for messages."""
    quantity: str
    """A column of the sweep's table, or what a curve is of: `a.position.x`, or a name that the measure returns."""
    value: tuple[float, ...]
    uncertainty: tuple[float, ...]
    """Standard deviations of the values."""
    time: tuple[float, ...] | None = None
    lines: tuple[int, ...] = ()
    """Lines of the file that the values are from."""
    left_out: int = 0
    """Rows of the file without a number."""

    @property
    def columns(self) -> list[str]:
        """Columns of the table that stand beside the values."""
        return [self.quantity] if self.time is None else columns(self.quantity, self.time)


def columns(quantity: str, times: Sequence[float]) -> list[str]:
    """Columns of a curve at some times."""
    return [f"{quantity} at {t!r} s" for t in times]


def moving(quantity: str) -> tuple[str, str, str] | None:
    """Ball, quantity and component of `a.position.x`; None where it is no such name."""
    parts = quantity.rsplit(".", 2)
    ok = len(parts) == 3 and parts[1] in QUANTITIES and parts[2] in QUANTITIES[parts[1]][0]
    return (parts[0], parts[1], parts[2]) if ok else None


@dataclass(frozen=True)
class Measured:
    """The measure of a fit's runs: what `function` returns, with its curves and those of the balls read at fixed times.

    Beside numbers `function` may return curves, `{name: (times, values)}`.
    """

    curves: tuple[tuple[str, tuple[float, ...]], ...]
    function: Measure | None

    @property
    def identity(self) -> str:
        """What distinguishes it from other measures."""
        return repr((self.curves, identity_of(self.function)))

    def __call__(self, result: Result) -> dict[str, float]:
        """Numbers by the names of their columns."""
        returned = self.function(result) if self.function is not None else {}
        try:
            given: dict[str, Any] = dict(returned)
        except (TypeError, ValueError):
            raise CaromError(
                f"it returned {returned!r:.80}; return numbers and curves by name, as {{'height': 0.1}}"
            ) from None
        found = {name: float(value) for name, value in given.items() if np.ndim(value) == 0}
        for quantity, times in self.curves:
            t, values = _curve(result, quantity, given)
            late = max(times) - t[-1]
            if late > ROUNDED * t[-1]:
                raise CaromError(
                    f"{quantity}: the run ends {late:.3g} s before the last time of the target; raise run.until"
                )
            found |= dict(zip(columns(quantity, times), np.interp(times, t, values).tolist(), strict=True))
        return found


def _curve(result: Result, quantity: str, given: Mapping[str, Any]) -> tuple[F64, F64]:
    if quantity in given:
        t, values = (reals(part) for part in given[quantity])
        return t, values
    place = moving(quantity)
    if place is None:
        raise CaromError(f"no curve is called {quantity}; {did_you_mean(quantity, list(given))}")
    ball, name, letter = place
    values = np.asarray(getattr(result[ball], name))[:, QUANTITIES[name][0].index(letter)]
    return np.asarray(result.time), values


def read(place: str, given: Mapping[str, Any], folder: Path) -> list[Target]:
    """The targets of one table `[[target]]`, whose file is looked for in `folder`."""
    _fitting(place, given)
    if "file" in given:
        return _of_file(place, given, folder / str(given["file"]))
    if not isinstance(given.get("quantity"), str) or "value" not in given:
        raise CaromError(f'{place}: write quantity = "NAME" and value = NUMBER, or file = "FILE.csv"')
    quantity = given["quantity"]
    values = _si(f"{place}.value", given["value"], quantity)
    time = None if "time" not in given else _si(f"{place}.time", given["time"], None)
    if len(values) != (1 if time is None else len(time)):
        told = counted(len(values), "value") + (" needs" if len(values) == 1 else " need")
        raise CaromError(f"{place}: {told} time = [...] with as many times")
    sigma = _si(f"{place}.uncertainty", given["uncertainty"], quantity)
    return [_target(place, quantity, values, sigma, time)]


def _fitting(place: str, given: Mapping[str, Any]) -> None:
    """Refuse keys that are unknown, missing, or of no use beside the others."""
    if not isinstance(given, Mapping):
        raise CaromError(
            f"{place}: expected a table, found {quoted(given)}; write quantity, value, uncertainty"
        )
    for key in given:
        if key not in KEYS:
            raise CaromError(f"{place}: unknown key {key}; {did_you_mean(str(key), KEYS)}")
    beside = "file" in given
    for key, cure in (BESIDE_FILE if beside else WITHOUT_FILE).items():
        if key in given:
            raise CaromError(f"{place}: {key} does nothing {'beside' if beside else 'without'} file; {cure}")
    if {"ball", "columns"} <= set(given):
        raise CaromError(
            f"{place}: ball does nothing beside columns; leave it out, or name its places in columns"
        )
    if beside and not isinstance(given.get("time", ""), str):
        raise CaromError(
            f"{place}.time: expected the name of a column, found {quoted(given['time'])}; times are those of the file"
        )
    if "uncertainty" not in given:
        raise CaromError(f"{place}: uncertainty is missing; write the standard deviation of the values")


def _of_file(place: str, given: Mapping[str, Any], path: Path) -> list[Target]:
    read_, table = read_table(path, gaps=True), {}
    for heading, numbers in read_.columns.items():
        name, unit = match.groups() if (match := _HEADING.fullmatch(heading)) else (heading, None)
        table[name] = (numbers, unit)
    named = given.get("time", next((name for name in TIMES if name in table), TIMES[0]))
    chosen = given.get("columns")
    if chosen is None and isinstance(given.get("ball"), str):
        chosen = {x: f"{given['ball']}.position.{x}" for x in "xyz" if x in table}
    if (
        not isinstance(chosen, Mapping)
        or not chosen
        or not all(isinstance(name, str) for name in chosen.values())
    ):
        cure = 'columns = { "x1" = "BALL.position.x" }, or ball = "BALL" for columns x, y and z'
        raise CaromError(f"{place}: {path} needs to be told what its columns are; write {cure}")
    for name in (named, *chosen):
        if name not in table:
            raise CaromError(f"{place}: {path} has no column {quoted(name)}; {did_you_mean(name, [*table])}")

    def read_off(name: str, quantity: str | None, key: str, beside: str | None = None) -> F64:
        numbers, own = table[name]
        unit = next((u for u in (own, given.get(key), beside) if u is not None), None)
        return np.array(numbers) * (
            1.0 if not unit else _read(f"{place}: {path}, column {name}", units.factor, unit, quantity)
        )

    sigma = given["uncertainty"]
    twice = next((name for name in chosen if name in (named, sigma)), None)
    if twice is not None:
        told = f"column {quoted(twice)} is measured, and is its own {'time' if twice == named else 'uncertainty'}"
        raise CaromError(f"{place}: {path}: {told}; name another column")
    own = [*chosen, *([sigma] if isinstance(sigma, str) and sigma in table else [])]
    for key, names in (("unit", own), ("time_unit", [named])):
        if key in given and all(table[name][1] is not None for name in names):
            told = counted(len(names), "column")
            raise CaromError(
                f"{place}: {key} does nothing: headings have the units of {told} in {path}; leave it out"
            )
    time = read_off(named, None, "time_unit")
    found = []
    for name, quantity in chosen.items():
        here = f"{place}: {path}, column {name}"
        if isinstance(sigma, str) and sigma in table:
            deviations = read_off(sigma, quantity, "unit", table[name][1])
        else:
            deviations = np.array(_si(f"{place}.uncertainty", sigma, quantity))
        values = read_off(name, quantity, "unit")
        if len(deviations) == 1:
            deviations = np.repeat(deviations, len(values))
        found.append(_present(here, quantity, values, deviations, time, read_.lines))
    return found


def _present(place: str, quantity: str, values: F64, sigma: F64, time: F64, lines: Sequence[int]) -> Target:
    """The target of a column: of the rows that have a number and its uncertainty."""
    if len(sigma) != len(values):
        told = f"{counted(len(sigma), 'number')} for {counted(len(values), 'row')}"
        raise CaromError(f"{place}: uncertainty has {told}; give one number, or one for each row")
    there = np.isfinite(values) & np.isfinite(sigma)
    if not there.any():
        raise CaromError(f"{place} has no number with an uncertainty; leave it out of the target")
    untimed = [line for line, ok, t in zip(lines, there, time, strict=True) if ok and t != t]
    if untimed:
        raise CaromError(
            f"{place}, row {untimed[0]}: a number without a time; write its time, or leave out the row"
        )
    values, sigma, time = values[there], sigma[there], time[there]
    target = _target(place, quantity, tuple(values.tolist()), tuple(sigma.tolist()), tuple(time.tolist()))
    kept = tuple(line for line, ok in zip(lines, there, strict=True) if ok)
    return replace(target, lines=kept, left_out=int((~there).sum()))


def _target(
    place: str,
    quantity: str,
    values: tuple[float, ...],
    sigma: tuple[float, ...],
    time: tuple[float, ...] | None,
) -> Target:
    sigma = sigma * len(values) if len(sigma) == 1 else sigma
    if len(sigma) != len(values):
        told = f"{counted(len(sigma), 'number')} for {counted(len(values), 'value')}"
        raise CaromError(f"{place}: uncertainty has {told}; give one number, or one for each value")
    if not all(s > 0 for s in sigma):
        raise CaromError(f"{place}: uncertainty must be above 0, found {min(sigma):g}")
    if time is not None and (min(time) < 0 or len(set(time)) < len(time)):
        raise CaromError(f"{place}: times must be from 0 on, each once; the run begins at 0")
    return Target(place, quantity, values, sigma, time)


def _si(place: str, given: Any, quantity: str | None) -> tuple[float, ...]:
    """Numbers in SI, or texts `0.5 mm`."""
    found = []
    for value in given if isinstance(given, (list, tuple, np.ndarray)) else [given]:
        if isinstance(value, str):
            if units.after_the_number(value) is None:
                raise CaromError(f'{place}: {quoted(value)} is no "NUMBER UNIT" and no column')
            value = _read(place, units.parse, value, quantity)
        if not is_finite(value):
            raise CaromError(f"{place}: expected a finite number in SI units, found {quoted(value)}")
        found.append(float(value))
    if not found:
        raise CaromError(f"{place}: the list is empty; give at least one number")
    return tuple(found)


def _read(place: str, reader: Callable[[str, str | None], float], text: str, quantity: str | None) -> float:
    """What a reader of units makes of a text. That of a ball's quantity must have its dimension, a time that of time."""
    known = moving(quantity) if quantity is not None else None
    dimension = "time" if quantity is None else DIMENSIONS.get(known[1]) if known else None
    try:
        return reader(text, dimension)
    except units.UnitError as error:
        raise CaromError(f"{place}: {error}") from error
