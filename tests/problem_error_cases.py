"""A mistake for every message about contact problems: a call that provokes it, and what the message must call the place.

The key is cause and cure as `error_catalogue` reads them from the source.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from carom import ContactProblem
from carom.cli.solve import _read
from carom.problem import (
    Csr,
    GlobalProblem,
    LocalProblem,
    global_,
    kept,
    rank,
    read_fclib,
    residual,
    run_files,
)
from carom.problem.fclib import write_fclib

Call = Callable[[Path, pytest.MonkeyPatch], Any]
GOOD: dict[str, Any] = {"W": np.eye(6), "q": np.ones(6), "mu": [0.1, 0.2]}
GLOBAL: dict[str, Any] = {
    "M": np.eye(4), "H": np.ones((4, 6)), "f": np.ones(4), "w": np.ones(6), "mu": [0.1, 0.2]
}  # fmt: skip
IDENTITY = (np.arange(6), np.arange(6), np.ones(6))


def local(**change: Any) -> Call:
    return lambda folder, patch: LocalProblem(**{**GOOD, **change})


def whole(**change: Any) -> Call:
    return lambda folder, patch: GlobalProblem(**{**GLOBAL, **change}).to_local()


def solved(**change: Any) -> Call:
    return lambda folder, patch: ContactProblem(LocalProblem(**GOOD)).solve(**change)


def triplets(*change: Any) -> Call:
    return lambda folder, patch: Csr.from_triplets(*change, (6, 6))


def file_with(name: str, value: Any) -> Call:
    """A file in which something else stands at `name`: a value, a new group, or nothing."""

    def call(folder: Path, patch: pytest.MonkeyPatch) -> Any:
        path = write_fclib(LocalProblem(**GOOD), folder / "p.hdf5")
        with h5py.File(path, "r+") as file:
            if name in file:
                del file[name]
            if value is dict:
                file.create_group(name)
            elif value is not None:
                file[name] = value
        return read_fclib(path)

    return call


def text_file(folder: Path, patch: pytest.MonkeyPatch) -> Any:
    (folder / "p.hdf5").write_text("no HDF5\n" * 100)
    return read_fclib(folder / "p.hdf5")


def too_many_entries(folder: Path, patch: pytest.MonkeyPatch) -> Any:
    patch.setattr(Csr, "entries", 2**31)
    return write_fclib(LocalProblem(**GOOD), folder / "p.hdf5")


def large_block(folder: Path, patch: pytest.MonkeyPatch) -> Any:
    patch.setattr(global_, "MAX_BLOCK", 3)
    return GlobalProblem(**{**GLOBAL, "M": np.eye(4) + np.ones((4, 4))}).to_local()


def wide_level(folder: Path, patch: pytest.MonkeyPatch) -> Any:
    patch.setattr(rank, "MAX_LEVEL", 3)
    return rank.rank_of(Csr.from_any(np.eye(6) + np.ones((6, 6))), dense_rows=2)


def of_run(*files: str, **wanted: Any) -> Call:
    """A run that kept these problems, and which one is wanted."""

    def call(folder: Path, patch: pytest.MonkeyPatch) -> Any:
        (folder / run_files.FOLDER).mkdir()
        for file in files:
            (folder / run_files.FOLDER / f"step_{file}_0.hdf5").touch()
        return run_files.find(folder, None, **wanted)

    return call


def many_joints(folder: Path, patch: pytest.MonkeyPatch) -> Any:
    patch.setattr(kept, "MAX_JOINT_ROWS", 1)
    return kept._inverse_of_joints(Csr.from_any(np.ones((2, 2))))


#: "cause; cure" -> (place that the message names, call).
PROBLEMS: dict[str, tuple[str, Call]] = {
    "found ...; name an HDF5 file": ("path: found None", lambda f, p: read_fclib(None)),  # type: ignore[arg-type]
    "...; name an HDF5 file": ("nowhere.hdf5: no such file", lambda f, p: read_fclib(f / "nowhere.hdf5")),
    "cannot be read (...); is it an HDF5 file, and whole?": ("p.hdf5", text_file),
    "no contact problem (there is ...); one of ...": ("p.hdf5: /", file_with("fclib_local", None)),
    "...; ... are known": ("fclib_local/spacedim: 4", file_with("fclib_local/spacedim", 4)),
    "bilateral constraints beside the contacts; eliminate them first; they are not supported": (
        "fclib_local/V",
        file_with("fclib_local/V", dict),
    ),
    "missing; a contact problem has this group": ("/fclib_local/W", file_with("fclib_local/W", None)),
    "... numbers; one is wanted": ("/fclib_local/spacedim: 2", file_with("fclib_local/spacedim", [3, 3])),
    "... x ...; with vectors of this length it must be ... x ...": (
        "W (m, n): 7 x 6",
        file_with("fclib_local/W/m", 7),
    ),
    "...; -2 are compressed rows, -1 compressed columns, others a number of triplets": (
        "W/nz: -3",
        file_with("fclib_local/W/nz", -3),
    ),
    "... triplets announced, ... there; the matrix is damaged": ("W/nz", file_with("fclib_local/W/nz", 7)),
    "... entries; FCLib counts with 32 bits": ("W, M or H: 2147483648", too_many_entries),
    "a contact problem does not change; make another one": (
        "problem.local",
        lambda *_: setattr(ContactProblem.from_matrices(np.eye(3), np.ones(3), [0.5]), "local", None),
    ),
    "it couples ... rows; blocks of up to ... are eliminated here; give W and q instead": ("M", large_block),
    "no contact problem was kept; save_problems=... (--save-problems) keeps those of chosen steps": (
        "",
        of_run(),
    ),
    "... contact problems ...; say which: ...": (
        "",
        of_run("000001_position", "000002_position", level="position"),
    ),
    "no contact problem with ...; there are those of ...": ("", of_run("000001_position", step=2)),
    "no contact problem with ...; of this step there are: ...": (
        "",
        of_run("000001_position", step=1, index=2),
    ),
    "...; there are ...": ("level: 'foo'", of_run("000001_position", level="foo")),
    "singular in row... ... (from 0); a body without mass or inertia cannot be eliminated": (
        "M: singular in row 2",
        whole(M=np.diag([1.0, 1.0, 0.0, 1.0])),
    ),
    "it is ... x ...; with f and w as they are it must be ... x ...": (
        "H: it is 3 x 6",
        whole(H=np.ones((3, 6))),
    ),
    "...; one of ...": ("form: 'loacl'", lambda f, p: kept.state({}, "loacl")),
    "joints of ... rows depend on one another; up to ... are eliminated": ("joints", many_joints),
    "its rows differ in length; give real numbers, as an array": ("q", local(q=[[1], [2, 3]])),
    "an array of ... dimensions and type ...; give real numbers, in ...": ("mu", local(mu=0.1)),
    "some of its numbers are masked; all numbers must be there": (
        "q",
        local(q=np.ma.masked_equal(np.ones(6), 1)),
    ),
    "... values; there must be ...": ("mu_r: 3", local(mu_r=[0.1, 0.1, 0.1])),
    "it is ... x ...; it must be ... x ...": ("W: it is 5 x 5", local(W=np.eye(5))),
    "unsymmetric by ... of its largest entry; up to ... is taken for rounding": (
        "W",
        local(W=np.eye(6) + np.triu(np.full((6, 6), 0.02), 1)),
    ),
    "... as value ... (from 0); all numbers must be finite": ("q: inf", local(q=[1, 2, 3, 4, 5, np.inf])),
    "there is none; give a number for each contact, 0 without friction": ("mu", local(mu=None)),
    "... at contact ... (from 0); bounds are 0 or positive": ("mu: -0.2 at contact 1", local(mu=[0.1, -0.2])),
    "... rows for ... contacts; every contact has the same number of rows": ("q: 7", local(q=np.ones(7))),
    "... rows for each contact, where ... were announced; mend either": ("q", local(dimension=2)),
    "... rows for ... contacts, ... each; contacts have ... rows": ("q", local(q=np.ones(8), W=np.eye(8))),
    "... rows for each contact, given ...; such contacts have ...": ("q", local(mu_r=[0.1, 0.1])),
    "... on its diagonal, row ... (from 0); it must be positive semidefinite; is a sign in it, or in what made it, wrong?": (
        "W: -1",
        local(W=np.diag([1.0, 1, -1, 1, 1, 1])),
    ),
    "its indices have ... dimensions; they are a list": ("W", triplets(np.eye(6), *IDENTITY[1:])),
    "its indices are of type ...; they must be whole numbers": ("W", triplets(np.ones(6), *IDENTITY[1:])),
    "... row indices, ... column indices and ... values; an entry has one of each": (
        "W: 6 row",
        triplets(*IDENTITY[:2], np.ones(5)),
    ),
    "... index ... is out of range; ...": (
        "W: column index 6",
        triplets(IDENTITY[0], IDENTITY[0] + 2, np.ones(6)),
    ),
    "... starts of ... ...; there must be ...": ("W", file_with("fclib_local/W/p", np.arange(6))),
    "the starts of its ... do not rise from 0; the matrix is damaged": (
        "W",
        file_with("fclib_local/W/p", np.array([0, 2, 1, 3, 4, 5, 6])),
    ),
    "... entries announced, ... indices and ... values there; the matrix is damaged": (
        "W",
        file_with("fclib_local/W/x", np.ones(5)),
    ),
    "...; it must be between 0 and 1": ("rtol: 2", lambda f, p: rank.rank_of(Csr.from_any(np.eye(3)), 2.0)),
    "... rows of it must be looked at together; a rank is estimated up to ...": ("W", wide_level),
    "its shape is ...; it must be (...,)": (
        "r: its shape is (5,)",
        lambda f, p: residual.residual_of(LocalProblem(**GOOD), np.ones(5)),
    ),
    "none is called ...; ...": ("solver", solved(solver="nweton")),
    "...; either 'raise' or 'return'": ("on_nonconvergence: 'warn'", solved(on_nonconvergence="warn")),
    "not all of it is finite; start from 0 (leave it out) or from a former r": (
        "r0",
        solved(r0=np.full(6, np.nan)),
    ),
    "...; it must be a ...number above 0": ("tol: -1", solved(tol=-1)),
    "...; it must be a whole number above 0": ("max_iterations: 0.5", solved(max_iterations=0.5)),
    "this run has no stored problems; carom run ... --save-problems STEPS stores them": (
        "",
        lambda folder, patch: ((folder / "run.json").write_text("{}"), _read(folder)),
    ),
    "no ... in this directory; name a file": ("", lambda folder, patch: _read(folder)),
}
