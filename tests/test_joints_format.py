"""The table [[joint]]: what it means in rows, which mistakes it explains, and that a good start is never refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from carom.errors import ScenarioError
from carom.scenario.schema import json_schema
from carom.scene import Scene
from hypothesis import given, settings
from hypothesis import strategies as st

R = 0.1
ANY_POINT = (0.3, -0.2, 1.1)
TURNED = (0.5, 0.1, -0.7, 0.5)  # not a unit quaternion to the last digit: the arrays hold it normalised
CONSTANT = ("constant", 0.0)
X, Y, Z = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]


def balls(**keys: Any) -> Scene:
    """Two balls `a` at (0, 0, 1) and `b` at (0, 0, 2), without gravity; `keys` are those of `a`."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 1.0})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    scene.sphere("a", **({"radius": R, "mass": 2.0, "at": (0, 0, 1), "material": "m"} | keys))
    scene.sphere("b", radius=R, mass=1.0, at=(0, 0, 2), material="m")
    return scene


def joint_of(scene: Scene, **keys: Any) -> dict[str, Any]:
    """The first joint as the core gets it."""
    kind = keys.pop("type")
    scene.joint(kind, **keys)
    assert scene.validate() == []
    return scene.to_model()["joints"][0]


def matrix(q: Any) -> np.ndarray:
    """Rotation of a quaternion, w first, by its definition q (0, v) q*."""
    w, x, y, z = np.array(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def unit_quaternion(q: Any) -> list[float]:
    return (np.array(q) / np.linalg.norm(q)).tolist()


class TestRows:
    @pytest.mark.parametrize(
        ("keys", "expected"),
        [
            ({"type": "fix"}, [("point", X), ("point", Y), ("point", Z)]),
            ({"type": "plane", "normal": (0, 0, 3)}, [("point", Z)]),
            ({"type": "lock"}, [("rotation", X), ("rotation", Y), ("rotation", Z)]),
            ({"type": "lock", "axes": [(0, 2, 0)]}, [("rotation", Y)]),
            ({"type": "motion", "direction": (5, 0, 0), "displacement": 0.0}, [("point", X)]),
            ({"type": "motion", "axis": (0, 0, 5), "angle": 0.0}, [("rotation", Z)]),
        ],
        ids=lambda x: x["type"] if isinstance(x, dict) else "",
    )
    def test_of_a_body_and_the_ground(self, keys: dict[str, Any], expected: list[tuple[str, Any]]) -> None:
        joint = joint_of(balls(), body="a", **keys)
        assert (joint["a"], joint["b"]) == (0, -1)
        assert [(kind, direction) for kind, direction, *_ in joint["rows"]] == expected
        for kind, _, arm_a, arm_b, law in joint["rows"]:
            assert arm_a == [0, 0, 0]
            assert arm_b == ([0, 0, 1] if kind == "point" else [0, 0, 0])
            assert law == CONSTANT

    @given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 1e-3))
    def test_a_line_leaves_its_direction_free(self, direction: tuple[float, float, float]) -> None:
        joint = joint_of(balls(), type="line", body="a", direction=direction)
        frame = np.array([direction / np.linalg.norm(direction), *(row[1] for row in joint["rows"])])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
        assert {row[0] for row in joint["rows"]} == {"point"}

    @pytest.mark.parametrize("kind", ["fix", "line", "plane", "motion"])
    def test_arms_are_those_of_the_turned_body(self, kind: str) -> None:
        more: dict[str, Any] = {
            "line": {"direction": X},
            "plane": {"normal": X},
            "motion": {"direction": X, "displacement": 0},
        }.get(kind, {})
        joint = joint_of(
            balls(orientation=unit_quaternion(TURNED)), type=kind, body="a", point=ANY_POINT, **more
        )
        for _, _, arm_a, arm_b, _ in joint["rows"]:
            np.testing.assert_allclose(matrix(TURNED) @ arm_a + [0, 0, 1], ANY_POINT, atol=1e-15)
            assert arm_b == list(ANY_POINT)

    def test_of_a_ball_joint(self) -> None:
        scene = balls(orientation=unit_quaternion(TURNED))
        joint = joint_of(scene, type="ball", between=("b", "a"), point=ANY_POINT)
        assert (joint["a"], joint["b"]) == (1, 0)
        assert [row[:2] for row in joint["rows"]] == [("point", X), ("point", Y), ("point", Z)]
        for _, _, arm_b, arm_a, law in joint["rows"]:
            np.testing.assert_allclose(matrix(TURNED) @ arm_a + [0, 0, 1], ANY_POINT, atol=1e-15)
            np.testing.assert_allclose(arm_b, np.subtract(ANY_POINT, [0, 0, 2]), atol=1e-15)
            assert law == CONSTANT

    def test_of_a_rod(self) -> None:
        joint = joint_of(balls(), type="rod", between=("a", "b"))
        assert joint == {
            "a": 0,
            "b": 1,
            "rows": [("distance", [0, 0, -1], [0, 0, 0], [0, 0, 0], ("constant", 1.0))],
        }

    def test_the_ground_is_always_second(self) -> None:
        ends = [(3.0, 0, 0.5), (0, 0, 1.1)]
        first = joint_of(balls(), type="rod", between=("ground", "a"), points=ends)
        second = joint_of(balls(), type="rod", between=("a", "ground"), points=ends[::-1])
        assert first == second
        assert (first["a"], first["b"]) == (0, -1)
        ((_, _, arm_a, arm_b, (_, length)),) = first["rows"]
        np.testing.assert_allclose(arm_a, [0, 0, 0.1], atol=1e-15)
        assert arm_b == [3, 0, 0.5]
        assert length == pytest.approx(np.hypot(3, 0.6), rel=1e-15)
        locked = joint_of(balls(), type="lock", between=("ground", "a"), axes=[Z])
        assert (locked["a"], locked["b"]) == (0, -1)

    def test_laws_go_with_the_rows(self) -> None:
        law = {"expression": "1 + 0.1*sin(t)"}
        joint = joint_of(balls(velocity=(0, 0, -0.1)), type="rod", between=("a", "b"), length=law)
        assert joint["rows"][0][-1] == ("expression", law["expression"])
        joint = joint_of(balls(), type="motion", body="a", axis=Z, angle={"polynomial": [0, 0, 3]})
        assert joint["rows"][0][-1] == ("polynomial", [0, 0, 3])
        joint = joint_of(
            balls(velocity=(2, 0, 0)),
            type="motion",
            body="a",
            direction=X,
            displacement={"table": [[0, 0], [0.5, 1]]},
        )
        assert joint["rows"][0][-1] == ("table", [[0, 0], [0.5, 1]])

    def test_balls_of_generators_can_be_joined(self) -> None:
        scene = balls()
        scene.lattice("l", counts=(2, 2, 1), origin=(5, 0, 0), spacing=1, radius=R, mass=1, material="m")
        scene.joint("rod", between=("l2", "b"))
        scene.joint("fix", body="l4")
        scene.validate()
        joints = scene.to_model()["joints"]
        assert [(j["a"], j["b"]) for j in joints] == [(3, 1), (5, -1)]
        resolved = Scene.from_toml(scene.to_toml(resolved=True))
        assert resolved.to_model()["joints"] == joints
        assert "lattice" not in resolved.to_toml()

    def test_no_joints_no_key(self) -> None:
        assert not {"joints", "loads", "friction_law"} & set(balls().to_model())


class TestText:
    def test_nothing_is_lost(self) -> None:
        scene = all_types()
        text = scene.to_toml()
        again = Scene.from_toml(text)
        assert again == scene
        assert again.to_toml() == text
        assert again.to_model()["joints"] == scene.to_model()["joints"]
        assert len(scene.to_model()["joints"]) == 9

    def test_the_resolved_form_has_the_names(self) -> None:
        scene = all_types()
        resolved = Scene.from_toml(scene.to_toml(resolved=True))
        assert (
            resolved.joint_names
            == scene.joint_names
            == ["joint1", "axle", *(f"joint{k}" for k in range(3, 10))]
        )
        assert [*re.findall(r'\[\[joint\]\]\nname = "(.*)"', resolved.to_toml())] == scene.joint_names
        assert resolved.to_model()["joints"] == scene.to_model()["joints"]

    def test_satisfies_the_published_schema(self) -> None:
        import tomllib

        schema = jsonschema.Draft202012Validator(json_schema())
        raw = tomllib.loads(all_types().to_toml())
        schema.validate(raw)
        for wrong in (
            {"type": "fix"},
            {"type": "fix", "body": "a", "normal": Z},
            {"type": "lock", "body": "a", "between": ["a", "b"]},
            {"type": "motion", "body": "a", "direction": X},
            {"type": "hinge", "body": "a"},
            {"type": "rod", "between": ["a", "b"], "length": {"polynom": [1]}},
            {"type": "lock", "body": "a", "axes": []},
        ):
            assert not schema.is_valid({**raw, "joint": [wrong]}), wrong

    def test_a_joint_may_be_changed(self) -> None:
        scene = balls()
        rod = scene.joint("rod", between=("a", "b"))
        rod.length = "100 cm"
        assert rod.length == 1.0
        with pytest.raises(ScenarioError, match=r'scene.joint\("rod"\): length: must be positive, found -1'):
            rod.length = -1
        with pytest.raises(ScenarioError, match='a joint of type "rod" has no key axis'):
            rod.axis = Z


def all_types() -> Scene:
    scene = balls()
    scene.joint("fix", body="a", point=("1 mm", 0, 1))
    scene.joint("line", name="axle", body="b", direction=(1, 2, 3))
    scene.joint("plane", body="a", normal=(0, 1, 0), point=(0, 0, 1))
    scene.joint("lock", body="a")
    scene.joint("lock", between=("a", "b"), axes=[X, Y])
    scene.joint("ball", between=("a", "ground"), point=(0, 0, 0))
    scene.joint(
        "rod", between=("a", "b"), points=[(0, 0, 1.1), (0, 0, 1.9)], length={"polynomial": [0.8, 0, 1]}
    )
    scene.joint("motion", body="b", direction=X, displacement={"table": [[0, 0], [1, 0], [2, 3.5]]})
    scene.joint("motion", body="b", axis=Y, angle={"expression": "1 - cos(3*t)"})
    return scene


HEAD = """\
format = 1
[run]
until = 1.0
[world]
gravity = [0.0, 0.0, 0.0]
[[material]]
name = "m"
[[material]]
name = "wall"
[[contact]]
between = ["m", "m"]
friction = 0.1
restitution = 0.5
[[contact]]
between = ["m", "wall"]
friction = 0.1
restitution = 0.5
[[plane]]
name = "bed"
material = "wall"
point = [0.0, 0.0, -9.0]
normal = [0.0, 0.0, 1.0]
[[sphere]]
name = "ball"
material = "m"
radius = 0.1
mass = 1.0
position = [0.0, 0.0, 1.0]
[[lattice]]
name = "l"
material = "m"
radius = 0.1
mass = 1.0
counts = [1, 1, 2]
origin = [0.0, 0.0, 2.0]
velocity = [0.0, 1.0, 0.0]
[[joint]]
"""

# what stands below [[joint]] (its first line is line 38), then what the one message must hold
MISTAKES: dict[str, tuple[str, ...]] = {
    "unknown type": (
        'type = "hinge"\nbody = "ball"',
        ':38: joint "ball" type: unknown value "hinge"',
        "fix, line",
    ),
    "type is missing": ('body = "ball"', ':37: joint "ball" type: is missing', 'add type = "fix"'),
    "key of another type": (
        'type = "fix"\nbody = "ball"\nnormal = [0, 0, 1]',
        ':40: joint "ball" normal: a joint of type "fix" has no key normal; remove it; fix takes body, point',
    ),
    "missing body": (
        'type = "fix"',
        ':37: joint number 1 body: is missing in a joint of type "fix"',
        'add body = "a"',
    ),
    "missing direction": (
        'type = "line"\nbody = "ball"',
        'joint "ball" direction: is missing in a joint of type "line"',
        "add direction = [1.0, 0.0, 0.0]",
    ),
    "two kinds of motion": (
        'type = "motion"\nbody = "ball"\nangle = 0\ndisplacement = 0',
        "either direction and displacement or axis and angle",
    ),
    "half a motion": (
        'type = "motion"\nbody = "ball"\naxis = [0, 0, 1]',
        'angle: is missing in a joint of type "motion"',
        "add angle = { polynomial = [0.0, 20.0] }",
    ),
    "no motion": (
        'type = "motion"\nbody = "ball"',
        "neither direction and displacement nor axis and angle is given",
    ),
    "a point that a rotation does not have": (
        'type = "motion"\nbody = "ball"\npoint = [0, 0, 1]\naxis = [0, 0, 1]\nangle = 0',
        ':40: joint "ball" point: a joint of type "motion" has no key point',
    ),
    "lock of nothing": ('type = "lock"', "neither body nor between is given"),
    "plane": (
        'type = "fix"\nbody = "bed"',
        ':39: joint "bed" body: "bed" is a plane, and joints act on spheres; known: ',
    ),
    "plane between": (
        'type = "rod"\nbetween = ["ball", "bed"]',
        ':39: joint "ball"-"bed" between: "bed" is a plane',
        'planes never move: write "ground"',
    ),
    "ground as body": (
        'type = "fix"\nbody = "ground"',
        '"ground" is no sphere',
        "joined to the ground without saying so",
    ),
    "unknown sphere": ('type = "fix"\nbody = "bal"', 'unknown sphere "bal"; did you mean ball?'),
    "unknown ball of a lattice": ('type = "fix"\nbody = "l3"', 'unknown sphere "l3"; known: ball, l1, l2'),
    "generator instead of its balls": (
        'type = "fix"\nbody = "l"',
        'unknown sphere "l"',
        "known: ball, l1, l2",
    ),
    "twice the same": ('type = "rod"\nbetween = ["ball", "ball"]', '"ball" stands on both sides'),
    "three ends": (
        'type = "rod"\nbetween = ["ball", "l1", "l2"]',
        "expected two sphere names, found a list of 3",
    ),
    "ground without point": (
        'type = "rod"\nbetween = ["ball", "ground"]',
        "points: is missing: a point of the ground must be given; add points = [[point of ball], [point of ground]]",
    ),
    "one point": (
        'type = "rod"\nbetween = ["ball", "l1"]\npoints = [[0, 0, 1]]',
        "expected 2 vectors, found a list of 1",
    ),
    "bad point": (
        'type = "rod"\nbetween = ["ball", "l1"]\npoints = [\n  [0, 0, 1],\n  [0, "x", 1]]',
        ':42: joint "ball"-"l1" points: number 2: number 2: "x" is not a number with a unit',
    ),
    "ball without point": ('type = "ball"\nbetween = ["ball", "l1"]', "point: is missing in a joint"),
    "zero axis": (
        'type = "motion"\nbody = "ball"\naxis = [0, 0, 0]\nangle = 0',
        ":40:",
        "a direction must not be zero",
    ),
    "parallel axes": (
        'type = "lock"\nbody = "ball"\naxes = [[0, 0, 1], [0, 0, -2]]',
        ':40: joint "ball" axes: the 2 axes are parallel or lie in a plane',
    ),
    "axes in a plane": (
        'type = "lock"\nbody = "ball"\naxes = [[1, 0, 0], [0, 1, 0], [1, 1, 0]]',
        "the 3 axes are parallel",
    ),
    "more than six rows": (
        'type = "lock"\nbody = "ball"\naxes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]]',
        "expected 1 to 3 vectors, found a list of 4",
    ),
    "motion that does not begin at zero": (
        'type = "motion"\nbody = "ball"\ndirection = [1, 0, 0]\ndisplacement = { expression = "0.5*cos(t)" }',
        ':41: joint "ball" displacement: is 0.5 m at t = 0, but counts from the start; subtract 0.5 from the law',
    ),
    "angle that does not begin at zero": (
        'type = "motion"\nbody = "ball"\naxis = [1, 0, 0]\nangle = "90 deg"',
        "angle: is 1.5708 rad at t = 0",
    ),
    "rod without length": (
        'type = "rod"\nbetween = ["ball", "l1"]\nlength = 0',
        "length: must be positive, found 0",
    ),
    "rod of a length that is not": (
        'type = "rod"\nbetween = ["l1", "ball"]\nlength = 1.1',
        ':40: joint "l1"-"ball" length: is 1.1 m at t = 0, but the ends are 1 m apart',
        "give length = 1, or leave length out",
    ),
    "rod of a law that is not": (
        'type = "rod"\nbetween = ["ball", "l1"]\nlength = { polynomial = [2, 1] }',
        "give a law that begins with 1",
    ),
    "rod whose ends are one point": (
        'type = "rod"\nbetween = ["ball", "l1"]\npoints = [[0, 0, 1.5], [0, 0, 1.5]]',
        "both ends of the rod are at the same point; move one of them, or use a joint of type ball",
    ),
    "variable of another kind": (
        'type = "rod"\nbetween = ["ball", "l1"]\nlength = { expression = "1 + v" }',
        'unknown name "v" in "1 + v"; the variable is called t',
    ),
    "two joints of one name": (
        'type = "lock"\nbody = "ball"\nname = "joint2"\n[[joint]]\ntype = "lock"\nbody = "l1"\naxes = [[1, 0, 0]]',
        'joint "l1" name: there are two joints "joint2"',
    ),
    "start that violates it": (
        'type = "line"\nbody = "l1"\ndirection = [1, 0, 0]',
        'joint "l1": the speed (m/s) of the point of "l1" along',
        "is 1 at the start, the joint asks for 0",
        'velocity = [0, 0, 0] of "l1" would fit',
    ),
    "unknown key": ('type = "fix"\nbody = "ball"\npont = [0, 0, 1]', "unknown key; did you mean point?"),
    "key of a spring": ('type = "fix"\nbody = "ball"\nstiffness = 1', "stiffness belongs in [[spring]]"),
}


@pytest.mark.parametrize("mistake", MISTAKES, ids=str)
def test_each_mistake_has_one_message_with_place_and_cure(mistake: str, tmp_path: Path) -> None:
    keys, *expected = MISTAKES[mistake]
    path = tmp_path / "x.toml"
    path.write_text(HEAD + keys + "\n", encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(path).validate()
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{path}:")
    assert "; " in line
    for part in expected:
        assert part in line


def test_the_scenario_that_the_mistakes_spoil_is_good() -> None:
    assert Scene.from_toml(HEAD + 'type = "fix"\nbody = "ball"\n').validate() == []


def test_a_sphere_called_ground_is_in_the_way_only_where_the_ground_is_meant() -> None:
    scene = balls()
    scene.sphere("ground", radius=R, mass=1, at=(4, 0, 0), material="m")
    scene.joint("fix", body="ground")
    assert scene.validate() == []
    assert scene.to_model()["joints"][0]["a"] == 2
    scene.joint("rod", between=("a", "ground"), points=[(0, 0, 1), (0, 0, 0)])
    with pytest.raises(ScenarioError, match='a sphere is called "ground", which here means'):
        scene.validate()


def test_a_sphere_that_could_not_be_read_is_not_called_unknown() -> None:
    text = HEAD.replace("radius = 0.1\nmass = 1.0\nposition", "radius = -0.1\nmass = 1.0\nposition")
    with pytest.raises(ScenarioError) as caught:
        Scene.from_toml(text + 'type = "fix"\nbody = "ball"\n')
    assert len(caught.value.problems) == 1


def test_of_ten_thousand_balls_the_ranges_are_named() -> None:
    scene = balls()
    scene.lattice("s", counts=(100, 100, 1), origin=(9, 0, 0), spacing=1, radius=R, mass=1, material="m")
    scene.joint("fix", body="s10001")
    with pytest.raises(ScenarioError, match='unknown sphere "s10001"; known: a, b, s1 to s10000'):
        scene.validate()


def test_wrong_keywords_are_explained() -> None:
    with pytest.raises(ScenarioError, match=r'Scene.joint\("fix"\): bodi: unknown keyword; write body='):
        balls().joint("fix", bodi="a")  # type: ignore[call-arg]
    with pytest.raises(
        ScenarioError, match=r'Scene.joint\("fix"\): body: is missing in a joint of type "fix"'
    ):
        balls().joint("fix")


# --- the start --------------------------------------------------------------------------------------------------------


def start_error(scene: Scene) -> str:
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    return str(caught.value)


def apply_cures(scene: Scene, message: str) -> None:
    """Do what the messages say: `velocity = [...] of "a" and angular_velocity = [...] of "b" would fit`."""
    found = re.findall(r'(\w+) = \[([^]]*)\] of "(\w+)"', message)
    assert found
    for key, numbers, name in found:
        (sphere,) = (s for s in scene.spheres if s.name == name)
        setattr(sphere, key, [float(x) for x in numbers.split(",")])


vectors = st.tuples(*[st.floats(-3, 3)] * 3)


@settings(deadline=None)
@given(vectors, vectors, st.floats(1e-6, 1e6), st.sampled_from(["ground", "b"]))
def test_a_pendulum_that_swings_is_a_good_start(
    direction: tuple[float, float, float], spin: tuple[float, float, float], scale: float, other: str
) -> None:
    """Velocities computed as w x r violate the rod by their rounding, which nobody is told about."""
    if np.linalg.norm(direction) < 0.5:
        return
    scene = balls()
    arm = np.array(direction)
    a, b = scene.spheres
    b.position = (50, 20, 3)
    at = np.array(b.position) + arm
    a.position = at
    a.velocity = np.cross(np.array(spin) * scale, arm)
    scene.joint("rod", between=("a", other), points=None if other == "b" else [at, b.position])
    assert [advice for advice in scene.validate() if advice.key != "run.step"] == []


@pytest.mark.parametrize(
    ("velocity", "law"),
    [
        (0.3, {"expression": "1 + 0.1*sin(3*t)"}),
        (-0.25, {"polynomial": [1.0, -0.25, 9.0]}),
        (2.0, {"table": [[-1, -1], [0, 1], [1, 3]]}),
        (0.0, {"table": [[0.5, 1], [1, 3]]}),
        (0.0, {"expression": "1 + 0.01*(1 - cos(200*t))"}),
        (0.1 + 0.2, {"expression": "exp(0.3*t)"}),
    ],
)
def test_a_rod_may_start_with_the_speed_of_its_law(velocity: float, law: dict[str, Any]) -> None:
    scene = balls(velocity=(0, 0, -velocity))
    scene.joint("rod", between=("a", "b"), length=law)
    assert scene.validate() == []
    scene.spheres[0].velocity = (0, 0, -velocity - 0.5)
    message = start_error(scene)
    assert 'the speed (m/s) at which the ends on "a" and "b" part is' in message
    found, wanted = re.search(r"part is (\S+) at the start, the joint asks for (\S+);", message).groups()  # type: ignore[union-attr]
    assert float(found) == pytest.approx(velocity + 0.5)
    assert float(wanted) == pytest.approx(velocity, abs=1e-9)
    apply_cures(scene, message)
    assert scene.validate() == []


def test_velocities_rounded_to_a_few_digits_get_advice() -> None:
    s, c = 0.5, 0.866  # of 30 degrees
    scene = balls(velocity=(c, 0, -s))
    scene.joint("rod", between=("a", "ground"), points=[(0, 0, 1), (-0.5, 0, 1 - 0.8660254037844386)])
    (advice,) = scene.validate()
    assert "part is -1.27019e-05 at the start, the joint asks for 0; velocity = [" in str(advice)
    scene.spheres[0].velocity = (c, 0, -0.4)
    assert start_error(scene)


def test_lengths_rounded_to_a_few_digits_get_advice() -> None:
    scene = balls(position=(1, 1, 1), at=None)
    rod = scene.joint("rod", between=("a", "b"), length=1.732)
    (advice,) = scene.validate()
    assert "is 1.732 m at t = 0, but the ends are 1.73205081 m apart" in str(advice)
    rod.length = 3**0.5
    assert scene.validate() == []


@given(vectors, vectors, vectors, vectors)
@settings(deadline=None, max_examples=30)
def test_the_velocities_in_the_message_fit(v: Any, w: Any, v_b: Any, w_b: Any) -> None:
    """Two bodies in three joints: what the messages say together leaves nothing to complain about."""
    scene = balls(velocity=v, angular_velocity=w, orientation=unit_quaternion(TURNED))
    scene.spheres[1].velocity, scene.spheres[1].angular_velocity = v_b, w_b
    scene.joint("ball", between=("a", "b"), point=(0.05, 0, 1.5))
    scene.joint("fix", body="a", point=(0, 0.1, 0.7))
    scene.joint("motion", body="b", axis=(0, 1, 1), angle={"polynomial": [0, 0.7]})
    apply_cures(scene, start_error(scene))
    scene.validate()  # the figures have nine digits, so that there may be advice but no error
    assert all("follow from" not in str(advice) for advice in scene.validate())


def test_angular_velocities_count() -> None:
    scene = balls(angular_velocity=(0, 0, 5))
    scene.joint("motion", name="drive", body="a", axis=Z, angle={"polynomial": [0, 4]})
    message = start_error(scene)
    assert (
        'scene.joint("motion", name="drive"): the angular speed (rad/s) of "a" about [0, 0, 1] is 5'
        in message
    )
    assert 'the joint asks for 4; angular_velocity = [0, 0, 4] of "a" would fit' in message
    scene.spheres[0].angular_velocity = (1, 2, 4)
    assert scene.validate() == []
    scene.joint("lock", between=("a", "b"), axes=[X])
    assert 'of "a" against "b" about [1, 0, 0] is 1' in start_error(scene)


def test_joints_that_contradict_each_other() -> None:
    scene = balls()
    scene.joint("motion", body="a", direction=X, displacement={"polynomial": [0, 1]})
    scene.joint("motion", body="a", direction=X, displacement={"polynomial": [0, 2]})
    assert "no velocities fit all joints of these bodies: they contradict each other" in start_error(scene)


def test_joints_that_say_the_same_twice_get_advice() -> None:
    scene = balls()
    scene.joint("fix", body="a")
    scene.joint("lock", body="a")
    assert scene.validate() == []
    scene.joint("line", body="a", direction=(1, 1, 1))
    (advice,) = scene.validate()
    assert '2 of the 2 conditions of joint "joint3" hold the same motion as other joints' in str(advice)
    assert advice.where == 'scene.joint("line")'


def test_many_joints_are_checked_one_by_one() -> None:
    """A chain of 300 ball joints has 900 rows, more than are fitted together."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 1.0})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    for k in range(301):
        scene.sphere(f"s{k}", radius=0.1, mass=1, at=(k, 0, 0), velocity=(0, 1, 0), material="m")
    for k in range(300):
        scene.joint("ball", between=(f"s{k}", f"s{k + 1}"), point=(k + 0.5, 0, 0))
    assert scene.validate() == []
    scene.spheres[150].velocity = (1, 1, 0)
    assert len(start_error(scene).splitlines()) == 2


# --- runs: the core does with the rows what the words say ---------------------------------------------------------------


def moving(**joint: Any) -> tuple[np.ndarray, ...]:
    """Times (T,), and positions (T, 3) and rotations (T, 3, 3) of `a` and `b` that gravity, forces and torques move."""
    import carom

    scene = balls(orientation=unit_quaternion(TURNED))
    scene.gravity = (1.0, -2.0, -9.8)
    scene.load("a", force=(3, 1, {"expression": "20*sin(9*t)"}), torque=(0.01, -0.02, 0.03))
    scene.load("b", force=(-1, 0, 5), torque=(0.02, 0.01, -0.01))
    scene.joint(joint.pop("type"), **joint)
    result = carom.simulate(scene, until=0.2, every=10)
    a, b = (np.array([matrix(q) for q in result.orientation[:, k]]) for k in (0, 1))
    return result.time, result.position[:, 0], a, result.position[:, 1], b


def carried(x: np.ndarray, turn: np.ndarray, point: Any) -> np.ndarray:
    """Where a point of a body, `point` at the start, is at each time, (T, 3)."""
    return x + turn @ turn[0].T @ (np.array(point) - x[0])


def turned_about(turn: np.ndarray, axis: Any) -> np.ndarray:
    """Sum of the angles about a fixed axis from frame to frame, (T,): for small steps the integral of w . axis."""
    steps = turn[1:] @ turn[:-1].transpose(0, 2, 1)
    skew = (steps - steps.transpose(0, 2, 1)) / 2
    angles = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1) @ axis
    return np.concatenate([[0.0], np.cumsum(angles)])


class TestRuns:
    POINT = (0.05, 0.02, 1.03)

    def test_fix(self) -> None:
        _, x, turn, *_ = moving(type="fix", body="a", point=self.POINT)
        np.testing.assert_allclose(carried(x, turn, self.POINT), [self.POINT] * len(x), atol=1e-12)
        assert np.ptp(x, axis=0).max() > 1e-3

    def test_line(self) -> None:
        direction = np.array([2, 1, -0.5]) / np.linalg.norm([2, 1, -0.5])
        _, x, turn, *_ = moving(type="line", body="a", point=self.POINT, direction=direction)
        way = carried(x, turn, self.POINT) - self.POINT
        np.testing.assert_allclose(way - np.outer(way @ direction, direction), 0, atol=1e-12)
        assert np.abs(way).max() > 5e-3

    def test_plane(self) -> None:
        normal = np.array([2, -1, 0.5]) / np.linalg.norm([2, -1, 0.5])
        _, x, turn, *_ = moving(type="plane", body="a", point=self.POINT, normal=normal)
        way = carried(x, turn, self.POINT) - self.POINT
        np.testing.assert_allclose(way @ normal, 0, atol=1e-12)
        assert np.linalg.matrix_rank(way, tol=1e-4) == 2

    def test_lock(self) -> None:
        _, x, turn, *_ = moving(type="lock", body="a")
        np.testing.assert_allclose(turn, [turn[0]] * len(turn), atol=1e-12)
        assert np.ptp(x, axis=0).max() > 0.02

    def test_lock_between(self) -> None:
        _, _, turn, _, other = moving(type="lock", between=("a", "b"))
        np.testing.assert_allclose(other.transpose(0, 2, 1) @ turn, [turn[0]] * len(turn), atol=1e-12)
        assert np.abs(other[-1] - np.eye(3)).max() > 1e-3

    def test_ball(self) -> None:
        point = (0.02, 0, 1.5)
        _, x, turn, y, other = moving(type="ball", between=("a", "b"), point=point)
        np.testing.assert_allclose(carried(x, turn, point), carried(y, other, point), atol=1e-12)
        assert np.abs(turn[-1] - turn[0]).max() > 1e-2

    def test_rod(self) -> None:
        law = {"polynomial": [0.8, 0, 2.0]}
        ends = [(0, 0, 1.1), (0, 0, 1.9)]
        t, x, turn, y, other = moving(type="rod", between=("a", "b"), points=ends, length=law)
        length = np.linalg.norm(carried(x, turn, ends[0]) - carried(y, other, ends[1]), axis=1)
        np.testing.assert_allclose(length, 0.8 + 2 * t**2, atol=1e-12)

    def test_motion_along_a_direction(self) -> None:
        law = {"expression": "0.05*(1 - cos(20*t))"}
        t, x, turn, *_ = moving(
            type="motion", body="a", point=self.POINT, direction=(0, 3, 0), displacement=law
        )
        way = carried(x, turn, self.POINT) - self.POINT
        np.testing.assert_allclose(way[:, 1], 0.05 * (1 - np.cos(20 * t)), atol=1e-12)
        assert np.abs(way[-1, 2]) > 0.02

    def test_motion_about_an_axis(self) -> None:
        """The angle is the integral of w . axis, which the frames give to the second order of their distance."""
        t, _, turn, *_ = moving(
            type="motion", body="a", axis=(0, 0, 2), angle={"table": [[0, 0], [0.1, 0], [0.2, 0.4]]}
        )
        np.testing.assert_allclose(turned_about(turn, Z), np.interp(t, [0.1, 0.2], [0, 0.4]), atol=2e-3)
        assert np.abs(turn[-1] - turn[0]).max() > 1e-2
