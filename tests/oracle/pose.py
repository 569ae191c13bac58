"""Where the bodies of a step are: centres, rotations exp(psi) R_n, and vectors carried by them with their derivatives.

Coordinates of a step are (x, psi) for each body, psi the **spatial** increment of rotation since t_n; velocities are
(v, w). A vector r = R_n s fixed in a body has become y = exp(psi) r; its velocity is w x y, its derivative by psi is not.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, factorial, sin, sqrt

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Ends:
    """Two attachment points: `arm_a` (3,) in the frame of body `a`; `arm_b` in that of `b`, or a fixed point if b = -1."""

    a: int
    b: int
    arm_a: F64
    arm_b: F64

    @property
    def bodies(self) -> tuple[int, ...]:
        """The spheres among the two (the ground is none and joins nothing)."""
        return (self.a,) if self.b < 0 else (self.a, self.b)

    def sides(self) -> Iterator[tuple[float, int, F64]]:
        """(sign, body, arm) of A, and of B where it is a sphere."""
        yield 1.0, self.a, self.arm_a
        if self.b >= 0:
            yield -1.0, self.b, self.arm_b


def cross_matrix(a: F64) -> F64:
    """[a]x with [a]x b = a x b, (3,3)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rotation_matrices(q: F64) -> F64:
    """R (N,3,3), body to world, of unit quaternions (N,4), w first."""
    w, v = q[:, 0, None, None], q[:, 1:]
    skew = np.array([cross_matrix(a) for a in v]).reshape(-1, 3, 3)
    return np.asarray(np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew, dtype=np.float64)


def rotate(q: F64, rot_incr_world: F64) -> F64:
    """exp(psi) q for orientations (N,4), w first, and spatial increments psi (N,3) [rad]; normalised."""
    angle = np.linalg.norm(rot_incr_world, axis=1)
    w1 = np.cos(0.5 * angle)
    v1 = 0.5 * np.sinc(angle / (2.0 * np.pi))[:, None] * rot_incr_world
    w2, v2 = q[:, 0], q[:, 1:]
    scalar = w1 * w2 - np.sum(v1 * v2, axis=1)
    vector = w1[:, None] * v2 + w2[:, None] * v1 + np.cross(v1, v2)
    result = np.concatenate([scalar[:, None], vector], axis=1)
    return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True), dtype=np.float64)


def rotation_increment(q_n: F64, q_new: F64) -> F64:
    """Spatial psi (N,3) [rad] with q_new = exp(psi) q_n, |psi| <= pi; orientations (N,4), w first."""
    w1, v1, w2, v2 = q_new[:, 0], q_new[:, 1:], q_n[:, 0], -q_n[:, 1:]
    w = w1 * w2 - np.sum(v1 * v2, axis=1)
    v = w1[:, None] * v2 + w2[:, None] * v1 + np.cross(v1, v2)
    v = np.where(w[:, None] < 0.0, -v, v)
    length = np.linalg.norm(v, axis=1)
    angle = 2.0 * np.arctan2(length, np.abs(w))
    factor = np.divide(angle, length, out=np.full(len(v), 2.0), where=length > 1e-300)
    return np.asarray(factor[:, None] * v, dtype=np.float64)


def stumpff(s: float) -> list[float]:
    """The Stumpff functions c_0 ... c_6 of s = theta^2: c_k = sum_j (-s)^j / (2 j + k)!.

    c_0 = cos theta, c_1 = sin theta / theta, c_2 = (1 - cos theta)/theta^2; d c_k/ds = (k c_{k+2} - c_{k+1})/2.
    """
    c = [0.0] * 7
    if s > 4.0:
        theta = sqrt(s)
        c[0], c[1] = cos(theta), sin(theta) / theta
        for k in range(5):
            c[k + 2] = (1.0 / factorial(k) - c[k]) / s
        return c
    # upwards the recurrence would divide rounding by s, downwards it forgets it
    for k in (5, 6):
        c[k] = sum((-s) ** j / factorial(2 * j + k) for j in range(12))
    for k in range(4, -1, -1):
        c[k] = 1.0 / factorial(k) - s * c[k + 2]
    return c


class Carried:
    """y = exp(psi) r and what its derivatives by psi need; psi, r (3,)."""

    def __init__(self, psi: F64, r: F64) -> None:
        self.psi, self.r = psi, r
        self.c = c = stumpff(float(psi @ psi))
        self.rate = [0.5 * (k * c[k + 2] - c[k + 1]) for k in range(5)]
        """d c_k/ds."""
        self.y = c[0] * r + c[1] * cross_matrix(psi) @ r + c[2] * float(psi @ r) * psi

    def jacobian(self) -> F64:
        """d y/d psi (3,3)."""
        psi, r, c, rate = self.psi, self.r, self.c, self.rate
        along = float(psi @ r)
        grown = 2.0 * (rate[0] * r + rate[1] * cross_matrix(psi) @ r + rate[2] * along * psi)
        return np.asarray(
            np.outer(grown, psi) - c[1] * cross_matrix(r) + c[2] * (along * np.eye(3) + np.outer(psi, r)),
            dtype=np.float64,
        )

    def curvature(self, a: F64) -> F64:
        """Second derivative of a . y by psi (3,3), symmetric.

        a . y = c_0 (a.r) + c_1 psi.(r x a) + c_2 (psi.a)(psi.r), differentiated twice.
        """
        psi, r, c, rate = self.psi, self.r, self.c, self.rate
        turn, pa, pr = cross_matrix(r) @ a, float(psi @ a), float(psi @ r)
        factors = (float(a @ r), float(psi @ turn), pa * pr)
        result = c[2] * (np.outer(a, r) + np.outer(r, a))
        for k, factor in enumerate(factors):
            second = 0.5 * (k * rate[k + 2] - rate[k + 1])
            result += factor * (2.0 * rate[k] * np.eye(3) + 4.0 * second * np.outer(psi, psi))
        mixed = 2.0 * np.outer(psi, rate[1] * turn + rate[2] * (pr * a + pa * r))
        return np.asarray(result + mixed + mixed.T, dtype=np.float64)


class Pose:
    """Centres x (N,3) and rotations exp(psi) R_n of all bodies; psi (N,3), R_n = `turn` (N,3,3)."""

    def __init__(self, x: F64, psi: F64, turn: F64) -> None:
        self.x, self.psi, self.turn = x, psi, turn

    @property
    def size(self) -> int:
        """Length 6 N of a generalised vector."""
        return 6 * len(self.x)


class Span:
    """The vector p_A - p_B between two attachment points in a pose, with its derivatives.

    Matrices are over all bodies: columns (x, psi) or (v, w), 6 N of them.
    """

    def __init__(self, ends: Ends, pose: Pose) -> None:
        self.size = pose.size
        self.sides = [
            (sign, body, Carried(pose.psi[body], pose.turn[body] @ arm)) for sign, body, arm in ends.sides()
        ]
        vector = sum(sign * (pose.x[body] + arm.y) for sign, body, arm in self.sides)
        self.vector: F64 = np.asarray(vector if ends.b >= 0 else vector - ends.arm_b, dtype=np.float64)
        """p_A - p_B (3,) [m]."""
        self.slope = np.zeros((3, self.size))
        """Its derivative by (x, psi)."""
        self.velocity = np.zeros((3, self.size))
        """Its rate is `velocity @ u`, u = (v, w)."""
        self._jacobians = []
        for sign, body, arm in self.sides:
            i, jacobian = 6 * body, arm.jacobian()
            self._jacobians.append(jacobian)
            self.slope[:, i : i + 3] = self.velocity[:, i : i + 3] = sign * np.eye(3)
            self.slope[:, i + 3 : i + 6] = sign * jacobian
            self.velocity[:, i + 3 : i + 6] = -sign * cross_matrix(arm.y)

    def turning(self, a: F64) -> F64:
        """Derivative of `velocity.T @ a` by (x, psi) at constant a (3,), (6N, 6N): d (y x a) = -[a]x dy."""
        result = np.zeros((self.size, self.size))
        for (sign, body, _), jacobian in zip(self.sides, self._jacobians, strict=True):
            block = slice(6 * body + 3, 6 * body + 6)
            result[block, block] -= sign * cross_matrix(a) @ jacobian
        return result

    def curvature(self, a: F64) -> F64:
        """Second derivative of a . (p_A - p_B) by (x, psi) at constant a (3,), (6N, 6N), symmetric."""
        result = np.zeros((self.size, self.size))
        for sign, body, arm in self.sides:
            block = slice(6 * body + 3, 6 * body + 6)
            result[block, block] += sign * arm.curvature(a)
        return result


def direction(vector: F64) -> tuple[F64, float, F64]:
    """Unit vector n, length L and dn = (1 - n n^T)/L d(vector) of a vector (3,); n and dn are 0 at L = 0."""
    length = float(np.sqrt(vector @ vector))
    if length == 0.0:
        return np.zeros(3), 0.0, np.zeros((3, 3))
    n = vector / length
    return n, length, (np.eye(3) - np.outer(n, n)) / length
