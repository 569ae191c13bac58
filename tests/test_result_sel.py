"""Parts of a result, momentum and energies by ball, and what notebooks show."""

from __future__ import annotations

import copy
import math
import pickle
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.result.selection import chosen_frames

ROOT = Path(__file__).parent.parent
pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


@pytest.fixture(scope="module")
def result() -> carom.Result:
    """The cradle of five, without gravity: momentum is conserved."""
    return carom.simulate(ROOT / "scenarios" / "newtons_cradle.toml", every=10)


@pytest.fixture(scope="module")
def sliding() -> carom.Result:
    """Three balls that slide on a floor, the first against the others: contacts in every frame but that of the start."""
    scene = carom.Scene("sliding", run={"until": 0.05, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for name, x, v in (("a", 0.0, 0.6), ("b", 0.03, 0.0), ("c", 0.06, 0.0)):
        scene.sphere(name, radius=0.01, mass=0.01, material="m", at=(x, 0, 0.01), velocity=(v, 0, 0))
    return carom.simulate(scene, walls=True)


def test_one_ball_of_a_part(result: carom.Result) -> None:
    part = result.sel(time=slice(0.01, 0.02), body=["ball5", "ball2"])
    ball = part["ball2"]
    assert np.array_equal(ball.velocity, part.velocity[:, 1])
    assert (ball.name, ball.mass, len(ball.time)) == ("ball2", result["ball2"].mass, 11)
    whole = result["ball2"].impacts
    assert np.array_equal(ball.impacts["step"], np.asarray(whole["step"])[part._within(whole["time"])])
    assert [body.name for body in part] == part.names
    with pytest.raises(CaromError, match="did you mean ball5"):
        part["ball55"]
    with pytest.raises(CaromError, match="no body is called 'ball1'"):
        part["ball1"]  # of the result, not of the part
    assert "1 frame," in repr(result.sel(time=0.01))


def test_results_go_to_other_processes(result: carom.Result) -> None:
    for copied in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        assert np.array_equal(copied.position, result.position)
        assert copied.origin == result.origin == "memory"
    part = result.sel(body="ball2")
    assert np.array_equal(pickle.loads(pickle.dumps(part)).position, part.position)


def test_time_and_bodies(result: carom.Result) -> None:
    part = result.sel(time=slice(0.01, 0.02), body=["ball5", "ball1"])
    inside = np.flatnonzero((np.asarray(result.time) > 0.0099) & (np.asarray(result.time) < 0.0201))
    assert len(part) == len(inside) == 11
    assert part.names == ["ball5", "ball1"]
    for key in ("position", "orientation", "velocity", "angular_velocity", "present"):
        whole = np.asarray(getattr(result, key))
        assert np.array_equal(getattr(part, key), whole[inside][:, [4, 0]])
    assert np.array_equal(part.time, np.asarray(result.time)[inside])
    assert np.array_equal(part.step, np.asarray(result.step)[inside])
    assert part.bodies["mass"].shape == (2,)
    assert len(part.steps) == len(part.energy.time) == 101
    assert part.energy.time[0] == pytest.approx(0.01)
    assert "11 frames, t = 0.01 to 0.02 s; ball5, ball1" in repr(part)


def test_the_ways_to_say_which(result: carom.Result) -> None:
    assert result.sel().position.shape == (len(result), 5, 3)
    assert result.sel(body="ball2").names == ["ball2"]
    assert result.sel(body=-1).names == ["ball5"]
    assert result.sel(body=slice("ball2", "ball4")).names == ["ball2", "ball3", "ball4"]
    assert result.sel(body=slice(1, 3)).names == ["ball2", "ball3"]
    assert result.sel(time=0.0104).time.tolist() == pytest.approx([0.01])
    assert result.sel(time=[0.02, 0.01]).time.tolist() == pytest.approx([0.02, 0.01])
    assert len(result.sel(time=slice(None, None, 10))) == 6
    assert len(result.sel(time=slice("10 ms", math.inf))) == len(result.sel(time=slice("10 ms", None)))
    empty = result.sel(time=slice(0.0101, 0.0102))
    assert empty.position.shape == (0, 5, 3)
    assert len(empty.impacts) == len(empty.steps) == 0
    for wrong, said in (
        ({"body": "bal1"}, "did you mean ball1"),
        ({"body": 7}, "there are 5"),
        ({"time": 1.0}, "outside of the frames"),
        ({"time": "1"}, "text without a unit; remove the quotes"),
        ({"time": "1 m"}, "expected a time"),
        ({"time": ["20 ms", None]}, "sel: time must be a finite number .*, found nothing"),
        ({"time": slice(5, 6)}, r"slice\(5, 6\) holds none of the frames; give times from 0 to 0\.05"),
        ({"time": slice(-2, -1)}, "holds none of the frames"),
        ({"time": slice(0.02, 0.01)}, r"slice\(0\.02, 0\.01\) holds none .* the smaller one first"),
        ({"time": slice(float("nan"), 1)}, "sel: time must be a finite number"),
        ({"time": [True, False]}, "a mask has a truth for each frame"),
        ({"body": [True, False]}, "a mask has a truth for each body, 5 here, and this one has 2"),
        ({"body": True}, "no body is called True"),
        ({"body": slice("ball4", "ball2")}, "'ball4' comes after 'ball2'"),
        ({"time": float("nan")}, "sel: time must be a finite number"),
        ({"body": slice(0.5, 2)}, "names or numbers"),
        ({"body": [["ball1"]]}, "no body is called"),
        ({"body": ["ball1", "ball2", 0]}, 'body: "ball1" is given twice; leave out one'),
        ({"time": slice(0, 1, 0.1)}, "counts frames"),
    ):
        with pytest.raises(CaromError, match=said):
            result.sel(**wrong)  # type: ignore[arg-type]


def test_masks_and_units(result: carom.Result) -> None:
    late = np.asarray(result.time) > 0.02
    assert 0 < late.sum() == len(result.sel(time=late)) == len(result.sel(time=late.tolist()))
    assert len(result.sel(time=result.time > 0.02)) == late.sum()
    some = np.array([True, False, False, True, False])
    assert result.sel(body=some).names == result.sel(body=some.tolist()).names == ["ball1", "ball4"]
    assert result.sel(body=~some).sel(body=[False, True, True]).names == ["ball3", "ball5"]
    assert result.sel(body=result.bodies["mass"] > 1e9).names == []
    assert np.array_equal(result.sel(time="20 ms").time, result.sel(time=0.02).time)
    assert np.array_equal(result.sel(time=slice("10 ms", 0.02)).time, result.sel(time=slice(0.01, 0.02)).time)
    assert result.sel(time=["20 ms", 0.01]).time.tolist() == pytest.approx([0.02, 0.01])


def test_a_clump_by_its_name_and_one_ball_of_it() -> None:
    """docs/reference/results.md: one ball has its share of the momentum of the clump, not mass times its own velocity."""
    scene = carom.Scene("rods", run={"until": 0.02, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    scene.sphere("a", radius=0.01, mass=0.01, material="m", at=(1, 0, 0))
    rod = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01]]
    for name, x in (("one", 0.0), ("two", 0.5)):
        scene.clump(
            name, spheres=rod, density=2500, material="m", position=(x, 0, 0), angular_velocity=(0, 0, 5)
        )
    result = carom.simulate(scene)
    two = result.clumps["two"]
    assert result.sel(body="two").names == two.balls
    assert result.sel(body=["a", "two"]).names == ["a", *two.balls]
    assert result.sel(body=["two", "a"]).sel(body="two").names == two.balls
    assert result.sel(body=[*two.balls[1:], "a"]).sel(body="two").names == two.balls[1:]
    with pytest.raises(CaromError, match="no body or clump is called 'one'"):
        result.sel(body="two").sel(body="one")
    ball = result.sel(body=two.balls[0])
    mass = float(np.asarray(ball.bodies["mass"])[0])
    assert ball.momentum == pytest.approx(mass * two.velocity)
    assert np.abs(ball.momentum - mass * ball.velocity[:, 0]).max() > 0.9 * mass * 5 * 0.01


def test_nearest_frames_are_those_of_a_search_through_all() -> None:
    time = np.arange(7) * 0.1
    given = np.concatenate([np.linspace(0, 0.6, 61), 0.5 * (time[1:] + time[:-1])])
    wanted = np.abs(time[:, None] - given).argmin(axis=0)
    assert chosen_frames(time, given).tolist() == wanted.tolist()
    assert chosen_frames(time[:1], [0.0, 0.0]).tolist() == [0, 0]
    many = np.arange(200_000) * 1e-3  # a table of all differences would be 320 GB
    assert np.array_equal(chosen_frames(many, many), np.arange(200_000))


def test_tables_are_cut_alike(result: carom.Result) -> None:
    part = result.sel(slice(0, 0.03), "ball3")
    body = np.asarray(result.impacts["body"])
    wanted = (body == 2).any(axis=1) & (np.asarray(result.impacts["time"]) <= 0.03)
    assert len(part.impacts) == wanted.sum() > 0
    contacts = result.sel(time=slice(None, None, 7)).contacts
    assert set(np.asarray(contacts["frame"]) % 7) <= {0}


def test_contacts_of_one_frame_of_a_part(sliding: carom.Result) -> None:
    """`at(k)` of chosen rows has the chosen rows of the k-th chosen frame, and no others."""
    whole, time = sliding.contacts, np.asarray(sliding.time)
    for wanted in (slice(0.02, 0.04), slice(None, None, 7), [0.03, 0.01, 0.01]):
        part = sliding.sel(time=wanted)
        for k in (*range(len(part)), -1):
            number = int(np.abs(time - part.time[k]).argmin())
            assert np.array_equal(part.contacts.at(k)["impulse"], whole.at(number)["impulse"])
            assert set(part.contacts.at(k)["time"]) <= {part.time[k]}
    of_ball = sliding.sel(body="b").contacts
    slips = whole.where(np.asarray(whole["status"]) == 2)
    for chosen, good in (
        (of_ball, lambda t: (t["body"] == 1).any(axis=1)),
        (slips, lambda t: t["status"] == 2),
    ):
        frames = [chosen.at(k) for k in range(len(time))]
        assert all(np.asarray(good(frame)).all() for frame in frames)
        assert 0 < sum(map(len, frames)) == len(chosen) < len(whole)
    one = whole.at(20)
    assert len(one.at(0)) == len(one) > len(one.between("b").at(-1)) > 0


def test_a_frame_that_a_part_does_not_have(sliding: carom.Result) -> None:
    part = sliding.sel(time=slice(0.01, 0.02)).contacts
    for table, frame, told in (
        (part, 11, "no frame 11 among 11 frames; give one of -11 to 10"),
        (part, 1.5, "no frame 1.5"),
        (sliding.sel(time=slice(0.0101, 0.0102)).contacts, 0, "among 0 frames; there are none"),
        (sliding.contacts.at(3), 1, "no frame 1 among 1 frame; give one of -1 to 0"),
    ):
        with pytest.raises(IndexError, match=told) as caught:
            table.at(frame)  # type: ignore[arg-type]
        assert isinstance(caught.value, CaromError)
    with pytest.raises(CaromError, match="rows of the whole table"):
        _ = part.ends


def test_walls_and_joints_of_a_part(sliding: carom.Result) -> None:
    """Their rows are those of the result in these frames: what is since the last frame is since that of the run."""
    part = sliding.sel(time=slice(0.01, None, 10), body="b")
    rows = [10, 20, 30, 40, 50]
    whole, wall = sliding.walls["floor"], part.walls["floor"]
    rowed = ("time", "position", "orientation", "present", "impulse", "angular_impulse", "force", "torque")
    for name in rowed:
        assert np.array_equal(getattr(wall, name), np.asarray(getattr(whole, name))[rows]), name
    assert (wall.force[:, 2] < 0).all()
    assert np.array_equal(part.joint_impulse, np.asarray(sliding.joint_impulse)[rows])
    assert list(part.walls) == sliding.wall_names
    assert len(part.residuals.where(part.residuals["step"] < 10)) == 0 < len(part.residuals)
    assert len(part.events) == len(part.transitions) == len(part.impulses) == 0  # as of the result
    assert part.box(0) is None


def test_clumps_of_a_part() -> None:
    scene = carom.Scene("clumps", run={"until": 0.02, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    for name, x in (("one", 0.0), ("two", 1.0)):
        spheres = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01]]
        scene.clump(
            name, spheres=spheres, mass=1.0, position=(x, 0, 0), angular_velocity=(1, 2, 3), material="m"
        )
    result = carom.simulate(scene)
    part = result.sel(time=[0.02, 0.0], body=result.clumps["two"].balls[0])
    assert list(part.clumps) == ["two"]
    whole, clump = result.clumps["two"], part.clumps["two"]
    for name in ("time", "present", "position", "orientation", "origin", "velocity", "angular_momentum"):
        assert np.array_equal(getattr(clump, name), np.asarray(getattr(whole, name))[[20, 0]]), name
    assert (clump.balls, clump.mass) == (whole.balls, whole.mass)


def test_names_of_clumps_end_slices_and_are_told() -> None:
    scene = carom.Scene("clumps", run={"until": 1e-3, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    for k in range(30):  # messages list twenty balls
        scene.sphere(f"a{k}", radius=0.01, mass=1.0, position=(0, 0, 0.1 * k), material="m")
    for k in range(1, 4):
        spheres = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01]]
        scene.clump(f"rod{k}-", spheres=spheres, mass=1.0, position=(k, 0, 0), material="m")
    result = carom.simulate(scene)
    both = ["rod1-1", "rod1-2", "rod2-1", "rod2-2"]
    assert result.sel(body=slice("rod1-", "rod2-")).names == both
    assert result.sel(body=slice("rod3-", None)).names == result.clumps["rod3-"].balls
    part = result.sel(body=["rod2-2", "a3", "rod1-1"])
    assert part.sel(body=slice("rod2-", "rod1-")).names == part.names
    with pytest.raises(CaromError, match="no body or clump is called 'rod1'; did you mean rod1-"):
        result.sel(body="rod1")
    with pytest.raises(CaromError, match="known: rod1-, rod2-, rod3-, a0"):
        result.sel(body="x")
    with pytest.raises(CaromError, match=r"no body is called 'rod1-'; it is a clump: take clumps\['rod1-'\]"):
        result["rod1-"]
    with pytest.raises(CaromError, match="did you mean a29"):
        result["a299"]
    with pytest.raises(CaromError, match="comes after"):
        result.sel(body=slice("rod2-", "rod1-"))


def test_tables_of_what_happens_are_cut_too() -> None:
    scene = carom.Scene("leaves", run={"until": 0.5, "step": 1e-3, "method": "events"}, gravity=(0, 0, 0))
    for name, v in (("first", 2.0), ("second", 1.0), ("stays", 0.0)):
        scene.sphere(name, radius=0.01, mass=1.0, at=(0, v, 0), velocity=(v, 0, 0), material="m")
    scene.contact("m", "m", friction=0, restitution=1)
    scene.outlet(low=(0.2, 0, -1), high=(9, 9, 1))
    result = carom.simulate(scene)
    assert list(result.events["ball"]) == ["first", "second"]
    for time, body, left in (
        (slice(0.05, 0.15), None, ["first"]),
        (None, ["second", "stays"], ["second"]),
        (slice(0.05, 0.15), "second", []),
    ):
        part = result.sel(time, body)
        assert list(part.events["ball"]) == [name for name, _ in part.events.left()] == left
        assert len(part.transitions) == len(left)


def test_a_part_of_a_part(sliding: carom.Result) -> None:
    part = sliding.sel(time=slice(0.01, 0.04), body=["c", "a"])
    again = part.sel(time=slice(None, None, 10), body="a")
    assert np.array_equal(again.position, np.asarray(sliding.position)[[10, 20, 30, 40]][:, [0]])
    assert len(again.contacts.at(1)) == len(sliding.contacts.at(20).between("a"))
    backwards = sliding.sel(time=[0.03, 0.01, 0.02]).sel(time=[0.0101, 0.0299])
    assert backwards.time.tolist() == pytest.approx([0.01, 0.03])
    for wrong, told in (({"body": "b"}, "no body is called 'b'"), ({"time": 0.0}, "times from 0.01 to 0.04")):
        with pytest.raises(CaromError, match=told):
            part.sel(**wrong)  # type: ignore[arg-type]


def test_what_a_part_does_not_have(sliding: carom.Result) -> None:
    part = sliding.sel(body="a")
    for name in ("save", "export", "plot", "view", "scene", "wall_names", "path"):
        with pytest.raises(AttributeError, match=f"no attribute '{name}'; take it from the whole result"):
            getattr(part, name)
    with pytest.raises(AttributeError, match="start, stop and every choose frames"):
        _ = part.export  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match=r"no attribute 'walks'$"):
        _ = part.walks  # type: ignore[attr-defined]
    assert not hasattr(part, "scene")
    for function in (
        carom.events.detect,
        carom.events.first_contacts,
        carom.audit.check,
        carom.audit.rerun,
    ):
        with pytest.raises(CaromError, match="give a function the whole one"):
            function(part)  # type: ignore[operator]


def test_momentum_and_energy_by_ball(result: carom.Result) -> None:
    mass = result.bodies["mass"][0]
    start = np.array([mass, 0.0, 0.0])
    np.testing.assert_allclose(result.momentum, np.tile(start, (len(result), 1)), atol=1e-15 * 100)
    np.testing.assert_allclose(result.kinetic_energy[0], [0.5 * mass, 0, 0, 0, 0])
    np.testing.assert_allclose(result.kinetic_energy[-1], [0, 0, 0, 0, 0.5 * mass], atol=1e-12)
    kinetic = result.energy.kinetic[np.asarray(result.step)[1:].astype(int) - 1]
    np.testing.assert_allclose(result.kinetic_energy[1:].sum(axis=1), kinetic, rtol=1e-12)
    assert result.potential_energy.shape == (len(result), 5)
    assert (result.potential_energy == 0).all()


def test_angular_momentum_of_a_thrown_spinning_ball() -> None:
    scene = carom.Scene("thrown", run={"until": 0.2, "step": 1e-3})
    scene.sphere(
        "b", radius=0.1, mass=2.0, at=(1, 0, 0), velocity=(0, 3, 0), angular_velocity=(0, 0, 5), material="m"
    )
    result = carom.simulate(scene)
    inertia = result.bodies["inertia"][0]
    assert result.angular_momentum[0].tolist() == pytest.approx([0, 0, 6.0 + 5 * inertia])
    assert result.angular_momentum_about((1, 0, 0))[0].tolist() == pytest.approx([0, 0, 5 * inertia])
    # dL/dt = r x m g
    t, x = np.asarray(result.time), np.asarray(result.position)[:, 0]
    torque = np.cross(x, [0, 0, -2.0 * 9.8])
    change = np.diff(result.angular_momentum, axis=0) / np.diff(t)[:, None]
    np.testing.assert_allclose(change, 0.5 * (torque[1:] + torque[:-1]), atol=1e-4)
    total = result.kinetic_energy.sum(axis=1) + result.potential_energy.sum(axis=1)
    np.testing.assert_allclose(total, total[0], rtol=1e-12)


def test_balls_that_are_absent_count_nothing() -> None:
    scene = carom.Scene("leaves", run={"until": 0.5, "step": 1e-3}, gravity=(0, 0, 0))
    for name, v in (("goes", 1.0), ("stays", 0.0)):
        scene.sphere(name, radius=0.1, mass=1.0, at=(0, v, 0), velocity=(v, 0, 0), material="m")
    scene.contact("m", "m", friction=0, restitution=1)
    scene.outlet(low=(0.2, 0, -1), high=(9, 9, 1))
    result = carom.simulate(scene)
    assert result.momentum[0, 0] == 1.0
    assert result.momentum[-1].tolist() == [0, 0, 0]
    assert np.isfinite(result.angular_momentum).all()
    assert np.isfinite(result.potential_energy).all()


def test_tables_for_other_programs(result: carom.Result) -> None:
    part = result.sel(slice(0, 0.01), ["ball1", "ball2"])
    pytest.importorskip("pandas", reason="the extra [interop] is not installed")
    frame = part.to_pandas()
    assert len(frame) == 22
    for k, axis in enumerate("xyz"):
        assert np.array_equal(frame[f"position_{axis}"].to_numpy().reshape(11, 2), part.position[..., k])
    pytest.importorskip("xarray", reason="the extra [interop] is not installed")
    assert part.to_xarray().sizes["body"] == 2


def test_energies_and_bodies_are_tables_too(result: carom.Result) -> None:
    pytest.importorskip("pandas", reason="the extra [interop] is not installed")
    energy, part = result.energy.to_pandas(), result.sel(slice(0, 0.01), "ball2")
    assert list(energy) == ["time", "kinetic", "potential", "total"]
    assert all(np.array_equal(energy[name], getattr(result.energy, name)) for name in energy)
    assert len(part.energy.to_pandas()) == len(part.steps)
    bodies = result.bodies.to_pandas()
    assert bodies["name"].tolist() == result.names
    assert np.array_equal(bodies["radius"], result.bodies.radius)
    assert part.bodies.to_pandas()["name"].tolist() == ["ball2"]
    planes = result.planes.to_pandas()
    assert all(np.array_equal(planes[f"normal_{x}"], result.planes.normal[:, k]) for k, x in enumerate("xyz"))


def test_misspelt_names_have_a_guess(result: carom.Result) -> None:
    with pytest.raises(AttributeError, match="did you mean radius"):
        result.bodies.raduis  # noqa: B018
    with pytest.raises(AttributeError) as error:
        result.sel().posiiton  # type: ignore[attr-defined]  # noqa: B018
    assert error.value.name == "posiiton"  # by these a traceback says which was meant
    assert "position" in dir(error.value.obj)


class Tags(HTMLParser):
    """Whether all tags are closed, and which there are."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_notebooks_see_tables_without_markup_of_the_user(result: carom.Result) -> None:
    text = result._repr_html_()
    page = Tags(text)
    assert not page.open
    assert "ball5" in text
    assert "done" in text
    scene = carom.Scene("<script>alert(1)</script>", run={"until": 0.01})
    for k in range(25):
        scene.sphere(f"<b>{k}", radius=0.1, mass=1.0, at=(k, 0, 0), material="m&m")
    scene.contact("m&m", "m&m", friction={"expression": "0.1*v"}, restitution=1)
    small = carom.simulate(scene)
    batch = carom.simulate_batch(scene, {"gravity": np.zeros((2, 3))})
    for shown in (scene._repr_html_(), small._repr_html_(), batch._repr_html_()):
        found = Tags(shown)
        assert not found.open
        assert found.seen <= {"div", "strong", "table", "thead", "tbody", "tr", "th", "td"}
    assert "and 5 more" in small._repr_html_()
    assert "law of the slip speed" in scene._repr_html_()
    assert "until 0.01 s" in scene._repr_html_()
    empty = carom.Scene()._repr_html_()
    assert "until not given<" in empty
    assert ">none<" in empty
    assert "done: 2" in batch._repr_html_()
