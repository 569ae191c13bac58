"""Contact problems as data: cones, the residual, local and global form, files in the layout of FCLib."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom.errors import CaromError
from carom.problem import (
    ContactProblem,
    ContactProblemError,
    ContactProblemWarning,
    Csr,
    GlobalProblem,
    LocalProblem,
    cone,
    rank_of,
    read_fclib,
    residual_of,
    write_fclib,
)
from carom.problem.matrix import PRODUCT_TERMS, asymmetry, components
from hypothesis import given
from hypothesis import strategies as st

DIMENSIONS = [2, 3, 5, 6]

# The published problems lie beside the project, or where this variable says; they are not part of it.
PUBLISHED = Path(
    os.environ.get("CAROM_CONTACT_PROBLEMS", Path(__file__).parents[2] / "shared/data/contact_problems")
)
FILES = sorted(PUBLISHED.glob("*.hdf5"))
needs_published = pytest.mark.skipif(
    not FILES, reason="published contact problems are not there (CAROM_CONTACT_PROBLEMS names their folder)"
)


def numbers(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def bounds_of(rng: np.random.Generator, contacts: int, d: int) -> dict[str, np.ndarray]:
    """mu, mu_r, mu_s as contacts of d rows have them; some are 0."""
    names = ["mu", "mu_r", "mu_s"][: {2: 1, 3: 1, 5: 2, 6: 3}[d]]
    return {name: rng.uniform(0.0, 1.5, contacts) * (rng.random(contacts) < 0.9) for name in names}


def a_problem(seed: int, d: int = 3, contacts: int = 5, bodies: int = 3) -> GlobalProblem:
    """Bodies of 6 degrees of freedom, coupled mass matrices, random rows: W is singular for many contacts."""
    rng = numbers(seed)
    n = 6 * bodies
    m = np.zeros((n, n))
    for k in range(bodies):
        a = rng.normal(size=(6, 6))
        m[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = a @ a.T + 0.1 * np.eye(6)
    h = np.zeros((n, d * contacts))
    for c in range(contacts):
        for body in rng.choice(bodies, 2, replace=False) if bodies > 1 else [0]:
            h[6 * body : 6 * body + 6, d * c : d * c + d] = rng.normal(size=(6, d))
    vectors = {"f": rng.normal(size=n), "w": rng.normal(size=d * contacts)}
    return GlobalProblem(M=m, H=h, **vectors, **bounds_of(rng, contacts, d), title=f"seed {seed}")


def test_no_friction_at_all_is_told_how_to_say_it() -> None:
    with pytest.raises(ContactProblemError, match=r"^mu: there is none; give a number for each contact"):
        ContactProblem.from_matrices(np.eye(3), np.zeros(3), None)


# --- cones ------------------------------------------------------------------------------------------------------------

seeds = st.integers(0, 2**32 - 1)


def a_point(seed: int, d: int, contacts: int = 40) -> tuple[np.ndarray, np.ndarray]:
    rng = numbers(seed)
    bounds = np.stack(list(bounds_of(rng, contacts, d).values()), axis=1)
    r = rng.normal(size=(contacts, d)) * 10.0 ** rng.uniform(-6, 6, (contacts, 1))
    for block in cone.BLOCKS[d]:  # points without a direction
        r[rng.random(contacts) < 0.1, block] = 0.0
    return r, bounds


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
def test_a_projection_splits_a_point_as_moreau_says(seed: int, d: int) -> None:
    """r = p - (p - r) with p in K, p - r in the dual cone, both perpendicular: this makes p the nearest point."""
    r, bounds = a_point(seed, d)
    p = cone.project(r, bounds)
    size = np.linalg.norm(r, axis=1)
    assert np.all(cone.outside(p, bounds) <= 4e-16 * size)
    rest = p - r
    dual = rest[:, 0] - np.sum(bounds * cone.lengths(rest), axis=1)
    assert np.all(dual >= -4e-15 * size)
    assert np.all(np.abs(np.sum(p * rest, axis=1)) <= 4e-15 * size**2)


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
def test_no_point_of_the_cone_is_nearer_than_the_projection(seed: int, d: int) -> None:
    r, bounds = a_point(seed, d)
    p = cone.project(r, bounds)
    rng = numbers(seed + 1)
    for near in (0.01, 1.0):
        other = p + near * rng.normal(size=r.shape) * np.linalg.norm(r, axis=1, keepdims=True)
        other[:, 0] = np.abs(other[:, 0])
        for b, block in enumerate(cone.BLOCKS[d]):
            length = np.linalg.norm(other[:, block], axis=1)
            radius = bounds[:, b] * other[:, 0]
            other[:, block] *= np.minimum(1.0, radius / np.where(length > 0.0, length, 1.0))[:, None]
        far, nearest = (np.linalg.norm(x - r, axis=1) for x in (other, p))
        assert np.all(nearest <= far * (1.0 + 1e-15))


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
def test_points_of_the_cone_stay_and_those_of_the_polar_go_to_zero(seed: int, d: int) -> None:
    r, bounds = a_point(seed, d)
    inside = r.copy()
    inside[:, 0] = np.abs(r[:, 0])
    for b, block in enumerate(cone.BLOCKS[d]):
        length = cone.lengths(r)[:, b]
        factor = 0.999 * bounds[:, b] * inside[:, 0] / np.where(length > 0.0, length, 1.0)
        inside[:, block] *= np.minimum(1.0, factor)[:, None]
    assert np.array_equal(cone.project(inside, bounds), inside)
    polar = r.copy()
    polar[:, 0] = -1.001 * np.sum(bounds * cone.lengths(r), axis=1) - 1e-300
    assert not cone.project(polar, bounds).any()


@given(seed=seeds)
def test_the_cone_with_rolling_has_the_cases_of_acary_and_bourrier(seed: int) -> None:
    """Their list (polar, inside, both bounds saturated, one of them) in the words of its authors, as a second way."""
    r, bounds = a_point(seed, 5)
    p = cone.project(r, bounds)
    for x, (mu, mu_r), got in zip(r, bounds, p, strict=True):
        n, t, m = x[0], np.hypot(*x[1:3]), np.hypot(*x[3:5])
        cases = [
            (t <= mu * n and m <= mu_r * n, n),
            (mu * t + mu_r * m <= -n, 0.0),
            (True, (n + mu * t + mu_r * m) / (1 + mu**2 + mu_r**2)),
            (True, (n + mu * t) / (1 + mu**2)),
            (True, (n + mu_r * m) / (1 + mu_r**2)),
        ]

        def consistent(case: int, height: float, t: float = t, m: float = m, b: Any = (mu, mu_r)) -> bool:
            cut_t, cut_m = t > b[0] * height, m > b[1] * height
            return (cut_t, cut_m) == {2: (True, True), 3: (True, False), 4: (False, True)}[case]

        found = [h for k, (holds, h) in enumerate(cases) if holds and (k < 2 or (h > 0 and consistent(k, h)))]
        assert found, "a point that is in no case"
        assert got[0] == pytest.approx(found[0], rel=1e-12, abs=1e-12 * np.linalg.norm(x))


# --- the residual -----------------------------------------------------------------------------------------------------


def one_ball(seed: int, d: int, contacts: int = 8) -> tuple[LocalProblem, np.ndarray]:
    """Contacts that do not touch one another, W diagonal as for spheres, and their solution by the law of discs."""
    rng = numbers(seed)
    own = rng.uniform(0.1, 10.0, (contacts, len(cone.BLOCKS[d]) + 1))
    q = rng.normal(size=(contacts, d)) * 10.0 ** rng.uniform(-3, 3)
    q[:2, 1:] = 0.0
    bounds = bounds_of(rng, contacts, d)
    r = np.zeros((contacts, d))
    r[:, 0] = np.maximum(0.0, -q[:, 0] / own[:, 0])
    diagonal = np.empty((contacts, d))
    diagonal[:, 0] = own[:, 0]
    for b, (block, bound) in enumerate(zip(cone.BLOCKS[d], bounds.values(), strict=True)):
        diagonal[:, block] = own[:, b + 1, None]
        stick = -q[:, block] / own[:, b + 1, None]
        length = np.linalg.norm(stick, axis=1)
        factor = np.minimum(1.0, bound * r[:, 0] / np.where(length > 0.0, length, 1.0))
        r[:, block] = stick * factor[:, None]
    problem = LocalProblem(W=np.diag(diagonal.reshape(-1)), q=q.reshape(-1), **bounds)
    return problem, r.reshape(-1)


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
def test_what_the_law_of_discs_gives_solves_the_cone_problem(seed: int, d: int) -> None:
    problem, r = one_ball(seed, d)
    found = residual_of(problem, r)
    assert found.err < 1e-14
    assert found.cone_violation <= 1e-15 * found.scale
    assert found.penetration <= 1e-14 * found.scale
    assert found.complementarity <= 1e-13 * found.scale**2


@given(seed=seeds, c=st.integers(0, 7), row=st.integers(0, 2), by=st.sampled_from([-0.3, 0.3]))
def test_an_error_at_one_contact_is_found_there(seed: int, c: int, row: int, by: float) -> None:
    problem, r = one_ball(seed, 3)
    r = r.copy()
    size = np.abs(r).max() + 1.0
    r[3 * c] += by * size if row == 0 else size
    r[3 * c + row] += by * size
    found = residual_of(problem, r)
    assert found.worst == c
    assert found.worst_natural_map == pytest.approx(found.natural_map)
    assert found.err > 1e-3 * size / found.scale


@given(seed=seeds)
def test_the_residual_is_its_formula(seed: int) -> None:
    problem = a_problem(seed).to_local()
    r = numbers(seed + 1).normal(size=problem.rows)
    u = problem.W.to_dense() @ r + problem.q
    squares = 0.0
    for c, mu in enumerate(problem.mu):
        rc, uc = r[3 * c : 3 * c + 3], u[3 * c : 3 * c + 3].copy()
        uc[0] += mu * np.hypot(uc[1], uc[2])
        x = rc - uc
        t = np.hypot(x[1], x[2])
        if t <= mu * x[0]:
            p = x
        elif mu * t <= -x[0]:
            p = np.zeros(3)
        else:
            height = (x[0] + mu * t) / (1 + mu * mu)
            p = np.array([height, mu * height * x[1] / t, mu * height * x[2] / t])
        squares += float(np.sum((rc - p) ** 2))
    expected = np.sqrt(squares) / max(np.linalg.norm(problem.q), np.linalg.norm(r), np.linalg.norm(u))
    assert residual_of(problem, r).err == pytest.approx(expected, rel=1e-12)
    assert residual_of(problem, r.reshape(-1, 3)).err == residual_of(problem, r).err
    assert float(residual_of(problem, r)) == residual_of(problem, r).err


def test_the_parts_of_the_residual_have_their_meaning() -> None:
    problem = LocalProblem(W=np.eye(6), q=[-1.0, 0, 0, -1.0, 0, 0], mu=[0.5, 0.5])
    found = residual_of(problem, [1.0, 0, 0, 0.25, 0.25, 0])
    assert found.worst == 1
    assert found.cone_violation == 0.25 - 0.5 * 0.25
    assert found.penetration == 0.75
    assert found.complementarity == pytest.approx(abs(0.25 * (-0.75 + 0.5 * 0.25) + 0.25 * 0.25))
    assert str(found).startswith("err = ")
    assert "worst contact 1" in str(found)
    assert found.to_dict()["worst"] == 1


def test_nothing_to_solve_leaves_no_residual() -> None:
    rest = LocalProblem(W=np.eye(3), q=np.zeros(3), mu=[0.3])
    assert residual_of(rest, np.zeros(3)).err == 0.0
    leaving = LocalProblem(W=np.eye(3), q=[1.0, 2.0, 0.0], mu=[0.3])
    assert residual_of(leaving, np.zeros(3)).err == 0.0
    none = LocalProblem(W=np.zeros((0, 0)), q=[], mu=[])
    assert (residual_of(none, []).err, residual_of(none, []).worst, none.dimension) == (0.0, -1, 3)


@pytest.mark.parametrize("scale", [1e-200, 1e-160, 1.0, 1e160])
def test_the_residual_keeps_its_value_where_squares_do_not_fit(scale: float) -> None:
    problem = LocalProblem(W=np.eye(3), q=scale * np.array([-1.0, 0.3, 0.0]), mu=[0.2])
    assert residual_of(problem, np.zeros(3)).err == pytest.approx(0.94 / np.hypot(1.0, 0.3), rel=0.1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
def test_an_r_that_ran_away_has_an_infinite_residual(bad: float) -> None:
    problem = LocalProblem(W=10 * np.eye(6), q=np.ones(6), mu=[0.2, 0.2])
    found = residual_of(problem, [0, 0, 0, 0, bad, 0])
    assert (found.err, found.worst) == (np.inf, 1)


def test_an_r_of_the_wrong_length_is_refused() -> None:
    problem = LocalProblem(W=np.eye(6), q=np.ones(6), mu=[0.2, 0.2])
    with pytest.raises(ContactProblemError, match=r"r: its shape is \(5,\); it must be \(6,\)"):
        residual_of(problem, np.zeros(5))


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
    problem = GlobalProblem(M=m, H=np.ones((5, 3)), f=np.zeros(5), w=np.zeros(3), mu=[0.3])
    with pytest.raises(ContactProblemError, match=rf"M: singular in {where} \(from 0\)"):
        problem.to_local()


def test_an_indefinite_mass_matrix_is_told() -> None:
    m = np.diag([1.0, 1.0, -0.1])
    problem = GlobalProblem(M=m, H=np.ones((3, 3)) + np.eye(3), f=np.zeros(3), w=np.zeros(3), mu=[0.3])
    with (
        pytest.warns(ContactProblemWarning, match="M is not positive definite"),
        pytest.raises(ContactProblemError, match="positive semidefinite"),
    ):
        problem.to_local()


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


GOOD: dict[str, Any] = {"W": np.eye(6), "q": np.ones(6), "mu": [0.1, 0.2]}


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
        ({"q": [[1], [2, 3]]}, "q: not a list of numbers"),
        ({"W": np.eye(5)}, "W: it is 5 x 5; it must be 6 x 6"),
        ({"W": np.ones(6)}, "W: it has 1 dimensions; give a matrix"),
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


# --- the face ---------------------------------------------------------------------------------------------------------


def test_the_face_of_it_all(tmp_path: Path) -> None:
    problem = carom.ContactProblem.from_matrices(np.eye(3), [-1.0, 0.5, 0.0], [0.2], title="one ball")
    assert problem.residual([1.0, -0.2, 0.0]).err < 1e-15
    assert str(problem.rank()) == "rank 3 of 3, nullity 0"
    assert repr(problem) == "<ContactProblem 'one ball': 1 contacts of 3 rows, local form>"
    assert carom.ContactProblem.from_fclib(problem.to_fclib(tmp_path / "p.hdf5")).title == "one ball"
    bodies = carom.ContactProblem.from_bodies(2 * np.eye(3), np.eye(3), [-2.0, 1.0, 0.0], np.zeros(3), [0.2])
    assert bodies.residual([2.0, -0.4, 0.0]).err < 1e-15
    assert np.array_equal(bodies.local.W.to_dense(), np.eye(3) / 2)
