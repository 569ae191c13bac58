"""Siconos among the programs of solvers.py: its solvers with their options, and the child process that runs them.

Its options are those that were best on the problems of this bench, of the ones tried (docs/validation/solvers.md).
Siconos stops by a count of iterations only, so a few are timed first and the time limit becomes a count.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from _solvers_programs import ONE_THREAD, Call, Problem

#: Debian installs Siconos for its own Python, which is not the one of this project.
PYTHON = os.environ.get("CAROM_SICONOS_PYTHON", "/usr/bin/python3")
CHILD = Path(__file__).with_name("_siconos.py")


@dataclass(frozen=True)
class Recipe:
    """A solver of Siconos with its options, named by constants of `siconos.numerics` (see _siconos.py)."""

    name: str
    driver: str
    id: str
    storage: str = "sparse"
    """How W is stored for it: as `sparse` triplets or in `block`s; the faster was taken."""
    options: dict[str, Any] = field(default_factory=dict)
    inner: str | None = None
    """The solver within, where it is not the default."""
    probe: int = 200
    """Iterations that are timed first."""

    def takes(self, problem: Problem) -> bool:
        """Whether the driver knows such problems."""
        return problem.contact_problem.dimension == {"fc2d": 2, "fc3d": 3, "rolling_fc3d": 5}[self.driver]


FC3D = "SICONOS_FRICTION_3D_"
RECIPES = (
    Recipe("NSGS", "fc3d", FC3D + "NSGS", "block", inner=FC3D + "ONECONTACT_NSN"),
    Recipe(
        "NSGS x 1.3",
        "fc3d",
        FC3D + "NSGS",
        "block",
        {FC3D + "NSGS_RELAXATION": FC3D + "NSGS_RELAXATION_TRUE", FC3D + "NSGS_RELAXATION_VALUE": 1.3},
        inner=FC3D + "ONECONTACT_NSN",
    ),
    Recipe("NSN_AC", "fc3d", FC3D + "NSN_AC", "block", probe=20),
    Recipe(
        "NSN_AC+EG",
        "fc3d",
        FC3D + "NSN_AC",
        options={FC3D + "NSN_HYBRID_STRATEGY": FC3D + "NSN_HYBRID_STRATEGY_VI_EG_NSN"},
        probe=20,
    ),
    Recipe(
        "ADMM",
        "fc3d",
        FC3D + "ADMM",
        options={
            FC3D + "ADMM_IPARAM_RHO_STRATEGY": FC3D + "ADMM_RHO_STRATEGY_RESIDUAL_BALANCING",
            FC3D + "ADMM_IPARAM_INITIAL_RHO": FC3D + "ADMM_INITIAL_RHO_NORM_INF",
        },
    ),
    Recipe("PROX", "fc3d", FC3D + "PROX", "block", probe=5),
    Recipe("NSGS", "fc2d", "SICONOS_FRICTION_2D_NSGS", "block"),
    Recipe("LEMKE", "fc2d", "SICONOS_FRICTION_2D_LEMKE", "block"),
    Recipe("CPG", "fc2d", "SICONOS_FRICTION_2D_CPG", "block"),
    Recipe("ADMM", "rolling_fc3d", "SICONOS_ROLLING_FRICTION_3D_ADMM", "block"),
)


class Gone(Exception):
    """The child ended, was ended or could not do it; the text says which."""


class Child:
    """The process, started when it is first asked and again after it ended."""

    def __init__(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.process: subprocess.Popen[str] | None = None
        self.loaded: Problem | None = None

    def path(self, name: str) -> Path:
        """A file for arrays."""
        return Path(self.folder.name) / name

    def ask(self, request: dict[str, Any], limit: float) -> dict[str, Any]:
        """The answer, or `Gone` after `limit` seconds or where there is none."""
        if self.process is None:
            self.process = subprocess.Popen(
                [PYTHON, str(CHILD)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env={**os.environ, **ONE_THREAD},
            )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        late = threading.Timer(limit, self.process.kill)
        late.start()
        try:
            self.process.stdin.write(json.dumps(request) + "\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        finally:
            expired = not late.is_alive()
            late.cancel()
        if not line:
            self.close()
            raise Gone(f"ended after {limit:.0f} s" if expired else "ended its process")
        answer: dict[str, Any] = json.loads(line)
        if "failed" in answer:
            raise Gone(answer["failed"])
        return answer

    def load(self, problem: Problem) -> None:
        """Hand the problem over, if it is not there yet."""
        if self.process is not None and self.loaded is problem:
            return
        local = problem.contact_problem.local
        arrays = {"q": local.q, "mu": local.mu}
        arrays |= {name: getattr(local.W, name) for name in ("indptr", "indices", "data")}
        if local.mu_r is not None:
            arrays["mu_r"] = local.mu_r
        path = self.path("problem.npz")
        with path.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        self.ask({"do": "load", "path": str(path)}, 600.0)
        self.loaded = problem

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
        self.process, self.loaded = None, None


class Siconos:
    """One solver of Siconos, as solvers.py wants it."""

    program = "Siconos"

    def __init__(self, recipe: Recipe, child: Child) -> None:
        self.recipe, self.child = recipe, child
        self.name = recipe.name
        self.pace: tuple[Problem, float] | None = None  # s for an iteration, of which problem

    def takes(self, problem: Problem) -> bool:
        """Whether it is made for such problems."""
        return self.recipe.takes(problem)

    @property
    def options(self) -> str:
        """What differs from its defaults, in words."""
        said = ["W in blocks" if self.recipe.storage == "block" else "W as triplets"]
        if self.recipe.inner:
            said.append(f"inner solver {self.recipe.inner.removeprefix(FC3D)}")
        said += [f"{_short(k)} = {_short(v)}" for k, v in self.recipe.options.items()]
        return ", ".join(said)

    def call(self, problem: Problem, tolerance: float, limit: float) -> Call:
        """One call from r = 0 within about `limit` seconds."""
        if self.pace is None or self.pace[0] is not problem:
            first = self._call(problem, tolerance, self.recipe.probe, limit)
            if first.stopped or first.r is None:
                return first
            self.pace = (problem, first.seconds / max(1, first.iterations))
        count = int(min(1e9, max(self.recipe.probe, limit / max(self.pace[1], 1e-9))))
        return self._call(problem, tolerance, count, limit)

    def _call(self, problem: Problem, tolerance: float, iterations: int, limit: float) -> Call:
        recipe = self.recipe
        solver = {
            "driver": recipe.driver,
            "id": recipe.id,
            "storage": recipe.storage,
            "inner": recipe.inner,
            "options": recipe.options,
        }
        out = self.child.path("r.npy")
        request = {
            "do": "solve",
            "solver": solver,
            "tolerance": tolerance,
            "iterations": iterations,
            "out": str(out),
        }
        try:
            self.child.load(problem)
            found = self.child.ask(request, 1.5 * limit + 2.0)
        except Gone as reason:
            return Call(float("nan"), -1, None, False, str(reason))
        stopped = found["info"] == 0
        told = "" if stopped else f"stopped after {found['iterations']} iterations"
        return Call(found["seconds"], found["iterations"], np.load(out), stopped, told)


def _short(x: Any) -> str:
    """The name of an option or of its value, without what all of them share."""
    return str(x).removeprefix(FC3D).replace("IPARAM_", "")


def siconos() -> tuple[list[Siconos], dict[str, str] | str]:
    """All its solvers and its versions, or none and why."""
    child = Child()
    try:
        versions = child.ask({"do": "versions"}, 60.0)
    except (Gone, OSError):
        return (
            [],
            f"Siconos skipped: {PYTHON} cannot import siconos.numerics (Debian: apt install python3-siconos)",
        )
    return [Siconos(recipe, child) for recipe in RECIPES], versions
