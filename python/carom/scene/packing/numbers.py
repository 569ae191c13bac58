"""Random numbers and elementary functions that are the same to the last bit on every machine.

The raw 64-bit output of PCG64 is a stream that NumPy promises to keep. Logarithms and exponentials of the C library, and
NumPy's own for vector units, differ in the last bit from machine to machine, and a packing would then differ as a whole:
here they are made of additions, multiplications, divisions and square roots, whose result IEEE 754 fixes.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.numeric import is_whole

_LN2_HIGH, _LN2_LOW = (
    6.93147180369123816490e-01,
    1.90821492927058770002e-10,
)  # the sum is ln 2; the first has few digits


class Stream:
    """Random numbers of one seed, one after the other."""

    def __init__(self, seed: int) -> None:
        if not is_whole(seed) or seed < 0:
            raise CaromError(f"seed = {seed!r}; give a whole number from 0")
        self._bits = np.random.PCG64(seed)

    def uniform(self, *shape: int) -> F64:
        """In [0, 1), multiples of 2^-53."""
        raw = self._bits.random_raw(int(np.prod(shape))) >> np.uint64(11)
        return (raw.astype(np.float64) * 2.0**-53).reshape(shape)

    def normal(self, count: int) -> F64:
        """Standard normal deviates, (count,), by inversion."""
        return normal_quantile(self.uniform(count) + 2.0**-54)  # never 0


def total(values: F64) -> float:
    """The sum from first to last, in this order on every machine."""
    return float(np.cumsum(values)[-1]) if len(values) else 0.0


def log(x: F64) -> F64:
    """Natural logarithm of positive numbers, to about 2 units of the last place."""
    mantissa, exponent = np.frexp(x)
    low = mantissa < np.sqrt(0.5)
    mantissa = np.where(low, 2.0 * mantissa, mantissa)
    power = (exponent - low).astype(np.float64)
    s = (mantissa - 1.0) / (mantissa + 1.0)  # ln m = 2 artanh s, |s| < 0.172
    square = s * s
    series = np.zeros_like(s)
    for k in range(23, 1, -2):
        series = (series + 1.0 / k) * square
    found: F64 = power * _LN2_HIGH + (power * _LN2_LOW + 2.0 * s * (1.0 + series))
    return found


def exp(x: F64) -> F64:
    """Exponential of numbers of moderate size, to about 2 units of the last place."""
    power = np.rint(x / (_LN2_HIGH + _LN2_LOW))
    rest = (x - power * _LN2_HIGH) - power * _LN2_LOW
    series = np.ones_like(rest)
    for k in range(16, 0, -1):
        series = 1.0 + rest * series / k
    found: F64 = np.ldexp(series, power.astype(np.int64))
    return found


def cbrt(x: float) -> float:
    """Cube root of a positive number."""
    return float(exp(log(np.array([x])) / 3.0)[0])


def _ratio(r: F64, above: tuple[float, ...], below: tuple[float, ...]) -> F64:
    """Two polynomials, highest power first."""
    num, den = np.full_like(r, above[0]), np.full_like(r, below[0])
    for a in above[1:]:
        num = num * r + a
    for b in below[1:]:
        den = den * r + b
    return num / den


# Wichura, The percentage points of the normal distribution, Applied Statistics 37 (1988), algorithm AS 241, to 1e-16
_MIDDLE = (
    (2.50908_09287_30122_6727e3, 3.34305_75583_58812_8105e4, 6.72657_70927_00870_0853e4, 4.59219_53931_54987_1457e4,
     1.37316_93765_50946_1125e4, 1.97159_09503_06551_4427e3, 1.33141_66789_17843_7745e2, 3.38713_28727_96366_6080e0),
    (5.22649_52788_52854_5610e3, 2.87290_85735_72194_2674e4, 3.93078_95800_09271_0610e4, 2.12137_94301_58659_5867e4,
     5.39419_60214_24751_1077e3, 6.87187_00749_20579_0830e2, 4.23133_30701_60091_1252e1, 1.0),
)  # fmt: skip
_TAIL = (
    (7.74545_01427_83414_07640e-4, 2.27238_44989_26918_45833e-2, 2.41780_72517_74506_11770e-1,
     1.27045_82524_52368_38258e0, 3.64784_83247_63204_60504e0, 5.76949_72214_60691_40550e0,
     4.63033_78461_56545_29590e0, 1.42343_71107_49683_57734e0),
    (1.05075_00716_44416_84324e-9, 5.47593_80849_95344_94600e-4, 1.51986_66563_61645_71966e-2,
     1.48103_97642_74800_74590e-1, 6.89767_33498_51000_04550e-1, 1.67638_48301_83803_84940e0,
     2.05319_16266_37758_82187e0, 1.0),
)  # fmt: skip
_FAR_TAIL = (
    (2.01033_43992_92288_13265e-7, 2.71155_55687_43487_57815e-5, 1.24266_09473_88078_43860e-3,
     2.65321_89526_57612_30930e-2, 2.96560_57182_85048_91230e-1, 1.78482_65399_17291_33580e0,
     5.46378_49111_64114_36990e0, 6.65790_46435_01103_77720e0),
    (2.04426_31033_89939_78564e-15, 1.42151_17583_16445_88870e-7, 1.84631_83175_10054_68180e-5,
     7.86869_13114_56132_59100e-4, 1.48753_61290_85061_48525e-2, 1.36929_88092_27358_05310e-1,
     5.99832_20655_58879_37690e-1, 1.0),
)  # fmt: skip


def normal_quantile(p: F64) -> F64:
    """The x below which a standard normal deviate lies with probability p, 0 < p < 1."""
    q = p - 0.5
    middle = q * _ratio(0.180625 - q * q, *_MIDDLE)
    r = np.sqrt(-log(np.minimum(p, 1.0 - p)))
    tail = np.where(r <= 5.0, _ratio(r - 1.6, *_TAIL), _ratio(r - 5.0, *_FAR_TAIL))
    found: F64 = np.where(np.abs(q) <= 0.425, middle, np.where(q < 0, -tail, tail))
    return found
