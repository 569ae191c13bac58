"""Fits: known values come back, intervals are those of theory, and nothing is told that the data do not tell."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
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

    @pytest.mark.parametrize("points", [1, 2, 4])
    def test_a_search_that_is_cut_short_says_nothing_of_model_and_data(self, points: int, free: Path) -> None:
        """Far from the best value chi squared is large: it was held against the model, and the parameter for unknown."""
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.029, 1e-3)], points=points)
        assert not found.converged
        assert len(found.remarks) == 1
        assert found.remarks[0].startswith(
            f"the search has not converged: the search ended after its {points} point"
        )
        assert found.interval == {"v": None}
        assert "lead v out of the interval, so there is none" in found.remarks[0]
        assert found.summary["widened"] == 1.0
        whole = fitted(free, {"v": (0.5, 1.5)}, [end(0.029, 1e-3)])
        assert whole.converged
        assert whole.interval["v"] is not None

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

    @pytest.mark.parametrize(
        ("slopes", "freedom"),
        [
            ([[0.0], [0.0]], 2),
            ([[1e-5], [0.0]], 2),
            ([[1e3], [0.0]], 1),
            ([[1e3, 1e3], [0.0, 0.0]], 1),
            ([[1e3, 0.0], [0.0, 1e3]], 0),
        ],
    )
    def test_degrees_of_freedom_are_the_data_less_what_they_determine(
        self, slopes: list[list[float]], freedom: int
    ) -> None:
        """A parameter without influence had taken one; with none left over any chi squared was as good as 0."""
        jacobian, n = np.array(slopes), len(slopes[0])
        for off, words in ((1e-6, []), (20.0, [f"chi squared is 400 where {freedom} is expected"])):
            found = told(jacobian, np.array([0.0, off]), np.zeros(2), np.full(n, 0.5), 1e-9)
            assert found.freedom == freedom
            remarks = [r.partition(":")[0] for r in of_data(found, ["a", "b"][:n]) if "chi squared" in r]
            assert remarks == words

    @pytest.mark.parametrize(
        ("data", "noise", "scatter"),
        [(8, 0.0, 1.0), (8, 1.5, 1.0), (4, 0.0, 1e3), (5, 0.0, 1e3), (13, 0.0, 1e3)],
    )
    def test_intervals_of_random_linear_models_hold_the_truth(
        self, data: int, noise: float, scatter: float
    ) -> None:
        """Theory alone, without runs: 95 %, also with noise of the runs, and where data scatter more than they say."""
        rng = np.random.default_rng(1)
        held = 0
        for _ in range(1000):
            jacobian = rng.normal(size=(data, 3)) * 1e6 * scatter  # all is determined
            off = rng.normal(size=data) * np.hypot(1, noise) * scatter
            step = np.linalg.lstsq(jacobian, off, rcond=None)[0]
            found = told(jacobian, off - jacobian @ step, np.full(data, noise), np.full(3, 0.5), 0.0)
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
                f"{file}:4: parameters.v: a fit needs",
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
            fitted(free, {"v": (0.5, 1.5)}, [end(0.02, 1e-4)], search="gaussian_process")
