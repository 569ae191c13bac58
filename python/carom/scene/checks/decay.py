"""Drag and dampers that are stiff for the step: they end a motion within it.

Speeds fall as `exp(-t/T)`, with `T = m/c` of the mass or inertia and the coefficient. With z = h/T the theta rule multiplies
them by `(1 - (1 - theta) z)/(1 + theta z)`: they change sign at each step from `z = 1/(1 - theta)` on, and ways are right.
The generalized-alpha scheme begins with the acceleration `-v/T`. Its step of the position, eq. 6a, then adds
`h^2 (beta - gamma/2) v/T` for ever, which is `(d z/2)^2` of the way `v T` with `d = (1 - rho_inf)/(1 + rho_inf)`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.mechanics import numbers
from carom.scene.checks.carriers import Carrier, Carriers, clump_carrier, springs
from carom.scene.messages import Finding
from carom.scene.tables.flow import Inflow
from carom.scene.tables.loads import ALL, Drag
from carom.scene.toml.lines import Path

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts, Whole

WRONG_WAY = 0.01
"""Error of the way of what is slowed that is told before a run."""
FLIPS = 2.0
"""Steps over decay times from which speeds overshoot 0 in the first steps of the generalized-alpha scheme."""
UNBALANCED, UNBALANCED_FIRST = 0.1, 0.03
"""Steps over decay times up to which the energy that drag takes is summed to 1e-3; that for the theta rule above 1/2."""
DECAYS = "motion decays in"
"""How the messages begin."""
Dampers = dict[int, list[tuple[int, Carrier, F64]]]
"""By the number of a body those at it: place of the table, the body, and the root (6,) of what it adds to `_rates`."""


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
    path, time = shortest_decay(parts)
    if step > most * time:
        error = (half * step / time) ** 2
        what = ": velocities change sign at each step" if half == 0.0 else ": velocities overshoot 0"
        if error > WRONG_WAY:
            what = f": what moves at the start goes {1.0 + error:.3g} times as far as it should"
        yield _finding(path, time, step, most, what, other, "its way to 1 %" if half else "it")


def unbalanced(parts: Whole) -> Iterator[Finding]:
    """The drag or damper that is stiffest for the step, where energy shows it: the remark on a run that gained."""
    path, time = shortest_decay(parts)
    given = parts.run.options()
    most = UNBALANCED_FIRST if given["method"] == "moreau" and given["theta"] > 0.5 else UNBALANCED
    if parts.run.step > most * time:
        yield _finding(path, time, parts.run.step, most)


def _finding(
    path: Path, time: float, step: float, most: float, what: str = "", other: str = "", follows: str = "it"
) -> Finding:
    cause = f"motion decays in {time:.3g} s, {time / step:.2g} steps of {step:g} s{what}"
    return Finding(path, cause, f"a step below {most * time:.2g} s follows {follows}{other}")


def shortest_decay(parts: Parts) -> tuple[Path, float]:
    """Which drag or damper takes most power of the motion that decays fastest, and the time in which it falls to 1/e, s.

    A body slows by all drags and dampers at once, and drag on the balls of a clump brakes its turning by their arms. The
    two ends of a damper are taken to move against each other: of balls in a chain that is the stiffest motion.
    """
    drags, bodies = parts.tables(Drag), parts.bodies()
    dampers: Dampers = defaultdict(list)
    for held in springs(parts):
        for carrier, lever in held.ends:
            if held.spring.damping > 0:
                root = math.sqrt(held.spring.damping * held.inverse_mass / float(lever @ lever))
                dampers[carrier.number].append((held.number, carrier, root * lever))
    number = numbers(bodies) if drags else {}
    places = [slice(None) if drag.on == ALL else [number[drag.on]] for _, drag in drags]
    slows = np.zeros((2, len(bodies.names)))
    for (_, drag), on in zip(drags, places, strict=True):
        slows[:, on] += [[drag.translation], [drag.rotation]]
    fastest: tuple[float, F64, Carrier] | None = None
    for carrier in _slowed(parts, slows, dampers):
        rates, motions = np.linalg.eigh(_rates(carrier, slows, dampers))
        if rates[-1] > (fastest[0] if fastest else 0.0):
            fastest = float(rates[-1]), motions[:, -1], carrier
    if fastest is None:
        return ("run",), math.inf
    rate, motion, carrier = fastest
    spin = motion[3:] / np.sqrt(carrier.moments)
    velocity = motion[:3] / np.sqrt(carrier.mass) + np.cross(spin, carrier.arms)  # of its balls, (n, 3)
    power: dict[Path, float] = {}
    for (i, drag), on in zip(drags, places, strict=True):
        its = on if isinstance(on, slice) else [k - carrier.number for k in on if k in carrier.balls]
        power["drag", i, "translation"] = drag.translation * float((velocity[its] ** 2).sum())
        power["drag", i, "rotation"] = drag.rotation * float(spin @ spin) * len(velocity[its])
    for i, _, slowing in dampers.get(carrier.number, ()):
        power["spring", i, "damping"] = float(slowing @ motion) ** 2
    return max(power, key=lambda path: power[path]), 1.0 / rate


def _slowed(parts: Parts, slows: F64, dampers: Dampers) -> Iterator[Carrier]:
    """Bodies among which the one is that slows fastest: of free balls one, of clumps and of what dampers hold all."""
    bodies, carriers = parts.bodies(), Carriers(parts)
    yield from (held[0][1] for held in dampers.values())
    rate = np.where(bodies.clump < 0, np.maximum(slows[0] / bodies.mass, slows[1] / bodies.inertia), 0.0)
    if rate.any():
        yield carriers.of(int(rate.argmax()))
    inflows = dict(parts.tables(Inflow))
    for segment in bodies.segments:
        if not segment.each or not slows[:, segment.start : segment.stop].any():
            continue
        if segment.section != Inflow.section:
            yield carriers.of(segment.start)
            continue
        its = slows[:, segment.start : segment.stop].reshape(2, -1, segment.each).swapaxes(0, 1)
        shape = inflows[segment.index].shape()
        assert shape is not None  # an inflow of balls has no segment with `each`
        for clump in np.unique(its, axis=0, return_index=True)[1].tolist():  # those with other drag
            start = segment.start + clump * segment.each
            yield clump_carrier(range(start, start + segment.each), shape)


def _rates(carrier: Carrier, slows: F64, dampers: Dampers) -> F64:
    """Of a body (6, 6), 1/s: by what `sqrt(m) v` and `sqrt(J) w` fall, both in the principal axes."""
    still, turn = np.zeros((3, 3)), np.diag(1.0 / np.sqrt(carrier.moments))
    translation, rotation = slows[:, carrier.number : carrier.number + len(carrier.arms)]
    rates = rotation.sum() * np.block([[still, still], [still, turn * turn]])
    for arm, drag in zip(carrier.arms, translation.tolist(), strict=True):
        moves = np.hstack([np.eye(3) / math.sqrt(carrier.mass), np.cross(turn, arm).T])
        rates += drag * moves.T @ moves
    for _, _, slowing in dampers.get(carrier.number, ()):
        rates += np.outer(slowing, slowing)
    return np.asarray(rates)
