"""Random scenes for the auditor: balls that stick to one another and to walls that rest and shake.

python tests/audit_cohesive.py 200       # simulates and judges 200 scenes, and says which were found at fault
python tests/audit_cohesive.py 1 37      # the scene of seed 37 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from audit_random import main

UNTIL = 0.1
"""Duration, s."""
R = 0.005


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 312])

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    periodic = {"periodic": (0.031, 0, 0)} if one(False, False, True) else {}
    made = carom.Scene(gravity=(0, 0, -9.8), **periodic)
    for other in ("grain", "wall"):
        made.contact("grain", other, friction=one(0.0, 0.3, 0.6), restitution=one(0.0, 0.0, 0.5),
                     rolling_radius=one(0.0, 0.0, 1e-4), cohesion=one(0.0, 0.002, 0.01, 0.05, 0.3),
                     rupture_distance=one(1e-6, 1e-5, 1e-4, 1e-3))  # fmt: skip
    shake = {"translation": [0, 0, {"expression": "0.002*sin(60*t)"}]}
    belt = {"surface_velocity": [0.2, 0, 0]}
    motion = one({}, {}, {"motion": shake}, {"motion": belt})
    made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall", **motion)
    kind = one("none", "side", "drum", "mesh")
    if kind == "side" and not periodic:
        made.plane("side", point=(-0.0051, 0, 0), normal=(1, 0, 0), material="wall")
    elif kind == "drum" and not periodic:
        made.cylinder("drum", point=(0.01, 0, 0.02), axis=(0, 1, 0), radius=0.03, material="wall",
                      motion={"rotation": {"axis": (0, 1, 0), "rate": 3.0}})  # fmt: skip
    elif kind == "mesh" and not periodic:
        corners = [(-0.05, -0.05, 0.0), (0.05, -0.05, 0.0), (0.05, 0.05, 0.001), (-0.05, 0.05, 0.001)]
        made.mesh("sheet", vertices=corners, triangles=[(0, 1, 2), (0, 2, 3)], material="wall")
    for k in range(one(1, 2, 3, 6, 12)):
        place = (0.0103 * (k % 3), 0.0102 * ((k // 3) % 2), 0.0065 + 0.0105 * (k // 6))
        made.sphere(f"b{k}", radius=R, density=2500, material="grain", position=place,
                    velocity=(0.3 * rng.uniform(-1, 1, 3)).tolist())  # fmt: skip
    if one(False, False, True):
        made.load("b0", force=[0, 0, {"expression": "0.02*sin(100*t)"}])
    options: dict[str, Any] = {
        "method": one("nsga", "nsga", "moreau"),
        "step": one(1e-3, 5e-4, 1e-4),
        "every": one(1, 1, 1, 3),
        "impacts": one("every", True, False),
        "contacts": one(True, True, True, False),
    }
    return made, options


if __name__ == "__main__":
    main(scene, UNTIL)
