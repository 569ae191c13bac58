"""Warnings: what runs but may not be what was meant. Each says how to do better; none changes a number."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from carom import _core
from carom.errors import quoted
from carom.scene.checks.attachments import advise_loads
from carom.scene.checks.bounces import advise_bounces
from carom.scene.checks.curved_walls import advise_curved, below
from carom.scene.checks.decay import advise_decays
from carom.scene.checks.deformation import advise_deformation
from carom.scene.checks.energy_gain import advise_gain
from carom.scene.checks.falls import Limit, step_before_planes, step_of_falls
from carom.scene.checks.flow import advise_flow
from carom.scene.checks.joint_contacts import advise_joint_contacts
from carom.scene.checks.joint_start import advise_start
from carom.scene.checks.moving_walls import advise_joint_laws, advise_walls
from carom.scene.checks.piles import advise_piles
from carom.scene.checks.rules import Whole, steps
from carom.scene.messages import Finding
from carom.scene.plan import STEP_BYTES, Plan
from carom.scene.tables.laws import value_at
from carom.scene.tables.options import OPTIONS, STEPPING

WARN_TRAVEL = 0.05
"""Travel per step, in radii, above which hits are inaccurate (rule R6)."""
FINE_TRAVEL = 0.02
"""Travel per step, in radii, that accuracy runs should keep to."""
MASS_RATIO = 1e4
"""Heaviest over lightest ball up to which solvers work as they do among equals. Columns of 6 to 40 balls hit by a heavy one
at 3 m/s: at 1e4 every step takes a fallback and the energy rises by up to 1e-6 of itself, at 1e8 by 1e-4, at 1e10 by 1e-2.
"""
MOST_FRICTION = 10.0
"""Coefficient of friction above which a number is taken for a slip of the pen. Dry solids stay below 1.5 and rubber below 4;
what adheres (clean metals in vacuum, gels) reaches more, but does not obey Coulomb. At 10 a contact slips only where it is
loaded within 6 degrees of its plane: the run is that of contacts that stick.
"""
LARGE_RESULTS = 5e9
"""Bytes of frames or of the table of steps that are announced before a run."""


def advise(parts: Whole) -> Iterator[Finding]:
    """All warnings of a scenario that `check` found nothing wrong with."""
    yield from _step_length(parts)
    if not _has_substeps(parts):
        yield from advise_curved(parts)
        yield from advise_piles(parts)
        yield from advise_bounces(parts)
    yield from _other_methods(parts)
    yield from _rounded_until(parts)
    yield from _large_results(parts)
    yield from _much_friction(parts)
    yield from _never_rolls(parts)
    yield from advise_gain(parts)
    yield from _heavy_shell(parts)
    yield from _mass_ratio(parts)
    yield from advise_start(parts)
    yield from advise_joint_contacts(parts)
    yield from advise_loads(parts)
    yield from advise_decays(parts)
    yield from advise_walls(parts)
    yield from advise_joint_laws(parts)
    yield from advise_flow(parts)
    yield from advise_deformation(parts)


def _other_methods(parts: Whole) -> Iterator[Finding]:
    """Options and keys of contacts that are set and that the method does not read."""
    given, usual = parts.run.options(), _core.defaults()
    unread: list[tuple[tuple[str | int, ...], tuple[str, ...]]] = [
        (("run", name), option.methods)
        for name, option in OPTIONS.items()
        if given["method"] not in option.methods and given[name] != usual[name]
    ]
    if given["method"] not in STEPPING:
        ratios = [i for i, law in parts.contacts() if law.stiffness_ratio != 1]
        unread += [(("contact", i, "stiffness_ratio"), STEPPING) for i in ratios]
    for place, methods in unread:
        cause = f"method {given['method']} does not read it"
        yield Finding(place, cause, f"leave it out, or set method = {' or '.join(map(quoted, methods))}")


def _has_substeps(parts: Whole) -> bool:
    """Whether the method divides the steps by itself: what is said of their length does not hold for it."""
    return parts.run.options()["method"] in ("penalty", "events")


def _step_length(parts: Whole) -> Iterator[Finding]:
    if _has_substeps(parts):  # which see every contact
        return
    told = [*_step_of_hits(parts), *step_before_planes(parts), *step_of_falls(parts)]
    if told:
        yield min(told, key=lambda one: one[0])[1]  # what is safe for it is safe for the others


def _step_of_hits(parts: Whole) -> Iterator[Limit]:
    """The fastest ball relative to its size; another may come towards it as fast, which the limits allow for."""
    run, bodies = parts.run, parts.bodies()
    rate = np.sqrt((bodies.velocity**2).sum(axis=1)) / bodies.radius
    body = int(rate.argmax())
    travel = float(rate[body]) * run.step
    if len(bodies.names) > 1 and travel > WARN_TRAVEL:
        ok, fine = below(WARN_TRAVEL / rate[body]), below(FINE_TRAVEL / rate[body])
        name = quoted(bodies.names[body])
        cause = f"a step of {run.step:g} s moves {name} by {travel:.2g} radii: oblique hits lose accuracy"
        cause += " and grazing ones may be missed"
        yield ok, Finding(("run", "step"), cause, f"step = {ok:g} is safe, {fine:g} accurate")


def _rounded_until(parts: Whole) -> Iterator[Finding]:
    end = steps(parts.run) * parts.run.step
    if end - parts.until > 1e-6 * parts.run.step:
        until, step = parts.until, parts.run.step
        cure = f"the run ends at {end:.10g} s"
        if parts.run.options()["method"] == "events":
            cause = f"until = {until:g} s is not a whole number of frames, which are {step:g} s apart"
            yield Finding(("run", "until"), cause, cure)
        else:
            cause = f"until = {until:g} s is not a whole number of steps"
            yield Finding(("run", "until"), cause, cure)


def _large_results(parts: Whole) -> Iterator[Finding]:
    plan = Plan.of(parts.until, parts.run.step, parts.record.every, parts.record.contacts)
    rows, frames = (
        plan.steps * STEP_BYTES,
        plan.steps // plan.every * plan.frame_bytes(len(parts.bodies().names)),
    )
    if rows > LARGE_RESULTS:
        cause = (
            f"{plan.steps:.3g} steps write about {rows / 1e9:.3g} GB: each has a row in the table of steps"
        )
        yield Finding(
            ("run", "until"), cause, "give a longer step or a shorter until, or keep so much space free"
        )
    if frames > LARGE_RESULTS:
        cause = f"frames with contacts and motion of every ball take up to about {frames / 1e9:.3g} GB"
        yield Finding(
            ("record", "every"), cause, "give a larger every, or contacts = false, or keep so much space free"
        )


def _much_friction(parts: Whole) -> Iterator[Finding]:
    for i, law in parts.contacts():
        mu = value_at(law.friction, 0.0)
        if mu > MOST_FRICTION:
            cause = (
                f"{mu:g} is above {MOST_FRICTION:g}, more than any pair of solids has: such contacts stick"
            )
            yield Finding(
                ("contact", i, "friction"), cause, "dry solids have 0.1 to 1.5 (0.3 for 30 %), rubber up to 4"
            )


def _never_rolls(parts: Whole) -> Iterator[Finding]:
    bodies, names = parts.bodies(), parts.materials()
    single = bodies.clump < 0
    smallest = {
        name: bodies.radius[single & (bodies.material == i)].min(initial=math.inf)
        for i, name in enumerate(names)
    }
    for i, law in parts.contacts():
        radius = min(smallest.get(name, math.inf) for name in law.between)
        if law.rolling_radius == 0 or not math.isfinite(radius):  # of two walls
            continue
        limit = value_at(law.friction, 0.0) * radius
        if law.rolling_radius >= limit:
            cause = f"{law.rolling_radius:g} m is not below friction times radius, {limit:.4g} m"
            cause += ": a sliding ball never starts to roll"
            yield Finding(("contact", i, "rolling_radius"), cause, f"values below {limit:.2g} let balls roll")


def _mass_ratio(parts: Whole) -> Iterator[Finding]:
    bodies = parts.bodies()
    if _has_substeps(parts) or len(bodies.names) < 2:
        return
    mass = bodies.whole_mass
    heavy, light = int(mass.argmax()), int(mass.argmin())
    ratio = mass[heavy] / mass[light]
    if ratio > MASS_RATIO:
        section, index = bodies.origin(heavy)
        cause = (
            f"{quoted(bodies.names[heavy])} has {ratio:.2g} times the mass of {quoted(bodies.names[light])}"
        )
        cause += f", more than {MASS_RATIO:g}: contacts of both are solved slowly, and energy may rise"
        cure = "check the units; else look at energy.max_rise and unconverged of the summary"
        yield Finding((section, index, "mass"), cause, cure)


def _heavy_shell(parts: Whole) -> Iterator[Finding]:
    bodies = parts.bodies()
    for segment in bodies.segments:
        if segment.each:  # the inertia is that of the whole clump
            continue
        k = segment.start
        hollow = 2.0 / 3.0 * bodies.mass[k] * bodies.radius[k] ** 2
        if bodies.inertia[k] > hollow * (1 + 1e-9):
            cause = f"{bodies.inertia[k]:.4g} kg m^2 is more than that of a hollow sphere ({hollow:.4g})"
            yield Finding(
                (segment.section, segment.index, "inertia"),
                cause,
                "check the units; 2/5 m r^2 is homogeneous",
            )
