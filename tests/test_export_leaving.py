"""Exports of contacts whose balls left before the frame: tables have them all, other formats those with a place."""

from __future__ import annotations

import csv
from pathlib import Path

import carom
import numpy as np
import pytest
from vtk_files import arrays, steps_of

R = 0.01
pytestmark = pytest.mark.filterwarnings("ignore:.*oblique hits lose accuracy:carom.CaromWarning")


@pytest.fixture(scope="module")
def leaving() -> carom.Result:
    """A ball rests on a floor and another one slides away; of two pairs that hit one another one ball leaves at once."""
    scene = carom.Scene("leaving", run={"until": 0.1, "step": 1e-3}, record={"every": 20, "walls": True})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("first", radius=R, mass=0.01, position=(0, 0, R), velocity=(1, 0, 0), material="m")
    scene.sphere("rests", radius=R, mass=0.01, position=(0, 0.1, R), material="m")
    goes, stays = (1.0, 0, 0), (0, 1.0, 0)
    for name, y, v in (
        ("goes", 0.2, goes),
        ("stays", 0.2 - 2.02 * R, stays),
        ("stays2", 0.4 - 2.02 * R, stays),
        ("goes2", 0.4, goes),
    ):
        scene.sphere(name, radius=R, mass=0.01, position=(0.04, y, R), velocity=v, material="m")
    scene.outlet(low=(0.045, -1, -1), high=(1, 1, 1))
    return carom.simulate(scene)


def test_tables_have_every_contact_and_its_impulse(leaving: carom.Result, tmp_path: Path) -> None:
    files = {path.stem: path for path in leaving.export(tmp_path, "csv")}
    with files["contacts"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(leaving.contacts)
    on_floor = np.zeros(len(leaving))
    for row in rows:
        on_floor[int(row["frame"])] += float(row["impulse_z (N s)"]) * (row["b"] == "floor")
    assert on_floor == pytest.approx(-np.asarray(leaving.walls["floor"].impulse)[:, 2], abs=1e-15)
    assert on_floor[3] > 1.05 * on_floor[4] > 0  # those that left in between pressed on the floor, too
    absent = [row for row in rows if row["point_x (m)"] == "nan"]
    assert {(row["a"], row["b"]) for row in absent} == {
        ("first", "floor"),
        ("goes", "floor"),
        ("goes2", "floor"),
    }


@pytest.mark.parametrize("format", ["vtkhdf", "vtp", "extxyz"])
def test_points_are_of_contacts_of_which_a_ball_is_there(
    format: str, leaving: carom.Result, tmp_path: Path
) -> None:
    paths = {path.stem: path for path in leaving.export(tmp_path, format)}
    if format == "extxyz":
        lines = paths["contacts"].read_text().splitlines()
        count = [int(line) for line in lines if line.isdigit()]
    else:
        count = [data.GetNumberOfPoints() for _, data in steps_of(paths["contacts"])]
    there = np.append(np.asarray(leaving.present), np.zeros((len(leaving), 1), dtype=bool), axis=1)
    bodies = [np.asarray(leaving.contacts.at(k).body) for k in range(len(leaving))]
    assert count == [int(there[k][body].any(axis=1).sum()) for k, body in enumerate(bodies)]
    assert sum(count) < len(leaving.contacts)


def test_the_ball_that_stays_tells_the_place(leaving: carom.Result, tmp_path: Path) -> None:
    """Of the hit of two balls one has left at the next frame; the point is on the other one, whichever of them is A."""
    contacts = steps_of({path.stem: path for path in leaving.export(tmp_path, "vtkhdf")}["contacts"])
    names = leaving.names
    found = arrays(contacts[1][1])
    pair = (found["body_a"] < len(names)) & (found["body_b"] < len(names))
    pairs = np.stack([found["body_a"], found["body_b"]], axis=1)[pair]
    assert [[names[i] for i in row] for row in pairs] == [["goes", "stays"], ["stays2", "goes2"]]
    stays = np.where(np.asarray(leaving.present)[1][pairs], pairs, -1).max(axis=1)
    assert [names[i] for i in stays] == ["stays", "stays2"]
    away = np.linalg.norm(found["points"][pair] - np.asarray(leaving.position)[1, stays], axis=1)
    assert away == pytest.approx(R, abs=1e-3)


def test_bonds_of_gsd_need_both_balls(leaving: carom.Result, tmp_path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    with hoomd.open(str(leaving.export(tmp_path, "gsd")[0])) as file:
        assert [frame.bonds.N for frame in file] == [0] * len(leaving)
