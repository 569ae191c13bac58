"""The oracle where joints, loads and contacts meet, against closed forms; and its judge on such steps."""

from typing import Any

import numpy as np
import pytest
from joint_scenes import AXES, G, constant, drag, held, locked, polynomial, push, rod, scene, spring
from oracle import Impulse, Reference, judge_step
from oracle.pose import rotation_increment

R = 0.1
FLOOR = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
LAWS = ["sequence", "one-shot"]


# ---------------------------------------------------------------------------------------------- impacts


def test_newtons_cradle_hangs_on_rods() -> None:
    """Touching balls on parallel rods: the first one's speed leaves with the last; the middle ones stay.

    The step is so short that the turn of the rods, which changes speeds by h^2, is below what the energy safeguard admits.
    """
    x = np.array([[0.0, 0, 0], [0.2, 0, 0], [0.4, 0, 0], [0.6, 0, 0]])
    joints = [rod(x, i, -1, None, x[i] + [0, 0, 1.0]) for i in range(4)]
    v = np.zeros((4, 3))
    v[0, 0] = 1.0
    cradle = Reference(scene(x, v, joints=joints, law={"restitution": 1.0}, g=(0, 0, 0), step=1e-5))
    (first,) = cradle.advance(1)
    assert [problem.stage for problem in first.problems] == ["1", "2", "3"]
    assert cradle.v[:, 0] == pytest.approx([0, 0, 0, 1], abs=2e-10)
    # the balls follow their circles
    assert np.max(np.abs(np.sum(cradle.v * (cradle.x - x - [0, 0, 1.0]), axis=1))) < 1e-13


@pytest.mark.parametrize("impact", LAWS)
@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
def test_a_dumb_bell_falls_on_one_end(e: float, impact: str) -> None:
    """Two balls on a rod at 30 degrees, frictionless floor: the blow turns it about its centre.

    The rod holds the centres alone, so that the balls do not turn: two masses m at distance l/2 of the middle.
    Impulse P = m (1 + e) v / (1/2 + cos^2/2), for the lower ball's share of the blow.
    """
    length, h = 1.0, 1e-6
    c, s = np.cos(np.pi / 6), 0.5
    x = np.array([[0.0, 0.0, R], [length * c, 0.0, R + length * s]])
    v = np.tile([0.0, 0.0, -2.0], (2, 1))
    law = {"restitution": e}
    bell = Reference(
        scene(x, v, joints=[rod(x, 0, 1)], planes=[FLOOR], law=law, g=(0, 0, 0), step=h, impact=impact)
    )
    (report,) = bell.advance(1)
    blow = (1 + e) * 2.0 / (0.5 + 0.5 * c * c)
    assert report.velocity_impulses[0, 2].normal == pytest.approx(blow, rel=1e-5)
    assert bell.v[0, 2] == pytest.approx(2.0 * e, abs=1e-12)
    # what the rod passes on lies along it
    assert bell.v[1] == pytest.approx(v[1] + blow * 0.5 * np.array([c * s, 0, s * s]), abs=1e-5)
    energy = 0.5 * np.sum(bell.v**2)
    lost = 0.5 * (1 - e * e) * 4.0 / (0.5 + 0.5 * c * c)
    assert energy == pytest.approx(4.0 - lost, abs=1e-5)


def test_a_moved_ball_hits_like_a_wall_that_moves() -> None:
    """Prescribed at 1 m/s into a free ball at rest, e = 0.5: the free ball leaves with 1.5 m/s, the other goes on."""
    x = np.array([[0.0, 0, 0], [0.2, 0, 0]])
    joints = [held(x, 0, -1, x[0], [AXES[0]], polynomial(0.0, 1.0)), held(x, 0, -1, x[0], AXES[1:])]
    run = Reference(scene(x, [[1.0, 0, 0], [0, 0, 0]], joints=joints, law={"restitution": 0.5}, g=(0, 0, 0)))
    (report,) = run.advance(1)
    assert run.v[0] == pytest.approx([1, 0, 0], abs=1e-14)
    assert run.v[1] == pytest.approx([1.5, 0, 0], abs=1e-13)
    assert report.scale == 1.0
    # the joint has taken the blow
    assert report.reactions[0] == pytest.approx(1.5, abs=1e-12)


def test_a_ball_on_a_joint_is_as_heavy_as_its_arm_makes_it() -> None:
    """A ball at the end of a rigid arm about a fixed point weighs (I + m l^2)/l^2 for a blow across the arm."""
    x = np.array([[0.0, 0, 0], [0.2, 0, 0]])
    joints = [held(x, 1, -1, [0.2, 0.5, 0.0])]
    run = Reference(
        scene(x, [[2.0, 0, 0], [0, 0, 0]], joints=joints, law={"restitution": 0.7}, g=(0, 0, 0), step=1e-7)
    )
    run.advance(1)
    heavy = (0.4 * R**2 + 0.25) / 0.25
    after = 2.0 * (1 + 0.7) / (1 + heavy)
    assert run.v[1] == pytest.approx([after, 0, 0], abs=1e-6)
    assert run.v[0, 0] == pytest.approx(2.0 - heavy * after, abs=1e-6)
    assert run.w[1] == pytest.approx([0, 0, after / 0.5], abs=1e-5)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_joined_balls_rest_on_the_floor_and_stay(friction: float) -> None:
    """Balls joined by a spring and a rod, with drag: at rest, weight carried, nothing moves; in one problem.

    The free motion falls by g h^2/2 and drag and spring feel it: the impulse is right to c h/m and k h^2/m.
    """
    x = np.array([[0.0, 0, R], [0.5, 0, R], [0.25, 0.6, R]])
    joints = [rod(x, 0, 1)]
    loads = [spring(x, 1, 2, k=300.0, c=1.0, rest=0.65), drag(0, 1.0, 0.1)]
    run = Reference(
        scene(x, joints=joints, loads=loads, planes=[FLOOR], law={"friction": friction, "restitution": 0.5})
    )
    for report in run.advance(10):
        for i in range(3):
            assert report.velocity_impulses[i, 3].normal == pytest.approx(G * 1e-3, rel=1e-3)
        assert [problem.stage for problem in report.problems] == ["0"]
    assert np.max(np.abs(run.v)) < 1e-13
    assert np.max(np.abs(run.x - x)) < 1e-14


def test_a_stack_pressed_by_a_spring_carries_spring_and_weight() -> None:
    x = np.array([[0.0, 0, R], [0.0, 0, 3 * R]])
    press = spring(x, 1, -1, None, [0, 0, 1.3], k=50.0, rest=2.0)
    run = Reference(scene(x, loads=[press], planes=[FLOOR], law={"friction": 0.4, "restitution": 0.3}))
    for report in run.advance(10):
        upper = (50.0 * 1.0 + G) * 1e-3
        assert report.velocity_impulses[0, 1].normal == pytest.approx(upper, rel=50e-6)
        assert report.velocity_impulses[0, 2].normal == pytest.approx(upper + G * 1e-3, rel=50e-6)
    assert np.max(np.abs(run.v)) < 1e-12


def test_a_damper_acts_in_the_step_of_the_impact() -> None:
    """A ball that hits a floor stops there; h c v of a drag is taken at the velocity after, not before the blow."""
    h, c = 1e-3, 40.0
    run = Reference(
        scene(
            [[0, 0, R]],
            [[1.0, 0, -2.0]],
            loads=[drag(0, c)],
            planes=[FLOOR],
            law={"restitution": 0.5},
            g=(0, 0, 0),
            step=h,
        )
    )
    old = run.state
    run.advance(1)
    # M W = h f_v + P with f_v = -c (v_{n+1} - v_check); the law holds exactly for v_{n+1}
    assert run.v[0, 2] == pytest.approx(1.0, abs=1e-13)
    assert run.v[0, 0] == pytest.approx(1.0 - h * c, abs=1e-3)
    assert run.state.step == old.step + 1


# ---------------------------------------------------------------------------------------------- friction laws


def test_a_law_of_friction_takes_the_slip_of_the_start_of_each_step() -> None:
    """A sliding ball that may not turn: v_{n+1} = v_n - h mu(v_n) g, step by step."""
    h, v = 2e-3, 1.5
    x = np.array([[0.0, 0, R]])
    law = {"friction_law": ("table", [[0.0, 0.5], [1.0, 0.2], [3.0, 0.1]])}
    run = Reference(scene(x, [[0.6 * v, 0.8 * v, 0]], joints=[locked(0)], planes=[FLOOR], law=law, step=h))
    for _ in range(100):
        v -= h * G * np.interp(v, [0.0, 1.0, 3.0], [0.5, 0.2, 0.1])
        run.advance(1)
        assert run.v[0] == pytest.approx([0.6 * v, 0.8 * v, 0], abs=1e-12)


def test_a_law_of_friction_counts_spin_as_slip_and_must_not_be_negative() -> None:
    """A ball that only spins slips with r w at its contact; mu(v) < 0 is refused with the place."""
    x = np.array([[0.0, 0, R]])
    law = {"friction_law": polynomial(0.1, 0.05)}
    run = Reference(scene(x, spin=[[0, 20.0, 0]], planes=[FLOOR], law=law))
    run.advance(1)
    assert run.v[0, 0] == pytest.approx(1e-3 * G * (0.1 + 0.05 * 2.0), rel=1e-12)
    bad = Reference(scene(x, [[5.0, 0, 0]], planes=[FLOOR], law={"friction_law": polynomial(0.1, -0.05)}))
    with pytest.raises(
        ValueError, match=r"pair \(0, 1\): the friction law gives -0\.15 at a slip speed of 5"
    ):
        bad.advance(1)


def test_an_equal_constant_law_of_friction_changes_nothing() -> None:
    x = np.array([[0.0, 0, R], [0.15, 0.1, 2.2 * R]])
    v = [[1.0, 0.4, 0], [-0.5, 0, -1.0]]
    known = {"restitution": 0.4, "tangential_restitution": 0.2}
    plain, law = (
        Reference(scene(x, v, planes=[FLOOR], law=known | own))
        for own in ({"friction": 0.3}, {"friction_law": constant(0.3)})
    )
    plain.advance(60)
    law.advance(60)
    assert np.array_equal(plain.x, law.x)
    assert np.array_equal(plain.w, law.w)


# ---------------------------------------------------------------------------------------------- the paper's first example


def test_a_driven_sphere_turns_another_by_friction() -> None:
    """Section 5.1 (eq. 46 as corrected): B, its centre held, driven by k t; A above it, free along z. Stick until t_lim."""
    k, mu, inertia, t_lim = 20.0, 0.3, 0.4, 2 * G * 0.3 / 20.0
    x = np.array([[0.0, 0, 2.0], [0, 0, 0]])
    joints = [held(x, 0, -1, x[0], AXES[:2]), held(x, 1, -1, x[1])]
    torque = push(1, torque=[constant(0), polynomial(0.0, -k), constant(0)])
    h = t_lim / 50
    run = Reference(scene(x, radius=1.0, joints=joints, loads=[torque], law={"friction": mu}, step=h))
    for report in run.advance(50):
        assert report.velocity_impulses[0, 1].normal == pytest.approx(G * h, rel=1e-10)
    assert run.w[0, 1] == pytest.approx(k * t_lim**2 / (4 * inertia), rel=1e-3)
    assert run.w[1, 1] == pytest.approx(-run.w[0, 1], abs=1e-12)
    run.advance(50)
    t = 2 * t_lim
    assert run.w[0, 1] == pytest.approx(k * t_lim / (2 * inertia) * (t - t_lim / 2), rel=2e-2)
    driven = -k / (4 * inertia) * (t_lim**2 + 2 * t * (t - t_lim))
    assert run.w[1, 1] == pytest.approx(driven, rel=2e-2)
    assert np.max(np.abs(run.x - x)) < 1e-12


# ---------------------------------------------------------------------------------------------- the judge


def crowd(impact: str) -> Reference:
    """Balls on rods, springs and a driven arm that fall on the floor and on each other."""
    x = np.array([[0.0, 0, 0.15], [0.3, 0.05, 0.3], [0.05, 0.1, 0.45], [0.4, 0.0, 0.13]])
    joints = [
        rod(x, 0, 1),
        held(x, 1, 3, [0.35, 0.0, 0.2]),
        locked(2, -1, [AXES[2]], polynomial(0.0, 2.0, 1.0)),
    ]
    loads = [spring(x, 2, 0, [0.05, 0.1, 0.4], k=60.0, c=0.2, rest=0.25), drag(3, 0.1, 1e-3)]
    law = {"friction": 0.3, "restitution": 0.6, "tangential_restitution": 0.1, "rolling_radius": 1e-3}
    v = np.tile([0.1, 0.0, -1.0], (4, 1))
    spin = np.array([[0, 0, 0], [0, 0, 0], [1, 0, 2.0], [0, 0, 0]])
    return Reference(
        scene(x, v, spin, joints=joints, loads=loads, planes=[FLOOR], law=law, step=4e-3, impact=impact)
    )


@pytest.mark.parametrize(("steps", "least"), [(15, 1), pytest.param(30, 3, marks=pytest.mark.long)])
@pytest.mark.parametrize("impact", ["sequence", "one-shot", "sequence-paper"])
def test_the_judge_accepts_the_own_steps_and_notices_wrong_ones(impact: str, steps: int, least: int) -> None:
    run = crowd(impact)
    hits = 0
    for _ in range(steps):
        old = run.state
        (report,) = run.advance(1)
        new, psi = run.state, rotation_increment(old.q, run.state.q)
        given = [(problem.stage, problem.impulses) for problem in report.problems]
        scales = [problem.scale for problem in report.problems]

        def judged(x: Any = new.x, u: Any = new.u, psi: Any = psi, problems: Any = given) -> Any:
            return judge_step(run.model, old, x, u, psi, report.position_impulses, problems, scales)  # noqa: B023

        assert judged().worst < 1e-11, judged()
        if not given:
            continue
        hits += 1
        assert judged(u=new.u + 1e-6).joints > 1e-8
        assert judged(u=new.u + 1e-6).worst > 1e-7
        assert judged(x=new.x + 1e-6 * AXES[2]).position.worst > 1e-7
        stretched = new.x.copy()
        stretched[1] += 1e-6 * (new.x[1] - new.x[0]) / np.linalg.norm(new.x[1] - new.x[0])
        assert judged(x=stretched).position.joints > 9e-7
        turned = psi.copy()
        turned[2, 2] += 1e-6
        assert judged(psi=turned).position.joints == pytest.approx(R * 1e-6, rel=1e-3)
        key, impulse = max(given[-1][1].items(), key=lambda entry: entry[1].normal)
        more = Impulse(impulse.normal + 1e-6, impulse.friction, impulse.moment)
        wrong = [*given[:-1], (given[-1][0], given[-1][1] | {key: more})]
        assert judged(problems=wrong).worst > 1e-7
    assert hits > least


def test_islands_without_contacts_keep_their_joints() -> None:
    """Far apart: a pendulum, and a ball that bounces; each as if the other were not there."""
    x = np.array([[0.5, 0, 5.0], [10.0, 0, 0.15]])
    pendulum = held(x, 0, -1, [0, 0, 5.0])
    law = {"restitution": 0.8, "friction": 0.2}
    v = [[0, 0, 0], [1.0, 0, -1.0]]
    both = Reference(scene(x, v, joints=[pendulum], planes=[FLOOR], law=law))
    bouncing = Reference(scene(x[1:], v[1:], planes=[FLOOR], law=law))
    hung = Reference(scene(x[:1], v[:1], joints=[pendulum]))
    for run in (both, bouncing, hung):
        run.advance(80)
    assert both.v[1, 2] > 0
    assert both.x[1] == pytest.approx(bouncing.x[0], abs=1e-13)
    assert both.w[1] == pytest.approx(bouncing.w[0], abs=1e-12)
    assert both.x[0] == pytest.approx(hung.x[0], abs=1e-13)
    assert both.v[0] == pytest.approx(hung.v[0], abs=1e-12)
