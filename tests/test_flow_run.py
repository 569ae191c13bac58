"""Balls that come and go, and worlds that repeat themselves, in real runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom import CaromWarning, Scene
from carom.cli.summary import text
from carom.result.remarks import remarks

R = 0.009
RATE = 60.0


def slide() -> Scene:
    """Balls enter over a slope, roll down and leave at its foot."""
    scene = Scene("flow", run={"until": 0.35, "step": 1e-3})
    scene.contact("sand", "steel", friction=0.3, restitution=0.2)
    scene.contact("sand", "sand", friction=0.3, restitution=0.2)
    scene.plane("slope", point=(0, 0, 0), normal=(0, -0.3, 1), material="steel")
    scene.inflow(
        "grain", count=12, region={"low": (-0.05, 0, 0.03), "high": (0.05, 0.02, 0.03)}, radius=R, density=2500,
        material="sand", rate=RATE, start=0.02, velocity=(0, -0.3, -0.15), spread=0.05, seed=1,
    )  # fmt: skip
    scene.outlet(low=(-1, -1, -1), high=(1, -0.04, 1))
    return scene


@pytest.fixture(scope="module")
def slid() -> carom.Result:
    return carom.simulate(slide(), every=5)


class TestFlow:
    def test_what_enters_before_the_first_step_is_in_the_initial_state(self) -> None:
        scene = Scene(gravity=(0, 0, 0), run={"until": 0.01, "step": 1e-3})
        scene.contact("sand", "sand", friction=0.3, restitution=0.2)
        scene.inflow("grain", count=5, radius=R, density=2500, material="sand", rate=0, seed=1,
                     region={"low": (0, 0, 0), "high": (1, 1, 1)}, velocity=(1, 0, 0))  # fmt: skip
        result = carom.simulate(scene)
        energy = result.summary["energy"]
        assert result.summary["entered"] == len(result.events) == 5
        assert energy["in"] == result.steps.entered.sum() == result.steps.energy_in.sum() == 0.0
        assert energy["initial"] == pytest.approx(0.5 * result.bodies["mass"].sum())

    def test_they_enter_in_their_time_in_their_region(self, slid: carom.Result) -> None:
        entered = slid.events.where(np.asarray(slid.events["kind"]) == 1)
        assert entered["ball"].tolist() == slid.names == [f"grain{k}" for k in range(1, 13)]
        time = np.asarray(entered["time"])
        due = 0.02 + np.arange(12) / RATE
        assert (time >= due - 1e-9).all()
        assert time[0] == pytest.approx(0.02, abs=1e-9)
        assert (time - due).max() < 5e-3  # there is room within a few steps
        frames = np.searchsorted(np.asarray(slid.time), time - 1e-9)
        for body, frame in enumerate(frames):
            x, y, z = slid["grain" + str(body + 1)].position[frame]
            assert -0.051 < x < 0.051
            assert -0.003 < y < 0.021  # the velocity carries it on until the frame
            assert 0.027 < z < 0.031

    def test_presence_follows_the_events(self, slid: carom.Result) -> None:
        present = np.asarray(slid.present)
        assert present.dtype == bool
        expected = np.zeros_like(present)
        kind, body, step = (np.asarray(slid.events[k]) for k in ("kind", "body", "step"))
        assert (kind == 0).sum() > 3
        for entered, ball, when in zip(kind, body, step, strict=True):
            expected[np.asarray(slid.step) >= when, ball] = bool(entered)
        assert (present == expected).all()

    def test_absent_balls_have_no_place_and_no_velocity(self, slid: carom.Result) -> None:
        present = np.asarray(slid.present)
        assert (np.isnan(np.asarray(slid.position)).all(axis=2) == ~present).all()
        assert np.isfinite(np.asarray(slid.position)[present]).all()
        assert (np.asarray(slid.velocity)[~present] == 0).all()
        last = np.asarray(slid.position)[present][:, 1]
        assert last.min() > -0.04  # at the end of each step those beyond are gone

    def test_energy_comes_and_goes_with_them(self, slid: carom.Result) -> None:
        monitors = slid.summary
        assert (monitors["entered"], monitors["removed"]) == (
            12,
            (np.asarray(slid.events["kind"]) == 0).sum(),
        )
        assert monitors["energy"]["max_rise_relative"] < 1e-3
        assert json.loads(json.dumps(monitors, allow_nan=False))["bodies"].keys() == {
            name for name, there in zip(slid.names, slid.present[-1], strict=True) if there
        }

    def test_a_run_goes_on_bit_for_bit(self, tmp_path: Path, slid: carom.Result) -> None:
        carom.simulate(slide(), until=0.15, every=5, out=tmp_path / "run")
        whole = carom.resume(tmp_path / "run", until=0.35)
        for name in ("position", "velocity", "present", "time"):
            assert np.array_equal(getattr(whole, name), getattr(slid, name), equal_nan=name != "present")
        for column in ("step", "body", "kind"):
            assert (np.asarray(whole.events[column]) == np.asarray(slid.events[column])).all()
        with h5py.File(tmp_path / "run" / "results.h5") as file:
            assert file["events/kind"].attrs["description"] == "1 the ball enters, 0 it leaves"

    @pytest.mark.parametrize(
        "what", [["trajectories", "heights"], pytest.param(None, marks=pytest.mark.long)]
    )
    def test_what_is_made_of_it(self, tmp_path: Path, slid: carom.Result, what: list[str] | None) -> None:
        info = slid.view(tmp_path / "view.html")
        assert info.frames == len(slid.time)
        slid.plot.save(tmp_path / "plots", what)
        assert list((tmp_path / "plots").iterdir())

    @pytest.mark.filterwarnings("ignore:.*leaves at once")
    @pytest.mark.parametrize("inside", [True, False])
    def test_an_outlet_across_a_periodic_border_takes_every_image(self, inside: bool) -> None:
        scene = Scene("border", gravity=(0, 0, 0), periodic=(0.3, 0, 0), run={"until": 0.01})
        for k, x in enumerate((0.32, 0.02, 0.27, 0.2, 0.05001)):
            scene.sphere(f"b{k}", radius=0.01, mass=1, at=(x, 0.1 * k, 0), material="sand")
        scene.contact("sand", "sand", friction=0, restitution=0)
        scene.outlet(low=(0.25, -1, -1), high=(0.35, 1, 1), inside=inside)
        there = np.asarray(carom.simulate(scene).present)[-1]
        assert (there == (np.array([1, 1, 1, 0, 0]) != inside)).all()

    @pytest.mark.filterwarnings("ignore:.*leaves at once")
    def test_an_outlet_leaves_what_joints_and_loads_hold(self) -> None:
        scene = Scene("held", gravity=(0, 0, 0), run={"until": 0.01})
        for k, name in enumerate(("free", "loaded", "joined", "other")):
            scene.sphere(name, radius=0.01, mass=1, at=(0, 0.1 * k, 0), material="sand")
        scene.contact("sand", "sand", friction=0, restitution=0)
        scene.load("loaded", force=(0, 0, 1))
        scene.joint("rod", between=("joined", "other"))
        scene.outlet(low=(-1, -1, -1), high=(1, 1, 1))
        there = np.asarray(carom.simulate(scene).present)[-1]
        assert there.tolist() == [False, True, True, True]

    def test_an_inflow_that_let_nobody_in_is_told(self, tmp_path: Path, slid: carom.Result) -> None:
        assert not remarks(slid, "shut_out")
        assert "flow        12 of 12 balls entered, " in text({**slid.summary, "directory": "x"}, slid)
        scene = Scene("full", gravity=(0, 0, 0), run={"until": 0.05})
        scene.sphere("a", radius=R, mass=1, at=(0, 0, 0.02), material="sand")
        scene.contact("sand", "sand", friction=0, restitution=0.2)
        region = {"low": (0, 0, 0.02), "high": (0, 0, 0.02)}
        for name, start in (("soon", 0.01), ("late", 0.06)):
            scene.inflow(
                name, count=5, region=region, radius=R, density=2500, material="sand", start=start, seed=1
            )
        told = 'none of 5 balls of inflow "soon" entered: no place in the region had room for one'
        with pytest.warns(CaromWarning, match=told):
            result = carom.simulate(scene, out=tmp_path / "run")
        assert remarks(result, "shut_out") == [told]
        printed = text({**result.summary, "directory": "x"}, result)
        assert " ".join(printed.split()).startswith(f"warning {told} full")
        assert "flow        0 of 10 balls entered, 0 balls left" in printed

    def test_no_events_without_flow(self) -> None:
        scene = Scene("one", gravity=(0, 0, 0), run={"until": 0.01})
        scene.sphere("a", radius=R, mass=1, at=(0, 0, 0), material="sand")
        events = carom.simulate(scene).events
        assert len(events) == 0
        assert events["ball"].shape == (0,)


class TestPeriodic:
    @staticmethod
    def gas(shift: Any = (0, 0, 0), **world: Any) -> carom.Result:
        scene = Scene(
            "gas", gravity=(0, 0, 0), periodic=(0.1, 0.1, 0), run={"until": 0.3, "step": 1e-3}, **world
        )
        scene.contact("sand", "sand", friction=0.3, restitution=0.9)
        rng = np.random.default_rng(3)
        for k, place in enumerate(np.argwhere(np.ones((2, 2, 2))) * 0.045 + 0.012):
            at, velocity = place + shift, rng.uniform(-0.4, 0.4, 3) * [1, 1, 0.1]
            scene.sphere(f"b{k}", radius=0.01, density=2500, at=at, velocity=velocity, material="sand")
        return carom.simulate(scene, every=5)

    def test_momentum_is_kept_and_positions_go_on(self) -> None:
        result = self.gas()
        momentum = (np.asarray(result.velocity) * result.bodies["mass"][:, None]).sum(axis=1)
        assert len(result.impacts) > 3
        assert np.abs(momentum - momentum[0]).max() < 1e-13 * np.abs(momentum[0]).max()
        assert result.periodic is not None
        assert result.periodic.tolist() == [0.1, 0.1, 0]
        position = np.asarray(result.position)
        assert position[..., :2].max() > 0.1  # not folded back
        assert np.abs(np.diff(position, axis=0)).max() < 0.01  # no jumps
        away = position[:, :, None] - position[:, None]
        away[..., :2] -= 0.1 * np.round(away[..., :2] / 0.1)
        gap = np.linalg.norm(away, axis=-1) - 0.02
        assert gap[:, ~np.eye(8, dtype=bool)].min() > -1e-7 * 0.01  # nor do images overlap

    def test_the_same_wherever_the_border_is(self) -> None:
        first, moved = self.gas(), self.gas(shift=(0.037, 0.071, 0))
        along = np.asarray(moved.position) - np.asarray(first.position)
        assert along == pytest.approx(np.broadcast_to([0.037, 0.071, 0], along.shape), abs=1e-9)


def test_a_ball_in_several_outlets_is_told_once() -> None:
    """And the other value of `inside` is advised only where it does not take all the other balls."""
    scene = Scene("boxes", gravity=(0, 0, 0), run={"until": 0.01})
    for k in range(3):
        scene.sphere(f"b{k}", radius=0.01, mass=1, at=(k, 0, 0), material="sand")
    scene.contact("sand", "sand", friction=0, restitution=0)
    for low in (1.5, 1.6, 0.5):
        scene.outlet(low=(low, -1, -1), high=(9, 1, 1))

    def told() -> list[str]:
        return [str(warning) for warning in scene.validate() if "at once" in str(warning)]

    assert [[name in text for name in ("b1", "b2")] for text in told()] == [[False, True], [True, False]]
    assert not any("inside" in text for text in told())
    scene.outlet(low=(-9, -1, -1), high=(9, 1, 1))
    assert ["inside" in text for text in told()] == [False, False, True]
