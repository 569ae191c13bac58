"""A contact problem: dynamics of some bodies, projected multipliers, residual and exact Hessian.

With `xi = lambda - p z` and `phi` its projection (section 4 of the specification; eqs. 21, 23, 29 with the
multiplier row scaled) the unknowns `u` (displacement U [m, rad] or velocity jump W [m/s, rad/s]) and `lambda`
satisfy

    r_u = M u - fixed - G^T phi = 0        r_l = phi - lambda = 0

which is the whole saddle system of the paper: no multiplier and no velocity is eliminated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contact import Element, gap_and_normal, normal_curvature, normal_row
from .model import F64, Model

EPS = float(np.finfo(np.float64).eps)


class Layout:
    """Numbering of the unknowns of some contacts: local degrees of freedom (d,) and rows (m,)."""

    def __init__(self, model: Model, elements: list[Element]) -> None:
        self.elements = elements
        self.bodies = sorted({body for e in elements for body in e.pair.bodies})
        local = {body: i for i, body in enumerate(self.bodies)}
        self.dofs = np.array([6 * body + k for body in self.bodies for k in range(6)], dtype=np.intp)
        self.columns = [
            np.array([6 * local[body] + k for body in e.pair.bodies for k in range(6)]) for e in elements
        ]
        counts = [len(e.rows) for e in elements]
        ends = [int(end) for end in np.cumsum(counts)]
        self.slices = [slice(end - k, end) for end, k in zip(ends, counts, strict=True)]
        self.rows = sum(counts)
        self.start = np.array([rows.start for rows in self.slices], dtype=np.intp)
        """First row of every element: its normal row."""
        self.mass = model.mass_diagonal[self.dofs]
        self.p = 0.5 / np.concatenate([e.delassus for e in elements])
        """Penalty per row, 0.5/D_cc (rule R1) [kg, kg m^2]."""
        self.owner = np.repeat(np.arange(len(elements)), counts)
        # weights of eq. 44: moments are divided by a radius, so that all entries are impulses [N s or N s^2]
        self.weight_u = np.ones(len(self.dofs))
        self.weight_l = np.ones(self.rows)
        for i, body in enumerate(self.bodies):
            self.weight_u[6 * i + 3 : 6 * i + 6] = 1.0 / model.radius[body]
        for number, e in enumerate(elements):
            for disc in e.discs:
                if disc.kind != "T":
                    rows = self.disc_rows(number, disc.start, disc.stop)
                    self.weight_l[rows] = 1.0 / e.pair.radius
        self.mean_mass = float(np.mean(model.mass[self.bodies]))

    def disc_rows(self, number: int, start: int, stop: int) -> slice:
        """Rows of a disc of element `number`."""
        return slice(int(self.start[number]) + start, int(self.start[number]) + stop)

    def frozen_gradient(self) -> F64:
        """G (m, d) with every row, the normal one included, in the frame of t_n."""
        gradient = np.zeros((self.rows, len(self.dofs)))
        for e, columns, rows in zip(self.elements, self.columns, self.slices, strict=True):
            gradient[rows, columns] = e.rows
        return gradient


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


class ContactProblem:
    """Base of both levels; a level supplies `kinematics` and, where the gradient varies, `curvature`."""

    def __init__(self, layout: Layout, fixed: F64, floor: float) -> None:
        self.layout = layout
        self.fixed = fixed
        self.floor = floor
        """Absolute size [N s or N s^2] below which a residual is rounding."""
        self.p = layout.p

    def kinematics(self, u: F64) -> tuple[F64, F64]:
        """z (m,) and its gradient G (m, d) at u (d,)."""
        raise NotImplementedError

    def curvature(self, u: F64, phi: F64) -> F64 | None:
        """Sum over contacts of phi_N d2 gap / dq2, (d, d), or None where the gradient is constant."""
        raise NotImplementedError

    def closed_gap(self, u: F64, phi: F64) -> float:
        """Largest |gap| / r_c of the contacts with impulse (position level); 0 at velocity level."""
        return 0.0

    def project(self, xi: F64) -> tuple[F64, F64]:
        """Projection phi (m,) of the augmented multipliers and its generalised derivative C (m, m)."""
        phi, tangent = np.zeros(len(xi)), np.zeros((len(xi), len(xi)))
        for number, e in enumerate(self.layout.elements):
            n = int(self.layout.start[number])
            if xi[n] < 0.0:
                continue
            phi[n], tangent[n, n] = xi[n], 1.0
            for disc in e.discs:
                rows = self.layout.disc_rows(number, disc.start, disc.stop)
                part, bound = xi[rows], disc.bound * xi[n]
                length = float(np.sqrt(part @ part))
                if bound == 0.0:
                    continue  # a disc of radius zero has no direction; phi = 0 and derivative 0
                if length <= bound:
                    phi[rows] = part
                    tangent[rows, rows] = np.eye(len(part))
                else:
                    tau = part / length
                    phi[rows] = bound * tau
                    tangent[rows, n] = disc.bound * tau
                    tangent[rows, rows] = bound / length * (np.eye(len(part)) - np.outer(tau, tau))
        return phi, tangent

    def evaluate(self, u: F64, multipliers: F64) -> Evaluation:
        """Residual of the saddle system at u (d,), lambda (m,)."""
        lay = self.layout
        z, gradient = self.kinematics(u)
        phi, tangent = self.project(multipliers - self.p * z)
        inertia, contact = lay.mass * u, gradient.T @ phi
        r_u, r_l = inertia - self.fixed - contact, phi - multipliers
        terms = (inertia, self.fixed, contact)
        scale = sum(_norm(term * lay.weight_u) for term in terms)
        scale += _norm(phi * lay.weight_l) + _norm(multipliers * lay.weight_l)
        norm = float(np.hypot(_norm(r_u * lay.weight_u), _norm(r_l * lay.weight_l)))
        return Evaluation(r_u, r_l, norm, scale, phi, tangent, z, gradient)

    def hessian(self, u: F64, at: Evaluation) -> F64:
        """Exact derivative of (r_u, r_l) by (u, lambda), (d + m, d + m); `at` is the evaluation at u."""
        lay, c, g = self.layout, at.tangent, at.gradient
        d, m = len(lay.dofs), lay.rows
        result = np.zeros((d + m, d + m))
        forward = g.T @ c
        result[:d, :d] = np.diag(lay.mass) + (forward * self.p) @ g
        result[:d, d:] = -forward
        result[d:, :d] = -(c * self.p) @ g
        result[d:, d:] = c - np.eye(m)
        curvature = self.curvature(u, at.phi)
        if curvature is not None:
            result[:d, :d] -= curvature
        return result


class PositionProblem(ContactProblem):
    """Eqs. 1c-e: displacements U with the gaps, friction on the increments of the step (eq. 37).

    `x_check` (N,3) centres and `d_check` (6N,) displacements of the whole step before the correction.
    """

    def __init__(self, model: Model, layout: Layout, x_check: F64, d_check: F64) -> None:
        size = float(np.max(np.abs(x_check[layout.bodies]))) + float(np.max(model.radius[layout.bodies]))
        super().__init__(layout, np.zeros(len(layout.dofs)), 4.0 * EPS * layout.mean_mass * size)
        self.model, self.x_check, self.d_check = model, x_check, d_check[layout.dofs]
        self.rounding = 16.0 * EPS * size
        self._frozen = layout.frozen_gradient()

    def _contacts(self) -> "zip[tuple[Element, np.intp, NDArray[np.intp]]]":
        lay = self.layout
        return zip(lay.elements, lay.start, lay.columns, strict=True)

    def centres(self, u: F64) -> F64:
        """Centres (N,3) after the correction u."""
        x = self.x_check.copy()
        x[self.layout.bodies] += u.reshape(-1, 6)[:, :3]
        return x

    def kinematics(self, u: F64) -> tuple[F64, F64]:
        x, gradient = self.centres(u), self._frozen.copy()
        z = gradient @ (self.d_check + u)
        for e, n, columns in self._contacts():
            z[n], normal, _ = gap_and_normal(self.model, e.pair, x)
            gradient[n, columns] = normal_row(e.pair, normal)
        return z, gradient

    def curvature(self, u: F64, phi: F64) -> F64 | None:
        x = self.centres(u)
        result = np.zeros((len(u), len(u)))
        for e, n, columns in self._contacts():
            if e.pair.plane < 0 and phi[n] > 0.0:
                _, normal, distance = gap_and_normal(self.model, e.pair, x)
                result[np.ix_(columns, columns)] += phi[n] * normal_curvature(normal, distance)
        return result

    def closed_gap(self, u: F64, phi: F64) -> float:
        z, _ = self.kinematics(u)
        worst = 0.0
        for e, n in zip(self.layout.elements, self.layout.start, strict=True):
            # an open gap is admitted where nothing pushes, and rounding of the coordinates is no error
            miss = abs(z[n]) if phi[n] > 0.0 else max(0.0, -z[n])
            worst = max(worst, max(0.0, miss - self.rounding) / e.pair.radius)
        return worst


class VelocityProblem(ContactProblem):
    """Eqs. 1f-h, 29: velocity jump W with `z = G (u_check + W) + offset`; G (m, d) constant, offset (m,).

    `u_check` (d,) velocity before any impulse of the step, `fixed` (d,) impulses of earlier problems: the P
    of eq. 28.
    """

    def __init__(
        self, layout: Layout, gradient: F64, u_check: F64, offset: F64, fixed: F64, floor: float
    ) -> None:
        super().__init__(layout, fixed, floor)
        self.gradient, self.free = gradient, gradient @ u_check + offset

    def kinematics(self, u: F64) -> tuple[F64, F64]:
        return self.free + self.gradient @ u, self.gradient

    def curvature(self, u: F64, phi: F64) -> F64 | None:
        return None


def _norm(vector: F64) -> float:
    return float(np.sqrt(vector @ vector))
