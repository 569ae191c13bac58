"""Rules about periodic boxes that deform."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import quoted
from carom.scene.messages import Finding
from carom.scene.tables.deformation import AXES, Deformation
from carom.scene.tables.laws import fault_at, value_at
from carom.scene.tables.model import Contact

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts, Whole

METHODS = ("nsga", "moreau")
"""Methods in time whose contacts know a box that deforms."""
KEY = ("world", "deformation")
MOST_STRAIN = 0.1
"""Strain of the box in a step from which on its neighbours pass each other by a fifth of a radius."""


def check_deformation(parts: Parts) -> Iterator[Finding]:
    """Only what repeats deforms, by methods that follow it, and its lengths stay positive."""
    deformation = _of(parts)
    if deformation is None or parts.world is None:
        return
    periods = parts.world.periodic
    if periods is None or not any(periods):
        cure = "add periodic = [x, y, z] to [world], its lengths in m"
        call = "give Scene(..., periodic=(x, y, z)), its lengths in m"
        yield Finding(KEY, "deformation is given without periodic: there is no box that deforms", cure, call)
        return
    wrong = list(_axes(deformation, periods))
    yield from wrong
    if not wrong:
        yield from _laws(parts, deformation)
    method = parts.run.options().get("method", METHODS[0]) if parts.run is not None else METHODS[0]
    if method not in METHODS:
        cause = f"a periodic box that deforms needs method {' or '.join(METHODS)}, found {method}"
        yield Finding(("run", "method"), cause, "take one of them, or remove deformation")
    for section in ("inflow", "outlet", "spring", "drag", "load_function"):
        for i, _ in parts.entries[section]:
            cause = f"[[{section}]] does not go with a periodic box that deforms"
            yield Finding((section, i), cause, "remove it, or remove deformation")
    yield from _rough_walls(parts)
    for i, _ in parts.entries["joint"]:
        cause = "balls that are joined do not go along with a periodic box that deforms"
        yield Finding(("joint", i), cause, "make a [[clump]] of them, or remove deformation")


def _rough_walls(parts: Parts) -> Iterator[Finding]:
    """Walls stand, and do not flow: with friction they would tell the images of a ball apart."""
    walls = {wall.material: wall.name for wall in parts.walls()}
    for i, table in parts.tables(Contact):
        rough = any((table.friction, table.rolling_radius, table.spinning_radius))
        if rough and (of := sorted(walls.keys() & set(table.between))):
            wall = f"wall {quoted(walls[of[0]])}, of material {quoted(of[0])}"
            cause = f"friction at {wall}, which does not go along with a periodic box that deforms"
            cure = (
                "write friction = 0.0 here; where balls have this material too, give walls one of their own"
            )
            yield Finding(("contact", i, "friction"), cause, cure)


def advise_deformation(parts: Whole) -> Iterator[Finding]:
    """Neighbours pass each other in a step where it strains the box too far."""
    deformation, run = parts.world.deformation, parts.run
    if deformation is None:
        return
    worst = 0.0
    for time in parts.times():
        gradient = deformation.velocity_gradient(time, run.step)
        worst = max(worst, run.step * float(np.abs(gradient).max()))
    if MOST_STRAIN < worst < math.inf:
        cause = f"a step of {run.step:g} s strains the periodic box by {worst:.2g}: neighbours pass each other unnoticed"
        yield Finding(("run", "step"), cause, f"step = {run.step * MOST_STRAIN / worst:.1g} is safe")


def _of(parts: Parts) -> Deformation | None:
    return parts.world.deformation if parts.world is not None else None


def _axes(deformation: Deformation, periods: tuple[float, ...]) -> Iterator[Finding]:
    for k, law in enumerate(deformation.stretch or ()):
        if periods[k] == 0 and law != 1.0:
            cause = f"stretches {AXES[k]}, along which the world does not repeat"
            yield Finding((*KEY, "stretch", k), cause, f"write 1.0 there, or give a period along {AXES[k]}")
    for name in ("flow", "gradient") if deformation.shear is not None else ():
        axis = str(getattr(deformation, name))
        if periods[AXES.index(axis)] == 0:
            cause = f"{name} is along {axis}, along which the world does not repeat"
            yield Finding((*KEY, name), cause, f"take an axis that repeats, or give a period along {axis}")


def _laws(parts: Parts, deformation: Deformation) -> Iterator[Finding]:
    """Laws have values, and factors of lengths are above 0, at times spread over the run."""
    laws = [(law, ("stretch", k)) for k, law in enumerate(deformation.stretch or ())]
    shear = [] if deformation.shear is None else [(deformation.shear, ("shear",))]
    for law, place in (*laws, *shear):
        for time in parts.times():
            value = value_at(law, time)
            if not math.isfinite(value):
                cause = f"has no finite value at t = {time:.4g} s{fault_at(law, time)}"
                yield Finding((*KEY, *place), cause, "change the law, or end the run before")
                break
            if place[0] == "stretch" and value <= 0:
                cause = f"comes to {value:.4g} at t = {time:.4g} s, and a length stays above 0"
                yield Finding((*KEY, *place), cause, "change the law, or end the run before")
                break


def least_lengths(parts: Parts) -> list[tuple[float, float]]:
    """The shortest length of the periodic box along each axis, m, and when it is so, s; length 0 where nothing repeats."""
    periods = parts.periods or (0.0, 0.0, 0.0)
    deformation = _of(parts)
    stretch = deformation.stretch if deformation is not None else None
    found = []
    for period, law in zip(periods, stretch or (1.0, 1.0, 1.0), strict=True):
        times = parts.times() if isinstance(law, dict) and period else [0.0]
        values = np.array([value_at(law, t) for t in times])
        values = np.where(
            np.isfinite(values) & (values > 0), values, 1.0
        )  # others are reported by themselves
        least = int(values.argmin())
        found.append((period * float(values[least]), float(times[least])))
    return found
