"""Random packings of balls: `[[packing]]` of a scenario, also without one.

    from carom.packing import Box, Lognormal, pack

    packed = pack(Box((0, 0, 0), (0.1, 0.1, 0.1)), Lognormal(0.005, 0.001, 0.003, 0.008), fraction=0.58, seed=1)
    packed.position, packed.radius, packed.fraction, packed.least_gap

Lengths are numbers in m or texts with a unit, `"5 mm"`. The same arguments give the same bits on every machine and for any
number of threads.
"""

from __future__ import annotations

from carom.arrays import F64
from carom.numeric import is_number, is_whole
from carom.scene.packing.grow import Packed, PackingError, grow
from carom.scene.packing.numbers import Stream
from carom.scene.packing.region import Ball, Box, Cylinder, Region
from carom.scene.packing.sizes import MOST_BALLS, Equal, Lognormal, Normal, Rare, Sizes, Table, Uniform, fill
from carom.units import number

__all__ = [
    "MOST_BALLS",
    "Ball",
    "Box",
    "Cylinder",
    "Equal",
    "Lognormal",
    "Normal",
    "Packed",
    "PackingError",
    "Region",
    "Sizes",
    "Stream",
    "Table",
    "Uniform",
    "draw",
    "pack",
]


def draw(
    region: Region, sizes: Sizes, stream: Stream, count: int | None = None, fraction: float | None = None
) -> F64:
    """Radii (N,), m: `count` of them, or as many as fill `fraction` of the region."""
    if (count is None) == (fraction is None):
        raise PackingError("count and fraction say the same thing in two ways", "give exactly one of them")
    if count is not None and not (is_whole(count) and 1 <= count <= MOST_BALLS):
        raise PackingError(f"count = {count!r}", f"give a whole number of balls from 1 to {MOST_BALLS}")
    if fraction is not None and not (is_number(fraction) and fraction > 0):
        raise PackingError(f"fraction = {fraction!r}", "give a part of the region above 0")
    try:
        if count is not None:
            found = 0.5 * sizes.draw(count, stream)
        else:
            assert fraction is not None
            found = 0.5 * fill(sizes, fraction * region.volume, stream, MOST_BALLS)
    except Rare as error:
        raise PackingError(str(error), "widen the limits, or give another mean") from None
    if not (found > 0).all():
        raise PackingError(
            f"the law of sizes gives a diameter of {2 * found.min():g} m", "give sizes above 0"
        )
    if len(found) > MOST_BALLS:
        cause = f"a fraction of {fraction:g} would take more than {MOST_BALLS} balls"
        raise PackingError(cause, "give a smaller region or larger balls")
    return found


def pack(
    region: Region,
    sizes: Sizes,
    *,
    seed: int,
    count: int | None = None,
    fraction: float | None = None,
    gap: float | str = 0.0,
) -> Packed:
    """A random packing without overlaps: `count` balls, or as many as fill `fraction` of the region.

    `gap` m at least is kept free between any two balls, half of it at walls. Raises `PackingError` where the balls have no
    room or jam.
    """
    if isinstance(gap, str):
        gap = number("pack", "gap", gap, "length")
    if not (is_number(gap) and gap >= 0):
        found = f"{gap:g} m" if is_number(gap) else repr(gap)
        raise PackingError(f"gap = {found}", "balls do not overlap: give a length of 0 m or more")
    stream = Stream(seed)
    radius = draw(region, sizes, stream, count, fraction)
    return grow(region, radius, stream, gap)
