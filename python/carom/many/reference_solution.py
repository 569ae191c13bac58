"""What a convergence study holds its runs against: a fine run, the frames of a run, formulas, a function."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from carom._core import Expression, ExpressionError
from carom.arrays import F64
from carom.errors import CaromError, did_you_mean
from carom.many.quantity import QUANTITIES, Quantity, States
from carom.numeric import reals
from carom.scene.toml.formulas import blank

if TYPE_CHECKING:
    from carom._core import Expression
    from carom.run.result import Result
    from carom.scene.scene import Scene

#: Of the time t (s): values by quantity, as `{"velocity:cue": (vx, vy, vz)}`.
Function = Callable[[float], Mapping[str, ArrayLike]]
#: What counts as the same instant, relative to the time.
SAME = 1e-9


class Truth(Protocol):
    """Values that count as exact."""

    @property
    def told(self) -> str:
        """What it is, in words."""

    @property
    def step(self) -> float | None:
        """The step with which it was computed, s; None: it is exact."""

    def offered(self) -> list[str] | None:
        """The quantities that it knows, as they are written; None: all of them."""

    def values(self, quantity: Quantity, time: F64) -> F64:
        """Values at the times (T,), s: (T, spheres, components)."""


class Frames:
    """States at instants: those of a fine run, of a run directory, or of the exact method, which has no step."""

    def __init__(
        self, told: str, bodies: Sequence[str], time: F64, states: States, step: float | None
    ) -> None:
        self.told, self.step = told, step
        self._bodies, self._time, self._states = bodies, time, states

    @classmethod
    def of(cls, result: Result, scene: Scene) -> Frames:
        """The frames of a run of the same scene: how it was solved may differ, what was solved may not."""
        bodies = scene.names
        if result.names != bodies:
            raise CaromError(f"the run in {result.origin} has other spheres than the scene")
        if other := _others(result, scene):
            raise CaromError(
                f"the run in {result.origin} is no reference for this scene: it has other {', '.join(other)};"
                " run the scene itself with a fine step and every = 1, in the same case and with the same --set"
            )
        states = {key: np.asarray(getattr(result, key)) for key in QUANTITIES}
        step = float(result.summary.get("step") or np.min(np.diff(result.time)))
        return cls(f"run in {result.origin}", bodies, np.asarray(result.time), states, step)

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

    step = None

    def __init__(self, told: str, function: Function, bodies: Sequence[str]) -> None:
        self.told, self._function, self._bodies = told, function, bodies

    @classmethod
    def read(cls, path: Path, bodies: Sequence[str]) -> Formulas:
        """A TOML file with a table for each sphere, whose components are numbers or formulas of t ("=" in front or not).

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

        return cls(f"formulas in {path}", at, bodies)

    def offered(self) -> list[str] | None:
        return list(self._given(0.0))

    def values(self, quantity: Quantity, time: F64) -> F64:
        return np.array([self._at(quantity, float(t)) for t in time])

    def _at(self, quantity: Quantity, t: float) -> F64:
        given = self._given(t)
        names = [quantity.text]
        if quantity.axis is not None:
            names.append(f"{quantity.key}:{quantity.body}")
        for name in names:
            if name in given:
                components = (
                    len(QUANTITIES[quantity.key][0]) if name != quantity.text else quantity.components
                )
                value = self._shaped(given[name], 1 if quantity.body else len(self._bodies), components, name)
                if name != quantity.text:
                    value = value[..., [QUANTITIES[quantity.key][0].index(str(quantity.axis))]]
                return value
        raise CaromError(f"the {self.told} does not give {quantity.text}; it gives {', '.join(given)}")

    def _given(self, t: float) -> Mapping[str, ArrayLike]:
        given = self._function(t)
        if not isinstance(given, Mapping):
            raise CaromError(
                f"the {self.told} gives {type(given).__name__} at t = {t:g} s; return values by quantity, as"
                ' {"velocity:cue": (vx, vy, vz)}'
            )
        return given

    def _shaped(self, given: ArrayLike, spheres: int, components: int, name: str) -> F64:
        """The values of a quantity at one time, (spheres, components)."""
        try:
            value = reals(given)
        except (TypeError, ValueError):
            raise CaromError(
                f"the {self.told} gives {name} = {given!r}, which is no array of numbers"
            ) from None
        if value.size != spheres * components:
            of = f"{components} numbers" if spheres == 1 else f"an array ({spheres}, {components})"
            raise CaromError(
                f"the {self.told} gives {name} with the shape {value.shape}; return "
                + ("one number" if spheres * components == 1 else of)
            )
        return value.reshape(spheres, components)


def _others(result: Result, scene: Scene) -> list[str]:
    """What the scene of a run has other than `scene`, as keys of the model; numbers may differ by rounding."""
    if scene.load_functions:  # a run directory holds their names only: nothing can be compared
        return []
    theirs, mine = result.scene.to_model(), scene.to_model()
    keys = [key for key in (mine | theirs) if key != "options"]
    return [key.replace("_", " ") for key in keys if not _same(mine.get(key), theirs.get(key))]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, (float, np.ndarray)) and isinstance(b, (float, np.ndarray)):
        return np.shape(a) == np.shape(b) and bool(np.allclose(a, b, rtol=SAME, atol=1e-15))
    return bool(a == b)


class _Component:
    """A number, or a formula of the names in `known`."""

    def __init__(self, given: Any, place: str, known: Mapping[str, float]) -> None:
        self._place = place
        self._value = 0.0
        self._formula = self._read(given, known)

    def _read(self, given: Any, known: Mapping[str, float]) -> Expression | None:
        if isinstance(given, (int, float)) and not isinstance(given, bool):
            self._value = float(given)
            return None
        if not isinstance(given, str):
            raise CaromError(f'{self._place}: must be a number or a formula such as "2*t", found {given!r}')
        try:
            formula = Expression(blank(given))
        except ExpressionError as error:
            raise CaromError(f"{self._place}: {error}") from None
        for name in formula.variables:
            if name not in known:
                raise CaromError(f"{self._place}: {name!r} is unknown; {did_you_mean(name, list(known))}")
        return formula

    def __call__(self, values: Mapping[str, float]) -> float:
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
