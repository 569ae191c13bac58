"""Figures of runs with names that are hard to set, long impact sequences, and walls that are taken away."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import carom
import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")

from carom.cli.examples import find
from carom.many.sweep.plot import _title
from carom.show.plot import contact
from carom.show.plot.style import WIDTHS, column_width, paired
from carom.text import LONGEST, shortened

LONG = "a name that nobody would write but that a program may well have made, of ball number 17"


def drop(title: str, *names: str) -> carom.Result:
    scene = carom.Scene(title, gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.plane("_floor $\\x$", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    for k, name in enumerate(names):
        scene.sphere(name, radius=0.01, density=1000, at=(0.05 * k, 0, 0.02), material="m")
    return carom.simulate(scene)


@pytest.fixture(scope="module")
def broken() -> carom.Result:
    scene = carom.Scene.from_toml(find("5.6_break"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return carom.simulate(scene, until=0.2)


def test_dollars_in_names_and_titles_are_no_formulas(tmp_path: Path) -> None:
    """matplotlib read `$\\oops$` as one, and `carom plot` ended with its traceback."""
    result = drop("from 5 $ to $\\oops$, and $x_1$", "a $\\foo{$ b", "$", "$\\mu$")
    assert result.plot.save(tmp_path, formats=["svg"])
    drawn = (tmp_path / "velocities.svg").read_text()
    assert all(text in drawn for text in ("$\\oops$, and $x_1$", "a $\\foo{$ b", "$\\mu$"))
    assert "a $\\foo{$ b - _floor $\\x$" in (tmp_path / "phases.svg").read_text()


def test_names_that_begin_with_an_underscore_are_in_the_legend() -> None:
    """matplotlib leaves them out: a figure of two balls named one."""
    plot = drop("t", "_a", "b", "_").plot
    for figure in (plot.velocities(), plot.heights(), plot.trajectories()):
        [legend] = figure.legends
        assert [text.get_text() for text in legend.get_texts()] == ["_a", "b", "_"]


def test_long_names_are_shortened_in_labels_and_whole_in_the_numbers() -> None:
    assert shortened("x" * LONGEST) == "x" * LONGEST
    assert len(shortened(LONG)) <= LONGEST
    assert shortened(LONG).startswith("a name that")
    assert shortened(LONG).endswith("number 17")
    chart = drop("t", LONG).plot.chart("velocities")
    [legend] = chart.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [shortened(LONG)]
    assert f"{LONG} v_x (m/s)" in chart.data


@pytest.mark.parametrize("most", [10, 16, 18, LONGEST])
@pytest.mark.parametrize(
    "name", ["steel ball number {:02d} of the lot A of this year", "x" * 40 + "{}", "{} " + "y" * 40]
)
def test_names_that_are_cut_stay_apart(name: str, most: int) -> None:
    """All balls of a lot had one label in figures of contacts."""
    names = [name.format(k) for k in range(14)]
    labels = [shortened(one, most, names) for one in names]
    assert len(set(labels)) == 14
    assert max(map(len, labels)) <= most
    pairs = [paired(pair, names) for pair in pairwise(names)]
    assert len(set(pairs)) == 13
    lots = [f"{k} {'z' * 40} of the long and winding lot {'AB'[k % 2] * 12} {k}" for k in range(4)]
    assert len({shortened(one, most, lots) for one in lots}) == 4


@pytest.mark.parametrize("wide", WIDTHS)
def test_figures_grow_with_the_lines_of_titles_and_legends(wide: str) -> None:
    """`trajectories` had the title over the legend, and its lower labels were cut, with two lines or four entries."""
    plot = drop(f"{LONG}, {LONG}, and more", *(f"{LONG}{k}" for k in range(8))).plot
    for kind in plot.available():
        with column_width(wide):
            figure = plot.chart(kind).figure
        for _ in range(2):  # as when it is saved: boxes of equal aspect are placed by the first
            figure.draw_without_rendering()
        drawn, page = figure.get_tightbbox(), figure.get_size_inches()
        assert min(*drawn.min, *(page - drawn.max)) > -0.01, kind
        title = figure.axes[0]._left_title.get_window_extent()  # type: ignore[attr-defined]
        assert all(legend.get_window_extent().y0 >= title.y1 - 1 for legend in figure.legends), kind
        assert figure.axes[0].get_position().height * page[1] > 0.4, kind


def test_of_a_long_sequence_the_sums_of_its_problems_are_drawn(
    broken: carom.Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 38 and of 236 problems ticks and numbers lay over each other."""
    few = broken.plot.chart("impacts")
    assert len(few.figure.axes) == 1
    assert few.figure.axes[0].texts
    monkeypatch.setattr(contact, "DIGIT", 10.0)  # no room for any number
    many = broken.plot.chart("impacts")
    above, rows = many.figure.axes
    assert not rows.texts
    problem, impulse = (few.data[name] for name in ("problem", "normal impulse (N s)"))
    sums = [impulse[problem == k].sum() for k in np.unique(problem)]
    [dots] = above.lines
    assert np.asarray(dots.get_ydata()) == pytest.approx([s for s in sums if s > 0])
    for figure in (few.figure, many.figure):
        [legend] = figure.legends
        assert {text.get_text() for text in legend.get_texts()} == set(few.data["status"])


def fallen(method: str, until: float, step: float) -> carom.Result:
    """A light ball falls from 20 mm, a heavy one from 70 mm."""
    scene = carom.Scene("t", gravity=(0, 0, -9.8), run={"until": until, "step": step, "method": method})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    for name, mass, height in (("light", 0.1, 0.02), ("heavy", 1.0, 0.07)):
        scene.sphere(name, radius=0.01, mass=mass, at=(mass, 0, 0.01 + height), material="m")
    return carom.simulate(scene)


def test_impacts_one_after_the_other_have_a_place_each() -> None:
    """Those of one step of method events lay on one spot, their numbers over each other."""
    chart = fallen("events", 0.5, 0.5).plot.chart("impacts", step=1)
    time, size = chart.data["time (s)"], chart.data["normal impulse (N s)"]
    assert len(time) > 20
    assert (np.diff(time) > 0).all()
    above, rows = chart.figure.axes
    assert sorted(np.concatenate([c.get_offsets()[:, 0] for c in rows.collections])) == list(
        range(1, len(time) + 1)
    )
    felt = size > contact.NOTHING * size.max()
    assert above.lines[0].get_ydata() == pytest.approx(size[felt])
    assert f"{time[0]:.5g} to {time[-1]:.5g} s" in above.get_title(loc="left")


def test_of_steps_with_equally_many_problems_the_strongest_is_shown() -> None:
    result = fallen("nsga", 0.3, 1e-3)
    strongest = np.argmax(np.linalg.norm(np.asarray(result.impacts["impulse"]), axis=1))
    assert strongest > 0
    assert contact.busiest_step(result) == result.impacts["step"][strongest]
    # In one step of method events all bounces count, and one step with two is before one with a harder hit.
    bounces = fallen("events", 0.3, 0.02)
    steps, counts = np.unique(np.asarray(bounces.impacts["step"]), return_counts=True)
    assert contact.busiest_step(bounces) == steps[np.argmax(counts)]


def test_heights_show_no_rounding_and_name_what_they_are_of() -> None:
    """A ball that rests was drawn hopping by 1e-9 mm."""
    rest = carom.Scene("t", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    rest.contact("m", "m", friction=0.0, restitution=0.5)
    rest.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    rest.sphere("a", radius=0.01, mass=1.0, at=(0, 0, 0.01 + 3e-12), material="m")
    chart = carom.simulate(rest).plot.chart("heights")
    assert np.ptp(chart.figure.axes[0].get_ylim()) >= 1e-5 * (1 - 1e-9)
    assert list(chart.data) == ["time (s)", "a height (mm)"]
    free = carom.Scene("t", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    free.sphere("a", radius=0.01, mass=1.0, at=(0, 0, 0), material="m")
    assert list(carom.simulate(free).plot.chart("heights").data)[1] == "a height of the centre (mm)"


@pytest.mark.parametrize(
    "piece", [{}, {"radius": 0.1}, {"size": (0.2, 0.2)}], ids=["plane", "disc", "rectangle"]
)
def test_heights_above_a_piece_of_a_plane_are_those_above_the_plane(piece: dict[str, Any]) -> None:
    """And not above a lid, whose normal points down, or above a tube that stands upright."""
    scene = carom.Scene("t", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    scene.plane("lid", material="m", point=(0, 0, 1), normal=(0, 0, -1), radius=0.3)
    scene.cylinder("tube", material="m", point=(0, 0, 0), axis=(0, 0, 1), radius=0.3)
    scene.plane("floor", material="m", point=(0, 0, 0.25), normal=(0, 0, 1), **piece)
    scene.sphere("a", radius=0.01, mass=1.0, at=(0, 0, 0.27), material="m")
    chart = carom.simulate(scene, every=10).plot.chart("heights")
    fallen = 10.0 - 4900.0 * chart.data["time (s)"][:5] ** 2  # mm
    assert chart.figure.axes[0].get_ylabel() == "height (mm)"
    assert chart.figure.axes[0].get_title(loc="left") == "t: height above floor"
    assert chart.data["a height (mm)"][:5] == pytest.approx(fallen, abs=1e-9)


def test_a_step_is_drawn_from_its_start_to_its_end() -> None:
    result = fallen("nsga", 0.1, 1e-3)
    line = result.plot.iterations().axes[2].lines[0]
    assert (line.get_drawstyle(), line.get_xdata()[0]) == ("steps-pre", 0.0)
    assert line.get_xdata()[1:].tolist() == result.steps["time"].tolist()


def test_iterations_are_summed_up_beside_the_curves(broken: carom.Result) -> None:
    for axes in broken.plot.iterations().axes:
        assert not axes.texts
        assert axes.get_title(loc="right").startswith("most ")


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")  # a wall that stays until the end
@pytest.mark.parametrize(("until", "drawn"), [(0.05, 0), (0.5, 1)])
def test_walls_that_were_taken_away_are_not_drawn(until: float, drawn: int) -> None:
    scene = carom.Scene("t", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    cone = {"axis": (0, 0, 1), "radius": 0.03, "radius_end": 0.1, "length": 0.1, "motion": {"until": until}}
    scene.cone("gone", material="m", point=(0, 0, 0.1), **cone)
    scene.plane("upright", material="m", point=(0.15, 0, 0), normal=(-1, 0, 0), motion={"until": until})
    scene.sphere("b", radius=0.02, density=1000, at=(0, 0, 0.5), velocity=(1, 0, 0), material="m")
    [axes] = carom.simulate(scene).plot.trajectories().axes
    assert len(axes.collections) == drawn
    assert len([line for line in axes.lines if line.get_linewidth() > 1.5]) == drawn


def test_a_long_flat_scene_has_no_empty_band_around_its_axes() -> None:
    """The sheet was taller than its axes, which keep the shape of the scene: a third of it was blank."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    scene = carom.Scene("t", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    for k in range(2):
        scene.sphere(f"b{k}", radius=0.01, density=1000, at=(k, 0, 0), material="m")
    figure = carom.simulate(scene).plot.trajectories()
    FigureCanvasAgg(figure).draw()
    [axes] = figure.axes
    drawn = figure.get_tightbbox(figure.canvas.get_renderer())
    assert drawn.height > 0.85 * figure.get_size_inches()[1]
    assert drawn.y0 >= 0.0
    assert axes.get_position().height * figure.get_size_inches()[1] > 0.9


def test_figures_of_scenes_without_a_title_begin_with_a_word(
    broken: carom.Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They began with ": step 10" and "; 3 further pairs"."""
    monkeypatch.setattr(contact, "MOST_PAIRS", 1)
    scene = drop("", "a", "b").scene
    figures = [carom.simulate(scene, contacts=True).plot.phases()]
    monkeypatch.setattr(type(broken), "title", "")
    figures += [broken.plot.chart(kind).figure for kind in broken.plot.available()]
    figures += [carom.converge(scene, [2e-3, 1e-3], 1e-4).plot(), carom.compare(scene, "nsga").plot()]
    titles = [axes.get_title(loc="left") for figure in figures for axes in figure.axes]
    assert len(list(filter(None, titles))) >= 5
    titles.append(_title(SimpleNamespace(study=SimpleNamespace(title=""), ok=np.array([True, False]))))  # type: ignore[arg-type]
    assert all(title[:1].isalnum() for title in titles if title)


def test_long_names_of_pairs_are_told_apart_in_comparisons() -> None:
    """The middle of both names together was left out: nothing of the second name but its end."""
    scene = carom.Scene("t", run={"until": 0.02, "step": 1e-4})
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    names = [f"_{LONG}{k}" for k in range(3)]
    for k, name in enumerate(names):
        scene.sphere(
            name, radius=0.01, mass=0.1, at=(0.02 * k, 0, 0), velocity=(float(k == 0), 0, 0), material="m"
        )
    found = carom.compare(scene, laws=["sequence", "binary"])
    assert found["nsga+binary"].order == tuple(f"{a}-{b}" for a, b in pairwise(names))
    labels = [text.get_text() for part in found.plot().subfigs for text in part.legends[-1].get_texts()]
    assert labels[-2:] == [paired(pair) for pair in pairwise(names)]


def test_rounding_is_no_speed_in_a_comparison() -> None:
    """A ball that came to rest had a bar of 1e-14 m/s over the whole panel."""
    scene = drop("t", "a").scene.with_options(until=1.0)
    found = carom.compare(scene, ("nsga", "moreau", "penalty"))
    last = np.stack([run.states["velocity"][-1] for run in found])
    assert 0.0 < np.abs(last).max() < 1e-8 < found.still < 1e-6
    assert found.directions == [0]
    heights = [bar.get_height() for bar in found.plot().axes[0].patches]
    assert heights == [0.0, 0.0, 0.0]
    falling = carom.compare(scene, ("nsga", "moreau"), until=0.02)
    assert falling.directions == [2]
    assert [bar.get_height() for bar in falling.plot().axes[0].patches] == pytest.approx([-0.196, -0.196])
