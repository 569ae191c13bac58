"""`ContactProblem.solve`: what it returns and refuses, with a NumPy solver in the place of the core's and, at the end, with
those of the core; performance profiles."""

from __future__ import annotations

import json
import math
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import solve_cases
from carom import CaromError, ContactProblem
from carom.problem import ContactProblemError, GlobalProblem, Profile, SolveFailed, solvers
from hypothesis import given, settings
from problem_cases import FILES, needs_published, one_ball, seeds
from solve_cases import bodies, chain, easy, unlucky
from solver_double import install, sweeps

double = solve_cases.double

DIMENSIONS = [2, 3, 5, 6]


# --- in Python --------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_solution_is_judged_outside_of_the_solver(d: int) -> None:
    problem = easy(7, d)
    solution = problem.solve()
    assert solution.converged
    assert solution.err == problem.residual(solution.r).err <= solution.tol == 1e-8
    np.testing.assert_allclose(
        solution.u, problem.local.W.to_dense() @ solution.r + problem.local.q, atol=1e-14
    )
    assert solution.solver == "auto"
    assert solution.iterations == solution.stages[0].iterations > 1
    assert solution.wall_s > 0.0
    assert solution.v is None
    for array in (solution.r, solution.u):
        with pytest.raises(ValueError):
            array[0] = 1.0


def test_what_a_solver_claims_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = easy(7)
    good = dict(sweeps_of(problem))
    install(monkeypatch, unlucky(converged=False))
    assert problem.solve().converged
    install(monkeypatch, unlucky(r=1.001 * good["r"], converged=True))
    solution = problem.solve(on_nonconvergence="return")
    assert not solution.converged
    assert 1e-5 < solution.err < 1e-1


def sweeps_of(problem: ContactProblem) -> dict[str, Any]:
    w, zero = problem.local.W, np.zeros(problem.contacts)
    matrix = (w.indptr, w.indices, w.data, problem.local.q, problem.dimension)
    return sweeps(*matrix, problem.local.mu, zero, zero, None, "auto", 1e-8, 0, math.inf, 1)


def test_no_iterate_is_passed_off_as_a_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)
    with pytest.raises(SolveFailed, match=r"seed 7: NOT solved by sweeps: err = .*, 1 iteration, ") as failed:
        easy(7).solve("sweeps", max_iterations=1)
    assert isinstance(failed.value, CaromError)
    assert failed.value.solution.err > 1e-8
    assert not failed.value.solution.converged
    for bad in (math.nan, math.inf):
        install(monkeypatch, unlucky(r=np.full(12, bad)))
        assert math.isinf(easy(7).solve(on_nonconvergence="return").err)


def test_all_arguments_reach_the_core(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []

    def spy(*arguments: Any) -> dict[str, Any]:
        seen[:] = arguments
        return sweeps(*arguments)

    install(monkeypatch, spy)
    problem = easy(7, d=6)
    first = problem.solve()
    indptr, indices, data, q, d, mu, mu_r, mu_s, r0, solver, tol, iterations, limit, threads, cancel = seen
    assert (indptr.dtype, indices.dtype, data.dtype, q.dtype) == (np.int64, np.int64, np.float64, np.float64)
    assert (d, solver, tol, iterations, limit, threads) == (6, "auto", 1e-8, 0, math.inf, 1)
    assert r0 is None
    assert not cancel.cancelled
    source = problem.local
    assert all(np.array_equal(a, b) for a, b in zip((mu, mu_r, mu_s), source.bounds.T, strict=True))
    start = first.r.reshape(-1, 6)
    again = problem.solve("sweeps", tol=1e-6, r0=start, max_iterations=50, time_limit="3000 ms", threads=2)
    assert again.iterations < first.iterations
    assert np.array_equal(seen[8], first.r)
    assert seen[9:14] == ["sweeps", 1e-6, 50, 3.0, 2]
    easy(7, d=3).solve()
    assert not seen[6].any()
    assert seen[6].shape == seen[7].shape == (4,)


@pytest.mark.usefixtures("double")
def test_velocities_of_bodies() -> None:
    problem = bodies(3)
    source = problem.source
    assert isinstance(source, GlobalProblem)
    solution = problem.solve()
    m, h = source.M.to_dense(), source.H.to_dense()
    assert solution.v is not None
    np.testing.assert_allclose(m @ solution.v, h @ solution.r + source.f, atol=1e-13)
    np.testing.assert_allclose(h.T @ solution.v + source.w, solution.u, atol=1e-13)


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"solver": "newtn"}, "solver: none is called 'newtn'; known: auto, sweeps"),
        ({"solver": "sweep"}, "did you mean sweeps"),
        ({"tol": 0.0}, "tol: 0.0; it must be a finite number above 0"),
        ({"tol": math.nan}, "tol: nan"),
        ({"tol": math.inf}, "tol: inf"),
        ({"tol": "small"}, "tol: 'small'"),
        ({"max_iterations": 0}, "max_iterations: 0; it must be a whole number above 0"),
        ({"max_iterations": 2.5}, "max_iterations: 2.5"),
        ({"time_limit": -1}, "time_limit: -1; it must be a number above 0"),
        ({"threads": 0}, "threads: 0"),
        ({"r0": np.zeros(11)}, r"r0: its shape is \(11,\); it must be \(12,\)"),
        ({"r0": ["a"]}, "r0: an array of 1 dimensions and type <U1; give real numbers"),
        ({"r0": np.full(12, np.nan)}, "r0: not all of it is finite"),
        ({"on_nonconvergence": "warn"}, "on_nonconvergence: 'warn'; either 'raise' or 'return'"),
    ],
)
def test_what_cannot_be_meant_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ContactProblemError, match=message) as refused:
        easy(7).solve(**arguments)
    assert "\n" not in str(refused.value)


def test_what_the_core_refuses_names_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: Any) -> dict[str, Any]:
        raise ValueError("contacts of 6 rows\nare not known")

    install(monkeypatch, refuse)
    with pytest.raises(CaromError, match=r"^sweeps: contacts of 6 rows are not known$"):
        easy(7, d=6).solve("sweeps")


@pytest.mark.usefixtures("double")
def test_it_shows_itself() -> None:
    solution = easy(7).solve()
    assert repr(solution).startswith("<Solution of 'seed 7': 4 contacts solved by auto: err = ")
    html = solution._repr_html_()
    assert "solved by <code>auto</code>" in html
    assert "<td>few contacts</td>" in html
    source = easy(7).local
    titled = ContactProblem.from_matrices(source.W, source.q, source.mu, title="<script>x")
    failed = titled.solve(max_iterations=1, on_nonconvergence="return")
    assert "NOT solved by auto" in repr(failed)
    assert "<b>not</b> solved" in failed._repr_html_()
    assert "<script>" not in failed._repr_html_()
    assert json.loads(json.dumps(solution.to_dict()))["stages"][0]["name"] == "sweep"


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize("form", ["local", "global"])
def test_a_solution_in_a_file_stands_beside_its_problem(form: str, tmp_path: Path) -> None:
    problem = easy(7) if form == "local" else bodies(7)
    solution = problem.solve()
    path = solution.to_fclib(tmp_path / "deep" / "s.hdf5")
    with h5py.File(path) as file:
        kept = {name: values[()] for name, values in file["solution"].items()}
    assert set(kept) == ({"r", "u"} if form == "local" else {"r", "u", "v"})
    assert np.array_equal(kept["r"], solution.r)
    assert np.array_equal(kept["u"], solution.u)
    again = ContactProblem.from_fclib(path)
    assert again.residual(kept["r"]).err == solution.err


def test_calls_from_other_threads_work(monkeypatch: pytest.MonkeyPatch) -> None:
    from concurrent.futures import ThreadPoolExecutor

    install(monkeypatch)
    alone = easy(7).solve().r
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda _: easy(7).solve().r, range(4)))
    assert all(np.array_equal(r, alone) for r in found)


# --- profiles ---------------------------------------------------------------------------------------------------------


def test_a_profile_by_hand() -> None:
    """Four problems: a is the fastest of two, b of one in three times the time, none solves the last."""
    inf = math.inf
    profile = Profile.of(["a", "b"], [[1.0, 2.0], [1.0, inf], [6.0, 2.0], [math.nan, inf]])
    assert profile.problems == 4
    np.testing.assert_array_equal(profile.ratios, [[1, 2], [1, inf], [3, 1], [inf, inf]])
    factor, share = profile.curves()
    np.testing.assert_array_equal(factor, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(share, [[0.5, 0.25], [0.5, 0.5], [0.75, 0.5]])
    np.testing.assert_array_equal(profile.within(2.5), [0.5, 0.5])
    at, solved = profile.solved()
    np.testing.assert_array_equal(at, [1.0, 2.0, 6.0])
    np.testing.assert_array_equal(solved, [[0.5, 0.0], [0.5, 0.5], [0.75, 0.5]])


@pytest.mark.parametrize("times", [np.zeros((0, 2)), np.full((3, 2), np.inf)])
def test_profiles_of_nothing_are_drawn(times: np.ndarray, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="figures need matplotlib")
    from carom.show.plot import profile as drawn
    from carom.show.plot.style import save

    profile = Profile.of(["a", "b"], times)
    assert not profile.within(10.0).any()
    for draw in (drawn.performance, drawn.times):
        [path] = [file for file in save(draw(profile), tmp_path, "p", ["svg"]) if file.suffix == ".svg"]
        assert ElementTree.parse(path).getroot().tag.endswith("svg")


def test_times_that_are_none_are_refused() -> None:
    with pytest.raises(CaromError, match="2 solvers from times of shape"):
        Profile.of(["a", "b"], [[1.0, 2.0, 3.0]])
    with pytest.raises(CaromError, match="above 0 s"):
        Profile.of(["a"], [[0.0]])


# --- the solvers of the core ------------------------------------------------------------------------------------------

#: Published problems of thousands of contacts, which take seconds.
LARGE = ("fc2d_granularflowonwall_02020_00213", "fc2d_granularflowonwall_07002_00801")


def published() -> list[Any]:
    """The files as parameters, large ones among the long tests."""
    return [
        pytest.param(path, id=path.stem, marks=pytest.mark.long if path.stem in LARGE else ())
        for path in FILES
    ]


@needs_published
@pytest.mark.parametrize("path", published())
@pytest.mark.filterwarnings("ignore::carom.problem.ContactProblemWarning")
def test_auto_solves_what_others_published(path: Path) -> None:
    problem = ContactProblem.from_fclib(path)
    # The aim of 10 s is for a machine of its own (`make bench`); tests share theirs.
    solution = problem.solve(time_limit=60.0, on_nonconvergence="return")
    assert problem.residual(solution.r).err <= 1e-8, solution


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
@settings(max_examples=20)
def test_auto_solves_well_conditioned_problems(d: int, seed: int) -> None:
    problem = easy(seed, d, contacts=6)
    solution = problem.solve()
    assert solution.err <= 1e-8
    assert sum(stage.iterations for stage in solution.stages) == solution.iterations


@pytest.mark.parametrize("d", DIMENSIONS)
@given(seed=seeds)
@settings(max_examples=20)
def test_contacts_on_their_own_are_solved_as_by_hand(d: int, seed: int) -> None:
    source, r = one_ball(seed, d)
    solution = ContactProblem(source).solve(tol=1e-13)
    np.testing.assert_allclose(solution.r, r, atol=1e-11 * np.abs(r).max(initial=1e-300))


@pytest.mark.parametrize("name", solvers())
def test_every_solver_has_a_line_and_solves_an_easy_problem(name: str) -> None:
    assert solvers()[name]
    assert "\n" not in solvers()[name]
    solution = easy(11, contacts=12).solve(name)
    assert solution.solver == name
    assert solution.stages[-1].err == pytest.approx(solution.err, rel=0.5, abs=1e-12)


def test_the_first_solver_is_auto_and_has_a_rule() -> None:
    from carom import _core

    assert next(iter(solvers())) == "auto"
    assert 5 <= len(_core.auto_rule().strip().splitlines()) <= 20


def test_a_problem_without_contacts_is_solved() -> None:
    solution = ContactProblem.from_matrices(np.zeros((0, 0)), [], []).solve()
    assert solution.converged
    assert (solution.r.shape, solution.u.shape, solution.err) == ((0,), (0,), 0.0)
    assert "0 contacts" in repr(solution)


def test_a_solution_to_begin_with_is_kept() -> None:
    problem = easy(11, contacts=12)
    first = problem.solve(tol=1e-12)
    again = problem.solve(tol=1e-8, r0=first.r)
    assert again.iterations <= 2
    np.testing.assert_allclose(again.r, first.r, atol=1e-7)


def test_threads_do_not_change_a_bit() -> None:
    problem = easy(11, contacts=40)
    alone = problem.solve()
    for threads in (2, 3, 8):
        assert np.array_equal(problem.solve(threads=threads).r, alone.r)
    assert np.array_equal(problem.solve().r, alone.r)


def test_threads_do_not_change_a_bit_of_many_contacts() -> None:
    # More contacts than are swept in the order given (crates/carom-solve/src/solver/sweep).
    problem = chain(2400)
    alone = problem.solve("gauss-seidel", max_iterations=30, on_nonconvergence="return")
    assert alone.err < 1e-2
    for threads in (2, 5, 8):
        again = problem.solve("gauss-seidel", threads=threads, max_iterations=30, on_nonconvergence="return")
        assert np.array_equal(again.r, alone.r)


def test_limits_are_kept() -> None:
    problem = easy(11, contacts=40)
    few = problem.solve("gauss-seidel", max_iterations=1, on_nonconvergence="return")
    assert (few.iterations, few.converged) == (1, False)
    begin = time.perf_counter()
    problem.solve("gauss-seidel", tol=1e-300, time_limit=0.2, on_nonconvergence="return")
    assert time.perf_counter() - begin < 2.0


@pytest.mark.parametrize("solver", ["auto", "newton", "gauss-seidel", "interior-point"])
@pytest.mark.parametrize("mu", [1e4, 1e8, 1e12])
def test_friction_without_bound_is_no_slip(solver: str, mu: float) -> None:
    """The natural map is `u_N/mu` where nothing pushes: it called an open contact solved, of which all closed."""
    problem = ContactProblem.from_matrices(np.eye(3), [-1, 3, 4], [mu])
    solution = problem.solve(solver)
    assert solution.r == pytest.approx([1, -3, -4], abs=1e-7)
    assert problem.residual(solution.r).penetration < 1e-7


def test_what_still_closes_is_not_solved() -> None:
    problem = ContactProblem.from_matrices(np.eye(3), [-1, 3, 4], [1e9])
    stopped = problem.solve("admm", max_iterations=5, on_nonconvergence="return")
    assert stopped.residual.penetration > 0.5
    assert not stopped.converged
