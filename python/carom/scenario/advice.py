"""Warnings: what runs but may not be what was meant. Each says how to do better; none changes a number."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from carom.errors import quoted
from carom.scenario.checks import Parts, steps
from carom.scenario.model import Plane, World
from carom.scenario.problems import Finding
from carom.scenario.vectors import dot, scaled

WARN_TRAVEL = 0.05
"""Travel per step, in radii, above which hits are inaccurate (rule R6)."""
FINE_TRAVEL = 0.02
"""Travel per step, in radii, that accuracy runs should keep to."""


def advise(parts: Parts, world: World) -> Iterator[Finding]:
    """All warnings of a scenario that `check` found nothing wrong with."""
    yield from _step_length(parts)
    yield from _rounded_until(parts)
    yield from _never_rolls(parts)
    yield from _bounces(parts, world)
    yield from _heavy_shell(parts)


def _step_length(parts: Parts) -> Iterator[Finding]:
    run, bodies = parts.run, parts.bodies()
    if run is None or len(bodies.names) < 2:
        return  # planes are flat: only hits between spheres lose accuracy
    # the fastest ball relative to its size; another may come towards it as fast, which the limits allow for
    rate = np.sqrt((bodies.velocity**2).sum(axis=1)) / bodies.radius
    body = int(rate.argmax())
    travel = float(rate[body]) * run.step
    if travel > WARN_TRAVEL:
        ok, fine = _rounded_down(WARN_TRAVEL / rate[body]), _rounded_down(FINE_TRAVEL / rate[body])
        name = quoted(bodies.names[body])
        cause = f"a step of {run.step:g} s moves {name} by {travel:.2g} radii: oblique hits lose accuracy"
        yield Finding(
            ("run", "step"),
            cause + " and grazing ones may be missed",
            f"step = {ok:g} is safe, {fine:g} accurate",
        )


def _rounded_down(x: float) -> float:
    """`x` to one digit, not above it."""
    scale = 10.0 ** math.floor(math.log10(x))
    return float(f"{math.floor(x / scale * (1 + 1e-12)) * scale:.1g}")


def _rounded_until(parts: Parts) -> Iterator[Finding]:
    run = parts.run
    if run is not None and run.until is not None:
        end = steps(run) * run.step
        if abs(end - run.until) > 1e-6 * run.step:
            cause = f"until = {run.until:g} s is not a whole number of steps"
            yield Finding(("run", "until"), cause, f"the run ends at {end:.10g} s")


def _never_rolls(parts: Parts) -> Iterator[Finding]:
    bodies, names = parts.bodies(), parts.materials()
    smallest = {
        name: bodies.radius[bodies.material == i].min(initial=math.inf) for i, name in enumerate(names)
    }
    for i, law in parts.contacts():
        radius = min(smallest.get(name, math.inf) for name in law.between)
        limit = law.friction * radius
        if law.rolling_radius > 0 and math.isfinite(radius) and law.rolling_radius >= limit:
            cause = f"{law.rolling_radius:g} m is not below friction times radius, {limit:.4g} m"
            cause += ": a sliding ball never starts to roll"
            yield Finding(("contact", i, "rolling_radius"), cause, f"values below {limit:.2g} let balls roll")


def _bounces(parts: Parts, world: World) -> Iterator[Finding]:
    bodies, names = parts.bodies(), parts.materials()
    kinds = {names[k] for k in np.unique(bodies.material) if k >= 0}
    for i, law in parts.contacts():
        if law.restitution < 1:
            continue
        for _, plane in parts.planes():
            a, b = law.between
            meets = (a == plane.material and b in kinds) or (b == plane.material and a in kinds)
            if meets and _presses(plane, world):
                cause = f"e_N = 1 on plane {quoted(plane.name)} against gravity"
                cause += ": each bounce loses energy of the order of the step"
                yield Finding(
                    ("contact", i, "restitution"),
                    cause,
                    "use a shorter step if heights of many bounces matter",
                )
                break


def _presses(plane: Plane, world: World) -> bool:
    return dot(world.gravity, scaled(plane.normal)) < 0


def _heavy_shell(parts: Parts) -> Iterator[Finding]:
    bodies = parts.bodies()
    for segment in bodies.segments:
        k = segment.start
        hollow = 2.0 / 3.0 * bodies.mass[k] * bodies.radius[k] ** 2
        if bodies.inertia[k] > hollow * (1 + 1e-9):
            cause = f"{bodies.inertia[k]:.4g} kg m^2 is more than that of a hollow sphere ({hollow:.4g})"
            yield Finding(
                (segment.section, segment.index, "inertia"),
                cause,
                "check the units; 2/5 m r^2 is homogeneous",
            )
