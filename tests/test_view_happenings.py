"""Impacts, contacts, energies, joints and springs in the page: what Python writes of them, read back with Python."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carom import Scene
from carom.errors import CaromError
from carom.show.viewer import codec, write_html
from carom.show.viewer import happenings as module
from test_view_page import Page
from view_scenes import Shown, Table, billiard, struck

FRAMES = 200


def write(run: Any, folder: Path, **options: Any) -> tuple[Any, Page]:
    info = write_html(run, folder / "view.html", **options)
    return info, Page(info.path.read_text())


def integers(page: Page, name: str) -> Any:
    entry = page.facts["arrays"][name]
    return codec.decode(page.data[entry["offset"] : entry["offset"] + entry["bytes"]], entry)[:, 0]


def floats(page: Page, name: str) -> Any:
    return integers(page, name).view(np.float32)


def doubles(page: Page, name: str) -> Any:
    entry = page.facts["arrays"][name]
    return np.frombuffer(page.data, "<f8", entry["shape"][0], entry["offset"])


def test_impacts_are_the_runs_in_the_order_of_the_sequence(tmp_path: Path) -> None:
    run = struck(FRAMES)
    shuffled = [5, 4, 2, 3, 0, 1]
    run.impacts = Table({name: values[shuffled] for name, values in run.impacts.items()})
    info, page = write(run, tmp_path)
    assert info.notes == ()
    assert doubles(page, "impact_time").tolist() == [0.1] * 5 + [0.3]
    assert integers(page, "impact_problem")[:, 0].tolist() == [0, 1, 2, 2, 3, 1]
    # Walls count down from -1, in the order of wall_names.
    assert integers(page, "impact_body").tolist() == [[1, -1], [0, 1], [1, 2], [1, 3], [0, 1], [3, -2]]
    assert page.facts["wall_names"][1] == "foot cushion"
    assert integers(page, "impact_status")[:, 0].tolist() == [1, 1, 2, 1, 2, 2]
    assert floats(page, "impact_impulse")[:, 0] == pytest.approx([0, -0.5, -0.25, -0.25, -0.125, -0.3])
    assert floats(page, "impact_speed")[1] == pytest.approx([-3.0, 2.9])
    assert integers(page, "impact_normal")[1].tolist() == [-32767, 0, 0]


def test_contact_forces_are_mean_forces_since_the_recorded_frame_before(tmp_path: Path) -> None:
    _, page = write(struck(FRAMES), tmp_path)
    ends = integers(page, "contact_end")[:, 0]
    assert page.facts["contact_every"] == 1
    assert ends.tolist() == [4 * k for k in range(FRAMES)]
    force = floats(page, "contact_force").reshape(-1, 4, 3)
    assert force[..., 2] == pytest.approx(np.tile(0.17 * 9.8 * np.arange(1, 5), (FRAMES - 1, 1)))
    assert np.abs(force[..., :2]).max() == 0.0


def test_too_many_are_thinned_and_the_page_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_IMPACTS", 3)
    monkeypatch.setattr(module, "MAX_CONTACTS", 250)
    info, page = write(struck(FRAMES), tmp_path)
    assert info.notes == ("Impacts: the 3 strongest of 6.", "Contact forces of one frame in 4.")
    assert page.facts["notes"] == list(info.notes)
    assert floats(page, "impact_impulse")[:, 0].tolist() == pytest.approx([-0.5, -0.25, -0.3])
    assert page.facts["contact_every"] == 4
    assert integers(page, "contact_end")[:, 0].tolist() == [0] + [4 * k for k in range(1, FRAMES // 4)]
    monkeypatch.setattr(module, "MAX_CONTACTS", 3)
    info, page = write(struck(FRAMES), tmp_path)
    assert info.notes[1] == "Contact forces are left out: there are too many."
    assert "contact_force" not in page.facts["arrays"]


def test_pairs_of_which_a_ball_is_not_shown_are_left_out() -> None:
    run = struck(FRAMES)
    found = module.happenings(run, np.arange(FRAMES), 2, 1e7)
    # Bodies 0 and 2 are shown, as 0 and 1.
    assert found.columns.keys().isdisjoint({"impact_body"})
    assert found.columns["contact_body"][:2, 0].tolist() == [[0, -1], [1, -1]]
    assert len(found.columns["contact_body"]) == 2 * (FRAMES - 1)


def test_energies_are_thinned_for_the_plot_and_keep_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = struck(FRAMES)
    time, kinetic, potential = doubles(write(run, tmp_path)[1], "energy").reshape(3, -1)
    assert np.array_equal(time, run.time)
    assert np.array_equal(kinetic, run.energy.kinetic)
    assert np.array_equal(potential, run.energy.potential)
    monkeypatch.setattr(module, "MAX_ENERGIES", 60)
    time = doubles(write(run, tmp_path)[1], "energy").reshape(3, -1)[0]
    assert len(time) <= 60
    assert time[-1] == run.time[-1]


def test_joints_and_springs_have_their_ends_in_the_axes_of_the_balls(tmp_path: Path) -> None:
    run = struck(FRAMES)
    half = np.sqrt(0.5)
    run.orientation[0, 0] = [
        half,
        0.0,
        half,
        0.0,
    ]  # a quarter turn about y: what is above lies along -x of the ball
    tie, spring = write(run, tmp_path)[1].facts["links"]
    assert (tie["kind"], tie["a"], tie["b"], tie["from"], tie["to"]) == ("rod", 2, 3, [0, 0, 0], [0, 0, 0])
    assert (spring["a"], spring["b"]) == (0, -1)
    assert spring["from"] == pytest.approx([-0.028575, 0, 0], abs=1e-12)
    assert spring["to"] == pytest.approx([0.3, 0.635, 0.3])


def test_axes_of_joints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = billiard(5)
    run.scene = Scene()
    run.scene.joint("line", body="ball2", direction=[0.0, 0.0, 2.0])
    run.scene.joint("lock", body="ball3")
    line, lock = write(run, tmp_path)[1].facts["links"]
    assert (line["name"], line["axes"]) == ("joint1", [[0, 0, 1]])
    assert line["to"] == pytest.approx(run.position[0, 0])  # where the rail passes
    assert lock["axes"] == np.eye(3).tolist()

    def lost(_: Shown) -> Scene:
        raise CaromError("the copy of the scenario is damaged")

    del run.scene
    monkeypatch.setattr(Shown, "scene", property(lost))
    facts = write(run, tmp_path)[1].facts
    assert "links" not in facts
    assert "its copy of the scenario cannot be read" in facts["notes"][0]


def test_a_run_without_any_of_it_has_a_page_as_before(tmp_path: Path) -> None:
    _, page = write(billiard(20), tmp_path)
    assert set(page.facts["arrays"]) == {"time", "position", "orientation", "velocity", "angular_velocity"}
    assert re.search(r"<title>Carom</title>", page.text)
    assert "links" not in page.facts
    assert json.loads(json.dumps(page.facts)) == page.facts
