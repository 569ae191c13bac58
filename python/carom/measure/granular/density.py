"""How densely the balls lie: packing fraction and radial distribution function."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.measure.granular.region import Region, inside
from carom.measure.granular.shown import Measure
from carom.measure.granular.snapshot import Source, snapshot
from carom.numeric import is_number, is_whole
from carom.scene.packing.neighbours import pairs, separation
from carom.scene.packing.periodic import PeriodicBox
from carom.scene.packing.region import Box


def packing_fraction(source: Source, region: Region, frame: int = -1) -> float:
    """Volume of the balls within a region over its volume; of balls that stick out, what is inside.

    Exact in boxes, in spheres and at the ends of cylinders; balls cut by the curved wall of a cylinder are integrated to
    about 1e-8. Along its periodic axes a box has no faces that could cut. In a periodic world all images of a ball count
    that reach the region.
    """
    return float(snapshot(source, frame).within(region).sum()) / region.volume


@dataclass(frozen=True, repr=False)
class RadialDistribution(Measure):
    """g(r): how often centres are a distance apart, over how often they would be if they lay evenly."""

    edges: F64
    """Of the bins, (B + 1,), m."""
    g: F64
    """Mean over each bin, (B,)."""
    pairs: F64
    """Neighbours found in each bin, (B,): a pair counts from each end that is an origin."""
    error: F64
    """Standard error of `g` from the number of different pairs found, (B,)."""
    origins: int
    """Balls around which was looked."""

    @property
    def r(self) -> F64:
        """Middle of the bins, (B,), m."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


def _images_of(box: Box, world: PeriodicBox | None) -> PeriodicBox | None:
    """How a box repeats itself along its axes without faces, in a world whose images may be displaced."""
    if world is None or not world.sheared:
        return PeriodicBox.of(box.period)
    return replace(world, lengths=box.period, offset=world.offset if box.periodic[world.gradient] else 0.0)


def radial_distribution(
    source: Source, box: Box, frame: int = -1, *, reach: float, bins: int = 100
) -> RadialDistribution:
    """The radial distribution function of the balls in a box, up to `reach` m.

    The box has to be full of them. So that no shell leaves it, only balls at least `reach` from its faces are origins; along
    periodic axes all are.
    """
    s = snapshot(source, frame)
    within = _images_of(box, s.box)
    free = ~np.array(box.periodic)
    low, high = np.array(box.low), np.array(box.high)
    if not (is_number(reach) and reach > 0 and is_whole(bins) and bins >= 1):
        cure = "give a length above 0, in m, and a whole number of bins from 1"
        raise CaromError(f"radial_distribution: reach = {reach!r} and {bins!r} bins; {cure}")
    if (2.0 * reach >= (high - low)).any():
        most = 0.5 * float((high - low).min())
        raise CaromError(f"reach = {reach:g} m is too far for the box; it must be below {most:.4g} m")
    _, x = inside(box, s.position[s.present], s.box)
    origin = ((x >= low + reach) & (x < high - reach) | ~free).all(axis=1)
    if not origin.any():
        raise CaromError(
            f"no ball is {reach:g} m from the faces of the box; give a shorter reach or a larger box"
        )
    a, b = pairs(x, np.full(len(x), 0.5 * reach), within)
    delta = separation(x[a] - x[b], within)
    distance = np.sqrt((delta * delta).sum(axis=1))
    weight = origin[a].astype(np.float64) + origin[b]
    counts, edges = np.histogram(distance, bins, (0.0, reach), weights=weight)
    # One pair seen from both ends is one event: a variance of 4, not 2.
    variance, _ = np.histogram(distance, bins, (0.0, reach), weights=weight * weight)
    shells = 4.0 / 3.0 * np.pi * np.diff(edges**3)
    expected = int(origin.sum()) * (len(x) - 1) / box.volume * shells
    error = np.sqrt(np.maximum(variance, 1.0)) / expected
    return RadialDistribution(edges, counts / expected, counts, error, int(origin.sum()))
