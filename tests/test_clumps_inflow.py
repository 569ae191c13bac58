"""Clumps enter in the course of a run: as whole bodies, at their rate, turned at random or as they are given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from audit_faults import planted
from carom import audit
from clump_scenes import ROD, R, empty

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

OPTIONS: dict[str, Any] = {"step": 1e-3, "pile_tolerance": 1e-4, "every": 1}
WIDE = 6 * R


def filled(**keys: Any) -> carom.Scene:
    """Rods and balls rain into a box; in one half of it they leave at the floor."""
    scene = empty(friction=0.5)
    scene.box("room", material="grain", low=(-WIDE, -WIDE, 0), high=(WIDE, WIDE, 1), open=["high_z"])
    region = {"low": (-WIDE + 2 * R, -WIDE + 2 * R, 0.1), "high": (WIDE - 2 * R, WIDE - 2 * R, 0.12)}
    given = {"spheres": ROD, "rate": 150.0, "velocity": (0, 0, -1), "spread": 0.2} | keys
    scene.inflow("rod", count=40, region=region, material="grain", density=2500, seed=2, **given)
    scene.inflow(
        "ball",
        count=20,
        region=region,
        material="grain",
        density=2500,
        seed=3,
        diameter=R,
        start=0.1,
        rate=80.0,
    )
    scene.outlet(low=(0, -WIDE, 0), high=(WIDE, WIDE, 1.5 * R))
    return scene


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> carom.Result:
    out = tmp_path_factory.mktemp("inflow") / "run"
    return carom.simulate(filled(), until=0.6, out=out, **OPTIONS)


def entered_at(result: carom.Result) -> dict[str, int]:
    """The step after which each clump entered."""
    kind, step, body = (np.asarray(result.events[name]).astype(int) for name in ("kind", "step", "body"))
    found = {}
    for name, clump in result.clumps.items():
        steps = step[(kind == 1) & np.isin(body, clump.numbers)]
        assert len(steps) == len(clump.numbers)  # all its balls
        assert len(set(steps.tolist())) == 1  # together
        found[name] = int(steps[0])
    return found


def test_clumps_enter_whole_at_their_rate_and_leave(run: carom.Result) -> None:
    entered = entered_at(run)
    assert list(entered)[:2] == ["rod1-", "rod2-"]
    assert run.names[:3] == ["rod1-1", "rod1-2", "rod2-1"]
    assert list(entered.values()) == [int(np.ceil(k / 0.15 - 1e-6)) for k in range(40)]
    axes = []
    for name, step in entered.items():
        clump = run.clumps[name]
        first, second = (run[ball].position[step] for ball in clump.balls)
        assert not clump.present[:step].any()
        assert np.abs(clump.velocity[step] - [0, 0, -1]).max() <= 0.2
        assert not clump.angular_velocity[step].any()
        assert clump.position[step] == pytest.approx(0.5 * (first + second), abs=1e-15)
        assert np.linalg.norm(second - first) == pytest.approx(2 * R, rel=1e-12)
        assert 0.1 <= clump.position[step][2] <= 0.12
        axes.append((second - first) / (2 * R))
    spread = np.linalg.eigvalsh(np.einsum("ki,kj->ij", axes, axes) / len(axes))
    assert spread.min() > 0.15  # all directions: a third each, of 40 rods
    assert run.summary["removed"] > 20
    assert run.steps.energy_in.sum() > 0
    report = audit.check(run)
    assert report.ok, repr(report)


def test_clumps_of_a_given_orientation_enter_so() -> None:
    half = np.sqrt(0.5)
    result = carom.simulate(filled(orientation=(half, 0, half, 0)), until=0.05, **OPTIONS)
    for name, step in entered_at_first(result).items():
        first, second = (result[ball].position[step] for ball in result.clumps[name].balls)
        assert second - first == pytest.approx([0, 0, -2 * R], abs=1e-15)
        assert np.abs(result.clumps[name].orientation[step] @ [half, 0, half, 0]) == pytest.approx(
            1, abs=1e-12
        )
    assert audit.check(result).ok


def test_clumps_that_enter_in_another_orientation_are_found(tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = carom.simulate(filled(orientation=(1, 0, 0, 0)), until=0.02, out=out, **OPTIONS)
    step = entered_at_first(result)["rod2-"]

    def turned(file: h5py.File) -> None:
        half, row = np.sqrt(0.5), file["frames/clumps"][step, 1]
        row[3:7] = [half * row[3], half * row[4], half * row[5], half * row[3]]
        file["frames/clumps"][step, 1] = row

    report = audit.check(planted(out, tmp_path / "copy", turned))
    assert "flow" in {finding.kind for finding in report.findings}


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("keys", [{"start": 9.0}, {"start": 0.0, "rate": 1e-9}])
def test_a_run_into_which_nothing_has_come_yet_is_judged(keys: dict[str, Any], every: int) -> None:
    result = carom.simulate(filled(**keys), until=0.03, **(OPTIONS | {"every": every}))
    assert audit.check(result).ok


def test_clumps_that_come_and_leave_between_two_frames_are_judged() -> None:
    scene = empty(gravity=0.0)
    scene.inflow("rod", count=3, region={"low": (0, 0, 0), "high": (0, 0, 0)}, material="grain", seed=1, density=2500,
                 spheres=ROD, rate=100, start=0.002, velocity=(0, 0, 9))  # fmt: skip
    scene.outlet(low=(-1, -1, 0.02), high=(1, 1, 1))
    result = carom.simulate(scene, step=1e-3, until=0.1, every=20)
    assert result.summary["entered"] == result.summary["removed"] == 6
    assert not result.present[1:].any()
    assert audit.check(result).ok


def test_a_clump_enters_a_room_that_its_turn_fits() -> None:
    """A rod lies on its side just above a floor; another one has only some turns between two walls."""
    scene = empty()
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.plane("left", point=(-1.2 * R, 0, 0), normal=(1, 0, 0), material="grain")
    scene.plane("right", point=(1.2 * R, 0, 0), normal=(-1, 0, 0), material="grain")
    lies = {"low": (0, 0, 1.1 * R), "high": (0, 0, 1.1 * R)}
    turns = {"low": (0, 0, 9 * R), "high": (0, 0, 9 * R)}
    half = np.sqrt(0.5)
    scene.inflow("lies", count=1, region=lies, material="grain", seed=1, density=2500, spheres=ROD,
                 orientation=(half, 0, 0, half))  # fmt: skip
    scene.inflow("turns", count=1, region=turns, material="grain", seed=1, density=2500, spheres=ROD)
    result = carom.simulate(scene, step=1e-3, until=0.1, every=1)
    assert result.summary["entered"] + sum(result.events.step == 0) >= 4
    assert audit.check(result).ok


def entered_at_first(result: carom.Result) -> dict[str, int]:
    """First frames with clumps, of those that came."""
    return {
        name: int(np.argmax(clump.present)) for name, clump in result.clumps.items() if any(clump.present)
    }


def test_a_clump_that_enters_moves_as_one_that_is_there() -> None:
    """The same motion, from the frame of its entry on, as of a scene that has it from the start."""
    body = [[0.02, 0, 0, 0.01], [-0.02, 0, 0, 0.01], [0.0, 0.03, 0, 0.008]]
    scene = empty(restitution=0.6)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.inflow("body", count=1, region={"low": (0, 0, 0.1), "high": (0, 0, 0.1)}, material="grain", seed=5,
                 density=2500, spheres=body, start=0.02, velocity=(0.3, 0, 0))  # fmt: skip
    result = carom.simulate(scene, step=5e-4, until=0.4, every=1)
    other = empty(restitution=0.6)
    other.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    (taken,) = other.spheres_from(result, time=0.02)
    assert taken.name == "body1-"
    again = carom.simulate(other, step=5e-4, until=0.38, every=1)
    ours, theirs = result.clumps["body1-"], again.clumps["body1-"]
    assert len(result.impacts) > 3
    assert ours.position[40:] == pytest.approx(theirs.position, abs=1e-9)
    assert ours.angular_velocity[40:] == pytest.approx(theirs.angular_velocity, abs=1e-6)


def test_a_resumed_run_is_the_same(run: carom.Result, tmp_path: Path) -> None:
    stopped = carom.simulate(filled(), until=0.13, out=tmp_path / "run", **OPTIONS)
    assert 0 < stopped.summary["entered"] < run.summary["entered"]
    resumed = carom.resume(tmp_path / "run", until=0.6)
    for name in ("position", "orientation", "velocity", "angular_velocity", "present"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(run, name))


def test_a_scenario_file_has_it(tmp_path: Path) -> None:
    scene = filled()
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    read = carom.Scene.from_toml(tmp_path / "scene.toml")
    assert read == scene
    assert [clump.name for clump in read.clumps[:2]] == ["rod1-", "rod2-"]
    assert len(read.clumps) == 40
    assert len(read.names) == 100


def _faster(file: h5py.File, step: int) -> None:
    file["frames/clumps"][step, 3, 7] += 0.5
    file["frames/velocity"][step, 6:8, 0] += 0.5


def _early(file: h5py.File, step: int) -> None:
    for row in np.flatnonzero(np.isin(file["events/body"][:], [6, 7]) & (file["events/kind"][:] == 1)):
        file["events/step"][row] -= 1
        file["events/time"][row] -= 1e-3


def _spun(file: h5py.File, step: int) -> None:
    file["frames/clumps"][step, 3, 11] += 0.1
    file["frames/angular_velocity"][step, 6:8, 1] += 0.1


def _more(file: h5py.File, step: int) -> None:
    file["steps/energy_in"][step - 1] *= 1 + 1e-9


@pytest.mark.parametrize(
    ("fault", "kind"), [(_faster, "flow"), (_early, "flow"), (_spun, "flow"), (_more, "energy record")]
)
def test_what_enters_otherwise_is_found(run: carom.Result, fault: Any, kind: str, tmp_path: Path) -> None:
    step = entered_at(run)["rod4-"]
    report = audit.check(planted(Path(run.path), tmp_path / "copy", lambda file: fault(file, step)))
    assert kind in {finding.kind for finding in report.findings}


def test_mass_of_an_inflow_is_that_of_each_clump() -> None:
    result = carom.simulate(filled(), until=0.2, **OPTIONS)
    own = empty()
    rod = own.clump("rod", spheres=ROD, material="grain", density=2500, position=(0, 0, 0))
    entered = result.summary["entered"]
    clumps = [clump for clump in result.clumps.values() if any(clump.present)]
    assert {clump.mass for clump in clumps} == {rod.body().mass}
    assert entered == 2 * len(clumps) + sum(any(result[f"ball{k}"].present) for k in range(1, 21))
    speed = np.linalg.norm(result.clumps["rod1-"].velocity[0])
    assert result.steps.energy_kinetic[0] == pytest.approx(0.5 * rod.body().mass * speed**2, rel=0.05)
