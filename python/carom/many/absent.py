"""Balls that are not there, as they left or have not entered yet: they have no number in what is compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from carom.arrays import F64, Bool
from carom.errors import quoted
from carom.run.result import Result

#: Balls that a remark names.
FEW = 10


def there_only(values: Any, there: Any) -> F64:
    """A quantity (..., N, 3) with NaN for the balls that are not `there` (..., N)."""
    return np.where(np.asarray(there)[..., None], values, np.nan)


def absent_at(frames: Sequence[int], result: Result) -> Bool:
    """Which balls are not there at the frames, (K, N); none at those that the run did not reach."""
    there, none = result.present, np.zeros(len(result.names), dtype=bool)
    return np.array([~there[k] if k < len(result.time) else none for k in frames])


def told(times: Sequence[float], bodies: Sequence[str], absent: Bool) -> tuple[str, ...]:
    """For each time the balls that have no difference, as they are `absent` (K, N) in some run."""
    found = [
        (t, [name for name, off in zip(bodies, row, strict=True) if off])
        for t, row in zip(times, absent, strict=True)
    ]
    return tuple(
        f"differences at {t:g} s leave out {', '.join(map(quoted, names[:FEW]))}"
        f"{f' and {len(names) - FEW} more' * (len(names) > FEW)}: not there in all runs"
        for t, names in found
        if names
    )
