"""Expressions in place of numbers: reading them, and what is wrong with them, as findings with a path.

An expression is a string that begins with `=`. The core reads it; a blank takes the place of the sign, so that columns in
messages count the string as it is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from carom import units
from carom.errors import did_you_mean, nearest, quoted
from carom.scene.messages import Finding
from carom.scene.tables.laws import Law, LawVector, parse
from carom.scene.toml.lines import Path

_NAME = re.compile(r"(?<![\w.])[A-Za-z_]\w*", re.ASCII)

Kind = Any
"""How a value is checked: the `Checked` of its key, or None where a plain number is expected."""


def is_formula(value: object) -> bool:
    """Whether a value of a file is an expression."""
    return isinstance(value, str) and value.lstrip().startswith("=")


class Formulas:
    """Reads the expressions of one file; collects findings and the names that occur."""

    def __init__(self) -> None:
        self.found: list[Finding] = []
        self.damaged: set[Path] = set()
        """Places whose value could not be had: findings of others about them are not worth having."""
        self.used: set[str] = set()
        self.quantities: dict[str, str] = {}
        """Texts of the parameters whose values are quantities with units."""

    def refuse(self, path: Path, cause: str, cure: str) -> None:
        """Note a mistake."""
        self.found.append(Finding(path, cause, cure))
        self.damaged.add(path)

    def names(self, text: str, path: Path, known: Iterable[str], later: Iterable[str] = ()) -> bool:
        """Whether `text` can be read and has known names only. `later`: those that are defined further down."""
        expression = self._read(text, path)
        if expression is None:
            return False
        self.used |= set(expression.variables)
        known = list(known)
        for name in expression.variables:
            if name not in known:
                self._unknown(text, name, path, known, later)
                return False
        return True

    def number(
        self, text: str, path: Path, values: Mapping[str, float | None], kind: Kind = None
    ) -> float | None:
        """The value, or None and a finding. A parameter that is None was found wrong already."""
        if isinstance(kind, Law | LawVector) and self._is_law(text, kind.variable, path, values):
            return None
        if not self.names(text, path, values):
            return None
        known = {name: value for name, value in values.items() if value is not None}
        expression = parse(blank(text))
        if any(name not in known for name in expression.variables):
            self.damaged.add(path)
            return None
        if kind is not None and not self._fits(text, path, kind):
            return None
        try:
            return expression.evaluate(known)
        except ValueError as e:
            given = ", ".join(f"{name} = {known[name]:.6g}" for name in expression.variables)
            self.refuse(
                path,
                f"{quoted(text)} has no finite value: {e}",
                f"change it, or the parameters ({given})" if given else "change it",
            )
            return None

    def passed_on(self, text: str) -> str | None:
        """The quantity with a unit that an expression takes from a parameter unchanged."""
        return self.quantities.get(blank(text).strip(" ()"))

    def _fits(self, text: str, path: Path, kind: Kind) -> bool:
        """Whether a parameter that is used unchanged has the dimension of the place."""
        passed = self.passed_on(text)
        try:
            if passed is not None:
                units.parse(passed, getattr(kind, "dimension", "number"))
        except units.UnitError as e:
            self.refuse(path, f"{quoted(text)}: {e.cause}", e.cure)
            return False
        return True

    def law(self, text: str, path: Path, values: Mapping[str, float | None], kind: Law | LawVector) -> str:
        """The formula of a law, with numbers in place of parameters; its own variable stays."""
        if is_formula(text):
            self.refuse(
                path, f'the formula of a law has no "=" in front: {quoted(text)}', 'leave the "=" out'
            )
            return text
        try:
            names = parse(text).variables
        except ValueError:
            return text  # the law will say so
        replaced = {name for name in names if name in values and name != kind.variable}
        self.used |= replaced
        if any(values[name] is None for name in replaced):
            self.damaged.add(path)
            return text
        if not self._fits(text, path, kind):
            return text
        return _NAME.sub(lambda m: f"({values[m[0]]!r})" if m[0] in replaced else m[0], text)

    def _read(self, text: str, path: Path) -> Any:
        try:
            return parse(blank(text))
        except ValueError as e:
            cause, _, cure = str(e).partition("; ")
            cure = cure or "complete it"
            if units.is_quantity(blank(text)):
                cure += '; of a number with a unit leave the "=" out'
            self.refuse(path, f"cannot read {quoted(text)}: {cause}", cure)
            return None

    def _unknown(self, text: str, name: str, path: Path, known: list[str], later: Iterable[str]) -> None:
        column = next((m.start() + 1 for m in _NAME.finditer(text) if m[0] == name), 1)
        unit = units.meant(name)
        cause = f"unknown name {name} in {quoted(text)} at column {column}"
        if name in later:
            self.refuse(path, cause, f"an expression uses parameters above it: move {name} up")
        elif known and (unit is None or nearest(name, known)):
            self.refuse(path, cause, did_you_mean(name, known))
        else:
            value = "1.0" if unit is None else f'"1 {unit}" if the unit is meant'
            self.refuse(path, cause, f"define it: [parameters], and below it {name} = {value}")

    def _is_law(self, text: str, variable: str, path: Path, values: Mapping[str, float | None]) -> bool:
        """Whether somebody wrote a law as an expression of parameters."""
        try:
            names = parse(blank(text)).variables
        except ValueError:
            return False
        if variable not in names or variable in values:
            return False
        formula = text.lstrip().removeprefix("=").strip()
        self.refuse(
            path,
            f"{quoted(text)} is not a number: it depends on {variable}",
            f'write it as a law, without the "=": "{formula}"',
        )
        return True


def blank(text: str) -> str:
    """An expression with a blank in place of its sign."""
    return text.replace("=", " ", 1) if is_formula(text) else text
