"""Writes a contact problem that could not be solved, so that it can be studied and solved by others.

The layout is that of FCLib for local problems (W, q, mu); what FCLib has no place for goes to the group
`/carom`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from carom.record.writer import _explained


def write_problem(path: Path, problem: Mapping[str, Any], outcome: Mapping[str, Any]) -> Path:
    """Write `problem`, with `W` (n, n) dense, `q` (n,), `mu` (contacts,) and any other arrays or scalars."""
    with _explained(path), h5py.File(path, "w") as file:
        local = file.create_group("fclib_local")
        n, contacts = len(problem["q"]), len(problem["mu"])
        local["spacedim"] = np.array([n // contacts if contacts else 3], dtype=np.int32)
        matrix = np.asarray(problem["W"], dtype=np.float64).reshape(n, n)
        w = local.create_group("W")
        rows, columns = np.nonzero(matrix)
        starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
        # FCLib marks compressed rows by nz = -2.
        for name, value in (("nzmax", len(rows)), ("m", n), ("n", n), ("nz", -2)):
            w[name] = np.array([value], dtype=np.int32)
        w["p"], w["i"], w["x"] = starts.astype(np.int32), columns.astype(np.int32), matrix[rows, columns]
        vectors = local.create_group("vectors")
        for name in ("q", "mu"):
            vectors[name] = np.asarray(problem[name], dtype=np.float64)
        info = local.create_group("info")
        info["title"] = "contact problem that Carom could not solve"
        info["description"] = (
            f"step {outcome.get('step')}, t = {outcome.get('time')} s, residual {outcome.get('residual')}"
        )
        info["math_info"] = str(problem.get("law", ""))
        rest = file.create_group("carom")
        for name, value in problem.items():
            if name not in ("W", "q", "mu") and value is not None:
                rest[name] = value
    return path
