"""How deep the grains of a box lie in each other: one judge for all programs.

NumPy alone, so that the interpreter of each of them can call it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Depth:
    """Overlaps over the radius: the deepest, and the mean over the `contacts` that overlap at all."""

    deepest: float
    mean: float
    contacts: int


def near_pairs(position: F64, reach: float) -> tuple[I64, I64]:
    """All pairs of points (N, 3) closer than `reach`, each once, by cells of that size."""
    corner = position.min(axis=0)
    cells = np.floor((position - corner) / reach).astype(np.int64)
    shape = cells.max(axis=0) + 3  # an empty layer around, so that neighbours need no test
    key = ((cells[:, 2] + 1) * shape[1] + cells[:, 1] + 1) * shape[0] + cells[:, 0] + 1
    order = np.argsort(key, kind="stable").astype(np.int64)
    ordered = key[order]
    first, second = [], []
    for dz, dy, dx in product((-1, 0, 1), repeat=3):
        offset = (dz * shape[1] + dy) * shape[0] + dx
        if offset < 0:
            continue
        low = np.searchsorted(ordered, ordered + offset, side="left")
        high = np.searchsorted(ordered, ordered + offset, side="right")
        if offset == 0:
            low = np.arange(1, len(ordered) + 1)  # those behind it in its own cell
        count = np.maximum(high - low, 0)
        a = np.repeat(np.arange(len(ordered)), count)
        b = np.arange(len(a)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(low, count)
        a, b = order[a], order[b]
        close = np.sum((position[a] - position[b]) ** 2, axis=1) < reach * reach
        first.append(a[close])
        second.append(b[close])
    return np.concatenate(first), np.concatenate(second)


def depth(position: F64, radius: float, side: float) -> Depth:
    """Overlaps of equal spheres, centres `position` (N, 3) in m, with each other and with floor and walls of the box
    (0, side)^2, m.
    """
    a, b = near_pairs(position, 2.0 * radius)
    between = 2.0 * radius - np.linalg.norm(position[a] - position[b], axis=1)
    sides = position[:, :2]
    walls = radius - np.concatenate([position[:, 2], sides.ravel(), (side - sides).ravel()])
    found = np.concatenate([between, walls])
    found = found[found > 0.0] / radius
    if found.size == 0:
        return Depth(0.0, 0.0, 0)
    return Depth(float(found.max()), float(found.mean()), int(found.size))


def kinetic(mass: float, radius: float, velocity: F64, spin: F64) -> float:
    """Kinetic energy of homogeneous spheres over N m g r: 1 would lift each of them by a radius."""
    energy = 0.5 * mass * (np.sum(velocity**2) + 0.4 * radius**2 * np.sum(spin**2))
    return float(energy / (len(velocity) * mass * 9.8 * radius))
