"""Studies in this process: rows, and that nothing computed is lost or computed twice."""

from __future__ import annotations

import csv
import json
import math
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.cli.app import app
from sweep_studies import STUDY, written
from typer.testing import CliRunner


@pytest.fixture
def files(tmp_path: Path) -> Path:
    return written(tmp_path)


TWO = """\
format = 1
run = { until = 0.02, step = 5e-4 }
world = { gravity = [0, 0, 0] }
material = [{ name = "g" }]
contact = [{ between = ["g", "g"], friction = 0.4, restitution = 0.3 }]
sphere = [
  { name = "a", material = "g", radius = 2.5e-3, density = 2500, position = [0, 0, 0] },
  { name = "b", material = "g", radius = 2.5e-3, density = 2500, position = [5.02e-3, 0, 0] },
]
"""


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

    def test_cohesion_and_its_reach_vary(self, tmp_path: Path) -> None:
        """A law without them took neither; one alone is refused, both are not."""
        file = tmp_path / "two.toml"
        file.write_text(TWO)
        places = {"g/g.cohesion": "= F", "g/g.rupture_distance": "= d"}
        study = carom.Study.of(file, {"F": [0.0, 1e-3], "d": [1e-4]}, set=places)
        found = carom.sweep(study, tmp_path / "out", workers=0)
        assert found.ok.all()
        assert found["b.position.x"][1] < found["b.position.x"][0]
        for case in range(2):
            result = carom.simulate(found.scene(case))
            assert result["b"].position[-1, 0] == found["b.position.x"][case]
        alone = carom.Study.of(file, {"F": [1e-3]}, set={"g/g.cohesion": "= F"})
        assert not carom.sweep(alone, tmp_path / "alone", workers=0).ok.any()

    def test_a_study_of_other_parameters_is_refused_in_the_folder(self, files: Path) -> None:
        """It once replaced the table of the first, 1000 rows, without a word."""
        carom.sweep(files / "study.toml", files / "out", workers=0)
        table = (files / "out" / "sweep.parquet").read_bytes()
        other = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]})
        told = r"out holds a study of other parameters: speed, aim\. This one has v; choose another folder"
        with pytest.raises(CaromError, match=told):
            carom.sweep(other, files / "out", workers=0)
        done = CliRunner().invoke(
            app,
            ["sweep", str(files / "study.toml"), "-o", str(files / "out"), "--workers", "0", "--no-plots"],
        )
        assert "16 cases done, 0 failed; nothing was missing" in done.stdout
        assert (files / "out" / "sweep.parquet").read_bytes() == table

    def test_a_study_of_which_no_row_is_there_warns_before_it_replaces_the_table(self, files: Path) -> None:
        carom.sweep(carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}), files / "out", workers=0)
        with warnings.catch_warnings():  # it grows
            warnings.filterwarnings("error", "no row")
            carom.sweep(carom.Study.of(files / "slide.toml", {"v": [1.0, 3.0]}), files / "out", workers=0)
        changed = carom.Study.of(files / "slide.toml", {"v": [1.0]}, until=0.01)
        with pytest.warns(carom.CaromWarning, match=r"no row in .*out fits this study.* that of 3 rows"):
            assert len(carom.sweep(changed, files / "out", workers=0)) == 1
        (files / "out" / "sweep.json").write_text("{")  # torn: what varied there is not known
        changed = carom.Study.of(files / "slide.toml", {"mu": [0.1]})
        with pytest.warns(carom.CaromWarning, match="no row in .*out fits this study"):
            carom.sweep(changed, files / "out", workers=0)

    def test_where_all_cases_fail_a_column_that_is_missing_names_the_first_failure(self, files: Path) -> None:
        def measure(result: carom.Result) -> dict[str, float]:
            return {"deflection": float(result["ball"].velocity[-1, 1])}

        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, measure=measure)
        found = carom.sweep(study, files / "out", workers=0)
        told = "no column 'deflection'; none of 2 cases is done. Case 0: measure_failed: .*no body is called 'ball'"
        with pytest.raises(CaromError, match=told):
            found["deflection"]
        with pytest.raises(CaromError, match=told):
            found.to_csv(columns=["v", "deflection"])

    def test_quiet_tells_what_went_wrong_and_how_laws_are_called(self, files: Path) -> None:
        study = files / "failing.toml"
        study.write_text('format = 1\nscenario = "slide.toml"\n[parameters]\nv = [1.0, -1e10, 1e10]\n')
        command = ["sweep", str(study), "-o", str(files / "out"), "--workers", "0", "--no-plots", "-q"]
        done = CliRunner().invoke(app, command)
        assert (done.exit_code, done.stdout) == (3, "")
        first, second = done.stderr.splitlines()
        assert first.startswith("carom: case 1 (v = -1e+10): refused: ")
        assert second.startswith("carom: case 2 (v = 1e+10): refused: ")
        with pytest.raises(CaromError, match='no contact law of "ball/bad"; did you mean ball/ball'):
            carom.Study.of(files / "slide.toml", {"ball/bad.friction": [0.1]})

    def test_rows_say_who_computed_them_and_a_study_of_two_versions_says_so(
        self, files: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from carom.many.sweep import origin

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
            carom.CaromWarning,
            match=r"8 cases by Carom .*; this is Carom 99.0.0 .*other versions",
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
        with pytest.warns(carom.CaromWarning, match="16 cases by a Carom that did not say its version"):
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

    @pytest.mark.parametrize("first", [True, False])
    @pytest.mark.parametrize(("place", "values"), [("mu", [-1.0, 0.1]), ("cue.radius", [-1.0, 0.03])])
    def test_an_invalid_value_is_a_row_wherever_it_stands(
        self, files: Path, place: str, values: list[float], first: bool
    ) -> None:
        """As the first case it stopped the study."""
        values = values if first else values[::-1]
        found = carom.sweep(carom.Study.of(files / "slide.toml", {place: values}), files / "out", workers=0)
        assert found["outcome"].tolist() == (["refused", "done"] if first else ["done", "refused"])
        with pytest.raises(carom.CaromError, match="must be zero or positive, found -1"):
            carom.Study.of(files / "slide.toml", {"mu": [-1.0, -2.0]})  # wrong in every case

    def test_a_parameter_that_does_nothing_is_refused(self, files: Path) -> None:
        """The study set what the parameter would; the column stood there beside results that knew nothing of it."""
        of = carom.Study.of
        with pytest.raises(carom.CaromError, match=r"parameters.mu does nothing: .*ball/ball.friction"):
            of(files / "slide.toml", {"mu": [0.1], "ball/ball.friction": [0.2]})
        with pytest.raises(carom.CaromError, match=r"parameters.v does nothing: .*cue.velocity.x"):
            of(files / "slide.toml", {"v": [0.1], "s": [1.0]}, set={"cue.velocity.x": "= s"})
        with pytest.raises(carom.CaromError, match=r"run.step: step sets step, too; leave out one"):
            of(files / "slide.toml", {"step": [1e-3], "run.step": [1e-3]})
        with pytest.raises(carom.CaromError, match=r"run.step: the study gives it twice, fixed and varied"):
            of(files / "slide.toml", {"run.step": [1e-3]}, step=1e-4)
        assert of(files / "slide.toml", {"v": [0.1], "cue.velocity.y": [0.2]}).cases == 1

    def test_of_parameters_that_do_nothing_the_first_is_told(self, tmp_path: Path) -> None:
        """Which one depended on the seed with which Python mixes texts."""
        names = [f"p{k}" for k in range(8)]
        given = ", ".join(f"{name} = 1.0" for name in names)
        text = TWO.replace("run =", f"parameters = {{ {given} }}\nrun =")
        speed = f'velocity = ["= {" + ".join(names)}", 0, 0]'
        text = text.replace("position = [0, 0, 0]", f"position = [0, 0, 0], {speed}")
        (tmp_path / "two.toml").write_text(text)
        with pytest.raises(carom.CaromError, match=r"^parameters.p0 does nothing"):
            carom.Study.of(tmp_path / "two.toml", {name: [1.0] for name in names}, set={"a.velocity.x": 1.0})

    def test_a_parameter_that_the_study_itself_uses_does_something(self, files: Path) -> None:
        """It was refused as idle, and without it the expression was."""
        study = carom.Study.of(
            files / "slide.toml", {"v": [1.0, 2.0]}, set={"cue.velocity.x": "= v*cos(0.1)"}
        )
        found = carom.sweep(study, files / "out", workers=0)
        turned = carom.sweep(
            carom.Study.of(files / "slide.toml", {"cue.velocity.x": np.cos(0.1) * np.array([1.0, 2.0])}),
            files / "turned",
            workers=0,
        )
        np.testing.assert_allclose(found["cue.position.x"], turned["cue.position.x"], rtol=1e-12)

    def test_columns_that_no_table_will_have_are_refused_before_any_run(self, files: Path) -> None:
        """With --no-plots they were accepted without a word."""
        command = ["sweep", str(files / "study.toml"), "-o", str(files / "out"), "--no-plots", "--columns"]
        done = CliRunner().invoke(app, [*command, "cue.position.x,nope"])
        assert done.exit_code == 2
        assert "the study has no column 'nope'; known: " in done.stderr
        assert not (files / "out").exists()
        study = carom.Study.from_toml(files / "study.toml")
        study.check_columns(carom.sweep(study, files / "out", workers=0).columns)

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

    def test_a_run_that_is_kept_says_which_case_it_is(self, files: Path) -> None:
        """All parameters of the file, and those of the study: those that go to laws, to `[run]`, or into the file."""
        axes = {"speed": [2.0], "more": [0.1, 0.3], "run.step": [1e-3]}
        for targets in ({"ball/ball.friction": "= more", "v": "= 2*speed"}, {"v": "= speed + more"}):
            study = carom.Study.of(files / "slide.toml", axes, set=targets, keep_runs=True)
            folder = files / f"out{len(targets)}"
            found = carom.sweep(study, folder, workers=0)
            for case, name in enumerate(study.ids):
                given = {key: float(found[key][case]) for key in axes}
                v = 4.0 if len(targets) == 2 else 2.0 + given["more"]
                run = carom.load(folder / "runs" / name)
                assert run.parameters == {**given, "mu": 0.2, "v": v} == found.scene(case).parameters
                assert run.study == given == found.scene(case).study

    def test_a_name_of_the_study_and_of_the_file_has_both_values(self, files: Path) -> None:
        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, set={"v": "= 2*v"}, keep_runs=True)
        carom.sweep(study, files / "twice", workers=0)
        runs = [carom.load(files / "twice" / "runs" / name) for name in study.ids]
        assert [(run.study["v"], run.parameters["v"]) for run in runs] == [(1.0, 2.0), (2.0, 4.0)]
        assert [run["cue"].velocity[0, 0] for run in runs] == [2.0, 4.0]

    @pytest.mark.parametrize(
        ("returned", "words"),
        [
            (3, "measure: it returned 3; return numbers by name, as {'height': 0.1}"),
            ({"z": "text"}, "measure: z is 'text', not a number; return numbers by name"),
        ],
    )
    def test_what_a_measure_returns_wrongly_is_said_in_words(
        self, files: Path, returned: Any, words: str
    ) -> None:
        study = carom.Study.of(files / "slide.toml", {"v": [1.0]}, measure=lambda result: returned)
        [failure] = carom.sweep(study, files / "out", workers=0).failures
        assert (failure["outcome"], failure["message"]) == ("measure_failed", words)

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

        monkeypatch.setattr("carom.run.simulate.resume", fails)
        monkeypatch.setattr("carom.run.simulate.simulate", anew)
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

    def test_counts_and_seeds_are_whole_numbers_in_csv(self, files: Path) -> None:
        """Of a case that was refused there is no count."""
        scanned = {"v": {"seeds": 2}, "mu": [0.1, -1.0]}
        found = carom.sweep(carom.Study.of(files / "slide.toml", scanned), files / "out", workers=0)
        table = found.to_csv(columns=["case", "mu", "v", "steps", "halvings"]).read_text().splitlines()
        assert table[1:] == ["0,0.1,1,20,0", "1,0.1,2,20,0", "2,-1.0,1,nan,nan", "3,-1.0,2,nan,nan"]

    def test_the_folder_of_a_study_is_not_called_a_run_that_is_not_there(self, files: Path) -> None:
        carom.sweep(carom.Study.of(files / "slide.toml", {"v": [1.0]}), files / "out", workers=0)
        with pytest.raises(
            CaromError, match=r"out is the folder of a study, .* `carom sweep STUDY -o .*out`"
        ):
            carom.load(files / "out")

    def test_many_parts_become_one_and_lose_nothing(
        self, files: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from carom.many.sweep import folder

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

    @pytest.mark.parametrize("what", ["the whole table", "a column twice", "no outcomes", "whole numbers"])
    def test_a_table_that_is_no_part_is_as_if_it_were_not_there(self, what: str, files: Path) -> None:
        import pyarrow as arrow
        from pyarrow import parquet

        first = carom.sweep(files / "study.toml", files / "out", workers=0)
        part = sorted((files / "out" / "parts").glob("*.parquet"))[0]
        table = parquet.read_table(part)
        changed = {
            "the whole table": parquet.read_table(files / "out" / "sweep.parquet"),
            "a column twice": table.append_column("time", table["time"]),
            "no outcomes": table.drop_columns(["outcome"]),
            "whole numbers": table.append_column("n", arrow.array([1] * len(table))),
        }
        parquet.write_table(changed[what], part)
        again = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert again.progress.new == len(table)
        assert again.table.drop_columns("seconds").equals(first.table.drop_columns("seconds"))

    def test_parts_that_do_not_fit_together_are_named(self, files: Path) -> None:
        import pyarrow as arrow
        from pyarrow import parquet

        carom.sweep(files / "study.toml", files / "out", workers=0)
        part = sorted((files / "out" / "parts").glob("*.parquet"))[0]
        table = parquet.read_table(part)
        text = arrow.array(["x"] * len(table), arrow.string())
        changed = table.set_column(table.column_names.index("time"), "time", text)
        parquet.write_table(changed, part.with_name("other.parquet"))
        with pytest.raises(CaromError, match=r"time is (string|double), and .* remove the part"):
            carom.sweep(files / "study.toml", files / "out", workers=0)

    def test_two_drivers_at_once_are_refused(self, files: Path) -> None:
        from carom.many.sweep.folder import Folder

        with (
            Folder(files / "out").driving(),
            pytest.raises(CaromError, match="is being computed by another process"),
        ):
            carom.sweep(files / "study.toml", files / "out", workers=0)
        (files / "thesis").mkdir()
        (files / "thesis" / "a.tex").write_text("")
        with pytest.raises(CaromError, match="holds other files and no study"):
            carom.sweep(files / "study.toml", files / "thesis", workers=0)
