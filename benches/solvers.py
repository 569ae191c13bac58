"""Solvers of contact problems, Carom's beside those of Siconos: `make bench`, or `python benches/solvers.py --help`.

Every solver starts from r = 0 on the same data with one thread; what it returns is judged by the residual of
`carom.ContactProblem`, whatever the solver thinks. Its own tolerance is tightened by decades until the judge agrees, and
loosened where that does as well: the cheapest setting with err below the bound is timed. Times are the best of several
rounds in which all solvers take turns, so that a busy machine meets all of them.

    python benches/solvers.py --only carom --solver auto --problem Capsules      # one line for each problem
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

from _solvers_problems import problems
from _solvers_programs import ONE_THREAD, Call, Problem, Solver, carom_solvers
from _solvers_report import Entry, Report
from _solvers_siconos import siconos
from run import about

#: Decades of a solver's own tolerance below and above the bound on err that are tried.
TIGHTEN, LOOSEN = 5, 3
#: Rounds of the timing, and the time (s) after which there is no further one.
ROUNDS, BUDGET = 15, 3.0


@dataclass(frozen=True)
class Setting:
    """A solver for a problem: the tolerance that the judge is content with, or None, and the call that showed it."""

    solver: Solver
    tolerance: float | None
    call: Call
    err: float


def setting(solver: Solver, problem: Problem, bound: float, limit: float) -> Setting:
    """The cheapest tolerance of `solver` with err <= `bound`, within `limit` seconds for each call."""

    def tried(tolerance: float) -> Setting:
        call = solver.call(problem, tolerance, limit)
        err = problem.err(call.r)
        if call.seconds > limit:
            call = replace(call, told=f"{call.seconds:.1f} s")
        return Setting(solver, tolerance if err <= bound and call.seconds <= limit else None, call, err)

    tolerance = bound
    found = tried(tolerance)
    for _ in range(TIGHTEN):
        # Where the solver itself sees that it is not done, a tighter tolerance does not help.
        if found.tolerance is not None or not found.call.stopped or found.call.seconds > limit:
            break
        tolerance /= 10
        found = tried(tolerance)
    if found.tolerance is None or tolerance < bound:
        return found
    for _ in range(LOOSEN):
        if found.err > 0.1 * bound:  # a looser one would fail the judge
            break
        tolerance *= 10
        looser = tried(tolerance)
        if looser.tolerance is None or looser.call.iterations >= found.call.iterations:
            break
        found = looser
    return found


def entries(solvers: list[Solver], problem: Problem, bound: float, limit: float) -> list[Entry]:
    """Each solver's best time for one problem."""
    settings = [setting(s, problem, bound, limit) for s in solvers if s.takes(problem)]
    best = [s.call.seconds for s in settings]
    spent = 0.0
    for _ in range(ROUNDS - 1):
        running = [k for k, s in enumerate(settings) if s.tolerance is not None]
        # A further round must fit into what is left; the slow ones are left out first.
        for k in sorted(running, key=lambda k: best[k]):
            if spent + best[k] > BUDGET:
                continue
            tolerance = settings[k].tolerance
            assert tolerance is not None
            call = settings[k].solver.call(problem, tolerance, limit)
            if problem.err(call.r) <= bound:
                best[k] = min(best[k], call.seconds)
            spent += call.seconds
    return [
        Entry.of(problem, s.solver, s.tolerance, seconds, s.call, s.err)
        for s, seconds in zip(settings, best, strict=True)
    ]


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description="Solvers of contact problems, Carom's beside those of Siconos: times, iterations, err."
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="fewer problems, 2 s for each call")
    add("--only", choices=("carom", "siconos"), help="one program alone")
    add("--solver", action="append", default=[], metavar="NAME", help="only this solver (repeatable)")
    add("--problem", action="append", default=[], metavar="TEXT", help="only problems with TEXT in the name")
    add("--file", action="append", default=[], type=Path, metavar="FILE", help="this file or folder instead")
    add("--tol", type=float, default=1e-8, help="what err must come below (1e-8)")
    add("--limit", type=float, default=0.0, metavar="S", help="time for a call (10 s, 2 s with --quick)")
    add(
        "--csv",
        type=Path,
        metavar="FILE",
        help="write all figures to FILE with -solvers in its name, and JSON beside",
    )
    add(
        "--docs",
        type=Path,
        metavar="FILE",
        help="write tables and figure into this page of the documentation",
    )
    return parser.parse_args()


def main() -> int:
    """The command."""
    options = arguments()
    os.environ.update(ONE_THREAD)
    limit = options.limit or (2.0 if options.quick else 10.0)
    said: list[str] = []
    solvers: list[Solver] = []
    versions: dict[str, str] = {}
    if options.only != "siconos":
        mine, why = carom_solvers()
        solvers += mine
        said += [why] if why else []
    if options.only != "carom":
        peers, found = siconos()
        solvers += peers
        if isinstance(found, str):
            said.append(found)
        else:
            versions = found
    solvers = [s for s in solvers if not options.solver or s.name.lower() in map(str.lower, options.solver)]
    header = about() + (f"; Siconos {versions['siconos']} (Python {versions['python']})" if versions else "")
    print("Contact solvers: " + header, flush=True)
    if not solvers:
        print("\n".join([*said, "Nothing to run."]))
        return 0
    chosen = list(problems(options.problem, options.quick, options.file, said))
    solvers = [s for s in solvers if any(s.takes(p) for p in chosen)]
    report = Report(header, options.tol, limit, solvers)
    # Lines for each solver where there are few, else a line for each problem.
    lines = len({s.name for s in solvers}) == 1
    print(report.head(lines), flush=True)
    for problem in chosen:
        found_here = entries(solvers, problem, options.tol, limit)
        report.entries += found_here
        print("\n".join(report.lines(problem, found_here, lines)), flush=True)
    print("\n".join(["", *report.summary(), *said]))
    if options.csv:
        report.write(options.csv.with_name(f"{options.csv.stem}-solvers.csv"))
    if options.docs:
        report.write_page(options.docs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
