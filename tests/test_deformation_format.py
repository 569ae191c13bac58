"""Boxes that deform in scenes: TOML and Python say the same, what the core gets, and F and dF/dt F^-1 of laws."""

from __future__ import annotations

import json

import carom
import numpy as np
import pytest
from carom import ScenarioError, Scene
from carom.scene.assembly.arrays import identify
from carom.scene.tables.deformation import Deformation
from carom.scene.toml.schema import json_schema
from deformed_runs import scene

TEXT = """\
format = 1

[run]
until = 1.0
step = 1e-3

[world]
gravity = [0.0, 0.0, 0.0]
periodic = [1.0, 0.8, 1.2]

[world.deformation]
stretch = [1.0, { table = [[0.0, 1.0], [2.0, 0.9]] }, { expression = "exp(-0.1*t)" }]
shear = { polynomial = [0.0, 2.0] }
flow = "x"
gradient = "z"

[[material]]
name = "m"

[[contact]]
between = ["m", "m"]
friction = 0.1
restitution = 0.5

[[sphere]]
name = "a"
material = "m"
radius = 0.1
mass = 1.0
position = [0.0, 0.0, 0.0]
"""


def python() -> Scene:
    made = Scene(gravity=(0, 0, 0), periodic=(1.0, 0.8, 1.2), run={"until": 1.0, "step": 1e-3})
    made.material("m")
    made.contact("m", "m", friction=0.1, restitution=0.5)
    made.sphere("a", material="m", radius=0.1, mass=1.0, at=(0, 0, 0))
    made.deform(
        stretch=(1.0, {"table": [[0.0, 1.0], [2.0, 0.9]]}, "exp(-0.1*t)"),
        shear={"polynomial": [0.0, 2.0]},
        flow="x",
        gradient="z",
    )
    return made


def test_a_file_and_a_program_say_the_same_and_survive_a_round_trip() -> None:
    read, made = Scene.from_toml(TEXT), python()
    assert read == made
    for resolved in (False, True):
        assert Scene.from_toml(made.to_toml(resolved=resolved)).world == made.world
    assert read.validate() == []


def test_the_schema_knows_the_table() -> None:
    schema = json_schema()
    keys = schema["$defs"]["Deformation"]["properties"]
    assert set(keys) == {"stretch", "shear", "flow", "gradient"}
    assert keys["flow"]["enum"] == ["x", "y", "z"]
    json.dumps(schema)


def test_the_core_gets_laws_and_numbers_of_axes() -> None:
    assert python().to_model()["deformation"] == {
        "stretch": (None, ("table", [[0.0, 1.0], [2.0, 0.9]]), ("expression", "exp(-0.1*t)")),
        "shear": ("polynomial", [0.0, 2.0]),
        "flow": 0,
        "gradient": 2,
    }
    only = scene(stretch=(1, 1, "1 - 0.1*t")).to_model()["deformation"]
    assert only["shear"] is None
    assert (only["flow"], only["gradient"]) == (0, 1)


def test_where_nothing_deforms_the_core_gets_nothing() -> None:
    assert "deformation" not in scene(stretch=(1, 1, 1)).to_model()
    assert "deformation" not in scene(shear=0.0, flow="x", gradient="y").to_model()
    assert identify(scene(stretch=(1, 1, 1)).to_model()) == identify(scene().to_model())


def test_a_run_of_another_deformation_is_another_run() -> None:
    laws = ("t", "2*t")
    marks = {identify(scene(shear=law, flow="x", gradient="y").to_model()) for law in laws}
    marks.add(identify(scene(shear="t", flow="y", gradient="x").to_model()))
    assert len({*marks, identify(scene().to_model())}) == 4


def test_the_velocity_gradient_is_the_rate_of_f_over_f() -> None:
    made = Deformation(
        stretch=[{"expression": "exp(-0.3*t)"}, 1.0, {"expression": "exp(0.2*t)"}],  # type: ignore[arg-type]
        shear={"expression": "0.5*t"},
        flow="x",
        gradient="z",
    )
    t, h = 0.8, 1e-5
    f = made.gradient_at(t)
    assert f == pytest.approx(np.array([[np.exp(-0.24), 0, 0.4], [0, 1, 0], [0, 0, np.exp(0.16)]]))
    # That of the step from then on.
    rate = (made.gradient_at(t + h) - f) / h
    assert made.velocity_gradient(t, h) @ f == pytest.approx(rate, abs=1e-9)


def test_what_python_says_wrong_names_the_call() -> None:
    made = scene()
    for given, cause in (
        ({"shear": "t", "flow": "x"}, "shear is given without gradient"),
        ({"stretch": 2.0}, "expected a list of 3 numbers or laws"),
        ({"stretch": (1, 1, "t")}, "must be positive at t = 0"),
        ({"shear": "t", "flow": "x", "gradient": "w"}, "unknown value"),
        ({"strech": (1, 1, 1)}, "stretch"),
    ):
        with pytest.raises(ScenarioError, match=f"Scene.deform.*{cause}"):
            made.deform(**given)  # type: ignore[arg-type]
    assert made.world.deformation is None


def test_a_scene_whose_period_is_taken_away_says_so() -> None:
    made = scene(shear="t", flow="x", gradient="y")
    made.periodic = None
    with pytest.raises(ScenarioError, match="deformation is given without periodic"):
        made.validate()


@pytest.mark.parametrize("wall", ["plane", "tube"])
def test_walls_that_follow_the_box_are_taken_and_others_are_not(wall: str) -> None:
    def add(made: carom.Scene) -> None:
        made.contact("m", "smooth", friction=0, restitution=0.5)
        about = {"material": "smooth"}
        if wall == "plane":
            made.plane("floor", point=(0, 0, 1.9), normal=(0, 0, 1), **about)
        else:
            made.cylinder("tube", point=(0.2, 0.5, 2.6), axis=(1, 0, 0), radius=2, inside=True, **about)

    repeats = (1, 1, 0) if wall == "plane" else (1, 0, 0)
    for deform in ({"stretch": (0.99, 1, 1)}, {"shear": "t", "flow": "x", "gradient": "y"}):
        deform = {k: ("1 - 0.1*t", 1, 1) if k == "stretch" else v for k, v in deform.items()}
        made = scene(repeats=repeats, **deform)
        add(made)
        if wall == "tube" and "shear" in deform:  # it lies along one axis, and shear needs two that repeat
            with pytest.raises(
                ScenarioError, match="gradient is along y, along which the world does not repeat"
            ):
                made.validate()
        else:
            made.validate()
    made = scene(shear="t", flow="x", gradient="y")
    add(made)
    with pytest.raises(ScenarioError, match="is not the same from period to period"):
        made.validate()


def test_a_clump_that_a_shorter_box_would_let_meet_itself() -> None:
    made = scene(stretch=("1 - 3*t", 1, 1))
    made.clump(
        "rod", spheres=[(-0.25, 0, 0, 0.02), (0.25, 0, 0, 0.02)], mass=1, material="m", at=(0, 0.5, 3.1)
    )
    with pytest.raises(ScenarioError, match=r"the period along x 0\.4 m at t = 0\.2 s"):
        made.validate()
