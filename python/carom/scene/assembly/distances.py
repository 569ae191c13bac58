"""How far balls are from the walls of a scene at the start: the geometry of `crates/carom-geom`, for the checks alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.placing import Placed
from carom.scene.tables.walls import MESH, PLANE


def gaps(wall: Placed, centre: F64, radius: F64) -> F64:
    """Gap of each ball to a wall at the start, (N,), m: negative where the ball is in it.

    Centres (N, 3) and radii (N,), m. Pieces of surfaces have two faces. A mesh more than a radius
    away is infinitely far.
    """
    kind, *parameters = wall.shape
    if kind == MESH:
        mesh: F64 = parameters[0].distance(centre, 2.0 * radius) - radius
        return mesh
    away = centre - np.array(wall.point)
    if kind == PLANE:
        gap: F64 = away @ np.array(parameters[0]) - radius
        return gap
    if kind == "sphere":
        bowl: F64 = _side(parameters[1]) * (np.linalg.norm(away, axis=1) - parameters[0]) - radius
        return bowl
    if kind == "rectangle":
        normal, side, size = (np.array(p) for p in parameters)
        within = np.stack([away @ side, away @ np.cross(normal, side)], axis=1)
        beyond = np.maximum(np.abs(within) - 0.5 * size, 0.0)
        sheet: F64 = np.hypot(away @ normal, np.linalg.norm(beyond, axis=1)) - radius
        return sheet
    axis = np.array(parameters[0])
    along: F64 = away @ axis
    across: F64 = np.linalg.norm(away - np.outer(along, axis), axis=1)
    if kind == "disc":
        beyond = np.maximum(np.maximum(across - parameters[1], parameters[2] - across), 0.0)
        flat: F64 = np.hypot(along, beyond) - radius
        return flat
    if kind == "cylinder":
        r, length, inside = parameters[1:]
        if math.isinf(length):
            open_tube: F64 = _side(inside) * (across - r) - radius
            return open_tube
        return _profile(along, across, (-0.5 * length, r), (0.5 * length, r)) - radius
    first, last, length = parameters[1:4]
    return _profile(along, across, (0.0, first), (length, last)) - radius


def _side(inside: bool) -> float:
    return -1.0 if inside else 1.0


def _profile(along: F64, across: F64, first: Sequence[float], last: Sequence[float]) -> F64:
    """Distance from what a line from `first` to `last` (along, across the axis) sweeps when it turns about the axis."""
    z, r = last[0] - first[0], last[1] - first[1]
    length = math.hypot(z, r)
    u, v = along - first[0], across - first[1]
    place = (u * z + v * r) / length
    beyond = np.maximum(np.maximum(place - length, -place), 0.0)
    return np.hypot((v * z - u * r) / length, beyond)


def _units(vectors: F64) -> F64:
    """Unit vectors, (N, 3); 0 stays 0."""
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(size > 0.0, size, 1.0))


def normals(wall: Placed, centre: F64) -> F64:
    """Unit normals at the closest points of a wall at the start, towards the balls, (N, 3); 0 where all are as near."""
    kind, *parameters = wall.shape
    if kind == MESH:
        return _units(centre - parameters[0].nearest(centre))
    away = centre - np.array(wall.point)
    if kind == PLANE:
        return np.tile(np.array(parameters[0], dtype=float), (len(centre), 1))
    if kind == "sphere":
        return _side(parameters[1]) * _units(away)
    # Of the others the distance of a point: its gradient by central differences of a size that both errors allow.
    step = 1e-5 * float(np.linalg.norm(away, axis=1).max(initial=0.0) or 1.0)
    none = np.zeros(len(centre))
    slopes = [gaps(wall, centre + d, none) - gaps(wall, centre - d, none) for d in step * np.eye(3)]
    return _units(np.stack(slopes, axis=1))
