"""Joints: bilateral rows of a point, a distance or a rotation (section 7 of the specification).

All matrices are over all bodies, 6 N columns: (v, w) for gradients of velocities, (x, psi) for derivatives of positions.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .law import ScalarLaw, read_law, read_vector
from .pose import F64, Ends, Pose, Span, direction

KINDS = ("point", "distance", "rotation")


@dataclass(frozen=True)
class JointRow:
    """One scalar condition; `axis` (3,) is the unit direction d or e in fixed axes, unused by a distance."""

    number: int
    """Number of the row among all rows of the model."""
    joint: int
    """Number of the joint that the row belongs to."""
    kind: str
    ends: Ends
    axis: F64
    law: ScalarLaw
    """c(t) [m or rad]."""

    @property
    def bodies(self) -> tuple[int, ...]:
        """Spheres that the row joins."""
        return self.ends.bodies

    def compliance(self, mass: F64, inertia: F64) -> float:
        """D_cc of the row [1/kg or 1/(kg m^2)]; for points and distances its largest value over all attitudes."""
        total = 0.0
        for _, body, arm in self.ends.sides():
            if self.kind == "rotation":
                total += 1.0 / float(inertia[body])
            else:
                total += 1.0 / float(mass[body]) + float(arm @ arm) / float(inertia[body])
        return total


class JointsAt:
    """Rows of joints (m,) in a pose: measures, gradients and their derivatives."""

    def __init__(self, rows: Sequence[JointRow], pose: Pose) -> None:
        self.rows, self.size = rows, pose.size
        self.slope = np.zeros((len(rows), pose.size))
        """d g/d(x, psi), (m, 6N)."""
        self.gradient = np.zeros((len(rows), pose.size))
        """G (m, 6N): the rate of g, without the law's, is `gradient @ u`."""
        self._measure = np.zeros(len(rows))
        self._spans: list[tuple[Span, F64, F64] | None] = []
        """Span, direction d and d(d)/d(vector) of a row, None for a rotation."""
        spans: dict[int, Span] = {}
        for i, row in enumerate(rows):
            if row.kind == "rotation":
                for sign, body, _ in row.ends.sides():
                    turn = slice(6 * body + 3, 6 * body + 6)
                    self.slope[i, turn] = self.gradient[i, turn] = sign * row.axis
                    self._measure[i] += sign * float(row.axis @ pose.psi[body])
                self._spans.append(None)
                continue
            # rows of a joint share their ends, and the span is the dear part
            if id(row.ends) not in spans:
                spans[id(row.ends)] = Span(row.ends, pose)
            span = spans[id(row.ends)]
            if row.kind == "point":
                d, turning = row.axis, np.zeros((3, 3))
                self._measure[i] = float(d @ span.vector)
            else:
                d, self._measure[i], turning = direction(span.vector)
            self.slope[i], self.gradient[i] = d @ span.slope, d @ span.velocity
            self._spans.append((span, d, turning))

    def measure(self, time: float, time_n: float) -> F64:
        """g (m,) [m or rad] at t_{n+1}; a rotation counts from t_n."""
        wanted = [
            row.law.value(time) - (row.law.value(time_n) if row.kind == "rotation" else 0.0)
            for row in self.rows
        ]
        return np.asarray(self._measure - np.array(wanted), dtype=np.float64)

    def curvature(self, multipliers: F64) -> F64:
        """Sum of multiplier times second derivative of g by (x, psi), (6N, 6N): d(slope^T multipliers)."""
        result = np.zeros((self.size, self.size))
        for known, force in zip(self._spans, multipliers, strict=True):
            if known is not None:
                span, d, turning = known
                result += force * (span.curvature(d) + span.slope.T @ turning @ span.slope)
        return result

    def reaction_tangent(self, multipliers: F64) -> F64:
        """d(G^T multipliers)/d(x, psi), (6N, 6N)."""
        result = np.zeros((self.size, self.size))
        for known, force in zip(self._spans, multipliers, strict=True):
            if known is not None:
                span, d, turning = known
                result += force * (span.turning(d) + span.velocity.T @ turning @ span.slope)
        return result

    def velocity_tangent(self, u: F64) -> F64:
        """d(G u)/d(x, psi) at constant u (6N,), (m, 6N)."""
        result = np.zeros((len(self.rows), self.size))
        for i, known in enumerate(self._spans):
            if known is not None:
                span, d, turning = known
                result[i] = u @ span.turning(d) + (span.velocity @ u) @ turning @ span.slope
        return result


def rates(rows: Sequence[JointRow], time: float) -> F64:
    """c'(t) (m,) [m/s or rad/s]."""
    return np.array([row.law.rate(time) for row in rows])


def accelerations(rows: Sequence[JointRow], time: float) -> F64:
    """c''(t) (m,) [m/s^2 or rad/s^2]."""
    return np.array([row.law.second(time) for row in rows])


def read_joints(model: Mapping[str, Any]) -> list[JointRow]:
    """The rows of `model["joints"]`, one joint after the other."""
    count = len(model["radius"])
    result: list[JointRow] = []
    for number, joint in enumerate(model.get("joints", ())):
        a, b = int(joint["a"]), int(joint["b"])
        if not (0 <= a < count and -1 <= b < count and a != b):
            raise ValueError(f"joint {number}: bodies {a} and {b} of {count}")
        shared: dict[tuple[float, ...], Ends] = {}
        for kind, axis, arm_a, arm_b, law in joint["rows"]:
            if kind not in KINDS:
                raise ValueError(f"joint {number}: {kind!r} is not a kind of row")
            ends = Ends(a, b, read_vector(arm_a), read_vector(arm_b))
            ends = shared.setdefault((*ends.arm_a, *ends.arm_b), ends)
            result.append(JointRow(len(result), number, kind, ends, read_vector(axis), read_law(law)))
    return result


def joint_wrenches(rows: list[JointRow], multipliers: F64, gradient: F64, joints: int) -> F64:
    """What multipliers (m,) along gradients (m, 6N) give sphere A of each joint (J,6): points and distances, rotations."""
    given = np.zeros((joints, 6))
    for row, multiplier, along in zip(rows, multipliers, gradient, strict=True):
        part = slice(3, 6) if row.kind == "rotation" else slice(0, 3)
        given[row.joint, part] += multiplier * along[6 * row.ends.a : 6 * row.ends.a + 6][part]
    return given


def never_meet(joints: Sequence[Mapping[str, Any]], radius: F64) -> set[frozenset[int]]:
    """Pairs of spheres whose centres joints keep at one distance: a rod between centres, a pivot at one of them, or clumps,
    in which pairs with a common point do not turn against one another. And those with a pivot where they touch.
    """
    found, clumps = set(), [{body} for body in range(len(radius))]
    for joint in joints:
        pair = frozenset((int(joint["a"]), int(joint["b"])))
        mine = [
            row for other in joints if {int(other["a"]), int(other["b"])} == pair for row in other["rows"]
        ]
        constant = [row for row in mine if row[4][0] == "constant"]
        points, turns = (
            [row for row in constant if row[0] == kind and -1 not in pair] for kind in ("point", "rotation")
        )
        arms = [[bool(np.any(row[side])) for side in (2, 3)] for row in constant if row[0] == "distance"]
        pivot = len(points) >= 3 and not all(np.any(points[0][side]) for side in (2, 3))
        if len(points) >= 3 and sum(np.linalg.norm(points[0][side]) for side in (2, 3)) <= 1.001 * sum(
            radius[list(pair)]
        ):
            pivot = True
        if -1 not in pair and (pivot or [False, False] in arms):
            found.add(pair)
        axes = [np.linalg.matrix_rank([row[1] for row in rows]) if rows else 0 for rows in (points, turns)]
        if axes == [3, 3]:
            whole = set().union(*(clump for clump in clumps if clump & pair))
            clumps = [clump for clump in clumps if not clump & pair] + [whole]
    return found | {frozenset((a, b)) for clump in clumps for a in clump for b in clump if a != b}
