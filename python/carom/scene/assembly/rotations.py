"""Rotation of vectors by unit quaternions `(w, x, y, z)` (section 1 of docs/theory/algorithm.md), and which way is up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64


def rotated(orientation: F64, vector: F64) -> F64:
    """`R v` of quaternions (..., 4) and vectors (..., 3), which are broadcast: from the body's axes to the fixed ones."""
    w, axis = orientation[..., :1], orientation[..., 1:]
    twice = 2.0 * np.cross(axis, vector)
    found: F64 = vector + w * twice + np.cross(axis, twice)
    return found


def rotated_back(orientation: F64, vector: F64) -> F64:
    """`R^T v`: from the fixed axes to the body's."""
    return rotated(inverse(orientation), vector)


def upward(gravity: ArrayLike) -> F64:
    """Unit vector against gravity (3,), m/s^2; along z where there is none."""
    down = np.asarray(gravity, dtype=np.float64)
    size = float(np.linalg.norm(down))
    return np.asarray(-down / size) if size > 0 else np.array([0.0, 0.0, 1.0])


def product(first: ArrayLike, second: ArrayLike) -> F64:
    """`q p` of quaternions (..., 4): the rotation `p`, then `q`, both about fixed axes."""
    q, p = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    a, u, b, v = q[..., :1], q[..., 1:], p[..., :1], p[..., 1:]
    scalar = a * b - (u * v).sum(axis=-1, keepdims=True)
    return np.concatenate([scalar, a * v + b * u + np.cross(u, v)], axis=-1)


def inverse(orientation: F64) -> F64:
    """The opposite rotation of unit quaternions (..., 4)."""
    return np.asarray(orientation * np.array([1.0, -1.0, -1.0, -1.0]))
