"""Advice on bounces without loss on flat walls, of which the weight within a step changes the energy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import quoted
from carom.scene.assembly.distances import gaps, normals
from carom.scene.assembly.placing import FLAT
from carom.scene.messages import Finding
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.laws import value_at

if TYPE_CHECKING:
    from carom.scene.assembly.placing import Placed
    from carom.scene.checks.rules import Whole

UPRIGHT = 1e-9
"""Share of the weight along the normal of a wall from which on that is no rounding."""


def advise_bounces(parts: Whole) -> Iterator[Finding]:
    """One for each contact law with e_N = 1 by which a ball bounces on a floor, or on a ceiling that it flies to."""
    for i, law in parts.contacts():
        if value_at(law.restitution, 0.0) < 1:
            continue
        for wall in parts.walls():
            a, b = law.between
            if wall.kind not in FLAT or wall.material not in (a, b):
                continue
            if does := _by_weight(parts, wall, b if a == wall.material else a):
                cause = f"e_N = 1 on plane {quoted(wall.name)} against gravity"
                cause += f": each bounce {does} energy of the order of the step"
                cure = "use a shorter step if heights of many bounces matter"
                yield Finding(("contact", i, "restitution"), cause, cure)
                break


def _by_weight(parts: Whole, wall: Placed, material: str) -> str:
    """What bounces of the balls of a material on a flat wall do to the energy; "" where the step changes none."""
    bodies, run, gravity = parts.bodies(), parts.run.options(), np.array(parts.world.gravity)
    balls = np.flatnonzero(bodies.material == parts.materials().index(material))
    position, velocity = bodies.position[balls], bodies.velocity[balls]
    normal = normals(wall, position)
    away, slight = normal @ gravity, UPRIGHT * np.linalg.norm(gravity)
    if run["method"] != "moreau" and (away < -slight).any():
        return "loses"
    speed = -np.einsum("ni,ni->n", velocity, normal)
    left = speed**2 - 2.0 * away * np.maximum(0.0, gaps(wall, position, bodies.radius[balls]))
    flies = bodies.present[balls] & (away > slight) & (speed > 0) & (left > 0)
    if not (speed[flies] - np.sqrt(left[flies]) <= parts.until * away[flies]).any():
        return ""
    if LAWS[run["impact"]].restitution != "printed":
        return "loses"
    return "" if run["method"] == "moreau" else "gains"
