"""A contact problem: dynamics of some bodies, projected multipliers, residual and exact Hessian.

With `xi = lambda - p z` and `phi` its projection (section 4 of the specification; eqs. 21, 23, 29 with the
multiplier row scaled) the unknowns `u` (displacement U [m, rad] or velocity jump W [m/s, rad/s]) and `lambda`
satisfy

    r_u = M u - forces(u) - G^T phi = 0        r_l = phi - lambda = 0

which is the whole saddle system of the paper: no multiplier and no velocity is eliminated. A row of a joint is
one whose projection is the identity, phi = xi, so that its r_l = -p z demands z = 0.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contact import Element, gap_and_normal, normal_curvature, normal_row
from .joint import JointsAt
from .layout import Layout as Layout
from .load import applied_force
from .model import F64, Model
from .pose import Pose
from .smooth import FreeMotion

EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Evaluation:
    """Residual at a point, and what its Hessian needs."""

    r_u: F64
    r_l: F64
    norm: float
    """Norm of the weighted residual."""
    scale: float
    """Sum of the norms of its contributions (eq. 44)."""
    phi: F64
    tangent: F64
    """C = d phi / d xi, (m, m)."""
    z: F64
    gradient: F64
    by_u: F64 | None
    """Derivative of the forces by u (d, d), None for 0."""


class ContactProblem:
    """Base of both levels; a level supplies `kinematics` and, where the gradient varies, `curvature`."""

    def __init__(self, layout: Layout, fixed: F64, floor: float) -> None:
        self.layout = layout
        self.fixed = fixed
        self.floor = floor
        """Absolute size [N s or N s^2] below which a residual is rounding."""
        self.p = layout.p
        self.least = np.zeros(len(layout.elements))
        """Least normal multiplier of each contact; above 0 in the expansion of Poisson's law."""
        self.along: F64 | None = None
        """Gradient (m, d) along which multipliers act where it is not that of z."""

    def kinematics(self, u: F64) -> tuple[F64, F64]:
        """z (m,) and its gradient G (m, d) at u (d,)."""
        raise NotImplementedError

    def forces(self, u: F64) -> tuple[F64, F64 | None]:
        """What acts besides the multipliers (d,), and its derivative (d, d), None for 0."""
        return self.fixed, None

    def curvature(self, u: F64, phi: F64) -> F64 | None:
        """Sum over rows of phi d2 z / dq2, (d, d), or None where the gradient is constant."""
        raise NotImplementedError

    def closed_gap(self, u: F64, phi: F64) -> float:
        """Largest |gap| / r_c of the contacts with impulse (position level); 0 at velocity level."""
        return 0.0

    def project(self, xi: F64) -> tuple[F64, F64]:
        """Projection phi (m,) of the augmented multipliers and its generalised derivative C (m, m)."""
        phi, tangent = np.zeros(len(xi)), np.zeros((len(xi), len(xi)))
        bilateral = np.arange(len(xi))[self.layout.joint_rows]
        phi[bilateral], tangent[bilateral, bilateral] = xi[bilateral], 1.0
        for number, e in enumerate(self.layout.elements):
            n, least = int(self.layout.start[number]), self.least[number]
            if xi[n] < 0.0 and least == 0.0:
                continue
            free = xi[n] >= least
            phi[n], tangent[n, n] = max(least, xi[n]), free
            for disc in e.discs:
                rows = self.layout.disc_rows(number, disc.start, disc.stop)
                part, bound = xi[rows], disc.bound * phi[n]
                length = float(np.sqrt(part @ part))
                if bound == 0.0:
                    continue  # a disc of radius zero has no direction; phi = 0 and derivative 0
                if length <= bound:
                    phi[rows] = part
                    tangent[rows, rows] = np.eye(len(part))
                else:
                    tau = part / length
                    phi[rows] = bound * tau
                    tangent[rows, n] = disc.bound * tau * free
                    tangent[rows, rows] = bound / length * (np.eye(len(part)) - np.outer(tau, tau))
        return phi, tangent

    def evaluate(self, u: F64, multipliers: F64) -> Evaluation:
        """Residual of the saddle system at u (d,), lambda (m,)."""
        lay = self.layout
        z, gradient = self.kinematics(u)
        phi, tangent = self.project(multipliers - self.p * z)
        acting = gradient if self.along is None else self.along
        inertia, contact = lay.mass * u, acting.T @ phi
        forces, stiffening = self.forces(u)
        r_u, r_l = inertia - forces - contact, phi - multipliers
        terms = (inertia, forces, contact)
        scale = sum(_norm(term * lay.weight_u) for term in terms)
        scale += _norm(phi * lay.weight_l) + _norm(multipliers * lay.weight_l)
        norm = float(np.hypot(_norm(r_u * lay.weight_u), _norm(r_l * lay.weight_l)))
        return Evaluation(r_u, r_l, norm, scale, phi, tangent, z, gradient, stiffening)

    def hessian(self, u: F64, at: Evaluation) -> F64:
        """Exact derivative of (r_u, r_l) by (u, lambda), (d + m, d + m); `at` is the evaluation at u."""
        lay, c, g = self.layout, at.tangent, at.gradient
        d, m = len(lay.dofs), lay.rows
        result = np.zeros((d + m, d + m))
        forward = (g if self.along is None else self.along).T @ c
        result[:d, :d] = np.diag(lay.mass) + (forward * self.p) @ g
        result[:d, d:] = -forward
        result[d:, :d] = -(c * self.p) @ g
        result[d:, d:] = c - np.eye(m)
        curvature = self.curvature(u, at.phi)
        if curvature is not None:
            result[:d, :d] -= curvature
        if at.by_u is not None:
            result[:d, :d] -= at.by_u
        return result


class PositionProblem(ContactProblem):
    """Eqs. 1c-e: displacements U with the gaps, friction on the increments of the step (eq. 37), joints and f_p.

    `x_check` (N,3) centres and `d_check` (6N,) displacements of the whole step before the correction. `free` is the free
    motion that led there; without it there are neither joints nor loads that follow the motion.
    """

    def __init__(
        self, model: Model, layout: Layout, x_check: F64, d_check: F64, free: FreeMotion | None = None
    ) -> None:
        size = float(np.max(np.abs(x_check[layout.bodies]))) + float(np.max(layout.reach))
        floor = 4.0 * EPS * layout.inertness * size
        if free is not None:
            # f_p is a difference of forces
            floor += 2.0 * EPS * model.options.step**2 * layout.size_of(free.following.parts)
        super().__init__(layout, np.zeros(len(layout.dofs)), floor)
        self.model, self.x_check, self.d_check, self.free = model, x_check, d_check[layout.dofs], free
        self.rounding = 16.0 * EPS * size
        self._frozen = layout.frozen_gradient()
        self._d_all = d_check
        self._last: tuple[F64, JointsAt] | None = None
        moving = {body for load in model.following for body in load.joins()}
        self._follows = free is not None and not moving.isdisjoint(layout.bodies)

    def _contacts(self) -> "zip[tuple[Element, np.intp, NDArray[np.intp]]]":
        lay = self.layout
        return zip(lay.elements, lay.start, lay.columns, strict=True)

    def centres(self, u: F64) -> F64:
        """Centres (N,3) after the correction u."""
        x = self.x_check.copy()
        x[self.layout.bodies] += u.reshape(-1, 6)[:, :3]
        return x

    def _pose(self, u: F64, free: FreeMotion) -> Pose:
        displacement = self._d_all.copy()
        displacement[self.layout.dofs] += u
        return Pose(self.centres(u), displacement.reshape(-1, 6)[:, 3:], free.turn)

    def _joints(self, u: F64) -> tuple[JointsAt, FreeMotion] | None:
        if self.free is None or not self.layout.joints:
            return None
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), JointsAt(self.layout.joints, self._pose(u, self.free))
        return self._last[1], self.free

    def kinematics(self, u: F64) -> tuple[F64, F64]:
        x, gradient = self.centres(u), self._frozen.copy()
        z = gradient @ (self.d_check + u)
        for e, n, columns in self._contacts():
            z[n], normal, _ = gap_and_normal(self.model, e.pair, x)
            gradient[n, columns] = normal_row(e.pair, normal)
        known = self._joints(u)
        if known is not None:
            joints, free = known
            z[self.layout.joint_rows] = joints.measure(free.time, free.time_n)
            gradient[self.layout.joint_rows] = joints.slope[:, self.layout.dofs]
        return z, gradient

    def forces(self, u: F64) -> tuple[F64, F64 | None]:
        if self.free is None or not self._follows:
            return self.fixed, None
        free, dofs, h = self.free, self.layout.dofs, self.model.options.step
        now = applied_force(self.model.following, self._pose(u, free), free.u_check, free.time)
        change = 0.5 * h * h * (now.force - free.following.force)
        return change[dofs], 0.5 * h * h * now.by_position[np.ix_(dofs, dofs)]

    def curvature(self, u: F64, phi: F64) -> F64 | None:
        x = self.centres(u)
        result = np.zeros((len(u), len(u)))
        for e, n, columns in self._contacts():
            if e.pair.plane < 0 and phi[n] > 0.0:
                _, normal, distance = gap_and_normal(self.model, e.pair, x)
                result[np.ix_(columns, columns)] += phi[n] * normal_curvature(normal, distance)
        known = self._joints(u)
        if known is not None:
            dofs = self.layout.dofs
            result += known[0].curvature(phi[self.layout.joint_rows])[np.ix_(dofs, dofs)]
        return result

    def closed_gap(self, u: F64, phi: F64) -> float:
        z, _ = self.kinematics(u)
        worst = 0.0
        for e, n in zip(self.layout.elements, self.layout.start, strict=True):
            # an open gap is admitted where nothing pushes, and rounding of the coordinates is no error
            miss = abs(z[n]) if phi[n] > 0.0 else max(0.0, -z[n])
            worst = max(worst, max(0.0, miss - self.rounding) / e.pair.radius)
        misses = np.abs(z[self.layout.joint_rows]) - self.rounding
        return max(worst, float(np.max(misses / self.layout.joint_radius, initial=0.0)))


class VelocityProblem(ContactProblem):
    """Eqs. 1f-h, 29: velocity jump W with `z = G (u_check + W) + offset`; G (m, d) constant, offset (m,).

    `u_check` (d,) velocity before any impulse of the step, `fixed` (d,) impulses of earlier problems: the P
    of eq. 28, and h f_v at W = 0; `damping` (d, d) is its derivative -h C.
    """

    def __init__(
        self,
        layout: Layout,
        gradient: F64,
        u_check: F64,
        offset: F64,
        fixed: F64,
        floor: float,
        damping: F64 | None = None,
    ) -> None:
        super().__init__(layout, fixed, floor)
        self.gradient, self.free = gradient, gradient @ u_check + offset
        self._damping = damping

    def kinematics(self, u: F64) -> tuple[F64, F64]:
        return self.free + self.gradient @ u, self.gradient

    def forces(self, u: F64) -> tuple[F64, F64 | None]:
        if self._damping is None:
            return self.fixed, None
        return self.fixed + self._damping @ u, self._damping

    def curvature(self, u: F64, phi: F64) -> F64 | None:
        return None


def _norm(vector: F64) -> float:
    return float(np.sqrt(vector @ vector))
