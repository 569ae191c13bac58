"""Options that a scenario merely claims, its identity with them, widen no bound beyond what the tables show."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import audit_faults as fault
import audit_scenes as scenes
import carom
import h5py
import numpy as np
import pytest
from audit_faults import Fault
from carom.scene.assembly.arrays import identify

SCENES = {
    "break": (scenes.break_, 0.15),
    "pile": (scenes.pile, 0.1),
    "rolling": (scenes.rolling, 0.1),
    "slow": (lambda: scenes.ball_on_plane((0.1, 0.0, 0.0)), 0.15),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    out = tmp_path_factory.mktemp("options")
    return {name: scenes.run(make(), out / name, until) for name, (make, until) in SCENES.items()}


def claim(run: Path, options: dict[str, Any]) -> None:
    """Writes options into the scenario of a run, and the identity that belongs to them."""
    text = (run / "scenario.toml").read_text()
    for name, value in options.items():
        text, count = re.subn(rf"(?m)^{name} = .*$", f"{name} = {json.dumps(value)}", text)
        assert count == 1
    (run / "scenario.toml").write_text(text)
    about = json.loads((run / "run.json").read_text())
    about["scenario"]["identity"] = identify(carom.Scene.from_toml(run / "scenario.toml").to_model())
    if "method" in options:
        about["summary"]["method"] = options["method"]
    (run / "run.json").write_text(json.dumps(about))


CLOSING = {"closing_tolerance_load": 5.0, "closing_tolerance_speed": 0.9}


@pytest.mark.parametrize(
    ("name", "options", "kind"),
    [
        ("break", {"touching_tolerance": 0.09}, "counts"),  # more pairs are as near as that
        ("pile", {"touching_tolerance": 0.09}, "counts"),
        ("break", CLOSING, "approach"),  # impacts began where less closes
        ("pile", CLOSING, "approach"),
        ("break", {"pile_contacts": 1}, "impact speeds"),
    ],
)
def test_a_claim_that_the_tables_contradict_is_found(
    runs: dict[str, Path], tmp_path: Path, name: str, options: dict[str, float], kind: str
) -> None:
    copy = Path(shutil.copytree(runs[name], tmp_path / "copy"))
    claim(copy, options)
    report = carom.audit.check(copy)
    assert report["claims"].word == "ok"  # the identity fits
    assert report[kind].word == "violated", report


def less_friction(file: h5py.File) -> None:
    """All friction is 30 % less."""
    impulse, normal = file["contacts/impulse"][...], file["contacts/normal"][...]
    sliding = impulse - (impulse * normal).sum(axis=1, keepdims=True) * normal
    file["contacts/impulse"][...] = impulse - 0.3 * sliding


SHOWN = {"tolerance": 0.9, "pile_tolerance": 0.9, "gap_tolerance": 0.9}


@pytest.mark.parametrize(
    ("name", "plant", "options", "kind"),
    [
        ("break", less_friction, SHOWN, "slip"),
        ("pile", fault.move_body(50, 7, np.array([0, 0, -1e-3])), SHOWN, "penetration"),
        ("rolling", fault.open_contact(60, 1e-6), {"touching_tolerance": 0.09}, "complementarity"),
        ("rolling", fault.move_body(50, 0, np.array([1e-8, 0, 0])), {"tolerance_floor": 0.09}, "position"),
        ("slow", fault.push_velocity(100, 0, np.array([0, 0, -1e-4])), CLOSING, "approach"),
        ("rolling", fault.move_body(50, 0, np.array([3e-11, 0, 0])), {"dense_contacts": 1}, "position"),
        ("rolling", fault.move_body(50, 0, np.array([3e-11, 0, 0])), {"pile_contacts": 1}, "position"),
    ],
)
def test_a_fault_is_not_excused_by_what_is_claimed(
    runs: dict[str, Path], tmp_path: Path, name: str, plant: Fault, options: dict[str, float], kind: str
) -> None:
    """Violated where steps show how much a solver left; what no table shows is said to be claimed, and not to be kept."""
    copy = fault.planted(runs[name], tmp_path / "copy", plant)
    assert carom.audit.check(copy)[kind].word == "violated"
    claim(copy, options)
    verdict = carom.audit.check(copy)[kind]
    told = [
        u for u in verdict.unjudged if all(f"{key} = {value:g}" in u.why for key, value in options.items())
    ]
    assert verdict.word == "violated" or told, verdict


@pytest.mark.parametrize("name", ["drum", "shaken"])
@pytest.mark.parametrize(
    "loose",
    [
        {"tolerance": 1e-5, "gap_tolerance": 1e-5, "pile_tolerance": 1e-4},
        {"touching_tolerance": 1e-5, "tolerance_floor": 1e-9},
        {"closing_tolerance_load": 0.5, "closing_tolerance_speed": 1e-3},
        {"dense_contacts": 1},
    ],
    ids=lambda options: next(iter(options)),
)
def test_runs_with_loose_tolerances_are_believed(tmp_path: Path, name: str, loose: dict[str, float]) -> None:
    path = scenes.run(getattr(scenes, name)(), tmp_path / "run", 0.1, **loose)
    assert carom.audit.check(path).ok, carom.audit.check(path)


@pytest.mark.parametrize("column", ["contacts", "islands", "largest_island", "candidates"])
@pytest.mark.parametrize("name", ["break", "pile"])
def test_what_the_steps_count_of_contacts_is_counted_anew(
    runs: dict[str, Path], tmp_path: Path, name: str, column: str
) -> None:
    """One more in one step is found, whatever the summary says."""

    def one_more(file: h5py.File) -> None:
        file[f"steps/{column}"][90] += 1

    assert (
        carom.audit.check(fault.planted(runs[name], tmp_path / "copy", one_more))["counts"].word == "violated"
    )
