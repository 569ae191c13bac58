"""`carom.billiards`: cushions, pockets and tables against rules and closed forms, and where a ball may be put."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from billiards_values import G, laws
from carom import CaromError, ScenarioError, billiards, events
from carom.billiards import TABLES, strike, table
from carom.cli import main
from carom.scene.billiards.data import SNOOKER
from carom.scene.billiards.walls import noses, outlets

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


# --- tables -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["9ft", "snooker", "carom"])
@pytest.mark.parametrize("e", [0.85, 0.6])
def test_a_cushion_gives_back_what_its_nose_and_the_bed_let(kind: str, e: float) -> None:
    """A ball that its weight holds on the bed comes back with e; one that nothing holds with (1 + e) cos^2 theta - 1."""
    t = table(kind)
    smooth = laws(
        ball_friction=0.0,
        cushion_restitution=e,
        cushion_friction=0.0,
        cloth_friction=0.0,
        cloth_restitution=0.0,
        rolling_deceleration=0.0,
        spin_deceleration=0.0,
    )
    for gravity, exact, within in ((G, e, 1e-9), (0.0, (1 + e) * math.cos(t.nose_angle) ** 2 - 1, 2e-3)):
        scene = t.scene(laws=smooth, gravity=gravity, until=0.02, step=2e-5)
        # The ball touches the nose when its centre is r cos theta before the rail.
        ball = t.ball(scene, "b", (0.75 * t.spec.length, t.reach + 0.01))
        ball.velocity = (0.0, -1.0, 0.0)
        result = carom.simulate(scene)
        v = result["b"].velocity[-1]
        assert v[1] == pytest.approx(exact, abs=within)
        assert abs(v[0]) < 1e-12
        [hit] = [event for event in events.first_contacts(result) if event.other != "bed"]
        assert hit.other.startswith("cushion ")
        assert hit.time == pytest.approx(0.01, abs=3e-5)


def test_a_ball_in_the_air_is_pressed_down_by_the_nose() -> None:
    t = table("9ft")
    scene = t.scene(gravity=0.0, until=0.01, step=2e-5)
    ball = t.ball(scene, "b", (0.7, t.reach + 0.005))
    ball.velocity = (0.0, -2.0, 0.0)
    ball.position = (0.7, t.reach + 0.005, t.spec.ball_radius + 0.001)
    result = carom.simulate(scene, until=0.003)
    assert result["b"].velocity[-1, 2] < -0.1


@pytest.mark.parametrize(
    ("start", "aim", "pocket"),
    [
        ((0.4, 0.4), (0.0, 0.0), "head right"),
        ((2.0, 1.0), (2.54, 1.27), "foot left"),
        ((1.27, 0.6), (1.27, 0.0), "side right"),
        ((0.4, 0.032), (0.0, 0.02), "head right"),
    ],
)
def test_pockets_take_balls_out(start: tuple[float, float], aim: tuple[float, float], pocket: str) -> None:
    t = table("9ft")
    scene = t.scene(until=2.0, step=5e-4, record={"every": 20})
    ball = t.ball(scene, "b", start)
    way = np.subtract(aim, start)
    strike(ball, ball_speed=1.0, direction=tuple(way), height=0.4)
    result = carom.simulate(scene, stop=lambda view: not view.present.any())
    assert [(p.ball, p.pocket) for p in t.pocketed(result)] == [("b", pocket)]
    assert 0.2 < t.pocketed(result)[0].time < 2.0


def test_a_ball_that_flies_over_the_rail_is_off_the_table() -> None:
    t = table("9ft")
    scene = t.scene(until=1.0, step=5e-4)
    ball = t.ball(scene, "b", (0.7, 0.3))
    ball.velocity = (0.0, -2.0, 1.5)
    result = carom.simulate(scene)
    assert [(p.ball, p.pocket) for p in t.pocketed(result)] == [("b", "off the table")]


def test_the_stairs_of_a_corner_follow_the_edge_of_the_slate() -> None:
    """They once all lay on its near side, and took balls up to 6 mm too early."""
    t = table("9ft")
    s = t.spec
    middle = 0.5 * s.corner_mouth / math.sqrt(2) - s.corner_shelf / math.sqrt(2)  # of the edge, along x and y
    boxes = [(np.array(low[:2]), np.array(high[:2])) for low, high in outlets(t.spec)]
    along, off = np.meshgrid(np.linspace(-0.8, 0.8, 201) * s.ball_radius, np.linspace(-8e-3, 8e-3, 161))
    x = np.stack([middle + (off + along) / math.sqrt(2), middle + (off - along) / math.sqrt(2)], axis=-1)
    taken = np.zeros(off.shape, dtype=bool)
    for low, high in boxes[4:]:  # the first four are over the rails, above the nose
        taken |= ((x >= low) & (x <= high)).all(axis=-1)
    assert off[taken].max() < 3.1e-3
    assert off[~taken].min() > -3.1e-3
    assert off[taken].max() == pytest.approx(-off[~taken].min(), abs=2e-4)


def test_a_ball_beside_a_pocket_stays() -> None:
    t = table("9ft")
    scene = t.scene(until=0.1, step=1e-3)
    r = t.spec.ball_radius
    for k, place in enumerate([(0.12, r), (1.27, r), (r, 0.12), (0.06, 0.06)]):
        t.ball(scene, f"b{k}", place)
    result = carom.simulate(scene)
    assert t.pocketed(result) == []
    assert np.linalg.norm(result.velocity[-1], axis=1).max() < 1e-9


def test_all_tables_build_valid_scenes_with_a_rack_and_go_through_toml() -> None:
    for kind in TABLES:
        t = table(kind)
        scene = t.scene(until=0.1, step=1e-3)
        t.rack(scene, 6)
        strike(t.cue_ball(scene), ball_speed=0.5)
        assert scene.validate() == []
        assert carom.Scene.from_toml(scene.to_toml()) == scene
        assert len(scene.wall_names) == (5 if kind == "carom" else 1 + 6 + 12)
        assert kind in repr(t)
    with pytest.raises(CaromError, match="did you mean snooker"):
        table("snoker")
    with pytest.raises(CaromError, match="name='x' cannot be changed; a table is called as its kind, '9ft'"):
        table("9ft", name="x")
    assert table(name="snooker").spec == table("snooker").spec
    assert table().spec.name == "9ft"
    with pytest.raises(CaromError, match="did you mean nose_height"):
        table("9ft", nose_hight=0.03)
    with pytest.raises(CaromError, match="nose_height must be"):
        table("9ft", nose_height=0.02)
    with pytest.raises(CaromError, match="both"):
        table("9ft", side_mouth=0.0)
    for keys, said in (
        ({"ball_mass": -0.17}, "ball_mass must be above 0"),
        ({"ball_radius": "28 g"}, "ball_radius: expected a length, found"),
        ({"nose_height": [0.037]}, "nose_height must be a finite number in SI units"),
        ({"corner_angle": "1 rad"}, "from 90 deg to below 180 deg, found 57.2958 deg"),
        ({"corner_angle": 142}, "corner_angle: 142 rad is more than a turn; write '142 deg'"),
        ({"length": math.nan}, "length must be a finite number"),
        ({"corner_mouth": -0.1}, "corner_mouth must not be below 0"),
        ({"corner_mouth": 2.0}, "leave no cushion"),
        ({"side_angle": "20 deg"}, "side_angle is that between nose and facing"),
    ):
        with pytest.raises(CaromError, match=said):
            table("9ft", **keys)
    for call, said in (
        (lambda: t.ball(t.scene(), "b", (1.0,)), r"at must be \(x, y\)"),
        (lambda: t.rack(t.scene(), apex=(1.0, 0.7, 0.1)), r"apex must be \(x, y\), found"),
        (lambda: t.rack(t.scene(), prefix=None), "prefix must be a text, found None"),  # type: ignore[arg-type]
        (lambda: t.rack(t.scene(), apex=3), r"apex must be \(x, y\)"),  # type: ignore[arg-type]
        (lambda: t.scene(gravity="g"), "gravity must be a finite number"),  # type: ignore[arg-type]
        (lambda: t.scene(laws=3), "laws must be of billiards.Laws"),  # type: ignore[arg-type]
    ):
        with pytest.raises(CaromError, match=said):
            call()
    with pytest.raises(CaromError, match="no spot"):
        t.rack(t.scene(), apex="fot spot")
    with pytest.raises(ScenarioError):
        t.scene(untl=3)


def test_the_spots_of_snooker_are_those_of_the_rules() -> None:
    """WPBSA, section 1, rule 1 (d) to (f), in inches; seen from the baulk end yellow lies right of green."""
    t = table("snooker")
    inch, middle = 0.0254, 0.5 * t.spec.width
    at = {name: t.spots[name] for name in SNOOKER}
    np.testing.assert_allclose([at[name][0] for name in ("yellow", "green", "brown")], 29 * inch, atol=5e-4)
    np.testing.assert_allclose(
        [at["yellow"][1], at["green"][1]], middle + 11.5 * inch * np.array([-1, 1]), atol=5e-4
    )
    assert at["black"][0] == pytest.approx(t.spec.length - 12.75 * inch, abs=5e-4)
    assert at["blue"][0] == 0.5 * t.spec.length
    assert at["pink"][0] == 0.5 * (at["blue"][0] + t.spec.length)
    assert {at[name][1] for name in ("brown", "blue", "pink", "black")} == {middle}
    assert not set(SNOOKER) & set(table("9ft").spots)


@pytest.mark.parametrize(
    ("at", "said"),
    [
        (
            (3.0, 0.5),
            r"'9' at \(3, 0.5\) m is outside of the rails: the bed is 0 to 2.54 m along x and 0 to 1.27 m",
        ),
        ((-0.01, 0.5), "'9' at .* is outside of the rails"),
        ((1.27, -0.01), "'9' at .* is outside of the rails"),
        ((0.005, 0.005), "'9' at .* is behind the edge of the slate, in the pocket 'head right'"),
        ((1.27, 1.3), "'9' at .* is outside of the rails"),
        (("100 in", "51 in"), "'9' at .* is outside of the rails"),
        (
            (2.53, 0.6),
            r"'9' at \(2.53, 0.6\) m overlaps the cushion foot by 15.9 mm; .* 0.02751 m or more from",
        ),
        ((2.54, 0.6), "'9' at .* overlaps the cushion foot by 20.9"),
        ((1.0, 0.5, 0.01), r"'9' at \(1, 0.5\) m overlaps the bed: its centre is at a height of 0.01 m"),
    ],
)
def test_a_ball_outside_of_the_rails_is_named(at: tuple[float, float], said: str) -> None:
    t = table("9ft")
    with pytest.raises(CaromError, match=said):
        t.ball(t.scene(), "9", at)


@pytest.mark.parametrize("kind", ["9ft", "snooker", "carom"])
def test_a_ball_is_refused_where_a_run_would_refuse_it(kind: str) -> None:
    """Along the rails, in the mouths of the pockets, and a hair before and behind the line where a ball touches a nose."""
    t = table(kind)
    r, length, width = t.spec.ball_radius, t.spec.length, t.spec.width
    rng = np.random.default_rng(1)
    places = [*(t.reach * k for k in (0.5, 1 - 1e-3, 1 + 1e-9, 1.1))]
    points = [(x, 0.3 * width) for x in places] + [(0.3 * length, width - y) for y in places]
    points += [(x, y) for x, y in rng.uniform(0, 0.2 * r + 2 * t.spec.corner_mouth, (40, 2))]
    points += [(0.5 * length + x, y) for x, y in rng.uniform(-3 * r, 3 * r, (40, 2)) if y > 0]

    def told(call: Any) -> str:
        try:
            call()
        except CaromError as error:
            return str(error)
        return ""

    refused = []
    for at in points:
        by_table = told(lambda at=at: t.ball(t.scene(), "b", at))
        if "in the pocket" in by_table or "outside" in by_table:
            continue  # without an overlap
        scene = t.scene(until=0.1, step=1e-3)
        scene.sphere("b", radius=r, mass=t.spec.ball_mass, material="ball", position=(*at, r))
        by_run = told(scene.validate)
        assert ("overlaps the" in by_table) == ("reaches" in by_run), (at, by_table, by_run)
        refused.append(bool(by_run))
    assert refused.count(True) >= 6
    assert refused.count(False) >= 4


def test_a_ball_in_the_air_and_one_of_another_size_are_where_they_are_put() -> None:
    t = table("9ft")
    scene = t.scene(until=0.1, step=1e-3)
    assert t.ball(scene, "high", (1.0, 0.5, "10 cm")).position == (1.0, 0.5, 0.1)
    assert t.ball(scene, "small", (1.5, 0.5), radius="26.25 mm").position == (1.5, 0.5, 0.02625)


def test_a_ball_is_put_at_one_place() -> None:
    t = table("9ft")
    with pytest.raises(CaromError, match="'1': both position and at are given"):
        t.ball(t.scene(until=1.0), "1", at=(1.2, 0.5), position=(9, 9, 9))


@pytest.mark.parametrize("every", [1, 20])
@pytest.mark.parametrize("speed", [3.0, 3.000001])
def test_pockets_do_not_depend_on_frames(every: int, speed: float) -> None:
    """At 3 m/s the ball comes to the outlet at the end of the fifth step."""
    t = table("9ft")
    scene = t.scene(until=1.0)
    t.ball(scene, "b", at=(1.27, 0.15, 0.09), velocity=(0.0, -speed, 0.0))
    result = carom.simulate(scene, every=every)
    assert result.transitions["event"].tolist() == ["outlet"]
    assert [p.pocket for p in t.pocketed(result)] == ["side right"]


@pytest.mark.parametrize("inwards", [1, -1])
@pytest.mark.parametrize("pocket", ["side", "head"])
def test_a_ball_that_flies_over_the_rail_is_pocketed_between_the_points_alone(
    pocket: str, inwards: int
) -> None:
    """2 mm to either side of the end of a nose."""
    t = table("9ft")
    s = t.spec
    point = 0.5 * (s.length - s.side_mouth) if pocket == "side" else s.corner_mouth / math.sqrt(2)
    inside = inwards if pocket == "side" else -inwards
    scene = t.scene(until=0.2)
    t.ball(scene, "b", at=(point + 2e-3 * inside, 0.15, 0.078), velocity=(0.0, -3.0, 0.0))
    found = [p.pocket for p in t.pocketed(carom.simulate(scene))]
    assert found == [f"{pocket} right" if inwards > 0 else "off the table"]


@pytest.mark.parametrize("at", [(1.27, -0.004), (0.03, 0.03), (1.27, 1.273)])
def test_a_ball_may_hang_over_a_pocket(at: tuple[float, float]) -> None:
    t = table("9ft")
    scene = t.scene(until=0.05, step=1e-3)
    t.ball(scene, "hangs", at)
    assert t.pocketed(carom.simulate(scene)) == []


def test_a_shot_is_told_alike_by_both_methods() -> None:
    t = table("9ft")
    scene = t.scene(until=2.5, step=1e-4)
    cue = t.cue_ball(scene, at=(1.6, 0.635))
    t.ball(scene, "1", at=(1.27, 0.635))
    t.ball(scene, "2", at=(0.4, 0.3))
    billiards.strike(cue, ball_speed="3 m/s", direction="0 deg")  # off the foot cushion, and back to ball 1
    stepped, exact = (
        t.shot(carom.simulate(scene, method=method, step=step))
        for method, step in (("nsga", 1e-4), ("events", 2.5))
    )
    assert exact.first == "1" == stepped.first
    assert exact.cushions("cue")[0] == "cushion foot"
    assert [h.other for h in exact.hits][:2] == [exact.cushions("cue")[0], "1"]
    assert [(h.ball, h.other) for h in exact.hits][:2] == [(h.ball, h.other) for h in stepped.hits][:2]
    for a, b in zip(exact.hits[:2], stepped.hits, strict=False):
        assert a.time == pytest.approx(b.time, abs=1e-3)
        assert a.speed == pytest.approx(b.speed, rel=2e-3)
    assert not exact.scratch
    assert not [h for h in exact.hits if "2" in (h.ball, h.other)]


def test_a_ball_that_is_only_pushed_is_named() -> None:
    """By topspin, frozen to the cue ball: nothing closes, and "hits no ball" was all that was said."""
    t = table("9ft")
    scene = t.scene(until=0.5)
    at = 1.0 + 2 * t.spec.ball_radius
    t.cue_ball(scene, at=(1.0, 0.6), angular_velocity=(0, 60, 0))
    t.ball(scene, "1", at=(at, 0.6))
    t.ball(scene, "2", at=(1.0, 0.9))
    shot = t.shot(carom.simulate(scene))
    assert shot.pushed == ("1",)
    assert str(shot) == "cue pushes 1 and hits no ball."


@pytest.mark.parametrize("run", [{}, {"method": "nsga", "step": 5e-4}])
def test_what_a_pushed_ball_does_is_of_the_shot(run: dict[str, Any]) -> None:
    """A pushed ball stays one when it hits or sinks later, and what it hits is moved by the cue ball; one that lay still
    until it was hit is none.
    """
    t = table("9ft")
    middle, width, reach = 0.5 * t.spec.length, t.spec.width, 2 * t.spec.ball_radius
    lean = np.array([math.sin(math.radians(30)), math.cos(math.radians(30))])
    hangs = np.array([middle, width - 0.012])
    at = hangs - 0.2 * lean
    scene = t.scene(until=1.1, **run)
    t.cue_ball(scene, at=at, angular_velocity=(-250, 0, 0))
    t.ball(scene, "1", at=at + reach * lean)
    t.ball(scene, "2", at=at + reach * lean * (-1, 1))
    t.ball(scene, "3", at=hangs)
    result = carom.simulate(scene)
    shot = t.shot(result)
    assert (shot.pushed, shot.first) == (("1", "2"), None)
    seldom = carom.simulate(scene, every=len(result.steps["step"]))
    assert t.shot(seldom).pushed == ("1", "2")  # no frame shows that 1 moved before its hit: the hit does
    assert ("1", "3") in [(hit.ball, hit.other) for hit in shot.hits]
    assert str(shot) == "cue pushes 1, 2 and hits no ball. Gone: 3 (side left)."

    row = t.scene(until=0.2, **run)
    t.cue_ball(row, at=(middle, 0.6), angular_velocity=(-150, 0, 0))
    for name, place in (("1", (0, 1)), ("2", (0, 2)), ("3", (1, 0))):
        t.ball(row, name, at=(middle + place[0] * reach, 0.6 + place[1] * reach))
    t.ball(row, "4", at=(middle + 2.5 * reach, 0.6), velocity=(-0.9, 0, 0))
    shot = t.shot(carom.simulate(row))
    assert "3" in {hit.ball for hit in shot.hits}
    assert shot.pushed == ("1", "2")

    alone = t.scene(until=1.0, **run)
    t.cue_ball(alone, at=(middle, width - 0.3), angular_velocity=(-150, 0, 0))
    t.ball(alone, "1", at=(middle, width - 0.3 + reach))
    assert (
        str(t.shot(carom.simulate(alone)))
        == "cue pushes 1 and hits no ball. Gone: 1 (side left). Scratch (side left)."
    )


@pytest.mark.parametrize("run", [{}, {"method": "nsga", "step": 2e-4}])
@pytest.mark.parametrize("beside", [0.0, 1e-4, 2.37e-3, 8e-3])
def test_the_point_of_a_pocket_is_one_cushion(beside: float, run: dict[str, Any]) -> None:
    """It is the end of a cushion and of its facing, which met the ball at one point and counted twice."""
    t = table("9ft")
    scene = t.scene(until=0.1, **run)
    x = 0.5 * (t.spec.length - t.spec.side_mouth)
    t.cue_ball(scene, at=(x + beside, t.spec.width - 0.1), velocity=(0.0, 1.0, 0.0))
    result = carom.simulate(scene)
    walls = {wall for ball, wall in result.impacts.pair.tolist() if "left" in wall}
    assert walls == {"cushion left head", "facing left head a"}
    assert t.shot(result).cushions("cue") == ["cushion left head"]


def test_a_corner_is_two_cushions() -> None:
    t = table("9ft", corner_mouth=0.0, side_mouth=0.0)
    scene = t.scene(until=0.2)
    inner = t.reach + 0.05
    t.cue_ball(scene, at=(inner, inner), velocity=(-1.0, -1.0, 0.0))
    assert sorted(t.shot(carom.simulate(scene)).cushions("cue")) == ["cushion head", "cushion right"]


def test_a_result_has_its_shots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One for each ball that was struck, with what it pocketed, as the table reads it; words say the same."""
    t = table("9ft")
    scene = t.scene(until=2.0)
    cue, ball = t.cue_ball(scene, at=(1.9, 0.635)), t.ball(scene, "7", at=(2.2, 0.9))
    other = t.ball(scene, "white", at=(0.4, 0.3))
    billiards.strike(cue, speed=1.5, direction=t.aim(cue, ball, "foot left"))
    billiards.strike(other, speed=0.1, direction="90 deg")
    result = carom.simulate(scene, out=tmp_path / "run")
    assert result.shots == [t.shot(result), t.shot(result, "white")]
    assert [str(shot) for shot in result.shots] == [
        "cue hits 7 first. Gone: 7 (foot left).",
        "white hits no ball.",
    ]
    with pytest.raises(SystemExit, match="0"):
        main(["info", str(tmp_path / "run")])
    assert "cue hits 7 first. Gone: 7 (foot left). white hits" in capsys.readouterr().out
    with pytest.raises(CaromError, match="record them"):
        _ = carom.simulate(scene, impacts=False).shots
    with pytest.raises(CaromError, match=r'"7" was not struck, .* struck: "cue", "white"'):
        t.shot(result, "7")
    with pytest.raises(CaromError, match='no ball is called "8"; known: 7, cue, white'):
        result.shots[0].cushions("8")
    still = t.scene(until=0.01)
    t.cue_ball(still)
    at_rest = carom.simulate(still)
    assert at_rest.shots == []
    with pytest.raises(CaromError, match=r'"cue" was not struck, .* no ball was'):
        t.shot(at_rest)
    elsewhere = carom.Scene(run={"until": 0.01, "step": 0.01, "method": "events"})
    elsewhere.sphere("a", radius=0.1, mass=1.0, material="m", position=(0, 0, 1), velocity=(1, 0, 0))
    with pytest.raises(CaromError, match="not on a table"):
        _ = carom.simulate(elsewhere).shots


def test_a_table_suggests_the_exact_method_where_no_step_is_given() -> None:
    t = table("9ft")
    assert t.scene(until=1.0).run.method == "events"
    assert t.scene(until=1.0, step=1e-4).run.method == "nsga"
    assert t.scene(until=1.0, method="penalty").run.step != t.scene(until=1.0).run.step


@pytest.mark.parametrize(
    ("until", "every", "apart"), [(10.0, None, 0.01), (20.0, None, 0.02), (20.0, 1, 0.01)]
)
def test_frames_are_as_far_apart_as_the_page_says(until: float, every: int | None, apart: float) -> None:
    """docs/reference/billiards.md"""
    made = table("9ft").scene(until=until)
    table("9ft").cue_ball(made)
    time = np.asarray(carom.simulate(made, every=every).time)
    np.testing.assert_allclose(np.diff(time), apart, rtol=1e-9)


def test_a_scratch_is_called_one() -> None:
    t = table("9ft")
    scene = t.scene(until=1.5, step=1.5, method="events")
    cue = t.cue_ball(scene, at=(2.0, 0.73))
    billiards.strike(cue, ball_speed="2 m/s", direction="45 deg")
    found = t.shot(carom.simulate(scene))
    assert found.scratch
    assert found.first is None
    assert found.pocketed[0].pocket == "foot left"


def test_another_table_neither_takes_balls_nor_reads_runs() -> None:
    # Its spots and pockets are elsewhere: the answers were wrong without a word.
    small, large = table("7ft"), table("snooker")
    higher = table("7ft", nose_height="37 mm")
    scene = small.scene(until=0.05)
    small.cue_ball(scene, velocity=(1.0, 0.0, 0.0))
    one, many = carom.simulate(scene), carom.simulate_batch([scene])
    refused = r"of the table '7ft' with length 1.9812, this table is 'snooker' with length 3.569"
    for call in (lambda: large.ball(scene, "red 1", (1.0, 0.5)), lambda: large.rack(scene, 3),
                 lambda: large.pocketed(one), lambda: large.pocketed(many), lambda: large.shot(one)):  # fmt: skip
        with pytest.raises(CaromError, match=refused):
            call()
    with pytest.raises(CaromError, match=r"'7ft' with nose_height 0.0362.*'7ft' with nose_height 0.037"):
        higher.shot(one)
    assert table("7ft").pocketed(one) == small.pocketed(one) == []
    scene.billiard_table = None
    large.ball(scene, "red 1", (1.0, 0.5))  # a scene that says nothing of a table may be any


@pytest.mark.parametrize("radius", [0.015, 0.037, 0.0603])
def test_a_ball_that_the_noses_do_not_fit_is_refused_as_the_table_would_be(radius: float) -> None:
    rule = "nose_height must be above the centre of the ball and below its top"
    with pytest.raises(CaromError, match=rule):
        table("7ft", ball_radius=radius)
    t = table("7ft")
    with pytest.raises(
        CaromError, match=f"'big' at .*: {rule}, .* take a radius between 0.01815 and 0.03629 m"
    ):
        t.ball(t.scene(), "big", (1.0, 0.5), radius=radius)
    assert t.ball(t.scene(), "fits", (1.0, 0.5), radius=0.0302).radius == 0.0302


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"corner_angle": "179 deg", "corner_mouth": 0.1},
            "corner_angle of 179 deg crosses .* are 0.08001 m long",
        ),
        ({"side_angle": "150 deg"}, "side_angle of 150 deg crosses the facings behind a side_mouth of 0.12"),
        ({"corner_shelf": 0.3}, "corner_shelf of 0.3 m puts the edge of the slate behind .* are 0.079"),
        ({"side_shelf": "8 cm"}, "side_shelf of 0.08 m puts the edge of the slate behind .* are 0.077"),
    ],
)
def test_pockets_whose_facings_lead_nowhere_are_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(CaromError, match=f"table: {said}"):
        table("9ft", **changes)
    assert table("9ft", **{**changes, "corner_mouth": 0.0, "side_mouth": 0.0})


def test_pockets_with_parallel_facings_and_shelves_as_deep_as_they_are() -> None:
    """At the limits: the ends of the two facings of a pocket are its mouth apart, and the slate's edge is on them."""
    r = TABLES["9ft"].ball_radius
    t = table(
        "9ft", corner_angle="135 deg", side_angle="90 deg", corner_shelf=2.799 * r, side_shelf=2.799 * r
    )
    ends = {name: (a, b) for name, a, b in noses(t.spec)}
    far = [ends["facing right head a"][0], ends["facing head b"][1]]
    assert math.dist(*far) == pytest.approx(t.spec.corner_mouth)
    deep = np.mean(far, axis=0) - np.array([t.spec.corner_mouth / math.sqrt(8)] * 2)
    assert -deep.sum() / math.sqrt(2) == pytest.approx(2.8 * r)
    sides = [ends["facing right head b"][1], ends["facing right foot a"][0]]
    assert math.dist(*sides) == pytest.approx(t.spec.side_mouth)
    assert sides[0][1] == pytest.approx(-2.8 * r)


@pytest.mark.parametrize(("kind", "straight"), [("corner", 135.0), ("side", 90.0)])
def test_a_pocket_is_refused_where_a_ball_cannot_pass(
    kind: str, straight: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On its axis a ball reaches the edge of the slate if half the way between the facings there is more than its reach."""
    t = table("9ft")
    shelf, lean = (getattr(t.spec, f"{kind}_{key}") for key in ("shelf", "angle"))
    lean -= math.radians(straight)
    least = 2 * (t.reach / math.cos(lean) + shelf * math.tan(lean))
    at, way = ((0.2, 0.2), (-1, -1, 0)) if kind == "corner" else ((0.5 * t.spec.length, 0.2), (0, -1, 0))

    def met(mouth: float) -> set[str]:
        narrow = table("9ft", **{f"{kind}_mouth": mouth})
        scene = narrow.scene(until=0.5)
        narrow.cue_ball(scene, at=at).velocity = way
        return set(carom.simulate(scene).shots[0].cushions("cue"))

    assert met(least + 1e-6) == set()
    with pytest.raises(CaromError, match=f"cannot pass a {kind}_mouth of"):
        met(least - 1e-6)
    for module in ("billiards.measures", "tables.billiard"):
        monkeypatch.setattr(f"carom.scene.{module}.misfit", lambda _: None)
    assert {name.partition(" ")[0] for name in met(least - 1e-6)} == {"facing"}


def test_gravity_is_a_magnitude() -> None:
    with pytest.raises(CaromError, match=r"gravity is a magnitude, which acts down; .* found -9\.8"):
        table("9ft").scene(gravity=-9.8)
    assert tuple(table("9ft").scene(gravity=0.0).gravity) == (0.0, 0.0, 0.0)


def test_a_density_takes_the_place_of_the_mass_of_the_table() -> None:
    t = table("9ft")
    scene = t.scene()
    dense = t.ball(scene, "dense", (1.0, 0.5), density="1800 kg/m^3")
    assert dense.mass_kg() == pytest.approx(1800 * 4 / 3 * math.pi * t.spec.ball_radius**3)
    assert t.ball(scene, "heavy", (1.2, 0.5), mass="1 kg").mass_kg() == 1.0
    assert t.ball(scene, "usual", (1.4, 0.5)).mass_kg() == t.spec.ball_mass


def test_another_radius_keeps_the_lengths_and_the_mass_of_the_table() -> None:
    """As the reference says: rolling slows down by r/r' times the value of the laws, spin on the spot by its square."""
    nine = table("9ft")
    scene, ratio = nine.scene(until=1.0), nine.spec.ball_radius / 0.025
    rolls = nine.ball(scene, "rolls", at=(0.5, 0.6), radius=0.025)
    rolls.velocity, rolls.angular_velocity = (0.5, 0.0, 0.0), (0.0, 20.0, 0.0)
    nine.ball(scene, "spins", at=(0.5, 0.3), radius=0.025).angular_velocity = (0.0, 0.0, 100.0)
    result = carom.simulate(scene)
    assert rolls.mass == nine.spec.ball_mass
    slower = 0.5 - result["rolls"].velocity[-1, 0]
    assert slower == pytest.approx(ratio * 9.8 * billiards.LAWS.rolling_deceleration, rel=1e-9)
    slower = 100.0 - result["spins"].angular_velocity[-1, 2]
    assert slower == pytest.approx(ratio**2 * billiards.LAWS.spin_deceleration, rel=1e-9)


@pytest.mark.parametrize(
    ("run", "share"),
    [({"impact": law}, 0.85) for law in ("sequence", "sequence-paper", "one-shot", "poisson")]
    + [({"impact": law}, 0.73) for law in ("compliant", "binary")]
    + [({"method": "moreau", "step": 5e-5}, 0.85), ({"method": "penalty", "step": 5e-5}, 0.77)],
)
def test_the_share_of_the_speed_that_a_rail_returns_by_law(run: dict[str, Any], share: float) -> None:
    """The figures of the reference: bed and nose are two contacts, which springs load at once."""
    nine = table("9ft")
    smooth = laws(cushion_friction=0.0, cloth_friction=0.0, rolling_deceleration=0.0, spin_deceleration=0.0)
    scene = nine.scene(until=0.3, laws=smooth, **run)
    nine.cue_ball(scene, at=(0.7, 0.2)).velocity = (0.0, -1.0, 0.0)
    assert carom.simulate(scene)["cue"].velocity[-1, 1] == pytest.approx(share, abs=0.005)


@pytest.mark.parametrize("run", [{"impact": "compliant"}, {"method": "penalty"}, {"impact": "sequence"}])
@pytest.mark.parametrize("kind", ["smooth", "rolls", "slides"])
def test_how_a_ball_leaves_a_rail_with_and_without_friction(run: dict[str, Any], kind: str) -> None:
    """The figures of the reference, share of the speed and hop in mm: at the nose the ball has 1 m/s."""
    nine, smooth = table("9ft"), laws(cushion_friction=0.0, cloth_friction=0.0)
    springs = {
        "smooth": {"compliant": (0.73, 2.6), "penalty": (0.77, 1.2)},
        "rolls": {"compliant": (0.72, 0.7), "penalty": (0.77, 0.4)},
        "slides": {"compliant": (0.61, 2.3), "penalty": (0.67, 1.3)},
    }
    share, hop = springs[kind].get(next(iter(run.values())), (0.85, 0.0))
    scene = nine.scene(until=0.05, step=2e-5, laws=smooth if kind == "smooth" else billiards.LAWS, **run)
    cue = nine.cue_ball(scene, at=(nine.reach + 4e-5, 0.3))
    cue.velocity = (-1.0, 0.0, 0.0)
    cue.angular_velocity = (0.0, -(kind == "rolls") / nine.spec.ball_radius, 0.0)
    found = carom.simulate(scene, every=1)["cue"]
    assert found.velocity[:, 0].max() == pytest.approx(share, abs=0.006)
    assert 1000 * (found.position[:, 2].max() - nine.spec.ball_radius) == pytest.approx(hop, abs=0.06)
