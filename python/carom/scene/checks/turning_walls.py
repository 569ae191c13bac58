"""How fast walls sweep through space as they move: what a surface that moves into itself does not do."""

from __future__ import annotations

import math

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.placing import Placed
from carom.scene.assembly.triangles import Triangles
from carom.scene.assembly.vectors import scaled
from carom.scene.tables.motion import Rotation
from carom.scene.tables.walls import MESH, PLANE


def lever(wall: Placed, turn: Rotation) -> float:
    """Speed at which a wall meets what is in its way, over its rate of turning, m.

    That of triangles and rectangles is along their normal, and at edges without a neighbour across the edge: a drum of
    triangles and a round table turn into themselves. Of round walls it is an upper bound. Planes without end have none.
    """
    axis, point = np.array(scaled(turn.axis)), np.array(turn.point or wall.pivot)
    centre, kind = np.array(wall.point), wall.kind
    if kind == PLANE:
        return 0.0
    if kind == MESH:
        return _of_triangles(wall.shape[1], axis, point)
    if kind == "rectangle":
        return _of_triangles(_rectangle(wall), axis, point)
    moved = np.cross(axis, centre - point)
    if kind == "sphere":
        return float(np.linalg.norm(moved))
    along = np.array(wall.shape[1], dtype=np.float64)
    tilt = float(np.linalg.norm(np.cross(axis, along)))
    if kind == "disc":
        reach = float(wall.shape[2])
    elif kind == "cylinder":
        reach = float(wall.shape[2]) + 0.5 * float(wall.shape[3])
    else:  # a cone, whose place is its first ring
        half = 0.5 * float(wall.shape[4])
        reach = max(float(wall.shape[2]), float(wall.shape[3])) + half
        moved = np.cross(axis, centre + half * along - point)
    if math.isinf(reach):  # of a tube without end, the part near its point
        reach, moved = 0.0, moved - (moved @ along) * along
    return float(np.linalg.norm(moved)) + reach * tilt


def through(wall: Placed, ways: F64, turned: F64, turn: Rotation | None) -> F64:
    """(T,) m, how far translations (T, 3) take a wall through what is in its way, as it has turned by angles (T,): of planes
    without end along their normal, of tubes without end across their axis.
    """
    endless = wall.kind == "cylinder" and math.isinf(wall.shape[3])
    if wall.kind != PLANE and not endless:
        return np.asarray(np.linalg.norm(ways, axis=1))
    own = np.array(wall.shape[1], dtype=np.float64)
    own = np.broadcast_to(own / np.linalg.norm(own), ways.shape)
    if turn is not None:
        axis, c, s = np.array(scaled(turn.axis)), np.cos(turned)[:, None], np.sin(turned)[:, None]
        own = c * own + s * np.cross(axis, own) + (1.0 - c) * (own @ axis)[:, None] * axis
    along = (ways * own).sum(axis=1)
    return np.asarray(np.linalg.norm(ways - along[:, None] * own, axis=1) if endless else np.abs(along))


def _rectangle(wall: Placed) -> Triangles:
    normal, first, (a, b) = wall.shape[1:4]
    u = 0.5 * a * np.array(first)
    v = 0.5 * b * np.cross(normal, first)
    corners = np.array([-u - v, u - v, u + v, v - u]) + np.array(wall.point)
    return Triangles(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def _of_triangles(surface: Triangles, axis: F64, point: F64) -> float:
    """The largest at a corner: it is linear within a triangle and along an edge."""
    speed = np.cross(axis, surface.vertices - point)
    through = np.einsum("tck,tk->tc", speed[surface.corners], surface.normal)
    edges = np.sort(surface.corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    a, b = edges[count == 1].T
    along = surface.vertices[b] - surface.vertices[a]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(speed[np.stack([a, b])], along)
    return max(float(np.abs(through).max()), float(np.linalg.norm(across, axis=2).max(initial=0.0)))
