"""The auditor judges clumps: honest runs are clean, and what moves a clump otherwise is found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import audit_clumps
import carom
import h5py
import numpy as np
import pytest
from audit_faults import Fault, kinds, planted, reworded
from audit_scenes import run
from carom import audit

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

ROD = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01], [0, 0.012, 0, 0.008]]
"""Balls of a clump that overlap."""


def thrown(*, friction: float = 0.3, restitution: float = 0.4, **law: float) -> carom.Scene:
    """A clump that is thrown, turning, onto a floor."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("grain", "grain", friction=friction, restitution=restitution, **law)
    scene.contact("grain", "wall", friction=friction, restitution=restitution, **law)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    scene.clump("rod", material="grain", spheres=ROD, mass=0.02, inertia=[1e-6, 2e-6, 2.5e-6], position=(0, 0, 0.03),
                velocity=(0.3, 0, 0), angular_velocity=(5, 20, 3))  # fmt: skip
    return scene


def lying(**law: float) -> carom.Scene:
    """A clump that lies on a floor on three balls, with a ball on top and a clump that falls onto both."""
    scene = thrown(**law)
    scene.clumps[0].angular_velocity = (0.0, 0.0, 0.0)
    scene.clumps[0].position = (0.0, 0.0, 0.01)
    scene.sphere("ball", radius=0.008, density=2500, material="grain", position=(0.002, 0.004, 0.0265))
    scene.clump("pair", material="grain", spheres=[[-0.007, 0, 0, 0.007], [0.009, 0, 0, 0.009]], density=2000,
                position=(0.004, 0, 0.05), orientation=(0.9, 0.3, 0.3, 0.1))  # fmt: skip
    return scene


def flying() -> carom.Scene:
    """A clump with three different moments, free in space, near its axis of no stability."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("grain", "grain", friction=0.3, restitution=0.5)
    scene.clump("rod", material="grain", spheres=ROD, mass=0.02, inertia=[1e-6, 2e-6, 2.5e-6], position=(0, 0, 0),
                velocity=(0.3, 0, 0), angular_velocity=(0.3, 30, 0.2))  # fmt: skip
    return scene


HONEST: dict[str, tuple[Callable[[], carom.Scene], float, dict[str, Any]]] = {
    "thrown": (thrown, 0.3, {"step": 1e-3}),
    "slippery": (lambda: thrown(friction=0.0, restitution=1.0), 0.3, {"step": 1e-3}),
    "restored slip": (lambda: thrown(tangential_restitution=0.5), 0.3, {"step": 1e-3}),
    "resisted": (lambda: thrown(rolling_radius=1e-4, spinning_radius=2e-4), 0.3, {"step": 1e-3}),
    "poisson": (thrown, 0.3, {"step": 1e-3, "impact": "poisson"}),
    "lying": (lying, 0.2, {"step": 1e-3, "impacts": "every"}),
    "flying": (flying, 1.0, {"step": 2e-3}),
}


@pytest.mark.parametrize("name", HONEST)
def test_honest_runs_are_clean(name: str, tmp_path: Path) -> None:
    scene, until, options = HONEST[name]
    for k, record in enumerate(({"every": 1}, {"every": 10}, {"every": 1, "contacts": False})):
        report = audit.check(run(scene(), tmp_path / f"run{k}", until, **options, **record))
        assert report.ok, (record, report.findings)
        for kind in ("momentum", "spin", "position", "rotation", "rigid"):
            assert report[kind].judged > 0
            if record == {"every": 1}:  # all of it
                assert not report[kind].unjudged


@pytest.mark.parametrize("seed", range(8))
def test_random_scenes_are_clean(seed: int, tmp_path: Path) -> None:
    scene, options = audit_clumps.scene(seed)
    report = audit.check(run(scene, tmp_path / "run", 0.15, **options))
    assert report.ok, (options, report.findings)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Runs into which faults are planted."""
    path = tmp_path_factory.mktemp("runs")
    return {
        "thrown": run(thrown(), path / "thrown", 0.2, step=1e-3),
        "lying": run(lying(), path / "lying", 0.1, step=1e-3),
        "bare": run(thrown(), path / "bare", 0.2, step=1e-3, contacts=False, impacts=False),
        "rare": run(thrown(), path / "rare", 0.2, step=1e-3, every=10),
        "flying": run(flying(), path / "flying", 0.2, step=1e-3, every=10),
    }


def of_first(file: h5py.File) -> slice:
    """Numbers of the balls of the first clump."""
    first = int(file["clumps/first"][0])
    return slice(first, first + len(ROD))


def shifted(frame: int, column: int, by: float, *, whole: bool) -> Fault:
    """A number of the first clump at one frame is another; `whole`: its balls go along."""

    def edit(file: h5py.File) -> None:
        clump = file["frames/clumps"][frame, 0]
        clump[column] += by
        file["frames/clumps"][frame, 0] = clump
        if not whole:
            return
        balls = of_first(file)
        if column < 3:
            file["frames/position"][frame, balls, column] += by
        elif column < 10:
            file["frames/velocity"][frame, balls, column - 7] += by
        else:
            lever = file["frames/position"][frame, balls] - clump[:3]
            way = np.eye(3)[column - 10] * by
            file["frames/angular_velocity"][frame, balls] += way
            file["frames/velocity"][frame, balls] += np.cross(way, lever)

    return edit


@pytest.mark.parametrize("name", ["thrown", "lying", "bare", "rare", "flying"])
@pytest.mark.parametrize(("column", "law"), [(2, "position"), (8, "momentum"), (11, "spin")])
def test_another_motion_of_a_clump_is_found(
    name: str, column: int, law: str, runs: dict[str, Path], tmp_path: Path
) -> None:
    whole = audit.check(planted(runs[name], tmp_path / "whole", shifted(5, column, 1e-6, whole=True)))
    assert law in kinds(whole)
    assert "rigid" not in kinds(whole)
    alone = audit.check(planted(runs[name], tmp_path / "alone", shifted(5, column, 1e-6, whole=False)))
    assert {law, "rigid"} <= kinds(alone)


@pytest.mark.parametrize("name", ["thrown", "bare", "rare"])
@pytest.mark.parametrize("column", ["position", "velocity", "angular_velocity", "orientation"])
def test_a_ball_that_leaves_its_clump_is_found(
    name: str, column: str, runs: dict[str, Path], tmp_path: Path
) -> None:
    def edit(file: h5py.File) -> None:
        values = file[f"frames/{column}"][5, 1]
        values[1] += 1e-6
        file[f"frames/{column}"][5, 1] = (
            values / np.linalg.norm(values) if column == "orientation" else values
        )

    assert "rigid" in kinds(audit.check(planted(runs[name], tmp_path / "run", edit)))


@pytest.mark.parametrize("name", ["thrown", "rare", "flying"])
def test_another_turn_of_a_clump_is_found(name: str, runs: dict[str, Path], tmp_path: Path) -> None:
    """The clump and its balls turned about its centre."""
    angle = 1e-6

    def edit(file: h5py.File) -> None:
        clump = file["frames/clumps"][5, 0]
        turned = _turned(clump[None, 3:7], angle)[0]
        file["frames/clumps"][5, 0] = np.concatenate([clump[:3], turned, clump[7:]])
        balls = of_first(file)
        lever = file["frames/position"][5, balls] - clump[:3]
        file["frames/position"][5, balls] += np.cross([0, 0, angle], lever)
        file["frames/orientation"][5, balls] = _turned(file["frames/orientation"][5, balls], angle)

    assert {"rotation", "spin"} <= kinds(audit.check(planted(runs[name], tmp_path / "run", edit)))


def _turned(q: Any, angle: float) -> Any:
    """Quaternions (n, 4) turned by a small angle about the vertical."""
    w, x, y, z = q.T
    half = 0.5 * angle
    found = np.stack([w - half * z, x - half * y, y + half * x, z + half * w], axis=1)
    return found / np.linalg.norm(found, axis=1)[:, None]


@pytest.mark.parametrize("name", ["thrown", "lying", "rare"])
def test_a_lost_impulse_is_found(name: str, runs: dict[str, Path], tmp_path: Path) -> None:
    def edit(file: h5py.File) -> None:
        row = int(np.argmax(np.linalg.norm(file["contacts/impulse"][:], axis=1)))
        file["contacts/impulse"][row] = 0.0

    found = kinds(audit.check(planted(runs[name], tmp_path / "run", edit)))
    assert "momentum" in found
    assert ("spin" in found) == (name != "rare")  # where levers turn by more than that between frames


@pytest.mark.parametrize("name", ["thrown", "lying"])
def test_a_lost_correction_of_places_is_found(name: str, runs: dict[str, Path], tmp_path: Path) -> None:
    def edit(file: h5py.File) -> None:
        row = int(np.argmax(np.linalg.norm(file["contacts/position_impulse"][:], axis=1)))
        file["contacts/position_impulse"][row] = 0.0

    assert {"position", "rotation"} <= kinds(audit.check(planted(runs[name], tmp_path / "run", edit)))


@pytest.mark.parametrize("name", ["thrown", "lying", "rare"])
@pytest.mark.parametrize(
    ("given", "other", "law"),
    [
        ("mass = 0.02", "mass = 0.02002", "momentum"),
        ("2e-06", "2.002e-06", "spin"),
        ("0.012", "0.012001", "rigid"),
    ],
)
def test_another_clump_is_found(
    name: str, given: str, other: str, law: str, runs: dict[str, Path], tmp_path: Path
) -> None:
    path = reworded(runs[name], tmp_path / "run", given, other)
    assert {law, "claims", "scenario"} <= kinds(audit.check(path))


@pytest.mark.parametrize("column", ["mass", "inertia", "centre", "axes"])
def test_another_table_of_clumps_is_found(column: str, runs: dict[str, Path], tmp_path: Path) -> None:
    def edit(file: h5py.File) -> None:
        file[f"clumps/{column}"][0] = file[f"clumps/{column}"][0] * (1.0 + 1e-6) + 1e-9

    assert "scenario" in kinds(audit.check(planted(runs["thrown"], tmp_path / "run", edit)))


def test_a_file_without_the_motion_of_its_clumps_is_refused(runs: dict[str, Path], tmp_path: Path) -> None:
    def edit(file: h5py.File) -> None:
        del file["frames/clumps"]

    with pytest.raises(carom.CaromError, match="frames/clumps"):
        audit.check(planted(runs["thrown"], tmp_path / "run", edit))


@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_a_clump_on_a_pile_that_is_swept(restitution: float, tmp_path: Path) -> None:
    """Islands of balls alone are swept beside one with a clump, whose impacts are rows of their own."""
    scene = carom.Scene(gravity=(0, 0, -9.81))
    scene.contact("glass", "glass", friction=0.5, restitution=restitution)
    scene.box("box", low=(0, 0, 0), high=(0.06, 0.06, 0.2), open=["high_z"], material="glass")
    scene.packing(
        "g",
        material="glass",
        density=2500,
        seed=1,
        count=100,
        diameter=0.01,
        low=(0, 0, 0),
        high=(0.06, 0.06, 0.06),
    )
    rod = [[-0.005, 0, 0, 0.005], [0.005, 0, 0, 0.005]]
    scene.clump("rod", spheres=rod, material="glass", density=2500, position=(0.03, 0.03, 0.09))
    result = carom.simulate(
        scene, step=5e-4, until=0.1, every=1, contacts=True, pile_tolerance=1e-6, out=tmp_path / "run"
    )
    assert np.asarray(result.steps["sweeps_velocity"]).max() > 0
    report = audit.check(tmp_path / "run")
    assert report.ok, report.findings


@pytest.mark.parametrize("every", [2, 5])
def test_a_clump_that_hits_a_mesh_between_two_frames_is_in_no_free_flight(every: int) -> None:
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("g", "g", friction=0.4, restitution=0.3)
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    scene.mesh("floor", material="g", vertices=corners, triangles=[(0, 1, 2), (0, 2, 3)])
    scene.clump(
        "rod",
        material="g",
        spheres=[[-0.008, 0, 0, 0.008], [0.008, 0, 0, 0.008]],
        density=2500,
        position=(0, 0, 0.03),
        orientation=(0.8, 0, 0.6, 0),
        velocity=(0, 0, -1),
    )
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.05, every=every))
    assert report.ok, str(report)
