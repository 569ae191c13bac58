"""A scene that begins with the balls of a run, and the overlaps that piles may start with."""

from __future__ import annotations

import warnings

import carom
import numpy as np
import pytest


def tray(pile_tolerance: float = 1e-4, **run: float) -> carom.Scene:
    run = {"until": 0.25, "step": 1e-3, "pile_tolerance": pile_tolerance, **run}
    scene = carom.Scene("tray", run=run, record={"every": 50, "impacts": False})
    for other in ("grain", "wall"):
        scene.contact("grain", other, friction=0.4, restitution=0.3)
    scene.box("tray", low=(0, 0, 0), high=(0.03, 0.03, 0.2), open=["high_z"], material="wall")
    return scene


@pytest.fixture(scope="module")
def settled() -> carom.Result:
    scene = tray()
    scene.packing(
        "g", material="grain", density=2500, seed=1, count=40, sizes="uniform", smallest=0.005, largest=0.009,
        low=(0, 0, 0), high=(0.03, 0.03, 0.06),
    )  # fmt: skip
    return carom.simulate(scene)


def test_balls_are_taken_to_the_last_bit(settled: carom.Result) -> None:
    scene = tray(until=0.005)
    taken = scene.spheres_from(settled)
    assert [ball.name for ball in taken] == scene.names == list(settled.names)
    again = carom.simulate(scene)
    for name in ("position", "velocity", "angular_velocity"):
        assert np.array_equal(getattr(again, name)[0], getattr(settled, name)[-1]), name
    assert again.orientation[0] == pytest.approx(settled.orientation[-1], abs=4e-16)  # of unit length again
    for name in ("radius", "mass", "inertia"):
        assert np.array_equal(again.bodies[name], settled.bodies[name]), name
    assert carom.Scene.from_toml(scene.to_toml()) == scene


@pytest.mark.parametrize("name", ["ball", "rod"])
def test_a_name_that_is_taken_leaves_the_scene_as_it_was(name: str) -> None:
    scene = carom.Scene(run={"step": 1e-3, "until": 0.01})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    scene.sphere("first", radius=0.01, mass=1, position=(2, 0, 0), material="m")
    scene.sphere("ball", radius=0.01, mass=1, position=(1, 0, 0), material="m")
    spheres = [[0, 0, 0, 0.01], [0.015, 0, 0, 0.01]]
    scene.clump("rod", spheres=spheres, mass=1, position=(0, 0, 0), material="m")
    run = carom.simulate(scene)
    other, before = (carom.Scene(run={"step": 1e-3, "until": 0.01}) for _ in range(2))
    for made in (other, before):
        made.sphere(name, radius=0.01, mass=1, position=(3, 0, 0), material="n")
    with pytest.raises(carom.CaromError, match=f'there is already a sphere, clump or wall "{name}"'):
        other.spheres_from(run)
    assert other == before
    other.spheres[0].name = "other"
    assert [one.name for one in other.spheres_from(run)] == ["first", "ball", "rod"]


def test_a_time_names_the_nearest_frame(settled: carom.Result) -> None:
    scene = tray()
    scene.spheres_from(settled, time=0.11)
    assert np.array_equal([ball.position for ball in scene.spheres], settled.position[2])
    with pytest.raises(carom.CaromError, match=r"there is no frame 99; give one of -6 to 5"):
        tray().spheres_from(settled, 99)


@pytest.mark.parametrize("body", ["ball", "wall"])
def test_piles_may_start_with_what_a_step_may_leave(body: str) -> None:
    for tolerance, deep, fine in (
        (1e-4, 4e-4, True),
        (1e-4, 5e-4, False),
        (1e-7, 2e-9, False),
        (9e-6, 2e-9, False),
    ):
        scene = tray(tolerance)
        height = 0.005 * (1 - deep) if body == "wall" else 0.1
        scene.sphere("a", radius=0.005, density=2500, at=(0.015, 0.015, height), material="grain")
        if body == "ball":
            up = height + 0.01 - 0.005 * deep
            scene.sphere("b", radius=0.005, density=2500, at=(0.015, 0.015, up), material="grain")
        if fine:
            scene.validate()
        else:
            with pytest.raises(carom.ScenarioError, match=r"overlap at the start|behind plane|into plane"):
                scene.validate()


@pytest.mark.parametrize("projected", [False, True])
def test_a_packing_of_moreau_goes_on_where_its_positions_were_projected(projected: bool) -> None:
    """Without it a ball that fell into the floor stays there: no scene begins so, and it is said where balls are taken."""
    first = tray(method="moreau", position_projection=projected, until=0.1)
    first.sphere("a", radius=0.005, density=2500, at=(0.015, 0.015, 0.0151), material="grain")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = carom.simulate(first)
    scene = tray(until=0.005)
    if projected:
        scene.spheres_from(run)
        scene.validate()
        return
    told = r"^spheres_from: .* overlapped by up to 0\.0\d+ radii.* position_projection = true"
    with pytest.warns(carom.CaromWarning, match=told):
        scene.spheres_from(run)
    with pytest.raises(carom.ScenarioError, match="reaches"):
        scene.validate()


def test_many_balls_want_the_tolerance_of_piles() -> None:
    def advice(count: int, **run: float) -> list[str]:
        scene = tray(**run)
        scene.lattice(
            "g", counts=(1, 1, count), origin=(0.015, 0.015, 0.005), radius=0.004, density=2500, spacing=0.01,
            material="grain",
        )  # fmt: skip
        return [a.cure for a in scene.validate() if a.key == "run.pile_tolerance"]

    [cure] = advice(100, pile_tolerance=1e-7)
    assert cure.startswith("pile_tolerance = 0.0001;")
    assert advice(100, pile_tolerance=1e-4) == advice(99, pile_tolerance=1e-7) == []


def test_a_batch_starts_from_a_settled_pile_as_a_run_does(settled: carom.Result) -> None:
    scene = tray(until=0.01)
    scene.spheres_from(settled)
    batch = carom.simulate_batch(scene, {"g1.velocity.z": [0.0, 0.1]})
    assert batch.outcome.tolist() == ["done", "done"], batch.message
    apart = tray(until=0.01)
    for x in (0.005, 0.02):
        apart.sphere(f"at {x}", radius=0.005, density=2500, at=(x, 0.015, 0.006), material="grain")
    batch = carom.simulate_batch(apart, {"at 0.005.position.x": [0.005, 0.010001, 0.0101]})
    assert batch.outcome.tolist() == ["done", "done", "overlap"]
