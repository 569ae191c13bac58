"""Moreau-Jean time stepping: what it does, its order, and what it lacks, by numbers."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromWarning, Result, Scene
from carom.many.order import error_of, order_of

SCENARIOS = Path(__file__).parent.parent / "scenarios"
GRAVITY, RADIUS, MASS = 9.8, 0.02, 0.1


def ball_above(height: float, *, restitution: float = 0.5, velocity: float = 0.0) -> Scene:
    """One ball whose lowest point is `height` (m) above a plane, thrown upwards with `velocity` (m/s)."""
    scene = Scene("bouncing ball", gravity=(0, 0, -GRAVITY))
    scene.contact("ball", "floor", friction=0.2, restitution=restitution)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    place = (0, 0, RADIUS + height)
    scene.sphere("ball", radius=RADIUS, mass=MASS, material="ball", position=place, velocity=(0, 0, velocity))
    return scene


def run(scene: Scene | Path, **options: Any) -> Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)
        return carom.simulate(scene, **{"method": "moreau", "every": 1, **options})


@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
def test_free_flight_is_the_theta_rule(theta: float) -> None:
    h, v0 = 1e-2, 3.0
    result = run(ball_above(1.0, velocity=v0), until=0.5, step=h, theta=theta)
    t = np.asarray(result.time)
    exact = RADIUS + 1.0 + v0 * t - GRAVITY * t**2 / 2
    late = -h * (theta - 0.5) * GRAVITY * t  # what the weights off the middle add: of first order in h
    np.testing.assert_allclose(result["ball"].velocity[:, 2], v0 - GRAVITY * t, atol=1e-13)
    np.testing.assert_allclose(result["ball"].position[:, 2], exact + late, atol=1e-13)


def test_a_bounce_by_the_predicted_gap() -> None:
    """The step of the impact is the first whose predicted midpoint lies in the floor; v_{n+1} = -e v_n there."""
    h, height, e = 1e-3, 0.1, 0.5
    result = run(ball_above(height, restitution=e), until=0.2, step=h)
    n = 0
    z, v = height, 0.0
    while z + h / 2 * v > 0:
        z, v, n = z + h * (v - h * GRAVITY / 2), v - h * GRAVITY, n + 1
    velocity = result["ball"].velocity[:, 2]
    assert velocity[n] == pytest.approx(v, rel=1e-12)
    assert velocity[n + 1] == pytest.approx(-e * v, rel=1e-12)
    after = z + h / 2 * (v - e * v)
    assert result["ball"].position[n + 1, 2] - RADIUS == pytest.approx(after, abs=1e-12)
    [step] = np.unique(result.impacts["step"])
    assert step == n + 1


def bounce_error(h: float, at: float, **options: Any) -> float:
    """Eq. 45 of height and velocity at `at` s after one bounce with e = 0.5, against the exact parabola."""
    height, e = 0.1, 0.5
    fall = math.sqrt(2 * height / GRAVITY)
    up = e * GRAVITY * fall
    result = run(ball_above(height, restitution=e), until=at, step=h, **options)
    last = float(result.time[-1]) - fall
    exact = [up * last - GRAVITY * last**2 / 2, up - GRAVITY * last]
    found = [float(result["ball"].position[-1, 2]) - RADIUS, float(result["ball"].velocity[-1, 2])]
    return error_of([found], [exact])


@pytest.mark.parametrize("options", [{}, {"theta": 1.0}, {"position_projection": True}])
def test_order_one_through_an_impact(options: dict[str, Any]) -> None:
    """Steps that have the impact at the same place of their step: the error is then a smooth function of h."""
    fall = math.sqrt(2 * 0.1 / GRAVITY)
    steps = [fall / (n + 0.3) for n in (100, 200, 400, 800)]
    errors = [bounce_error(h, at=0.2, **options) for h in steps]
    order = order_of(steps, errors)
    assert 0.9 < order.value < 1.1, order


def test_three_balls_hand_on_the_velocity() -> None:
    result = run(SCENARIOS / "three_balls.toml")
    np.testing.assert_allclose(result.velocity[-1][:, 0], [0, 0, 2], atol=1e-14)
    assert result.summary["energy"]["max_rise"] <= 1e-15
    one_shot = run(SCENARIOS / "three_balls.toml", impact="one-shot")
    np.testing.assert_allclose(one_shot.velocity[-1][:, 0], [-2 / 3, 4 / 3, 4 / 3], atol=1e-12)


@pytest.mark.parametrize("impact", ["sequence", "one-shot"])
def test_a_column_stays_at_rest(impact: str) -> None:
    result = run(SCENARIOS / "column.toml", impact=impact)
    moved = np.asarray(result.position[-1]) - np.asarray(result.position[0])
    assert np.max(np.abs(moved)) < 1e-12
    assert np.max(np.abs(np.asarray(result.velocity[-1]))) < 1e-12
    assert result.summary["unconverged"] == 0


def test_penetration_stays_and_is_reported() -> None:
    """An inelastic impact found in the middle of a step leaves the ball in the floor, for good."""
    h, height = 1e-3, 0.1
    scene = ball_above(height, restitution=0.0)
    result = run(scene, until=0.3, step=h)
    depth = RADIUS - float(result["ball"].position[-1, 2])
    speed = math.sqrt(2 * GRAVITY * height)
    assert 0 < depth < h * speed
    assert result.summary["penetration_max"] == pytest.approx(depth, rel=1e-9)
    assert float(result.steps["penetration"][-1]) == pytest.approx(depth, rel=1e-9)
    assert np.all(np.asarray(result["ball"].velocity[-50:]) == 0)

    projected = run(scene, until=0.3, step=h, position_projection=True)
    assert projected.summary["penetration_max"] < 1e-12
    assert float(projected["ball"].position[-1, 2]) == pytest.approx(RADIUS, abs=1e-14)
    assert projected.summary["iterations"]["position"]["max"] >= 1
    assert result.summary["iterations"]["position"]["max"] == 0


def test_penetration_of_pairs_that_are_no_contact_is_seen() -> None:
    """Two balls whose midpoints stay apart overlap at the end of the step: nothing acts on them yet."""
    scene = Scene("approach", gravity=(0, 0, 0))
    scene.contact("a", "a", friction=0.0, restitution=0.0)
    scene.sphere("left", radius=0.1, mass=1.0, material="a", position=(0, 0, 0))
    scene.sphere("right", radius=0.1, mass=1.0, material="a", position=(0.207, 0, 0), velocity=(-1, 0, 0))
    result = run(scene, until=0.01, step=0.01)
    assert len(result.impacts) == 0
    assert result.summary["penetration_max"] == pytest.approx(0.003, rel=1e-12)
    projected = run(scene, until=0.01, step=0.01, position_projection=True)
    assert projected.summary["penetration_max"] < 1e-12
    apart = np.asarray(projected.position[-1])
    # By mass: both balls give way by half; their velocities stay.
    np.testing.assert_allclose(apart[:, 0], [-0.0015, 0.1985], atol=1e-12)
    np.testing.assert_array_equal(projected.velocity[-1], result.velocity[-1])


def test_projection_pushes_balls_that_others_push() -> None:
    """A row of balls at rest, the first of which overlaps: the projection reaches those beyond the candidates."""
    scene = Scene("row", gravity=(0, 0, 0))
    scene.contact("a", "a", friction=0.3, restitution=0.0)
    r, gap = 0.1, 0.002
    for i in range(4):
        x = i * (2 * r + gap)
        speed = -3.0 if i == 3 else 0.0
        scene.sphere(f"b{i}", radius=r, mass=1.0, material="a", position=(x, 0, 0), velocity=(speed, 0, 0))
    result = run(scene, until=0.02, step=0.02, position_projection=True)
    x = np.asarray(result.position[-1])[:, 0]
    assert np.all(np.diff(x) >= 2 * r * (1 - 1e-10))
    assert result.summary["penetration_max"] < 1e-10 * r
    free = np.arange(4) * (2 * r + gap) + np.array([0, 0, 0, -3.0 * 0.02])
    assert np.mean(x) == pytest.approx(np.mean(free), abs=1e-14)  # the centre of mass is not moved


@pytest.mark.parametrize("h", [1e-3, 2e-4])
def test_a_heap_at_rest_stays_with_projection(h: float) -> None:
    """It has no overlaps to be known by: what the loads close in a step is held, and friction with it."""

    def heap() -> Scene:
        scene = Scene("heap", gravity=(0, 0, -GRAVITY), run={"pile_tolerance": 1e-4})
        scene.contact("g", "g", friction=0.6, restitution=0.0, rolling_radius=6e-4)
        scene.plane("floor", material="g", point=(0, 0, 0), normal=(0, 0, 1))
        return scene

    poured = heap()
    region = {"region": "sphere", "point": (0, 0, 0.014), "region_radius": 0.0135}
    poured.packing("p", material="g", density=2500, seed=1, count=40, sizes="equal", diameter=0.006, **region)
    settled = run(poured, until=0.5, step=1e-3, method="nsga")
    rests = heap()
    rests.spheres_from(settled)
    result = run(rests, until=0.1, step=h, position_projection=True)
    height = np.asarray(result.position)[:, :, 2].mean(axis=1)
    assert height[0] - height[-1] < 1e-4 * height[0]
    assert carom.audit.check(result).ok


def test_the_break_is_close_to_nsga() -> None:
    """After the impact both schemes tend to the same velocities; they differ by the delay, of first order in h."""
    h = 1e-4
    scene = SCENARIOS / "paper" / "5.6_break.toml"
    ours = run(scene, until=0.13, step=h)
    theirs = run(scene, until=0.13, step=h, method="nsga")
    assert error_of(ours.velocity[-1], theirs.velocity[-1]) < 0.02
    assert ours["ball2"].velocity[-1, 0] == pytest.approx(theirs["ball2"].velocity[-1, 0], abs=0.02)
    mirrored = np.asarray(ours["ball4"].velocity[-1]) * [1, -1, 1]
    np.testing.assert_allclose(ours["ball5"].velocity[-1], mirrored, atol=1e-9)
    assert ours.summary["energy"]["max_rise"] <= 1e-12 * ours.summary["energy"]["initial"]
    assert ours.summary["unconverged"] == 0
    assert float(ours.time[1100]) == pytest.approx(0.11)  # before the impact
    np.testing.assert_allclose(ours["ball2"].velocity[1100], theirs["ball2"].velocity[1100], atol=1e-10)


def overlap_over_the_hill(h: float, *, projected: bool) -> float:
    """A ball that rolls down over a far heavier one: deepest overlap in 0.5 s, m."""
    scene = Scene("over the hill", gravity=(0, 0, -GRAVITY))
    scene.contact("a", "a", friction=0.5, restitution=0.0)
    scene.contact("a", "floor", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.sphere("hill", radius=1.0, mass=1e6, material="a", position=(0, 0, 1))
    tilt = 0.1
    top = (1.1 * math.sin(tilt), 0, 1 + 1.1 * math.cos(tilt))
    scene.sphere("ball", radius=0.1, mass=0.1, material="a", position=top)
    result = run(scene, until=0.5, step=h, position_projection=projected)
    apart = np.asarray(result["ball"].position) - np.asarray(result["hill"].position)
    gap = np.linalg.norm(apart, axis=1) - 1.1
    return -float(np.min(gap))


def test_a_curved_contact_overlaps_by_h_squared_without_projection() -> None:
    """The tangent leaves the sphere; the ball falls back upon it and is found inside."""
    coarse, fine = (overlap_over_the_hill(h, projected=False) for h in (1e-3, 5e-4))
    assert coarse > 1e-6
    assert coarse / fine == pytest.approx(4, rel=0.05)
    assert overlap_over_the_hill(1e-3, projected=True) < 1e-10 * 0.1


@pytest.mark.parametrize("impact", ["sequence", "one-shot", "compliant"])
def test_what_slides_over_a_ball_keeps_its_contact(impact: str) -> None:
    """Three balls with friction 1 % below what holds them: opening by the square of their way they stay loaded."""
    half = math.radians(40)
    least = math.tan(half / 2)
    scene = Scene(gravity=(0, 0, -9.8))
    scene.contact("b", "b", friction=1.2 * least, restitution=0)
    scene.contact("b", "f", friction=0.99 * least / 3, restitution=0)
    scene.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="f")
    r, q = 0.02, 0.04 * math.sin(half)
    for name, at in (("l", (-q, 0, r)), ("r", (q, 0, r)), ("t", (0, 0, r + 2 * r * math.cos(half)))):
        scene.sphere(name, radius=r, mass=0.1, material="b", position=at)
    exact = carom.simulate(scene, step=2.5e-4, until=0.2).position
    for h in (2e-3, 5e-4):
        run = carom.simulate(scene, step=h, until=0.2, method="moreau", impact=impact)
        way = run.position[-1] - run.position[0]
        assert way == pytest.approx(exact[-1] - exact[0], abs=1e-3 * abs(exact[-1] - exact[0]).max())
        assert len(run.impacts) == 0
        assert run.summary["energy"]["max_rise"] == 0.0


@pytest.mark.parametrize("force", [0.0, 2.0, 20.0])
def test_what_is_pushed_along_a_floor_does_not_hover(force: float) -> None:
    """A gap that rest leaves is that of the weight, 5 micrometres at 1 ms, whatever acts along the floor."""
    scene = Scene(gravity=(0, 0, -9.8))
    scene.contact("b", "f", friction=0.2, restitution=0.5)
    scene.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="f")
    scene.sphere("b", radius=0.01, mass=0.01, material="b", position=(0, 0, 0.02))
    scene.load("b", force=(force, 0, 0))
    run = carom.simulate(scene, step=1e-3, until=0.4, method="moreau")
    gap = run.position[-1, 0, 2] - 0.01
    assert -2e-5 < gap <= 0.5 * 9.8e-6 + 1e-9
    assert gap == pytest.approx(run.position[-20, 0, 2] - 0.01, abs=1e-9)


@pytest.mark.parametrize(("theta", "order"), [(0.5, 2.0), (1.0, 1.0)])
def test_loads_are_weighted_by_theta(theta: float, order: float) -> None:
    """A spring against the exact oscillation: order 2 with the mean of old and new, 1 otherwise."""
    omega, amplitude = 2 * math.pi, 0.1
    scene = Scene("oscillator", gravity=(0, 0, 0))
    scene.contact("a", "a", friction=0.0, restitution=0.0)
    scene.sphere("ball", radius=0.1, mass=1.0, material="a", position=(amplitude, 0, 0))
    ends = ((amplitude, 0, 0), (-10, 0, 0))
    scene.spring("ball", "ground", points=ends, stiffness=omega**2, rest_length=10.0)

    def exact(t: float) -> dict[str, list[float]]:
        return {"position:ball:x": [amplitude * math.cos(omega * t)]}

    found = carom.converge(scene, [2e-2, 1e-2, 5e-3], exact, until=1.0, method="moreau", theta=theta)
    fit = found.orders["position:ball:x"]
    assert fit is not None
    assert fit.value == pytest.approx(order, abs=0.1)


def pendulum() -> Scene:
    scene = Scene("pendulum", gravity=(0, 0, -GRAVITY))
    scene.contact("a", "a", friction=0.0, restitution=0.0)
    scene.sphere("bob", radius=0.05, mass=1.0, material="a", position=(1, 0, 0))
    scene.joint("rod", between=("bob", "ground"), points=((1, 0, 0), (0, 0, 0)))
    return scene


@pytest.mark.parametrize("projected", [False, True])
def test_joints_are_held_at_velocity_level(projected: bool) -> None:
    """A pendulum tends to that of nsga with order 1; its rod drifts by h^2 unless positions are projected."""
    options: dict[str, Any] = {"method": "moreau", "position_projection": projected, "until": 1.0}
    steps = [4e-3, 2e-3, 1e-3]
    reference = carom.simulate(pendulum(), method="nsga", step=5e-5, until=1.0, every=20)
    found = carom.converge(pendulum(), steps, reference, ["position", "velocity"], **options)
    for order in found.orders.values():
        assert order is not None
        assert order.value == pytest.approx(1, abs=0.05)
    drift = []
    for h in steps:
        places = np.asarray(run(pendulum(), step=h, until=1.0, position_projection=projected)["bob"].position)
        drift.append(float(np.max(np.abs(np.linalg.norm(places, axis=1) - 1))))
    if projected:
        assert max(drift) < 1e-12
    else:
        assert order_of(steps, drift).value == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("options", [{"method": "nsga"}, {"theta": 0.5}, {"theta": 0.8}])
def test_the_reaction_of_a_joint_carries_the_weight(options: dict[str, Any]) -> None:
    """At rest weight and reaction cancel and nothing moves: neither may be the measure of convergence."""
    scene = Scene("hanging", gravity=(0, 0, -GRAVITY))
    scene.contact("a", "a", friction=0.0, restitution=0.0)
    scene.sphere("ball", radius=0.05, mass=2.0, material="a", position=(0, 0, 0))
    scene.joint("fix", body="ball")
    h, every = 1e-3, 10
    result = run(scene, step=h, until=0.1, every=every, **options)
    reaction = np.asarray(result.joint_impulse)[2:, 0]
    carried = [0, 0, 2.0 * GRAVITY * h * every, 0, 0, 0]
    np.testing.assert_allclose(reaction, [carried] * len(reaction), atol=1e-12)
    assert np.max(np.abs(np.asarray(result.position))) < 1e-12


def test_a_driven_joint_does_the_work_that_the_energy_gains() -> None:
    """A ball pushed along a line by a prescribed motion: what the joint puts in is counted with the right weight."""
    scene = Scene("driven", gravity=(0, 0, 0))
    scene.contact("a", "a", friction=0.0, restitution=0.0)
    scene.sphere("ball", radius=0.05, mass=2.0, material="a", position=(0, 0, 0))
    scene.joint("motion", body="ball", direction=(1, 0, 0), displacement={"polynomial": [0, 0, 1.5]})
    for method in ("nsga", "moreau"):
        energy = run(scene, method=method, step=1e-3, until=0.5).summary["energy"]
        gained = energy["final"] - energy["initial"]
        assert gained == pytest.approx(0.5 * 2.0 * 1.5**2, rel=1e-9)  # v = 2 * 1.5 t at 0.5 s
        assert energy["work"] == pytest.approx(gained, rel=5e-3)


@pytest.mark.parametrize("projected", [False, True])
def test_a_run_continues_bit_for_bit(tmp_path: Path, projected: bool) -> None:
    scene = Scene.from_toml(SCENARIOS / "corner.toml")
    whole = run(scene, until=0.2, position_projection=projected)
    run(scene, until=0.1, position_projection=projected, out=tmp_path / "half")
    rest = carom.resume(tmp_path / "half", until=0.2)
    for key in ("position", "orientation", "velocity", "angular_velocity"):
        np.testing.assert_array_equal(getattr(rest, key)[-1], getattr(whole, key)[-1])


def test_contacts_and_impacts_are_recorded() -> None:
    result = run(ball_above(0.0, restitution=0.0), until=0.01, step=1e-3)
    impulse = np.asarray(result.contacts["impulse"])
    np.testing.assert_allclose(impulse[:, 2], MASS * GRAVITY * 1e-3, rtol=1e-9)
    assert result.summary["method"] == "moreau"


@pytest.mark.parametrize("theta", [0.0, 1.1, -0.5])
def test_theta_out_of_range_is_refused(theta: float) -> None:
    with pytest.raises(carom.ScenarioError, match="theta"):
        ball_above(0.1).with_options(theta=theta)


@pytest.mark.parametrize("restitution", [0.0, 0.4])
def test_what_is_only_projected_is_no_contact_of_the_velocities(restitution: float) -> None:
    """A ball that leaves the floor within a step is put on it: the auditor does not miss it among the counted contacts."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("b", "b", friction=0.3, restitution=restitution)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
    scene.sphere("a", radius=0.01, density=2500, material="b", position=(0, 0, 0.05))
    result = carom.simulate(scene, step=1e-3, until=0.3, every=1, method="moreau", position_projection=True)
    assert carom.audit.check(result).ok


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")  # of a wall that is as fast as that
@pytest.mark.parametrize("method", ["moreau", "nsga"])
@pytest.mark.parametrize("speed", [6.0, 20.0, 30.0])
def test_a_fast_disc_does_not_go_through_a_ball(method: str, speed: float) -> None:
    for place in np.arange(0.006, 0.03, 0.004):
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("b", "b", friction=0.0, restitution=0.0)
        scene.sphere("a", radius=0.005, mass=0.1, at=(place, 0, 0), material="b")
        motion = {"translation": [{"polynomial": [0, speed]}, 0, 0]}
        scene.plane("w", point=(0, 0, 0), normal=(1, 0, 0), radius=0.05, material="b", motion=motion)
        result = carom.simulate(scene, step=1e-3, until=8e-3, method=method)
        assert result.velocity[-1, 0, 0] == pytest.approx(speed, rel=1e-9)
        assert result.summary["substeps"] > 0


@pytest.mark.parametrize("motion", ["surface", "shape"])
@pytest.mark.parametrize("rides", [True, False])
def test_a_ball_on_a_turntable_keeps_its_speed(motion: str, rides: bool) -> None:
    """One rolls: `v' = (2/7) w x v`, a circle of its own. One rides along without rolling. Both keep their speed to h^2."""
    rate, r = 3.0, 0.02
    at, v = np.array([0.2, 0, r]), np.array([0, 0.6 if rides else 0.5, 0])
    slip = v - np.cross([0, 0, rate], [0.2, 0, 0])
    turning = (0, 0, rate) if rides else (-slip[1] / r, slip[0] / r, 0)
    of_wall = {
        "surface": {"surface_rotation": {"axis": [0, 0, 1], "rate": rate}},
        "shape": {"rotation": {"axis": [0, 0, 1], "angle": {"polynomial": [0, rate]}}},
    }
    scene = carom.Scene()
    scene.plane("table", point=(0, 0, 0), normal=(0, 0, 1), material="a", motion=of_wall[motion])
    scene.sphere("ball", radius=r, mass=0.1, at=at, velocity=v, angular_velocity=turning, material="a")
    scene.contact("a", "a", friction=5.0, restitution=0.0)
    off = []
    for step in (2e-3, 1e-3):
        result = carom.simulate(scene, method="moreau", step=step, until=1.0)
        off.append(np.linalg.norm(result.velocity[-1, 0]) - np.linalg.norm(v))
        gained = np.diff(result.kinetic_energy[[0, -1], 0])[0] - result.steps["energy_work"].sum()
        assert abs(gained) < 1e-9
    assert abs(off[1]) < 1e-6
    assert 3.0 < off[0] / off[1] < 5.0
