"""Studies: the points of each design, where values go, and that nothing computed is lost or computed twice."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom.cli.app import app
from carom.errors import CaromError
from carom.sweeps.design import Axis, Design
from typer.testing import CliRunner

SCENARIO = """
format = 1
title = "slide"

[parameters]
v = 1.0
mu = 0.2

[world]
gravity = [0.0, 0.0, -9.8]

[run]
until = 0.02
step = 1e-3

[[material]]
name = "ball"
[[contact]]
between = ["ball", "ball"]
friction = "= mu"
restitution = 0.5

[[sphere]]
name = "cue"
material = "ball"
radius = 0.03
mass = 0.17
position = [0.0, 0.0, 0.03]
velocity = ["= v", 0.0, 0.0]
[[sphere]]
name = "post"
material = "ball"
radius = 0.03
mass = 0.17
position = [0.5, 0.0, 0.03]

[[plane]]
name = "bed"
material = "ball"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
"""

STUDY = """
format = 1
title = "slides"
scenario = "slide.toml"

[parameters]
speed = { low = 0.5, high = 1.5 }
aim = { low = -0.1, high = 0.1 }

[design]
kind = "sobol"
count = 16
seed = 3

[set]
"cue.velocity.x" = "= speed*cos(aim)"
"cue.velocity.y" = "= speed*sin(aim)"
"""


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "slide.toml").write_text(SCENARIO)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def scheduler(folder: Path) -> tuple[subprocess.Popen[str], str]:
    """A scheduler with a worker in a process of its own, and its address."""
    (folder / "cluster.py").write_text(
        "import time\nfrom distributed import LocalCluster\nif __name__ == '__main__':\n"
        "    c = LocalCluster(n_workers=1, threads_per_worker=1, host='127.0.0.1', dashboard_address=None)\n"
        "    print(c.scheduler_address, flush=True)\n    time.sleep(600)\n"
    )
    process = subprocess.Popen(
        [sys.executable, str(folder / "cluster.py")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


class TestDesigns:
    def test_a_grid_has_every_combination_seeds_fastest(self) -> None:
        axes = [Axis.of("s", {"seeds": 2}), Axis.of("a", {"low": 1, "high": 100, "count": 3, "log": True})]
        points = Design("grid").points([*axes, Axis.of("b", [5, 6])])
        assert points["a"] == pytest.approx([1] * 4 + [10] * 4 + [100] * 4)
        assert points["b"].tolist() == [5, 5, 6, 6] * 3
        assert points["s"].tolist() == [1, 2] * 6

    @pytest.mark.parametrize("kind", ["lhs", "sobol"])
    def test_random_designs_fill_every_slice_and_repeat_by_seed(self, kind: str) -> None:
        pytest.importorskip("scipy", reason="the extra [cluster] is not installed")
        axes = [Axis.of("a", (2.0, 4.0)), Axis.of("b", [1, 2, 3, 4])]
        points = Design(kind, 16, 1).points(axes)
        # One point in each sixteenth of a continuous axis, four at each of four values.
        assert sorted(((points["a"] - 2) * 8).astype(int).tolist()) == list(range(16))
        assert [int((points["b"] == k).sum()) for k in (1, 2, 3, 4)] == [4] * 4
        again, other = Design(kind, 16, 1).points(axes), Design(kind, 16, 2).points(axes)
        assert np.array_equal(points["a"], again["a"])
        assert not np.array_equal(points["a"], other["a"])

    def test_a_sobol_study_grows_at_its_end(self) -> None:
        pytest.importorskip("scipy", reason="the extra [cluster] is not installed")
        axes = [Axis.of("a", (0.0, 1.0)), Axis.of("s", {"seeds": 2})]
        small, large = Design("sobol", 8, 1).points(axes), Design("sobol", 32, 1).points(axes)
        assert all(np.array_equal(small[name], large[name][:16]) for name in small)

    @pytest.mark.parametrize(
        ("given", "told"),
        [
            ({"low": 1}, "parameters.a: give values = [...], or low and high, or seeds"),
            ({"low": 2, "high": 1}, "low = 2, high = 1; wanted low < high"),
            ({"low": 0, "high": 1, "log": True}, "wanted 0 < low < high"),
            ({"low": 0, "heigh": 1}, "unknown key heigh; did you mean high?"),
            ([], "the list of values is empty"),
            ([1, "2"], "expected numbers in SI units, found '2'"),
            ({"seeds": 0}, "parameters.a.seeds: expected a whole number from 1"),
        ],
    )
    def test_says_what_is_wrong_with_an_axis(self, given: Any, told: str) -> None:
        with pytest.raises(CaromError) as caught:
            Axis.of("a", given)
        assert told in str(caught.value)

    def test_a_grid_of_a_range_needs_its_count(self) -> None:
        with pytest.raises(CaromError, match=r"parameters.a: a grid needs count = N points"):
            Design("grid").points([Axis.of("a", (0.0, 1.0))])

    @pytest.mark.parametrize(
        ("design", "axes", "told"),
        [
            (Design("grid", 8), {"a": [1, 2]}, "design.count belongs to lhs and sobol; give each range its count"),
            (Design("table", 8, table={"a": [1.0]}), {}, "the rows of the table are the points"),
            (
                Design("lhs", 8),
                {"a": {"low": 0, "high": 1, "count": 5}},
                "parameters.a: count belongs to a grid; lhs takes design.count = N points in all",
            ),
            (Design("lhs", 8, -1), {"a": (0.0, 1.0)}, "design.seed: expected a whole number from 0, found -1"),
            (Design("sobol", 10**12), {"a": (0.0, 1.0)}, "design.count: expected a whole number from 1 to"),
            (Design("sobol", 10**7), {"a": (0.0, 1.0), "s": {"seeds": 10}}, "the study has 100000000 points"),
            (Design("table", table={"a": [1.0, 2.0], "b": [1.0]}), {}, "equally long, found a 2, b 1 rows"),
            (Design("table", table={"a": ["x"]}), {}, "parameters.a: expected numbers in SI units, found 'x'"),
            (Design("table", table={"a": [math.nan]}), {}, "parameters.a: expected numbers in SI units, found nan"),
        ],
    )  # fmt: skip
    def test_nothing_of_a_design_is_left_aside_without_a_word(
        self, design: Design, axes: dict[str, Any], told: str
    ) -> None:
        """A count of the wrong kind was once ignored, and a table cut to its first column."""
        if design.kind in ("lhs", "sobol"):
            pytest.importorskip("scipy", reason="the extra [cluster] is not installed")
        with pytest.raises(CaromError) as caught:
            design.points([Axis.of(name, given) for name, given in axes.items()])
        assert told in str(caught.value)


class TestStudy:
    def test_values_go_where_they_should(self, files: Path) -> None:
        study = carom.Study.of(
            files / "slide.toml", {"v": [1.0, 2.0], "run.step": [1e-3, 5e-4], "angle": [0.5]},
            set={"cue.velocity.y": "= v*sin(angle)", "v": "= 2*v"},
        )  # fmt: skip
        scene = study.targeting.scene(3)
        assert scene.run.step == 5e-4
        assert scene.spheres[0].velocity == pytest.approx((4.0, 2 * math.sin(0.5), 0.0))
        assert (
            carom.Study.of(files / "slide.toml", {"mu": [0.3]}).targeting.scene(0)._tree.contact[0].friction
            == 0.3
        )

    def test_the_name_of_a_case_is_that_of_its_content(self, files: Path) -> None:
        few = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, until=0.01)
        more = carom.Study.of(files / "slide.toml", {"v": [3.0, 2.0, 1.0]}, until=0.01)
        assert set(few.ids) == set(more.ids[1:])
        longer = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, until=0.02)
        assert not set(few.ids) & set(longer.ids)
        (files / "slide.toml").write_text("# a comment\n" + SCENARIO)
        assert carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, until=0.01).ids == few.ids
        (files / "slide.toml").write_text(SCENARIO.replace("0.17", "0.18"))
        assert not set(carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, until=0.01).ids) & set(few.ids)

    @pytest.mark.parametrize(
        ("old", "new", "told"),
        [
            ("[design]", "[desing]", "unknown key desing; did you mean design?"),
            ('kind = "sobol"', 'kind = "sobel"', "no design is called 'sobel'; did you mean sobol?"),
            ("count = 16", "", "design.kind = sobol needs design.count = N points"),
            ("count = 16", 'count = "x"', "design.count: expected a whole number, found 'x'"),
            ('"slide.toml"', '"side.toml"', "side.toml: no such file; did you mean"),
            ("speed*cos(aim)", "sped*cos(aim)", 'unknown name sped in "= sped*cos(aim)"; did you mean speed?'),
            ('"cue.velocity.x"', '"cu.velocity.x"', 'no ball is called "cu"; did you mean cue?'),
            ("[set]", "[set]\nw = 1", '"w" names no quantity'),
            ("aim = {", "eim = {", "unknown name aim"),
            ("format = 1", "", "write format = 1 at the top"),
        ],
    )  # fmt: skip
    def test_mistakes_are_found_before_anything_runs(
        self, old: str, new: str, told: str, files: Path
    ) -> None:
        pytest.importorskip("scipy", reason="the extra [cluster] is not installed")
        (files / "study.toml").write_text(STUDY.replace(old, new))
        done = CliRunner().invoke(app, ["sweep", str(files / "study.toml"), "-o", str(files / "out")])
        assert done.exit_code == 2, done.output
        assert told in done.stderr
        assert "Traceback" not in done.stderr
        assert not (files / "out").exists()

    def test_a_file_that_is_not_there_is_not_called_bad_toml(self, files: Path) -> None:
        with pytest.raises(CaromError, match=r"^.*none.toml: no such file"):
            carom.Study.from_toml(files / "none.toml")
        (files / "study.toml").write_text("format = ")
        with pytest.raises(CaromError, match=r"study.toml is not TOML: Invalid value"):
            carom.Study.from_toml(files / "study.toml")

    def test_an_example_is_known_by_name_in_python_as_in_files(self) -> None:
        study = carom.Study.of("paper/5.3_throw", {"spin": [0.0, 0.5]})
        assert study.cases == 2
        assert study.targeting.scene(1).spheres[0].angular_velocity[2] == pytest.approx(
            0.5 * 1.341 / 0.028575
        )
        with pytest.raises(CaromError, match="absent: no such file"):
            carom.Study.of("absent", {"spin": [0.0]})

    def test_one_ball_may_be_named_alone_and_set_takes_numbers(self, files: Path) -> None:
        assert carom.Study.of(files / "slide.toml", {"v": [1.0]}, bodies="cue").bodies == ("cue",)
        with pytest.raises(CaromError, match=r"set.cue.mass: expected numbers in SI units, found None"):
            carom.Study.of(files / "slide.toml", {"v": [1.0]}, set={"cue.mass": None})  # type: ignore[dict-item]

    def test_a_parameter_that_goes_nowhere_is_refused(self, files: Path) -> None:
        with pytest.raises(CaromError, match=r"parameters.speed goes nowhere: .*slide.toml has no parameter"):
            carom.Study.of(files / "slide.toml", {"speed": [1.0]})

    def test_a_table_names_its_columns(self, files: Path) -> None:
        (files / "t.csv").write_text("v, mu\n1.0, 0.1\n2.0, 0.2\n")
        assert carom.Study.of(files / "slide.toml", table=files / "t.csv").points["v"].tolist() == [1.0, 2.0]
        (files / "t.csv").write_text("v, mu\n1.0, a\n")
        with pytest.raises(CaromError, match=r"t.csv, row 2: mu is 'a', not a number"):
            carom.Study.of(files / "slide.toml", table=files / "t.csv")


class TestInThisProcess:
    @pytest.fixture(autouse=True)
    def extras(self) -> None:
        for name in ("pyarrow", "scipy"):
            pytest.importorskip(name, reason="the extra [cluster] is not installed")

    def test_rows_are_those_of_single_runs(self, files: Path) -> None:
        found = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert len(found) == 16
        assert found.ok.all()
        for case in (0, 7):
            result = carom.simulate(found.scene(case))
            for k, axis in enumerate("xyz"):
                assert found[f"cue.velocity.{axis}"][case] == result["cue"].velocity[-1, k]
        assert np.array_equal(found["speed"], found.study.points["speed"])

    def test_a_second_call_does_nothing_and_a_larger_study_only_the_rest(self, files: Path) -> None:
        first = carom.sweep(files / "study.toml", files / "out", workers=0)
        parts = sorted((files / "out" / "parts").iterdir())
        again = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert again.progress.new == 0
        assert sorted((files / "out" / "parts").iterdir()) == parts
        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 24"))
        larger = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert larger.progress.new == 8
        assert np.array_equal(larger["cue.position.x"][:16], first["cue.position.x"])
        assert larger["case"].tolist() == list(range(24))

    def test_rows_say_who_computed_them_and_a_study_of_two_versions_says_so(
        self, files: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from carom.sweeps import origin

        def study(count: int) -> Path:
            (files / "study.toml").write_text(STUDY.replace("count = 16", f"count = {count}"))
            return files / "study.toml"

        here = origin.here()
        assert here.carom == carom.__version__
        first = carom.sweep(study(4), files / "out", workers=0)
        assert first["carom"].tolist() == [carom.__version__] * 4
        assert first["build"].tolist() == [here.build] * 4
        with warnings.catch_warnings():  # of one and the same nothing is said
            warnings.simplefilter("error")
            carom.sweep(study(8), files / "out", workers=0)
        monkeypatch.setattr(origin, "here", lambda: origin.Origin("99.0.0", "ab" * 20))
        with pytest.warns(
            carom.run.CaromWarning, match=r"8 cases by Carom .*; this is Carom 99.0.0 .*other versions"
        ):
            mixed = carom.sweep(study(10), files / "out", workers=0)
        assert mixed["carom"].tolist() == [carom.__version__] * 8 + ["99.0.0"] * 2
        assert dict(mixed.origins) == {here: 8, origin.Origin("99.0.0", "ab" * 20): 2}
        noted = json.loads((files / "out" / "sweep.json").read_text())["computed_by"]
        assert {row["carom"]: row["cases"] for row in noted} == {carom.__version__: 8, "99.0.0": 2}
        monkeypatch.setattr(origin, "here", lambda: origin.Origin("99.0.0", "cd" * 20))
        done = CliRunner().invoke(
            app, ["sweep", str(study(12)), "-o", str(files / "out"), "--workers", "0", "--no-plots"]
        )
        assert "carom: warning: there already: 8 cases by Carom" in done.stderr
        assert "2 cases by Carom 99.0.0 (build cdcdcdcd)" in done.stdout
        with warnings.catch_warnings():  # nothing is computed, so nothing is mixed by this call
            warnings.simplefilter("error")
            carom.sweep(study(12), files / "out", workers=0)

    def test_parts_that_do_not_say_who_wrote_them_are_read(self, files: Path) -> None:
        """Parts of older versions have no such columns; they were once taken for damaged by a draft of this."""
        from pyarrow import parquet

        first = carom.sweep(files / "study.toml", files / "out", workers=0)
        for part in (files / "out" / "parts").glob("*.parquet"):
            parquet.write_table(parquet.read_table(part).drop_columns(["carom", "build"]), part)
        again = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert again.progress.new == 0
        assert sum(again.origins.values()) == 16
        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 20"))
        with pytest.warns(carom.run.CaromWarning, match="16 cases by a Carom that did not say its version"):
            more = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert more.progress.new == 4
        assert np.array_equal(more["cue.position.x"][:16], first["cue.position.x"])

    def test_failures_are_rows_with_their_reason_and_stop_nothing(self, files: Path) -> None:
        # The second ball is put inside the first, or given a mass that none can have.
        study = carom.Study.of(files / "slide.toml", {"post.position.x": [0.5, 0.01, 0.4]})
        found = carom.sweep(study, files / "out", workers=0)
        assert found["outcome"].tolist() == ["done", "overlap", "done"]
        [failure] = found.failures
        assert failure["case"] == 1
        assert failure["post.position.x.start"] == 0.01
        assert failure["message"]
        assert math.isnan(found["cue.position.x"][1])
        again = carom.sweep(study, files / "out", workers=0)
        assert again.progress.new == 0
        retried = carom.sweep(study, files / "out", workers=0, retry_failed=True)
        assert retried.progress.new == 1
        assert len(retried) == 3
        refused = carom.Study.of(files / "slide.toml", {"mu": [0.1, -1.0]})
        rows = carom.sweep(refused, files / "other", workers=0)
        assert rows["outcome"].tolist() == ["done", "refused"]
        assert "friction" in rows.failures[0]["message"]

    def test_run_directories_are_kept_continued_and_measured(self, files: Path) -> None:
        def travelled(result: carom.Result) -> dict[str, float]:
            return {"travelled": float(result["cue"].position[-1, 0])}

        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, keep_runs=True, measure=travelled)
        found = carom.sweep(study, files / "out", workers=0)
        assert np.array_equal(found["travelled"], found["cue.position.x"])
        runs = [files / "out" / "runs" / name for name in study.ids]
        assert [carom.load(run).outcome.kind for run in runs] == ["done", "done"]
        # The rows are lost, the runs are there: they are loaded, not computed again, and stay those of who computed them.
        about = json.loads((runs[1] / "run.json").read_text())
        about["versions"] |= {"core": "0.0.9", "build": "ef" * 20}
        (runs[1] / "run.json").write_text(json.dumps(about))
        for part in (files / "out" / "parts").glob("*.parquet"):
            part.unlink()
        before = [(run / "results.h5").stat().st_mtime_ns for run in runs]
        again = carom.sweep(study, files / "out", workers=0)
        assert again.progress.new == 2
        assert [(run / "results.h5").stat().st_mtime_ns for run in runs] == before
        assert np.array_equal(again["travelled"], found["travelled"])
        assert again["carom"].tolist() == [carom.__version__, "0.0.9"]
        assert again["build"].tolist() == [found["build"][0], "ef" * 20]

    def test_a_run_that_fails_when_it_is_continued_is_not_computed_anew(
        self, files: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        study = carom.Study.of(files / "slide.toml", {"v": [1.0]}, keep_runs=True)
        carom.sweep(study, files / "out", workers=0)
        [path] = (files / "out" / "runs").iterdir()
        about = json.loads((path / "run.json").read_text())
        (path / "run.json").write_text(json.dumps(about | {"status": "interrupted"}))
        for part in (files / "out" / "parts").glob("*.parquet"):
            part.unlink()

        def fails(where: Path) -> carom.Result:
            raise carom.RunFailed("blew up", carom.load(where))

        def anew(*_: object, **__: object) -> carom.Result:
            raise AssertionError("computed anew")

        monkeypatch.setattr("carom.run.resume", fails)
        monkeypatch.setattr("carom.run.simulate", anew)
        assert len(carom.sweep(study, files / "out", workers=0)) == 1

    @pytest.mark.parametrize("name", ["v", "outcome", "time", "cue.position.x"])
    def test_a_measure_may_not_take_the_place_of_another_column(self, name: str, files: Path) -> None:
        """It once overwrote parameters and outcomes without a word."""
        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, measure=lambda result: {name: 9.0})
        found = carom.sweep(study, files / "out", workers=0)
        assert found["v"].tolist() == [1.0, 2.0]
        assert found["outcome"].tolist() == ["measure_failed"] * 2
        assert f"a column is called {name} already" in found.failures[0]["message"]

    def test_columns_have_their_units(self, files: Path) -> None:
        found = carom.sweep(
            carom.Study.of(files / "slide.toml", {"cue.velocity.x": [1.0]}), files / "out", workers=0
        )
        units = {field.name: (field.metadata or {}).get(b"unit") for field in found.table.schema}
        assert units["cue.velocity.x"] == units["cue.velocity.x.start"] == b"m/s"
        assert (units["penetration_max"], units["energy_final"], units["time"]) == (b"m", b"J", b"s")
        assert units["penetration_max_relative"] == units["cue.orientation.w"] == units["outcome"] == b"1"

    def test_the_table_is_written_as_csv_with_units_and_every_bit(self, files: Path) -> None:
        found = carom.sweep(
            carom.Study.of(files / "slide.toml", {"v": [1.0, 1 / 3]}), files / "out", workers=0
        )
        with open(found.to_csv(), newline="") as file:
            rows = list(csv.DictReader(file))
        assert [float(row["cue.velocity.x (m/s)"]) for row in rows] == found["cue.velocity.x"].tolist()
        assert [row["outcome"] for row in rows] == ["done", "done"]
        few = found.to_csv(files / "tables" / "few.csv", ["v", "cue.velocity.x"])
        assert few.read_text().splitlines()[0] == "v,cue.velocity.x (m/s)"
        assert float(few.read_text().splitlines()[2].split(",")[0]) == 1 / 3
        with pytest.raises(CaromError, match="no column 'velocity'"):
            found.to_csv(columns=["velocity"])

    def test_the_folder_of_a_study_is_not_called_a_run_that_is_not_there(self, files: Path) -> None:
        carom.sweep(carom.Study.of(files / "slide.toml", {"v": [1.0]}), files / "out", workers=0)
        with pytest.raises(
            CaromError, match=r"out is the folder of a study, .* `carom sweep STUDY -o .*out`"
        ):
            carom.load(files / "out")

    def test_the_numbers_beside_the_figures_have_units_and_those_below_panels_stand_apart(
        self, files: Path
    ) -> None:
        pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
        from carom.plot.sweep import histograms, places, responses
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        def long_number(result: carom.Result) -> dict[str, float]:
            return {"z": 0.03 + 7.5e-4 * float(result["cue"].velocity[0, 0])}

        study = carom.Study.of(files / "slide.toml", {"v": [0.0, 0.3, 0.6, 1.0]}, measure=long_number)
        found = carom.sweep(study, files / "out", workers=0)
        assert list(responses(found, ["cue.position.x"]).data) == ["case", "cue.position.x (m)", "v"]
        assert set(places(found).data) == {"case", "v", "cue x (m)", "cue y (m)", "post x (m)", "post y (m)"}
        chart = histograms(found, ["z"] * 5 + ["cue.position.x"])  # three panels beside each other
        assert {"z: from", "cue.position.x: from (m)"} < set(chart.data)
        canvas = FigureCanvasAgg(chart.figure)
        canvas.draw()
        ends = 0.0
        for axis in chart.figure.axes[:3]:
            low, high = axis.get_xlim()
            for tick, at in zip(axis.get_xticklabels(), axis.get_xticks(), strict=True):
                if low <= at <= high:
                    box = tick.get_window_extent(canvas.get_renderer())
                    assert box.x0 > ends
                    ends = box.x1

    def test_many_parts_become_one_and_lose_nothing(
        self, files: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from carom.sweeps import folder

        monkeypatch.setattr(folder, "MOST_PARTS", 3)
        first = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert len(list((files / "out" / "parts").glob("*.parquet"))) == 1
        again = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert again.progress.new == 0
        assert again.table.equals(first.table)

    def test_a_damaged_part_is_computed_again(self, files: Path) -> None:
        first = carom.sweep(files / "study.toml", files / "out", workers=0)
        part = sorted((files / "out" / "parts").glob("*.parquet"))[0]
        part.write_bytes(part.read_bytes()[:100])
        again = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert 0 < again.progress.new < 16
        assert again.table.drop_columns("seconds").equals(first.table.drop_columns("seconds"))

    def test_a_killed_driver_loses_nothing_that_was_written(self, files: Path) -> None:
        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 600"))
        command = [
            sys.executable,
            "-m",
            "carom",
            "sweep",
            str(files / "study.toml"),
            "-o",
            str(files / "out"),
        ]
        process = subprocess.Popen([*command, "--workers", "0", "-q", "--no-plots"])
        parts = files / "out" / "parts"
        while not list(parts.glob("*.parquet")):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        rest = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert 0 < rest.progress.new < 600
        assert len(rest) == rest.ok.sum() == 600

    def test_two_drivers_at_once_are_refused(self, files: Path) -> None:
        from carom.sweeps.folder import Folder

        with (
            Folder(files / "out").driving(),
            pytest.raises(CaromError, match="is being computed by another process"),
        ):
            carom.sweep(files / "study.toml", files / "out", workers=0)
        (files / "thesis").mkdir()
        (files / "thesis" / "a.tex").write_text("")
        with pytest.raises(CaromError, match="holds other files and no study"):
            carom.sweep(files / "study.toml", files / "thesis", workers=0)

    def test_the_command_says_what_failed_and_draws(self, files: Path) -> None:
        pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
        (files / "study.toml").write_text(
            STUDY.replace("speed = {", "post = {values = [0.5, 0.02]}\nspeed = {")
            + '"post.position.x" = "= post"\n'
        )
        arguments = ["sweep", str(files / "study.toml"), "-o", str(files / "out"), "--workers", "0"]
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 3, done.output
        assert "8 cases done, 8 failed; 16 new in" in done.stdout
        assert "overlap" in done.stdout
        again = CliRunner().invoke(
            app,
            [*arguments, "--json", "--columns", "cue.position.y,seconds", "--csv", str(files / "table.csv")],
        )
        facts = json.loads(again.stdout)
        assert (facts["new"], facts["done"], facts["failed"], facts["missing"]) == (0, 8, 8, 0)
        assert facts["files"][0] == str(files / "table.csv")
        assert len((files / "table.csv").read_text().splitlines()) == 17
        assert json.loads((files / "out" / "sweep.json").read_text())["failures"] == facts["failures"]
        with open(files / "out" / "plots" / "histograms.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        assert (
            sum(float(r["cue.position.y: cases"]) for r in rows if r["cue.position.y: cases"] != "nan") == 8
        )


def test_pieces_that_are_cancelled_with_their_scheduler_end_the_call_in_a_line(
    monkeypatch: pytest.MonkeyPatch, files: Path
) -> None:
    distributed = pytest.importorskip("distributed", reason="needs dask (extra cluster)")
    from carom.sweeps import cluster

    class Lost:
        status = "running"

        def nthreads(self) -> dict[str, int]:
            return {"worker": 1}

        def submit(self, *arguments: Any, **options: Any) -> object:
            return object()

    client = Lost()

    def wait(*arguments: Any, **options: Any) -> None:
        client.status = "closed"
        raise CancelledError

    monkeypatch.setattr(distributed, "wait", wait)
    job = cluster.Job("key", "folder", carom.Study.of(files / "slide.toml", {"v": [1.0]}), ("id",))
    with pytest.raises(CaromError, match="the scheduler is gone"):
        cluster._drive(client, [job], lambda cases, failed: None)
    # dask gives its client's log a level of its own: the line would stand below tracebacks.
    assert {"distributed", "distributed.client"} <= {log.name for log in cluster._loggers("distributed")}


@pytest.mark.long
class TestOnACluster:
    """Worker processes of their own, some of which do not live long."""

    @pytest.fixture(autouse=True)
    def extras(self) -> None:
        for name in ("pyarrow", "scipy", "distributed"):
            pytest.importorskip(name, reason="the extra [cluster] is not installed")

    def test_a_killed_worker_changes_nothing(self, files: Path) -> None:
        from distributed import LocalCluster

        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 400"))
        killed = []
        with LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
        ) as cluster:

            def kill_one(now: carom.sweeps.Progress) -> None:
                if not killed:
                    killed.append(next(iter(cluster.workers.values())).pid)
                    os.kill(killed[0], signal.SIGKILL)

            found = carom.sweep(
                files / "study.toml", files / "out", scheduler=cluster.scheduler_address, progress=kill_one
            )
        assert killed
        assert len(found) == found.ok.sum() == 400
        alone = carom.sweep(files / "study.toml", files / "alone", workers=0)
        assert found.table.drop_columns("seconds").equals(alone.table.drop_columns("seconds"))
        assert carom.sweep(files / "study.toml", files / "out", workers=2).progress.new == 0

    def test_a_case_that_kills_workers_is_found_and_the_others_are_done(self, files: Path) -> None:
        def deadly(result: carom.Result) -> dict[str, float]:
            if result["cue"].velocity[0, 0] == 2.0:
                os.kill(os.getpid(), signal.SIGKILL)
            return {"v": 1.0}

        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0, 3.0, 4.0]}, measure=deadly)
        found = carom.sweep(study, files / "out", workers=2)
        assert sorted(found["outcome"].tolist()) == ["done", "done", "done", "worker_died"]
        assert found["outcome"][1] == "worker_died"

    def test_a_scheduler_that_goes_loses_nothing(self, files: Path) -> None:
        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 2000"))
        process, address = scheduler(files)

        def kill(now: carom.sweeps.Progress) -> None:
            process.kill()

        with pytest.raises(CaromError, match="the scheduler is gone; what was computed stays"):
            carom.sweep(files / "study.toml", files / "out", scheduler=address, progress=kill)
        process.wait()
        rest = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert 0 < rest.progress.new < 2000
        assert len(rest) == rest.ok.sum() == 2000

    def test_a_scheduler_that_goes_while_pieces_are_awaited_loses_nothing(self, files: Path) -> None:
        # dask cancels what it awaits of a lost scheduler; it came out as an error in Carom, below tracebacks of dask.
        process, address = scheduler(files)
        go = files / "go"

        def waits(result: carom.Result) -> dict[str, float]:
            while not go.exists():
                time.sleep(0.02)
            return {"v": 1.0}

        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0, 3.0]}, measure=waits)
        end = threading.Timer(2.0, process.kill)
        end.start()
        try:
            with pytest.raises(CaromError, match="the scheduler is gone; what was computed stays"):
                carom.sweep(study, files / "out", scheduler=address)
        finally:
            end.cancel()
            process.kill()
            process.wait()
            go.touch()
        assert len(carom.sweep(study, files / "out", workers=0)) == 3
