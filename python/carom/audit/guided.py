"""Free walls: planes with a mass, bodies of the auditor behind the balls, which a guide lets move along their normals alone.

The scheme moves a wall along its normal `n` as it moves a ball. Gravity acts on it as `(g n) n` or not at all, its force as
any force that depends on the time, and an impulse of a contact with its normal part. Results keep its displacement and its
velocity in `frames/free_walls`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64, I64
from carom.audit.formula import law

HELD = 1e30
"""Moment of inertia that stands for the guide, kg m^2: nothing turns a free wall. Smaller: moments of contacts would."""


@dataclass(frozen=True)
class FreeWall:
    """One of them, as the scenario gives it."""

    normal: F64
    point: F64
    """Where it is at the start, m."""
    mass: float
    velocity: float
    """Along the normal at the start, m/s."""
    weighs: bool
    force: Any
    """Along the normal, N, a law of time; with an area Pa."""
    material: int
    area: tuple[Any, ...] = ()
    """Sides of the area on which a pressure acts, which go with periods and planes."""

    def fall(self, gravity: F64) -> F64:
        """What gravity does to it, (3,), m/s^2."""
        return float(gravity @ self.normal) * self.normal if self.weighs else np.zeros(3)

    def load(self, body: int, series: tuple[F64, F64]) -> list[dict[str, Any]]:
        """Its force as a load on a body; none where there is no force. `series` are times, s, and the areas there, m^2."""
        kind, value = self.force
        if kind == "constant" and float(value) == 0.0:
            return []
        along: list[Any] = [("times", (float(share), self.force)) for share in self.normal]
        if self.area:
            along = [("pressure", (float(share), self.force, *series)) for share in self.normal]
        return [{"kind": "force", "body": body, "force": along, "torque": [("constant", 0.0)] * 3}]

    def meet(self, x: F64, moved: F64, radius: F64) -> tuple[F64, F64]:
        """Gap (K,), m, and normal (K, 3) of balls at the places `x` (K, 3), where the wall is moved by `moved` (K, 3)."""
        gap = (x - moved - self.point) @ self.normal - radius
        return gap, np.broadcast_to(self.normal, x.shape)


def of_model(model: Mapping[str, Any]) -> list[FreeWall]:
    """Those of a model: the first ones of its planes."""
    found = []
    for given in model.get("free_walls", ()):
        w = int(given["wall"])
        normal, point = (
            np.asarray(model[f"plane_{name}"][w], dtype=np.float64) for name in ("normal", "point")
        )
        found.append(
            FreeWall(
                normal,
                point,
                float(given["mass"]),
                float(given["velocity"]),
                bool(given["weighs"]),
                given["force"],
                int(model["plane_material"][w]),
                tuple(given.get("area", ())),
            )
        )
    return found


def areas(
    model: Mapping[str, Any], wall: FreeWall, time: F64, frame_time: F64, moved_by: F64
) -> tuple[F64, F64]:
    """The area on which the pressure of a wall acts, m^2, at the times of the grid (S + 1,), s: free planes are where they
    were a step before and would be with their velocity of then, others where they are. `moved_by` (F, walls, 2) are
    displacements and velocities at the times of the frames.
    """
    product = np.ones(len(time))
    before = np.concatenate([time[:1], time[:-1]])
    moved = dict(model.get("wall_motion", ()))

    def place(plane: int) -> F64:
        """(S + 1, 3)"""
        at = np.tile(np.asarray(model["plane_point"][plane], dtype=np.float64), (len(time), 1))
        if plane < moved_by.shape[1]:
            way, speed = (np.interp(before, frame_time, moved_by[:, plane, k]) for k in (0, 1))
            way = way + (time - before) * speed
            at += way[:, None] * np.asarray(model["plane_normal"][plane], dtype=np.float64)
        elif plane in moved and moved[plane]["translation"] is not None:
            at += np.stack([law(form, time)[0] for form in moved[plane]["translation"]], axis=1)
        return at

    for kind, *of in wall.area:
        if kind == "period":
            stretch = (model.get("deformation") or {}).get("stretch", (None, None, None))[of[0]]
            product *= float(model["periodic"][of[0]]) * (1.0 if stretch is None else law(stretch, time)[0])
        else:
            across = (place(of[1]) - place(of[0])) @ np.asarray(model["plane_normal"][of[0]])
            product *= np.maximum(across, 0.0)
    return time, product


def taken(walls: list[FreeWall], balls: int, b: I64, given: F64) -> F64:
    """What bodies `b` (K,) take of impulses (K, 3) that are given to them: free walls the part along their normals."""
    found = np.array(given, dtype=np.float64)
    for w, wall in enumerate(walls):
        rows = np.flatnonzero(b == balls + w)
        found[rows] = np.outer(given[rows] @ wall.normal, wall.normal)
    return found
