"""`[[packing]]` in files and scenes: read and written, expanded, checked, and what messages say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from carom import ScenarioError, Scene
from carom.scene.toml.load import parse
from carom.scene.toml.schema import json_schema

BOX: dict[str, Any] = {"low": (0, 0, 0), "high": (0.1, 0.1, 0.1)}
GRAIN: dict[str, Any] = {"material": "g", "density": 2500, "seed": 1, "diameter": "10 mm", **BOX}


def scene(**keys: Any) -> Scene:
    made = Scene(run={"until": 1})
    made.contact("g", "g", friction=0.5, restitution=0.3)
    made.packing("grain", **{**GRAIN, "count": 200, **keys})
    return made


def refused(made: Scene) -> ScenarioError:
    with pytest.raises(ScenarioError) as caught:
        made.validate()
    return caught.value


KINDS: list[dict[str, Any]] = [
    {},
    {"sizes": "uniform", "diameter": None, "smallest": "4 mm", "largest": "8 mm", "periodic": "xy", "gap": 1e-4},
    {
        "sizes": "lognormal", "diameter": None, "mean": 0.006, "deviation": "1 mm", "smallest": 3e-3, "largest": 0.01,
        "region": "cylinder", "low": None, "high": None, "point": (0, 0, 0.1), "axis": (0, 1, 1),
        "region_radius": "5 cm", "length": 0.1, "velocity": (0, 0, -0.01), "first_number": 0,
    },
    {
        "sizes": "table", "diameter": None, "classes": [[0.004, 0.5], [0.008, 0.5]], "shares": "mass", "count": None,
        "fraction": 0.4, "region": "sphere", "low": None, "high": None, "point": (0, 0, 0), "region_radius": 0.03,
    },
]  # fmt: skip


@pytest.mark.parametrize("keys", KINDS, ids=["equal", "uniform", "lognormal", "table"])
class TestKinds:
    def test_is_kept_as_a_recipe(self, keys: dict[str, Any]) -> None:
        made = scene(**keys)
        text = made.to_toml()
        assert "[[packing]]" in text
        assert len(text) < 1000
        again = Scene.from_toml(text)
        assert again == made
        # Many balls are advised a tolerance: at another place, since one scene has a text.
        assert [p.cause for p in made.validate()] == [p.cause for p in again.validate()]

    def test_resolved_copy_makes_the_same_model(self, keys: dict[str, Any]) -> None:
        made = scene(**keys)
        made.sphere("first", radius=0.01, density=1000, at=(1, 1, 1), material="g")
        made.lattice("last", counts=(2, 1, 1), origin=(2, 2, 2), radius=0.01, mass=1, material="g")
        resolved = Scene.from_toml(made.to_toml(resolved=True))
        assert len(resolved.spheres) == len(resolved.names)
        assert resolved.names == made.names
        a, b = made.to_model(), resolved.to_model()
        for key in a:
            if key != "options":
                np.testing.assert_array_equal(a[key], b[key])

    def test_satisfies_the_published_schema(self, keys: dict[str, Any]) -> None:
        import tomllib

        jsonschema.Draft202012Validator(json_schema()).validate(tomllib.loads(scene(**keys).to_toml()))


def test_the_balls_are_those_of_the_packing() -> None:
    made = scene(velocity=(1, 0, 0), fraction=0.5, count=None)
    made.sphere("alone", radius=0.01, density=1000, at=(1, 1, 1), material="g")
    (packing,) = made._tree.packing
    packed = packing.packed()
    assert packing.size() == len(packed.radius) == len(made.names) - 1
    assert made.names[:2] == ["alone", "grain1"]
    model = made.to_model()
    np.testing.assert_array_equal(model["position"][1:], packed.position)
    np.testing.assert_array_equal(model["velocity"][1:, 0], 1.0)
    np.testing.assert_allclose(model["mass"][1:], 2500 * np.pi / 6 * 0.01**3, rtol=1e-14)
    np.testing.assert_allclose(model["inertia"], 0.4 * model["mass"] * model["radius"] ** 2)
    assert packed.fraction == pytest.approx(0.5, abs=3e-4)


def test_a_large_packing_stays_one_in_the_resolved_copy() -> None:
    text = scene(count=10_500, high=(0.5, 0.5, 0.5)).to_toml(resolved=True)
    assert "[[packing]]" in text
    assert len(text) < 3000


def test_parameters_may_stand_in_a_packing() -> None:
    text = scene().to_toml().replace("count = 200", 'count = "= n"').replace("format = 1", "format = 1")
    tree, _ = parse(text.replace("[run]", "[parameters]\nn = 50\n\n[run]"))
    assert tree.packing[0].count == 50


def test_diameters_of_classes_take_units() -> None:
    table = {"diameter": None, "sizes": "table"}
    plain, with_units = (
        scene(**table, classes=classes).to_model()["radius"]
        for classes in ([[0.004, 0.5], [0.008, 0.5]], [["4 mm", 0.5], ["0.8 cm", 0.5]])
    )
    assert np.array_equal(plain, with_units)
    assert "classes = [[0.004, 0.5]]" in scene(**table, classes=[["4 mm", 0.5]]).to_toml()
    with pytest.raises(ScenarioError, match='classes: number 1: number 1: expected a length, found "4 kg"'):
        scene(**table, classes=[["4 kg", 0.5]])


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"count": None}, "neither count nor fraction is given"),
        ({"fraction": 0.3}, "both count and fraction"),
        ({"diameter": None}, 'sizes = "equal" needs diameter; give diameter'),
        ({"mean": 0.01}, 'sizes = "equal" has no key mean; remove it'),
        ({"sizes": "normal"}, 'sizes = "normal" needs mean and deviation and smallest and largest'),
        ({"region": "sphere"}, 'region = "sphere" needs point and region_radius'),
        ({"axis": (0, 0, 1)}, 'region = "box" has no key axis'),
        ({"high": (0.1, 0.1, 0)}, "low is not below high along each axis"),
        ({"sizes": "gauss"}, 'unknown value "gauss"'),
        (
            {"diameter": None, "sizes": "table", "classes": [[0.01, -1]]},
            "classes: diameters and shares of the table must be positive",
        ),
        (
            {"diameter": None, "sizes": "table", "classes": []},
            "expected 1 to 1000 vectors, found a list of 0; write [[diameter, share], ...]",
        ),
        (
            {"diameter": None, "sizes": "table", "classes": [[0.01]]},
            "expected a list of 2 numbers, found a list of 1; write [diameter, share]",
        ),
        ({"seed": None}, "seed: is missing; add seed = 1"),
        ({"density": None}, "density: is missing"),
        pytest.param(
            {"count": 170, "diameter": 0.02},
            "count: no packing of fraction 0.7121 was found",
            marks=pytest.mark.long,  # tests/test_packing.py has the same refusal
        ),
        ({"count": 3000}, "count: the balls would fill 1.57 of the region"),
        ({"diameter": 0.11}, "has no room in the region; the largest may have"),
        ({"high": (1e20, 1e20, 1e20)}, "check the units"),
    ],
)
def test_impossible_packings(keys: dict[str, Any], expected: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scene(**keys).validate()
    assert expected in str(caught.value)


def test_findings_about_single_balls_name_the_packing_once() -> None:
    made = scene()
    made.plane("floor", point=(0, 0, -1), normal=(0, 0, 1), material="g")
    made.packing("grain", **{**GRAIN, "count": 20, "low": (1, 0, 0), "high": (1.1, 0.1, 0.1)})
    made._tree.packing[1].material = "sand"
    text = str(refused(made))
    assert text.count("unknown material") == 1
    assert 'scene.packing["grain"]: material: unknown material "sand"' in text
    assert 'there are two spheres "grain1"; change name (the prefix) or first_number' in text


def test_a_packing_that_meets_others_is_told_to_move() -> None:
    made = scene()
    made.plane("floor", point=(0, 0, 0.05), normal=(0, 0, 1), material="g")
    made.sphere("big", radius=0.04, density=1000, at=(0.05, 0.05, 0.1), material="g")
    text = str(refused(made))
    assert 'behind plane "floor"; move the region of the packing' in text
    assert 'spheres "big" and "grain' in text
    source = made.to_toml()
    line = source.split("\n").index("low = [0.0, 0.0, 0.0]") + 1
    problems = refused(Scene.from_toml(source)).problems
    assert {p.line for p in problems} == {line}


def test_what_a_packing_lacks_is_said_beside_other_mistakes() -> None:
    made = scene(count=3000)
    made.sphere("a", radius=0.1, density=1, at=(1, 0, 0), material="g")
    made.sphere("b", radius=0.1, density=1, at=(1.1, 0, 0), material="g")
    text = str(refused(made))
    assert "would fill" in text
    assert 'spheres "a" and "b" overlap' in text
    assert len(text.split("\n")) == 2


PAGE = Path(__file__).parents[1] / "docs" / "reference" / "packings.md"


def test_the_page_has_the_table_of_the_model() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert "| `region_radius` | m |" in page
    assert len(of_the_page()._tree.packing) == 1


def of_the_page() -> Scene:
    """The example of the page, with what it leaves out."""
    page = PAGE.read_text(encoding="utf-8")
    (toml,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    base = Scene(run={"until": 1, "pile_tolerance": 1e-4}, record={"every": 20})
    base.contact("glass", "glass", friction=0.5, restitution=0.3)
    return Scene.from_toml(base.to_toml() + toml)


@pytest.mark.long
def test_the_example_of_the_page_works() -> None:
    made = of_the_page()
    assert made.validate() == []
    assert made._tree.packing[0].packed().fraction == pytest.approx(0.58, abs=1e-3)


def test_a_wrong_class_of_a_table_is_told_on_its_own_line() -> None:
    classes = "[\n  [0.01, 1.0],\n  [0.02, -1.0],\n]"
    text = scene().to_toml().replace("diameter = 0.01", f'sizes = "table"\nclasses = {classes}')
    assert classes in text
    with pytest.raises(ScenarioError) as caught:
        parse(text)
    (problem,) = caught.value.problems
    assert problem.key.endswith("classes")
    assert problem.source.strip() == "[0.02, -1.0],"
