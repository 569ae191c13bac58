"""The auditor: clean runs of every method are clean, each planted fault is caught, and by its own law."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import audit_faults as fault
import audit_scenes as scenes
import carom
import h5py
import numpy as np
import pytest
from audit_faults import Fault
from carom import _core, audit
from carom.audit.block import pile_overlap
from carom.audit.report import Place, Tally
from trials import Trials

Maker = Callable[[str], Path]
CAUGHT = "planted faults caught by their law"

PRINTED: dict[str, object] = {"position_friction": "paper"}

CLEAN: dict[str, tuple[Callable[[], carom.Scene], float, dict[str, object]]] = {
    "break": (scenes.break_, 0.25, {}),
    "break-moreau": (scenes.break_, 0.12, {"method": "moreau"}),
    "rolling": (scenes.rolling, 0.15, {}),
    "slow": (lambda: scenes.ball_on_plane((0.1, 0.0, 0.0)), 0.15, {"contacts": False}),
    "two": (scenes.two_balls, 0.05, {}),
    "two-tangential": (lambda: scenes.two_balls(tangential_restitution=0.4), 0.05, {}),
    "pile": (scenes.pile, 0.25, {}),
    "pile-coarse": (scenes.pile, 0.25, {"every": 7}),
    "pile-moreau": (scenes.pile, 0.15, {"method": "moreau"}),
    "pile-penalty": (scenes.pile, 0.15, {"method": "penalty"}),
    "dull-penalty": (scenes.dull, 0.1, {"method": "penalty"}),
    "pile-summed": (scenes.pile, 0.25, {"pile_tolerance": 1e-4, "max_problems": 50}),
    "pile-every": (scenes.pile, 0.25, {"pile_tolerance": 1e-4, "max_problems": 50, "impacts": "every"}),
    "pile-blind": (
        scenes.pile,
        0.25,
        {"pile_tolerance": 1e-4, "max_problems": 50, "impacts": "every", "contacts": False},
    ),
    "pile-bare": (scenes.pile, 0.15, {"contacts": False, "impacts": False, "walls": True}),
    "shaken": (scenes.shaken, 0.3, {}),
    "shaken-moreau": (scenes.shaken, 0.3, {"method": "moreau"}),
    # Islands solved as piles for their places have one frame for their impacts too, however few touch.
    "shaken-layer": (scenes.shaken_layer, 0.115, {"impacts": "every"}),
    "loose-layer": (scenes.loose_layer, 0.12, {}),
    "landed-layer-moreau": (scenes.landed_layer, 0.08, {"method": "moreau"}),
    "drum": (scenes.drum, 0.2, {}),
    "drum-moreau": (scenes.drum, 0.2, {"method": "moreau"}),
    "drum-penalty": (scenes.drum, 0.2, {"method": "penalty"}),
    # As printed: loads have friction of their own at the position level.
    "break-printed": (scenes.break_, 0.25, PRINTED),
    "rolling-printed": (scenes.rolling, 0.15, PRINTED),
    "shaken-printed": (scenes.shaken, 0.3, PRINTED),
    "drum-printed": (scenes.drum, 0.2, PRINTED),
    "loose-layer-printed": (scenes.loose_layer, 0.12, PRINTED),
    "dropped": (scenes.dropped, 0.1, {}),
    "joined": (scenes.joined, 0.5, {}),
    "joined-moreau": (scenes.joined, 0.5, {"method": "moreau"}),
    "linked": (scenes.linked, 0.2, {}),
    "linked-printed": (scenes.linked, 0.2, PRINTED),
    "loaded": (scenes.loaded, 0.3, {}),
    "flowing": (scenes.flowing, 0.6, {}),
    "wall-ahead": (scenes.wall_ahead, 0.1, {}),
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Maker:
    """Runs by their names, each made once."""
    made: dict[str, Path] = {}

    def make(name: str) -> Path:
        if name not in made:
            scene, until, options = CLEAN[name]
            made[name] = scenes.run(scene(), tmp_path_factory.mktemp("runs") / name, until, **options)
        return made[name]

    return make


#: Runs and faults whose likes are in the quick tier.
LONG = {
    "two-tangential",
    "drum-penalty",
    "loose-layer-printed",
    "joined-moreau",
    "pile-moreau",
    "velocity changed, moreau",
    "frame shifted, moreau",
    "velocity changed, penalty",
    "velocity changed, joined",
    "closing contact",
    "into the floor, penalty",
}


def tiered(names: Iterable[str]) -> list[Any]:
    """Parameters, some of them for the long tier."""
    return [pytest.param(n, marks=pytest.mark.long) if n in LONG else n for n in names]


@pytest.mark.parametrize("name", tiered(CLEAN))
def test_a_clean_run_is_clean(run: Maker, name: str) -> None:
    report = audit.check(run(name))
    assert report.ok, repr(report)
    assert report["momentum"].judged or name == "slow"  # whose contacts are not recorded
    assert report["numbers"].judged
    # What is set already is no advice.
    cures = {u.cure for verdict in report.verdicts.values() for u in verdict.unjudged}
    chosen = {"every": 1, "contacts": True, "impacts": True, "walls": False} | CLEAN[name][2]
    given = [f"{key} = {value}" for key, value in (("every", 1), ("contacts", "true"), ("impacts", "true"))
             if str(chosen[key]).lower() == str(value)]  # fmt: skip
    assert not [cure for cure in cures for setting in given if setting in cure]


ROLLING_STEP = 60  # of 150: it slides and rolls on
PUSH = np.array([1e-9, 0.0, 0.0])

FAULTS: dict[str, tuple[str, Fault, str]] = {
    "impulse pulls": ("rolling", fault.flip_impulse(ROLLING_STEP), "sign"),
    "friction leaves its cone": ("rolling", fault.widen_friction(20), "friction cone"),
    "friction along the slip": ("rolling", fault.drag_along(20), "slip"),
    "rolling moment drives": ("rolling", fault.roll_against(ROLLING_STEP), "roll"),
    "slip said to be stick": ("rolling", fault.write("contacts/status", 19, 1), "slip"),
    "stick said to be slip": ("break", fault.slip_in_place_of_stick, "slip"),
    "stick said to be slip, in an impact": ("two", fault.write("impacts/status", 0, 2), "slip"),
    "an impact that is said to be none": ("two", fault.write("impacts/status", 0, 0), "slip"),
    "impulse lost": ("rolling", fault.lose_impulse(ROLLING_STEP), "momentum"),
    "velocity changed": ("rolling", fault.push_velocity(ROLLING_STEP, 0, PUSH), "momentum"),
    "velocity changed, in a pile": ("pile", fault.push_velocity(200, 7, PUSH), "momentum"),
    "velocity changed, moreau": ("pile-moreau", fault.push_velocity(100, 7, PUSH), "momentum"),
    "velocity changed, penalty": ("pile-penalty", fault.push_velocity(100, 7, PUSH), "momentum"),
    "velocity changed, seven steps a frame": ("pile-coarse", fault.push_velocity(20, 7, PUSH), "momentum"),
    "velocity changed, walls alone recorded": (
        "pile-bare",
        fault.push_velocity(100, 7, PUSH),
        "wall impulse",
    ),
    "velocity changed, joined": ("joined", fault.push_velocity(100, 0, 1e4 * PUSH), "momentum"),
    "energy added to a ball": ("break", fault.speed_up(200, 2, 1.01), "energy balance"),
    "energy added to the record": ("break", fault.raise_energy(150, 1e-9), "energy record"),
    "rise of energy in the first step": ("pile-bare", fault.raise_energy(0, 0.1), "energy rise"),
    "rise of energy": ("pile-bare", fault.raise_energy(100, 0.1), "energy rise"),
    "contacts give energy": ("rolling", fault.more_work(ROLLING_STEP, 1e-2), "passivity"),
    "work misstated": ("rolling", fault.more_work(ROLLING_STEP, -1e-6), "energy balance"),
    # One of each law of impacts, where it begins.
    "rolling moment of an impact": (
        "dropped",
        fault.scale("impacts/moment", 0, [1.1, 1.1, 1.0]),
        "rolling cone",
    ),
    "spinning moment of an impact": (
        "dropped",
        fault.scale("impacts/moment", 0, [1.0, 1.0, 1.1]),
        "spinning cone",
    ),
    "moment of an impact drives": ("dropped", fault.scale("impacts/moment", 0, -1.0), "roll"),
    "slip restored too little": ("dropped", fault.restore_slip(0, 0.9), "slip"),
    "slip restored too little, two balls": ("two-tangential", fault.restore_slip(0, 0.9), "slip"),
    "closing contact, beside a load": (
        "dropped",
        fault.push_velocity(90, 1, np.array([0, 0, -1e-4])),
        "approach",
    ),
    "velocity changed, under a load": ("dropped", fault.push_velocity(90, 1, PUSH), "momentum"),
    "restitution too large, moving wall": ("shaken", fault.restitute(0, 1.1), "impact"),
    "collective impact": ("pile-every", fault.of_collective(lambda row: fault.restitute(row, 1.1)), "impact"),
    **{
        f"{what}, {name}": (name, plant, kind)
        for what, of, plant, kind in (
            ("impulse pulls", "rolling", fault.flip_impulse(ROLLING_STEP), "sign"),
            ("friction leaves its cone", "rolling", fault.widen_friction(20), "friction cone"),
            ("friction along the slip", "rolling", fault.drag_along(20), "slip"),
            ("rolling moment drives", "rolling", fault.roll_against(ROLLING_STEP), "roll"),
            ("ball moved", "rolling", fault.move_body(50, 0, np.array([1e-11, 0, 0])), "position"),
            ("ball turned", "rolling", fault.turn_body(50, 0, 1e-9), "rotation"),
            # Where normals turn, positions have loads that are solved again for the velocities.
            ("ball moved on", "drum", fault.move_body(150, 3, np.array([1e-6, 0, 0])), "position"),
            ("ball turned on", "drum", fault.turn_body(150, 3, 1e-4), "rotation"),
            ("spin changed", "drum", fault.scale("frames/angular_velocity", 150, 1.0 + 1e-9), "spin"),
            ("velocity changed", "pile", fault.push_velocity(200, 7, PUSH), "momentum"),
            ("restitution too large", "break", fault.restitute(3, 1.1), "impact"),
            ("work of friction", "drum", fault.scale_largest("contacts/work_friction", 1.01), "work"),
            ("work of pushes", "shaken", fault.scale_largest("contacts/work_normal", 1.01), "work"),
        )
        for name in ([of] if of == "pile" else [of, f"{of}-printed"])
    },
    **{
        f"1 % more work, {column}, {name}": (
            name,
            fault.scale_largest(f"contacts/work_{column}", 1.01),
            "work",
        )
        for name, columns in {
            "rolling": ("normal", "friction", "rolling", "spinning"),
            "break": ("normal", "friction"),
            "pile": ("normal", "friction"),
            "pile-moreau": ("normal", "friction"),
            "shaken": ("normal", "friction"),
            "drum": ("normal", "friction"),
            "flowing": ("normal", "friction"),
        }.items()
        for column in columns
    },
    # What joints, dampers and drag hold is judged by what they answer.
    **{
        f"{what}, {name}": (name, plant, kind)
        for name, row in {"joined": 3, "linked": 1, "linked-printed": 1}.items()
        for what, plant, kind in (
            ("restitution too large", fault.restitute(row, 1.01), "impact"),
            ("restitution too small", fault.restitute(row, 0.99), "impact"),
            ("approach misstated", fault.scale("impacts/approach", row, 1.001), "impact speeds"),
            ("friction beyond its cone", fault.more_friction(row, 4.0), "friction cone"),
            ("impact not told", fault.lose_impact(row), "impact"),
            ("work of pushes", fault.scale_largest("contacts/work_normal", 1.01), "work"),
            ("work of friction", fault.scale_largest("contacts/work_friction", 1.01), "work"),
            ("contacts give energy", fault.more_work(79 if name == "joined" else 30, 1.0), "passivity"),
        )
    },
    "energy added to a ball, joined": ("joined", fault.speed_up(99, 0, 1.2), "energy balance"),
    "frame shifted": ("break", fault.shift_frame(200), "position"),
    "frame shifted, moreau": ("drum-moreau", fault.shift_frame(100), "position"),
    "quaternion scaled": ("rolling", fault.scale_quaternion(50, 0), "quaternion"),
    "orientation turned": ("rolling", fault.turn_body(50, 0, 1e-9), "rotation"),
    "not a number": ("rolling", fault.not_a_number("frames/velocity", 40), "numbers"),
    "not a number in a table": ("rolling", fault.not_a_number("contacts/impulse", 40), "numbers"),
    "through a wall": ("wall-ahead", fault.move_body(50, 0, np.array([-0.1, 0, 0])), "tunnelling"),
    "through a ball": ("two", fault.move_body(10, 0, np.array([0.14, 0, 0])), "tunnelling"),
    "into the floor": ("pile", fault.move_body(200, 7, np.array([0, 0, -1e-3])), "penetration"),
    "into the floor, penalty": (
        "pile-penalty",
        fault.move_body(100, 7, np.array([0, 0, -1e-2])),
        "penetration",
    ),
    "restitution too large": ("two", fault.restitute(0, 1.1), "impact"),
    "restitution too large, in a break": ("break", fault.restitute(3, 1.1), "impact"),
    "open contact pushes": ("rolling", fault.open_contact(ROLLING_STEP, 1e-6), "complementarity"),
    "gap misstated": ("rolling", fault.report_gap(ROLLING_STEP, 1e-9), "gap"),
    "time tampered": ("rolling", fault.tamper_time(30, 1e-9), "clock"),
    "mass changed": ("rolling", fault.heavier(0), "scenario"),
    "wall impulse misstated": ("shaken", fault.lighter_wall(0), "wall impulse"),
    "ball moved, joined": ("joined", fault.move_body(100, 2, np.array([0, 1e-9, 0])), "position"),
    "ball moved beside its joint": ("joined", fault.move_body(100, 1, np.array([0, 1e-5, 0])), "position"),
    "ball turned beside its joint": ("joined", fault.turn_body(100, 0, 5e-4), "rotation"),
    "joint torn": ("joined", fault.move_body(100, 1, np.array([0, 1e-6, 0])), "joint"),
    "joint torn in its speeds": (
        "joined",
        fault.push_velocity(100, 1, np.array([0, 0, 1e-3])),
        "joint speed",
    ),
    "impulse of an impact, with joints": (
        "joined",
        fault.write("impacts/impulse", (0, 2), 7.0),
        "impact sum",
    ),
    "moment of an impact": ("two", fault.write("impacts/moment", (0, 1), 1e-6), "impact sum"),
    "speed after an impact, with joints": (
        "joined",
        fault.write("impacts/separation", 0, 7.0),
        "impact speeds",
    ),
    "normal of an impact": ("joined", fault.write("impacts/normal", (0, 2), 1.001), "normal"),
    "impact not told": ("break", fault.lose_impact(3), "impact"),
    "restitution more than whole": ("two", fault.write("impacts/restitution_scale", 0, 1.5), "counts"),
    "moment of a wall": ("shaken", fault.write("frames/walls", (80, 0, 4), 1.0), "wall moment"),
    "reaction of a joint no number": (
        "joined",
        fault.write("frames/joint_impulse", (79, 0, 2), np.nan),
        "momentum",
    ),
    "wall moved": ("shaken", fault.write("planes/point", (0, 2), 1e-3), "scenario"),
    "size of a wall": ("wall-ahead", fault.write("walls/size", (0, 1), 0.5), "scenario"),
    "material of a ball": ("two", fault.write("bodies/material", 1, 1), "scenario"),
    "orientation at the start": ("two", fault.write("frames/orientation", (0, 1), [0, 1, 0, 0]), "scenario"),
    "penetration hidden": (
        "pile-penalty",
        fault.write("steps/penetration", slice(None), 0.0),
        "penetration record",
    ),
    "penetration invented": ("rolling", fault.write("steps/penetration", 50, 1e-6), "penetration record"),
    "work of nothing": ("joined", fault.write("steps/energy_work", 30, 1e-3), "energy record"),
    "energy of what entered": ("flowing", fault.write("steps/energy_in", slice(None), 0.0), "energy record"),
    "arrivals miscounted": ("flowing", fault.write("steps/entered", 10, 5), "counts"),
    "a ball is back that left": ("flowing", fault.write("frames/present", (-1, 0), True), "flow"),
    "a ball stays in the outlet": ("flowing", fault.fall_on(0.05), "flow"),
    "a ball enters early": ("flowing", fault.write("events/step", 1, 20), "flow"),
    "a ball enters beside its region": ("flowing", fault.at_entry("position", 0.1), "flow"),
    "a ball enters faster": ("flowing", fault.at_entry("velocity", 0.3), "flow"),
    "contacts miscounted": ("rolling", fault.write("steps/contacts", 50, 0), "counts"),
    "impact problems miscounted": ("break", fault.write("steps/impact_problems", slice(None), 0), "counts"),
    **{
        f"{what}, in a pile": ("pile-every", fault.of_pile(plant, problem), kind)
        for what, plant, problem, kind in (
            ("restitution too large", lambda row: fault.restitute(row, 1.1), 1, "impact"),
            ("restitution too small", lambda row: fault.restitute(row, 0.9), 1, "impact"),
            ("restitution too large later", lambda row: fault.restitute(row, 1.2), 3, "impact"),
            ("energy from an impact", lambda row: fault.restitute(row, 3.0), 1, "passivity"),
            ("a push in place of a later one", fault.bring_forward, 3, "impact"),
            ("friction beyond its cone", fault.beyond_cone, 1, "friction cone"),
            ("friction along the slip", lambda row: fault.more_friction(row, -1.0), 1, "slip"),
            (
                "impulse of one problem",
                lambda row: fault.scale("impacts/impulse", row, 1.001),
                2,
                "impact sum",
            ),
            ("approach misstated", lambda row: fault.scale("impacts/approach", row, 1.1), 2, "impact speeds"),
            ("factor misstated", lambda row: fault.write("impacts/restitution_scale", row, 0.5), 1, "counts"),
            ("the loads misstated", lambda row: fault.scale("impacts/impulse", row, 1.1), 0, "impact"),
            (
                "taken for the end of a cut sequence",
                lambda row: fault.write("impacts/problem", row, 51),
                1,
                "counts",
            ),
        )
    },
    "position impulse of penalty": (
        "pile-penalty",
        fault.write("contacts/position_impulse", (5, 2), 1e30),
        "position",
    ),
    "closing contact, slowly": ("slow", fault.push_velocity(100, 0, np.array([0, 0, -1e-4])), "approach"),
    "closing contact": ("pile", fault.push_velocity(200, 0, np.array([0, 0, -0.1])), "approach"),
}


@pytest.mark.parametrize("name", tiered(FAULTS))
def test_a_planted_fault_is_caught_by_its_law(run: Maker, tmp_path: Path, name: str, trials: Trials) -> None:
    scene, plant, kind = FAULTS[name]
    copy = fault.planted(run(scene), tmp_path / "copy", plant)
    with trials(CAUGHT):
        report = audit.check(copy)
        assert report[kind].violations, repr(report)
        assert report[kind].worst is not None
        assert report[kind].worst.ratio > 1.0


#: Numbers that point to what is not there; with none of them may the auditor stumble.
DANGLING = {
    "body of a contact": ("rolling", fault.write("contacts/body", (40, 1), 10**9)),
    "status of a contact": ("two", fault.write("contacts/status", 0, 9)),
    "status of an impact": ("two", fault.write("impacts/status", 0, 3)),
    "contact with itself": ("two", fault.write("contacts/body", (0, 1), 0)),
    "body of an impact": ("two", fault.write("impacts/body", (0, 0), 10**9)),
    "step of an impact": ("two", fault.write("impacts/step", 0, 10**9)),
    "step of a frame": ("rolling", fault.write("frames/step", 40, 10**9)),
    "end of the contacts": ("rolling", fault.write("frames/contact_end", 40, 10**9)),
    "body that enters": ("flowing", fault.write("events/body", 0, 10**9)),
    "kind of an event": ("flowing", fault.write("events/kind", 0, 2)),
}


@pytest.mark.parametrize("name", DANGLING)
def test_what_points_nowhere_is_a_finding_and_nothing_else_is_said_to_be_kept(
    run: Maker, tmp_path: Path, name: str, trials: Trials
) -> None:
    scene, plant = DANGLING[name]
    copy = fault.planted(run(scene), tmp_path / "copy", plant)
    with trials(CAUGHT):
        report = audit.check(copy)
        assert report["references"].violations, repr(report)
    assert {v.word for v in report.verdicts.values()} == {"violated", "not judged"}


def test_a_bound_that_is_no_number_is_violated() -> None:
    tally = Tally()
    tally.measure("momentum", [0.0, 1.0], [np.nan, 2.0], lambda i: Place(step=i))
    verdict = tally.close()["momentum"]
    assert (verdict.judged, verdict.violations) == (2, 1)
    assert verdict.worst is not None
    assert verdict.worst.place.step == 0
    assert verdict.worst.ratio == np.inf


def test_small_islands_of_a_large_scene_have_their_impacts_judged(tmp_path: Path) -> None:
    """A scene with many candidate pairs is no pile where nothing touches in numbers."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("ball", "ball", friction=0.2, restitution=0.5)
    for k in range(121):
        x, y = 0.0402 * (k % 11), 0.0402 * (k // 11)
        speed = (0.5 * (-1) ** k, 0.5 * (-1) ** (k // 11), 0)
        scene.sphere(f"b{k}", radius=0.02, mass=0.1, material="ball", position=(x, y, 0), velocity=speed)
    path = scenes.run(scene, tmp_path / "many", 0.01)
    assert np.asarray(carom.load(path).steps["candidates"]).max() > 100
    report = audit.check(path)
    assert report.ok, repr(report)
    assert report["impact"].judged
    assert not report["impact"].unjudged


@pytest.mark.parametrize("name", ["pile-summed", "pile-every"])
def test_impacts_of_piles_are_judged_where_every_problem_is_recorded(run: Maker, name: str) -> None:
    path = run(name)
    result, report = carom.load(path), audit.check(path)
    assert result.steps["largest_island"].max() > 10
    every = name == "pile-every"
    for kind in ("impact", "slip"):
        assert any("piles" in u.why for u in report[kind].unjudged) is not every
        assert every or all("every" in u.cure for u in report[kind].unjudged if "piles" in u.why)
    assert not every or report["impact"].judged >= len(result.impacts)
    # Sequences that were cut are said to be, and their last problem is judged like the others.
    assert result.steps["truncated"].any()
    assert any("ended by one problem with all contacts" in words for words in report.warnings)


def test_impacts_slower_than_what_loads_may_do_between_the_recorded_speeds_are_not_judged(
    run: Maker, tmp_path: Path
) -> None:
    """Without contacts the bound grows with the weight of all balls; "ok" had been said within it."""
    path = run("pile-blind")
    verdict, impacts = audit.check(path)["impact"], carom.load(path).impacts
    speed = np.maximum(np.abs(impacts["approach"]), np.abs(impacts["separation"]))
    slow = verdict.unjudged[0]
    assert verdict.word == "ok"
    assert "contacts = true" in slow.cure
    assert verdict.judged + slow.count == len(impacts)
    assert verdict.judged > 100
    restoring = (impacts["problem"][:] > 0) & (impacts["problem"][:] <= 50)
    assert slow.count >= np.count_nonzero(
        restoring & (speed < 0.3 * 9.8e-3 * (2 + 20))
    )  # equal balls, e_N >= 0.3
    fast = int(np.argmax(np.where(impacts["problem"][:] == 1, impacts["separation"][:], 0.0)))
    bad = audit.check(
        fault.planted(path, tmp_path / "fast", fault.write("impacts/separation", fast, 2.0 * speed[fast]))
    )
    assert bad["impact"].violations == 1
    assert bad["impact"].unjudged == verdict.unjudged


def test_recording_every_problem_leaves_the_motion_as_it_is(run: Maker) -> None:
    one, other = (carom.load(run(name)) for name in ("pile-summed", "pile-every"))
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        assert np.array_equal(getattr(one, name)[:], getattr(other, name)[:]), name
    for table in ("contacts", "steps"):
        mine, theirs = getattr(one, table), getattr(other, table)
        assert all(np.array_equal(mine[name], theirs[name]) for name in mine.columns), table
    assert len(other.impacts) > len(one.impacts)


def test_a_spring_at_the_ground_is_judged_where_the_first_ball_has_left(tmp_path: Path) -> None:
    """The ground took its velocity, 0, from the first ball times 0, which is no number once that ball is gone."""
    scene = carom.Scene(run={"step": 1e-3})
    scene.contact("m", "m", friction=0.1, restitution=0.0)
    scene.sphere("leaver", radius=0.01, mass=0.01, material="m", at=(1, 0, 0), velocity=(1, 0, 0))
    scene.sphere("hung", radius=0.01, mass=0.01, material="m", at=(0, 0, 0))
    scene.spring(
        "hung", "ground", stiffness=10.0, damping=0.01, rest_length=0.05, points=((0, 0, 0), (0, 0, 0.1))
    )
    scene.outlet(low=(1.02, -1, -9), high=(9, 1, 9))
    path = scenes.run(scene, tmp_path / "hung", 0.05)
    assert not carom.load(path).present[-1][0]
    report = audit.check(path)
    assert report.ok, repr(report)
    assert report["momentum"].judged


def test_a_ball_that_leaves_while_it_touches_another(tmp_path: Path) -> None:
    """The contact was held against the place of a ball that has none. The energies that are left of a sum with one that left
    have the rounding of that sum. Numbers of groups of impacts had no room where the first group had left.
    """
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("m", "m", friction=0.3, restitution=0.3)
    scene.plane("floor", point=(0.2, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("a", radius=0.01, density=2500, material="m", position=(0, 0, 0.1))
    scene.sphere("b", radius=0.01, density=2500, material="m", position=(0, 0.001, 0.12), velocity=(0, 0, -1))
    scene.sphere("c", radius=0.01, density=2500, material="m", position=(0.2, 0, 0.01))
    scene.sphere("d", radius=0.01, density=2500, material="m", position=(0.3, 0, 0.013))
    scene.outlet(low=(-0.1, -1, -9), high=(0.1, 1, 0.0999))
    path = scenes.run(scene, tmp_path / "two", 0.05)
    result = carom.load(path)
    assert set(result.events.step[:].tolist()) & set(result.impacts.step[:].tolist())
    report = audit.check(path)
    assert report.ok, repr(report)


@pytest.mark.parametrize(("drag", "friction"), [(0.05, 0.1), (0.005, 0.1), (0.5, 0.1), (0.05, 0.0)])
def test_a_ball_that_slides_and_rolls_with_drag_is_clean(
    drag: float, friction: float, tmp_path: Path
) -> None:
    """The scheme takes the drag of the velocity without contacts too, as if the ball fell; this had counted as a fault."""
    scene = carom.Scene(run={"step": 1e-3})
    scene.contact("m", "m", friction=friction, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("a", radius=0.01, mass=0.01, material="m", at=(1, 0, 0.01), velocity=(1, 0, 0))
    scene.drag("a", translation=drag, rotation=1e-6)
    path = scenes.run(scene, tmp_path / "drag", 0.2)
    report = audit.check(path)
    assert report.ok, repr(report)
    assert report["position"].judged == report["momentum"].judged == 200
    # The bound is of second order in the step: it still finds a drag that is a fifth too strong.
    assert report["momentum"].worst is not None
    assert report["momentum"].worst.bound < 0.2 * drag * 1e-3


def test_the_filter_of_loads_remembers_an_impact_for_several_steps(tmp_path: Path) -> None:
    """Drag falls with the speed in an impact, and the pseudo acceleration follows in a geometric series: bounds do too."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": 1e-3})
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    for k, (x, v) in enumerate(((0.0, 1.0), (0.0205, 0.0))):
        scene.sphere(f"b{k}", radius=0.01, mass=0.01, material="m", at=(x, 0, 0), velocity=(v, 0, 0))
        scene.drag(f"b{k}", translation=0.1)
    report = audit.check(scenes.run(scene, tmp_path / "echo", 0.05))
    assert report.ok, repr(report)
    assert report["momentum"].judged == 100


def test_an_impact_is_felt_through_a_damper(tmp_path: Path) -> None:
    """The speed after an impact on one ball is not that of the frame where a later impact moved another on its damper."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": 5e-4})
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for name, at, velocity in (
        ("alone", (0.0, 0, 0.02), (0, 0, -0.5)),
        ("below", (0.1, 0, 0.02), (0, 0.7, -0.6)),
        ("above", (0.124, 0, 0.052), (0, 0, -0.1)),
    ):
        scene.sphere(name, radius=0.02, mass=0.08, material="m", at=at, velocity=velocity)
    scene.spring(
        "alone",
        "above",
        points=((0, 0, 0.02), (0.124, 0, 0.052)),
        stiffness=10.0,
        damping=0.43,
        rest_length=0.1,
    )
    path = scenes.run(scene, tmp_path / "felt", 0.003)
    assert carom.load(path).impacts["problem"][:].max() > 1
    report = audit.check(path)
    assert report.ok, repr(report)
    assert report["impact speeds"].judged


def test_forces_that_cancel_between_two_frames_have_moved_their_ball(tmp_path: Path) -> None:
    """An impulse that is none in sum shifts a ball all the same."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": 5e-4}, record={"every": 3})
    scene.sphere("b", radius=0.01, mass=0.01, material="m", at=(0, 0, 0))
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    scene.load("b", force=(0, {"expression": "0.05*sin(200*t)"}, 0))
    report = audit.check(scenes.run(scene, tmp_path / "cancel", 0.06, every=3))
    assert report.ok, repr(report)


def test_the_overlap_admitted_in_piles_is_the_solver_s() -> None:
    """The auditor has the formula in its own words; where they part, one of them is wrong."""
    contacts = np.unique(np.geomspace(101, 1e6, 200).astype(int))
    for tolerance in (1e-9, 1e-6, 1e-5, 1e-4, 2.4e-4, 2.6e-4, 1e-3, 1e-2):
        theirs = [_core.pile_overlap(tolerance, int(n)) for n in contacts]
        assert pile_overlap(tolerance, contacts) == pytest.approx(theirs, rel=1e-12), tolerance


def test_balls_that_go_far_between_frames_are_looked_at_where_they_are(tmp_path: Path) -> None:
    """Pairs are sought near both ends of the interval, not along all of the way: those would be all pairs."""
    scene = carom.Scene()
    scene.material("steel")
    scene.contact("steel", "steel", friction=0.1, restitution=0.5)
    places = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for k, place in enumerate(places):
        scene.sphere(f"b{k}", radius=0.01, density=7800, material="steel",
                     position=0.08 * place, velocity=(1.0, 0.0, 0.0))  # fmt: skip
    path = tmp_path / "run"
    carom.simulate(scene, out=path, step=1e-3, until=0.2, every=50)
    clean = carom.audit.check(path)
    assert clean.ok
    # The ways of 125 balls in four intervals reach as many neighbours; those near either end are none.
    assert clean["penetration"].judged == 0
    assert any("some radii" in of.why and of.count == 4 * 125 for of in clean["tunnelling"].unjudged)

    def overlap(file: h5py.File) -> None:
        place = file["frames/position"]
        place[-1, 100] = place[-1, 3] + np.array([0.019, 0.0, 0.0])

    found = carom.audit.check(fault.planted(path, tmp_path / "copy", overlap))
    assert found["penetration"].word == "violated"
    assert found["penetration"].worst is not None
    assert found["penetration"].worst.place.who == ("b3", "b100")


def test_a_ball_that_one_from_far_away_hits_is_in_no_free_flight(tmp_path: Path) -> None:
    """Without recorded contacts free flight is all that is judged of it: the hit would be momentum out of nothing."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("ball", "ball", friction=0.0, restitution=0.9)
    for k in range(70):
        place = (1 + 0.1 * (k % 10), 1 + 0.1 * (k // 10), 0)
        scene.sphere(f"b{k}", radius=0.01, density=7800, material="ball", position=place)
    scene.sphere("target", radius=0.01, density=7800, material="ball", position=(0, 0, 0))
    scene.sphere(
        "cue", radius=0.01, density=7800, material="ball", position=(-0.06, 0.0197, 0), velocity=(2, 0, 0)
    )
    run = carom.simulate(scene, step=1e-3, until=0.04, every=40, contacts=False, out=tmp_path / "run")
    assert np.linalg.norm(run["target"].velocity[-1]) > 0.01
    report = audit.check(run)
    assert report.ok, repr(report)
    assert report["momentum"].judged == 70
