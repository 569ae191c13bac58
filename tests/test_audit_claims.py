"""What a run claims is compared with what its tables show: `run.json`, the scenario beside it, attributes, frames."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom.result.record.layout import Rows

SCENARIOS = Path(carom.__file__).parent / "scenarios"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("claims") / "run"
    carom.simulate(str(SCENARIOS / "paper" / "5.6_break.toml"), out=path, until=0.15)
    return path


def violated(run: Path) -> bool:
    return carom.audit.check(run)["claims"].word == "violated"


def numbers(tree: Any, *path: str) -> Iterator[tuple[str, ...]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from numbers(value, *path, key)
        elif isinstance(value, int | float):
            yield (*path, key)


def changed(run: Path, copy: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    shutil.copytree(run, copy)
    about = json.loads((copy / "run.json").read_text())
    change(about)
    (copy / "run.json").write_text(json.dumps(about))
    return copy


#: Times of phases are in no table.
UNTOLD = ("phases",)


def test_every_number_of_the_summary_is_compared(run: Path, tmp_path: Path) -> None:
    summary = json.loads((run / "run.json").read_text())["summary"]
    missed = []
    for k, path in enumerate(p for p in numbers(summary) if p[0] not in UNTOLD):

        def alter(about: dict[str, Any], path: tuple[str, ...] = path) -> None:
            at = about["summary"]
            for key in path[:-1]:
                at = at[key]
            at[path[-1]] = at[path[-1]] * 1.01 + 1

        if not violated(changed(run, tmp_path / str(k), alter)):
            missed.append(".".join(path))
    assert missed == []


def test_final_states_are_compared(run: Path, tmp_path: Path) -> None:
    def alter(about: dict[str, Any]) -> None:
        about["summary"]["bodies"]["ball2"]["velocity"][1] += 1e-12

    assert violated(changed(run, tmp_path / "copy", alter))


@pytest.mark.parametrize(
    ("key", "value"),
    [("status", "stopped"), ("outcome.step", 149), ("outcome.time", 0.16), ("scenario.identity", "0" * 64)],
)
def test_the_ending_is_compared(run: Path, tmp_path: Path, key: str, value: Any) -> None:
    def alter(about: dict[str, Any]) -> None:
        *within, last = key.split(".")
        at = about
        for part in within:
            at = at[part]
        at[last] = value

    assert violated(changed(run, tmp_path / "copy", alter))


@pytest.mark.parametrize("gone", [(), ("outcome",), ("outcome", "finished"), ("outcome", "summary")])
def test_a_run_that_is_running_tells_nothing_of_its_end(
    run: Path, tmp_path: Path, gone: tuple[str, ...]
) -> None:
    def alter(about: dict[str, Any]) -> None:
        about["status"] = "running"
        about["summary"]["contacts"]["max"] += 1
        for key in gone:
            del about[key]

    assert violated(changed(run, tmp_path / "copy", alter))


def test_a_run_that_goes_on_has_no_summary(run: Path, tmp_path: Path) -> None:
    copy, seen = Path(shutil.copytree(run, tmp_path / "copy")), []

    def look(simulation: carom.Simulation) -> None:
        seen.append(json.loads((copy / "run.json").read_text()))

    carom.resume(copy, until=0.16, callback=look)
    assert seen
    for about in seen:
        assert about["status"] == "running"
        assert about.keys().isdisjoint({"summary", "finished"})
    assert not violated(copy)


def cut(steps: int, frames: int) -> Callable[[h5py.File], None]:
    """Whole rows only of all but the last steps, as if the run had ended before."""

    def edit(file: h5py.File) -> None:
        rows = Rows(*map(int, file["commit"][-1]))
        ends = file["frames/contact_end"][: rows.frames - frames]
        last = int(file["steps/step"][rows.steps - steps - 1])
        file["commit"][-1] = rows._replace(
            frames=rows.frames - frames,
            contacts=int(ends[-1]),
            steps=rows.steps - steps,
            impacts=int((file["impacts/step"][: rows.impacts] <= last).sum()),
        )

    return edit


def without_frame(frame: int) -> Callable[[h5py.File], None]:
    def edit(file: h5py.File) -> None:
        rows = Rows(*map(int, file["commit"][-1]))
        for column in file["frames"].values():
            column[frame : rows.frames - 1] = column[frame + 1 : rows.frames]
        file["commit"][-1] = rows._replace(frames=rows.frames - 1)

    return edit


@pytest.mark.parametrize(
    "fault",
    [
        cut(0, 1),
        without_frame(70),
        lambda file: file.attrs.__setitem__("step", file.attrs["step"] * 1.001),
        lambda file: file.attrs.__setitem__("every", 2),
        lambda file: file["steps/contacts"].__setitem__(100, file["steps/contacts"][100] + 1),
        lambda file: file["steps/impact_problems"].__setitem__(100, file["steps/impact_problems"][100] + 1),
        lambda file: file["steps/iterations_position"].__setitem__(100, 3),
    ],
)
def test_results_that_are_not_those_claimed(
    run: Path, tmp_path: Path, fault: Callable[[h5py.File], None]
) -> None:
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    with h5py.File(copy / "results.h5", "r+") as file:
        fault(file)
    assert violated(copy)


def test_a_run_that_was_cut_is_not_read(run: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    with h5py.File(copy / "results.h5", "r+") as file:
        cut(20, 20)(file)
    with pytest.raises(carom.CaromError, match="of the 150 steps of the run 130 are in"):
        violated(copy)


@pytest.mark.parametrize(
    ("old", "new"), [("until = 0.15", "until = 0.3"), ("tolerance = 1e-08", "tolerance = 0.9")]
)
def test_a_scenario_that_is_not_the_one_that_was_run(run: Path, tmp_path: Path, old: str, new: str) -> None:
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    text = (copy / "scenario.toml").read_text()
    assert old in text
    (copy / "scenario.toml").write_text(text.replace(old, new))
    assert violated(copy)


def stop(view: Any) -> bool:
    return bool(view.step >= 50)


@pytest.mark.parametrize(
    "options",
    [
        {"every": 7},
        {"until": 0.0453, "every": 10},
        {"method": "moreau"},
        {"method": "penalty", "until": 0.02},
        {"stop": stop},
    ],
)
def test_honest_runs_are_believed(tmp_path: Path, options: dict[str, Any]) -> None:
    scene = carom.Scene.from_toml(SCENARIOS / "paper" / "5.6_break.toml")
    result = carom.simulate(scene, out=tmp_path / "run", **{"until": 0.1, **options})
    assert not violated(result.path), carom.audit.check(result.path)["claims"].worst
    if "stop" not in options:
        carom.resume(result.path, until=0.1203)
        assert not violated(result.path), carom.audit.check(result.path)["claims"].worst


@pytest.mark.parametrize(
    "name", ["hopper_slot", "shaken_layer", "rotating_drum", "column_collapse", "three_balls"]
)
def test_honest_scenes_of_every_kind_are_believed(tmp_path: Path, name: str) -> None:
    scene = carom.Scene.from_toml(SCENARIOS / f"{name}.toml")
    result = carom.simulate(scene, out=tmp_path / "run", until=30 * scene.run.step)
    assert not violated(result.path), carom.audit.check(result.path)["claims"].worst
    result.close()
    carom.resume(tmp_path / "run", until=41 * scene.run.step, tolerance=1e-7)
    assert not violated(tmp_path / "run"), carom.audit.check(tmp_path / "run")["claims"].worst


def test_a_rod_that_an_impact_of_moreau_jean_turns_is_not_accused(tmp_path: Path) -> None:
    """Its rate holds where the smooth motion ends: the direction turns from there by the speeds before the impact."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    rng = np.random.default_rng(56)
    scene.contact("m", "m", friction=float(rng.uniform(0, 0.8)), restitution=float(rng.uniform(0, 1)))
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    height, way, length = float(rng.uniform(0.02, 0.1)), rng.normal(size=3), float(rng.uniform(0.05, 0.12))
    way = np.abs(way / np.linalg.norm(way)) * [np.sign(way[0]), np.sign(way[1]), 1.0]
    start = np.array([0, 0, height])
    scene.sphere("a", radius=0.02, mass=0.1, at=start, material="m")
    scene.sphere("b", radius=0.02, mass=0.1, at=start + length * way, material="m")
    scene.joint("rod", between=("a", "b"))
    for step in (1e-3, 1e-4):
        result = carom.simulate(
            scene, until=0.3, step=step, every=1, method="moreau", out=tmp_path / f"{step}"
        )
        assert carom.audit.check(result).ok, carom.audit.check(result)


def test_joints_and_what_they_do_not_touch_are_judged(tmp_path: Path) -> None:
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for name, x, z in (("free", 0.0, 0.05), ("left", 1.0, 0.05), ("right", 1.1, 0.06)):
        scene.sphere(name, radius=0.02, mass=0.1, at=(x, 0, z), material="m")
    scene.joint("rod", between=("left", "right"))
    run = carom.simulate(scene, until=0.2, step=1e-3, every=1, out=tmp_path / "run").path
    report = carom.audit.check(run)
    for kind in ("impact", "passivity", "work", "energy balance"):
        assert (report[kind].word, report[kind].unjudged) == ("ok", []), report[kind]
    works = Path(shutil.copytree(run, tmp_path / "works"))
    with h5py.File(works / "results.h5", "r+") as file:
        row = int(np.flatnonzero(file["contacts/body"][:, 0] == 0)[0])
        file["contacts/work_normal"][row] *= 1.01
    assert carom.audit.check(works)["energy balance"].word == "violated"
    for body in (0, 1):  # the law of the free ball is told apart from rounding, and that of one with a rod
        copy = Path(shutil.copytree(run, tmp_path / f"copy{body}"))
        with h5py.File(copy / "results.h5", "r+") as file:
            row = int(np.flatnonzero(file["impacts/body"][:, 0] == body)[0])
            file["impacts/separation"][row] *= 1.01
        assert not carom.audit.check(copy).ok
        other = Path(shutil.copytree(run, tmp_path / f"law{body}"))
        text = (other / "scenario.toml").read_text()
        assert text.count("restitution = 0.5") == 1
        (other / "scenario.toml").write_text(text.replace("restitution = 0.5", "restitution = 0.501"))
        assert carom.audit.check(other)["impact"].word == "violated"
