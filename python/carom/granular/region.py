"""Where something is measured: boxes, cylinders and spheres, and what they hold of balls and of lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carom.errors import CaromError
from carom.granular.cut import ball_in_ball, ball_in_box, ball_in_cylinder
from carom.packing.region import Ball, Box, Cylinder
from carom.scenario.vectors import scaled

F64 = NDArray[np.float64]
Region = Box | Cylinder | Ball


def ball_volume(region: Region, position: F64, radius: F64) -> F64:
    """Volume of each ball that lies in the region, (N,) m^3, exact where planes or a sphere cut it."""
    if isinstance(region, Box):
        return ball_in_box(position, radius, np.array(region.low), np.array(region.high))
    away = position - np.array(region.point)
    if isinstance(region, Ball):
        return ball_in_ball(np.linalg.norm(away, axis=1), radius, region.radius)
    along = away @ np.array(scaled(region.axis))
    off = np.linalg.norm(away - np.outer(along, scaled(region.axis)), axis=1)
    return ball_in_cylinder(off, along, radius, region.radius, 0.5 * region.length)


def holds(region: Region, points: F64) -> NDArray[np.bool_]:
    """Which of the points (M, 3) lie in the region; of two boxes that share a face only one has a point of it."""
    if isinstance(region, Box):
        inside = (points >= np.array(region.low)) & (points < np.array(region.high))
        return np.asarray(inside.all(axis=1))
    return line_share(region, points, points) > 0


def line_share(region: Region, start: F64, end: F64) -> F64:
    """Part of each straight line from `start` to `end`, (M, 3) m, that lies in the region, (M,) from 0 to 1."""
    first, last = np.zeros(len(start)), np.ones(len(start))
    along = end - start
    if isinstance(region, Box):
        for k in range(3):
            first, last = _slab(start[:, k], along[:, k], region.low[k], region.high[k], first, last)
        return np.asarray(np.maximum(last - first, 0.0))
    away = start - np.array(region.point)
    if isinstance(region, Cylinder):
        axis = np.array(scaled(region.axis))
        high = 0.5 * region.length
        first, last = _slab(away @ axis, along @ axis, -high, high, first, last)
        away = away - np.outer(away @ axis, axis)
        along = along - np.outer(along @ axis, axis)
    # |away + t along|^2 = radius^2
    square = (along * along).sum(axis=1)
    middle = (away * along).sum(axis=1)
    free = (away * away).sum(axis=1) - region.radius**2
    root = np.sqrt(np.maximum(middle**2 - square * free, 0.0))
    moving = square > 0
    safe = np.where(moving, square, 1.0)
    missed = np.where(moving, middle**2 <= square * free, free > 0)
    first = np.where(moving, np.maximum(first, (-middle - root) / safe), first)
    last = np.where(moving, np.minimum(last, (-middle + root) / safe), last)
    return np.where(missed, 0.0, np.maximum(last - first, 0.0))


def _slab(x: F64, along: F64, low: float, high: float, first: F64, last: F64) -> tuple[F64, F64]:
    """The part of each line between two planes, within the part from `first` to `last`."""
    still = along == 0
    step = np.where(still, 1.0, along)
    to_low, to_high = (low - x) / step, (high - x) / step
    outside = still & ((x < low) | (x >= high))
    entry = np.where(still, np.where(outside, np.inf, -np.inf), np.minimum(to_low, to_high))
    leave = np.where(still, np.inf, np.maximum(to_low, to_high))
    return np.maximum(first, entry), np.minimum(last, leave)


def layers(region: Box | Cylinder, axis: str, count: int) -> list[Box] | list[Cylinder]:
    """`count` equal slices of a box, or of a cylinder along this axis, across "x", "y" or "z", lowest first."""
    if axis not in ("x", "y", "z") or count < 1:
        raise CaromError(
            f"cannot cut {count} layers across {axis!r}; give an axis x, y or z and at least one layer"
        )
    k = "xyz".index(axis)
    if isinstance(region, Cylinder):
        return _discs(region, k, count)
    if not isinstance(region, Box):
        raise CaromError("only a Box or a Cylinder can be cut in layers; give one of these")
    counts = [1, 1, 1]
    counts[k] = count
    return cells(region, (counts[0], counts[1], counts[2]))


def _discs(region: Cylinder, k: int, count: int) -> list[Cylinder]:
    along = scaled(region.axis)
    if abs(along[k]) < 1.0 - 1e-12:
        cure = "give the axis that it lies along, or make the slices yourself: each is a Cylinder"
        raise CaromError(f"a cylinder along {region.axis} cannot be cut in layers across {'xyz'[k]}; {cure}")
    edges = np.linspace(-0.5, 0.5, count + 1) * region.length
    middle = np.tile(np.array(region.point, dtype=np.float64), (count, 1))
    middle[:, k] += 0.5 * (edges[1:] + edges[:-1])
    return [
        Cylinder((x, y, z), region.axis, region.radius, region.length / count) for x, y, z in middle.tolist()
    ]


def cells(box: Box, counts: tuple[int, int, int]) -> list[Box]:
    """A box in equal parts: `counts` along x, y and z, x fastest."""
    edges = [np.linspace(box.low[k], box.high[k], counts[k] + 1).tolist() for k in range(3)]
    x, y, z = edges
    return [
        Box((x[i], y[j], z[k]), (x[i + 1], y[j + 1], z[k + 1]))
        for k in range(counts[2])
        for j in range(counts[1])
        for i in range(counts[0])
    ]
