"""Contact problems as data: matrices, the local and the global form, rank."""

from __future__ import annotations

import warnings
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from carom import CaromError, ContactProblem
from carom.problem import (
    ContactProblemError,
    ContactProblemWarning,
    Csr,
    GlobalProblem,
    LocalProblem,
    rank_of,
)
from carom.problem.matrix import PRODUCT_TERMS, asymmetry, components
from hypothesis import given
from hypothesis import strategies as st
from problem_cases import DIMENSIONS, GOOD, a_problem, numbers, seeds

# --- matrices and the global form -------------------------------------------------------------------------------------


@given(seed=seeds, m=st.integers(0, 12), n=st.integers(0, 12), density=st.floats(0, 1))
def test_matrices_are_those_of_numpy(seed: int, m: int, n: int, density: float) -> None:
    rng = numbers(seed)
    a, b = (rng.normal(size=s) * (rng.random(s) < density) for s in ((m, n), (n, 7)))
    x, y = Csr.from_any(a), Csr.from_any(b)
    assert np.array_equal(x.to_dense(), a)
    assert np.array_equal(x.transpose.to_dense(), a.T)
    assert np.array_equal(x.diagonal(), np.diagonal(a))
    np.testing.assert_allclose(x.multiply(y).to_dense(), a @ b, atol=1e-14)
    v = rng.normal(size=n)
    np.testing.assert_allclose(x.dot(v), a @ v, atol=1e-14)
    assert x.multiply(y).to_dense().tobytes() == grouped(x, y).to_dense().tobytes()


def grouped(x: Csr, y: Csr) -> Csr:
    """The product in groups of single rows."""
    matrix = pytest.MonkeyPatch()
    matrix.setattr("carom.problem.matrix.PRODUCT_TERMS", 1)
    try:
        return x.multiply(y)
    finally:
        matrix.undo()


def test_blocks_that_do_not_touch_are_told_apart() -> None:
    assert PRODUCT_TERMS > 1
    order = numbers(1).permutation(60)
    chain = np.zeros((60, 60))
    for a, b in pairwise(order[:40]):
        chain[a, b] = 1.0
    label = components(Csr.from_any(chain))
    assert len(set(label[order[:40]])) == 1
    assert len(set(label)) == 21


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
def test_the_local_form_is_that_of_the_bodies(seed: int, d: int) -> None:
    problem = a_problem(seed, d)
    local = problem.to_local()
    m, h = problem.M.to_dense(), problem.H.to_dense()
    expected = h.T @ np.linalg.solve(m, h)
    tolerance = 1e-13 * np.linalg.cond(m) * np.abs(expected).max()
    np.testing.assert_allclose(local.W.to_dense(), expected, atol=tolerance, rtol=0)
    q = problem.w + h.T @ np.linalg.solve(m, problem.f)
    np.testing.assert_allclose(local.q, q, atol=1e-13 * np.linalg.cond(m) * np.abs(q).max(), rtol=0)
    assert (local.dimension, local.contacts, local.title) == (d, 5, problem.title)
    assert np.array_equal(local.bounds, problem.bounds)


def test_bodies_of_any_mass_are_eliminated() -> None:
    mass = 10.0 ** np.arange(-120.0, 120.0, 40.0)
    h = numbers(0).normal(size=(6, 3))
    local = GlobalProblem(M=np.diag(mass), H=h, f=np.zeros(6), w=np.zeros(3), mu=[0.3]).to_local()
    np.testing.assert_allclose(local.W.to_dense(), h.T @ np.diag(1 / mass) @ h, rtol=1e-12)


@pytest.mark.parametrize(
    ("block", "where"),
    [
        ([[0.0, 0.0], [0.0, 0.0]], "row 2"),
        ([[1.0, 1.0], [1.0, 1.0]], "rows 2, 3"),
        ([[1.0, 2.0], [2.0, 4.0 + 1e-15]], "rows 2, 3"),
        ([[1e-9, 1.0], [1.0, 1e9]], "rows 2, 3"),
    ],
)
def test_a_singular_mass_matrix_is_refused(block: Any, where: str) -> None:
    m = np.eye(5)
    m[2:4, 2:4] = block
    with pytest.raises(ContactProblemError, match=rf"M: singular in {where} \(from 0\)"):
        GlobalProblem(M=m, H=np.ones((5, 3)), f=np.zeros(5), w=np.zeros(3), mu=[0.3])


def test_a_large_block_of_a_mass_matrix_is_looked_at_when_it_is_inverted(monkeypatch: Any) -> None:
    monkeypatch.setattr("carom.problem.global_.MAX_CHECKED", 1)
    rest = {"H": np.ones((3, 3)), "f": np.zeros(3), "w": np.zeros(3), "mu": [0.3]}
    with pytest.raises(ContactProblemError, match="M: singular in rows 0, 1"):
        GlobalProblem(M=[[1, 1, 0], [1, 1, 0], [0, 0, 1]], **rest).to_local()
    with pytest.raises(ContactProblemError, match="M: singular in row 2"):
        GlobalProblem(M=[[2, 1, 0], [1, 2, 0], [0, 0, 0]], **rest)


def test_an_indefinite_mass_matrix_is_told() -> None:
    rest = {"H": np.eye(3), "f": np.zeros(3), "w": np.zeros(3), "mu": [0.3]}
    with pytest.raises(ContactProblemError, match=r"M: -0\.1 on its diagonal, row 2 .*is a sign in it"):
        GlobalProblem(M=np.diag([1.0, 1.0, -0.1]), **rest)
    problem = GlobalProblem(M=[[1, 2, 0], [2, 1, 0], [0, 0, 1]], **rest)
    with (
        pytest.warns(ContactProblemWarning, match="M is not positive definite"),
        pytest.raises(ContactProblemError, match="positive semidefinite"),
    ):
        problem.to_local()


def test_an_indefinite_w_is_told() -> None:
    """And none that is so by rounding: redundant contacts, rows of 0."""
    for w, mu in (([[1, 2], [2, 1]], [0.3]), (np.kron([[1, -3], [-3, 1]], np.eye(2)), [0, 0])):
        with pytest.warns(ContactProblemWarning, match="W is not positive semidefinite"):
            LocalProblem(W=w, q=-np.ones(len(w)), mu=mu)
    h = np.random.default_rng(1).standard_normal((6, 30))
    redundant = h.T @ np.diag(10.0 ** np.arange(6)) @ h
    redundant[:, 3] = redundant[3] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        LocalProblem(W=redundant, q=np.zeros(30), mu=np.zeros(10))
        LocalProblem(W=np.zeros((6, 6)), q=np.zeros(6), mu=np.zeros(2))


class Sparse:
    """What SciPy's matrices look like from here."""

    def __init__(self, dense: np.ndarray) -> None:
        self.dense = dense

    def tocsr(self) -> SimpleNamespace:
        a = Csr.from_any(self.dense)
        return SimpleNamespace(
            indptr=a.indptr.astype(np.int32), indices=a.indices, data=a.data, shape=self.dense.shape
        )


def test_sparse_matrices_of_others_are_taken() -> None:
    w = a_problem(3).to_local().W.to_dense()
    ours = ContactProblem.from_matrices(Sparse(w), np.ones(15), np.full(5, 0.3))
    assert np.array_equal(ours.local.W.to_dense(), w)


@pytest.mark.parametrize("form", ["csr_array", "csc_matrix", "coo_array", "bsr_array"])
def test_scipy_matrices_are_taken(form: str) -> None:
    sparse = pytest.importorskip("scipy.sparse", reason="SciPy is not installed")
    w = a_problem(3).to_local().W.to_dense()
    ours = ContactProblem.from_matrices(getattr(sparse, form)(w), np.ones(15), np.full(5, 0.3))
    assert np.array_equal(ours.local.W.to_dense(), w)
    assert np.array_equal(ours.local.W.to_scipy().toarray(), w)


def test_a_problem_does_not_change_with_the_arrays_it_was_made_of() -> None:
    w, q, mu = np.eye(3), np.ones(3), np.array([0.5])
    problem = LocalProblem(W=w, q=q, mu=mu)
    w[0, 0], q[0], mu[0] = 7.0, 7.0, 7.0
    assert (problem.W.to_dense()[0, 0], problem.q[0], problem.mu[0]) == (1.0, 1.0, 0.5)
    with pytest.raises(ValueError):
        problem.q[0] = 3.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.ones(7)}, r"q: 7 rows for 2 contacts; every contact has the same number of rows"),
        (
            {"q": np.ones(8), "W": np.eye(8)},
            r"q: 8 rows for 2 contacts, 4 each; contacts have 2, 3, 5, 6 rows",
        ),
        ({"q": np.ones(10), "W": np.eye(10)}, "given mu; such contacts have mu and mu_r"),
        ({"mu_r": [0.1, 0.1]}, "3 rows for each contact, given mu and mu_r; such contacts have mu"),
        ({"q": np.ones(12), "W": np.eye(12), "mu_r": [0.1, 0.1]}, "such contacts have mu and mu_r and mu_s"),
        ({"mu": [0.1, -0.2]}, r"mu: -0.2 at contact 1 \(from 0\); bounds are 0 or positive"),
        ({"mu": [0.1, np.nan]}, r"mu: nan as value 1 \(from 0\); all numbers must be finite"),
        ({"mu": 0.1}, "mu: an array of 0 dimensions"),
        ({"mu": []}, "q: 6 rows for 0 contacts"),
        ({"mu": ["much", "more"]}, "mu: an array of 1 dimensions and type <U4; give real numbers"),
        ({"q": [1, 2, 3, 4, 5, np.inf]}, r"q: inf as value 5 \(from 0\)"),
        ({"q": np.ones(6) * 1j}, "q: .* type complex128; give real numbers"),
        ({"q": [[1], [2, 3]]}, "q: its rows differ in length"),
        ({"W": np.eye(5)}, "W: it is 5 x 5; it must be 6 x 6"),
        ({"W": np.ones(6)}, "W: an array of 1 dimensions .* in two dimensions"),
        ({"W": [[1, 2], [3]]}, "W: its rows differ in length"),
        ({"W": np.diag([1, 1, 1, 1, 1, np.nan])}, "W: nan as value 5"),
        ({"W": np.eye(6) + np.triu(np.full((6, 6), 0.02), 1)}, "W: unsymmetric by 0.02 of its largest entry"),
        ({"W": np.diag([1.0, 1, -1, 1, 1, 1])}, r"W: -1 on its diagonal, row 2 \(from 0\)"),
        ({"dimension": 2}, "q: 3 rows for each contact, where 2 were announced"),
    ],
)
def test_what_is_no_problem_is_refused(change: dict[str, Any], message: str) -> None:
    LocalProblem(**GOOD)
    with pytest.raises(ContactProblemError, match=message) as caught:
        LocalProblem(**{**GOOD, **change})
    assert isinstance(caught.value, CaromError)
    assert "\n" not in str(caught.value)


def test_global_problems_are_checked_too() -> None:
    good: dict[str, Any] = {
        "M": np.eye(4), "H": np.ones((4, 6)), "f": np.ones(4), "w": np.ones(6), "mu": [0.1, 0.2]
    }  # fmt: skip
    GlobalProblem(**good)
    for change, message in (
        ({"H": np.ones((6, 4))}, r"H: it is 6 x 4 \(is it the transpose\?\); .* must be 4 x 6"),
        ({"M": np.eye(3)}, "M: it is 3 x 3; it must be 4 x 4"),
        ({"f": np.ones(5)}, "M: it is 4 x 4; it must be 5 x 5"),
        ({"H": np.full((4, 6), np.nan)}, "H: nan as value 0"),
        ({"mu": [0.1, -1.0]}, "mu: -1 at contact 1"),
        ({"w": np.ones(5)}, "w: 5 rows for 2 contacts"),
    ):
        with pytest.raises(ContactProblemError, match=message):
            GlobalProblem(**{**good, **change})


def test_a_little_asymmetry_is_told_and_kept() -> None:
    w = np.eye(6)
    w[0, 1], w[1, 0] = 0.3, 0.301
    with pytest.warns(ContactProblemWarning, match=r"W is unsymmetric by 0\.001 of its largest entry"):
        problem = LocalProblem(**{**GOOD, "W": w})
    assert np.array_equal(problem.W.to_dense(), w)
    assert asymmetry(problem.W) == pytest.approx(1e-3)
    w[1, 0] = 0.3 + 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        LocalProblem(**{**GOOD, "W": w})


# --- rank -------------------------------------------------------------------------------------------------------------


@given(seed=seeds, contacts=st.integers(1, 12))
def test_rank_and_nullity_are_those_of_the_bodies(seed: int, contacts: int) -> None:
    local = a_problem(seed, contacts=contacts, bodies=2).to_local()
    found = rank_of(local.W)
    assert found.exact
    assert found.rank == np.linalg.matrix_rank(local.W.to_dense(), rtol=1e-10) == min(3 * contacts, 6 + 6)
    assert found.rank + found.nullity == local.rows


@pytest.mark.parametrize("noise", [0.0, 1e-13, 1e-6])
@pytest.mark.parametrize("contacts", [60, pytest.param(150, marks=pytest.mark.long)])
def test_the_estimate_of_the_rank_of_a_long_row_is_its_rank(contacts: int, noise: float) -> None:
    """A row of bodies with several contacts between neighbours: as many redundant ones as the bodies cannot feel.

    With the noise of a file of few digits W has negative eigenvalues, which count as singular values do.
    """
    rng = numbers(contacts)
    bodies = contacts // 3
    g = np.zeros((3 * contacts, 6 * bodies))
    for c in range(contacts):
        for body in (c // 3, c // 3 + 1):
            if body < bodies:
                g[3 * c : 3 * c + 3, 6 * body : 6 * body + 6] = rng.normal(size=(3, 6))
    w = g @ g.T
    errors = rng.normal(size=w.shape) * (w != 0.0) * noise
    w += errors + errors.T
    expected = np.linalg.matrix_rank(w, rtol=1e-10)
    assert (expected < len(w)) == (noise < 1e-10)
    assert (np.linalg.eigvalsh(w)[0] < -1e-9) == (noise > 1e-10)
    order = rng.permutation(len(w))
    shuffled = Csr.from_any(w[np.ix_(order, order)])
    assert rank_of(shuffled).rank == expected
    found = rank_of(shuffled, dense_rows=30)
    assert (found.rank, found.nullity, found.exact) == (expected, len(w) - expected, False)
    assert str(found).endswith("estimated")
