"""Where something is measured: boxes, cylinders and spheres, and what they hold of balls and of lines.

A world that repeats itself (a `PeriodicBox`) has every ball in every period: of each the images that
reach the region count. Along the axes in which a `Box` is `periodic` it has no faces: all balls count once, wherever they
are.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.errors import CaromError
from carom.measure.granular.cut import ball_in_ball, ball_in_box, ball_in_cylinder
from carom.numeric import is_number, is_whole
from carom.scene.assembly.vectors import scaled
from carom.scene.packing.periodic import PeriodicBox
from carom.scene.packing.region import Ball, Box, Cylinder

Region = Box | Cylinder | Ball

MOST_IMAGES = 1000
"""Images of one ball in a region at most: a region of so many periods was not meant."""


def ball_volume(region: Region, position: F64, radius: F64) -> F64:
    """Volume of each ball that lies in the region, (N,) m^3, exact where planes or a sphere cut it."""
    if isinstance(region, Box):
        return ball_in_box(position, radius, *_faces(region))
    away = position - np.array(region.point)
    if isinstance(region, Ball):
        return ball_in_ball(np.linalg.norm(away, axis=1), radius, region.radius)
    along = away @ np.array(scaled(region.axis))
    off = np.linalg.norm(away - np.outer(along, scaled(region.axis)), axis=1)
    return ball_in_cylinder(off, along, radius, region.radius, 0.5 * region.length)


def holds(region: Region, points: F64) -> Bool:
    """Which of the points (M, 3) lie in the region; of two boxes that share a face only one has a point of it."""
    if isinstance(region, Box):
        low, high = _faces(region)
        return np.asarray(((points >= low) & (points < high)).all(axis=1))
    return line_share(region, points, points) > 0


def line_share(region: Region, start: F64, end: F64) -> F64:
    """Part of each straight line from `start` to `end`, (M, 3) m, that lies in the region, (M,) from 0 to 1."""
    first, last = np.zeros(len(start)), np.ones(len(start))
    along = end - start
    if isinstance(region, Box):
        low, high = _faces(region)
        for k in range(3):
            first, last = _slab(start[:, k], along[:, k], float(low[k]), float(high[k]), first, last)
        return np.asarray(np.maximum(last - first, 0.0))
    away = start - np.array(region.point)
    if isinstance(region, Cylinder):
        axis = np.array(scaled(region.axis))
        half = 0.5 * region.length
        first, last = _slab(away @ axis, along @ axis, -half, half, first, last)
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


def images(region: Region, points: F64, reach: F64, world: PeriodicBox | None) -> tuple[I64, F64]:
    """Numbers (M,) of the points (N, 3), m, that have an image within `reach` (N,), m, of the box around the region, and the
    places (M, 3) of these images. In a `world` that does not repeat the points themselves, all of them.
    """
    if not isinstance(region, Region):
        raise CaromError(f"a region is a Box, a Cylinder or a Ball, found {type(region).__name__}")
    rows, moved = np.arange(len(points)), points
    if world is None:
        return rows, moved
    low, high = _around(region)
    open_ = np.array(region.periodic) if isinstance(region, Box) else np.zeros(3, dtype=bool)
    _fits(world, open_, high - low)
    vectors = world.vectors
    for axis in world.order:  # that of the gradient first: its images are displaced along the flow
        if open_[axis]:
            continue
        length = float(world.lengths[axis])
        slack = reach[rows] + 1e-9 * length  # `holds` decides of points at a face
        first = np.ceil((low[axis] - slack - moved[:, axis]) / length)
        last = np.floor((high[axis] + slack - moved[:, axis]) / length)
        counts = np.maximum(last - first + 1.0, 0.0)
        if len(rows) and np.bincount(rows, counts).max() > MOST_IMAGES:
            k = int(
                np.argmax(
                    np.where(
                        world.lengths > 0, (high - low) / np.where(world.lengths > 0, world.lengths, 1.0), 0
                    )
                )
            )
            raise CaromError(
                f"the region is {(high - low)[k] / world.lengths[k]:.0f} periods long along {'xyz'[k]};"
                " one of the world says the same"
            )
        many = counts.astype(np.int64)
        source = np.repeat(np.arange(len(rows)), many)
        number = first[source] + np.arange(len(source)) - np.repeat(np.cumsum(many) - many, many)
        rows, moved = rows[source], moved[source] + number[:, None] * vectors[axis]
    return rows, moved


def _fits(world: PeriodicBox, open_: Bool, size: F64) -> None:
    """Refuses a box without faces across an axis over which the world does not repeat in the same way."""
    off = (world.lengths > 0) & open_ & ~np.isclose(size, world.lengths, rtol=1e-9, atol=0.0)
    if off.any():
        k = int(np.flatnonzero(off)[0])
        raise CaromError(
            f"the box is periodic along {'xyz'[k]} over {size[k]:.6g} m, the world over {world.lengths[k]:.6g} m;"
            " give it the length of the world, or faces"
        )
    if world.sheared and open_[world.gradient] and not open_[world.flow]:
        across, along = "xyz"[world.gradient], "xyz"[world.flow]
        raise CaromError(
            f"the box is periodic along {across} and not along {along}, along which images across {across} are displaced;"
            f" make it periodic along {along} too, or give it faces across {across}"
        )


def inside(region: Region, points: F64, world: PeriodicBox | None) -> tuple[I64, F64]:
    """Numbers (M,) of the points (N, 3), m, that lie in the region, themselves or an image, and where, (M, 3), m."""
    rows, moved = images(region, points, np.zeros(len(points)), world)
    here = holds(region, moved)
    rows, first = np.unique(rows[here], return_index=True)
    return rows, moved[here][first]


def _faces(box: Box) -> tuple[F64, F64]:
    """Lowest and highest corner, (3,) m; endless where the box is periodic."""
    open_ = np.array(box.periodic)
    return np.where(open_, -np.inf, box.low), np.where(open_, np.inf, box.high)


def _around(region: Region) -> tuple[F64, F64]:
    """Corners of the box around a region, (3,) m."""
    if isinstance(region, Box):
        return np.array(region.low, dtype=np.float64), np.array(region.high, dtype=np.float64)
    half = np.full(3, region.radius)
    if isinstance(region, Cylinder):
        axis = np.array(scaled(region.axis))
        half = 0.5 * region.length * np.abs(axis) + region.radius * np.sqrt(
            np.maximum(1.0 - axis * axis, 0.0)
        )
    point = np.array(region.point, dtype=np.float64)
    return point - half, point + half


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
    if axis not in ("x", "y", "z") or not is_number(count) or count < 1:
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
    """A box in equal parts: `counts` along x, y and z, x fastest. Axes that are not cut stay periodic."""
    given: Any = counts
    if np.ndim(given) != 1 or len(given) != 3 or not all(is_whole(count) and count >= 1 for count in given):
        raise CaromError(f"cannot cut a box in {counts} cells; give three whole numbers from 1")
    edges = [np.linspace(box.low[k], box.high[k], counts[k] + 1).tolist() for k in range(3)]
    x, y, z = edges
    uncut = [open_ and count == 1 for open_, count in zip(box.periodic, counts, strict=True)]
    return [
        Box((x[i], y[j], z[k]), (x[i + 1], y[j + 1], z[k + 1]), (uncut[0], uncut[1], uncut[2]))
        for k in range(counts[2])
        for j in range(counts[1])
        for i in range(counts[0])
    ]
