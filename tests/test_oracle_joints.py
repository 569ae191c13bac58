"""The oracle with joints, loads and friction laws against closed forms: it may judge others only after that."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from joint_scenes import (
    AXES,
    G,
    constant,
    drag,
    held,
    locked,
    polynomial,
    push,
    rod,
    scene,
    spring,
)
from oracle import Reference
from oracle.pose import rotation_increment

R, L = 0.1, 0.5
I_SPHERE = 0.4 * R**2
"""Inertia of a sphere of 1 kg about its centre."""


def hung(angle: float, with_rod: bool, spin: float = 0.0, **options: Any) -> Reference:
    """A ball of 1 kg below the origin, L from it, `angle` off the vertical in the plane y = 0: on a rod or a rigid arm."""
    x = np.array([[L * np.sin(angle), 0.0, -L * np.cos(angle)]])
    velocity = spin * np.cross([0.0, -1.0, 0.0], x)
    joint = rod(x, 0, -1, None, [0.0, 0.0, 0.0]) if with_rod else held(x, 0, -1, [0.0, 0.0, 0.0])
    turning = [[0.0, 0.0, 0.0]] if with_rod else [[0.0, -spin, 0.0]]
    return Reference(scene(x, velocity, turning, joints=[joint], **options))


def period(angle: float, with_rod: bool) -> float:
    """Of a pendulum released at `angle`, by the arithmetic-geometric mean."""
    length = L if with_rod else (I_SPHERE + L**2) / L
    a, b = 1.0, np.cos(angle / 2)
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, np.sqrt(a * b)
    return float(2 * np.pi * np.sqrt(length / G) / a)


def orders(errors: list[float]) -> Any:
    """Orders from errors at halved steps."""
    return np.log2(np.array(errors[:-1]) / errors[1:])


# ---------------------------------------------------------------------------------------------- pendulums


@pytest.mark.parametrize("with_rod", [True, False], ids=["rod", "rigid arm"])
def test_a_pendulum_swings_with_its_exact_period_to_second_order(with_rod: bool) -> None:
    errors = []
    for steps in (25, 50, 100):
        # after a quarter of it the ball is lowest, where an error of phase shows most
        pendulum = hung(1.2, with_rod, step=period(1.2, with_rod) / 4 / steps)
        pendulum.advance(steps)
        errors.append(float(np.linalg.norm(pendulum.x[0] - [0.0, 0.0, -L])))
    assert errors[-1] < 1e-4
    assert orders(errors) == pytest.approx([2, 2], abs=0.3)


@pytest.mark.parametrize("steps", [100, pytest.param(1000, marks=pytest.mark.long)])
def test_a_pendulum_keeps_its_joint_and_its_energy(steps: int) -> None:
    """Neither length nor its rate drift; the numerical damping of the scheme is of third order in h."""
    pendulum = hung(1.2, False, step=5e-3)
    start = sum(pendulum.energy())
    size = G * L * (1 - np.cos(1.2))
    for _ in range(steps):
        pendulum.advance(1)
        assert abs(np.linalg.norm(pendulum.x[0]) - L) < 1e-14
        # the point at rest is the origin
        assert np.max(np.abs(pendulum.v[0] + np.cross(pendulum.w[0], -pendulum.x[0]))) < 1e-13
    assert abs(sum(pendulum.energy()) - start) < 2e-3 * size


def test_forces_of_a_joint_are_those_of_statics_and_of_a_steady_circle() -> None:
    at_rest = hung(0.0, False)
    (report,) = at_rest.advance(1)
    assert report.reactions / 1e-3 == pytest.approx([0, 0, G], abs=1e-12)
    assert np.max(np.abs(at_rest.v)) < 1e-14
    x = [[L, 0.0, 0.0]]
    circle = Reference(
        scene(x, [[0.0, 3.0, 0.0]], joints=[rod(np.array(x), 0, -1, None, [0, 0, 0])], g=(0, 0, 0))
    )
    reports = circle.advance(50)
    pulls = [report.reactions[0] / 1e-3 for report in reports]
    assert pulls == pytest.approx([-9.0 / L] * 50, rel=5e-5)
    # a tenth of a turn: what numerical damping takes is of higher order than the error of the path
    assert np.linalg.norm(circle.v[0]) == pytest.approx(3.0, rel=1e-6)


def test_a_rod_drawn_in_keeps_the_angular_momentum() -> None:
    """A puck without gravity on a rod of length l(t): l^2 phi' is constant."""
    x = np.array([[L, 0.0, 0.0]])
    errors = []
    for h in (1e-2, 5e-3, 2.5e-3):
        law = polynomial(L, 0.0, -0.5)
        puck = Reference(
            scene(x, [[0, 2.0, 0]], joints=[rod(x, 0, -1, None, [0, 0, 0], law)], g=(0, 0, 0), step=h)
        )
        puck.advance(round(0.4 / h))
        length = L - 0.5 * 0.16
        assert np.linalg.norm(puck.x[0]) == pytest.approx(length, abs=1e-14)
        assert puck.x[0] @ puck.v[0] / length == pytest.approx(-0.4, abs=1e-13)
        errors.append(abs(np.cross(puck.x[0], puck.v[0])[2] - 2.0 * L))
    assert errors[-1] < 1e-4
    assert orders(errors) == pytest.approx([2, 2], abs=0.2)


@pytest.mark.parametrize(
    "steps", [(8e-3, 4e-3, 2e-3), pytest.param((8e-3, 4e-3, 2e-3, 1e-3), marks=pytest.mark.long)]
)
def test_a_double_pendulum_keeps_momenta_and_second_order(steps: tuple[float, ...]) -> None:
    """Two balls on rigid arms, free in space: momentum exact, angular momentum and end state of second order."""
    ends, angular = [], []
    for h in steps:
        x = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.9, -0.2, 0.1]])
        joints = [held(x, 0, 1, [0.3, 0.0, 0.1]), held(x, 1, 2, [0.6, -0.2, 0.0])]
        v, w = consistent(x, joints, 5)
        chain = Reference(scene(x, v, w, joints=joints, g=(0, 0, 0), step=h))
        momentum, turning = chain.v.sum(axis=0), about_origin(chain)
        chain.advance(round(0.08 / h))
        assert np.max(np.abs(chain.v.sum(axis=0) - momentum)) < 1e-13
        angular.append(float(np.linalg.norm(about_origin(chain) - turning)))
        ends.append(np.concatenate([chain.x.ravel(), 0.1 * chain.v.ravel()]))
    assert orders(angular) == pytest.approx([2] * (len(steps) - 1), abs=0.3)
    changes = [float(np.linalg.norm(a - b)) for a, b in pairwise(ends)]
    assert orders(changes) == pytest.approx([2] * (len(steps) - 2), abs=0.2)


def about_origin(run: Reference) -> Any:
    """Angular momentum of spheres of 1 kg."""
    return np.sum(np.cross(run.x, run.v) + I_SPHERE * run.w, axis=0)


def consistent(x: Any, joints: Any, seed: int) -> tuple[Any, Any]:
    """Random velocities that satisfy common points of two bodies: found one body after the other."""
    rng = np.random.default_rng(seed)
    v, w = rng.normal(size=(len(x), 3)), 2.0 * rng.normal(size=(len(x), 3))
    for joint in joints:
        a, b = joint["a"], joint["b"]
        _, _, at_a, at_b, _ = joint["rows"][0]
        v[b] = v[a] + np.cross(w[a], at_a) - np.cross(w[b], at_b)
    return v, w


def test_a_top_precesses_steadily() -> None:
    """A sphere on a point: A = I + m L^2 across, C = I along the arm; A W^2 cos(a) - C n W + m g L = 0."""
    tilt, rate = 0.7, 3.0
    across, along = I_SPHERE + L**2, I_SPHERE
    total = (across * rate**2 * np.cos(tilt) + G * L) / (along * rate)
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    spin = rate * AXES[2] + (total - rate * np.cos(tilt)) * axis
    x = np.array([L * axis])
    errors = []
    for h in (4e-4, 2e-4, 1e-4):
        top = Reference(scene(x, [np.cross(spin, x[0])], [spin], joints=[held(x, 0, -1, [0, 0, 0])], step=h))
        top.advance(round(0.02 / h))
        turned = [np.sin(tilt) * np.cos(0.02 * rate), np.sin(tilt) * np.sin(0.02 * rate), np.cos(tilt)]
        errors.append(float(np.linalg.norm(top.x[0] / L - turned)))
    assert errors[-1] < 1e-4
    assert orders(errors) == pytest.approx([2, 2], abs=0.2)


# ---------------------------------------------------------------------------------------------- springs and loads


def scheme(run: Reference, matrix: Any, damping: Any, x: Any, v: Any, steps: int) -> tuple[Any, Any]:
    """The scheme of eqs. 6-7 written out for x'' = -matrix x - damping x': the discrete solution itself."""
    c, h = run.model.coefficients, run.model.options.step
    acc = -matrix @ x - damping @ v
    a = acc.copy()
    for _ in range(steps):
        ahead = (c.alpha_f * acc - c.alpha_m * a) / (1 - c.alpha_m)
        share = (1 - c.alpha_f) / (1 - c.alpha_m)
        x0 = x + h * v + h * h * ((0.5 - c.beta) * a + c.beta * ahead)
        v0 = v + h * ((1 - c.gamma) * a + c.gamma * ahead)
        left = np.eye(len(x)) + share * (h * h * c.beta * matrix + h * c.gamma * damping)
        acc = np.linalg.solve(left, -matrix @ x0 - damping @ v0)
        a = ahead + share * acc
        x, v = x0 + h * h * c.beta * share * acc, v0 + h * c.gamma * share * acc
    return x, v


def test_a_mass_on_spring_and_damper_is_the_discrete_and_nearly_the_exact_solution() -> None:
    k, c, h, t = 30.0, 0.8, 5e-3, 0.8
    x = np.array([[1.3, 0.0, 0.0]])
    mass = Reference(
        scene(x, g=(0, 0, 0), step=h, loads=[spring(x, 0, -1, None, [0, 0, 0], k=k, c=c, rest=1.0)])
    )
    mass.advance(round(t / h))
    found = np.array([mass.x[0, 0] - 1.0]), mass.v[0, :1]
    own = scheme(mass, np.array([[k]]), np.array([[c]]), np.array([0.3]), np.zeros(1), round(t / h))
    assert found[0] == pytest.approx(own[0], abs=1e-12)
    assert found[1] == pytest.approx(own[1], abs=1e-11)
    wd = np.sqrt(k - c * c / 4)
    exact = 0.3 * np.exp(-c * t / 2) * (np.cos(wd * t) + c / (2 * wd) * np.sin(wd * t))
    assert found[0] == pytest.approx(exact, abs=2e-4)


def test_a_chain_of_springs_swings_in_its_mode() -> None:
    """Four equal masses along x between two walls, in the second mode: w = 2 sqrt(k/m) sin(2 pi / 10)."""
    k, n = 40.0, 4
    x0 = np.arange(1.0, n + 1.0)
    shape = 0.02 * np.sin(2 * np.pi * x0 / (n + 1))
    x = np.zeros((n, 3))
    x[:, 0] = x0 + shape
    loads = [spring(x, i, i + 1, k=k, rest=1.0) for i in range(n - 1)]
    loads += [
        spring(x, 0, -1, None, [0, 0, 0], k=k, rest=1.0),
        spring(x, n - 1, -1, None, [n + 1, 0, 0], k=k, rest=1.0),
    ]
    h, steps = 5e-3, 60
    chain = Reference(scene(x, g=(0, 0, 0), loads=loads, step=h))
    chain.advance(steps)
    stiff = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    own, _ = scheme(chain, stiff, np.zeros((n, n)), shape, np.zeros(n), steps)
    assert chain.x[:, 0] - x0 == pytest.approx(own, abs=1e-12)
    omega = 2 * np.sqrt(k) * np.sin(np.pi / (n + 1))
    assert own == pytest.approx(shape * np.cos(omega * h * steps), abs=2e-4)


def test_a_spring_held_off_centre_turns_its_body() -> None:
    """A sphere on a fixed centre, a spring from its equator far out: phi'' = -k r^2 phi / I for small angles."""
    k, amplitude, errors = 5.0, 1e-3, []
    omega = np.sqrt(k * R * R / I_SPHERE)
    for h in (8e-3, 4e-3, 2e-3):
        x = np.zeros((1, 3))
        far = [R * np.cos(amplitude), 2e3, 0.0]
        point = [R * np.cos(amplitude), R * np.sin(amplitude), 0.0]
        load = spring(x, 0, -1, point, far, k=k, rest=2e3)
        ball = Reference(scene(x, g=(0, 0, 0), joints=[held(x, 0, -1, [0, 0, 0])], loads=[load], step=h))
        ball.advance(round(0.4 / h))
        psi = rotation_increment(np.array([[1.0, 0, 0, 0]]), ball.q)[0]
        errors.append(abs(psi[2] + amplitude - amplitude * np.cos(omega * 0.4)))
        assert np.max(np.abs(ball.x)) < 1e-14
    assert errors[-1] < 2e-3 * amplitude
    assert orders(errors) == pytest.approx([2, 2], abs=0.2)


def test_drag_slows_exponentially_and_a_falling_ball_to_its_limit() -> None:
    c, turn = 0.7, 2e-3
    ball = Reference(
        scene([[0, 0, 0]], [[1, 2, 0]], [[0, 0, 5]], loads=[drag(0, c, turn)], g=(0, 0, 0), step=1e-2)
    )
    ball.advance(100)
    own = scheme(ball, np.zeros((1, 1)), np.array([[c]]), np.zeros(1), np.ones(1), 100)
    assert ball.v[0] == pytest.approx(np.array([1, 2, 0]) * own[1], abs=1e-13)
    assert own[1][0] == pytest.approx(np.exp(-c), abs=5e-6)
    assert ball.w[0, 2] == pytest.approx(5 * np.exp(-turn / I_SPHERE), abs=2e-5)
    falling = Reference(scene([[0, 0, 0]], loads=[drag(0, 20.0)], step=1e-2))
    falling.advance(200)
    assert falling.v[0, 2] == pytest.approx(-G / 20.0, rel=1e-12)


def test_torque_and_force_by_time_and_a_function_of_the_user() -> None:
    """Torque k t gives w = k t^2 / 2 I; a function with the same values gives the same run to the bit."""
    k, h = 0.02, 5e-3
    laws = {"force": [polynomial(0.0, 0.0, 3.0), constant(0), constant(0)],
            "torque": [constant(0), polynomial(0.0, k), constant(0)]}  # fmt: skip
    ball = Reference(scene([[0, 0, 0]], loads=[push(0, **laws)], g=(0, 0, 0), step=h))

    def user(t: float, x: Any, v: Any, w: Any) -> Any:
        return np.array([[3.0 * t**2, 0, 0, 0, k * t, 0]])

    same = Reference(scene([[0, 0, 0]], loads=[{"kind": "callable", "function": user}], g=(0, 0, 0), step=h))
    ball.advance(100)
    same.advance(100)
    assert ball.w[0, 1] == pytest.approx(k * 0.25 / 2 / I_SPHERE, rel=1e-3)
    assert ball.v[0, 0] == pytest.approx(0.125, rel=1e-3)
    assert same.w == pytest.approx(ball.w, rel=1e-14)
    assert same.x == pytest.approx(ball.x, rel=1e-14)


def test_a_function_of_the_user_may_follow_the_motion() -> None:
    k, c = 30.0, 0.8
    x = np.array([[0.3, 0.0, 0.0]])

    def user(t: float, x: Any, v: Any, w: Any) -> Any:
        return np.concatenate([-k * x - c * v, -0.01 * w], axis=1)

    run = Reference(scene(x, g=(0, 0, 0), loads=[{"kind": "callable", "function": user}], step=5e-3))
    run.advance(40)
    own = scheme(run, np.array([[k]]), np.array([[c]]), np.array([0.3]), np.zeros(1), 40)
    assert run.x[0, 0] == pytest.approx(own[0][0], abs=1e-12)


@pytest.mark.parametrize(
    "steps", [(1.6e-2, 8e-3, 4e-3), pytest.param((1.6e-2, 8e-3, 4e-3, 2e-3), marks=pytest.mark.long)]
)
def test_second_order_with_everything_that_is_smooth(steps: tuple[float, ...]) -> None:
    """Joints, springs, drag, torque, a prescribed motion: the end state converges with h^2, constraints hold throughout."""
    x = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.1], [0.8, 0.2, 0.0], [0.4, 0.6, 0.0]])
    joints = [
        held(x, 0, -1, x[0], [AXES[0]], polynomial(0.0, 0.0, 0.8)),
        held(x, 0, -1, x[0], AXES[1:]),
        held(x, 0, 1, [0.2, 0.0, 0.0]),
        rod(x, 1, 2, [0.45, 0.0, 0.1], [0.75, 0.2, 0.0]),
        locked(2, 3, [AXES[1]]),
    ]
    loads = [
        spring(x, 2, 3, [0.8, 0.25, 0.0], None, k=25.0, c=0.3, rest=0.4),
        spring(x, 3, -1, None, [0.4, 0.6, 1.0], k=15.0, rest=0.9),
        drag(2, 0.2, 1e-3),
        push(1, torque=[constant(0), polynomial(0.0, 0.4), constant(0)]),
    ]
    ends = []
    for h in steps:
        run = Reference(scene(x, joints=joints, loads=loads, step=h))
        run.advance(round(0.096 / h))
        ends.append(
            np.concatenate([run.x.ravel(), run.q.ravel(), 0.1 * run.v.ravel(), 0.1 * R * run.w.ravel()])
        )
        assert run.x[0] == pytest.approx([0.8 * 0.096**2, 0, 0], abs=1e-14)
    changes = [float(np.linalg.norm(a - b)) for a, b in pairwise(ends)]
    assert orders(changes) == pytest.approx([2] * (len(steps) - 2), abs=0.25)


# ---------------------------------------------------------------------------------------------- prescribed motion


def test_prescribed_motions_are_followed_to_rounding() -> None:
    x = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    path = polynomial(0.0, 0.5, -1.0, 2.0)
    joints = [held(x, 0, -1, x[0], [[0.6, 0.8, 0.0]], path), held(x, 1, -1, x[1]), locked(1, -1, AXES[:2]),
              locked(1, -1, [AXES[2]], path)]  # fmt: skip
    run = Reference(
        scene(x, [[0.3, 0.4, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 0.5]], g=(0, 0, 0), joints=joints, step=1e-2)
    )
    for step in range(1, 51):
        run.advance(1)
        t = 1e-2 * step
        way, speed = 0.5 * t - t**2 + 2 * t**3, 0.5 - 2 * t + 6 * t**2
        assert run.x[0] == pytest.approx([0.6 * way, 0.8 * way, 0], abs=1e-14)
        assert run.v[0] == pytest.approx([0.6 * speed, 0.8 * speed, 0], abs=1e-13)
        assert rotation_increment(np.array([[1.0, 0, 0, 0]]), run.q[1:])[0] == pytest.approx(
            [0, 0, way], abs=1e-13
        )
        assert run.w[1] == pytest.approx([0, 0, speed], abs=1e-13)


def test_a_locked_pair_turns_as_one_body() -> None:
    """Two spheres with a common point and no relative rotation, free: a dumb-bell turns steadily about its long axis."""
    x = np.array([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0]])
    joints = [held(x, 0, 1, [0, 0, 0]), locked(0, 1)]
    spin = np.array([0.0, 0.0, 4.0])
    v = np.cross(spin, x)
    bell = Reference(scene(x, v, [spin, spin], g=(0, 0, 0), joints=joints, step=2e-3))
    bell.advance(100)
    assert bell.w == pytest.approx(np.array([spin, spin]), abs=1e-5)
    assert bell.q[0] == pytest.approx(bell.q[1], abs=1e-14)
    angle = 4.0 * 0.2
    assert bell.x[1] == pytest.approx([0.2 * np.cos(angle), 0.2 * np.sin(angle), 0], abs=1e-5)
    assert np.max(np.abs(bell.x.sum(axis=0))) < 1e-14


def test_joints_said_twice_move_as_said_once() -> None:
    x = np.array([[L, 0.0, 0.0], [L + 0.5, 0.0, 0.0]])
    once = [held(x, 0, -1, [0, 0, 0]), rod(x, 0, 1)]
    twice = [*once, held(x, 0, -1, [0, 0, 0], [[0.6, 0, 0.8]]), rod(x, 1, 0)]
    plain, redundant = (Reference(scene(x, joints=joints, step=5e-3)) for joints in (once, twice))
    plain.advance(40)
    redundant.advance(40)
    assert redundant.x == pytest.approx(plain.x, abs=1e-12)
    assert redundant.v == pytest.approx(plain.v, abs=1e-11)


def test_starts_that_violate_a_joint_are_refused() -> None:
    x = np.array([[L, 0.0, 0.0]])
    with pytest.raises(ValueError, match=r"joint 0, distance.*1\.000e-02 m"):
        Reference(scene(x, joints=[rod(x, 0, -1, None, [0, 0, 0], constant(L + 0.01))]))
    with pytest.raises(ValueError, match=r"joint 0, point.*m/s"):
        Reference(scene(x, [[0, 1, 0]], joints=[held(x, 0, -1, x[0])]))
