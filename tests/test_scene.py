"""`carom.Scene`: built in Python, written as TOML, read back without the loss of a bit."""

from __future__ import annotations

import copy
import math
import os
import pickle
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError, ScenarioError, Scene, _core
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


def example() -> Scene:
    scene = Scene("one ball", gravity=(0, 0, "-9.8 m/s^2"), run={"until": 1}, record={"every": 5})
    scene.sphere(
        "cue",
        radius="28.575 mm",
        mass="170 g",
        at=(0, 0, 0.028575),
        velocity=np.array([1.8, 0, 0]),
        material="ball",
    )
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 2), material="cloth")
    scene.contact("ball", "cloth", friction=0.2, restitution=0, rolling_radius="1 mm")
    return scene


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("until", "scene: until: unknown attribute; write scene.run.until"),
        ("every", "write scene.record.every"),
        ("gravty", "did you mean gravity?"),
        ("names", "scene: names: cannot be set"),
        ("sphere", "call scene.sphere(...)"),
        ("run", "set keys of it, as scene.run.until"),
    ],
)
def test_attributes_that_nothing_reads_are_refused(name: str, told: str) -> None:
    """`scene.until = 5` did nothing."""
    with pytest.raises(carom.ScenarioError) as caught:
        setattr(example(), name, 1)
    assert told in str(caught.value)


def test_a_file_that_cannot_be_written_is_an_error_of_carom(tmp_path: Path) -> None:
    example().to_toml(tmp_path / "absent" / "x.toml")  # which makes the directory
    for path in (tmp_path, tmp_path / "absent" / "x.toml" / "y.toml", tmp_path / "a\0b"):
        with pytest.raises(CaromError, match=r"^cannot write (?!.*cannot write)(?!.* -o)"):
            example().to_toml(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no FIFOs")
def test_what_lies_under_the_name_of_a_scene_stays_what_it_is(tmp_path: Path) -> None:
    """A link was replaced by a file, a FIFO too, and who may read a file was forgotten."""
    target, link, fifo = tmp_path / "target.toml", tmp_path / "link.toml", tmp_path / "fifo"
    link.symlink_to(target.name)
    text = example().to_toml(link)  # to a file that is not there yet
    assert link.is_symlink()
    assert target.read_text() == text
    target.write_text("old")
    target.chmod(0o640)
    example().to_toml(link)
    assert (link.is_symlink(), target.stat().st_mode & 0o777, target.read_text()) == (True, 0o640, text)
    os.mkfifo(fifo)
    reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
    example().to_toml(fifo)
    assert (os.read(reader, 100_000).decode(), fifo.is_fifo()) == (text, True)
    os.close(reader)


def test_text_may_begin_with_a_byte_order_mark() -> None:
    assert Scene.from_toml("\ufeff" + example().to_toml()) == example()


def test_attributes_survive_copies_and_subclasses_have_their_own() -> None:
    scene = example()
    scene.title = "copied"
    assert scene == copy.copy(scene) == copy.deepcopy(scene) == pickle.loads(pickle.dumps(scene))

    class Mine(Scene):
        def __init__(self) -> None:
            super().__init__("mine")
            self.balls = 3

    assert pickle.loads(pickle.dumps(scene)).title == "copied"
    assert copy.copy(Mine()).balls == 3


def test_model_has_the_arrays_of_the_core() -> None:
    scene = example()
    assert scene.validate() == []
    model = scene.to_model()
    expected: dict[str, Any] = {
        "gravity": [0, 0, -9.8],
        "radius": [0.028575],
        "mass": [0.17],
        "inertia": [0.4 * 0.17 * 0.028575**2],
        "position": [[0, 0, 0.028575]],
        "velocity": [[1.8, 0, 0]],
        "angular_velocity": [[0, 0, 0]],
        "orientation": [[1, 0, 0, 0]],
        "material": [0],
        "plane_point": [[0, 0, 0]],
        "plane_normal": [[0, 0, 1]],
        "plane_material": [1],
        "law_a": [0],
        "law_b": [1],
        "friction": [0.2],
        "restitution": [0],
        "stiffness_ratio": [1],
        "tangential_restitution": [0],
        "rolling_radius": [1e-3],
        "spinning_radius": [0],
    }
    assert model.pop("options") == _core.defaults()
    assert set(model) == set(expected)
    for key, values in expected.items():
        array = model[key]
        assert array.dtype == (
            np.int64 if key in ("material", "plane_material", "law_a", "law_b") else np.float64
        )
        assert array.flags.c_contiguous
        assert array.shape == np.shape(values)
        np.testing.assert_array_equal(array, values)


def test_a_scene_without_planes_has_empty_arrays() -> None:
    model = Scene().to_model()
    assert model["plane_point"].shape == model["position"].shape == (0, 3)
    assert model["orientation"].shape == (0, 4)


def test_what_was_given_is_written_and_nothing_else() -> None:
    assert (
        example().to_toml()
        == """\
format = 1
title = "one ball"

[run]
until = 1.0

[record]
every = 5

[world]
gravity = [0.0, 0.0, -9.8]

[[material]]
name = "ball"

[[material]]
name = "cloth"

[[contact]]
between = ["ball", "cloth"]
friction = 0.2
restitution = 0.0
rolling_radius = 0.001

[[sphere]]
name = "cue"
material = "ball"
radius = 0.028575
mass = 0.17
position = [0.0, 0.0, 0.028575]
velocity = [1.8, 0.0, 0.0]

[[plane]]
name = "bed"
material = "cloth"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 2.0]
"""
    )


def test_resolved_copy_has_every_option() -> None:
    table = tomllib.loads(example().to_toml(resolved=True))
    defaults = _core.defaults()
    assert defaults.keys() <= table["run"].keys()
    assert table["sphere"][0]["orientation"] == [1.0, 0.0, 0.0, 0.0]
    assert table["record"]["contacts"] is True


def test_file_and_text_and_path(tmp_path: Path) -> None:
    scene = example()
    path = tmp_path / "x.toml"
    text = scene.to_toml(path)
    assert path.read_text(encoding="utf-8") == text
    assert Scene.from_toml(path) == Scene.from_toml(str(path)) == Scene.from_toml(text) == scene
    assert scene != example().with_options(until=2)
    assert scene != 3


def test_options_override_those_of_the_scene() -> None:
    scene = example()
    other = scene.with_options(step="0.1 ms", every=7, contacts=False)
    assert (other.run.step, other.record.every, other.record.contacts, other.run.until) == (
        1e-4,
        7,
        False,
        1.0,
    )
    assert (scene.run.step, scene.record.every, scene.record.contacts) == (1e-3, 5, True)
    with pytest.raises(ScenarioError) as caught:
        scene.with_options(stpe=1, evry=2)
    assert "carom.simulate: stpe: unknown option; write step=" in str(caught.value)
    assert "write every=" in str(caught.value)
    with pytest.raises(ScenarioError, match=r"^carom.simulate: step: must be positive, found -1; "):
        scene.with_options(step=-1)


def moved(x: float) -> list[Any]:
    return [x, {"expression": "0.1*sin(t)"}, 0]


COPIES: list[Callable[[Scene], Scene]] = [
    copy.copy,
    copy.deepcopy,
    lambda scene: scene.with_options(),
    lambda scene: pickle.loads(pickle.dumps(scene)),
    lambda scene: scene.with_options(until=1).with_options(until=1),
]
EDITS: list[Callable[[Scene], Any]] = [
    lambda scene: setattr(scene, "title", "other"),
    lambda scene: setattr(scene, "gravity", (0, 0, 0)),
    lambda scene: setattr(scene.world, "origin", (1, 0, 0)),
    lambda scene: setattr(scene.run, "step", 1e-5),
    lambda scene: setattr(scene.record, "every", 1),
    lambda scene: setattr(scene.spheres[0], "velocity", (5, 0, 0)),
    lambda scene: setattr(scene.planes[0].motion, "translation", moved(0)),
    lambda scene: scene.contacts[0].friction.update(expression="v"),
    lambda scene: scene.material("new"),
    lambda scene: scene.sphere("z", radius=0.01, mass=1, at=(9, 9, 9), material="ball"),
    lambda scene: scene.plane("wall", point=(0, 0, -1), normal=(0, 0, 1), material="ball"),
    lambda scene: scene.load(on="cue", force=(1, 0, 0)),
]


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("copied", COPIES)
def test_what_is_done_to_a_copy_does_nothing_to_the_scene_nor_the_other_way(
    copied: Callable[[Scene], Scene], edit: Callable[[Scene], Any]
) -> None:
    def made() -> Scene:
        scene = example()
        scene.contact("ball", "ball", friction={"expression": "0.1*exp(-v)"}, restitution=0.9)
        scene.contacts[0].friction = {"expression": "0.1*exp(-v)"}
        scene.planes[0].motion = {"translation": [0, 0, {"expression": "0.1*sin(t)"}]}
        return scene

    scene = made()
    other = copied(scene)
    assert other == scene
    edit(other)
    assert scene == made() != other
    edit(scene)
    assert scene == other  # so the names that the copy took were free here
    fresh = made()
    kept = copied(fresh)
    edit(fresh)
    assert kept == made()


def test_a_name_is_free_once_its_owner_is_called_otherwise() -> None:
    scene = example()
    for copied in (scene, copy.copy(scene), scene.with_options(step=1e-4)):
        copied.spheres[0].name = "white"
        again = copied.sphere("cue", radius=0.01, mass=1, at=(1, 1, 1), material="ball")
        assert copied.names == ["white", "cue"]
        for name in ("white", "cue", "bed"):
            with pytest.raises(ScenarioError, match="there is already a sphere, clump or wall"):
                copied.sphere(name, radius=0.01, mass=1, at=(2, 2, 2), material="ball")
        again.name = "red"
        copied.planes[0].name = "cue"
        copied.sphere("bed", radius=0.01, mass=1, at=(3, 3, 3), material="ball")
        assert copied.names == ["white", "red", "bed"]


def test_settings_are_checked_as_they_are_set() -> None:
    scene = example()
    scene.run.step = "2 ms"
    assert scene.run.step == 2e-3
    with pytest.raises(ScenarioError, match=r"^scene.run: step: must be positive, found 0; "):
        scene.run.step = 0
    with pytest.raises(ScenarioError, match=r"did you mean spectral_radius\?"):
        scene.run.spectral_radious = 0.5
    cue = scene.spheres[0]
    cue.velocity = ("36 km/h", 0, 0)
    assert cue.velocity == (10.0, 0.0, 0.0)
    with pytest.raises(
        ScenarioError,
        match=r'^scene.sphere\["cue"\]: velocity: expected a list of 3 numbers, found a list of 2',
    ):
        cue.velocity = (1, 2)
    assert cue.velocity == (10.0, 0.0, 0.0)
    scene.gravity, scene.title = (0, 0, 0), "free"
    assert "free" in scene.to_toml()


BALL: dict[str, Any] = {"name": "a", "radius": 1, "mass": 1, "position": (0, 0, 0), "material": "m"}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"radius": -1}, 'Scene.sphere("a"): radius: must be positive, found -1; '),
        ({"radius": "1 kg"}, 'radius: expected a length, found "1 kg", a mass'),
        ({"radius": float("nan")}, "must be a finite number"),
        ({"position": None}, 'Scene.sphere("a"): position: is missing; '),
        ({"position": 5}, "position: expected a list of 3 numbers, found 5"),
        ({"at": (0, 0, 0)}, "at: both position and at are given"),
        ({"mass": None}, "neither mass nor density is given"),
        ({"name": "cue"}, "name: there is already a sphere, clump or wall"),
        ({"name": ""}, "name: must be 1 to 200 printable characters"),
        ({"name": "a\u200bb"}, '200 printable characters, found \\u200b in "a b"; '),
    ],
)
def test_mistakes_in_spheres(keys: dict[str, Any], message: str) -> None:
    assert message in refused(lambda scene: scene.sphere(**{**BALL, **keys}))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda scene: scene.plane("p", point=(0, 0, 0), normal=(0, 0, 0), material="m"),
            'Scene.plane("p"): normal: a direction must not be zero',
        ),
        (
            lambda scene: scene.contact("cloth", "ball", friction=0, restitution=0),
            'Scene.contact("cloth", "ball"): there is already a law',
        ),
        (
            lambda scene: scene.contact("a", "b", friction=-1, restitution=2),
            "restitution: must be at least 0 and at most 1",
        ),
        (lambda scene: Scene(run={"untill": 3}), "Scene(run=...): untill: unknown key; did you mean until?"),
        (lambda scene: Scene(gravity=(0, 0)), "Scene: gravity: expected a list of 3 numbers"),
    ],
)
def test_mistakes_in_other_calls(call: Callable[[Scene], object], message: str) -> None:
    assert message in refused(call)


def refused(call: Callable[[Scene], object]) -> str:
    """The message of a call, which must leave the scene as it was."""
    scene = example()
    before = scene.to_toml()
    with pytest.raises(ScenarioError) as caught:
        call(scene)
    assert scene.to_toml() == before
    return str(caught.value)


def test_mistakes_of_the_whole_scene_name_the_calls() -> None:
    scene = Scene()
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    assert str(caught.value).splitlines() == [
        "scene: run.until: is missing; pass until=... (simulated time, s); it has no default",
        "scene: sphere: the scene has no spheres; add one with scene.sphere(...)",
    ]
    scene = example()
    scene.sphere("low", radius=0.1, mass=1, at=(0, 3, 0), material="ball")
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    assert 'scene.sphere["low"]: position: sphere "low" reaches 0.1 m behind plane "bed"' in str(caught.value)
    assert 'scene: contact: no contact law for "ball" and "ball"' in str(caught.value)


def test_additions_to_a_scene_from_a_file_are_not_blamed_on_a_line(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    example().to_toml(path)
    scene = Scene.from_toml(path)
    scene.sphere("low", radius=0.1, mass=1, at=(0, 3, 0), material="balls")
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    assert any(p.where == 'scene.sphere["low"]' for p in caught.value.problems)


def test_model_of_a_broken_scene_is_refused() -> None:
    scene = example()
    scene.spheres[0].material = "bal"
    with pytest.raises(ScenarioError, match=r"did you mean ball\?"):
        scene.to_model()


def test_errors_travel_between_processes() -> None:
    with pytest.raises(CaromError) as caught:
        Scene().validate()
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert copy.problems == caught.value.problems


def test_orientation_and_normals_are_normalised_in_the_arrays_only() -> None:
    scene = example()
    scene.spheres[0].orientation = (0.5, 0.5, 0.5, 0.5000004)
    scene.planes[0].normal = (1e-200, 0, 1e-200)
    model = scene.to_model()
    assert np.linalg.norm(model["orientation"][0]) == pytest.approx(1, abs=1e-15)
    assert np.linalg.norm(model["plane_normal"][0]) == pytest.approx(1, abs=1e-15)
    assert Scene.from_toml(scene.to_toml()) == scene
    assert scene.spheres[0].orientation[3] == 0.5000004


def test_repr_says_how_much() -> None:
    assert repr(example()) == '<Scene "one ball": 1 sphere, 1 plane, 1 contact law; 1000 steps of 0.001 s>'


# --- without loss: any scene whatever, sensible or not --------------------------------------------------

numbers = st.floats(-1e9, 1e9)
positive = st.floats(1e-300, 1e300)
vectors = st.tuples(numbers, numbers, numbers)
names = st.text(min_size=1, max_size=10).filter(lambda s: s.isprintable() and s == s.strip())


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    maybe = lambda values: draw(st.none() | values)  # noqa: E731
    scene = Scene(
        draw(st.text(max_size=20).filter(str.isprintable)),
        gravity=draw(vectors),
        run={
            "until": draw(positive),
            "step": draw(positive),
            "line_search": draw(st.booleans()),
            "threads": 3,
        },
        record={"every": draw(st.integers(1, 10**9))},
    )
    for name in draw(st.lists(names, unique=True, max_size=3)):
        scene.sphere(
            name,
            radius=draw(positive),
            density=draw(positive),
            inertia=maybe(positive),
            at=draw(vectors),
            velocity=maybe(vectors),
            angular_velocity=maybe(vectors),
            orientation=maybe(st.sampled_from([(0.6, 0.0, -0.8, 0.0), (0.0, 0.0, 0.0, -1.0)])),
            material=draw(names),
        )
    for name in draw(st.lists(names, unique=True, max_size=2)):
        scene.rack(
            name,
            rows=draw(st.integers(1, 5)),
            apex=draw(vectors),
            direction=(draw(numbers), 1, 0),
            radius=draw(positive),
            mass=draw(positive),
            material=draw(names),
            jitter=maybe(st.floats(0, 1)),
            seed=draw(st.integers(0, 2**63 - 1)),
        )
    for a, b in draw(st.lists(st.tuples(names, names), unique_by=lambda p: tuple(sorted(p)), max_size=3)):
        scene.contact(a, b, friction=draw(st.floats(0, 1e300)), restitution=draw(st.floats(0, 1)))
    return scene


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scenes())
def test_nothing_is_lost_on_the_way_to_text_and_back(scene: Scene) -> None:
    text = scene.to_toml()
    again = Scene.from_toml(text)
    assert again == scene
    assert again.to_toml() == text


# --- calls with wrong keywords ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "messages"),
    [
        (
            lambda s: s.sphere("x", radus=1),
            [
                'Scene.sphere("x"): radus: unknown keyword; write radius=',
                'Scene.sphere("x"): material: is missing; add material=...',
            ],
        ),
        (
            lambda s: s.contact("a", "b", mu=0.1, e=1.0),
            [
                'Scene.contact("a", "b"): mu: unknown keyword; write friction=',
                'Scene.contact("a", "b"): e: unknown keyword; write restitution=',
            ],
        ),
        (
            lambda s: s.contact("a", "b", 0.1, 1.0),
            ['Scene.contact("a", "b"): only a, b can be given without a name; write the others as friction='],
        ),
        (
            lambda s: carom.simulate(s, dt=1e-3, T=1.0),
            [
                "carom.simulate: dt: unknown option; write step=",
                "carom.simulate: T: unknown option; write until=",
            ],
        ),
        (lambda s: carom.simulate(s, save="x"), ["carom.simulate: save: unknown option; write out="]),
        (lambda s: carom.simulate(s, xyzzy=1), ["carom.simulate: xyzzy: unknown option; known: until, step"]),
        (lambda s: carom.simulate(3), ["simulate takes a Scene or the path of a scenario file, found int"]),
    ],
)
def test_wrong_keywords_are_explained(call: Callable[[Scene], object], messages: list[str]) -> None:
    with pytest.raises(carom.CaromError) as caught:
        call(Scene())
    lines = str(caught.value).splitlines()
    assert len(lines) == len(messages)
    assert all(line.startswith(message) for line, message in zip(lines, messages, strict=True)), lines


def test_a_path_can_be_simulated(tmp_path: Path) -> None:
    from carom.cli.examples import find

    scene = carom.Scene.from_toml(find("slide_to_roll"))
    expected = carom.simulate(scene, until=0.01).position
    for path in (find("slide_to_roll"), str(find("slide_to_roll"))):
        assert np.array_equal(carom.simulate(path, until=0.01).position, expected)


def test_the_world_is_an_attribute_and_joints_call_it_ground() -> None:
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.world.gravity = (0, 0, -1.6)
    assert scene.gravity == scene.world.gravity == (0, 0, -1.6)
    scene.contact("ball", "ball", friction=0.1, restitution=0.5)
    scene.sphere("bob", radius=0.1, mass=1, material="ball", position=(0, 0, 0))
    scene.joint("rod", between=["bob", "world"], points=[(0, 0, 0), (0, 0, 1)])
    with pytest.raises(carom.ScenarioError, match='unknown sphere "world"; known: bob, ground'):
        scene.with_options(until=1).validate()


def test_laws_are_written_alike_in_calls_and_attributes() -> None:
    """A text is an expression where the law has no unit; an attribute refused it, with advice for files."""
    scene = Scene(gravity=(0, 0, 0), periodic=(1, 1, 1))
    made = scene.contact("a", "a", friction="0.1 + 0.2*exp(-v)", restitution="0.9 - 0.01*v")
    law = scene.contact("a", "b", friction=0.1, restitution=0.5)
    law.friction, law.restitution = "0.1 + 0.2*exp(-v)", "0.9 - 0.01*v"
    assert (law.friction, law.restitution) == (made.friction, made.restitution)
    law.friction = "0.3"
    assert law.friction == 0.3
    with pytest.raises(ScenarioError, match='unknown name "t"'):
        law.friction = "exp(-t)"
    box = scene.deform(stretch=(1, "exp(-t)", 1), shear="2*t", flow="x", gradient="z")
    old = (box.stretch, box.shear)
    box.stretch, box.shear = (1, "exp(-t)", 1), "2*t"  # type: ignore[assignment]
    assert (box.stretch, box.shear) == old


def test_a_text_is_a_formula_wherever_a_law_stands() -> None:
    """In calls and in files: some took a text, others asked for the table that it stands for."""

    def scene(of: Callable[[str], Any]) -> Scene:
        made = Scene(gravity=(0, 0, 0), run={"until": 0.1, "step": 1e-3})
        made.contact("m", "m", friction=of("0.1 + exp(-v)"), restitution=of("0.9*exp(-v)"))
        for name, x in {"a": 0.0, "b": 0.1}.items():
            made.sphere(name, radius=0.01, mass=1, material="m", position=(x, 0, 0.5))
        made.load("a", force=("5 N", of("sin(t)"), 0))
        made.joint("rod", between=["a", "b"], length=of("0.1 + 0.1*t"))
        motion = {"translation": (0, 0, of("sin(t)"))}
        made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m", motion=motion)
        return made

    plain, spelled = scene(str), scene(lambda text: {"expression": text})
    assert plain == spelled
    text = spelled.to_toml()
    bare = re.sub(r"\{ expression = (.*?) \}", r"\1", text)
    assert bare.count('"sin(t)"') == 2
    assert "expression" not in bare
    assert Scene.from_toml(bare) == plain
    used = bare.replace("0.1 + exp", "k + exp").replace("0.1*t", "k*t") + "\n[parameters]\nk = 0.1\n"
    assert Scene.from_toml(used).to_model()["friction_law"] == [("expression", "(0.1) + exp(-v)")]
    for unit in ("5 N", "5*N", "5 kg m/s^2"):  # a quantity, where it can be read as one
        assert plain.load("b", force=(unit, 0, 0)).force == (5.0, 0.0, 0.0)
    with pytest.raises(ScenarioError, match=r'unknown name "v".*the variable is called t'):
        plain.load("b", force=("20*v", 0, 0))
    with pytest.raises(ScenarioError, match="remove the quotes"):
        plain.load("b", force=("20", 0, 0))


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("2*3", 6.0),
        ("sqrt(4)", 2.0),
        ("0.5+0", 0.5),
        ("-pi", -math.pi),
        ("5*N", 5.0),
        ("5 t m/s^2", 5000.0),
        ("0.1*sin(20*t))", 'column 14: ")" without a "("'),
        ("2sin(t)", "column 2: an operator is missing"),
        ("5*", "column 3: the expression ends"),
        ("2t", "column 2: an operator is missing.*to multiply"),
        ("5 N*t", "column 3: .*a formula has no units.*parameter N ="),
        ("5*sin(t) N", "column 10: .*a formula has no units"),
        ("90 deg*t^2", "a formula has no units.*parameter deg ="),
        ("t/s", 'unknown name "s".*a formula has no units'),
        ("0.5", "remove the quotes"),
        ("0,5 N", "decimal comma"),
        ("5 Newton", "mean N?"),
        ("5 kg", "a mass"),
    ],
)
def test_texts_in_place_of_forces(text: str, means: float | str) -> None:
    """What begins as a number with a unit and is a formula was called an unknown unit, also without a variable."""
    scene = Scene()
    scene.sphere("b", radius=1, mass=1, position=(0, 0, 0), material="m")
    if isinstance(means, str):
        with pytest.raises(ScenarioError, match=re.escape(means).replace(r"\.\*", ".*")):
            scene.load("b", force=(text, 0, 0))
    else:
        assert scene.load("b", force=(text, 0, 0)).force[0] == means
