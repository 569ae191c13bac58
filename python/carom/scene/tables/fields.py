"""Types of the values in a scenario: each checks one value, says what is wrong with it, and states its JSON
Schema.

All checks are our own (pydantic only reports missing and unknown keys), so that every message has a cause and
a cure, and the bounds in the message, in the schema and in the check are the same object.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from carom import units
from carom.errors import did_you_mean, quoted
from carom.numeric import is_number, is_whole

OURS = "carom"
"""Type of the pydantic errors made here; their context holds `cause`, `cure` and perhaps `part` (a place in the value)."""


def refuse(cause: str, cure: str, part: tuple[int | str, ...] = ()) -> PydanticCustomError:
    """The error to raise for a value that cannot be used. Braces would be read as fields of a template."""
    return PydanticCustomError(OURS, "{cause}; {cure}", {"cause": cause, "cure": cure, "part": part})


def inside(place: int | str, error: PydanticCustomError) -> PydanticCustomError:
    """The same error, of which the value is a part (an element of a list, a key of a table) of the one given."""
    context = error.context or {}
    number = f"number {place + 1}: " if isinstance(place, int) else ""
    return refuse(f"{number}{context['cause']}", str(context["cure"]), (place, *context.get("part", ())))


class Checked:
    """Metadata for `Annotated`: `check` gets the raw value and returns the stored one, or raises `refuse(...)`."""

    def check(self, value: Any) -> Any:
        raise NotImplementedError

    def json_schema(self) -> dict[str, Any]:
        raise NotImplementedError

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return self.json_schema()


@dataclass(frozen=True)
class Bounds:
    """Limits of a number; `words` says them in the message."""

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def hold(self, x: float) -> bool:
        return (
            (self.gt is None or x > self.gt)
            and (self.ge is None or x >= self.ge)
            and (self.lt is None or x < self.lt)
            and (self.le is None or x <= self.le)
        )

    def words(self) -> str:
        if self == Bounds(gt=0):
            return "positive"
        if self == Bounds(ge=0):
            return "zero or positive"
        parts = [
            ("greater than", self.gt),
            ("at least", self.ge),
            ("less than", self.lt),
            ("at most", self.le),
        ]
        return " and ".join(f"{word} {limit:g}" for word, limit in parts if limit is not None)

    def schema(self) -> dict[str, float]:
        names = ("exclusiveMinimum", "minimum", "exclusiveMaximum", "maximum")
        limits = (self.gt, self.ge, self.lt, self.le)
        return {name: limit for name, limit in zip(names, limits, strict=True) if limit is not None}


ANY = Bounds()
POSITIVE = Bounds(gt=0)
NOT_NEGATIVE = Bounds(ge=0)


@dataclass(frozen=True)
class Quantity(Checked):
    """A finite number in SI, or a string with a unit of `dimension` (see `carom.units`); stored as a float in SI."""

    dimension: str = "number"
    bounds: Bounds = ANY

    def check(self, value: Any) -> float:
        if type(value) is float:
            x = value
        elif isinstance(value, str) and self.dimension != "number":
            try:
                x = units.parse(value, self.dimension)
            except units.UnitError as e:
                raise refuse(e.cause, e.cure) from None
        elif is_number(value):
            try:
                x = float(value)
            except OverflowError:
                raise refuse(f"is too large, found {quoted(value)}", "write a number below 1e308") from None
        else:
            raise refuse(
                f"expected a number, found {quoted(value)}", f"write {units.expected(self.dimension)}"
            )
        if not math.isfinite(x):
            raise refuse(f"must be a finite number, found {quoted(value)}", "write a finite number")
        if not self.bounds.hold(x):
            raise refuse(
                f"must be {self.bounds.words()}, found {quoted(value)}",
                f"write a number that is {self.bounds.words()}",
            )
        return x

    def json_schema(self) -> dict[str, Any]:
        number: dict[str, Any] = {"type": "number", **self.bounds.schema()}
        if self.dimension == "number":
            return number
        return {"anyOf": [number, {"type": "string", "pattern": units.SCHEMA_PATTERN}]}


@dataclass(frozen=True)
class Version(Checked):
    """The version of the format."""

    known: int

    def check(self, value: Any) -> int:
        if value != self.known or isinstance(value, bool):
            raise refuse(
                f"this Carom reads format {self.known}, found {quoted(value)}", f"write format = {self.known}"
            )
        return self.known

    def json_schema(self) -> dict[str, Any]:
        return {"const": self.known}


@dataclass(frozen=True)
class Integer(Checked):
    """A whole number within bounds."""

    bounds: Bounds = ANY

    def check(self, value: Any) -> int:
        if not is_whole(value):
            raise refuse(
                f"expected a whole number, found {quoted(value)}", "write a whole number, without a point"
            )
        # The bounds say what is wrong with a number that is far too large only where they are upper ones.
        holds = self.bounds.hold(int(value))
        if abs(value) > 2**63 - 1 or not holds:
            words = ("below 2^63" if value > 0 else "above -2^63") if holds else self.bounds.words()
            raise refuse(f"must be {words}, found {quoted(value)}", f"write a number that is {words}")
        return int(value)

    def json_schema(self) -> dict[str, Any]:
        return {"type": "integer", **self.bounds.schema()}


@dataclass(frozen=True)
class Flag(Checked):
    """true or false."""

    def check(self, value: Any) -> bool:
        if not isinstance(value, bool):
            raise refuse(
                f"expected true or false, found {quoted(value)}", "write true or false, without quotes"
            )
        return value

    def json_schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


@dataclass(frozen=True)
class FlagOr(Checked):
    """true, false, or one of some words that say more than true."""

    words: tuple[str, ...]

    def check(self, value: Any) -> bool | str:
        if isinstance(value, bool):
            return value
        if value in self.words:
            return str(value)
        words = " or ".join(f'"{word}"' for word in self.words)
        raise refuse(
            f"expected true, false, {words}, found {quoted(value)}",
            f"write true or false, without quotes, or {words}",
        )

    def json_schema(self) -> dict[str, Any]:
        return {"enum": [True, False, *self.words]}


@dataclass(frozen=True)
class Choice(Checked):
    """One of the `values`."""

    values: tuple[str, ...]

    def check(self, value: Any) -> str:
        if not isinstance(value, str) or value not in self.values:
            cure = did_you_mean(value if isinstance(value, str) else "", self.values)
            raise refuse(f"unknown value {quoted(value)}", cure)
        return value

    def json_schema(self) -> dict[str, Any]:
        return {"enum": list(self.values)}


@dataclass(frozen=True)
class Text(Checked):
    """A string of one line; names must not be empty."""

    least: int = 0
    most: int = 200

    def check(self, value: Any) -> str:
        if not isinstance(value, str):
            raise refuse(
                f"expected a string, found {quoted(value)}", 'write it in quotes, for example "ball"'
            )
        hidden = [c for c in value if not c.isprintable()]
        if not self.least <= len(value) <= self.most or hidden:
            found = "nothing" if not value else quoted(value)
            if hidden:
                found = f"{ascii(hidden[0])[1:-1]} in {found}"
            raise refuse(
                f"must be {self.least} to {self.most} printable characters, found {found}",
                "shorten or rename it",
            )
        if self.least and value != value.strip():
            raise refuse(f"begins or ends with a blank: {quoted(value)}", "remove the blank")
        return value

    def json_schema(self) -> dict[str, Any]:
        return {"type": "string", "minLength": self.least, "maxLength": self.most}


@dataclass(frozen=True)
class Pair(Checked):
    """Two names."""

    what: str = "material"
    example: str = '["ball", "cloth"]'

    def check(self, value: Any) -> tuple[str, str]:
        if not isinstance(value, list | tuple) or len(value) != 2:
            found = f"a list of {len(value)}" if isinstance(value, list | tuple) else quoted(value)
            raise refuse(f"expected two {self.what} names, found {found}", f"write between = {self.example}")
        name = Text(1)
        return name.check(value[0]), name.check(value[1])

    def json_schema(self) -> dict[str, Any]:
        return {"type": "array", "items": Text(1).json_schema(), "minItems": 2, "maxItems": 2}


def exactly_one(table: Mapping[str, Any], first: str, second: str) -> None:
    """Refuses a table where not exactly one of two keys is given, which say the same thing in two ways."""
    given = [key for key in (first, second) if table.get(key) is not None]
    if len(given) != 1:
        cause = f"both {first} and {second} are given" if given else f"neither {first} nor {second} is given"
        raise refuse(cause, f"give exactly one of {first} and {second}")
