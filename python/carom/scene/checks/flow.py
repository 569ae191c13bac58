"""Rules about inflows and outlets, and advice on those that can do nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, Bool
from carom.errors import counted, quoted
from carom.scene.assembly.distances import gaps
from carom.scene.assembly.mechanics import references
from carom.scene.assembly.vectors import scaled
from carom.scene.checks.walls import TOUCHING, called
from carom.scene.messages import Finding
from carom.scene.tables.clumps import Clump
from carom.scene.tables.flow import Inflow, Outlet, Region
from carom.scene.tables.loads import Drag

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts, Whole

SLIGHT = 1e-9
"""Share of a region, or of a period, that is rounding where regions meet."""


def check_flow(parts: Parts) -> Iterator[Finding]:
    """Balls enter where there is room for them, and not where they would leave at once."""
    if parts.entries["inflow"]:
        yield from _held(parts)
    for i, inflow in parts.tables(Inflow):
        corners = _corners(inflow.region)
        offsets, radii = inflow.least()
        places = (corners[:, None] + offsets).reshape(-1, 3)
        radius = np.tile(radii, len(corners))
        largest = float(inflow.radii().max())
        for wall in parts.walls():
            if wall.motion is not None and (wall.motion.until or math.inf) <= inflow.start:
                continue  # it has been taken away by then
            depth = -float(gaps(wall, places, radius).min())
            if depth > TOUCHING * largest:
                what, away = ("clumps", "further") if inflow.spheres else ("balls", "one radius")
                cause = f"{what} would enter {depth:.4g} m deep in {called(wall)}"
                cure = f"the region is that of their centres: keep it {away} away from walls"
                yield Finding(("inflow", i, "region"), cause, cure)
                break
        if any(_leave(parts, outlet, inflow.region)[1] for _, outlet in parts.tables(Outlet)):
            cause = "balls would leave where they enter: the region lies where an outlet removes them"
            yield Finding(("inflow", i, "region"), cause, "move the region or the outlet")


def _held(parts: Parts) -> Iterator[Finding]:
    """Joints and loads on balls that are not there yet."""
    bodies = parts.bodies()
    coming = {name for name, there in zip(bodies.names, bodies.present, strict=True) if not there}
    for name, section, index, key, _ in references(parts.entries):
        if name in coming and section != "drag":  # which holds nothing
            cause = f"{quoted(name)} enters in the course of the run, and what enters must be free"
            yield Finding((section, index, key), cause, "name a sphere that is there from the start")


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


def _periods(parts: Parts) -> tuple[float, float, float]:
    return parts.periods or (0.0, 0.0, 0.0)


def _leave(parts: Parts, outlet: Outlet, region: Region) -> tuple[bool, bool]:
    """Whether an outlet removes balls in some of a region, and in all of it. Of a disc the box around it counts."""
    corners = _corners(region)
    low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    meets = covered = True
    for a, b, c, d, period in zip(low, high, outlet.low, outlet.high, _periods(parts), strict=True):
        if period and d - c >= period:
            continue
        # The first images of the region whose high end, or whose low end, is not below the outlet.
        ends, begins = (period * math.ceil((c - x) / period - SLIGHT) if period else 0.0 for x in (b, a))
        slight = SLIGHT * (b - a if b > a else period)
        common = [min(b + k, d) - max(a + k, c) for k in (ends, begins)]
        meets &= any(x > slight for x in common) if b > a else any(x >= -slight for x in common)
        covered &= a + begins >= c - slight and b + begins <= d + slight
    return (meets, covered) if outlet.inside else (not covered, not meets)


def _within(parts: Parts, outlet: Outlet, points: F64) -> Bool:
    """Which points lie in the box of an outlet, themselves or by an image, as in the core (`Periodic::in_box`)."""
    low, high, period = np.array(outlet.low), np.array(outlet.high), np.array(_periods(parts))
    length = np.where(period > 0, period, 1.0)
    image = np.where(period > 0, points - length * np.floor((points - low) / length), points)
    covered = (period > 0) & (high - low >= period)
    return np.asarray((covered | ((image >= low) & (image <= high))).all(axis=1))


def advise_flow(parts: Whole) -> Iterator[Finding]:
    """Inflows that lose balls or let none in, and outlets that take what is there at the start."""
    for i, inflow in parts.tables(Inflow):
        if any(_leave(parts, outlet, inflow.region)[0] for _, outlet in parts.tables(Outlet)):
            cause = "balls that enter in a part of the region leave at once: an outlet removes them there"
            yield Finding(("inflow", i, "region"), cause, "move the region or the outlet")
        if inflow.start > parts.until:
            cause = f"no ball enters: the run ends at {parts.until:g} s, before {inflow.start:g} s"
            yield Finding(("inflow", i, "start"), cause, "give an earlier start or a longer until")
    if not parts.entries["outlet"]:
        return
    bodies = parts.bodies()
    held = {of.name for of in references(parts.entries) if of.section != Drag.section}
    there, clumps = bodies.present.copy(), dict(parts.tables(Clump))
    places, names = bodies.position.copy(), list(bodies.names)
    for segment in bodies.segments:
        if segment.section == "clump":  # which leaves by its centre of mass; its first ball stands for it
            clump = clumps[segment.index]
            places[segment.start], names[segment.start] = clump.middle(), clump.name
            there[segment.start + 1 : segment.stop] = False
    bound = np.array([name in held for name in bodies.names], dtype=bool)
    for segment in bodies.segments:
        if segment.section == "clump":  # of which one ball that is held holds all
            bound[segment.start : segment.stop] = bound[segment.start : segment.stop].any()
    free = there & ~bound
    told = np.zeros_like(free)
    for i, outlet in parts.tables(Outlet):
        leaves = free & (_within(parts, outlet, places) == outlet.inside)
        gone = np.flatnonzero(leaves & ~told)
        told |= leaves
        if len(gone) and leaves.sum() == there.sum():
            cause = "all balls that are there at the start leave at once: they start where it removes them"
            cure = "move the balls or the outlet, or write the other value of inside"
            yield Finding(("outlet", i), cause, cure)
        elif len(gone):  # the other value would take the rest
            name = quoted(names[gone[0]])
            others = f", like {counted(len(gone) - 1, 'other')}" if len(gone) > 1 else ""
            cause = f"{name} leaves at once: it starts where balls are removed{others}"
            yield Finding(("outlet", i), cause, "move the balls or the outlet")
