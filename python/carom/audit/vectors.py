"""A little algebra of rows of vectors (K, 3) and of unit quaternions (K, 4), scalar part first.

Components are written out: an audit does little else, and NumPy's `cross`, sums over a short axis, and `ufunc.at` with
several indices take 3 to 6 times as long.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64

EPS = float(np.finfo(np.float64).eps)
UP = np.array([0.0, 0.0, 1.0])


def dot(a: F64, b: F64) -> F64:
    """Scalar products along the last axis, of length 3."""
    found: F64 = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return found


def norm(a: F64) -> F64:
    """Lengths along the last axis, of any length."""
    return np.asarray(np.sqrt(dot(a, a) if a.shape[-1] == 3 else np.einsum("...i,...i->...", a, a)))


def cross(a: F64, b: F64) -> F64:
    """Vector products along the last axis, of length 3."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k, i, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return found


def add_at(total: F64, index: tuple[I64, ...], values: F64) -> None:
    """`np.add.at(total, index, values)`: adds rows of `values` (K, ...) at places that may repeat."""
    row = np.ravel_multi_index(index, total.shape[: len(index)])
    width = int(np.prod(total.shape[len(index) :], dtype=np.int64))
    place = (row[:, None] * width + np.arange(width)).ravel()
    np.add.at(total.reshape(-1, copy=False), place, np.ascontiguousarray(values, dtype=np.float64).ravel())


def unit(a: F64) -> F64:
    """Directions; of a null vector a null vector."""
    length = norm(a)[..., None]
    return np.divide(a, length, out=np.zeros_like(a), where=length > 0.0)


def direction(a: F64, otherwise: F64) -> F64:
    """Directions; of null vectors another one, as the core has one of bodies with the same centre."""
    length = norm(a)[..., None]
    return np.divide(a, length, out=np.array(np.broadcast_to(otherwise, a.shape)), where=length > 0.0)


def across(a: F64, normal: F64) -> F64:
    """The part of each vector across a unit normal."""
    return np.asarray(a - dot(a, normal)[..., None] * normal)


def rotated(q: F64, a: F64) -> F64:
    """Vectors turned by unit quaternions."""
    twice = 2.0 * cross(q[..., 1:], a)
    turned: F64 = a + q[..., :1] * twice + cross(q[..., 1:], twice)
    return turned


def product(p: F64, q: F64) -> F64:
    """Products of quaternions."""
    scalar = p[..., 0] * q[..., 0] - dot(p[..., 1:], q[..., 1:])
    vector = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + cross(p[..., 1:], q[..., 1:])
    return np.concatenate([scalar[..., None], vector], axis=-1)


def conjugate(q: F64) -> F64:
    """Inverse rotations."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def exponential(psi: F64) -> F64:
    """Unit quaternions of rotation vectors, rad."""
    half = 0.5 * psi
    angle = norm(half)[..., None]
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=-1)


def rotation_vector(q: F64) -> F64:
    """Rotation vectors of unit quaternions, rad, of length pi at most."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = norm(q[..., 1:])[..., None]
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    found: F64 = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0) * q[..., 1:]
    return found
