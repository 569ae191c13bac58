"""Volume, centre and inertia tensor of a body that is the union of spheres: each point counts once.

All three follow from integrals over the surface of the union, by the divergence theorem with the outward normal n:

    V = 1/3 ∮ x.n dA,   ∫ x dV = 1/4 ∮ x (x.n) dA,   ∫ x x^T dV = 1/5 ∮ x x^T (x.n) dA

The surface is what no other sphere covers of each sphere. On a sphere of centre c and radius r is x = c + r n, so that
the integrals of 1, n, n n and n n n over the uncovered part are all that is needed. With the height z along the axis and
the angle phi about it dA = r dz dphi. At one height every other sphere covers one interval of phi, in closed form; what
the intervals leave is integrated exactly. Along z Gauss-Legendre quadrature goes from bend to bend of the integrand:
where a circle of intersection begins or ends, and where two of them cross. At its ends the integrand goes like a square
root, which z = m + h sin(theta) takes away.

A sphere that meets no other one is added in closed form, so that a union without overlaps is exact to rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from carom.arrays import F64

POINTS = 32
"""Points of Gauss-Legendre quadrature from bend to bend. Two overlapping spheres come out to 1e-14, tight heaps of twenty to
1e-9 of the volume (`tests/test_clumps_union.py`).
"""
BLOCK = 1 << 19
"""Pairs of a height and a covering sphere that are looked at together: some 30 MB."""
GRADE = 8.0
"""An interval longer than this, over one beside it, is divided."""
ROUNDING = 1e-15
"""Parts of the centre and of the second moments below this, over the size of the body, are 0."""
SAME_BEND = 1e-12
"""Bends closer than this, over the radius, are one: rounding parts what meets in one point."""

Spheres = tuple[tuple[float, ...], ...]
"""Centres x, y, z and radii, m."""


@dataclass(frozen=True, eq=False)
class Union:
    """A homogeneous body: volume, m^3, centre (3,), m, and `second` (3, 3), the integral of x x^T about the centre, m^5."""

    volume: float
    centre: F64
    second: F64

    def inertia(self, mass: float) -> F64:
        """Tensor of inertia about the centre, (3, 3), kg m^2, of that mass, kg."""
        with np.errstate(all="ignore"):  # absurd sizes are reported by the checks
            density = np.float64(mass) / self.volume
            return np.asarray(density * (np.trace(self.second) * np.eye(3) - self.second))


@lru_cache(maxsize=256)
def union(spheres: Spheres) -> Union:
    """The body that these spheres are together."""
    given = np.array(spheres, dtype=np.float64)
    size = float(np.abs(given).max())
    centre, radius = given[:, :3] / size, given[:, 3] / size
    with np.errstate(all="ignore"):
        origin = np.average(centre, axis=0, weights=radius / radius.max())
        moments = [_of_sphere(centre - origin, radius, k) for k in range(len(radius))]
        volume = math.fsum(m[0] for m in moments)
        first = _sum([m[1] for m in moments])
        away = first / volume
        away[np.abs(away) < ROUNDING] = 0.0
        second = _sum([m[2] for m in moments]) - volume * np.outer(away, away)
        cube = size * size * size  # a power would raise OverflowError
        second[np.abs(second) < ROUNDING * np.trace(second)] = 0.0
        return Union(volume * cube, (origin + away) * size, second * size * size * cube)


def _sum(parts: list[F64]) -> F64:
    """Sum without rounding on the way: the order of the spheres is no matter."""
    rows = np.stack(parts).reshape(len(parts), -1)
    return np.array([math.fsum(column) for column in rows.T.tolist()]).reshape(parts[0].shape)


def _of_sphere(centre: F64, radius: F64, k: int) -> tuple[float, F64, F64]:
    """What sphere k adds to the volume, to the integral of x and to that of x x^T."""
    c, r = centre[k], float(radius[k])
    axes, heights = _caps(centre, radius, k)
    if axes is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    if not len(heights):
        volume = 4.0 / 3.0 * math.pi * r**3
        return volume, volume * c, volume * (np.outer(c, c) + r * r / 5.0 * np.eye(3))
    one, n1, n2, n3 = _uncovered(axes, heights)  # of the unit sphere
    # x.n = c.n + r and x = c + r n
    along = c @ n1 + r * one
    outward = n2 @ c + r * n1  # of n (x.n)
    tensor = np.tensordot(n3, c, 1) + r * n2  # of n n^T (x.n)
    mixed = np.outer(c, outward)
    second = along * np.outer(c, c) + r * (mixed + mixed.T) + r * r * tensor
    area = r * r
    return area * along / 3.0, area * (along * c + r * outward) / 4.0, area * second / 5.0


def _caps(centre: F64, radius: F64, k: int) -> tuple[F64 | None, F64]:
    """The caps that other spheres cover of sphere k: unit axes (M, 3) and heights (M,) over the radius, from which they
    reach to their poles. None if all of it is covered.
    """
    r = radius[k]
    apart = np.delete(centre, k, axis=0) - centre[k]
    other = np.delete(radius, k)
    distance = np.linalg.norm(apart, axis=1)
    within = distance + r <= other
    twin = within & (distance + other <= r)  # the same sphere twice: the first one counts
    before = np.arange(len(other)) < k
    if (within & (~twin | before)).any():
        return None, np.zeros(0)
    near = ~twin & (distance < r + other) & (distance + other > r)
    height = (distance**2 + r**2 - other**2) / (2.0 * distance * r)
    near &= np.abs(height) < 1.0  # not so where they touch, to rounding
    axes, height = apart[near] / distance[near, None], height[near]
    widest = np.arccos(height)
    between = np.arccos(np.clip(axes @ axes.T, -1.0, 1.0))
    # A cap that lies in another one adds nothing; of two equal ones the first stays.
    inside = between + widest[:, None] <= widest[None]
    np.fill_diagonal(inside, False)
    inside &= ~(inside.T & (np.arange(len(height))[:, None] < np.arange(len(height))[None]))
    shown = ~inside.any(axis=1)
    return axes[shown], height[shown]


def _uncovered(axes: F64, heights: F64) -> tuple[float, F64, F64, F64]:
    """Integrals of 1, n, n n and n n n over what the caps leave of the unit sphere."""
    bends = _bends(axes, heights)
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    theta = 0.5 * math.pi * nodes
    middle, half = 0.5 * (bends[1:] + bends[:-1]), 0.5 * (bends[1:] - bends[:-1])
    z = (middle[:, None] + half[:, None] * np.sin(theta)).ravel()
    weight = (0.5 * math.pi * half[:, None] * np.cos(theta) * weights).ravel()
    total = np.zeros(20)
    rows = max(1, BLOCK // len(heights))
    for first in range(0, len(z), rows):
        part = slice(first, first + rows)
        total += weight[part] @ _rings(z[part], axes, heights)
    return _tensors(total)


def _bends(axes: F64, heights: F64) -> F64:
    """Heights between which the integrand is smooth, ascending, from -1 to 1."""
    across = np.sqrt(1.0 - heights**2)
    tilt = np.sqrt(np.maximum(0.0, 1.0 - axes[:, 2] ** 2))
    middle = heights * axes[:, 2]
    found = [np.array([-1.0, 1.0]), middle - across * tilt, middle + across * tilt]
    if len(heights) > 1:
        found.append(_crossings(axes, heights))
    bends = np.unique(np.clip(np.concatenate(found), -1.0, 1.0))
    bends = np.append(bends[np.diff(bends, append=2.0) > SAME_BEND][:-1], 1.0)
    bends[0] = -1.0
    return _graded(bends)


def _graded(bends: F64) -> F64:
    """The same with more points in intervals much longer than one beside them: a bend close beyond an end is felt."""
    lengths = np.diff(bends)
    beside = np.concatenate([[np.inf], lengths, [np.inf]])
    more = [bends]
    for k in np.flatnonzero(lengths > GRADE * np.minimum(beside[:-2], beside[2:])).tolist():
        for end, way, step in ((bends[k], 1.0, beside[k]), (bends[k + 1], -1.0, beside[k + 2])):
            if math.isfinite(step):
                count = max(0, math.ceil(math.log(0.5 * lengths[k] / step, GRADE)))
                more.append(end + way * step * GRADE ** np.arange(count, dtype=np.float64))
    return np.unique(np.concatenate(more))


def _crossings(axes: F64, heights: F64) -> F64:
    """Heights z at which the circles of two caps cross in the open: in no third cap."""
    a, b = np.triu_indices(len(heights), 1)
    cosine = np.sum(axes[a] * axes[b], axis=1)
    normal = np.cross(axes[a], axes[b])
    square = np.sum(normal * normal, axis=1)
    inner = heights[a] ** 2 + heights[b] ** 2 - 2.0 * cosine * heights[a] * heights[b]
    cross = (square > 0.0) & (inner <= square)
    a, b, cosine, normal, square, inner = (q[cross] for q in (a, b, cosine, normal, square, inner))
    foot = (heights[a] - cosine * heights[b])[:, None] * axes[a]
    foot = (foot + (heights[b] - cosine * heights[a])[:, None] * axes[b]) / square[:, None]
    reach = (np.sqrt(1.0 - inner / square) / np.sqrt(square))[:, None] * normal
    points = np.concatenate([foot + reach, foot - reach])
    open_ = np.ones(len(points), dtype=bool)
    rows = max(1, BLOCK // len(heights))
    for first in range(0, len(points), rows):
        part = slice(first, first + rows)
        open_[part] = (points[part] @ axes.T - heights <= 1e-9).all(axis=1)
    found: F64 = points[open_, 2]
    return found


def _rings(z: F64, axes: F64, heights: F64) -> F64:
    """Integrals over phi at heights z (K,) of the 20 products of up to three components of n, (K, 20)."""
    ring = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    width = np.hypot(axes[:, 0], axes[:, 1])
    flat = width < 1e-150  # a cap about the axis covers whole rings
    level = (heights - np.outer(z, axes[:, 2])) / (np.outer(ring, np.where(flat, 1.0, width)) + 1e-300)
    level = np.where(flat, np.where(np.outer(z, axes[:, 2]) > heights, -2.0, 2.0), level)
    half = np.arccos(np.clip(level, -1.0, 1.0))
    angle = np.mod(np.arctan2(axes[:, 1], axes[:, 0]), 2.0 * math.pi)
    low, high = angle - half, angle + half
    # Covered intervals within one turn; what goes over its end comes again at its beginning.
    begin = np.concatenate([np.maximum(low, 0.0), np.where(low < 0.0, low + 2.0 * math.pi, 8.0)], axis=1)
    end = np.concatenate([np.minimum(high, 2.0 * math.pi), np.where(low < 0.0, 2.0 * math.pi, 8.0)], axis=1)
    over = high > 2.0 * math.pi
    begin = np.concatenate([begin, np.where(over, 0.0, 8.0)], axis=1)
    end = np.concatenate([end, np.where(over, high - 2.0 * math.pi, 8.0)], axis=1)
    nothing = np.tile(half <= 0.0, 3)
    begin, end = np.where(nothing, 8.0, begin), np.where(nothing, 8.0, end)
    order = np.argsort(begin, axis=1)
    begin, end = np.take_along_axis(begin, order, 1), np.take_along_axis(end, order, 1)
    turn = 2.0 * math.pi
    covered = np.maximum.accumulate(np.where(begin < turn, end, turn), axis=1)
    start = np.concatenate([np.zeros((len(z), 1)), covered], axis=1)
    stop = np.concatenate([np.minimum(begin, turn), np.full((len(z), 1), turn)], axis=1)
    free = np.maximum(stop - start, 0.0) > 0.0
    row, at = np.nonzero(free)
    arcs = _arcs(start[row, at], stop[row, at])  # of cos^p sin^q
    sums = np.zeros((len(z), arcs.shape[1]))
    np.add.at(sums, row, arcs)
    one, c, s, cc, cs, ss, ccc, ccs, css, sss = sums.T
    r2, r3 = ring * ring, ring**3
    x, y, xx, xy, yy = ring * c, ring * s, r2 * cc, r2 * cs, r2 * ss
    third = (r3 * ccc, r3 * ccs, r3 * css, r3 * sss, xx * z, xy * z, yy * z, x * z * z, y * z * z, one * z**3)
    return np.stack([one, x, y, one * z, xx, xy, yy, x * z, y * z, one * z * z, *third], axis=1)


def _arcs(start: F64, stop: F64) -> F64:
    """Integrals of 1, c, s, c^2, c s, s^2, c^3, c^2 s, c s^2, s^3 over arcs, c = cos(phi) and s = sin(phi), (A, 10).

    Written with the half-length and the middle of an arc, so that short ones lose no digits.
    """
    half, middle = 0.5 * (stop - start), 0.5 * (stop + start)
    s1, s2, s3 = np.sin(half), np.sin(2.0 * half), np.sin(3.0 * half)
    one = 2.0 * half
    c, s = 2.0 * s1 * np.cos(middle), 2.0 * s1 * np.sin(middle)
    c2, sin2 = s2 * np.cos(2.0 * middle), s2 * np.sin(2.0 * middle)  # of cos(2 phi), sin(2 phi)
    c3, sin3 = 2.0 / 3.0 * s3 * np.cos(3.0 * middle), 2.0 / 3.0 * s3 * np.sin(3.0 * middle)
    squares = (0.5 * (one + c2), 0.5 * sin2, 0.5 * (one - c2))
    cubes = (0.25 * (3.0 * c + c3), 0.25 * (s + sin3), 0.25 * (c - c3), 0.25 * (3.0 * s - sin3))
    return np.stack([one, c, s, *squares, *cubes], axis=1)


def _tensors(total: F64) -> tuple[float, F64, F64, F64]:
    """The 20 integrals as a number, a vector and two symmetric tensors."""
    n2, n3 = np.empty((3, 3)), np.empty((3, 3, 3))
    pairs = {(0, 0): 4, (0, 1): 5, (1, 1): 6, (0, 2): 7, (1, 2): 8, (2, 2): 9}
    triples = {
        (0, 0, 0): 10,
        (0, 0, 1): 11,
        (0, 1, 1): 12,
        (1, 1, 1): 13,
        (0, 0, 2): 14,
        (0, 1, 2): 15,
        (1, 1, 2): 16,
        (0, 2, 2): 17,
        (1, 2, 2): 18,
        (2, 2, 2): 19,
    }
    for i, j in np.ndindex(3, 3):
        n2[i, j] = total[pairs[tuple(sorted((i, j)))]]
    for i, j, k in np.ndindex(3, 3, 3):
        n3[i, j, k] = total[triples[tuple(sorted((i, j, k)))]]
    return float(total[0]), total[1:4], n2, n3
