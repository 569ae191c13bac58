"""Volumes of balls cut by planes, exactly.

A ball cut by planes at right angles is bounded by pieces of its sphere and of the planes. By the divergence theorem its
volume is a third of the sum of their areas times their distances from the centre; the area on the sphere follows from the
arcs around it and the angles between them (Gauss and Bonnet).
"""

from __future__ import annotations

from itertools import combinations, pairwise, product

import numpy as np

from carom.arrays import F64

WHOLE = 4.0 / 3.0 * np.pi
"""Volume of the unit ball."""


def cap(a: F64) -> F64:
    """Volume of the unit ball beyond one plane, x > a >= 0."""
    height = np.maximum(1.0 - a, 0.0)
    volume: F64 = np.pi / 3.0 * height * height * (3.0 - height)
    return volume


def edge(a: F64, b: F64) -> F64:
    """Volume of the unit ball beyond two planes at right angles, x > a >= 0 and y > b >= 0."""
    cut = a * a + b * b < 1.0
    a, b = np.where(cut, a, 0.0), np.where(cut, b, 0.0)
    rest = _rest(
        a, b
    )  # half the line in which the planes meet; all angles by it, so that its rounding cancels
    arc_a, arc_b = np.arctan2(rest, b), np.arctan2(rest, a)  # half the arcs on the circles x = a and y = b
    sphere = 2.0 * np.pi - 2.0 * a * arc_a - 2.0 * b * arc_b - 2.0 * np.arctan2(rest, -a * b)
    flat = a * ((1.0 - a * a) * arc_a - b * rest) + b * ((1.0 - b * b) * arc_b - a * rest)
    return np.where(cut, np.maximum((sphere - flat) / 3.0, 0.0), 0.0)


def corner(a: F64, b: F64, c: F64) -> F64:
    """Volume of the unit ball beyond three planes at right angles, x > a, y > b and z > c, none of them negative."""
    cut = a * a + b * b + c * c < 1.0
    planes = [np.where(cut, x, 0.0) for x in (a, b, c)]
    sphere = np.full_like(planes[0], 2.0 * np.pi)
    flat = np.zeros_like(sphere)
    for k in range(3):
        x, y, z = (planes[(k + i) % 3] for i in range(3))
        to_y, to_z = _rest(x, y), _rest(x, z)  # where the circle in the plane x meets the planes y and z
        arc = np.arctan2(to_y, y) - np.arctan2(z, to_z)
        sphere -= x * arc + np.arctan2(to_y, -x * y)
        flat += x * 0.5 * ((1.0 - x * x) * arc - y * (to_y - z) - z * (to_z - y))
    return np.where(cut, np.maximum((sphere - flat) / 3.0, 0.0), 0.0)


def beyond(planes: F64) -> F64:
    """Volume of the unit ball where x > a, y > b and z > c, for (M, 3) values of any sign.

    Of a plane behind the centre, all but what lies on its other side: 1[x > a] = 1 - 1[-x > -a].
    """
    behind = planes < 0
    sign = np.where(behind, -1.0, 1.0)
    size = np.abs(planes)
    volume = np.where(behind.all(axis=1), WHOLE, 0.0)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        volume += np.where(behind[:, j] & behind[:, k], sign[:, i] * cap(size[:, i]), 0.0)
    for i, j in combinations(range(3), 2):
        k = 3 - i - j
        volume += np.where(behind[:, k], sign[:, i] * sign[:, j] * edge(size[:, i], size[:, j]), 0.0)
    volume += sign.prod(axis=1) * corner(size[:, 0], size[:, 1], size[:, 2])
    return volume


def ball_in_box(position: F64, radius: F64, low: F64, high: F64) -> F64:
    """Volume of each ball, (N,) m^3, within a box along the axes; `position` (N, 3) m, `radius` (N,) m."""
    lower, upper = (low - position) / radius[:, None], (high - position) / radius[:, None]
    volume = np.where(((lower <= -1.0) & (upper >= 1.0)).all(axis=1), WHOLE, 0.0)
    crossed = ((lower < 1.0) & (upper > -1.0)).all(axis=1) & (volume == 0.0)
    if crossed.any():
        bounds = np.clip(np.stack([lower[crossed], upper[crossed]]), -1.0, 1.0)
        part = np.zeros(int(crossed.sum()))
        for sides in product((0, 1), repeat=3):
            part += (-1.0) ** sum(sides) * beyond(
                np.stack([bounds[s, :, k] for k, s in enumerate(sides)], axis=1)
            )
        volume[crossed] = np.maximum(part, 0.0)
    whole: F64 = volume * radius**3
    return whole


def ball_in_ball(distance: F64, radius: F64, other: float) -> F64:
    """Volume that each ball, (N,) m^3, shares with one of radius `other` whose centre is `distance` (N,) m away."""
    smaller = np.minimum(radius, other)
    lens = (radius + other - distance) ** 2 * (
        distance**2 + 2.0 * distance * (radius + other) - 3.0 * (radius - other) ** 2
    )
    within = distance <= np.abs(radius - other)
    volume = np.pi * lens / (12.0 * np.where(within, 1.0, distance))
    return np.where(within, WHOLE * smaller**3, np.where(distance >= radius + other, 0.0, volume))


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)


def ball_in_cylinder(off: F64, along: F64, radius: F64, wide: float, half: float) -> F64:
    """Volume of each ball, (N,) m^3, within a cylinder of radius `wide` and length 2 `half`, m.

    Their centres are `off` (N,) m from its axis and `along` (N,) m from its middle. Exact where only the ends cut; where the
    curved wall cuts, the lenses across the axis are integrated along it, to about 1e-8 of the ball.
    """
    low = np.clip((-half - along) / radius, -1.0, 1.0)
    high = np.clip((half - along) / radius, -1.0, 1.0)
    volume = (high - low - (high**3 - low**3) / 3.0) * np.pi * radius**3
    volume = np.where(off >= wide + radius, 0.0, volume)
    cut = np.flatnonzero((off + radius > wide) & (volume > 0.0))
    if len(cut):
        off, radius, low, high = off[cut], radius[cut], low[cut], high[cut]
        # where a cross-section of the ball begins to stick out, or to cover the cylinder, the integrand has a kink
        ratio = np.minimum(np.abs(wide - off) / radius, 1.0)
        kink = np.sqrt(1.0 - ratio**2)
        ends = [low, np.clip(-kink, low, high), np.clip(kink, low, high), high]
        part = np.zeros(len(cut))
        for first, last in pairwise(ends):
            from_, to = np.arcsin(first), np.arcsin(last)
            angle = 0.5 * (from_ + to)[:, None] + 0.5 * (to - from_)[:, None] * _NODES
            disc = radius[:, None] * np.cos(angle)
            area = _lens(disc, wide, off[:, None])
            part += 0.5 * (to - from_) * (area * disc * _WEIGHTS).sum(axis=1)
        volume[cut] = part
    return volume


def _lens(a: F64, b: float, distance: F64) -> F64:
    """Area common to two discs of radii `a` and `b`."""
    within = distance <= np.abs(a - b)
    apart = distance >= a + b
    d, r = np.where(within | apart, b, distance), np.where(within | apart, b, a)
    first = _acos((d**2 + r**2 - b**2) / (2.0 * d * r))
    second = _acos((d**2 + b**2 - r**2) / (2.0 * d * b))
    kite = np.sqrt(np.maximum((-d + r + b) * (d + r - b) * (d - r + b) * (d + r + b), 0.0))
    area = r**2 * first + b**2 * second - 0.5 * kite
    return np.where(within, np.pi * np.minimum(a, b) ** 2, np.where(apart, 0.0, area))


def _rest(a: F64, b: F64) -> F64:
    """Half the length that the unit ball cuts out of the line x = a, y = b."""
    return np.asarray(np.sqrt(np.maximum(1.0 - a * a - b * b, 0.0)))


def _acos(x: F64) -> F64:
    return np.asarray(np.arccos(np.clip(x, -1.0, 1.0)))
