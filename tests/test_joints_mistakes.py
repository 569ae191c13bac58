"""The table [[joint]]: which mistakes it explains."""

from __future__ import annotations

from pathlib import Path

import pytest
from carom import ScenarioError, Scene
from joint_format_scenes import R, balls

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
        ':40: joint "ball" point: a joint of type "motion" with axis and angle has no key point; remove it; motion with'
        " axis and angle takes body, axis, angle",
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


@pytest.mark.parametrize("what", ["joint", "load", "spring"])
def test_of_a_clump_its_balls_are_named(what: str) -> None:
    scene = balls()
    rod = [[-R, 0, 0, R], [R, 0, 0, R]]
    scene.clump("rod", spheres=rod, material="m", density=2500, position=(0, 0, 9))
    if what == "joint":
        scene.joint("fix", body="rod")
    elif what == "load":
        scene.load("rod", force=(1, 0, 0))
    else:
        scene.spring("rod", "a", stiffness=1.0)
    acts = "joints act" if what == "joint" else f"a {what} acts"
    with pytest.raises(
        ScenarioError, match=f'"rod" is a clump, and {acts} on spheres; its balls are rod1 to rod2'
    ):
        scene.validate()
