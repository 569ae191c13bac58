"""Where the eye stands: presets that have a whole box in view, as the viewer has them, or along with a ball."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64

#: Angle of view from the lower to the upper edge, degrees.
ANGLE = 32.0
#: Distance from a ball that is followed, in its radii.
NEAR = 26.0


@dataclass(frozen=True)
class Eye:
    """Position, what it looks at and what is up, (3,) each."""

    position: F64
    target: F64
    up: F64


def whole(preset: str, low: F64, high: F64, up: F64, aspect: float) -> Eye:
    """Stands so that the box from `low` to `high`, (3,), is in view; `up` a unit vector, `aspect` width over height."""
    across = _across(low, high, up)
    if aspect < 0.8:  # what is long lies along the screen
        across = np.cross(up, across)
    back = np.cross(up, across)
    sight = {
        "fit": -back - 0.1 * across + 0.85 * up,
        "top": up - 0.001 * back,
        "side": -back + 0.2 * up,
        "end": -across + 0.3 * up,
    }[preset]
    toward = sight / np.linalg.norm(sight)
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    above = np.cross(toward, right)
    tan = math.tan(math.radians(ANGLE / 2))
    corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    target, distance = 0.5 * (low + high), 0.0
    # The nearer side looks larger: the target moves until margins on both sides are equal.
    for _ in range(8):
        x, y, z = ((corners - target) @ axis for axis in (right, above, toward))
        distance = float((z + 1.06 * np.maximum(np.abs(x) / (tan * aspect), np.abs(y) / tan)).max())
        for offset, axis in ((x, right), (y, above)):
            slope = offset / (distance - z)
            target = target + 0.5 * (slope.max() + slope.min()) * distance * axis
    return Eye(target + distance * toward, target, above)


def beside(eye: Eye, centre: F64, radius: float) -> Eye:
    """Looks at a ball from near by, in the direction in which `eye` looks."""
    toward = eye.position - eye.target
    toward = toward / np.linalg.norm(toward)
    return Eye(centre + NEAR * radius * toward, centre, eye.up)


def _across(low: F64, high: F64, up: F64) -> F64:
    """The longer level direction of the box, with its axis to the right."""
    k = int(np.argmin(np.abs(up)))
    u = np.eye(3)[k] - up[k] * up
    u /= np.linalg.norm(u)
    v = np.cross(up, u)
    size = high - low
    long = v if np.abs(v) @ size > 1.15 * (np.abs(u) @ size) else u
    return -long if long[np.argmax(np.abs(long))] < 0 else long  # where y is up, v is -z
