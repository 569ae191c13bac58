"""Parameters and cases of a scenario file: `[parameters]` names numbers, `[[case]]` names variants of them.

Both are gone before the tables are validated: every string that begins with `=` and stands where a number is expected
becomes that number. A scene therefore knows nothing of them but the `Variant` it was read with.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel

from carom import units
from carom._core import Expression
from carom.errors import did_you_mean, quoted
from carom.numeric import is_finite
from carom.scene.messages import nested
from carom.scene.tables.fields import Checked, Integer, Quantity
from carom.scene.tables.laws import Law, LawVector, parse
from carom.scene.tables.lists import Integers, Tensor, Vector, Vectors
from carom.scene.tables.model import REPEATED, SINGLE
from carom.scene.toml.formulas import Formulas, Kind, is_formula
from carom.scene.toml.lines import Path

SECTIONS = ("parameters", "case")
"""The tables of a file that no scene has."""
GIVEN = -1
"""First part of the path of a value that was given by the caller; no key of a file is a number."""

_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NUMERIC = (Quantity, Vector, Vectors, Tensor, Law, LawVector, Integer, Integers)


@dataclass(frozen=True)
class Variant:
    """Which form of a file was read: the case, if any, and the values of all parameters."""

    case: str | None = None
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass
class Tables:
    """What a file says of parameters and cases, checked."""

    formulas: Formulas
    order: list[str] = field(default_factory=list)
    """Names of the parameters, as they follow each other."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """Number or expression of each that has one of these."""
    quantities: dict[Path, str] = field(default_factory=dict)
    """Text of each value that is a quantity with a unit: others have the dimension of that in the file, or no unit."""
    cases: dict[str, tuple[Path, dict[str, Any]]] = field(default_factory=dict)
    """Path and values by the name of the case."""


def names(raw: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Names of the parameters and of the cases of a parsed file, as far as they can be read."""
    tables = _read(raw)
    return tables.order, list(tables.cases)


def dimension_of(owner: type[BaseModel], key: str) -> str:
    """The dimension of the numbers of a key."""
    return getattr(_kind(owner, key), "dimension", "number")


def substitute(
    raw: dict[str, Any], case: str | None = None, given: Mapping[str, Any] | None = None
) -> tuple[Variant, Formulas]:
    """Replace the expressions in `raw`, a parsed file, and take `[parameters]` and `[[case]]` out of it.

    Values are those of `given`, else of the `case`, else of the file. What is wrong is in `Formulas.found`; an expression
    without a value stays where it is.
    """
    tables = _read(raw)
    formulas = tables.formulas
    chosen = {**_of_case(tables, case), **_given(tables, given or {})}
    values = _values(tables, chosen)
    for section in SECTIONS:
        raw.pop(section, None)
    for path, table, owner in _tables(raw):
        for key, value in table.items():
            kind = _kind(owner, key)
            if kind is not None:
                table[key] = _replaced(value, kind, (*path, key), values, formulas)
    if not formulas.found:  # else what uses a parameter may be what could not be read
        for name in tables.order:
            if name not in formulas.used:
                cure = f'use it, as "= 2*{name}", or leave it out'
                formulas.refuse(("parameters", name), "is not used anywhere", cure)
    return Variant(case, {name: x for name, x in values.items() if x is not None}), formulas


# --- what the file says ---------------------------------------------------------------------------------------


def _read(raw: Mapping[str, Any]) -> Tables:
    formulas = Formulas()
    tables = Tables(formulas)
    given = raw.get("parameters", {})
    if not isinstance(given, Mapping):
        formulas.refuse(
            ("parameters",),
            f"expected one table, found {'[[parameters]]' if isinstance(given, list) else quoted(given)}",
            "write [parameters], and below it NAME = NUMBER",
        )
        given = {}
    for name in given:
        wrong = _unfit(name)
        if wrong:
            formulas.refuse(("parameters", name), *wrong)
        else:
            tables.order.append(name)
    for name in tables.order:
        value = _fit(tables, ("parameters", name), name, given[name])
        if value is not None:
            tables.parameters[name] = value
    _read_cases(raw, tables)
    return tables


def _unfit(name: str) -> tuple[str, str] | None:
    """Cause and cure, if a parameter cannot be called so."""
    if not _NAME.fullmatch(name):
        return (
            f"{quoted(name)} is no name for a parameter",
            "use letters, digits and _, beginning with a letter",
        )
    if name in (*Expression.functions(), "pi", "PI"):
        return f"{name} means something in expressions already", "choose another name"
    if name == "name":
        return "a parameter cannot be called name: that is the name of a [[case]]", "choose another name"
    return None


def _fit(tables: Tables, path: Path, name: str, value: Any, bare: bool = False) -> float | str | None:
    """The value of the parameter `name` in SI, or its expression of the parameters above it; None if it is wrong.

    A `bare` expression needs no "=": it is what cannot be a quantity.
    """
    k = tables.order.index(name)
    if isinstance(value, str) and _has_two_readings(tables.formulas, path, value, tables.order, time=True):
        return None
    if is_formula(value) or (bare and isinstance(value, str) and _is_expression(value, tables.order)):
        known = tables.formulas.names(value, path, tables.order[:k], tables.order[k:])
        return str(value) if known else None
    formula = ', or an expression of the parameters above it: "= 2*pi"'
    number = value
    try:
        if isinstance(value, str):
            number = units.parse(value, like=tables.quantities.get(("parameters", name)))
            tables.quantities[path] = value
    except units.UnitError as e:
        tables.formulas.refuse(path, e.cause, e.cure + formula)
        return None
    if is_finite(number):
        return float(number)
    cause = f"expected a number or an expression, found {quoted(value)}"
    tables.formulas.refuse(path, cause, f"write {units.expected(None)}{formula}")
    return None


def _has_two_readings(
    formulas: Formulas,
    path: Path,
    text: str,
    known: Collection[str],
    dimension: str | None = None,
    time: bool = False,
) -> bool:
    """Whether a text is a quantity and an expression of names as its units, as "2*m": it is refused.

    Names are those of the `known` parameters and, where somebody may think of a law, of the `time`.
    """
    try:
        names = [name for name in parse(text).variables if name in known or (time and name == "t")]
        units.parse(text, dimension)
    except ValueError:
        return False
    if names:
        quantity = re.sub(r"\s*([*/])\s*", lambda sign: " " if sign[1] == "*" else " 1/", text, count=1)
        if names[0] in known:
            cause = f"{quoted(text)} may mean the unit or the parameter {names[0]}"
            cure = f"write {quoted(quantity)} with the unit, or {quoted(f'= {text}')} with the parameter"
            formulas.refuse(path, cause, cure)
        else:
            cause = f"{quoted(text)} may mean the unit t, tonnes, or the time"
            formulas.refuse(
                path, cause, f"write {quoted(quantity)}; laws of the time stand where they are used"
            )
    return bool(names)


def _is_expression(text: str, known: Sequence[str]) -> bool:
    """Whether a text is no quantity: what follows the number it begins with, if any, is no unit, misspelt or forgotten."""
    with suppress(units.UnitError):
        units.parse(text)
        return False
    rest = units.after_the_number(text)
    if not rest or any(name in known for name in _NAME.findall(rest)):
        return rest != ""
    with suppress(ValueError):
        parse(text)
        return True
    return False


def _read_cases(raw: Mapping[str, Any], tables: Tables) -> None:
    formulas, entries = tables.formulas, raw.get("case", [])
    if not isinstance(entries, list):
        found = "[case]" if isinstance(entries, Mapping) else quoted(entries)
        cause = f"expected any number of tables, found {found}"
        formulas.refuse(("case",), cause, "write [[case]], with two brackets")
        return
    for i, entry in enumerate(entries):
        path: Path = ("case", i)
        if not isinstance(entry, Mapping):
            formulas.refuse(
                path, f"expected a table, found {quoted(entry)}", "write [[case]] and its keys below"
            )
            continue
        name = entry.get("name")
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            found = "is missing" if name is None else f"expected text, found {quoted(name)}"
            formulas.refuse((*path, "name"), found, 'add name = "CASE", by which --case calls it')
        elif name in tables.cases:
            first = tables.cases[name][0][1]
            formulas.refuse(
                (*path, "name"),
                f"is the name of case number {int(first) + 1} too",
                "give each case its own name",
            )
        values = {}
        for key, value in entry.items():
            if key == "name":
                continue
            if key not in tables.order:
                formulas.refuse((*path, key), "is not in [parameters]", did_you_mean(key, tables.order))
            elif (fit := _fit(tables, (*path, key), key, value)) is not None:
                values[key] = fit
        if isinstance(name, str):
            tables.cases.setdefault(name, (path, values))


# --- the values of one variant --------------------------------------------------------------------------------

Chosen = dict[str, tuple[Path, Any]]
"""Values that take the place of those in `[parameters]`, with where they stand."""


def _of_case(tables: Tables, case: str | None) -> Chosen:
    if case is None:
        return {}
    if case not in tables.cases:
        cure = did_you_mean(case, list(tables.cases)) if tables.cases else "the file has no [[case]]"
        tables.formulas.refuse((GIVEN, "case"), f"there is no case {quoted(case)}", cure)
        return {}
    path, values = tables.cases[case]
    return {key: ((*path, key), value) for key, value in values.items()}


def _given(tables: Tables, given: Mapping[str, Any]) -> Chosen:
    chosen: Chosen = {}
    for name, value in given.items():
        path = (GIVEN, "set", name)
        if name not in tables.order:
            cure = did_you_mean(name, tables.order) if tables.order else "the file has no [parameters]"
            tables.formulas.refuse(path, "is no parameter of this file", cure)
        elif (fit := _fit(tables, path, name, value, bare=True)) is not None:
            chosen[name] = (path, fit)
    return chosen


def _values(tables: Tables, chosen: Chosen) -> dict[str, float | None]:
    """All parameters, in the order of the file; None for those that have no value."""
    values: dict[str, float | None] = dict.fromkeys(tables.order)
    formulas = tables.formulas
    for name, own in tables.parameters.items():
        path, value = chosen.get(name, (("parameters", name), own))
        text = tables.quantities.get(path)
        if isinstance(value, str):
            values[name], text = formulas.number(value, path, values), formulas.passed_on(value)
        else:
            values[name] = float(value)
        if text is not None:
            formulas.quantities[name] = text
    return values


# --- into the tables ------------------------------------------------------------------------------------------


def _tables(raw: Mapping[str, Any]) -> Iterator[tuple[Path, dict[str, Any], type[BaseModel]]]:
    """Every table of the file that the format knows, also those that are values of a key."""
    for section, owner in {**SINGLE, **REPEATED}.items():
        entry = raw.get(section)
        if isinstance(entry, dict):
            yield from _with_inner((section,), entry, owner)
        elif isinstance(entry, list):
            for i, table in enumerate(entry):
                if isinstance(table, dict):
                    yield from _with_inner((section, i), table, owner)


def _with_inner(
    path: Path, table: dict[str, Any], owner: type[BaseModel]
) -> Iterator[tuple[Path, dict[str, Any], type[BaseModel]]]:
    yield path, table, owner
    for key, value in table.items():
        inner = nested(owner, key) if isinstance(value, dict) else None
        if inner is not None:
            yield from _with_inner((*path, key), value, inner)


@cache
def _kind(owner: type[BaseModel], key: str) -> Kind:
    """The check of a key whose value holds numbers; None for names, choices and unknown keys."""
    known = owner.model_fields.get(key)
    if known is None:
        return None
    found = next((c for c in (*known.metadata, *_checks(known.annotation)) if isinstance(c, Checked)), None)
    return found if isinstance(found, _NUMERIC) else None


def _checks(annotation: Any) -> Iterator[Any]:
    """The metadata of `Annotated[...] | None`."""
    for part in (annotation, *get_args(annotation)):
        yield from getattr(part, "__metadata__", ())


def _replaced(
    value: Any, kind: Kind, path: Path, values: Mapping[str, float | None], formulas: Formulas
) -> Any:
    dimension = getattr(kind, "dimension", None)
    if isinstance(value, str) and _has_two_readings(formulas, path, value, values, dimension):
        return value
    if is_formula(value):
        x = formulas.number(value, path, values, kind)
        if x is None:
            return value
        return int(x) if isinstance(kind, Integer | Integers) and x.is_integer() else x
    if isinstance(value, list):
        part = kind.item() if isinstance(kind, LawVector) else kind
        return [_replaced(v, part, (*path, i), values, formulas) for i, v in enumerate(value)]
    if isinstance(kind, Law) and kind.writes_formula(value):
        value = {"expression": value}
    if isinstance(value, dict) and isinstance(kind, Law):
        return {
            key: formulas.law(v, (*path, key), values, kind)
            if key == "expression" and isinstance(v, str)
            else _replaced(v, None, (*path, key), values, formulas)
            for key, v in value.items()
        }
    return value
