"""VTKHDF, temporal PolyData: balls and contacts as points, walls as triangles over time, one HDF5 file each, without VTK.

Layout: VTK's file format documentation, version 2.0 of VTKHDF. A step names offsets into arrays that hold all steps end to
end; what does not change is stored once, and every step points to it. Numbers keep their double precision.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from carom.arrays import Array
from carom.export.atomic import whole_file, without
from carom.export.frames import FIXED, Selection
from carom.export.glyphs import contact_glyphs
from carom.export.walls import walls
from carom.result.kinematics import QUANTITIES

VERSION = (2, 0)
CELLS = ("Vertices", "Lines", "Polygons", "Strips")
#: Rows of a chunk.
CHUNK = 8192
#: Bytes that are kept before they are written.
KEPT = 8 * 1024 * 1024


def write(selection: Selection, directory: Path) -> list[Path]:
    """`balls.vtkhdf`, and `contacts.vtkhdf` and `walls.vtkhdf` if the run has some."""
    files = [directory / "balls.vtkhdf"]
    fixed = {} if selection.changes else {**selection.fixed(), "id": np.arange(len(selection.result.names))}
    with whole_file(files[0]) as path, Temporal(path, fixed) as file:
        for block in selection.blocks():
            stack = block.stack()
            data = {name: stack.quantities[name] for name in QUANTITIES if name != "position"}
            if selection.changes:
                data |= {name: stack.quantities[name] for name in FIXED} | {"id": stack.body}
            file.append(stack.time, stack.count, stack.quantities["position"], data)
    if selection.with_contacts:
        files.append(directory / "contacts.vtkhdf")
        with whole_file(files[1]) as path, Temporal(path) as file:
            for glyphs in contact_glyphs(selection):
                file.append(glyphs.time, glyphs.count, glyphs.points, glyphs.data)
    found = walls(selection)
    if found is not None:
        files.append(directory / "walls.vtkhdf")
        with (
            whole_file(files[-1]) as path,
            Temporal(path, triangles=found.triangles, cells=found.cells) as file,
        ):
            times = selection.time[np.array(selection.frames)]
            for part in found.parts():
                file.append(times[part], found.corners[part], found.points(part), {}, found.faces[part])
            file.repeat(times[part.stop :])
    without(directory, {"contacts.vtkhdf", "walls.vtkhdf"} - {file.name for file in files})
    return files


class Temporal:
    """A VTKHDF file written some steps at a time: points, each a vertex cell, or with `triangles` (F, 3) those corners of
    them; a step has the first so many of these.

    `fixed` are arrays (n,) or (n, k) of the points, `cells` (F,) or (F, k) of the triangles, that belong to every step; with
    them all steps have the same number of points.
    """

    def __init__(
        self,
        path: Path,
        fixed: Mapping[str, Array] | None = None,
        *,
        triangles: Array | None = None,
        cells: Mapping[str, Array] | None = None,
    ) -> None:
        self._file = h5py.File(path, "w")
        root = self._root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(VERSION, dtype=np.int64)
        root.attrs.create("Type", np.bytes_(b"PolyData"))
        root.create_group("PointData")
        self._kept: dict[str, list[Array]] = {}
        self._lengths: dict[str, int] = {}
        self._bytes = 0
        self._fixed = dict(fixed or {})
        for name, values in self._fixed.items():
            self._append(f"PointData/{name}", values)
        self._triangles = triangles
        self._of_cells = list(cells or {})
        for name, values in (cells or {}).items():
            self._append(f"CellData/{name}", values)
        self._times: list[float] = []
        self._counts: list[int] = []
        self._begins: list[int] = []
        self._faces: list[int] = []
        self._varying: list[str] = []

    def append(
        self,
        time: Array,
        count: Array,
        points: Array,
        data: Mapping[str, Array],
        faces: Array | None = None,
    ) -> None:
        """Add steps at `time` (F,) s of `count` (F,) points each, with all their points (n, 3) and arrays (n,) or (n, k) end
        to end; the names of these are the same in every call. `faces` (F,): how many of the triangles each step has.
        """
        self._faces.extend(np.zeros_like(count).tolist() if faces is None else faces.tolist())
        self._varying = list(data)
        begin = self._append("Points", points)
        for name, values in data.items():
            self._append(f"PointData/{name}", values)
        self._times.extend(time.tolist())
        self._counts.extend(count.tolist())
        self._begins.extend((begin + np.cumsum(count) - count).tolist())

    def repeat(self, time: Array) -> None:
        """Add steps at `time` (F,) s with the points of the step before."""
        self._times.extend(time.tolist())
        self._counts.extend(self._counts[-1:] * len(time))
        self._faces.extend(self._faces[-1:] * len(time))
        self._begins.extend(self._begins[-1:] * len(time))

    def close(self) -> None:
        """Write what the steps share, and where each begins."""
        self._flush()
        steps, counts = len(self._times), np.array(self._counts, dtype=np.int64)
        faces = np.array(self._faces, dtype=np.int64)
        # A fixed number of points is one part that all steps share.
        if len(set(zip(self._counts, self._faces, strict=True))) <= 1:
            parts, faces = counts[:1], faces[:1]
        else:
            parts = counts
        root = self._root
        root["NumberOfPoints"] = parts
        for kind in CELLS:
            connected, of_parts = np.zeros((0, 1), dtype=np.int64), np.zeros_like(parts)
            # A step with fewer points or triangles reads only the beginning of both, so that all offsets of cells are 0:
            # how VTK counts others on has changed between its versions.
            if kind == "Vertices" and self._triangles is None:
                connected, of_parts = np.arange(counts.max(initial=0))[:, np.newaxis], parts
            elif kind == "Polygons" and self._triangles is not None:
                connected, of_parts = self._triangles, faces
            group = root.create_group(kind)
            corners = connected.shape[1]
            group["NumberOfCells"], group["NumberOfConnectivityIds"] = of_parts, corners * of_parts
            group["Connectivity"] = connected.ravel()
            group["Offsets"] = corners * np.arange(len(connected) + 1, dtype=np.int64)
        begin = np.array(self._begins, dtype=np.int64)
        group = root.create_group("Steps")
        group.attrs["NSteps"] = np.int64(steps)
        group["Values"] = np.array(self._times)
        group["PartOffsets"] = np.arange(steps) if len(parts) == steps else np.zeros(steps, dtype=np.int64)
        group["NumberOfParts"] = np.ones(steps, dtype=np.int64)
        group["PointOffsets"] = begin
        group["CellOffsets"] = group["ConnectivityIdOffsets"] = np.zeros((steps, len(CELLS)), dtype=np.int64)
        offsets = group.create_group("PointDataOffsets")
        for name in self._varying:
            offsets[name] = begin
        for name in self._fixed:
            offsets[name] = np.zeros(steps, dtype=np.int64)
        if self._of_cells:
            offsets = group.create_group("CellDataOffsets")
            for name in self._of_cells:
                offsets[name] = np.zeros((steps, len(CELLS)), dtype=np.int64)

    def _append(self, name: str, values: Array) -> int:
        """Add rows to an array; returns how many it had."""
        rows = self._lengths.get(name, 0)
        self._lengths[name] = rows + len(values)
        self._kept.setdefault(name, []).append(values)
        self._bytes += values.nbytes
        if self._bytes >= KEPT:
            self._flush()
        return rows

    def _flush(self) -> None:
        for name, pieces in self._kept.items():
            self._write(name, np.concatenate(pieces))
        self._kept, self._bytes = {}, 0

    def _write(self, name: str, values: Array) -> None:
        if name not in self._root:
            self._root.create_dataset(
                name,
                shape=(0, *values.shape[1:]),
                maxshape=(None, *values.shape[1:]),
                chunks=(CHUNK, *values.shape[1:]),
                dtype=np.int64 if values.dtype.kind in "iu" else np.float64,
            )
        dataset = self._root[name]
        rows = len(dataset)
        dataset.resize(rows + len(values), axis=0)
        dataset[rows:] = values

    def __enter__(self) -> Temporal:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        self._file.close()
