"""Columns that no law looked at once: what contacts are said to do, parts of meshes, counts of Moreau-Jean, levers."""

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


def sticking(file: h5py.File) -> None:
    """A contact with an impact that stuck is said to slip."""
    status = file["contacts/status"][...]
    struck = {tuple(body) for body in file["impacts/body"][...].tolist()}
    rows = [i for i in np.flatnonzero(status == 1) if tuple(file["contacts/body"][i].tolist()) in struck]
    status[rows] = 2
    assert rows
    file["contacts/status"][...] = status


@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_a_contact_does_what_its_last_impact_did(method: str, tmp_path: Path) -> None:
    scene = scenes.two_balls(friction=1.0)
    run = scenes.run(scene, tmp_path / "run", 0.05, method=method)
    assert audit.check(run).ok
    assert fault.kinds(audit.check(fault.planted(run, tmp_path / "copy", sticking))) == {"slip"}


def plus_one(column: str) -> fault.Fault:
    def edit(file: h5py.File) -> None:
        values = file[column][...]
        values[np.flatnonzero(values)[0]] += 1
        file[column][...] = values

    return edit


@pytest.mark.parametrize("name", ["candidates", "islands", "largest_island"])
def test_moreau_counts_what_overlaps_in_the_middle_of_a_step(name: str, tmp_path: Path) -> None:
    """In its first impact: later there are pairs that loads may close, or not."""
    run = scenes.run(scenes.pile(), tmp_path / "run", 0.15, method="moreau")
    assert audit.check(run).ok
    copy = fault.planted(run, tmp_path / "copy", plus_one(f"steps/{name}"))
    assert "counts" in fault.kinds(audit.check(copy))


def test_only_meshes_have_parts(tmp_path: Path) -> None:
    scene = carom.Scene(gravity=(0, 0, -9.8))
    for other in ("m", "g"):
        scene.contact("g", other, friction=0.3, restitution=0.5)
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    scene.mesh("floor", material="m", vertices=corners, triangles=np.array([(0, 1, 2), (0, 2, 3)]))
    for i, z in enumerate((0.012, 0.033)):
        scene.sphere(f"g{i}", radius=0.01, density=2500, material="g", at=(0.3, 0.1, z))
    run = scenes.run(scene, tmp_path / "run", 0.1)
    assert audit.check(run).ok
    for table in ("contacts", "impacts"):

        def meant(file: h5py.File, table: str = table) -> None:
            part = file[f"{table}/part"][...]
            part[np.flatnonzero(part == -1)[0]] = 0
            file[f"{table}/part"][...] = part

        copy = fault.planted(run, tmp_path / table, meant)
        assert fault.kinds(audit.check(copy)) == {"references"}


@pytest.mark.parametrize("seed", [1, 4, 5, 8])
def test_one_shot_may_push_without_an_impact_at_either_lever(seed: int) -> None:
    """No row of an impact, nor a way: of the loads, half-way through the step, or of the problem after them, at its end."""
    rng = np.random.default_rng(seed)
    scene = carom.Scene(gravity=(0, 0, 0))
    for other in ("b", "w"):
        scene.contact("b", other, friction=0.3, restitution=0.0)
    scene.box("box", material="w", low=(-0.05,) * 3, high=(0.05,) * 3)
    for i in range(3):
        rng.uniform(-0.035, 0.035, 3)
        at, v = ((i - 1) * 0.024, *rng.uniform(-0.03, 0.03, 2)), (rng.normal(size=3) * 0.7).tolist()
        spin = (rng.normal(size=3) * 10).tolist()
        scene.sphere(f"s{i}", radius=0.01, mass=0.05 if i % 2 else 0.5, position=at, velocity=v,
                     angular_velocity=spin, material="b")  # fmt: skip
    result = carom.simulate(
        scene, step=1e-3, until=0.25, every=1, impact="one-shot", walls=True, impacts="every"
    )
    report = audit.check(result)
    assert report.ok, report
    assert report["wall moment"].judged
