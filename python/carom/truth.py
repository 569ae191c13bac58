"""What a convergence study holds its runs against: a fine run, the frames of a run, formulas, a function."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carom.errors import CaromError, did_you_mean
from carom.quantity import QUANTITIES, Quantity, States

if TYPE_CHECKING:
    from carom._core import Expression
    from carom.result import Result

F64 = NDArray[np.float64]
#: Of the time t (s): values by quantity, as `{"velocity:cue": (vx, vy, vz)}`.
Function = Callable[[float], Mapping[str, ArrayLike]]
#: What counts as the same instant, relative to the time.
SAME = 1e-9


class Truth(Protocol):
    """Values that count as exact."""

    #: What it is, in words.
    told: str

    def offered(self) -> list[str] | None:
        """The quantities that it knows, as they are written; None: all of them."""

    def values(self, quantity: Quantity, time: F64) -> F64:
        """Values at the times (T,), s: (T, spheres, components)."""


class Frames:
    """States at instants: those of a fine run, or of a run directory."""

    def __init__(self, told: str, bodies: Sequence[str], time: F64, states: States) -> None:
        self.told = told
        self._bodies, self._time, self._states = bodies, time, states

    @classmethod
    def of(cls, result: Result, bodies: Sequence[str]) -> Frames:
        """The frames of a run of the same spheres."""
        if result.names != list(bodies):
            raise CaromError(f"the run in {result.path} has other spheres than the scene")
        states = {key: np.asarray(getattr(result, key)) for key in QUANTITIES}
        return cls(f"run in {result.path}", bodies, np.asarray(result.time), states)

    def offered(self) -> list[str] | None:
        return None

    def values(self, quantity: Quantity, time: F64) -> F64:
        at = np.clip(np.searchsorted(self._time, time * (1 - SAME)), 0, len(self._time) - 1)
        off = np.abs(self._time[at] - time) > 2 * SAME * np.maximum(time, SAME)
        if off.any():
            raise CaromError(
                f"the {self.told} holds no state at t = {time[off][0]:g} s; record every step of it (every = 1),"
                " with a step that divides those of the study"
            )
        return quantity.of_states({key: values[at] for key, values in self._states.items()}, self._bodies)


class Formulas:
    """Closed forms: for each quantity, its value at one time, from a file or a function."""

    def __init__(self, told: str, function: Function) -> None:
        self.told, self._function = told, function

    @classmethod
    def read(cls, path: Path) -> Formulas:
        """A TOML file with a table for each sphere, whose components are numbers or `"= formula of t"`.

        [parameters]            # optional: numbers, or formulas of those above
        g = 9.8
        [sphere.cue]
        velocity = [1.0, 0.0, "= -g*t"]
        """
        try:
            tree = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise CaromError(f"{path}: {error.strerror}; give a step, a run directory or a file") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise CaromError(f"{path} is not TOML: {error}") from None
        known: dict[str, float] = {}
        for name, given in _table(tree, "parameters", path).items():
            known[name] = _Component(given, f"{path}: parameters.{name}", known)(known)
        formulas: dict[str, list[_Component]] = {}
        for sphere, table in _table(tree, "sphere", path).items():
            for key, given in _table({sphere: table}, sphere, path).items():
                place = f"{path}: sphere.{sphere}.{key}"
                if key not in QUANTITIES:
                    raise CaromError(f"{place}: no such quantity; {did_you_mean(key, list(QUANTITIES))}")
                count = len(QUANTITIES[key][0])
                if not isinstance(given, list) or len(given) != count:
                    raise CaromError(f"{place}: must be a list of {count} numbers or formulas")
                formulas[f"{key}:{sphere}"] = [_Component(c, place, {**known, "t": 0.0}) for c in given]
        if not formulas:
            raise CaromError(
                f'{path} holds no formulas; write [sphere.NAME] and velocity = [0, 0, "= -9.8*t"]'
            )

        def at(t: float) -> Mapping[str, ArrayLike]:
            values = {**known, "t": t}
            return {text: [component(values) for component in row] for text, row in formulas.items()}

        return cls(f"formulas in {path}", at)

    def offered(self) -> list[str] | None:
        return list(self._function(0.0))

    def values(self, quantity: Quantity, time: F64) -> F64:
        return np.array([self._at(quantity, float(t)) for t in time])

    def _at(self, quantity: Quantity, t: float) -> F64:
        given = self._function(t)
        names = [quantity.text]
        if quantity.axis is not None:
            names.append(f"{quantity.key}:{quantity.body}")
        for name in names:
            if name in given:
                value = np.asarray(given[name], dtype=np.float64)
                if name != quantity.text:
                    value = value[..., [QUANTITIES[quantity.key][0].index(str(quantity.axis))]]
                return value.reshape(-1, quantity.components)
        raise CaromError(f"the {self.told} does not give {quantity.text}; it gives {', '.join(given)}")


class _Component:
    """A number, or a formula of the names in `known`."""

    def __init__(self, given: Any, place: str, known: Mapping[str, float]) -> None:
        self._place = place
        self._value = 0.0
        self._formula = self._read(given, known)

    def _read(self, given: Any, known: Mapping[str, float]) -> Expression | None:
        from carom._core import Expression, ExpressionError

        if isinstance(given, (int, float)) and not isinstance(given, bool):
            self._value = float(given)
            return None
        if not isinstance(given, str) or not given.lstrip().startswith("="):
            raise CaromError(f'{self._place}: must be a number or a formula such as "= 2*t", found {given!r}')
        try:
            formula = Expression(given.lstrip()[1:])
        except ExpressionError as error:
            raise CaromError(f"{self._place}: {error}") from None
        for name in formula.variables:
            if name not in known:
                raise CaromError(f"{self._place}: {name!r} is unknown; {did_you_mean(name, list(known))}")
        return formula

    def __call__(self, values: Mapping[str, float]) -> float:
        from carom._core import ExpressionError

        if self._formula is None:
            return self._value
        try:
            return self._formula.evaluate(values)
        except ExpressionError as error:
            raise CaromError(f"{self._place}: {error}") from None


def _table(tree: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    table = tree.get(name, {})
    if not isinstance(table, dict):
        raise CaromError(f"{path}: {name} must be a table")
    return table
