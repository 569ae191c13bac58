"""Figures of a study: what is drawn unless something else is asked for, and the numbers beside it."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from types import SimpleNamespace

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


@pytest.fixture(autouse=True)
def extras() -> None:
    for name in ("pyarrow", "scipy"):
        pytest.importorskip(name, reason="the extra [cluster] is not installed")
    pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")


def test_the_numbers_beside_the_figures_have_units_and_those_below_panels_stand_apart(files: Path) -> None:
    pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
    from carom.many.sweep.plot import histograms, places, responses
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


def test_the_command_says_what_failed_and_draws(files: Path) -> None:
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
    taken = CliRunner().invoke(app, [*arguments, "--csv", str(files / "table.csv")])
    assert taken.exit_code == 2
    assert "table.csv exists already; give --force" in taken.stderr
    assert (facts["new"], facts["done"], facts["failed"], facts["missing"]) == (0, 8, 8, 0)
    assert facts["files"][0] == str(files / "table.csv")
    assert len((files / "table.csv").read_text().splitlines()) == 17
    assert json.loads((files / "out" / "sweep.json").read_text())["failures"] == facts["failures"]
    with open(files / "out" / "plots" / "histograms.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert sum(float(r["cue.position.y: cases"]) for r in rows if r["cue.position.y: cases"] != "nan") == 8


def test_labels_of_long_names_keep_to_their_panels(files: Path) -> None:
    from carom.many.sweep.plot import histograms, responses
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    text, name = (files / "slide.toml").read_text(), "the ball that slides until it meets the other one"
    (files / "long.toml").write_text(text.replace('name = "cue"', f'name = "{name}"'))
    found = carom.sweep(carom.Study.of(files / "long.toml", {"v": [0.0, 0.5, 1.0]}), files / "out", workers=0)
    columns = [f"{name}.{kind}.x" for kind in ("position", "velocity")]
    for chart, across in ((responses(found, columns), 1), (histograms(found, columns), 0)):
        canvas = FigureCanvasAgg(chart.figure)
        canvas.draw()
        labels = [(axis.xaxis, axis.yaxis)[across].label for axis in chart.figure.axes]
        (a, b), size = (
            (label.get_window_extent(canvas.get_renderer()) for label in labels),
            canvas.get_width_height(),
        )
        assert not a.overlaps(b)
        for box in (a, b):
            assert box.x0 >= 0 <= box.y0
            assert box.x1 <= size[0]
            assert box.y1 <= size[1]


def test_places_are_left_out_where_nothing_moves_in_the_plane(files: Path) -> None:
    text = (files / "slide.toml").read_text()
    (files / "still.toml").write_text(text.replace("v = 1.0", "v = 0.0"))
    found = carom.sweep(carom.Study.of(files / "still.toml", {"mu": [0.1, 0.2]}), files / "out", workers=0)
    assert {file.stem for file in found.plot()} == {"histograms", "responses"}


def test_what_a_parameter_explains_is_its_share_of_the_variance() -> None:
    from carom.many.sweep.plot import explained

    a, b, c = (values.ravel() for values in np.meshgrid(*[np.arange(5.0)] * 3))
    assert [explained(x, a + 2 * b) for x in (a, b, c)] == pytest.approx([1 / 5, 4 / 5, 0])
    assert explained(a, a * 0) == 0.0
    # Of a range, bands: each holds what varies within a fifteenth of it, and no more.
    fine = np.linspace(0, 1, 3000)
    assert explained(fine, fine) == pytest.approx(1 - 1 / 15**2, rel=1e-3)
    assert explained(fine, np.append(fine[1:], np.nan)) == pytest.approx(1 - 1 / 15**2, rel=1e-3)


def test_columns_that_the_parameters_tell_of_come_first(files: Path) -> None:
    """Final energy and places once stood first, in the order of the table, whatever had happened."""
    from carom.many.sweep.plot import chosen_columns, responses

    along_y = (
        STUDY.replace("cue.velocity.x", "cue.velocity.w")
        .replace("velocity.y", "velocity.x")
        .replace("velocity.w", "velocity.y")
    )
    (files / "study.toml").write_text(along_y.replace("count = 16", "count = 64"))
    found = carom.sweep(files / "study.toml", files / "out", workers=0)
    # Velocities repeat the places, the post stays, nothing leaves the bed: of twelve columns two are left. The speed
    # tells all of the way along y; what it and the aim do together to the way along x is told by neither.
    assert chosen_columns(found, ()) == ["cue.position.y", "cue.position.x", "energy_final"]
    numbers = responses(found).data
    share = {name: numbers[f"cue.position.x: explained by {name}"][0] for name in ("speed", "aim")}
    assert share["aim"] > 0.8
    assert share["speed"] < 0.3
    # A measure of one's own comes before all of it.
    study = carom.Study.of(
        files / "slide.toml", {"v": (0.5, 1.5)}, design="lhs", count=32,
        measure=lambda result: {"way": float(result["cue"].position[-1, 0])},
    )  # fmt: skip
    assert chosen_columns(carom.sweep(study, files / "own", workers=0), ())[0] == "way"


def test_figures_of_a_study_whose_cases_all_failed(files: Path) -> None:
    def fails(result: carom.Result) -> dict[str, float]:
        raise ValueError("nothing to measure")

    study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0]}, measure=fails)
    found = carom.sweep(study, files / "out", workers=0)
    assert len(found.failures) == 2
    with pytest.raises(CaromError, match=r"no case reached its end.*sweep.failures says why"):
        found.plot()


def test_every_column_of_places_has_its_numbers_below(files: Path) -> None:
    """The second of three balls has nothing below it; its panel had ticks alone."""
    pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
    from carom.cli.examples import find
    from carom.many.sweep.plot import places

    study = carom.Study.of(find("three_balls"), {"first.velocity.x": [1.0, 2.0]})
    axes = places(carom.sweep(study, files / "three", workers=0)).figure.axes
    assert [axis.get_xlabel() for axis in axes[:3]] == ["", "$x$ (m)", "$x$ (m)"]
    assert [axis.xaxis.get_tick_params()["labelbottom"] for axis in axes[:3]] == [False, True, True]


def test_labels_of_fits_have_units() -> None:
    from carom.many.fit.plot import _label

    assert _label("cue.position.x") == "cue\nposition.x (m)"
    assert _label("b.angular_velocity.z") == "b\nangular_velocity.z (rad/s)"
    assert _label("share") == "share"


@pytest.mark.parametrize(("spread", "scale"), [(1e-12, "linear"), (1e3, "log")])
def test_ticks_of_a_search_tell_apart_what_they_are_at(spread: float, scale: str) -> None:
    """Of chi squared that hardly changed all ticks read 4.59184 x 10^-2, and points were counted in halves."""
    from carom.many.fit.plot import path

    calibration = SimpleNamespace(
        study=SimpleNamespace(title="t"),
        names=["mu"],
        values=lambda shares: shares,
        axes=[SimpleNamespace(at=lambda share: share, log=False)],
    )
    chi2 = 0.0459183 * (1 + spread * np.array([1.0, 0.4, 0.0, 0.0, 0.0]))
    points = SimpleNamespace(
        calibration=calibration, shares=np.linspace(0, 1, 5)[:, np.newaxis], good=np.full(5, True), chi2=chi2
    )
    figure = path(points).figure  # type: ignore[arg-type]
    figure.draw_without_rendering()
    above, below = figure.axes
    assert above.get_yscale() == scale
    texts = [text.get_text() for text in above.get_yticklabels() if text.get_text()]
    assert len(texts) > 1
    assert len(set(texts)) == len(texts)
    assert not above.yaxis.get_offset_text().get_text()
    assert all(float(x).is_integer() for x in below.get_xticks())
