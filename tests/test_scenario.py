"""The scenario format: it agrees with the core, every shipped file is good, and text and tree are the same thing."""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import carom
import jsonschema
import numpy as np
import pytest
from carom import Scene, _core, units
from carom.scene.tables.model import REPEATED, SINGLE, Scenario
from carom.scene.tables.options import OPTIONS, Run
from carom.scene.toml.schema import json_schema
from hypothesis import given
from hypothesis import strategies as st

ROOT = Path(__file__).parent.parent
SHIPPED = sorted((ROOT / "scenarios").rglob("*.toml"))
EXAMPLE = """\
format = 1
title = "quantities as text"

[run]
until = "2 s"
step = "1 ms"
restitution_threshold = "3 mm/s"

[record]
every = 10

[world]
gravity = [0.0, "0 m/s^2", "-980 cm/s^2"]

[[material]]
name = "ball"

[[contact]]
between = ["ball", "ball"]
friction = 0.1
restitution = 1
rolling_radius = "5 um"

[[sphere]]
name = "a"
material = "ball"
radius = "28.575 mm"
density = "1.7 g/cm^3"
inertia = "550 g cm^2"
position = ["1 in", 0, "28.575 mm"]
velocity = ["36 km/h", 0.0, 0.0]
angular_velocity = ["60 rpm", "180 deg/s", "1 rad/s"]
"""


def test_format_and_core_agree_on_the_options() -> None:
    """An option that only the core has would be undocumented, one that only we have would fail at the core."""
    assert set(OPTIONS) == set(_core.defaults())
    assert set(Run.model_fields) == set(_core.defaults()) | {"until"}
    run = Run.model_validate({})
    assert run.options() == _core.defaults()
    names = {name for name, default in _core.defaults().items() if isinstance(default, str)}
    assert names == set(_core.choices())
    for name, values in _core.choices().items():
        assert _core.defaults()[name] in values
        for value in values:
            assert getattr(Run.model_validate({name: value}), name) == value


def test_every_key_says_what_it_means_and_quantities_have_a_unit() -> None:
    for table in (*SINGLE.values(), *REPEATED.values(), Scenario):
        for key, field in table.model_fields.items():
            assert field.description, f"{table.__name__}.{key}"


#: Resolved copies of larger scenes, tables of all their balls, are validated in the long tier: it takes a second each.
FEW = 100


@functools.cache
def read(path: Path) -> Scene:
    """The scene of a file, made once; nobody changes it."""
    return Scene.from_toml(path)


@functools.cache
def written(path: Path) -> str:
    """Its resolved copy."""
    return read(path).to_toml(resolved=True)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
class TestShipped:
    def test_is_good(self, path: Path) -> None:
        scene = read(path)
        scene.validate()
        assert scene.title
        assert path.read_text(encoding="utf-8").startswith("# "), "a scenario begins with what it teaches"

    def test_reads_back_to_itself(self, path: Path) -> None:
        scene = read(path)
        assert Scene.from_toml(scene.to_toml()) == scene

    def test_resolved_copy_makes_the_same_model(self, path: Path) -> None:
        scene = read(path)
        resolved = Scene.from_toml(written(path))
        resolved.validate()
        assert resolved.names == scene.names
        a, b = scene.to_model(), resolved.to_model()
        assert a.pop("options") == b.pop("options")
        for key in a:
            if key in ("friction_law", "outlet"):  # rows of mixed types, no arrays
                assert a[key] == b[key]
            else:
                np.testing.assert_array_equal(a[key], b[key])

    def test_satisfies_the_published_schema(self, path: Path) -> None:
        schema = jsonschema.Draft202012Validator(json_schema())
        schema.validate(as_json(path.read_text(encoding="utf-8")))
        if len(read(path).names) <= FEW:
            schema.validate(as_json(written(path)))

    @pytest.mark.long
    def test_its_resolved_copy_satisfies_the_published_schema(self, path: Path) -> None:
        jsonschema.Draft202012Validator(json_schema()).validate(as_json(written(path)))


def as_json(text: str) -> Any:
    import tomllib

    return json.loads(json.dumps(tomllib.loads(text)))


class TestQuantities:
    def test_become_the_nearest_double(self) -> None:
        scene = Scene.from_toml(EXAMPLE)
        (a,) = scene.spheres
        assert (scene.run.until, scene.run.step, scene.run.restitution_threshold) == (2.0, 1e-3, 3e-3)
        assert scene.gravity == (0.0, 0.0, -9.8)
        assert (a.radius, a.density, a.inertia) == (0.028575, 1700.0, 5.5e-5)
        assert a.position == (0.0254, 0.0, 0.028575)
        assert a.velocity == (10.0, 0.0, 0.0)
        assert a.angular_velocity == (2 * np.pi, np.pi, 1.0)

    def test_satisfy_the_published_schema(self) -> None:
        schema = jsonschema.Draft202012Validator(json_schema())
        schema.validate(as_json(EXAMPLE))
        for old, new in [
            ('"28.575 mm"\ndensity', '"mm"\ndensity'),
            ('"28.575 mm"\ndensity', "-1\ndensity"),
            ('"28.575 mm"\ndensity', "[1]\ndensity"),
            ('density = "1.7 g/cm^3"\n', ""),
            ('density = "1.7 g/cm^3"\n', "density = 1\nmass = 1\n"),
            ('until = "2 s"\n', ""),
            ("friction = 0.1", "frictoin = 0.1"),
            ("restitution = 1\n", "restitution = 1.1\n"),
        ]:
            assert EXAMPLE.count(old) == 1
            assert not schema.is_valid(as_json(EXAMPLE.replace(old, new))), new

    def test_schema_is_a_schema_without_null(self) -> None:
        schema = json_schema()
        jsonschema.Draft202012Validator.check_schema(schema)
        assert '"null"' not in json.dumps(schema)

    @given(st.floats(1e-300, 1e300), st.sampled_from(sorted(units.UNITS)))
    def test_unit_with_its_own_factor(self, x: float, unit: str) -> None:
        factor, pi, exponents = units.UNITS[unit]
        dimension = (
            next(name for name, row in units.DIMENSIONS.items() if row[0] == exponents)
            if unit != "rpm"
            else "angular speed"
        )
        expected = x * float(factor) * np.pi**pi
        value = units.parse(f"{x!r} {unit}", dimension)
        assert value == pytest.approx(expected, rel=1e-15) or not np.isfinite(expected)

    @pytest.mark.parametrize(
        ("text", "dimension", "value"),
        [
            ("1kg/m^3", "density", 1.0),
            ("1 kg m^-3", "density", 1.0),
            ("1 g/cm3", "density", 1000.0),
            ("2 kg*m^2", "moment of inertia", 2.0),
            ("2 kg·m^2", "moment of inertia", 2.0),
            ("5 µm", "length", 5e-6),
            (" +.5e1  m ", "length", 5.0),
            ("9.8 m/s^2", "acceleration", 9.8),
            ("9.8 m/s/s", "acceleration", 9.8),
            ("30 deg", "angle", 30 * np.pi / 180),
            ("1 1/s*rad", "angular speed", 1.0),
            ("7.8 g/cm³", "density", 7800.0),
            ("2 m·s⁻²", "acceleration", 2.0),
            ("30°", "angle", np.pi / 6),
            ("180 °/s", "angular speed", np.pi),
            ("1e999 m", "length", np.inf),
            ("1e-999 m", "length", 0.0),
        ],
    )
    def test_spellings(self, text: str, dimension: str, value: float) -> None:
        assert units.parse(text, dimension) == pytest.approx(value, rel=1e-15)

    @pytest.mark.parametrize(
        "text",
        [
            "",
            "m",
            "1",
            "1 /m",
            "1 m//s",
            "1 m^",
            "1 m2x",
            "--1 m",
            "0x1 m",
            "1 m!",
            "nan m",
            "1 M",
            "9" * 90 + " m",
            "5 12 m",  # was once 5 m, and 2 10 mm 2 mm
            "2 10 mm",
            "1 1/2 in",
            "5 m 1",
        ],
    )
    def test_nonsense(self, text: str) -> None:
        with pytest.raises(units.UnitError) as caught:
            units.parse(text, "length")
        assert "cm, mm" in caught.value.cure

    @pytest.mark.parametrize("dimension", [name for name, row in units.DIMENSIONS.items() if row[1]])
    def test_messages_name_every_unit_of_a_dimension_and_such_that_work(self, dimension: str) -> None:
        told = units.expected(dimension).rpartition("with a unit of ")[2].split(", ")
        assert all(units.parse(f"1 {unit}", dimension) > 0 for unit in told)
        own = {unit for unit, row in units.UNITS.items() if row[2] == units.DIMENSIONS[dimension][0]}
        assert own <= set(told)
        assert len(told) == len(set(told))
        assert dimension != "speed" or {"ft/s", "mph", "km/h"} < set(told)

    @pytest.mark.parametrize(
        ("text", "dimension", "meant"),
        [
            ("5 mn", "force", "mN"),
            ("5 mn", "time", "ms or min"),
            ("5 mn", "length", "m, mm or in"),  # m alone was once suggested
            ("5 mhp", "speed", "mph"),
            ("2 mpa", "pressure", "MPa"),
            ("3 M/s", "speed", "m"),
            ("3 kgg/cm3", "density", "kg"),
        ],
    )
    def test_the_unit_that_is_suggested_has_the_dimension(
        self, text: str, dimension: str, meant: str
    ) -> None:
        """A millinewton was once suggested for a length."""
        with pytest.raises(units.UnitError, match=rf"did you mean {meant}\? otherwise"):
            units.parse(text, dimension)

    def test_no_unit_is_suggested_where_none_would_fit(self) -> None:
        with pytest.raises(units.UnitError) as caught:
            units.parse("3 hz", "frequency")  # h is an hour
        assert "did you mean" not in str(caught.value)

    @pytest.mark.parametrize("text", ["3 x", "3 y/s", "3 qq"])
    def test_a_letter_for_a_letter_is_no_likeness(self, text: str) -> None:
        with pytest.raises(units.UnitError) as caught:
            units.parse(text)
        assert "did you mean" not in str(caught.value)

    @pytest.mark.parametrize(
        ("text", "cure"),
        [
            ("1,5 cm", 'write a point: "1.5 cm"'),
            ("-7,8e3 kg", 'write a point: "-7.8e3 kg"'),
            ("1,234.5 mm", "write a number in m"),
        ],
    )
    def test_a_decimal_comma_is_no_part_of_a_unit(self, text: str, cure: str) -> None:
        with pytest.raises(units.UnitError) as caught:
            units.parse(text, "length")
        assert caught.value.cure.startswith(cure)

    def test_angle_is_not_nothing(self) -> None:
        with pytest.raises(units.UnitError, match="expected an angular speed"):
            units.parse("1 1/s", "angular speed")

    @given(st.text(max_size=30), st.sampled_from(sorted(units.DIMENSIONS)))
    def test_any_text_is_read_or_refused(self, text: str, dimension: str) -> None:
        with suppress(units.UnitError):
            assert isinstance(units.parse(text, dimension), float)


def test_the_tables_of_the_reference_are_those_of_the_model_and_the_layout() -> None:
    root = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, root / "tools/reference_tables.py", "--check"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_examples_of_the_reference_page_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[1] / "docs/reference/scenario.md").read_text(encoding="utf-8")
    toml, *tables = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    rods, pendulum, variants, code = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    scene = Scene.from_toml(toml)
    assert scene.validate() == []
    for table in tables:  # the others are parts to add to the first
        assert Scene.from_toml(f"{toml}\n{table}").validate() == []
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"carom": carom}
    (parameters,) = (table for table in tables if table.startswith("[parameters]"))
    Path("slope.toml").write_text(f"{toml}\n{parameters}", encoding="utf-8")
    exec(rods, names)
    assert 0.0 < names["out"] <= sum(clump.mass for clump in names["result"].clumps.values())
    exec(pendulum, names)
    away = names["result"].position[:, 0] - [0.0, 0.0, 0.5]
    assert np.abs(away).max() < 1e-10 < np.abs(names["result"].clumps["rod"].velocity).max()
    exec(variants, names)
    assert (names["result"].case, names["result"].parameters["m"]) == ("steep", 0.2)
    exec(code, names)
    built, read = names["scene"].to_model(), scene.to_model()
    assert built.pop("options") == read.pop("options")
    for key in read:
        np.testing.assert_array_equal(built[key], read[key])
