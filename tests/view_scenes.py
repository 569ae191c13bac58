"""Results made by hand for the tests of the viewer: motion as smooth as a real run's, no solver needed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

RADIUS = 0.028575
STEP = 2e-3


def turn(rate: Any, time: float) -> Any:
    """Attitude, scalar first, after turning at the constant `rate` for `time`."""
    angle = np.linalg.norm(rate, axis=-1, keepdims=True) * time
    axis = rate / np.maximum(np.linalg.norm(rate, axis=-1, keepdims=True), 1e-12)
    return np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * axis], -1)


def billiard(frames: int) -> Any:
    """Four balls that roll apart on a table, ever slower; the first also spins about the vertical.

    Attitudes are those of a constant axis: exact for the other three, and all that is asked of the first.
    """
    time = STEP * np.arange(frames)
    r = RADIUS
    start = np.array(
        [
            [0.635, 0.635, r],
            [1.905, 0.635, r],
            [1.905 + 3**0.5 * r, 0.635 - r, r],
            [1.905 + 3**0.5 * r, 0.635 + r, r],
        ]
    )
    direction = np.array([[0.30, 0.02, 0.0], [0.15, 0.01, 0.0], [0.2, -0.2, 0.0], [0.2, 0.2, 0.0]])
    travelled = 1.0 - np.exp(-time)
    position = start + direction * travelled[:, None, None]
    velocity = direction * np.exp(-time)[:, None, None]
    axis = np.stack([-direction[:, 1] / r, direction[:, 0] / r, np.array([5.0, 0.0, 0.0, 0.0])], -1)
    return SimpleNamespace(
        time=time,
        position=position,
        orientation=np.stack([turn(axis, float(s)) for s in travelled]),
        velocity=velocity,
        angular_velocity=axis * np.exp(-time)[:, None, None],
        names=["ball2", "ball3", "ball4", "ball5"],
        bodies={"radius": np.full(4, r)},
        planes={
            "name": ["bed", "foot cushion", "head cushion", "left cushion", "right cushion"],
            "point": [[0, 0, 0], [2.54, 0, 0], [0, 0, 0], [0, 1.27, 0], [0, 0, 0]],
            "normal": [[0, 0, 1], [-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]],
        },
        gravity=np.array([0.0, 0.0, -9.8]),
        impacts={"time": np.array([0.01, 0.02])},
    )
