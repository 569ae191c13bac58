"""Measurements of fits: files and units, and every mistake with its place and cure before anything runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import pytest
from carom import Calibration, CaromError
from test_fit import COLLISION, end, extras, fitted, free

__all__ = ["extras", "free"]


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

    @pytest.mark.parametrize(
        ("heading", "unit", "size"), [("x (cm),s", None, 1e-2), ("x,s", "cm", 1e-2), ("x (cm),s", "mm", 1e-3)]
    )
    def test_uncertainties_without_a_unit_have_that_of_their_column(
        self, heading: str, unit: str | None, size: float, free: Path
    ) -> None:
        (free.parent / "a.csv").write_text(f"t,{heading}\n0.01,1,0.1\n0.02,2,0.3\n")
        target = {"file": "a.csv", "columns": {"x": "cue.position.x"}, "uncertainty": "s"}
        more = {} if unit is None else {"unit": unit}
        [read] = Calibration.of(free, V, [target | more], folder=free.parent).targets
        assert read.value == pytest.approx((1e-2, 2e-2))
        assert read.uncertainty == pytest.approx((0.1 * size, 0.3 * size))

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
    "unknown measure": (V, [{**end(1, 1), "quantity": "energy"}], {}, r"without .*\); did you mean energy_final\?$"),
    "unknown ball": (V, [{**CURVE, "quantity": "que.position.x"}], {}, "no ball is called 'que'; did you mean cue"),
    "wrong unit": (V, [{**end(0.02, 1e-4), "value": "20 ms"}], {}, r'1\.value: expected a length, found "20 ms", a time'),
    "no number": (V, [{**end(0.02, 1e-4), "value": "x mm"}], {}, r"target 1\.value: .*NUMBER UNIT"),
    "lengths differ": (V, [{**CURVE, "time": [0.0]}], {}, "2 values need time"),
    "times twice": (V, [{**CURVE, "time": [0.01, 0.01]}], {}, "each once"),
    "empty": (V, [{**CURVE, "value": []}], {}, "the list is empty"),
    "unknown search": (V, [end(0.02, 1e-4)], {"search": "newton"}, r"search\.kind: no search is called 'newton'"),
    "points": (V, [end(0.02, 1e-4)], {"points": 0}, r"search\.points: expected a whole number from 1"),
    "too few points": (V, [end(0.02, 1e-4)], {"points": 3, "starts": 4}, "least_squares begins with 4 points"),
    "starts of another search": (V, [end(0.02, 1e-4)], {"search": "differential_evolution", "starts": 2}, "has no starts"),
    "start of seeds": ({**V, "s": {"seeds": 2, "start": 1}}, [end(0.02, 1e-4)], {}, "seeds stands alone, found start too"),
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


@pytest.mark.parametrize(
    ("parameters", "set_", "words"),
    [
        ({"q": (0.5, 2.0)}, {"ball/ball.restitution": "= q"}, "high = 2 is impossible: ball/ball.restitution must be at"),
        ({"q": (-0.3, 0.3)}, {"ball/ball.friction": "= q"}, "low = -0.3 is impossible: ball/ball.friction must be zero"),
        ({"a.mass": (-1.0, 1.0)}, {}, "low = -1 is impossible: a.mass must be positive, found -1"),
        ({"q": (0.0, 1.0)}, {"a.radius": "= q*0.03"}, "low = 0 is impossible: a.radius must be positive"),
    ],
)  # fmt: skip
def test_bounds_of_numbers_of_balls_and_laws_are_looked_at_before_any_run(
    parameters: dict[str, Any], set_: dict[str, str], words: str
) -> None:
    targets = [{"quantity": "b.velocity.x", "value": 0.5, "uncertainty": 0.01}] * 2
    with pytest.raises(CaromError, match=words):
        Calibration.of(COLLISION, parameters, targets, set=set_)
    Calibration.of(
        COLLISION, {"q": (0.5, 1.5), "p": (0.1, 0.9)}, targets, set={"ball/ball.restitution": "= p*q"}
    )


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
        ("time,x (s)\n0,1\n1,2\n", 'expected a unit of a length, found "s", a time'),
    ],
)
def test_a_wrong_file_is_named(text: str, words: str, free: Path) -> None:
    (free.parent / "a.csv").write_text(text)
    with pytest.raises(CaromError, match=words):
        Calibration.of(free, V, [{"file": "a.csv", "ball": "cue", "uncertainty": 1.0}], folder=free.parent)


OF_FILE = {"file": "a.csv", "columns": {"x": "cue.position.x"}, "uncertainty": 1.0}
NUMBER = {"quantity": "cue.position.x", "value": 0.02, "uncertainty": 1e-4}


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ({**OF_FILE, "quantity": "x"}, "quantity does nothing beside file; name it in columns"),
        ({**OF_FILE, "value": 3.0}, "value does nothing beside file; leave it out"),
        ({**OF_FILE, "ball": "nobody"}, "ball does nothing beside columns"),
        ({**OF_FILE, "time": [0.0, 0.01]}, r"time: expected the name of a column, found \[0.0, 0.01\]"),
        ({**OF_FILE, "unit": "mm"}, "unit does nothing: headings have the units of 1 column in .*a.csv"),
        ({**OF_FILE, "time": "t", "time_unit": "s"}, "time_unit does nothing: headings have"),
        ({**OF_FILE, "time": "x"}, 'column "x" is measured, and is its own time'),
        ({**OF_FILE, "uncertainty": "x"}, 'column "x" is measured, and is its own uncertainty'),
        ({**OF_FILE, "columns": {"x": 3}}, "needs to be told what its columns are"),
        ({**NUMBER, "ball": "cue"}, 'ball does nothing without file; write quantity = "BALL.position.x"'),
        ({**NUMBER, "columns": {"x": "cue.position.x"}}, "columns does nothing without file"),
        ({**NUMBER, "unit": "mm"}, 'unit does nothing without file; write the unit with the value'),
        ({**NUMBER, "time_unit": "ms"}, "time_unit does nothing without file"),
        ({**NUMBER, "time": [0.0, 0.01]}, r"1 value needs time = \[...\] with as many times"),
        ({**NUMBER, "quantity": "time", "time": 0.01}, "time is a number of the whole run, no curve; leave time out"),
        ("x", 'target 1: expected a table, found "x"'),
        ({**NUMBER, 1: 2}, "unknown key 1"),
    ],
)  # fmt: skip
def test_a_key_that_would_do_nothing_is_refused(target: Any, words: str, free: Path) -> None:
    (free.parent / "a.csv").write_text("t (s),x (m)\n0,0\n0.01,0.0105\n0.02,0.021\n")
    with pytest.raises(CaromError, match=words):
        Calibration.of(free, V, [target], folder=free.parent)


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
        (lambda result: 3, CURVE, "measure: it returned 3; return numbers and curves by name"),
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


def test_a_rounded_time_is_that_of_the_end(free: Path) -> None:
    """As the last frame of a video, 1/30 s in six digits; what is later is told with its digits."""
    target = {
        "quantity": "cue.position.x",
        "time": [0.01, 0.0200001],
        "value": [0.01, 0.02],
        "uncertainty": 1e-4,
    }
    assert fitted(free, V, [target]).best["v"] == pytest.approx(1.0, abs=1e-4)
    with pytest.raises(CaromError, match=r"a time of 0\.020001 s is after the end of the run at 0\.02 s"):
        Calibration.of(free, V, [target | {"time": [0.01, 0.020001]}])


def test_an_end_that_is_a_parameter_decides_run_by_run(free: Path) -> None:
    """Times up to 0.02 s: shorter runs count as bad; of 0.03 s no run has them."""
    parameters = {"run.until": {"low": 0.01, "high": 0.025, "start": 0.0225}}
    found = fitted(free, parameters, [{**CURVE, "value": [0.0, 0.02]}, end(0.0205, 1e-4)], step=1e-5)
    assert found.best["run.until"] == pytest.approx(0.0205, abs=1e-3)
    with pytest.raises(
        CaromError, match=r"the run ends .* before the last time of the target; raise run\.until"
    ):
        fitted(free, parameters, [{**CURVE, "time": [0.0, 0.03]}], "late")
