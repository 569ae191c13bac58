"""Rules about walls, periodic worlds, inflows and outlets, and advice on how walls move."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from carom import _core
from carom.errors import quoted
from carom.scenario.bodies import F64
from carom.scenario.distances import gaps
from carom.scenario.flow import Inflow, Outlet, Region
from carom.scenario.laws import fault_at, value_at
from carom.scenario.loads import ALL
from carom.scenario.mechanics import references
from carom.scenario.model import World
from carom.scenario.placing import Placed
from carom.scenario.problems import Finding
from carom.scenario.vectors import cross, norm, scaled
from carom.scenario.walls import PARALLEL, PLANE, Box

if TYPE_CHECKING:
    from carom.scenario.checks import Parts

TOUCHING = 1e-9
"""A gap above minus this fraction of the radius counts as touching; the step has the same tolerance."""
COARSE = 1e-5
"""A `pile_tolerance` from which on a scene is one of piles, as in the core, which sweeps all but its smallest islands."""
HUGE = 1_000_000
"""Contacts of the largest piles."""
MOST = 20
"""Balls in walls that are listed; more say nothing new."""
PERIOD = 4.1
"""A period is at least so many of the largest radii: with less, two balls could touch twice. The core asks for 4.08:
four and the margin of its lists of pairs (`crates/carom-core/src/periodic.rs`).
"""
SAMPLES = 200
"""Times of a run at which the motion of walls is looked at."""
WALL_TRAVEL = 0.5
"""Travel of a wall per step, in the smallest radii, above which a ball may be deep in it before it is noticed."""


def touching(pile_tolerance: float) -> float:
    """Overlap over the radius up to which bodies count as touching at the start of a run.

    In scenes of piles it is what a step may leave in the largest of them, so that a run can begin where another one has
    ended.
    """
    return _core.pile_overlap(pile_tolerance, HUGE) if pile_tolerance >= COARSE else TOUCHING


def start_overlap(parts: Parts) -> float:
    """`touching` of a scene."""
    options = parts.run.options() if parts.run is not None else {}
    return touching(float(options.get("pile_tolerance", 0.0)))


def check_walls(parts: Parts) -> Iterator[Finding]:
    """Balls that start in a wall or outside a closed box."""
    bodies = parts.bodies()
    there = np.flatnonzero(bodies.present)
    centre, radius = bodies.position[there], bodies.radius[there]
    reported = 0
    strays: set[int] = set()
    overlap = start_overlap(parts)
    for _, box in parts.entries["box"]:
        assert isinstance(box, Box)
        if box.open:
            continue
        outside = ((centre < np.array(box.low)) | (centre > np.array(box.high))).any(axis=1)
        for k in np.flatnonzero(outside)[: MOST - reported]:
            reported += 1
            strays.add(int(k))
            cause = (
                f"sphere {quoted(bodies.names[there[k]])} is outside box {quoted(box.name)}, which is closed"
            )
            yield Finding(
                parts.place(int(there[k])), cause, "move it inside, or list the sides without a wall in open"
            )
        if len(strays) >= MOST:
            return
    for wall in parts.walls():
        gap = gaps(wall, centre, radius)
        for k in np.flatnonzero(gap < -overlap * radius):
            if int(k) in strays:
                continue
            if reported >= MOST:
                return
            reported += 1
            body, depth = int(there[k]), -float(gap[k])
            name = quoted(bodies.names[body])
            if wall.kind == PLANE:
                cause = f"sphere {name} reaches {depth:.4g} m behind {_called(wall)}"
                if depth > 2 * radius[k]:
                    cure = "move it to the side that the normal points to, or reverse the normal"
                else:
                    cure = f"move it by {depth:.4g} m along the normal of the plane"
            else:
                cause = f"sphere {name} reaches {depth:.4g} m into {_called(wall)}"
                cure = (
                    f"move it by {depth:.4g} m away from the wall{_other_side(wall, depth, float(radius[k]))}"
                )
            yield Finding(parts.place(body), cause, cure)


def _called(wall: Placed) -> str:
    """How messages call a wall: `plane "bed"`, `cylinder "drum"`."""
    what = "plane" if wall.kind == PLANE else wall.section.replace("_", " ")
    return f"{what} {quoted(wall.name)}"


def _other_side(wall: Placed, depth: float, radius: float) -> str:
    """What else may have been meant where a ball is on the wrong side of a curved wall."""
    inside = wall.shape[-1]
    if isinstance(inside, bool) and depth > 2 * radius:
        return f", or write inside = {str(not inside).lower()}: spheres live {'outside' if inside else 'inside'} then"
    return ""


def check_periodic(parts: Parts, world: World | None) -> Iterator[Finding]:
    """A periodic world has room for its balls, and its walls look the same from period to period."""
    periods = world.periodic if world is not None else None
    if periods is None or not any(periods):
        return
    bodies = parts.bodies()
    largest = float(bodies.radius.max(initial=0.0))
    for k, period in enumerate(periods):
        if 0 < period < PERIOD * largest:
            cause = f"a period of {period:g} m along {'xyz'[k]} is below {PERIOD:g} radii of the largest ball"
            cure = f"give at least {PERIOD * largest:g} m: with less, two balls could touch twice"
            yield Finding(("world", "periodic", k), cause, cure)
    axes = [k for k, period in enumerate(periods) if period > 0]
    for wall in parts.walls():
        crossed = next((k for k in axes if not _invariant(wall, k)), None)
        if crossed is None:
            continue
        letter = "xyz"[crossed]
        cause = f"{_called(wall)} is not the same from period to period along {letter}"
        if wall.kind == PLANE:
            cure = f"take a plane whose normal (also when it moves) has no part along {letter}"
        else:
            cure = "along a periodic axis there may be planes and tubes without end that follow it"
        yield Finding((wall.section, wall.index), cause, f"{cure}, or set that period to 0")


def _invariant(wall: Placed, k: int) -> bool:
    """Whether a wall, wherever it moves, is the same after any shift along axis k."""
    axis = [float(j == k) for j in range(3)]
    turn = None if wall.motion is None else wall.motion.rotation
    if wall.kind == PLANE:
        normal = wall.shape[1]
        if abs(normal[k]) > PARALLEL:
            return False
        return turn is None or _parallel(turn.axis, normal) or _parallel(turn.axis, axis)
    if wall.kind == "cylinder" and math.isinf(wall.shape[3]):
        return _parallel(wall.shape[1], axis) and (turn is None or _parallel(turn.axis, axis))
    return False


def _parallel(a: object, b: object) -> bool:
    u, v = scaled(a), scaled(b)  # type: ignore[arg-type]
    return norm(cross(u, v)) < PARALLEL


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
                cause = f"balls would enter {depth:.4g} m deep in {_called(wall)}"
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


def _advise_narrow_cones(parts: Parts) -> Iterator[Finding]:
    """Cones from inside whose narrow end holds a ball: it would touch a whole ring, and a wall is touched at one point."""
    bodies = parts.bodies()
    if not bodies.names:
        return
    largest = float(bodies.radius.max())
    for wall in parts.walls():
        if wall.shape[0] != "cone" or not wall.shape[5]:
            continue
        ends = {"radius": float(wall.shape[2]), "radius_end": float(wall.shape[3])}
        key = min(ends, key=ends.__getitem__)
        if ends[key] < largest:
            cause = f"balls of radius {largest:g} m do not pass the narrow end of {_called(wall)}"
            yield Finding(
                (wall.section, wall.index, key),
                cause + ": one that sits on the whole ring stops the run",
                f"give {largest:g} m or more, and close the end with a disc if balls should stay",
            )


def advise_walls(parts: Parts) -> Iterator[Finding]:
    """Laws of motion that break off within the run, and walls that are fast for the step."""
    yield from _advise_narrow_cones(parts)
    run, bodies = parts.run, parts.bodies()
    if run is None or run.until is None or not bodies.names:
        return
    times = np.linspace(0.0, run.until, SAMPLES + 1).tolist()
    smallest = float(bodies.radius.min())
    told: set[tuple[str, int]] = set()
    for wall in parts.walls():
        motion, path = wall.motion, (wall.section, wall.index, "motion")
        if motion is None or path[:2] in told:  # the sides of a box share one motion
            continue
        told.add(path[:2])
        laws = [(law, "translation") for law in motion.translation or ()]
        laws += [(motion.rotation.law(), "rotation")] if motion.rotation is not None else []
        broken = False
        for law, key in laws:
            for t in times:
                if not math.isfinite(value_at(law, t)):
                    cause = f"{key} has no finite value at t = {t:.4g} s{fault_at(law, t)}"
                    yield Finding(path, cause, "the run would stop there: change the law or until")
                    broken = True
                    break
        if motion.translation is None or broken:
            continue
        here = np.array([[value_at(law, t) for law in motion.translation] for t in times])
        there = np.array([[value_at(law, t + run.step) for law in motion.translation] for t in times])
        travel = float(np.nan_to_num(np.linalg.norm(there - here, axis=1)).max()) / smallest
        if travel > WALL_TRAVEL:
            cause = (
                f"a step of {run.step:g} s moves {_called(wall)} by {travel:.2g} radii of the smallest ball"
            )
            step = run.step * WALL_TRAVEL / travel
            yield Finding(path, cause, f"balls may be passed unnoticed: step = {step:.1g} is safe")
