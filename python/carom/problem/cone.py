"""The cone of a contact, and the nearest point of it.

The multiplier of a contact is `r = (r_N, r_1, ..., r_B)`: the normal component first, then one block for each
bound: sliding (1 component in the plane, 2 in space), rolling (2), spinning (1). With bounds `mu_b >= 0`

    K  = { r : r_N >= 0, |r_b| <= mu_b r_N for all b }
    K* = { u : u_N >= sum_b mu_b |u_b| }                                    (its dual)

For sliding alone K is the second-order cone of Coulomb; with rolling it is that of Acary and Bourrier (2021),
"Coulomb friction with rolling resistance as a cone complementarity problem", to which spinning adds one bound
of the same kind.

**Projection.** The nearest point of K to r is found along the normal component: given t = r_N of the result,
each block is cut to the radius mu_b t, so t >= 0 minimises

    (t - r_N)^2 + sum_b max(0, |r_b| - mu_b t)^2.

Its derivative rises and bends where t = |r_b|/mu_b; with the k blocks of largest |r_b|/mu_b cut,
t_k = (r_N + sum mu_b |r_b|)/(1 + sum mu_b^2). The right k is the first whose t_k is not below the ratio of the next
block: no iteration and no list of cases.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64

#: Rows of a contact -> its blocks behind the normal row, one for each bound: sliding, rolling, spinning.
BLOCKS: dict[int, tuple[slice, ...]] = {
    2: (slice(1, 2),),
    3: (slice(1, 3),),
    5: (slice(1, 3), slice(3, 5)),
    6: (slice(1, 3), slice(3, 5), slice(5, 6)),
}


def lengths(r: F64) -> F64:
    """(C, B) Euclidean norms of the blocks of `r` (C, d)."""
    parts = [r[:, block] for block in BLOCKS[r.shape[1]]]
    return np.stack(
        [np.hypot(x[:, 0], x[:, 1]) if x.shape[1] == 2 else np.abs(x[:, 0]) for x in parts], axis=1
    )


def project(r: F64, bounds: F64) -> F64:
    """(C, d) nearest points of the cones with `bounds` (C, B) to `r` (C, d); points of the cone stay as they are."""
    norm = lengths(r)
    with np.errstate(divide="ignore", over="ignore"):
        ratio = np.divide(norm, bounds, out=np.zeros_like(norm), where=norm > 0.0)  # a bound of 0: always cut
    order = np.argsort(-ratio, axis=1, kind="stable")
    m, x, ratio = (np.take_along_axis(a, order, axis=1) for a in (bounds, norm, ratio))
    start = r[:, :1]
    heights = np.concatenate(
        [start, (start + np.cumsum(m * x, axis=1)) / (1.0 + np.cumsum(m * m, axis=1))], 1
    )
    following = np.concatenate([ratio, np.full_like(start, -np.inf)], axis=1)
    k = np.argmax(heights >= following, axis=1)
    out = np.empty_like(r)
    out[:, 0] = np.maximum(heights[np.arange(len(r)), k], 0.0)
    for b, block in enumerate(BLOCKS[r.shape[1]]):
        radius = bounds[:, b] * out[:, 0]
        cut = norm[:, b] > radius
        factor = np.divide(radius, norm[:, b], out=np.ones_like(radius), where=cut)
        out[:, block] = r[:, block] * factor[:, None]
    return out


def shift(u: F64, bounds: F64) -> F64:
    """(C, d) `u + (sum_b mu_b |u_b|) n`, the change of variable of De Saxce and Feng, n the normal component."""
    out = u.copy()
    out[:, 0] += np.sum(bounds * lengths(u), axis=1)
    return out


def outside(r: F64, bounds: F64) -> F64:
    """(C,) by how much each contact leaves its cone: the largest of -r_N and |r_b| - mu_b r_N, at least 0."""
    excess = np.max(lengths(r) - bounds * np.maximum(r[:, :1], 0.0), axis=1)
    worst: F64 = np.maximum(np.maximum(excess, -r[:, 0]), 0.0)
    return worst
