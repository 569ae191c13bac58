"""`Frames`: what follows from the motion alone, of a whole result or of a part of one (`carom.result.selection`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carom.arrays import F64, I64
from carom.errors import among, extra
from carom.numeric import is_whole
from carom.result.names import UnknownName
from carom.result.tables import Impacts

if TYPE_CHECKING:
    import pandas
    import xarray

    from carom.result.clumps import Clump

A = TypeVar("A")
"""An array, or a column that acts as one."""

QUANTITIES = {
    "position": ("xyz", "m"),
    "orientation": ("wxyz", "1"),
    "velocity": ("xyz", "m/s"),
    "angular_velocity": ("xyz", "rad/s"),
}
"""Components and units."""


class Part(NamedTuple):
    """Balls that are parts of one clump, and how it moves; each has a share of what the clump has."""

    balls: I64
    share: F64
    """Of each ball, (n,)."""
    position: F64
    """Of the centre of mass, (T, 3), m."""
    velocity: F64
    angular_momentum: F64
    """About the centre of mass, (T, 3), N m s."""
    rotational_energy: F64
    """(T,), J."""

    @classmethod
    def of(cls, clump: Clump, mass: F64) -> Self:
        """All balls of a clump; `mass` (N,) is that of all balls of the run."""
        own = mass[clump.numbers]
        motion = clump.position, clump.velocity, clump.angular_momentum, clump.rotational_energy
        return cls(clump.numbers, own / own.sum(), *motion)

    def chosen(self, frames: NDArray[np.intp], bodies: NDArray[np.intp]) -> Self:
        """Those among some balls of the run in some frames; their numbers are then those among the balls."""
        place, at = np.nonzero(bodies[:, None] == self.balls[None])
        return type(self)(place, self.share[at], *(values[frames] for values in self[2:]))


class Motion(Generic[A]):
    """How balls move. Arrays are (T, N, ...), T times and N balls: of one ball they have no N, of one time no T."""

    @property
    def position(self) -> A:
        """Centres, (T, N, 3), m."""
        return self._quantity("position")

    @property
    def orientation(self) -> A:
        """Unit quaternions, scalar part first, (T, N, 4): body frame to world frame."""
        return self._quantity("orientation")

    @property
    def velocity(self) -> A:
        """Velocities of the centres, (T, N, 3), m/s."""
        return self._quantity("velocity")

    @property
    def angular_velocity(self) -> A:
        """Angular velocities in the world frame, (T, N, 3), rad/s."""
        return self._quantity("angular_velocity")

    @property
    def present(self) -> A:
        """Which balls are there, (T, N): all, unless the scene has inflows or outlets."""
        return self._quantity("present")

    def _quantity(self, name: str) -> A:
        raise NotImplementedError


class Frames(Motion[A]):
    """T frames of N balls, and what follows from them: momentum, energy by ball, tables for other programs."""

    # Given by those who derive from this; `Any` is an array, or a column that acts as one.
    time: Any
    step: Any
    bodies: Any
    impacts: Any
    gravity: Any
    title: Any
    versions: Any

    @property
    def names(self) -> list[str]:
        """Names of the bodies, in the order of the second axis of all arrays."""
        return list(self.bodies["name"])

    @property
    def momentum(self) -> F64:
        """Momentum of all balls together, (T, 3), N s."""
        return np.asarray(np.einsum("n,tni->ti", self._mass(), self._carried("velocity")))

    @property
    def angular_momentum(self) -> F64:
        """Angular momentum of all balls about the origin, orbital and of their spin, (T, 3), N m s."""
        return self.angular_momentum_about((0.0, 0.0, 0.0))

    def angular_momentum_about(self, point: ArrayLike) -> F64:
        """The same about another fixed point (3,), m."""
        arm = self._carried("position") - np.asarray(point, dtype=np.float64)
        orbit = np.cross(arm, self._mass()[:, np.newaxis] * self._carried("velocity"))
        spin = np.asarray(self.bodies["inertia"])[:, np.newaxis] * self._of_present("angular_velocity")
        for part in self._parts():
            spin[:, part.balls] = part.share[:, np.newaxis] * part.angular_momentum[:, np.newaxis]
        return np.asarray((orbit + spin).sum(axis=1))

    @property
    def kinetic_energy(self) -> F64:
        """Of each ball, translation and rotation, (T, N), J; a ball of a clump has its share of the clump's, by mass."""
        v, w = self._carried("velocity"), self._of_present("angular_velocity")
        spin = np.asarray(self.bodies["inertia"]) * (w**2).sum(axis=2)
        for part in self._parts():
            spin[:, part.balls] = 2.0 * part.share * part.rotational_energy[:, np.newaxis]
        return np.asarray(0.5 * (self._mass() * (v**2).sum(axis=2) + spin))

    @property
    def potential_energy(self) -> F64:
        """Of each ball in gravity, 0 at the origin, (T, N), J."""
        height = np.einsum("tni,i->tn", self._carried("position"), np.asarray(self.gravity))
        return np.asarray(-self._mass() * height)

    def to_xarray(self) -> xarray.Dataset:
        """Motion as an `xarray.Dataset` with dimensions time, body, axis (and quaternion)."""
        package = extra("xarray", "to_xarray needs xarray", "interop")
        data = {
            name: (
                ("time", "body", "quaternion" if len(letters) == 4 else "axis"),
                np.asarray(getattr(self, name)),
                {"units": unit},
            )
            for name, (letters, unit) in QUANTITIES.items()
        }
        coordinates = {
            "time": ("time", np.asarray(self.time), {"units": "s"}),
            "body": self.names,
            "axis": list("xyz"),
            "quaternion": list("wxyz"),
            "radius": ("body", self.bodies["radius"], {"units": "m"}),
            "mass": ("body", self.bodies["mass"], {"units": "kg"}),
        }
        found: xarray.Dataset = package.Dataset(data, coordinates, {"title": self.title, **self.versions})
        return found

    def to_pandas(self) -> pandas.DataFrame:
        """Motion as a `pandas.DataFrame`, one row per frame and body (index time, body); tables have a `to_pandas` too."""
        pandas = extra("pandas", "to_pandas needs pandas", "interop")
        index = pandas.MultiIndex.from_product([np.asarray(self.time), self.names], names=["time", "body"])
        columns: dict[str, F64] = {}
        for name, (letters, _) in QUANTITIES.items():
            values = np.asarray(getattr(self, name)).reshape(len(index), len(letters))
            columns |= {f"{name}_{letter}": values[:, i] for i, letter in enumerate(letters)}
        return pandas.DataFrame(columns, index=index)

    def _table_number(self, index: int) -> int:
        """The number that a body has in tables, from its place in the arrays."""
        return index

    def __getitem__(self, name: str) -> Body:
        return Body.of(self, name)

    def __iter__(self) -> Any:
        # Without this, `for body in result` would try result[0], result[1], ... by the old protocol.
        return (Body(self, i) for i in range(len(self.names)))

    def _of_ball(self, name: str, index: int) -> Any:
        return self.bodies[name][index] if name in self.bodies else getattr(self, name)[:, index]

    def _mass(self) -> F64:
        return np.asarray(self.bodies["mass"])

    def _parts(self) -> list[Part]:
        """Balls that are parts of clumps."""
        return []

    def _carried(self, quantity: str) -> F64:
        """Position or velocity (T, N, 3) for momentum and energy: of a ball of a clump that of the centre of mass."""
        found = np.array(getattr(self, quantity))
        for part in self._parts():
            found[:, part.balls] = getattr(part, quantity)[:, np.newaxis]
        return self._there(found)

    def _of_present(self, quantity: str) -> F64:
        """A quantity (T, N, 3), 0 for balls that are absent."""
        return self._there(np.asarray(getattr(self, quantity)))

    def _there(self, values: F64) -> F64:
        return np.where(np.asarray(self.present)[:, :, np.newaxis], values, 0.0)


class Body(Motion[F64]):
    """One ball: `result["cue"].velocity` is (T, 3), `batch["cue"].velocity` (B, 3), `view["cue"].velocity` (3,).

    Below, T is the axis of what it is a ball of: frames, cases, or none.
    """

    def __init__(self, whole: Any, index: int) -> None:
        self._whole, self.index, self.name = whole, index, whole.names[index]

    @classmethod
    def of(cls, whole: Any, name: str) -> Body:
        """The ball that is called so."""
        names = list(whole.names)
        if name not in names:
            clumps = getattr(whole, "clumps", None)  # of a view an array
            is_clump = isinstance(clumps, Mapping) and name in clumps
            cure = f"it is a clump: take clumps[{name!r}]" if is_clump else among(str(name), names)
            if is_whole(name) and hasattr(whole, "sel"):
                cure = (
                    f"a number is for sel(body={int(name)}), frames for arrays: result.position[{int(name)}]"
                )
            raise UnknownName(f"no body is called {name!r}; {cure}")
        return cls(whole, names.index(name))

    @property
    def time(self) -> Any:
        """Times, (T,), s."""
        return self._whole.time

    @property
    def speed(self) -> Any:
        """Speed of the centre, (T,), m/s."""
        return np.linalg.norm(self.velocity, axis=-1)

    @property
    def radius(self) -> float:
        """Radius, m."""
        return float(self._quantity("radius"))

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return float(self._quantity("mass"))

    @property
    def inertia(self) -> float:
        """Moment of inertia about any diameter, kg m^2."""
        return float(self._quantity("inertia"))

    @property
    def impacts(self) -> Impacts:
        """The impacts that a ball of a result took part in."""
        impacts: Impacts = self._whole.impacts
        number = self._whole._table_number(self.index)
        return impacts.where((np.asarray(impacts["body"]) == number).any(axis=1))

    def _quantity(self, name: str) -> F64:
        found: F64 = self._whole._of_ball(name, self.index)
        return found

    def __repr__(self) -> str:
        if not isinstance(self._whole, Frames):
            return f"<body {self.name!r} of {self._whole!r}>"
        return (
            f"<body {self.name!r}: radius {self.radius:g} m, mass {self.mass:g} kg, {len(self.time)} frames>"
        )
