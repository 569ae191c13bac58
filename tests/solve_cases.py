"""Contact problems to be solved, in files too, and the stand-in for the solvers of the core."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carom import ContactProblem
from carom.problem.matrix import Csr
from problem_cases import bounds_of, numbers
from solver_double import install, sweeps


def easy(seed: int, d: int = 3, contacts: int = 4) -> ContactProblem:
    """W diagonally dominant: sweeps converge in a few dozen iterations."""
    rng = numbers(seed)
    a = rng.normal(size=(d * contacts, d * contacts))
    w = 0.05 * a @ a.T + np.diag(rng.uniform(1.0, 2.0, d * contacts))
    bounds = bounds_of(rng, contacts, d)
    return ContactProblem.from_matrices(w, rng.normal(size=d * contacts), **bounds, title=f"seed {seed}")


def chain(contacts: int, coupling: float = -0.4) -> ContactProblem:
    """Contacts in a row, each feels those beside it."""
    n = 3 * contacts
    rows = np.arange(n)
    places = [(rows, rows, 1.0), (rows[3:], rows[:-3], coupling), (rows[:-3], rows[3:], coupling)]
    triplets = [(i, j, np.full(len(i), w)) for i, j, w in places]
    w = Csr.from_triplets(*map(np.concatenate, zip(*triplets, strict=True)), (n, n))
    return ContactProblem.from_matrices(w, numbers(3).normal(size=n), np.full(contacts, 0.5), title="chain")


def unlucky(**answer: Any) -> Callable[..., dict[str, Any]]:
    """A solver that does its work and then says something else."""
    return lambda *arguments: {**sweeps(*arguments), **answer}


@pytest.fixture
def double(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three problems in files: local, rolling, and of bodies."""
    easy(1).to_fclib(tmp_path / "a.hdf5")
    easy(2, d=5).to_fclib(tmp_path / "b.h5")
    bodies(3).to_fclib(tmp_path / "c.hdf5")
    return tmp_path


def bodies(seed: int) -> ContactProblem:
    """One ball on three planes, as bodies."""
    rng = numbers(seed)
    h = np.vstack([np.eye(6), 0.1 * rng.normal(size=(3, 6))]).T.reshape(6, 9)
    m = np.diag(rng.uniform(0.5, 2.0, 6))
    vectors = {"f": rng.normal(size=6), "w": rng.normal(size=9), "mu": np.full(3, 0.3)}
    return ContactProblem.from_bodies(M=m, H=h, **vectors)
