"""Motion as small integers: what the page embeds, and how to read it back.

A smooth trajectory is nearly a straight line from frame to frame, so what is stored is the error of a
prediction (same as before, or same change as before), folded to an unsigned integer and cut into byte
planes. The high planes are then almost all zero and gzip makes nothing of them: thirty-two bits cost
about what sixteen would, and no scene is so large that its balls begin to tremble.

`viewer/src/codec.ts` reads this. Arithmetic is modulo 2^32 on both sides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from carom.arrays import F64

Integers = npt.NDArray[np.int32]

INT32 = 2**31 - 1


def quantise(values: F64, step: float, origin: F64) -> Integers:
    """The nearest multiples of `step` from `origin`; the caller has seen to it that they fit."""
    integers: Integers = np.rint((values - origin) / step).astype(np.int32)
    return integers


def position_grid(position: F64, radius: F64) -> tuple[F64, float]:
    """Origin and step of the grid positions are rounded to: 1e-5 of the smallest radius at most off.

    Only a scene larger than some 40 000 radii gets a coarser grid, the finest that 32 bits give it.
    """
    low = position.min(axis=(0, 1))
    high = position.max(axis=(0, 1))
    extent = float((high - low).max())
    wanted = 2e-5 * float(radius.min())
    step = max(wanted, extent / (2.0 * (INT32 - 1)))
    return 0.5 * (low + high), step


def orientation_integers(orientation: F64) -> Integers:
    """Quaternions as 16-bit integers, in the page's order x, y, z, w.

    q and -q are the same attitude: the sign is chosen so that a turning ball never jumps, which would
    cost bytes and make the half-way attitude meaningless.
    """
    quaternion = orientation / np.linalg.norm(orientation, axis=-1, keepdims=True)
    flips = np.einsum("tnk,tnk->tn", quaternion[1:], quaternion[:-1]) < 0.0
    sign = np.ones(quaternion.shape[:2])
    sign[1:] = np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)
    turned = (quaternion * sign[..., None])[..., [1, 2, 3, 0]]
    integers: Integers = np.rint(turned * 32767.0).astype(np.int32)
    return integers


def _residual(values: Integers, order: int) -> Integers:
    for _ in range(order):
        values = np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))
    return values


def _best_order(values: Integers) -> int:
    """How far to predict (0 none, 1 rest, 2 uniform motion): the one with the fewest bits."""
    sample = values[:, :: max(1, values[0].size // 3000)]
    bits = [float(np.log2(1.0 + np.abs(_residual(sample, k).astype(np.float64))).sum()) for k in range(3)]
    return int(np.argmin(bits))


def encode(values: Integers) -> tuple[bytes, dict[str, Any]]:
    """Bytes of an integer array (frame, body, component), before gzip, and the entry that describes them."""
    order = _best_order(values)
    residual = _residual(values, order)
    folded = ((residual << 1) ^ (residual >> 31)).view(np.uint32)  # 0, -1, 1, -2, ... -> 0, 1, 2, 3, ...
    series = np.ascontiguousarray(folded.transpose(2, 1, 0))  # a body's component, all its frames in a row
    planes = max(1, (int(series.max()).bit_length() + 7) // 8)
    data = b"".join(((series >> (8 * k)) & 0xFF).astype(np.uint8).tobytes() for k in range(planes))
    return data, {"shape": list(values.shape), "order": order, "planes": planes}


def decode(data: bytes, entry: dict[str, Any]) -> Integers:
    """The inverse of `encode`; the page does the same in the browser."""
    frames, bodies, components = entry["shape"]
    planes = np.frombuffer(data, np.uint8).reshape(entry["planes"], components, bodies, frames)
    folded = np.zeros(planes.shape[1:], np.uint32)
    for k, plane in enumerate(planes):
        folded |= plane.astype(np.uint32) << np.uint32(8 * k)
    values = ((folded >> np.uint32(1)) ^ (~(folded & np.uint32(1)) + np.uint32(1))).view(np.int32)
    values = values.transpose(2, 1, 0)
    for _ in range(entry["order"]):
        values = np.cumsum(values, axis=0, dtype=np.int32)
    return np.ascontiguousarray(values)
