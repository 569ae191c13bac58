"""How well GIVEN positions, velocities and impulses satisfy the conditions of section 4 of the specification.

Redundant frictional contacts have many solutions; two programs may then differ and both be right. What is
judged here is not a solution but its claim: the dynamics, and for every disc the natural map
`projection(lambda - p z) - lambda`, divided by p and for moments multiplied by r_c, so that every figure is a
length [m] (position level) or a speed [m/s] (velocity level) and 0 means that the condition holds exactly.

Nobody reports the multipliers of joints. They have no sign and no bound, so they are recovered: those that balance
the dynamics best, in the metric of M; what they leave unbalanced is the violation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .contact import Impulse, element, from_world, gap_and_normal
from .impact import ImpactProblem, solve_island
from .island import Bonds, Island, islands
from .joint import JointsAt, rates
from .model import F64, TOUCH, Model, State
from .pose import Pose
from .pose import rotation_increment as rotation_increment
from .problem import ContactProblem, Layout, PositionProblem
from .smooth import FreeMotion, free_motion

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
    joints: float = 0.0
    """Rows of joints; those of rotations times the radius of the body."""

    @property
    def worst(self) -> float:
        """The largest of all."""
        return max(self.dynamics, self.normal, self.discs, self.joints)


@dataclass
class StepJudgement:
    """Verdict on one step: each level on its own, and whether the impact problems were the right ones."""

    position: Conditions
    problems: list[tuple[str, Conditions]] = field(default_factory=list)
    """Stage and verdict of each impact problem."""
    velocity: float = 0.0
    """Largest |u_{n+1} - u_check - W| with W from the impulses, rotations times the radius [m/s]."""
    joints: float = 0.0
    """Largest |G u_{n+1} - c'| of the joints, rotations times the radius [m/s]."""
    objections: list[str] = field(default_factory=list)
    """Problems that the law does not have, are missing, or hold impulses of foreign contacts."""

    @property
    def worst(self) -> float:
        """Largest violation of all; infinite if there are objections."""
        figures = [
            self.position.worst,
            self.velocity,
            self.joints,
            *(verdict.worst for _, verdict in self.problems),
        ]
        return float("inf") if self.objections else max(figures)


def conditions(problem: ContactProblem, u: F64, multipliers: F64) -> Conditions:
    """Judge u (d,), lambda (m,) as an answer to a problem; multipliers of joints are recovered, not read."""
    lay, rows = problem.layout, problem.layout.joint_rows
    known = multipliers.copy()
    z, gradient = problem.kinematics(u)
    # projection adds -p z to a joint's multiplier: with this start its row counts as phi = 0
    known[rows] = problem.p[rows] * z[rows]
    at = problem.evaluate(u, known)
    root = 1.0 / np.sqrt(lay.mass)
    balance = root * at.r_u
    reach = gradient[rows].T * root[:, None]
    if lay.joints:
        balance = balance - reach @ np.linalg.lstsq(reach, balance, rcond=1e-10)[0]
    dynamics = np.abs(root * balance) / lay.weight_u
    natural = np.abs(at.r_l) / problem.p / lay.weight_l
    is_normal, is_joint = np.zeros(lay.rows, dtype=bool), np.zeros(lay.rows, dtype=bool)
    is_normal[lay.start], is_joint[rows] = True, True
    return Conditions(
        float(np.max(dynamics, initial=0.0)),
        float(np.max(natural[is_normal], initial=0.0)),
        float(np.max(natural[~is_normal & ~is_joint], initial=0.0)),
        float(np.max(natural[is_joint], initial=0.0)),
    )


def admissible(problem: ContactProblem, u: F64, multipliers: F64) -> Conditions:
    """Judge an answer between those without restitution and with it (rule R4): within the cones, and nothing closes.

    `problem` is the one without restitution.
    """
    lay, of_law = problem.layout, conditions(problem, u, multipliers)
    z, _ = problem.kinematics(u)
    known = multipliers.copy()
    known[lay.joint_rows] = 0.0
    outside = np.abs(problem.project(known)[0] - known) / problem.p / lay.weight_l
    closing = np.maximum(0.0, -z[lay.start]) / lay.weight_l[lay.start]
    return Conditions(
        of_law.dynamics,
        float(np.max(closing, initial=0.0)),
        float(np.max(outside, initial=0.0)),
        of_law.joints,
    )


def position_conditions(
    model: Model, state: State, x_new: F64, rot_incr_world: F64, impulses: Mapping[Key, Impulse]
) -> Conditions:
    """Position level of the step from `state` to x_new (N,3), increments (N,3); impulses [N s^2] by pair.

    Every pair of the scene is judged, whether it has an impulse or not.
    """
    return _position_conditions(model, state, free_motion(model, state), x_new, rot_incr_world, impulses)


def _position_conditions(
    model: Model,
    state: State,
    free: FreeMotion,
    x_new: F64,
    rot_incr_world: F64,
    impulses: Mapping[Key, Impulse],
) -> Conditions:
    elements = [element(model, pair, state.x, state.u) for pair in model.pairs]
    if not elements and not model.joints:
        return Conditions(0.0, 0.0, 0.0)
    layout = Layout(model, elements, model.joints, range(model.bodies))
    x_check = state.x + free.d_check.reshape(-1, 6)[:, :3]
    problem = PositionProblem(model, layout, x_check, free.d_check, free)
    displacement = np.concatenate([x_new - state.x, rot_incr_world], axis=1).reshape(-1)
    multipliers = np.zeros(layout.rows)
    for e, rows in zip(elements, layout.slices, strict=True):
        if e.pair.key in impulses:
            multipliers[rows] = from_world(e, impulses[e.pair.key])
    return conditions(problem, (displacement - free.d_check)[layout.dofs], multipliers)


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
    `scales`: s of rule R4 of each entry, where it acted. The law is replayed with the given
    impulses: its sets follow from them, not from a solution made here.
    """
    free = free_motion(model, state)
    verdict = StepJudgement(
        _position_conditions(model, state, free, x_new, rot_incr_world, position_impulses)
    )
    closed = [
        element(model, pair, state.x, state.u)
        for pair in model.pairs
        if pair.key in position_impulses or gap_and_normal(model, pair, x_new)[0] <= TOUCH * pair.radius
    ]
    factors = [1.0] * len(problems) if scales is None else list(scales)
    u, pose = free.u_check.copy(), Pose(x_new, rot_incr_world, free.turn)
    homeless = {key for _, given in problems for key in given} - {e.pair.key for e in closed}
    if homeless:
        verdict.objections.append(f"impulses of {sorted(homeless)}, which are not closed")
    for group in islands(model, closed):
        bonds = Bonds.of(model, group, free, pose)
        island = Island(model, group.elements, x_new, state.u, free.u_check, bonds)
        own = {e.pair.key for e in island.elements}
        queue = [
            (stage, {key: given[key] for key in own & given.keys()}, factor)
            for (stage, given), factor in zip(problems, factors, strict=True)
        ]
        u[island.layout.dofs] += _replay(island, [entry for entry in queue if entry[1]], verdict)
    radius = np.repeat(np.stack([np.ones(model.bodies), model.radius], axis=1), 3, axis=1).reshape(-1)
    verdict.velocity = float(np.max(np.abs(u_new - u) * radius, initial=0.0))
    if model.joints:
        missed = JointsAt(model.joints, pose).gradient @ u_new - rates(model.joints, free.time)
        weight = Layout(model, [], model.joints).weight_l
        verdict.joints = float(np.max(np.abs(missed) / weight))
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
        before: F64,
        u_minus: F64 | None,
        tolerance: F64,
        stage: str,
        paper: bool = False,
        compressed: F64 | None = None,
        known: F64 | None = None,
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
        offset, least = island.plastic, np.zeros(len(island.elements))
        if compressed is not None and factor == 1.0:
            least, offset = island.expansion(compressed)
        elif u_minus is not None and factor == 1.0:
            offset = island.offset(u_minus, tolerance, paper)
        problem, columns, rows = island.problem(members, offset, fixed)
        problem.least = least[members]
        jump = island.jump(fixed + multipliers)
        judge = conditions if factor in {0.0, 1.0} else admissible
        verdict.problems.append((stage, judge(problem, jump[columns], multipliers[rows])))
        record = ImpactProblem(tuple(lay.bodies), stage, names, given, 0, [], "", factor, 0.0)
        return multipliers, record

    result = solve_island(island, given_problem)
    if queue:
        verdict.objections.append(
            f"stages {[stage for stage, _, _ in queue]} too many on spheres {lay.bodies}"
        )
    return result.jump
