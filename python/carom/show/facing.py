"""Which way round the triangles of a mesh are drawn: seen from where the balls are, corners go round counter-clockwise.

Contacts ask no side of a triangle, so files may have either, even mixed. Triangles that share an edge are turned alike; then
balls tell the side of each connected piece: that of the place nearest to them, those near by more than others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, I64, Bool, connected
from carom.scene.assembly.triangles import Triangles

if TYPE_CHECKING:
    from carom.result.walls import Wall

BALLS = 128
"""Places of balls that are asked."""
TIED = 1e-9
"""Share by which distances of triangles may differ that have the nearest place both."""


def facing(wall: Wall) -> I64:
    """The triangles (T, 3) of a mesh, their corners in the order in which the balls see them."""
    assert wall.mesh is not None
    turned, piece = _alike(wall.mesh)
    mesh = Triangles(wall.mesh.vertices, _turned(wall.mesh.corners, turned))
    return _turned(mesh.corners, _sides(mesh, piece, wall.seen(BALLS))[piece] < 0.0)


def _turned(corners: I64, which: Bool) -> I64:
    return np.where(which[:, None], corners[:, ::-1], corners)


def _alike(mesh: Triangles) -> tuple[Bool, I64]:
    """Which triangles (T,) to turn for neighbours to have one side, and a number of the piece of each. Where more than two
    meet in an edge, or a surface has but one side, they stay.
    """
    count = len(mesh.corners)
    point = np.unique(mesh.vertices, axis=0, return_inverse=True)[1].ravel()[mesh.corners]
    ends = np.stack([point, np.roll(point, -1, axis=1)], axis=2).reshape(-1, 2)
    forth = ends[:, 0] < ends[:, 1]
    _, edge, shared = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    first, second = order[(shared == 2)[edge.ravel()[order]]].reshape(-1, 2).T
    # Each triangle twice, as it is and turned: what is joined here is seen together.
    other = np.where(forth[first] == forth[second], count, 0)
    a, b = first // 3, second // 3
    label = connected(2 * count, np.append(a, a + count), np.append(b + other, b + count - other))
    return label[:count] > label[count:], np.minimum(label[:count], label[count:])


def _sides(mesh: Triangles, piece: I64, x: F64) -> F64:
    """For the number of each piece (T,) whether places (K, 3) are before it (above 0) or behind it."""
    found = np.zeros(len(piece))
    centre = mesh.at.mean(axis=1)
    size = np.linalg.norm(mesh.at - centre[:, None], axis=2).max(axis=1)
    for place in x:
        least = np.full(len(piece), np.inf)
        away = np.linalg.norm(place - centre, axis=1)
        np.minimum.at(least, piece, away)
        near = np.flatnonzero(away - size <= least[piece])
        arm = place - mesh.closest(np.broadcast_to(place, (len(near), 3)), near)
        away, of = np.linalg.norm(arm, axis=1), piece[near]
        np.minimum.at(least, of, away)
        tied = away <= least[of] * (1.0 + TIED)
        height = np.bincount(of, np.where(tied, np.sum(arm * mesh.normal[near], axis=1), 0.0), len(piece))
        found += np.sign(height) / np.maximum(least, np.finfo(float).tiny)
    return found
