"""The table `[[clump]]`: a rigid body made of spheres that overlap, touch, or stand apart.

Mass, centre of mass and inertia are those of the homogeneous union of the spheres, unless they are given.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from carom.arrays import F64
from carom.scene.assembly.principal import Six, Vec3, fault, principal, six
from carom.scene.assembly.rotations import product, rotated
from carom.scene.assembly.union import union
from carom.scene.assembly.vectors import scaled, unit
from carom.scene.tables.base import Table
from carom.scene.tables.fields import exactly_one, refuse
from carom.scene.tables.lists import BallPlace, Quaternion, Tensor, Vectors
from carom.scene.tables.quantities import (
    FARTHEST,
    ZEROS,
    AngularVelocity,
    Density,
    Mass,
    Name,
    Position,
    Velocity,
    key,
)

MOST_SPHERES = 500
"""Spheres of one clump at most: the properties of 200 that all overlap take 3 s, and the time grows with the cube."""

Spheres = Annotated[
    tuple[tuple[float, float, float, float], ...], Vectors(BallPlace(most=FARTHEST), 1, MOST_SPHERES)
]
"""Centres and radii of the balls of a clump."""
ROD = [[-0.01, 0.0, 0.0, 0.01], [0.01, 0.0, 0.0, 0.01]]


@dataclass(frozen=True)
class Rigid:
    """A rigid body in its own axes."""

    mass: float
    """kg."""
    centre: Vec3
    """Centre of mass, m."""
    inertia: Six
    """Jxx, Jyy, Jzz, Jxy, Jxz, Jyz about the centre of mass, kg m^2."""
    moments: Vec3
    """Principal moments, kg m^2."""
    axes: tuple[float, float, float, float]
    """Unit quaternion, w first, of the principal axes in the own ones."""


class Clump(Table):
    """A rigid body whose surface is that of its spheres: `name = "rod"` makes rod1, rod2, ..."""

    section: ClassVar[str] = "clump"

    name: Name = key(
        "name, unique among balls, clumps and walls; its balls have it with a number, from 1",
        examples=["rod"],
    )
    material: Name = key("name of its material", examples=["steel"])
    spheres: Spheres = key(
        "centres and radii [x, y, z, radius] in own axes; they may overlap",
        "m",
        examples=[ROD],
    )
    mass: Mass | None = key("mass (or give density)", "kg", default=None, examples=[0.05, "50 g"])
    density: Density | None = key("density, instead of mass", "kg/m^3", default=None, examples=[7800.0])
    inertia: Annotated[tuple[float, ...], Tensor()] | None = key(
        "about the centre of mass, in own axes: [J1, J2, J3], or [Jxx, Jyy, Jzz, Jxy, Jxz, Jyz];"
        " if omitted, that of the homogeneous body",
        "kg m^2",
        default=None,
        examples=[[1e-5, 2e-5, 2e-5]],
    )
    centre: Position | None = key(
        "centre of mass in own axes, only with inertia; if omitted, that of the homogeneous body",
        "m",
        default=None,
        examples=[[0.0, 0.0, 0.0]],
    )
    position: Position = key(
        "where the origin of the own axes is at the start", "m", examples=[[0.0, 0.0, 0.05]]
    )
    orientation: Annotated[tuple[float, float, float, float], Quaternion()] = key(
        "unit quaternion [w, x, y, z], own to fixed axes, at the start", default=(1.0, 0.0, 0.0, 0.0)
    )
    velocity: Velocity = key("velocity of the centre of mass at the start", "m/s", default=ZEROS)
    angular_velocity: AngularVelocity = key(
        "angular velocity at the start, in fixed axes", "rad/s", default=ZEROS
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        exactly_one(self.__dict__, "mass", "density")
        if self.centre is not None and self.inertia is None:
            cause = "centre is given without inertia: with another centre of mass the body is not homogeneous"
            raise refuse(cause, "add inertia, or leave centre out", ("centre",))
        if self.inertia is not None:
            why = fault(principal(_six(self.inertia))[0])
            if why:
                cause = f"no body has this tensor of inertia: {why}"
                cure = "check the order [Jxx, Jyy, Jzz, Jxy, Jxz, Jyz] and the signs: Jxy is minus the integral of x y"
                raise refuse(cause, cure, ("inertia",))
        return self

    def size(self) -> int:
        """Number of balls."""
        return len(self.spheres)

    def ball_names(self) -> list[str]:
        return [f"{self.name}{k}" for k in range(1, len(self.spheres) + 1)]

    def body(self) -> Rigid:
        """Mass, centre of mass and inertia."""
        return _rigid(self.spheres, self.mass, self.density, self.inertia, self.centre)

    def resolved(self) -> Clump:
        """The same with mass, inertia and centre of mass written down."""
        body = self.body()
        inertia = self.inertia or body.inertia
        return self.model_copy(
            update={"mass": body.mass, "density": None, "inertia": inertia, "centre": body.centre}
        )

    def placed(self, centre: F64, orientation: F64) -> Clump:
        """The same with its centre of mass at `centre` (3,), m, and its own axes turned by `orientation` (4,)."""
        arm = rotated(orientation, np.array(self.body().centre))
        return self.model_copy(
            update={"position": tuple((centre - arm).tolist()), "orientation": tuple(orientation.tolist())}
        )

    def called(self, name: str, number: int) -> Clump:
        """The same as one of many: `name = "rod"` makes rod1-, rod2-, ..., with balls rod1-1, rod1-2, ..."""
        return self.model_copy(update={"name": f"{name}{number}-"})

    def turn(self) -> F64:
        """Unit quaternion (4,), w first, from own to fixed axes at the start."""
        return np.array(unit(self.orientation))

    def middle(self) -> F64:
        """Centre of mass at the start, (3,), m."""
        return np.array(self.position) + rotated(self.turn(), np.array(self.body().centre))

    def centres(self) -> F64:
        """Centres of its balls at the start, (n, 3), m."""
        return np.array(self.position) + rotated(self.turn(), np.array(self.spheres)[:, :3])

    def velocities(self) -> F64:
        """Velocities of its balls at the start, (n, 3), m/s."""
        with np.errstate(all="ignore"):
            arms = self.centres() - self.middle()
            return np.asarray(np.array(self.velocity) + np.cross(self.angular_velocity, arms))

    def reach(self) -> float:
        """How far its balls reach from its centre of mass, m."""
        away = np.linalg.norm(np.array(self.spheres)[:, :3] - self.body().centre, axis=1)
        return float((away + self.radii()).max())

    def radii(self) -> F64:
        """Radii of its balls, (n,), m."""
        return np.array(self.spheres)[:, 3]

    def masses(self) -> F64:
        """The mass of the clump shared among its balls by their volumes, (n,), kg."""
        own = (self.radii() / self.radii().max()) ** 3
        return np.asarray(self.body().mass * (own / own.sum()))

    def inertias(self) -> F64:
        """Moments of inertia of such balls if they were alone, (n,), kg m^2: the core takes that of the clump."""
        with np.errstate(all="ignore"):  # absurd sizes are reported by the checks
            return 0.4 * self.masses() * self.radii() ** 2

    def for_core(self, first: int) -> dict[str, Any]:
        """What the core takes of a clump whose first ball is number `first`."""
        body = self.body()
        return {
            "balls": (first, first + len(self.spheres)),
            "mass": body.mass,
            "inertia": list(body.moments),
            "position": self.middle().tolist(),
            "orientation": list(scaled(product(self.turn(), body.axes).tolist())),
            "velocity": list(self.velocity),
            "angular_velocity": list(self.angular_velocity),
        }


def _six(inertia: tuple[float, ...]) -> Six:
    a, b, c, *products = inertia
    d, e, f = products or (0.0, 0.0, 0.0)
    return a, b, c, d, e, f


@lru_cache(maxsize=1 << 17)
def _rigid(
    spheres: tuple[tuple[float, float, float, float], ...],
    mass: float | None,
    density: float | None,
    inertia: tuple[float, ...] | None,
    centre: Vec3 | None,
) -> Rigid:
    if mass is None:
        assert density is not None  # by the table
        with np.errstate(all="ignore"):
            mass = float(np.float64(density) * union(spheres).volume)
    if centre is None:
        x, y, z = union(spheres).centre.tolist()
        centre = (x, y, z)
    tensor = six(union(spheres).inertia(mass)) if inertia is None else _six(inertia)
    moments, axes = principal(tensor)
    return Rigid(mass, centre, tensor, moments, axes)
