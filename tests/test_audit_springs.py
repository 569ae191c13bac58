"""The auditor on method `penalty`: works and impacts within a step, by the frames around it."""

from __future__ import annotations

from pathlib import Path

import audit_faults as fault
import audit_scenes as scenes
import carom
import h5py
import numpy as np
import pytest
from carom import audit

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


def hit(restitution: float = 0.8, gravity: float = 0.0) -> carom.Scene:
    """Two balls meet obliquely, and a third one is far away."""
    scene = carom.Scene(gravity=(0, 0, -gravity))
    scene.contact("ball", "ball", friction=0.2, restitution=restitution)
    for i, (x, v) in enumerate(((-0.2, 1.0), (0.2, -1.0))):
        scene.sphere(f"s{i}", radius=0.03, mass=0.2, at=(x, 0.01 * i, 0), velocity=(v, 0, 0), material="ball")
    scene.sphere("far", radius=0.03, mass=0.2, at=(5, 5, 5), material="ball")
    return scene


def write(column: str, at: tuple[int, ...], value: float, *, times: bool = True) -> fault.Fault:
    def edit(file: h5py.File) -> None:
        values = file[column][...]
        values[at] = values[at] * value if times else value
        file[column][...] = values

    return edit


FAULTS = {
    "a hit that gains": (write("contacts/work_normal", (0,), -1.0), "energy balance"),
    "work": (write("contacts/work_normal", (0,), 1.0 + 1e-9), "energy balance"),
    "work of friction": (write("contacts/work_friction", (0,), 1.01), "energy balance"),
    "partner": (write("impacts/body", (0, 1), 2, times=False), "impact sum"),
    "impulse": (write("impacts/impulse", (0, 0), 1.0 + 1e-9), "impact sum"),
    "approach": (write("impacts/approach", (0,), 2.0), "impact speeds"),
    "separation": (write("impacts/separation", (0,), 2.0), "impact speeds"),
    "scale of an impact": (write("impacts/restitution_scale", (0,), 1.01), "counts"),
    "scale of a step": (write("steps/restitution_scale", (0,), 0.99), "counts"),
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return scenes.run(hit(), tmp_path_factory.mktemp("springs") / "run", 0.3, method="penalty", step=1e-3)


def test_a_right_run_is_clean(run: Path) -> None:
    report = audit.check(run)
    assert report.ok, report
    assert min(report[kind].judged for kind in ("energy balance", "impact sum", "impact speeds")) > 0


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_off_is_found(name: str, run: Path, tmp_path: Path) -> None:
    edit, law = FAULTS[name]
    report = audit.check(fault.planted(run, tmp_path / "copy", edit))
    assert law in fault.kinds(report), report


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("friction", ["regularised", "spring"])
@pytest.mark.parametrize("every", [1, 3])
def test_many_hits_balance(restitution: float, friction: str, every: int) -> None:
    """Among walls and under the weight; contacts whose impulses cancel work too, and have no row: they are named."""
    rng = np.random.default_rng(7)
    scene = carom.Scene(gravity=(0, 0, -9.8))
    for other in ("ball", "wall"):
        scene.contact("ball", other, friction=0.3, restitution=restitution)
    scene.box("box", material="wall", low=(-0.07, -0.07, -0.07), high=(0.07, 0.07, 0.07))
    for i, place in enumerate(np.ndindex(2, 2, 2)):
        at, velocity = (np.array(place) - 0.5) * 0.05, rng.normal(size=3)
        scene.sphere(f"b{i}", radius=0.015, mass=[0.05, 5.0][i % 2], at=at.tolist(), velocity=velocity.tolist(),
                     angular_velocity=(10 * rng.normal(size=3)).tolist(), material="ball")  # fmt: skip
    result = carom.simulate(
        scene, method="penalty", step=1e-3, until=0.2, every=every, penalty_friction=friction
    )
    report = audit.check(result)
    assert report.ok, report
    assert report["energy balance"].judged > 100
    if restitution == 0.0:
        assert any("cancel" in one.why for one in report["energy balance"].unjudged)
