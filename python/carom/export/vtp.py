"""VTK's XML files: a `.vtp` per frame and a `.pvd` that lists them with their times, for every version of ParaView.

Arrays stand at the end of a file as raw bytes (`appended`), in the byte order of this machine, in double precision.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from carom.arrays import Array
from carom.export.atomic import whole_file, whole_folder, without
from carom.export.frames import FIXED, Frame, Selection
from carom.export.glyphs import contact_glyphs
from carom.export.walls import walls
from carom.result.kinematics import QUANTITIES

#: What the files in the folders of a series are called.
OWN = "*.vtp"
ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"


def write(selection: Selection, directory: Path) -> list[Path]:
    """`balls.pvd`, and `contacts.pvd` and `walls.pvd` if the run has some; the frames are in folders of these names."""
    files = [_series(selection, directory, "balls", (polydata(*_balls(frame)) for frame in selection))]
    if selection.with_contacts:
        glyphs = (polydata(*frame) for part in contact_glyphs(selection) for frame in part)
        files.append(_series(selection, directory, "contacts", glyphs))
    found = walls(selection)
    if found is not None:
        placed = (
            # Walls at rest have one file for all times.
            polydata(
                found.points(slice(k, k + 1)),
                {},
                found.triangles[:n],
                {name: values[:n] for name, values in found.cells.items()},
            )
            if found.moves or k == 0
            else None
            for k, n in enumerate(found.faces.tolist())
        )
        files.append(_series(selection, directory, "walls", placed))
    without(directory, {"contacts.pvd", "walls.pvd"} - {file.name for file in files}, own=OWN)
    return files


def _series(selection: Selection, directory: Path, what: str, steps: Iterable[bytes | None]) -> Path:
    """The file of each chosen frame, and their list; a frame without one shares that of the frame before."""
    digits = len(str(selection.frames[-1]))
    listed: list[tuple[float, str]] = []
    with whole_folder(directory / what, own=OWN) as folder:
        for index, content in zip(selection.frames, steps, strict=True):
            name = f"{index:0{digits}d}.vtp"
            if content is not None:
                (folder / name).write_bytes(content)
            listed.append(
                (float(selection.time[index]), listed[-1][1] if content is None else f"{what}/{name}")
            )
        # Between here and the end of the function a reader finds no list, never one of frames that are not there.
        (directory / f"{what}.pvd").unlink(missing_ok=True)
    with whole_file(directory / f"{what}.pvd") as path:
        path.write_text(_collection(listed), encoding="utf-8")
    return directory / f"{what}.pvd"


def _balls(frame: Frame) -> tuple[Array, dict[str, Array]]:
    names = [*(name for name in QUANTITIES if name != "position"), *FIXED]
    return frame.position, {**{name: frame.quantities[name] for name in names}, "id": frame.body}


def polydata(
    points: Array,
    data: Mapping[str, Array],
    triangles: Array | None = None,
    cells: Mapping[str, Array] | None = None,
) -> bytes:
    """A `.vtp` file of points (n, 3) with arrays (n,) or (n, k): each a vertex, or with `triangles` (F, 3), which may have
    arrays `cells` too, (F,) or (F, k).
    """
    blobs: list[bytes] = []
    size = 0

    def array(values: Array, name: str = "") -> str:
        nonlocal size
        values = np.ascontiguousarray(values, dtype=np.int64 if values.dtype.kind in "iu" else np.float64)
        kind = "Int64" if values.dtype.kind == "i" else "Float64"
        components = values.shape[1] if values.ndim == 2 else 1
        blob = np.uint64(values.nbytes).tobytes() + values.tobytes()
        offset, size = size, size + len(blob)
        blobs.append(blob)
        called = f"Name={quoteattr(name)} " if name else ""
        return f'<DataArray type="{kind}" {called}NumberOfComponents="{components}" format="appended" offset="{offset}"/>'

    count = len(points)
    section, corners = (
        ("Verts", np.arange(count)[:, np.newaxis]) if triangles is None else ("Polys", triangles)
    )
    numbers = dict.fromkeys(("Verts", "Lines", "Strips", "Polys"), 0) | {section: len(corners)}
    counted = " ".join(f'NumberOf{name}="{number}"' for name, number in numbers.items())
    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="PolyData" version="1.0" byte_order="{ORDER}" header_type="UInt64">',
        "<PolyData>",
        f'<Piece NumberOfPoints="{count}" {counted}>',
        "<PointData>",
        *(array(values, name) for name, values in data.items()),
        "</PointData>",
        "<CellData>",
        *(array(values, name) for name, values in (cells or {}).items()),
        "</CellData>",
        "<Points>",
        array(points, "Points"),
        "</Points>",
        f"<{section}>",
        array(corners.ravel(), "connectivity"),
        array(corners.shape[1] * np.arange(1, len(corners) + 1), "offsets"),
        f"</{section}>",
        "</Piece>",
        "</PolyData>",
        '<AppendedData encoding="raw">',
    ]
    return "\n".join(lines).encode() + b"\n_" + b"".join(blobs) + b"\n</AppendedData>\n</VTKFile>\n"


def _collection(listed: Iterable[tuple[float, str]]) -> str:
    entries = "\n".join(
        f'<DataSet timestep="{time!r}" part="0" file={quoteattr(name)}/>' for time, name in listed
    )
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="{ORDER}">\n<Collection>\n'
        f"{entries}\n</Collection>\n</VTKFile>\n"
    )
