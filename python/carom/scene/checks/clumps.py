"""Rules about clumps: by what methods they are computed, what may hold them, and what their numbers may be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import quoted
from carom.scene.checks.deformation import least_lengths
from carom.scene.messages import Finding
from carom.scene.tables.clumps import Clump
from carom.scene.tables.flow import Inflow
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.joints import Joint
from carom.scene.tables.loads import GROUND, Spring

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts

MOMENTS = (1e-90, 1e90)
"""Moments of inertia between these, kg m^2, as of spheres."""
SAME = 1e-9
"""Difference of two spheres, over the radius, up to which they are one: contacts of both would be one, that counts twice."""


def shapes(parts: Parts) -> Iterator[tuple[str, int, Clump]]:
    """The clumps of a scene with section and place of their tables; one of each inflow of them."""
    yield from ((Clump.section, i, clump) for i, clump in parts.tables(Clump))
    for i, inflow in parts.tables(Inflow):
        if (shape := inflow.shape()) is not None:
            yield Inflow.section, i, shape


def check_clumps(parts: Parts) -> Iterator[Finding]:
    """What a scene with clumps may not have."""
    if any(True for _ in shapes(parts)):
        yield from _options(parts)
        yield from _within(parts)


def _within(parts: Parts) -> Iterator[Finding]:
    """Joints and springs between two balls of one clump, which never move against one another."""
    clump_of = {ball: clump.name for _, clump in parts.tables(Clump) for ball in clump.ball_names()}
    for section, does in (("joint", "joins"), ("spring", "pulls at")):
        for i, table in parts.entries[section]:
            assert isinstance(table, Joint | Spring)
            a, b = (clump_of.get(name) for name in table.between or (GROUND, GROUND))
            if a is not None and a == b:
                cause = f"{does} two balls of clump {quoted(a)}, which is rigid"
                cure = f'leave this {section} out, or name a ball of another body, or "ground"'
                yield Finding((section, i, "between"), cause, cure)


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
        balls = np.array(clump.spheres)
        differ = np.abs(balls[:, None] - balls[None]).max(axis=2)
        same = np.argwhere(np.triu(differ <= SAME * balls[:, 3], 1))
        if len(same):
            first, second = same[0] + 1
            cause = f"balls {first} and {second} of the clump are one and the same, which would press and attract twice"
            yield Finding((section, i, "spheres"), cause, "leave one out")


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
