"""`carom.billiards`: racks by the rules of the games, aims, and many shots at once."""

from __future__ import annotations

import copy
import math
import tomllib
from dataclasses import replace
from typing import Any

import carom
import numpy as np
import pytest
from billiards_values import IDEAL
from carom import CaromError, billiards, events
from carom.billiards import LAWS, rack_places, strike, table
from carom.scene.billiards.racks import numbers_of, rows_of

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


# --- racks --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("balls", range(3, 16))
def test_racks_of_every_size_are_tight_and_do_not_overlap(balls: int) -> None:
    places = rack_places(balls, 0.5)
    assert places.shape == (balls, 2)
    distance = np.linalg.norm(places[:, None] - places[None], axis=2) + 9 * np.eye(balls)
    assert distance.min() == pytest.approx(1.0)
    assert (np.isclose(distance, 1.0).sum(axis=1) >= 1).all()
    assert sum(rows_of(balls)) == balls
    loose = rack_places(balls, 0.5, gap=0.02, jitter=0.005, seed=3)
    spread = np.linalg.norm(loose[:, None] - loose[None], axis=2) + 9 * np.eye(balls)
    assert spread.min() >= 1.0
    assert np.array_equal(loose, rack_places(balls, 0.5, gap=0.02, jitter=0.005, seed=3))


def test_full_racks_are_those_of_the_format() -> None:
    from carom.scene.assembly.bodies import rack_centres
    from carom.scene.tables.balls import Rack

    for balls, shape in ((15, "triangle"), (10, "triangle"), (9, "diamond")):
        rack = Rack(
            name="r",
            material="m",
            radius=0.5,
            mass=1,
            apex=(0, 0, 0),
            direction=(1, 0, 0),
            balls=balls,
            shape=shape,
        )
        np.testing.assert_allclose(rack_places(balls, 0.5), rack_centres(rack)[:, :2], atol=1e-15)


def test_tables_racks_and_places_take_units_as_scenes_do() -> None:
    given, plain = (
        table("9ft", nose_height="37 mm", corner_angle=math.radians(142), ball_mass="170 g"),
        table("9ft").spec,
    )
    assert given.spec == replace(plain, nose_height=0.037, ball_mass=0.17)
    assert np.array_equal(rack_places(4, "28.575 mm", gap="0.1 mm"), rack_places(4, 0.028575, gap=1e-4))
    scene = given.scene()
    assert given.cue_ball(scene, ("50 cm", 0.25)).position == (0.5, 0.25, plain.ball_radius)


def test_values_print_with_range_unit_and_source() -> None:
    lines = str(LAWS).splitlines()
    assert len(lines) == 8
    assert "spin_deceleration = 10 (5 to 15) rad/s^2: middle of D. Alciatore" in lines[5]
    assert "Marlow" in lines[1]
    assert "Marlow" not in str(replace(LAWS, ball_friction="0.06"))  # of somebody else


def test_laws_take_bare_numbers_and_scenes_take_values() -> None:
    """A number keeps the unit of what it replaces, and says that it has no source; a value is a number with one."""
    other = replace(LAWS, cloth_friction=0.3, rolling_deceleration=np.float64(0.02))
    assert str(other.cloth_friction) == "0.3: given by the caller"
    assert str(other.rolling_deceleration) == "0.02 g: given by the caller"
    assert replace(LAWS, cloth_friction=0.2).cloth_friction == LAWS.cloth_friction
    written = tomllib.loads(table().scene(laws=other).to_toml())["contact"]
    assert [c["friction"] for c in written if set(c["between"]) == {"ball", "cloth"}] == [0.3]
    scene = carom.Scene("the laws of the kit on a scene of one's own")
    law = scene.contact("a", "a", friction=LAWS.ball_friction, restitution=LAWS.ball_restitution)
    assert law.friction == {"expression": LAWS.ball_friction}
    assert scene.contact("a", "b", friction=LAWS.cloth_friction, restitution=0.5).friction == 0.2
    assert carom.Scene.from_toml(scene.to_toml()) == scene
    copied = copy.deepcopy(LAWS.cloth_friction)
    assert (str(copied), copied.low, copied.value) == (str(LAWS.cloth_friction), 0.15, 0.2)
    for wrong, said in (
        (
            {"cloth_friction": "0.3"},
            'must be a finite number without a unit, found "0.3"; give a number, not a',
        ),
        ({"cloth_friction": math.nan}, "must be a finite number"),
        ({"cloth_friction": None}, "must be a finite number"),
        ({"spin_deceleration": "8 rad/s^2"}, r'must be a finite number in rad/s\^2, found "8 rad/s\^2"'),
        ({"cloth_friction": -0.3}, "must be 0 or more, found -0.3"),
        ({"ball_friction": -0.06}, "must be 0 or more, found -0.06"),
        ({"ball_friction": "-v"}, r"is -0.01 at a slip of 0.01 m/s; write max\(0, ...\) around it"),
        ({"ball_friction": "0.1 - v"}, "is -0.2 at a slip of 0.3 m/s"),
        ({"ball_restitution": 1.5}, "must be from 0 to 1, found 1.5"),
        ({"cushion_restitution": billiards.Value(1.5, "1", "nobody")}, "must be from 0 to 1, found 1.5"),
    ):
        with pytest.raises(CaromError, match=f"Laws: {next(iter(wrong))} {said}"):
            replace(LAWS, **wrong)  # type: ignore[arg-type]
    for law, said in (
        ("0.1/v", "has no finite value at v = 0"),
        ("0.1*t", "unknown name"),
        ("exp(", "cannot read"),
    ):
        with pytest.raises(CaromError, match=f"Laws: ball_friction: {said}"):
            replace(LAWS, ball_friction=law)
    assert replace(LAWS, ball_friction="max(0, 0.1 - v)").ball_friction == "max(0, 0.1 - v)"


def test_wrong_racks_are_told() -> None:
    for keys, said in (
        ({"balls": 2}, "3 to 15"),
        ({"balls": 16}, "3 to 15"),
        ({"balls": "9-ball"}, "found '9-ball'; for the rack of a game write order=\"9-ball\""),
        ({"balls": 5, "jitter": 1e-4}, "without a seed"),
        ({"balls": 5, "jitter": 1e-3, "seed": 1}, "may overlap"),
        ({"balls": 5, "gap": -1.0}, "below 0"),
        *(
            ({"balls": 5, "seed": seed}, "rack: seed must be a whole number from 0")
            for seed in (-1, 1.5, "a", True)
        ),
        ({"balls": 5, "gap": "1 kg"}, "gap: expected a length"),
    ):
        with pytest.raises(CaromError, match=said):
            rack_places(radius=0.5, **keys)  # type: ignore[arg-type]


def test_a_break_of_fifteen_runs_and_spreads() -> None:
    t = table("9ft")
    scene = t.scene(until=0.8, step=1e-3)
    t.rack(scene, 15, gap=1e-4, jitter=2e-5, seed=1)
    strike(t.cue_ball(scene), ball_speed=8.0, height=0.05)
    result = carom.simulate(scene, every=10)
    assert result.summary["unconverged"] == 0
    assert (np.asarray(result.velocity[-1])[:, 0].std()) > 0.1
    assert result.energy.total[-1] < result.energy.total[0]


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
@pytest.mark.parametrize(("order", "count"), [("8-ball", 15), ("9-ball", 9), ("10-ball", 10)])
def test_racks_by_game_follow_the_rules(order: str, count: int, seed: int | None) -> None:
    """WPA: the 1 on the foot spot, the ball of the game in the middle; 8-ball has a solid and a stripe in its corners."""
    t = table("9ft")
    scene = t.scene()
    balls = t.rack(scene, order=order, gap=2e-4, jitter=2e-5, seed=seed or 1)
    assert [ball.name for ball in balls] == [str(k) for k in range(1, count + 1)]
    at = np.array([ball.position[:2] for ball in balls])
    np.testing.assert_allclose(at[0], t.spots["foot spot"], atol=3e-5)
    # In the middle is the ball that six others touch, at the centre of the rack along its axis.
    middle = at[{"8-ball": 7, "9-ball": 8, "10-ball": 9}[order]]
    assert np.sum(np.linalg.norm(at - middle, axis=1) < 2.1 * t.spec.ball_radius) == 7
    pitch = 2 * t.spec.ball_radius + 2e-4
    np.testing.assert_allclose(middle - at[0], [math.sqrt(3) * pitch, 0.0], atol=1e-4)
    if order == "8-ball":
        last = np.flatnonzero(at[:, 0] > at[:, 0].max() - 0.01)
        ends = last[[at[last, 1].argmin(), at[last, 1].argmax()]] + 1
        assert (ends < 8).sum() == 1
    again = t.rack(t.scene(), order=order, gap=2e-4, jitter=2e-5, seed=seed or 1)
    assert [b.position for b in again] == [b.position for b in balls]


def test_seeds_draw_other_racks_of_a_game() -> None:
    drawn = {tuple(numbers_of("8-ball", seed)) for seed in range(20)}
    assert len(drawn) == 20
    assert {numbers[10] < 8 for numbers in drawn} == {True, False}  # the stripe is on either side
    assert all(sorted(numbers) == list(range(1, 16)) for numbers in drawn)
    assert numbers_of("8-ball") == numbers_of("8-ball", 0)


# --- aiming -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", ["30 deg", -0.7, 0.0])
def test_the_angle_of_a_cut_is_that_asked_for(cut: float | str) -> None:
    t = table("9ft")
    scene = t.scene(laws=IDEAL, until=0.8, step=1e-5)
    cue, ball = t.cue_ball(scene, (0.9, 0.5)), t.ball(scene, "object", (1.1, 0.7))
    direction = t.aim(cue, ball, cut=cut)
    strike(cue, ball_speed=2.0, direction=direction)
    result = carom.simulate(scene, stop=lambda view: view["object"].speed > 0, callback_every=10)
    out = result["object"].velocity[-1]
    wanted = math.radians(30) if cut == "30 deg" else float(cut)
    assert math.atan2(out[1], out[0]) - direction == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize(
    ("pocket", "y"), [("foot left", 0.4), ("side left", 0.4), ("foot right", 0.9), ((1.27, 1.27), 0.4)]
)
def test_a_ball_that_is_aimed_at_a_pocket_goes_there(pocket: str | tuple[float, float], y: float) -> None:
    t = table("9ft")
    scene = t.scene(laws=replace(LAWS, ball_friction=0.0), until=4.0, step=1e-4, record={"every": 20})
    cue, ball = t.cue_ball(scene, (0.9, y)), t.ball(scene, "object", (1.15, 0.7))
    strike(cue, ball_speed=2.5, direction=t.aim(cue, ball, pocket), height=-0.2)
    result = carom.simulate(scene, stop=lambda view: not view["object"].present)
    wanted = pocket if isinstance(pocket, str) else "side left"
    assert ("object", wanted) in [(p.ball, p.pocket) for p in t.pocketed(result)]


@pytest.mark.parametrize("radius", [0.02, 0.0286, 0.035])
@pytest.mark.parametrize("cut", [-30, 60])
def test_balls_of_unlike_radius_are_aimed_at_where_they_meet(radius: float, cut: int) -> None:
    """On the bed 2 sqrt(r1 r2) apart. Without friction the object ball leaves on the line of centres, exactly."""
    t = table("9ft")
    smooth = replace(
        LAWS, ball_friction=0.0, cloth_friction=0.0, rolling_deceleration=0.0, spin_deceleration=0.0
    )
    scene = t.scene(laws=smooth, until=0.4)
    cue, ball = t.cue_ball(scene, (0.8, 0.6), radius=radius), t.ball(scene, "object", (1.2, 0.6))
    direction = t.aim(cue, ball, cut=f"{cut} deg")
    cue.velocity = (2 * math.cos(direction), 2 * math.sin(direction), 0.0)
    out = carom.simulate(scene)["object"].velocity[-1]
    assert math.degrees(math.atan2(out[1], out[0]) - direction) == pytest.approx(cut, abs=1e-9)
    x = 0.8 + 2 * math.sqrt(radius * t.spec.ball_radius) + 1e-6
    assert t.aim(cue, t.ball(scene, "near", (x, 0.6)), cut=0.0) == 0.0
    with pytest.raises(CaromError, match="'cue' passes below 'high'; they meet"):
        t.aim(cue, t.ball(scene, "high", (0.82, 0.6, 0.2)), cut=0.0)


def test_wrong_aims_are_told() -> None:
    t = table("9ft")
    scene = t.scene()
    cue, ball = t.cue_ball(scene, (0.9, 0.4)), t.ball(scene, "object", (1.15, 0.7))
    for given, keys, said in (
        ((), {}, "give a pocket or cut="),
        (("foot left",), {"cut": 0.1}, "give a pocket or cut="),
        (("foot lef",), {}, "no pocket is called 'foot lef'; did you mean foot left"),
        (("head right",), {}, r"the cut would be 16\d deg, and must be below 90"),
        ((), {"cut": 30}, "cut: 30 rad is more than a turn; write '30 deg'"),
        ((), {"cut": "90 deg"}, "between -90 deg and 90 deg, found 90 deg"),
        (((1.15, 0.7),), {}, "'object' lies at the place"),
    ):
        with pytest.raises(CaromError, match=said):
            t.aim(cue, ball, *given, **keys)  # type: ignore[arg-type]
    with pytest.raises(carom.CaromError, match="aim: 'cue' is aimed at itself"):
        t.aim(cue, cue, "foot left")
    with pytest.raises(CaromError, match="overlap"):
        t.aim(cue, t.ball(scene, "near", (0.92, 0.4)), cut=0.0)
    carom_table = table("carom")
    with pytest.raises(CaromError, match="the table has none"):
        carom_table.aim(cue, ball, "foot left")
    for keys, said in (
        ({"order": "9ball"}, "no game is called '9ball'; did you mean 9-ball"),
        ({"order": "9-ball", "balls": 15}, "9-ball has 9 balls, found 15"),
        ({"balls": 16}, "3 to 15"),
        ({"order": "9-ball", "seed": -1}, "rack: seed must be a whole number from 0, found -1"),
    ):
        with pytest.raises(CaromError, match=said):
            t.rack(t.scene(), **keys)  # type: ignore[arg-type]


# --- many shots ---------------------------------------------------------------------------------------------------------


def test_a_batch_stops_each_case_and_names_its_pockets() -> None:
    """Each case has the bits and the pockets of `simulate` with the same condition, whatever the number of threads."""
    t = table("9ft")
    scene = t.scene(until=12.0, step=5e-4)
    t.ball(scene, "other", (2.0, 0.9))
    strike(t.cue_ball(scene, (0.4, 0.4)), ball_speed=1.0, direction=(-1, -1), height=0.4)
    vx = np.array([-0.7, -0.3, 0.5, 3.0])
    keys: dict[str, Any] = {"stop": events.AtRest(ignore_spin=True), "callback_every": 20}
    batch = carom.simulate_batch(scene, {"cue.velocity.x": vx}, threads=2, **keys)
    assert batch.ok.all()
    assert (batch.outcome == "stopped").all()
    assert len(set(batch.time)) == len(vx)
    found = t.pocketed(batch)
    assert [[p.pocket for p in case] for case in found] == [["head right"], [], [], []]
    assert np.isnan(batch.left_at[1:]).all()
    assert math.dist(batch.left_at[0, 1, :2], (0, 0)) < t.spec.corner_mouth
    for case in range(len(vx)):
        single = carom.simulate(batch.scene(case), **keys)
        assert single.outcome.message == batch.message[case] == "by AtRest"
        assert single.outcome.time == batch.time[case]
        assert np.array_equal(single.position[-1], batch.position[case], equal_nan=True)
        assert t.pocketed(single) == found[case]


def test_what_a_stop_of_a_batch_raises_goes_on() -> None:
    t = table("9ft")
    scene = t.scene(until=0.1, step=1e-3)
    t.cue_ball(scene)

    def fails(view: Any) -> bool:
        raise RuntimeError("no condition")

    with pytest.raises(RuntimeError, match="no condition") as caught:
        carom.simulate_batch(scene, {"cue.velocity.x": [1.0, 2.0]}, stop=fails)
    assert (caught.value.result.outcome == "not_run").any()  # type: ignore[attr-defined]
    for keys, said in (
        ({"stop": 3}, "simulate_batch: stop must be a function"),
        ({"callback_every": 5}, "simulate_batch: callback_every is given without stop"),
        ({"stop": fails, "callback_every": 0}, "simulate_batch: callback_every must be a number of steps"),
    ):
        with pytest.raises(CaromError, match=said):
            carom.simulate_batch(scene, {"cue.velocity.x": [1.0]}, **keys)  # type: ignore[arg-type]


def test_touching_balls_are_aimed_at_whichever_way_their_places_round() -> None:
    """Frozen balls are as balls a hair apart are; the ball that is struck straight on goes along the line of centres."""
    tables = table("9ft")
    for angle in np.linspace(-3.1, 3.1, 100):
        aims = []
        for reach in (1.0, 1.0 + 1e-9):
            scene = tables.scene()
            cue = tables.cue_ball(scene, at=(1.0, 0.6))
            way = np.array([math.cos(angle), math.sin(angle)])
            ball = tables.ball(scene, "1", at=np.add((1.0, 0.6), 2 * reach * cue.radius * way))
            aims.append([tables.aim(cue, ball, cut=cut) for cut in ("-40 deg", 0.0, "89 deg")])
            straight = tables.aim(cue, ball, np.add((1.0, 0.6), way))
            assert reach > 1 or straight == pytest.approx(angle, abs=1e-8)
        np.testing.assert_allclose(*aims, atol=1e-6)
        assert aims[0][1] == pytest.approx(angle, abs=1e-12)
    near = tables.scene()
    balls = [tables.ball(near, name, at=(x, 0.6)) for name, x in (("a", 1.0), ("b", 1.057))]
    with pytest.raises(CaromError, match="overlap"):
        tables.aim(*balls, cut=0.1)


def test_a_rack_that_does_not_fit_leaves_nothing() -> None:
    tables = table("9ft")
    scene = tables.scene()
    tables.cue_ball(scene)
    with pytest.raises(CaromError, match="outside"):
        tables.rack(scene, order="9-ball", apex=(2.35, 0.6))
    assert scene.names == ["cue"]
    tables.ball(scene, "5", at=(1.0, 0.3))
    with pytest.raises(CaromError, match="already"):
        tables.rack(scene, order="9-ball")
    assert scene.names == ["cue", "5"]
    assert len(tables.rack(scene, order="9-ball", prefix="r")) == 9
