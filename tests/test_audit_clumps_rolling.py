"""The auditor judges clumps of one ball: tops, whose centre of mass is beside that of the ball that rolls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from audit_faults import kinds, planted
from audit_scenes import run
from carom import audit
from carom.audit import turning
from carom.audit.data import read

R, M = 0.02, 0.05


def top(friction: float, spin: float, tilt: float, moments: tuple[float, float, float]) -> carom.Scene:
    """A ball that spins on a floor, with its centre of mass 3 mm below its centre; `moments` over m r^2."""
    scene = carom.Scene(gravity=(0, 0, -9.81))
    for other in ("ball", "floor"):
        scene.contact("ball", other, friction=friction, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.clump(
        "top",
        spheres=[[0, 0, 0, R]],
        material="ball",
        mass=M,
        inertia=[of * M * R**2 for of in moments],
        centre=(0, 0, -0.003),
        position=(0, 0, R),
        orientation=(np.cos(tilt / 2), np.sin(tilt / 2), 0, 0),
        angular_velocity=(0, 0, spin),
    )
    return scene


EQUAL, UNEQUAL = (0.38, 0.38, 0.38), (0.32, 0.38, 0.45)
TOPS = [(0.3, 200.0, 0.1, EQUAL), (0.0, 50.0, 1.0, EQUAL), (0.3, 50.0, 1.0, UNEQUAL)]


@pytest.mark.parametrize("of", TOPS, ids=str)
@pytest.mark.parametrize("record", [{"every": 1}, {"every": 10}, {"every": 1, "contacts": False}], ids=str)
def test_tops_are_clean(of: tuple[Any, ...], record: dict[str, Any], tmp_path: Path) -> None:
    """Loads act half-way through the step, while the contact goes round: energy goes up and down by the third order."""
    path = run(top(*of), tmp_path / "run", 0.4, step=1e-3, **record)
    report = audit.check(path)
    assert report.ok, report.findings
    assert report["energy rise"].judged == 400


def _bounds(of: tuple[Any, ...], path: Path, step: float) -> tuple[np.ndarray, np.ndarray]:
    found = read(run(top(*of), path, 0.2, step=step, every=1))
    motion = np.asarray(found.steps["energy_kinetic"])
    return turning.rolled(found, motion), turning.lifted(found, motion)


def test_what_rolls_may_gain_next_to_nothing(tmp_path: Path) -> None:
    """The bound is of third order in the step, and far below what the first contact may lift, of first order."""
    for k, of in enumerate(TOPS):
        (long, loose), (short, _) = (_bounds(of, tmp_path / f"{k}{h}", h) for h in (1e-3, 5e-4))
        assert np.median(long) < 0.02 * np.median(loose)
        assert np.median(short) < np.median(long) / 6.0


def test_a_gain_while_it_rolls_is_found(tmp_path: Path) -> None:
    honest = run(top(*TOPS[1]), tmp_path / "honest", 0.2, step=1e-3)

    def edit(file: h5py.File) -> None:
        kinetic = file["steps/energy_kinetic"]
        kinetic[100:] += 1e-6  # of 0.01 J: far below what bodies that fall may be lifted by

    assert "energy rise" in kinds(audit.check(planted(honest, tmp_path / "run", edit)))


def test_the_travel_of_a_clump_is_that_of_its_centre_over_its_reach(tmp_path: Path) -> None:
    """Here the ball of the clump is slower than that."""
    scene = top(0.3, 0.0, 0.0, EQUAL)
    scene.world.gravity = (0, 0, 0)
    scene.clumps[0].angular_velocity = (10.0, 0.0, 0.0)
    scene.clumps[0].velocity = (0.0, 0.026, 0.0)
    scene.clumps[0].position = (0.0, 0.0, 2.0 * R)
    path = run(scene, tmp_path / "run", 0.01, step=1e-3)
    assert carom.load(path).summary["travel_max"] == pytest.approx(0.026e-3 / 0.023)
    assert audit.check(path).ok
