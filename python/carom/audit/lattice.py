"""Periodic boxes as the auditor sees them: where images are and how fast they move at any time, from the law of the box.

The edges of a box are `H(t) = F(t) H(0)` about a centre that stays, `F = diag(stretch) + shear e_flow (x) e_gradient`
(algorithm, section 16). The image `n` lengths away is displaced by `H n` and faster by `dH/dt n`, as a wall that moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from carom.arrays import F64, Bool
from carom.audit.formula import law
from carom.audit.vectors import norm
from carom.scene.packing.periodic import PeriodicBox


class Lattice:
    """The periodic box of a run at any time; of a world that does not repeat all lengths are 0. Times are (K,), s."""

    def __init__(self, model: Mapping[str, Any], period: F64 | None) -> None:
        given = model.get("deformation") or {}
        self.first: F64 = np.zeros(3) if period is None else np.asarray(period, dtype=np.float64)
        """Lengths at the start, m; 0 along axes that do not repeat."""
        self.repeats: Bool = self.first > 0.0
        origin = model.get("periodic_origin")
        self.middle: F64 = (
            np.zeros(3) if origin is None else np.asarray(origin, dtype=np.float64)
        ) + 0.5 * self.first
        self.deforms = bool(given)
        self.h = float(model["options"]["step"])
        """Size of a step, s: the rate is constant in each."""
        self._stretch = tuple(given.get("stretch") or (None,) * 3)
        self._shear = given.get("shear")
        self.flow, self.gradient = int(given.get("flow", 0)), int(given.get("gradient", 1))

    @property
    def any(self) -> bool:
        """Whether anything repeats."""
        return bool(self.repeats.any())

    def edges(self, time: F64) -> tuple[F64, F64]:
        """Lengths (K, 3) and the displacement (K,) along the flow of the image one up along the gradient, m: of a law
        at the times of the grid, and straight between them.
        """
        time = np.asarray(time, dtype=np.float64)
        start = self._number(time) * self.h
        lengths, offset = np.tile(self.first, (len(time), 1)), np.zeros(len(time))
        for axis, form in enumerate(self._stretch):
            if form is not None:
                lengths[:, axis] *= law(form, start)[0] + (time - start) * self._rate(form, time)
        if self._shear is not None:
            strain = law(self._shear, start)[0] + (time - start) * self._rate(self._shear, time)
            offset = strain * self.first[self.gradient]
        return lengths, offset

    def rates(self, time: F64, *, end: bool = False) -> tuple[F64, F64]:
        """How fast both change, m/s, in the step that begins at a time, or the one that ends there."""
        time = np.asarray(time, dtype=np.float64)
        lengths, offset = np.zeros((len(time), 3)), np.zeros(len(time))
        for axis, form in enumerate(self._stretch):
            if form is not None:
                lengths[:, axis] = self.first[axis] * self._rate(form, time, end=end)
        if self._shear is not None:
            offset = self._rate(self._shear, time, end=end) * self.first[self.gradient]
        return lengths, offset

    def _number(self, time: F64) -> F64:
        """(K,) the step that begins at a time, or has it."""
        return np.floor(time / self.h + 1e-6)

    def _rate(self, form: Any, time: F64, *, end: bool = False) -> F64:
        """(K,) of a law: from one time of the grid to the next. Of a straight one it is the slope, which does not round.
        Where the law ends it is that of the step before.
        """
        found = self._of_step(form, np.maximum(self._number(time) - end, 0.0))
        behind = ~np.isfinite(found)
        if behind.any():
            found = np.where(behind, self._of_step(form, np.maximum(self._number(time) - 1.0, 0.0)), found)
        return found

    def _of_step(self, form: Any, number: F64) -> F64:
        (first, slope), (last, _) = law(form, number * self.h), law(form, (number + 1.0) * self.h)
        mean = (last - first) / self.h
        return np.where(np.abs(mean - slope) <= 1e-9 * (np.abs(slope) + np.abs(last)), slope, mean)

    def along(self, edges: tuple[F64, F64], count: F64) -> F64:
        """(..., 3) what is `count` (..., 3) edges long, of edges, or their rates, of as many times."""
        lengths, offset = edges
        found = np.asarray(lengths * count)
        found[..., self.flow] += offset * count[..., self.gradient]
        return found

    def packed(self, time: float) -> PeriodicBox | None:
        """The box at a time, for lists of neighbours; None where nothing repeats."""
        if not self.any:
            return None
        lengths, offset = (of[0] for of in self.edges(np.array([time])))
        if self._shear is None:
            return PeriodicBox(lengths, self.middle - 0.5 * lengths)
        whole = lengths[self.flow] * np.rint(offset / lengths[self.flow])
        low = self.middle - 0.5 * lengths
        return PeriodicBox(lengths, low, self.flow, self.gradient, float(offset - whole))

    def velocity(self, time: F64, count: F64, *, end: bool = False) -> F64:
        """(K, 3) m/s, by how much images so many lengths away are faster."""
        return self.along(self.rates(time, end=end), count)

    def away(self, time: F64, d: F64) -> F64:
        """(K, 3) how many images away differences of places (K, 3) end: first along the gradient."""
        lengths, offset = self.edges(time)
        over = np.where(self.repeats, lengths, np.inf)
        count = np.rint(d / over)
        if self._shear is not None:
            left = d[:, self.flow] - count[:, self.gradient] * offset
            count[:, self.flow] = np.rint(left / over[:, self.flow])
        return np.asarray(count)

    def nearest(self, time: F64, d: F64) -> F64:
        """Differences of places (K, 3), m, to the nearest image."""
        return np.asarray(d - self.along(self.edges(time), self.away(time, d)))

    def share(self, edges: tuple[F64, F64], x: F64) -> F64:
        """(..., 3) how far places (..., 3) are from the middle, in edges of as many times; 0 where nothing repeats."""
        lengths, offset = edges
        over, d = np.where(self.repeats, lengths, np.inf), x - self.middle
        found, f, g = d / over, self.flow, self.gradient
        if self._shear is not None:
            found[..., f] = (d[..., f] - found[..., g] * offset) / over[..., f]
        return np.asarray(found)

    def rounding(self, time: F64) -> F64:
        """(K,) m, the lengths that places of images near the box are sums of: 0 of a box that does not deform."""
        if not self.deforms:
            return np.zeros(len(time))
        lengths, offset = self.edges(time)
        return np.asarray(lengths.max(axis=1, initial=0.0) + 2.0 * np.abs(offset))

    def strain_rate(self, time: F64, *, end: bool = False) -> F64:
        """(K,) 1/s, the size of `dF/dt F^-1`: what is a metre apart moves apart so fast, in m/s, at most."""
        return self._over(self.rates(time, end=end), time)

    def _over(self, change: tuple[F64, F64], time: F64) -> F64:
        """(K,) the size of a change of the edges, over the edges."""
        lengths, offset = self.edges(time)
        over = np.where(self.repeats, lengths, np.inf)
        each = change[0] / over
        # dF F^-1 of a matrix with one entry beside its diagonal.
        beside = (change[1] - each[:, self.flow] * offset) / over[:, self.gradient]
        return np.asarray(norm(np.concatenate([each, beside[:, None]], axis=1)))

    def jolts(self, end: F64) -> F64:
        """(K,) 1/s, sizes of the changes of the rate from the steps that end at these times to the next ones."""
        last, then = self.rates(end, end=True), self.rates(end)
        return self._over((then[0] - last[0], then[1] - last[1]), end)
