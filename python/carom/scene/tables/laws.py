"""Laws of one variable: a number, a polynomial, a table or an expression in `t` (time, s) or `v` (a speed, m/s).

A law is kept as a float, or as a dict with one of the keys `polynomial`, `table`, `expression` (a text is the last). What is
constant is the float: what knows numbers alone, as method `events` on level walls, takes it however it is written. The core
evaluates it in the steps; here it is only looked at before a run, to say what is wrong with it.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import PydanticCustomError

from carom import _core, units
from carom.errors import did_you_mean, quoted
from carom.scene.tables.fields import ANY, Bounds, Checked, Quantity, inside, refuse
from carom.scene.tables.lists import Vector, as_list, each

if TYPE_CHECKING:
    from carom._core import Expression

LawValue = float | dict[str, Any]
"""A float, `{"polynomial": [c0, ...]}`, `{"table": [[x, y], ...]}` or `{"expression": text}`."""

FORMS = ("polynomial", "table", "expression")
MOST_COEFFICIENTS, MOST_POINTS = 100, 100_000
FORWARD = (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25)
"""Weights of the first derivative in values at 0, 1, 2, 3 and 4 steps, of fourth order."""
BREAKS = (
    "a run that evaluates it there stops, and one whose steps go over it means nothing from there on:"
    " change the law or until"
)
"""What a law of the time without a value does, and the cure."""
_NUMBER = Quantity()
_POINT = Vector(size=2)


@dataclass(frozen=True)
class Law(Checked):
    """A law of `variable` whose values have `dimension`; `bounds` hold for a constant, for the
    value at zero and for the points of a table from there on. Where it `moves` something its slope is a speed."""

    variable: str
    dimension: str = "number"
    bounds: Bounds = ANY
    moves: bool = False

    def check(self, value: Any) -> LawValue:
        if self.writes_formula(value):
            return self.check({"expression": value})
        if not isinstance(value, Mapping):
            return self._constant(value)
        unknown = [key for key in value if key not in FORMS]
        if unknown:
            cause = f"{quoted(str(unknown[0]))} is no kind of law"
            raise refuse(cause, did_you_mean(str(unknown[0]), FORMS), (str(unknown[0]),))
        if len(value) != 1:
            cause = "a law has one key, found " + (" and ".join(value) or "none")
            raise refuse(cause, f"give one of {', '.join(FORMS)}")
        ((form, given),) = value.items()
        try:
            values = _FORMS[form](given, self.variable)
        except PydanticCustomError as e:
            raise inside(form, e) from None
        law: LawValue = {form: values}
        start = value_at(law, 0.0)
        if not math.isfinite(start):
            cause = f"has no finite value at {self.variable} = 0{fault_at(law, 0.0)}"
            raise refuse(cause, f"change the {form}", (form,))
        if not self.bounds.hold(start):
            wanted = self.bounds.words()
            cause = f"must be {wanted} at {self.variable} = 0, found {start:.6g}"
            raise refuse(cause, f"change the {form} so that its value there is {wanted}", (form,))
        if self.moves and not math.isfinite(slope_of(law, 0.0)):
            cause = f"has no finite slope at {self.variable} = 0, where it moves something"
            cure = f"change the {form}, so that it begins with a speed; t^1.5 has one, t*sqrt(t) as a product none"
            raise refuse(cause, cure, (form,))
        for k, (x, y) in enumerate(values if form == "table" else ()):
            if x >= 0.0 and not self.bounds.hold(y):
                cause = f"must be {self.bounds.words()} everywhere, found {y:.6g} at {self.variable} = {x:g}"
                raise refuse(cause, "change this point", (form, k))
        return start if _constant(form, values) else law

    def writes_formula(self, value: Any) -> bool:
        """Whether a value is a formula: a text that is no number, with a unit or without, nor one of parameters of a file.

        What cannot be read is meant as a formula if it does not begin with a number, or goes on as no unit does.
        """
        if not isinstance(value, str) or value.lstrip().startswith("="):
            return False
        rest = units.after_the_number(value)
        if rest == "":
            return self.dimension == "number"  # else its unit was forgotten
        with suppress(units.UnitError):
            units.parse(value, self.dimension)
            return False
        return rest is None or re.search(rf"^[-*/^]|[()+]|- |\b{self.variable}\b", rest) is not None

    def _constant(self, value: Any) -> float:
        try:
            return Quantity(self.dimension, self.bounds).check(value)
        except PydanticCustomError as e:
            if callable(value):
                cure = "a Python function is a load of its own: scene.load_function(f)"
                raise refuse("expected a number or a law, found a function", cure) from None
            if isinstance(value, str) and value.lstrip().startswith("="):
                cause = f"a formula of {self.variable} stands by itself, found {quoted(value)}"
                raise refuse(cause, 'leave the "=" out') from None
            if isinstance(value, str | int | float):
                raise e
            cause = f"expected a number or a law, found {quoted(value)}"
            raise refuse(cause, f'write a number, or a formula in quotes, as "20*{self.variable}"') from None

    def json_schema(self) -> dict[str, Any]:
        pair = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
        items: dict[str, Any] = {
            "polynomial": {"type": "array", "items": {"type": "number"}, "minItems": 1},
            "table": {"type": "array", "items": pair, "minItems": 2},
            "expression": {"type": "string", "minLength": 1},
        }
        forms = [
            {"type": "object", "properties": {key: item}, "required": [key], "additionalProperties": False}
            for key, item in items.items()
        ]
        constant = [{"type": "number", **self.bounds.schema()}, {"type": "string", "minLength": 1}]
        return {"anyOf": [*constant, *forms]}


@dataclass(frozen=True)
class LawVector(Checked):
    """Three laws, one per fixed axis; `bounds` and `moves` as in `Law`."""

    variable: str
    dimension: str
    bounds: Bounds = ANY
    moves: bool = False

    def check(self, value: Any) -> tuple[LawValue, ...]:
        value = as_list(value)
        if not isinstance(value, list | tuple) or len(value) != 3:
            found = f"a list of {len(value)}" if isinstance(value, list | tuple) else quoted(value)
            cause = f"expected a list of 3 numbers or laws, found {found}"
            raise refuse(cause, f'write for example [0.0, 0.0, "20*{self.variable}"]')
        return tuple(each(value, self.item().check))

    def item(self) -> Law:
        """What each of the three is."""
        return Law(self.variable, self.dimension, self.bounds, self.moves)

    def json_schema(self) -> dict[str, Any]:
        return {"type": "array", "items": self.item().json_schema(), "minItems": 3, "maxItems": 3}


def _constant(form: str, data: Any) -> bool:
    """Whether a law has one value, by how it is written; it then is this number."""
    if form == "expression":
        return not parse(data).variables
    return not any(data[1:]) if form == "polynomial" else len({y for _, y in data}) == 1


def _listed(value: Any, what: str, least: int, most: int) -> list[Any]:
    value = as_list(value)
    if not isinstance(value, list | tuple):
        raise refuse(f"expected a list of {what}, found {quoted(value)}", "write it in [ ]")
    if not least <= len(value) <= most:
        raise refuse(f"expected {least} to {most} {what}, found {len(value)}", "give as many")
    return list(value)


def _polynomial(value: Any, variable: str) -> list[float]:
    """Coefficients in rising powers."""
    return each(_listed(value, "coefficients", 1, MOST_COEFFICIENTS), _NUMBER.check)


def _table(value: Any, variable: str) -> list[list[float]]:
    """Points [x, y] with rising x."""
    points = each(_listed(value, "points", 2, MOST_POINTS), _POINT.check)
    for k in range(1, len(points)):
        if points[k][0] <= points[k - 1][0]:
            cause = (
                f"{variable} must rise from point to point, found {points[k][0]:g} after {points[k - 1][0]:g}"
            )
            raise refuse(cause, "sort the points; for a jump, put two of them close together", (k,))
    return list(map(list, points))


def _expression(value: Any, variable: str) -> str:
    example = f"0.5*sin(10*{variable})"
    if not isinstance(value, str):
        cure = f'write the formula in quotes: "{example}"'
        raise refuse(f"expected a formula, found {quoted(value)}", cure)
    try:
        parsed = parse(value)
    except ValueError as e:
        cause, _, cure = str(e).partition("; ")
        surplus = re.search(r'missing between .* and "(\w+)"$', cause)
        cure = _no_units(surplus and surplus[1], variable) or cure
        cure = cure or f'write a formula in {variable}, for example "{example}"'
        raise refuse(f"cannot read {quoted(value)}: {cause}", cure) from None
    strangers = [name for name in parsed.variables if name != variable]
    if strangers:
        cause = f"unknown name {quoted(strangers[0])} in {quoted(value)}"
        cure = f"the variable is called {variable}; write numbers for all else"
        raise refuse(cause, _no_units(strangers[0], variable) or cure)
    return value


def _no_units(name: str | None, variable: str) -> str:
    """The cure where a name in a formula of `variable` is that of a unit."""
    unit = units.meant(name) if name and name not in ("t", "v") else None
    return (
        f'a formula has no units: write it in SI, as 5*{variable}, or a parameter {unit} = "1 {unit}"'
        if unit
        else ""
    )


_FORMS: dict[str, Callable[[Any, str], Any]] = {
    "polynomial": _polynomial,
    "table": _table,
    "expression": _expression,
}


@lru_cache(maxsize=1024)
def parse(text: str) -> Expression:
    """The expression, read by the core; `ValueError` if it cannot be."""
    try:
        return _core.Expression(text)
    except _core.ExpressionError as e:
        raise ValueError(str(e)) from None


def value_at(law: LawValue, x: float) -> float:
    """The value at `x`; not a number where an expression has none."""
    if not isinstance(law, dict):
        return law
    ((form, data),) = law.items()
    if form == "polynomial":
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.polynomial.polynomial.polyval(x, data))
    if form == "table":
        xs, ys = zip(*data, strict=True)
        return float(np.interp(x, xs, ys))
    expression = parse(data)
    try:
        return expression.evaluate(dict.fromkeys(expression.variables, x))
    except ValueError:
        return math.nan


def fault_at(law: LawValue, x: float) -> str:
    """Why an expression has no finite value at `x`, to be put behind a message that says so."""
    if isinstance(law, dict) and "expression" in law:
        expression = parse(law["expression"])
        try:
            expression.evaluate(dict.fromkeys(expression.variables, x))
        except ValueError as e:
            return f": {e}"
    return ""


def slope_of(law: LawValue, x: float) -> float:
    """Derivative at `x` from the right, as the core takes it; not finite where there is none."""
    expression = isinstance(law, dict) and law.get("expression")
    return parse(expression).slope(x) if expression else slope_at(law, x, 1.0)[0]


def slope_at(law: LawValue, x: float, h: float) -> tuple[float, float]:
    """Derivative at `x`, from the right or, with a negative `h`, from the left, and how much it may be wrong.

    That of an expression is a difference of fourth order over steps of `h`; it is compared with one over `h`/2.
    """
    if not isinstance(law, dict):
        return 0.0, 0.0
    ((form, data),) = law.items()
    if form == "polynomial":
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(data))), 0.0
    if form == "table":
        for (x0, y0), (x1, y1) in itertools.pairwise(data):
            if x0 <= x < x1 if h > 0.0 else x0 < x <= x1:
                return (y1 - y0) / (x1 - x0), 0.0
        return 0.0, 0.0
    values = {k: value_at(law, x + 0.5 * k * h) for k in (0, 1, 2, 3, 4, 6, 8)}
    coarse = sum(w * values[2 * k] for k, w in enumerate(FORWARD)) / h
    fine = sum(w * values[k] for k, w in enumerate(FORWARD)) / (0.5 * h)
    rounding = 64.0 * np.finfo(float).eps * max(map(abs, values.values())) / abs(h)
    return fine, abs(fine - coarse) + rounding


def times(law: LawValue, factor: float) -> LawValue:
    """The law with all its values multiplied."""
    if not isinstance(law, dict):
        return factor * law
    ((form, data),) = law.items()
    if form == "expression":
        return {form: f"({data})*{factor!r}"}
    if form == "polynomial":
        return {form: [factor * c for c in data]}
    return {form: [[x, factor * y] for x, y in data]}


def as_core(law: LawValue) -> tuple[str, Any]:
    """The law as it goes to the core: `("constant", x)`, `("polynomial", [...])`, ..."""
    if not isinstance(law, dict):
        return "constant", law
    ((form, data),) = law.items()
    return form, data
