"""Joints and loads as the core takes them: bodies by number, points as arms, laws as pairs.

The rows of a joint are those of section 7 of docs/theory/algorithm.md. All points are given at the start and in fixed
axes; the core carries an arm with its body, so it gets `s = R^T (p - x)`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.bodies import Bodies, Entries
from carom.scene.assembly.rotations import rotated_back
from carom.scene.assembly.vectors import cross, scaled
from carom.scene.tables.joints import Joint
from carom.scene.tables.laws import LawValue, as_core
from carom.scene.tables.loads import ALL, GROUND, CheckedFunction, Drag, Load, LoadFunction, Spring
from carom.scene.tables.quantities import Vec3

MECHANICS = ("joint", "load", "spring", "drag", "load_function")
"""Sections of joints and loads."""
GROUND_INDEX = -1
AXES: tuple[Vec3, Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Row(NamedTuple):
    """One scalar condition between body a and body b or the ground."""

    kind: str
    """`point`, `distance` or `rotation`."""
    direction: Vec3
    """Unit vector in fixed axes; of a distance, from b to a at the start."""
    point_a: F64
    """Attachment point of a at the start, fixed axes, m."""
    point_b: F64
    law: LawValue
    """What the measure of the row follows, m or rad."""


class Rows(NamedTuple):
    """The rows of one joint; `b` is -1 for the ground."""

    a: int
    b: int
    rows: list[Row]


class Reference(NamedTuple):
    """A name of a body in a table of joints or loads, and where it stands."""

    name: str
    section: str
    place: int
    key: str
    ground: bool
    """Whether the key admits the ground."""


def references(entries: Entries) -> Iterator[Reference]:
    """All names that joints and loads refer to, without the "all" of drags."""
    for section in MECHANICS:
        for i, table in entries.get(section, ()):
            for key in ("on", "body", "between"):
                value = getattr(table, key, None)
                for name in (value,) if isinstance(value, str) else value or ():
                    if not (section == "drag" and name == ALL):
                        yield Reference(name, section, i, key, key == "between")


def numbers(bodies: Bodies) -> dict[str, int]:
    """The number of each body by its name, and that of the ground."""
    known = {name: i for i, name in enumerate(bodies.names)}
    known.setdefault(GROUND, GROUND_INDEX)
    return known


def joint_rows(joint: Joint, bodies: Bodies, number: Mapping[str, int]) -> Rows:
    """The rows of a joint, the ground always second."""
    if joint.between is None:
        assert joint.body is not None  # by the keys of its type
        a, b = number[joint.body], GROUND_INDEX
    else:
        a, b = (number[name] for name in joint.between)
    points = joint.points
    if a == GROUND_INDEX:
        a, b, points = b, a, points and (points[1], points[0])
    if joint.type == "rod":
        ends = _ends(a, b, points, bodies)
        span = ends[0] - ends[1]
        distance = float(np.linalg.norm(span))
        direction = scaled(span.tolist()) if distance > 0 else AXES[0]  # refused by the checks
        law = distance if joint.length is None else joint.length
        return Rows(a, b, [Row("distance", _vec3(direction), *ends, law)])
    point = bodies.position[a] if joint.point is None else np.array(joint.point)
    directions, axes, law = _directions(joint)
    rows = [Row("point", d, point, point, law) for d in directions]
    return Rows(a, b, rows + [Row("rotation", e, point, point, law) for e in axes])


def _directions(joint: Joint) -> tuple[Sequence[Vec3], Sequence[Vec3], LawValue]:
    """Unit directions of the point rows and of the rotation rows, and the law that they follow."""
    if joint.type == "line":
        assert joint.direction is not None
        return _normals(joint.direction), (), 0.0
    if joint.type == "plane":
        assert joint.normal is not None
        return (_unit(joint.normal),), (), 0.0
    if joint.type == "lock":
        return (), [_unit(axis) for axis in joint.axes or AXES], 0.0
    if joint.type == "motion" and joint.displacement is not None:
        assert joint.direction is not None
        return (_unit(joint.direction),), (), joint.displacement
    if joint.type == "motion":
        assert joint.axis is not None
        assert joint.angle is not None
        return (), (_unit(joint.axis),), joint.angle
    return AXES, (), 0.0  # fix, ball


def _normals(direction: Vec3) -> tuple[Vec3, Vec3]:
    """Two unit vectors normal to `direction` and to each other."""
    d = _unit(direction)
    smallest = min(range(3), key=lambda k: abs(d[k]))
    first = _unit(cross(AXES[smallest], d))
    return first, _unit(cross(d, first))


def _unit(direction: Sequence[float]) -> Vec3:
    return _vec3(scaled(direction))


def _vec3(a: Sequence[float]) -> Vec3:
    return a[0] + 0.0, a[1] + 0.0, a[2] + 0.0  # no negative zeros


def _ends(a: int, b: int, points: tuple[Vec3, Vec3] | None, bodies: Bodies) -> tuple[F64, F64]:
    """Two attachment points at the start, (3,) each; by default the centres."""
    if points is None:
        return bodies.position[a], bodies.position[b]
    return np.array(points[0]), np.array(points[1])


def spring_ends(spring: Spring, bodies: Bodies, number: Mapping[str, int]) -> tuple[int, int, F64, F64]:
    """Both bodies and attachment points of a spring, the ground second."""
    a, b = (number[name] for name in spring.between)
    points = spring.points
    if a == GROUND_INDEX:
        a, b, points = b, a, points and (points[1], points[0])
    return a, b, *_ends(a, b, points, bodies)


def arm(body: int, point: F64, bodies: Bodies) -> list[float]:
    """`R^T (p - x)`; of the ground the fixed point itself."""
    if body == GROUND_INDEX:
        return [float(x) for x in point]
    own = rotated_back(bodies.orientation[body], point - bodies.position[body])
    return [float(x) for x in own]


def joints_for_core(
    joints: Sequence[Joint], bodies: Bodies, number: Mapping[str, int]
) -> list[dict[str, Any]]:
    """`{"a", "b", "rows"}` per joint; a row is `(kind, direction, arm_a, arm_b, law)`."""
    found = []
    for joint in joints:
        a, b, rows = joint_rows(joint, bodies, number)
        listed = [
            (row.kind, list(row.direction), *_arms(row, a, b, bodies), as_core(row.law)) for row in rows
        ]
        found.append({"a": a, "b": b, "rows": listed})
    return found


def _arms(row: Row, a: int, b: int, bodies: Bodies) -> tuple[list[float], list[float]]:
    if row.kind == "rotation":
        return [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    return arm(a, row.point_a, bodies), arm(b, row.point_b, bodies)


def loads_for_core(
    loads: Sequence[Load],
    springs: Sequence[Spring],
    drags: Sequence[Drag],
    functions: Sequence[LoadFunction],
    bodies: Bodies,
    number: Mapping[str, int],
) -> list[dict[str, Any]]:
    """All loads, in the order of the tables."""
    found: list[dict[str, Any]] = []
    for load in loads:
        laws = {key: [as_core(law) for law in getattr(load, key)] for key in ("force", "torque")}
        found.append({"kind": "force", "body": number[load.on], **laws})
    for spring in springs:
        a, b, point_a, point_b = spring_ends(spring, bodies, number)
        length = math.dist(point_a, point_b) if spring.rest_length is None else spring.rest_length
        found.append(
            {
                "kind": "spring",
                "a": a,
                "b": b,
                "arm_a": arm(a, point_a, bodies),
                "arm_b": arm(b, point_b, bodies),
                "stiffness": spring.stiffness,
                "damping": spring.damping,
                "rest_length": length,
            }
        )
    for drag in drags:
        for body in range(len(bodies.names)) if drag.on == ALL else (number[drag.on],):
            coefficients = {"translation": drag.translation, "rotation": drag.rotation}
            found.append({"kind": "drag", "body": body, **coefficients})
    for place in functions:
        assert place.function is not None  # refused before
        function = CheckedFunction(place.name, place.function, len(bodies.names))
        found.append({"kind": "callable", "function": function})
    return found
