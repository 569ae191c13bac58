"""How well GIVEN positions, velocities and impulses satisfy the conditions of section 4 of the specification.

Redundant frictional contacts have many solutions; two programs may then differ and both be right. What is
judged here is not a solution but its claim: the dynamics, and for every disc the natural map
`projection(lambda - p z) - lambda`, divided by p and for moments multiplied by r_c, so that every figure is a
length [m] (position level) or a speed [m/s] (velocity level) and 0 means that the condition holds exactly.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .contact import Impulse, element, from_world, gap_and_normal, islands
from .impact import ImpactProblem, Island, solve_island
from .model import F64, TOUCH, Model, State
from .problem import ContactProblem, Layout, PositionProblem, VelocityProblem
from .step import smooth

Key = tuple[int, int]


@dataclass(frozen=True)
class Conditions:
    """Largest violation of each kind, [m] at position level, [m/s] at velocity level."""

    dynamics: float
    """|u - M^-1 (fixed + G^T lambda)|, rotations times the radius of the body."""
    normal: float
    """Natural map of the unilateral rows: overlap, adhesion, impulse at an open gap."""
    discs: float
    """Natural map of sliding, rolling and spinning: bound exceeded, motion inside it, wrong direction."""

    @property
    def worst(self) -> float:
        """The largest of all."""
        return max(self.dynamics, self.normal, self.discs)


@dataclass
class StepJudgement:
    """Verdict on one step: each level on its own, and whether the impact problems were the right ones."""

    position: Conditions
    problems: list[tuple[str, Conditions]] = field(default_factory=list)
    """Stage and verdict of each impact problem."""
    velocity: float = 0.0
    """Largest |u_{n+1} - u_check - W| with W from the impulses, rotations times the radius [m/s]."""
    objections: list[str] = field(default_factory=list)
    """Problems that the law does not have, are missing, or hold impulses of foreign contacts."""

    @property
    def worst(self) -> float:
        """Largest violation of all; infinite if there are objections."""
        figures = [self.position.worst, self.velocity, *(verdict.worst for _, verdict in self.problems)]
        return float("inf") if self.objections else max(figures)


def conditions(problem: ContactProblem, u: F64, multipliers: F64) -> Conditions:
    """Judge u (d,), lambda (m,) as an answer to a problem."""
    lay = problem.layout
    at = problem.evaluate(u, multipliers)
    dynamics = np.abs(at.r_u) / lay.mass / lay.weight_u
    natural = np.abs(at.r_l) / problem.p / lay.weight_l
    is_normal = np.zeros(lay.rows, dtype=bool)
    is_normal[lay.start] = True
    return Conditions(
        float(np.max(dynamics, initial=0.0)),
        float(np.max(natural[is_normal], initial=0.0)),
        float(np.max(natural[~is_normal], initial=0.0)),
    )


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


def position_conditions(
    model: Model, state: State, x_new: F64, rot_incr_world: F64, impulses: Mapping[Key, Impulse]
) -> Conditions:
    """Position level of the step from `state` to x_new (N,3), increments (N,3); impulses [N s^2] by pair.

    Every pair of the scene is judged, whether it has an impulse or not.
    """
    _, _, _, d_check, _ = smooth(model, state)
    elements = [element(model, pair, state.x) for pair in model.pairs]
    if not elements:
        return Conditions(0.0, 0.0, 0.0)
    layout = Layout(model, elements)
    problem = PositionProblem(model, layout, state.x + d_check.reshape(-1, 6)[:, :3], d_check)
    displacement = np.concatenate([x_new - state.x, rot_incr_world], axis=1).reshape(-1)
    multipliers = np.zeros(layout.rows)
    for e, rows in zip(elements, layout.slices, strict=True):
        if e.pair.key in impulses:
            multipliers[rows] = from_world(e, impulses[e.pair.key])
    return conditions(problem, (displacement - d_check)[layout.dofs], multipliers)


def split_impulse(model: Model, state: State, x_new: F64, key: Key, total: F64, moment: F64) -> Impulse:
    """Take apart the whole impulse (3,) on the first partner, as the core reports it.

    The normal part acts along the normal of t_{n+1}, friction in the plane of contact of t_n: the two are not
    quite perpendicular, so a projection on the new normal would be wrong by O(h).
    """
    (pair,) = (pair for pair in model.pairs if pair.key == key)
    _, before, _ = gap_and_normal(model, pair, state.x)
    _, after, _ = gap_and_normal(model, pair, x_new)
    normal = float(before @ total) / float(before @ after)
    return Impulse(normal, total - normal * after, moment)


def judge_step(
    model: Model,
    state: State,
    x_new: F64,
    u_new: F64,
    rot_incr_world: F64,
    position_impulses: Mapping[Key, Impulse],
    problems: Sequence[tuple[str, Mapping[Key, Impulse]]],
    scales: Sequence[float] | None = None,
) -> StepJudgement:
    """Judge a whole step from `state` to x_new (N,3), u_new (6N,).

    `problems`: the impulses [N s] of each impact problem by pair, with its stage as `ImpactProblem` names it; an
    entry may hold the problems of several islands, and contacts or problems without impulse may be left out.
    `scales`: factor of the energy safeguard of each entry, where it acted. The law is replayed with the given
    impulses: its sets follow from them, not from a solution made here.
    """
    verdict = StepJudgement(position_conditions(model, state, x_new, rot_incr_world, position_impulses))
    _, _, u_check, _, _ = smooth(model, state)
    closed = [
        element(model, pair, state.x)
        for pair in model.pairs
        if pair.key in position_impulses or gap_and_normal(model, pair, x_new)[0] <= TOUCH * pair.radius
    ]
    factors = [1.0] * len(problems) if scales is None else list(scales)
    u = u_check.copy()
    homeless = {key for _, given in problems for key in given} - {e.pair.key for e in closed}
    if homeless:
        verdict.objections.append(f"impulses of {sorted(homeless)}, which are not closed")
    for group in islands(closed):
        island = Island(model, [closed[i] for i in group], x_new, state.u, u_check)
        own = {e.pair.key for e in island.elements}
        queue = [
            (stage, {key: given[key] for key in own & given.keys()}, factor)
            for (stage, given), factor in zip(problems, factors, strict=True)
        ]
        u[island.layout.dofs] += _replay(island, [entry for entry in queue if entry[1]], verdict)
    radius = np.repeat(np.stack([np.ones(model.bodies), model.radius], axis=1), 3, axis=1).reshape(-1)
    verdict.velocity = float(np.max(np.abs(u_new - u) * radius, initial=0.0))
    return verdict


def _replay(
    island: Island, queue: list[tuple[str, dict[Key, Impulse], float]], verdict: StepJudgement
) -> F64:
    """Run the law of the island on given impulses; W (d,) of those that count."""
    lay = island.layout

    def given_problem(
        island: Island,
        members: list[int],
        fixed: F64,
        u_minus: F64 | None,
        tolerance: float,
        stage: str,
        paper: bool = False,
    ) -> tuple[F64, ImpactProblem]:
        _, given, factor = queue.pop(0) if queue and queue[0][0] == stage else (stage, {}, 1.0)
        multipliers = np.zeros(lay.rows)
        names = [island.elements[i].pair.key for i in members]
        for i, name in zip(members, names, strict=True):
            if name in given:
                multipliers[lay.slices[i]] = from_world(island.elements[i], given[name])
        foreign = given.keys() - set(names)
        if foreign:
            verdict.objections.append(f"stage {stage}: impulses of {sorted(foreign)}, which are no members")
        offset = np.zeros(lay.rows)
        if u_minus is not None:
            offset = island.offset(u_minus, np.full(len(island.elements), factor), tolerance, paper)
        rows = np.concatenate([np.arange(lay.rows)[lay.slices[i]] for i in members])
        sub = Layout(island.model, [island.elements[i] for i in members])
        columns = np.flatnonzero(np.isin(lay.dofs, sub.dofs))
        force = (island.gradient.T @ fixed)[columns]
        gradient = island.gradient[np.ix_(rows, columns)]
        problem = VelocityProblem(sub, gradient, island.u_check[columns], offset[rows], force, island.floor)
        jump = island.jump(fixed + multipliers)
        verdict.problems.append((stage, conditions(problem, jump[columns], multipliers[rows])))
        record = ImpactProblem(tuple(lay.bodies), stage, names, given, 0, [], "", factor, 0.0)
        return multipliers, record

    result = solve_island(island, given_problem)
    if queue:
        verdict.objections.append(
            f"stages {[stage for stage, _, _ in queue]} too many on spheres {lay.bodies}"
        )
    return result.jump
