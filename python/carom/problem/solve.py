"""Solves a contact problem, and says how well: `carom.ContactProblem.solve` and what it returns.

Solvers are those of the core (crate `carom-solve`); they see the local form alone. Whether a problem counts as solved is
decided here, by the residual that `carom.problem.residual` computes anew from the r that came back.
"""

from __future__ import annotations

import math
import tempfile
import threading
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import h5py
import numpy as np

from carom import _core
from carom.arrays import F64
from carom.errors import CaromError, counted, did_you_mean, one_line
from carom.files import write_whole
from carom.numeric import is_whole
from carom.problem.errors import ContactProblemWarning, refuse
from carom.problem.fclib import write_fclib
from carom.problem.given import of_contacts
from carom.problem.global_ import GlobalProblem, invert
from carom.problem.local import LocalProblem
from carom.problem.residual import Residual, holds_nothing, residual_of
from carom.text import seconds
from carom.units import number

if TYPE_CHECKING:
    from carom.problem.contact import ContactProblem


#: What to do with an r that is no solution.
OnNonconvergence = Literal["raise", "return"]
#: What `err` must come below unless a call says otherwise.
TOLERANCE = 1e-8


@dataclass(frozen=True)
class Stage:
    """What a solver did up to one checkpoint; `auto` has several, other solvers one."""

    name: str
    solver: str
    """Which solver was at work."""
    iterations: int
    err: float
    """The residual after the stage, as the solver saw it."""
    wall_s: float
    why: str
    """Why this stage was entered."""


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """What a solver found, and the judgement on it; arrays are read-only.

    >>> solution = problem.solve()
    >>> solution.converged, solution.err, solution.r
    """

    problem: ContactProblem
    r: F64
    """(d C,) impulses at velocity level, multipliers at position level."""
    u: F64
    """(d C,) relative velocities (displacements) `W r + q`."""
    residual: Residual
    """How well r solves the problem, computed outside of the solver."""
    tol: float
    """What `err` had to come below."""
    solver: str
    """The solver that was asked for."""
    iterations: int
    """Iterations of all stages."""
    wall_s: float
    """Time of the core, s: setting up, scaling and solving, but neither reading nor the elimination of bodies."""
    stages: tuple[Stage, ...]
    err_scaled: float = 0.0
    """The residual of the scaled problem, which units do not change. Where forces grow without bound, because contacts
    cannot all be kept apart, it is what they leave of the velocities."""

    @property
    def err(self) -> float:
        """The residual `|F| / max(|q|, |r|, |u|)`."""
        return self.residual.err

    @property
    def converged(self) -> bool:
        """Whether `err` and `err_scaled` are at most `tol`."""
        return max(self.err, self.err_scaled) <= self.tol

    @cached_property
    def v(self) -> F64 | None:
        """(n,) velocities of the bodies `M^-1 (H r + f)` of a problem in global form; None in local form."""
        source = self.problem.source
        if not isinstance(source, GlobalProblem):
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ContactProblemWarning)  # told when bodies were eliminated
            v = invert(source.M).dot(source.H.dot(self.r) + source.f)
        v.setflags(write=False)
        return v

    def to_fclib(self, path: Path | str) -> Path:
        """Write the problem and, in the group `solution` as FCLib has it, `r`, `u` and of bodies `v`."""
        path = Path(path)
        with tempfile.TemporaryDirectory() as folder:
            whole = write_fclib(self.problem.source, Path(folder) / "problem.hdf5")
            with h5py.File(whole, "r+") as file:
                group = file.create_group("solution")
                for name, values in (("v", self.v), ("u", self.u), ("r", self.r)):
                    if values is not None:
                        group[name] = values
            write_whole(path, whole.read_bytes(), durable=False, parents=True)
        return path

    def to_dict(self) -> dict[str, Any]:
        """Everything but the arrays, for JSON."""
        return {
            "solver": self.solver,
            "converged": self.converged,
            "err": self.err,
            "err_scaled": self.err_scaled,
            "tolerance": self.tol,
            "iterations": self.iterations,
            "wall_s": self.wall_s,
            "residual": self.residual.to_dict(),
            "stages": [asdict(stage) for stage in self.stages],
        }

    def __str__(self) -> str:
        verdict = "solved" if self.converged else "NOT solved"
        scaled = f", scaled {self.err_scaled:.3g}" if self.err_scaled > self.tol else ""
        return (
            f"{verdict} by {self.solver}: err = {self.err:.3g}{scaled} (tolerance {self.tol:g}),"
            f" {counted(self.iterations, 'iteration')}, {seconds(self.wall_s)}"
        )

    def __repr__(self) -> str:
        what = f" of {one_line(self.problem.title, 80)!r}" if self.problem.title else ""
        return f"<Solution{what}: {counted(self.problem.contacts, 'contact')} {self}>"

    def _repr_html_(self) -> str:
        """The verdict and the stages as tables, for notebooks."""
        worst = self.residual
        facts = [
            ("problem", f"{self.problem.title} ({self.problem.contacts} contacts, {len(self.r)} rows)"),
            ("err", f"{self.err:.3g}, scaled {self.err_scaled:.3g} (tolerance {self.tol:g})"),
            ("worst contact", f"{worst.worst}: {worst.worst_natural_map:.3g}"),
            ("complementarity", f"{worst.complementarity:.3g}"),
            ("outside the cone", f"{worst.cone_violation:.3g}"),
            ("penetration", f"{worst.penetration:.3g}"),
            ("iterations, time", f"{self.iterations}, {seconds(self.wall_s)}"),
        ]
        stages = [(*_cells(stage), stage.why) for stage in self.stages]
        head = ("stage", "solver", "iterations", "err", "time", "why")
        verdict = "solved" if self.converged else "<b>not</b> solved"
        return (
            f"<p>{verdict} by <code>{escape(self.solver)}</code></p>"
            f"{_html(facts)}{_html(stages, head) if stages else ''}"
        )


class SolveFailed(CaromError):
    """No r with both residuals at most `tol` was found; `solution` holds the last one, with its residual and its stages."""

    def __init__(self, message: str, solution: Solution) -> None:
        super().__init__(message)
        self.solution = solution


def solvers() -> dict[str, str]:
    """The solvers by name, `auto` first, and a line on each."""
    return dict(_core.contact_solvers())


def solve(
    problem: ContactProblem,
    solver: str = "auto",
    *,
    tol: float = TOLERANCE,
    r0: Any = None,
    max_iterations: int | None = None,
    time_limit: float | str | None = None,
    threads: int = 1,
    on_nonconvergence: OnNonconvergence = "raise",
) -> Solution:
    """Find r with `residual(r).err <= tol`.

    `solver` is one of `carom.problem.solvers()`. `r0` (d C,) is where to begin, by default at 0. The solver stops after
    `max_iterations` iterations (by default a number of its own) or after `time_limit` (s, or a text with a unit), by
    default never. The result does not depend on `threads`.

    Raises `SolveFailed` if there is no such r by then; its `solution` has what was found. With
    `on_nonconvergence="return"` that is returned instead, and `solution.converged` tells. Ctrl-C raises
    `KeyboardInterrupt` at once; the core then computes on unheard until it is done or its time is up.
    """
    known = solvers()
    if not isinstance(solver, str) or solver not in known:
        raise refuse("solver", f"none is called {solver!r}", did_you_mean(str(solver), list(known)))
    if on_nonconvergence not in ("raise", "return"):
        raise refuse("on_nonconvergence", f"{on_nonconvergence!r}", "either 'raise' or 'return'")
    if isinstance(time_limit, str):
        time_limit = number("solve", "time_limit", time_limit, "time")
    _positive("tol", tol)
    _positive("time_limit", math.inf if time_limit is None else time_limit, infinite=True)
    _count("max_iterations", 1 if max_iterations is None else max_iterations)
    _count("threads", threads)
    local = problem.local
    start = _start(r0, local)
    zero = np.zeros(local.contacts)

    cancel = _core.Cancel()

    def call() -> dict[str, Any]:
        return _core.solve_contact_problem(
            local.W.indptr,
            local.W.indices,
            local.W.data,
            local.q,
            local.dimension,
            local.mu,
            zero if local.mu_r is None else local.mu_r,
            zero if local.mu_s is None else local.mu_s,
            start,
            solver,
            float(tol),
            int(max_iterations or 0),
            math.inf if time_limit is None else float(time_limit),
            int(threads),
            cancel,
        )

    try:
        found = _interruptible(call, cancel.cancel)
    except CaromError:
        raise
    except ValueError as error:
        raise CaromError(one_line(f"{solver}: {error}")) from error
    r = np.array(found["r"], dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):  # an r without bound; its err is infinite
        u = local.W.dot(r) + local.q
    for array in (r, u):
        array.setflags(write=False)
    solution = Solution(
        problem=problem,
        r=r,
        u=u,
        residual=residual_of(local, r),
        tol=float(tol),
        solver=solver,
        iterations=int(found["iterations"]),
        wall_s=float(found["wall_s"]),
        stages=tuple(Stage(**stage) for stage in found["stages"]),
        err_scaled=float(found["err_scaled"]),
    )
    if not solution.converged and on_nonconvergence == "raise":
        cure = "error.solution holds what was found; another solver, more iterations or a larger tol may do"
        if holds_nothing(local, r, u):
            cure += ", or there may be no solution: its normal forces push against one another and hold next to nothing"
        raise SolveFailed(one_line(f"{problem.title or 'problem'}: {solution}; {cure}"), solution)
    return solution


#: Threads that compute what Ctrl-C left behind.
_abandoned: list[threading.Thread] = []
#: How long Ctrl-C waits for a solver to look up, s. Most do so within milliseconds; a large factorisation does not.
GRACE = 0.5
#: How long to wait for an answer at a time, s: Python misses a signal that comes while a wait is about to begin, and
#: would hear it only when that wait ends.
HEARING = 0.2


def is_abandoned() -> bool:
    """Whether a solver that Ctrl-C interrupted still computes, in a thread that nobody waits for."""
    return any(thread.is_alive() for thread in _abandoned)


def _interruptible(call: Callable[[], dict[str, Any]], cancel: Callable[[], None]) -> dict[str, Any]:
    """`call()` so that Ctrl-C is heard at once: `cancel` tells the core to end, and soon nobody waits for it any more."""
    if threading.current_thread() is not threading.main_thread():  # signals go to the main thread
        return call()
    answer: Future[dict[str, Any]] = Future()
    # A bare lock: an interruption while it is waited for leaves nothing locked that the worker needs.
    ended = threading.Lock()
    ended.acquire()

    def work() -> None:
        try:
            answer.set_result(call())
        except BaseException as error:  # whatever it is, it belongs to the caller
            answer.set_exception(error)
        finally:
            ended.release()

    thread = threading.Thread(target=work, name="carom solve", daemon=True)
    try:
        thread.start()  # an interruption may come before it returns
        while not ended.acquire(timeout=HEARING):
            pass
        return answer.result()
    except KeyboardInterrupt:
        cancel()
        if thread.ident is not None:
            _abandoned.append(thread)
            thread.join(GRACE)
        raise


def _start(r0: Any, local: LocalProblem) -> F64 | None:
    if r0 is None:
        return None
    start = of_contacts(r0, "r0", local.contacts, local.dimension)
    if not np.isfinite(start).all():
        raise refuse("r0", "not all of it is finite", "start from 0 (leave it out) or from a former r")
    return start


def _positive(name: str, value: Any, *, infinite: bool = False) -> None:
    try:
        good = float(value) > 0.0 and (infinite or math.isfinite(value))
    except (TypeError, ValueError):
        good = False
    if not good:
        finite = "" if infinite else "finite "
        raise refuse(name, f"{value!r}", f"it must be a {finite}number above 0")


def _count(name: str, value: Any) -> None:
    if not (is_whole(value) and 1 <= value < 2**31):
        raise refuse(name, f"{value!r}", "it must be a whole number above 0")


def _cells(stage: Stage) -> tuple[str, ...]:
    return stage.name, stage.solver, f"{stage.iterations}", f"{stage.err:.2g}", seconds(stage.wall_s)


def _html(rows: Sequence[Sequence[str]], head: Sequence[str] = ()) -> str:
    lines = ["".join(f"<th>{escape(cell)}</th>" for cell in head)] if head else []
    lines += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
