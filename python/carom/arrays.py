"""Types of arrays (shapes and units stand where one is used), and what is joined by pairs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]
Array = NDArray[Any]


def connected(n: int, a: I64, b: I64) -> I64:
    """Of `n` things of which pairs `a`, `b` (K,) are joined: the lowest number in the group of each, (n,)."""
    label = np.arange(n)
    while True:
        low = np.minimum(label[a], label[b])
        if (label[a] == label[b]).all():
            return label
        np.minimum.at(label, label[a], low)
        np.minimum.at(label, label[b], low)
        while (label[label] != label).any():
            label = label[label]
