"""Loads, springs, drag and laws of one variable in scenario files and in Python: what goes to the core, and mistakes."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import carom
import jsonschema
import numpy as np
import pytest
from carom import CaromError, ScenarioError, Scene
from carom.result.directory import RunDir
from carom.run import changes
from carom.scene.assembly.arrays import identify
from carom.scene.tables.laws import slope_at, value_at
from carom.scene.toml.literal import literal
from carom.scene.toml.schema import json_schema
from hypothesis import given
from hypothesis import strategies as st

ZERO = ("constant", 0.0)


def balls(**run: Any) -> Scene:
    """Two balls of 1 kg at (0, 0, 1) and (0, 0, 2), `a` turned by 90 degrees about x."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 1.0, **run})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    half = math.sqrt(0.5)
    scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 1), orientation=(half, half, 0, 0), material="m")
    scene.sphere("b", radius=0.1, mass=1, at=(0, 0, 2), material="m")
    return scene


def loads_of(scene: Scene) -> list[dict[str, Any]]:
    assert scene.validate() == []
    return scene.to_model()["loads"]


class TestForTheCore:
    def test_forces_and_torques(self) -> None:
        scene = balls()
        scene.load("b", force=("5 N", 0, {"expression": "20*t"}))
        scene.load("a", torque=["1 N m", {"polynomial": [1, 2]}, {"table": np.array([[0, 0], [1, 2]])}])
        assert loads_of(scene) == [
            {
                "kind": "force",
                "body": 1,
                "force": [("constant", 5.0), ZERO, ("expression", "20*t")],
                "torque": [ZERO, ZERO, ZERO],
            },
            {
                "kind": "force",
                "body": 0,
                "force": [ZERO, ZERO, ZERO],
                "torque": [
                    ("constant", 1.0),
                    ("polynomial", [1.0, 2.0]),
                    ("table", [[0.0, 0.0], [1.0, 2.0]]),
                ],
            },
        ]

    def test_a_spring_between_centres(self) -> None:
        scene = balls()
        scene.spring("a", "b", stiffness="100 N/m", damping="0.5 N s/m")
        (spring,) = loads_of(scene)
        assert spring == {
            "kind": "spring",
            "a": 0,
            "b": 1,
            "arm_a": [0, 0, 0],
            "arm_b": [0, 0, 0],
            "stiffness": 100.0,
            "damping": 0.5,
            "rest_length": 1.0,
        }

    @pytest.mark.parametrize("turned", [False, True])
    def test_a_spring_to_the_ground_has_its_arm_in_the_body(self, turned: bool) -> None:
        scene = balls()
        names, points = ("a", "ground"), [(0, 0.1, 1), (0, 3.1, 5)]
        if turned:
            names, points = names[::-1], points[::-1]
        scene.spring(*names, points=points, stiffness=1)
        (spring,) = loads_of(scene)
        assert (spring["a"], spring["b"]) == (0, -1)
        np.testing.assert_allclose(
            spring["arm_a"], [0, 0, -0.1], atol=1e-16
        )  # y of the world is -z of the body
        assert spring["arm_b"] == [0, 3.1, 5]
        assert spring["rest_length"] == pytest.approx(5, rel=1e-15)

    def test_rest_length_may_be_given(self) -> None:
        scene = balls()
        scene.spring("a", "b", damping=1, rest_length="50 cm")
        assert loads_of(scene)[0]["rest_length"] == 0.5

    def test_drag_on_all_is_drag_on_each(self) -> None:
        scene = balls()
        scene.lattice("l", counts=(2, 1, 1), origin=(5, 0, 0), radius=0.1, mass=1, material="m")
        scene.drag("all", translation="0.1 kg/s", rotation="1e-4 N m s")
        scene.drag("l2", rotation=2)
        drags = loads_of(scene)
        assert [d["body"] for d in drags] == [0, 1, 2, 3, 3]
        assert drags[0] == {"kind": "drag", "body": 0, "translation": 0.1, "rotation": 1e-4}
        assert (drags[4]["translation"], drags[4]["rotation"]) == (0.0, 2.0)

    def test_friction_laws_stand_beside_the_constants(self) -> None:
        scene = balls()
        law = {"expression": "9.951e-3 + 0.108*exp(-1.088*v)"}
        scene.contact("m", "n", friction=law, restitution=0)
        assert scene.validate() == []
        model = scene.to_model()
        np.testing.assert_array_equal(model["friction"], [0.1, 0.0])
        assert model["friction_law"] == [None, ("expression", law["expression"])]
        assert Scene.from_toml(scene.to_toml()).to_model()["friction_law"] == model["friction_law"]


class TestText:
    def test_nothing_is_lost(self) -> None:
        scene = everything()
        text = scene.to_toml()
        again = Scene.from_toml(text)
        assert again == scene
        assert again.to_toml() == text
        resolved = Scene.from_toml(scene.to_toml(resolved=True))
        assert resolved.to_model()["loads"] == again.to_model()["loads"] == scene.to_model()["loads"]
        assert 'force = [0.0, 5.0, { expression = "20*t" }]' in text
        assert "torque = [{ polynomial = [1.0, 2.0] }, 0.0, { table = [[0.0, 0.0], [1.0, 2.0]] }]" in text

    def test_satisfies_the_published_schema(self) -> None:
        schema = jsonschema.Draft202012Validator(json_schema())
        raw = tomllib.loads(everything().to_toml())
        schema.validate(raw)
        for section, wrong in (
            ("load", {"on": "a"}),
            ("load", {"on": "a", "force": [0, 0]}),
            ("load", {"on": "a", "force": [0, 0, {"expresion": "t"}]}),
            ("load", {"on": "a", "force": [0, 0, {"expression": "t", "polynomial": [1]}]}),
            ("spring", {"between": ["a", "b"]}),
            ("spring", {"between": ["a", "b"], "stiffness": -1}),
            ("drag", {"on": "all"}),
        ):
            assert not schema.is_valid({**raw, section: [wrong]}), wrong

    @given(st.recursive(st.floats() | st.booleans() | st.integers() | st.text(), st.lists, max_leaves=9))
    def test_any_value_reads_back(self, value: Any) -> None:
        line = f"x = {literal(value)}"
        assert "\n" not in line
        assert repr(tomllib.loads(line)["x"]) == repr(value)

    def test_repr_counts_them(self) -> None:
        assert "0 planes, 2 contact laws, 5 loads; 1000 steps" in repr(everything())


def everything() -> Scene:
    scene = balls()
    scene.contact("m", "n", friction={"table": [[0, 0.2], [1, 0.1]]}, restitution=0)
    scene.load("a", force=(0, 5, {"expression": "20*t"}))
    scene.load("b", torque=({"polynomial": [1, 2]}, 0, {"table": [[0, 0], [1, 2]]}))
    scene.spring("b", "a", points=[(0, 0, 1.9), (0, 0, 1.1)], stiffness=100, rest_length=0)
    scene.spring("b", "ground", points=[(0, 0, 1.9), (0, 0, 0)], damping=1)
    scene.drag("all", translation=0.1)
    return scene


HEAD = """\
format = 1
[run]
until = 1.0
[world]
gravity = [0.0, 0.0, 0.0]
[[material]]
name = "m"
[[contact]]
between = ["m", "m"]
friction = 0.1
restitution = 0.5
[[plane]]
name = "bed"
material = "m"
point = [0.0, 0.0, -9.0]
normal = [0.0, 0.0, 1.0]
[[sphere]]
name = "ball"
material = "m"
radius = 0.1
mass = 1.0
position = [0.0, 0.0, 1.0]
[[sphere]]
name = "other"
material = "m"
radius = 0.1
mass = 1.0
position = [0.0, 0.0, 2.0]
"""

# what stands below (its first line is line 29), then what the one message must hold
MISTAKES: dict[str, tuple[str, ...]] = {
    "unknown sphere": (
        '[[load]]\non = "bal"\nforce = [0, 0, 1]',
        ':30: load "bal" on: unknown sphere "bal"; did you mean ball?',
    ),
    "plane": (
        '[[load]]\non = "bed"\nforce = [0, 0, 1]',
        '"bed" is a plane, and a load acts on spheres; known: ball, other',
    ),
    "ground": ('[[load]]\non = "ground"\nforce = [0, 0, 1]', '"ground" is no sphere; known: ball, other'),
    "all": ('[[load]]\non = "all"\nforce = [0, 0, 1]', 'unknown sphere "all"'),
    "no load": ('[[load]]\non = "ball"', ':29: load "ball": neither force nor torque is given; add force ='),
    "one number": (
        '[[load]]\non = "ball"\nforce = 5',
        ':31: load "ball" force: expected a list of 3 numbers or laws, found 5',
    ),
    "wrong unit": (
        '[[load]]\non = "ball"\nforce = [0, 0, "1 N m"]',
        'force: number 3: expected a force, found "1 N m", a moment; write a number in N',
    ),
    "wrong unit of a torque": (
        '[[load]]\non = "ball"\ntorque = ["1 N", 0, 0]',
        'expected a moment, found "1 N", a force',
    ),
    "stranger in a text": (
        '[[load]]\non = "ball"\nforce = [0, 0, "20*v"]',
        ':31: load "ball" force: number 3: unknown name "v" in "20*v"; the variable is called t',
    ),
    "unknown form": (
        '[[load]]\non = "ball"\nforce = [0, 0, { expresion = "20*t" }]',
        '"expresion" is no kind of law; did you mean expression?',
    ),
    "two forms": (
        '[[load]]\non = "ball"\nforce = [0, 0, { expression = "t", polynomial = [1] }]',
        "number 3: a law has one key, found expression and polynomial",
    ),
    "no form": ('[[load]]\non = "ball"\nforce = [0, 0, {}]', "a law has one key, found none; give one of"),
    "misspelt expression": (
        '[[load]]\non = "ball"\nforce = [\n  0,\n  0,\n  { expression = "20*" }]',
        ':34: load "ball" force: number 3: cannot read "20*": column 4',
    ),
    "unknown function": (
        '[[load]]\non = "ball"\nforce = [0, 0, { expression = "sine(t)" }]',
        'cannot read "sine(t)": column 1',
    ),
    "other variable": (
        '[[load]]\non = "ball"\nforce = [0, 0, { expression = "20*x" }]',
        'unknown name "x" in "20*x"; the variable is called t',
    ),
    "expression that is a number": (
        '[[load]]\non = "ball"\nforce = [0, 0, { expression = 20 }]',
        "expected a formula, found 20",
    ),
    "no value at the start": (
        '[[load]]\non = "ball"\nforce = [0, 0, { expression = "1/t" }]',
        "has no finite value at t = 0: column 2",
    ),
    "empty polynomial": (
        '[[load]]\non = "ball"\nforce = [0, 0, { polynomial = [] }]',
        "expected 1 to 100 coefficients, found 0",
    ),
    "bad coefficient": (
        '[[load]]\non = "ball"\nforce = [0, 0, { polynomial = [1, "2 N"] }]',
        'force: number 3: number 2: expected a number, found "2 N"',
    ),
    "table of one point": (
        '[[load]]\non = "ball"\nforce = [0, 0, { table = [[0, 1]] }]',
        "expected 2 to 100000 points, found 1",
    ),
    "table that does not rise": (
        '[[load]]\non = "ball"\nforce = [0, 0, { table = [[0, 1], [2, 1], [2, 3]] }]',
        "t must rise from point to point, found 2 after 2",
    ),
    "table of triples": (
        '[[load]]\non = "ball"\nforce = [0, 0, { table = [[0, 1], [2, 1, 3]] }]',
        "number 3: number 2: expected a list of 2 numbers, found a list of 3",
    ),
    "no spring": (
        '[[spring]]\nbetween = ["ball", "other"]',
        ':29: spring "ball"-"other": stiffness and damping are both zero',
    ),
    "negative spring": (
        '[[spring]]\nbetween = ["ball", "other"]\nstiffness = -1',
        "stiffness: must be zero or positive, found -1",
    ),
    "stiffness of another unit": (
        '[[spring]]\nbetween = ["ball", "other"]\nstiffness = "1 N m"',
        'expected a stiffness, found "1 N m", a moment; write a number in N/m',
    ),
    "spring to a plane": (
        '[[spring]]\nbetween = ["ball", "bed"]\nstiffness = 1',
        '"bed" is a plane, and a spring acts on spheres; planes never move: write "ground"',
    ),
    "spring without ground point": (
        '[[spring]]\nbetween = ["ground", "ball"]\nstiffness = 1',
        "points: is missing: a point of the ground must be given; add points = [[point of ground], [point of ball]]",
    ),
    "spring to itself": (
        '[[spring]]\nbetween = ["ball", "ball"]\nstiffness = 1',
        '"ball" stands on both sides',
    ),
    "spring in a point": (
        '[[spring]]\nbetween = ["ball", "other"]\nstiffness = 1\nrest_length = 1\npoints = [[0, 0, 1.5], [0, 0, 1.5]]',
        ':33: spring "ball"-"other" points: both ends of the spring are at the same point',
    ),
    "no drag": (
        '[[drag]]\non = "all"',
        "translation and rotation are both zero; give one, as translation = 0.1",
    ),
    "drag of another unit": (
        '[[drag]]\non = "all"\nrotation = "1 N s/m"',
        'expected a rotational damping, found "1 N s/m", a damping',
    ),
    "function in a file": (
        '[[load_function]]\nname = "wind"',
        ':29: load_function "wind": the Python function "wind" is not there: no file can hold it',
        'scene.load_function(f, name="wind")',
    ),
    "friction below zero": (
        '[[material]]\nname = "n"\n[[contact]]\nbetween = ["m", "n"]\nrestitution = 0\nfriction = { expression = "v - 1" }',
        ':34: contact "m"-"n" friction: must be zero or positive at v = 0, found -1',
    ),
    "friction of the time": (
        '[[material]]\nname = "n"\n[[contact]]\nbetween = ["m", "n"]\nrestitution = 0\nfriction = { expression = "0.1*t" }',
        'unknown name "t" in "0.1*t"; the variable is called v',
    ),
    "friction of a unit": (
        '[[material]]\nname = "n"\n[[contact]]\nbetween = ["m", "n"]\nrestitution = 0\nfriction = "0.1 mm"',
        'expected a number, found "0.1 mm"',
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES, ids=str)
def test_each_mistake_has_one_message_with_place_and_cure(mistake: str, tmp_path: Path) -> None:
    tables, *expected = MISTAKES[mistake]
    path = tmp_path / "x.toml"
    path.write_text(HEAD + tables + "\n", encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(path).validate()
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{path}:")
    assert "; " in line
    for part in expected:
        assert part in line


def test_the_scenario_that_the_mistakes_spoil_is_good() -> None:
    assert Scene.from_toml(HEAD).validate() == []


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.load("a", force=(0, 0)), 'Scene.load("a"): force: expected a list of 3 numbers or laws'),
        (lambda s: s.load("a", force=(0, 0, math.sin)), "number 3: expected a number or a law, found a function; a Python"),
        (lambda s: s.load("a", force=(0, 0, math.nan)), "number 3: must be a finite number"),
        (lambda s: s.load("a", moment=(0, 0, 0)), 'Scene.load("a"): moment: unknown keyword; '),
        (lambda s: s.spring("a", "b"), 'Scene.spring("a", "b"): stiffness and damping are both zero'),
        (lambda s: s.spring("a", "b", k=1), 'Scene.spring("a", "b"): k: unknown keyword'),
        (lambda s: s.drag("a"), 'Scene.drag("a"): translation and rotation are both zero'),
        (lambda s: s.contact("m", "n", friction={"constant": 1}, restitution=0), '"constant" is no kind of law'),
        (lambda s: s.mesh("m", material="m", file="m.stl", free={"mass": 1}), "free: unknown keyword; free walls are"),
        (lambda s: s.load_function(3), "Scene.load_function: expected a function, found 3"),
    ],
)  # fmt: skip
def test_mistakes_in_calls(call: Any, message: str) -> None:
    scene = balls()
    before = scene.to_toml()
    with pytest.raises(ScenarioError) as caught:
        call(scene)
    assert message in str(caught.value)
    assert scene.to_toml() == before


# --- laws -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "values", "slope"),
    [
        (2.5, {0: 2.5, 9: 2.5}, 0.0),
        ({"polynomial": [1.0, 2.0, 3.0]}, {0: 1, 2: 17, -1: 2}, 2.0),
        ({"table": [[-1.0, 0.0], [1.0, 4.0], [2.0, 3.0]]}, {-9: 0, 0: 2, 1.5: 3.5, 9: 3}, 2.0),
        ({"table": [[0.0, 1.0], [1.0, 4.0]]}, {0: 1, 0.5: 2.5}, 3.0),
        ({"table": [[-1.0, 1.0], [0.0, 4.0]]}, {0: 4}, 0.0),
        ({"expression": "2 + sin(7*t)"}, {0: 2, 0.5: 2 + math.sin(3.5)}, 7.0),
        ({"expression": "exp(-t)"}, {0: 1, 1: math.exp(-1)}, -1.0),
        ({"expression": "3"}, {0: 3}, 0.0),
        ({"expression": "t*abs(t)"}, {-2: -4}, 0.0),
    ],
)
def test_laws_are_what_they_say(law: Any, values: dict[float, float], slope: float) -> None:
    for x, y in values.items():
        assert value_at(law, x) == pytest.approx(y, rel=1e-14)
    found, doubt = slope_at(law, 0.0, 1e-5)
    assert abs(found - slope) <= doubt <= 1e-8


def test_the_doubt_covers_laws_that_have_no_slope() -> None:
    found, doubt = slope_at({"expression": "sqrt(t)"}, 0.0, 1e-5)
    assert 10 * doubt > abs(found)


def test_a_run_goes_on_only_until_a_rod_vanishes(tmp_path: Path) -> None:
    """It ended with a message about joints that contradict one another."""
    scene = balls(until=0.5)
    scene.joint("rod", between=("a", "b"), length={"expression": "1 - t^2"})
    carom.simulate(scene, out=tmp_path / "run")
    with pytest.raises(ScenarioError, match="length: falls to 0 m at t = 1 s; a rod has a positive length"):
        carom.resume(tmp_path / "run", until=1.0)


def test_a_law_that_begins_with_no_speed_is_refused_where_it_stands() -> None:
    """`carom check` had no objection, and the core refused the law of "joint 0"."""
    text = balls(until=0.1).to_toml() + '[[joint]]\nname = "servo"\ntype = "motion"\nbody = "a"\n'
    text += 'direction = [1, 0, 0]\ndisplacement = { expression = "sqrt(t)" }\n'
    line = text.splitlines().index('displacement = { expression = "sqrt(t)" }') + 1
    with pytest.raises(
        ScenarioError, match=f'{line}: joint "servo" displacement: has no finite slope at t = 0'
    ):
        Scene.from_toml(text)
    Scene.from_toml(text.replace("sqrt(t)", "t^1.5")).validate()


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
def test_a_run_that_a_law_stops_says_which() -> None:
    def stopped(scene: Scene) -> str:
        with pytest.raises(carom.RunFailed) as told:
            carom.simulate(scene)
        return str(told.value)

    scene = balls(until=0.05, step=1e-3)
    scene.load("b", force=({"expression": "1/(0.02 - t)"}, 0, 0))
    assert "at b (force [inf, 0, 0] N, torque [0, 0, 0] N m at t = 0.02 s)" in stopped(scene)
    scene = balls(until=0.05, step=1e-3)
    scene.joint("lock", body="a", name="pin")
    scene.joint("motion", body="a", direction=(1, 0, 0), displacement={"expression": "1/(0.04-t)-25-625*t"})
    assert 'at a (joint "joint2": its law gives inf with the slope' in stopped(scene)
    scene.joints[1].name = "servo"
    assert 'at a (joint "servo": its law gives inf with the slope' in stopped(scene)


def test_advice_on_laws_that_end_within_the_run() -> None:
    scene = balls(until=3.0)
    scene.load("a", force=(0, 0, {"expression": "sqrt(2 - t)"}))
    scene.joint("rod", between=("a", "b"), length={"polynomial": [1, 0, -0.25]})
    with pytest.raises(ScenarioError, match=r'joint\("rod"\): length: falls to -0.01002 m at t = 2.01 s; '):
        scene.validate()
    scene.joints[0].length = {"polynomial": [1, 0, -0.1]}
    [told] = map(str, scene.validate())
    assert 'scene.load("a"): force: has no finite value at t = 2.01 s: column 1: sqrt(' in told
    scene.run.until = 1.9
    assert scene.validate() == []


def test_advice_on_springs_that_are_fast_for_the_step() -> None:
    scene = balls(step=1e-2)
    scene.spring("a", "b", stiffness=1e4)  # period 2 pi sqrt(0.5/1e4) = 0.0444 s
    (advice,) = scene.validate()
    assert (
        "stiffness: its period is about 0.0444 s, 4.4 steps of 0.01 s; a step below 0.002 s follows it"
        in str(advice)
    )
    scene.run.step = 2e-3
    assert scene.validate() == []


def test_advice_on_friction_that_becomes_negative() -> None:
    scene = balls(step=1e-4)
    law = scene.contact("m", "n", friction={"polynomial": [0.2, -0.1]}, restitution=0)
    assert scene.validate() == []  # nothing moves
    scene.spheres[0].velocity = (3, 0, 0)
    (advice,) = scene.validate()
    assert 'scene.contact("m", "n"): friction: the coefficient is -0.00' in str(advice)
    law.friction = {"expression": "max(0, 0.2 - 0.1*v)"}
    assert scene.validate() == []


# --- Python functions -------------------------------------------------------------------------------------------------


def wind(t: float, position: Any, velocity: Any, angular_velocity: Any) -> Any:
    loads = np.zeros((len(position), 6))
    loads[:, 0] = t - velocity[:, 0]
    return loads


class TestFunctions:
    def scene(self) -> Scene:
        scene = balls()
        scene.load_function(wind)
        return scene

    def call(self, function: Any) -> Any:
        scene = balls()
        scene.load_function(function, name="f")
        (load,) = scene.to_model()["loads"]
        assert load["kind"] == "callable"
        return load["function"](0.5, np.zeros((2, 3)), np.full((2, 3), 0.2), np.zeros((2, 3)))

    def test_are_called_with_the_arrays_of_the_scene(self) -> None:
        loads = self.call(wind)
        assert loads.dtype == np.float64
        assert loads.flags.c_contiguous
        np.testing.assert_allclose(loads, [[0.3, 0, 0, 0, 0, 0]] * 2)
        np.testing.assert_array_equal(self.call(lambda *_: [[1] * 6] * 2), np.ones((2, 6)))

    @pytest.mark.parametrize(
        ("value", "message"),
        [
            (
                np.zeros(3),
                'load function "f": returned an array of shape (3,); return an array (2, 6) of finite numbers',
            ),
            (np.full((2, 6), np.nan), "returned a number that is not finite at t = 0.5 s"),
            (None, "returned"),
            ("text", 'returned "str"'),
            ([[1], [1, 2]], 'returned "list"'),
        ],
    )
    def test_that_return_something_else_are_explained(self, value: Any, message: str) -> None:
        with pytest.raises(CaromError) as caught:
            self.call(lambda *_: value)
        assert message in str(caught.value)

    def test_cannot_be_written(self) -> None:
        scene = self.scene()
        with pytest.raises(
            ScenarioError, match=r"scene.load_function\(wind\): a file cannot hold a Python function; "
        ):
            scene.to_toml()
        assert 'load_function]]\nname = "wind"' in scene.to_toml(resolved=True)

    def test_are_missing_after_reading(self) -> None:
        again = Scene.from_toml(self.scene().to_toml(resolved=True))
        assert [f.name for f in again.load_functions] == ["wind"]
        with pytest.raises(ScenarioError, match=r'the Python function "wind" is not there'):
            again.to_model()
        again.load_function(wind)
        assert identify(again.to_model()) == identify(self.scene().to_model())

    def test_have_names_of_their_own(self) -> None:
        scene = self.scene()
        scene.load_function(lambda *_: 0)
        scene.load_function(lambda *_: 0)
        assert [f.name for f in scene.load_functions] == ["wind", "function2", "function3"]
        with pytest.raises(ScenarioError, match='there is already a load function "wind"'):
            scene.load_function(wind)

    def test_make_scenes_differ(self) -> None:
        assert self.scene() == self.scene()
        other = balls()
        other.load_function(lambda *_: 0, name="wind")
        assert other != self.scene()

    def test_stay_when_options_are_overridden(self) -> None:
        assert "loads" in self.scene().with_options(until=2).to_model()

    def test_of_a_run_are_asked_for_again(self, tmp_path: Path) -> None:
        text = self.scene().to_toml(resolved=True)
        directory = RunDir(tmp_path)
        for given_functions in ((), (wind, wind)):
            with pytest.raises(CaromError) as caught:
                changes.restore_functions(directory, Scene.from_toml(text), given_functions)
            assert f'continue it in Python, as carom.resume("{tmp_path}", load_functions=[wind])' in str(
                caught.value
            )
        for good in (wind, [wind], (wind,)):
            scene = Scene.from_toml(text)
            changes.restore_functions(directory, scene, good)
            assert [f.function for f in scene.load_functions] == [wind]
        with pytest.raises(CaromError, match="load functions: none; 1 given; leave load_functions out"):
            changes.restore_functions(directory, balls(), wind)
        changes.restore_functions(directory, balls())

    def test_a_run_continues_with_its_function(self, tmp_path: Path) -> None:
        """Bit for bit as without the break; without the function it is refused with a cure."""

        whole = carom.simulate(self.scene(), until=0.2, out=tmp_path / "whole")
        carom.simulate(self.scene(), until=0.1, out=tmp_path / "part")
        with pytest.raises(CaromError, match=r"continue it in Python, as carom\.resume"):
            carom.resume(tmp_path / "part", until=0.2)
        resumed = carom.resume(tmp_path / "part", until=0.2, load_functions=[wind])
        np.testing.assert_array_equal(resumed.velocity[-1], whole.velocity[-1])
        assert resumed.time[-1] == whole.time[-1]
        assert whole.velocity[-1, 0, 0] == pytest.approx(0.2 - 1 + math.exp(-0.2), rel=1e-4)


def test_a_scene_of_all_loads_runs() -> None:

    result = carom.simulate(everything(), until=0.05)
    again = carom.simulate(carom.Scene.from_toml(everything().to_toml()), until=0.05)
    assert np.array_equal(again.position, result.position)
    bare = balls()
    bare.contact("m", "n", friction={"table": [[0, 0.2], [1, 0.1]]}, restitution=0)
    assert np.abs(carom.simulate(bare, until=0.05).position[-1] - result.position[-1]).max() > 1e-4


def test_the_identity_of_a_scene_knows_its_loads() -> None:
    scene = balls()
    plain = identify(scene.to_model())
    load = scene.load("a", force=(0, 0, 1))
    one = identify(scene.to_model())
    load.force = (0, 0, {"polynomial": [1, 1]})
    assert len({plain, one, identify(scene.to_model())}) == 3
