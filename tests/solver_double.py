"""A solver of contact problems in NumPy that stands for the core where a test wants to command what it does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from carom.problem import cone

SOLVERS = [("auto", "chooses"), ("sweeps", "one contact after the other")]
RULE = "few contacts: sweeps\nmany contacts: sweeps as well"


def sweeps(
    indptr: Any, indices: Any, data: Any, q: Any, dimension: int, mu: Any, mu_r: Any, mu_s: Any, r0: Any,
    solver: str, tolerance: float, max_iterations: int, time_limit: float, threads: int, cancel: Any = None,
) -> dict[str, Any]:  # fmt: skip
    """Projected Gauss-Seidel: slow, but sure where W is well conditioned."""
    start = time.perf_counter()
    n, d = len(q), dimension
    w = np.zeros((n, n))
    w[np.repeat(np.arange(n), np.diff(indptr)), indices] = data
    bounds = np.stack([mu, mu_r, mu_s], axis=1)[:, : {2: 1, 3: 1, 5: 2, 6: 3}[d]]
    r = np.zeros(n) if r0 is None else r0.copy()
    k, err = 0, np.inf
    for k in range(1, (max_iterations or 20_000) + 1):  # noqa: B007
        old = r.copy()
        for c in range(len(mu)):
            own = slice(d * c, d * c + d)
            rho = 0.9 / max(np.linalg.norm(w[own, own], 2), 1e-12)
            u = (w[own] @ r + q[own])[None]
            b = bounds[c : c + 1]
            r[own] = cone.project(r[own][None] - rho * cone.shift(u, b), b)[0]
        err = float(np.abs(r - old).max(initial=0.0)) / max(float(np.abs(r).max(initial=0.0)), 1e-300)
        if err < 1e-2 * tolerance or time.perf_counter() - start > time_limit:
            break
    wall = time.perf_counter() - start
    stage = {
        "name": "sweep",
        "solver": "sweeps",
        "iterations": k,
        "err": err,
        "wall_s": wall,
        "why": "few contacts",
    }
    return {"r": r, "converged": True, "err_scaled": 0.0, "iterations": k, "wall_s": wall, "stages": [stage]}


def install(monkeypatch: pytest.MonkeyPatch, solve: Callable[..., dict[str, Any]] = sweeps) -> None:
    """Put `solve` in the place of the core's solvers."""
    monkeypatch.setattr("carom._core.solve_contact_problem", solve, raising=False)
    monkeypatch.setattr("carom._core.contact_solvers", lambda: SOLVERS, raising=False)
    monkeypatch.setattr("carom._core.auto_rule", lambda: RULE, raising=False)
