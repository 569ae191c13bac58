"""Random packings: balls dropped at random into a region, that grow while they push each other apart.

The balls begin small and grow in stages to a little more than their size, the margin. In each stage the overlaps repel
like linear springs, and their energy is brought down by FIRE (Bitzek et al., Phys. Rev. Lett. 97 (2006) 170201). The
packing is done when no overlap is deeper than the margin: the balls of the size that was asked for have gaps then. Equal
balls jam at a fraction of about 0.64 (O'Hern et al., Phys. Rev. E 68 (2003) 011306); below it the overlaps vanish, above
they cannot.

Only operations are used whose result IEEE 754 fixes, in an order that does not depend on the machine or on threads: the same
seed gives the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64
from carom.errors import CaromError
from carom.scene.packing.neighbours import pairs, separation
from carom.scene.packing.numbers import Stream, cbrt, total
from carom.scene.packing.region import Region

JAMMED = 0.64
"""Fraction at which random packings of equal balls jam."""
MOST_ITERATIONS = 6000
_FIRST = 0.15  # fraction at which the growth begins
_STAGES = 6
_STAGE_ITERATIONS = 60
_LEAST_MARGIN = 2e-4
_SKIN = 0.25  # a ball may move by this part of its radius before the pairs are listed again
_MOVE = 0.1  # the same, in one iteration


class PackingError(CaromError):
    """A packing that was asked for and not found. `cause` says why, `cure` what to ask for."""

    def __init__(self, cause: str, cure: str) -> None:
        super().__init__(f"{cause}; {cure}")
        self.cause, self.cure = cause, cure


@dataclass(frozen=True)
class Packed:
    """Balls without overlaps."""

    position: F64
    """Centres, (N, 3), m."""
    radius: F64
    """Radii, (N,), m."""
    fraction: float
    """Volume of the balls over that of the region, both without overlap or cut."""
    least_gap: float
    """Smallest distance of the surfaces of two balls, or of a ball and the wall, m; not negative."""
    iterations: int
    """Of the minimisation, over all stages."""


def grow(region: Region, radius: F64, stream: Stream, gap: float = 0.0) -> Packed:
    """Balls of the given radii (N,) m at random in a region, no two nearer than `gap` m, nor any than half of it to a wall.

    Raises `PackingError` if they do not fit, or if they jam before they have their size.
    """
    if not 1e-30 < region.volume < 1e30:
        raise PackingError(f"the region has a volume of {region.volume:.4g} m^3", "check the units")
    swollen = radius + 0.5 * gap  # two of these touch at the gap
    fraction = _fraction(region, radius)
    full = _fraction(region, swollen)
    largest = float(swollen.max())
    if largest * (1.0 + _LEAST_MARGIN) > region.widest:
        cause = f"a ball of diameter {2 * radius.max():.4g} m has no room in the region"
        raise PackingError(
            cause, f"the largest may have {2 * region.widest / (1.0 + _LEAST_MARGIN) - gap:.4g} m"
        )
    if full > 0.95:
        cause = f"the balls{' and their gaps' if gap else ''} would fill {full:.3g} of the region"
        raise PackingError(cause, f"random packings reach about {JAMMED:g}: take fewer or a larger region")
    margin = min(0.01, max(_LEAST_MARGIN, 0.1 * (JAMMED - full)), region.widest / largest - 1.0)
    state = _State(region, swollen, stream)
    enough = 0.99 * margin / (1.0 + margin)  # of the swollen radii: what leaves a gap between those asked for
    start = min(1.0, cbrt(_FIRST / full))
    for stage in range(_STAGES):
        scale = start + (1.0 - start) * stage / _STAGES
        state.relax(swollen * scale * (1.0 + margin), enough, _STAGE_ITERATIONS)
    deepest = state.relax(swollen * (1.0 + margin), enough, MOST_ITERATIONS)
    if deepest > enough:
        cause = f"no packing of fraction {fraction:.4g} was found: after {state.iterations} iterations balls overlap by "
        cause += f"{deepest - enough:.2g} of a diameter"
        cure = f"random packings of equal balls jam at {JAMMED:g}, less near walls"
        cure += f": ask for {min(0.97 * fraction, JAMMED - 0.02):.3g} or less{', or for a smaller gap' if gap else ''}"
        raise PackingError(cause, cure)
    position = region.to_world(state.x)
    return Packed(position, radius, fraction, state.least_gap(radius, position), state.iterations)


def _fraction(region: Region, radius: F64) -> float:
    return 4.0 / 3.0 * np.pi * total(radius * radius * radius) / region.volume


class _State:
    """Centres on their way, and the list of pairs that may touch."""

    def __init__(self, region: Region, radius: F64, stream: Stream) -> None:
        self.region, self.iterations = region, 0
        self.x = _scattered(region, radius, stream)
        self._listed = self.x
        self._mass = np.ones(len(radius))
        self._a: I64 = np.zeros(0, np.int64)
        self._b: I64 = np.zeros(0, np.int64)

    def relax(self, radius: F64, enough: float, most: int) -> float:
        """Push apart until no overlap is deeper than `enough`, relative to the sum of two radii, or to one at a wall.

        Returns the deepest, relative.
        """
        self._list(radius)
        velocity = np.zeros_like(self.x)
        dt, damping, downhill = 0.2, 0.1, 0
        for _ in range(most):
            force, deepest = self._push(radius)
            if deepest <= enough:
                break
            self.iterations += 1
            power = total((force * velocity).ravel())
            if power > 0:
                speed = total((velocity * velocity).ravel()) / total((force * force).ravel())
                velocity = (1.0 - damping) * velocity + damping * np.sqrt(speed) * force
                downhill += 1
                if downhill > 5:
                    dt, damping = min(1.1 * dt, 0.7), 0.99 * damping
            else:
                velocity[:] = 0.0
                dt, damping, downhill = max(0.5 * dt, 0.02), 0.1, 0
            velocity += dt * force / self._mass[:, None]
            move = dt * velocity
            length = np.sqrt((move * move).sum(axis=1))
            move *= np.minimum(1.0, _MOVE * radius / np.maximum(length, 1e-300))[:, None]
            self.x = self.x + move
        return deepest

    def _push(self, radius: F64) -> tuple[F64, float]:
        """Sum of the overlaps of each ball as vectors, (N, 3) m, and the deepest overlap over the sum of the radii."""
        moved = self.x - self._listed
        allowed = _SKIN * radius
        if ((moved * moved).sum(axis=1) > allowed * allowed).any():
            self._list(radius)
        delta = separation(self.x[self._a] - self.x[self._b], self.region.period)
        limit = radius[self._a] + radius[self._b]
        square = (delta * delta).sum(axis=1)
        met = np.flatnonzero(square < limit * limit)
        a, b, delta, limit = self._a[met], self._b[met], delta[met], limit[met]
        distance = np.sqrt(square[met])
        overlap = limit - distance
        wall, force = self.region.depth(self.x, radius)
        deepest = float((wall / radius).max())
        if len(met):
            deepest = max(deepest, float((overlap / limit).max()))
            push = delta * (overlap / np.maximum(distance, 1e-300))[:, None]
            n = len(self.x)
            for axis in range(3):
                force[:, axis] += np.bincount(a, push[:, axis], n) - np.bincount(b, push[:, axis], n)
        return force, max(deepest, 0.0)

    def _list(self, radius: F64) -> None:
        """The pairs near enough to meet before a ball has moved by the skin."""
        self._listed = self.x
        self._a, self._b = pairs(self.x, (1.0 + _SKIN) * radius, self.region.period)
        n = len(radius)
        met = np.bincount(self._a, minlength=n) + np.bincount(self._b, minlength=n)
        self._mass = np.maximum(1.0, met / 12.0)  # many springs pull at a ball among small ones

    def least_gap(self, radius: F64, position: F64) -> float:
        a, b = pairs(position, 1.25 * radius, self.region.period)
        delta = separation(position[a] - position[b], self.region.period)
        gap = np.sqrt((delta * delta).sum(axis=1)) - radius[a] - radius[b]
        wall, _ = self.region.depth(self.x, radius)
        return float(min(gap.min(initial=np.inf), -wall.max()))


def _scattered(region: Region, radius: F64, stream: Stream) -> F64:
    """Centres at random, evenly, each ball within the walls."""
    half = region.half
    room = np.where(region.period > 0, half, half - radius[:, None])
    x = np.zeros((len(radius), 3))
    left = np.arange(len(radius))
    while len(left):
        x[left] = (2.0 * stream.uniform(len(left), 3) - 1.0) * room[left]
        outside, _ = region.depth(x[left], radius[left])
        left = left[outside > 1e-12 * radius[left]]
    return x
