"""Quantities with an error of first order in the step: a row at the paper's h, and one of their limit for h -> 0.

The error admitted at h follows from the runs, and is not chosen: of v(h) = v(0) + c h + O(h^2) two steps give c. It is
the limit that proves the law, since the impact in it falls on an instant, not on the end of a step.
"""

from __future__ import annotations

from collections.abc import Sequence

from carom.reproduce import study
from carom.reproduce.document import Row

#: What a row at the paper's h admits, over the error c h that is predicted: the second order, up to 1/8 of it here.
SPARE = 1.2
#: Differences below this are rounding, in any of the units that occur (m, s, m/s).
SMALLEST = 1e-9
#: The unit of c in v(h) = v(0) + c h by that of v.
_PER_SECOND = {"s": "", "1": "1/s", "m": "m/s", "m/s": "m/s^2"}


def steps(event: float, h: float, count: int) -> list[float]:
    """h and `count` - 1 steps near h/2, h/4, ..., coarse first, with the time `event` at the same share of a step.

    The scheme has an impact at the end of its step: its delay is then the same share of all steps, and errors go
    smoothly to zero. h/2 itself may well delay the impact by as much as h.
    """
    whole, place = divmod(event / h, 1.0)
    return [h] + [event / (whole * 2**k + place) if event else h / 2**k for k in range(1, count)]


def limits(h: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Limit by the two finest steps, and by the two before: their difference bounds the error of the first."""
    return study.limit(h, values), study.limit(h[:-1], values[:-1])


def rows(
    quantity: str,
    unit: str,
    h: Sequence[float],
    values: Sequence[float],
    exact: float,
    *,
    paper: float | str | None = None,
    note: str = "",
    scatter: tuple[float, str] = (0.0, ""),
) -> list[Row]:
    """Two rows of a quantity with the `values` at the steps `h` of `steps`, three at least.

    `scatter`: what the limit may be off besides, and why, where a later event has no fixed place in the step.
    """
    slope = (values[0] - values[1]) / (h[0] - h[1])
    c = f"{abs(slope):.3g} {_PER_SECOND[unit]}".rstrip()
    predicted = f"first order: {SPARE:g} c h, c = {c} from the runs with h = {h[0]:g} and {h[1]:.4g} s"
    finest, before = limits(h, values)
    extrapolated = (
        f"from the two finest steps, {h[-1]:.2g} s and twice that, less c h. Admitted: the difference to what the two before"
        f" them give{scatter[1]}"
    )
    within = SPARE * abs(slope) * h[0] + SMALLEST
    return [
        study.row(quantity, unit, values[0], within, predicted, exact=exact, paper=paper, note=note),
        study.row(
            f"{quantity}, h -> 0",
            unit,
            finest,
            abs(finest - before) + scatter[0] + SMALLEST,
            extrapolated,
            exact=exact,
        ),
    ]
