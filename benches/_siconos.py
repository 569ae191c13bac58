"""Siconos as a child process of solvers.py, run by the interpreter that has it: Debian's, with NumPy and no Carom.

One JSON request in a line of standard input, one JSON answer in a line of standard output:

    {"do": "versions"}                      -> {"siconos": "4.4.0", ...}
    {"do": "load", "path": "problem.npz"}   -> {}
    {"do": "solve", "solver": {...}, "tolerance": 1e-8, "iterations": 1000, "out": "r.npy"}
                                            -> {"seconds", "iterations", "info", "error"}

or {"failed": "why"}. `problem.npz` holds the local form: indptr, indices, data of W in compressed rows; q, mu, and mu_r with
rolling. A solver is told by names of constants of `siconos.numerics`, so that no number of theirs stands here:

    {"driver": "fc3d", "id": "SICONOS_FRICTION_3D_NSGS", "storage": "block", "inner": "SICONOS_..." or null,
     "options": {"SICONOS_...": 1 or "SICONOS_..."}}

Only the call of the driver is timed: matrices were brought to the solver's best storage before. What the libraries
print goes nowhere; a fatal error of theirs ends the process, which the parent sees.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from typing import Any

import numpy as np

# The libraries print to standard output: the answers get a descriptor of their own.
ANSWERS = os.fdopen(os.dup(1), "w")
for stream in (1, 2):
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream)

import siconos.numerics as sn  # type: ignore[import-not-found]  # noqa: E402  its output goes elsewhere now


def sparse(rows: Any, columns: Any, values: Any, size: int) -> Any:
    """A square matrix as triplets."""
    matrix = sn.NM_create(sn.NM_SPARSE, size, size)
    sn.NM_triplet_alloc(matrix, max(1, len(values)))
    for i, j, x in zip(rows.tolist(), columns.tolist(), values.tolist()):
        sn.NM_entry(matrix, i, j, x)
    return matrix


def block(rows: Any, columns: Any, values: Any, q: Any, *bounds: Any) -> Any:
    """A problem in blocks of a contact by a contact, which only their text format can say without SciPy.

    Lines: d, contacts, storage 1, rows, columns; number of blocks and of rows and columns of them; where these
    end; compressed rows of the blocks; the blocks by columns, each after its number; q; `bounds` mu, and mu_r.
    """
    contacts = len(bounds[0])
    d = len(q) // contacts
    key = (rows // d) * contacts + columns // d
    present, which = np.unique(key, return_inverse=True)
    blocks = np.zeros((len(present), d, d))
    np.add.at(blocks, (which, columns % d, rows % d), values)
    ends = " ".join(str(d * (c + 1)) for c in range(contacts))
    starts = np.searchsorted(present // contacts, np.arange(contacts + 1))
    lines = [d, contacts, 1, d * contacts, d * contacts, len(present), contacts, contacts, ends, ends]
    lines += [contacts + 1, len(present), " ".join(map(str, starts.tolist()))]
    lines.append(" ".join(map(str, (present % contacts).tolist())))
    for k, numbers in enumerate(blocks.reshape(len(present), -1).tolist()):
        lines += [k, "\n".join(map(repr, numbers))]
    lines += [" ".join(map(repr, vector.tolist())) for vector in (q, *bounds)]
    with tempfile.NamedTemporaryFile("w", suffix=".dat") as file:
        file.write("\n".join(map(str, lines)) + "\n")
        file.flush()
        kind = "rollingFrictionContact" if len(bounds) > 1 else "frictionContact"
        return getattr(sn, kind + "_new_from_filename")(file.name)


class Problem:
    """A contact problem in the forms that solvers ask for, each made when it is first wanted."""

    def __init__(self, path: str) -> None:
        self.data = dict(np.load(path))
        self.mu, self.q = self.data["mu"], self.data["q"]
        self.contacts = len(self.mu)
        self.d = len(self.q) // self.contacts
        self.forms: dict[tuple[str, str], Any] = {}

    def form(self, driver: str, storage: str) -> Any:
        """The problem as `driver` takes it."""
        key = (driver, storage)
        if key not in self.forms:
            self.forms[key] = self.make(driver, storage)
        return self.forms[key]

    def make(self, driver: str, storage: str) -> Any:
        """The problem, made anew."""
        data = self.data
        rows = np.repeat(np.arange(len(self.q)), np.diff(data["indptr"]))
        entries = rows, data["indices"], data["data"]
        if driver.startswith("rolling"):  # its Python face has no way to set mu_r
            return block(*entries, self.q, self.mu, data["mu_r"])
        if storage == "block":
            return block(*entries, self.q, self.mu)
        problem = sn.FrictionContactProblem()
        problem.dimension, problem.numberOfContacts = self.d, self.contacts
        problem.M = sparse(*entries, len(self.q))  # before the vectors, whose lengths are checked with it
        # Only addresses are taken over: the arrays must live as long as this.
        problem.q, problem.mu = self.q, self.mu
        return problem


def value(x: Any) -> Any:
    """A number, or the constant of that name."""
    return getattr(sn, x) if isinstance(x, str) else x


def solve(problem: Problem, request: dict[str, Any]) -> dict[str, Any]:
    """One call from r = 0."""
    solver = request["solver"]
    form = problem.form(solver["driver"], solver["storage"])
    options = sn.SolverOptions(value(solver["id"]))
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = request["iterations"]
    options.dparam[sn.SICONOS_DPARAM_TOL] = request["tolerance"]
    for name, x in solver["options"].items():
        (options.dparam if isinstance(x, float) else options.iparam)[value(name)] = value(x)
    if solver["inner"]:
        sn.solver_options_update_internal(options, 0, value(solver["inner"]))
    r, u = np.zeros(len(problem.q)), np.zeros(len(problem.q))
    driver = getattr(sn, solver["driver"] + "_driver")
    begin = time.perf_counter()
    info = driver(form, r, u, options)
    seconds = time.perf_counter() - begin
    np.save(request["out"], r)
    return {
        "seconds": seconds,
        "iterations": int(options.iparam[sn.SICONOS_IPARAM_ITER_DONE]),
        "info": int(info),
        "error": float(options.dparam[sn.SICONOS_DPARAM_RESIDU]),
    }


def versions() -> dict[str, str]:
    """What is installed, as the distribution says."""
    import platform
    import subprocess

    command = ["dpkg-query", "-W", "-f", "${Version}", "python3-siconos"]
    try:
        found = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError):
        found = "of unknown version"
    return {"siconos": found, "python": platform.python_version(), "numpy": np.__version__}


def main() -> None:
    """Answer until the input ends."""
    sn.numerics_set_verbose(0)
    problem: Problem | None = None
    for line in sys.stdin:
        request = json.loads(line)
        answer: dict[str, Any] = {}
        try:
            if request["do"] == "versions":
                answer = dict(versions())
            elif request["do"] == "load":
                problem = Problem(request["path"])
            elif problem is not None:
                answer = solve(problem, request)
        except Exception as error:  # the parent tells it
            answer = {"failed": f"{type(error).__name__}: {error}"}
        ANSWERS.write(json.dumps(answer) + "\n")
        ANSWERS.flush()


if __name__ == "__main__":
    main()
