"""`carom.ContactProblem`: a contact problem from matrices, a file or a run; its solution, and how well an r solves it."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

from carom.problem.errors import refuse
from carom.problem.fclib import read_fclib, write_fclib
from carom.problem.global_ import GlobalProblem
from carom.problem.local import LocalProblem
from carom.problem.rank import Rank, rank_of
from carom.problem.residual import Residual, residual_of
from carom.problem.run_files import find
from carom.problem.solve import solve
from carom.result.directory import RunDir


class ContactProblem:
    """A frictional contact problem, in local or global form; it does not change.

    >>> problem = carom.ContactProblem.from_matrices(W, q, mu)
    >>> solution = problem.solve()
    >>> problem.residual(solution.r).err
    """

    def __init__(self, source: LocalProblem | GlobalProblem) -> None:
        self.__dict__["source"] = source

    @property
    def source(self) -> LocalProblem | GlobalProblem:
        """The form in which it was given; `to_fclib` writes this one."""
        found: LocalProblem | GlobalProblem = self.__dict__["source"]
        return found

    def __setattr__(self, name: str, value: object) -> None:
        raise refuse(f"problem.{name}", "a contact problem does not change", "make another one")

    def __delattr__(self, name: str) -> None:
        self.__setattr__(name, None)

    @classmethod
    def from_matrices(
        cls, W: Any, q: Any, mu: Any, mu_r: Any = None, mu_s: Any = None, *, title: str = ""
    ) -> ContactProblem:
        """From the local form: `W` (d C, d C) dense or a SciPy sparse matrix, `q` (d C,), `mu` (C,).

        With d = 5 rows for each contact also the bounds `mu_r` (C,) of rolling, m; with 6 also `mu_s` (C,) of
        spinning, m. `title` goes to files.
        """
        return cls(LocalProblem(W=W, q=q, mu=mu, mu_r=mu_r, mu_s=mu_s, title=title))

    @classmethod
    def from_bodies(
        cls, M: Any, H: Any, f: Any, w: Any, mu: Any, mu_r: Any = None, mu_s: Any = None, *, title: str = ""
    ) -> ContactProblem:
        """From the global form `M v = H r + f`, `u = H^T v + w`: `M` (n, n), `H` (n, d C), `f` (n,), `w` (d C,)."""
        return cls(GlobalProblem(M=M, H=H, f=f, w=w, mu=mu, mu_r=mu_r, mu_s=mu_s, title=title))

    @classmethod
    def from_fclib(cls, path: Path | str) -> ContactProblem:
        """From a file in the layout of FCLib (docs/reference/problems.md)."""
        return cls(read_fclib(path))

    @classmethod
    def from_run(
        cls,
        run_dir: Path | str,
        step: int | None = None,
        level: str | None = None,
        island: int | None = None,
        index: int | None = None,
        part: int | None = None,
        again: int | None = None,
    ) -> ContactProblem:
        """A problem that a run kept: one of those that `save_problems` asked for, or the one that could not be solved.

        Give as much as tells it from the others: its `step`, its `level` ("position" or "velocity"), the number of its
        `island` and, at velocity level, the `index` of the impact problem (0: the loads, as in the table of impacts); of a
        step that was halved the `part` (0: none). Where a step poses several problems of this description, `again` is 0
        for the first. Without anything it is the one that could not be solved, if there is one. An error lists what there
        is.
        """
        directory = RunDir.open(run_dir)
        failed = (directory.read().get("outcome") or {}).get("step")
        wanted = {
            "step": step,
            "level": level,
            "island": island,
            "index": index,
            "part": part,
            "again": again,
        }
        return cls.from_fclib(find(directory.path, failed, **wanted))

    def to_fclib(self, path: Path | str) -> Path:
        """Write a file in the layout of FCLib, in the form in which the problem was given."""
        return write_fclib(self.source, path)

    @cached_property
    def local(self) -> LocalProblem:
        """The local form; bodies of a global one are eliminated at the first use."""
        return self.source.to_local() if isinstance(self.source, GlobalProblem) else self.source

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return self.source.contacts

    @property
    def dimension(self) -> int:
        """Rows of a contact: 2 in the plane, 3 in space, 5 with rolling, 6 with spinning."""
        return self.source.dimension

    @property
    def title(self) -> str:
        """What the problem is called."""
        return self.source.title

    solve = solve

    def residual(self, r: Any) -> Residual:
        """How well `r` (d C,) solves the problem: `err` and where it is worst."""
        return residual_of(self.local, r)

    def rank(self, rtol: float = 1e-10) -> Rank:
        """Rank and nullity of W: with a nullity the multipliers need not be unique."""
        return rank_of(self.local.W, rtol)

    def __repr__(self) -> str:
        form = "global" if isinstance(self.source, GlobalProblem) else "local"
        name = f" {self.title!r}" if self.title else ""
        return f"<ContactProblem{name}: {self.contacts} contacts of {self.dimension} rows, {form} form>"
