"""`carom.events`: found where closed forms say that they happen."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError, events
from carom.result.record import Column
from carom.run import watch

R, G, MU = 0.028575, 9.8, 0.2
pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


def shot(speed: float = 2.0, spin: float = 0.0, rho: float = 0.0, **run: float | str) -> carom.Scene:
    """A cue ball that slides along x, and an object ball 0.5 m further."""
    scene = carom.Scene("shot", gravity=(0, 0, -G), run={"until": 1.0, "step": 1e-3, **run})
    for name, x in (("cue", 0.0), ("object", 0.5)):
        scene.sphere(name, radius=R, mass=0.17, at=(x, 0.0, R), material="ball")
    scene.spheres[0].velocity = (speed, 0.0, 0.0)
    scene.spheres[0].angular_velocity = (0.0, spin, 0.0)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
    scene.contact("ball", "ball", friction=0.0, restitution=1.0)
    scene.contact("ball", "cloth", friction=MU, restitution=0.0, rolling_radius=rho)
    return scene


def test_slide_to_roll_at_the_time_of_the_closed_form() -> None:
    speed = 1.0
    result = carom.simulate(shot(speed), until=0.45, every=20)
    [event] = events.slip_to_roll(result, "cue", "bed", speed=1e-6)
    exact = 2.0 * speed / (7.0 * MU * G)
    assert event.time == pytest.approx(exact, abs=2e-6)  # frames are 20 ms apart
    assert event.within == pytest.approx(0.02)
    assert event.speed == pytest.approx(5.0 / 7.0 * speed, rel=1e-6)
    state = events.phases(result, "cue", "bed")
    time = np.asarray(result.time)
    assert (state[1 : int(exact / 0.02) + 1] == events.SLIDING).all()
    assert (state[time > exact] == events.ROLLING).all()
    assert (events.phases(result, "object", "bed") == events.RESTING).all()


def test_first_contact_and_its_speed() -> None:
    result = carom.simulate(shot(speed=2.0))
    event = events.first_contact(result, "cue", "object")
    assert event is not None
    gap = 0.5 - 2 * R
    exact = (2.0 - np.sqrt(4.0 - 2 * MU * G * gap)) / (MU * G)
    assert exact <= event.time <= exact + event.within + 1e-12
    assert event.within == pytest.approx(1e-3)
    assert event.speed == pytest.approx(2.0 - MU * G * exact, abs=3e-3)
    assert events.first_contact(result, "object", "cue") == event
    pairs = {(e.body, e.other) for e in events.first_contacts(result)}
    assert pairs == {("cue", "object"), ("cue", "bed"), ("object", "bed")}
    slow = carom.simulate(shot(speed=0.1), until=0.2)
    assert events.first_contact(slow, "cue", "object") is None


@pytest.mark.parametrize("step", [0.01, 0.3])
def test_method_events_knows_its_times_however_far_apart_frames_are(step: float) -> None:
    """Slip had ended up to a frame late, and hits at the end of their step."""
    scene = shot(1.0, spin=0.0, method="events")
    scene.outlet(low=(-1, 0.5, -1), high=(1, 0.6, 1))
    scene.sphere("away", radius=R, mass=0.17, at=(-0.4, 0.0, R), material="ball")
    scene.spheres[2].velocity = (0.0, 3.0, 0.0)
    result = carom.simulate(scene, until=0.9, step=step)
    rolls, hit = events.slip_to_roll(result, "cue", "bed"), events.first_contact(result, "cue", "object")
    exact = 2.0 / (7.0 * MU * G)
    assert rolls[0].time == pytest.approx(exact, abs=1e-12)
    assert rolls[0].speed == pytest.approx(5.0 / 7.0, abs=1e-12)
    met = exact + (0.5 - 2 * R - (1.0 - 0.5 * MU * G * exact) * exact) * 7.0 / 5.0
    assert hit is not None
    assert hit.time == pytest.approx(met, abs=1e-12)
    assert hit.speed == pytest.approx(5.0 / 7.0, abs=1e-9)
    [left] = events.departures(result)
    assert left.time == pytest.approx((3.0 - np.sqrt(9.0 - 2 * MU * G * 0.5)) / (MU * G), abs=1e-9)
    assert {e.within for e in (*rolls, hit, left)} == {events.ROUNDING}


def test_what_method_events_steps_is_read_off_frames() -> None:
    """A ball that turns against another one: its slip ends in steps, of which frames tell."""
    scene = shot(0.0, spin=60.0, method="events", until=0.5, step=0.01)
    scene.spheres[1].position = (2 * R, 0.0, R)
    scene.contacts[0].friction = 0.3
    result = carom.simulate(scene)
    assert result.steps.stepped.sum() > 0
    finer = carom.simulate(scene, method="nsga", step=1e-4, every=10)
    [found], [expected] = (events.slip_to_roll(r, "cue", "bed") for r in (result, finer))
    assert found.time == pytest.approx(expected.time, abs=1e-6)
    assert found.within == pytest.approx(0.01)


def test_of_what_is_stepped_elsewhere_events_know_nothing() -> None:
    """A ball is pressed along a rail while two others meet: these are exact, whatever `step`, and it is not."""

    def detected(step: float) -> tuple[list[events.Event], carom.Result]:
        scene = shot(2.0, method="events", until=0.9, step=step)
        scene.plane("rail", material="rail", point=(0, 1 + R, 0), normal=(0, -1, 0))
        scene.contact("ball", "rail", friction=0.2, restitution=0.5)
        scene.sphere("pressed", radius=R, mass=0.17, material="ball", at=(-1, 1, R), velocity=(1.5, 0, 0))
        scene.spheres[-1].angular_velocity = (-60.0, 0.0, 0.0)
        result = carom.simulate(scene)
        assert result.transitions.between("pressed", "rail").event[0] == "press"
        return [*events.first_contacts(result), *events.slip_to_roll(result)], result

    alone = {
        (e.kind, e.body): e for e in events.detect(carom.simulate(shot(2.0, method="events", until=0.9)))
    }
    for step in (0.05, 0.3):
        found, result = detected(step)
        mine = [
            e for e in found if e.body in ("cue", "object") and e.kind in ("contact", "roll") and e.time > 0
        ]
        assert len(mine) >= 3
        for event in mine:
            assert event.within == 1e-9
            assert event.time == pytest.approx(alone[event.kind, event.body].time, abs=1e-12)
        rolls = [e for e in found if (e.kind, e.body) == ("roll", "pressed")]
        assert all(e.within >= 1e-4 for e in rolls)
        assert set(result.transitions.between("cue", "object").event) == {"impact"}


def test_rest_where_rolling_resistance_ends_the_motion() -> None:
    rho, speed = 2e-3, 0.3
    result = carom.simulate(shot(speed, spin=speed / R, rho=rho), until=0.8, every=5)
    # Rolling: m r a + I alpha = -rho N  =>  7/5 m r a = -rho m g.
    exact = speed * 1.4 * R / (rho * G)
    [cue] = events.rest(result, "cue", speed=1e-4)
    assert cue.time == pytest.approx(exact, abs=cue.within + 1e-3)
    assert events.rest(result, "object")[0].time == 0.0
    moving = carom.simulate(shot(speed, spin=speed / R, rho=rho), until=0.3)
    assert events.rest(moving, "cue") == []


def test_all_in_the_order_of_time() -> None:
    result = carom.simulate(shot(speed=2.0, rho=1e-3))
    found = events.detect(result)
    assert [e.time for e in found] == sorted(e.time for e in found)
    assert {e.kind for e in found} >= {"contact", "roll"}


def test_balls_that_leave() -> None:
    scene = shot(speed=2.0)
    scene.outlet(low=(0.3, -1, -1), high=(0.4, 1, 1))
    result = carom.simulate(scene)
    [event] = events.departures(result)
    assert (event.kind, event.body) == ("left", "cue")
    exact = (2.0 - np.sqrt(4.0 - 2 * MU * G * 0.3)) / (MU * G)
    assert exact <= event.time <= exact + 1e-3 + 1e-12
    assert [e.body for e in events.rest(result)] == ["object"]
    assert events.phases(result, "cue", "bed")[-1] == events.AWAY


def test_at_rest_as_a_stop_condition() -> None:
    rho, speed = 2e-3, 0.3
    scene = shot(speed, spin=speed / R, rho=rho)
    result = carom.simulate(scene, until=5.0, every=10, stop=events.AtRest(hold=0.1))
    exact = speed * 1.4 * R / (rho * G)
    assert result.outcome.kind == "stopped"
    assert "AtRest" in str(result.outcome)
    assert exact + 0.09 <= result.outcome.time <= exact + 0.13
    thrown = carom.Scene(run={"until": 0.6, "step": 1e-3})
    thrown.sphere("ball", radius=0.1, mass=1, at=(0, 0, 1), velocity=(0, 0, 2), material="m")
    # Slower than the bound at the top, not for long.
    up = carom.simulate(thrown, stop=events.AtRest(speed=0.1), callback_every=1)
    assert up.outcome.kind == "done"
    for named in (["object"], "object"):
        one = carom.simulate(shot(1.0), stop=events.AtRest(named, hold=0.05), every=10)
        assert one.outcome.time == pytest.approx(0.06)


LEVEL = {"point": (0, 0, 0), "normal": (0, 0, 1), "material": "g"}


def lying() -> carom.Scene:
    """A ball that lies still on a table, which the test has to add."""
    scene = carom.Scene(gravity=(0, 0, -G), run={"until": 5.0, "step": 1e-3})
    scene.contact("g", "g", friction=0.4, restitution=0.2, rolling_radius=3e-4)
    scene.sphere("ball", material="g", radius=3e-3, density=2500, position=(0, 0, 3e-3))
    return scene


def ended(scene: carom.Scene, *named: str) -> float:
    stop = events.AtRest(list(named) or None, hold=0.05)
    result = carom.simulate(scene, stop=stop, callback_every=1)
    assert result.outcome.kind == "stopped"
    return result.outcome.time


@pytest.mark.parametrize("kind", [{"radius": 3e-3}, {"spheres": [[0, 0, 0, 3e-3], [0, 0, 2e-3, 3e-3]]}])
def test_balls_that_are_due_are_not_at_rest(kind: Any) -> None:
    """All lay still before an inflow began, and in each pause of a slow one."""
    scene = lying()
    scene.plane("f", **LEVEL)
    for name, x in (("a", -0.1), ("b", 0.1)):  # of clumps the second is behind the first
        region = {"low": (x, -0.05, 0.01), "high": (x + 0.01, 0.05, 0.02)}
        scene.inflow(
            name, material="g", count=2, density=2500, region=region, seed=1, rate=3, start=0.2, **kind
        )
    last = 0.2 + 1 / 3
    assert ended(scene) > last + 0.05
    assert ended(scene, "ball") == pytest.approx(0.051)
    first = next(name for name in scene.names if name.startswith("a1"))
    assert 0.25 < ended(scene, first) < last


def test_a_lid_that_falls_is_not_at_rest() -> None:
    scene = lying()
    scene.plane("f", **LEVEL)
    scene.plane("lid", point=(0, 0, 0.1), normal=(0, 0, -1), material="g", free={"mass": 0.01})
    fall = np.sqrt(2 * (0.1 - 6e-3) / G)
    assert fall + 0.05 < ended(scene) < fall + 0.2
    assert ended(scene, "ball") == pytest.approx(0.051)


def test_what_motions_and_forces_have_still_to_do_is_waited_for() -> None:
    """A gate that opens later, taken away or moved, and a push; a wall that moves for ever is not waited for."""
    opens = {"table": [[0, 0], [0.3, 0], [0.35, -0.02], [5, -0.02]]}
    for motion, last in (({"until": 0.3}, 0.3), ({"translation": (0, 0, opens)}, 0.35)):
        scene = lying()
        scene.plane("gate", **LEVEL, motion=motion)
        scene.plane("f", **LEVEL | {"point": (0, 0, -0.02)})
        assert last + 0.05 <= ended(scene) < 0.8
    pushed = lying()
    pushed.plane("f", **LEVEL)
    pushed.load("ball", force=({"table": [[0, 0], [0.5, 0], [0.51, 1e-2], [0.52, 0]]}, 0, 0))
    assert ended(pushed) > 0.57
    turning = lying()
    turning.plane("f", **LEVEL, motion={"rotation": {"axis": (0, 0, 1), "rate": 1e-4}})
    assert ended(turning) == pytest.approx(0.051)


@pytest.mark.parametrize(
    ("begin", "gate", "push"), [(7.0, 0.051, 0.051), (5.0, 0.051, 0.051), (4.9, 4.951, 5.0)]
)
def test_what_begins_after_the_end_of_a_run_is_not_waited_for(begin: float, gate: float, push: float) -> None:
    """The run ends at 5 s. A wall goes at once, and a push that begins before the end is not over there."""
    gated, pushed = lying(), lying()
    gated.plane("f", **LEVEL)
    wall = {"point": (1, 0, 0), "normal": (-1, 0, 0), "material": "g", "motion": {"until": begin}}
    gated.plane("gate", **wall)
    pushed.plane("f", **LEVEL)
    pushed.load("ball", force=({"table": [[0, 0], [begin, 0], [9, 1e-9]]}, 0, 0))
    for scene, end in ((gated, gate), (pushed, push)):
        result = carom.simulate(scene, stop=events.AtRest(hold=0.05), callback_every=1, every=1000)
        assert result.outcome.time == pytest.approx(end, abs=2e-3)


def test_what_a_run_waits_for_is_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look went through all rows of all tables, and fetched the whole state where there is an inflow."""
    scene = lying()
    scene.plane("f", **LEVEL)
    scene.load("ball", force=({"table": [[k * 1e-3, 1e-9 * (k % 2)] for k in range(3000)]}, 0, 0))
    region = {"low": (-0.1, -0.05, 0.01), "high": (-0.05, 0.05, 0.02)}
    scene.inflow("a", material="g", count=3, density=2500, region=region, seed=1, rate=10, radius=3e-3)
    walked, due = [], []
    walk = watch._changes
    monkeypatch.setattr(watch, "_changes", lambda part: walked.append(0) or walk(part))

    def look(view: carom.View) -> None:
        fetched = view._fetch_allowed().state()["entered"]
        np.testing.assert_array_equal(view.due, [False] + [k >= fetched[0] for k in range(3)])
        due.append(int(view.due.sum()))
        assert view.last_change == pytest.approx(0.4)
        view.due[:] = True  # a copy

    carom.simulate(scene, until=0.4, callback=look, callback_every=1)
    assert len(due) == 400
    assert sorted(set(due)) == [0, 1, 2]
    assert 0 < len(walked) < 400

    stepped, states = carom.Simulation(scene), []
    for steps, due_then in ((1, 2), (150, 1)):
        stepped.step(steps)
        assert stepped.due.sum() == due_then
        states.append((stepped.state(), due_then))
    for state, due_then in (*states, *states):
        stepped.restore(state)
        assert stepped.due.sum() == due_then
    assert stepped.last_change == 2.999  # without an end


def test_at_rest_can_ignore_a_ball_that_spins_on_the_spot() -> None:
    """Spin about z does not count then; back spin still does, which would set the ball in motion."""
    spinning = carom.Scene(gravity=(0, 0, 0), run={"until": 0.2, "step": 1e-3})
    spinning.sphere("ball", radius=R, mass=1, at=(0, 0, 1), angular_velocity=(0, 0, 5.0), material="m")
    ends = []
    for ignore in (False, True):
        result = carom.simulate(spinning, stop=events.AtRest(hold=0.05, ignore_spin=ignore), callback_every=1)
        ends.append((result.outcome.kind, round(result.outcome.time, 6)))
    assert ends == [("done", 0.2), ("stopped", 0.051)]
    assert events.rest(result) == []
    assert [event.time for event in events.rest(result, ignore_spin=True)] == [0.0]
    moving = carom.simulate(
        shot(0.0, spin=-5.0), until=0.2, stop=events.AtRest("cue", ignore_spin=True), callback_every=1
    )
    assert moving.outcome.kind == "done"


@pytest.mark.parametrize("method", ["moreau", "penalty"])
def test_a_ball_that_overlaps_its_plane_touches_it(method: str) -> None:
    """Methods with overlaps were said never to touch, so that nothing ever rolled."""
    result = carom.simulate(shot(1.0, method=method), until=0.45, every=20)
    assert (events.phases(result, "cue", "bed")[1:] != events.AWAY).all()
    [event] = events.slip_to_roll(result, "cue", "bed")
    assert event.time == pytest.approx(2.0 / (7.0 * MU * G), abs=2e-3)


def test_a_contact_that_is_there_before_its_first_impact_is_of_the_start() -> None:
    """A ball rolls on a floor that shakes off and hits again between two frames: it touched from the start."""
    scene = carom.Scene(run={"until": 0.1, "step": 1e-3})
    scene.sphere("ball", radius=R, mass=0.17, at=(0, 0, R), material="ball")
    motion = {"translation": [0, 0, {"table": [[0, 0], [0.012, 0], [0.0121, -5e-5], [0.1, -5e-5]]}]}
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth", motion=motion)
    scene.contact("ball", "cloth", friction=MU, restitution=0.5)
    result = carom.simulate(scene, every=10)
    assert 0.01 < result.impacts["time"][0] < 0.02
    event = events.first_contact(result, "ball", "bed")
    assert event is not None
    assert (event.time, event.within) == (0.0, 0.0)


@pytest.mark.parametrize(
    "run", [{"method": "events", "step": 2.0}, {"method": "events", "step": 0.1}, {"method": "nsga"}]
)
def test_a_ball_that_touches_from_the_start_does_so_before_it_rolls_or_leaves(run: dict[str, Any]) -> None:
    """Its contact had the time of the first frame: after its roll, and after it had left."""
    scene = shot(1.0, **run)
    scene.outlet(low=(0.4, -1, -1), high=(0.6, 1, 1))
    found = events.detect(carom.simulate(scene, until=2.0))
    mine = [(event.kind, event.time) for event in found if event.body == "cue"]
    assert [kind for kind, _ in mine] == ["contact", "roll", "left"]
    assert mine[0][1] == 0.0


def test_columns_are_read_once_and_not_for_each_ball(monkeypatch: pytest.MonkeyPatch) -> None:
    result = carom.simulate(shot(1.0), until=0.05)
    reads = []
    whole = Column.__getitem__
    monkeypatch.setattr(Column, "__getitem__", lambda self, key: reads.append(key) or whole(self, key))
    for find in (events.slip_to_roll, events.rest):
        reads.clear()
        find(result)
        assert len([key for key in reads if isinstance(key, tuple)]) <= 4


def test_wrong_names_and_moving_planes_are_told() -> None:
    result = carom.simulate(shot(), until=0.01)
    with pytest.raises(KeyError, match="did you mean cue"):
        events.slip_to_roll(result, "cu")
    with pytest.raises(KeyError, match="did you mean bed"):
        events.phases(result, "cue", "bet")
    with pytest.raises(CaromError, match="above 0"):
        events.AtRest(speed=0.0)
    scene = shot()
    scene.plane(
        "belt", point=(0, 0, -1), normal=(0, 0, 1), material="cloth", motion={"surface_velocity": [1, 0, 0]}
    )
    moving = carom.simulate(scene, until=0.01)
    with pytest.raises(CaromError, match="'belt' moves"):
        events.slip_to_roll(moving, "cue", "belt")
    assert {e.other for e in events.slip_to_roll(moving)} <= {"bed"}


def test_events_are_the_same_however_few_frames_fit_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames are read in windows: an event may lie across the border of two, in any place."""
    result = carom.simulate(shot(speed=0.3, rho=2e-3), every=7)
    whole = events.rest(result), events.slip_to_roll(result)
    assert [len(found) for found in whole] == [2, 1]
    frames = len(result.time)
    for numbers in range(3, frames + 2):
        monkeypatch.setattr(events, "BLOCK", 6 * numbers)  # of two balls with three components
        assert (events.rest(result), events.slip_to_roll(result)) == whole, numbers
    assert events.rest(result, "cue") == [event for event in whole[0] if event.body == "cue"]
