"""Cohesion of pairs that Moreau-Jean sees open: it acts until they touch, for nothing answers it in that step."""

from __future__ import annotations

from pathlib import Path

import carom
import numpy as np
import pytest
from carom import audit

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

R, M, F, D = 3e-3, 1e-3, 0.05, 1e-3


def run(gap: float, speed: float, steps: int, out: Path, method: str = "moreau") -> carom.Result:
    """Two balls at rest, or that pass one another."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": 1e-3, "method": method})
    scene.contact("ball", "ball", friction=0.3, restitution=0, cohesion=F, rupture_distance=D)
    for name, sign in (("a", 1), ("b", -1)):
        at, velocity = (0, 0, sign * (R + gap / 2)), (sign * speed, 0, 0)
        scene.sphere(name, radius=R, mass=M, material="ball", at=at, velocity=velocity)
    return carom.simulate(scene, until=steps * 1e-3, every=1, out=out)


@pytest.mark.parametrize("gap", [3e-5, 4e-5])
def test_what_falls_together_has_the_work_of_its_way(gap: float, tmp_path: Path) -> None:
    """All of it and no more, where a step is longer than the fall."""
    result = run(gap, 0.0, 1, tmp_path / "run")
    work = F * (D**2 - (D - gap) ** 2) / (2 * D)
    assert np.asarray(result.steps["energy_kinetic"]) == pytest.approx(work, rel=1e-9)
    assert audit.check(tmp_path / "run").ok


@pytest.mark.parametrize("gap", [1e-7, 1e-5])
def test_what_loads_close_in_a_step_sticks(gap: float, tmp_path: Path) -> None:
    """Its hit is inelastic, and a share of the step."""
    assert run(gap, 0.0, 3, tmp_path / "run").steps["energy_kinetic"] == pytest.approx(np.zeros(3), abs=1e-20)
    assert audit.check(tmp_path / "run").ok


@pytest.mark.parametrize("speed", [0.006, 0.03])
def test_a_pair_that_touches_and_turns_is_not_thrown_together(speed: float, tmp_path: Path) -> None:
    """It opens by the square of its way in a step; the pull of a whole step would bring 2.5 microjoules."""
    result = run(0.0, speed, 30, tmp_path / "run")
    kinetic = np.asarray(result.steps["energy_kinetic"])
    assert kinetic.max() < 1.03 * M * speed**2
    exact = run(0.0, speed, 30, tmp_path / "exact", "nsga").steps["energy_kinetic"]
    assert kinetic[-1] == pytest.approx(exact[-1], rel=0.01)
    report = audit.check(tmp_path / "run")
    assert report.ok, repr(report)
