"""Silo and drum of validation/bulk: what is read off curves, the scenes, and the small version of the command."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "validation" / "bulk"))

import measure
import report
import targets
from scenes import DENSITY, SETTLING, SMALL, WHOLE, Drum, Silo

BULK = Path(__file__).parent.parent / "validation" / "bulk" / "bulk.py"


def command(runs: Path, *arguments: str) -> list[dict[str, Any]]:
    """Numbers that the command prints of small cases; exit code 1, a missed target, fails too."""
    done = subprocess.run(
        [sys.executable, str(BULK), "--small", "--json", "--runs", str(runs), *arguments],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


class TestCurves:
    def test_the_rate_is_that_of_the_straight_part(self) -> None:
        time = np.arange(0.0, 1.01, 0.05)
        above = 1000.0 - 500.0 * np.maximum(time - 0.1, 0.0)  # it takes a while to begin
        found = measure.rate(measure.Curves(time, {"grains_above_orifice": above}), 1000)
        assert found is not None
        assert found.rate == pytest.approx(500.0)
        assert found.off == pytest.approx(0.0, abs=1e-12)
        assert (found.first, found.last) == pytest.approx((0.15, 1.0))

    def test_a_bent_curve_is_off_its_line(self) -> None:
        time = np.arange(0.0, 1.01, 0.05)
        above = 1000.0 - 500.0 * time**2
        found = measure.rate(measure.Curves(time, {"grains_above_orifice": above}), 1000)
        assert found is not None
        assert found.off > 2 * targets.STRAIGHT

    def test_no_rate_of_too_few_points(self) -> None:
        time = np.array([0.0, 0.1, 0.2, 0.3])
        assert measure.rate(measure.Curves(time, {"grains_above_orifice": 100 - time}), 100) is None

    def test_turns_of_a_wave(self) -> None:
        time = np.linspace(0.0, 4.0, 401)
        found = measure.turns(time, np.sin(2 * np.pi * time / 2), least=0.3)
        assert [t.peak for t in found] == [True, False, True, False]
        assert [t.time for t in found] == pytest.approx([0.5, 1.5, 2.5, 3.5])

    def test_small_ripples_are_no_turns(self) -> None:
        time = np.linspace(0.0, 2.0, 201)
        wave = np.sin(np.pi * time) + 0.1 * np.sin(40 * np.pi * time)
        assert len(measure.turns(time, wave, least=0.4)) == 2

    def test_a_late_and_high_peak_is_measured(self) -> None:
        time = np.linspace(0.0, 2.0, 201)
        expected = measure.Curves(time, {"n": np.sin(np.pi * time)})
        ours = measure.Curves(time, {"n": 1.2 * np.sin(np.pi * (time - 0.1))})
        peak = measure.pairs(ours, expected)[0]
        assert peak.late == pytest.approx(0.1)
        assert peak.off == pytest.approx(0.2, abs=1e-3)

    def test_a_peak_that_is_missing_is_not_a_number(self) -> None:
        time = np.linspace(0.0, 2.0, 201)
        flat = measure.Curves(time, {"n": np.zeros_like(time)})
        assert np.isnan(measure.pairs(flat, measure.Curves(time, {"n": np.sin(np.pi * time)}))[0].late)

    def test_curves_survive_their_file(self, tmp_path: Path) -> None:
        curves = measure.Curves(np.array([0.0, 0.05]), {"a": np.array([3.0, 2.0]), "b": np.array([1.0, 0.0])})
        curves.to_csv(tmp_path / "c.csv")
        again = measure.Curves.of_csv(tmp_path / "c.csv")
        assert np.array_equal(again.time, curves.time)
        assert all(np.array_equal(again.counts[name], n) for name, n in curves.counts.items())


class TestPublished:
    def test_the_codes_agree_about_the_drum(self) -> None:
        """They keep what is asked of Carom, so that it can be kept."""
        codes = measure.published("drum")
        both = measure.mean(list(codes.values()))
        for curves in codes.values():
            found = measure.pairs(curves, both)
            assert len(found) > 15
            for pair in found:
                assert abs(pair.late) <= targets.TURN_LATE
                assert abs(pair.off) <= max(targets.TURN_OFF * pair.expected.count, 300)

    @pytest.mark.parametrize("name", ["silo-large", "silo-small"])
    def test_their_silos_empty_along_a_line(self, name: str) -> None:
        for curves in measure.published(name).values():
            line = measure.rate(curves, 100_000)
            assert line is not None
            assert line.off <= targets.STRAIGHT
            assert line.rate == pytest.approx(targets.RATES[name], rel=0.07)

    def test_the_law_of_the_orifice_gives_both_published_rates(self) -> None:
        for name, rate in targets.RATES.items():
            case = WHOLE[name]
            assert isinstance(case, Silo)
            assert targets.expected_rate(name, case) == pytest.approx(rate)


@pytest.mark.parametrize("name", SMALL)
def test_a_small_scene_is_right_and_holds_its_grains(name: str) -> None:
    case = SMALL[name]
    scene = case.scene(step=2e-3, pile_tolerance=1e-3)
    assert not [str(advice) for advice in scene.validate() if "until" not in str(advice)]
    model = scene.to_model()
    assert case.grains == WHOLE[name].grains / 20 == len(model["radius"])
    density = model["mass"] / (4 / 3 * np.pi * model["radius"] ** 3)
    if isinstance(case, Drum):
        assert np.count_nonzero(model["radius"] == case.diameters[0] / 2) == case.small
        assert density[: case.large] == pytest.approx(DENSITY["M2"])
        assert density[case.large :] == pytest.approx(DENSITY["M1"])
    else:
        assert density == pytest.approx(DENSITY["M1"])


def test_the_drum_turns_upwards_at_positive_x_once_its_grains_have_settled() -> None:
    few = Drum("few", 150, 40, radius=0.018, depth=0.012, rate=4.0, duration=0.15)
    result = carom.simulate(few.scene(step=1e-3, pile_tolerance=1e-3), every=50)
    x, z = (np.asarray(result.position)[:, :, k].mean(axis=1) for k in (0, 2))
    settled = round(SETTLING / 0.05)
    assert abs(x[settled]) < 1e-3
    assert z[settled] < -6e-3
    assert x[-1] > 2e-3
    kinds = measure.drum(few, result)
    assert kinds.time[0] == pytest.approx(0.0)
    assert kinds.counts["zone2_M1"][0] + kinds.counts["zone2_M2"][0] == pytest.approx(95, abs=20)
    assert kinds.counts["zone2_M1"][-1] < kinds.counts["zone2_M1"][0]


@pytest.mark.parametrize("size", ["whole", "small"])
def test_the_page_has_the_tables_of_the_numbers_beside_it(size: str) -> None:
    page = BULK.parent.parent.parent / "docs" / "validation" / "bulk.md"
    cases = WHOLE if size == "whole" else SMALL
    stems = {name: page.parent / "bulk" / f"{size}-{name}" for name in cases}
    kept = [report.Found.kept(name, cases[name], stems[name], whole=size == "whole") for name in cases]
    assert report.text(kept) in page.read_text(encoding="utf-8")


def test_a_run_goes_on_with_what_it_began_with_or_is_refused(tmp_path: Path) -> None:
    def asked(*more: str) -> str:
        silo = ("--small", "--case", "silo-large", "--runs", str(tmp_path))
        done = subprocess.run(
            [sys.executable, str(BULK), *silo, *more],
            capture_output=True,
            text=True,
            timeout=200,
            check=False,
        )
        return done.stderr if done.returncode == 2 else f"code {done.returncode}: {done.stderr}"

    place = tmp_path / "small-silo-large"
    place.mkdir()
    (tmp_path / "small-silo-large.options.json").write_text('{"seed": 3, "step": 0.002}')
    told = f"{place} began with 3; leave it out, or take another folder for --runs"
    assert f"--seed 4: {told}" in asked("--resume", "--seed", "4", "--step", "2e-3")
    assert "--rolling-radius 0.1: " in asked("--resume", "--seed", "3", "--rolling-radius", "0.1")
    assert "--seed does nothing with --measure" in asked("--measure", "--seed", "3")


@pytest.mark.long
def test_small_silos_empty_at_the_rates_of_the_published_ones(tmp_path: Path) -> None:
    """Rate and straightness are judged by the command itself; it goes on from what was interrupted."""
    large = ("--case", "silo-large")
    [begun] = command(tmp_path, *large, "--duration", "0.05")
    assert begun["time_s"] == pytest.approx(0.05)
    found = command(tmp_path, *large, "--case", "silo-small", "--resume", "--audit")
    for numbers in found:
        assert numbers["time_s"] == pytest.approx(0.5)
        assert numbers["unconverged"] == 0
        assert numbers["penetration_relative"] < 2e-3
        assert abs(numbers["rate_off"]) < targets.SMALL_RATE_OFF
        assert numbers["audit"]["ok"]
    assert {f"small-{n}{end}" for n in ("silo-large", "silo-small") for end in (".csv", ".json", ".png")} <= {
        path.name for path in tmp_path.iterdir()
    }


@pytest.mark.long
def test_grains_rise_with_the_wall_of_a_small_drum_and_slide_back(tmp_path: Path) -> None:
    [numbers] = command(tmp_path, "--case", "drum", "--duration", "0.8")
    assert numbers["unconverged"] == 0
    curves = measure.Curves.of_csv(tmp_path / "small-drum.csv")
    risen = curves.counts["zone1_M1"]
    assert risen[0] == 0
    assert risen.max() > 200
    assert risen[-1] < 20
