"""Every derivative that the oracle uses for joints and loads, against central differences."""

from typing import Any

import numpy as np
import pytest
from joint_scenes import drag, held, locked, polynomial, push, rod, scene, spring
from oracle.contact import element
from oracle.joint import JointsAt, read_joints
from oracle.law import PolynomialLaw, TableLaw, extrapolated
from oracle.load import applied_force, read_loads
from oracle.model import Model, State
from oracle.pose import Carried, Pose, rotate, rotation_matrices
from oracle.problem import Layout, PositionProblem, VelocityProblem
from oracle.smooth import SmoothProblem, free_motion

N = 3
CLOSE = 1e-7


def derivative(f: Any, x: Any, step: float = 1e-5) -> Any:
    """Central differences (..., len(x)), fourth order."""
    columns = []
    for i in range(len(x)):
        e = np.zeros(len(x))
        e[i] = step
        columns.append((8 * (f(x + e) - f(x - e)) - (f(x + 2 * e) - f(x - 2 * e))) / (12 * step))
    return np.stack(columns, axis=-1)


def worst(exact: Any, numeric: Any) -> float:
    return float(np.max(np.abs(exact - numeric)) / max(1.0, np.max(np.abs(numeric))))


def linked(rng: Any, **options: Any) -> dict[str, Any]:
    """Three spheres with a joint of each kind, to the ground and to each other, and each kind of load."""
    x = rng.normal(size=(N, 3))
    wind = rng.normal(size=(6, 6))

    def user(t: float, x: Any, v: Any, w: Any) -> Any:
        swirl = np.concatenate([np.sin(x), np.cos(v) + 0.1 * w], axis=1) @ wind
        return swirl + swirl[::-1] * t

    def near(body: int) -> Any:
        return x[body] + rng.normal(size=3)

    p, q = near(0), near(2)
    return scene(
        x,
        rng.normal(size=(N, 3)),
        rng.normal(size=(N, 3)),
        joints=[
            held(x, 0, 1, p),
            held(x, 2, -1, q, [[0.6, 0.8, 0.0]], polynomial(0.0, 1.0, 2.0)),
            rod(x, 1, 2, near(1), near(2)),
            rod(x, 0, -1, near(0), rng.normal(size=3)),
            locked(1, 2, [[0.0, 0.6, -0.8]], polynomial(0.0, 0.0, 3.0)),
            locked(0, -1, [[1.0, 0.0, 0.0]]),
        ],
        loads=[
            spring(x, 0, 2, near(0), near(2), k=3.0, c=0.7, rest=0.4),
            spring(x, 1, -1, near(1), rng.normal(size=3), k=2.0, c=0.3, rest=1.1),
            drag(1, 0.3, 0.2),
            push(0, torque=[polynomial(0.0, 1.0)] * 3),
            {"kind": "callable", "function": user},
        ],
        **options,
    )


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.5, 1.9, 2.1, 5.0, 40.0])
def test_a_carried_vector_is_the_rotated_one_with_exact_derivatives(angle: float) -> None:
    rng = np.random.default_rng(3)
    psi, r, a = rng.normal(size=(3, 3))
    psi *= angle / np.linalg.norm(psi)
    carried = Carried(psi, r)
    turned = rotation_matrices(rotate(np.array([[1.0, 0, 0, 0]]), psi[None]))[0] @ r
    assert np.max(np.abs(carried.y - turned)) < 1e-14 * max(1.0, angle)
    assert worst(carried.jacobian(), derivative(lambda p: Carried(p, r).y, psi)) < 1e-9
    slope = derivative(lambda p: a @ Carried(p, r).jacobian(), psi)
    assert worst(carried.curvature(a), slope) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_of_joints(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = read_joints(linked(rng))
    turn = rotation_matrices(rotate(np.tile([1.0, 0, 0, 0], (N, 1)), rng.normal(size=(N, 3))))
    q, u, force = rng.normal(size=6 * N), rng.normal(size=6 * N), rng.normal(size=len(rows))

    def at(q: Any) -> JointsAt:
        step = q.reshape(-1, 6)
        return JointsAt(rows, Pose(step[:, :3], step[:, 3:], turn))

    here = at(q)
    assert worst(here.slope, derivative(lambda q: at(q).measure(0.0, 0.0), q)) < CLOSE
    assert worst(here.curvature(force), derivative(lambda q: force @ at(q).slope, q)) < CLOSE
    assert worst(here.reaction_tangent(force), derivative(lambda q: force @ at(q).gradient, q)) < CLOSE
    assert worst(here.velocity_tangent(u), derivative(lambda q: at(q).gradient @ u, q)) < CLOSE
    # the rate of the measure: at psi = 0 the coordinates move with the velocities
    q.reshape(-1, 6)[:, 3:] = 0.0
    assert worst(at(q).gradient, at(q).slope) < 1e-14


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_of_loads(seed: int) -> None:
    rng = np.random.default_rng(seed)
    loads = read_loads(linked(rng))
    turn = rotation_matrices(rotate(np.tile([1.0, 0, 0, 0], (N, 1)), rng.normal(size=(N, 3))))
    q, u = rng.normal(size=6 * N), rng.normal(size=6 * N)

    def at(q: Any, u: Any) -> Any:
        step = q.reshape(-1, 6)
        return applied_force(loads, Pose(step[:, :3], step[:, 3:], turn), u, 0.7)

    assert worst(at(q, u).by_position, derivative(lambda q: at(q, u).force, q)) < CLOSE
    assert worst(at(q, u).by_velocity, derivative(lambda u: at(q, u).force, u)) < CLOSE
    assert worst(at(q, u).stiffness, -at(q, u).by_position) == 0.0
    # at given positions springs, dampers and drag are linear in the velocity
    own = [load for load in loads if load.joins()]
    pose = Pose(q.reshape(-1, 6)[:, :3], q.reshape(-1, 6)[:, 3:], turn)
    here, there = applied_force(own, pose, u, 0.7), applied_force(own, pose, 3.0 * u, 0.7)
    assert there.force - here.force == pytest.approx(here.by_velocity @ (2.0 * u), abs=1e-12)
    # inner forces push neither the whole nor turn it: springs between spheres alone
    x = rng.normal(size=(2, 3))
    own = [spring(x, 0, 1, rng.normal(size=3), rng.normal(size=3), k=2.0, c=0.4, rest=0.1)]
    inner = read_loads(scene(x, g=(0, 0, 0), loads=own))
    f = applied_force(inner, Pose(x, np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))), u[:12], 0.0).force
    f = f.reshape(-1, 6)
    assert np.max(np.abs(f)) > 0.1
    assert np.max(np.abs(f[:, :3].sum(axis=0))) < 1e-14
    assert np.max(np.abs((f[:, 3:] + np.cross(x, f[:, :3])).sum(axis=0))) < 1e-14


def started(rng: Any, **options: Any) -> tuple[Model, State]:
    """The linked spheres amidst a motion that need not satisfy anything."""
    model = Model.from_dict(linked(rng, step=0.05, **options))
    q = rotate(model.orientation, rng.normal(size=(N, 3)))
    u, a, acc = rng.normal(size=(3, 6 * N))
    return model, State(model.position, q, u, a, acc, 3)


@pytest.mark.parametrize("seed", range(3))
def test_the_smooth_matrix_is_the_derivative_of_its_residual(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, state = started(rng)
    problem = SmoothProblem(model, state)
    n, m = 6 * N, len(model.joints)
    y = rng.normal(size=n + m)
    numeric = derivative(lambda y: problem.residual(y[:n], y[n:])[0], y)
    assert worst(problem.matrix(y[:n], y[n:]), numeric) < CLOSE


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("level", ["position", "velocity"])
def test_the_hessians_with_joints_and_loads(level: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, state = started(rng)
    free = free_motion(model, state)
    elements = [element(model, pair, state.x, state.u) for pair in model.pairs]
    layout = Layout(model, elements, model.joints)
    d, m = len(layout.dofs), layout.rows
    problem: Any
    if level == "position":
        problem = PositionProblem(
            model, layout, state.x + free.d_check.reshape(-1, 6)[:, :3], free.d_check, free
        )
    else:
        start = Pose(state.x, np.zeros_like(state.x), free.turn)
        joints = JointsAt(model.joints, start)
        gradient = np.concatenate([rng.normal(size=(layout.contact_rows, d)), joints.gradient])
        offset, fixed = rng.normal(size=m), rng.normal(size=d)
        damping = -0.05 * applied_force(model.following, start, free.u_check, free.time).damping
        problem = VelocityProblem(layout, gradient, free.u_check, offset, fixed, 0.0, damping)
    # far from every border: contacts open or pushing, without friction
    y = np.concatenate([0.1 * rng.normal(size=d), 20.0 + rng.normal(size=m)])

    def residual(y: Any) -> Any:
        at = problem.evaluate(y[:d], y[d:])
        return np.concatenate([at.r_u, at.r_l])

    exact = problem.hessian(y[:d], problem.evaluate(y[:d], y[d:]))
    assert worst(exact, derivative(residual, y)) < CLOSE


def test_laws_and_their_derivatives() -> None:
    cubic = PolynomialLaw([1.0, -2.0, 0.5, 3.0])
    assert cubic.value(2.0) == 1.0 - 4.0 + 2.0 + 24.0
    assert cubic.rate(2.0) == -2.0 + 2.0 + 36.0
    assert cubic.second(2.0) == 1.0 + 36.0
    assert PolynomialLaw(4.0).rate(1.0) == 0.0
    table = TableLaw([[0.0, 1.0], [1.0, 3.0], [3.0, -1.0]])
    assert [table.value(x) for x in (-1.0, 0.5, 2.0, 9.0)] == [1.0, 2.0, 1.0, -1.0]
    assert [table.rate(x) for x in (-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0)] == [
        0.0,
        2.0,
        2.0,
        -2.0,
        -2.0,
        0.0,
        0.0,
    ]
    for f, exact in ((np.sin, np.cos(0.7)), (lambda x: np.exp(-30 * x), -30 * np.exp(-21.0))):
        found = extrapolated(lambda d, f=f: (f(0.7 + d) - f(0.7 - d)) / (2 * d))
        assert found == pytest.approx(exact, abs=2e-12)


def test_laws_of_expressions() -> None:
    _core = pytest.importorskip("carom._core")
    if not hasattr(_core, "Expression"):
        pytest.skip("the core is built without expressions")
    from oracle.law import read_law

    law = read_law(("expression", "0.3*sin(40*t) + t^2"))
    assert law.value(0.2) == pytest.approx(0.3 * np.sin(8.0) + 0.04, rel=1e-15)
    assert law.rate(0.2) == pytest.approx(12.0 * np.cos(8.0) + 0.4, abs=1e-10)
    assert law.second(0.2) == pytest.approx(-480.0 * np.sin(8.0) + 2.0, abs=1e-6)
