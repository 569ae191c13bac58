"""Meshes from files: STL, OBJ, PLY and what else trimesh reads."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path

import numpy as np

from carom.arrays import F64, I64
from carom.errors import extra, quoted
from carom.scene.assembly.triangles import Triangles
from carom.scene.tables.fields import refuse

THIN = 1e-10
"""Least height over the longest edge of a triangle that has a direction, as in the core (`mesh.rs`)."""
NAMED = 5
"""Bad triangles that a message names."""


KEPT: ContextVar[Mapping[tuple[str, bool], Triangles]] = ContextVar("KEPT")
"""Surfaces that were read before, by file and `clean`: files of these are not looked at."""


def surface(path: str, *, clean: bool) -> Triangles:
    """The triangles of a file, or those kept of it."""
    kept = KEPT.get({}).get((path, clean))
    return kept if kept is not None else checked(*read(path), clean=clean)


@contextmanager
def kept(surfaces: Mapping[tuple[str, bool], Triangles]) -> Iterator[None]:
    """Within it these are what their files hold."""
    token = KEPT.set(surfaces)
    try:
        yield
    finally:
        KEPT.reset(token)


def read(path: str | Path) -> tuple[F64, I64]:
    """Points (V, 3), in the unit of the file, and triangles (T, 3) of a file. Points in one place are one.

    What is wrong is a `refuse(...)`. A file that has not changed is read once.
    """
    path = Path(path)
    try:
        state = path.stat()
    except FileNotFoundError:
        raise refuse(
            f"there is no file {quoted(str(path))}", "check the path, from the scenario file on"
        ) from None
    except (OSError, ValueError) as error:
        raise refuse(f"{quoted(str(path))} cannot be read ({error})", "check the path") from None
    if not path.is_file():
        raise refuse(f"{quoted(str(path))} is no file", "name an STL, OBJ or PLY file")
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=8)
def _read(path: Path, changed: int, size: int) -> tuple[F64, I64]:
    trimesh = extra("trimesh", "meshes from files need trimesh", "mesh")
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        mesh = trimesh.load_mesh(path, process=True)
        vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        corners = np.ascontiguousarray(mesh.faces, dtype=np.int64)
        if len(corners) == 0:
            raise ValueError("it has no triangles")
    except Exception as error:  # whatever its readers raise
        raise refuse(
            f"{quoted(path.name)} is no mesh that trimesh reads ({type(error).__name__}: {error})",
            "name an STL, OBJ or PLY file of triangles",
        ) from None
    return vertices, corners


def checked(vertices: F64, corners: I64, *, clean: bool) -> Triangles:
    """A mesh that the core takes. Refuses what has bad triangles, by number; `clean` leaves out those without an area."""
    if corners.min() < 0 or corners.max() >= len(vertices):
        wrong = np.flatnonzero((corners < 0).any(axis=1) | (corners >= len(vertices)).any(axis=1))
        cure = f"number the {len(vertices)} points from 0"
        raise refuse(f"triangles {_numbers(wrong)} name points that are not there", cure)
    if not np.isfinite(vertices).all():
        wrong = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        raise refuse(f"points {_numbers(wrong)} are not finite", "repair the mesh")
    with np.errstate(all="ignore"):
        made = Triangles(vertices, corners)
        edges = made.at - np.roll(made.at, -1, axis=1)
        longest = (edges**2).sum(axis=2).max(axis=1)
        thin = ~(np.linalg.norm(made.across, axis=1) > 2 * THIN * longest)
    if thin.any() and not clean:
        cause = f"triangles {_numbers(np.flatnonzero(thin))} have their corners on one line"
        raise refuse(cause, "write clean = true to leave them out, or repair the mesh")
    if thin.all():
        raise refuse("no triangle has an area", "check the mesh")
    return Triangles(vertices, corners[~thin])


def _numbers(wrong: I64) -> str:
    named = ", ".join(map(str, wrong[:NAMED].tolist()))
    return f"{named}{f' and {len(wrong) - NAMED} more' if len(wrong) > NAMED else ''} (counted from 0)"
