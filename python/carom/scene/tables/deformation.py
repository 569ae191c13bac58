"""The key `deformation` of `[world]`: how a periodic box changes its size, or is sheared (Lees-Edwards)."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from carom.arrays import F64
from carom.scene.tables.base import Table
from carom.scene.tables.fields import POSITIVE, Choice, refuse
from carom.scene.tables.laws import Law, LawValue, LawVector, as_core, value_at
from carom.scene.tables.loads import LawVec3
from carom.scene.tables.quantities import key

AXES = ("x", "y", "z")


class Deformation(Table):
    """How a periodic box deforms: its vectors are those at the start times F = diag(stretch) + shear along flow."""

    section: ClassVar[str] = "deformation"

    stretch: Annotated[LawVec3, LawVector("t", "number", POSITIVE)] | None = key(
        "lengths along x, y, z over those at the start: numbers or laws of the time t that are 1 at the start",
        default=None,
        examples=[[1.0, 1.0, {"expression": "exp(-0.1*t)"}]],
    )
    shear: Annotated[LawValue, Law("t")] | None = key(
        "shear strain: a law of the time t that is 0 at the start. Images one up along gradient are displaced by it times"
        " the length along gradient at the start",
        default=None,
        examples=[{"polynomial": [0.0, 2.0]}],
    )
    flow: Annotated[str, Choice(AXES)] | None = key(
        "axis along which shear displaces", default=None, examples=["x"]
    )
    gradient: Annotated[str, Choice(AXES)] | None = key(
        "axis across which it does", default=None, examples=["z"]
    )

    @model_validator(mode="after")
    def _deforms(self) -> Self:
        if self.stretch is None and self.shear is None:
            cure = "give stretch, or shear with flow and gradient, or leave deformation out"
            raise refuse("neither stretch nor shear is given", cure)
        for name in ("flow", "gradient"):
            if self.shear is not None and getattr(self, name) is None:
                raise refuse(
                    f"shear is given without {name}",
                    'write for example flow = "x", gradient = "z"',
                    ("shear",),
                )
            if self.shear is None and getattr(self, name) is not None:
                raise refuse(f"{name} is given without shear", f"add shear, or remove {name}", (name,))
        if self.shear is not None and self.flow == self.gradient:
            cure = "give two different axes: planes across gradient move along flow"
            raise refuse(f'flow and gradient are both "{self.flow}"', cure, ("gradient",))
        for k, law in enumerate(self.stretch or ()):
            _starts_at(law, 1.0, ("stretch", k))
        if self.shear is not None:
            _starts_at(self.shear, 0.0, ("shear",))
        return self

    def axes(self) -> tuple[int, int]:
        """Numbers of flow and gradient."""
        return AXES.index(self.flow or "x"), AXES.index(self.gradient or "y")

    def gradient_at(self, time: float) -> F64:
        """F, the deformation gradient at a time, (3, 3)."""
        stretch, shear = (self.stretch or (1.0, 1.0, 1.0)), self.shear or 0.0
        return self._matrix([value_at(law, time) for law in stretch], value_at(shear, time))

    def velocity_gradient(self, time: float, step: float) -> F64:
        """G = dF/dt F^-1, (3, 3), 1/s, in the step (s) of the run that begins at a time: rates are constant in each. At the
        end of a law it is that of the step before.
        """
        rate = (self.gradient_at(time + step) - self.gradient_at(time)) / step
        if not np.isfinite(rate).all():
            rate = (self.gradient_at(time) - self.gradient_at(time - step)) / step
        return np.asarray(rate @ np.linalg.inv(self.gradient_at(time)))

    def _matrix(self, diagonal: list[float], beside: float) -> F64:
        found = np.diag(np.array(diagonal, dtype=np.float64))
        if self.shear is not None:
            found[self.axes()] = beside
        return found

    def for_core(self) -> dict[str, Any]:
        """What the core takes: laws, None where nothing changes; nothing at all where nothing does."""
        stretch = tuple(as_core(law) if isinstance(law, dict) else None for law in self.stretch or (1.0,) * 3)
        shear = as_core(self.shear) if isinstance(self.shear, dict) else None
        if shear is None and stretch == (None, None, None):
            return {}
        flow, gradient = self.axes()
        return {"stretch": stretch, "shear": shear, "flow": flow, "gradient": gradient}

    def label(self) -> str:
        return "deformation"


def _starts_at(law: LawValue, wanted: float, part: tuple[str | int, ...]) -> None:
    """The box at the start is the one that `periodic` gives; a law with another start would hide it."""
    start = value_at(law, 0.0)
    if math.isfinite(start) and start != wanted:
        constant = not isinstance(law, dict)
        cure = (
            f'write a law of the time: "{"1 - 0.1*t" if wanted else "2*t"}"'
            if constant
            else f"{'divide by' if wanted else 'subtract'} its first value, or give other lengths in periodic"
        )
        raise refuse(f"must be {wanted:g} at t = 0, found {start!r}", cure, part)
