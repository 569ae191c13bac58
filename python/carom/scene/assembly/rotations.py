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
    return rotated(orientation * np.array([1.0, -1.0, -1.0, -1.0]), vector)


def upward(gravity: ArrayLike) -> F64:
    """Unit vector against gravity (3,), m/s^2; along z where there is none."""
    down = np.asarray(gravity, dtype=np.float64)
    size = float(np.linalg.norm(down))
    return np.asarray(-down / size) if size > 0 else np.array([0.0, 0.0, 1.0])
