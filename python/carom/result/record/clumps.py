"""Clumps as a static table of a results file, from the model that the core gets and the tables of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from carom.scene.tables.clumps import Clump

COLUMNS = 13
"""Numbers of a clump in a frame: centre of mass 3, orientation of the principal axes 4, velocity 3, angular velocity 3."""


def table(clumps: Sequence[Clump], model: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """`{"clumps": columns}`; nothing where there are none."""
    if not clumps:
        return {}
    given = model["clumps"]
    bodies = [clump.body() for clump in clumps]
    columns = {
        "name": [clump.name for clump in clumps],
        "first": np.array([clump["balls"][0] for clump in given], dtype=np.int64),
        "count": np.array([clump.size() for clump in clumps], dtype=np.int64),
        "mass": np.array([clump["mass"] for clump in given]),
        "inertia": np.array([clump["inertia"] for clump in given]),
        "centre": np.array([body.centre for body in bodies]),
        "axes": np.array([body.axes for body in bodies]),
    }
    return {"clumps": columns}
