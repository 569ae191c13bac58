"""`carom.simulate_batch`: balls that it places, or strikes, where joints hold them or inflows let them in."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.many import cases
from carom.many.cases import Overrides
from carom.scene.assembly.vectors import unit


def joined() -> carom.Scene:
    scene = carom.Scene("joined", gravity=(0, 0, -9.81), run={"until": 0.05, "step": 1e-3})
    scene.contact("g", "g", friction=0.3, restitution=0.0)
    for name, x in (("a", 0.0), ("b", 0.1), ("c", 0.2), ("d", 0.3)):
        scene.sphere(name, radius=0.01, mass=0.1, at=(x, 0, 0), material="g")
    scene.joint("rod", between=["a", "b"])
    scene.joint("ball", between=["ground", "b"], point=(0.1, 0, 0.05))
    scene.spring("c", "d", stiffness=5.0)
    return scene


def test_joints_and_springs_are_those_of_the_places_of_a_case() -> None:
    given = {"a.position.z": [0.0, 0.02], "d.position.x": [0.3, 0.35], "a.velocity.y": [0.0, 1.0]}
    batch = carom.simulate_batch(joined(), given)
    assert batch.ok.all()
    for case in range(2):
        single = carom.simulate(batch.scene(case))
        np.testing.assert_array_equal(batch.position[case], np.asarray(single.position)[-1])
    assert np.linalg.norm(batch.position[1, 0] - batch.position[1, 1]) == pytest.approx(np.hypot(0.1, 0.02))


@pytest.mark.parametrize("off", [0.0, 1e-7])
def test_orientations_have_the_bits_of_single_runs_and_of_their_files(off: float) -> None:
    """A scene divided them by their length once more than the batch, whose last bits went with it."""
    q = np.random.default_rng(0).normal(size=(12, 4, 4))
    q *= (1.0 + off) / np.linalg.norm(q, axis=2, keepdims=True)
    scene = joined()
    batch = carom.simulate_batch(scene, {f"{name}.orientation": q[:, i] for i, name in enumerate("abcd")})
    assert batch.ok.all()
    for case in range(len(q)):
        own = batch.scene(case)
        for same in (own, carom.Scene.from_toml(own.to_toml())):
            assert np.array_equal(np.asarray(carom.simulate(same).orientation)[-1], batch.orientation[case])
    once = [*map(unit, q.reshape(-1, 4).tolist())]
    assert [*map(unit, once)] == once


def test_cases_of_a_scene_with_inflows_are_scenes() -> None:
    """They were refused, though only a law, gravity or a sphere of the scene varies."""
    scene = carom.Scene("falls", run={"until": 0.1, "step": 1e-3})
    scene.contact("b", "w", friction=0.3, restitution=0.3)
    scene.contact("b", "b", friction=0.3, restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    scene.sphere("a", radius=0.004, mass=0.01, at=(0.1, 0, 0.004), material="b")
    region = {"low": (-0.02, -0.02, 0.02), "high": (0.02, 0.02, 0.03)}
    scene.inflow("g", count=5, radius=0.004, density=2500, region=region, rate=200, seed=1, material="b")
    given = {"b/w.friction": [0.1, 0.5], "gravity.x": [0.0, 1.0], "a.velocity.x": [-0.1, -1.0]}
    batch = carom.simulate_batch(scene, given)
    assert batch.ok.all()
    for case in range(2):
        single = carom.simulate(batch.scene(case))
        assert np.array_equal(np.asarray(single.position)[-1], batch.position[case])
    with pytest.raises(
        CaromError, match=r'^"mass": "g5" is no sphere of a scene; make a scene for each case'
    ):
        carom.simulate_batch(scene, {"mass": np.full((1, 6), 0.01)}).scene(0)


def test_a_case_that_its_scene_would_refuse_is_bad() -> None:
    batch = carom.simulate_batch(joined(), {"a.velocity.x": [0.0, 5.0], "b.mass": [0.1, 0.2]})
    assert batch.outcome.tolist() == ["done", "bad_scene"]
    assert 'the speed (m/s) at which the ends on "a" and "b" part is -5 at the start' in batch.message[1]


def test_balls_of_inflows_enter_as_their_table_says() -> None:
    scene = joined()
    region = {"low": (0, 0, 1), "high": (0, 0, 1)}
    scene.inflow("g", count=1, radius=0.01, density=2500, region=region, material="g", seed=1)
    for key, told in (
        ("g1.velocity", '"g1" is of an inflow and enters where and as its table says'),
        ("g1.position.x", '"g1" is of an inflow'),
        (
            "velocity",
            'those of inflows enter where and as their table says; name the spheres .* "cue.velocity"',
        ),
    ):
        with pytest.raises(carom.CaromError, match=told):
            carom.simulate_batch(scene, {key: np.zeros((1, 5, 3) if key == "velocity" else (1, 3))})
    assert carom.simulate_batch(scene, {"d.velocity.y": [0.1]}).ok.all()


def test_a_quaternion_is_of_length_one() -> None:
    turns = [[1.0, 0, 0, 0], [2.0, 0, 0, 0], [0.0, 0, 0, 0]]
    batch = carom.simulate_batch(joined(), {"d.orientation": turns})
    assert batch.outcome.tolist() == ["done", "bad_scene", "bad_scene"]
    assert batch.message[1] == 'orientation of "d": a unit quaternion has length 1, found 2'
    turned = Overrides(joined(), {"d.orientation.x": [1.0]}).model(0)["orientation"][3]
    np.testing.assert_allclose(
        turned, [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    )  # of one component the others follow


def test_a_case_costs_as_much_as_it_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The orientations of all balls were looked at in each case."""
    given = Overrides(joined(), {"d.orientation.x": [1.0, 2.0], "b.orientation": [[0.6, 0, 0, 0.8]] * 2})
    seen = []
    monkeypatch.setattr(cases, "unit", lambda row: seen.append(row) or unit(row))
    given.model(1)
    assert len(seen) == 2
