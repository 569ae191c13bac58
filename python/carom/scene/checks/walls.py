"""Rules about walls and periodic worlds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from carom import _core
from carom.errors import quoted
from carom.scene.assembly.distances import gaps
from carom.scene.assembly.placing import Placed
from carom.scene.assembly.vectors import cross, norm, scaled
from carom.scene.checks.deformation import least_lengths
from carom.scene.messages import Finding
from carom.scene.tables.options import MOST_OVERLAP
from carom.scene.tables.quantities import Vec3, unit
from carom.scene.tables.walls import PLANE, WALLS, Box

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts

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
four and the margin of its lists of pairs (`crates/carom-core/src/build/periodic.rs`). Balls that attract have to be so far
from a second image that none is within the distance, either (`_least_period`).
"""
SIZES = (1e-75, 1e75)
"""Lengths of walls between these, m, have squares that are numbers, as in the core (`wall/check.rs`)."""
ALONG = 1e-9
"""Sine of an angle below which a direction is along an axis that repeats, as in the core (`build/periodic.rs`)."""


def touching(options: Mapping[str, Any]) -> float:
    """Overlap over the radius that runs with these options admit at their start, to begin where others have ended.

    In scenes of piles it is what a step may leave in the largest of them; with springs what they hold without a warning.
    """
    if options.get("method") == "penalty":
        return MOST_OVERLAP + TOUCHING
    pile_tolerance = float(options.get("pile_tolerance", 0.0))
    return _core.pile_overlap(pile_tolerance, HUGE) if pile_tolerance >= COARSE else TOUCHING


def start_overlap(parts: Parts) -> float:
    """`touching` of a scene."""
    options = parts.run.options() if parts.run is not None else {}
    return touching(options)


def check_walls(parts: Parts) -> Iterator[Finding]:
    """Walls of a size that no number holds, balls that start in a wall or outside a closed box."""
    unusable = list(_sizes(parts))
    yield from unusable
    if unusable:
        return
    bodies = parts.bodies()
    there = np.flatnonzero(bodies.present)
    centre, radius = bodies.position[there], bodies.radius[there]
    reported = 0
    strays: set[int] = set()
    overlap = start_overlap(parts)
    for _, box in parts.tables(Box):
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
            too_deep = depth - (overlap - TOUCHING) * float(radius[k])
            name = quoted(bodies.names[body])
            if wall.kind == PLANE:
                cause = f"sphere {name} reaches {depth:.4g} m behind {called(wall)}"
                if depth > radius[k]:  # its centre is behind
                    cure = "move it to the side that the normal points to, or reverse the normal"
                else:
                    cure = f"move it by {too_deep:.4g} m along the normal of the plane"
            else:
                cause = f"sphere {name} reaches {depth:.4g} m into {called(wall)}"
                meant = _other_side(wall, depth, float(radius[k]))
                cure = f"move it by {too_deep:.4g} m away from the wall{meant}"
            yield Finding(parts.place(body), cause, cure)


def _sizes(parts: Parts) -> Iterator[Finding]:
    """Lengths whose squares overflow or vanish."""
    least, most = SIZES
    for section in WALLS:
        for i, table in parts.entries[section]:
            for key, field in type(table).model_fields.items():
                value = getattr(table, key)
                if value is None or field.json_schema_extra != unit("m") or np.size(value) == 3:
                    continue  # places have bounds of their own
                for number in np.atleast_1d(np.array(value, dtype=float)).tolist():
                    if number > most or 0 < number < least:
                        cause = f"is {number:g} m, and walls have lengths from {least:g} to {most:g} m"
                        cure = "check the units; a plane stands for a huge wall"
                        yield Finding((section, i, key), cause, cure)
                        break


def called(wall: Placed) -> str:
    """How messages call a wall: `plane "bed"`, `cylinder "drum"`."""
    what = "plane" if wall.kind == PLANE else wall.section.replace("_", " ")
    return f"{what} {quoted(wall.name)}"


def _other_side(wall: Placed, depth: float, radius: float) -> str:
    """What else may have been meant where a ball is on the wrong side of a curved wall."""
    inside = wall.shape[-1]
    if isinstance(inside, bool) and depth > 2 * radius:
        return f", or write inside = {str(not inside).lower()}: spheres live {'outside' if inside else 'inside'} then"
    return ""


def check_periodic(parts: Parts) -> Iterator[Finding]:
    """A periodic world has room for its balls, and its walls look the same from period to period."""
    periods = parts.periods
    if periods is None or not any(periods):
        return
    least, of_balls, why = _least_period(parts)
    for k, (length, time) in enumerate(least_lengths(parts)):
        if not 0 < length < least:
            continue
        cure = f"give at least {least:g} m{why}"
        if time > 0:
            cause = (
                f"shortens the period along {'xyz'[k]} to {length:g} m at t = {time:.4g} s,"
                f" below {PERIOD:g} radii of the largest ball{of_balls}"
            )
            yield Finding(("world", "deformation", "stretch", k), cause, cure)
        else:
            cause = (
                f"a period of {length:g} m along {'xyz'[k]} is below"
                f" {PERIOD:g} radii of the largest ball{of_balls}"
            )
            yield Finding(("world", "periodic", k), cause, cure)
    axes = [k for k, period in enumerate(periods) if period > 0]
    for wall in parts.walls():
        crossed = next((k for k in axes if not _invariant(wall, k)), None)
        if crossed is not None:
            letter = "xyz"[crossed]
            cause = f"{called(wall)} is not the same from period to period along {letter}"
            if wall.kind == PLANE:
                cure = f"take a plane whose normal has no part along {letter}"
            else:
                cure = "along a periodic axis there may be planes and tubes without end that follow it"
            yield Finding((wall.section, wall.index), cause, f"{cure}, or set that period to 0")
            continue
        for key, axis in _turns(wall):
            across = next((k for k in axes if not _parallel(axis, _axis(k))), None)
            if across is not None:
                letter = "xyz"[across]
                cause = f"{called(wall)} turns about an axis that is not along {letter}, which is periodic"
                cure = "its surface would move otherwise from period to period: take surface_velocity"
                yield Finding(
                    (wall.section, wall.index, "motion", key), cause, f"{cure}, or set that period to 0"
                )


def _least_period(parts: Parts) -> tuple[float, str, str]:
    """The least length of a period, m, of which balls, and why: a pair touches, or attracts, one image of each other alone.

    Images are no nearer to one another than the shortest period, at any shear; at half of it two of them are as near.
    """
    bodies = parts.bodies()
    largest = float(bodies.radius.max(initial=0.0))
    found = [(PERIOD * largest, "", ": with less, two balls could touch twice")]
    names = parts.materials()
    two = {name: np.sort(bodies.radius[bodies.material == k])[:-3:-1] for k, name in enumerate(names)}
    for _, law in parts.contacts():
        a, b = (two.get(name, bodies.radius[:0]) for name in law.between)
        pair = a if law.between[0] == law.between[1] else np.append(a[:1], b[:1])
        if law.cohesion and len(pair) == 2:
            length = PERIOD * float(pair.mean()) + 2.0 * law.rupture_distance
            of = " and ".join(quoted(name) for name in dict.fromkeys(law.between))
            of_balls = f"s of {of} (their mean) and twice their rupture_distance"
            why = ", or a shorter rupture_distance: only the nearest image of a ball attracts"
            found.append((length, of_balls, why))
    return max(found)


def _axis(k: int) -> list[float]:
    return [float(j == k) for j in range(3)]


def _turns(wall: Placed) -> Iterator[tuple[str, Vec3]]:
    """What turns of a wall or its surface, and about which axis."""
    if wall.motion is not None and wall.motion.rotation is not None:
        yield "rotation", wall.motion.rotation.axis
    if wall.motion is not None and wall.motion.surface_rotation is not None:
        yield "surface_rotation", wall.motion.surface_rotation.axis


def _invariant(wall: Placed, k: int) -> bool:
    """Whether a wall is at the start the same after any shift along axis k."""
    if wall.kind == PLANE:
        return abs(float(wall.shape[1][k])) < ALONG
    return wall.kind == "cylinder" and math.isinf(wall.shape[3]) and _parallel(wall.shape[1], _axis(k))


def _parallel(a: object, b: object) -> bool:
    u, v = scaled(a), scaled(b)  # type: ignore[arg-type]
    return norm(cross(u, v)) < ALONG
