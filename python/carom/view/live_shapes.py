"""Meshes of the live view: two halves of a ball, by whose colours its rotation shows, and walls of every shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int32]

ROUND = 48
BALL_ROUND = 16


def ball_halves() -> tuple[tuple[str, Floats, Faces], tuple[str, Floats, Faces]]:
    """Name, vertices and faces of what lies below and above a third of the radius of a unit ball."""
    cut = np.arccos(1 / 3)
    parts = []
    for name, first, last, rings in (("lower", np.pi, cut, 7), ("cap", cut, 0.0, 5)):
        angle = np.linspace(first, last, rings)
        parts.append((name, *_revolved(np.sin(angle), np.cos(angle), np.eye(3), BALL_ROUND)))
    return parts[0], parts[1]


def wall_mesh(shape: str, facts: Mapping[str, Any], low: Floats, high: Floats) -> tuple[Floats, Faces]:
    """Vertices relative to the wall's point, m, and faces. What has no end reaches as far as the box of the balls."""
    middle, reach = 0.5 * (low + high) - np.asarray(facts["point"]), 0.75 * float(np.linalg.norm(high - low))
    normal = facts["normal"] if shape == "plane" else facts.get("axis")
    axis = (
        np.array([0.0, 0.0, 1.0]) if normal is None or not np.isfinite(normal).all() else np.asarray(normal)
    )
    axis = axis / np.linalg.norm(axis)
    if shape == "rectangle":
        u = np.asarray(facts["side"]) / np.linalg.norm(facts["side"])
        return _sheet(u, np.cross(axis, u), np.asarray(facts["size"]) / 2, np.zeros(3))
    frame = _frame(axis)
    if shape == "plane":
        return _sheet(frame[0], frame[1], np.full(2, reach), middle - axis * (axis @ middle))
    radius = float(facts["radius"])
    if shape == "sphere":
        angle = np.linspace(np.pi, 0.0, 24)
        return _revolved(radius * np.sin(angle), radius * np.cos(angle), frame, ROUND)
    if shape == "disc":
        hole = float(facts.get("hole", np.nan))
        rings = np.array([hole if np.isfinite(hole) else 0.0, radius])
        return _revolved(rings, np.zeros(2), frame, ROUND)
    length = float(facts.get("length", np.nan))
    if shape == "cone":
        return _revolved(
            np.array([radius, float(facts["radius_end"])]), np.array([0.0, length]), frame, ROUND
        )
    along = float(axis @ middle)
    ends = np.array([-length / 2, length / 2]) if np.isfinite(length) else along + np.array([-reach, reach])
    return _revolved(np.full(2, radius), ends, frame, ROUND)


def _frame(axis: Floats) -> Floats:
    """Rows u, v and the axis, right-handed."""
    u = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(axis, u), axis])


def _sheet(u: Floats, v: Floats, half: Floats, middle: Floats) -> tuple[Floats, Faces]:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return middle + corners @ np.stack([u, v]), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def _revolved(radius: Floats, height: Floats, frame: Floats, sides: int) -> tuple[Floats, Faces]:
    """A profile turned about the third row of `frame`; normals point away from the axis if the height grows."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = radius[:, np.newaxis, np.newaxis] * (ring @ frame[:2])[np.newaxis]
    vertices = (flat + height[:, np.newaxis, np.newaxis] * frame[2]).reshape(-1, 3)
    faces = []
    for k in range(len(radius) - 1):
        a = k * sides + np.arange(sides)
        b = k * sides + (np.arange(sides) + 1) % sides
        faces += [np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)]
    return vertices, np.concatenate(faces).astype(np.int32)
