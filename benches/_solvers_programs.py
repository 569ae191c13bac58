"""What solvers.py runs: problems, calls, and Carom's own solvers."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, Protocol

import carom
import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """A contact problem of the bench."""

    name: str
    group: str
    contact_problem: carom.ContactProblem

    def err(self, r: F64 | None) -> float:
        """The judge of all programs."""
        return float("inf") if r is None else self.contact_problem.residual(r).err


@dataclass(frozen=True)
class Call:
    """One call of a solver. `seconds` is its wall time alone, `r` (d C,) what it returned."""

    seconds: float
    iterations: int
    r: F64 | None
    stopped: bool
    """Whether the solver says that it is done."""
    told: str = ""
    """What else it says."""
    stages: tuple[dict[str, Any], ...] = field(default=())


class Solver(Protocol):
    """A solver of a program, with its options."""

    program: str
    name: str

    def takes(self, problem: Problem) -> bool:
        """Whether it is made for such problems."""

    @property
    def options(self) -> str:
        """Its options, in words."""

    def call(self, problem: Problem, tolerance: float, limit: float) -> Call:
        """One call from r = 0 with at most `limit` seconds."""


#: What keeps libraries of linear algebra to one thread.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"), "1"
)


class Carom:
    """One solver of Carom, timed around the call that takes W as it is: its structures are part of the time."""

    program = "Carom"

    def __init__(self, name: str) -> None:
        self.name = name

    options = "one thread"

    def takes(self, problem: Problem) -> bool:
        """All of them take all problems; one that refuses says so."""
        return True

    def call(self, problem: Problem, tolerance: float, limit: float) -> Call:
        """One call from r = 0."""
        from carom import _core

        p = problem.contact_problem.local
        none = np.zeros(p.contacts)
        bounds = [none if b is None else np.ascontiguousarray(b) for b in (p.mu, p.mu_r, p.mu_s)]
        begin = time.perf_counter()
        try:
            found = _core.solve_contact_problem(
                p.W.indptr,
                p.W.indices,
                p.W.data,
                p.q,
                p.dimension,
                *bounds,
                None,
                self.name,
                tolerance,
                0,
                limit,
                1,
            )
        except ValueError as reason:
            return Call(float("nan"), -1, None, False, f"refused: {reason}")
        seconds = time.perf_counter() - begin
        return Call(
            seconds,
            int(found["iterations"]),
            np.asarray(found["r"]),
            bool(found["converged"]),
            "" if found["converged"] else f"stopped after {found['iterations']} iterations",
            tuple(found.get("stages", ())),
        )


def carom_solvers() -> tuple[list[Carom], str]:
    """All of them, `auto` first, or none and why."""
    from carom import _core

    if not hasattr(_core, "contact_solvers"):
        return [], "Carom skipped: the extension has no contact solvers (`make dev` builds it)"
    return [Carom(name) for name, _ in _core.contact_solvers()], ""
