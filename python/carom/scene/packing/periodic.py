"""Periodic boxes: where the images of a ball are, also of a box that changes its size or is sheared.

The images of a place x are x + n @ vectors, n whole numbers. In a box that is sheared (Lees-Edwards) the image one up along
the axis `gradient` is displaced by `offset` along the axis `flow`; all other vectors lie along the fixed axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from carom.arrays import F64

BITS = np.array([[i >> k & 1 for k in range(3)] for i in range(8)], dtype=np.float64)
"""Which corner of a box is at the upper end of which axis, (8, 3)."""
_NO_FLOW: F64 = np.zeros((3, 3))


@dataclass(frozen=True)
class PeriodicBox:
    """A periodic box at one time."""

    lengths: F64
    """Along x, y, z, (3,), m; 0 along axes that do not repeat."""
    origin: F64 = field(default_factory=lambda: np.zeros(3))
    """Its lowest corner, (3,), m. A box that deforms keeps its centre."""
    flow: int = 0
    """Axis along which images are displaced: 0, 1 or 2 for x, y, z."""
    gradient: int = 1
    """Axis across which they are."""
    offset: float = 0.0
    """Displacement along `flow` of the image one up along `gradient`, m; it may be many lengths."""
    velocity_gradient: F64 = field(default_factory=lambda: _NO_FLOW)
    """G of the mean flow, (3, 3), 1/s: an image at n @ vectors moves with G (n @ vectors)."""

    @classmethod
    def of(cls, period: PeriodicBox | F64 | None) -> PeriodicBox | None:
        """The box of these lengths, or the box itself; None where nothing repeats."""
        if period is None or isinstance(period, PeriodicBox):
            return period
        return cls(np.asarray(period, dtype=np.float64)) if np.any(np.asarray(period) > 0) else None

    @property
    def centre(self) -> F64:
        """(3,), m; along axes that do not repeat the origin."""
        return np.asarray(self.origin + 0.5 * self.lengths)

    @property
    def vectors(self) -> F64:
        """Vectors between images as rows, (3, 3), m; zeros for axes that do not repeat."""
        found: F64 = np.diag(self.lengths)
        found[self.gradient, self.flow] = self.offset
        return found

    def corners(self, low: F64, high: F64) -> F64:
        """The corners of the box whose edges are `vectors`, (8, 3), m; in number i bit k is set at the upper end along k.

        Along axes that do not repeat it is from `low` to `high`, (3,), m.
        """
        repeats = self.lengths > 0
        edges = np.where(repeats[:, None], self.vectors, np.diag(high - low))
        least = np.where(repeats, self.centre - 0.5 * self.vectors.sum(axis=0), low)
        return np.asarray(least + BITS @ edges)

    @property
    def tilt(self) -> float:
        """The offset less whole lengths, at most half a length in size, m: that of the box with the shortest edges."""
        length = float(self.lengths[self.flow])
        return self.offset - length * float(np.rint(self.offset / length)) if self.offset else 0.0

    @property
    def tilted(self) -> PeriodicBox:
        """The same box with `tilt` as its offset: the same images, in shorter vectors."""
        return PeriodicBox(
            self.lengths, self.origin, self.flow, self.gradient, self.tilt, self.velocity_gradient
        )

    @property
    def sheared(self) -> bool:
        """Whether images are displaced."""
        return self.offset != 0.0

    @property
    def deforms(self) -> bool:
        """Whether images move against each other."""
        return bool(self.velocity_gradient.any())

    def nearest(self, delta: F64) -> F64:
        """Differences of places (..., 3), m, to the nearest image."""
        return self._without(delta, np.rint)

    def fold(self, place: F64) -> F64:
        """The images of places (..., 3), m, in the block from `origin` to `origin` + `lengths`, its upper faces left out."""
        return (
            np.asarray(self._without(place - self.origin, np.floor) + self.origin)
            if self.sheared
            else self._level(place)
        )

    def _level(self, place: F64) -> F64:
        """The same where nothing is displaced: what lies in the box keeps its bits."""
        turns = np.floor((place - self.origin) / np.where(self.lengths > 0, self.lengths, np.inf))
        return np.asarray(place - self.lengths * turns)

    def _without(self, delta: F64, whole: np.ufunc) -> F64:
        """Differences less vectors of images, of which `whole` says how many: first along the gradient, with its offset."""
        found = np.array(delta, dtype=np.float64)
        for axis in self.order:
            turns = whole(found[..., axis] / self.lengths[axis])
            found[..., axis] -= self.lengths[axis] * turns
            if axis == self.gradient and self.sheared:
                found[..., self.flow] -= self.offset * turns
        return found

    @property
    def order(self) -> list[int]:
        """The axes that repeat, that of the gradient first: an image along it is displaced along another one."""
        axes = np.flatnonzero(self.lengths > 0).tolist()
        return sorted(axes, key=lambda axis: axis != self.gradient)

    def turns(self, place: F64) -> F64:
        """How many vectors (..., 3) places (..., 3), m, are from their image in the box whose edges are `vectors`."""
        away = place - self.centre
        found: F64 = np.zeros_like(away)
        for axis in self.order:
            part = away[..., axis]
            if axis == self.flow and self.sheared:
                part = part - self.offset * (away[..., self.gradient] / self.lengths[self.gradient])
            found[..., axis] = np.floor(part / self.lengths[axis] + 0.5)
        return found

    def fold_tilted(self, place: F64) -> F64:
        """The images of places (..., 3), m, in the box about the same centre whose edges are `vectors`: a parallelepiped."""
        return np.asarray(place - self.turns(place) @ self.vectors)

    def flow_velocity(self, place: F64) -> F64:
        """Velocity of the mean flow at places (..., 3), m/s: G (x - centre)."""
        return np.asarray((place - self.centre) @ self.velocity_gradient.T)
