"""Rules about inflows and outlets, and advice on those that can do nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import quoted
from carom.scenario.bodies import F64
from carom.scenario.distances import gaps
from carom.scenario.flow import Inflow, Outlet, Region
from carom.scenario.loads import ALL
from carom.scenario.mechanics import references
from carom.scenario.problems import Finding
from carom.scenario.vectors import scaled
from carom.scenario.wall_checks import TOUCHING, called

if TYPE_CHECKING:
    from carom.scenario.checks import Parts


def check_flow(parts: Parts) -> Iterator[Finding]:
    """Balls enter where there is room for them, and not where they would leave at once."""
    if parts.entries["inflow"]:
        yield from _held(parts)
    outlets = [t for _, t in parts.entries["outlet"] if isinstance(t, Outlet)]
    for i, inflow in parts.entries["inflow"]:
        assert isinstance(inflow, Inflow)
        corners = _corners(inflow.region)
        radius = np.full(len(corners), inflow.radius)
        for wall in parts.walls():
            depth = -float(gaps(wall, corners, radius).min())
            if depth > TOUCHING * inflow.radius:
                cause = f"balls would enter {depth:.4g} m deep in {called(wall)}"
                cure = "the region is that of their centres: keep it one radius away from walls"
                yield Finding(("inflow", i, "region"), cause, cure)
                break
        if any(_within(outlet, inflow.region.centre()) == outlet.inside for outlet in outlets):
            cause = "balls would leave where they enter: the region lies where an outlet removes them"
            yield Finding(("inflow", i, "region"), cause, "move the region or the outlet")


def _held(parts: Parts) -> Iterator[Finding]:
    """Joints and loads on balls that are not there yet."""
    bodies = parts.bodies()
    coming = {name for name, there in zip(bodies.names, bodies.present, strict=True) if not there}
    for name, section, index, key, _ in references(parts.entries):
        if name in coming:
            cause = f"{quoted(name)} enters in the course of the run, and what enters must be free"
            yield Finding((section, index, key), cause, "name a sphere that is there from the start")
    for i, drag in parts.entries["drag"]:
        if getattr(drag, "on", None) == ALL:
            cause = (
                '"all" would act on balls that enter in the course of the run, and what enters must be free'
            )
            yield Finding(("drag", i, "on"), cause, "name the spheres one by one, or do without the inflow")


def _corners(region: Region) -> F64:
    """Points whose hull is the region of centres, or (of a disc) nearly so, (C, 3), m."""
    if region.low is not None and region.high is not None:
        return np.array(list(product(*zip(region.low, region.high, strict=True))))
    assert region.normal is not None
    assert region.radius is not None
    n = np.array(scaled(region.normal))
    u = np.cross(n, np.eye(3)[int(np.abs(n).argmin())])
    u /= np.linalg.norm(u)
    angle = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
    rim = np.outer(np.cos(angle), u) + np.outer(np.sin(angle), np.cross(n, u))
    points: F64 = np.array(region.centre()) + region.radius * rim
    return points


def _within(outlet: Outlet, point: tuple[float, float, float]) -> bool:
    return all(a <= x <= b for a, x, b in zip(outlet.low, point, outlet.high, strict=True))
