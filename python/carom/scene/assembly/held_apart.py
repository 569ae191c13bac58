"""Pairs of balls that have no contact: those of one clump, and those whose joints keep their centres at one distance, or
join them where they touch (algorithm, section 7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from carom.arrays import F64, I64, Bool, connected

THREE = 1e-6
"""Volume that three unit axes span from which they are three."""


AT_SURFACE = 1e-3
"""How far beyond the surfaces, over the sum of the radii, a ball joint may be that joins two balls where they touch."""


class HeldApart(NamedTuple):
    """These pairs of N balls."""

    clump: I64
    """(N,) a ball of the clump that each belongs to."""
    pairs: frozenset[tuple[int, int]]
    """Held by a rod or a ball joint, the lower number first."""

    def holds(self, a: I64, b: I64) -> Bool:
        """Whether the pairs (K,) of balls are such; `b` from N on are walls."""
        balls = b < len(self.clump)
        other = np.where(balls, b, 0)
        held = np.array([pair in self.pairs for pair in zip(a.tolist(), b.tolist(), strict=True)], dtype=bool)
        return np.asarray(balls & ((self.clump[a] == self.clump[other]) | held))


def held_apart(joints: Sequence[Mapping[str, Any]], radius: F64, clump: I64) -> HeldApart:
    """Of joints as the core has them (`mechanics.joints_for_core`) and balls of radii (N,), m; `clump` (N,) is the number
    of the clump that each is a part of, -1 of the others.
    """
    pairs, tied = set(), []
    between = sorted((joint for joint in joints if joint["b"] >= 0), key=_pair)
    for pair, same in groupby(between, _pair):
        listed = [joint["rows"] for joint in same]
        if any(_keeps_apart(rows, float(radius[list(pair)].sum())) for rows in listed):
            pairs.add(pair)
        common = any(_spans_space(rows, "point") for rows in listed)
        if common and _spans_space([row for rows in listed for row in rows], "rotation"):
            tied.append(pair)
    # Balls of one clump, each with the next one.
    parts = np.flatnonzero((clump[1:] == clump[:-1]) & (clump[1:] >= 0))
    links = np.concatenate(
        [np.array(tied, dtype=np.int64).reshape(-1, 2), np.stack([parts, parts + 1], axis=1)]
    )
    return HeldApart(connected(len(radius), *links.T), frozenset(pairs))


def _pair(joint: Mapping[str, Any]) -> tuple[int, int]:
    a, b = int(joint["a"]), int(joint["b"])
    return min(a, b), max(a, b)


def _keeps_apart(rows: Sequence[Any], radii: float) -> bool:
    """A rod of constant length between the centres, or a common point that is the centre of one of both or where their
    surfaces touch; `radii`: their sum.
    """
    kind, _, *given, law = rows[0]
    arms = [float(np.linalg.norm(arm)) for arm in given]
    if kind == "distance":
        return law[0] == "constant" and not any(arms)
    return _spans_space(rows, "point") and (not all(arms) or sum(arms) <= (1.0 + AT_SURFACE) * radii)


def _spans_space(rows: Sequence[Any], kind: str) -> bool:
    """Whether the constant rows of a kind hold all three directions."""
    still = [row[1] for row in rows if row[0] == kind and row[4][0] == "constant"]
    axes = np.array(still, dtype=np.float64).reshape(-1, 3)
    return bool(np.linalg.det(axes.T @ axes) > THREE)
