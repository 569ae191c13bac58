"""`carom solve`: contact problems in files, by one solver or several."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carom.cli.options import Force, Json, Quiet, figure_formats, listed, option, refuse_existing, time
from carom.cli.output import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    NOT_CONVERGED,
    emit,
    guarded,
    note,
)
from carom.cli.process import leave_at_once
from carom.cli.progress import counting_bar
from carom.errors import CaromError, did_you_mean

if TYPE_CHECKING:
    from carom.cli.solutions import Attempt
    from carom.problem import ContactProblem, Solution

#: Rank and nullity of problems of up to this many rows cost well below a second.
RANK_ROWS = 600
#: Warnings shown of several files.
WARNINGS = 3
SUFFIXES = (".hdf5", ".h5")


@guarded
def solve(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE...",
            help="Contact problems (FCLib's layout), directories of them (*.hdf5, *.h5), or runs with saved problems.",
            show_default=False,
        ),
    ] = None,
    solver: Annotated[
        list[str] | None,
        option(
            "--solver",
            "NAME",
            "Solver: auto (default), another name, several with commas, or all; may be repeated.",
        ),
    ] = None,
    tol: Annotated[float, option("--tol", "ERR", "Residual tolerance.")] = 1e-8,
    max_iterations: Annotated[
        int | None, option("--max-iterations", "N", "Iteration limit. Default: the solver's own.", min=1)
    ] = None,
    time_limit: Annotated[
        str | None,
        option(
            "--time-limit",
            "TIME",
            "Time limit per solver and file, s or with a unit; factorisations are not interrupted. Default: none.",
        ),
    ] = None,
    threads: Annotated[
        int, option("--threads", "N", "Threads; the result does not depend on it.", min=1)
    ] = 1,
    repeat: Annotated[int, option("--repeat", "N", "Solve N times and report the shortest time.", min=1)] = 1,
    solution: Annotated[
        Path | None,
        option("--solution", "HDF5", "Save the problem with its solution r, u (one file, one solver)."),
    ] = None,
    force: Force = False,
    out: Annotated[
        Path | None,
        option(
            "-o", "--out", "DIR", "Output directory for the table (CSV) and, with several files, profiles."
        ),
    ] = None,
    format_: Annotated[
        str | None,
        option(
            "--format", "FORMAT", "Formats of the profiles: png (default), svg, pdf; several with commas."
        ),
    ] = None,
    explain: Annotated[
        bool, option("--explain", "Print the rule of auto, and why it used each stage.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Solve contact problems from files, and measure the residuals.

    Several files or solvers give a table. Residuals are computed outside of the solvers. The exit code is 3 if a problem
    is not solved, 2 if a file cannot be read.

    Example: carom solve Capsules.hdf5

    Example: carom solve problems --solver all --time-limit 10 -o profiles --format svg
    """
    from carom._core import auto_rule
    from carom.cli import solutions
    from carom.problem.solve import is_abandoned

    names = _solvers(solver or ["auto"])
    rule = auto_rule().strip() if explain else None
    if not files:
        if rule is None:
            raise typer.BadParameter("give a file to solve, or --explain for the rule of auto")
        _show({"rule": rule}, [], rule, quiet=quiet, as_json=as_json)
        return DONE
    if format_ is not None and out is None:
        raise typer.BadParameter("--format: nothing is drawn without -o DIR; add it, or leave --format out")
    limit = time("--time-limit", time_limit)
    for name, value in (("--tol", tol), ("--time-limit", limit)):
        if value is not None and not 0 < value < math.inf:
            raise typer.BadParameter(
                f"{name}: must be positive, found {value:g}; write a number that is positive"
            )
    formats = _formats(format_ or "png") if out is not None else []
    refuse_existing("--solution", solution, force)
    paths = list(dict.fromkeys(path for given in files for path in _expanded(given)))
    if solution is not None and (len(paths), len(names)) != (1, 1):
        raise typer.BadParameter("--solution takes the r of one file and one solver; give one of each")
    how = {"tol": tol, "max_iterations": max_iterations, "time_limit": limit, "threads": threads}

    done: list[Attempt] = []
    interrupted = False
    try:
        with counting_bar(not (quiet or as_json)) as progress:
            for attempt, found in _attempts(paths, names, how, repeat=repeat, rank=len(paths) == 1):
                done.append(attempt)
                if found is not None and solution is not None:
                    found.to_fclib(solution)
                if progress is not None:
                    what = " ".join([attempt.name, attempt.solver])
                    progress(len(done), len(paths) * len(names), what)
    except KeyboardInterrupt:
        interrupted = True
    written = [str(p) for p in solutions.write(done, names, out, formats)] if out is not None else []
    if solution is not None and done and done[0].solution is not None:
        written.append(str(solution))
    code, error = _verdict(done, len(paths), names[-1], interrupted)
    _warn(done)
    document: dict[str, Any] = {} if rule is None else {"rule": rule}
    document |= {"tolerance": tol, "threads": threads, "interrupted": interrupted}
    document |= {"results": [a.to_dict() for a in done], "solvers": solutions.summary(done, names)}
    document |= {"files": written} | ({"error": error, "code": code} if error else {})
    _show(document, done, rule, quiet=quiet, as_json=as_json)
    if error:
        note(error)
    if (
        is_abandoned()
    ):  # Python would not survive the return of a solver that was interrupted and still computes
        leave_at_once(code)
    return code


def _attempts(
    paths: list[Path], names: list[str], how: dict[str, Any], *, repeat: int, rank: bool
) -> Iterator[tuple[Attempt, Solution | None]]:
    """Every file by every solver, one after the other; what cannot be done is an attempt with an error."""
    from carom.cli.solutions import Attempt

    for path in paths:
        try:
            problem, told = _read(path)
            facts = _facts(problem, rank=rank) | {"warnings": told}
        except (CaromError, OSError, MemoryError) as error:
            yield Attempt(path, error=_told(error, path)), None
            continue
        for name in names:
            try:
                calls = (problem.solve(name, **how, on_nonconvergence="return") for _ in range(repeat))
                found = min(calls, key=lambda solution: solution.wall_s)
            except (CaromError, MemoryError) as error:
                yield Attempt(path, facts, name, error=_told(error, path)), None
                continue
            yield Attempt(path, facts, name, found.to_dict()), found


def _read(path: Path) -> tuple[ContactProblem, list[str]]:
    """The problem of a file in local form, and the warnings about it."""
    from carom.problem import ContactProblem
    from carom.problem.errors import ContactProblemWarning, refuse

    if (path / "run.json").is_file():
        raise refuse(
            str(path), "this run has no stored problems", "carom run ... --save-problems STEPS stores them"
        )
    if path.is_dir():
        raise refuse(
            str(path), f"no {' or '.join('*' + s for s in SUFFIXES)} in this directory", "name a file"
        )
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ContactProblemWarning)
        problem = ContactProblem.from_fclib(path)
        problem.local  # noqa: B018  # bodies are eliminated here, before anything is timed
    return problem, [_placed(str(warning.message), path) for warning in told]


def _facts(problem: ContactProblem, *, rank: bool) -> dict[str, Any]:
    from carom.problem import GlobalProblem

    facts: dict[str, Any] = {
        "title": problem.title,
        "form": "global" if isinstance(problem.source, GlobalProblem) else "local",
        "contacts": problem.contacts,
        "dimension": problem.dimension,
        "rows": problem.local.rows,
        "entries": problem.local.W.entries,
    }
    if rank and problem.local.rows <= RANK_ROWS:
        found = problem.rank()
        facts |= {"rank": found.rank, "nullity": found.nullity}
    return facts


def _expanded(given: Path) -> list[Path]:
    """The files that an argument names; a directory without any stays, to be reported."""
    if not given.is_dir():
        return [given]
    if (given / "run.json").is_file():  # results.h5 is no contact problem
        kept = [given / "failing_problem.h5", *sorted((given / "problems").glob("*"))]
        found = [path for path in kept if path.is_file() and path.suffix in SUFFIXES]
    else:
        found = sorted(path for path in given.iterdir() if path.suffix in SUFFIXES and path.is_file())
    return found or [given]


def _solvers(given: list[str]) -> list[str]:
    """The solvers asked for, each once."""
    from carom.problem import solvers

    known = list(solvers())
    names = listed("--solver", *given)
    for name in names:
        if name not in [*known, "all"]:
            raise CaromError(f"--solver: none is called {name!r}; {did_you_mean(name, [*known, 'all'])}")
    return known if "all" in names else list(dict.fromkeys(names))


def _formats(text: str) -> list[str]:
    from carom.show.plot import require_matplotlib

    formats = figure_formats(text)
    require_matplotlib()
    return formats


def _show(
    document: dict[str, Any], done: list[Attempt], rule: str | None, *, quiet: bool, as_json: bool
) -> None:
    from carom.cli import solutions

    if as_json:
        emit(document)
    elif not quiet:
        if rule is not None:
            print(rule + ("\n" if done else ""))
        solutions.show(done, document, explain=rule is not None)


def _verdict(done: list[Attempt], files: int, last: str, interrupted: bool) -> tuple[int, str]:
    """Exit code, and one line on what went wrong; `last` is the solver that every file has last."""
    wrong = [a for a in done if a.error]
    unsolved = [a for a in done if a.solution is not None and not a.solution["converged"]]
    if interrupted:
        whole = sum(not a.solver or a.solver == last for a in done)
        return INTERRUPTED, f"interrupted: {whole} of {files} files are done"
    if len(wrong) == 1:
        return BAD_INPUT, wrong[0].error
    if wrong:
        return BAD_INPUT, f"{len(wrong)} of {len(done)} could not be solved for the reasons in the table"
    if unsolved:
        one = unsolved[0]
        told = f"{one.name}: {one.solver} ends with err = {one.err:.3g}"
        return NOT_CONVERGED, told if len(
            unsolved
        ) == 1 else f"{len(unsolved)} of {len(done)} not solved, as {told}"
    return DONE, ""


def _warn(done: list[Attempt]) -> None:
    """The first few warnings on standard error; `--json` has all."""
    told = list(dict.fromkeys(text for a in done for text in a.facts.get("warnings", ())))
    for text in told[:WARNINGS]:
        note(f"warning: {text}")
    if len(told) > WARNINGS:
        note(f"warning: and {len(told) - WARNINGS} more such; --json lists them")


def _told(error: BaseException, path: Path) -> str:
    if isinstance(error, MemoryError):
        return f"{path}: not enough memory"
    return _placed(" ".join(str(error).split()), path)


def _placed(text: str, path: Path) -> str:
    return text if text.startswith(str(path)) else f"{path}: {text}"
