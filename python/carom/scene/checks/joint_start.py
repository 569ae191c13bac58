"""Whether the start agrees with the joints: their points, their laws at t = 0, and the velocities.

The first step would mend any disagreement by a jump of the positions or an impulse, which nobody asked for. What is
more than rounding gets advice, what is more than a rounded number can explain is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, connected
from carom.errors import quoted
from carom.scene.assembly.bodies import Bodies
from carom.scene.assembly.mechanics import GROUND_INDEX, Row, Rows, joint_rows, numbers, spring_ends
from carom.scene.checks.carriers import Carrier, Carriers
from carom.scene.messages import Finding
from carom.scene.tables.joints import Joint, default_name
from carom.scene.tables.laws import slope_at, value_at
from carom.scene.tables.loads import Spring

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts

REFUSED, ADVISED = 1e-3, 1e-6
"""Disagreement, relative to what is compared, that is an error or worth a warning: numbers in a file are often
rounded to a few digits, and the first step mends that without harm."""
AT_ZERO = 1e-6
"""Displacement (in radii) and angle (rad) at t = 0 that counts as zero."""
UNNOTICED = 1e-9
"""Travel in a step (in radii) or turn in a step (rad) that nobody notices: what counts as touching."""
DEPENDENT = 1e-8
"""Part of a unit row that the rows before it do not explain, below which it counts as dependent."""
MOST_ROWS = 600
"""Rows of bodies joined together up to which their velocities are fitted together; beyond, joint by joint."""

MOST_FITTED = 3
"""Bodies whose fitting velocities one message gives."""


def check_start(parts: Parts) -> Iterator[Finding]:
    """What forbids a run; all names are known by now."""
    bodies = parts.bodies()
    if not parts.entries["joint"] and not parts.entries["spring"]:
        return
    number = numbers(bodies)
    wrong = False
    for i, joint in parts.tables(Joint):
        for finding in _laws_at_zero(i, joint, bodies, joint_rows(joint, bodies, number)):
            wrong = True
            yield finding
    for i, spring in parts.tables(Spring):
        *_, point_a, point_b = spring_ends(spring, bodies, number)
        if spring.rest_length and np.array_equal(point_a, point_b):
            cause = "both ends of the spring are at the same point, so that it has no direction"
            yield Finding(("spring", i, "points"), cause, "move one of them, or give rest_length = 0.0")
    if not wrong:
        yield from (m.finding() for m in _mismatches(parts) if m.relative > REFUSED)


def advise_start(parts: Parts) -> Iterator[Finding]:
    """What the first step will mend, and joints that say the same thing twice."""
    bodies = parts.bodies()
    if not parts.entries["joint"]:
        return
    number = numbers(bodies)
    for i, joint in parts.tables(Joint):
        if joint.length is not None:
            yield from _length(i, joint, joint_rows(joint, bodies, number).rows[0], ADVISED)
    yield from (m.finding() for m in _mismatches(parts) if m.relative > ADVISED)
    yield from _redundant(parts)


# --- points and laws --------------------------------------------------------------------------------------------------


def _laws_at_zero(i: int, joint: Joint, bodies: Bodies, of: Rows) -> Iterator[Finding]:
    if joint.type == "rod":
        row = of.rows[0]
        if np.array_equal(row.point_a, row.point_b):
            cure = "move one of them, or use a joint of type ball"
            yield Finding(("joint", i, "points"), "both ends of the rod are at the same point", cure)
        elif joint.length is not None:
            yield from _length(i, joint, row, REFUSED)
    for key, unit, most in (("displacement", "m", AT_ZERO * bodies.radius[of.a]), ("angle", "rad", AT_ZERO)):
        law = getattr(joint, key)
        if law is not None and abs(start := value_at(law, 0.0)) > most:
            cause = f"is {start:.6g} {unit} at t = 0, but counts from the start"
            yield Finding(("joint", i, key), cause, f"subtract {start:.9g} from the law")


def _length(i: int, joint: Joint, row: Row, most: float) -> Iterator[Finding]:
    """The length of a rod at t = 0 against the distance of its ends, to within a part `most` of it."""
    assert joint.length is not None
    distance, length = math.dist(row.point_a, row.point_b), value_at(joint.length, 0.0)
    if abs(length - distance) > most * distance:
        cause = f"is {length:.9g} m at t = 0, but the ends are {distance:.9g} m apart"
        law = "a law that begins with" if isinstance(joint.length, dict) else "length ="
        leave = "" if isinstance(joint.length, dict) else ", or leave length out"
        yield Finding(("joint", i, "length"), cause, f"move a sphere, or give {law} {distance:.9g}{leave}")


# --- velocities -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mismatch:
    """The row of a joint that the velocities at the start violate most, and velocities that would not."""

    index: int
    relative: float
    """Wrong speed over the speeds that it is the difference of."""
    cause: str
    cure: str

    def finding(self) -> Finding:
        return Finding(("joint", self.index), self.cause, self.cure)


@dataclass(frozen=True)
class Group:
    """Joints that share bodies, as the linear system `G u = c'` in the velocities of these bodies at the start."""

    joints: list[tuple[int, Rows]]
    bodies: list[Carrier]
    gradient: F64  # (R, 6 B): of the rows over (v, w) of each body, of a clump w along its principal axes
    velocity: F64  # (6 B,) m/s and rad/s
    rate: F64  # (R,) c'(0), m/s or rad/s
    doubt: F64  # (R,) error of the rate, where it is a difference
    scale: F64  # (R,) sum of the sizes of the terms
    mass: F64  # (6 B,) kg and kg m^2
    size: F64  # (R,) radius of body a, m, of rotations 1

    def place(self, number: int) -> int | None:
        """Where a body of this number is among all."""
        return next((k for k, body in enumerate(self.bodies) if body.number == number), None)


def _mismatches(parts: Parts) -> Iterator[Mismatch]:
    bodies = parts.bodies()
    step = parts.run.step if parts.run is not None else 0.0  # without it nothing is known of laws either
    for group in groups(parts, MOST_ROWS):
        excess = group.gradient @ group.velocity - group.rate
        # what the difference quotient leaves open is given to the author of the law, and so is rounding of nothing:
        # a velocity computed as w x r is 1e-17 rather than 0 where the two are parallel
        beyond = np.maximum(0.0, np.abs(excess) - 10.0 * group.doubt)
        beyond[beyond * step < UNNOTICED * group.size] = 0.0
        relative = np.divide(beyond, group.scale, out=np.zeros_like(beyond), where=group.scale > 0)
        if relative.max(initial=0.0) <= ADVISED:
            continue
        fitting = _fitted(group, excess)
        start = 0
        for index, of in group.joints:
            here = slice(start, start + len(of.rows))
            start += len(of.rows)
            k = int(relative[here].argmax())
            if relative[here][k] > ADVISED:
                found, wanted = excess[here][k] + group.rate[here][k], group.rate[here][k]
                cause = (
                    f"{_measure(of, k, bodies)} is {found:.6g} at the start, the joint asks for {wanted:.6g}"
                )
                yield Mismatch(index, float(relative[here][k]), cause, _cure(group, of, fitting))


def _fitted(group: Group, excess: F64) -> F64 | None:
    """The velocities nearest to those given (in kinetic energy) that fit all rows; None if there are none."""
    root = np.sqrt(group.mass)
    scaled = group.gradient / root
    change = np.linalg.lstsq(scaled, -excess, rcond=None)[0] / root
    fitted: F64 = group.velocity + change
    left = np.abs(group.gradient @ change + excess) - 10.0 * group.doubt
    size = group.scale + np.abs(group.gradient) @ np.abs(fitted)
    return fitted if left.max() <= ADVISED * size.max() else None


def _measure(of: Rows, k: int, bodies: Bodies) -> str:
    row = of.rows[k]
    a = quoted(bodies.names[of.a])
    b = "" if of.b == GROUND_INDEX else f" against {quoted(bodies.names[of.b])}"
    if row.kind == "distance":
        other = "the ground" if of.b == GROUND_INDEX else quoted(bodies.names[of.b])
        return f"the speed (m/s) at which the ends on {a} and {other} part"
    along = f"[{', '.join(f'{x:.4g}' for x in row.direction)}]"
    if row.kind == "rotation":
        return f"the angular speed (rad/s) of {a}{b} about {along}"
    return f"the speed (m/s) of the point of {a}{b} along {along}"


def _cure(group: Group, of: Rows, fitting: F64 | None) -> str:
    """Velocities that fit all joints of the group at once, those of the joint's own bodies first."""
    if fitting is None:
        return "no velocities fit all joints of these bodies: they contradict each other, compare their laws"
    own = [ball for ball in (of.a, of.b) if ball != GROUND_INDEX]
    order = sorted(
        range(len(group.bodies)),
        key=lambda k: next((i for i, ball in enumerate(own) if ball in group.bodies[k].balls), len(own)),
    )
    noise = 1e-12 * max(np.abs(fitting).max(), np.abs(group.velocity).max())
    written: list[str] = []
    changed = 0
    for k in order:
        body, found = group.bodies[k], []
        for key, part in (
            ("velocity", slice(6 * k, 6 * k + 3)),
            ("angular_velocity", slice(6 * k + 3, 6 * k + 6)),
        ):
            new, old = fitting[part], group.velocity[part]
            if np.abs(new - old).max() > noise:
                new = body.turning_back(new) if key == "angular_velocity" else new
                listed = ", ".join(f"{0.0 if abs(x) < noise else x:.9g}" for x in new)
                found.append(f"{key} = [{listed}] of {quoted(body.name)}")
        changed += bool(found)
        if changed <= MOST_FITTED:
            written += found
    more = f" (and others of {changed - MOST_FITTED} more)" if changed > MOST_FITTED else ""
    return " and ".join(written) + f"{more} would fit"


# --- redundancy -------------------------------------------------------------------------------------------------------


def _redundant(parts: Parts) -> Iterator[Finding]:
    """Joints all or some of whose rows follow from those before: then the reactions are not unique."""
    for group in groups(parts, MOST_ROWS):
        if len(group.rate) > MOST_ROWS:
            continue
        rows = group.gradient / np.sqrt(group.mass)
        rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        basis = np.zeros((0, rows.shape[1]))
        k = 0
        shares: dict[int, str] = {}
        for index, of in group.joints:
            implied = 0
            for row in rows[k : k + len(of.rows)]:
                rest = row - basis.T @ (basis @ row)
                rest -= basis.T @ (basis @ rest)  # twice is enough
                size = np.linalg.norm(rest)
                if size <= DEPENDENT:
                    implied += 1
                else:
                    basis = np.vstack([basis, rest / size])
            k += len(of.rows)
            if implied:
                name = dict(parts.tables(Joint))[index].name or default_name(index)
                shares[index] = f"{implied} of the {len(of.rows)} conditions of joint {quoted(name)}"
        if shares:
            written = list(shares.values())[:MOST_FITTED]
            if len(shares) > MOST_FITTED:
                written.append(f"some of {len(shares) - MOST_FITTED} more")
            cause = f"{', '.join(written)} hold the same motion as other joints"
            cure = (
                "where they agree leave them out: of many reactions the least are shown; "
                "where they do not the run will stop"
            )
            yield Finding(("joint", min(shares)), cause, cure)


# --- the linear system ------------------------------------------------------------------------------------------------


def groups(parts: Parts, most: int) -> Iterator[Group]:
    """All joints in groups that share bodies; those of more than `most` rows joint by joint."""
    bodies, carriers = parts.bodies(), Carriers(parts)
    number = numbers(bodies)
    joints = [(i, joint_rows(j, bodies, number)) for i, j in parts.tables(Joint)]
    held = {ball for _, of in joints for ball in (of.a, of.b) if ball != GROUND_INDEX}
    carrier = {ball: carriers.of(ball) for ball in held}
    pairs = np.array(
        [(carrier[of.a].number, carrier[of.b].number) for _, of in joints if of.b != GROUND_INDEX],
        dtype=np.int64,
    ).reshape(-1, 2)
    label = connected(len(bodies.names), *pairs.T)
    groups: dict[int, list[tuple[int, Rows]]] = {}
    for i, of in joints:
        groups.setdefault(int(label[carrier[of.a].number]), []).append((i, of))
    h = 0.01 * parts.run.step if parts.run is not None else 0.0
    for group in groups.values():
        for some in [[one] for one in group] if sum(len(of.rows) for _, of in group) > most else [group]:
            yield _system(some, bodies, carrier, h)


def _system(
    joints: list[tuple[int, Rows]], bodies: Bodies, carrier: Mapping[int, Carrier], h: float
) -> Group:
    balls = {ball for _, of in joints for ball in (of.a, of.b) if ball != GROUND_INDEX}
    found = {carrier[ball].number: carrier[ball] for ball in balls}
    members = [found[number] for number in sorted(found)]
    place = {body.number: 6 * k for k, body in enumerate(members)}
    count = sum(len(of.rows) for _, of in joints)
    gradient = np.zeros((count, 6 * len(members)))
    rate, doubt, scale = np.zeros(count), np.zeros(count), np.zeros(count)
    k = 0
    for _, of in joints:
        for row in of.rows:
            rate[k], doubt[k] = slope_at(row.law, 0.0, h) if h > 0 else (0.0, math.inf)
            scale[k] = abs(rate[k])
            for ball, point, sign in ((of.a, row.point_a, 1.0), (of.b, row.point_b, -1.0)):
                if ball == GROUND_INDEX:
                    continue
                body = carrier[ball]
                lever = point - body.centre
                d = np.array(row.direction)
                turning = d if row.kind == "rotation" else np.cross(lever, d)
                at = place[body.number]
                gradient[k, at + 3 : at + 6] = sign * body.turning(turning)
                speed = float(np.linalg.norm(body.angular_velocity))
                if row.kind == "rotation":
                    scale[k] += speed
                else:
                    gradient[k, at : at + 3] = sign * d
                    scale[k] += float(np.linalg.norm(body.velocity) + speed * np.linalg.norm(lever))
            k += 1
    both = [(body.velocity, body.turning(body.angular_velocity)) for body in members]
    mass = np.array([[body.mass] * 3 + list(body.moments) for body in members]).ravel()
    kinds = [(row.kind, bodies.radius[of.a]) for _, of in joints for row in of.rows]
    size = np.array([1.0 if kind == "rotation" else radius for kind, radius in kinds])
    return Group(joints, members, gradient, np.array(both).ravel(), rate, doubt, scale, mass, size)
