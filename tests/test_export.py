"""Exports: what other programs' own readers find in the files is what the run holds, bit for bit where the format allows."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import carom
import h5py
import numpy as np
import pytest
from carom import CaromError
from carom.cli.app import app
from carom.export import FORMATS
from carom.export.atomic import whole_file, whole_folder
from typer.testing import CliRunner
from vtk_files import arrays, steps_of

R, N, G = 0.01, 3, 9.8


@pytest.fixture(scope="module")
def column() -> carom.Result:
    """Three balls on each other at rest, and a fourth that spins and flies by itself."""
    scene = carom.Scene("column", run={"until": 0.05, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for k in range(N):
        scene.sphere(f"b{k}", radius=R, density=2500, material="m", at=(0, 0, R + 2 * R * k))
    scene.sphere(
        "flier", radius=2 * R, density=2500, material="m", at=(1, 0, 1), velocity=(0.1, 0.2, 0.3), angular_velocity=(4, 5, 6)
    )  # fmt: skip
    return carom.simulate(scene)


@pytest.fixture(scope="module")
def flow() -> carom.Result:
    """Balls enter one after the other, fall, touch a floor and leave."""
    scene = carom.Scene("flow", run={"until": 0.2, "step": 1e-3}, record={"every": 5})
    scene.contact("sand", "sand", friction=0.3, restitution=0.2)
    scene.plane("slope", point=(0, 0, 0), normal=(0, -0.3, 1), material="sand")
    scene.inflow(
        "grain", count=5, region={"low": (-0.05, 0, 0.03), "high": (0.05, 0.02, 0.03)}, radius=0.009, density=2500,
        material="sand", rate=60.0, start=0.02, velocity=(0, -0.3, -0.15), seed=1,
    )  # fmt: skip
    scene.outlet(low=(-1, -1, -1), high=(1, -0.02, 1))
    return carom.simulate(scene)


@pytest.mark.parametrize("format", ["vtkhdf", "vtp"])
@pytest.mark.parametrize("which", ["column", "flow"])
def test_vtk_reads_what_the_run_holds(
    format: str, which: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    result: carom.Result = request.getfixturevalue(which)
    files = result.export(tmp_path, format)
    assert [f.stem for f in files] == ["balls", "contacts", "walls"]
    steps = steps_of(files[0])
    assert [time for time, _ in steps] == np.asarray(result.time).tolist()
    seen = set()
    for k, (_, data) in enumerate(steps):
        found, there = arrays(data), np.asarray(result.present[k])
        assert data.GetNumberOfVerts() == data.GetNumberOfPoints() == there.sum()
        seen.add(int(there.sum()))
        if not there.any():
            continue
        assert np.array_equal(found["points"], result.position[k][there])
        for name in ("velocity", "angular_velocity", "orientation"):
            assert np.array_equal(found[name], getattr(result, name)[k][there])
        for name in ("radius", "mass"):
            assert np.array_equal(found[name], result.bodies[name][there])
        assert np.array_equal(found["id"], np.flatnonzero(there))
    assert seen == {4} if which == "column" else len(seen) > 2
    contacts = steps_of(files[1])
    for k, (_, data) in enumerate(contacts):
        rows = result.contacts.at(k)
        balls = np.append(np.asarray(result.present[k]), [False] * len(result.wall_names))
        there = balls[np.asarray(rows["body"])].any(axis=1)  # both may have left since
        assert data.GetNumberOfPoints() == there.sum()
        if there.any():
            assert np.array_equal(arrays(data)["impulse"], np.asarray(rows["impulse"])[there])


@pytest.mark.parametrize("format", ["vtkhdf", "vtp"])
def test_contact_glyphs_stand_where_the_balls_touch_and_carry_their_weight(
    format: str, column: carom.Result, tmp_path: Path
) -> None:
    found = arrays(steps_of(column.export(tmp_path, format)[1])[-1][1])
    order = np.argsort(found["points"][:, 2])
    assert found["points"][order] == pytest.approx(np.array([[0, 0, 2 * R * k] for k in range(N)]), abs=1e-12)
    weight = float(column.bodies["mass"][0]) * G
    assert found["normal_force"][order] == pytest.approx(weight * np.arange(N, 0, -1), rel=1e-9)
    assert found["friction_force"] == pytest.approx(0.0, abs=1e-9 * weight)
    assert np.abs(found["branch"][order][:, 2]) == pytest.approx([R, 2 * R, 2 * R])
    assert set(found["status"]) == {1}
    upward = found["force"][:, 2] * np.sign(found["normal"][:, 2])
    assert (upward > 0).all()  # it pushes A away from B


def test_contacts_that_are_still_closed_have_the_branch_of_the_frame(tmp_path: Path) -> None:
    """Of bodies that have parted since, normal and gap are of an earlier time than the places, which nothing said."""
    scene = carom.Scene("hit", run={"until": 0.05, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.5, restitution=0.8)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for name, x, z, speed in (("low", 0, 1, 0), ("top", 0, 3, 0), ("hit", 5, 1, 0), ("hits", 7.5, 1, -1)):
        place = {"at": (x * R, 0, z * R), "velocity": (speed, 0, 0)}
        scene.sphere(name, radius=R, density=2500, material="m", **place)
    result = carom.simulate(scene)
    found = arrays(steps_of(result.export(tmp_path, "vtkhdf")[1])[1][1])
    a, b = (found[name].astype(int) for name in ("body_a", "body_b"))
    pair, centre = b < 4, np.asarray(result.position[1])
    assert {(int(i), int(j)): int(c) for i, j, c in zip(a, b, found["closed"], strict=True)} == {
        (0, 1): 1, (2, 3): 0, **{(k, 4): 1 for k in (0, 2, 3)}
    }  # fmt: skip
    off = np.linalg.norm(centre[a[pair]] - centre[b[pair]] - found["branch"][pair], axis=1)
    assert off[found["closed"][pair] == 1] == pytest.approx(0.0, abs=1e-9 * R)
    assert (off[found["closed"][pair] == 0] > 0.1 * R).all()


def test_the_files_need_no_package_beyond_the_base(column: carom.Result, tmp_path: Path) -> None:
    """What VTK would read, by h5py alone: this runs where VTK is not installed."""
    column.export(tmp_path, "vtkhdf", every=2)
    with h5py.File(tmp_path / "balls.vtkhdf") as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"PolyData"
        chosen = slice(None, None, 2)
        assert root["Steps/Values"][()].tolist() == np.asarray(column.time)[chosen].tolist()
        assert np.array_equal(root["Points"][()].reshape(-1, 4, 3), np.asarray(column.position)[chosen])
        assert np.array_equal(root["PointData/radius"], column.bodies["radius"])


@pytest.mark.parametrize("format", ["vtkhdf", "csv"])
def test_frames_are_written_many_at_a_time(
    format: str, flow: carom.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To read contacts frame by frame took most of 50 s for 3001 frames."""
    from carom.export import frames, glyphs
    from carom.result.tables import Table

    reads: list[str] = []
    read = Table.__getitem__
    monkeypatch.setattr(Table, "__getitem__", lambda self, name: reads.append(name) or read(self, name))
    whole = [path.name for path in flow.export(tmp_path / "whole", format, every=2)]
    assert reads.count("normal") < 6  # of 21 frames, with the impacts of the tables
    # The same however small the parts are, and if unwanted rows between frames are skipped rather than read.
    monkeypatch.setattr(glyphs, "ROWS", 2)
    monkeypatch.setattr(glyphs, "GAP", 0)
    monkeypatch.setattr(frames, "BLOCK_BYTES", 3 * 4 * 8 * len(flow.names))
    flow.export(tmp_path / "parts", format, every=2)
    for name in whole:
        if format == "csv":
            assert (tmp_path / "whole" / name).read_text() == (tmp_path / "parts" / name).read_text()
            continue
        with h5py.File(tmp_path / "whole" / name) as one, h5py.File(tmp_path / "parts" / name) as other:
            held = [f"{group}/{key}" for group in ("PointData", "Steps") for key in one["VTKHDF"][group]]
            for key in ("Points", *(key for key in held if not key.endswith("Offsets"))):
                assert np.array_equal(one["VTKHDF"][key][()], other["VTKHDF"][key][()]), key
            assert np.array_equal(one["VTKHDF/Steps/PointOffsets"], other["VTKHDF/Steps/PointOffsets"])


@pytest.mark.parametrize("format", ["vtkhdf", "vtp", "csv", "parquet", "extxyz"])
def test_what_the_run_has_none_of_does_not_stay_from_an_earlier_export(
    format: str, column: carom.Result, tmp_path: Path
) -> None:
    """Walls of an older run once stood in ParaView around the balls of the new one."""
    if format == "parquet":
        pytest.importorskip("pyarrow", reason="the extra [export] is not installed")
    scene = carom.Scene("alone", run={"until": 2e-3, "step": 1e-3})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.sphere("a", radius=R, mass=1.0, material="m", at=(0, 0, 0))
    alone = carom.simulate(scene)
    alone.export(tmp_path / "new", format)
    column.export(tmp_path / "both", format)
    assert len(list((tmp_path / "both").rglob("*"))) > len(list((tmp_path / "new").rglob("*")))
    alone.export(tmp_path / "both", format)

    def names(directory: Path) -> set[str]:
        return {path.relative_to(directory).as_posix() for path in directory.rglob("*")}

    assert names(tmp_path / "both") == names(tmp_path / "new")


def test_a_table_of_the_users_own_is_not_taken_for_an_old_one(column: carom.Result, tmp_path: Path) -> None:
    (tmp_path / "events.csv").write_text("day,what\n")
    (tmp_path / "walls").mkdir()
    (tmp_path / "walls" / "thesis.tex").write_text("")
    assert not len(column.events)
    column.export(tmp_path, "csv")
    assert (tmp_path / "events.csv").read_text() == "day,what\n"
    scene = carom.Scene("alone", run={"until": 2e-3, "step": 1e-3})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.sphere("a", radius=R, mass=1.0, material="m", at=(0, 0, 0))
    carom.simulate(scene).export(tmp_path, "vtp")
    assert (tmp_path / "walls" / "thesis.tex").exists()


def test_several_formats_are_those_of_the_command(column: carom.Result, tmp_path: Path) -> None:
    one_by_one = [path.name for name in ("csv", "extxyz") for path in column.export(tmp_path / name, name)]
    for several in (["csv", "extxyz"], ("csv", "extxyz"), "csv,extxyz", "csv, extxyz"):
        assert [path.name for path in column.export(tmp_path / "all", several)] == one_by_one
    for wrong in ([], "", ["csv", "vtk"], "csv,vtk", ["csv", ["vtp"]]):
        with pytest.raises(carom.CaromError, match="no export format is called"):
            column.export(tmp_path / "none", wrong)
    with pytest.raises(carom.CaromError, match="speed is an option of films; csv, vtp has none"):
        column.export(tmp_path / "none", "csv,vtp", speed=2.0)
    assert not (tmp_path / "none").exists()


def test_a_part_of_the_run_by_time(column: carom.Result, tmp_path: Path) -> None:
    column.export(tmp_path, "csv", start=0.02, stop=0.04)
    rows = read_csv(tmp_path / "frames.csv")
    assert sorted({float(r["time (s)"]) for r in rows}) == np.asarray(column.time)[2:5].tolist()
    steps = [int(r["step"]) for r in read_csv(tmp_path / "steps.csv")]
    assert steps == list(range(11, 41))  # the time before a frame belongs to it
    with pytest.raises(
        CaromError, match=r"no frame between 7 and 0.05 s; the run has frames from 0 to 0.05 s"
    ):
        column.export(tmp_path, "csv", start=7.0)


def test_tables_end_with_the_time_asked_for_however_few_frames_are_taken(
    column: carom.Result, tmp_path: Path
) -> None:
    """With a large `every` the tables once went on to the end of the run."""
    column.export(tmp_path, "csv", stop=0.03, every=1000)
    assert len({r["frame"] for r in read_csv(tmp_path / "frames.csv")}) == 1
    assert [int(r["step"]) for r in read_csv(tmp_path / "steps.csv")] == list(range(1, 31))


def read_csv(path: Path) -> list[dict[str, str]]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_csv_reads_back_bit_for_bit(flow: carom.Result, tmp_path: Path) -> None:
    files = flow.export(tmp_path, "csv")
    assert {f.stem for f in files} == {"frames", "bodies", "contacts", "impacts", "events", "steps"}
    rows = read_csv(files[0])
    present = np.asarray(flow.present)
    assert len(rows) == present.sum()
    frame, body = np.nonzero(present)
    assert [int(r["frame"]) for r in rows] == frame.tolist()
    for name, unit in (("velocity", "m/s"), ("angular_velocity", "rad/s"), ("position", "m")):
        values = np.array([[float(r[f"{name}_{c} ({unit})"]) for c in "xyz"] for r in rows])
        assert np.array_equal(values, np.asarray(getattr(flow, name))[frame, body])
    assert [r["name"] for r in rows] == [flow.names[k] for k in body]
    impacts = read_csv(tmp_path / "impacts.csv")
    assert [float(r["impulse_z (N s)"]) for r in impacts] == np.asarray(flow.impacts["impulse"])[
        :, 2
    ].tolist()
    assert [[r["a"], r["b"]] for r in impacts] == flow.impacts["pair"].tolist()


def test_parquet_holds_the_same_with_units(flow: carom.Result, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra [export] is not installed")
    files = flow.export(tmp_path, "parquet")
    assert files[0].name == "frames.parquet"
    table = parquet.read_table(files[0])
    frame, body = np.nonzero(np.asarray(flow.present))
    assert np.array_equal(table["velocity_y"].to_numpy(), np.asarray(flow.velocity)[frame, body, 1])
    assert table.schema.field("velocity_y").metadata == {b"unit": b"m/s"}
    steps = parquet.read_table(tmp_path / "steps.parquet")
    assert np.array_equal(steps["energy_kinetic"].to_numpy(), flow.energy.kinetic)
    events = parquet.read_table(tmp_path / "events.parquet")
    assert events["name"].to_pylist() == flow.events["ball"].tolist()


def test_extxyz_is_what_its_first_lines_announce(flow: carom.Result, tmp_path: Path) -> None:
    path, _ = flow.export(tmp_path, "extxyz", every=3)
    lines = path.read_text().splitlines()
    for k in range(0, len(flow.time), 3):
        count, comment = int(lines.pop(0)), lines.pop(0)
        assert comment.endswith(f" Time={float(flow.time[k])!r} Step={int(flow.step[k])}")
        there = np.flatnonzero(flow.present[k])
        assert count == len(there)
        rows = [lines.pop(0).split() for _ in range(count)]
        for row, body in zip(rows, there, strict=True):
            values = np.array(row[1:], dtype=float)
            assert np.array_equal(values[:3], flow.position[k][body])
            assert int(row[4]) == body
            assert values[4] == 0.009
            assert np.array_equal(values[6:9], flow.velocity[k][body])
            assert np.array_equal(values[9:12], flow.angular_velocity[k][body])
            assert np.array_equal(np.roll(values[12:16], 1), flow.orientation[k][body])
    assert not lines


def test_contacts_for_ovito_are_points_with_their_forces(column: carom.Result, tmp_path: Path) -> None:
    """OVITO takes the column `force` for its vector property Force; it was read so with its package, version 3.17."""
    _, path = column.export(tmp_path, "extxyz")
    assert path.name == "contacts.extxyz"
    lines = path.read_text().splitlines()
    weight = float(column.bodies["mass"][0]) * G
    for k in range(len(column.time)):
        rows = int(lines.pop(0))
        names = [
            part.split(":") for part in re.findall(r"(?:^|:)([a-z_]+:[SRI]:[0-9]+)", lines[0].split()[0][11:])
        ]
        assert lines.pop(0).endswith(f" Time={float(column.time[k])!r} Step={int(column.step[k])}")
        assert rows == (3 if k else 0)
        width = [int(number) for _, _, number in names]
        begin = dict(zip((name for name, _, _ in names), np.cumsum([0, *width]), strict=False))
        for row in sorted((lines.pop(0).split() for _ in range(rows)), key=lambda row: float(row[3])):
            height = float(row[begin["pos"] + 2])
            above = N - round(height / (2 * R))
            assert row[begin["type"]] == "stick"
            assert float(row[begin["normal_force"]]) == pytest.approx(above * weight, rel=1e-9)
            force = np.array(row[begin["force"] : begin["force"] + 3], dtype=float)
            assert np.linalg.norm(force) == pytest.approx(above * weight, rel=1e-9)
            assert len(row) == sum(width)
    assert not lines


def test_contacts_for_ovito_name_their_balls_by_the_ids_of_the_balls(
    column: carom.Result, tmp_path: Path
) -> None:
    """A contact of two balls of one size lies half way between the balls of these ids."""
    balls, contacts = (path.read_text().splitlines() for path in column.export(tmp_path, "extxyz"))
    place = {
        int(row[4]): np.array(row[1:4], dtype=float) for row in map(str.split, balls[-len(column.names) :])
    }
    pairs = [
        (np.array(row[1:4], dtype=float), int(row[-2]), int(row[-1])) for row in map(str.split, contacts[-3:])
    ]
    pairs = [(point, a, b) for point, a, b in pairs if b in place]  # the floor is no ball
    assert len(pairs) == 2
    for point, a, b in pairs:
        assert 0.5 * (place[a] + place[b]) == pytest.approx(point, abs=1e-9)


def test_contacts_of_balls_are_bonds_of_gsd(column: carom.Result, tmp_path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    with hoomd.open(str(column.export(tmp_path, "gsd")[0])) as file:
        assert file[0].bonds.N == 0
        frame = file[-1]
        assert np.sort(frame.bonds.group, axis=1).tolist() == [[0, 1], [1, 2]]  # the floor is no particle
        weight = float(column.bodies["mass"][0]) * G
        assert frame.log["bonds/normal_force"] == pytest.approx([2 * weight, weight], rel=1e-9)
        assert np.abs(frame.log["bonds/force"][:, 2]) == pytest.approx([2 * weight, weight], rel=1e-9)
    with hoomd.open(str(column.export(tmp_path, "gsd", contacts=False)[0])) as file:
        assert file[-1].bonds.N == 0


def test_bonds_of_gsd_are_of_places_in_the_frame_and_not_of_numbers_of_balls(tmp_path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    scene = carom.Scene("leaver", run={"until": 0.05, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("leaver", radius=R, density=2500, material="m", at=(0.5, 0, R), velocity=(2.0, 0, 0))
    for k in range(2):
        scene.sphere(f"b{k}", radius=R, density=2500, material="m", at=(0, 0, R + 2 * R * k))
    scene.outlet(low=(0.53, -1, -1), high=(9, 1, 1))
    result = carom.simulate(scene)
    with hoomd.open(str(result.export(tmp_path, "gsd")[0])) as file:
        assert (file[1].particles.N, file[-1].particles.N) == (3, 2)
        assert np.sort(file[1].bonds.group, axis=1).tolist() == [[1, 2]]
        assert np.sort(file[-1].bonds.group, axis=1).tolist() == [[0, 1]]


def test_gsd_reads_back(flow: carom.Result, column: carom.Result, tmp_path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    for result in (flow, column):
        [path] = result.export(tmp_path, "gsd")
        with hoomd.open(str(path)) as file:
            assert len(file) == len(result.time)
            frame, there = file[-1], np.asarray(result.present[-1])
            assert there.sum() == frame.particles.N
            assert np.array_equal(frame.log["particles/position"], result.position[-1][there])
            assert frame.particles.position == pytest.approx(result.position[-1][there], rel=1e-6, abs=1e-7)
            assert frame.particles.diameter == pytest.approx(2 * result.bodies["radius"][there], rel=1e-6)
            assert (np.abs(frame.particles.position) <= frame.configuration.box[:3] / 2).all()
            assert frame.log["configuration/time"][0] == result.time[-1]


def test_the_angular_momentum_of_gsd_turns_back_into_the_spin() -> None:
    """HOOMD: omega in the body frame is the vector part of conj(q) P / 2 over I."""
    from carom.export.gsd import _angular_momentum

    q = np.array([[0.5, 0.5, -0.5, 0.5]])
    spin = np.array([[1.0, 2.0, 3.0]])
    w, x, y, z = _angular_momentum(q, spin)[0] / 2
    a, b, c, d = q[0]
    # (0, omega_world) = P conj(q) / 2
    world = [
        x * a - w * b - y * d + z * c,
        y * a - w * c - z * b + x * d,
        z * a - w * d - x * c + y * b,
    ]
    assert world == pytest.approx([1.0, 2.0, 3.0])
    assert w * a + x * b + y * c + z * d == pytest.approx(0.0)


def test_a_periodic_box_goes_along(tmp_path: Path) -> None:
    scene = carom.Scene(
        run={"until": 0.01, "step": 1e-3}, gravity=(0, 0, 0), periodic=(1.0, 0, 0), origin=(-0.25, 0, 0)
    )
    scene.sphere("a", radius=0.1, mass=1, material="m", at=(0, 0, 0), velocity=(1, 0, 0))
    scene.contact("m", "m", friction=0, restitution=1)
    result = carom.simulate(scene, every=5)
    io = pytest.importorskip("ase.io", reason="the package ase is not installed")
    frame = io.read(result.export(tmp_path, "extxyz")[0], index=0)
    assert frame.pbc.tolist() == [True, False, False]
    assert frame.cell.array == pytest.approx(np.diag([1.0, 0.2, 0.2]))
    assert np.array(
        frame.info["Origin"].split() if isinstance(frame.info["Origin"], str) else frame.info["Origin"],
        dtype=float,
    ) == pytest.approx([-0.25, -0.1, -0.1])


def test_balls_that_crossed_a_period_lie_in_the_box_of_gsd(tmp_path: Path) -> None:
    """Places go on beyond the period in a run; HOOMD refuses such a file."""
    hoomd = pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    scene = carom.Scene(
        run={"until": 1.0, "step": 1e-2}, gravity=(0, 0, 0), periodic=(1.0, 0, 0), origin=(-0.25, 0, 0)
    )
    for name, speed in (("there", 3.0), ("back", -1.3)):
        scene.sphere(name, radius=0.1, mass=1, material="m", at=(0.3, speed, 0), velocity=(speed, 0, 0))
    scene.contact("m", "m", friction=0, restitution=1)
    result = carom.simulate(scene, every=5)
    with hoomd.open(str(result.export(tmp_path, "gsd")[0])) as file:
        for k, frame in enumerate(file):
            box, place = frame.configuration.box[:3], frame.particles.position
            assert (np.abs(place) <= 0.5 * box * (1 + 1e-6)).all()
            whole = place + frame.particles.image * box + frame.log["configuration/origin"]
            assert whole == pytest.approx(result.position[k], abs=1e-6)
        assert np.abs(frame.particles.image[:, 0]).max() >= 1


def test_ase_reads_the_balls_and_their_numbers(flow: carom.Result, tmp_path: Path) -> None:
    """Its column `species` takes chemical elements only: there must be none."""
    path, _ = flow.export(tmp_path, "extxyz")
    io = pytest.importorskip("ase.io", reason="the package ase is not installed")
    frames = io.read(path, index=":")
    assert len(frames) == len(flow.time)
    there = np.asarray(flow.present[-1])
    assert np.array_equal(frames[-1].positions, flow.position[-1][there])
    assert frames[-1].arrays["type"].tolist() == ["M0"] * int(there.sum())


class TestWhole:
    def test_nothing_half_written_takes_the_place_of_a_whole_file(self, tmp_path: Path) -> None:
        path = tmp_path / "a.txt"
        path.write_text("old")

        def break_off() -> None:
            with whole_file(path) as temporary:
                temporary.write_text("half")
                raise RuntimeError("in the middle")

        with pytest.raises(RuntimeError, match="in the middle"):
            break_off()
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]

    def test_scraps_of_a_killed_export_go_with_the_next(self, tmp_path: Path) -> None:
        process = subprocess.Popen([sys.executable, "-c", ""])
        process.wait()
        dead, alive = tmp_path / f".a.txt.{process.pid}.tmp", tmp_path / f".a.txt.{os.getppid()}.tmp"
        dead.write_text("")
        alive.write_text("")
        with whole_file(tmp_path / "a.txt") as temporary:
            temporary.write_text("new")
        assert set(tmp_path.iterdir()) == {tmp_path / "a.txt", alive}

    def test_foreign_files_are_never_deleted(self, tmp_path: Path) -> None:
        (tmp_path / "balls").mkdir()
        (tmp_path / "balls" / "thesis.tex").write_text("")
        with pytest.raises(CaromError, match=r"thesis.tex is no file of an export"):
            whole_folder(tmp_path / "balls", "*.vtp").__enter__()

    def test_a_shorter_series_leaves_no_frame_of_the_longer_one(
        self, column: carom.Result, tmp_path: Path
    ) -> None:
        column.export(tmp_path, "vtp")
        assert len(list((tmp_path / "balls").iterdir())) == len(column.time)
        column.export(tmp_path, "vtp", every=5)
        assert sorted(p.name for p in (tmp_path / "balls").iterdir()) == ["0.vtp", "5.vtp"]


class TestCommand:
    def test_writes_into_the_run_and_says_what(self, column: carom.Result, tmp_path: Path) -> None:
        run = column.save(tmp_path / "run").path
        done = CliRunner().invoke(app, ["export", str(run), "--format", "vtkhdf,csv", "--json"])
        assert done.exit_code == 0, done.output
        files = [Path(f) for f in json.loads(done.stdout)["files"]]
        assert {f.parent for f in files} == {run / "export"}
        with h5py.File(run / "export" / "balls.vtkhdf") as file:
            assert file["VTKHDF/Steps/Values"][()].tolist() == list(column.time)
        assert {f.suffix for f in files} == {".vtkhdf", ".csv"}
        from carom.result.directory import RunDir

        with RunDir.create(run, force=True).writing():  # a new run leaves no export of the old one
            assert not (run / "export" / "balls.vtkhdf").exists()

    def test_contacts_that_were_not_recorded_are_missed_aloud(self, tmp_path: Path) -> None:
        told = "contacts were not recorded, and are left out; contacts = true in [record] keeps them"
        for kept in (True, False):
            scene = carom.example("column")
            scene.record.contacts = kept
            run = carom.simulate(scene, until=0.01, out=tmp_path / str(kept)).path
            done = CliRunner().invoke(app, ["export", str(run)])
            assert done.exit_code == 0, done.output
            assert (told in done.stderr) is not kept
            assert told not in CliRunner().invoke(app, ["export", str(run), "--no-contacts"]).stderr

    @pytest.mark.parametrize(
        ("arguments", "told"),
        [
            (["--format", "vtk"], "no export format is called 'vtk'; did you mean vtp?"),
            (["--format", "OVITO"], "no export format is called 'OVITO'; OVITO reads extxyz or gsd"),
            (["--from", "3"], "no frame between 3 and"),
            (["--from", "0.8", "--to", "0.2"], "no frame from 0.8 to 0.2 s, which ends before it begins"),
        ],
    )
    def test_says_in_a_line_what_is_wrong(
        self, arguments: list[str], told: str, column: carom.Result, tmp_path: Path
    ) -> None:
        done = CliRunner().invoke(app, ["export", str(column.path), *arguments, "-o", str(tmp_path / "x")])
        assert done.exit_code == 2
        assert told in done.stderr
        assert not (tmp_path / "x").exists()

    @pytest.mark.parametrize(("format", "module"), [("parquet", "pyarrow"), ("gsd", "gsd.hoomd")])
    def test_names_the_extra_that_is_missing(
        self, format: str, module: str, column: carom.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(CaromError, match=r"pip install 'carom\[export\]'"):
            column.export(tmp_path, format)
        assert not list(tmp_path.iterdir())

    def test_every_format_is_in_the_help(self) -> None:
        text = CliRunner().invoke(app, ["export", "--help"]).stdout
        assert all(name in text for name in FORMATS)


def test_times_in_python_may_have_units(column: carom.Result, tmp_path: Path) -> None:
    middle = float(column.time[len(column.time) // 2])
    for name, times in (("s", (middle, math.inf)), ("ms", (f"{1e3 * middle} ms", None))):
        column.export(tmp_path / name, "csv", start=times[0], stop=times[1])
    assert (tmp_path / "s" / "frames.csv").read_text() == (tmp_path / "ms" / "frames.csv").read_text()
    with pytest.raises(CaromError, match="export: start: expected a time"):
        column.export(tmp_path, "csv", start="1 m")
    with pytest.raises(CaromError, match="films: at: expected a time"):
        column.export(tmp_path, "png", at="1 m")


def test_times_of_the_command_may_have_units(column: carom.Result, tmp_path: Path) -> None:
    end = float(column.time[-1])

    def exported(*times: str) -> str:
        out = tmp_path / "-".join(times).replace(" ", "_")
        command = [
            "export",
            str(column.path),
            "--format",
            "csv",
            "-o",
            str(out),
            "--from",
            times[0],
            "--to",
            times[1],
        ]
        assert CliRunner().invoke(app, command).exit_code == 0
        return (out / "frames.csv").read_text()

    assert exported("0 ms", f"{500 * end:.17g} ms") == exported("0", f"{end / 2:.17g}")
    done = CliRunner().invoke(
        app, ["export", str(column.path), "--from", "soon", "-o", str(tmp_path / "none")]
    )
    assert (done.exit_code, '--from: "soon" is not a number with a unit' in done.stderr) == (2, True)
