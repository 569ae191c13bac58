"""Algorithm 1 of the paper: predict, smooth, position, velocity, finish."""

from dataclasses import dataclass, field

import numpy as np

from . import once
from .contact import Element, Impulse, element, gap_and_normal, to_world
from .impact import ImpactProblem, IslandResult, solve_island
from .island import Bonds, Island, islands
from .joint import joint_wrenches
from .model import F64, TOUCH, Model, Pair, State
from .newton import Solution, solve
from .pose import Pose, rotate
from .problem import Layout, PositionProblem
from .smooth import FreeMotion, free_motion


@dataclass
class StepReport:
    """What happened in a step. Contacts are named by `Pair.key`; impulses act on the first partner."""

    smooth_iterations: int = 0
    position_iterations: list[int] = field(default_factory=list)
    """Per island of possible contacts; likewise the histories."""
    position_histories: list[list[float]] = field(default_factory=list)
    position_impulses: dict[tuple[int, int], Impulse] = field(default_factory=dict)
    closed: list[tuple[int, int]] = field(default_factory=list)
    """The set A (eq. 8a as amended)."""
    problems: list[ImpactProblem] = field(default_factory=list)
    """All impact problems, island after island, in the order they were solved."""
    velocity_impulses: dict[tuple[int, int], Impulse] = field(default_factory=dict)
    """Sum over the problems that count: what changed the velocities in this step."""
    truncated: int = 0
    """Islands whose sequence was cut."""
    fallbacks: list[str] = field(default_factory=list)
    relisted: int = 0
    """Times the position level was solved again because an unlisted pair overlapped."""
    reactions: F64 = field(default_factory=lambda: np.zeros(0))
    """Impulses of the joints in the step, row by row of the model (m,) [N s, N m s]: Lambda + h lambda(t_{n+1})."""
    joint_impulses: F64 = field(default_factory=lambda: np.zeros((0, 6)))
    """What each joint gave its sphere A in the step (J,6): points and distances [N s], rotations [N m s]."""

    @property
    def scale(self) -> float:
        """Smallest factor of the energy safeguard, 1 if it did nothing."""
        return min((problem.scale for problem in self.problems), default=1.0)

    def velocity_iterations(self) -> list[int]:
        """Newton iterations of each impact problem."""
        return [problem.iterations for problem in self.problems]


def smooth(model: Model, state: State) -> tuple[F64, F64, F64, F64, int]:
    """Lines 5-20: a_new before line 41, acc_new, u_check, displacement d_check (6N,), and the iterations."""
    free = free_motion(model, state)
    return free.a_new, free.acc_new, free.u_check, free.d_check, free.iterations


@dataclass
class Corrected:
    """Result of the position level: centres (N,3), displacement of the whole step (6N,), closed contacts."""

    x: F64
    displacement: F64
    closed: list[Element]


def position(model: Model, state: State, free: FreeMotion, report: StepReport) -> Corrected:
    """Lines 21-30 (eqs. 1c-e, 8a): remove overlap, with friction on the increments of the step; hold the joints."""
    d_check = free.d_check
    x_check = state.x + d_check.reshape(-1, 6)[:, :3]
    elements: dict[tuple[int, int], Element] = {}

    def built(pair: Pair) -> Element:
        if pair.key not in elements:
            elements[pair.key] = element(model, pair, state.x, state.u)
        return elements[pair.key]

    # any list will do, as long as no pair outside it overlaps in the end
    gaps = {pair.key: gap_and_normal(model, pair, x_check)[0] for pair in model.pairs}
    deepest = max([0.0, *(-gap for gap in gaps.values())])
    listed = {pair.key for pair in model.pairs if gaps[pair.key] < 2.0 * deepest + 1e-3 * pair.radius}
    while True:
        correction = np.zeros_like(d_check)
        solutions: list[tuple[Layout, Solution]] = []
        candidates = [built(pair) for pair in model.pairs if pair.key in listed]
        for group in islands(model, candidates):
            layout = Layout(model, group.elements, group.joints, group.bodies if group.links else ())
            problem = PositionProblem(model, layout, x_check, d_check, free)
            what = f"position level, step {state.step + 1}, spheres {layout.bodies}"
            solutions.append((layout, solve(problem, np.zeros(len(layout.dofs)), model.options, what)))
            correction[layout.dofs] = solutions[-1][1].u
        displacement = d_check + correction
        x = state.x + displacement.reshape(-1, 6)[:, :3]
        gaps = {pair.key: gap_and_normal(model, pair, x)[0] for pair in model.pairs}
        missed = {key for key, gap in gaps.items() if gap < 0.0 and key not in listed}
        if not missed:
            break
        listed |= missed
        report.relisted += 1
    pushed = set()
    for layout, solution in solutions:
        report.position_iterations.append(solution.iterations)
        report.position_histories.append(solution.history)
        if solution.fallback:
            report.fallbacks.append(f"position: {solution.fallback}")
        for e, rows in zip(layout.elements, layout.slices, strict=True):
            multipliers = solution.multipliers[rows]
            if multipliers[0] > 0.0:
                pushed.add(e.pair.key)
                report.position_impulses[e.pair.key] = to_world(e, multipliers)
    closed = [
        built(pair) for pair in model.pairs if pair.key in pushed or gaps[pair.key] <= TOUCH * pair.radius
    ]
    report.closed = [e.pair.key for e in closed]
    return Corrected(x, displacement, closed)


def velocity(model: Model, corrected: Corrected, u_n: F64, free: FreeMotion, report: StepReport) -> F64:
    """Lines 31-40 (eqs. 1f-h, 24-29): u_{n+1} = u_check + W, (6N,), from the problems of every island."""
    u = free.u_check.copy()
    pose = Pose(corrected.x, corrected.displacement.reshape(-1, 6)[:, 3:], free.turn)
    for group in islands(model, corrected.closed):
        bonds = Bonds.of(model, group, free, pose)
        island = Island(model, group.elements, corrected.x, u_n, free.u_check, bonds)
        result: IslandResult = solve_island(island)
        u[island.layout.dofs] += result.jump
        report.problems += result.problems
        report.truncated += int(result.truncated)
        report.fallbacks += [f"velocity {p.stage}: {p.fallback}" for p in result.problems if p.fallback]
        for e, rows in zip(island.elements, island.layout.slices, strict=True):
            if result.multipliers[rows.start] > 0.0:
                report.velocity_impulses[e.pair.key] = to_world(e, result.multipliers[rows])
        if bonds:
            impulses = result.multipliers[island.layout.joint_rows]
            for row, impulse in zip(group.joints, impulses, strict=True):
                report.reactions[row.number] += impulse
            report.joint_impulses += joint_wrenches(
                group.joints, impulses, bonds.gradient, len(report.joint_impulses)
            )
    return u


def advance(model: Model, state: State) -> tuple[State, StepReport]:
    """One step of size h; `state` is left as it is."""
    joints = 1 + max((row.joint for row in model.joints), default=-1)
    report = StepReport(reactions=np.zeros(len(model.joints)), joint_impulses=np.zeros((joints, 6)))
    h = model.options.step
    free = free_motion(model, state)
    report.smooth_iterations = free.iterations
    if model.options.position_friction == "once" and model.options.impact == "sequence":
        x, displacement, u = once.step(model, state, free)
        corrected = Corrected(x, displacement, [])
    else:
        corrected = position(model, state, free, report)
        u = velocity(model, corrected, state.u, free, report)
    for row, reaction in zip(model.joints, free.reactions, strict=True):
        report.reactions[row.number] += h * reaction
    c = model.coefficients
    a_new = free.a_new + (1.0 - c.alpha_f) / (1.0 - c.alpha_m) * free.acc_new
    # the impulse that acted is that of the filtered reactions, as the velocity is that of the filtered accelerations
    reaction = joint_wrenches(model.joints, free.reactions, free.gradient, joints)
    pseudo = (1.0 - c.alpha_f) * reaction + c.alpha_f * state.reaction - c.alpha_m * state.pseudo_reaction
    pseudo /= 1.0 - c.alpha_m
    report.joint_impulses += h * ((1.0 - c.gamma) * state.pseudo_reaction + c.gamma * pseudo)
    rot_incr_world = corrected.displacement.reshape(-1, 6)[:, 3:]
    q = rotate(state.q, rot_incr_world)
    return State(corrected.x, q, u, a_new, free.acc_new, state.step + 1, reaction, pseudo), report
