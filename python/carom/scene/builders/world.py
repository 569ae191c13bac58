"""`Deformer`: the call of a `carom.Scene` that lets its periodic box deform."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from carom.scene.arguments import explained
from carom.scene.builders.balls import Builder, make
from carom.scene.tables.deformation import Deformation

Law = float | str | Mapping[str, Any]
"""A number, a formula of the time `t`, or a law as `{"table": [[0.0, 1.0], [2.0, 0.9]]}`."""


class Deformer(Builder):
    """A periodic box that changes its size or is sheared; `carom.Scene` is one."""

    @explained
    def deform(
        self,
        *,
        stretch: Sequence[Law] | None = None,
        shear: Law | None = None,
        flow: str | None = None,
        gradient: str | None = None,
    ) -> Deformation:
        """Let the periodic box deform: `stretch` its lengths, or `shear` it (Lees-Edwards boundaries).

        `stretch` are three numbers or laws of the time, factors on the lengths in `periodic`, 1 at t = 0; a text is a
        formula: `stretch=(1, 1, "exp(-0.1*t)")`. `shear` is the same of the shear strain, 0 at t = 0: planes across the
        axis `gradient` move along the axis `flow`, as `shear="2*t", flow="x", gradient="z"`. The centre of the box stays.
        Velocities of balls in the scene are against the mean flow; those that are recorded are not.
        """
        deformation = make(
            Deformation,
            "Scene.deform",
            stretch=stretch,
            shear=shear,
            flow=flow,
            gradient=gradient,
        )
        self._tree.world.deformation = deformation
        return deformation
