"""Rules about clumps: what is computed together with them, and what their numbers may be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import quoted
from carom.scene.assembly.mechanics import MECHANICS
from carom.scene.checks.deformation import least_lengths
from carom.scene.messages import Finding
from carom.scene.tables.clumps import Clump
from carom.scene.tables.flow import Inflow
from carom.scene.tables.impact_laws import LAWS

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts

LEAVE_OUT = {
    "joint": "joints do",
    "load": "loads do",
    "spring": "springs do",
    "drag": "drag does",
    "load_function": "Python functions do",
}
"""What does not act in a scene with clumps yet, by section."""
MOMENTS = (1e-90, 1e90)
"""Moments of inertia between these, kg m^2, as of spheres."""


def shapes(parts: Parts) -> Iterator[tuple[str, int, Clump]]:
    """The clumps of a scene with section and place of their tables; one of each inflow of them."""
    yield from ((Clump.section, i, clump) for i, clump in parts.tables(Clump))
    for i, inflow in parts.tables(Inflow):
        if (shape := inflow.shape()) is not None:
            yield Inflow.section, i, shape


def check_clumps(parts: Parts) -> Iterator[Finding]:
    """What a scene with clumps may not have."""
    if not any(True for _ in shapes(parts)):
        return
    yield from _options(parts)
    for section in MECHANICS:
        for i, _ in parts.entries[section][:1]:
            cause = f"{LEAVE_OUT[section]} not act in a scene with clumps yet"
            yield Finding((section, i), cause, "leave this table out, or take spheres in place of clumps")


def _options(parts: Parts) -> Iterator[Finding]:
    """The method and what positions and impacts follow."""
    if parts.run is None:
        return
    options = parts.run.options()
    if options["method"] != "nsga":
        cause = f"clumps need method nsga, found {options['method']}"
        yield Finding(("run", "method"), cause, 'write method = "nsga", or take spheres in place of clumps')
    if options["position_friction"] != "once":
        cause = f"clumps need position_friction once, found {options['position_friction']}"
        yield Finding(("run", "position_friction"), cause, 'write position_friction = "once", the default')
    if LAWS[options["impact"]].restitution == "printed":
        cause = f"clumps need another impact law than {options['impact']}"
        yield Finding(("run", "impact"), cause, 'write impact = "sequence", the default')


def usable_clumps(parts: Parts) -> Iterator[Finding]:
    """Sizes and masses at which squares and cubes neither overflow nor vanish."""
    for section, i, clump in shapes(parts):
        body, (least, most) = clump.body(), MOMENTS
        wrong = [moment for moment in body.moments if not least <= moment <= most]
        if wrong:
            cause = f"a principal moment comes to {wrong[0]:g}, outside {least:g} to {most:g}"
            key = "spheres" if clump.inertia is None else "inertia"
            yield Finding((section, i, key), cause, "check the units")


def check_size(parts: Parts) -> Iterator[Finding]:
    """In a periodic world a clump must not meet itself."""
    periods = parts.periods
    if periods is None or not any(periods):
        return
    for section, i, clump in shapes(parts):
        balls = np.array(clump.spheres)
        centre, radius = balls[:, :3], balls[:, 3]
        apart = np.linalg.norm(centre[:, None] - centre[None], axis=2) + radius[:, None] + radius[None]
        longest = float(apart.max())
        for k, (period, time) in enumerate(least_lengths(parts)):
            if 0 < period <= longest:
                when = f" at t = {time:.4g} s" if time > 0 else ""
                cause = (
                    f"clump {quoted(clump.name)} is {longest:g} m long,"
                    f" and the period along {'xyz'[k]} {period:g} m{when}"
                )
                cure = f"give a period above {longest:g} m: with less, the clump could meet itself"
                yield Finding((section, i, "spheres"), cause, cure)
                break
