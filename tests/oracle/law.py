"""Laws of one variable: a joint's c(t), a load's f(t), the friction mu(v), with their derivatives."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from .pose import F64


class ScalarLaw(Protocol):
    """A number as a function of a number."""

    def value(self, x: float) -> float:
        """The law at x."""
        ...

    def rate(self, x: float) -> float:
        """Its first derivative."""
        ...

    def second(self, x: float) -> float:
        """Its second derivative."""
        ...


class PolynomialLaw:
    """Sum of c_k x^k; a constant is the polynomial of one coefficient."""

    def __init__(self, coefficients: Any) -> None:
        self._values = np.polynomial.Polynomial(np.atleast_1d(np.asarray(coefficients, dtype=np.float64)))

    def value(self, x: float) -> float:
        """The law at x."""
        return float(self._values(x))

    def rate(self, x: float) -> float:
        """Its first derivative."""
        return float(self._values.deriv(1)(x))

    def second(self, x: float) -> float:
        """Its second derivative."""
        return float(self._values.deriv(2)(x))


class TableLaw:
    """Linear between points (n, 2), constant outside; at a point the slope is that of the piece that begins there."""

    def __init__(self, points: Any) -> None:
        self._x, self._y = np.asarray(points, dtype=np.float64).T

    def value(self, x: float) -> float:
        """The law at x."""
        return float(np.interp(x, self._x, self._y))

    def rate(self, x: float) -> float:
        """Its first derivative."""
        right = int(np.searchsorted(self._x, x, side="right"))
        if right in (0, len(self._x)):
            return 0.0
        rise = self._y[right] - self._y[right - 1]
        return float(rise / (self._x[right] - self._x[right - 1]))

    def second(self, x: float) -> float:
        """Zero, between the points."""
        return 0.0


class ExpressionLaw:
    """A text in t or v, evaluated by the core's parser; derivatives by extrapolated differences, not by its rules."""

    def __init__(self, text: str) -> None:
        from carom import _core

        expression = _core.Expression(text)
        variables = list(expression.variables)
        if len(variables) > 1:
            raise ValueError(f"expression {text!r}: one variable is allowed, not {variables}")
        name = variables[0] if variables else "t"
        self._evaluate: Callable[[float], float] = lambda x: float(expression.evaluate({name: x}))

    def value(self, x: float) -> float:
        """The law at x."""
        return self._evaluate(x)

    def rate(self, x: float) -> float:
        """Its first derivative, to about 1e-12 of the law."""
        f = self._evaluate
        return extrapolated(lambda d: (f(x + d) - f(x - d)) / (2.0 * d))

    def second(self, x: float) -> float:
        """Its second derivative, to about 1e-9 of the law."""
        f = self._evaluate
        return extrapolated(lambda d: (f(x + d) - 2.0 * f(x) + f(x - d)) / (d * d))


def extrapolated(difference: Callable[[float], float], start: float = 0.2, levels: int = 24) -> float:
    """Limit for d -> 0 of an even function of d (Ridders): Neville's scheme over shrinking d, best estimate wins."""
    ratio, best, error = 1.5, float("nan"), float("inf")
    previous: list[float] = []
    for level in range(levels):
        row = [difference(start / ratio**level)]
        for k, older in enumerate(previous):
            factor = ratio ** (2 * (k + 1))
            row.append((factor * row[k] - older) / (factor - 1.0))
        if previous:
            change = max(abs(row[-1] - row[-2]), abs(row[-1] - previous[-1]))
            if change < error:
                best, error = row[-1], change
        previous = row[:12]
    return best


def read_law(given: tuple[str, Any]) -> ScalarLaw:
    """A LAW as it goes to the core: ("constant", x), ("polynomial", c), ("table", points), ("expression", text)."""
    kind, data = given
    if kind in ("constant", "polynomial"):
        return PolynomialLaw(data)
    if kind == "table":
        return TableLaw(data)
    if kind == "expression":
        return ExpressionLaw(data)
    raise ValueError(f"law: {kind!r} is not a kind of law")


def read_vector(given: Any) -> F64:
    """Three numbers."""
    return np.array(given, dtype=np.float64).reshape(3)
