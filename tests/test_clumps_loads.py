"""Clumps with loads, springs, drag and joints: closed forms, and single balls, which a clump of one ball moves like."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import carom
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipk

F64 = NDArray[np.float64]
R, M, G = 0.01, 0.03, 9.8
BAR = [[0.02 * k, 0, 0, 0.01] for k in (-2, -1, 0, 1, 2)]
"""Five balls in a row."""
J = [2e-6, 3.2e-5, 3.2e-5]
"""Moments of inertia of the bar, kg m^2."""


def scene(gravity: float = 0.0, **law: float) -> carom.Scene:
    made = carom.Scene(gravity=(0, 0, -gravity))
    for other in ("steel", "floor"):
        made.contact("steel", other, **{"friction": 0.3, "restitution": 0.5, **law})
    return made


def bar(made: carom.Scene, **keys: Any) -> None:
    given = {"spheres": BAR, "mass": M, "inertia": J, "position": (0, 0, 0), "material": "steel"}
    made.clump("bar", **{**given, **keys})


# ------------------------------------------------------------------------------- a clump of one ball, and a ball


# In a plane, in which turns add up as they do of balls: those of a clump are composed.


def with_load(made: carom.Scene, name: str) -> None:
    made.load(
        name,
        force=(0.01, 0.0, {"expression": "0.02*sin(90*t)"}),
        torque=(0, {"expression": "4e-5*cos(70*t)"}, 0),
    )


def with_spring(made: carom.Scene, name: str) -> None:
    points = [(0.004, 0.0, 0.043), (0.1, 0.0, 0.1)]
    made.spring(name, "ground", points=points, stiffness=30.0, damping=0.02, rest_length=0.08)


def with_drag(made: carom.Scene, name: str) -> None:
    made.drag(name, translation=0.1, rotation=2e-6)


def with_function(made: carom.Scene, name: str) -> None:
    def pull(t: float, x: F64, v: F64, w: F64) -> F64:
        return np.hstack([-0.5 * x - 0.01 * v, -1e-6 * w + [0, 1e-5 * t, 0]])

    made.load_function(pull)


def with_fix(made: carom.Scene, name: str) -> None:
    made.joint("fix", body=name, point=(0.03, 0, 0.05))


def with_rod(made: carom.Scene, name: str) -> None:
    made.joint("rod", between=(name, "ground"), points=[(0.005, 0, 0.045), (0.05, 0, 0.08)])


def with_lock(made: carom.Scene, name: str) -> None:
    made.joint("lock", body=name, axes=[(1, 0, 0), (0, 0, 1)])
    made.joint("plane", body=name, normal=(0, 1, 0))


ALL = [with_load, with_spring, with_drag, with_function, with_fix, with_rod, with_lock]


@pytest.mark.parametrize("given", ALL, ids=lambda f: f.__name__)
@pytest.mark.parametrize("floor", [False, True], ids=["free", "floor"])
def test_a_clump_of_one_ball_does_what_a_ball_does(given: Callable[..., None], floor: bool) -> None:
    moves = {"position": (0, 0, 0.04)}
    if given not in (with_fix, with_rod, with_lock):
        moves |= {"velocity": (0.2, 0, -0.1), "angular_velocity": (0, -20, 0)}
    results = []
    for clump in (False, True):
        made = scene(G, tangential_restitution=0.4)
        if floor:
            made.plane("floor", point=(0, 0, 0.02), normal=(0.1, 0, 1), material="floor")
        if clump:
            made.clump(
                "b", spheres=[[0, 0, 0, R]], mass=M, inertia=[0.4 * M * R * R] * 3, material="steel", **moves
            )
        else:
            made.sphere("b", radius=R, mass=M, material="steel", **moves)
        given(made, "b1" if clump else "b")
        results.append(carom.simulate(made, step=1e-3, until=0.3, every=1))
    one, other = results
    for name in ("position", "velocity", "angular_velocity"):
        a, b = (np.asarray(getattr(result, name)) for result in results)
        assert np.abs(a - b).max() <= 1e-11 * np.abs(a).max(), name
    assert np.abs(np.asarray(one.joint_impulse) - np.asarray(other.joint_impulse)).max(initial=0.0) <= 1e-12
    assert np.asarray(other.steps["energy_work"]) == pytest.approx(
        np.asarray(one.steps["energy_work"]), abs=1e-13
    )


# --------------------------------------------------------------------------------------------------- closed forms


def orders(error: Callable[[float], float], steps: tuple[float, ...]) -> list[float]:
    """Of the errors at these steps, each half of the one before."""
    found = [error(step) for step in steps]
    return [float(np.log2(a / b)) for a, b in pairwise(found)]


def test_drag_on_a_bar_slows_it_down_by_exponentials() -> None:
    """Translation by `n c/M`, turning by `(c sum(l^2) + n c_r)/J`, both exact; order two in the step."""
    c, c_r = 0.05, 3e-6
    rate = 5 * c / M, (c * sum(x**2 for x, *_ in BAR) + 5 * c_r) / J[2]

    def error(step: float) -> float:
        made = scene()
        bar(made, velocity=(0.3, -0.2, 0.1), angular_velocity=(0, 0, 8))
        made.drag("all", translation=c, rotation=c_r)
        clump = carom.simulate(made, step=step, until=0.2).clumps["bar"]
        v = np.array([0.3, -0.2, 0.1]) * np.exp(-rate[0] * 0.2)
        w = 8 * np.exp(-rate[1] * 0.2)
        assert np.abs(clump.angular_velocity[-1][:2]).max() < 1e-12
        return float(np.abs(clump.velocity[-1] - v).max() / 0.3 + abs(clump.angular_velocity[-1][2] - w) / 8)

    assert min(orders(error, (4e-3, 2e-3, 1e-3))) > 1.9
    assert error(1e-3) < 1e-5


def test_a_force_off_the_centre_moves_and_turns() -> None:
    """A force along y on the last ball, while the bar hardly turns: `a = F/M`, `alpha = F d/J`."""
    force, until = 1e-4, 0.05
    made = scene()
    bar(made)
    made.load("bar5", force=(0, force, 0))
    clump = carom.simulate(made, step=1e-3, until=until).clumps["bar"]
    alpha = force * 0.04 / J[2]
    assert clump.velocity[-1] == pytest.approx([0, force / M * until, 0], abs=1e-14)
    assert clump.position[-1] == pytest.approx([0, 0.5 * force / M * until**2, 0], abs=1e-16)
    assert clump.angular_velocity[-1] == pytest.approx([0, 0, alpha * until], rel=1e-7, abs=1e-16)


def test_a_torque_turns_by_the_inertia_whichever_ball_has_it() -> None:
    turned = []
    for ball in ("bar1", "bar3"):
        made = scene()
        bar(made)
        made.load(ball, torque=(0, 1e-4, 0))
        clump = carom.simulate(made, step=1e-3, until=0.1).clumps["bar"]
        assert np.abs(clump.velocity).max() == 0.0
        assert clump.angular_velocity[-1] == pytest.approx([0, 1e-4 * 0.1 / J[1], 0], rel=1e-12)
        turned.append(clump.orientation[-1])
    assert turned[0] == pytest.approx(turned[1], abs=1e-15)


def test_a_bar_between_two_springs_has_the_period_of_its_inertia() -> None:
    """Springs along y at both ends, to points far away: `w = sqrt(2 k d^2/J)` of turning, `sqrt(2 k/M)` of the way."""
    k, d, far = 20.0, 0.04, 1e4
    turning = np.sqrt(2 * k * d**2 / J[2])

    def error(step: float) -> float:
        made = scene()
        bar(made, angular_velocity=(0, 0, 1e-3 * turning))
        for ball, x in (("bar1", -d), ("bar5", d)):
            made.spring(ball, "ground", points=[(x, 0, 0), (x, far, 0)], stiffness=k)
        result = carom.simulate(made, step=step, until=0.1, every=1)
        angle = 2 * np.asarray(result.clumps["bar"].orientation)[:, 3]
        return float(np.abs(angle - 1e-3 * np.sin(turning * result.time)).max()) / 1e-3

    assert min(orders(error, (2e-3, 1e-3, 5e-4))) > 1.9
    assert error(5e-4) < 5e-3


def test_a_rod_that_hangs_by_its_end_has_the_period_of_a_physical_pendulum() -> None:
    """Let go from 60 degrees: a quarter of the period is `K(sin(a/2)) sqrt(J_P/(M g d))`. Order two."""
    d, start = 0.04, np.radians(60.0)
    about = J[2] + M * d * d
    quarter = float(ellipk(np.sin(start / 2) ** 2)) * np.sqrt(about / (M * G * d))
    fastest = np.sqrt(2 * M * G * d * (1 - np.cos(start)) / about)

    def error(step: float) -> float:
        steps = round(quarter / step)
        made = scene(G)
        half = 0.25 * np.pi - 0.5 * start  # the bar from x to straight down, less the angle
        bar(made, position=(d * np.sin(start), 0, -d * np.cos(start)),
            orientation=(np.cos(half), 0, np.sin(half), 0))  # fmt: skip
        made.joint("fix", body="bar1", point=(0, 0, 0))
        result = carom.simulate(made, step=quarter / steps, until=quarter, every=1)
        clump = result.clumps["bar"]
        assert np.abs(np.linalg.norm(clump.position, axis=1) - d).max() < 1e-10
        late = float(clump.position[-1][0]) / d  # 0 at the lowest place
        return abs(late) + abs(float(np.linalg.norm(clump.angular_velocity[-1])) / fastest - 1)

    assert min(orders(error, (4e-3, 2e-3, 1e-3))) > 1.8
    assert error(1e-3) < 1e-4


def test_the_reaction_of_a_pendulum_at_rest_is_its_weight() -> None:
    made = scene(G)
    bar(made, orientation=(np.sqrt(0.5), 0, np.sqrt(0.5), 0))
    made.joint("fix", body="bar1")
    result = carom.simulate(made, step=1e-3, until=0.05, every=1)
    reaction = np.asarray(result.joint_impulse)[1:, 0]
    assert reaction[:, :3] == pytest.approx(np.tile([0, 0, M * G * 1e-3], (50, 1)), abs=1e-12)
    assert np.abs(reaction[:, 3:]).max() < 1e-14


def test_a_free_axis_of_three_moments_under_a_torque_follows_eulers_equations() -> None:
    """A body with three moments, turned by a torque fixed in space and by drag: against an integrator of high order."""
    inertia, torque, c_r = np.array([1e-6, 2e-6, 2.6e-6]), np.array([1e-6, 2e-6, -3e-6]), 2e-6
    w0 = np.array([0.3, 9.0, 0.2])

    def rates(_: float, y: F64) -> F64:
        q, w = y[:4] / np.linalg.norm(y[:4]), y[4:]
        turned = matrix(q)
        momentum = turned @ (inertia * (turned.T @ w))
        spin = np.array([-q[1:] @ w, *(q[0] * w + np.cross(w, q[1:]))])
        change = turned @ ((turned.T @ (torque - c_r * w - np.cross(w, momentum))) / inertia)
        return np.concatenate([0.5 * spin, change])

    exact = solve_ivp(rates, (0, 0.5), [1, 0, 0, 0, *w0], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]

    def error(step: float) -> float:
        made = scene()
        bar(made, inertia=inertia.tolist(), angular_velocity=w0.tolist())
        made.load("bar3", torque=torque.tolist())
        made.drag("bar3", rotation=c_r)
        clump = carom.simulate(made, step=step, until=0.5).clumps["bar"]
        off = np.abs(matrix(clump.orientation[-1]) - matrix(exact[:4])).max()
        return float(off + np.abs(clump.angular_velocity[-1] - exact[4:]).max() / 9.0)

    assert min(orders(error, (4e-3, 2e-3, 1e-3))) > 1.8
    assert error(1e-3) < 1e-3


def matrix(q: F64) -> F64:
    """Of a unit quaternion, w first."""
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_a_function_gives_what_the_same_load_gives() -> None:
    results = []
    for function in (False, True):
        made = scene(G)
        bar(made, velocity=(0.1, 0, 0), angular_velocity=(1, 2, 3))
        made.plane("floor", point=(0, 0, -0.03), normal=(0, 0, 1), material="floor")

        def push(t: float, x: F64, v: F64, w: F64) -> F64:
            found = np.zeros((5, 6))
            found[4] = [0, 0.02 * np.sin(50 * t), 0.01, 1e-5, 0, 2e-5 * np.cos(40 * t)]
            return found

        if function:
            made.load_function(push)
        else:
            made.load("bar5", force=(0, {"expression": "0.02*sin(50*t)"}, 0.01),
                      torque=(1e-5, 0, {"expression": "2e-5*cos(40*t)"}))  # fmt: skip
        results.append(carom.simulate(made, step=1e-3, until=0.2, every=1))
    for name in ("position", "velocity", "angular_velocity"):
        a, b = (np.asarray(getattr(result, name)) for result in results)
        assert np.abs(a - b).max() <= 1e-11 * np.abs(a).max()


def test_a_function_gets_the_motion_of_balls() -> None:
    seen: list[tuple[float, F64, F64, F64]] = []

    def look(t: float, x: F64, v: F64, w: F64) -> F64:
        seen.append((t, x.copy(), v.copy(), w.copy()))
        return np.zeros((5, 6))

    made = scene()
    bar(made, velocity=(0.1, 0, 0), angular_velocity=(0, 0, 10))
    made.load_function(look)
    carom.simulate(made, step=1e-3, until=0.02)
    for t, x, v, w in seen:
        turned = np.array([np.cos(10 * t), np.sin(10 * t), 0])
        across = np.array([-turned[1], turned[0], 0])
        lever = np.array([at for at, *_ in BAR])[:, None]
        assert x == pytest.approx([0.1 * t, 0, 0] + lever * turned, abs=1e-9)
        assert v == pytest.approx([0.1, 0, 0] + 10 * lever * across, abs=1e-8)
        assert w == pytest.approx(np.tile([0, 0, 10], (5, 1)), abs=1e-9)


def test_joined_bars_keep_momentum_and_energy() -> None:
    """Two bars joined end to end turn freely: momentum is exact, energy of second order in the step."""

    def error(step: float) -> float:
        made = scene()
        bar(made, angular_velocity=(0, 0, 6), velocity=(0, 0, 0))
        made.clump("other", spheres=BAR, mass=2 * M, inertia=J, position=(0.1, 0, 0), material="steel",
                   angular_velocity=(0, 0, -3), velocity=(0, 6 * 0.05 + 3 * -0.05 + 0.3, 0))  # fmt: skip
        other = made.clumps[1]
        other.velocity = (0, 6 * 0.05 - (-3) * (-0.05), 0)
        made.joint("ball", between=("bar5", "other1"), point=(0.05, 0, 0))
        result = carom.simulate(made, step=step, until=0.5, every=1)
        momentum = np.asarray(result.momentum)
        assert np.abs(momentum - momentum[0]).max() < 1e-12 * M
        spin = np.asarray(result.angular_momentum)
        assert np.abs(spin - spin[0]).max() < 1e-3 * np.abs(spin[0]).max()
        energy = np.asarray(result.steps["energy_kinetic"])
        return float(np.abs(energy - energy[0]).max() / energy[0])

    assert min(orders(error, (2e-3, 1e-3, 5e-4))) > 1.7
    assert error(5e-4) < 1e-3


@pytest.mark.parametrize("held", [True, False])
def test_an_outlet_takes_no_clump_that_a_load_holds(held: bool) -> None:
    made = scene(G)
    bar(made)
    if held:
        made.load("bar4", force=(0, 0, 1e-3))
    made.drag("bar2", translation=1e-3)  # which holds nothing
    made.outlet(low=(-1, -1, -9), high=(1, 1, -0.01))
    result = carom.simulate(made, step=1e-3, until=0.1)
    assert bool(result.clumps["bar"].present[-1]) == held


def test_two_balls_that_a_rod_holds_do_not_meet_others_do() -> None:
    """Two bars side by side, joined at balls in the middle, at a distance below their diameters: nothing meets there."""
    made = scene()
    bar(made)
    bar_2 = {"spheres": BAR, "mass": M, "inertia": J, "position": (0, 0.0201, 0), "material": "steel"}
    made.clump("other", angular_velocity=(0, 0, 3), **bar_2)
    made.joint("rod", between=("bar3", "other3"), length={"expression": "0.0201"})
    result = carom.simulate(made, step=5e-4, until=0.05, every=1, contacts=True)
    pairs = {tuple(sorted(pair)) for pair in np.asarray(result.contacts["body"]).tolist()}
    assert pairs
    assert (2, 7) not in pairs
