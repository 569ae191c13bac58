"""`result.box(frame)`: the periodic box at a frame, which may have changed its size or be sheared since the start."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from carom.arrays import F64, I64
from carom.scene.packing.periodic import PeriodicBox
from carom.scene.tables.deformation import Deformation

if TYPE_CHECKING:
    from carom.result.data import RunData

COLUMNS = 4


class Boxes:
    """The periodic boxes of T frames: `boxes[frame]`."""

    def __init__(
        self,
        first: PeriodicBox,
        rows: F64 | None = None,
        time: F64 | None = None,
        law: tuple[Deformation, float] | None = None,
    ) -> None:
        self.first = first
        """The one that the scene gives."""
        self.rows = rows
        """Lengths along x, y, z and offset, (T, 4), m; None where the box is always the first one."""
        self._time, self._law = time, law

    @classmethod
    def of(cls, result: RunData) -> Self | None:
        """Those of a result; None of one whose world does not repeat."""
        periodic = result.periodic
        if periodic is None:
            return None
        attributes = result._segments.attributes
        first = PeriodicBox(
            periodic,
            result.periodic_origin,
            int(attributes.get("box_flow", 0)),
            int(attributes.get("box_gradient", 1)),
        )
        if "box" not in result._segments.columns("frames"):
            return cls(first)
        rows = np.asarray(result._segments.column("frames", "box"), dtype=np.float64)
        _usable(result, first, rows)
        deformation = result.scene.world.deformation
        law = None if deformation is None else (deformation, float(result.scene.run.step))
        return cls(first, rows, np.asarray(result.time), law)

    @property
    def deform(self) -> bool:
        """Whether they differ from frame to frame."""
        return self.rows is not None

    def __len__(self) -> int:
        return 0 if self.rows is None else len(self.rows)

    def __getitem__(self, frame: int) -> PeriodicBox:
        if self.rows is None or self._time is None:
            return self.first
        return self._made(self.rows[frame], float(self._time[frame]))

    def at(self, time: float) -> PeriodicBox:
        """The box at a time, s, straight between two frames."""
        if self.rows is None or self._time is None:
            return self.first
        return self._made(np.array([np.interp(time, self._time, row) for row in self.rows.T]), time)

    def _made(self, row: F64, time: float) -> PeriodicBox:
        first, lengths = self.first, row[:3].copy()
        flow: dict[str, F64] = {}
        if self._law is not None:
            deformation, step = self._law
            flow = {"velocity_gradient": deformation.velocity_gradient(time, step)}
        origin = first.centre - 0.5 * lengths
        return PeriodicBox(lengths, origin, first.flow, first.gradient, float(row[3]), **flow)

    def nearest(self, delta: F64, frame: I64) -> F64:
        """Differences of places (K, 3), m, at the frames (K,), to the nearest image."""
        if self.rows is None:
            return self.first.nearest(delta)
        found: F64 = np.empty_like(delta)
        for k in np.unique(frame).tolist():
            found[frame == k] = self[k].nearest(delta[frame == k])
        return found

    def around(self, low: F64, high: F64) -> tuple[F64, F64]:
        """Lowest and highest corner, (3,), m, of all boxes as they are drawn; `low`, `high` where nothing repeats."""
        first, repeats = self.first, self.first.lengths > 0
        if self.rows is None:
            return np.where(repeats, first.origin, low), np.where(repeats, first.origin + first.lengths, high)
        half = 0.5 * self.rows[:, :3]
        # A box that is sheared goes from one side to the other as its tilt does.
        half[:, first.flow] *= 1.0 + (self.rows[:, 3] != 0.0)
        reach = half.max(axis=0, initial=0.0)
        return np.where(repeats, first.centre - reach, low), np.where(repeats, first.centre + reach, high)


def _usable(result: RunData, first: PeriodicBox, rows: F64) -> None:
    """A file may be damaged, or made by others."""
    axes = {first.flow, first.gradient}
    if not axes <= {0, 1, 2} or len(axes) < 2:
        raise result._segments.damage("box_flow and box_gradient", "they are no two of the axes 0, 1, 2")
    repeats = first.lengths > 0
    good = np.isfinite(rows).all() and ((rows[:, :3] > 0) == repeats).all() and (rows[:, :3] >= 0).all()
    if not good:
        raise result._segments.damage(
            "/frames/box", "lengths are not above 0, or along axes that do not repeat"
        )
    if (rows[:, 3] != 0).any() and not (repeats[first.flow] and repeats[first.gradient]):
        raise result._segments.damage(
            "/frames/box", "images are displaced along an axis that does not repeat"
        )
