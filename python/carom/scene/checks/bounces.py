"""Advice on bounces: laws that leave 0 to 1, and flat walls without loss, where weight within a step changes the energy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64
from carom.errors import quoted
from carom.scene.assembly.distances import gaps, normals
from carom.scene.assembly.placing import FLAT
from carom.scene.messages import Finding
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.laws import value_at

if TYPE_CHECKING:
    from carom.scene.assembly.placing import Placed
    from carom.scene.checks.rules import Whole
    from carom.scene.tables.model import Contact

UPRIGHT = 1e-9
"""Share of the weight along the normal of a wall from which on that is no rounding."""
SPEEDS = 200
"""Approach speeds at which laws of restitution are looked at."""


def advise_bounces(parts: Whole) -> Iterator[Finding]:
    """Where the law of a contact leaves 0 to 1; a ball that bounces by e_N = 1 on a floor, or a ceiling that it flies to."""
    for i, law in parts.contacts():
        path, fastest, does = ("contact", i, "restitution"), _fastest(parts, law), ""
        for wall in parts.walls():
            a, b = law.between
            if wall.kind not in FLAT or wall.material not in (a, b):
                continue
            away, speed = _arrivals(parts, wall, b if a == wall.material else a)
            fastest = max(fastest, speed.max(initial=0.0))
            elastic = [value_at(law.restitution, v) == 1 for v in speed.tolist()]
            if not does and (does := _by_weight(parts, away[elastic])):
                cause = f"e_N = 1 on plane {quoted(wall.name)} against gravity"
                cause += f": each bounce {does} energy of the order of the step"
                cure = "use a shorter step if heights of many bounces matter"
                yield Finding(path, cause, cure)
        for v in np.linspace(0.0, fastest, SPEEDS + 1).tolist() if isinstance(law.restitution, dict) else ():
            e = value_at(law.restitution, v)
            if not 0 <= e <= 1:
                cause = f"the coefficient is {e:.4g} at an approach of {v:.4g} m/s"
                yield Finding(
                    path, cause, "write max(0, min(1, ...)), or a table: its points lie from 0 to 1"
                )
                break


def _fastest(parts: Whole, law: Contact) -> float:
    """The largest approach speed of two balls, or a ball and a wall, of these materials as they start."""
    bodies, names = parts.bodies(), parts.materials()
    speed = np.linalg.norm(bodies.velocity, axis=1) * bodies.present
    a, b = (np.sort(speed[bodies.material == names.index(name)]) for name in law.between)
    return float(a[-2:].sum() if law.between[0] == law.between[1] else a[-1:].sum() + b[-1:].sum())


def _arrivals(parts: Whole, wall: Placed, material: str) -> tuple[F64, F64]:
    """The weight along its normal, m/s^2, and the speed there, of balls of a material that weight or flight brings to a
    flat wall.
    """
    bodies, gravity = parts.bodies(), np.array(parts.world.gravity)
    balls = np.flatnonzero(bodies.present & (bodies.material == parts.materials().index(material)))
    position = bodies.position[balls]
    normal = normals(wall, position)
    away, speed = normal @ gravity, -np.einsum("ni,ni->n", bodies.velocity[balls], normal)
    left = speed**2 - 2.0 * away * np.maximum(0.0, gaps(wall, position, bodies.radius[balls]))
    there = np.sqrt(np.maximum(0.0, left))
    comes = (np.abs(away) > UPRIGHT * np.linalg.norm(gravity)) & (left >= 0) & ((away < 0) | (speed > 0))
    comes &= np.abs(speed - there) <= parts.until * np.abs(away)
    return away[comes], there[comes]


def _by_weight(parts: Whole, away: F64) -> str:
    """What bounces with these weights along the normal do to the energy; "" where the step changes none."""
    run = parts.run.options()
    if run["method"] != "moreau" and (away < 0).any():
        return "loses"
    if not (away > 0).any():
        return ""
    if LAWS[run["impact"]].restitution != "printed":
        return "loses"
    return "" if run["method"] == "moreau" else "gains"
