"""Order of convergence in the step h: the error measure of eq. 45, and the slope of log error over log h.

(The module is not called `converge`: importing it would hide the function of that name in the package.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from carom.errors import CaromError

#: Errors by eq. 45 below this are rounding: no order is read from them.
ROUNDING = 1e-12
#: What an order is not read from either: an error above this, orders of neighbours further apart, a slope below.
LARGE, SCATTER, FLAT = 1.0, 0.5, 0.25
#: Errors of all steps above this do not come from the tolerance of a solver.
SOLVED = 1e-6
EVENT = "an event (impact, end of sliding) falls at another place of the step for each h"
#: A reference step at most this part of the finest step adds little to the errors.
FINER = 4


@dataclass(frozen=True)
class Order:
    """Observed order: `value` is the slope of log error over log h by least squares over all steps.

    `uncertainty` is the standard error of that slope, NaN for fewer than three steps. `pairwise` are the
    slopes between neighbouring steps, coarse to fine. `factor` is C of the fitted `error = C h^value`.
    """

    value: float
    uncertainty: float
    pairwise: tuple[float, ...]
    factor: float

    def __float__(self) -> float:
        return self.value

    def at(self, h: float) -> float:
        """The error that the fit has at step `h` (s)."""
        return float(self.factor * h**self.value)


def error_of(found: ArrayLike, reference: ArrayLike, norm: Literal[1, 2] = 1) -> float:
    """Eq. 45: `sum |f - f_ref| / sum |f_ref|` over all times (and bodies), |.| over the last axis, (..., components).

    `norm = 1` is the paper's; 2 is the length of a vector, which does not depend on the directions of the axes.
    Where the reference vanishes everywhere the sum of the differences itself is given, in their unit.
    """
    found, reference = np.asarray(found, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    off = float(np.sum(np.linalg.norm(found - reference, ord=norm, axis=-1)))
    size = float(np.sum(np.linalg.norm(reference, ord=norm, axis=-1)))
    return off / size if size > 0 else off


def order_of(steps: Sequence[float], errors: Sequence[float]) -> Order:
    """The order of convergence that `errors` at the step sizes `steps` (s, any order, at least two) show.

    An error of 0 has no logarithm, and one at the level of rounding no order: leave such steps out.
    """
    h, e = np.asarray(steps, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    if h.ndim != 1 or h.shape != e.shape or len(h) < 2:
        raise CaromError("an order needs one error per step and at least two steps")
    if not (np.all(h > 0) and np.all(np.isfinite(h)) and len(np.unique(h)) == len(h)):
        raise CaromError("the steps of an order must be positive and all different")
    if not (np.all(e > 0) and np.all(np.isfinite(e))):
        raise CaromError("an order needs errors above 0; leave out the steps where the error vanishes")
    coarse_first = np.argsort(-h)
    x, y = np.log(h[coarse_first]), np.log(e[coarse_first])
    dx = x - x.mean()
    spread = float(dx @ dx)
    slope = float(dx @ (y - y.mean())) / spread
    rest = y - y.mean() - slope * dx
    free = len(x) - 2
    uncertainty = math.sqrt(float(rest @ rest) / free / spread) if free else math.nan
    pairs = np.diff(y) / np.diff(x)
    return Order(slope, uncertainty, tuple(map(float, pairs)), math.exp(float(y.mean() - slope * x.mean())))


def clear_order(steps: Sequence[float], errors: Sequence[float]) -> Order | None:
    """The order of the errors that stand clear of rounding; None where fewer than two do."""
    clear = [(h, e) for h, e in zip(steps, errors, strict=True) if e > ROUNDING]
    return order_of(*zip(*clear, strict=True)) if len(clear) > 1 else None


def pairwise_order(steps: Sequence[float], errors: Sequence[float]) -> float | None:
    """The order between two steps; None where an error is rounding or missing."""
    order = clear_order(steps, errors)
    return None if order is None else order.value


def doubts(name: str, steps: Sequence[float], errors: Sequence[float]) -> list[str]:
    """Why the order of a quantity should not be believed, a sentence each; nothing if it may be."""
    told = []
    order = clear_order(steps, errors)
    if any(0 < e <= ROUNDING for e in errors):
        told.append(f"{name}: errors below {ROUNDING:g} are rounding and show no order; larger steps would")
    if order is None:
        return told
    if max(e for e in errors if e == e) > LARGE:
        told.append(
            f"{name}: an error is as large as the quantity itself, so it shows no order: the quantity is about zero,"
            " or the motion is chaotic by then; choose another quantity, or an earlier time"
        )
    elif max(order.pairwise) - min(order.pairwise) > SCATTER:
        told.append(
            f"{name}: the order scatters from {min(order.pairwise):.2f} to {max(order.pairwise):.2f}, the fit means"
            f" little: {EVENT}, steps are too large, or the motion is chaotic;"
            " choose steps with the event at the same place, or an earlier time"
        )
    elif order.value < FLAT:
        large = min(e for e in errors if e > ROUNDING) > SOLVED
        cause = (
            f"{EVENT}, or the reference is another motion; choose finer steps, or an earlier time"
            if large
            else "it comes from elsewhere (tolerance of the solver, reference)"
        )
        told.append(f"{name}: the error hardly depends on the step: {cause}")
    return told
