"""Algorithm 1 of the paper: predict, smooth, position, velocity, finish."""

from dataclasses import dataclass, field

import numpy as np

from .contact import Element, Impulse, element, gap_and_normal, islands, to_world
from .impact import ImpactProblem, Island, IslandResult, solve_island
from .model import F64, TOUCH, Model, Pair, State
from .newton import Solution, solve
from .problem import Layout, PositionProblem


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

    @property
    def scale(self) -> float:
        """Smallest factor of the energy safeguard, 1 if it did nothing."""
        return min((problem.scale for problem in self.problems), default=1.0)

    def velocity_iterations(self) -> list[int]:
        """Newton iterations of each impact problem."""
        return [problem.iterations for problem in self.problems]


def applied_force(model: Model, x_check: F64, u_check: F64, time: float) -> tuple[F64, F64, F64]:
    """Smooth force f (6N,) and its derivatives by displacement and velocity, (6N, 6N): here gravity alone.

    Loads that depend on position, velocity or time enter the reference at this one place.
    """
    f = np.zeros(6 * model.bodies)
    f.reshape(-1, 6)[:, :3] = model.mass[:, None] * model.gravity
    zero = np.zeros((len(f), len(f)))
    return f, zero, zero


def initial_state(model: Model) -> State:
    """State at t = 0 with a = acc = M^-1 f (Algorithm 1, lines 2-3); refuses overlapping spheres."""
    x = model.position.copy()
    for pair in model.pairs:
        gap = gap_and_normal(model, pair, x)[0]
        if gap < -TOUCH * pair.radius:
            raise ValueError(f"pair {pair.key} overlaps by {-gap:.3e} m at the start")
    u = np.concatenate([model.velocity, model.angular_velocity], axis=1).reshape(-1)
    f, _, _ = applied_force(model, x, u, 0.0)
    acc = f / model.mass_diagonal
    return State(x, model.orientation.copy(), u, acc.copy(), acc)


def smooth(model: Model, state: State) -> tuple[F64, F64, F64, F64, int]:
    """Lines 5-20: the free motion of the step.

    Returns a_new before line 41, acc_new, u_check, displacement d_check (6N,), and the iterations.
    """
    h, c = model.options.step, model.coefficients
    time = (state.step + 1) * h
    a_new = (c.alpha_f * state.acc - c.alpha_m * state.a) / (1.0 - c.alpha_m)
    u_check = state.u + h * (1.0 - c.gamma) * state.a + h * c.gamma * a_new
    d_check = h * state.u + h * h * (0.5 - c.beta) * state.a + h * h * c.beta * a_new
    acc_new = np.zeros_like(a_new)
    slope = (1.0 - c.alpha_m) / ((1.0 - c.alpha_f) * c.gamma * h)
    for iteration in range(model.options.max_iterations):
        x_check = state.x + d_check.reshape(-1, 6)[:, :3]
        f, stiffness, damping = applied_force(model, x_check, u_check, time)
        inertia = model.mass_diagonal * acc_new
        residual = inertia - f
        scale = np.linalg.norm(inertia) + np.linalg.norm(f)
        if float(np.linalg.norm(residual)) <= model.options.tolerance * scale:
            return a_new, acc_new, u_check, d_check, iteration
        matrix = slope * np.diag(model.mass_diagonal) - damping - h * c.beta / c.gamma * stiffness
        du = np.linalg.solve(matrix, -residual)
        u_check = u_check + du
        acc_new = acc_new + slope * du
        d_check = d_check + h * c.beta / c.gamma * du
    raise RuntimeError("the smooth sub-problem was not solved")


@dataclass
class Corrected:
    """Result of the position level: centres (N,3), displacement of the whole step (6N,), closed contacts."""

    x: F64
    displacement: F64
    closed: list[Element]


def position(model: Model, state: State, d_check: F64, report: StepReport) -> Corrected:
    """Lines 21-30 (eqs. 1c-e, 8a): remove overlap, with friction on the increments of the step."""
    x_check = state.x + d_check.reshape(-1, 6)[:, :3]
    elements: dict[tuple[int, int], Element] = {}

    def built(pair: Pair) -> Element:
        if pair.key not in elements:
            elements[pair.key] = element(model, pair, state.x)
        return elements[pair.key]

    # any list will do, as long as no pair outside it overlaps in the end
    gaps = {pair.key: gap_and_normal(model, pair, x_check)[0] for pair in model.pairs}
    deepest = max([0.0, *(-gap for gap in gaps.values())])
    listed = {pair.key for pair in model.pairs if gaps[pair.key] < 2.0 * deepest + 1e-3 * pair.radius}
    while True:
        correction = np.zeros_like(d_check)
        solutions: list[tuple[Layout, Solution]] = []
        candidates = [built(pair) for pair in model.pairs if pair.key in listed]
        for group in islands(candidates):
            layout = Layout(model, [candidates[i] for i in group])
            problem = PositionProblem(model, layout, x_check, d_check)
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


def velocity(model: Model, corrected: Corrected, u_n: F64, u_check: F64, report: StepReport) -> F64:
    """Lines 31-40 (eqs. 1f-h, 24-29): u_{n+1} = u_check + W, (6N,), from the problems of every island."""
    u = u_check.copy()
    for group in islands(corrected.closed):
        island = Island(model, [corrected.closed[i] for i in group], corrected.x, u_n, u_check)
        result: IslandResult = solve_island(island)
        u[island.layout.dofs] += result.jump
        report.problems += result.problems
        report.truncated += int(result.truncated)
        report.fallbacks += [f"velocity {p.stage}: {p.fallback}" for p in result.problems if p.fallback]
        for e, rows in zip(island.elements, island.layout.slices, strict=True):
            if result.multipliers[rows.start] > 0.0:
                report.velocity_impulses[e.pair.key] = to_world(e, result.multipliers[rows])
    return u


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


def advance(model: Model, state: State) -> tuple[State, StepReport]:
    """One step of size h; `state` is left as it is."""
    report = StepReport()
    a_new, acc_new, u_check, d_check, report.smooth_iterations = smooth(model, state)
    corrected = position(model, state, d_check, report)
    u = velocity(model, corrected, state.u, u_check, report)
    c = model.coefficients
    a_new = a_new + (1.0 - c.alpha_f) / (1.0 - c.alpha_m) * acc_new
    rot_incr_world = corrected.displacement.reshape(-1, 6)[:, 3:]
    q = rotate(state.q, rot_incr_world)
    return State(corrected.x, q, u, a_new, acc_new, state.step + 1), report
