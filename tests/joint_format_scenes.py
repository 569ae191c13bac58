"""Two balls to be joined, and rotations by their definition."""

from __future__ import annotations

from typing import Any

import numpy as np
from carom import Scene
from hypothesis import strategies as st

R = 0.1
TURNED = (0.5, 0.1, -0.7, 0.5)  # not a unit quaternion to the last digit: the arrays hold it normalised
X, Y, Z = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]


def balls(**keys: Any) -> Scene:
    """Two balls `a` at (0, 0, 1) and `b` at (0, 0, 2), without gravity; `keys` are those of `a`."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 1.0})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    scene.sphere("a", **({"radius": R, "mass": 2.0, "at": (0, 0, 1), "material": "m"} | keys))
    scene.sphere("b", radius=R, mass=1.0, at=(0, 0, 2), material="m")
    return scene


def unit_quaternion(q: Any) -> list[float]:
    return (np.array(q) / np.linalg.norm(q)).tolist()


def all_types() -> Scene:
    scene = balls()
    scene.joint("fix", body="a", point=("1 mm", 0, 1))
    scene.joint("line", name="axle", body="b", direction=(1, 2, 3))
    scene.joint("plane", body="a", normal=(0, 1, 0), point=(0, 0, 1))
    scene.joint("lock", body="a")
    scene.joint("lock", between=("a", "b"), axes=[X, Y])
    scene.joint("ball", between=("a", "ground"), point=(0, 0, 0))
    scene.joint(
        "rod", between=("a", "b"), points=[(0, 0, 1.1), (0, 0, 1.9)], length={"polynomial": [0.8, 0, 1]}
    )
    scene.joint("motion", body="b", direction=X, displacement={"table": [[0, 0], [1, 0], [2, 3.5]]})
    scene.joint("motion", body="b", axis=Y, angle={"expression": "1 - cos(3*t)"})
    return scene


vectors = st.tuples(*[st.floats(-3, 3)] * 3)
