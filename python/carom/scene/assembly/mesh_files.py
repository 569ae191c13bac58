"""Meshes from files: STL, OBJ, PLY and what else trimesh reads."""

from __future__ import annotations

import logging
from functools import lru_cache
from pathlib import Path

import numpy as np

from carom.arrays import F64, I64
from carom.errors import extra, quoted
from carom.scene.assembly.triangles import Triangles

THIN = 1e-10
"""Least height over the longest edge of a triangle that has a direction, as in the core (`mesh.rs`)."""
NAMED = 5
"""Bad triangles that a message names."""
MOST = 5_000_000
"""Most triangles of a mesh."""


class MeshError(Exception):
    """A mesh that cannot be used: cause and cure."""

    def __init__(self, cause: str, cure: str) -> None:
        super().__init__(f"{cause}; {cure}")
        self.cause, self.cure = cause, cure


def read(path: str | Path) -> tuple[F64, I64]:
    """Points (V, 3), in the unit of the file, and triangles (T, 3) of a file. Points in one place are one.

    Raises `MeshError`. A file that has not changed is read once.
    """
    path = Path(path)
    try:
        state = path.stat()
    except FileNotFoundError:
        raise MeshError(
            f"there is no file {quoted(str(path))}", "check the path, from the scenario file on"
        ) from None
    except (OSError, ValueError) as error:
        raise MeshError(f"{quoted(str(path))} cannot be read ({error})", "check the path") from None
    if not path.is_file():
        raise MeshError(f"{quoted(str(path))} is no file", "name an STL, OBJ or PLY file")
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=8)
def _read(path: Path, changed: int, size: int) -> tuple[F64, I64]:
    trimesh = extra("trimesh", "meshes from files need trimesh", "mesh")
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        mesh = trimesh.load_mesh(path, process=True)
        vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        corners = np.ascontiguousarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # whatever its readers raise
        raise MeshError(
            f"{quoted(path.name)} is no mesh that trimesh reads ({type(error).__name__}: {error})",
            "name an STL, OBJ or PLY file of triangles",
        ) from None
    if len(corners) == 0:
        raise MeshError(f"{quoted(path.name)} has no triangles", "name an STL, OBJ or PLY file of triangles")
    return vertices, corners


def checked(vertices: F64, corners: I64, *, clean: bool) -> Triangles:
    """A mesh that the core takes. Raises `MeshError` with the bad triangles; `clean` leaves out those without an area."""
    if len(corners) > MOST:
        raise MeshError(f"has {len(corners)} triangles, more than {MOST}", "simplify the mesh")
    if len(corners) == 0 or corners.min() < 0 or corners.max() >= len(vertices):
        wrong = np.flatnonzero((corners < 0).any(axis=1) | (corners >= len(vertices)).any(axis=1))
        cause = _named("name points that are not there", wrong) if len(wrong) else "has no triangles"
        raise MeshError(cause, f"number the {len(vertices)} points from 0")
    if not np.isfinite(vertices).all():
        wrong = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        raise MeshError(_named("are not finite", wrong, "points"), "repair the mesh")
    with np.errstate(all="ignore"):
        made = Triangles(vertices, corners)
        edges = made.at - np.roll(made.at, -1, axis=1)
        longest = (edges**2).sum(axis=2).max(axis=1)
        thin = ~(np.linalg.norm(made.across, axis=1) > 2 * THIN * longest)
    if thin.any() and not clean:
        cause = _named("have their corners on one line", np.flatnonzero(thin))
        raise MeshError(cause, "write clean = true to leave them out, or repair the mesh")
    if thin.all():
        raise MeshError("has no triangle with an area", "check the mesh and its scale")
    return Triangles(vertices, corners[~thin])


def _named(what: str, wrong: I64, of: str = "triangles") -> str:
    names = ", ".join(map(str, wrong[:NAMED].tolist()))
    more = f" and {len(wrong) - NAMED} more" if len(wrong) > NAMED else ""
    return f"{of} {names}{more} (counted from 0) {what}"
