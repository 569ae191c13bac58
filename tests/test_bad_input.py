"""Every mistake a person can make in a scenario file gets a one-line error with file, line, key and cure."""

from __future__ import annotations

import re
import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from carom import ScenarioError, Scene
from carom.units import UnitError, parse
from hypothesis import given
from hypothesis import strategies as st

GOOD = """\
format = 1
title = "one ball on a table"

[run]
until = 1.0
step = 1e-3

[world]
gravity = [0.0, 0.0, -9.8]

[[material]]
name = "ball"

[[material]]
name = "cloth"

[[contact]]
between = ["ball", "cloth"]
friction = 0.2
restitution = 0.5

[[contact]]
between = ["ball", "ball"]
friction = 0.1
restitution = 0.9

[[sphere]]
name = "cue"
material = "ball"
radius = "28.575 mm"
mass = 0.17
position = [0.0, 0.0, 0.028575]

[[sphere]]
name = "other"
material = "ball"
radius = "28.575 mm"
mass = 0.17
position = [0.5, 0.0, 0.028575]

[[plane]]
name = "bed"
material = "cloth"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
"""


def problems_of(text: str, folder: Path) -> list[str]:
    """The lines of the error for a scenario, which must name the file and stand on one line each."""
    path = folder / "x.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(path).validate()
    lines = str(caught.value).splitlines()
    assert len(lines) == len(caught.value.problems)
    assert all(line.startswith(f"{path}:") and "; " in line for line in lines)
    return [line.removeprefix(f"{path}:") for line in lines]


def test_the_scenario_that_the_others_spoil_is_good() -> None:
    scene = Scene.from_toml(GOOD)
    assert scene.validate() == []
    assert scene.names == ["cue", "other"]


# what is replaced in GOOD, by what, then the parts that the one message must hold
MISTAKES = {
    "unknown key": (
        "mass = 0.17\nposition = [0.5",
        "mass = 0.17\nradiuss = 1\nposition = [0.5",
        "sphere",
        "did you mean radius?",
    ),
    "unknown table": ("[world]", "[record]\nevry = 2\n[world]", "record.evry", "did you mean every?"),
    "unknown section": ("[world]", "[wrld]\na = 1\n[world]", "wrld: unknown key", "did you mean [world]?"),
    **{
        f"unknown section {section}": (
            "[world]",
            f"[[{section}]]\nname = 'a'\n[world]",
            f"did you mean [[{meant}]]?",
        )
        for section, meant in (
            ("spheres", "sphere"),
            ("balls", "sphere"),
            ("walls", "plane"),
            ("contacts", "contact"),
        )
    },
    "a single value at the top": (
        "[run]",
        "contacts = true\n[run]",
        "contacts: unknown key; contacts belongs in [record]",
    ),
    "key of another table": (
        "step = 1e-3",
        "gravity = [0, 0, 0]",
        "run.gravity",
        "gravity belongs in [world]; [run] has until, step, ",
    ),
    "key of another table, which may not be meant": (
        "[world]",
        '[[joint]]\nkind = "rod"\nbetween = ["cue", "ground"]\ntype = "fix"\n[world]',
        "kind: unknown key",
        "kind belongs in [[lattice]]; [[joint]] has name, type, ",
    ),
    "key of many tables": (
        "[world]",
        '[[outlet]]\nname = "drain"\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n[world]',
        "name: unknown key; known: low, high, inside",
    ),
    "key of a table in the table": (
        "[world]",
        '[[plane]]\nname = "p"\nmaterial = "ball"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\nvelocity = [1, 0, 0]\n[world]',
        'plane "p" velocity: unknown key; did you mean motion.surface_velocity or free.velocity? (known: name, ',
    ),
    "title below a table": ("step = 1e-3", 'title = "x"', "run.title", "top of the file"),
    "wrong unit": (
        '"28.575 mm"\nmass = 0.17\nposition = [0.0',
        '"2 s"\nmass = 0.17\nposition = [0.0',
        'sphere "cue" radius: expected a length, found "2 s", a time',
        "cm, mm",
    ),
    "unknown unit": (
        '"28.575 mm"\nmass = 0.17\nposition = [0.0',
        '"2 mn"\nmass = 0.17\nposition = [0.0',
        'unknown unit "mn"',
        "did you mean m, mm or in? otherwise",
    ),
    "no unit": (
        '"28.575 mm"\nmass = 0.17\nposition = [0.0',
        '"0.02"\nmass = 0.17\nposition = [0.0',
        "text without a unit",
        "remove the quotes",
    ),
    "negative mass": (
        "mass = 0.17\nposition = [0.0",
        "mass = -1\nposition = [0.0",
        'sphere "cue" mass: must be positive, found -1',
    ),
    "zero radius": (
        '"28.575 mm"\nmass = 0.17\nposition = [0.0',
        "0.0\nmass = 0.17\nposition = [0.0",
        "radius: must be positive, found 0",
    ),
    "nan": (
        "mass = 0.17\nposition = [0.0",
        "mass = nan\nposition = [0.0",
        "must be a finite number, found nan",
    ),
    "infinite": (
        "[0.5, 0.0, 0.028575]",
        "[0.5, inf, 0.028575]",
        'sphere "other" position: number 2: must be a finite number',
    ),
    "huge integer": (
        "mass = 0.17\nposition = [0.0",
        "mass = 1" + "0" * 400 + "\nposition = [0.0",
        "is too large, found a whole number of about 400 digits",
    ),
    "boolean for a number": ("until = 1.0", "until = true", "run.until: expected a number, found true"),
    "word for a flag": (
        "format = 1\n",
        'format = 1\nrecord.impacts = "all"\n',
        'record.impacts: expected true, false, "every" or "history", found "all"',
    ),
    "no mass": ("mass = 0.17\nposition = [0.0", "position = [0.0", 'sphere "cue": neither mass nor density'),
    "two masses": (
        "mass = 0.17\nposition = [0.0",
        "mass = 0.17\ndensity = 1\nposition = [0.0",
        "both mass and density",
    ),
    "missing key": (
        "friction = 0.2\n",
        "",
        'contact "ball"-"cloth" friction: is missing',
        "add friction = 0.2",
    ),
    "missing table": (
        "[world]\ngravity = [0.0, 0.0, -9.8]\n",
        "",
        "world: is missing",
        "add [world] and below it gravity = [0.0, 0.0, -9.8]",
    ),
    "missing format": ("format = 1\n", "", "format: is missing", "add format = 1"),
    "later format": ("format = 1", "format = 2", "format: this Carom reads format 1, found 2"),
    "two numbers": (
        "gravity = [0.0, 0.0, -9.8]",
        "gravity = [0.0, -9.8]",
        "world.gravity: expected a list of 3 numbers, found a list of 2",
    ),
    "one bracket": (
        "[[plane]]",
        "[plane]",
        "plane: expected any number of tables, found [plane]",
        "[[plane]]",
    ),
    "two brackets": ("[world]", "[[world]]", "world: expected a table", "write [world]"),
    "value for a table": ('title = "one ball on a table"', "record = 3", "record: expected a table, found 3"),
    "overlap": (
        "[0.5, 0.0, 0.028575]",
        "[0.05, 0.0, 0.028575]",
        'sphere "other" position: spheres "cue" and "other" overlap',
        "gap -0.00715 m",
        "0.00715 m further apart",
    ),
    "same place": ("[0.5, 0.0, 0.028575]", "[0.0, 0.0, 0.028575]", "overlap at the start, gap -0.05715 m"),
    "below a plane": (
        "[0.5, 0.0, 0.028575]",
        "[0.5, 0.0, 0.02]",
        'sphere "other" position: sphere "other" reaches 0.008575 m behind plane "bed"',
        "move it by",
    ),
    "wrong side": ("[0.5, 0.0, 0.028575]", "[0.5, 0.0, -0.5]", "behind plane", "reverse the normal"),
    "missing pair": (
        'between = ["ball", "cloth"]',
        'between = ["cloth", "cloth"]',
        'material "cloth": no contact law for "ball" and "cloth"',
        'plane "bed"',
        'between = ["ball", "cloth"]',
    ),
    "missing pair of equals": (
        'between = ["ball", "ball"]',
        'between = ["cloth", "cloth"]',
        'material "ball": no contact law for "ball" and "ball"',
        '"cue" and "other" can meet',
    ),
    "second law": (
        '[[sphere]]\nname = "cue"',
        '[[contact]]\nbetween = ["cloth", "ball"]\nfriction = 0\nrestitution = 0\n[[sphere]]\nname = "cue"',
        'a second law for "cloth" and "ball"',
    ),
    "unknown material": (
        'material = "cloth"',
        'material = "clooth"',
        'plane "bed" material: unknown material "clooth"',
        "did you mean cloth?",
    ),
    "name twice": ('name = "other"', 'name = "cue"', 'sphere "cue" name: there are two spheres "cue"'),
    "plane called like a sphere": (
        'name = "bed"',
        'name = "cue"',
        'plane "cue" name: there is already a sphere "cue"',
    ),
    "empty name": (
        'name = "other"',
        'name = ""',
        "name: must be 1 to 200 printable characters, found nothing",
    ),
    "friction": ("friction = 0.2", "friction = -0.2", "friction: must be zero or positive, found -0.2"),
    "restitution": (
        "restitution = 0.5",
        "restitution = 1.5",
        "restitution: must be at least 0 and at most 1, found 1.5",
    ),
    "tangential restitution": (
        "restitution = 0.5",
        "restitution = 0.5\ntangential_restitution = 1.1",
        "greater than -1 and at most 1",
    ),
    "rolling radius": (
        "restitution = 0.5",
        "restitution = 0.5\nrolling_radius = -1e-3",
        "rolling_radius: must be zero or positive",
    ),
    "zero step": ("step = 1e-3", "step = 0", "run.step: must be positive, found 0"),
    "negative step": ("step = 1e-3", "step = -1e-3", "run.step: must be positive"),
    "zero until": ("until = 1.0", "until = 0.0", "run.until: must be positive"),
    "no until": ("until = 1.0\n", "", "run.until: is missing", "it has no default"),
    "less than a step": (
        "until = 1.0",
        "until = 1e-4",
        "run.until: until = 0.0001 s is shorter than one step",
    ),
    "endless": ("step = 1e-3", "step = 1e-30", "more than 10^12 steps"),
    "unknown method": (
        "step = 1e-3",
        'method = "nsgaa"',
        'run.method: unknown value "nsgaa"',
        "did you mean nsga?",
    ),
    "unknown law": ("step = 1e-3", 'impact = "newton"', "run.impact", "sequence-paper"),
    "half an iteration": ("step = 1e-3", "max_iterations = 1.5", "expected a whole number, found 1.5"),
    "no thread": ("step = 1e-3", "threads = 0", "run.threads: must be at least 1"),
    "text for a flag": ("step = 1e-3", 'line_search = "yes"', "expected true or false"),
    "zero normal": (
        "normal = [0.0, 0.0, 1.0]",
        "normal = [0, 0, 0]",
        'plane "bed" normal: a direction must not be zero',
    ),
    "quaternion": (
        "[0.5, 0.0, 0.028575]",
        "[0.5, 0.0, 0.028575]\norientation = [2.0, 0.0, 0.0, 0.0]",
        "orientation: a unit quaternion has length 1, found 2",
        "[1, 0, 0, 0]",
    ),
    "tiny": (
        '"28.575 mm"\nmass = 0.17\nposition = [0.0, 0.0, 0.028575]',
        "1e-200\nmass = 0.17\nposition = [0.0, 0.0, 0.028575]",
        "outside 1e-12 to 1e+12",
        "check the units",
    ),
    "fast": (
        "[0.5, 0.0, 0.028575]",
        "[0.5, 0.0, 0.028575]\nvelocity = [1e30, 0, 0]",
        'sphere "other" velocity: number 1: must be at least -1e+09 and at most 1e+09',
    ),
    "far": ("[0.5, 0.0, 0.028575]", "[1e20, 0.0, 0.028575]", "more than 10^12 radii"),
    "unquoted text": (
        'name = "cue"',
        "name = cue",
        "is not TOML",
        'put text and quantities in quotes: "cue"',
    ),
    "unquoted unit": (
        '"28.575 mm"\nmass = 0.17\nposition = [0.0',
        "28.575 mm\nmass = 0.17\nposition = [0.0",
        "is not TOML",
        'in quotes: "28.575 mm"',
    ),
    "no digit before the point": (
        "mass = 0.17\nposition = [0.0",
        "mass = .17\nposition = [0.0",
        "is not TOML",
        "0.5, 1.0",
    ),
    "key twice": ("step = 1e-3", "step = 1e-3\nstep = 1e-3", "is not TOML", "may be given once"),
    "open bracket": ("normal = [0.0, 0.0, 1.0]\n", "normal = [0.0, 0.0", "is not TOML"),
    "too deep": ("normal = [0.0, 0.0, 1.0]", "normal = " + "[" * 100_000, "is not TOML"),
    "date for a number": (
        "until = 1.0",
        "until = 2026-01-01",
        "run.until: expected a number, found the date 2026-01-01",
    ),
    "time for a number": ("until = 1.0", "until = 12:30:00", "found the time 12:30:00"),
    "dates in a list": ("until = 1.0", "until = [2026-01-01]", "found [the date 2026-01-01]"),
    "endless number": (
        "until = 1.0",
        f"until = {'1' * 5000}",
        "a number of 5000 digits; write one below 1e308",
    ),
    "endless hexadecimal": (
        "until = 1.0",
        f"until = 0x{'f' * 6000}",
        "run.until: is too large, found a whole number of about 7225 digits",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_single_mistake_gives_a_single_line_with_cause_and_cure(mistake: str, tmp_path: Path) -> None:
    old, new, *parts = MISTAKES[mistake]
    assert GOOD.count(old) == 1
    text = GOOD.replace(old, new)
    lines = problems_of(text, tmp_path)
    assert len(lines) == 1, lines
    for part in parts:
        assert part in lines[0]
    number, key = re.match(r"(\d+): (?:([^:]*):)?", lines[0]).groups()
    row = text.splitlines()[int(number) - 1]
    if key and "is not TOML" not in key and number != "1":
        # the line of the key, or where it is missing that of the table
        assert re.split(r"[ .]", key)[-1] in row or re.split(r"[ .]", key)[0] in row, (row, lines)
    elif not key and mistake not in ("open bracket", "key twice"):
        assert new.splitlines()[0][:20] in row


def test_all_mistakes_are_told_at_once_also_those_between_tables(tmp_path: Path) -> None:
    text = GOOD
    for old, new in [
        ("step = 1e-3", "stp = 1e-3"),
        ("friction = 0.2\n", "friction = -1\n"),
        ("mass = 0.17\nposition = [0.5", 'mass = "1 m"\nmss = 3\nposition = [0.5'),
        ('material = "cloth"', 'material = "clth"'),
        ("[0.0, 0.0, 0.028575]", "[0.0, 0.0, -0.028575]"),
    ]:
        assert old in text
        text = text.replace(old, new)
    lines = problems_of(text, tmp_path)
    rows = [text.splitlines()[int(line.split(":")[0]) - 1] for line in lines]
    keys = ["stp =", "friction = -1", "position = [0.0", 'mass = "1 m"', "mss =", 'material = "clth"']
    assert all(row.startswith(key) for row, key in zip(rows, keys, strict=True)), rows
    assert "did you mean step?" in lines[0]
    assert 'behind plane "bed"' in lines[2]
    assert "expected a mass" in lines[3]
    assert "did you mean mass?" in lines[4]
    assert "did you mean cloth?" in lines[5]


def test_materials_are_looked_for_in_tables_with_another_mistake(tmp_path: Path) -> None:
    text = GOOD.replace('name = "cue"\nmaterial = "ball"', 'name = "cue"\nmaterial = "bal"\nmss = 1')
    text = text.replace(
        'between = ["ball", "cloth"]\nfriction = 0.2', 'between = ["ball", "clth"]\nfriction = -1'
    )
    lines = problems_of(text, tmp_path)
    assert ["did you mean ball?" in line for line in lines if '"bal"' in line] == [True]
    assert ["did you mean cloth?" in line for line in lines if 'material "clth"' in line] == [True]
    assert len(lines) == 4
    none = GOOD.replace('[[material]]\nname = "ball"', "").replace('[[material]]\nname = "cloth"', "")
    (line,) = problems_of(none.replace("mass = 0.17", "mss = 1", 1), tmp_path)[:1]
    assert "no material is declared" in line
    assert '"ball", "cloth"' in line
    assert not [line for line in problems_of(none, tmp_path) if "unknown material" in line]


def test_mass_is_asked_for_together_with_other_mistakes(tmp_path: Path) -> None:
    text = GOOD.replace("mass = 0.17\nposition = [0.5, 0.0, 0.028575]", "position = 3")
    lines = problems_of(text, tmp_path)
    assert len(lines) == 2
    assert any("neither mass nor density" in line for line in lines)


def test_an_empty_scene(tmp_path: Path) -> None:
    text = GOOD[: GOOD.index("[[sphere]]")]
    (line,) = problems_of(text, tmp_path)
    assert "the scene has no spheres; add a [[sphere]]" in line


def test_the_report_shows_the_line_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text(GOOD.replace("step = 1e-3", "stp = 1e-3  # typing error"), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(path)
    assert "\n    6 | stp = 1e-3  # typing error" in caught.value.report()
    (problem,) = caught.value.problems
    assert problem.to_dict() | {"cure": ""} == {
        "where": str(path),
        "line": 6,
        "key": "run.stp",
        "cause": "unknown key",
        "cure": "",
        "source": "stp = 1e-3  # typing error",
    }


def test_thousands_of_mistakes_are_counted_not_printed() -> None:
    sphere = '[[sphere]]\nname = "s{}"\nmaterial = "ball"\nradius = 0\nmass = 1\nposition = [{}, 0, 1]\n'
    text = GOOD + "".join(sphere.format(i, i) for i in range(1000))
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(text)
    assert len(caught.value.problems) == 1000
    assert len(str(caught.value).splitlines()) == 51
    assert "and 950 more" in str(caught.value)


def test_spheres_all_at_one_place_do_not_hang() -> None:
    scene = Scene(gravity=(0, 0, 0), run={"until": 1})
    scene.contact("a", "a", friction=0, restitution=0)
    scene.lattice("s", counts=(100, 100, 10), origin=(0, 0, 0), spacing=1e-9, radius=1, mass=1, material="a")
    with pytest.raises(ScenarioError, match="give a larger spacing"):
        scene.validate()


KEYS = st.sampled_from(["run", "world", "sphere", "rack", "lattice", "radius", "mass", "until", "x", "", "é"])
VALUES = st.recursive(
    st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["1 mm", "2 s", "ball", "cloth", 0.0, 1e300, 1e-300, 10**400])
    | st.lists(st.floats() | st.integers(-2, 2), min_size=3, max_size=4)
    | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=4,
)
GENERATORS = {
    "rack": {
        "name": "r",
        "material": "ball",
        "radius": 0.01,
        "mass": 1,
        "rows": 2,
        "apex": [0, 0, 9],
        "direction": [1, 0, 0],
    },
    "lattice": {
        "name": "l",
        "material": "ball",
        "radius": 0.01,
        "mass": 1,
        "counts": [2, 2, 2],
        "origin": [0, 0, 5],
    },
    "clump": {
        "name": "c",
        "material": "ball",
        "spheres": [[-0.01, 0, 0, 0.01], [0.005, 0, 0, 0.01]],
        "density": 1000,
        "position": [0, 5, 5],
        "orientation": [0.6, 0.8, 0, 0],
        "angular_velocity": [0, 0, 1],
    },
}


@given(st.data())
def test_any_value_at_any_place_is_taken_or_refused_in_words(data: st.DataObject) -> None:
    tree: Any = {**tomllib.loads(GOOD), **{name: [deepcopy(table)] for name, table in GENERATORS.items()}}
    place = tree
    while True:
        keys = range(len(place)) if isinstance(place, list) else sorted(place)
        key = data.draw(st.sampled_from(keys))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.integers(0, 3)) == 0:
            break
        place = place[key]
    if isinstance(place, dict) and data.draw(st.booleans()):
        key = data.draw(KEYS)
    place[key] = data.draw(VALUES)
    try:
        scene = Scene.from_toml(tomli_w.dumps(tree))
        scene.validate()
    except ScenarioError as error:
        for line in str(error).splitlines():
            assert re.match(r"scenario text:\d+: .+; .+", line)
    else:
        model = scene.to_model()
        clumps = [np.asarray(value) for clump in model.pop("clumps", ()) for value in clump.values()]
        arrays = [array for name, array in model.items() if name != "options"]
        assert all(np.isfinite(array).all() for array in (*arrays, *clumps))


class TestFiles:
    """Files that cannot be read at all."""

    def error(self, path: Path | str) -> str:
        with pytest.raises(ScenarioError) as caught:
            Scene.from_toml(path)
        assert len(str(caught.value).splitlines()) == 1
        return str(caught.value)

    def test_absent(self, tmp_path: Path) -> None:
        (tmp_path / "break.toml").write_text(GOOD)
        assert "no such file; did you mean" in self.error(tmp_path / "brake.toml")
        assert "no such file; check the path" in self.error(tmp_path / "nowhere" / "x.toml")
        assert "no such file" in self.error("nowhere.toml")
        (tmp_path / "e.toml").touch()  # the ending makes no names alike
        assert "no such file; check the path" in self.error(tmp_path / "nope.toml")

    def test_directory(self, tmp_path: Path) -> None:
        assert "is a directory" in self.error(tmp_path)

    def test_null_byte_and_overlong_name(self) -> None:
        assert "cannot be read" in self.error("a\0b.toml")
        assert "too long" in self.error("x" * 300)

    def test_not_utf8(self, tmp_path: Path) -> None:
        path = tmp_path / "x.toml"
        path.write_bytes(b"format = 1\ntitle = '\xfcber'\n")
        assert f"{path}:2: is not UTF-8 text (byte 0xfc)" in self.error(path)

    def test_binary(self, tmp_path: Path) -> None:
        path = tmp_path / "x.toml"
        path.write_bytes(bytes(range(128)))
        assert "is not TOML" in self.error(path)

    def test_standard_input_has_a_name(self) -> None:
        assert "-: no such file; the name of standard input is /dev/stdin" in self.error(Path("-"))

    @pytest.mark.parametrize("text", ["", "\n \n", "# only a comment\n"])
    def test_empty(self, tmp_path: Path, text: str) -> None:
        path = tmp_path / "x.toml"
        path.write_text(text)
        with pytest.raises(ScenarioError) as caught:
            Scene.from_toml(path)
        assert str(path) in str(caught.value)

    def test_byte_order_mark_and_windows_line_ends_are_read(self, tmp_path: Path) -> None:
        path = tmp_path / "x.toml"
        path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
        assert Scene.from_toml(path) == Scene.from_toml(GOOD)


def test_a_seed_that_is_far_too_large_is_not_said_to_be_negative() -> None:
    scene = Scene("seeds")
    for seed, limit in ((2**64, r"must be below 2\^63"), (-1, "must be zero or positive")):
        with pytest.raises(ScenarioError, match=f"seed: {limit}, found {seed}"):
            scene.packing(
                "heap",
                count=5,
                diameter=0.02,
                density=1000,
                low=(0, 0, 0),
                high=(1, 1, 1),
                material="m",
                seed=seed,
            )


@pytest.mark.parametrize(
    ("written", "dimension", "meant"),
    [
        ("3 inches", "length", "in"),
        ("20 miles/h", "speed", "mph"),
        ("20 mi / hour", "speed", "mph"),
        ("20 kph", "speed", "km/h"),
        ("2 Meters/second", "speed", "m/s"),
        ("5 degrees/s", "angular speed", "deg/s"),
    ],
)
def test_units_that_are_spelled_out_are_told_by_their_symbols(
    written: str, dimension: str, meant: str
) -> None:
    with pytest.raises(UnitError, match=rf"did you mean {re.escape(meant)}\?"):
        parse(written, dimension)


def test_a_unit_of_another_dimension_is_not_what_was_meant() -> None:
    with pytest.raises(UnitError) as caught:
        parse("3 inches", "mass")
    assert "did you mean" not in str(caught.value)
