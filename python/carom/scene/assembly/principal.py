"""Principal moments and axes of a tensor of inertia, by Jacobi's rotations.

Additions, multiplications, divisions and square roots alone, on numbers one by one: the axes are the same bits on every
machine, as a run that is resumed elsewhere needs. Each rotation turns by at most an eighth, so that the principal axes keep
the order of the axes given, and are these where the tensor is diagonal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from carom.arrays import F64
from carom.scene.assembly.rotations import product

SMALL = 1e-16
"""Products of inertia below this, over the sum of the moments, are rounding."""
SWEEPS = 50
"""Sweeps at most: each squares what is left, so that five are usual."""
FLAT = 1e-9
"""By so much of itself a moment may be more than the sum of the other two: rounding of a flat body."""

Vec3 = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
"""Jxx, Jyy, Jzz, Jxy, Jxz, Jyz: the entries of the tensor, kg m^2 (`Jxy` is minus the integral of x y)."""


def six(tensor: F64) -> Six:
    """The entries of a symmetric tensor (3, 3)."""
    return tuple(float(tensor[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))  # type: ignore[return-value]


def principal(tensor: Sequence[float]) -> tuple[Vec3, tuple[float, float, float, float]]:
    """Moments, kg m^2, and the unit quaternion, w first, of their axes in those of the tensor `(Jxx, Jyy, Jzz, Jxy, Jxz,
    Jyz)`; right-handed.
    """
    xx, yy, zz, xy, xz, yz = tensor
    a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    small = SMALL * (abs(xx) + abs(yy) + abs(zz))
    turn: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    for _ in range(SWEEPS):
        still = True
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):  # k: the axis of the rotation
            if not abs(a[i][j]) > small:
                continue
            still = False
            ratio = (a[i][i] - a[j][j]) / (2.0 * a[i][j])
            t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
            a[i][i], a[j][j] = a[i][i] + t * a[i][j], a[j][j] - t * a[i][j]
            c = 1.0 / math.sqrt(1.0 + t * t)
            s = t * c
            a[i][k], a[j][k] = c * a[i][k] + s * a[j][k], c * a[j][k] - s * a[i][k]
            a[k][i], a[k][j] = a[i][k], a[j][k]
            a[i][j] = a[j][i] = 0.0
            half = [math.sqrt(0.5 * (1.0 + c)), 0.0, 0.0, 0.0]
            half[1 + k] = 0.5 * s / half[0]
            turn = product(turn, half).tolist()
        if still:
            break
    length = math.sqrt(sum(x * x for x in turn))
    w, x, y, z = (value / length for value in turn)
    return (a[0][0], a[1][1], a[2][2]), (w, x, y, z)


def fault(moments: Vec3) -> str:
    """Why no body has these principal moments; nothing if one may."""
    least, middle, most = sorted(moments)
    if not least > 0.0:
        return f"the principal moment {least:.4g} kg m^2 is not positive"
    if most > (least + middle) * (1.0 + FLAT):
        excess = most - (least + middle)
        return f"the principal moment {most:.4g} kg m^2 is more than the sum of the other two, by {excess:.2g} kg m^2"
    return ""
