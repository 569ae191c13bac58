"""Laws of one variable, read and evaluated here: the auditor does not ask the core what a formula is worth.

A law has the form in which results and models keep it: `("constant", x)`, `("polynomial", [c0, c1, ...])`,
`("table", [[x, y], ...])` or `("expression", text)`. Values come with their slopes, by the chain rule.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from carom.arrays import F64

Dual = tuple[F64, F64]
"""A value and its slope."""

_FUNCTIONS: dict[str, tuple[Callable[[F64], F64], Callable[[F64], F64]]] = {
    "sin": (np.sin, np.cos),
    "cos": (np.cos, lambda x: -np.sin(x)),
    "tan": (np.tan, lambda x: 1.0 / np.cos(x) ** 2),
    "asin": (np.arcsin, lambda x: 1.0 / np.sqrt(1.0 - x * x)),
    "acos": (np.arccos, lambda x: -1.0 / np.sqrt(1.0 - x * x)),
    "atan": (np.arctan, lambda x: 1.0 / (1.0 + x * x)),
    "sqrt": (np.sqrt, lambda x: 0.5 / np.sqrt(x)),
    "exp": (np.exp, np.exp),
    "ln": (np.log, lambda x: 1.0 / x),
    "log10": (np.log10, lambda x: 1.0 / (x * np.log(10.0))),
    "floor": (np.floor, np.zeros_like),
    "ceil": (np.ceil, np.zeros_like),
    "sign": (np.sign, np.zeros_like),
}
"""Functions of one value, with their derivatives."""


def law(form: Sequence[Any], x: F64, *, before: bool = False) -> Dual:
    """Values and slopes of a law at `x`, of its shape; at a kink the slope to the right, with `before` that to the left."""
    kind, data = form
    x = np.asarray(x, dtype=np.float64)
    rounding = 8.0 * np.finfo(np.float64).eps * np.abs(x)  # t_n + h and n h differ by so much
    if kind == "constant":
        return np.full(x.shape, float(data)), np.zeros(x.shape)
    if kind == "polynomial":
        polynomial = np.polynomial.Polynomial(data)
        return np.asarray(polynomial(x)), np.asarray(polynomial.deriv()(x))
    if kind == "table":
        return _table(np.asarray(data, dtype=np.float64), x, rounding, before)
    with np.errstate(all="ignore"):  # a formula may have no value somewhere; its user will see a NaN there
        tree = _parsed(str(data))
        way = -1.0 if before else 1.0
        (value, at), (_, beside) = (_evaluate(tree, place, way) for place in (x, x + way * rounding))
        return value, way * np.where(np.isfinite(beside), beside, at)  # a formula may end at `x`


def _table(points: F64, x: F64, rounding: F64, before: bool) -> Dual:
    knots, values = points[:, 0], points[:, 1]
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(knots), [0.0]])
    side: Literal["left", "right"] = "left" if before else "right"
    place = np.searchsorted(knots, x - rounding if before else x + rounding, side=side)
    return np.interp(x, knots, values), slopes[place]


@lru_cache(maxsize=256)
def _parsed(text: str) -> ast.expr:
    """The tree of a formula: its powers bind as Python's do, which knows no numbers such as 007."""
    plain = re.sub(r"(?<![\w.])0+(?=\d)", "", " ".join(text.split()))
    return ast.parse(plain.replace("^", "**"), mode="eval").body


def _evaluate(node: ast.expr, x: F64, way: float) -> Dual:
    """The value, and its change where `x` goes the way of 1 or -1."""
    if isinstance(node, ast.Constant):
        return np.full(x.shape, float(node.value)), np.zeros(x.shape)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        if node.id in ("pi", "PI"):
            return np.full(x.shape, np.pi), np.zeros(x.shape)
        return x, np.full(x.shape, way)  # the one variable, whatever its name
    if isinstance(node, ast.UnaryOp):
        value, slope = _evaluate(node.operand, x, way)
        return (-value, -slope) if isinstance(node.op, ast.USub) else (value, slope)
    if isinstance(node, ast.BinOp):
        return _binary(node.op, _evaluate(node.left, x, way), _evaluate(node.right, x, way))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return _call(node.func.id, [_evaluate(argument, x, way) for argument in node.args])
    raise ValueError(f"cannot read {ast.unparse(node)!r} in a formula")


def _binary(op: ast.operator, left: Dual, right: Dual) -> Dual:
    (a, da), (b, db) = left, right
    if isinstance(op, ast.Add):
        return a + b, da + db
    if isinstance(op, ast.Sub):
        return a - b, da - db
    if isinstance(op, ast.Mult):
        return a * b, da * b + a * db
    if isinstance(op, ast.Div):
        return a / b, (da - a / b * db) / b
    power = a**b
    # Where the exponent does not vary its term, a logarithm that may not exist, is left out.
    varying = np.where(db != 0.0, power * np.log(np.where(a > 0.0, a, 1.0)) * db, 0.0)
    return power, np.where(b != 0.0, b * a ** (b - 1.0) * da, 0.0) + varying


def _call(name: str, given: list[Dual]) -> Dual:
    if name == "abs":
        ((a, da),) = given
        return np.abs(a), np.where(a == 0.0, np.abs(da), np.sign(a) * da)
    if name in _FUNCTIONS:
        value, derivative = _FUNCTIONS[name]
        ((a, da),) = given
        return value(a), derivative(a) * da
    if name == "atan2":
        (y, dy), (x, dx) = given
        return np.arctan2(y, x), (x * dy - y * dx) / (x * x + y * y)
    if name in ("min", "max"):
        best, slope = given[0]
        for a, da in given[1:]:
            sign = 1.0 if name == "min" else -1.0
            better = (sign * a < sign * best) | ((a == best) & (sign * da < sign * slope))
            best, slope = np.where(better, a, best), np.where(better, da, slope)
        return best, slope
    raise ValueError(f"unknown function {name!r} in a formula")
