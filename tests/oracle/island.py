"""Islands: bodies that contacts, joints and loads between bodies join; and the velocity level of one of them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contact import Element, gap_and_normal, normal_row
from .joint import JointRow, JointsAt, rates
from .load import applied_force
from .model import F64, Model
from .newton import solve
from .pose import Pose
from .problem import EPS, Layout, VelocityProblem
from .smooth import FreeMotion

CLOSING_LOAD, OVER_TOLERANCE, CLOSING_SPEED = 0.1, 1e5, 1e-6
"""Closing tolerance (rule R3): over the change of velocity by loads, at most; that over the tolerance of the core; over the
largest speed."""
LARGE_ISLAND = 10
"""Contacts above which the tolerance of the core is its `pile_tolerance`."""
SPRINGS: dict[str, float | None] = {"compliant": None, "binary": None}
"""Laws through springs `F = k d^n`, with n; None: that of the options."""


def connected(sets: Sequence[Iterable[int]]) -> list[list[int]]:
    """Numbers of the sets that hang together through common members, in order."""
    groups: list[tuple[set[int], list[int]]] = []
    for number, given in enumerate(sets):
        united, members = set(given), [number]
        rest = []
        for group in groups:
            if group[0] & united:
                united |= group[0]
                members = group[1] + members
            else:
                rest.append(group)
        groups = [*rest, (united, members)]
    return sorted(sorted(members) for _, members in groups)


@dataclass(frozen=True)
class Group:
    """What one island holds: its contacts, rows of joints, and all its spheres."""

    elements: list[Element]
    joints: list[JointRow]
    bodies: list[int]
    links: list[tuple[int, ...]]
    """Spheres that each joint or load of the group joins."""


def islands(model: Model, elements: list[Element]) -> list[Group]:
    """Groups with at least a contact or a joint; planes and the ground join nothing."""
    links = [row.bodies for row in model.joints] + [load.joins() for load in model.following]
    sets = [e.pair.bodies for e in elements] + links
    result = []
    for members in connected(sets):
        contacts = [elements[i] for i in members if i < len(elements)]
        others = [i - len(elements) for i in members if i >= len(elements)]
        rows = [model.joints[i] for i in others if i < len(model.joints)]
        if contacts or rows:
            bodies = sorted({body for i in members for body in sets[i]})
            result.append(Group(contacts, rows, bodies, [links[i] for i in others]))
    return result


@dataclass(frozen=True)
class Bonds:
    """What joins the bodies of an island at velocity level besides contacts: joints, and loads that follow the motion."""

    group: Group
    gradient: F64
    """G of the joints (m, 6N) at q_{n+1}."""
    rates: F64
    """c'(t_{n+1}) (m,)."""
    old_rates: F64
    """c'(t_n) (m,)."""
    change: F64
    """h f_v of eq. 4 (6N,) at v_check: what the correction of the positions alone changes."""
    damping: F64
    """-h C (6N, 6N): at given positions springs, dampers and drag are linear in the velocity."""
    parts: F64
    """Absolute sizes (6N,) of the forces that f_v is a difference of."""

    @staticmethod
    def of(model: Model, group: Group, free: FreeMotion, pose: Pose) -> "Bonds | None":
        """Those of a group in the pose of t_{n+1}; None where contacts alone act."""
        if not group.links:
            return None
        h, before = model.options.step, free.following
        now = applied_force(model.following, pose, free.u_check, free.time)
        change, damping = h * (now.force - before.force), h * now.by_velocity
        gradient = JointsAt(group.joints, pose).gradient
        new, old = (rates(group.joints, time) for time in (free.time, free.time - h))
        return Bonds(group, gradient, new, old, change, damping, before.parts)


class Island:
    """One island with its contacts of A: velocities in local numbering, gradients at the corrected positions.

    `u_n`, `u_check` (6N,) generalised velocities; `x_new` (N,3) corrected centres. Rows are those of the contacts, then
    those of the joints. Multipliers of joints belong to no problem: each finds their totals anew, so that impulses given to
    `respond` are those of contacts alone.
    """

    def __init__(
        self, model: Model, elements: list[Element], x_new: F64, u_n: F64, u_check: F64,
        bonds: Bonds | None = None,
    ) -> None:  # fmt: skip
        self.model, self.elements, self.bonds = model, elements, bonds
        joints = bonds.group.joints if bonds else []
        self.layout = lay = Layout(model, elements, joints, bonds.group.bodies if bonds else ())
        self.u_n, self.u_check = u_n[lay.dofs], u_check[lay.dofs]
        self.gradient_n = lay.frozen_gradient()
        self.gradient = self.gradient_n.copy()
        for e, row, columns in zip(elements, lay.start, lay.columns, strict=True):
            self.gradient[row, columns] = normal_row(e.pair, gap_and_normal(model, e.pair, x_new)[1])
        self.plastic = np.zeros(lay.rows)
        """Offset of z without restitution (m,): what the joints prescribe."""
        self.plastic_before = np.zeros(lay.rows)
        """The same at t_n."""
        if bonds:
            self.gradient[lay.joint_rows] = self.gradient_n[lay.joint_rows] = bonds.gradient[:, lay.dofs]
            self.plastic[lay.joint_rows] = -bonds.rates
            self.plastic_before[lay.joint_rows] = -bonds.old_rates
        self.normal_rows = lay.start
        radius = model.radius[lay.bodies]
        before, free = self.u_n.reshape(-1, 6), self.u_check.reshape(-1, 6)
        self.old_speed = _speed(before, radius)
        self.moves_nothing = EPS * float(np.max(radius)) / model.options.step
        """Speed whose way in a step is the rounding of a radius [m/s]."""
        # rounding of the problem: relative to the largest velocity that enters it, spin included
        fastest = max(_speed(before, lay.reach), _speed(free, lay.reach))
        self.floor = 4.0 * EPS * lay.inertness * fastest
        if bonds:
            # f_v is a difference of forces
            self.floor += 4.0 * EPS * model.options.step * lay.size_of(bonds.parts)
        self.start, self.start_multipliers = self.respond(np.zeros(lay.rows))
        """W_J (d,): what the joints and loads ask for before any impact (stage J), and its multipliers (m,)."""
        started = free + self.start.reshape(-1, 6)
        self.loads = np.linalg.norm(started[:, :3] - before[:, :3], axis=1)
        """Change of each body's velocity by the loads of the step (n,) [m/s]."""
        self.speed = max(self.old_speed, float(np.max(self.loads)))

    def closing_tolerance(self) -> F64 | None:
        """Rule R3, per contact [m/s]; None if there is nothing to solve."""
        if self.speed == 0.0:
            return None
        loads = np.array([self._load_of(e) for e in self.elements])
        tolerance = self.model.options.closing[len(self.elements) > LARGE_ISLAND]
        share = min(CLOSING_LOAD, OVER_TOLERANCE * tolerance)
        least = max(CLOSING_SPEED * self.speed, 64.0 * EPS * self.old_speed, self.moves_nothing)
        return np.maximum(share * loads, least)

    def _load_of(self, e: Element) -> float:
        """Larger change that the loads of the step make to the velocities of a contact's bodies [m/s]."""
        return float(max(self.loads[self.layout.bodies.index(body)] for body in e.pair.bodies))

    def normal_velocity(self, u: F64, frozen: bool = False) -> F64:
        """G_N u per contact [m/s], with the normals of t_{n+1}, or of t_n if `frozen`."""
        gradient = self.gradient_n if frozen else self.gradient
        return np.asarray(gradient[self.normal_rows] @ u, dtype=np.float64)

    def problem(
        self, members: list[int], offset: F64, fixed: F64
    ) -> tuple[VelocityProblem, NDArray[np.intp], NDArray[np.intp]]:
        """The problem of the contacts `members` and all joints, with its columns and rows of the island's.

        `offset` (m,) as of `offset`; `fixed` (m,) impulses of contacts that act already.
        """
        lay, every = self.layout, np.arange(self.layout.rows)
        rows = np.concatenate([*(every[lay.slices[i]] for i in members), every[lay.joint_rows]])
        # joints and loads couple all bodies; contacts alone only those that they touch
        bodies = lay.bodies if self.bonds else ()
        part = Layout(self.model, [self.elements[i] for i in members], lay.joints, bodies)
        columns = np.flatnonzero(np.isin(lay.dofs, part.dofs))
        force, damping = self.gradient.T @ fixed, None
        if self.bonds:
            force = force + self.bonds.change[lay.dofs]
            damping = self.bonds.damping[np.ix_(lay.dofs, lay.dofs)]
        gradient, free = self.gradient[np.ix_(rows, columns)], self.u_check[columns]
        found = VelocityProblem(part, gradient, free, offset[rows], force[columns], self.floor, damping)
        return found, columns, rows

    def respond(self, multipliers: F64) -> tuple[F64, F64]:
        """Jump W (d,) under impulses of the contacts (m,), and all multipliers with those of the joints in their rows."""
        lay, force = self.layout, self.gradient.T @ multipliers
        if self.bonds is None:
            return np.asarray(force / lay.mass, dtype=np.float64), multipliers
        problem, _, _ = self.problem([], self.plastic, multipliers)
        found = solve(problem, force / lay.mass, self.model.options, f"joints of spheres {lay.bodies}")
        result = multipliers.copy()
        result[lay.joint_rows] = found.multipliers
        return found.u, result

    def jump(self, multipliers: F64) -> F64:
        """W (d,) under impulses of the contacts (m,): M^-1 G^T of them where nothing else acts."""
        return self.respond(multipliers)[0]

    def compressed(self) -> F64:
        """Poisson's law: impulses (m,) without restitution from the velocities before the step, where nothing else acts."""
        every = list(range(len(self.elements)))
        problem = VelocityProblem(
            self.layout, self.gradient, self.u_n, self.plastic_before, np.zeros(len(self.u_n)), self.floor
        )
        found = solve(problem, np.zeros(len(self.u_n)), self.model.options, f"compression, contacts {every}")
        return found.multipliers

    def reduced(self) -> tuple[F64, F64]:
        """What joints leave of G M^-1 G^T (m, m), and of the measures before the step (m,)."""
        joints, coupling = self.layout.joint_rows, self.gradient @ (self.gradient / self.layout.mass).T
        measures = self.gradient @ self.u_n + self.plastic_before
        share = coupling[:, joints] @ np.linalg.pinv(coupling[joints, joints], rcond=1e-12, hermitian=True)
        return coupling - share @ coupling[joints], measures - share @ measures[joints]

    def expansion(self, compressed: F64) -> tuple[F64, F64]:
        """Of impulses of compression (m,): least normal impulses of expansion (n,), and the offset of z (m,)."""
        least, offset = np.zeros(len(self.elements)), self.plastic.copy()
        coupling, _ = self.reduced()
        inverse = np.diag(coupling)
        for i, e in enumerate(self.elements):
            n, law = self.layout.start[i], e.pair.law
            speed = compressed[n] * inverse[n]
            if speed > 0.0 and speed >= self.model.options.restitution_threshold:
                least[i] = law.rebound(speed) * compressed[n]
            if e.slides:
                rows = slice(n + 1, n + 3)
                offset[rows] = -law.tangential_restitution * coupling[rows, rows] @ compressed[rows]
        return least, offset

    def offset(self, u_minus: F64, tolerance: F64, paper: bool) -> F64:
        """The part e gamma^- of eq. 24 for every row (m,).

        Default law: normal of t_{n+1}, clipped to approach, tangential restitution only where the contact
        approaches. `paper`: normal of t_n and neither clip.
        """
        approach = self.normal_velocity(u_minus, frozen=paper)
        result = self.plastic.copy()
        for i, e in enumerate(self.elements):
            law, n = e.pair.law, self.layout.start[i]
            threshold = self.model.options.restitution_threshold
            # zero means never: the unclipped law of the paper knows separating pre-impact velocities
            if threshold == 0.0 or -approach[i] >= threshold:
                result[n] = law.rebound(-approach[i]) * (approach[i] if paper else min(0.0, approach[i]))
            restores = e.slides and self.model.options.impact not in SPRINGS
            if restores and (paper or approach[i] < -tolerance[i]):
                rows = slice(n + 1, n + 3)
                result[rows] = law.tangential_restitution * (self.gradient[rows] @ u_minus)
        return result


def _speed(velocities: F64, radius: F64) -> float:
    """max(|v| + r |w|) of generalised velocities (n,6) [m/s]."""
    linear, spin = np.linalg.norm(velocities[:, :3], axis=1), np.linalg.norm(velocities[:, 3:], axis=1)
    return float(np.max(linear + radius * spin))
