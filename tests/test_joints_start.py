"""The table [[joint]]: a good start is never refused, and of a bad one the cure is told."""

from __future__ import annotations

import re
from typing import Any

import carom
import numpy as np
import pytest
from carom import ScenarioError, Scene
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_format_scenes import TURNED, X, Z, balls, unit_quaternion, vectors

# --- the start --------------------------------------------------------------------------------------------------------


def start_error(scene: Scene) -> str:
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    return str(caught.value)


def apply_cures(scene: Scene, message: str) -> None:
    """Do what the messages say: `velocity = [...] of "a" and angular_velocity = [...] of "b" would fit`."""
    found = re.findall(r'(\w+) = \[([^]]*)\] of "(\w+)"', message)
    assert found
    for key, numbers, name in found:
        (sphere,) = (s for s in scene.spheres if s.name == name)
        setattr(sphere, key, [float(x) for x in numbers.split(",")])


@settings(deadline=None)
@given(vectors, vectors, st.floats(1e-6, 1e6), st.sampled_from(["ground", "b"]))
def test_a_pendulum_that_swings_is_a_good_start(
    direction: tuple[float, float, float], spin: tuple[float, float, float], scale: float, other: str
) -> None:
    """Velocities computed as w x r violate the rod by their rounding, which nobody is told about."""
    if np.linalg.norm(direction) < 0.5:
        return
    scene = balls()
    arm = np.array(direction)
    a, b = scene.spheres
    b.position = (50, 20, 3)
    at = np.array(b.position) + arm
    a.position = at
    a.velocity = np.cross(np.array(spin) * scale, arm)
    scene.joint("rod", between=("a", other), points=None if other == "b" else [at, b.position])
    assert [advice for advice in scene.validate() if advice.key != "run.step"] == []


@pytest.mark.parametrize(
    ("velocity", "law"),
    [
        (0.3, {"expression": "1 + 0.1*sin(3*t)"}),
        (-0.25, {"polynomial": [1.0, -0.25, 9.0]}),
        (2.0, {"table": [[-1, -1], [0, 1], [1, 3]]}),
        (0.0, {"table": [[0.5, 1], [1, 3]]}),
        (0.0, {"expression": "1 + 0.01*(1 - cos(200*t))"}),
        (0.1 + 0.2, {"expression": "exp(0.3*t)"}),
    ],
)
def test_a_rod_may_start_with_the_speed_of_its_law(velocity: float, law: dict[str, Any]) -> None:
    scene = balls(velocity=(0, 0, -velocity))
    scene.joint("rod", between=("a", "b"), length=law)
    assert scene.validate() == []
    scene.spheres[0].velocity = (0, 0, -velocity - 0.5)
    message = start_error(scene)
    assert 'the speed (m/s) at which the ends on "a" and "b" part is' in message
    found, wanted = re.search(r"part is (\S+) at the start, the joint asks for (\S+);", message).groups()  # type: ignore[union-attr]
    assert float(found) == pytest.approx(velocity + 0.5)
    assert float(wanted) == pytest.approx(velocity, abs=1e-9)
    apply_cures(scene, message)
    assert scene.validate() == []


def test_velocities_rounded_to_a_few_digits_get_advice() -> None:
    s, c = 0.5, 0.866  # of 30 degrees
    scene = balls(velocity=(c, 0, -s))
    scene.joint("rod", between=("a", "ground"), points=[(0, 0, 1), (-0.5, 0, 1 - 0.8660254037844386)])
    (advice,) = scene.validate()
    assert "part is -1.27019e-05 at the start, the joint asks for 0; velocity = [" in str(advice)
    scene.spheres[0].velocity = (c, 0, -0.4)
    assert start_error(scene)


def test_lengths_rounded_to_a_few_digits_get_advice() -> None:
    scene = balls(position=(1, 1, 1), at=None)
    rod = scene.joint("rod", between=("a", "b"), length=1.732)
    (advice,) = scene.validate()
    assert "is 1.732 m at t = 0, but the ends are 1.73205081 m apart" in str(advice)
    rod.length = 3**0.5
    assert scene.validate() == []


@given(vectors, vectors, vectors, vectors)
@settings(deadline=None, max_examples=30)
def test_the_velocities_in_the_message_fit(v: Any, w: Any, v_b: Any, w_b: Any) -> None:
    """Two bodies in three joints: what the messages say together leaves nothing to complain about."""
    scene = balls(velocity=v, angular_velocity=w, orientation=unit_quaternion(TURNED))
    scene.spheres[1].velocity, scene.spheres[1].angular_velocity = v_b, w_b
    scene.joint("ball", between=("a", "b"), point=(0.05, 0, 1.5))
    scene.joint("fix", body="a", point=(0, 0.1, 0.7))
    scene.joint("motion", body="b", axis=(0, 1, 1), angle={"polynomial": [0, 0.7]})
    apply_cures(scene, start_error(scene))
    scene.validate()  # the figures have nine digits, so that there may be advice but no error
    assert all("follow from" not in str(advice) for advice in scene.validate())


def test_angular_velocities_count() -> None:
    scene = balls(angular_velocity=(0, 0, 5))
    scene.joint("motion", name="drive", body="a", axis=Z, angle={"polynomial": [0, 4]})
    message = start_error(scene)
    assert (
        'scene.joint("motion", name="drive"): the angular speed (rad/s) of "a" about [0, 0, 1] is 5'
        in message
    )
    assert 'the joint asks for 4; angular_velocity = [0, 0, 4] of "a" would fit' in message
    scene.spheres[0].angular_velocity = (1, 2, 4)
    assert scene.validate() == []
    scene.joint("lock", between=("a", "b"), axes=[X])
    assert 'of "a" against "b" about [1, 0, 0] is 1' in start_error(scene)


def test_joints_that_contradict_each_other() -> None:
    scene = balls()
    scene.joint("motion", body="a", direction=X, displacement={"polynomial": [0, 1]})
    scene.joint("motion", body="a", direction=X, displacement={"polynomial": [0, 2]})
    assert "no velocities fit all joints of these bodies: they contradict each other" in start_error(scene)


def test_joints_that_say_the_same_twice_get_advice() -> None:
    scene = balls()
    scene.joint("fix", body="a")
    scene.joint("lock", body="a")
    assert scene.validate() == []
    scene.joint("line", body="a", direction=(1, 1, 1))
    (advice,) = scene.validate()
    assert '2 of the 2 conditions of joint "joint3" hold the same motion as other joints' in str(advice)
    assert advice.where == 'scene.joint("line")'


def test_joints_that_say_the_same_are_told_at_once() -> None:
    """One line, however many joints repeat others."""
    scene = balls()
    for kind in ("fix", "lock", "fix", "fix", "fix", "fix"):
        scene.joint(kind, body="a")
    (advice,) = scene.validate()
    assert str(advice).count("3 of the 3 conditions") == 3
    assert "some of 1 more hold the same motion as other joints" in str(advice)


def beads(*, bend: float = 0.0) -> Scene:
    """Two balls of 0.1 m, the second bent by an angle about the point where they touched."""
    scene = Scene(gravity=(0, 0, -9.8), run={"until": 0.2, "step": 1e-3})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    at = (0.1 + 0.1 * np.cos(bend), 0, -0.1 * np.sin(bend))
    scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 0), material="m")
    scene.sphere("b", radius=0.1, mass=1, at=at, material="m")
    scene.joint("fix", body="a")
    scene.joint("lock", body="a")
    return scene


def test_balls_that_joints_hold_apart_may_overlap_at_the_start() -> None:
    """A chain of beads that has bent is a start like any other: its run goes on as if it had not stopped."""
    scene = beads(bend=0.5)
    assert "overlap at the start" in start_error(scene)
    scene.joint("ball", between=["a", "b"], point=(0.1, 0, 0))
    assert scene.validate() == []

    straight = beads()
    straight.joint("ball", between=["a", "b"], point=(0.1, 0, 0))
    whole, half = carom.simulate(straight), carom.simulate(straight, until=0.1)
    rest = Scene(gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    rest.contact("m", "m", friction=0.1, restitution=0.5)
    rest.spheres_from(half)
    assert "overlap at the start" in start_error(rest)
    for kind in ("fix", "lock"):
        rest.joint(kind, body="a")
    rest.joint("ball", between=["a", "b"], point=(0.1, 0, 0))
    went_on = carom.simulate(rest)
    assert float(went_on.position[-1, 1, 2]) < -0.05
    np.testing.assert_allclose(went_on.position[-1], whole.position[-1], rtol=0, atol=2e-5)


def test_many_joints_are_checked_one_by_one() -> None:
    """A chain of 300 ball joints has 900 rows, more than are fitted together."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 1.0})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    for k in range(301):
        scene.sphere(f"s{k}", radius=0.1, mass=1, at=(k, 0, 0), velocity=(0, 1, 0), material="m")
    for k in range(300):
        scene.joint("ball", between=(f"s{k}", f"s{k + 1}"), point=(k + 0.5, 0, 0))
    assert scene.validate() == []
    scene.spheres[150].velocity = (1, 1, 0)
    assert len(start_error(scene).splitlines()) == 2
