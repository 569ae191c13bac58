"""`result.walls`: where the walls of a run were, and what the balls did to them.

Places follow from the laws of motion at the times of the frames; forces are means over the interval that ends at a frame.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.errors import CaromError, quoted
from carom.result.record.opening import DAMAGED
from carom.result.record.untrusted import first_line
from carom.result.record.walls import PARAMETERS
from carom.result.tables import Named
from carom.scene.assembly.distances import gaps
from carom.scene.assembly.rotations import rotated, rotated_back
from carom.scene.assembly.triangles import Triangles
from carom.scene.tables.laws import value_at

if TYPE_CHECKING:
    from carom.result.data import RunData


GONE = 1e-9
"""Relative to the time at which a wall is taken away: times of frames are rounded."""


class Poses:
    """A prescribed motion as a file keeps it: JSON of what the core got (`wall_motion` in `_core.pyi`), "" for none."""

    def __init__(self, text: str) -> None:
        given: Mapping[str, Any] = json.loads(text) if text else {}
        self._translation = given.get("translation")
        self._rotation = given.get("rotation")
        self.until = float(given.get("until", np.inf))
        """When the wall is taken away, s."""

    @property
    def moves(self) -> bool:
        """Whether the shape moves, or is taken away."""
        return self._translation is not None or self._rotation is not None or np.isfinite(self.until)

    def there(self, time: F64) -> Bool:
        """Whether the wall is there at several times, (T,): at the end of the step that ends at `until` it is."""
        return np.asarray(time <= self.until * (1.0 + GONE))

    def displacement(self, time: F64) -> F64:
        """Displacement `d` by the translation, (T, 3), m."""
        if self._translation is None:
            return np.zeros((len(time), 3))
        return np.stack([_values(law, time) for law in self._translation], axis=1)

    def orientation(self, time: F64) -> F64:
        """Rotation `R` since the start as unit quaternions, scalar part first, (T, 4)."""
        found = np.zeros((len(time), 4))
        found[:, 0] = 1.0
        if self._rotation is not None:
            axis, _, law = self._rotation
            half = 0.5 * _values(law, time)
            found[:, 0] = np.cos(half)
            found[:, 1:] = np.outer(np.sin(half), axis)
        return found

    def position(self, point: F64, time: F64) -> F64:
        """Where a point (3,) of the wall is: `c + d + R (point - c)`, (T, 3), m."""
        displacement = self.displacement(time)
        if self._rotation is None:
            return point + displacement
        centre = np.array(self._rotation[1])
        return centre + displacement + rotated(self.orientation(time), point - centre)


class FreePoses(Poses):
    """The motion of a free wall along its `normal` (3,), from its displacement (T,), m, and velocity (T,), m/s, at the
    times (T,) of the frames: between them the cubic that has both.
    """

    def __init__(self, normal: F64, time: F64, displacement: F64, velocity: F64) -> None:
        super().__init__("")
        self._normal, self._time = normal, time
        self._along, self._velocity = displacement, velocity

    @property
    def moves(self) -> bool:
        return True

    def displacement(self, time: F64) -> F64:
        if len(self._time) < 2:
            return np.outer(np.full(len(time), self._along[0]), self._normal)
        k = np.clip(np.searchsorted(self._time, time, side="right") - 1, 0, len(self._time) - 2)
        (y, v), h = ((x[k], x[k + 1]) for x in (self._along, self._velocity)), np.diff(self._time)[k]
        s = np.clip((time - self._time[k]) / h, 0.0, 1.0)
        along = y[0] + (y[1] - y[0]) * s * s * (3.0 - 2.0 * s)
        along += h * s * (1.0 - s) * ((1.0 - s) * v[0] - s * v[1])
        return np.outer(along, self._normal)


def _values(law: Sequence[Any], time: F64) -> F64:
    """A law in the form of the core at several times, (T,)."""
    form, data = law
    value = data if form == "constant" else {form: data}
    return np.array([value_at(value, float(t)) for t in time])


def meshes(
    points: Mapping[str, Any], triangles: Mapping[str, Any], shapes: Sequence[str]
) -> dict[int, Triangles]:
    """The meshes among the walls, by number, from their two tables. A `ValueError` says in which way these are none for the
    walls of these `shapes`.
    """
    wanted = {k for k, shape in enumerate(shapes) if shape == "mesh"}
    if not wanted:
        return {}
    if "wall" not in points or "wall" not in triangles:
        raise ValueError("a mesh has no points or no triangles")
    of_point, of_triangle = (np.asarray(table["wall"]) for table in (points, triangles))
    places = np.asarray(points["position"], dtype=np.float64)
    corners = np.asarray(triangles["corners"]).astype(np.int64)
    found = {
        int(k): Triangles(places[of_point == k], corners[of_triangle == k]) for k in np.unique(of_triangle)
    }
    if set(found) != wanted:
        raise ValueError("they are not those of the walls that are meshes")
    for mesh in found.values():
        if (
            mesh.corners.min() < 0
            or mesh.corners.max() >= len(mesh.vertices)
            or not np.isfinite(mesh.vertices).all()
        ):
            raise ValueError("a triangle names a point that is not there, or a point is not finite")
    return found


class Wall:
    """One wall of a result: `result.walls["drum"].torque` is (T, 3)."""

    def __init__(
        self,
        result: RunData,
        index: int,
        facts: Mapping[str, Any],
        mesh: Triangles | None = None,
        frames: slice | Array = slice(None),
    ) -> None:
        self._result, self._frames = result, frames
        self.mesh = mesh
        """Of a mesh its triangles where they are at the start: `vertices` (V, 3), m, and `corners` (T, 3)."""
        self.index = index
        """Number among all walls, planes first."""
        self.name = str(facts["name"])
        self.shape = str(facts.get("shape", "plane"))
        """ "plane", "rectangle", "disc", "cylinder", "sphere", "cone" or "mesh"."""
        self.facts = dict(facts)
        """The row of `result.planes` or of `/walls` of the file: point, axis, radius ..."""
        is_free = bool(str(facts.get("free", "")))
        try:
            self.motion = self._free_poses() if is_free else Poses(str(facts.get("motion", "")))
            self.motion.position(np.zeros(3), np.zeros(1)).reshape(1, 3)
        except (AttributeError, *DAMAGED) as error:
            table = "planes" if self.shape == "plane" else "walls"
            why = f"{quoted(self.name)}: {first_line(error)}"
            place = "/frames/free_walls" if is_free else f"/{table}/motion"
            raise result._segments.damage(place, why) from error

    def _free_poses(self) -> FreePoses:
        """Those of a free wall; free walls are the first ones."""
        column = np.asarray(self._result._segments.column("frames", "free_walls")[:, self.index])
        normal = np.asarray(self.facts["normal"], dtype=np.float64)
        return FreePoses(normal, np.asarray(self._result.time), column[:, 0], column[:, 1])

    def chosen(self, frames: Array) -> Wall:
        """The same wall with rows of some frames of the run only; what is since the last frame stays so."""
        return Wall(self._result, self.index, self.facts, self.mesh, frames)

    @property
    def is_free(self) -> bool:
        """Whether it moves along its normal by what presses it."""
        return isinstance(self.motion, FreePoses)

    @property
    def velocity(self) -> F64:
        """Velocity of a free wall along its normal, (T,), m/s."""
        if not self.is_free:
            raise CaromError(f"wall {quoted(self.name)} is not free; its motion is that of the scenario")
        column = self._result._segments.column("frames", "free_walls")
        return np.asarray(column[:, self.index, 1])[self._frames]

    @property
    def time(self) -> Any:
        """Times of the frames, (T,), s."""
        return self._result.time[self._frames]

    @cached_property
    def position(self) -> F64:
        """The wall's point, (T, 3), m: `point` of its table as the motion carries it; of a side of a box, its middle."""
        return self.motion.position(np.asarray(self.facts["point"], dtype=np.float64), np.asarray(self.time))

    @cached_property
    def orientation(self) -> F64:
        """Rotation since the start as unit quaternions, scalar part first, (T, 4)."""
        return self.motion.orientation(np.asarray(self.time))

    @cached_property
    def present(self) -> Bool:
        """Whether it is there, (T,): until the time at which it is taken away."""
        return self.motion.there(np.asarray(self.time))

    def gap(self, centre: F64, radius: F64, time: F64, part: I64 | None = None) -> F64:
        """Distance (K,), m, of balls with centres (K, 3) and radii (K,), m, from the wall as it is at the times (K,), s:
        infinite where it has been taken away. Of a mesh from the parts (K,) that contacts name, if given.
        """
        centre = self._at_start(centre, time)
        if self.mesh is not None and part is not None:
            found = self.mesh.at_part(centre, part, radius) - radius
        else:
            at_start: Any = SimpleNamespace(shape=self._shape(), point=np.asarray(self.facts["point"]))
            found = gaps(at_start, centre, radius)
        return np.where(self.motion.there(time), found, np.inf)

    def met(self, centre: F64, radius: F64, gap: float, time: float) -> I64:
        """Which of K balls are within `gap`, m, of the wall at a time, s: their rows, of a mesh as often as they meet it."""
        times = np.full(len(centre), time)
        if self.mesh is None or not self.motion.there(np.array(time)):
            return np.flatnonzero(self.gap(centre, radius, times) <= gap)
        return self.mesh.minima(self._at_start(centre, times), radius + gap)[0]

    def seen(self, most: int) -> F64:
        """Up to `most` places (K, 3), m, of balls in the course of the run, seen from the wall where it is at the start."""
        time = np.asarray(self._result.time)
        frames = np.unique(np.linspace(0, len(time) - 1, min(len(time), 8)).astype(np.int64))
        found = [np.zeros((0, 3))]
        for frame in frames[self.motion.there(time[frames])].tolist():
            centre = np.asarray(self._result.position[frame])
            centre = centre[np.isfinite(centre).all(axis=1)]
            centre = centre[:: len(centre) * len(frames) // most + 1]
            found.append(self._at_start(centre, np.full(len(centre), time[frame])))
        return np.concatenate(found)

    def _at_start(self, centre: F64, time: F64) -> F64:
        """Places (K, 3) at the times (K,), as seen from the wall, where it is at the start."""
        if not self.motion.moves:
            return centre
        point = np.asarray(self.facts["point"], dtype=np.float64)
        return point + rotated_back(self.motion.orientation(time), centre - self.motion.position(point, time))

    def _shape(self) -> tuple[Any, ...]:
        """Name and parameters, as the core has them."""
        if self.shape == "plane":
            return ("plane", self.facts["normal"])
        if self.mesh is not None:
            return (self.shape, self.mesh)
        blank = {"length": np.inf, "hole": 0.0}  # a tube without end, a disc without hole
        values = ((name, self.facts[name]) for name in PARAMETERS[self.shape])
        return self.shape, *(
            blank[name] if name in blank and np.isnan(value) else value for name, value in values
        )

    @property
    def impulse(self) -> F64:
        """Impulse of the balls on the wall since the last frame, (T, 3), N s."""
        return self._recorded()[:, :3]

    @property
    def angular_impulse(self) -> F64:
        """Its moment about the wall's point as it moves along, (T, 3), N m s."""
        return self._recorded()[:, 3:]

    @property
    def force(self) -> F64:
        """Mean force on the wall between this frame and the last, (T, 3), N; not a number at the first."""
        return self.impulse / self._intervals()

    @property
    def torque(self) -> F64:
        """Mean torque about the wall's point, (T, 3), N m; not a number at the first frame."""
        return self.angular_impulse / self._intervals()

    def _recorded(self) -> F64:
        segments = self._result._segments
        if "walls" not in segments.columns("frames"):
            raise CaromError(
                f"the forces on wall {quoted(self.name)} were not recorded;"
                " run again with `walls = true` in [record], or carom.simulate(..., walls=True)"
            )
        return np.asarray(segments.column("frames", "walls")[:, self.index])[self._frames]

    def _intervals(self) -> F64:
        """Time since the last frame of the run, (T, 1), s."""
        time = np.asarray(self._result.time)
        return np.diff(time, prepend=np.nan)[self._frames, np.newaxis]

    def __repr__(self) -> str:
        how = "free" if self.is_free else "moving" if self.motion.moves else "fixed"
        return f"<wall {self.name!r}: {how} {self.shape}, {len(self.time)} frames>"


class Walls(Named[Wall]):
    """All walls of a result by name, in the order of the core: planes without end first, meshes last."""

    what = "wall"

    def __init__(
        self,
        result: RunData,
        tables: Sequence[Mapping[str, Any]],
        meshes: Mapping[int, Triangles] | None = None,
    ) -> None:
        rows = [
            {key: values[i] for key, values in table.items()}
            for table in tables
            for i in range(len(table["name"]))
        ]
        super().__init__(
            {str(row["name"]): Wall(result, i, row, (meshes or {}).get(i)) for i, row in enumerate(rows)}
        )

    def chosen(self, frames: Array) -> Self:
        """The same walls with rows of some frames of the run only."""
        return self._with({name: wall.chosen(frames) for name, wall in self.items()})
