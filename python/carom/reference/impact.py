"""Velocity level: the sequence of impact problems of one island (section 5 of the specification; eqs. 24-29).

Three laws: `sequence` (load offset in stage 0, rules R2-R4), `sequence-paper` (the paper as printed) and
`one-shot` (one simultaneous problem with Newton's law).
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .contact import Element, Impulse, gap_and_normal, islands, normal_row, to_world
from .model import F64, Model
from .newton import solve
from .problem import EPS, Layout, VelocityProblem

ENERGY_SLACK = 1e-10
"""A problem may produce this fraction of the kinetic energy of its bodies (rule R4)."""
BISECTIONS = 12


LARGE_ISLAND = 10
"""Contacts above which the closing tolerance goes by the load alone (rule R3)."""


@dataclass
class ImpactProblem:
    """Record of one problem: its stage ('0', '1', ..., 'one-shot', 'truncated'), members, impulses."""

    island: tuple[int, ...]
    """Spheres of the island."""
    stage: str
    members: list[tuple[int, int]]
    impulses: dict[tuple[int, int], Impulse]
    iterations: int
    history: list[float]
    fallback: str
    scale: float
    """Smallest factor the energy safeguard put on a restitution of this problem; 1 if it did nothing."""
    work: float
    """Kinetic energy gained in this problem [J], 1/2 sum lambda.(gamma^- + gamma^+)."""


@dataclass
class IslandResult:
    """Velocity jump and total impulses of an island, with the problems that led there."""

    jump: F64
    """W (d,) [m/s, rad/s]."""
    multipliers: F64
    """Sum over the problems that count, (m,) [N s, N s m]."""
    problems: list[ImpactProblem] = field(default_factory=list)
    truncated: bool = False
    tolerance: float | None = None
    """Closing tolerance [m/s], None where there was nothing to solve."""


class Island:
    """One island with its contacts of A: velocities in local numbering, gradients at the corrected positions.

    `u_n`, `u_check` (6N,) generalised velocities; `x_new` (N,3) corrected centres.
    """

    def __init__(self, model: Model, elements: list[Element], x_new: F64, u_n: F64, u_check: F64) -> None:
        self.model, self.elements = model, elements
        self.layout = lay = Layout(model, elements)
        self.u_n, self.u_check = u_n[lay.dofs], u_check[lay.dofs]
        self.gradient_n = lay.frozen_gradient()
        self.gradient = self.gradient_n.copy()
        for e, row, columns in zip(elements, lay.start, lay.columns, strict=True):
            self.gradient[row, columns] = normal_row(e.pair, gap_and_normal(model, e.pair, x_new)[1])
        self.normal_rows = lay.start
        radius = model.radius[lay.bodies]
        before, free = self.u_n.reshape(-1, 6), self.u_check.reshape(-1, 6)
        self.load = float(np.max(np.linalg.norm(free[:, :3] - before[:, :3], axis=1)))
        self.old_speed = _speed(before, radius)
        self.speed = max(self.old_speed, self.load)
        # rounding of the problem: relative to the largest velocity that enters it, spin included
        self.floor = 4.0 * EPS * lay.mean_mass * max(_speed(before, radius), _speed(free, radius))

    def closing_tolerance(self) -> float | None:
        """Rule R3 [m/s]; None if there is nothing to solve."""
        if self.load == 0.0:
            return 1e-6 * self.speed if self.speed > 0.0 else None
        by_load = 1e-2 * self.load
        large = len(self.elements) > LARGE_ISLAND
        tolerance = by_load if large else min(by_load, 1e-6 * self.speed)
        return max(tolerance, 64.0 * EPS * self.old_speed)

    def normal_velocity(self, u: F64, frozen: bool = False) -> F64:
        """G_N u per contact [m/s], with the normals of t_{n+1}, or of t_n if `frozen`."""
        gradient = self.gradient_n if frozen else self.gradient
        return np.asarray(gradient[self.normal_rows] @ u, dtype=np.float64)

    def jump(self, multipliers: F64) -> F64:
        """M^-1 G^T of impulses (m,): a velocity jump (d,)."""
        return np.asarray(self.gradient.T @ multipliers / self.layout.mass, dtype=np.float64)

    def offset(self, u_minus: F64, scale: F64, tolerance: float, paper: bool) -> F64:
        """The part e gamma^- of eq. 24 for every row (m,); `scale` per contact multiplies its coefficients.

        Default law: normal of t_{n+1}, clipped to approach, tangential restitution only where the contact
        approaches. `paper`: normal of t_n and neither clip.
        """
        approach = self.normal_velocity(u_minus, frozen=paper)
        result = np.zeros(self.layout.rows)
        for i, e in enumerate(self.elements):
            law, n = e.pair.law, self.layout.start[i]
            threshold = self.model.options.restitution_threshold
            # zero means never: the unclipped law of the paper knows separating pre-impact velocities
            if threshold == 0.0 or -approach[i] >= threshold:
                result[n] = scale[i] * law.restitution * (approach[i] if paper else min(0.0, approach[i]))
            if law.friction > 0.0 and (paper or approach[i] < -tolerance):
                rows = slice(n + 1, n + 3)
                result[rows] = scale[i] * law.tangential_restitution * (self.gradient[rows] @ u_minus)
        return result


@dataclass
class _Solved:
    multipliers: F64
    """Of the members, (m,)."""
    jump: F64
    """Of these and the fixed impulses, (d,)."""
    iterations: int
    history: list[float]
    fallback: str


def _solve_members(island: Island, members: list[int], offset: F64, fixed: F64, what: str) -> _Solved:
    """Solve the contacts `members`; `fixed` (m,) are the impulses that already act."""
    lay = island.layout
    rows = np.concatenate([np.arange(lay.rows)[lay.slices[i]] for i in members])
    sub = Layout(island.model, [island.elements[i] for i in members])
    columns = np.flatnonzero(np.isin(lay.dofs, sub.dofs))
    force = island.gradient.T @ fixed
    start = force / lay.mass
    problem = VelocityProblem(
        sub,
        island.gradient[np.ix_(rows, columns)],
        island.u_check[columns],
        offset[rows],
        force[columns],
        island.floor,
    )
    found = solve(problem, start[columns], island.model.options, what)
    multipliers = np.zeros(lay.rows)
    multipliers[rows] = found.multipliers
    jump = island.jump(fixed + multipliers)
    return _Solved(multipliers, jump, found.iterations, found.history, found.fallback)


def _gain(island: Island, contacts: list[int], solved: _Solved, before: F64) -> float:
    """w of rule R4 over some contacts [J]; `before` (d,) the jump of the fixed impulses."""
    mean = 0.5 * (before + solved.jump) + island.u_check
    work = solved.multipliers * (island.gradient @ mean)
    return float(sum(np.sum(work[island.layout.slices[i]]) for i in contacts))


def _pushing_islands(island: Island, members: list[int], solved: _Solved) -> list[list[int]]:
    pushing = [i for i in members if solved.multipliers[island.layout.start[i]] > 0.0]
    return [[pushing[k] for k in group] for group in islands([island.elements[i] for i in pushing])]


def impact_problem(
    island: Island,
    members: list[int],
    fixed: F64,
    u_minus: F64 | None,
    tolerance: float,
    stage: str,
    paper: bool = False,
) -> tuple[F64, ImpactProblem]:
    """One problem with members C: its impulses (m,), and a record. `u_minus` (d,) is V^-, None for e = 0."""
    what = f"impact problem, stage {stage}, spheres {island.layout.bodies}"
    scale = np.ones(len(island.elements))

    def at(factors: F64) -> _Solved:
        plastic = np.zeros(island.layout.rows)
        offset = plastic if u_minus is None else island.offset(u_minus, factors, tolerance, paper)
        return _solve_members(island, members, offset, fixed, what)

    solved = at(scale)
    before = island.jump(fixed)
    if u_minus is not None and not paper and island.model.options.energy_safeguard:
        energy = 0.5 * island.layout.mass * (island.u_check + before) ** 2
        # scaling one group may let a contact between two groups push: look again until no group gains
        for _ in range(len(members)):
            gaining = []
            for group in _pushing_islands(island, members, solved):
                dofs = np.unique(np.concatenate([island.layout.columns[i] for i in group]))
                bound = ENERGY_SLACK * float(np.sum(energy[dofs]))
                if _gain(island, group, solved, before) > bound:
                    gaining.append((group, bound))
            if not gaining:
                break
            for group, bound in gaining:
                low, high = 0.0, 1.0
                for _ in range(BISECTIONS):
                    trial = scale.copy()
                    trial[group] *= 0.5 * (low + high)
                    if _gain(island, group, at(trial), before) <= bound:
                        low = 0.5 * (low + high)
                    else:
                        high = 0.5 * (low + high)
                scale[group] *= low
            solved = at(scale)
    record = ImpactProblem(
        island=tuple(island.layout.bodies),
        stage=stage,
        members=[island.elements[i].pair.key for i in members],
        impulses={
            island.elements[i].pair.key: to_world(
                island.elements[i], solved.multipliers[island.layout.slices[i]]
            )
            for i in members
        },
        iterations=solved.iterations,
        history=solved.history,
        fallback=solved.fallback,
        scale=float(np.min(scale)),
        work=_gain(island, members, solved, before),
    )
    return solved.multipliers, record


class ProblemSolver(Protocol):
    """What `solve_island` calls for each problem: `impact_problem`, or a judge of impulses found elsewhere."""

    def __call__(
        self,
        island: Island,
        members: list[int],
        fixed: F64,
        u_minus: F64 | None,
        tolerance: float,
        stage: str,
        paper: bool = False,
    ) -> tuple[F64, ImpactProblem]: ...


def solve_island(island: Island, impact_problem: ProblemSolver = impact_problem) -> IslandResult:
    """All impact problems of one island by the law that the options name."""
    result = IslandResult(np.zeros(len(island.layout.dofs)), np.zeros(island.layout.rows))
    tolerance = result.tolerance = island.closing_tolerance()
    if tolerance is None:
        return result
    everything = list(range(len(island.elements)))
    impact = island.model.options.impact
    paper = impact == "sequence-paper"
    if impact == "one-shot":
        result.multipliers, record = impact_problem(
            island, everything, result.multipliers, island.u_n, tolerance, impact
        )
        result.problems.append(record)
        result.jump = island.jump(result.multipliers)
        return result

    impulses = np.zeros(island.layout.rows)
    offset_jump = np.zeros(len(island.layout.dofs))
    loaded: set[int] = set()
    if not paper:
        resting = np.flatnonzero(island.normal_velocity(island.u_n) >= -tolerance).tolist()
        closing = island.normal_velocity(island.u_check) < -tolerance
        loaded = {i for i in resting if closing[i]}
        if loaded:
            impulses, record = impact_problem(island, resting, impulses, None, tolerance, "0")
            result.problems.append(record)
            offset_jump = island.jump(impulses)

    jump = offset_jump
    for number in range(1, island.model.options.max_problems + 2):
        members = set(np.flatnonzero(island.normal_velocity(island.u_check + jump) < -tolerance).tolist())
        if not members:
            break
        if number > island.model.options.max_problems:
            # the sequence does not end: one problem that leaves nothing approaching and cannot gain energy
            added, record = impact_problem(island, everything, impulses, None, tolerance, "truncated")
            result.truncated = True
        else:
            if number == 1:
                members |= loaded
                for i in members:
                    impulses[island.layout.slices[i]] = 0.0
            u_minus = island.u_n + jump - offset_jump if number > 1 else island.u_n
            added, record = impact_problem(
                island, sorted(members), impulses, u_minus, tolerance, str(number), paper=paper
            )
        impulses = impulses + added
        result.problems.append(record)
        jump = island.jump(impulses)
    result.multipliers, result.jump = impulses, jump
    return result


def _speed(velocities: F64, radius: F64) -> float:
    """max(|v| + r |w|) of generalised velocities (n,6) [m/s]."""
    linear, spin = np.linalg.norm(velocities[:, :3], axis=1), np.linalg.norm(velocities[:, 3:], axis=1)
    return float(np.max(linear + radius * spin))
