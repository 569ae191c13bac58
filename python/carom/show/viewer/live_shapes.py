"""Meshes of the live view's balls: two halves, by whose colours the rotation shows."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.show.surfaces import Faces, revolved

BALL_ROUND = 16


def ball_halves() -> tuple[tuple[str, F64, Faces], tuple[str, F64, Faces]]:
    """Name, vertices and faces of what lies below and above a third of the radius of a unit ball."""
    cut = np.arccos(1 / 3)
    parts = []
    for name, first, last, rings in (("lower", np.pi, cut, 7), ("cap", cut, 0.0, 5)):
        angle = np.linspace(first, last, rings)
        parts.append((name, *revolved(np.sin(angle), np.cos(angle), np.eye(3), BALL_ROUND)))
    return parts[0], parts[1]
