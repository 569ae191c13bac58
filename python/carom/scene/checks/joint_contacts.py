"""Joints that take the load of a contact (rule R10): then no force presses there, and friction has nothing to act on.

A contact holds the motion of two bodies along its normal. Where the joints of these bodies hold the same motion, alone or
together, the force is theirs or is shared in a way that nothing determines. At a free wall it is what presses the wall.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from itertools import takewhile
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from carom.arrays import F64
from carom.errors import quoted
from carom.scene.assembly.distances import gaps, normals
from carom.scene.assembly.mechanics import Rows
from carom.scene.checks.carriers import Carrier
from carom.scene.checks.joint_start import MOST_ROWS, Group, groups
from carom.scene.checks.overlap import overlaps
from carom.scene.checks.walls import called
from carom.scene.messages import Finding
from carom.scene.tables.joints import Joint, default_name
from carom.scene.tables.laws import value_at
from carom.scene.tables.model import Contact
from carom.scene.tables.walls import PLANE

if TYPE_CHECKING:
    from carom.scene.assembly.placing import Placed
    from carom.scene.checks.rules import Whole

TOUCHING = 1e-6
"""Gap, in radii, up to which a contact counts as closed: joints keep a gap, so that a rounded position never closes."""
HELD = 1e-6
"""Part of a unit row that joints do not hold, up to which they hold it. Beyond it, they and the contact jam."""
SHARE = 1e-6
"""Part of the load, over the largest, from which a joint takes part in it."""
FINER = 1000
"""Parts of the time between two looks at laws to which it is told when a contact closes."""
MOST_NAMED = 3
"""Joints that one message names."""
MOST_TOLD = 20
"""Contacts that a message lists."""


class Joined(NamedTuple):
    """The joints of a scene."""

    around: dict[int, list[Group]]
    """The groups of joints of each body that has some, by its number (`Carrier.number`)."""
    carrier: dict[int, Carrier]
    """Of each ball of these bodies."""
    rows: dict[int, Rows]
    """By number of the joint."""


class Touch(NamedTuple):
    """A contact between a ball and a wall or a second ball."""

    a: int
    b: int | None
    normal: F64
    """From b (or the wall) to a, (3,)."""
    gap: float
    """m."""
    wall: Placed | None
    other: str
    """What a touches, with its material."""
    material: str


def advise_joint_contacts(parts: Whole) -> Iterator[Finding]:
    """Joints that hold the normal of a contact whose friction is wanted, each contact with its joints."""
    if not parts.entries["joint"]:
        return
    systems = Joined({}, {}, {})
    for group in groups(parts, MOST_ROWS):
        systems.rows.update(group.joints)
        for body in group.bodies:
            systems.around.setdefault(body.number, []).append(group)
            systems.carrier.update(dict.fromkeys(body.balls, body))
    entries = dict(parts.tables(Joint))
    told = 0
    for touch in _touches(parts, systems):
        found = _taken(parts, systems, touch)
        if found is None:
            continue
        joints, time, through = found
        names = [quoted(entries[i].name or default_name(i)) for i in joints[:MOST_NAMED]]
        listed = ", ".join(names) + (
            f" and {len(joints) - MOST_NAMED} more" if len(joints) > MOST_NAMED else ""
        )
        a = quoted(parts.bodies().names[touch.a])
        when = "" if time is None else f" from t = {time:.4g} s on"
        if through:
            cause = f"{listed} holds {a} against {touch.other}{when}, and neither gives way"
            cure = (
                f"leave the direction of that contact free in {names[0]}, or end the run or the motion before"
            )
            yield Finding(("joint", joints[0]), cause, cure)
        else:
            cause = f"{listed} can take the load of the contact of {a} with {touch.other}{when}"
            cause += ": friction there vanishes or is undetermined"
            cure = f"leave the direction of that contact free in {names[0]}, or give the two materials no friction"
            yield Finding(("joint", joints[0]), cause, cure)
        told += 1
        if told == MOST_TOLD:
            return


def _touches(parts: Whole, systems: Joined) -> Iterator[Touch]:
    """Contacts of balls with joints that are closed at the start, or that prescribed motion could close."""
    bodies, materials = parts.bodies(), parts.materials()
    held = sorted(systems.carrier)
    driven = any(_moves(systems, joint) for joint in systems.rows)
    there = np.array(held)
    position, radius = bodies.position[there], bodies.radius[there]
    for wall in (wall for wall in parts.walls() if wall.free is None):
        gap = gaps(wall, position, radius)
        for k in np.flatnonzero(
            (gap <= TOUCHING * radius) | (wall.kind == PLANE and (driven or wall.motion is not None))
        ).tolist():
            normal = normals(wall, position[k : k + 1])[0]
            yield Touch(held[k], None, normal, float(gap[k]), wall, called(wall), wall.material)
    no_contact = parts.no_contact(there)
    for i, j, apart in overlaps(position, radius, -TOUCHING, MOST_ROWS, parts.periods, no_contact):
        a, b = held[i], held[j]
        away = bodies.position[a] - bodies.position[b]
        for k, period in enumerate(parts.periods or ()):
            away[k] -= period * round(away[k] / period) if period else 0.0
        normal, other = away / np.linalg.norm(away), quoted(bodies.names[b])
        yield Touch(a, b, normal, apart, None, other, materials[bodies.material[b]])


def _taken(parts: Whole, systems: Joined, touch: Touch) -> tuple[list[int], float | None, bool] | None:
    """The joints that take its load, since when if not from the start, and whether they go on through the contact; None if
    they leave the contact its load, or it has none to act on.
    """
    bodies = parts.bodies()
    law = _law(parts, parts.materials()[bodies.material[touch.a]], touch.material)
    if law is None:
        return None
    load = _share(systems, _row(parts, systems, touch, touch.normal, np.zeros(3)))
    if load is None:
        return None
    least = TOUCHING * float(bodies.radius[touch.a])
    through = _closes(parts, systems, touch, load, -least)
    time = through if touch.gap <= least else _closes(parts, systems, touch, load, least)
    if through is None:
        open_ = touch.gap > least and time is None
        if open_ or all(_at_rest(systems, row) for row in _slips(parts, systems, touch, law)):
            return None
    return sorted(load, key=lambda joint: -np.abs(load[joint]).max()), time, through is not None


def _row(parts: Whole, systems: Joined, touch: Touch, at_point: F64, turning: F64) -> dict[int, F64]:
    """Row over (v, w) of both bodies: of the velocity of the contact point along a direction, and of the turn."""
    row, bodies = {}, parts.bodies()
    for ball, sign in ((touch.a, 1.0), (touch.b, -1.0)):
        if ball is not None:
            body = systems.carrier[ball]
            lever = -sign * bodies.radius[ball] * touch.normal
            if body.axes is not None:
                lever = lever + bodies.position[ball] - body.centre
            turned = body.turning(np.cross(lever, at_point) + turning)
            row[body.number] = sign * np.concatenate([at_point, turned])
    return row


def _slips(parts: Whole, systems: Joined, touch: Touch, law: Contact) -> Iterator[dict[int, F64]]:
    """The motions that the load of this contact would brake."""
    n, none = touch.normal, np.zeros(3)
    across = np.linalg.svd(n[None])[2][1:]
    if _friction(law):
        yield from (_row(parts, systems, touch, t, none) for t in across)
    if law.rolling_radius:
        yield from (_row(parts, systems, touch, none, t) for t in across)
    if law.spinning_radius:
        yield _row(parts, systems, touch, none, n)


def _friction(law: Contact) -> bool:
    return isinstance(law.friction, dict) or law.friction > 0


def _law(parts: Whole, *pair: str) -> Contact | None:
    return next((law for _, law in parts.contacts() if sorted(law.between) == sorted(pair)), None)


def _share(systems: Joined, row: dict[int, F64]) -> dict[int, F64] | None:
    """What the rows of each joint add to a row, by number of the joint; None if the joints do not hold it."""
    for system in systems.around[next(iter(row))]:
        if all(system.place(body) is not None for body in row):
            found = _share_of(system, row)
            if found is not None:
                return found
    if len(row) == 1:
        return None
    found = {}
    for body, part in row.items():  # both ends may be held by different joints
        share = _share(systems, {body: part})
        if share is None:
            return None
        found.update(share)
    return found


def _share_of(system: Group, row: dict[int, F64]) -> dict[int, F64] | None:
    root = np.sqrt(system.mass)
    wanted = np.zeros(len(root))
    for k, body in enumerate(system.bodies):
        if body.number in row:
            wanted[6 * k : 6 * k + 6] = row[body.number]
    matrix, wanted = (system.gradient / root).T, wanted / root
    size = np.linalg.norm(matrix, axis=0)
    factor = np.linalg.lstsq(matrix / size, wanted, rcond=HELD**2)[0]
    if np.linalg.norm(matrix / size @ factor - wanted) > HELD * np.linalg.norm(wanted):
        return None
    found, start = {}, 0
    for joint, of in system.joints:
        here = slice(start, start + len(of.rows))
        start += len(of.rows)
        if np.abs(factor[here]).max(initial=0.0) > SHARE * np.abs(factor).max():
            found[joint] = factor[here] / size[here]
    return found


def _at_rest(systems: Joined, row: dict[int, F64]) -> bool:
    """Whether the joints hold this motion, too, and let nothing move: then there is nothing to brake."""
    share = _share(systems, row)
    return share is not None and not any(_moves(systems, joint) for joint in share)


def _moves(systems: Joined, joint: int) -> bool:
    return any(isinstance(row.law, dict) for row in systems.rows[joint].rows)


def _closes(parts: Whole, systems: Joined, touch: Touch, load: dict[int, F64], least: float) -> float | None:
    """When the joints bring the gap of a contact with a plane down to the least, s; None if they don't."""
    wall = touch.wall
    if wall is None or (wall.motion is not None and wall.motion.rotation is not None):
        return None
    rows = {i: systems.rows[i].rows for i in load}
    laws = [(c, row.law) for i, share in load.items() for c, row in zip(share, rows[i], strict=True)]
    if any(row.kind == "distance" for listed in rows.values() for row in listed):
        return None  # a rod turns, and holds another direction then
    laws += [
        (-n, law)
        for n, law in zip(touch.normal, (wall.motion and wall.motion.translation) or (), strict=False)
    ]
    if not any(isinstance(law, dict) for _, law in laws):
        return None

    def reached(time: float) -> bool:
        way = sum(c * (value_at(law, time) - value_at(law, 0.0)) for c, law in laws)
        return float(touch.gap + way) <= least

    there = (wall.motion and wall.motion.until) or math.inf
    before = 0.0
    for time in takewhile(lambda time: time < there, parts.times()):
        if reached(time):
            between = np.linspace(before, time, FINER + 1).tolist()
            return float(between[max(0, bisect_left(between, True, key=reached) - 1)])
        before = time
    return None
