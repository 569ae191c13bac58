"""Clumps in scenes, arrays and results: what needs no physics of the core."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import ScenarioError, Scene, simulate_batch
from carom.cli import main
from carom.errors import CaromError
from carom.result.clumps import Clumps, rigid
from carom.scene.assembly.arrays import identify
from carom.scene.assembly.filling import random_turns
from carom.scene.assembly.rotations import rotated
from carom.scene.tables.clumps import Clump
from carom.show.viewer.table import ball_facts

TEE = [[-0.01, 0, 0, 0.006], [0, 0, 0, 0.006], [0.01, 0, 0, 0.006], [0, 0.01, 0, 0.006], [0, 0.02, 0, 0.006]]
"""Spheres that overlap, in the shape of a T: its principal axes are its own ones."""
SKEW = [[0, 0, 0, 0.01], [0.012, 0.004, 0, 0.006], [0.0, 0.01, 0.013, 0.005]]
"""Three different ones whose principal axes are not its own."""
TURN = np.array([0.9, 0.1, 0.3, 0.2]) / np.linalg.norm([0.9, 0.1, 0.3, 0.2])


def empty(**run: Any) -> Scene:
    scene = Scene(gravity=(0, 0, 0), run={"until": 0.01, "step": 1e-4, **run})
    scene.contact("steel", "steel", friction=0.3, restitution=0.5)
    return scene


def with_clump(spheres: Any = SKEW, name: str = "grain", **keys: Any) -> Scene:
    scene = empty()
    given = {"density": 7800, "position": (0.1, 0.2, 0.3), "orientation": TURN, "velocity": (0.1, -0.2, 0.3),
             "angular_velocity": (3, 5, 7), "material": "steel"}  # fmt: skip
    scene.clump(name, spheres=spheres, **{**given, **keys})
    return scene


# ------------------------------------------------------------------------------------------------ scene and arrays


def test_balls_are_placed_and_move_as_parts_of_a_rigid_body() -> None:
    scene = with_clump()
    model = scene.to_model()
    (clump,) = model["clumps"]
    assert clump["balls"] == (0, 3)
    assert scene.names == ["grain1", "grain2", "grain3"]
    local = np.array(SKEW)
    assert model["position"] == pytest.approx(
        np.array([0.1, 0.2, 0.3]) + rotated(TURN, local[:, :3]), abs=1e-16
    )
    assert model["radius"].tolist() == local[:, 3].tolist()
    arm = model["position"] - clump["position"]
    assert model["velocity"] == pytest.approx(
        np.array([0.1, -0.2, 0.3]) + np.cross([3, 5, 7], arm), abs=1e-16
    )
    assert model["angular_velocity"].tolist() == [[3, 5, 7]] * 3
    assert model["orientation"] == pytest.approx(np.tile(TURN, (3, 1)), abs=1e-15)
    volumes = local[:, 3] ** 3
    assert model["mass"] == pytest.approx(clump["mass"] * volumes / volumes.sum(), rel=1e-14)
    assert clump["velocity"] == [0.1, -0.2, 0.3]
    assert clump["angular_velocity"] == [3, 5, 7]


def test_the_principal_axes_carry_the_tensor() -> None:
    scene = with_clump()
    (clump,) = scene.to_model()["clumps"]
    body = scene.clumps[0].body()
    assert body.axes != (1.0, 0.0, 0.0, 0.0)
    xx, yy, zz, xy, xz, yz = body.inertia
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    frame = rotated(TURN, np.eye(3)).T  # own to fixed axes
    axes = rotated(np.array(clump["orientation"]), np.eye(3)).T
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-14)
    fixed = axes @ np.diag(clump["inertia"]) @ axes.T
    assert fixed == pytest.approx(frame @ own @ frame.T, abs=1e-14 * np.trace(own))


def test_density_and_mass_say_the_same() -> None:
    by_density = with_clump().clumps[0].body()
    by_mass = with_clump(density=None, mass=by_density.mass).clumps[0].body()
    assert by_mass == by_density
    one = with_clump([[0, 0, 0, 0.01]], density=None, mass=2.0).clumps[0].body()
    assert one.inertia == pytest.approx((0.4 * 2.0 * 1e-4,) * 3 + (0, 0, 0), rel=1e-14)
    assert one.centre == (0.0, 0.0, 0.0)


def test_a_given_inertia_and_centre_are_taken() -> None:
    centre = (0.001, -0.002, 0.003)
    scene = with_clump(density=None, mass=0.02, inertia=("3 g mm^2", 4e-9, 5e-9), centre=centre)
    (clump,) = scene.to_model()["clumps"]
    assert clump["inertia"] == [3e-9, 4e-9, 5e-9]
    assert clump["orientation"] == pytest.approx(TURN, abs=1e-15)
    assert clump["position"] == pytest.approx(
        np.array([0.1, 0.2, 0.3]) + rotated(TURN, np.array(centre)), abs=1e-16
    )
    six = with_clump(density=None, mass=0.02, inertia=[3e-6, 4e-6, 5e-6, 1e-7, -2e-7, 3e-7])
    assert six.clumps[0].body().inertia == (3e-6, 4e-6, 5e-6, 1e-7, -2e-7, 3e-7)
    assert six.clumps[0].body().centre == pytest.approx(with_clump().clumps[0].body().centre, abs=1e-18)


def test_clumps_stand_behind_lattices_and_before_inflows() -> None:
    scene = empty()
    scene.clump("c", spheres=TEE, mass=1, material="steel", at=(5, 0, 0))
    scene.inflow("in", count=2, seed=1, radius=0.01, mass=1, material="steel",
                 region={"low": (8, 8, 8), "high": (9, 9, 9)})  # fmt: skip
    scene.lattice("l", counts=(2, 1, 1), origin=(1, 0, 0), radius=0.01, mass=1, material="steel")
    scene.packing(
        "p", density=1000, seed=1, count=2, diameter=0.01, low=(2, 0, 0), high=(3, 1, 1), material="steel"
    )
    scene.sphere("s", radius=0.01, mass=1, position=(0, 0, 0), material="steel")
    names = ["s", "p1", "p2", "l1", "l2", "c1", "c2", "c3", "c4", "c5", "in1", "in2"]
    assert scene.names == names
    assert scene.to_model()["clumps"][0]["balls"] == (5, 10)
    resolved = scene.resolved()
    assert resolved.names == names
    assert len(resolved.clumps) == 1
    assert identify(resolved.to_model()) == identify(scene.to_model())


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("grain", "sphere"),
        ("grain", "plane"),
        ("grain", "clump"),
        ("b3", "lattice"),  # its third ball
        ("rod2-", "inflow"),  # its second clump
    ],
)
def test_no_ball_wall_or_other_clump_has_the_name_of_a_clump(name: str, other: str) -> None:
    """What was called by it was the ball; the clump had no part in it."""
    more = {
        "sphere": f'[[sphere]]\nname = "{name}"\nradius = 0.01\nmass = 1\nposition = [1, 0, 0]',
        "plane": f'[[plane]]\nname = "{name}"\npoint = [0, 0, -9]\nnormal = [0, 0, 1]',
        "clump": f'[[clump]]\nname = "{name}"\nspheres = [[0, 0, 0, 0.01]]\nmass = 1\nposition = [1, 0, 0]',
        "lattice": '[[lattice]]\nname = "b"\ncounts = [4, 1, 1]\norigin = [1, 0, 0]\nradius = 0.01\nmass = 1',
        "inflow": '[[inflow]]\nname = "rod"\ncount = 2\nseed = 1\nmass = 1\nspheres = [[0, 0, 0, 0.01]]\n'
        "region = { low = [2, 2, 2], high = [3, 3, 3] }",
    }[other]
    made = Scene.from_toml(f'{with_clump(name=name).to_toml()}\n{more}\nmaterial = "steel"\n')
    with pytest.raises(ScenarioError) as caught:
        made.validate()
    causes = [problem.cause for problem in caught.value.problems]
    what = "clump" if other == "plane" else "sphere"
    alike = f'there are two spheres "{name}1"'  # two clumps of a name have balls of a name
    assert causes == [alike if other in ("clump", "inflow") else f'there is already a {what} "{name}"']


def test_a_clump_may_be_called_as_a_ball_of_another_and_is_meant_then() -> None:
    scene = Scene()
    scene.contact("steel", "steel", friction=0.1, restitution=0.5)
    for k in range(12):
        scene.clump(f"c{k}", spheres=TEE, mass=1, at=(k, 0, 0), material="steel")
    scene.run.until, scene.run.step = 1e-3, 1e-3
    scene.validate()
    scene.load("c11", force=(1, 0, 0))
    with pytest.raises(ScenarioError, match=r'"c11" is a clump.*give it another name to mean the ball "c11"'):
        scene.validate()


def test_calls_refuse_the_name_of_a_clump_at_once() -> None:
    scene = with_clump()
    copied = copy.copy(scene)
    calls: list[Callable[[Scene], Any]] = [
        lambda s: s.sphere("grain", radius=0.01, mass=1, at=(1, 0, 0), material="steel"),
        lambda s: s.plane("grain", point=(0, 0, -1), normal=(0, 0, 1), material="steel"),
        lambda s: s.clump("grain", spheres=TEE, mass=1, at=(1, 0, 0), material="steel"),
    ]
    for made in (scene, copied):
        for call in calls:
            with pytest.raises(ScenarioError, match='there is already a sphere, clump or wall "grain"'):
                call(made)
        assert made == with_clump()


def test_a_scene_and_its_file_are_the_same() -> None:
    scene = with_clump()
    assert Scene.from_toml(scene.to_toml()) == scene
    resolved = Scene.from_toml(scene.to_toml(resolved=True))
    assert resolved == scene.resolved()
    assert resolved.clumps[0].density is None
    assert resolved.clumps[0].mass == scene.clumps[0].body().mass
    assert identify(resolved.to_model()) == identify(scene.to_model())
    moved = with_clump(position=(0.1, 0.2, 0.3 + 1e-12))
    assert identify(moved.to_model()) != identify(scene.to_model())


def test_lengths_may_have_units_and_parameters() -> None:
    text = with_clump([[0, 0, 0, 0.01], [0.02, 0, 0, 0.01]]).to_toml()
    assert "[0.02, 0.0, 0.0, 0.01]" in text
    given = text.replace("[0.02, 0.0, 0.0, 0.01]", '["2 cm", "= d - 0.02", 0.0, "10 mm"]')
    scene = Scene.from_toml(f"{given}\n[parameters]\nd = 0.02\n")
    assert scene.clumps[0].spheres == ((0, 0, 0, 0.01), (0.02, 0, 0, 0.01))


def test_what_a_scene_says_counts_clumps() -> None:
    assert "3 spheres, 1 clump" in repr(with_clump())
    assert "clump" not in repr(empty())
    assert "grain" in with_clump()._repr_html_()


def test_the_schema_has_clumps() -> None:
    from carom.scene.toml.schema import json_schema

    schema = json_schema()
    assert schema["$defs"]["Clump"]["oneOf"] == [{"required": ["mass"]}, {"required": ["density"]}]
    assert schema["$defs"]["Clump"]["properties"]["spheres"]["maxItems"] == 500


# --------------------------------------------------------------------------------------------------------- checks


def said(scene: Scene) -> str:
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    return str(caught.value)


def test_balls_of_one_clump_may_overlap_and_others_may_not() -> None:
    scene = with_clump(TEE, name="a")
    assert scene.validate() == []
    scene.clump("b", spheres=TEE, density=7800, material="steel", position=(0.1, 0.2, 0.3))
    assert 'spheres "a2" and "b2" overlap' in said(scene)
    scene = with_clump(TEE, name="a")
    scene.sphere("s", radius=0.01, mass=1, position=(0.1, 0.2, 0.3), material="steel")
    assert 'scene.clump["a"]: position: spheres "s" and "a1" overlap at the start' in said(scene)


def test_overlaps_across_a_period_are_found() -> None:
    scene = with_clump(TEE, orientation=None)
    scene.periodic = (0.2, 0, 0)
    scene.clump("b", spheres=TEE, density=7800, material="steel", position=(0.3, 0.2, 0.3))
    assert "overlap at the start" in said(scene)


def test_a_clump_in_a_wall_is_told() -> None:
    scene = with_clump(position=(0, 0, 0.001))
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
    assert 'scene.clump["grain"]: position: sphere "grain1" reaches' in said(scene)


def test_names_are_unique() -> None:
    scene = with_clump(name="a")
    scene.sphere("a2", radius=0.01, mass=1, position=(3, 3, 3), material="steel")
    assert 'there are two spheres "a2"; give one another name' in said(scene)


def test_a_lone_clump_needs_no_law_of_its_material_with_itself() -> None:
    scene = Scene(run={"until": 0.1})
    scene.contact("steel", "floor", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.clump("a", spheres=TEE, mass=1, material="steel", position=(0, 0, 0.05))
    assert scene.validate() == []
    scene.clump("b", spheres=TEE, mass=1, material="steel", position=(1, 0, 0.05))
    assert 'spheres "a1" and "b1" can meet' in said(scene)


def test_advice_takes_clumps_as_whole_bodies() -> None:
    """A speck of a heavy clump is no light ball, and its small inertia and rolling are not looked at."""
    scene = with_clump([[0, 0, 0, 0.01], [0.01, 0, 0, 1e-4]], density=None, mass=1.0, velocity=None,
                       angular_velocity=None)  # fmt: skip
    assert scene.to_model()["mass"].min() < 1e-5
    scene.contacts[0].rolling_radius = 0.005
    assert scene.validate() == []
    scene.sphere("light", radius=0.02, mass=1e-5, position=(3, 3, 3), material="steel")
    (advice,) = scene.validate()
    assert "1e+05 times the mass" in str(advice)


def test_balls_that_were_overridden_in_a_batch_are_refused() -> None:
    scene = with_clump()
    scene.sphere("free", radius=0.01, mass=1, position=(3, 3, 3), material="steel")
    for key in ("grain1.velocity.x", "grain2.mass", "grain1.position"):
        shape = (2, 3) if key.endswith("position") else (2,)
        with pytest.raises(CaromError, match='is a part of clump "grain"'):
            simulate_batch(scene, {key: np.ones(shape)})
    with pytest.raises(CaromError, match="the scene has clumps"):
        simulate_batch(scene, {"velocity": np.ones((2, 4, 3))})


# --------------------------------------------------------------------------------------------------------- results


@pytest.fixture(scope="module")
def result() -> carom.Result:
    scene = with_clump()
    scene.sphere("free", radius=0.01, mass=0.5, position=(3, 3, 3), velocity=(1, 2, 3), material="steel",
                 angular_velocity=(4, 5, 6))  # fmt: skip
    return carom.simulate(scene, every=10)


def test_a_result_has_the_pose_of_each_clump(result: carom.Result) -> None:
    clump = result.clumps["grain"]
    table = result.scene.clumps[0]
    assert list(result.clumps) == ["grain"]
    assert clump.balls == ["grain1", "grain2", "grain3"]
    assert clump.numbers.tolist() == [1, 2, 3]
    assert clump.orientation[0] == pytest.approx(TURN, abs=1e-15)
    assert clump.origin[0] == pytest.approx([0.1, 0.2, 0.3], abs=1e-15)
    assert clump.velocity[0].tolist() == [0.1, -0.2, 0.3]
    assert clump.angular_velocity[0].tolist() == [3, 5, 7]
    assert clump.centre.tolist() == list(table.body().centre)
    local = np.array(SKEW)[:, :3]
    for k in range(len(result.time)):
        placed = clump.origin[k] + rotated(clump.orientation[k], local)
        assert result.position[k, 1:] == pytest.approx(placed, abs=1e-15)
        spun = clump.velocity[k] + np.cross(
            clump.angular_velocity[k], result.position[k, 1:] - clump.position[k]
        )
        assert result.velocity[k, 1:] == pytest.approx(spun, abs=1e-14)
    xx, yy, zz, xy, xz, yz = table.body().inertia
    assert clump.inertia == pytest.approx(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), abs=1e-20)
    assert "3 balls" in repr(clump)
    assert repr(result.clumps) == "<1 clump: grain>"
    with pytest.raises(KeyError, match="no clump is called 'grai'"):
        result.clumps["grai"]


def test_energy_and_momentum_count_the_clump_as_one_body(result: carom.Result) -> None:
    clump = result.clumps["grain"]
    frame = rotated(clump.orientation[0], np.eye(3)).T
    spin = clump.angular_velocity[0]
    tensor = frame @ clump.inertia @ frame.T
    assert clump.angular_momentum[0] == pytest.approx(tensor @ spin, rel=1e-12)
    assert clump.rotational_energy[0] == pytest.approx(0.5 * spin @ tensor @ spin, rel=1e-12)
    own = 0.5 * clump.mass * (clump.velocity[0] ** 2).sum() + clump.rotational_energy[0]
    assert clump.kinetic_energy[0] == pytest.approx(own, rel=1e-14)
    ball = 0.5 * 0.5 * 14 + 0.5 * 0.4 * 0.5 * 1e-4 * 77
    assert result.kinetic_energy[0].sum() == pytest.approx(own + ball, rel=1e-13)
    assert result.kinetic_energy[0, 0] == pytest.approx(ball, rel=1e-14)
    assert result.energy.kinetic[0] == pytest.approx(own + ball, rel=1e-12)
    assert result.momentum[0] == pytest.approx(
        clump.mass * clump.velocity[0] + 0.5 * np.array([1, 2, 3]), rel=1e-13
    )
    about = result.sel(body=["grain1", "grain2", "grain3"]).angular_momentum_about(clump.position[0])
    assert about[0] == pytest.approx(clump.angular_momentum[0], rel=1e-9)
    part = result.sel(slice(0.005, 0.01), ["grain3", "free"])
    assert part.kinetic_energy == pytest.approx(result.kinetic_energy[5:][:, [3, 0]], rel=1e-14)


def test_a_view_has_the_clumps() -> None:
    scene = with_clump()
    seen: list[tuple[Any, float]] = []
    result = carom.simulate(
        scene,
        every=10,
        callback=lambda view: seen.append((view.clumps, view.kinetic_energy)),
        callback_every=50,
    )
    assert [rows.shape for rows, _ in seen] == [(1, 13)] * 2
    rows, energy = seen[-1]
    clump = result.clumps["grain"]
    assert rows[0, :3].tolist() == clump.position[-1].tolist()
    assert energy == pytest.approx(clump.kinetic_energy[-1], rel=1e-13)
    without = empty()
    without.sphere("s", radius=0.01, mass=1, position=(0, 0, 0), material="steel")
    shapes: list[tuple[int, ...]] = []
    carom.simulate(without, callback=lambda view: shapes.append(view.clumps.shape), callback_every=100)
    assert shapes == [(0, 13)]


def test_memory_and_file_hold_the_same(result: carom.Result, tmp_path: Path) -> None:
    saved = result.save(tmp_path / "run")
    for name in ("position", "orientation", "velocity", "angular_momentum"):
        np.testing.assert_array_equal(
            getattr(saved.clumps["grain"], name), getattr(result.clumps["grain"], name)
        )
    np.testing.assert_array_equal(saved.clumps["grain"].inertia, result.clumps["grain"].inertia)
    assert saved.scene == result.scene
    assert len(Clumps(result, {"name": []})) == 0


def test_a_run_without_clumps_has_none() -> None:
    scene = empty()
    scene.sphere("s", radius=0.01, mass=1, position=(0, 0, 0), material="steel")
    result = carom.simulate(scene)
    assert len(result.clumps) == 0
    assert "clumps" not in result._segments.columns("frames")


@pytest.mark.parametrize(
    ("column", "value", "told"),
    [
        ("first", 3, "a clump has balls that are not there"),
        ("count", 0, "a clump has balls that are not there"),
        ("mass", -1.0, "not finite, or not above 0"),
        ("axes", np.nan, "not finite, or not above 0"),
    ],
)
def test_a_damaged_table_is_told(result: carom.Result, column: str, value: float, told: str) -> None:
    table = {name: np.array(values) for name, values in result._segments.static("clumps").items()}
    table[column][0] = value
    with pytest.raises(CaromError, match=told):
        Clumps(result, table)


def test_spheres_from_takes_clumps_over(result: carom.Result) -> None:
    scene = empty()
    taken = scene.spheres_from(result)
    assert [type(one).__name__ for one in taken] == ["Sphere", "Clump"]
    old, new = result.clumps["grain"], carom.simulate(scene, every=10).clumps["grain"]
    assert new.mass == old.mass
    assert new.position[0] == pytest.approx(old.position[-1], abs=1e-15)
    assert new.orientation[0] == pytest.approx(old.orientation[-1], abs=1e-15)
    assert new.velocity[0].tolist() == old.velocity[-1].tolist()
    assert new.angular_velocity[0].tolist() == old.angular_velocity[-1].tolist()
    assert isinstance(scene.clumps[0], Clump)


def test_a_clump_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    scene = with_clump()
    whole = carom.simulate(scene, every=10, until=0.02)
    carom.simulate(scene, every=10, out=tmp_path / "run", checkpoint_steps=50)
    resumed = carom.resume(tmp_path / "run", until=0.02)
    np.testing.assert_array_equal(resumed.clumps["grain"].position, whole.clumps["grain"].position)
    np.testing.assert_array_equal(resumed.clumps["grain"].orientation, whole.clumps["grain"].orientation)


def test_the_commands_count_clumps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = with_clump()
    scene.to_toml(tmp_path / "grain.toml")
    carom.simulate(scene, out=tmp_path / "run")

    def printed(*arguments: str) -> str:
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert end.value.code == 0
        return capsys.readouterr().out

    assert json.loads(printed("check", str(tmp_path / "grain.toml"), "--json"))["clumps"] == 1
    assert json.loads(printed("info", str(tmp_path / "run"), "--json"))["clumps"] == 1
    assert "principal moments" in printed("info", str(tmp_path / "run"))


def test_pictures_give_the_balls_of_a_clump_one_colour(result: carom.Result) -> None:
    assert rigid(result).tolist() == [0, 1, 1, 1]
    shown = ball_facts(result, None, 1)["balls"]
    assert len({colour for _, colour, _ in shown[1:]}) == 1
    assert shown[0][1] != shown[1][1]
    assert {label for _, _, label in shown} == {""}
    assert len(ball_facts(result, None, 2)["balls"]) == 2


def test_a_packing_of_clumps() -> None:
    rod = [[-0.005, 0, 0, 0.005], [0.005, 0, 0, 0.005]]
    keys = {
        "spheres": rod,
        "material": "glass",
        "density": 2500,
        "seed": 3,
        "low": (0, 0, 0),
        "high": (0.06, 0.06, 0.1),
    }

    def made(**more: float) -> carom.Scene:
        scene = carom.Scene(run={"until": 1.0})
        scene.contact("glass", "glass", friction=0.5, restitution=0.1)
        scene.clump_packing("rod", **keys, **more)
        return scene

    one, two = made(fraction=0.1), made(fraction=0.1)
    volume = sum(c.body().mass for c in one.clumps) / 2500
    assert volume == pytest.approx(0.1 * 0.06 * 0.06 * 0.1, rel=0.03)
    assert one.to_toml() == two.to_toml()
    one.validate()
    assert len({c.orientation for c in one.clumps}) == len(one.clumps)
    centres = np.concatenate([c.centres() for c in one.clumps])
    assert centres.min() > 0.005 - 1e-9
    assert (centres < [0.055 + 1e-9, 0.055 + 1e-9, 0.095 + 1e-9]).all()
    assert len(made(count=12).clumps) == 12
    with pytest.raises(ScenarioError, match=r"0\.5 is not within 0 and 0\.15"):
        made(fraction=0.5)


def test_turns_at_random_favour_no_direction() -> None:
    turns = random_turns(5, 4000)
    assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0)
    axis = rotated(turns, np.array([0.0, 0.0, 1.0]))
    assert np.abs(axis.mean(axis=0)).max() < 0.05
    assert (axis**2).mean(axis=0) == pytest.approx(1 / 3, abs=0.02)
