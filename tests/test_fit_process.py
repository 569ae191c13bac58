"""The search by Gaussian processes: it ends by itself on precise data, and expects no more than there is to gain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import Calibration

SLIDE = """\
format = 1
run = { until = 0.5, step = 5e-4 }
record = { every = 10 }
parameters = { mu = 0.2, e = 0.5 }
contact = [{ between = ["g", "g"], friction = "= mu", restitution = "= e" }]
material = [{ name = "g" }]
plane = [{ name = "f", material = "g", point = [0, 0, 0], normal = [0, 0, 1] }]
[[sphere]]
name = "a"
material = "g"
radius = 0.01
mass = 0.01
position = [0.0, 0.0, 0.03]
velocity = [1.0, 0.0, 0.0]
[world]
gravity = [0.0, 0.0, -9.81]
"""
TRUTH = {"mu": 0.23, "e": 0.62}


@pytest.fixture
def bounces(tmp_path: Path) -> Path:
    """A ball that bounces and slides, and its track without noise."""
    pytest.importorskip("sklearn", reason="the extra [fit] is not installed")
    path = tmp_path / "slide.toml"
    path.write_text(SLIDE)
    run = carom.simulate(carom.Scene.from_toml(path, parameters=TRUTH))
    place = np.asarray(run["a"].position)
    rows = np.column_stack([run.time, place[:, 0], place[:, 2]])
    np.savetxt(tmp_path / "track.csv", rows, delimiter=",", header="t,x,z", comments="")
    return path


def searched(scene: Path, **more: Any) -> carom.Fit:
    target = {
        "file": "track.csv",
        "uncertainty": "0.3 mm",
        "columns": {"x": "a.position.x", "z": "a.position.z"},
    }
    calibration = Calibration.of(
        scene, {"mu": (0.05, 0.5), "e": (0.1, 0.9)}, [target],
        search="gaussian_process", folder=scene.parent, **more,
    )  # fmt: skip
    return carom.fit(calibration, scene.parent / "fit", workers=0)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_search_ends_by_itself_on_precise_data(seed: int, bounces: Path) -> None:
    """It had used all its 40 points and expected hundreds more than chi squared, which was 0.4."""
    found = searched(bounces, seed=seed)
    assert found.converged
    assert found.summary["points"] <= 30
    assert found.chi2 < 0.1
    for name, truth in TRUTH.items():
        low, high = found.interval[name]  # type: ignore[misc]
        assert low < truth < high
        assert high - low < 0.02


def test_no_point_is_expected_to_gain_more_than_there_is(bounces: Path) -> None:
    """Two points after the first ones: 2e4 had been expected of a chi squared of 142."""
    found = searched(bounces, points=12, seed=1)
    assert not found.converged
    words = found.summary["message"]
    assert words.endswith("; raise search.points")
    assert 0 < float(words.split("by ")[1].split(";")[0]) < found.chi2
    for name, interval in found.interval.items():
        assert interval is not None or name in found.remarks[0]


def test_a_parameter_without_any_effect_has_no_interval(bounces: Path) -> None:
    """All residuals of all points are the same then: nothing is left to be modelled."""
    found = carom.fit(
        Calibration.of(
            bounces, {"mu": (0.05, 0.5)}, [{"quantity": "a.mass", "value": 0.01, "uncertainty": 1e-3}],
            search="gaussian_process", measure=lambda result: {"a.mass": float(result.bodies["mass"][0])},
        ),
        bounces.parent / "fit", workers=0,
    )  # fmt: skip
    assert found.converged
    assert found.interval == {"mu": None}
    assert found.remarks == ["the data do not determine mu within its bounds"]


@pytest.mark.parametrize("seed", [1, 3])
def test_a_parameter_beyond_which_nothing_changes_has_no_interval(seed: int, bounces: Path) -> None:
    """From some friction on the ball rolls after a bounce. Runs have no slopes there, processes beside a cliff do."""
    bounces.write_text(bounces.read_text().replace("velocity = [1.0,", "velocity = [0.1,"))
    run = carom.simulate(carom.Scene.from_toml(bounces, parameters={"mu": 0.3, "e": 0.62}))
    place = np.asarray(run["a"].position)
    rows = np.column_stack([run.time, place[:, 0], place[:, 2]])
    np.savetxt(bounces.parent / "track.csv", rows, delimiter=",", header="t,x,z", comments="")
    found = searched(bounces, seed=seed, points=20)
    assert found.interval["mu"] is None
    assert "the data do not determine mu within its bounds" in found.remarks
    low, high = found.interval["e"]  # type: ignore[misc]
    assert low < 0.62 < high
