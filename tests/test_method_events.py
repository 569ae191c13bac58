"""Method `events` from Python: exact frames, clean audits, runs that are taken up again, refusals."""

from __future__ import annotations

import re
from pathlib import Path

import carom
import numpy as np
import pytest
from carom import billiards
from carom.audit import check
from scipy.spatial.transform import Rotation

MU, G, R = 0.2, 9.8, 0.028575


def shot(rolling_radius: float = 0.0, **run: object) -> carom.Scene:
    """A ball that slides down a table with cushions, towards another one."""
    scene = carom.Scene(
        "a shot", gravity=(0, 0, -G), run={"method": "events", "until": 2.0, "step": 0.05, **run}
    )
    for name in ("ball", "bed", "rail"):
        scene.material(name)
    scene.contact("ball", "ball", friction=0.06, restitution=0.95)
    scene.contact("ball", "bed", friction=MU, restitution=0.5, rolling_radius=rolling_radius)
    scene.contact("ball", "rail", friction=0.14, restitution=0.85)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.plane("end", point=(2.5, 0, 0), normal=(-1, 0, 0), material="rail")
    scene.sphere("cue", radius=R, mass=0.17, position=(0, 0, R), velocity=(2.0, 0, 0), material="ball")
    scene.sphere("object", radius=R, mass=0.17, position=(1.2, 0.02, R), material="ball")
    return scene


def test_frames_are_exact_at_their_times() -> None:
    result = carom.simulate(shot(until=0.5, step=1e-2))
    ends = 2.0 / (3.5 * MU * G)
    t = np.minimum(result.time, ends)
    way = 2.0 * t - 0.5 * MU * G * t**2 + (result.time - t) * (2.0 - MU * G * ends)
    np.testing.assert_allclose(result["cue"].position[:, 0], way, rtol=0, atol=3e-15)
    assert len(result.time) == 51


def test_impacts_have_their_times_and_audits_are_clean(tmp_path: Path) -> None:
    for every in (1, 4):
        result = carom.simulate(shot(), out=tmp_path / f"run{every}", every=every)
        assert result.outcome.kind == "done"
        hits = result.impacts
        off = np.abs(np.asarray(hits["time"]) / 0.05 % 1.0 - 0.5)
        assert len(off) > 2
        assert off.max() < 0.499  # none at the end of a step
        report = check(tmp_path / f"run{every}")
        assert report.ok, str(report)


def test_a_run_is_taken_up_again_with_the_same_bits(tmp_path: Path) -> None:
    whole = carom.simulate(shot())
    carom.simulate(shot(), until=0.7, out=tmp_path / "run")
    parts = carom.resume(tmp_path / "run", until=2.0)
    np.testing.assert_array_equal(parts.position[-1], whole.position[-1])
    np.testing.assert_array_equal(parts.angular_velocity[-1], whole.angular_velocity[-1])
    np.testing.assert_array_equal(parts.orientation[-1], whole.orientation[-1])


def test_pockets_take_balls_when_they_come() -> None:
    scene = shot(until=2.0, step=0.5)
    scene.outlet(low=(1.6, -1, -1), high=(2.2, 1, 1))
    result = carom.simulate(scene)
    time = dict(result.events.left())["object"]
    other = carom.simulate(shot(until=time, step=time))
    assert other["object"].position[-1, 0] == pytest.approx(1.6, abs=1e-12)


def test_what_cannot_be_done_is_refused_by_name() -> None:
    scene = shot()
    scene.spring("cue", "object", stiffness=1.0, rest_length=1.2)
    with pytest.raises(
        carom.CaromError, match="events does not know springs or loads beyond the weight; choose nsga"
    ):
        carom.simulate(scene)


def test_places_that_round_by_more_than_contacts_are_refused() -> None:
    scene = shot()
    for sphere in scene.spheres:
        sphere.position = (sphere.position[0], sphere.position[1] + 1e5, sphere.position[2])
    with pytest.raises(carom.CaromError, match="from the origin; move the scene there, or choose nsga"):
        carom.simulate(scene)


def test_balls_that_press_one_another_are_stepped_and_said_so(tmp_path: Path) -> None:
    scene = shot()
    at = 2.5 - R
    scene.sphere("at the rail", radius=R, mass=0.17, position=(at, 1.0, R), material="ball")
    push = (0, 50, 0)
    scene.sphere(
        "b", radius=R, mass=0.17, position=(at - 2 * R, 1.0, R), angular_velocity=push, material="ball"
    )
    result = carom.simulate(scene, out=tmp_path / "run")
    report = check(tmp_path / "run")
    assert report.ok, str(report)
    rows = result.transitions
    press, release = (rows.where(rows.event == kind) for kind in ("press", "release"))
    assert set(press.pair.ravel()) == {"b", "at the rail"}
    assert set(press.after) == {"stepped"} == set(release.before)
    assert result.summary["handovers"] == len(np.unique(press.time)) >= 1
    stepped = result.summary["stepped"]
    assert stepped == pytest.approx(np.sum(np.unique(release.time) - np.unique(press.time)))
    finer = carom.simulate(scene, pressing_step=1e-5)
    for name in scene.names:
        off = np.abs(result[name].position[-1] - finer[name].position[-1]).max()
        assert off < 1e-4, name
    carom.simulate(scene, until=0.15, out=tmp_path / "part")
    again = carom.resume(tmp_path / "part", until=2.0).transitions
    for column in rows.columns:
        np.testing.assert_array_equal(again[column], rows[column], column)


@pytest.mark.parametrize(("direction", "height"), [(1.0, 0.2), (2.0, 0.4), (3.0, 0.3)])
def test_the_last_of_many_bounces_keeps_the_friction_cone(direction: float, height: float) -> None:
    # Each of hundreds of landings ends in contact. What that takes back of the push had left its friction in the sum.
    table = billiards.table("9ft")
    scene, r = table.scene("push line", until=0.12), table.spec.ball_radius
    cue = table.cue_ball(scene, at=(0.6, 0.6))
    for k in (1, 2):
        table.ball(scene, f"{k}", (0.6 + 2 * k * r, 0.6))
    billiards.strike(cue, speed=3, direction=np.radians(direction), height=height)
    report = check(carom.simulate(scene))
    assert report.ok, str(report)


def test_balls_that_come_to_rest_against_one_another_press_no_more() -> None:
    moves = {"a": (6.7e-5, -2.2e-5, 0), "b": (-9.9e-5, -3.3e-5, 0)}
    scene = carom.Scene(gravity=(0, 0, -G), run={"method": "events", "until": 3.0, "step": 3.0})
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.contact("ball", "ball", friction=0.06, restitution=0.0)
    scene.contact("ball", "bed", friction=MU, restitution=0.5, rolling_radius=3e-4)
    for side, (name, v) in zip((-R, R), moves.items(), strict=True):
        spin = np.cross((0, 0, 1 / R), v)
        scene.sphere(
            name,
            radius=R,
            mass=0.17,
            position=(side, 0, R),
            velocity=v,
            angular_velocity=spin,
            material="ball",
        )
    result = carom.simulate(scene)
    assert result.summary["handovers"] == 1
    assert result.summary["stepped"] < 0.05  # rolling resistance, which stops them, also holds them together
    assert not result.velocity[-1].any()


def test_transitions_are_those_of_the_closed_form() -> None:
    result = carom.simulate(shot(until=0.5, step=0.5))
    rows = result.transitions.between("cue")
    [ends] = rows.where(rows.event == "slip ends").time
    assert ends == pytest.approx(2.0 / (3.5 * MU * G), rel=1e-14)
    assert rows.before[0] == "slide"
    assert rows.after[0] == "roll"
    hit = result.transitions.between("cue", "object")
    assert set(hit.time) <= set(result.impacts["time"])
    assert not len(carom.simulate(shot(until=0.01, step=1e-3), method="nsga").transitions)


def test_a_table_with_rolling_resistance_comes_to_rest(tmp_path: Path) -> None:
    scene = shot(rolling_radius=1e-3, until=12.0, step=0.5)
    result = carom.simulate(scene, out=tmp_path / "run")
    assert not result.velocity[-1].any()
    report = check(tmp_path / "run")
    assert report.ok, str(report)


def test_the_exact_break_of_the_paper_is_the_one_on_its_page() -> None:
    root = Path(__file__).parents[1]
    page = (root / "docs/validation/5.6_break.md").read_text().partition("| exact | time (s)")[2]
    told = [
        [float(x) for x in re.findall(r"-?[0-9]+\.?[0-9]*", row.partition("|")[2])]
        for row in (line.removeprefix("|") for line in page.splitlines()[2:11])
    ]
    found = []
    for case, until in (("5.6_break", 1.0), ("5.6_break_rolling", 3.0)):
        scene = root / f"python/carom/scenarios/paper/{case}.toml"
        rows = carom.simulate(scene, method="events", until=until, step=until).transitions
        by = {k: rows.where(rows.pair[:, 0] == f"ball{k}") for k in (2, 3, 4)}
        if case == "5.6_break":
            ends = {k: own.where(own.event == "slip ends") for k, own in by.items()}
            at = [by[2], by[3], by[4], rows.between("ball2", "bed"), ends[3], ends[2]]
        else:
            at = [by[k].where(by[k].event == "roll ends") for k in (3, 2, 4)]
        found += [[r.time[0], *r.velocity[0]] for r in at]
    np.testing.assert_allclose(found, told, rtol=0, atol=6e-7)


@pytest.mark.parametrize("law", ["one-shot", "poisson", "sequence"])
@pytest.mark.parametrize("gravity", [9.8, 0.0])
@pytest.mark.parametrize("balls", [3, 6, 12])
def test_a_row_of_any_length_is_hit_exactly(law: str, gravity: float, balls: int) -> None:
    """One ball hits a row that touches: together all `n` go on, `v = 4/(n + 1)` of 2 m/s; one after the other the last.

    More than `dense_contacts` once took the speed that opens a gap in a step for what a moment may leave.
    """
    r, scene = 0.03, carom.Scene(gravity=(0, 0, -gravity))
    scene.contact("ball", "ball", friction=0.0, restitution=1.0)
    scene.contact("ball", "bed", friction=0.0, restitution=0.5)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    for number in range(balls):
        scene.sphere(f"{number}", radius=r, mass=0.2, at=(2 * r * number, 0.7, r), material="ball")
    at = (-2 * r - 0.013, 0.7, r)
    scene.sphere("cue", radius=r, mass=0.2, at=at, velocity=(2, 0, 0), material="ball")
    found = carom.simulate(scene, method="events", step=0.01, until=0.01, impact=law).velocity[-1, :, 0]
    together = 4 / (balls + 1)
    wanted = [0.0] * (balls - 1) + [2.0, 0.0] if law == "sequence" else [together] * balls + [together - 2]
    assert found == pytest.approx(wanted, abs=1e-11)


def test_tight_racks_keep_their_energy() -> None:
    """60 contacts at once: audited, and the same as of a dense matrix."""
    table = billiards.table("9ft")
    for speed in (0.5, 1.5):
        scene = table.scene("tight", until=0.1 / speed)
        table.rack(scene, 15)
        cue = table.cue_ball(scene, at=(1.8, 0.637))
        billiards.strike(cue, ball_speed=speed)
        found = carom.simulate(scene)
        other = carom.simulate(scene, dense_contacts=500)
        assert check(found).ok
        assert found.velocity[-1] == pytest.approx(other.velocity[-1], abs=1e-10)


@pytest.mark.parametrize("side", [-0.3, 0.0, 0.3])
def test_a_ball_frozen_to_a_rail_runs_past_its_end(side: float) -> None:
    table = billiards.table("9ft")
    scene = table.scene("along the rail", until=0.25)
    cue = table.cue_ball(scene, at=(1.0, table.reach))
    billiards.strike(cue, ball_speed=2.0, side=side)
    found, steps = (carom.simulate(scene, method=of, step=1e-4, every=100) for of in ("events", "nsga"))
    assert found["cue"].position[-1, 0] > 1.3  # the nose ends at 1.207
    assert found["cue"].position[-1] == pytest.approx(steps["cue"].position[-1], abs=2e-4)


def test_axes_do_not_matter() -> None:
    """The whole scene turned: what has ended is rounding then, and no event after the other."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        turn = Rotation.from_rotvec(rng.normal(size=3))
        v, w = rng.normal(size=3) * (1, 1, 0), 20 * rng.normal(size=3)
        ends = []
        for by in (Rotation.identity(), turn):
            to = lambda of, by=by: tuple(by.apply(of))  # noqa: E731
            scene = carom.Scene(gravity=to((0, 0, -9.8)))
            rolls = {"rolling_radius": 4e-4, "spinning_radius": 3e-4}
            scene.contact("ball", "bed", friction=0.2, restitution=0.5, **rolls)
            scene.plane("bed", point=(0, 0, 0), normal=to((0, 0, 1)), material="bed")
            moves = {"velocity": to(v), "angular_velocity": to(w)}
            scene.sphere("ball", radius=0.03, mass=0.17, at=to((0.1, 0.2, 0.03)), material="ball", **moves)
            found = carom.simulate(scene, method="events", step=0.01, until=2.0)
            ends.append((by.inv().apply(found["ball"].position[-1].copy()), len(found.transitions)))
        assert ends[1][0] == pytest.approx(ends[0][0], abs=1e-11)
        assert ends[1][1] == ends[0][1]


@pytest.mark.parametrize("slower", [1e-2, 1e3, 1e6])
def test_units_of_time_do_not_matter(slower: float) -> None:
    """Bounces come to rest in weak gravity too."""
    scene = carom.Scene(gravity=(0, 0, -9.8 / slower**2))
    scene.contact("ball", "bed", friction=0.2, restitution=0.5)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.sphere(
        "ball", radius=0.03, mass=0.17, at=(0, 0, 0.05), velocity=(2.5 / slower, 0, 0), material="ball"
    )
    found = carom.simulate(scene, method="events", step=0.01 * slower, until=1.5 * slower)
    assert found["ball"].position[-1, 2] == pytest.approx(0.03, abs=1e-12)
    assert len(found.transitions) < 40


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_ball_on_a_rim_does_not_fall_through(restitution: float) -> None:
    """It is pressed on the rim of a disc and goes along it, closing by no more than rounding."""
    r, scene = 0.01, carom.Scene(gravity=(5.896893548244714, -7.257340764796024, -2.932175217189408))
    scene.contact("g", "g", friction=0.3, restitution=restitution)
    scene.plane("disc", point=(0, 0, 0), normal=(0, 0, 1), radius=0.1, hole=0.02, material="g")
    at = (-0.09569024632044833, -0.054089821691635, 0.0012650334614540246)
    velocity = (-0.06403110967943404, 0.15148000443037593, 0.14741047623864983)
    scene.sphere("ball", radius=r, mass=0.1, at=at, velocity=velocity, material="g")
    found = carom.simulate(scene, method="events", step=5e-4, until=0.2)["ball"].position
    out = np.hypot(found[:, 0], found[:, 1])
    assert (np.hypot(out - np.clip(out, 0.02, 0.1), found[:, 2]) > r * (1 - 1e-9)).all()


def test_groups_of_more_than_a_hundred_contacts_are_audited() -> None:
    """Rows of their impacts are sums; that there was such a group is told by `largest_island`."""
    r, scene = 0.0286, carom.Scene(gravity=(0, 0, 0))
    scene.contact("b", "b", friction=0.1, restitution=0.95)
    for i in range(9):
        for j in range(i + 1):
            at = (i * np.sqrt(3) * r, (2 * j - i) * r, 0)
            scene.sphere(f"b{i}_{j}", radius=r, mass=0.17, material="b", at=at)
    cue = {"at": (-2 * r - 0.001, 0.01, 0), "velocity": (3, 0, 0)}
    scene.sphere("cue", radius=r, mass=0.17, material="b", **cue)
    found = carom.simulate(scene, method="events", step=0.0025, until=0.01)
    assert max(found.steps["largest_island"]) > 100
    report = check(found)
    assert report.ok, str(report)


def test_surfaces_with_two_laws_share_a_ball_in_any_order() -> None:
    """As `nsga` has it: half the load each, so the mean friction. On a seam that ends it is exact again."""
    carried = []
    for order in ("slow fast", "fast slow"):
        scene = carom.Scene("two", gravity=(0, 0, -G), run={"method": "events", "until": 0.4, "step": 0.05})
        for name, friction in (("slow", 0.4), ("fast", 0.1)):
            scene.contact("ball", name, friction=friction, restitution=0.5)
        for name in order.split():
            scene.plane(name, point=(0, 0, 0), normal=(0, 0, 1), material=name)
        scene.sphere("a", radius=R, mass=0.2, position=(0, 0, R), velocity=(0, 1, 0), material="ball")
        result = carom.simulate(scene)
        assert result.summary["handovers"] == 1
        carried.append(result["a"].position[-1, 1])
    slides = 1.0 / (3.5 * 0.25 * G)
    way = 1.0 * slides - 0.5 * 0.25 * G * slides**2 + (0.4 - slides) * 5 / 7
    np.testing.assert_allclose(carried, way, rtol=0, atol=2e-5)


def test_a_ball_leaves_by_an_outlet_with_its_velocity() -> None:
    scene = shot(until=0.5)
    scene.outlet(low=(0.3, -1, -1), high=(1.0, 1, 1))
    rows = carom.simulate(scene).transitions
    (row,) = np.flatnonzero(np.asarray(rows["event"]) == "outlet")
    assert rows["velocity"][row, 0] == pytest.approx(np.sqrt(4.0 - 2 * MU * G * 0.3), abs=1e-13)


@pytest.mark.parametrize(
    "law", [{"polynomial": [0.2, 0.0]}, {"table": [[0, 0.2], [1, 0.2]]}, {"expression": "0.4/2"}, "0.2"]
)
def test_a_constant_law_is_the_number(law: object) -> None:
    """Method `events` refused it as one that depends on the slip."""
    places = []
    for friction in (law, 0.2):
        scene = carom.Scene(gravity=(0, 0, -9.8), run={"method": "events", "until": 0.4, "step": 0.1})
        scene.contact("ball", "bed", friction=friction, restitution=0.5)  # type: ignore[arg-type]
        scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
        scene.sphere("a", radius=0.03, mass=0.2, position=(0, 0, 0.03), velocity=(1, 0, 0), material="ball")
        assert scene.contacts[0].friction == 0.2
        places.append(carom.simulate(scene)["a"].position)
    np.testing.assert_array_equal(*places)
    scene.contacts[0].friction = {"polynomial": [0.2, 0.01]}
    with pytest.raises(carom.CaromError, match="depends on the slip"):
        carom.simulate(scene)


@pytest.mark.parametrize(("count", "restitution"), [(2, 0.5), (3, 0.5), (5, 0.9)])
def test_a_stack_that_is_dropped_ends_at_rest_whatever_the_step(count: int, restitution: float) -> None:
    """It begins at rest: what is rounding goes by the speeds that it has later."""
    for step in (1.0, 0.25, 0.05):
        scene = carom.Scene("stack", run={"method": "events", "step": step, "until": 1.0})
        scene.contact("b", "b", friction=0.0, restitution=restitution)
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
        for k in range(count):
            scene.sphere(f"b{k}", radius=0.03, mass=1.0, at=(0, 0, 0.1 + 0.07 * k), material="b")
        result = carom.simulate(scene)
        np.testing.assert_allclose(
            result.position[-1, :, 2], 0.03 + 0.06 * np.arange(count), rtol=0, atol=1e-9
        )


@pytest.mark.parametrize("step", [0.5, 0.25, 0.125])
def test_what_happens_at_the_end_of_a_step_is_of_that_step(step: float) -> None:
    """Impacts, the end of a slip and an outlet, all at t = 0.5 by numbers without rounding: frames have them too."""
    scene = carom.Scene("ends", gravity=(0, 0, -8.0), run={"until": 1.0, "step": step, "method": "events"})
    scene.contact("b", "w", friction=0.25, restitution=0.5)
    scene.contact("b", "b", friction=0.0, restitution=1.0)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    scene.plane("wall", point=(2.0, 0, 0), normal=(-1, 0, 0), material="w")
    for name, at, v in (
        ("hits", (1.5, 0, 5.0), (0.5, 0, 0)),
        ("rolls", (-1.0, 3, 0.25), (3.5, 0, 0)),
        ("lands", (0.0, -3, 1.25), (0, 0, 0)),
        ("leaves", (-1.0, -5, 5.25), (-2, 0, 0)),
    ):
        scene.sphere(name, material="b", radius=0.25, mass=1.0, position=at, velocity=v)
    scene.outlet(low=(-9, -9, -9), high=(-2.0, 9, 9))
    result = carom.simulate(scene)
    rows = result.transitions
    rows = rows.where(rows["time"] == 0.5)
    found = sorted(zip(rows["pair"][:, 0], rows["event"], strict=True))
    assert found == [
        ("hits", "impact"),
        ("lands", "impact"),
        ("leaves", "outlet"),
        ("rolls", "slip ends"),
    ]
    assert set(rows["step"].tolist()) == {int(0.5 / step)}
    assert set(result.impacts.step[np.asarray(result.impacts.time) == 0.5].tolist()) == {int(0.5 / step)}
    k = int(0.5 / step)
    assert result["hits"].velocity[k, 0] == pytest.approx(-0.25, abs=1e-12)
    assert result["lands"].velocity[k, 2] == pytest.approx(2.0, abs=1e-12)
    assert not result["leaves"].present[k]


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("seed", range(12))
def test_rows_of_a_ball_follow_one_another(seed: int, tmp_path: Path) -> None:
    """Each mode before is the last one after: in breaks of frozen balls, which press, by balls that bounce."""
    rng = np.random.default_rng(seed)
    t = billiards.table("9ft")
    scene = t.scene(until=2.0, step=(0.01, 0.05)[seed % 2], method="events")
    cue = t.cue_ball(scene, at=(0.6, rng.uniform(0.4, 0.8)))
    t.rack(scene, gap=0.0 if seed % 3 else 1e-4)
    speed, direction, elevation = rng.uniform([1, -0.3, 1], [6, 0.3, 8])
    billiards.strike(cue, speed=speed, direction=direction, elevation=f"{elevation} deg", side=0.2)
    result = carom.simulate(scene, out=tmp_path / "run")
    rows, last = result.transitions, dict[str, str]()
    for ball, before, after in zip(rows["pair"][:, 0], rows["before"], rows["after"], strict=True):
        assert last.get(ball, before) == before
        last[ball] = after
    report = check(tmp_path / "run")
    assert report.ok, str(report)


def test_a_landing_too_weak_for_a_row_of_impacts_is_told() -> None:
    """The last bounce rises at 4.9014e-9 m/s, just above what counts as none, and below 1e-9 of the speed."""
    scene = carom.Scene("hop", gravity=(0, 0, -9.8), run={"until": 0.3, "step": 0.01, "method": "events"})
    scene.contact("b", "w", friction=0.2, restitution=0.5)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    at = (0, 0, 0.03 + 0.022080536912751678)
    scene.sphere("a", material="b", radius=0.03, mass=0.2, position=at, velocity=(8.0, 0, 0))
    rows = carom.simulate(scene).transitions
    assert (rows["event"][-1], rows["before"][-1], rows["after"][-1]) == ("impact", "flight", "slide")
    assert rows["pair"][-1].tolist() == ["a", "bed"]
