"""What only rounding makes is no fault: places of walls after many of their periods."""

from __future__ import annotations

import itertools

import carom
import numpy as np
import pytest


def test_a_ball_on_a_plate_that_has_shaken_for_long_is_right() -> None:
    """The plate's phase has the rounding of its time, which is more than that of its small way."""
    rate = 40.0 * np.pi
    scene = carom.Scene("plate", run={"until": 2.0, "step": 1e-3}, record={"every": 1})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    scene.sphere("ball", radius=0.005, mass=0.001, at=(0, 0, 0.005), material="m")
    way = f"{3.0 * 9.8 / rate**2!r}*sin({rate!r}*t)"
    scene.plane(
        "plate",
        point=(0, 0, 0),
        normal=(0, 0, 1),
        material="m",
        motion={"translation": (0, 0, {"expression": way})},
    )
    report = carom.audit.check(carom.simulate(scene))
    assert report.ok, report.findings
    assert report["gap"].judged > 100


def test_balls_that_a_lid_presses_in_a_box_that_shrinks_are_right() -> None:
    """Between frames contacts move balls against the flow of the box, too, and so change what its rate gives them."""
    side = 0.022
    run = {"until": 0.1, "step": 2e-4, "pile_tolerance": 1e-4, "impact": "one-shot"}
    scene = carom.Scene("lid", gravity=(0, 0, 0), periodic=(side, side, 0), run=run, record={"every": 20})
    scene.contact("m", "m", friction=0.3, restitution=0.3)
    scene.contact("m", "w", friction=0.0, restitution=0.3)
    region = {"low": (0, 0, 0), "high": (side, side, 0.03)}
    scene.packing("g", material="m", density=2500, seed=2, count=60, diameter=0.005, periodic="xy", **region)
    scene.plane("floor", material="w", point=(0, 0, 0), normal=(0, 0, 1))
    free = {"mass": 2e-3, "pressure": 1000.0, "weight": False}
    scene.plane("lid", material="w", point=(0, 0, 0.041), normal=(0, 0, -1), free=free)
    scene.deform(stretch=("exp(-0.8*t)", 1, 1))
    report = carom.audit.check(carom.simulate(scene))
    assert report.ok, report.findings
    assert report["momentum"].judged > 1000


@pytest.mark.parametrize("held", ["rod", "force", "spring", "roof"])
def test_a_ball_that_hangs_at_the_origin_is_right(held: str) -> None:
    """Its velocity is what is left of the weight and of what holds it, and its way has the rounding of both."""
    scene = carom.Scene("hung", gravity=(0, 0, -9.81))
    scene.contact("m", "m", friction=0.0, restitution=0.0, cohesion=20.0, rupture_distance=1e-3)
    scene.sphere("ball", radius=0.05, mass=1.0, at=(0, 0, 0), material="m")
    ends = {"between": ("ball", "ground"), "points": ((0, 0, 0), (0, 0, 0.5))}
    if held == "rod":
        scene.joint("rod", **ends)
    elif held == "force":
        scene.load(on="ball", force=(0, 0, 9.81))
    elif held == "spring":
        scene.spring("ball", "ground", points=ends["points"], stiffness=300.0, rest_length=0.5 - 9.81 / 300.0)
    else:
        scene.plane("roof", point=(0, 0, 0.05), normal=(0, 0, -1), material="m")
    result = carom.simulate(scene, step=5e-4, until=0.01, method="moreau")
    report = carom.audit.check(result)
    assert report.ok, report.findings
    assert report["position"].judged


@pytest.mark.parametrize("method", ["moreau", "nsga"])
@pytest.mark.parametrize("share", [0.5, 1.0, 1.001])
def test_a_lid_that_cohesion_holds_is_right(method: str, share: float) -> None:
    """Its force and the attraction cancel: of the way of `h^2 F/M` that both would make there is the rounding."""
    result = carom.simulate(lid(3, -3 * 0.05 * share, cohesion=0.05, rupture_distance=1e-4), method=method)
    lifted = result.walls["lid"].position[-1, 2] - 0.01
    assert lifted > 1e-5 if share > 1.0 else abs(lifted) < 1e-12
    report = carom.audit.check(result)
    assert report.ok, report.findings
    assert report["position"].judged


def test_without_contacts_the_momentum_of_a_lid_has_its_attraction_once() -> None:
    scene = lid(3, 0.5, cohesion=0.02, rupture_distance=1e-4)
    report = carom.audit.check(carom.simulate(scene, contacts=False, walls=True))
    assert report.ok, report.findings
    assert report["momentum"].judged >= 100


@pytest.mark.parametrize("force", [0.05, 5.0, {"expression": "5*exp(-100*t)"}])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_overlaps_below_a_lid_may_add_up(count: int, force: object) -> None:
    """What solvers leave two balls to close by is a share of what the lid presses with, and keeps its sign in many steps."""
    report = carom.audit.check(carom.simulate(lid(count, force), method="moreau"))
    assert report.ok, report.findings
    assert report["penetration"].judged


@pytest.mark.parametrize("step", [1e-4, 5e-5])
def test_what_sticks_by_cohesion_is_held_where_its_loads_were_solved(step: float) -> None:
    """A tetrahedron at rest that a ball begins to pull askew. Its normals turn by less than what loads are solved again for:
    impulses turn with them, attraction does not. What is left is that share of their speeds, whatever the tolerance.
    """
    r, m = 0.005, 1e-3
    scene = carom.Scene("askew", gravity=(0, 0, 0), run={"tolerance": 1e-12})
    scene.contact("a", "a", friction=0.3, restitution=0.5, cohesion=0.02, rupture_distance=5e-4)
    corners = r * np.array([(0, 0, 0), (2, 0, 0), (1, 3**0.5, 0), (1, 3**-0.5, (8 / 3) ** 0.5)])
    askew = np.array((0.3, 0.2, 1.0)) / np.linalg.norm((0.3, 0.2, 1.0))
    for k, at in enumerate((*corners, corners[3] + (2 * r + 4.9e-4) * askew)):
        scene.sphere(f"b{k}", radius=r, mass=m, material="a", at=at)
    result = carom.simulate(scene, step=step, until=2 * step, every=1)
    report = carom.audit.check(result)
    assert report.ok, report.findings
    assert report["slip"].judged
    first = result.contacts.at(1)
    v, w = result.velocity[1], result.angular_velocity[1]
    given = np.linalg.norm(first.impulse, axis=1)
    for (a, b), normal in zip(first.body, first.normal, strict=True):
        slip = v[a] - v[b] - r * np.cross(w[a] + w[b], normal)
        slip -= (slip @ normal) * normal
        pressed = given[np.isin(first.body, (a, b)).any(axis=1)].sum()
        assert np.linalg.norm(slip) < 2e-7 * 2.0 * pressed / m


@pytest.mark.filterwarnings("ignore:energy rose")
def test_balls_of_moreau_that_a_force_presses_are_right() -> None:
    """They move by the mean of velocities, in which the force works with what solvers leave."""
    scene = carom.Scene("column", gravity=(0, 0, 0))
    for other in ("a", "w"):
        scene.contact("a", other, friction=0.3, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    for k in range(3):
        scene.sphere(f"b{k}", radius=0.005, mass=1e-3, material="a", at=(0, 0, 0.005 + 0.01 * k))
    scene.load(on="b2", force=(0, 0, -3.0))
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.1, method="moreau"))
    assert report.ok, report.findings
    assert report["energy rise"].judged
    assert report["penetration"].judged


def lid(count: int, force: object, **law: float) -> carom.Scene:
    """Balls without weight between a floor and a free plane."""
    scene = carom.Scene("lid", gravity=(0, 0, 0), run={"step": 1e-3, "until": 0.1}, record={"every": 1})
    for other in ("a", "w"):
        scene.contact("a", other, friction=0.3, restitution=0.0, **(law if other == "w" else {}))
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    free = {"mass": 0.01, "force": force}
    scene.plane("lid", point=(0, 0, 0.01), normal=(0, 0, -1), material="w", free=free)
    for i in range(count):
        at = (0.02 * i, (0.013 * i * i) % 0.05, 0.005)
        scene.sphere(f"b{i}", radius=0.005, mass=1e-3, material="a", at=at)
    return scene


@pytest.mark.parametrize("tolerance", [1e-8, 1e-12])
def test_a_stress_that_fades_from_the_record_leaves_what_it_was_solved_to(tolerance: float) -> None:
    """A square with both braces turns in its plane: one condition too many, so that any stress of it is a solution."""
    corners = np.array([(0, 0, 0), (0.5, 0, 0), (0.5, 0, -0.5), (0, 0, -0.5)])
    scene = carom.Scene("truss", gravity=(0, 0, 0), run={"tolerance": tolerance})
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    for k, at in enumerate(corners):
        velocity = np.cross((1, 2, 3), at) + np.array((0.1, 0.2, 0.3))
        scene.sphere(f"b{k}", radius=0.05, mass=1.0 + k, at=at, velocity=velocity, material="m")
    for i, j in itertools.combinations(range(4), 2):
        scene.joint("rod", between=(f"b{j}", f"b{i}"))
    with pytest.warns(carom.CaromWarning, match="hold the same motion"):
        result = carom.simulate(scene, step=1e-3, until=1.0, every=1)
    most = np.linalg.norm(result.joint_impulse[:, :, :3], axis=2).sum(axis=1)
    assert most[800:].min() < 1e-3 * most.max()
    report = carom.audit.check(result)
    assert report.ok, report.findings


@pytest.mark.parametrize("speed", [1e-6, 1e-8])
def test_a_spin_that_ends_in_a_bowl_is_right(speed: float) -> None:
    """Loads are not solved again where their normals turned by less than a share of `closing_tolerance_speed`. What a body
    turns with has then a part of that share along its new normal, on which no spinning moment acts.
    """
    radius, bowl = 0.0262, 0.32
    normal = np.array([-0.848, 0.213, -0.486])
    normal /= np.linalg.norm(normal)
    velocity = np.array([0.044, -0.28, -0.204])
    velocity -= velocity @ normal * normal
    scene = carom.Scene("bowl", gravity=(8.27, -2.47, 4.05), run={"until": 0.02, "step": 5e-4})
    scene.contact("m", "m", friction=0.9, restitution=0.0, spinning_radius=0.003)
    scene.ball_wall("bowl", point=(0, 0, 0), radius=bowl, material="m")
    turn = np.cross(normal, velocity) / radius + 0.1 * normal
    scene.sphere(
        "ball",
        radius=radius,
        mass=1.88,
        material="m",
        at=tuple((radius - bowl) * normal),
        velocity=tuple(velocity),
        angular_velocity=tuple(turn),
    )
    run = carom.simulate(scene, closing_tolerance_speed=speed)
    last = run.contacts.at(len(run.time) - 1)
    spin = abs(np.asarray(run.angular_velocity)[-1, 0] @ last["normal"][0])
    assert spin < 0.2 * speed * np.linalg.norm(run.angular_velocity[-1, 0])
    assert (spin > 1e-8) == (speed == 1e-6)
    assert np.linalg.norm(last["moment"][0]) < 1e-9
    report = carom.audit.check(run)
    assert report.ok, report.findings
    assert report["roll"].judged > 30


@pytest.mark.parametrize("tied", [True, False])
def test_what_one_problem_joins_has_the_rounding_of_its_farthest_body(tied: bool) -> None:
    """The solver closes gaps to 16 roundings of the largest coordinate of its problem, if a spring joins the far one."""
    scene = carom.Scene("far", gravity=(0, 0, -9.8), record={"every": 1})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for name, place in (("near", (0, 0, 0.001)), ("far", (100.0, 0, 1.0))):
        scene.sphere(name, radius=0.001, mass=0.01, at=place, material="m")
    if tied:
        scene.spring("far", "near", stiffness=1e-3)
    worst = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.01))["penetration"].worst
    assert worst is not None
    largest = 100.0 if tied else 0.001
    assert worst.bound == pytest.approx(1e-10 * 0.001 + 16.0 * np.finfo(float).eps * largest, rel=1e-6)


@pytest.mark.parametrize("tolerance", [1e-11, 1e-12])
def test_works_of_a_solver_that_ends_at_its_floor_are_right(tolerance: float) -> None:
    """A ball that spins between heavy ones falls with them: impulses are a millionth of their weights in a step."""
    scene = carom.Scene("falling", gravity=(0, 0, -9.8), record={"every": 1})
    scene.contact("m", "m", friction=0.15, restitution=0.5)
    beside = (-0.0063, 0, -0.007 * (1.0 - 0.81) ** 0.5)
    scene.sphere("ball", radius=0.001, mass=0.08, at=(0, 0, 0), angular_velocity=(6, 0, 0), material="m")
    scene.sphere("heavy", radius=0.001, mass=1.7, at=(0.002, 0, 0), material="m")
    scene.sphere("dragged", radius=0.006, mass=0.46, at=beside, material="m")
    scene.drag("dragged", translation=0.05, rotation=1e-5)
    run = {"until": 0.15, "step": 5e-4, "impact": "compliant", "tolerance": tolerance}
    report = carom.audit.check(carom.simulate(scene, **run))
    assert report.ok, report.findings
    assert report["work"].judged > 500
