"""Walls for ParaView, by VTK's own readers: shape, place at every time, and whose triangles they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from vtk_files import arrays, steps_of

SHAKEN, RATE = 0.03, 40.0


@pytest.fixture(scope="module")
def room() -> carom.Result:
    """A ball above a floor without end, and walls of every shape, two of which move."""
    scene = carom.Scene("room", run={"until": 0.05, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "n", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.plane("plate", point=(0.5, 0, 0.1), normal=(0, 0, 1), size=(0.2, 0.1), material="m",
                motion={"translation": [0, 0, {"expression": f"{SHAKEN}*sin({RATE}*t)"}]})  # fmt: skip
    scene.plane("ring", point=(0, 0.5, 0.1), normal=(0, 0, 1), radius=0.1, hole=0.05, material="m")
    scene.cylinder("drum", point=(-0.5, 0, 0.3), axis=(0, 1, 0), radius=0.1, length=0.2, inside=False, material="m",
                   motion={"rotation": {"axis": (0, 1, 0), "rate": 5.0}})  # fmt: skip
    scene.ball_wall("stone", point=(0, -0.5, 0.2), radius=0.1, inside=False, material="m")
    scene.cone("spike", point=(0.5, 0.5, 0.1), axis=(0, 0, 1), radius=0.1, radius_end=0, length=0.1, inside=False,
               material="m")  # fmt: skip
    scene.sphere("ball", radius=0.02, mass=0.1, material="n", at=(0, 0, 0.05))
    return carom.simulate(scene)


def triangles(data: Any) -> Any:
    """Corners (F, 3, 3) of the polygons of a vtkPolyData, all of which are triangles."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    assert data.GetNumberOfVerts() == data.GetNumberOfLines() == 0
    rows = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    assert len(rows) == data.GetNumberOfPolys()
    return arrays(data)["points"][rows]


def of_cells(data: Any, name: str) -> Any:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(data.GetCellData().GetArray(name))


@pytest.mark.parametrize("format", ["vtkhdf", "vtp"])
def test_vtk_reads_all_walls_at_all_times(format: str, room: carom.Result, tmp_path: Path) -> None:
    file = room.export(tmp_path, format)[-1]
    assert file.stem == "walls"
    steps = steps_of(file)
    assert [time for time, _ in steps] == np.asarray(room.time).tolist()
    areas = {
        "plate": 0.02,
        "ring": np.pi * (0.01 - 0.0025),
        "drum": 2 * np.pi * 0.1 * 0.2,
        "stone": 4 * np.pi * 0.01,
        "spike": np.pi * 0.1 * np.hypot(0.1, 0.1),
    }
    for time, data in steps:
        corners, owner = triangles(data), of_cells(data, "id")
        assert set(owner) == {1 + wall.index for wall in room.walls.values()}  # as body_b of contacts
        assert set(of_cells(data, "material")) == {room.walls["floor"].facts["material"]}
        vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(vectors, axis=1)

        def mine(name: str, owner: Any = owner) -> Any:
            return owner == 1 + room.walls[name].index

        for name, area in areas.items():
            assert size[mine(name)].sum() == pytest.approx(area, rel=0.01), name
        plate = corners[mine("plate")]
        assert plate[..., 2] == pytest.approx(0.1 + SHAKEN * np.sin(RATE * time), abs=1e-12)
        floor = corners[mine("floor")]
        assert floor[..., 2] == pytest.approx(0.0, abs=1e-15)
        assert floor[..., 0].min() < -0.02  # it has no end, and reaches past the ball
        assert floor[..., 0].max() > 0.02
        drum = corners[mine("drum")] - [-0.5, 0, 0.3]
        assert np.hypot(drum[..., 0], drum[..., 2]) == pytest.approx(0.1)
        first = corners_at_start(steps, room, "drum") - [-0.5, 0, 0.3]
        c, s = np.cos(5 * time), np.sin(5 * time)
        assert drum == pytest.approx(first @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T, abs=1e-12)


def corners_at_start(steps: Any, room: carom.Result, name: str) -> Any:
    data = steps[0][1]
    return triangles(data)[of_cells(data, "id") == 1 + room.walls[name].index]


def resting(tmp_path: Path) -> carom.Result:
    scene = carom.Scene("rest", run={"until": 0.02, "step": 1e-3}, record={"every": 5})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("ball", radius=0.02, mass=0.1, material="m", at=(0, 0, 0.02))
    return carom.simulate(scene, out=tmp_path / "run")


@pytest.mark.parametrize("format", ["vtkhdf", "vtp"])
def test_walls_at_rest_are_there_at_every_time_and_stored_once(format: str, tmp_path: Path) -> None:
    result = resting(tmp_path)
    file = result.export(tmp_path / "x", format)[-1]
    if format == "vtkhdf":
        with h5py.File(file) as root:
            assert root["VTKHDF/Points"].shape == (4, 3)
    else:
        assert len(list((tmp_path / "x" / "walls").iterdir())) == 1
    steps = steps_of(file)
    assert len(steps) == len(result.time) == 5
    assert all(data.GetNumberOfPolys() == 2 for _, data in steps)


def test_the_layout_without_vtk(room: carom.Result, tmp_path: Path) -> None:
    """What VTK would read, by h5py alone: this runs where VTK is not installed."""
    room.export(tmp_path, "vtkhdf", every=2)
    with h5py.File(tmp_path / "walls.vtkhdf") as file:
        root = file["VTKHDF"]
        faces, corners = int(root["Polygons/NumberOfCells"][0]), int(root["NumberOfPoints"][0])
        assert root["Polygons/Offsets"][()].tolist() == list(range(0, 3 * faces + 1, 3))
        assert root["Polygons/Connectivity"][()].max() == corners - 1
        assert root["CellData/id"].shape == (faces,)
        begins = root["Steps/PointOffsets"][()]
        assert begins.tolist() == [k * corners for k in range(len(root["Steps/Values"]))]
        place = root["Points"][()].reshape(-1, corners, 3)
        index = np.unique(
            root["Polygons/Connectivity"][()].reshape(-1, 3)[
                root["CellData/id"][()] == 1 + room.walls["plate"].index
            ]
        )
        law = 0.1 + SHAKEN * np.sin(RATE * root["Steps/Values"][()])
        assert place[:, index, 2] == pytest.approx(np.repeat(law[:, None], 4, axis=1), abs=1e-12)


def test_a_scene_without_walls_has_no_file_of_them(tmp_path: Path) -> None:
    scene = carom.Scene("free", run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0, restitution=1)
    scene.sphere("a", radius=0.1, mass=1, material="m", at=(0, 0, 0))
    assert [f.name for f in carom.simulate(scene).export(tmp_path, "vtkhdf")] == ["balls.vtkhdf"]


@pytest.mark.parametrize("format", ["vtkhdf", "vtp"])
def test_a_wall_that_is_taken_away_has_no_triangles_from_then_on(format: str, tmp_path: Path) -> None:
    """Ends of the walls in frames, one of which moves and one goes first of all though it is told first; then none is."""
    ends = {"early": 1, "late": 3, "moving": 2}
    scene = carom.Scene("gone", gravity=(0, 0, 0), run={"until": 0.05, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    for k, (name, end) in enumerate(ends.items()):
        motion: dict[str, Any] = {"until": 0.01 * end}
        if name == "moving":
            motion["translation"] = [0, {"expression": "t"}, 0]
        scene.plane(
            name, point=(k, 0, 1), normal=(0, 0, 1), size=(0.1 * (k + 1), 1), material="m", motion=motion
        )
    scene.sphere("ball", radius=0.02, mass=0.1, material="m", at=(0, 0, 0.05))
    result = carom.simulate(scene)
    first = {1 + result.walls[name].index: (name, end) for name, end in ends.items()}
    for frame, (time, data) in enumerate(steps_of(result.export(tmp_path, format)[-1])):
        there = sorted(k for k, (_, end) in first.items() if frame <= end)
        corners, ids = triangles(data), of_cells(data, "id")
        assert sorted(set(ids.tolist())) == there
        assert data.GetNumberOfPoints() == 4 * len(there)
        for k in there:
            mine = corners[ids == k]
            area = (
                0.5 * np.linalg.norm(np.cross(mine[:, 1] - mine[:, 0], mine[:, 2] - mine[:, 0]), axis=1).sum()
            )
            assert area == pytest.approx(0.1 * k, rel=1e-12)
            low = mine.reshape(-1, 3).min(axis=0)
            moved = time if first[k][0] == "moving" else 0.0
            assert low == pytest.approx([k - 1 - 0.05 * k, moved - 0.5, 1.0])
