"""Drag and dampers that are stiff for the step: they end a motion within it.

Speeds fall as `exp(-t/T)`, with `T = m/c` of the mass or inertia and the coefficient. With z = h/T the theta rule multiplies
them by `(1 - (1 - theta) z)/(1 + theta z)`: they change sign at each step from `z = 1/(1 - theta)` on, and ways are right.
The generalized-alpha scheme begins with the acceleration `-v/T`. Its step of the position, eq. 6a, then adds
`h^2 (beta - gamma/2) v/T` for ever, which is `(d z/2)^2` of the way `v T` with `d = (1 - rho_inf)/(1 + rho_inf)`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.scene.checks.carriers import springs
from carom.scene.messages import Finding
from carom.scene.tables.loads import ALL, Drag
from carom.scene.toml.lines import Path

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts, Whole

WRONG_WAY = 0.01
"""Error of the way of what is slowed that is told before a run."""
FLIPS = 2.0
"""Steps over decay times from which the generalized-alpha scheme and the theta rule of 1/2 change the sign of speeds."""
UNBALANCED, UNBALANCED_FIRST = 0.1, 0.03
"""Steps over decay times up to which the energy that drag takes is summed to 1e-3; that for the theta rule above 1/2."""
DECAYS = "motion decays in"
"""How the messages begin."""


def advise_decays(parts: Whole) -> Iterator[Finding]:
    """Drag and dampers that the method does not follow."""
    step, given = parts.run.step, parts.run.options()
    if given["method"] not in ("nsga", "moreau"):
        return  # penalty divides its steps, events has no drag
    rho, theta, half = given["spectral_radius"], given["theta"], 0.0
    if given["method"] == "moreau":
        most = 1.0 / (1.0 - theta) if theta < 1.0 else math.inf
        other = ", and so does theta = 1"
    else:
        half = 0.5 * (1.0 - rho) / (1.0 + rho)
        most = min(FLIPS, math.sqrt(WRONG_WAY) / half)
        clumps = any(segment.each for segment in parts.bodies().segments)  # which moreau does not have
        other = "" if clumps else ', and so does method = "moreau" with theta = 1'
    for path, time in decay_times(parts):
        if step > most * time:
            error = (half * step / time) ** 2
            what = ": velocities change sign at each step"
            if error > WRONG_WAY:
                what = f": what moves at the start goes {1.0 + error:.3g} times as far as it should"
            yield _finding(path, time, step, most, what, other)


def unbalanced(parts: Whole) -> Iterator[Finding]:
    """The drag or damper that is stiffest for the step, where energy shows it: the remark on a run that gained."""
    path, time = min(decay_times(parts), key=lambda one: one[1], default=(("run",), math.inf))
    given = parts.run.options()
    most = UNBALANCED_FIRST if given["method"] == "moreau" and given["theta"] > 0.5 else UNBALANCED
    if parts.run.step > most * time:
        yield _finding(path, time, parts.run.step, most)


def _finding(path: Path, time: float, step: float, most: float, what: str = "", other: str = "") -> Finding:
    cause = f"motion decays in {time:.3g} s, {time / step:.2g} steps of {step:g} s{what}"
    return Finding(path, cause, f"a step below {most * time:.2g} s follows it{other}")


def decay_times(parts: Parts) -> Iterator[tuple[Path, float]]:
    """Each coefficient of drag and dampers, and the shortest time in which it slows a body to 1/e, s."""
    bodies = parts.bodies()
    each = np.ones(len(bodies.names))
    for segment in bodies.segments:
        each[segment.start : segment.stop] = segment.each or 1
    for i, drag in parts.tables(Drag):
        of_all = drag.on == ALL
        on = slice(None) if of_all else [bodies.names.index(drag.on)]
        share = each if of_all else np.ones(len(each))  # of a ball in its clump
        for key, resists in (("translation", bodies.mass), ("rotation", bodies.inertia)):
            coefficient = getattr(drag, key)
            if coefficient > 0:
                yield ("drag", i, key), float((bodies.whole(resists) / share)[on].min()) / coefficient
    for i, spring, inverse in springs(parts):
        if spring.damping > 0:
            yield ("spring", i, "damping"), 1.0 / (spring.damping * inverse)
