"""Rules about joints and loads as parts of a scene: the names they refer to, and the laws they follow in the run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import did_you_mean, quoted
from carom.scene.assembly.mechanics import MECHANICS, references
from carom.scene.checks.carriers import springs
from carom.scene.messages import Finding
from carom.scene.tables.clumps import Clump
from carom.scene.tables.joints import Joint, default_name
from carom.scene.tables.laws import BREAKS, LawValue, fault_at, value_at
from carom.scene.tables.loads import ALL, GROUND, Drag, Load, LoadFunction

if TYPE_CHECKING:
    from carom.scene.assembly.bodies import Bodies
    from carom.scene.checks.rules import Parts, Whole

MOST = 20
"""Wrong names that are listed; more say nothing new."""
LISTED = 2000
"""Names among which the nearest is looked for."""
SLIPS = 200
"""Speeds of slip at which laws of friction are looked at."""
FEW_STEPS = 20
"""Steps per period of a spring below which its motion is inaccurate."""


def check_names(parts: Parts) -> Iterator[Finding]:
    """What joints and loads refer to exists and is a sphere; joints have names of their own."""
    if not any(parts.entries[section] for section in MECHANICS):
        return
    yield from _joint_names(parts)
    yield from _functions(parts)
    bodies = parts.bodies()
    known = set(bodies.names)
    walls = {wall.name: wall for wall in parts.walls()}
    clumps = {clump.name: clump.ball_names() for _, clump in parts.tables(Clump)}
    wrong = 0
    for name, section, index, key, ground_admitted in references(parts.entries):
        cause = cure = ""
        if name == GROUND and ground_admitted:
            if GROUND in known:
                cause, cure = (
                    'a sphere is called "ground", which here means what never moves',
                    "rename the sphere",
                )
        elif name in clumps:
            cause = f"{quoted(name)} is a clump, and {_acts(section)} on spheres"
            cure = f"its balls are {clumps[name][0]} to {clumps[name][-1]}"
            if name in known:
                cure += f"; give it another name to mean the ball {quoted(name)}"
        elif name not in known:
            if name in walls:
                what = walls[name].section.replace("_", " ")
                cause = f"{quoted(name)} is a {what}, and {_acts(section)} on spheres"
                wall = walls[name]
                stands = ground_admitted and wall.motion is None and wall.free is None
                cure = 'planes never move: write "ground"' if stands else _known(name, bodies)
            elif name == GROUND:
                cause = f"{quoted(name)} is no sphere"
                cure = (
                    f"name the sphere; {key} is joined to the ground without saying so"
                    if key == "body"
                    else _known(name, bodies)
                )
            elif not parts.balls_damaged():
                cause, cure = f"unknown sphere {quoted(name)}", _known(name, bodies, ground_admitted)
        if cause and wrong < MOST:
            wrong += 1
            yield Finding((section, index, key), cause, cure)
    of_all = [i for i, drag in parts.tables(Drag) if drag.on == ALL]
    if ALL in known and of_all:
        cause = 'a sphere is called "all", which here means every sphere'
        yield Finding(("drag", of_all[0], "on"), cause, "rename the sphere")


def _acts(section: str) -> str:
    return "joints act" if section == "joint" else f"a {section} acts"


def _known(name: str, bodies: Bodies, ground: bool = False) -> str:
    """The nearest sphere, or which there are, the ground among them; of many spheres their first and last."""
    if len(bodies.names) <= LISTED:
        return did_you_mean(name, [*bodies.names, *([GROUND] if ground else [])])
    groups = [
        f"{bodies.names[s.start]} to {bodies.names[s.stop - 1]}"
        for s in bodies.segments
        if s.stop > s.start + 1
    ]
    singles = [bodies.names[s.start] for s in bodies.segments if s.stop == s.start + 1][:LISTED]
    if not groups:
        return did_you_mean(name, singles)
    return f"known: {', '.join(singles[:5] + groups[:5])}"


def _joint_names(parts: Parts) -> Iterator[Finding]:
    seen: dict[str, int] = {}
    for i, joint in parts.tables(Joint):
        name = joint.name or default_name(i)
        if name in seen:
            cause = f"there are two joints {quoted(name)}"
            yield Finding(("joint", i, "name"), cause, "give one another name")
        seen[name] = i


def _functions(parts: Parts) -> Iterator[Finding]:
    seen: set[str] = set()
    for i, place in parts.tables(LoadFunction):
        if place.name in seen:
            cause = f"there are two load functions {quoted(place.name)}"
            yield Finding(
                ("load_function", i, "name"), cause, "give one another name: load_function(f, name=...)"
            )
        seen.add(place.name)
        if place.function is None:
            cause = f"the Python function {quoted(place.name)} is not there: no file can hold it"
            cure = f"read the scene in Python and give it: scene.load_function(f, name={quoted(place.name)})"
            yield Finding(("load_function", i), cause, cure)


def check_rods(parts: Parts) -> Iterator[Finding]:
    """A rod whose law brings its ends together within the run: then it has no direction."""
    for i, joint in parts.tables(Joint):
        if isinstance(law := joint.length, dict):
            gone = next((t for t in parts.times() if value_at(law, t) <= 0), None)
            if gone is not None:
                cause = f"falls to {value_at(law, gone):.4g} m at t = {gone:.4g} s"
                cure = "a rod has a positive length: change the law or until"
                yield Finding(("joint", i, "length"), cause, cure)


def advise_loads(parts: Whole) -> Iterator[Finding]:
    """Advice on laws and springs."""
    yield from _laws(parts)
    yield from _fast_springs(parts)
    yield from _friction(parts)


def _laws(parts: Whole) -> Iterator[Finding]:
    """Laws of the time that break off within the run."""
    times = parts.times()
    for section, keys in (("joint", ("length", "displacement", "angle")), ("load", ("force", "torque"))):
        for i, table in parts.entries[section]:
            for key in keys:
                given = getattr(table, key)
                for law in given if isinstance(table, Load) else (given,):
                    if isinstance(law, dict):
                        yield from _broken((section, i, key), law, times)


def _broken(path: tuple[str, int, str], law: LawValue, times: list[float]) -> Iterator[Finding]:
    for t in times:
        value = value_at(law, t)
        if not math.isfinite(value):
            yield Finding(path, f"has no finite value at t = {t:.4g} s{fault_at(law, t)}", BREAKS)
            return


def _fast_springs(parts: Whole) -> Iterator[Finding]:
    step = parts.run.step
    for held in springs(parts):
        rate = held.spring.stiffness * held.inverse_mass
        period = 2.0 * math.pi / math.sqrt(rate) if rate > 0 else math.inf
        if step * FEW_STEPS > period:
            cause = f"its period is about {period:.3g} s, {period / step:.2g} steps of {step:g} s"
            cure = f"a step below {period / FEW_STEPS:.1g} s follows it"
            yield Finding(("spring", held.number, "stiffness"), cause, cure)


def _friction(parts: Parts) -> Iterator[Finding]:
    """Laws of friction that are negative at speeds which the run may reach."""
    bodies = parts.bodies()
    laws = [(i, law) for i, law in parts.contacts() if isinstance(law.friction, dict)]
    if not laws:
        return
    surface = np.linalg.norm(bodies.velocity, axis=1)
    surface += bodies.radius * np.linalg.norm(bodies.angular_velocity, axis=1)
    fastest = 2.0 * float(surface.max())
    for i, law in laws:
        for v in np.linspace(0.0, fastest, SLIPS + 1).tolist():
            mu = value_at(law.friction, v)
            if not mu >= 0:
                cause = f"the coefficient is {mu:.4g} at a slip of {v:.4g} m/s"
                yield Finding(
                    ("contact", i, "friction"), cause, "write max(0, ...), or a table that ends at zero"
                )
                break
