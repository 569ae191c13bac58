"""VTK's XML files: a `.vtp` per frame and a `.pvd` that lists them with their times, for every version of ParaView.

Arrays stand at the end of a file as raw bytes (`appended`), in the byte order of this machine, in double precision.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from carom.export.frames import FIXED, MOVING, Frame, Selection
from carom.export.glyphs import contact_glyphs
from carom.export.whole import whole_file, whole_folder

ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"


def write(selection: Selection, directory: Path) -> list[Path]:
    """`balls.pvd`, and `contacts.pvd` if the run has some; the frames are in folders of these names."""
    files = [_series(selection, directory, "balls")]
    if selection.with_contacts:
        files.append(_series(selection, directory, "contacts"))
    return files


def _series(selection: Selection, directory: Path, what: str) -> Path:
    digits = len(str(selection.frames[-1]))
    listed = []
    with whole_folder(directory / what, own="*.vtp") as folder:
        for frame in selection:
            name = f"{frame.index:0{digits}d}.vtp"
            arrays = _balls(frame) if what == "balls" else contact_glyphs(selection, frame)
            (folder / name).write_bytes(points_file(*arrays))
            listed.append((frame.time, f"{what}/{name}"))
        # Between here and the end of the function a reader finds no list, never one of frames that are not there.
        (directory / f"{what}.pvd").unlink(missing_ok=True)
    with whole_file(directory / f"{what}.pvd") as path:
        path.write_text(_collection(listed), encoding="utf-8")
    return directory / f"{what}.pvd"


def _balls(frame: Frame) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    names = [*(name for name in MOVING if name != "position"), *FIXED]
    return frame.position, {**{name: frame.quantities[name] for name in names}, "id": frame.body}


def points_file(points: NDArray[Any], data: Mapping[str, NDArray[Any]]) -> bytes:
    """A `.vtp` file of points (n, 3), each a vertex, with arrays (n,) or (n, k)."""
    blobs: list[bytes] = []
    size = 0

    def array(values: NDArray[Any], name: str = "") -> str:
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
    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="PolyData" version="1.0" byte_order="{ORDER}" header_type="UInt64">',
        "<PolyData>",
        f'<Piece NumberOfPoints="{count}" NumberOfVerts="{count}" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0">',
        "<PointData>",
        *(array(values, name) for name, values in data.items()),
        "</PointData>",
        "<Points>",
        array(points, "Points"),
        "</Points>",
        "<Verts>",
        array(np.arange(count), "connectivity"),
        array(np.arange(1, count + 1), "offsets"),
        "</Verts>",
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
