"""Contact problems as data: cones and the residual."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import ContactProblem
from carom.problem import ContactProblemError, LocalProblem, cone, residual_of
from carom.problem.residual import holds_nothing
from hypothesis import given
from hypothesis import strategies as st
from problem_cases import DIMENSIONS, a_problem, bounds_of, numbers, one_ball, seeds


def test_no_friction_at_all_is_told_how_to_say_it() -> None:
    with pytest.raises(ContactProblemError, match=r"^mu: there is none; give a number for each contact"):
        ContactProblem.from_matrices(np.eye(3), np.zeros(3), None)


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


@pytest.mark.parametrize(
    ("r", "message"),
    [
        (np.ones(6) * 1j, "type complex128; give real numbers"),
        ("abc", "an array of 0 dimensions and type <U3; give real numbers"),
        (None, "type object; give real numbers"),
        (np.ma.masked_equal(np.arange(6.0), 2), "some of its numbers are masked"),
        ([np.ma.masked_equal(np.arange(3.0), 2)] * 2, "some of its numbers are masked"),
        (np.ones((3, 2)), r"its shape is \(3, 2\); it must be \(6,\)"),
    ],
)
def test_every_array_is_read_in_one_way(r: Any, message: str) -> None:
    problem = ContactProblem.from_matrices(np.eye(6), np.ones(6), [0.2, 0.2])
    with pytest.raises(ContactProblemError, match=f"r: .*{message}"):
        problem.residual(r)
    if r is not None:  # to begin at 0
        with pytest.raises(ContactProblemError, match=f"r0: .*{message}"):
            problem.solve(r0=r)
    if "shape" not in message:
        with pytest.raises(ContactProblemError, match="q: "):
            ContactProblem.from_matrices(np.eye(6), r, [0.2, 0.2])
        with pytest.raises(ContactProblemError, match="vector: "):
            _ = problem.local.W @ r


def test_masked_matrices_and_bounds_are_refused() -> None:
    masked = np.ma.masked_equal(np.eye(3), 1)
    with pytest.raises(ContactProblemError, match="W: some of its numbers are masked"):
        ContactProblem.from_matrices(masked, np.ones(3), [0.2])
    with pytest.raises(ContactProblemError, match="mu: some of its numbers are masked"):
        ContactProblem.from_matrices(np.eye(3), np.ones(3), np.ma.masked_equal([0.2], 0.2))
    assert ContactProblem.from_matrices(np.ma.array(np.eye(3)), np.ones(3), [0.2]).solve().converged


def test_what_overflows_is_infinite_everywhere() -> None:
    problem = LocalProblem(W=np.eye(3), q=[-1e300, 5e299, 0.0], mu=[0.3])
    for r in ([1e200, 0, 0], [np.inf, 0, 0]):
        assert residual_of(problem, r).complementarity == np.inf
        assert "e+308" not in str(residual_of(problem, r))


# --- the face ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["auto", "gauss-seidel", "admm", "interior-point"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_body_between_walls_that_close_has_no_solution(solver: str, mu: float) -> None:
    """Both walls push the same body: `u_N = r_1 - r_2 - 1 >= 0` and `r_2 - r_1 - 1 >= 0` cannot be."""
    W = np.eye(6)
    W[0, 3] = W[3, 0] = -1.0
    closing = ContactProblem.from_matrices(W, [-1, 0, 0, -1, 0, 0], [mu, mu])
    with pytest.raises(carom.problem.SolveFailed, match="there may be no solution") as failed:
        closing.solve(solver)
    found = failed.value.solution
    assert found.err < 0.01
    assert found.residual.penetration > 0.99
    one = ContactProblem.from_matrices(W, [-1, 0, 0, 1, 0, 0], [mu, mu])  # which the body can follow
    assert one.solve(solver).converged


@pytest.mark.parametrize("solver", list(carom.problem.solvers()))
@pytest.mark.parametrize("tol", [1e-4, 2e-3, 1e-2, 0.1])
def test_no_tolerance_takes_what_closes_for_solved(solver: str, tol: float) -> None:
    """The same two walls, and each slides: no r solves it. What has a solution is solved, however large its forces."""
    walls = np.array([[1.0, 0, -1, 0], [0, 1, 0, 1], [-1, 0, 1, 0], [0, 1, 0, 1]])
    for mu in (0.0, 0.3, 5.0):
        closing = ContactProblem.from_matrices(walls, [-1, 0.2, -1, 0.3], [mu, mu])
        assert not closing.solve(solver, tol=tol, on_nonconvergence="return").converged
    n = 40  # a column, whose lowest forces are the sum of all above
    chain = np.kron(2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1), np.diag([1.0, 0.0]))
    column = ContactProblem.from_matrices(chain, np.tile([-1.0, 0.0], n), np.zeros(n))
    found = column.solve(solver, tol=tol, on_nonconvergence="return")
    assert found.converged
    closes = np.maximum(-found.u[::2], 0.0)  # at 1 m/s in each contact where nothing is held
    assert np.sqrt(np.mean(closes**2)) <= np.sqrt(tol)
    assert closes.max() < np.sqrt(2 * tol)  # a half sine along the column, which vanishes last


def test_solvers_that_end_early_say_nothing_of_no_solution() -> None:
    for path in sorted((Path(__file__).parent / "data" / "contact_problems").glob("*velocity*.hdf5"))[::8]:
        problem = ContactProblem.from_fclib(path)
        for solver in ("newton", "gauss-seidel", "admm", "interior-point"):
            found = problem.solve(solver, tol=1e-14, max_iterations=3, on_nonconvergence="return")
            assert not holds_nothing(problem.local, found.r, found.u), path


def test_what_may_have_no_solution_may_as_well_converge_slowly() -> None:
    """A column of balls whose masses grow tenfold: `gauss-seidel` creeps, its forces hold nothing yet; `auto` solves it."""
    light, n = 10.0 ** -np.arange(8), 8
    normal = np.diag(light + np.append(0.0, light[:-1])) - np.diag(light[:-1], 1) - np.diag(light[:-1], -1)
    column = ContactProblem.from_matrices(
        np.kron(normal, np.diag([1.0, 0.0, 0.0])), -np.eye(3 * n)[0], [0.0] * n
    )
    with pytest.raises(
        carom.problem.SolveFailed, match=r"another solver, more iterations .* may do, or there may be no"
    ):
        column.solve("gauss-seidel")
    solved = column.solve("auto")
    # All fell at 1 m/s and stand still: each contact has taken the momentum of the balls above it.
    assert solved.r[::3] == pytest.approx([sum(10.0**j for j in range(k, n)) for k in range(n)], rel=1e-4)


def test_a_problem_does_not_change() -> None:
    problem = ContactProblem.from_bodies(np.eye(3), np.eye(3), [-1, 0, 0], np.zeros(3), [0.5])
    for name, value in {"local": None, "source": None, "mu": 3.0}.items():
        with pytest.raises(ContactProblemError, match=rf"problem.{name}: a contact problem does not change"):
            setattr(problem, name, value)
    with pytest.raises(ContactProblemError, match="does not change"):
        del problem.source
    assert problem.solve().converged
    with pytest.raises(ContactProblemError, match="M: singular in row 0"):
        ContactProblem.from_bodies(np.zeros((3, 3)), np.eye(3), [-1, 0, 0], np.zeros(3), [0.5])


def test_wrong_arguments_of_a_problem_are_errors_of_carom(tmp_path: Path) -> None:
    problem = ContactProblem.from_matrices(np.eye(3), [-1, 0, 0], [0.5])
    with pytest.raises(ContactProblemError, match=r"solver: none is called \['auto'\]"):
        problem.solve(solver=["auto"])  # type: ignore[arg-type]
    for write in (problem.to_fclib, problem.solve().to_fclib):
        for path in (".", tmp_path):
            with pytest.raises(carom.CaromError, match=r"cannot write .*: it is a directory; name a file"):
                write(path)


def test_the_face_of_it_all(tmp_path: Path) -> None:
    problem = carom.ContactProblem.from_matrices(np.eye(3), [-1.0, 0.5, 0.0], [0.2], title="one ball")
    assert problem.residual([1.0, -0.2, 0.0]).err < 1e-15
    assert str(problem.rank()) == "rank 3 of 3, nullity 0"
    assert repr(problem) == "<ContactProblem 'one ball': 1 contacts of 3 rows, local form>"
    assert carom.ContactProblem.from_fclib(problem.to_fclib(tmp_path / "p.hdf5")).title == "one ball"
    bodies = carom.ContactProblem.from_bodies(2 * np.eye(3), np.eye(3), [-2.0, 1.0, 0.0], np.zeros(3), [0.2])
    assert bodies.residual([2.0, -0.4, 0.0]).err < 1e-15
    assert np.array_equal(bodies.local.W.to_dense(), np.eye(3) / 2)
