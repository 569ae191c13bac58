"""Energies over the whole of a record: at its start and after every step."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64

if TYPE_CHECKING:
    from carom.result.data import RunData


def energies(result: RunData) -> tuple[F64, F64, F64]:
    """Times, s, kinetic and potential energy, J: at the start, where the run tells what there was, and after the steps."""
    energy = result.energy
    columns = [
        np.asarray(values, dtype=np.float64) for values in (energy.time, energy.kinetic, energy.potential)
    ]
    total = (result.summary.get("energy") or {}).get("initial")
    steps = np.asarray(result.steps["step"] if total is not None and len(result.step) else [])
    # That is before the first step of the record, at its first frame.
    if total is not None and len(steps) and result.step[0] + 1 == steps[0]:
        time = float(result.time[0])
        kinetic = float(result.sel(time=time).kinetic_energy[0].sum())
        for wall in result.walls.values():
            if wall.is_free:
                kinetic += 0.5 * json.loads(wall.facts["free"])["mass"] * float(wall.velocity[0]) ** 2
        start = time, kinetic, total - kinetic
        columns = [np.append(first, column) for first, column in zip(start, columns, strict=True)]
    return columns[0], columns[1], columns[2]
