"""The tables of what pushes the bodies besides gravity and contact: `[[load]]`, `[[spring]]`, `[[drag]]`, and the
place of Python functions, `[[load_function]]`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import PrivateAttr, model_validator

from carom.arrays import F64
from carom.errors import CaromError, quoted
from carom.scene.tables.base import Table
from carom.scene.tables.fields import NOT_NEGATIVE, Pair, Quantity, refuse
from carom.scene.tables.laws import LawValue, LawVector
from carom.scene.tables.lists import Vector, Vectors
from carom.scene.tables.quantities import FARTHEST, ZEROS, Distance, Name, Vec3, key

GROUND = "ground"
"""In place of a sphere: what never moves."""
ALL = "all"
"""In place of a sphere: every one."""

LawVec3 = tuple[LawValue, LawValue, LawValue]
Ends = Annotated[tuple[str, str], Pair("sphere", '["a", "b"] or ["a", "ground"]')]
Points = Annotated[tuple[Vec3, Vec3], Vectors(Vector("length", most=FARTHEST), 2, 2)]


def check_ends(between: tuple[str, str]) -> None:
    """Refuse ends that nothing can join, whatever the spheres are."""
    if between[0] == between[1]:
        cause = f"{quoted(between[0])} stands on both sides"
        raise refuse(cause, 'name two spheres, or one and "ground"', ("between",))


def check_points(between: tuple[str, str], points: tuple[Vec3, Vec3] | None) -> None:
    """The ground has no centre to stand in for its point."""
    if GROUND in between and points is None:
        example = ", ".join(f"[point of {name}]" for name in between)
        raise refuse(
            "is missing: a point of the ground must be given", f"add points = [{example}]", ("points",)
        )


class Load(Table):
    """Force and torque on a sphere as functions of time."""

    section: ClassVar[str] = "load"

    on: Name = key("the sphere", examples=["a"])
    force: Annotated[LawVec3, LawVector("t", "force")] = key(
        "force at the centre, in fixed axes: numbers or laws of the time t",
        "N",
        default=ZEROS,
        examples=[[0.0, 0.0, {"expression": "20*t"}]],
    )
    torque: Annotated[LawVec3, LawVector("t", "moment")] = key(
        "torque, in fixed axes: numbers or laws of the time t", "N m", default=ZEROS
    )

    @model_validator(mode="after")
    def _acts(self) -> Self:
        if not {"force", "torque"} & self.model_fields_set:
            raise refuse("neither force nor torque is given", "add force = [0.0, 0.0, 1.0] (N)")
        return self

    def label(self) -> str:
        return f'scene.load("{self.on}")'


class Spring(Table):
    """A linear spring and damper between two points."""

    section: ClassVar[str] = "spring"

    between: Ends = key('two spheres, or one and "ground"', examples=[["a", "b"]])
    points: Points | None = key(
        "its ends at the start, in fixed axes; each is carried by its sphere; if omitted, the centres",
        "m",
        default=None,
    )
    stiffness: Annotated[float, Quantity("stiffness", NOT_NEGATIVE)] = key(
        "tension over elongation", "N/m", default=0.0, examples=[100.0]
    )
    damping: Annotated[float, Quantity("damping", NOT_NEGATIVE)] = key(
        "tension over speed of elongation", "N s/m", default=0.0, examples=[0.5]
    )
    rest_length: Distance | None = key(
        "length without tension; if omitted, that at the start", "m", default=None, examples=[1.0]
    )

    @model_validator(mode="after")
    def _acts(self) -> Self:
        check_ends(self.between)
        check_points(self.between, self.points)
        if self.stiffness == 0 and self.damping == 0:
            raise refuse(
                "stiffness and damping are both zero", "give one of them, as stiffness = 100.0 (N/m)"
            )
        return self

    def label(self) -> str:
        return f'scene.spring("{self.between[0]}", "{self.between[1]}")'


class Drag(Table):
    """Viscous drag: the force is `-translation v`, the torque `-rotation w`."""

    section: ClassVar[str] = "drag"

    on: Name = key('the sphere, or "all"', examples=["all"])
    translation: Annotated[float, Quantity("damping", NOT_NEGATIVE)] = key(
        "force over speed", "N s/m", default=0.0, examples=[0.1]
    )
    rotation: Annotated[float, Quantity("rotational damping", NOT_NEGATIVE)] = key(
        "torque over angular speed", "N m s", default=0.0, examples=[1e-4]
    )

    @model_validator(mode="after")
    def _acts(self) -> Self:
        if self.translation == 0 and self.rotation == 0:
            raise refuse("translation and rotation are both zero", "give one, as translation = 0.1 (N s/m)")
        return self

    def label(self) -> str:
        return f'scene.drag("{self.on}")'


class LoadFunction(Table):
    """The place of a Python function that gives loads.

    A file cannot hold the function: the copy of a scenario in a run directory has its name, so that the run is
    not continued or repeated without it.
    """

    section: ClassVar[str] = "load_function"

    name: Name = key("name of the function", examples=["wind"])
    _function: Callable[..., Any] | None = PrivateAttr(None)

    @property
    def function(self) -> Callable[..., Any] | None:
        """`f(t, position, velocity, angular_velocity) -> (N, 6)`; None after reading a file."""
        return self._function

    def label(self) -> str:
        return f"scene.load_function({self.name})"


class CheckedFunction:
    """A load function as the core calls it: what it returns is an array (N, 6) of finite doubles, or an error.

    It is known by its name alone, so that a run can be continued by another Python process.
    """

    def __init__(self, name: str, function: Callable[..., Any], bodies: int) -> None:
        self.name, self._function, self._shape = name, function, (bodies, 6)

    def __call__(self, t: float, position: Any, velocity: Any, angular_velocity: Any) -> F64:
        """Force (N) and torque (N m) of each body at time `t`, (N, 6), fixed axes."""
        given = self._function(t, position, velocity, angular_velocity)
        try:
            loads = np.ascontiguousarray(given)
            if loads.dtype.kind != "c":  # to which NumPy would do no more than warn
                loads = loads.astype(np.float64, copy=False)
        except (TypeError, ValueError):
            raise self._wrong(f"returned {quoted(type(given).__name__)}") from None
        if loads.dtype.kind == "c":
            raise self._wrong("returned complex numbers")
        if loads.shape != self._shape:
            raise self._wrong(f"returned an array of shape {loads.shape}")
        if not np.isfinite(loads).all():
            number = int(np.argmin(np.isfinite(loads).all(axis=1))) + 1
            raise self._wrong(
                f"returned a number that is not finite at t = {t:.6g} s for sphere number {number}"
            )
        return loads

    def _wrong(self, cause: str) -> CaromError:
        n, columns = self._shape
        cure = (
            f"return an array ({n}, {columns}) of finite numbers: force (N) and torque (N m) of each sphere"
        )
        return CaromError(f"load function {quoted(self.name)}: {cause}; {cure}")

    def __repr__(self) -> str:
        return f"load function {self.name}"
