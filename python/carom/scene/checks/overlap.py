"""Which spheres overlap, in a time proportional to their number, with NumPy alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.scene.packing.neighbours import pairs, separation

FIRST = 1000
"""Spheres that are looked at first; then ten times as many, and so on."""

Overlap = tuple[int, int, float]
"""Two spheres (lower number first) and their gap, m, which is negative."""


def overlaps(
    position: F64,
    radius: F64,
    tolerance: float = 1e-9,
    most: int = 20,
    periods: Sequence[float] | None = None,
    no_contact: Callable[[I64, I64], Bool] | None = None,
) -> list[Overlap]:
    """Pairs whose gap is below `-tolerance` times the smaller radius, at most `most` of them.

    `position` (N, 3) and `radius` (N,), both finite, m. `periods` (3,) m are those of a periodic world, 0 along others,
    of at least four radii: then balls also meet the images of others. `no_contact` says of pairs (K,) which of them have
    no contact: their overlaps do not count.

    Where most spheres lie in one place their pairs would fill the memory. Some drawn at random then show enough overlaps.
    """
    box = None if periods is None else np.array(periods, dtype=np.float64)
    order = np.random.default_rng(0).permutation(len(radius))
    count = min(FIRST, len(radius))
    while True:
        drawn = np.sort(order[:count])
        reach = radius[drawn] * (1.0 + max(0.0, -tolerance))
        a, b = (drawn[of] for of in pairs(position[drawn], reach, box))
        gap = np.linalg.norm(separation(position[a] - position[b], box), axis=1) - radius[a] - radius[b]
        deep = np.flatnonzero(gap < -tolerance * np.minimum(radius[a], radius[b]))
        if no_contact is not None:
            deep = deep[~no_contact(a[deep], b[deep])]
        if count == len(radius) or len(deep) >= most:
            chosen = deep[:most]
            return list(zip(a[chosen].tolist(), b[chosen].tolist(), gap[chosen].tolist(), strict=True))
        count = min(10 * count, len(radius))
