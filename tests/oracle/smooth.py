"""The free motion of a step: Algorithm 1, lines 1-20, with loads and joints but without contacts."""

from dataclasses import dataclass

import numpy as np

from .contact import gap_and_normal
from .joint import JointsAt, accelerations, joint_wrenches, rates
from .load import Applied, applied_force
from .model import F64, TOUCH, Model, State
from .pose import Pose, rotation_matrices

HOLDS = 1e-9
"""A joint may be violated at the start by this [m, rad, m/s, rad/s], relative to the size of what it binds."""


@dataclass(frozen=True)
class FreeMotion:
    """Result of the smooth sub-problem; generalised vectors (6N,)."""

    time_n: float
    time: float
    """t_n and t_{n+1} [s]."""
    turn: F64
    """Rotations R_n (N,3,3)."""
    a_new: F64
    """Pseudo acceleration before line 41."""
    acc_new: F64
    """Smooth acceleration of t_{n+1}."""
    u_check: F64
    d_check: F64
    """Velocity, and displacement (x, psi) of the step."""
    following: Applied
    """f(q_check, v_check, t_{n+1}) of the loads that follow the motion."""
    reactions: F64
    """lambda of the joints (m,) [N, N m]."""
    gradient: F64
    """G of the joints (m, 6N) at q_check, along which the reactions act."""
    iterations: int


def initial_state(model: Model) -> State:
    """State at t = 0 with a = acc consistent (Algorithm 1, lines 2-3): no contact forces, but those of the joints.

    M acc = f + G^T lambda with G acc = c'' - (dG/dt) v. Refuses overlapping spheres and joints that the start violates.
    """
    x = model.position.copy()
    for pair in model.pairs:
        gap = gap_and_normal(model, pair, x)[0]
        if gap < -TOUCH * pair.radius:
            raise ValueError(f"pair {pair.key} overlaps by {-gap:.3e} m at the start")
    u = np.concatenate([model.velocity, model.angular_velocity], axis=1).reshape(-1)
    pose = Pose(x, np.zeros_like(x), rotation_matrices(model.orientation))
    f = applied_force(model.loads, pose, u, 0.0).force
    acc = f / model.mass_diagonal
    if model.joints:
        joints = JointsAt(model.joints, pose)
        _refuse_violations(joints, u)
        # at psi = 0 the rate of psi is w, so that u is the rate of (x, psi)
        turning = joints.velocity_tangent(u) @ u
        wanted = accelerations(model.joints, 0.0) - turning - joints.gradient @ acc
        root = 1.0 / np.sqrt(model.mass_diagonal)
        # least norm in the metric of M: the constrained acceleration is the nearest to the free one (Gauss)
        acc = acc + root * np.linalg.lstsq(joints.gradient * root, wanted, rcond=1e-10)[0]
    start = np.zeros((1 + max((row.joint for row in model.joints), default=-1), 6))
    if model.joints:
        given = model.mass_diagonal * acc - f
        reactions = np.asarray(np.linalg.lstsq(joints.gradient.T, given, rcond=1e-10)[0], dtype=np.float64)
        start = joint_wrenches(model.joints, reactions, joints.gradient, len(start))
    return State(x, model.orientation.copy(), u, acc.copy(), acc, 0, start, start.copy())


def _refuse_violations(joints: JointsAt, u: F64) -> None:
    position, velocity = joints.measure(0.0, 0.0), joints.gradient @ u - rates(joints.rows, 0.0)
    speed = HOLDS * (1.0 + float(np.max(np.abs(u))))
    for row, miss, rate in zip(joints.rows, position, velocity, strict=True):
        if abs(miss) > HOLDS or abs(rate) > speed:
            raise ValueError(
                f"joint {row.joint}, {row.kind}: the start violates it by {miss:.3e} m, {rate:.3e} m/s"
            )


class SmoothProblem:
    """Eqs. 1a-b over du (6N,), the change of v_check from its prediction, and lambda (m,) of the joints.

    As in lines 16-18, du changes acc by `slope` du and the displacement by `share` du.
    """

    def __init__(self, model: Model, state: State) -> None:
        h, c = model.options.step, model.coefficients
        self.model, self.state = model, state
        self.time_n, self.time = state.step * h, (state.step + 1) * h
        self.turn = rotation_matrices(state.q)
        self.slope = (1.0 - c.alpha_m) / ((1.0 - c.alpha_f) * c.gamma * h)
        self.share = h * c.beta / c.gamma
        self.a_new = (c.alpha_f * state.acc - c.alpha_m * state.a) / (1.0 - c.alpha_m)
        self.u_start = state.u + h * (1.0 - c.gamma) * state.a + h * c.gamma * self.a_new
        self.d_start = h * state.u + h * h * ((0.5 - c.beta) * state.a + c.beta * self.a_new)
        self.wanted = rates(model.joints, self.time)
        self._last: tuple[F64, tuple[F64, JointsAt, Applied]] | None = None
        self.p = 0.5 / np.array([row.compliance(model.mass, model.inertia) for row in model.joints])
        # weights of eq. 44: moments over a radius; a speed times p s is a force
        self.weight = np.ones(6 * model.bodies)
        self.weight.reshape(-1, 6)[:, 3:] = 1.0 / model.radius[:, None]
        lever = [float(np.min(model.radius[list(row.bodies)])) for row in model.joints]
        turns = [row.kind == "rotation" for row in model.joints]
        self.weight_rate = self.slope * self.p / np.where(turns, lever, 1.0)

    def moved(self, du: F64) -> tuple[F64, F64, Pose]:
        """v_check and d_check (6N,), and the pose there."""
        u, d = self.u_start + du, self.d_start + self.share * du
        step = d.reshape(-1, 6)
        return u, d, Pose(self.state.x + step[:, :3], step[:, 3:], self.turn)

    def at(self, du: F64) -> tuple[F64, JointsAt, Applied]:
        """v_check (6N,), joints and loads."""
        if self._last is None or not np.array_equal(self._last[0], du):
            u, _, pose = self.moved(du)
            load = applied_force(self.model.loads, pose, u, self.time)
            self._last = du.copy(), (u, JointsAt(self.model.joints, pose), load)
        return self._last[1]

    def residual(self, du: F64, reactions: F64) -> tuple[F64, float, float]:
        """Residual (6N + m,) [N, N m, m/s, rad/s], its weighted norm [N] and the sum of those of its terms."""
        u, joints, load = self.at(du)
        inertia, carried = self.model.mass_diagonal * self.slope * du, joints.gradient.T @ reactions
        balance, miss = inertia - load.force - carried, joints.gradient @ u - self.wanted
        norm = np.hypot(np.linalg.norm(balance * self.weight), np.linalg.norm(miss * self.weight_rate))
        rate = np.abs(joints.gradient) @ np.abs(u) + np.abs(self.wanted)
        # load by load: at rest on a spring inertia and force vanish, their rounding does not
        terms = (inertia * self.weight, load.parts * self.weight, carried * self.weight)
        scale = sum(np.linalg.norm(term) for term in (*terms, rate * self.weight_rate))
        return np.concatenate([balance, miss]), float(norm), float(scale)

    def matrix(self, du: F64, reactions: F64) -> F64:
        """S_t of eq. 11, (6N + m, 6N + m): the derivative of the residual."""
        u, joints, load = self.at(du)
        n, m = len(du), len(reactions)
        result = np.zeros((n + m, n + m))
        result[:n, :n] = self.slope * np.diag(self.model.mass_diagonal) + load.damping
        result[:n, :n] += self.share * (load.stiffness - joints.reaction_tangent(reactions))
        result[:n, n:] = -joints.gradient.T
        result[n:, :n] = joints.gradient + self.share * joints.velocity_tangent(u)
        return result


def free_motion(model: Model, state: State) -> FreeMotion:
    """Lines 5-20, eqs. 1a-b, by Newton."""
    problem = SmoothProblem(model, state)
    n, slope = 6 * model.bodies, problem.slope
    du, reactions = np.zeros(n), np.zeros(len(model.joints))
    # dimensionless with square roots of s M and of s p
    left = 1.0 / np.sqrt(np.concatenate([slope * model.mass_diagonal, 1.0 / (slope * problem.p)]))
    for iteration in range(model.options.max_iterations + 1):
        residual, norm, scale = problem.residual(du, reactions)
        if norm <= model.options.tolerance * scale:
            u, d, pose = problem.moved(du)
            following = applied_force(model.following, pose, u, problem.time)
            return FreeMotion(
                problem.time_n, problem.time, problem.turn, problem.a_new, slope * du, u, d, following,
                reactions, problem.at(du)[1].gradient, iteration,
            )  # fmt: skip
        matrix = problem.matrix(du, reactions) * left * left[:, None]
        # reactions of redundant joints are not unique: the shortest
        change = left * np.linalg.lstsq(matrix, -residual * left, rcond=1e-11)[0]
        du, reactions = du + change[:n], reactions + change[n:]
    raise RuntimeError(f"step {state.step + 1}: the smooth sub-problem was not solved")
