"""The figures: what they show, that the numbers beside them are those of the run, that they repeat byte for byte."""

from __future__ import annotations

import csv
import sys
import warnings
from pathlib import Path

import carom
import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")

from carom import CaromError
from carom.cli.examples import find
from carom.show.plot import KINDS
from carom.show.plot.solver import hardest_step, quadratic
from carom.show.plot.style import COLOURS

sys.path.insert(0, str(Path(__file__).parent))
import fake_sim


@pytest.fixture(scope="module")
def result() -> carom.Result:
    """The break, until shortly after the impact."""
    scene = carom.Scene.from_toml(find("5.6_break"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return carom.simulate(scene, until=0.2)


def numbers(path: Path) -> dict[str, list[str]]:
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return {name: [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}


def test_every_kind_is_written_with_its_numbers(result: carom.Result, tmp_path: Path) -> None:
    files = result.plot.save(tmp_path)
    assert [f.name for f in files] == [f"{k.replace('-', '_')}.{e}" for k in KINDS for e in ("png", "csv")]
    for file in files:
        if file.suffix == ".csv":
            columns = numbers(file)
            assert all(columns.values()), file
            continue
        from matplotlib.image import imread

        pixels = imread(file)
        assert pixels[..., :3].std() > 0.02, f"{file} shows nothing"


def test_figures_for_print_repeat_byte_for_byte(result: carom.Result, tmp_path: Path) -> None:
    formats = ("png", "svg", "pdf")
    first = result.plot.save(tmp_path / "a", ["heights"], formats=formats)
    second = result.plot.save(tmp_path / "b", ["heights"], formats=formats)
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name
    svg = (tmp_path / "a" / "heights.svg").read_text()
    assert "ball5" in svg  # text stays text
    assert b"/Type3" not in (tmp_path / "a" / "heights.pdf").read_bytes()


def test_the_numbers_beside_a_figure_are_those_of_the_run(result: carom.Result, tmp_path: Path) -> None:
    result.plot.save(tmp_path, ["velocities", "heights", "energies", "iterations"])
    found = numbers(tmp_path / "velocities.csv")
    assert list(found)[:3] == ["time (s)", "ball2 v_x (m/s)", "ball3 v_x (m/s)"]
    for i, name in enumerate(result.names):
        for k, letter in enumerate("xyz"):
            column = np.array(found[f"{name} v_{letter} (m/s)"], dtype=float)
            assert np.array_equal(column, np.asarray(result.velocity)[:, i, k])
    heights = np.array(numbers(tmp_path / "heights.csv")["ball2 height (mm)"], dtype=float)
    assert heights[0] == pytest.approx(0.0, abs=1e-9)
    energies = {name: np.array(values, float) for name, values in numbers(tmp_path / "energies.csv").items()}
    assert np.array_equal(energies["total (J)"][1:], result.energy.total)
    assert (energies["time (s)"][0], energies["kinetic (J)"][0]) == (0.0, result.kinetic_energy[0].sum())
    assert energies["total (J)"][0] == pytest.approx(result.summary["energy"]["initial"], rel=1e-15)
    steps = numbers(tmp_path / "iterations.csv")
    assert [int(n) for n in steps["iterations_position"]] == np.asarray(
        result.steps["iterations_position"]
    ).tolist()


def test_the_energy_before_the_first_step_is_that_of_what_moves_then() -> None:
    """Also of a free wall, with what is gone after the first step; of a restored state the record begins there."""
    scene = carom.Scene("hit", run={"until": 0.004, "step": 1e-3}, gravity=(0, 0, 0))
    scene.contact("g", "g", friction=0.0, restitution=0.0)
    wall = {"mass": 0.1, "velocity": 1.0}
    scene.plane("lid", point=(0, 0, 0.5), normal=(0, 0, -1), material="g", free=wall)
    scene.sphere("a", radius=0.01, mass=0.1, position=(0, 0, 0), velocity=(2, 0, 0), material="g")
    scene.sphere("b", radius=0.01, mass=0.1, position=(0.02, 0, 0), material="g")
    sim = carom.Simulation(scene, step=1e-3)
    sim.step(4)
    data = sim.result().plot.chart("energies").data
    assert data["kinetic (J)"].tolist() == pytest.approx([0.25, 0.15, 0.15, 0.15, 0.15], abs=1e-15)
    assert data["potential (J)"].tolist() == pytest.approx([0.0] * 5, abs=1e-15)
    sim.restore(sim.state())
    sim.step(2)
    data = sim.result().plot.chart("energies").data
    assert data["time (s)"].tolist() == pytest.approx([0.004, 0.005, 0.006])
    assert data["total (J)"].tolist() == pytest.approx([0.15] * 3, abs=1e-15)


def test_axes_have_labels_and_units(result: carom.Result) -> None:
    for kind in KINDS:
        axes = result.plot.chart(kind).figure.axes
        label = axes[-1].get_xlabel()
        assert label in ("time (s)", "Newton iteration", "$x$ (m)") or label.endswith("normal impulses (N s)")
        # Rows are named by the pairs of bodies instead.
        assert all(axis.get_ylabel() or axis.get_yticklabels()[0].get_text() for axis in axes)
    assert [a.get_ylabel() for a in result.plot.velocities().axes] == [f"$v_{k}$ (m/s)" for k in "xyz"]
    assert result.plot.heights().axes[0].get_ylabel() == "height (mm)"
    [legend] = result.plot.velocities().legends
    assert [text.get_text() for text in legend.get_texts()] == result.names
    assert len(set(COLOURS)) == len(COLOURS)


def test_chosen_bodies_only(result: carom.Result) -> None:
    figure = result.plot.angular_velocities(bodies=["ball4"])
    assert [line.get_label() for line in figure.axes[0].lines] == ["ball4"]
    assert np.array_equal(figure.axes[1].lines[0].get_ydata(), result["ball4"].angular_velocity[:, 1])


def test_the_residuals_are_those_of_the_impact(result: carom.Result) -> None:
    step = hardest_step(result)
    assert step == int(result.impacts.between("ball2", "ball3")["step"][0]) == 115
    figure = result.plot.residuals()
    assert f"step {step}" in figure.axes[0].get_title(loc="left")
    chart = result.plot.chart("residuals", step=step)
    drawn = np.concatenate(result.residuals.history(step))
    assert np.array_equal(chart.data["residual (1)"], drawn)
    assert set(chart.data["level"]) <= {"position", "velocity"}
    with pytest.raises(CaromError, match="no residuals were recorded for step 7000"):
        result.plot.residuals(7000)


def test_the_reference_predicts_the_last_iterate_of_a_quadratic_sequence() -> None:
    history = np.array([0.3, 0.5, 1e-2, 2e-4, 8e-8])  # r_{k+1} = 2 r_k^2 at the end
    found = quadratic(history)
    assert found is not None
    start, values = found
    assert start == 2
    assert values == pytest.approx(history[2:])
    assert quadratic(history[:2]) is None
    assert quadratic(np.array([1.0, 2.0, 3.0])) is None


def test_many_bodies_are_a_band_and_few_numbers(tmp_path: Path) -> None:
    result = carom.simulate(fake_sim.hopping(*(f"b{i}" for i in range(30))), until=0.5, every=10)
    chart = result.plot.chart("velocities")
    assert list(chart.data)[1:4] == ["5 % v_x (m/s)", "median v_x (m/s)", "95 % v_x (m/s)"]
    assert len(chart.figure.axes[0].lines) == 3
    velocity = np.asarray(result.velocity)[:, :, 0]
    assert np.array_equal(chart.data["least v_x (m/s)"], velocity.min(axis=1))
    assert np.array_equal(chart.data["greatest v_x (m/s)"], velocity.max(axis=1))
    assert np.array_equal(
        chart.data["median v_z (m/s)"], np.median(np.asarray(result.velocity)[:, :, 2], axis=1)
    )


def test_what_a_run_lacks_is_left_out_and_said_if_asked_for(tmp_path: Path) -> None:
    scene = carom.Scene("free fall", run={"until": 0.1})
    scene.sphere("only", radius=0.1, mass=1.0, material="stone", position=(0, 0, 1))
    result = carom.simulate(scene)
    made = {f.stem for f in result.plot.save(tmp_path, formats=["svg"])}
    assert made == {"velocities", "angular_velocities", "heights", "trajectories", "energies", "iterations"}
    assert result.plot.heights().axes[0].get_ylabel() == "height of the centre (m)"
    for kind, told in (
        ("phases", "the run holds no contacts"),
        ("impacts", "the run holds no impacts"),
        ("residuals", "no step needed a solve"),
    ):
        with pytest.raises(CaromError, match=told):
            result.plot.chart(kind)


def test_paths_from_above_between_the_cushions(result: carom.Result) -> None:
    chart = result.plot.chart("trajectories")
    assert np.array_equal(chart.data["ball2 x (m)"], np.asarray(result.position)[:, 0, 0])
    [axes] = chart.figure.axes
    assert axes.get_aspect() == 1.0
    cushions = [line for line in axes.lines if len(line.get_xdata()) == 2 and line.get_linewidth() > 1.5]
    assert len(cushions) == 4
    low, high = axes.get_xlim()
    assert low < 0.0
    assert high > 2.54
    radii = {patch.get_radius() for patch in axes.patches}
    assert radii == {0.028575}


def test_walls_with_ends_are_drawn_where_they_are_at_the_end() -> None:
    # Rectangles for cushions: paths once turned back at nothing.
    table = carom.billiards.table("9ft")
    scene = table.scene(until=0.4, step=1e-3)
    scene.billiard_table = None  # or it would be drawn as a table
    carom.billiards.strike(table.cue_ball(scene), ball_speed=8.0)
    axes = carom.simulate(scene).plot.chart("trajectories").figure.axes[0]
    drawn = [c.get_segments() for c in axes.collections]
    assert len(drawn) == len(scene.wall_names) - 1  # all but the bed
    corners = np.concatenate([np.concatenate(segments) for segments in drawn])
    assert any(np.allclose(c, (0.0, table.spec.corner_mouth / np.sqrt(2))) for c in corners)
    left, right = axes.get_xlim()
    assert left < 0.0 < table.spec.length < right

    drum = carom.Scene("drum", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    drum.contact("m", "m", friction=0.1, restitution=0.0)
    drum.cylinder(
        "tube",
        point=(0, 0, 0),
        axis=(0, 0, 1),
        radius=0.1,
        length=1.0,
        material="m",
        motion={"translation": [{"expression": "0.5*t"}, 0.0, 0.0]},
    )
    drum.sphere("ball", radius=0.02, density=1000, position=(0, 0, 0), material="m")
    (tube,) = carom.simulate(drum).plot.chart("trajectories").figure.axes[0].collections
    rim = np.concatenate(tube.get_segments())
    assert np.linalg.norm(rim - (0.05, 0.0), axis=1) == pytest.approx(0.1)


def test_strips_are_the_statuses_of_the_contacts(result: carom.Result) -> None:
    """Every frame of every contact lies in a strip of its status, and no strip reaches beyond its contact."""
    data = result.plot.chart("phases").data
    rows = result.contacts.between("ball2", "bed")
    mine = data["pair"] == "ball2 - bed"
    begin, end, status = (data[key][mine] for key in ("from (s)", "to (s)", "status"))
    names = np.array(["open", "stick", "slip"])[np.asarray(rows["status"])]
    for time, name in zip(np.asarray(rows["time"]), names, strict=True):
        assert status[(begin < time - 1e-12) & (time <= end + 1e-12)].tolist() == [name]
    assert np.sum(end - begin) == pytest.approx(len(rows) * 1e-3)
    # The cue ball slides on the bed, and the balls of the rack rest on it until they are hit.
    rest = (data["pair"] == "ball3 - bed") & (data["to (s)"] < 0.115)
    assert set(status) == {"slip"}
    assert set(data["status"][rest]) == {"stick"}


def test_strips_go_to_the_end_of_the_axis_where_a_run_was_cut_short_between_frames() -> None:
    """A ball that rolls on to the end: the state alone has no contacts, and shows no gap."""
    sim = carom.Simulation(carom.example("slide_to_roll"), every=50)
    sim.step(590)
    whole = carom.simulate(carom.example("slide_to_roll"), every=50, until=0.59)
    for result, end in ((sim.result(), 0.55), (whole, 0.59)):
        chart = result.plot.chart("phases")
        assert chart.figure.axes[0].get_xlim() == pytest.approx((0.0, end))
        assert chart.data["to (s)"].max() == pytest.approx(end)


def test_the_impact_sequence_of_the_break(result: carom.Result) -> None:
    chart = result.plot.chart("impacts")
    data = chart.data
    assert "t = 0.115 s" in chart.figure.axes[0].get_title(loc="left")  # not broken across lines
    first = data["problem"] == 1
    strongest = data["pair"][first][np.argmax(data["normal impulse (N s)"][first])]
    assert strongest == "ball2 - ball3"
    hits = result.impacts.between("ball2", "ball3")
    impulse = np.sum(np.asarray(hits["impulse"]) * np.asarray(hits["normal"]), axis=1)
    assert np.array_equal(data["normal impulse (N s)"][data["pair"] == "ball2 - ball3"], impulse)
    with pytest.raises(CaromError, match="there was no impact in step 3; the busiest step is 115"):
        result.plot.impacts(3)


def test_a_figure_for_one_column_is_that_wide_and_nothing_is_cut(
    result: carom.Result, tmp_path: Path
) -> None:
    from carom.show.plot.style import column_width
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    for kind in KINDS:
        with column_width("single"):
            figure = result.plot.chart(kind).figure
        assert figure.get_figwidth() == 3.4
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        page = figure.bbox
        for axes in figure.axes:
            title = axes.title if axes.title.get_text() else axes._left_title
            box = title.get_window_extent(canvas.get_renderer())
            assert box.x1 <= page.x1 + 1, kind
    assert len(result.plot.save(tmp_path, ["energies"], width="single")) == 2
    with pytest.raises(CaromError, match="no width is called 'wide'"):
        result.plot.save(tmp_path, width="wide")


def test_balls_that_left_leave_the_figures_and_the_others_stay(tmp_path: Path) -> None:
    """One ball through an outlet once ended the heights of all, and its velocity 0 counted in median and band."""
    scene = carom.Scene("fall", run={"until": 0.3, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for k in range(10):
        scene.sphere(
            f"b{k}", radius=0.01, mass=0.01, material="m", at=(0.1 * k, 0, 0.01), velocity=(0, 0.5, 0)
        )
    scene.outlet(low=(-0.05, 0.05, -1), high=(0.05, 9, 1))
    result = carom.simulate(scene)
    assert result.present[0].all()
    assert np.asarray(result.present[-1]).sum() == 9
    heights = result.plot.chart("heights").data
    assert heights["median height (mm)"] == pytest.approx(0.0, abs=1e-6)
    speeds = result.plot.chart("velocities").data
    assert speeds["least v_y (m/s)"][-1] == np.asarray(result.velocity)[-1, 1:, 1].min() > 0
    one = result.plot.chart("velocities", bodies=["b0"]).data["b0 v_y (m/s)"]
    assert np.array_equal(np.isfinite(one), result.present[:, 0])
    assert len(result.plot.save(tmp_path, ["trajectories"])) == 2


def test_heights_above_a_floor_that_moves_are_above_where_it_is() -> None:
    scene = carom.Scene("lift", run={"until": 0.2, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.1, restitution=0.0)
    scene.plane(
        "plate", point=(0, 0, 0), normal=(0, 0, 1), material="m", motion={"translation": [0, 0, {"expression": "0.3*t"}]}
    )  # fmt: skip
    scene.sphere("b", radius=0.01, mass=0.01, material="m", at=(0, 0, 0.01), velocity=(0, 0, 0.3))
    result = carom.simulate(scene)
    assert result.position[-1, 0, 2] == pytest.approx(0.07, abs=1e-6)
    assert result.plot.chart("heights").data["b height (mm)"] == pytest.approx(0.0, abs=1e-4)


def test_of_a_crowd_the_balls_at_the_end_are_drawn_from_the_lowest_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from carom.show.plot import table

    scene = carom.Scene("stack", gravity=(0, -9.8, 0), run={"until": 0.01})
    scene.contact("m", "m", friction=0.1, restitution=0.0)
    for k, (x, y) in enumerate(((0.0, 0.5), (0.1, 0.1), (0.2, 0.3))):
        scene.sphere(f"b{k}", radius=0.01, density=1000, at=(x, y, 0.0), material="m")
    monkeypatch.setattr(table, "CROWD", 2)
    [axes] = table.trajectories(carom.simulate(scene)).figure.axes
    [heap] = axes.collections
    assert not axes.lines
    # Where y is up, z points right and x up on the sheet.
    assert heap.get_offsets()[:, 1].tolist() == pytest.approx([0.1, 0.2, 0.0])


@pytest.mark.parametrize(
    "gravity", [(0, 0, -9.8), (0, 0, 9.8), (0, -9.8, 0), (0, 9.8, 0), (-9.8, 0, 0), (9.8, 0, 0)]
)
def test_what_turns_left_seen_from_above_turns_left_on_the_sheet(gravity: tuple[float, ...]) -> None:
    """With y up, or with gravity along z, figures had been mirror images: seen from below."""
    up = -np.array(gravity) / 9.8
    along = np.roll(up, 1)
    left = np.cross(up, along)
    scene = carom.Scene("two", gravity=gravity, run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0.1, restitution=0.0)
    for name, place in (("first", along), ("second", left)):
        scene.sphere(name, radius=0.01, density=1000, at=place.tolist(), material="m")
    data = carom.simulate(scene).plot.chart("trajectories").data
    columns = [values for name, values in data.items() if name != "time (s)"]
    (ax, ay), (bx, by) = ((columns[k][0], columns[k + 1][0]) for k in (0, 2))
    assert ax * by - ay * bx == pytest.approx(1.0)


def test_of_many_bodies_the_spread_is_the_same_however_few_frames_fit_the_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Runs of very many bodies are read in blocks; all frames at once did not fit."""
    from carom.show.plot import motion

    scene = carom.Scene("many", run={"until": 0.05, "step": 1e-3})
    scene.contact("m", "m", friction=0.1, restitution=0.0)
    for k in range(12):
        scene.sphere(
            f"b{k}", radius=0.01, density=1000, at=(0.1 * k, 0, 0), velocity=(0, 0, 0.1 * k), material="m"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = carom.simulate(scene)
    whole = {kind: result.plot.chart(kind).data for kind in ("velocities", "heights")}
    assert whole["velocities"]["greatest v_z (m/s)"] == pytest.approx(
        1.1 - 9.8 * np.asarray(result.time), abs=1e-9
    )
    assert whole["heights"]["median height of the centre (mm)"][0] == 0.0
    monkeypatch.setattr(motion, "BLOCK", 100)  # two frames
    monkeypatch.setattr(motion, "MOST_FRAMES", 20)
    for kind, columns in whole.items():
        thin = result.plot.chart(kind).data
        assert len(thin["time (s)"]) == 18
        assert thin["time (s)"][-1] == result.time[-1]  # the last frame is always in
        for name, values in columns.items():
            np.testing.assert_array_equal(thin[name], values[[*range(0, 51, 3), 50]], name)


def test_a_notebook_shows_figures_as_pictures(result: carom.Result) -> None:
    """Where pyplot had not been imported it showed `<Figure size 770x572 with 3 Axes>`, as in the tutorial."""
    picture = result.plot.heights()._repr_png_()  # type: ignore[attr-defined]
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 2000


def test_balls_that_left_are_dotted_and_a_periodic_box_is_outlined(monkeypatch: pytest.MonkeyPatch) -> None:
    from carom.show.plot import table
    from matplotlib.collections import EllipseCollection, LineCollection

    scene = carom.Scene(gravity=(0, 0, -9.8), periodic=(0.3, 0.2, 0), run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.2)
    scene.sphere("leaves", radius=0.01, mass=0.1, material="m", position=(0.1, 0.1, 0.03))
    scene.sphere("stays", radius=0.01, mass=0.1, material="m", position=(0.2, 0.1, 0.5), velocity=(3, 0, 0))
    scene.outlet(low=(0, 0, -1), high=(0.3, 0.2, 0.0))
    result = carom.simulate(scene)
    axes = table.trajectories(result).figure.axes[0]
    assert [patch.get_linestyle() for patch in axes.patches] == ["solid", ":", "solid", "solid"]
    assert [patch.get_fill() for patch in axes.patches] == [False, False, False, True]
    [box] = [found for found in axes.collections if isinstance(found, LineCollection)]
    corners = np.unique(np.concatenate(box.get_segments()).round(12), axis=0)
    assert corners == pytest.approx(np.array([[0, 0], [0, 0.2], [0.3, 0], [0.3, 0.2]]))
    monkeypatch.setattr(table, "CROWD", 1)
    crowd = table.trajectories(result).figure.axes[0].collections
    [heap] = [found for found in crowd if isinstance(found, EllipseCollection)]
    assert [len(found) for found in (heap.get_facecolors(), heap.get_edgecolors())] == [2, 2]
    assert heap.get_facecolors()[:, 3].tolist() == [0.0, 1.0]  # the lowest, which left, is hollow
