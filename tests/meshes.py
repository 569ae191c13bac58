"""Surfaces of triangles for tests: points (V, 3) and triangles (T, 3), counterclockwise seen from the front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Mesh = tuple[F64, I64]


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """The twelve triangles of a box, its front outside."""
    points = np.array(
        [[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], dtype=float
    )
    sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return points, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])


def floor(n: int, *, seed: int) -> Mesh:
    """The unit square in the plane z = 0 of `2 n^2` triangles: a grid with points moved at random, cut at random."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"), axis=-1)
    grid[1:-1, 1:-1] += rng.uniform(-0.3, 0.3, (max(n - 1, 0), max(n - 1, 0), 2))
    points = np.concatenate([grid.reshape(-1, 2) / n, np.zeros(((n + 1) ** 2, 1))], axis=1)
    triangles = []
    for i in range(n):
        for j in range(n):
            a, b, c, d = (x * (n + 1) + y for x, y in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
            triangles += [(a, b, c), (a, c, d)] if rng.random() < 0.5 else [(a, b, d), (b, c, d)]
    return points, np.array(triangles)


def revolved(profile: Sequence[tuple[float, float]], sides: int) -> Mesh:
    """What a line of points (radius, height) sweeps about z, open at its ends; its front outside where the height grows."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([np.c_[r * ring, np.full(sides, z)] for r, z in profile])
    triangles = []
    for k in range(len(profile) - 1):
        for i in range(sides):
            a, b = k * sides + i, k * sides + (i + 1) % sides
            triangles += [(a, b, b + sides), (a, b + sides, a + sides)]
    return points, np.array(triangles)


def globe(rings: int, around: int, rough: float, seed: int) -> Mesh:
    """A closed lump of radius 1, rough at random."""
    rng = np.random.default_rng(seed)
    points = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    for i in range(1, rings + 1):
        for j in range(around):
            polar, turn = np.pi * i / (rings + 1), 2 * np.pi * j / around
            r = 1 + rough * (rng.random() - 0.5)
            points.append(
                (r * np.sin(polar) * np.cos(turn), r * np.sin(polar) * np.sin(turn), r * np.cos(polar))
            )
    at = lambda i, j: 2 + (i - 1) * around + j % around  # noqa: E731
    triangles = []
    for j in range(around):
        triangles += [(0, at(1, j), at(1, j + 1)), (1, at(rings, j + 1), at(rings, j))]
        for i in range(1, rings):
            a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
            triangles += [(a, b, c), (a, c, d)]
    return np.array(points), np.array(triangles)
