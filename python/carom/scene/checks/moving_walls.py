"""Advice on walls: how they move, and what balls cannot pass; and on laws of joints that jump or are fast, as those of
walls do and are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from carom.scene.assembly.areas import area
from carom.scene.assembly.placing import FLAT, Placed
from carom.scene.assembly.vectors import dot, norm
from carom.scene.checks.turning_walls import lever, through
from carom.scene.checks.walls import called
from carom.scene.messages import Finding
from carom.scene.tables.joints import Joint
from carom.scene.tables.laws import BREAKS, LawValue, fault_at, value_at

if TYPE_CHECKING:
    from carom.scene.checks.rules import Whole
    from carom.scene.tables.free import Free
    from carom.scene.tables.motion import Motion
    from carom.scene.toml.lines import Path

WALL_TRAVEL = 0.5
"""Travel of a wall per step, in the smallest radii, above which a ball may be deep in it before it is noticed."""
FASTEST = 1e12
"""Speed of walls and balls, m/s, that no run goes beyond, as in the core (`outcome.rs`)."""
ALONG = 1e-9
"""Share of a velocity along a normal below which it is rounding."""
MOST_LOOKS = 10_000
"""Steps at whose ends jumps are looked for; of longer runs as many instants, evenly spread."""
JUMP = 1e-3
"""Jumps of a wall below this, in the smallest radii (of its angle: in radians), are none."""
HALVINGS = 10
"""A change in a step of which at least half happens in one part of it, halved so often, is a jump. What moves at one
speed and passes `JUMP` in that part passes `WALL_TRAVEL` in the step.
"""


def _advise_narrow_cones(parts: Whole) -> Iterator[Finding]:
    """Cones from inside whose narrow end holds a ball: it would touch a whole ring, and a wall is touched at one point."""
    largest = float(parts.bodies().radius.max())
    for wall in parts.walls():
        if wall.shape[0] != "cone" or not wall.shape[5]:
            continue
        ends = {"radius": float(wall.shape[2]), "radius_end": float(wall.shape[3])}
        key = min(ends, key=ends.__getitem__)
        if ends[key] < largest:
            cause = f"balls of radius {largest:g} m do not pass the narrow end of {called(wall)}"
            yield Finding(
                (wall.section, wall.index, key),
                cause + ": one that sits on the whole ring stops the run",
                f"give {largest:g} m or more, and close the end with a disc if balls should stay",
            )


def _advise_holes(parts: Whole) -> Iterator[Finding]:
    """The same of a hole that a ball does not pass: it would touch a whole ring, or two places of it at once."""
    largest = float(parts.bodies().radius.max())
    for wall in parts.walls():
        if wall.shape[0] == "disc" and 0.0 < wall.shape[3] < largest:
            yield Finding(
                (wall.section, wall.index, "hole"),
                f"balls of radius {largest:g} m do not pass the hole of {called(wall)}:"
                " one near its axis gains energy, falls through or stops the run",
                f"give {largest:g} m or more, or none; beside the hole the balls are right",
            )


def advise_walls(parts: Whole) -> Iterator[Finding]:
    """Laws of motion that break off or jump within the run, walls that are fast for the step, slip that does nothing."""
    yield from _advise_narrow_cones(parts)
    yield from _advise_holes(parts)
    told: set[tuple[str, int]] = set()
    for wall in parts.walls():
        motion, place = wall.motion, (wall.section, wall.index)
        if wall.free is not None:
            yield from _advise_free(parts, wall, wall.free)
        if motion is None or place in told:  # the sides of a box share one motion
            continue
        if wall.section != "box":
            yield from _advise_slip(wall, motion)
        told.add(place)
        if motion.until is not None and motion.until >= parts.until:
            cause = f"the wall stays: the run ends at {parts.until:g} s, and it would be taken away at {motion.until:g} s"
            yield Finding((*place, "motion"), cause, "give an earlier until of the motion, or a longer run")
        broken = list(_advise_breaks(parts, wall, motion))
        yield from broken
        jumps = [] if broken else list(_advise_jumps(parts, wall, motion))
        yield from jumps
        if not broken and not jumps:  # no step is safe for a jump
            yield from _advise_travel(parts, wall, motion)


def _advise_slip(wall: Placed, motion: Motion) -> Iterator[Finding]:
    """A surface slips within itself: the contacts take no notice of what a velocity has along the normal."""
    slip = motion.surface_velocity
    if wall.kind not in FLAT or slip is None:
        return
    across = dot(slip, wall.shape[1])
    if abs(across) > ALONG * norm(slip):
        cause = f"{across:.4g} m/s of it are along the normal of {called(wall)}: a surface slips only within itself"
        cure = (
            "contacts pass that part over: give a velocity within the plane, or move the plane by translation"
        )
        yield Finding((wall.section, wall.index, "motion", "surface_velocity"), cause, cure)


def _laws(motion: Motion) -> list[tuple[LawValue, str]]:
    laws = [(law, "translation") for law in motion.translation or ()]
    return laws + ([(motion.rotation.law(), "rotation")] if motion.rotation is not None else [])


def _advise_breaks(parts: Whole, wall: Placed, motion: Motion) -> Iterator[Finding]:
    for law, key in _laws(motion):
        for t in parts.times():
            if not math.isfinite(value_at(law, t)):
                cause = f"{key} has no finite value at t = {t:.4g} s{fault_at(law, t)}"
                yield Finding((wall.section, wall.index, "motion"), cause, BREAKS)
                break


def _advise_travel(parts: Whole, wall: Placed, motion: Motion) -> Iterator[Finding]:
    """By translation, and by turning at the point that is moved most of all that the table stands for."""
    run, bodies = parts.run, parts.bodies()
    if not motion.moves_shape:
        return
    times = parts.times()
    path = (wall.section, wall.index, "motion")
    laws = [law for law, _ in _laws(motion)]
    here = np.array([[value_at(law, t) for law in laws] for t in times])
    there = np.array([[value_at(law, t + run.step) for law in laws] for t in times])
    moves = np.nan_to_num(there) - here
    of_table = [piece for piece in parts.walls() if (piece.section, piece.index) == path[:2]]
    if motion.rotation is not None:  # from an angle to a way
        moves[:, -1] *= max(lever(piece, motion.rotation) for piece in of_table)
    fastest = float(np.abs(moves).max()) / run.step
    if fastest > FASTEST:
        cause = f"{called(wall)} reaches {fastest:.2g} m/s, more than the {FASTEST:g} m/s of any run"
        yield Finding(
            path, cause, "the run would stop there: check the law and its units (t is in s, lengths in m)"
        )
        return
    slides = 0 if motion.translation is None else 3
    way = np.abs(moves[:, slides:]).sum(axis=1)
    if slides:
        given = moves[:, :3], here[:, -1], motion.rotation
        way = way + np.max([through(piece, *given) for piece in of_table], axis=0)
    travel = float(way.max()) / float(bodies.radius.min())
    yield from _advise_way(path, wall, run.step, travel, run.step * WALL_TRAVEL / max(travel, WALL_TRAVEL))


def _advise_free(parts: Whole, wall: Placed, free: Free) -> Iterator[Finding]:
    """A light wall that a force drives far in a step: contacts are sought where it would be without balls."""
    run, bodies = parts.run, parts.bodies()
    law = free.law()
    force = max(abs(value_at(law, t)) for t in parts.times())
    if free.follows():
        surfaces = parts.walls()
        force *= area(surfaces.index(wall), surfaces, parts.periods)
    by_force = 0.5 * force / free.mass * run.step**2
    travel = (by_force + abs(free.velocity) * run.step) / float(bodies.radius.min())
    if math.isfinite(travel):
        step = run.step * min(1.0, WALL_TRAVEL / max(travel, WALL_TRAVEL)) ** (0.5 if by_force > 0.0 else 1.0)
        yield from _advise_way((wall.section, wall.index, "free"), wall, run.step, travel, step)


def _advise_way(path: Path, wall: Placed, step: float, travel: float, safe: float) -> Iterator[Finding]:
    """Of a wall that goes so many radii of the smallest ball in a step, and of the step that is safe, s."""
    if travel > WALL_TRAVEL:
        cause = f"a step of {step:g} s moves {called(wall)} by {travel:.2g} radii of the smallest ball"
        yield Finding(path, cause, f"balls may be passed unnoticed: step = {safe:.1g} is safe")


def _advise_jumps(parts: Whole, wall: Placed, motion: Motion) -> Iterator[Finding]:
    bodies = parts.bodies()
    for law, key in _laws(motion):
        radius = float(bodies.radius.min()) if key == "translation" else 1.0
        found = first_jump(law, parts.until, parts.run.step, JUMP * radius)
        if found is None:
            continue
        time, size = found
        unit = "m" if key == "translation" else "rad"
        cause = f"the law jumps by {size:.4g} {unit} at t = {time:.4g} s"
        cure = (
            f"{called(wall)} would shift balls, whose energy rises without work: write a ramp over some steps"
        )
        yield Finding((wall.section, wall.index, "motion", key), cause, cure)
        return


def advise_joint_laws(parts: Whole) -> Iterator[Finding]:
    """Laws of joints that jump: they carry bodies through others, which no contact sees. And those that are fast."""
    radius, step = float(parts.bodies().radius.min()), parts.run.step
    for i, joint in parts.tables(Joint):
        for key, unit, size, measure in (
            ("length", "m", radius, "radii of the smallest ball"),
            ("displacement", "m", radius, "radii of the smallest ball"),
            ("angle", "rad", 1.0, "rad"),
        ):
            law = getattr(joint, key)
            found = first_jump(law, parts.until, step, JUMP * size)
            if found is not None:
                cause = f"the law jumps by {found[1]:.4g} {unit} at t = {found[0]:.4g} s"
                cure = "its bodies would pass through others, without a speed: write a ramp over some steps"
                yield Finding(("joint", i, key), cause, cure)
            elif law is not None:
                way = max(abs(value_at(law, t + step) - value_at(law, t)) for t in parts.times()) / size
                if way > WALL_TRAVEL:  # and it is a number
                    cause = f"the law changes by {way:.2g} {measure} in a step of {step:g} s"
                    cure = (
                        f"what happens on that way is not seen: step = {step * WALL_TRAVEL / way:.1g} is safe"
                    )
                    yield Finding(("joint", i, key), cause, cure)


def first_jump(law: LawValue, until: float, step: float, least: float) -> tuple[float, float] | None:
    """When a law first changes by `least` or more in far less than a step, and by how much; None if it never does."""
    if not isinstance(law, dict):
        return None
    ((form, data),) = law.items()
    if form == "table":
        for (begin, low), (end, high) in pairwise(data):
            if 0.0 <= end <= until and end - begin <= step * 0.5**HALVINGS and abs(high - low) >= least:
                return end, high - low
    if form != "expression":
        return None
    looks = min(MOST_LOOKS, max(2, math.ceil(until / step)))
    times = np.linspace(0.0, until, looks + 1)
    values = np.array([value_at(law, t) for t in times.tolist()])
    change = np.abs(np.diff(values))
    for k in np.flatnonzero(change >= least).tolist():
        begin, end, low, high = (float(x) for x in (times[k], times[k + 1], values[k], values[k + 1]))
        for _ in range(HALVINGS):
            middle = 0.5 * (begin + end)
            value = value_at(law, middle)
            # The half in which it changes most.
            if abs(value - low) > abs(high - value):
                end, high = middle, value
            else:
                begin, low = middle, value
            if not abs(high - low) >= max(least, 0.5 * change[k]):
                break
        else:
            return end, high - low
    return None
