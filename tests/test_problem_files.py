"""Contact problems as data: files in the layout of FCLib, published ones among them."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from carom import CaromError, ContactProblem
from carom.problem import (
    ContactProblemError,
    ContactProblemWarning,
    Csr,
    GlobalProblem,
    LocalProblem,
    read_fclib,
    write_fclib,
)
from problem_cases import DIMENSIONS, FILES, GOOD, PUBLISHED, a_problem, needs_published, numbers

# --- files ------------------------------------------------------------------------------------------------------------


def assert_same(a: Any, b: Any) -> None:
    """Bit for bit."""
    assert type(a) is type(b)
    for key, value in vars(a).items():
        other = getattr(b, key)
        if isinstance(value, Csr):
            assert value.shape == other.shape
            for part in ("indptr", "indices", "data"):
                assert getattr(value, part).tobytes() == getattr(other, part).tobytes()
        elif isinstance(value, np.ndarray):
            assert value.tobytes() == other.tobytes()
        elif key != "max_asymmetry":
            assert value == other


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("form", ["local", "global"])
@pytest.mark.parametrize("contacts", [0, 1, 6])
def test_a_problem_comes_back_bit_for_bit(form: str, d: int, contacts: int, tmp_path: Path) -> None:
    problem: Any = a_problem(11 * d, d, contacts)
    if form == "local":
        problem = problem.to_local()
    path = write_fclib(problem, tmp_path / "new" / "a.hdf5")
    assert_same(read_fclib(path), problem)
    assert [p.name for p in path.parent.iterdir()] == ["a.hdf5"]


def test_equal_problems_give_equal_files_at_any_time(tmp_path: Path) -> None:
    """HDF5 stamps what it is not told to leave alone, in whole seconds."""
    first = write_fclib(a_problem(1, 5), tmp_path / "a.hdf5").read_bytes()
    time.sleep(1.0)
    assert write_fclib(a_problem(1, 5), tmp_path / "b.hdf5").read_bytes() == first


def test_groups_are_those_of_fclib_and_extensions_have_other_names(tmp_path: Path) -> None:
    groups = {}
    for d in DIMENSIONS:
        for problem in (a_problem(1, d), a_problem(1, d).to_local()):
            with h5py.File(write_fclib(problem, tmp_path / "p.hdf5")) as file:
                groups[type(problem).__name__[0], d] = list(file)
    assert groups == {
        ("L", 2): ["fclib_local"],
        ("G", 2): ["fclib_global"],
        ("L", 3): ["fclib_local"],
        ("G", 3): ["fclib_global"],
        ("L", 5): ["fclib_local_rolling"],
        ("G", 5): ["fclib_global_rolling"],
        ("L", 6): ["carom_local_spinning"],
        ("G", 6): ["carom_global_spinning"],
    }


def test_strings_end_as_a_program_in_c_expects(tmp_path: Path) -> None:
    problem = LocalProblem(**GOOD, title="Kögel", description="two\nlines")
    path = write_fclib(problem, tmp_path / "p.hdf5")
    with h5py.File(path) as file:
        title = file["fclib_local/info/title"]
        kind = title.id.get_type()
        assert (kind.get_size(), kind.get_strpad(), title.shape) == (7, h5py.h5t.STR_NULLTERM, ())
        assert file["fclib_local/W/nz"].dtype == np.int32
    found = read_fclib(path)
    assert (found.title, found.description, found.math_info) == ("Kögel", "two\nlines", "")


def test_a_file_that_cannot_be_replaced_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_fclib(LocalProblem(**GOOD, title="old"), tmp_path / "p.hdf5")

    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(CaromError, match="no space left on the disk"):
        write_fclib(LocalProblem(**GOOD, title="new"), path)
    assert read_fclib(path).title == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["p.hdf5"]


def with_matrix(path: Path, a: np.ndarray, nz: int, *, twice: bool = False, surplus: int = 0) -> Path:
    """A file of FCLib whose W is stored in one of its three ways; `twice`: every entry in two halves."""
    write_fclib(LocalProblem(W=np.eye(len(a)), q=np.ones(len(a)), mu=np.ones(len(a) // 3)), path)
    r, c = np.nonzero(a)
    if nz == -1:
        order = np.lexsort((r, c))
        r, c = r[order], c[order]
    x = a[r, c]
    if twice:
        r, c, x = np.repeat(r, 2), np.repeat(c, 2), np.repeat(x / 2, 2)
    if nz == -2:
        p, i = np.searchsorted(r, np.arange(len(a) + 1)), c
    elif nz == -1:
        p, i = np.searchsorted(c, np.arange(len(a) + 1)), r
    else:
        order = numbers(0).permutation(len(x))
        p, i, x, nz = c[order], r[order], x[order], len(x)
    with h5py.File(path, "r+") as file:
        w = file["fclib_local/W"]
        for name in ("p", "i", "x", "nz", "nzmax"):
            del w[name]
        tail = np.full(surplus, 99)
        w["nz"], w["nzmax"] = nz, [len(x) + surplus]  # a number alone is read as well as a list of one
        w["p"] = np.concatenate([p, tail]) if nz >= 0 else p
        w["i"], w["x"] = np.concatenate([i, tail]), np.concatenate([x, tail])
    return path


@pytest.mark.parametrize("nz", [-2, -1, 0])
@pytest.mark.parametrize("twice", [False, True])
@pytest.mark.parametrize("surplus", [0, 5])
def test_every_way_to_store_a_matrix_is_read(nz: int, twice: bool, surplus: int, tmp_path: Path) -> None:
    a = np.diag(np.arange(1.0, 7.0)) + 0.25 * (np.eye(6, k=2) + np.eye(6, k=-2))
    a[0, 2] = 0.25 + 1e-9  # tells rows from columns
    path = with_matrix(tmp_path / "p.hdf5", a, nz, twice=twice, surplus=surplus)
    assert np.array_equal(read_fclib(path).W.to_dense(), a)


def put(name: str, value: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        if value is not None:
            file[name] = value

    return change


def bilateral(file: h5py.File) -> None:
    file.create_group("fclib_local/V")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("fclib_local", None), "no contact problem .there is nothing.; one of fclib_local, "),
        (put("fclib_local/W", None), "/fclib_local/W: missing"),
        (put("fclib_local/vectors", None), "/fclib_local/vectors: missing"),
        (put("fclib_local/vectors/q", None), "/fclib_local/vectors/q: missing"),
        (put("fclib_local/vectors/q", "text"), "/fclib_local/vectors/q: of type object; numbers are wanted"),
        (put("fclib_local/vectors/q", h5py.Empty("f8")), "/fclib_local/vectors/q: missing"),
        (put("fclib_local/vectors/q", np.full(6, np.nan)), r"q: nan as value 0 \(from 0\)"),
        (put("fclib_local/vectors/q", np.ones(9)), r"W \(m, n\): 6 x 6; .* it must be 9 x 9"),
        (put("fclib_local/vectors/mu", [0.1, -0.1]), "mu: -0.1 at contact 1"),
        (
            put("fclib_local/vectors/mu", [0.1, 0.1, 0.1]),
            "q: 2 rows for each contact, where 3 were announced",
        ),
        (put("fclib_local/spacedim", 4), "fclib_local/spacedim: 4; 2 or 3 are known"),
        (put("fclib_local/spacedim", [3, 3]), "/fclib_local/spacedim: 2 numbers; one is wanted"),
        (put("fclib_local/W/m", 2_000_000_000), r"W \(m, n\): 2000000000 x 6"),
        (put("fclib_local/W/nz", -3), "W/nz: -3; -2 are compressed rows"),
        (put("fclib_local/W/nz", 7), "W/nz: 7 triplets announced, 6 there; the matrix is damaged"),
        (
            put("fclib_local/W/i", np.array([0, 1, 2, 3, 4, 6])),
            "W: column index 6 is out of range; columns are 0 to 5",
        ),
        (put("fclib_local/W/i", np.array([0, 1, 2, 3, 4, -1])), "W: column index -1 is out of range"),
        (put("fclib_local/W/i", np.arange(6.0)), "/fclib_local/W/i: of type float64"),
        (put("fclib_local/W/p", np.arange(6)), "W: 6 starts of 6 rows; there must be 7"),
        (put("fclib_local/W/p", np.array([0, 2, 1, 3, 4, 5, 6])), "W: the starts of its rows do not rise"),
        (
            put("fclib_local/W/p", np.array([0, 1, 2, 3, 4, 5, 60])),
            "W: 60 entries announced, 6 indices and 6 values",
        ),
        (put("fclib_local/W/x", np.ones(5)), "W: 6 entries announced, 6 indices and 5 values"),
        (bilateral, "fclib_local/V: bilateral constraints"),
    ],
)
def test_damaged_files_say_where(change: Callable[[h5py.File], None], message: str, tmp_path: Path) -> None:
    path = write_fclib(LocalProblem(**GOOD), tmp_path / "p.hdf5")
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ContactProblemError, match=message) as caught:
        read_fclib(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_file_cut_anywhere_is_refused(tmp_path: Path) -> None:
    whole = write_fclib(LocalProblem(**GOOD), tmp_path / "p.hdf5").read_bytes()
    cut = tmp_path / "cut.hdf5"
    for length in (0, 1, 8, 100, 1000, len(whole) // 2, len(whole) - 1):
        cut.write_bytes(whole[:length])
        with pytest.raises(ContactProblemError, match="cannot be read"):
            read_fclib(cut)


@pytest.mark.parametrize("seed", range(40))
def test_a_file_with_wrong_bytes_is_refused_or_read_but_never_a_surprise(seed: int, tmp_path: Path) -> None:
    rng = numbers(seed)
    data = bytearray(write_fclib(LocalProblem(**GOOD), tmp_path / "p.hdf5").read_bytes())
    for _ in range(30):
        data[rng.integers(len(data))] = rng.integers(256)
    path = tmp_path / "q.hdf5"
    path.write_bytes(data)
    with warnings.catch_warnings(), suppress(ContactProblemError):
        warnings.simplefilter("ignore", ContactProblemWarning)
        assert isinstance(read_fclib(path), LocalProblem)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContactProblemError, match="no such file; name an HDF5 file"):
        read_fclib(tmp_path / "none.hdf5")
    with pytest.raises(ContactProblemError, match="a directory; name an HDF5 file"):
        read_fclib(tmp_path)
    with pytest.raises(ContactProblemError, match="no regular file; name an HDF5 file"):
        read_fclib("/dev/null")
    (tmp_path / "text.hdf5").write_text("not HDF5\n" * 100)
    with pytest.raises(ContactProblemError, match=r"cannot be read .*; is it an HDF5 file, and whole"):
        read_fclib(tmp_path / "text.hdf5")


# --- published problems -----------------------------------------------------------------------------------------------


@needs_published
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_published_problems_are_read_and_written(path: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactProblemWarning)
        problem = ContactProblem.from_fclib(path)
        copy = ContactProblem.from_fclib(problem.to_fclib(tmp_path / "copy.hdf5"))
        local = problem.local
    assert_same(copy.source, problem.source)
    assert local.contacts == problem.contacts > 0
    found = problem.residual(np.zeros(local.rows))
    assert 0.0 < found.err <= 1.0  # r = 0 is never worse than 1: the projection of -u is not longer than u
    with h5py.File(path) as file:
        (group,) = (name for name in file if name.startswith("fclib"))
        assert problem.dimension == file[group]["spacedim"][0]


@needs_published
def test_bodies_of_a_published_problem_are_eliminated_as_by_its_authors() -> None:
    """One problem is published in both forms."""
    bodies = read_fclib(PUBLISHED / "GFC3D_TwoRods1.hdf5")
    condensed = read_fclib(PUBLISHED / "GFC3D_TwoRods1-condensed.hdf5")
    assert isinstance(bodies, GlobalProblem)
    assert isinstance(condensed, LocalProblem)
    ours = bodies.to_local()
    seven_digits = 5e-7  # so many are printed of W and q
    np.testing.assert_allclose(ours.W.to_dense(), condensed.W.to_dense(), rtol=seven_digits)
    np.testing.assert_allclose(ours.q, condensed.q, rtol=seven_digits)
