"""`result.clumps`: how the rigid bodies made of spheres moved.

The core gives the pose of the principal axes; here it is that of the own axes, in which the scenario has the spheres.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.result.record.clumps import COLUMNS
from carom.result.tables import Named
from carom.scene.assembly.rotations import inverse, product, rotated, rotated_back

if TYPE_CHECKING:
    from carom.result.data import RunData


class Clump:
    """One clump of a result: `result.clumps["rod"].position` is (T, 3)."""

    def __init__(
        self, result: RunData, index: int, facts: Mapping[str, Any], frames: slice | Array = slice(None)
    ) -> None:
        self._result, self._facts, self._frames = result, facts, frames
        self.index = index
        """Number among the clumps."""
        self.name = str(facts["name"])
        self.mass = float(facts["mass"])
        """kg."""
        first = int(facts["first"])
        self.numbers: I64 = np.arange(first, first + int(facts["count"]))
        """Numbers of its balls, (n,)."""
        self.moments: F64 = np.asarray(facts["inertia"], dtype=np.float64)
        """Principal moments of inertia, (3,), kg m^2."""
        self.axes: F64 = np.asarray(facts["axes"], dtype=np.float64)
        """Unit quaternion, scalar part first, (4,): principal axes to own axes."""
        self.centre: F64 = np.asarray(facts["centre"], dtype=np.float64)
        """Centre of mass in own axes, (3,), m."""

    def chosen(self, frames: Array) -> Clump:
        """The same clump with rows of some frames of the run only."""
        return Clump(self._result, self.index, self._facts, frames)

    @property
    def balls(self) -> list[str]:
        """Names of its balls."""
        names = self._result.names
        return [names[k] for k in self.numbers.tolist()]

    @cached_property
    def inertia(self) -> F64:
        """Tensor of inertia about the centre of mass, own axes, (3, 3), kg m^2."""
        turned = rotated(self.axes, np.eye(3)).T  # principal to own axes
        return np.asarray(turned @ np.diag(self.moments) @ turned.T)

    @property
    def time(self) -> Any:
        """Times of the frames, (T,), s."""
        return self._result.time[self._frames]

    @property
    def present(self) -> Bool:
        """Whether it is there, (T,): always, unless the scene has outlets."""
        return np.asarray(self._result.present[:, self.numbers[0]])[self._frames]

    @property
    def position(self) -> F64:
        """Centre of mass, (T, 3), m; not a number while it is absent."""
        return self._columns(0, 3)

    @property
    def principal_orientation(self) -> F64:
        """Unit quaternions, scalar part first, (T, 4): principal axes to fixed axes."""
        return self._columns(3, 7)

    @cached_property
    def orientation(self) -> F64:
        """Unit quaternions, scalar part first, (T, 4): own axes to fixed axes."""
        return product(self.principal_orientation, inverse(self.axes))

    @cached_property
    def origin(self) -> F64:
        """Origin of the own axes, (T, 3), m: `position` of its table as the clump moves."""
        return self.position - rotated(self.orientation, self.centre)

    @property
    def velocity(self) -> F64:
        """Velocity of the centre of mass, (T, 3), m/s."""
        return self._columns(7, 10)

    @property
    def angular_velocity(self) -> F64:
        """Angular velocity in the world frame, (T, 3), rad/s."""
        return self._columns(10, 13)

    @cached_property
    def angular_momentum(self) -> F64:
        """Angular momentum about the centre of mass in the world frame, (T, 3), N m s."""
        turn = self.principal_orientation
        return rotated(turn, self.moments * rotated_back(turn, self.angular_velocity))

    @cached_property
    def rotational_energy(self) -> F64:
        """Kinetic energy of the rotation, (T,), J."""
        return np.asarray(0.5 * (self.angular_momentum * self.angular_velocity).sum(axis=1))

    @property
    def kinetic_energy(self) -> F64:
        """Kinetic energy of translation and rotation, (T,), J."""
        return np.asarray(0.5 * self.mass * (self.velocity**2).sum(axis=1) + self.rotational_energy)

    def _columns(self, first: int, end: int) -> F64:
        column = self._result._segments.column("frames", "clumps")
        return np.asarray(column[:, self.index, first:end])[self._frames]

    def __repr__(self) -> str:
        return f"<clump {self.name!r}: {len(self.numbers)} balls, mass {self.mass:g} kg, {len(self.time)} frames>"


def rigid(result: RunData) -> I64:
    """Number of the rigid body that each ball is or is a part of, (N,), from 0: the balls of a clump have one in common."""
    number = np.arange(len(result.names))
    for clump in result.clumps.values():
        number[clump.numbers] = clump.numbers[0]
    return np.unique(number, return_inverse=True)[1]


class Clumps(Named[Clump]):
    """All clumps of a result by name, in the order of the scenario; `table` is the static one of the file."""

    what = "clump"

    def __init__(self, result: RunData, table: Mapping[str, Any]) -> None:
        names = [str(name) for name in table["name"]]
        if names:
            _check(result, table, len(names))
        rows = ({key: column[k] for key, column in table.items()} for k in range(len(names)))
        super().__init__(
            {name: Clump(result, k, row) for k, (name, row) in enumerate(zip(names, rows, strict=True))}
        )

    def chosen(self, frames: Array, bodies: Array) -> Self:
        """Those of which a ball is among some of the run, with rows of some frames only."""
        mine = {name: clump for name, clump in self.items() if np.isin(clump.numbers, bodies).any()}
        return self._with({name: clump.chosen(frames) for name, clump in mine.items()})


def _check(result: RunData, table: Mapping[str, Any], count: int) -> None:
    """Raise if the table and the column of frames do not fit the balls of the run, or one another."""
    damage = result._segments.damage
    first, several = np.asarray(table["first"]), np.asarray(table["count"])
    if ((first < 0) | (several < 1) | (first + several > len(result.names))).any():
        raise damage("/clumps/first", "a clump has balls that are not there")
    for name in ("mass", "inertia", "centre", "axes"):
        values = np.asarray(table[name])
        if not np.isfinite(values).all() or (name in ("mass", "inertia") and (values <= 0).any()):
            raise damage(f"/clumps/{name}", "a number is not finite, or not above 0")
    if "clumps" not in result._segments.columns("frames"):
        raise damage("/frames/clumps", "it is not there, and the run has clumps")
    shape = result._segments.column("frames", "clumps").shape[1:]
    if shape != (count, COLUMNS):
        raise damage("/frames/clumps", f"its rows have shape {shape}, not {(count, COLUMNS)}")
