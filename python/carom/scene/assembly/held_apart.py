"""Pairs of balls whose joints keep their centres at one distance: they have no contact (algorithm, section 7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

I64 = NDArray[np.int64]

THREE = 1e-6
"""Volume that three unit axes span from which they are three."""


class HeldApart(NamedTuple):
    """These pairs of N balls."""

    clump: I64
    """(N,) a ball of the clump that each belongs to."""
    pairs: frozenset[tuple[int, int]]
    """Held by a rod or a ball joint, the lower number first."""

    def holds(self, a: I64, b: I64) -> NDArray[np.bool_]:
        """Whether the pairs (K,) of balls are such; `b` from N on are walls."""
        balls = b < len(self.clump)
        other = np.where(balls, b, 0)
        held = np.array([pair in self.pairs for pair in zip(a.tolist(), b.tolist(), strict=True)], dtype=bool)
        return np.asarray(balls & ((self.clump[a] == self.clump[other]) | held))


def held_apart(joints: Sequence[Mapping[str, Any]], balls: int) -> HeldApart:
    """Of joints as the core has them (`mechanics.joints_for_core`)."""
    clump, pairs = np.arange(balls), set()
    between = sorted((joint for joint in joints if joint["b"] >= 0), key=_pair)
    for pair, same in groupby(between, _pair):
        listed = [joint["rows"] for joint in same]
        if any(_keeps_distance(rows) for rows in listed):
            pairs.add(pair)
        common = any(_spans_space(rows, "point") for rows in listed)
        if common and _spans_space([row for rows in listed for row in rows], "rotation"):
            clump[clump == clump[pair[1]]] = clump[pair[0]]
    return HeldApart(clump, frozenset(pairs))


def _pair(joint: Mapping[str, Any]) -> tuple[int, int]:
    a, b = int(joint["a"]), int(joint["b"])
    return min(a, b), max(a, b)


def _keeps_distance(rows: Sequence[Any]) -> bool:
    """A rod of constant length between the centres, or a common point that is the centre of one of both."""
    for kind, _, arm_a, arm_b, law in rows:
        if kind == "distance" and law[0] == "constant" and not np.any(arm_a) and not np.any(arm_b):
            return True
    return _spans_space(rows, "point") and not (np.any(rows[0][2]) and np.any(rows[0][3]))


def _spans_space(rows: Sequence[Any], kind: str) -> bool:
    """Whether the constant rows of a kind hold all three directions."""
    still = [row[1] for row in rows if row[0] == kind and row[4][0] == "constant"]
    axes = np.array(still, dtype=np.float64).reshape(-1, 3)
    return bool(np.linalg.det(axes.T @ axes) > THREE)
