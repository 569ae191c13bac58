"""`ContactProblem.solve` and `carom solve`: what they return, print and write, and what they refuse.

Most tests have a NumPy solver in the place of the core's, so that they command what it answers; those at the end call
the core.
"""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from carom.errors import CaromError
from carom.problem import (
    ContactProblem,
    ContactProblemError,
    GlobalProblem,
    Profile,
    SolveFailed,
    solvers,
    write_fclib,
)
from carom.problem.matrix import Csr
from hypothesis import given, settings
from solver_double import RULE, install, sweeps
from test_cli import Answer, cli
from test_problem import FILES, bounds_of, needs_published, numbers, one_ball, seeds

DIMENSIONS = [2, 3, 5, 6]


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
    again = problem.solve("sweeps", tol=1e-6, r0=start, max_iterations=50, time_limit=3, threads=2)
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
        ({"tol": 0.0}, "tol: 0.0; it must be a number above 0"),
        ({"tol": math.nan}, "tol: nan"),
        ({"tol": math.inf}, "tol: inf"),
        ({"tol": "small"}, "tol: 'small'"),
        ({"max_iterations": 0}, "max_iterations: 0; it must be a whole number above 0"),
        ({"max_iterations": 2.5}, "max_iterations: 2.5"),
        ({"time_limit": -1}, "time_limit: -1; it must be a number above 0"),
        ({"threads": 0}, "threads: 0"),
        ({"r0": np.zeros(11)}, r"r0: its shape is \(11,\); it must be \(12,\)"),
        ({"r0": ["a"]}, "r0: not a list of numbers"),
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
    from carom.plot import profile as drawn
    from carom.plot.style import save

    profile = Profile.of(["a", "b"], times)
    assert not profile.within(10.0).any()
    for draw in (drawn.performance, drawn.times):
        assert all(path.stat().st_size for path in save(draw(profile), tmp_path, "p", ["svg"]))


def test_times_that_are_none_are_refused() -> None:
    with pytest.raises(CaromError, match="2 solvers from times of shape"):
        Profile.of(["a", "b"], [[1.0, 2.0, 3.0]])
    with pytest.raises(CaromError, match="above 0 s"):
        Profile.of(["a"], [[0.0]])


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("double")
def test_one_file_is_told_in_full(folder: Path) -> None:
    answer = cli("solve", folder / "a.hdf5")
    lines = answer.stdout.splitlines()
    assert lines[0] == "seed 1 (a.hdf5)"
    assert lines[1].startswith("solved: err = ")
    told = {line.split()[0]: line for line in lines[2:]}
    assert told["problem"].split("  ")[-1].strip() == "local form, 4 contacts of 3 rows"
    assert told["W"].endswith("12 rows, 144 entries; rank 12, nullity 0")
    assert told["solver"].split()[1] == "auto,"
    assert "worst" in told
    assert told["sweep"].endswith("few contacts")
    assert answer.stderr == ""
    assert cli("solve", folder / "a.hdf5", "--quiet").stdout == ""


@pytest.mark.usefixtures("double")
def test_several_files_are_a_table(folder: Path) -> None:
    rows = cli("solve", folder).stdout.splitlines()
    assert rows[0] == "3 of 3 solved by auto to err <= 1e-08"
    assert " ".join(rows[2].split()) == "file contacts rows iterations time err finished by verdict"
    assert [row.split()[:3] for row in rows[4:7]] == [
        ["a.hdf5", "4", "12"],
        ["b.h5", "4", "20"],
        ["c.hdf5", "3", "9"],
    ]
    assert all(row.split()[-2:] == ["sweep", "solved"] for row in rows[4:7])
    pairs = cli("solve", folder, "--solver", "all").stdout.splitlines()
    assert pairs[0] == "6 of 6 solved to err <= 1e-08"
    assert pairs[4].split()[:4] == ["a.hdf5", "4", "12", "auto"]
    assert pairs[5].split()[0] == "sweeps"  # of the same file


def test_a_narrow_terminal_keeps_the_names(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)
    monkeypatch.setenv("COLUMNS", "70")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    from carom.cli.solutions import Attempt, _table

    done = [
        Attempt(Path("a_file_with_a_rather_long_name.hdf5"), {"contacts": 4, "rows": 12}, "auto", None, "no")
    ]
    sheet = _table(done, {"tolerance": 1e-8, "solvers": {"auto": {}, "sweeps": {}}})
    assert list(sheet.head) == ["file", "solver", "time", "err", "verdict"]


@pytest.mark.usefixtures("double")
def test_json_is_one_document_with_all_of_it(folder: Path) -> None:
    answer = cli("solve", folder, "--solver", "sweeps", "--solver", "auto,sweeps", "--json")
    document = json.loads(answer.stdout)
    assert answer.stderr == ""
    assert set(document) == {"tolerance", "threads", "interrupted", "results", "solvers", "files"}
    assert [(Path(r["file"]).name, r["solver"]) for r in document["results"]] == [
        (name, solver) for name in ("a.hdf5", "b.h5", "c.hdf5") for solver in ("sweeps", "auto")
    ]
    first = document["results"][0]
    assert first["verdict"] == "solved"
    assert first["err"] <= document["tolerance"] == 1e-8
    assert (first["contacts"], first["dimension"], first["rows"], first["form"]) == (4, 3, 12, "local")
    assert first["residual"]["worst"] in range(4)
    assert first["stages"][0]["why"] == "few contacts"
    assert set(document["solvers"]) == {"sweeps", "auto"}
    assert document["solvers"]["auto"]["solved"] == document["solvers"]["auto"]["problems"] == 3
    assert document["solvers"]["auto"]["within_10"] <= 1.0


def test_what_is_not_solved_gives_3(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)
    one = cli("solve", folder / "a.hdf5", "--max-iterations", "1", code=3)
    assert "NOT SOLVED: err = " in one.stdout
    assert one.stderr.startswith("carom: a.hdf5: auto ends with err = ")
    several = cli("solve", folder, "--max-iterations", "1", "--json", code=3)
    document = json.loads(several.stdout)
    assert {r["verdict"] for r in document["results"]} == {"not solved"}
    assert document["code"] == 3
    assert document["solvers"]["auto"]["solved"] == 0
    install(monkeypatch, unlucky(r=np.full(12, np.nan)))
    assert json.loads(cli("solve", folder / "a.hdf5", "--json", code=3).stdout)["results"][0]["err"] is None


@pytest.mark.usefixtures("double")
def test_a_file_that_cannot_be_read_does_not_stop_the_others(folder: Path) -> None:
    (folder / "bad.h5").write_bytes(b"no HDF5")
    answer = cli(
        "solve", folder, "--max-iterations", "1", code=2
    )  # 2 before 3: bad input is the greater trouble
    bad = next(line for line in answer.stdout.splitlines() if line.startswith(" bad.h5"))
    assert bad.split() == ["bad.h5", *"------", "refused"]
    assert sum("not solved" in line for line in answer.stdout.splitlines()) == 3
    assert f"refused: {folder / 'bad.h5'}: cannot be read" in answer.stdout
    assert answer.stderr.startswith(f"carom: {folder / 'bad.h5'}: cannot be read")
    document = json.loads(cli("solve", folder, "--json", code=2).stdout)
    assert [r["verdict"] for r in document["results"]] == ["solved", "solved", "refused", "solved"]
    assert document["code"] == 2
    assert document["results"][2]["error"] in document["error"]


def test_a_solver_that_refuses_a_problem_is_a_row(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def picky(*arguments: Any) -> dict[str, Any]:
        if arguments[4] == 5 and arguments[9] == "sweeps":
            raise ValueError("no rolling")
        return sweeps(*arguments)

    install(monkeypatch, picky)
    answer = cli("solve", folder, "--solver", "all", code=2)
    assert f"refused: {folder / 'b.h5'}: sweeps: no rolling" in answer.stdout
    last = [line.split() for line in answer.stdout.splitlines()[-2:]]
    assert [line[:4] for line in last] == [["auto", "3", "of", "3"], ["sweeps", "2", "of", "3"]]


def test_of_several_times_the_shortest_counts(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = [3.0, 1.0, 2.0]
    install(monkeypatch, lambda *arguments: {**sweeps(*arguments), "wall_s": times.pop(0)})
    document = json.loads(cli("solve", folder / "a.hdf5", "--repeat", "3", "--json").stdout)
    assert document["results"][0]["wall_s"] == 1.0
    assert not times


@pytest.mark.usefixtures("double")
def test_the_rule_of_auto(folder: Path) -> None:
    assert cli("solve", "--explain").stdout == RULE + "\n"
    assert json.loads(cli("solve", "--explain", "--json").stdout) == {"rule": RULE}
    one = cli("solve", folder / "a.hdf5", "--explain").stdout
    assert one.startswith(RULE + "\n\nseed 1")
    several = cli("solve", folder, "--explain").stdout
    assert several.startswith(RULE)
    assert several.count("few contacts") == RULE.count("few contacts") + 3
    assert "c.hdf5, auto\n" in several
    assert "give a file to solve" in cli("solve", code=2).stderr


@pytest.mark.usefixtures("double")
def test_profiles_and_their_numbers_are_written(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="figures need matplotlib")
    out = tmp_path / "new" / "out"
    answer = cli("solve", folder, "--solver", "all", "-o", out, "--format", "svg,pdf")
    names = {"results.csv"} | {f"{n}.{s}" for n in ("profile", "times") for s in ("csv", "svg", "pdf")}
    assert {path.name for path in out.iterdir()} == names
    assert all(str(out / name) in answer.stdout for name in names)
    with open(out / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6
    times = {(row["file"], row["solver"]): float(row["wall_s"]) for row in rows}
    with open(out / "profile.csv", newline="") as file:
        [*_, last] = csv.DictReader(file)
    worst = max(
        max(times[name, s] for s in ("auto", "sweeps")) / min(times[name, s] for s in ("auto", "sweeps"))
        for name in ("a.hdf5", "b.h5", "c.hdf5")
    )
    assert float(last["factor (1)"]) == pytest.approx(worst, rel=1e-12)
    assert float(last["share of auto (1)"]) == float(last["share of sweeps (1)"]) == 1.0
    assert "share of 3 problems solved" in (out / "profile.svg").read_text()
    alone = tmp_path / "alone"
    cli("solve", folder / "a.hdf5", "-o", alone)
    assert {path.name for path in alone.iterdir()} == {"results.csv"}
    assert "--format: 'gif' is no format" in cli("solve", folder, "-o", out, "--format", "gif", code=2).stderr


@pytest.mark.usefixtures("double")
def test_the_solution_of_one_file_is_written(folder: Path) -> None:
    answer = cli("solve", folder / "c.hdf5", "--solution", folder / "kept" / "s.hdf5")
    assert answer.stdout.splitlines()[-1] == str(folder / "kept" / "s.hdf5")
    with h5py.File(folder / "kept" / "s.hdf5") as file:
        r = file["solution/r"][()]
    assert ContactProblem.from_fclib(folder / "c.hdf5").residual(r).err < 1e-8
    assert "one file and one solver" in cli("solve", folder, "--solution", "s.h5", code=2).stderr
    refused = cli("solve", folder / "a.hdf5", "--solution", folder / "a.hdf5" / "s.h5", code=2)
    assert "cannot write" in refused.stderr


@pytest.mark.usefixtures("double")
def test_directories_of_runs_are_known(folder: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    (run / "problems").mkdir(parents=True)
    (run / "run.json").write_text("{}")
    (run / "results.h5").write_bytes(b"frames")
    (run / "failing_problem.h5").write_bytes((folder / "a.hdf5").read_bytes())
    (run / "problems" / "step_7.hdf5").write_bytes((folder / "b.h5").read_bytes())
    document = json.loads(cli("solve", run, "--json").stdout)
    assert [Path(r["file"]).name for r in document["results"]] == ["failing_problem.h5", "step_7.hdf5"]
    (tmp_path / "empty").mkdir()
    assert "no *.hdf5 or *.h5 in this directory" in cli("solve", tmp_path / "empty", code=2).stderr


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--solver", "sweep"], "--solver: none is called 'sweep'; did you mean sweeps?"),
        (["--tol", "0"], "tol: 0.0; it must be a number above 0"),
        (["--tol", "nan"], "tol: nan"),
        (["--time-limit", "0"], "time_limit: 0.0"),
        (["--threads", "0"], "--threads"),
        (["--max-iterations", "-1"], "--max-iterations"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(options: list[str], message: str, folder: Path) -> None:
    one_line(cli("solve", folder / "a.hdf5", *options, code=2), message)


# --- input that is ill posed ------------------------------------------------------------------------------------------


def one_line(answer: Answer, message: str) -> None:
    assert message in answer.stderr
    assert answer.stderr.count("\n") == 1
    assert "Traceback" not in answer.stderr


def changed(path: Path, change: Callable[[h5py.File], None]) -> None:
    with h5py.File(path, "r+") as file:
        change(file["fclib_local"])


def put(name: str, place: int, value: float) -> Callable[[Any], None]:
    def change(group: Any) -> None:
        group[name][place] = value

    return change


def swap(name: str, values: Any) -> Callable[[Any], None]:
    def change(group: Any) -> None:
        del group[name]
        group[name] = np.asarray(values)

    return change


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("vectors/q", 3, np.nan), "q: nan as value 3 (from 0); all numbers must be finite"),
        (put("W/x", 5, np.inf), "W: inf as value 5 (from 0); all numbers must be finite"),
        (put("W/x", 1, 3.0), "W: unsymmetric by "),
        (put("W/x", 0, -3.0), "W: -3 on its diagonal, row 0 (from 0); it must be positive semidefinite"),
        (put("vectors/mu", 2, -0.1), "mu: -0.1 at contact 2 (from 0); bounds are 0 or positive"),
        (swap("vectors/q", np.ones(11)), "W (m, n): 12 x 12; with vectors of this length it must be 11 x 11"),
        (
            swap("vectors/mu", np.ones(5)),
            "q: 12 rows for 5 contacts; every contact has the same number of rows",
        ),
        (swap("W/p", np.arange(5)), "W: 5 starts of 12 rows; there must be 13"),
        (swap("spacedim", [7]), "fclib_local/spacedim: 7; 2 or 3 are known"),
    ],
)
def test_ill_posed_files_are_refused_in_one_line(
    change: Callable[[Any], None], message: str, folder: Path
) -> None:
    path = folder / "a.hdf5"
    changed(path, change)
    answer = cli("solve", path, code=2)
    one_line(answer, message)
    assert answer.stderr.startswith(f"carom: {path}: ")
    assert ";" in answer.stderr.removeprefix(f"carom: {path}: ")  # a cure
    assert answer.stdout == ""
    document = json.loads(cli("solve", path, "--json", code=2).stdout)
    assert (document["code"], document["results"][0]["verdict"]) == (2, "refused")


@pytest.mark.usefixtures("double")
def test_files_that_are_none_are_refused_in_one_line(folder: Path) -> None:
    whole = (folder / "a.hdf5").read_bytes()
    (folder / "cut.hdf5").write_bytes(whole[: len(whole) // 2])
    one_line(cli("solve", folder / "cut.hdf5", code=2), "is it an HDF5 file, and whole?")
    one_line(cli("solve", folder / "none.hdf5", code=2), "no such file; name an HDF5 file")
    with h5py.File(folder / "other.hdf5", "w") as file:
        file["frames"] = np.zeros(3)
    one_line(cli("solve", folder / "other.hdf5", code=2), "no contact problem (there is frames)")
    heavy = GlobalProblem(M=np.diag([1.0, 0.0, 1.0]), H=np.eye(3), f=np.ones(3), w=np.ones(3), mu=[0.3])
    write_fclib(heavy, folder / "massless.hdf5")
    one_line(cli("solve", folder / "massless.hdf5", code=2), "M: singular in row 1 (from 0)")


@pytest.mark.usefixtures("double")
def test_what_is_doubtful_is_told_and_solved(folder: Path) -> None:
    changed(folder / "a.hdf5", lambda group: put("W/x", 1, group["W/x"][1] + 1e-5)(group))
    answer = cli("solve", folder / "a.hdf5")
    assert answer.stderr.startswith(f"carom: warning: {folder / 'a.hdf5'}: W is unsymmetric by ")
    assert answer.stderr.count("\n") == 1
    for k in range(5):
        (folder / f"a{k}.hdf5").write_bytes((folder / "a.hdf5").read_bytes())
    lines = cli("solve", folder).stderr.splitlines()
    assert len(lines) == 4
    assert lines[-1] == "carom: warning: and 3 more such; --json lists them"


# --- Ctrl-C -----------------------------------------------------------------------------------------------------------

SLOW = """
import sys, time, pytest
sys.path.insert(0, {tests!r})
from carom.problem.matrix import Csr
from hypothesis import given, settings
from solver_double import install, sweeps
def solve(*arguments):
    if arguments[4] == 5:
        print("slow", file=sys.stderr, flush=True)
        time.sleep(60)
    return sweeps(*arguments)
install(pytest.MonkeyPatch(), solve)
"""


def started(program: str) -> subprocess.Popen[str]:
    text = SLOW.format(tests=str(Path(__file__).parent)) + program
    process = subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert process.stderr.readline() == "slow\n"
    return process


@pytest.mark.parametrize(
    ("number", "form"),
    [
        (signal.SIGINT, "text"),
        (signal.SIGTERM, "json"),
        pytest.param(signal.SIGINT, "json", marks=pytest.mark.long),
        pytest.param(signal.SIGTERM, "text", marks=pytest.mark.long),
    ],
)
def test_ctrl_c_is_heard_at_once_and_shows_what_is_done(number: int, form: str, folder: Path) -> None:
    options = [] if form == "text" else ["--json"]
    arguments = ["solve", *(str(folder / name) for name in ("a.hdf5", "c.hdf5", "b.h5")), *options]
    process = started(f"from carom.cli import main; main({arguments!r})")
    begin = time.perf_counter()
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert time.perf_counter() - begin < 10.0  # the solver would have slept for 60 s
    assert process.returncode == 130
    assert err == "carom: interrupted: 2 of 3 files are done\n"
    if form == "json":
        document = json.loads(out)
        assert (document["interrupted"], document["code"]) == (True, 130)
        assert [r["verdict"] for r in document["results"]] == ["solved", "solved"]
    else:
        assert out.startswith("2 of 2 solved")


def test_ctrl_c_in_python_leaves_the_session_alive(folder: Path) -> None:
    program = f"""
import carom, time
from carom.problem.solve import is_abandoned
try:
    carom.ContactProblem.from_fclib({str(folder / "b.h5")!r}).solve()
except KeyboardInterrupt:
    print("interrupted", is_abandoned(), carom.ContactProblem.from_fclib({str(folder / "a.hdf5")!r}).solve().converged)
    import os, sys
    sys.stdout.flush()
    os._exit(0)
"""
    process = started(program)
    os.kill(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (out, err) == ("interrupted True True\n", "")


ENDLESS = """
import sys, threading, time
sys.path.insert(0, {tests!r})
import numpy as np
from carom import _core
from test_solve import chain
local = chain(4000, -0.5).local  # sweeps take thousands of rounds
zero = np.zeros(local.contacts)
def endless(cancel):
    return _core.solve_contact_problem(local.W.indptr, local.W.indices, local.W.data, local.q, 3, local.mu, zero, zero,
        None, "gauss-seidel", 1e-300, 0, float("inf"), 2, cancel)
""".replace("{tests!r}", repr(str(Path(__file__).parent)))


def test_the_core_ends_when_it_is_told_to() -> None:
    program = f"""{ENDLESS}
cancel, found = _core.Cancel(), []
thread = threading.Thread(target=lambda: found.append(endless(cancel)))
thread.start()
time.sleep(0.2)
assert thread.is_alive() and not cancel.cancelled
cancel.cancel()
thread.join(10.0)
assert cancel.cancelled
print(thread.is_alive(), found[0]["converged"], bool(np.isfinite(found[0]["r"]).all()), found[0]["wall_s"] >= 0.2)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("False False True True\n", "")


def test_ctrl_c_ends_the_core_too() -> None:
    program = f"""{ENDLESS}
from carom.problem.solve import _interruptible, is_abandoned
cancel = _core.Cancel()
print("ready", flush=True)
try:
    _interruptible(lambda: endless(cancel), cancel.cancel)
except KeyboardInterrupt:
    print("interrupted", is_abandoned())
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (out, err, process.returncode) == ("interrupted False\n", "", 0)


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
