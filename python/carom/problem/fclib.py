"""Contact problems in files: the HDF5 layout of FCLib, and what it has no place for.

| group | form | rows of a contact | vectors |
|---|---|---|---|
| `fclib_local` | local | 2, 3 | q, mu |
| `fclib_global` | global | 2, 3 | f, w, mu |
| `fclib_global_rolling` | global | 5 | f, w, mu, mu_r |
| `fclib_local_rolling` | local | 5 | q, mu, mu_r (Carom's: FCLib has rolling in global form only) |
| `carom_local_spinning`, `carom_global_spinning` | either | 6 | also mu_s (Carom's) |

Matrices are groups `m, n, nz, nzmax, p, i, x`: `nz = -2` compressed rows, `-1` compressed columns, else triplets, of
which the first `nz` count, with the row in `i` and the column in `p` (as all files have it; a comment in FCLib's
header says the opposite). `docs/reference/problems.md` has the whole.

The groups `solution` and `guesses` are not read: what stands there need not be a solution. Links and storage that lead
out of the file are refused, and so are arrays larger than the bytes behind them (`carom.result.record.untrusted`).
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from carom.arrays import F64, Array
from carom.files import write_whole
from carom.problem.errors import ContactProblemError, ContactProblemWarning, refuse
from carom.problem.global_ import GlobalProblem
from carom.problem.local import LocalProblem
from carom.problem.matrix import Csr
from carom.result.record.untrusted import Untrusted, child, first_line, read

#: (is global, rows of a contact) -> group; and back, in the order in which a file is searched.
GROUPS = {
    (False, 2): "fclib_local",
    (False, 3): "fclib_local",
    (False, 5): "fclib_local_rolling",
    (False, 6): "carom_local_spinning",
    (True, 2): "fclib_global",
    (True, 3): "fclib_global",
    (True, 5): "fclib_global_rolling",
    (True, 6): "carom_global_spinning",
}
INFO = ("title", "description", "math_info")

#: Bytes of an array from which on a chunk that is deflated is smaller, its header counted.
LEAST_DEFLATED = 1024

#: What h5py raises over damaged files, besides the errors of its own.
UNREADABLE = (OSError, RuntimeError, MemoryError, KeyError, TypeError, ValueError, OverflowError)


def _what(path: Path) -> str:
    """What stands where a file should."""
    if path.is_dir():
        return "a directory"
    return "no regular file" if path.exists() else "no such file"


def read_fclib(path: Path | str) -> LocalProblem | GlobalProblem:
    """The contact problem of a file; the local one if it holds both forms.

    Every file that cannot be used is a `ContactProblemError` that names the file and the place in it.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise refuse("path", f"found {path!r}", "name an HDF5 file")
    path = Path(path)
    if not path.is_file():
        raise refuse(str(path), _what(path), "name an HDF5 file")
    try:
        with warnings.catch_warnings(record=True) as told, h5py.File(path, "r") as file:
            warnings.simplefilter("always", ContactProblemWarning)
            problem = _read(file)
    except ContactProblemError as error:
        raise ContactProblemError(f"{path}: {error}") from error
    except Untrusted as error:
        raise refuse(f"{path}: {error.place}", error.cause, error.cure) from error
    except UNREADABLE as error:
        cure = "is it an HDF5 file, and whole?"
        raise refuse(str(path), f"cannot be read ({first_line(error)})", cure) from error
    for warning in told:
        warnings.warn(f"{path}: {warning.message}", warning.category, stacklevel=2)
    return problem


def write_fclib(
    problem: LocalProblem | GlobalProblem,
    path: Path | str,
    *,
    extra: Mapping[str, Any] | None = None,
    compress: bool = False,
) -> Path:
    """Write a problem, matrices by compressed rows; the file is there whole or not at all.

    `extra` goes to a group `/carom`, which FCLib does not look at: arrays as they are, numbers and texts as attributes.
    With `compress` arrays are deflated, which every HDF5 library reads.
    """
    is_global = isinstance(problem, GlobalProblem)
    with h5py.File("problem", "w", driver="core", backing_store=False) as file:
        group = file.create_group(GROUPS[is_global, problem.dimension])
        _write_int(group, "spacedim", problem.dimension)
        vectors = group.create_group("vectors")
        if isinstance(problem, GlobalProblem):
            matrices, names = {"M": problem.M, "H": problem.H}, ["f", "w"]
        else:
            matrices, names = {"W": problem.W}, ["q"]
        for name, matrix in matrices.items():
            _write_matrix(group.create_group(name), matrix, compress)
        for name in (*names, "mu", "mu_r", "mu_s"):
            if getattr(problem, name) is not None:
                _write_array(vectors, name, getattr(problem, name), compress)
        info = group.create_group("info")
        for name in INFO:
            _write_text(info, name, getattr(problem, name))
        if extra is not None:
            own = file.create_group("carom")
            for name, value in extra.items():
                if np.ndim(value):
                    _write_array(own, name, np.asarray(value), compress)
                else:
                    own.attrs[name] = value
        file.flush()
        image = file.id.get_file_image()
    path = Path(path)
    write_whole(path, image, durable=False, parents=True)
    return path


def _read(file: h5py.File) -> LocalProblem | GlobalProblem:
    found = [name for name in dict.fromkeys(GROUPS.values()) if isinstance(child(file, name), h5py.Group)]
    if not found:
        there = ", ".join(map(str, list(file)[:6])) or "nothing"
        raise refuse(
            "/",
            f"no contact problem (there is {there})",
            f"one of {', '.join(dict.fromkeys(GROUPS.values()))}",
        )
    name = found[0]
    group = child(file, name)
    dimension = _int(group, "spacedim")
    is_global = "global" in name
    allowed = [d for (whole, d), g in GROUPS.items() if g == name and whole == is_global]
    if dimension not in allowed:
        raise refuse(f"{name}/spacedim", str(dimension), f"{' or '.join(map(str, allowed))} are known")
    for constraint in ("G", "V", "R"):
        if constraint in group:
            cause = "bilateral constraints beside the contacts"
            raise refuse(f"{name}/{constraint}", cause, "eliminate them first; they are not supported")
    vectors = _group(group, "vectors")
    mu = _floats(vectors, "mu")
    rest: dict[str, Any] = {key: _text(group, key) for key in INFO}
    if is_global:
        f, w = _floats(vectors, "f"), _floats(vectors, "w")
        m, h = _matrix(group, "M", (len(f), len(f))), _matrix(group, "H", (len(f), len(w)))
        rest |= {key: _floats(vectors, key) for key in ("mu_r", "mu_s") if key in vectors}
        return GlobalProblem(M=m, H=h, f=f, w=w, mu=mu, dimension=dimension, **rest)
    q = _floats(vectors, "q")
    matrix = _matrix(group, "W", (len(q), len(q)))
    rest |= {key: _floats(vectors, key) for key in ("mu_r", "mu_s") if key in vectors}
    return LocalProblem(W=matrix, q=q, mu=mu, dimension=dimension, **rest)


# --- pieces of a file ---------------------------------------------------------------------------------------------


def _group(group: h5py.Group, key: str) -> h5py.Group:
    found = child(group, key)
    if not isinstance(found, h5py.Group):
        raise refuse(f"{group.name}/{key}", "missing", "a contact problem has this group")
    return found


def _array(group: h5py.Group, key: str, kinds: str) -> Array:
    array: Array = np.atleast_1d(read(group, key, kinds))
    return array.reshape(-1)


def _floats(group: h5py.Group, key: str) -> F64:
    return _array(group, key, "fiu").astype(np.float64)


def _int(group: h5py.Group, key: str) -> int:
    array = _array(group, key, "iu")
    if len(array) != 1:
        raise refuse(f"{group.name}/{key}", f"{len(array)} numbers", "one is wanted")
    return int(array[0])


def _text(group: h5py.Group, key: str) -> str:
    """A string of `info`, "" if missing; published ones hold bytes that are no UTF-8."""
    found = child(group, f"info/{key}")
    if (
        not isinstance(found, h5py.Dataset)
        or found.shape not in ((), (1,))
        or found.is_virtual
        or found.external
    ):
        return ""
    value = found[()] if found.shape == () else found[0]
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)


def _matrix(group: h5py.Group, key: str, shape: tuple[int, int]) -> Csr:
    """A matrix that must have `shape`, which the vectors say: so a damaged size asks for no memory."""
    g = _group(group, key)
    place = f"{key} (m, n)"
    m, n, nz = (_int(g, name) for name in ("m", "n", "nz"))
    if (m, n) != shape:
        raise refuse(place, f"{m} x {n}", f"with vectors of this length it must be {shape[0]} x {shape[1]}")
    p, i, x = _array(g, "p", "iu"), _array(g, "i", "iu"), _array(g, "x", "fiu")
    if nz in (-1, -2):
        return Csr.from_compressed(p, i, x, shape, by="columns" if nz == -1 else "rows", name=key)
    if nz < 0:
        raise refuse(
            f"{key}/nz", str(nz), "-2 are compressed rows, -1 compressed columns, others a number of triplets"
        )
    if min(len(p), len(i), len(x)) < nz:
        cause = f"{nz} triplets announced, {min(len(p), len(i), len(x))} there"
        raise refuse(f"{key}/nz", cause, "the matrix is damaged")
    return Csr.from_triplets(i[:nz], p[:nz], x[:nz], shape, key)


def _write_matrix(group: h5py.Group, a: Csr, compress: bool) -> None:
    if max(a.entries, *a.shape) > np.iinfo(np.int32).max:
        raise refuse("W, M or H", f"{a.entries} entries", "FCLib counts with 32 bits")
    for name, value in (("nzmax", a.entries), ("m", a.shape[0]), ("n", a.shape[1]), ("nz", -2)):
        _write_int(group, name, value)
    for name, values in (("p", a.indptr.astype(np.int32)), ("i", a.indices.astype(np.int32)), ("x", a.data)):
        _write_array(group, name, values, compress)


def _write_array(group: h5py.Group, name: str, values: Array, compress: bool) -> None:
    """An array; deflated only where that makes it smaller: a chunk has a price of its own."""
    if compress and values.nbytes > LEAST_DEFLATED:
        group.create_dataset(name, data=values, chunks=values.shape, compression=9, shuffle=True)
    else:
        group[name] = values


def _write_int(group: h5py.Group, name: str, value: int) -> None:
    group[name] = np.array([value], dtype=np.int32)


def _write_text(group: h5py.Group, name: str, text: str) -> None:
    """A string of fixed length with its closing zero: FCLib, a C program, reads nothing else."""
    data = text.encode("utf-8").replace(b"\0", b" ") + b"\0"
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(data))
    kind.set_strpad(h5py.h5t.STR_NULLTERM)
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)  # equal problems give equal files
    space = h5py.h5s.create(h5py.h5s.SCALAR)
    dataset = h5py.h5d.create(group.id, name.encode(), kind, space, dcpl=plan)
    dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.array(data, dtype=f"S{len(data)}"), mtype=kind)
