"""Fits: known values come back, intervals are those of theory, and nothing is told that the data do not tell."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import Calibration, CaromError
from carom.cli.app import app
from carom.many.fit.calibration import FILE_KEYS, SEARCHES
from carom.many.fit.intervals import told
from carom.many.fit.remarks import of_data
from carom.scene.tables.model import SINGLE
from sweep_studies import SCENARIO
from typer.testing import CliRunner

EXAMPLE = Path(__file__).parent.parent / "validation" / "calibration"
COLLISION = EXAMPLE / "collision.toml"
#: Differential evolution takes the most runs.
MOST_IN_LONG = [
    pytest.param(s, marks=[pytest.mark.long] if s == "differential_evolution" else []) for s in SEARCHES
]
#: A ball that flies freely: it is at x = v * 0.02 s in the end.
FREE = SCENARIO.replace("[0.0, 0.0, -9.8]", "[0.0, 0.0, 0.0]")
T = 0.02


@pytest.fixture(autouse=True)
def extras() -> None:
    for name in ("pyarrow", "scipy", "sklearn"):
        pytest.importorskip(name, reason="the extra [fit] is not installed")


@pytest.fixture
def free(tmp_path: Path) -> Path:
    (tmp_path / "free.toml").write_text(FREE)
    return tmp_path / "free.toml"


def end(value: float, uncertainty: float, axis: str = "x") -> dict[str, Any]:
    return {"quantity": f"cue.position.{axis}", "value": value, "uncertainty": uncertainty}


def fitted(
    scene: Path, parameters: dict[str, Any], targets: list[Any], name: str = "fit", **more: Any
) -> carom.Fit:
    calibration = Calibration.of(scene, parameters, targets, **more)
    return carom.fit(calibration, scene.parent / name, workers=0)


class TestAnswers:
    @pytest.mark.parametrize("search", MOST_IN_LONG)
    def test_restitution_and_friction_come_back_from_a_noisy_video(self, search: str, tmp_path: Path) -> None:
        """track.csv was made with e = 0.9 and mu = 0.1, and noise of 0.5 mm; all searches find one minimum."""
        text = (EXAMPLE / "collision_fit.toml").read_text() + f'[search]\nkind = "{search}"\n'
        for name in ("collision.toml", "track.csv"):
            (tmp_path / name).write_bytes((EXAMPLE / name).read_bytes())
        (tmp_path / "fit.toml").write_text(text)
        found = carom.fit(tmp_path / "fit.toml", tmp_path / "fit", workers=0)
        assert found.converged
        assert found.remarks == []
        for name, truth in {"e": 0.9, "mu": 0.1}.items():
            low, high = found.interval[name]  # type: ignore[misc]
            assert low < truth < high
            assert high - low < 0.01
        assert found.best["e"] == pytest.approx(0.899887, abs=2e-4)
        assert found.best["mu"] == pytest.approx(0.100265, abs=1e-4)
        assert 60 < found.chi2 < 180  # 122 degrees of freedom

    def test_exact_data_give_the_exact_values(self, tmp_path: Path) -> None:
        result = carom.simulate(COLLISION)
        targets = [
            {"quantity": f"{ball}.velocity.{x}", "value": float(result[ball].velocity[-1]["xyz".index(x)]),
             "uncertainty": 0.01} for ball in "ab" for x in "xy"
        ]  # fmt: skip
        calibration = Calibration.of(COLLISION, {"e": (0.5, 1.0), "mu": (0.0, 0.3)}, targets)
        found = carom.fit(calibration, tmp_path / "fit", workers=0)
        assert found.best == pytest.approx({"e": 0.9, "mu": 0.1}, abs=1e-6)
        assert found.chi2 < 1e-8

    def test_the_interval_of_a_linear_model_is_that_of_theory(self, free: Path) -> None:
        """Two measurements of one velocity: the weighted mean, and its standard error times 1.96."""
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.021, 1e-4), end(0.0215, 2e-4)])
        weights = np.array([1e-4, 2e-4]) ** -2.0
        assert found.best["v"] == pytest.approx(np.average([0.021, 0.0215], weights=weights) / T, abs=1e-6)
        assert found.interval["v"] is not None
        half = 1.959964 * weights.sum() ** -0.5 / T
        assert np.diff(found.interval["v"])[0] / 2 == pytest.approx(half, rel=1e-4)
        assert found.chi2 == pytest.approx(5e-4**2 / 5e-8, rel=1e-4)

    def test_a_logarithmic_parameter_has_a_lopsided_interval(self, free: Path) -> None:
        found = fitted(free, {"v": {"low": 0.1, "high": 10.0, "log": True, "start": 0.5}}, [end(0.02, 1e-3)])
        low, high = found.interval["v"]  # type: ignore[misc]
        assert low * high == pytest.approx(found.best["v"] ** 2, rel=1e-6)
        assert found.best["v"] == pytest.approx(1.0, abs=1e-5)

    def test_several_starts_find_the_lower_of_two_minima(self, free: Path) -> None:
        """y = -0.5 mm is reached at one angle of two; the lower sum of squares is at the other end of the range."""
        parameters = {"p": {"low": -2.0, "high": 2.0, "start": 1.5}}
        set_ = {"cue.velocity.x": "= 0.1*(p^4 - 4*p^2 + p)"}
        targets = [end(0.1 * (2.0**2 - 12.0) * T, 1e-5)]
        one = fitted(free, parameters, targets, "one", set=set_)
        several = fitted(free, parameters, targets, "several", set=set_, starts=4)
        assert one.best["p"] > 0 > several.best["p"]
        assert several.chi2 < one.chi2


class TestWhatTheDataDoNotTell:
    def test_a_parameter_without_effect_has_no_interval(self, tmp_path: Path) -> None:
        """A ball that hits the other one head on does not slip: friction has no effect."""
        text = COLLISION.read_text().replace("[0.2, 0.05, 0.0]", "[0.2, 0.0, 0.0]")
        (tmp_path / "collision.toml").write_text(text)
        targets = [{"quantity": "b.velocity.x", "value": 0.9, "uncertainty": 0.01}] * 2
        found = fitted(tmp_path / "collision.toml", {"e": (0.5, 1.0), "mu": (0.0, 0.3)}, targets)
        assert found.interval["mu"] is None
        assert found.interval["e"] is not None
        assert found.best["e"] == pytest.approx(0.8, abs=1e-5)
        assert found.remarks == ["the data do not determine mu within its bounds"]

    def test_results_without_any_slope_end_the_search(self, free: Path) -> None:
        """SciPy divided by the slope: zero."""
        found = fitted(free, {"p": (0.0, 1.0)}, [end(0.03, 1e-3)], set={"cue.velocity.x": "= 1 + 0*p"})
        assert found.interval == {"p": None}
        assert found.remarks[0] == "the data do not determine p within its bounds"

    @pytest.mark.parametrize("search", MOST_IN_LONG)
    def test_two_parameters_of_which_only_the_product_counts(self, search: str, free: Path) -> None:
        found = fitted(
            free, {"p": (0.5, 2.0), "q": (0.5, 2.0)}, [end(0.02, 1e-6), end(0.02, 1e-6)], search=search,
            set={"cue.velocity.x": "= p*q"},
        )  # fmt: skip
        assert found.best["p"] * found.best["q"] == pytest.approx(1.0, abs=1e-3)
        assert found.interval == {"p": None, "q": None}
        assert "the data do not tell p and q apart" in found.remarks

    def test_a_best_value_at_a_bound_has_no_interval(self, free: Path) -> None:
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.04, 1e-4)])
        assert found.best["v"] == pytest.approx(1.5, abs=1e-3)
        assert found.interval["v"] is None
        assert "v is at a bound" in found.remarks[0]

    def test_values_that_contradict_each_other_widen_the_interval(self, free: Path) -> None:
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.02, 1e-5), end(0.021, 1e-5)])
        assert "the model or the uncertainties are not right" in found.remarks[0]
        low, high = found.interval["v"]  # type: ignore[misc]
        assert low < 1.0 < 1.05 < high

    @pytest.mark.parametrize(
        ("weak", "strong", "remarks"),
        [
            # The sets a, b and a, b, c: the smallest one, and c.
            ([(1, -1, 0), (1, 1, 1)], (1, 1, -2), ["do not tell a and b apart", "do not determine c within its bounds"]),
            ([(1, 1, 1), (1, -2, 1)], (1, 0, -1), ["do not tell a, b and c apart"]),  # one set twice
        ],
    )  # fmt: skip
    def test_what_the_data_do_not_tell_apart_is_named_once(
        self, weak: list[Any], strong: Any, remarks: list[str]
    ) -> None:
        directions = np.array([*weak, strong]) / np.linalg.norm([*weak, strong], axis=1, keepdims=True)
        jacobian = np.diag([0.5, 1.0, 1000.0]) @ directions
        found = told(jacobian, np.zeros(3), np.zeros(3), np.full(3, 0.5), 0.0)
        assert found.hidden.all()
        assert of_data(found, ["a", "b", "c"]) == [f"the data {remark}" for remark in remarks]

    def test_intervals_of_random_linear_models_hold_the_truth(self) -> None:
        """Theory alone, without runs: 95 % of 2000 data sets, with and without noise of the runs."""
        rng = np.random.default_rng(1)
        for noise in (0.0, 1.5):
            held = 0
            for _ in range(1000):
                jacobian = rng.normal(size=(8, 3)) * 40
                off = rng.normal(size=8) * np.hypot(1, noise)
                step = np.linalg.lstsq(jacobian, off, rcond=None)[0]
                found = told(jacobian, off - jacobian @ step, np.full(8, noise), np.full(3, 0.5), 0.0)
                assert np.isfinite(found.half).all()
                held += int((np.abs(step) < found.half).sum())
            assert held / 3000 == pytest.approx(0.95, abs=0.015)


#: Velocities scatter by the seed and by the parameter, so that finite differences see it.
NOISY = {"cue.velocity.x": "= p + 0.05*sin(777*seed^2 + 54321*p*sqrt(seed))"}


class TestNoise:
    @pytest.mark.parametrize("search", SEARCHES)
    def test_seeds_are_averaged_and_their_noise_is_in_the_interval(self, search: str, free: Path) -> None:
        found = fitted(
            free,
            {"p": (0.5, 2.0), "seed": {"seeds": 6}},
            [end(0.02, 1e-5)],
            search=search,
            set=NOISY,
            points=60,
        )
        assert len(found.sweep) == 6 * found.summary["points"]
        low, high = found.interval["p"]  # type: ignore[misc]
        assert low < 1.0 < high
        # 1.96 times the standard error of six sines would be 0.028; the target's uncertainty alone would be 0.001.
        assert 0.005 < (high - low) / 2 < 0.1
        if search != "gaussian_process":
            assert "chosen by the noise" in found.summary["interval_by"]

    @pytest.mark.long
    @pytest.mark.parametrize("search", ["least_squares", "gaussian_process"])
    def test_intervals_of_noisy_runs_hold_the_truth(self, search: str, free: Path) -> None:
        """20 kinds of noise: fewer than 16 intervals of 95 % would hold the truth in 3 of 1000 such tests."""
        held = 0
        for k in range(20):
            set_ = {"cue.velocity.x": NOISY["cue.velocity.x"].replace("777", str(777 + 13 * k))}
            parameters = {"p": (0.5, 2.0), "seed": {"seeds": 4}}
            found = fitted(free, parameters, [end(0.02, 1e-4)], str(k), search=search, set=set_, points=40)
            low, high = found.interval["p"]  # type: ignore[misc]
            held += low < 1.0 < high
        assert held >= 16

    @pytest.mark.long
    def test_the_rolling_radius_of_a_small_heap(self, tmp_path: Path) -> None:
        text = (EXAMPLE.parent.parent / "scenarios" / "heap.toml").read_text()
        text = text.replace("fraction = 0.55", "fraction = 0.5").replace('"= 15*r"', '"= 8*r"')
        (tmp_path / "heap.toml").write_text(text.replace("until = 1.0", "until = 0.6"))
        found = fitted(
            tmp_path / "heap.toml", {"rolling": (0.0, 0.3), "seed": {"seeds": 3}},
            [{"quantity": "angle", "value": "28 deg", "uncertainty": "1 deg"}],
            search="gaussian_process", points=10, measure=angle,
        )  # fmt: skip
        [off], [noise] = found.residuals["residual over uncertainty"], found.residuals["noise"]
        assert abs(off) < 3 * np.hypot(1.0, np.degrees(noise))
        assert 0.0 < found.best["rolling"] < 0.2


def angle(result: carom.Result) -> dict[str, float]:
    return {"angle": carom.granular.heap_angle(result).angle}


class TestFailures:
    @pytest.mark.parametrize("search", SEARCHES)
    def test_runs_that_fail_count_as_bad_points_and_are_reported(self, search: str, free: Path) -> None:
        """The other ball is put inside the first one where p is below 0.15."""
        found = fitted(
            free, {"p": {"low": 0.0, "high": 0.6, "start": 0.3}}, [end(0.02, 1e-4)], search=search, points=80,
            set={"post.position.x": "= 0.4*p", "cue.velocity.x": "= 5*p"},
        )  # fmt: skip
        assert found.best["p"] == pytest.approx(0.2, abs=1e-3)
        if search == "least_squares":
            return
        assert found.summary["failed_points"] > 0
        assert any("counted as bad; the first: overlap" in remark for remark in found.remarks)
        assert found.summary["failures"][0]["outcome"] == "overlap"

    def test_a_start_that_cannot_be_simulated_is_refused(self, free: Path) -> None:
        with pytest.raises(CaromError, match='spheres "cue" and "post" overlap at the start'):
            fitted(free, {"p": (0.0, 0.02)}, [end(0.02, 1e-4)], set={"post.position.x": "= p"})

    def test_a_measure_that_fails_is_named(self, free: Path) -> None:
        def broken(result: carom.Result) -> dict[str, float]:
            raise RuntimeError("no heap here")

        with pytest.raises(CaromError, match="measure_failed: measure: RuntimeError: no heap here"):
            fitted(free, {"v": (0.5, 1.5)}, [end(0.02, 1e-4)], measure=broken)

    def test_a_slope_between_failures_is_refused(self, free: Path) -> None:
        def only_here(result: carom.Result) -> dict[str, float]:
            assert result["cue"].velocity[0, 0] == 1.0, "not here"
            return {}

        with pytest.raises(
            CaromError, match=r"runs on both sides of v = 1 fail.*give a smaller search.difference"
        ):
            fitted(free, {"v": (0.5, 1.5)}, [end(0.02, 1e-4)], measure=only_here)

    def test_a_search_that_runs_out_of_points_says_so(self, free: Path) -> None:
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.021, 1e-4)], points=3)
        assert not found.converged
        assert "raise search.points" in found.remarks[0]


class TestFolder:
    def test_a_killed_fit_goes_on_and_ends_as_if_it_had_not_been(self, tmp_path: Path) -> None:
        command = [
            sys.executable,
            "-m",
            "carom",
            "fit",
            str(EXAMPLE / "collision_fit.toml"),
            "--workers",
            "0",
        ]
        command += ["--no-plots", "-q", "-o"]
        started = subprocess.Popen([*command, str(tmp_path / "killed")])
        parts = tmp_path / "killed" / "parts"
        until = time.monotonic() + 60
        while len([*parts.glob("*.parquet")]) < 8 and time.monotonic() < until and started.poll() is None:
            time.sleep(0.005)
        started.kill()
        assert started.wait() != 0
        before = len([*parts.glob("*.parquet")])
        assert before >= 8
        for name in ("killed", "whole"):
            subprocess.run([*command, str(tmp_path / name)], check=True, timeout=120)
        killed, whole = (json.loads((tmp_path / n / "fit.json").read_text()) for n in ("killed", "whole"))
        assert before < whole["runs"]
        for key in ("best", "interval_95", "correlation", "chi2", "points", "runs"):
            assert killed[key] == whole[key]

    def test_an_interrupted_fit_keeps_its_points(self, free: Path) -> None:
        def stop(state: Any) -> None:
            if state.points >= 3:
                raise KeyboardInterrupt

        calibration = Calibration.of(free, {"v": (0.5, 1.5)}, [end(0.021, 1e-4)])
        with pytest.raises(KeyboardInterrupt):
            carom.fit(calibration, free.parent / "fit", workers=0, progress=stop)
        points: list[int] = []
        found = carom.fit(calibration, free.parent / "fit", workers=0)
        again = carom.fit(
            calibration, free.parent / "fit", workers=0, progress=lambda s: points.append(s.points)
        )
        assert again.best == found.best
        assert again._points.new == 0
        assert points[-1] == found.summary["points"]

    def test_workers_give_the_same_answer(self, tmp_path: Path) -> None:
        pytest.importorskip("distributed", reason="the extra [fit] is not installed")
        found = [carom.fit(EXAMPLE / "collision_fit.toml", tmp_path / str(n), workers=n) for n in (0, 2)]
        assert found[0].best == found[1].best
        assert found[0].interval == found[1].interval

    def test_all_points_are_rows_of_a_sweep(self, free: Path) -> None:
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.021, 1e-4)])
        assert isinstance(found.sweep, carom.Sweep)
        assert np.allclose(found.sweep["cue.position.x"], found.sweep["v"] * T)
        [row] = csv.DictReader((found.path / "residuals.csv").open())
        assert float(row["fitted"]) == pytest.approx(0.021)
        assert json.loads((found.path / "fit.json").read_text())["best"] == found.best


class TestData:
    def test_units_in_headings_declared_or_si_are_one(self, free: Path) -> None:
        rows = "\n{},{}" * 3
        files = {
            "heading.csv": ("t (ms),x [mm]", (0, 0, 10, 10.5, 20, 21), {}),
            "declared.csv": ("t,x", (0, 0, 10, 1.05, 20, 2.1), {"unit": "cm", "time_unit": "ms"}),
            "si.csv": ("time,x", (0, 0, 0.01, 0.0105, 0.02, 0.021), {}),
        }
        for name, (head, numbers, more) in files.items():
            (free.parent / name).write_text(head + rows.format(*numbers) + "\n")
            target = {"file": name, "ball": "cue", "uncertainty": "0.1 mm", **more}
            [read] = Calibration.of(free, {"v": (0.5, 1.5)}, [target], folder=free.parent).targets
            assert read.value == pytest.approx((0.0, 0.0105, 0.021), rel=1e-12)
            assert read.time == pytest.approx((0.0, 0.01, 0.02), rel=1e-12)
            assert read.uncertainty == (1e-4,) * 3

    def test_uncertainties_may_be_a_column(self, free: Path) -> None:
        (free.parent / "a.csv").write_text("t,x (mm),s (mm)\n0.01,10.5,0.1\n0.02,21,0.3\n")
        target = {"file": "a.csv", "columns": {"x": "cue.position.x"}, "uncertainty": "s"}
        [read] = Calibration.of(free, {"v": (0.5, 1.5)}, [target], folder=free.parent).targets
        assert read.uncertainty == pytest.approx((1e-4, 3e-4))

    def test_uncertainties_of_a_file_may_be_a_list(self, free: Path) -> None:
        (free.parent / "a.csv").write_text("t,x\n0.01,0.0105\n0.02,0.021\n")
        target = {"file": "a.csv", "ball": "cue", "uncertainty": ["0.1 mm", 3e-4]}
        [read] = Calibration.of(free, V, [target], folder=free.parent).targets
        assert read.uncertainty == pytest.approx((1e-4, 3e-4))
        with pytest.raises(
            CaromError, match=r"a.csv, column x: uncertainty has 3 numbers for 2 rows; give one"
        ):
            Calibration.of(free, V, [{**target, "uncertainty": [1e-4] * 3}], folder=free.parent)

    def test_a_cell_without_a_number_is_left_out_for_its_column_alone(self, free: Path) -> None:
        rows = [
            "t;x;y;s",
            "0;0,0;0;1e-4",
            "0,005;;0;1e-4",
            "0,01;NaN;0;1e-4",
            "0,015;0,0165;NA;1e-4",
            "0,02;0,022;0;",
            ";;;",
        ]
        (free.parent / "a.csv").write_text("\n".join(rows) + "\n")
        target = {"file": "a.csv", "ball": "cue", "uncertainty": "s"}
        x, y = Calibration.of(free, V, [target], folder=free.parent).targets
        assert (x.time, x.value, x.lines, x.left_out) == ((0.0, 0.015), (0.0, 0.0165), (2, 5), 3)
        assert (y.time, y.lines, y.left_out) == ((0.0, 0.005, 0.01), (2, 3, 4), 2)
        found = carom.fit(
            Calibration.of(free, V, [target], folder=free.parent), free.parent / "fit", workers=0
        )
        assert found.best["v"] == pytest.approx(1.1, abs=1e-6)
        told = "rows without a number are left out: 3 of 5 of cue.position.x and 2 of 5 of cue.position.y"
        assert told in found.remarks
        assert [t["left_out"] for t in found.summary["targets"]] == [3, 2]

    @pytest.mark.parametrize("separator", [";", "\t"])
    def test_semicolons_and_tabs_are_read_like_commas(self, separator: str, free: Path) -> None:
        text = "t (ms),x (mm)\n0,0\n10,10.5\n20,21\n"
        found = []
        for name, content in (("a.csv", text), ("b.csv", text.replace(",", separator))):
            (free.parent / name).write_text(content)
            target = {"file": name, "ball": "cue", "uncertainty": 1e-4}
            [read] = Calibration.of(free, V, [target], folder=free.parent).targets
            found.append((read.time, read.value))
        assert found[0] == found[1]

    def test_curves_of_a_measure(self, free: Path) -> None:
        def speed(result: carom.Result) -> dict[str, Any]:
            return {"double speed": (result.time, 2 * result["cue"].speed), "one": 1.0}

        target = {"quantity": "double speed", "time": [0.0, 0.013], "value": [2.2, 2.2], "uncertainty": 0.01}
        found = fitted(free, {"v": (0.5, 1.5)}, [target], measure=speed)
        assert found.best["v"] == pytest.approx(1.1, abs=1e-6)
        assert found.sweep["one"].tolist() == [1.0] * len(found.sweep)

    def test_frames_that_are_farther_apart_than_measurements_are_named_before_any_run(
        self, free: Path
    ) -> None:
        times = [0.0, 0.004, 0.008, 0.012]
        target = {**CURVE, "time": times, "value": times}
        calibration = Calibration.of(free, V, [target], every=10)
        told = r"frames of the runs every 0\.01 s lie under measurements every 0\.004 s; write every = 4 below \[run\]"
        with pytest.warns(carom.CaromWarning, match=told):
            found = carom.fit(calibration, free.parent / "fit", workers=0)
        assert found.remarks[0].startswith("frames of the runs every 0.01 s")
        mended = carom.fit(
            Calibration.of(free, V, [target], every=4), free.parent / "4", workers=0
        )  # warnings are errors
        assert mended.remarks == []
        with pytest.warns(carom.CaromWarning, match=r"write step = 0\.004 below \[run\], or less"):
            carom.fit(Calibration.of(free, V, [target], step=0.01), free.parent / "step", workers=0)


V = {"v": (0.5, 1.5)}
CURVE = {"quantity": "cue.position.x", "time": [0.0, 0.02], "value": [0.0, 0.02], "uncertainty": 1e-4}
WRONG: dict[str, tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any], str]] = {
    "unknown parameter": ({"w": (0.0, 1.0)}, [end(0.02, 1e-4)], {}, r"parameters\.w goes nowhere.*v"),
    "no bounds": ({"v": [1.0, 2.0]}, [end(0.02, 1e-4)], {}, r"parameters\.v: a fit needs bounds; write v = \{ low"),
    "one bound": ({"v": {"low": 1.0}}, [end(0.02, 1e-4)], {}, r"parameters\.v: a fit needs bounds"),
    "count": ({"v": {"low": 1.0, "high": 2.0, "count": 3}}, [end(0.02, 1e-4)], {}, "leave them out of a fit"),
    "start outside": ({"v": {"low": 1.0, "high": 2.0, "start": 3.0}}, [end(0.02, 1e-4)], {}, "outside 1 to 2"),
    "seeds alone": ({"seed": {"seeds": 2}}, [end(0.02, 1e-4)], {}, "nothing to fit"),
    "few data": ({**V, "mu": (0.0, 1.0)}, [end(0.02, 1e-4)], {}, "1 measured value cannot determine 2 parameters"),
    "not finite": (V, [end(float("nan"), 1e-4)], {}, r"target 1\.value: expected a finite number"),
    "no uncertainty": (V, [{"quantity": "cue.position.x", "value": 1.0}], {}, "target 1: uncertainty is missing"),
    "uncertainty 0": (V, [end(0.02, 0.0)], {}, "uncertainty must be above 0"),
    "unknown key": (V, [{**end(0.02, 1e-4), "sigma": 1}], {}, "target 1: unknown key sigma"),
    "no quantity": (V, [{"value": 1.0, "uncertainty": 1.0}], {}, "write quantity = "),
    "unknown measure": (V, [{**end(1, 1), "quantity": "angle"}], {}, r"target 1: no quantity is called 'angle' without"),
    "unknown ball": (V, [{**CURVE, "quantity": "que.position.x"}], {}, "no ball is called 'que'; did you mean cue"),
    "wrong unit": (V, [{**end(0.02, 1e-4), "value": "20 ms"}], {}, r"target 1\.value: expected a length"),
    "no number": (V, [{**end(0.02, 1e-4), "value": "x mm"}], {}, r"target 1\.value: .*NUMBER UNIT"),
    "lengths differ": (V, [{**CURVE, "time": [0.0]}], {}, "2 values need time"),
    "times twice": (V, [{**CURVE, "time": [0.01, 0.01]}], {}, "each once"),
    "empty": (V, [{**CURVE, "value": []}], {}, "the list is empty"),
    "unknown search": (V, [end(0.02, 1e-4)], {"search": "newton"}, r"search\.kind: no search is called 'newton'"),
    "points": (V, [end(0.02, 1e-4)], {"points": 0}, r"search\.points: expected a whole number from 1"),
    "too few points": (V, [end(0.02, 1e-4)], {"points": 3, "starts": 4}, "least_squares begins with 4 points"),
    "difference": (V, [end(0.02, 1e-4)], {"difference": 0.7}, r"search\.difference: expected a share"),
    "late": (V, [{**CURVE, "time": [0.0, 0.03]}], {}, "target 1: a time of 0.03 s is after the end .* at 0.02 s; raise"),
    "very late": (V, [{**CURVE, "time": [0.0, 20.0]}], {}, 'if the times are in another unit, write "20 ms"; else raise'),
    "no file": (V, [{"file": "x.csv", "ball": "cue", "uncertainty": 1}], {}, "x.csv cannot be read as CSV"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"e": (0.5, 2.0)}, r"parameters.e: high = 2 is impossible: .*restitution must be at least 0 and at most 1"),
        ({"mu": (-0.3, 0.3)}, r"parameters.mu: low = -0.3 is impossible: .*friction must be zero or positive, found -0.3"),
        ({"mu": (-0.3, -0.1), "e": (0.0, 1.0)}, r"parameters.mu: low = -0.3 is impossible: .*; give another low"),
        ({"run.step": (-1.0, 1e-3)}, r"parameters.run.step: low = -1 is impossible: step must be positive"),
    ],
)  # fmt: skip
def test_an_impossible_bound_is_named_with_its_parameter(parameters: dict[str, Any], words: str) -> None:
    targets = [{"quantity": "b.velocity.x", "value": 0.5, "uncertainty": 0.01}] * 2
    with pytest.raises(CaromError, match=words):
        Calibration.of(COLLISION, parameters, targets)


def test_a_bound_that_another_parameter_mends_is_allowed() -> None:
    """p*q is a restitution within 1 for other values of q."""
    targets = [{"quantity": "b.velocity.x", "value": 0.5, "uncertainty": 0.01}] * 2
    Calibration.of(COLLISION, {"p": (0.5, 1.2), "q": (0.7, 1.3)}, targets, set={"e": "= p*q - 0.1"})
    Calibration.of(COLLISION, {"p": (0.0, 1.0)}, targets, set={"e": "= 0.1/p"})  # none at 0


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_named_with_its_place_and_cure(name: str, free: Path) -> None:
    parameters, targets, more, words = WRONG[name]
    with pytest.raises(CaromError, match=words):
        Calibration.of(free, parameters, targets, folder=free.parent, **more)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,y1\n0,1\n", "needs to be told what its columns are"),
        (
            "time,x\n0,1\n1,-\n",
            r"row 3: x is '-', not a number; leave the cell empty where nothing was measured",
        ),
        ("time,x\n0,\n1,nan\n", "column x has no number with an uncertainty; leave it out"),
        ("time,x\n0,1\n,1\n", "column x, row 3: a number without a time"),
        ("time,x\n0,1\n1,2,5\n", "row 3: 3 values for 2 columns between commas"),
        ("seconds,x\n0,1\n1,2\n", 'has no column "time"'),
        ("time,x (furlong)\n0,1\n1,2\n", 'column x: unknown unit "furlong"'),
        ("time,x (s)\n0,1\n1,2\n", "expected a length"),
    ],
)
def test_a_wrong_file_is_named(text: str, words: str, free: Path) -> None:
    (free.parent / "a.csv").write_text(text)
    with pytest.raises(CaromError, match=words):
        Calibration.of(free, V, [{"file": "a.csv", "ball": "cue", "uncertainty": 1.0}], folder=free.parent)


def test_a_missing_column_is_named_with_those_that_are_there(free: Path) -> None:
    (free.parent / "a.csv").write_text("time,x1\n0,1\n1,2\n")
    target = {"file": "a.csv", "columns": {"x2": "cue.position.x"}, "uncertainty": 1.0}
    with pytest.raises(CaromError, match=r'target 1: .*has no column "x2"; known: time, x1'):
        Calibration.of(free, V, [target], folder=free.parent)


@pytest.mark.parametrize(
    ("measure", "target", "words"),
    [
        (lambda result: {"height": 1.0}, {**end(1, 1), "quantity": "angle"}, "no run gives angle, a target; .*height"),
        (lambda result: {"height": 1.0}, {**CURVE, "quantity": "N"}, "no curve is called N"),
    ],
)  # fmt: skip
def test_what_only_a_run_shows_is_said_after_the_first(
    measure: Callable[[Any], Any] | None, target: dict[str, Any], words: str, free: Path
) -> None:
    with pytest.raises(CaromError, match=words):
        fitted(free, V, [target], measure=measure)


def test_a_time_after_the_end_is_named_with_its_row_before_any_run(free: Path) -> None:
    (free.parent / "a.csv").write_text("# of a video\nt,x\n0,0\n10,0.01\n20,0.02\n")
    target = {"file": "a.csv", "ball": "cue", "uncertainty": 1e-4}
    with pytest.raises(
        CaromError, match=r"a.csv, column x, row 4: a time of 10 s .* at 0.02 s; .*time_unit = .ms."
    ):
        Calibration.of(free, V, [target], folder=free.parent)
    Calibration.of(free, V, [{**target, "time_unit": "ms"}], folder=free.parent)


def test_an_end_that_is_a_parameter_decides_run_by_run(free: Path) -> None:
    """Times up to 0.02 s: shorter runs count as bad; of 0.03 s no run has them."""
    parameters = {"run.until": {"low": 0.01, "high": 0.025, "start": 0.0225}}
    found = fitted(free, parameters, [{**CURVE, "value": [0.0, 0.02]}, end(0.0205, 1e-4)], step=1e-5)
    assert found.best["run.until"] == pytest.approx(0.0205, abs=1e-3)
    with pytest.raises(
        CaromError, match=r"the run ends .* before the last time of the target; raise run\.until"
    ):
        fitted(free, parameters, [{**CURVE, "time": [0.0, 0.03]}], "late")


def test_keys_of_a_search_are_none_of_a_run() -> None:
    """Both are keywords of `Calibration.of`."""
    assert not {*FILE_KEYS["search"], "search", "targets", "folder"} & {*SINGLE["run"].model_fields}


class TestCommand:
    def test_a_short_summary_files_and_a_document(self, tmp_path: Path) -> None:
        pytest.importorskip("matplotlib", reason="it draws figures")
        command = ["fit", str(EXAMPLE / "collision_fit.toml"), "-o", str(tmp_path / "fit"), "--workers", "0"]
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 0, done.stderr
        assert done.stdout.startswith("e   0.8998")
        assert len(done.stdout.splitlines()) < 12
        page = (EXAMPLE.parent.parent / "docs" / "reference" / "fit.md").read_text("utf-8")
        assert [line for line in done.stdout.splitlines()[:4] if line not in page] == []
        for name in ("fit.json", "residuals.csv", "plots/fit.png", "plots/search.png", "plots/search.csv"):
            assert (tmp_path / "fit" / name).is_file()
        document = json.loads(CliRunner().invoke(app, [*command, "--json"]).stdout)
        assert document["best"]["mu"] == pytest.approx(0.1003, abs=1e-4)
        assert document["converged"] is True

    def test_exit_codes_and_messages(self, free: Path) -> None:
        text = (
            'format = 1\nscenario = "free.toml"\n[parameters]\nv = { low = 0.5, high = 1.5 }\n[search]\npoints = 3\n'
            '[[target]]\nquantity = "cue.position.x"\nvalue = "21 mm"\nuncertainty = "0.1 mm"\n'
        )
        file = free.parent / "fit.toml"
        for change, code, words in (
            (text, 3, "has not converged"),
            (text.replace("points", "point"), 2, "unknown key search.point; did you mean points"),
            (text[: text.index("[[target]]")], 2, f"{file}: no target; write [[target]]"),
            (
                text.replace("v = { low = 0.5, high = 1.5 }", "v = [0.5, 1.5]"),
                2,
                f"{file}: parameters.v: a fit needs",
            ),
            (text + "[design]\n", 2, "unknown key design"),
        ):
            file.write_text(change)
            done = CliRunner().invoke(
                app, ["fit", str(file), "-o", str(free.parent / "o"), "--workers", "0", "--no-plots"]
            )
            assert done.exit_code == code, done.output
            assert words in done.output

    def test_without_scikit_learn_the_search_says_what_to_install(
        self, free: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "sklearn.gaussian_process", None)
        with pytest.raises(CaromError, match=r"needs scikit-learn: pip install 'carom\[fit\]'"):
            fitted(free, V, [end(0.02, 1e-4)], search="gaussian_process")
