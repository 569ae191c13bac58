"""Clumps with joints and loads, as far as scenes are checked: a joint or load names a ball, and holds the whole clump."""

from __future__ import annotations

import re
from typing import Any

import carom
import numpy as np
import pytest
from carom import ScenarioError, Scene
from carom.scene.assembly.arrays import bodies
from carom.scene.assembly.held_apart import held_apart
from carom.scene.assembly.mechanics import joints_for_core, numbers
from carom.scene.assembly.rotations import rotated

TEE = [[-0.01, 0, 0, 0.006], [0.01, 0, 0, 0.006], [0, 0.02, 0, 0.006]]
TURN = np.array([0.9, 0.1, 0.3, 0.2]) / np.linalg.norm([0.9, 0.1, 0.3, 0.2])


def tees(count: int = 2, **keys: Any) -> Scene:
    """Clumps tee1-, tee2-, ... side by side, of balls tee1-1 and so on."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 0.01, "step": 1e-4})
    scene.contact("steel", "steel", friction=0.3, restitution=0.5)
    for k in range(1, count + 1):
        given = {"density": 7800, "position": (0.1 * k, 0.2, 0.3), "orientation": TURN, "material": "steel"}
        scene.clump(f"tee{k}-", spheres=TEE, **{**given, **keys})
    return scene


def told(scene: Scene) -> list[str]:
    return [f"{advice.cause}; {advice.cure}" for advice in scene.validate()]


def error(scene: Scene) -> str:
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    return str(caught.value)


def test_all_that_holds_a_ball_may_hold_one_of_a_clump() -> None:
    scene = tees()
    scene.joint("fix", body="tee1-1")
    scene.joint("rod", between=("tee1-2", "tee2-3"))
    scene.load("tee2-1", force=(1, 0, 0), torque=(0, 1e-4, 0))
    scene.spring("tee1-3", "tee2-2", stiffness=1.0)
    scene.drag("all", translation=0.1)
    scene.load_function(lambda t, x, v, w: np.zeros((6, 6)))
    assert told(scene) == []
    model = scene.to_model()
    assert [(joint["a"], joint["b"]) for joint in model["joints"]] == [(0, -1), (1, 5)]
    assert [load.get("body", load.get("a")) for load in model["loads"]] == [3, 2, *range(6), None]


@pytest.mark.parametrize("section", ["joint", "spring"])
def test_nothing_holds_two_balls_of_one_clump(section: str) -> None:
    scene = tees()
    scene.joint("rod", between=("tee1-1", "tee2-1"))
    scene.spring("tee1-1", "ground", points=[(0, 0, 0), (1, 0, 0)], stiffness=1.0)
    if section == "joint":
        scene.joint("lock", between=("tee2-1", "tee2-3"))
    else:
        scene.spring("tee2-1", "tee2-3", stiffness=1.0)
    message = error(scene)
    assert f'two balls of clump "tee2-", which is rigid; leave this {section} out' in message


def test_a_clump_is_named_by_its_balls() -> None:
    scene = tees()
    scene.load("tee1-", force=(1, 0, 0))
    scene.joint("fix", body="tee2-")
    message = error(scene)
    assert '"tee1-" is a clump, and a load acts on spheres; its balls are tee1-1 to tee1-3' in message
    assert '"tee2-" is a clump, and joints act on spheres; its balls are tee2-1 to tee2-3' in message


@pytest.mark.parametrize("kind", ["fix", "ball", "rod", "lock"])
def test_velocities_that_fit_the_joints_are_those_of_clumps(kind: str) -> None:
    """What does not fit is refused, and the cure is one that fits: of a clump with its own velocities."""
    scene = tees(velocity=(0.3, -0.1, 0.2), angular_velocity=(3, 5, 7))
    other = scene.clumps[1]
    other.velocity, other.angular_velocity = (-0.1, 0.2, 0.1), (1, -4, 2)
    between = ("tee1-3", "tee2-1")
    if kind == "fix":
        scene.joint("fix", body="tee1-3")
    elif kind == "ball":
        scene.joint("ball", between=between, point=(0.15, 0.21, 0.32))
    else:
        scene.joint(kind, between=between)
    found = re.findall(r'(\w+) = \[([^]]*)\] of "([-\w]+)"', error(scene))
    assert {name for *_, name in found} <= {"tee1-", "tee2-"}
    for key, given, name in found:
        (clump,) = (c for c in scene.clumps if c.name == name)
        setattr(clump, key, [float(x) for x in given.split(",")])
    assert told(scene) == []
    if kind == "fix":
        clump = scene.clumps[0]
        arm = clump.centres()[2] - clump.middle()
        assert clump.velocity == pytest.approx(-np.cross(clump.angular_velocity, arm), abs=1e-9)


def test_a_clump_that_swings_about_one_of_its_balls_is_a_good_start() -> None:
    scene = tees(1)
    (clump,) = scene.clumps
    arm = clump.middle() - clump.centres()[0]
    clump.angular_velocity = (3, 5, 7)
    clump.velocity = np.cross([3, 5, 7], arm)
    scene.joint("fix", body="tee1-1")
    assert told(scene) == []
    clump.velocity = np.cross([3, 5, 7], arm) + np.array([0.1, 0, 0])
    assert "the joint asks for 0" in error(scene)


def test_joints_of_a_clump_that_hold_the_same_twice_are_told() -> None:
    """Three points of a rigid body hold it three times over; two balls of their own would not be."""
    scene = tees(1)
    for ball in ("tee1-1", "tee1-2"):
        scene.joint("fix", body=ball)
    (advice,) = told(scene)
    assert "1 of the 3 conditions of joint" in advice
    assert "hold the same motion as other joints" in advice


def test_joined_balls_do_not_meet_others_of_their_clumps_do() -> None:
    scene = tees()
    scene.joint("rod", between=("tee1-2", "tee2-1"))
    balls = bodies(scene._tree)
    found = held_apart(joints_for_core(scene.joints, balls, numbers(balls)), balls.radius, balls.clump)
    a, b = (np.array(of) for of in zip(*[(i, j) for i in range(6) for j in range(i + 1, 6)], strict=True))
    apart = {(int(i), int(j)) for i, j, held in zip(a, b, found.holds(a, b), strict=True) if held}
    assert apart == {(0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5), (1, 3)}


def test_a_clump_that_is_held_does_not_leave() -> None:
    scene = tees()
    scene.outlet(low=(-1, -1, -1), high=(1, 1, 1))
    (advice,) = told(scene)
    assert "all balls that are there at the start leave at once" in advice
    scene.drag("tee1-3", translation=0.1)  # which holds nothing
    assert len(told(scene)) == 1
    scene.load("tee1-3", force=(0, 0, 0.1))
    (advice,) = told(scene)
    assert advice.startswith('"tee2-" leaves at once')


def test_a_spring_far_from_the_centre_is_quick_for_a_step() -> None:
    """It turns the clump: the period is that of the inverse mass `1/m + d^2/J`."""
    spheres = [[x, 0, 0, 0.001] for x in (-0.05, 0.05)]
    scene = Scene(gravity=(0, 0, 0), run={"until": 0.1, "step": 4e-3})
    scene.contact("steel", "steel", friction=0.3, restitution=0.5)
    inertia = [1e-6, 2.5e-6, 2.5e-6]  # which turns far more easily than two balls that far away would
    scene.clump("rod", spheres=spheres, mass=0.01, inertia=inertia, position=(0, 0, 0), material="steel")
    scene.spring("rod2", "ground", points=[(0.05, 0, 0), (0.05, 1, 0)], stiffness=10.0)
    period = 2 * np.pi / np.sqrt(10.0 * (1 / 0.01 + 0.05**2 / 2.5e-6))
    (advice,) = told(scene)
    assert f"its period is about {period:.3g} s" in advice


def test_a_contact_of_any_ball_of_a_clump_may_lose_its_load_to_joints() -> None:
    """Ball rod2 lies on a plane, and the joints are at rod1: they hold what presses it down."""
    for types, loses in ((("plane", "lock"), True), (("plane",), False)):
        scene = Scene(gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
        scene.contact("steel", "steel", friction=0.3, restitution=0.0)
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
        scene.clump("rod", spheres=[[0, 0, 0, 0.008], [0.02, 0, 0, 0.01]], mass=0.1, position=(0, 0, 0.01),
                    material="steel")  # fmt: skip
        for kind in types:
            scene.joint(kind, body="rod1", normal=(0, 0, 1) if kind == "plane" else None)
        assert any("can take the load of the contact" in advice for advice in told(scene)) == loses


def test_a_run_is_taken_over_with_its_clumps_under_other_loads(tmp_path: Any) -> None:
    scene = tees(1, velocity=(0.1, 0, 0), angular_velocity=(1, 2, 3))
    result = carom.simulate(scene, until=0.002)
    following = Scene(gravity=(0, 0, 0), run={"until": 0.002, "step": 1e-4})
    following.contact("steel", "steel", friction=0.3, restitution=0.5)
    (clump,) = following.spheres_from(result)
    following.joint("fix", body="tee1-2", point=clump.centres()[0] + rotated(TURN, np.array([0, 0, 1e-3])))
    following.load("tee1-1", force=(0, 0, 1))
    message = error(following)
    assert 'of "tee1-"' in message
