"""Random scenes for the auditor: balls and clumps that stick to one another and to walls that rest and shake.

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
    of_clumps = np.random.default_rng([seed, 313])
    clumps = of_clumps.random() < 0.4
    for k in range(one(1, 2, 3, 6, 12)):
        place = (0.0103 * (k % 3), 0.0102 * ((k // 3) % 2), 0.0065 + 0.0105 * (k // 6))
        motion = {"position": place, "velocity": (0.3 * rng.uniform(-1, 1, 3)).tolist()}
        if clumps and of_clumps.random() < 0.7:
            _clump(made, f"b{k}", of_clumps, **motion)
        else:
            made.sphere(f"b{k}", radius=R, density=2500, material="grain", **motion)
    if one(False, False, True) and not clumps:
        made.load("b0", force=[0, 0, {"expression": "0.02*sin(100*t)"}])
    options: dict[str, Any] = {
        "method": "nsga" if clumps else one("nsga", "nsga", "moreau"),
        "step": one(1e-3, 5e-4, 1e-4),
        "every": one(1, 1, 1, 3),
        "impacts": one("every", True, False),
        "contacts": one(True, True, True, False),
    }
    return made, options


def _clump(made: carom.Scene, name: str, rng: np.random.Generator, **motion: Any) -> None:
    """Two or three balls within the ball of radius R."""
    r = R * rng.uniform(0.4, 0.6)
    spheres = [[R - r, 0, 0, r], [r - R, 0, 0, r], [0, 0.5 * R, 0, 0.5 * R]][: int(rng.integers(2, 4))]
    turn = rng.normal(size=4)
    made.clump(name, material="grain", spheres=spheres, density=2500, orientation=(turn / np.linalg.norm(turn)).tolist(),
               angular_velocity=(20.0 * rng.normal(size=3)).tolist(), **motion)  # fmt: skip


if __name__ == "__main__":
    main(scene, UNTIL)
