"""Quantities with units at the border: `"28.575 mm"` becomes 0.028575, in SI, correctly rounded.

Inside Carom every number is SI and has no unit attached. The table is small on purpose: what a person writes
about spheres, and nothing that could be mistaken (`g` is the gram). Angles are a dimension of their own, so
that `1/s` is not taken for `rad/s`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from typing import Any

from carom.errors import CaromError, quoted
from carom.numeric import is_finite, is_number

Dimension = tuple[int, int, int, int]
"""Exponents of length, mass, time and angle."""

DIMENSIONS: dict[str, tuple[Dimension, str, str]] = {
    # name: exponents, SI unit, made units that messages name besides those of `UNITS`
    "number": ((0, 0, 0, 0), "", ""),
    "length": ((1, 0, 0, 0), "m", ""),
    "area": ((2, 0, 0, 0), "m^2", "m^2, cm^2, mm^2, in^2, ft^2"),
    "mass": ((0, 1, 0, 0), "kg", ""),
    "time": ((0, 0, 1, 0), "s", ""),
    "angle": ((0, 0, 0, 1), "rad", ""),
    "frequency": ((0, 0, -1, 0), "1/s", "1/s, 1/min"),
    "speed": ((1, 0, -1, 0), "m/s", "m/s, cm/s, mm/s, km/h, ft/s, in/s"),
    "acceleration": ((1, 0, -2, 0), "m/s^2", "m/s^2, cm/s^2, ft/s^2"),
    "angular speed": ((0, 0, -1, 1), "rad/s", "rad/s, deg/s, rev/s"),
    "density": ((-3, 1, 0, 0), "kg/m^3", "kg/m^3, g/cm^3"),
    "moment of inertia": ((2, 1, 0, 0), "kg m^2", "kg m^2, g mm^2"),
    "force": ((1, 1, -2, 0), "N", ""),
    "moment": ((2, 1, -2, 0), "N m", "N m, mN m, N mm"),
    "stiffness": ((0, 1, -2, 0), "N/m", "N/m, N/mm"),
    "damping": ((0, 1, -1, 0), "N s/m", "N s/m, kg/s"),
    "rotational damping": ((2, 1, -1, 0), "N m s", "N m s, mN m s"),
    "pressure": ((-1, 1, -2, 0), "Pa", ""),
}

_Unit = tuple[Fraction, int, Dimension]  # rational factor, power of pi, exponents


def _unit(factor: str, dimension: Dimension, pi: int = 0) -> _Unit:
    return Fraction(factor), pi, dimension


_LENGTH, _MASS, _TIME, _ANGLE = (DIMENSIONS[k][0] for k in ("length", "mass", "time", "angle"))

UNITS: dict[str, _Unit] = {
    "m": _unit("1", _LENGTH),
    "km": _unit("1000", _LENGTH),
    "cm": _unit("0.01", _LENGTH),
    "mm": _unit("0.001", _LENGTH),
    "um": _unit("1e-6", _LENGTH),
    "in": _unit("0.0254", _LENGTH),
    "ft": _unit("0.3048", _LENGTH),
    "kg": _unit("1", _MASS),
    "g": _unit("0.001", _MASS),
    "mg": _unit("1e-6", _MASS),
    "t": _unit("1000", _MASS),
    "oz": _unit("0.028349523125", _MASS),
    "lb": _unit("0.45359237", _MASS),
    "s": _unit("1", _TIME),
    "ms": _unit("0.001", _TIME),
    "us": _unit("1e-6", _TIME),
    "min": _unit("60", _TIME),
    "h": _unit("3600", _TIME),
    "rad": _unit("1", _ANGLE),
    "deg": _unit("1/180", _ANGLE, pi=1),
    "rev": _unit("2", _ANGLE, pi=1),
    "rpm": _unit("1/30", (0, 0, -1, 1), pi=1),
    "mph": _unit("0.44704", (1, 0, -1, 0)),
    "N": _unit("1", (1, 1, -2, 0)),
    "mN": _unit("0.001", (1, 1, -2, 0)),
    "kN": _unit("1000", (1, 1, -2, 0)),
    "Pa": _unit("1", (-1, 1, -2, 0)),
    "kPa": _unit("1000", (-1, 1, -2, 0)),
    "MPa": _unit("1e6", (-1, 1, -2, 0)),
    "GPa": _unit("1e9", (-1, 1, -2, 0)),
}

SPELLED: dict[str, str] = {
    "in": "inch inches",
    "ft": "foot feet",
    "m": "meter meters metre metres",
    "cm": "centimeter centimeters centimetre centimetres",
    "mm": "millimeter millimeters millimetre millimetres",
    "km": "kilometer kilometers kilometre kilometres",
    "g": "gram grams",
    "kg": "kilogram kilograms",
    "oz": "ounce ounces",
    "lb": "pound pounds lbs",
    "s": "sec secs second seconds",
    "min": "minute minutes",
    "h": "hr hrs hour hours",
    "deg": "degree degrees",
    "rad": "radian radians",
    "N": "newton newtons",
    "mph": "mi/h mile/h miles/h mi/hour mile/hour miles/hour",
    "km/h": "kmh kph kmph",
}
"""How people write units that have a symbol: only to say in a message which they meant."""
_MEANT = {word: unit for unit, words in SPELLED.items() for word in words.split()}

_ASCII = str.maketrans({"µ": "u", "μ": "u", "·": "*", "°": "deg", "¹": "1", "²": "2", "³": "3", "⁻": "-"})
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE]([+-]?\d+))?)\s*(.*?)\s*", re.DOTALL)
# A 1 only stands before a slash: "5 12 m" would be 5 m otherwise, with 12 as a power of 1.
_FACTOR = re.compile(r"([*/ ]?)\s*(?:([A-Za-z]+)(?:\^?(-?\d))?|1(?=\s*/))\s*")

SCHEMA_PATTERN = r"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*\S.*$"
"""A number and a unit, as a regular expression that JSON Schema and its editors understand."""


class UnitError(ValueError):
    """A quantity string that cannot be read; `cause` and `cure` are ready for a message."""

    def __init__(self, cause: str, cure: str) -> None:
        super().__init__(cause, cure)  # its arguments: a copy is made of them
        self.cause, self.cure = cause, cure

    def __str__(self) -> str:
        return f"{self.cause}; {self.cure}"


def parse(text: str, dimension: str | None = None, like: str | None = None) -> float:
    """The value of `text` in SI, which must have the dimension named (a key of `DIMENSIONS`), if one is, or that of the
    quantity `like`, which was read before.

    The factor is a fraction, so the result is the double nearest to the true value: `"28.575 mm"` equals
    `0.028575`.
    """
    wanted = DIMENSIONS[dimension][0] if dimension else None
    if like not in (None, text):
        wanted = _parse_unit((after_the_number(like or "") or "").translate(_ASCII), "")[2]
        dimension = _called(wanted)
    cure = f"write {expected(dimension)}"
    match = _QUANTITY.fullmatch(text) if len(text) <= 80 else None
    if match is None:
        raise UnitError(f"{quoted(text)} is not a number with a unit", cure)
    digits, exponent, unit = match.groups()
    pointed = text.replace(",", ".", 1)
    again = _QUANTITY.fullmatch(pointed) if re.match(r",\d", unit) else None
    if again is not None and not re.match(r"[\d.,]", again[3]):
        raise UnitError(f"{quoted(text)} has a decimal comma", f"write a point: {quoted(pointed)}")
    if not unit:
        # "0.5" in quotes: accepting it would hide the forgotten unit that a string announces
        raise UnitError(f"{quoted(text)} is text without a unit", f"remove the quotes, or {cure}")
    factor, pi, found = _parse_unit(unit.translate(_ASCII), cure, wanted)
    if wanted and found != wanted:
        raise _other(
            f"a quantity like {quoted(like)}" if like else _article(dimension or ""), text, found, cure
        )
    if exponent is not None and abs(int(exponent)) > 400:
        return float(digits)  # 0 or infinite (refused by the caller); a fraction of that size would not end
    try:
        value = float(Fraction(digits) * factor)
    except OverflowError:
        return math.inf
    return value * math.pi**pi if pi else value


def number(
    call: str,
    name: str,
    value: Any,
    dimension: str | None = None,
    unit: str = "in SI units",
    *,
    infinite: bool = False,
) -> float:
    """What a caller gives as a finite number in SI; `call` and `name` say in the message where it was given.

    With a `dimension` (a key of `DIMENSIONS`) it may be a text with a unit; without one messages call for a number `unit`.
    """
    where = f"{call}: {name}" if call else name
    if dimension is not None and isinstance(value, str):
        try:
            value = parse(value, dimension)
        except UnitError as error:
            raise CaromError(f"{where}: {error}") from None
    if not (is_finite(value) or (infinite and is_number(value) and abs(value) == math.inf)):
        unit += ", or a text with its unit" if dimension is not None else ""
        cure = "; give a number, not a text" if isinstance(value, str) else ""
        raise CaromError(f"{where} must be a finite number {unit}, found {quoted(value)}{cure}")
    return float(value)


def numbers(call: str, name: str, given: Any, dimension: str) -> list[float]:
    """As `number`, of one quantity or of several."""
    several = isinstance(given, Iterable) and not isinstance(given, str) and getattr(given, "ndim", 1) != 0
    return [number(call, name, value, dimension) for value in (given if several else [given])]


def factor(unit: str, dimension: str | None = None) -> float:
    """What one `unit` is in SI, of the dimension named if one is; no text is 1."""
    wanted = DIMENSIONS[dimension][0] if dimension else None
    cure = f"write {expected(dimension)}" if dimension else "write SI units"
    value, pi, found = _parse_unit(unit.translate(_ASCII), cure, wanted)
    if wanted and found != wanted:
        raise _other(f"a unit of {_article(dimension or '')}", unit, found, cure)
    return float(value) * math.pi**pi


def _other(what: str, text: str, found: Dimension, cure: str) -> UnitError:
    """Of a text that is of another dimension than `what` was expected."""
    is_a = f", {_article(name)}" if (name := _called(found)) else ""
    return UnitError(f"expected {what}, found {quoted(text)}{is_a}", cure)


def is_quantity(text: str) -> bool:
    """Whether a number is followed by what people call a unit."""
    match = _QUANTITY.fullmatch(text)
    word = re.match("[A-Za-z]+", match[3].translate(_ASCII)) if match else None
    return word is not None and meant(word[0]) is not None


def after_the_number(text: str) -> str | None:
    """What follows the number that a text begins with; None if it begins with none."""
    match = _QUANTITY.fullmatch(text)
    return match[3] if match else None


def meant(name: str) -> str | None:
    """The unit that people call so, if there is one."""
    return name if name in UNITS else _MEANT.get(name.lower())


def expected(dimension: str | None) -> str:
    """What may stand there, in words: `a number in m, or "NUMBER UNIT" with a unit of m, km, cm, mm, um, in, ft`."""
    if dimension is None:
        return 'a number in SI units, or "NUMBER UNIT"'
    exponents, si, made = DIMENSIONS[dimension]
    known = [*made.split(", "), *(unit for unit, row in UNITS.items() if row[2] == exponents)]
    units = ", ".join(filter(None, known))
    return f'a number in {si}, or "NUMBER UNIT" with a unit of {units}' if si else "a plain number"


def _called(dimension: Dimension) -> str | None:
    """The first name of a dimension."""
    return next((name for name, row in DIMENSIONS.items() if row[0] == dimension), None)


def _article(name: str) -> str:
    return f"a{'n' if name[0] in 'aeiou' else ''} {name}"


@lru_cache(maxsize=256)
def _parse_unit(text: str, cure: str, wanted: Dimension | None = None) -> _Unit:
    """Products and powers of `UNITS`: `kg/m^3`, `kg m^2`, `m/s2`, `1/s`. A slash divides by the next factor
    only. An unknown unit is reported with those that would make the `wanted` dimension and may have been meant;
    not so without a `cure`.
    """
    factor, pi, exponents = Fraction(1), 0, (0, 0, 0, 0)
    position = 0
    while position < len(text):
        match = _FACTOR.match(text, position)
        if match is None or (position and not match[1] and text[position - 1] not in " "):
            raise UnitError(f"cannot read the unit {quoted(text)}", cure)
        name, power = match[2], int(match[3] or 1) * (-1 if match[1] == "/" else 1)
        if name is not None:
            if name not in UNITS:
                best = _alike(text, match.span(2), wanted) if cure else ""
                hint = f"did you mean {best}? otherwise {cure}" if best else cure
                raise UnitError(f"unknown unit {quoted(name)}", hint)
            base, base_pi, base_exponents = UNITS[name]
            factor *= base**power
            pi += base_pi * power
            a, b, c, d = (e + power * f for e, f in zip(exponents, base_exponents, strict=True))
            exponents = (a, b, c, d)
        position = match.end()
    return factor, pi, exponents


def _alike(text: str, span: tuple[int, int], wanted: Dimension | None) -> str:
    """What `text` may mean, or the units at `span` of it: those that differ by one slip and make the wanted dimension."""
    words = re.sub("[A-Za-z]+", lambda word: _MEANT.get(word[0].lower(), word[0]), text)
    for spelled in (_MEANT.get(text.replace(" ", "").lower(), words), words):
        with suppress(UnitError):  # another part cannot be read either
            if wanted in (None, _parse_unit(spelled, "")[2]):
                return spelled
    name, fitting = text[slice(*span)].lower(), []
    for unit in UNITS:
        try:
            found = _parse_unit(text[: span[0]] + unit + text[span[1] :], "")[2]
        except UnitError:  # another part cannot be read either
            return ""
        if wanted in (None, found):
            fitting.append(unit)  # case matters (mN), so names are compared without it
    near = [unit for unit in fitting if unit.lower() == name]
    near = near or [unit for unit in fitting if _one_slip(unit.lower(), name)]
    return " or ".join(filter(None, (", ".join(near[:-1]), *near[-1:])))


def _one_slip(a: str, b: str) -> bool:
    """Whether one letter was left out, added or mistaken, or letters changed places."""
    return sorted(a) == sorted(b) or len(_gaps(a) & _gaps(b) - {"?"}) > 0


def _gaps(name: str) -> set[str]:
    """The name with a gap in place of each letter, and between any two."""
    return {f"{name[:i]}?{name[i + k :]}" for i in range(len(name) + 1) for k in (0, 1)}
