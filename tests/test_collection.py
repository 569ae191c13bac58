"""The collected contact problems (tools/collect_problems.py): all are there, are read, and are what the index says."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from carom import ContactProblem
from carom.problem import GlobalProblem, read_fclib, write_fclib

FOLDER = Path(__file__).parent / "data" / "contact_problems"
INDEX: list[dict[str, Any]] = json.loads((FOLDER / "index.json").read_text(encoding="utf-8"))["problems"]
#: Rows up to which the rank is computed anew here.
RANK_ROWS = 400
#: Contacts from which a problem is left to the long tier: it takes seconds.
LARGE = 1000


def test_the_index_lists_the_files_and_no_others() -> None:
    assert [entry["file"] for entry in INDEX] == sorted(file.name for file in FOLDER.glob("*.hdf5"))
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < 10e6
    assert {entry["level"] for entry in INDEX} == {"position", "velocity"}
    assert {entry["form"] for entry in INDEX} == {"local", "global"}
    assert {entry["dimension"] for entry in INDEX} == {3, 5, 6}
    assert max(entry["contacts"] for entry in INDEX) > 5000
    assert sum(not entry["carom"]["converged"] for entry in INDEX) > 10


@pytest.mark.parametrize(
    "entry",
    [pytest.param(entry, marks=[pytest.mark.long] * (entry["contacts"] > LARGE)) for entry in INDEX],
    ids=lambda entry: str(entry["file"]).removesuffix(".hdf5"),
)
def test_a_collected_problem_is_what_the_index_says(entry: dict[str, Any], tmp_path: Path) -> None:
    path = FOLDER / entry["file"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        problem = ContactProblem.from_fclib(path)
        local = problem.local
    assert isinstance(problem.source, GlobalProblem) == (entry["form"] == "global")
    assert (problem.contacts, problem.dimension, local.rows) == tuple(
        entry[key] for key in ("contacts", "dimension", "rows")
    )
    with h5py.File(path) as file:
        about, r = file["carom"].attrs, file["carom/r"][()]
        assert (about["level"], about["step"], about["index"]) == (
            entry["level"],
            entry["step"],
            entry["index"],
        )
        bodies, axes = file["carom/bodies"][()], np.stack([file[f"carom/{k}"][()] for k in AXES], axis=1)
    assert bodies.shape == (problem.contacts, 2)
    assert np.all(bodies[:, 0] < bodies[:, 1])
    gram = axes @ axes.transpose(0, 2, 1)
    np.testing.assert_allclose(np.diagonal(gram, axis1=1, axis2=2), 1.0, rtol=1e-14)
    assert np.abs(gram[:, 1, 2]).max() < 1e-14
    assert (
        np.abs(gram[:, 0, 1:]).max() < 0.1
    )  # tangents are those of the start of the step, the normal is later
    # What the run found is as good as it was then; nothing is far from as good.
    assert problem.residual(r).err == pytest.approx(entry["carom"]["err"], rel=1e-3, abs=1e-12)
    assert 0.0 < problem.residual(np.zeros(local.rows)).err <= 1.0
    if entry["rows"] <= RANK_ROWS:
        found = problem.rank()
        assert found.exact
        assert (found.rank, found.nullity) == (entry["rank"], entry["nullity"])
    # Written anew, deflated or not, it is the same problem.
    for compress in (False, True):
        copy = read_fclib(write_fclib(problem.source, tmp_path / "copy.hdf5", compress=compress))
        for key in ("M", "H", "W") if isinstance(copy, GlobalProblem) else ("W",):
            if hasattr(copy, key):
                one, other = getattr(copy, key), getattr(problem.source, key)
                for part in ("indptr", "indices", "data"):
                    assert np.array_equal(getattr(one, part), getattr(other, part))
        assert np.array_equal(copy.bounds, problem.source.bounds)


AXES = ("normal", "tangent1", "tangent2")


def test_deflating_makes_a_file_smaller(tmp_path: Path) -> None:
    problem = read_fclib(FOLDER / max(INDEX, key=lambda entry: int(entry["contacts"]))["file"])
    plain = write_fclib(problem, tmp_path / "plain.hdf5").stat().st_size
    assert write_fclib(problem, tmp_path / "small.hdf5", compress=True).stat().st_size < 0.8 * plain
