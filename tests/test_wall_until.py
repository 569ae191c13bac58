"""A wall that is taken away: it holds what lies on it until then, and is nowhere from then on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import audit

G, R, UNTIL = 9.8, 0.01, 0.05

#: A floor at z = 0 of every kind.
FLOORS: dict[str, tuple[str, dict[str, Any]]] = {
    "plane": ("plane", {"point": (0, 0, 0), "normal": (0, 0, 1)}),
    "rectangle": ("plane", {"point": (0, 0, 0), "normal": (0, 0, 1), "size": (0.2, 0.2)}),
    "disc": ("plane", {"point": (0, 0, 0), "normal": (0, 0, 1), "radius": 0.1}),
    "box": ("box", {"low": (-0.1, -0.1, 0), "high": (0.1, 0.1, 0.2)}),
    "trough": ("cylinder", {"point": (0, 0, 0.1), "axis": (1, 0, 0), "radius": 0.1}),
    "pipe": ("cylinder", {"point": (0, 0, 0.1), "axis": (1, 0, 0), "radius": 0.1, "length": 0.3}),
    "bowl": ("ball_wall", {"point": (0, 0, 0.1), "radius": 0.1}),
    "beam": ("cylinder", {"point": (0, 0, -0.1), "axis": (1, 0, 0), "radius": 0.1, "inside": False}),
}


def resting(kind: str = "plane", until: float = UNTIL, **run: Any) -> carom.Scene:
    """A ball lies on a floor that is taken away."""
    scene = carom.Scene("until", gravity=(0, 0, -G), run={"until": 0.1, "step": 1e-3, **run})
    scene.contact("steel", "steel", friction=0.3, restitution=0.5)
    call, shape = FLOORS[kind]
    getattr(scene, call)("floor", material="steel", motion={"until": until}, **shape)
    scene.sphere("ball", radius=R, density=2500, material="steel", position=(0, 0, R))
    return scene


@pytest.mark.parametrize("kind", FLOORS)
def test_what_lay_on_it_falls_freely_from_then_on(kind: str) -> None:
    result = carom.simulate(resting(kind))
    time, height = np.asarray(result.time), np.asarray(result["ball"].position)[:, 2] - R
    fallen = np.maximum(time - UNTIL, 0.0)
    assert np.asarray(result["ball"].velocity)[:, 2] == pytest.approx(-G * fallen, abs=1e-12)
    assert height == pytest.approx(-0.5 * G * fallen**2, abs=1e-12)
    name = result.wall_names[0]
    assert (result.walls[name].present == (time < UNTIL + 1e-9)).all()
    assert np.isinf(result.walls[name].gap(np.zeros((1, 3)), np.array([R]), np.array([0.06]))).all()


@pytest.mark.parametrize("run", [{"method": "moreau"}, {"method": "penalty"}, {"step": 7e-4}])
def test_by_every_method_and_between_two_steps(run: dict[str, Any]) -> None:
    """The first step that begins after the time is free; in the one before the wall still holds."""
    result = carom.simulate(resting(**run))
    h = result.summary["step"]
    free = np.ceil(UNTIL / h - 1e-6) * h
    time = np.asarray(result.time)
    fast = np.asarray(result["ball"].velocity)[:, 2]
    # Penalty: the indentation under the weight springs back.
    off = 0.02 if run.get("method") == "penalty" else 1e-9
    assert fast == pytest.approx(-G * np.maximum(time - free, 0.0), abs=off)
    assert fast[-1] < -0.4


def column(taken: float = 0.06, **record: Any) -> carom.Scene:
    """Grains in a tube that is taken away."""
    run = {"until": 0.12, "step": 1e-3, "pile_tolerance": 1e-4}
    scene = carom.Scene("column", run=run, record={"walls": True, **record})
    scene.contact("sand", "sand", friction=0.3, restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="sand")
    scene.cylinder(
        "tube", point=(0, 0, 0.1), axis=(0, 0, 1), radius=0.03, material="sand", motion={"until": taken}
    )
    scene.packing(
        "g", material="sand", density=2500, seed=1, count=80, diameter="1 cm", region="cylinder",
        point=(0, 0, 0.05), axis=(0, 0, 1), region_radius=0.03, length=0.1,
    )  # fmt: skip
    return scene


@pytest.fixture(scope="module")
def collapsed(tmp_path_factory: pytest.TempPathFactory) -> carom.Result:
    return carom.simulate(column(every=1), out=tmp_path_factory.mktemp("until") / "run")


def test_a_column_spreads_when_its_tube_is_taken_away(collapsed: carom.Result) -> None:
    time, x = np.asarray(collapsed.time), np.asarray(collapsed.position)
    out = np.linalg.norm(x[..., :2], axis=2).max(axis=1) + 0.005
    assert out[time <= 0.06].max() < 0.03001
    assert out[-1] > 0.032
    push = np.abs(collapsed.walls["tube"].impulse).sum(axis=1)
    assert push[(time > 0.03) & (time < 0.0605)].any()
    assert not push[time > 0.0605].any()


@pytest.mark.parametrize(("every", "taken"), [(1, 0.06), (7, 0.06), (1, 0.0604), (7, 0.0604)])
def test_the_audit_knows_that_it_is_gone(tmp_path: Path, every: int, taken: float) -> None:
    """Also where its time is within a step, to whose end it holds."""
    result = carom.simulate(column(taken, every=every), out=tmp_path / "run")
    report = audit.check(result)
    assert report.ok, repr(report)
    assert report["penetration"].judged > 0


def test_the_audit_accuses_a_ball_in_it_before(tmp_path: Path) -> None:
    """The ball leaves before the time that the file of the run is made to say."""
    carom.simulate(resting(), out=tmp_path / "run", every=1)
    file = tmp_path / "run" / "scenario.toml"
    file.write_text(
        file.read_text()
        .replace(f"until = {UNTIL}\n", "until = 0.09\n")
        .replace(f"until = {UNTIL} ", "until = 0.09 ")
    )
    assert "0.09" in file.read_text()
    assert audit.check(tmp_path / "run")["penetration"].violations > 0


def test_a_run_goes_on_bit_for_bit_across_it(collapsed: carom.Result, tmp_path: Path) -> None:
    carom.simulate(column(every=1), until=0.05, out=tmp_path / "run")
    whole = carom.resume(tmp_path / "run", until=0.12)
    for name in ("position", "velocity", "angular_velocity", "orientation"):
        assert np.array_equal(getattr(whole, name), getattr(collapsed, name))


def test_balls_enter_where_it_was() -> None:
    scene = carom.Scene("room", gravity=(0, 0, 0), run={"until": 0.1, "step": 1e-3})
    scene.contact("sand", "sand", friction=0, restitution=0)
    scene.ball_wall(
        "block", point=(0, 0, 0), radius=0.05, inside=False, material="sand", motion={"until": 0.05}
    )
    region = {"low": (-0.1, -0.02, -0.02), "high": (0.1, 0.02, 0.02)}
    scene.inflow("g", count=9, region=region, radius=R, density=2500, material="sand", rate=100.0, seed=1)
    place = np.asarray(carom.simulate(scene, every=1).position)
    entered = np.isfinite(place[..., 0]).argmax(axis=0)
    away = np.linalg.norm(place[entered, np.arange(9)], axis=1)
    assert (away[entered <= 50] >= 0.06).all()
    assert (away[entered > 50] < 0.06).any()


def test_pictures_leave_it_out(collapsed: carom.Result, tmp_path: Path) -> None:
    from carom.show.viewer.scenery import scenery

    [tube] = scenery(collapsed, np.array([0, 100])).walls
    assert (tube["name"], tube["until"]) == ("tube", 0.06)
    from carom.export.frames import Selection
    from carom.export.walls import walls

    found = walls(Selection.of(collapsed))
    assert found is not None
    shown = np.asarray(collapsed.walls["tube"].present)
    assert found.faces.tolist() == np.where(shown, len(found.triangles), 2).tolist()  # the floor is two
    assert len(found.points(slice(0, len(shown)))) == found.corners.sum()


def test_a_time_must_come() -> None:
    with pytest.raises(carom.ScenarioError, match="until"):
        resting(until=0.0)


def test_a_time_after_the_end_of_the_run_is_advised_against() -> None:
    [advice] = resting(until=0.2).validate()
    assert "the wall stays: the run ends at 0.1 s" in str(advice)
    assert resting().validate() == []


def test_an_inflow_may_begin_where_a_wall_has_been() -> None:
    scene = resting()
    inflow = {"count": 1, "radius": R, "density": 2500, "material": "steel", "seed": 1}
    scene.inflow("late", region={"low": (0, 0, -1), "high": (0, 0, -1)}, start=UNTIL, **inflow)
    assert scene.validate() == []
    scene.inflow("early", region={"low": (1, 0, -1), "high": (1, 0, -1)}, start=0.04, **inflow)
    with pytest.raises(carom.ScenarioError, match="balls would enter"):
        scene.validate()
