"""The free motion of a step: Algorithm 1, lines 1-20, with loads and joints but without contacts."""

from dataclasses import dataclass

import numpy as np

from .contact import gap_and_normal
from .joint import JointsAt, accelerations, rates
from .load import applied_force
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
    force: F64
    """f(q_check, v_check, t_{n+1})."""
    reactions: F64
    """lambda of the joints (m,) [N, N m]."""
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
    return State(x, model.orientation.copy(), u, acc.copy(), acc)


def _refuse_violations(joints: JointsAt, u: F64) -> None:
    position, velocity = joints.measure(0.0, 0.0), joints.gradient @ u - rates(joints.rows, 0.0)
    speed = HOLDS * (1.0 + float(np.max(np.abs(u))))
    for row, miss, rate in zip(joints.rows, position, velocity, strict=True):
        if abs(miss) > HOLDS or abs(rate) > speed:
            raise ValueError(
                f"joint {row.joint}, {row.kind}: the start violates it by {miss:.3e} m, {rate:.3e} m/s"
            )


def free_motion(model: Model, state: State) -> FreeMotion:
    """Lines 5-20, eqs. 1a-b: Newton with the whole matrix of eq. 11, rotations in the coordinates psi."""
    h, c = model.options.step, model.coefficients
    time_n, time = state.step * h, (state.step + 1) * h
    turn = rotation_matrices(state.q)
    a_new = (c.alpha_f * state.acc - c.alpha_m * state.a) / (1.0 - c.alpha_m)
    u = state.u + h * (1.0 - c.gamma) * state.a + h * c.gamma * a_new
    d = h * state.u + h * h * (0.5 - c.beta) * state.a + h * h * c.beta * a_new
    acc = np.zeros_like(a_new)
    slope, share = (1.0 - c.alpha_m) / ((1.0 - c.alpha_f) * c.gamma * h), h * c.beta / c.gamma
    wanted, n, m = rates(model.joints, time), len(u), len(model.joints)
    reactions = np.zeros(m)
    weight = np.tile(np.repeat([1.0, 1.0], 3), model.bodies)
    weight.reshape(-1, 6)[:, 3:] = 1.0 / model.radius[:, None]
    p = 0.5 / np.array([row.compliance(model.mass, model.inertia) for row in model.joints])
    # a speed times p s is a force; of a moment it is the moment, divided by a radius as in eq. 44
    lever = np.array([float(np.min(model.radius[list(row.bodies)])) for row in model.joints])
    turns = np.array([row.kind == "rotation" for row in model.joints], dtype=bool)
    p_slope = slope * p / np.where(turns, lever, 1.0)
    for iteration in range(model.options.max_iterations + 1):
        step = d.reshape(-1, 6)
        pose = Pose(state.x + step[:, :3], step[:, 3:], turn)
        joints = JointsAt(model.joints, pose)
        load = applied_force(model.loads, pose, u, time)
        terms = (model.mass_diagonal * acc, load.force, joints.gradient.T @ reactions)
        balance, rate = terms[0] - terms[1] - terms[2], joints.gradient @ u
        residual = np.concatenate([balance * weight, (rate - wanted) * p_slope])
        scale = sum(float(np.linalg.norm(term * weight)) for term in terms)
        scale += float(np.linalg.norm((np.abs(joints.gradient) @ np.abs(u) + np.abs(wanted)) * p_slope))
        if float(np.linalg.norm(residual)) <= model.options.tolerance * scale:
            return FreeMotion(time_n, time, turn, a_new, acc, u, d, load.force, reactions, iteration)
        matrix = np.zeros((n + m, n + m))
        matrix[:n, :n] = slope * np.diag(model.mass_diagonal) + load.damping + share * load.stiffness
        matrix[:n, :n] -= share * joints.reaction_tangent(reactions)
        matrix[:n, n:] = -joints.gradient.T
        matrix[n:, :n] = joints.gradient + share * joints.velocity_tangent(u)
        # dimensionless with square roots of s M and s p; redundant joints have many reactions, the shortest is taken
        left = 1.0 / np.sqrt(np.concatenate([slope * model.mass_diagonal, 1.0 / (slope * p)]))
        rhs = -np.concatenate([balance, rate - wanted])
        change = left * np.linalg.lstsq(matrix * left * left[:, None], rhs * left, rcond=1e-11)[0]
        du = change[:n]
        u, acc, d, reactions = u + du, acc + slope * du, d + share * du, reactions + change[n:]
    raise RuntimeError(f"step {state.step + 1}: the smooth sub-problem was not solved")
