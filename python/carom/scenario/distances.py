"""How far balls are from the walls of a scene at the start: the geometry of `crates/carom-geom`, for the checks alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from carom.scenario.bodies import F64
from carom.scenario.placing import Placed
from carom.scenario.walls import PLANE

FREE = math.inf
"""Gap of a ball that is on the far side of a piece of a surface, which has one face."""


def gaps(wall: Placed, centre: F64, radius: F64) -> F64:
    """Gap of each ball to a wall at the start, (N,), m: negative where the ball is in it.

    Centres (N, 3) and radii (N,), m. A ball that has passed a piece of a plane, or a tube with ends, by more than its
    radius does not touch it.
    """
    kind, *parameters = wall.shape
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
        return _one_faced(away @ normal, np.linalg.norm(beyond, axis=1), radius)
    axis = np.array(parameters[0])
    along: F64 = away @ axis
    across: F64 = np.linalg.norm(away - np.outer(along, axis), axis=1)
    if kind == "disc":
        beyond = np.maximum(np.maximum(across - parameters[1], parameters[2] - across), 0.0)
        return _one_faced(along, beyond, radius)
    if kind == "cylinder":
        r, length, inside = parameters[1:]
        if math.isinf(length):
            open_tube: F64 = _side(inside) * (across - r) - radius
            return open_tube
        return _profile(along, across, (-0.5 * length, r), (0.5 * length, r), inside, radius)
    first, last, length, inside = parameters[1:]
    return _profile(along, across, (0.0, first), (length, last), inside, radius)


def _side(inside: bool) -> float:
    return -1.0 if inside else 1.0


def _one_faced(height: F64, beyond: F64, radius: F64) -> F64:
    """Gap to a piece of a surface: `height` over its face, `beyond` its outline."""
    distance = np.where(beyond > 0, np.hypot(height, beyond), height)
    return np.where((beyond == 0) & (height < -radius), FREE, distance - radius)


def _profile(
    along: F64, across: F64, first: Sequence[float], last: Sequence[float], inside: bool, radius: F64
) -> F64:
    """Gap to the surface that a line from `first` to `last` (along, across the axis) makes when it turns about the axis."""
    z, r = last[0] - first[0], last[1] - first[1]
    length = math.hypot(z, r)
    u, v = along - first[0], across - first[1]
    place = (u * z + v * r) / length
    beyond = np.maximum(np.maximum(place - length, -place), 0.0)
    outward = (v * z - u * r) / length
    return _one_faced(_side(inside) * outward, beyond, radius)
