"""The bench of contact solvers: its heaps, its search for a tolerance, and that Siconos is told the same problem."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "benches"))

import _solvers_report as report
import solvers as bench
from _solvers_problems import heap, problems
from _solvers_programs import Call, Problem
from _solvers_siconos import siconos


@pytest.fixture(scope="module")
def pile() -> Problem:
    return Problem("pile", "heaps", heap(40, 0.5, 7))


class Scripted:
    """A solver whose r has err = `factor` times its tolerance, at a cost that grows as that falls."""

    program, options = "Test", ""

    def __init__(self, solution: np.ndarray[Any, Any], factor: float, most: float = 1e99) -> None:
        self.name, self.solution, self.factor, self.most = "scripted", solution, factor, most
        self.asked: list[float] = []

    def takes(self, problem: Problem) -> bool:
        return True

    def call(self, problem: Problem, tolerance: float, limit: float) -> Call:
        self.asked.append(tolerance)
        err = max(self.factor * tolerance, 1.0 / self.most)
        iterations = round(-10 * np.log10(err))
        off = np.zeros_like(self.solution)
        off[0] = 1.0
        # err rises with the distance along `off`: halve until it is met.
        size = 1.0
        while problem.err(self.solution + size * off) > err:
            size *= 0.9
        return Call(1e-3, iterations, self.solution + size * off, err <= self.factor * tolerance)


@pytest.fixture(scope="module")
def solution(pile: Problem) -> np.ndarray[Any, Any]:
    return np.array(pile.contact_problem.solve(tol=1e-13).r)


def test_a_heap_is_what_was_ordered_and_the_same_each_time(pile: Problem) -> None:
    p = pile.contact_problem
    assert p.contacts == 40
    again = heap(40, 0.5, 7)
    assert np.array_equal(p.local.q, again.local.q)
    assert np.array_equal(p.local.W.data, again.local.W.data)
    assert not np.array_equal(p.local.q, heap(40, 0.5, 8).local.q)
    assert p.rank().nullity < 30  # spheres touch one another; they are not a chain of copies
    assert np.linalg.eigvalsh(p.local.W.to_dense()).min() > -1e-12


@pytest.mark.parametrize(
    ("factor", "settled", "asked"),
    [
        (0.9, 1e-8, 1),  # just right
        (50.0, 1e-10, 3),  # too lax a measure: two decades tighter
        (1e-4, 1e-5, 5),  # too strict: looser as long as the judge agrees
    ],
)
def test_the_cheapest_tolerance_that_the_judge_accepts_is_found(
    pile: Problem, solution: np.ndarray[Any, Any], factor: float, settled: float, asked: int
) -> None:
    solver = Scripted(solution, factor)
    found = bench.setting(solver, pile, 1e-8, 10.0)
    assert found.tolerance == pytest.approx(settled)
    assert found.err <= 1e-8
    assert len(solver.asked) <= asked


def test_a_solver_that_knows_that_it_failed_is_not_asked_again(
    pile: Problem, solution: np.ndarray[Any, Any]
) -> None:
    solver = Scripted(solution, 0.9, most=1e5)
    found = bench.setting(solver, pile, 1e-8, 10.0)
    assert found.tolerance is None
    assert solver.asked == [1e-8]
    entry = report.Entry.of(pile, solver, found.tolerance, 1e-3, found.call, found.err)
    assert not entry.solved
    assert entry.seconds != entry.seconds  # an unsolved problem has no time
    assert entry.cell.startswith("(")


def test_files_and_names_choose_problems(pile: Problem, tmp_path: Path) -> None:
    pile.contact_problem.to_fclib(tmp_path / "mine.hdf5")
    said: list[str] = []
    assert [p.name for p in problems([], False, [tmp_path], said)] == ["mine"]
    assert not list(problems(["other"], False, [tmp_path], said))
    assert not said
    assert not list(problems([], False, [tmp_path / "absent"], said))
    assert said == ["Skipped: no such files."]


def test_siconos_is_told_the_same_problem_in_both_storages(
    pile: Problem, solution: np.ndarray[Any, Any]
) -> None:
    found, why = siconos()
    if not found:
        pytest.skip(str(why))
    asked = [s for s in found if s.takes(pile)]
    assert {s.recipe.storage for s in asked} == {"block", "sparse"}
    for solver in asked:
        call = solver.call(pile, 1e-9, 5.0)
        assert call.r is not None, f"{solver.name}: {call.told}"
        assert pile.err(call.r) < 1e-7, solver.name
    found[0].child.close()


def test_ratios_to_newton_are_told_apart_by_the_number_of_contacts() -> None:
    """A call of Siconos has a cost that small problems see alone."""
    made = report.Report("", 1e-8, 1.0, [])
    for name, contacts, carom_s, siconos_s in (
        ("a", 10, 1.0, 100.0),
        ("b", 60, 1.0, 2.0),
        ("c", 80, 1.0, 8.0),
    ):
        for program, solver, took in (("Carom", "auto", carom_s), ("Siconos", "NSN_AC", siconos_s)):
            made.entries.append(
                report.Entry(
                    name, "heap", "local", contacts, 3, program, solver, "", True, took, 1, 1e-9, 1e-8, "", ""
                )
            )
    told = "\n".join(made.compare())
    assert "50 contacts and more: 0.25 in the geometric mean of 2 problems" in told
    assert "fewer contacts, where the cost of a call counts: 0.01 in the geometric mean of 1 problem" in told
