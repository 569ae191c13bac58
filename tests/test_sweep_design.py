"""Studies before anything is computed: the points of each design, and where values go."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.cli.app import app
from carom.many.sweep.design import Axis, Design
from sweep_studies import SCENARIO, STUDY, written
from typer.testing import CliRunner


@pytest.fixture
def files(tmp_path: Path) -> Path:
    return written(tmp_path)


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
            ({"step": [1e-3]}, 'unknown key step; for a place of this name write it in quotes: "a.step"'),
            ({"value": [1.0, 2.0]}, "unknown key value; did you mean values?"),
            ([], "the list of values is empty"),
            ([1, None], "expected numbers in SI units, found None"),
            (
                [1, "2"],
                'parameters.a: "2" is text without a unit; remove the quotes, or write a number in SI',
            ),
            (
                ["8 deg", "2 mm"],
                'expected a quantity like "8 deg", found "2 mm", a length; write a number in rad',
            ),
            ({"low": "1 m", "high": "2 s"}, 'expected a quantity like "1 m", found "2 s", a time'),
            (["= 2*x"], "parameters.a: x has no value"),
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
            (Design("table", table={"a": ["x"]}), {}, 'parameters.a: "x" is not a number with a unit'),
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

    def test_a_parameter_of_the_scenario_goes_there_also_where_set_uses_it(self, files: Path) -> None:
        study = carom.Study.of(files / "slide.toml", {"v": [3.0]}, set={"cue.velocity.y": "= v/4"})
        assert study.targeting.scene(0).spheres[0].velocity == pytest.approx([3.0, 0.75, 0.0])

    def test_a_parameter_that_goes_nowhere_is_refused(self, files: Path) -> None:
        with pytest.raises(CaromError, match=r"parameters.speed goes nowhere: .*slide.toml has no parameter"):
            carom.Study.of(files / "slide.toml", {"speed": [1.0]})

    def test_a_table_names_its_columns(self, files: Path) -> None:
        (files / "t.csv").write_text("v, mu\n1.0, 0.1\n2.0, 0.2\n")
        assert carom.Study.of(files / "slide.toml", table=files / "t.csv").points["v"].tolist() == [1.0, 2.0]
        (files / "t.csv").write_text("v, mu\n1.0, a\n")
        with pytest.raises(CaromError, match=r"t.csv, row 2: mu is 'a', not a number"):
            carom.Study.of(files / "slide.toml", table=files / "t.csv")


class TestQuantities:
    """A study reads of parameters what the scenario itself reads."""

    @pytest.mark.parametrize(
        ("given", "values"),
        [
            (["36 km/h", 5, "= 2*pi"], [10.0, 5.0, 2 * math.pi]),
            ({"values": ["1 m/s", "200 cm/s"]}, [1.0, 2.0]),
            ({"low": "1 m/s", "high": "3.6 km/h", "count": 2}, None),
            ({"low": "1 m/s", "high": "7.2 km/h", "count": 2}, [1.0, 2.0]),
            (("36 km/h", 20.0), [10.0, 20.0]),
            ("36 km/h", [10.0]),
        ],
    )
    def test_values_are_those_that_the_scenario_has_of_the_same_texts(
        self, given: Any, values: list[float] | None, files: Path
    ) -> None:
        if values is None:
            with pytest.raises(CaromError, match=r"parameters.v: low = 1, high = 1; wanted low < high"):
                Axis.of("v", given)
            return
        axis = Axis.of("v", given)
        found = list(axis.values) or [axis.low, axis.high]
        assert found == values
        for text in given if isinstance(given, list) else ():
            assert (
                carom.Scene.from_toml(files / "slide.toml", parameters={"v": text}).parameters["v"] in values
            )

    def test_a_file_has_them_too_and_a_message_has_the_line(self, files: Path) -> None:
        study = files / "study.toml"
        study.write_text(
            'format = 1\nscenario = "slide.toml"\n[parameters]\nmu = [0.1]\nv = ["36 km/h", 5]\n'
        )
        assert carom.Study.from_toml(study).points["v"].tolist() == [10.0, 5.0]
        study.write_text(study.read_text().replace("36 km/h", "0.1"))
        with pytest.raises(CaromError, match=rf'^{study}:5: parameters.v: "0.1" is text without a unit'):
            carom.Study.from_toml(study)

    @pytest.mark.parametrize(
        ("name", "value", "told"),
        [
            ("v", "3 s", r'expected a quantity like "1 m/s", found "3 s", a time; write a number in m/s'),
            ("step", "1 m", 'expected a time, found "1 m", a length'),
            ("run.step", "1 m", 'expected a time, found "1 m", a length'),
            ("cue.velocity.y", "1 m", 'expected a speed, found "1 m", a length'),
            ("cue.mass", "1 m", 'expected a mass, found "1 m", a length'),
            ("ball/ball.restitution", "1 m", 'expected a number, found "1 m", a length'),
        ],
    )
    def test_a_unit_is_one_of_the_place_that_the_value_goes_to(
        self, name: str, value: str, told: str, files: Path
    ) -> None:
        scenario = files / "slide.toml"
        scenario.write_text(scenario.read_text().replace("v = 1.0", 'v = "1 m/s"'))
        for given in ({"parameters": {name: [value]}}, {"table": {name: [value]}}):
            with pytest.raises(CaromError) as caught:
                carom.Study.of(scenario, **given)
            assert f"parameters.{name}: {told}" in str(caught.value)

    @pytest.mark.parametrize(
        ("key", "told"),
        [
            ("v", 'expected a quantity like "1 m/s", found "1 kg"'),
            ("step", 'expected a time, found "1 kg"'),
            ("cue.velocity.y", 'expected a speed, found "1 kg"'),
            ("ball/bed.friction", 'found "1 kg"'),
        ],
    )
    def test_units_fit_where_set_passes_a_value_on(self, key: str, told: str, files: Path) -> None:
        scenario = files / "slide.toml"
        scenario.write_text(scenario.read_text().replace("v = 1.0", 'v = "1 m/s"'))
        with pytest.raises(CaromError) as caught:
            carom.Study.of(scenario, {"w": ["1 kg"]}, set={key: "= w"})
        assert "parameters.w: " in str(caught.value)
        assert told in str(caught.value)

    def test_units_are_free_where_set_computes_with_the_values(self, files: Path) -> None:
        study = carom.Study.of(
            files / "slide.toml", {"mass": ["2 m"], "t": ["1 s"]}, set={"cue.velocity.y": "= mass/t"}
        )
        assert study.targeting.scene(0).spheres[0].velocity == pytest.approx([1.0, 2.0, 0.0])


class TestPlaces:
    """Messages name the file of what they complain about."""

    @pytest.mark.parametrize(
        ("line", "told"),
        [
            ("mu = 0.2", r"run.mu: unknown key; it is a parameter of .*slide.toml: write it below \[set\]"),
            ("unti = 0.2", "run.unti: unknown key; did you mean until"),
            ("until = -1", "run.until: must be positive, found -1"),
        ],
    )
    def test_a_wrong_key_of_run_is_named_with_the_file_of_the_study(
        self, line: str, told: str, files: Path
    ) -> None:
        study = files / "study.toml"
        study.write_text(STUDY.replace("[design]", f"[run]\n{line}\n[design]"))
        with pytest.raises(CaromError, match=rf"^{re.escape(str(study))}:\d+: {told}"):
            carom.Study.from_toml(study)

    def test_a_case_that_is_refused_names_the_scenario_or_the_parameter(self, files: Path) -> None:
        study = carom.Study.of(files / "slide.toml", {"mu": [-1.0, 0.2], "step": [1e-3, -1e-3]}, check=False)
        with pytest.raises(CaromError, match=r"slide.toml:20: contact .* friction"):
            study.targeting.scene(0)
        with pytest.raises(CaromError, match=r"^parameters of the study: step: must be positive"):
            study.targeting.scene(3)

    def test_meshes_lie_beside_the_scenario_wherever_a_study_is_run(self, files: Path) -> None:
        (files / "floor.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n")
        bed = SCENARIO[SCENARIO.index("[[plane]]") :]
        mesh = '[[mesh]]\nname = "bed"\nmaterial = "ball"\nfile = "floor.obj"\n'
        (files / "slide.toml").write_text(SCENARIO.replace(bed, mesh))
        assert carom.Study.of(files / "slide.toml", {"mu": [0.1, 0.2]}).targeting.scene(1).wall_names == [
            "bed"
        ]

    def test_all_cases_have_the_mesh_as_it_was_read(self, files: Path) -> None:
        """Also in a worker; and rows with another mesh are other rows."""
        floor, bed = files / "floor.obj", SCENARIO[SCENARIO.index("[[plane]]") :]
        floor.write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n")
        mesh = '[[mesh]]\nname = "bed"\nmaterial = "ball"\nfile = "floor.obj"\n'
        (files / "slide.toml").write_text(SCENARIO.replace(bed, mesh))

        def study() -> carom.Study:
            return carom.Study.of(files / "slide.toml", {"mu": [0.1, 0.2]}, check=False)

        first, same = study(), study()
        assert first.ids == same.ids
        floor.write_text("v -1 -1 -2\nv 1 -1 -2\nv 0 1 -2\nf 1 2 3\n")
        for read in (first, pickle.loads(pickle.dumps(first))):
            for case in range(2):
                vertices = read.targeting.scene(case).to_model()["meshes"][0]["vertices"]
                assert np.all(vertices[:, 2] == 0)
        assert not set(study().ids) & set(first.ids)
