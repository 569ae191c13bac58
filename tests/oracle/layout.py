"""Numbering of the unknowns of a contact problem, with the mass, penalty and weight of each."""

from collections.abc import Iterable, Sequence

import numpy as np

from .contact import Element
from .joint import JointRow
from .model import F64, Model


class Layout:
    """Numbering of the unknowns: local degrees of freedom (d,); rows (m,) of contacts, then of joints.

    `bodies` are spheres of the island beyond those of its contacts and joints.
    """

    def __init__(
        self,
        model: Model,
        elements: list[Element],
        joints: Sequence[JointRow] = (),
        bodies: Iterable[int] = (),
    ) -> None:
        self.elements, self.joints = elements, joints
        touched = {body for e in elements for body in e.pair.bodies}
        self.bodies = sorted(touched.union(bodies, *(row.bodies for row in joints)))
        local = {body: i for i, body in enumerate(self.bodies)}
        self.dofs = np.array([6 * body + k for body in self.bodies for k in range(6)], dtype=np.intp)
        self.columns = [
            np.array([6 * local[body] + k for body in e.pair.bodies for k in range(6)]) for e in elements
        ]
        counts = [len(e.rows) for e in elements]
        ends = [int(end) for end in np.cumsum(counts)]
        self.slices = [slice(end - k, end) for end, k in zip(ends, counts, strict=True)]
        self.contact_rows = sum(counts)
        self.rows = self.contact_rows + len(joints)
        self.joint_rows = slice(self.contact_rows, self.rows)
        self.start = np.array([rows.start for rows in self.slices], dtype=np.intp)
        """First row of every element: its normal row."""
        self.mass = model.mass_diagonal[self.dofs]
        compliance = [row.compliance(model.mass, model.inertia) for row in joints]
        self.p = 0.5 / np.concatenate([*(e.delassus for e in elements), compliance])
        """Penalty per row, 0.5/D_cc (rule R1) [kg, kg m^2]."""
        self.owner = np.repeat(np.arange(len(elements)), np.array(counts, dtype=np.intp))
        """Element of each row of a contact."""
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
        self.joint_radius = np.array([float(np.min(model.radius[list(row.bodies)])) for row in joints])
        turns = np.array([row.kind == "rotation" for row in joints], dtype=bool)
        self.weight_l[self.joint_rows][turns] = 1.0 / self.joint_radius[turns]
        self.mean_mass = float(np.mean(model.mass[self.bodies]))
        weighed = self.p[self.joint_rows] * self.weight_l[self.joint_rows]
        self.inertness = self.mean_mass + float(np.sqrt(weighed @ weighed))
        """Mass [kg] by which rounding of a length or speed enters a residual."""
        self.reach = model.radius[self.bodies].copy()
        """Farthest point of each body that matters (n,) [m]: its surface, or a point of a joint."""
        for row in joints:
            for _, body, arm in row.ends.sides():
                i = local[body]
                self.reach[i] = max(self.reach[i], float(np.sqrt(arm @ arm)))

    def size_of(self, vector: F64) -> float:
        """Norm [N] of a generalised force (6N,) on these bodies, moments divided by radii as in eq. 44."""
        return float(np.linalg.norm(vector[self.dofs] * self.weight_u))

    def disc_rows(self, number: int, start: int, stop: int) -> slice:
        """Rows of a disc of element `number`."""
        return slice(int(self.start[number]) + start, int(self.start[number]) + stop)

    def frozen_gradient(self) -> F64:
        """G (m, d) with every row of contacts, the normal one included, in the frame of t_n; joints are left 0."""
        gradient = np.zeros((self.rows, len(self.dofs)))
        for e, columns, rows in zip(self.elements, self.columns, self.slices, strict=True):
            gradient[rows, columns] = e.rows
        return gradient
