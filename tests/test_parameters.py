"""Parameters and cases: what expressions in a scenario file mean, and what is said of those that are wrong."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import carom
import jsonschema
import numpy as np
import pytest
from carom import CaromError, ScenarioError, Scene, Study, _core
from carom.cli import main
from carom.cli.run import run_name
from carom.scene.toml.lines import LineMap
from carom.scene.toml.load import cases
from carom.scene.toml.schema import json_schema
from hypothesis import given
from hypothesis import strategies as st

CUT = """format = 1
title = "= not an expression"

[parameters]
r = 0.028575
f = 0.5
phi = "= asin(1 - f)"   # rad
mu = 0.06
n = 2

[[case]]
name = "f=0.25"
f = 0.25

[[case]]
name = "thin cut"
phi = "= pi/3 + 0.1"
mu = 0

[run]
until = "= 20*1e-3"
step = 1e-3

[record]
every = "= n"

[world]
gravity = [0.0, 0.0, 0.0]

[[material]]
name = "= ball"

[[contact]]
between = ["= ball", "= ball"]
friction = { expression = "mu*exp(-v)" }
restitution = 1.0

[[sphere]]
name = "cue"
material = "= ball"
radius = "= r"
mass = 0.17
position = [
    "= -0.1 - 2*r*cos(phi)",
    "= -2*r*sin(phi)",
    0.0,
]
velocity = [1.0, 0.0, 0.0]

[[sphere]]
name = "object"
material = "= ball"
radius = "28.575 mm"
mass = 0.17
position = [0.0, 0.0, 0.0]
"""
R = 0.028575


def position(scene: Scene) -> Any:
    return scene.to_model()["position"][0]


def placed(phi: float) -> list[float]:
    return [-0.1 - 2 * R * math.cos(phi), -2 * R * math.sin(phi), 0.0]


def problems(text: str, **how: Any) -> list[tuple[int | None, str, str]]:
    """Line, key and the rest of every problem of a text that must have some."""
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(text, **how)
    return [(p.line, p.key, f"{p.cause}; {p.cure}") for p in caught.value.problems]


def line_of(text: str, part: str) -> int:
    (line,) = (i for i, row in enumerate(text.split("\n"), 1) if part in row)
    return line


def changed(*pairs: tuple[str, str]) -> str:
    text = CUT
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


class TestValues:
    def test_expressions_stand_where_numbers_do_and_names_stay_names(self) -> None:
        scene = Scene.from_toml(CUT)
        np.testing.assert_allclose(position(scene), placed(math.pi / 6), rtol=0, atol=1e-16)
        assert scene.title == "= not an expression"
        assert scene.record.every == 2
        assert scene.run.until == pytest.approx(0.02, rel=1e-15)
        assert scene.parameters == {"r": R, "f": 0.5, "phi": math.asin(0.5), "mu": 0.06, "n": 2.0}
        assert scene.case is None

    def test_a_quantity_is_that_number_in_si_wherever_it_is_given(self) -> None:
        """8 degrees became 8 radians: the message said to define the name of the unit as 1."""
        text = changed(
            ("f = 0.5", 'deg = "1 deg"\nf = "45°"'),
            ('"= asin(1 - f)"', '"= 2*f - 60*deg"'),
            ("f = 0.25", 'f = "50 deg"'),
        )
        scene = Scene.from_toml(text)
        assert scene.parameters["phi"] == pytest.approx(math.pi / 6, rel=1e-15)
        np.testing.assert_allclose(position(scene), placed(math.pi / 6), rtol=0, atol=1e-16)
        assert Scene.from_toml(text, case="f=0.25").parameters["phi"] == pytest.approx(
            2 * math.pi / 9, rel=1e-15
        )
        for value in ("45 deg", "= 45*deg", "0.125 rev", np.radians(45)):
            found = Scene.from_toml(text, parameters={"f": value}).parameters["f"]
            assert found == pytest.approx(math.pi / 4, rel=1e-15)

    @pytest.mark.parametrize(
        ("text", "value", "told"),
        [
            ("1 ms", "1 m", "a length; write a number in s, or"),  # it was a step of 1 s
            ("1 ms", "2 m/s", "a speed; write a number in s, or"),
            ("8 deg", "0.1 s", "a time; write a number in rad, or"),
            ("3 kg m^2/s^3", "1 N", "a force; write a number in SI units, or"),
        ],
    )
    def test_other_values_of_a_quantity_have_its_dimension_or_no_unit(
        self, text: str, value: str, told: str
    ) -> None:
        file = f'format = 1\n[parameters]\nx = "{text}"\n[run]\nstep = "= 1*x"\n[world]\ngravity = [0.0, 0.0, 0.0]'
        wanted = f'expected a quantity like "{text}", found "{value}", {told}'
        [(line, key, message)] = problems(f'{file}\n[[case]]\nname = "a"\nx = "{value}"\n')
        assert (line, key) == (10, 'case "a" x')
        assert wanted in message
        [(line, key, message)] = problems(f"{file}\n", parameters={"x": value})
        assert (line, key) == (None, "set x")
        assert wanted in message
        for other in (text, 0.03, "= 0.01*3"):
            assert Scene.from_toml(f"{file}\n", parameters={"x": other}).run.step > 0

    @pytest.mark.parametrize(
        ("key", "value", "told"),
        [
            ("radius", "1 g", "expected a length, found"),
            ("mass", "1 cm", "expected a mass, found"),
            ("velocity", "1 s", "expected a speed, found"),
            ("friction", "1 mm", "expected a number, found"),
        ],
    )
    def test_a_quantity_that_is_used_unchanged_has_the_dimension_of_the_place(
        self, key: str, value: str, told: str, tmp_path: Path
    ) -> None:
        """As a quantity that stands there itself, and as that of a study; a plain number or a computed one may be any."""
        used = {"radius": "0.02", "mass": "0.1", "velocity": "1.0", "friction": "0.1"} | {key: '"= y"'}
        file = (
            'format = 1\nmaterial = [{ name = "steel" }]\nrun = { until = 0.1 }\nworld = { gravity = [0, 0, 0] }\n'
            'contact = [{ between = ["steel", "steel"], friction = FRICTION, restitution = 0.5 }]\n'
            '[parameters]\nx = 0.5\ny = "= x"\n[[case]]\nname = "a"\nx = "VALUE"\n'
            '[[sphere]]\nname = "one"\nradius = RADIUS\nmass = MASS\nmaterial = "steel"\n'
            "position = [0, 0, 0]\nvelocity = [VELOCITY, 0, 0]\n"
        )
        for name, text in used.items():
            file = file.replace(name.upper(), text)
        file = file.replace("VALUE", value)
        assert Scene.from_toml(file).parameters == {"x": 0.5, "y": 0.5}
        for how in ({"case": "a"}, {"parameters": {"x": value}}, {"parameters": {"y": value}}):
            [(_, place, message)] = problems(file, **how)  # type: ignore[arg-type]
            assert place.endswith((key, f"{key}[0]")), place
            assert f'"= y": {told} "{value}"' in message
        path = tmp_path / "passed.toml"
        path.write_text(file)
        with pytest.raises(CaromError) as caught:
            Study.of(path, {"y": [value]})
        assert f'parameters.y: "= y": {told}' in str(caught.value)
        computed = file.replace('"= y"', '"= 1*y"')
        assert Scene.from_toml(computed, parameters={"x": value}).parameters["x"] > 0

    def test_a_case_overrides_and_what_depends_on_it_follows(self) -> None:
        np.testing.assert_allclose(
            position(Scene.from_toml(CUT, case="f=0.25")), placed(math.asin(0.75)), rtol=0, atol=1e-16
        )
        thin = Scene.from_toml(CUT, case="thin cut")
        np.testing.assert_allclose(position(thin), placed(math.pi / 3 + 0.1), rtol=0, atol=1e-16)
        assert thin.case == "thin cut"
        assert thin.parameters["mu"] == 0.0

    def test_given_values_go_before_those_of_the_case(self) -> None:
        scene = Scene.from_toml(CUT, case="f=0.25", parameters={"f": np.float64(0.9), "mu": "= 0.06 + f/10"})
        assert scene.parameters["phi"] == math.asin(1 - 0.9)
        assert scene.parameters["mu"] == 0.06 + 0.9 / 10

    def test_parameters_in_laws_become_numbers_but_for_their_variable(self) -> None:
        text = changed(("mu = 0.06", "mu = 0.06\nv = -3.0"), ("mass = 0.17", 'mass = "= -v"'))
        assert Scene.from_toml(text).to_model()["friction_law"] == [("expression", "(0.06)*exp(-v)")]
        text = changed(('{ expression = "mu*exp(-v)" }', '{ polynomial = ["= 2*mu", 0.5] }'))
        assert Scene.from_toml(text).to_model()["friction_law"] == [("polynomial", [0.12, 0.5])]

    def test_without_parameters_expressions_are_of_numbers(self) -> None:
        plain = Scene.from_toml(
            CUT.replace(CUT[CUT.index("[parameters]") : CUT.index("[run]")], "")
            .replace('"= n"', "2")
            .replace("mu*", "0.06*")
            .replace('"= r"', '"= 28.575e-3"')
            .replace("2*r*", "0.05715*")
            .replace("(phi)", "(pi/6)")
        )
        np.testing.assert_allclose(position(plain), placed(math.pi / 6), rtol=0, atol=1e-16)
        assert plain.parameters == {}

    def test_the_resolved_scenario_has_the_numbers(self) -> None:
        scene = Scene.from_toml(CUT, case="thin cut")
        again = Scene.from_toml(scene.to_toml(resolved=True))
        assert again.parameters == {}
        np.testing.assert_array_equal(position(again), position(scene))

    @given(st.floats(-1e3, 1e3), st.floats(0.1, 1e3))
    def test_values_are_those_of_python(self, a: float, b: float) -> None:
        text = CUT.replace("n = 2", f"n = 2\na = {a!r}\nb = {b!r}").replace(
            "velocity = [1.0,", 'velocity = ["= -a^2/b + min(a, b)*2^-1",'
        )
        velocity = Scene.from_toml(text).to_model()["velocity"][0][0]
        assert velocity == pytest.approx(-(a**2) / b + min(a, b) * 0.5, rel=1e-14)


class TestFiles:
    def test_cases_are_listed(self, tmp_path: Path) -> None:
        (tmp_path / "cut.toml").write_text(CUT)
        assert cases(tmp_path / "cut.toml") == ["f=0.25", "thin cut"]

    def test_every_case_of_every_shipped_file_is_a_scene(self) -> None:
        found = 0
        for path in sorted((Path(__file__).parents[1] / "scenarios").rglob("*.toml")):
            for case in cases(path):
                found += 1
                assert Scene.from_toml(path, case=case).case == case
        assert found

    def test_the_published_schema_agrees(self) -> None:
        schema = jsonschema.Draft202012Validator(json_schema())
        schema.validate(tomllib.loads(CUT))
        for old, new in (
            ('radius = "= r"', 'radius = "r"'),
            ("f = 0.25", "f = true"),
            ("f = 0.25", 'f = "abc"'),
            ("[[case]]", "[[cases]]"),
        ):
            assert not schema.is_valid(tomllib.loads(changed((old, new)))), new


LAW = 'contact "= ball"-"= ball"'
WRONG = [
    # what is changed, a part of the line that is named, its key, parts of what is said
    (("2*r*sin(phi)", "2r*sin(phi)"), "2r*sin", 'sphere "cue" position', ["column 5", "write *"]),
    (("2*r*cos(phi)", "2*r*cos(psi)"), "cos(psi)", 'sphere "cue" position', ["name psi", "column 18", "mean phi?"]),
    (("2*r*cos(phi)", "2*r*cos(phi"), "cos(phi", 'sphere "cue" position', ["column 17", 'add ")"']),
    (("2*r*cos(phi)", "sqrt(r - 1)"), "sqrt", 'sphere "cue" position', ["sqrt(-0.971425) is not a number", "r = 0.028575"]),
    (('"= asin(1 - f)"', '"= asin(1 - g)"'), "asin", "parameters.phi", ["name g", "column 12"]),
    (('"= asin(1 - f)"', '"= asin(2 - f)"'), "asin", "parameters.phi", ["asin(1.5)", "f = 0.5"]),
    (('"= asin(1 - f)"', '"= asin(1 - mu)"'), "asin", "parameters.phi", ["move mu up"]),
    (('"= asin(1 - f)"', '"= 2*phi"'), "2*phi", "parameters.phi", ["move phi up"]),
    (('"= asin(1 - f)"', '"30 degrees"'), "30 degrees", "parameters.phi", ["mean deg?", "SI units", '"= 2*pi"']),
    (('"= asin(1 - f)"', '"1,5 deg"'), "1,5 deg", "parameters.phi", ['"1.5 deg"']),
    (('"= asin(1 - f)"', '"= 30 deg"'), "30 deg", "parameters.phi", ['leave the "=" out']),
    (('"= asin(1 - f)"', '"= 30*deg"'), "30*deg", "parameters.phi", ['deg = "1 deg" if the unit is meant']),
    (("n = 2", "n = 2\nz = 1.0"), "z = 1.0", "parameters.z", ["not used", "leave it out"]),
    (("n = 2", "n = true"), "n = true", "parameters.n", ["found true"]),
    (("n = 2", "n = nan"), "n = nan", "parameters.n", ["found nan"]),
    (("n = 2", "n = 2\nsin = 1"), "sin = 1", "parameters.sin", ["another name"]),
    (("n = 2", 'n = 2\n"a b" = 1'), '"a b"', "parameters.a b", ["letters"]),
    (("n = 2", "n = 2\nname = 1"), "name = 1", "parameters.name", ["name of a [[case]]"]),
    (("f = 0.25", "ff = 0.25"), "ff = 0.25", 'case "f=0.25" ff', ["not in [parameters]", "mean f?"]),
    (("f = 0.25", 'f = "= n"'), 'f = "= n"', 'case "f=0.25" f', ["move n up"]),
    (('"= pi/3 + 0.1"', '"= pi/3 + "'), "pi/3", 'case "thin cut" phi', ["column 10"]),
    (('name = "f=0.25"\n', ""), None, "case number 1 name", ["is missing"]),
    (('name = "thin cut"', 'name = "f=0.25"'), None, 'case "f=0.25" name', ["number 1 too"]),
    (('every = "= n"', 'every = "= n + 0.5"'), "n + 0.5", "record.every", ["whole number", "2.5"]),
    (('radius = "= r"', 'radius = "= -r"'), "= -r", 'sphere "cue" radius', ["positive", "-0.028575"]),
    (('{ expression = "mu*exp(-v)" }', '"= mu*exp(-v)"'), "exp(-v)", f"{LAW} friction", ["depends on v", ': "mu*exp(-v)"']),
    (('"mu*exp(-v)"', '"= mu*exp(-v)"'), "exp(-v)", f"{LAW} friction", ['leave the "=" out']),
    (("restitution = 1.0", 'restitution = "= 1.0 < 2"'), "1.0 < 2", f"{LAW} restitution", ["column 7", "compare"]),
]  # fmt: skip


@pytest.mark.parametrize(("change", "place", "key", "parts"), WRONG, ids=[w[0][1] for w in WRONG])
def test_one_mistake_gives_one_message_with_line_column_and_cure(
    change: tuple[str, str], place: str | None, key: str, parts: list[str]
) -> None:
    text = changed(change)
    ((line, named, message),) = problems(text)
    assert named == key
    for part in parts:
        assert part in message
    if place is not None:
        assert line == line_of(text, place)


def test_mistakes_of_all_kinds_come_at_once() -> None:
    text = changed(
        ("f = 0.5", "f = 5"), ("mass = 0.17", "mass = -1"), ("cos(phi)", "cos(mu"), ('"= n"', '"= k"')
    )
    lines = [line for line, _, _ in problems(text)]
    assert lines == sorted(line_of(text, part) for part in ("asin", "mass = -1", "cos(mu", "= k"))


@pytest.mark.parametrize(
    ("change", "cure"),
    [
        (("[parameters]", "[parameter]"), "did you mean [parameters]?"),
        (("[[case]]", "[[cases]]"), "did you mean [[case]]?"),
        (("[parameters]", "[[parameters]]"), "write [parameters]"),
        (("[parameters]", "parameters = 3\n[world2]"), "write [parameters]"),
    ],
)
def test_misspelt_tables(change: tuple[str, str], cure: str) -> None:
    assert any(cure in message for _, _, message in problems(changed(change)))


def test_one_table_in_place_of_many() -> None:
    text = CUT.replace(CUT[CUT.index("[[case]]") : CUT.index("[run]")], '[case]\nname = "a"\nf = 1.0\n')
    ((line, key, message),) = problems(text)
    assert (line, key) == (line_of(text, "[case]"), "case")
    assert "write [[case]]" in message


@pytest.mark.parametrize(
    ("how", "key", "part"),
    [
        ({"case": "thin"}, "case", "did you mean thin cut?"),
        ({"set": {"fi": 1}}, "set fi", "known: r, f, phi, mu, n"),
        ({"set": {"f": "0.3"}}, "set f", "remove the quotes"),
        ({"set": {"f": "= mu"}}, "set f", "move mu up"),
        ({"set": {"f": None}}, "set f", "found nothing"),
        ({"set": {"f": 7}}, "parameters.phi", "asin(-6)"),
    ],
)
def test_what_the_caller_gives_may_be_wrong_too(how: dict[str, Any], key: str, part: str) -> None:
    ((_, named, message),) = problems(CUT, **how)
    assert named == key
    assert part in message


def test_the_name_of_a_unit_and_of_a_parameter() -> None:
    """`2*s` was 2 seconds in Python and in the file, twice the parameter with --set."""
    text = CUT.replace("mu = 0.06", "s = 0.06").replace("mu*exp", "s*exp").replace("mu = 0\n", "s = 0\n")
    for wrong, quantity in (("3*s", "3 s"), ("3/s", "3 1/s")):
        for how in ({"parameters": {"n": wrong}}, {}):
            source = text if how else text.replace("n = 2", f'n = "{wrong}"')
            ((_, _, message),) = problems(source, **how)
            assert f'may mean the unit or the parameter s; write "{quantity}" with the unit' in message
            assert f'or "= {wrong}" with the parameter' in message
    assert Scene.from_toml(text, parameters={"n": "= 50*s"}).parameters["n"] == 3.0
    computed = text.replace('"= n"', '"= 1*n"')
    assert Scene.from_toml(computed, parameters={"n": "3 s"}).parameters["n"] == 3.0


def _force(scene: Scene) -> Any:
    return scene.to_model()["loads"][0]["force"][0][1]


@pytest.mark.parametrize("place", ['[[load]]\non = "cue"\nforce = ["{}", 0, 0]', 'until = "{}"'])
def test_texts_of_files_have_one_reading(place: str) -> None:
    """`2*N` was 2 newton and `N*2` twice the parameter, in one line of a file."""
    unit = "N" if "load" in place else "s"

    def read(value: str) -> Any:
        text = CUT.replace("n = 2", f"n = 2\n{unit} = 3.0")
        line = place.format(value)
        return Scene.from_toml(
            text + line if "load" in place else text.replace('until = "= 20*1e-3"', line), parameters={}
        )

    with pytest.raises(ScenarioError, match=f'may mean the unit or the parameter {unit}; write "2 {unit}"'):
        read(f"2*{unit}")
    scene = read(f"= 2*{unit}")
    assert (_force(scene) if "load" in place else scene.run.until) == 6.0
    if "load" in place:
        assert _force(read("N*2")) == 6.0


def test_a_parameter_used_unchanged_in_a_law_has_the_dimension_of_the_place() -> None:
    text = CUT.replace("mu = 0.06", 'mu = "2 N"')
    for law in ("= mu", "mu", "(mu)"):
        ((_, _, message),) = problems(text.replace('{ expression = "mu*exp(-v)" }', f'"{law}"'))
        assert 'found "2 N", a force' in message


@given(st.text("=+-*/^()., 0123456789eErfphimunstv<[{\"'\\\n\u00b2", max_size=30))
def test_no_expression_gives_a_traceback(text: str) -> None:
    quoted = json.dumps("=" + text)
    source = CUT.replace('"= -2*r*sin(phi)"', quoted)
    try:
        Scene.from_toml(source)
    except ScenarioError as error:
        found = {p.line for p in error.problems}
    else:
        found = set()
    # the only other mistake there can be: without this expression nobody uses phi
    assert found <= {line_of(CUT, "sin(phi)"), line_of(CUT, 'phi = "= asin')}
    assert LineMap(source).source(line_of(CUT, "sin(phi)")).strip(" ,") == quoted


class TestCommandLine:
    @pytest.fixture
    def file(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
        (tmp_path / "cut.toml").write_text(CUT)
        monkeypatch.chdir(tmp_path)
        return "cut.toml"

    @staticmethod
    def carom(*arguments: str) -> int:
        with pytest.raises(SystemExit) as left:
            main(list(arguments))
        return int(left.value.code or 0)

    def test_a_run_records_case_and_parameters(self, file: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert (
            self.carom(
                "run", file, "--case", "thin cut", "--set", "phi=asin(0.9)", "--set", "until=0.004", "--json"
            )
            == 0
        )
        summary = json.loads(capsys.readouterr().out)
        directory = Path("runs/cut-thin_cut-1")
        assert summary["directory"] == str(directory)
        expected = {"r": R, "f": 0.5, "phi": math.asin(0.9), "mu": 0.0, "n": 2.0}
        about = json.loads((directory / "run.json").read_text())
        for told in (about["scenario"], summary):
            assert (told["case"], told["parameters"]) == ("thin cut", expected)
        result = carom.load(directory)
        assert (result.case, result.parameters) == ("thin cut", expected)
        assert "[parameters]" not in result.scenario
        np.testing.assert_array_equal(
            result.position[0][0],
            position(Scene.from_toml(file, case="thin cut", parameters={"phi": math.asin(0.9)})),
        )
        assert self.carom("info", str(directory)) == 0
        assert "thin cut" in capsys.readouterr().out

    def test_a_run_without_parameters_says_nothing_of_them(self, tmp_path: Path) -> None:
        scene = Scene.from_toml(Scene.from_toml(CUT).to_toml())
        result = carom.simulate(scene, out=tmp_path / "run", until=0.002)
        assert (result.case, result.parameters) == (None, {})
        assert "parameters" not in (tmp_path / "run/run.json").read_text()

    def test_check_looks_at_every_case(self, file: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert self.carom("check", file) == 0
        told = capsys.readouterr().out
        assert "phi = 0.5235987756" in told
        assert "f=0.25, thin cut" in told
        Path(file).write_text(changed(("f = 0.25", "f = 3")))
        assert self.carom("check", file) == 2
        assert 'case "f=0.25", parameters.phi' in capsys.readouterr().err
        assert self.carom("check", file, "--case", "thin cut") == 0

    @pytest.mark.parametrize(
        ("setting", "part"),
        [
            ("fi=1", "did you mean f?"),
            ("stp=1", "did you mean step?"),
            ("phi=2r", "write *"),
            ("phi=8 degrees", "did you mean deg?"),
            ("phi=8 degs", 'unknown unit "degs"; did you mean deg?'),
            ("phi=9,5 deg", '"9,5 deg" has a decimal comma'),
            ("phi=9,5e-1 deg", 'write a point: "9.5e-1 deg"'),
            ("until=1e-4,2e-4", 'cannot read the unit ",2e-4"'),  # a point would make no number of it
            ("phi=asin(r", 'cannot read "asin(r": column 5: "(" is never closed'),
            ("until=.5 mm", "expected a time"),
            ("parameters.g=1", "is no parameter of this file"),
            ("step=1", "write --set parameters.step=... or --set run.step=..."),
        ],
    )
    def test_wrong_settings(
        self, file: str, setting: str, part: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        if setting == "step=1":
            Path(file).write_text(changed(("n = 2", "n = 2\nstep = 1e-3"), ("20*1e-3", "20*step")))
        assert self.carom("check", file, "--set", setting) == 2
        assert part in capsys.readouterr().err

    @pytest.mark.parametrize("text", ["8 deg", "8*deg", "2*r", "-pi/20", "asin(.5)", "1 1/s"])
    def test_a_text_means_the_same_here_and_in_python(
        self, file: str, text: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """`2*r` was refused in Python, and `8*deg` here."""
        expected = Scene.from_toml(file, parameters={"phi": text}).parameters["phi"]
        assert self.carom("check", file, "--set", f"phi={text}", "--json") == 0
        assert json.loads(capsys.readouterr().out)["parameters"]["phi"] == expected

    def test_numbers_are_read_as_those_of_until(self, file: str, capsys: pytest.CaptureFixture[str]) -> None:
        """`.5` is no number of TOML."""
        assert self.carom("check", file, "--set", "until=.02", "--set", "step=.001", "--set", "phi=.5") == 0
        assert "phi = 0.5," in capsys.readouterr().out

    def test_a_section_tells_parameter_and_option_apart(
        self, file: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        Path(file).write_text(changed(("n = 2", "n = 2\nstep = 1e-3"), ("20*1e-3", "20*step")))
        assert self.carom("check", file, "--set", "parameters.step=2e-3", "--set", "run.step=1e-3") == 0
        assert "40 steps of 0.001 s" in capsys.readouterr().out

    def test_names_of_runs_fit_every_file_system(self) -> None:
        path = Path("a/5.3_throw.toml")
        assert run_name(path, None) == "5.3_throw"
        assert run_name(path, "phi=0 spin=-1.25/é") == "5.3_throw-phi=0_spin=-1.25_"


class TestExpression:
    def test_is_a_value_error_with_column(self) -> None:
        with pytest.raises(ValueError, match=r"column 2: .*write \*"):
            _core.Expression("2t")
        assert issubclass(_core.ExpressionError, ValueError)

    def test_evaluates_what_is_named(self) -> None:
        e = _core.Expression("a*t^2")
        assert e.variables == ["a", "t"]
        assert e.evaluate({"t": 3, "a": np.float64(0.5), "other": 1.0}) == 4.5
        assert repr(e) == 'Expression("a*t^2")'
        for values, part in (({"a": 1.0}, "t has no value"), ({"a": 1e300, "t": 1e300}, "is not finite")):
            with pytest.raises(_core.ExpressionError, match=part):
                e.evaluate(values)

    def test_every_function_takes_one_value_or_two(self) -> None:
        for name in _core.Expression.functions():
            two = name in ("atan2", "min", "max")
            arguments, wrong = ("0.5, 0.25", "0.5") if two else ("0.5", "0.5, 0.25")
            assert math.isfinite(_core.Expression(f"{name}({arguments})").evaluate({}))
            with pytest.raises(_core.ExpressionError, match=f"{name} takes {'two' if two else 'one'}"):
                _core.Expression(f"{name}({wrong})")


def test_the_old_name_of_the_parameters_warns() -> None:
    with pytest.warns(DeprecationWarning, match=r"Scene\.from_toml: set= is called parameters= now"):
        old = Scene.from_toml(CUT, set={"f": 0.3})  # type: ignore[call-arg]
    assert old == Scene.from_toml(CUT, parameters={"f": 0.3})
