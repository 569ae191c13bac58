"""Random scenes for the auditor: balls and clumps in periodic boxes that are sheared, squeezed and stretched.

python tests/audit_deforming.py 60       # simulates and judges 60 scenes, and says which were found at fault
python tests/audit_deforming.py 1 37     # the scene of seed 37 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from audit_random import main

UNTIL = 0.06
"""Duration, s."""
R = 0.01


def _laws(one: Any) -> tuple[Any, Any]:
    """Laws of a shear strain, and of a stretch: steady, oscillating, and with kinks on steps and between them."""
    rate, w = one(0.5, 3.0, -8.0), one(20, 60)
    shear = one(
        {"polynomial": [0.0, rate]},
        {"expression": f"{rate / w}*sin({w}*t)"},
        {"table": [[0.0, 0.0], [0.02, 0.02 * rate], [0.0403, -0.01 * rate], [1.0, -0.01 * rate]]},
        {"polynomial": [0.0, 0.0, 10.0 * rate]},
    )
    rate = one(-1.0, -0.2, 0.5, 1.5)
    stretch = one(
        {"polynomial": [1.0, rate]},
        {"expression": f"exp({rate}*t)"},
        {"expression": f"1 + {rate / w}*sin({w}*t)"},
        {"table": [[0.0, 1.0], [0.03, 1.0 + 0.03 * rate], [0.0507, 1.0], [1.0, 1.0]]},
    )
    return shear, stretch


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 16])

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    method = one("nsga", "nsga", "nsga", "moreau")
    side, pitch = one(2, 2, 3, 3, 4), one(2.03, 2.1, 2.4, 3.0)
    pitch = max(pitch, 4.6 / side)
    length, walled = side * pitch * R, one(False, False, False, True)
    periodic = (length, length, 0.0 if walled else length)
    made = carom.Scene(gravity=one((0, 0, 0), (0, 0, 0), (0, 0, -9.8)), periodic=periodic)
    clumps = method == "nsga" and one(False, False, True)
    cohesion = {"cohesion": one(0.002, 0.05), "rupture_distance": one(1e-5, 1e-3)}
    cohesion = {} if clumps or one(0, 0, 1) else cohesion
    for other in ("grain", "wall"):
        rough = {"friction": one(0.0, 0.2, 0.5), "rolling_radius": one(0.0, 0.0, 1e-4),
                 "spinning_radius": one(0.0, 0.0, 1e-4)}  # fmt: skip
        if other == "wall":  # which does not go along with the box
            rough = {"friction": 0.0}
        made.contact("grain", other, restitution=one(0.0, 0.5, 0.8, 1.0),
                     tangential_restitution=one(0.0, 0.0, 0.0, 0.4), **rough, **cohesion)  # fmt: skip
    shear, stretch = _laws(one)
    planes = one(("x", "y"), ("y", "x")) if walled else one(("x", "z"), ("y", "x"), ("z", "y"))
    given: dict[str, Any] = {}
    kind = one("shear", "shear", "stretch", "both")
    if kind != "stretch":
        given |= {"shear": shear, "flow": planes[0], "gradient": planes[1]}
    if kind != "shear":
        given["stretch"] = [one(1.0, stretch), stretch, 1.0 if walled else one(1.0, stretch)]
    made.deform(**given)
    if walled:
        made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    speed, spin = one(0.0, 0.1, 1.0), one(0.0, 10.0)
    away = one(0, 0, 3)
    for k in range(side**3):
        cell = np.array([k % side, k // side % side, k // side**2])
        slack = 0.5 * (pitch - 2.001) * R
        place = (cell + 0.5) * pitch * R + slack * rng.uniform(-0.5, 0.5, 3)
        # Of any images.
        place = place + np.array(periodic) * rng.integers(-away, away + 1, 3)
        common: dict[str, Any] = {"material": "grain", "position": place.tolist(), "density": 2500,
                                  "velocity": (speed * rng.uniform(-1, 1, 3)).tolist(),
                                  "angular_velocity": (spin * rng.uniform(-1, 1, 3)).tolist()}  # fmt: skip
        if clumps and k % 3 == 0:
            made.clump(f"c{k}_", spheres=[[-0.3 * R, 0, 0, 0.7 * R], [0.3 * R, 0, 0, 0.6 * R]], **common)
        else:
            made.sphere(f"b{k}", radius=R * one(1.0, 1.0, 0.9), **common)
    loose = [ball.name for ball in made.spheres]
    if len(loose) > 1 and not clumps and one(0, 0, 0, 1):
        made.load(loose[1], force=[0, 0, {"expression": "0.1*sin(80*t)"}])
    options: dict[str, Any] = {
        "method": method,
        "step": one(1e-3, 5e-4, 5e-4, 2e-4),
        "every": one(1, 1, 1, 3),
        "impacts": one("every", True, True, False),
        "contacts": one(True, True, True, False),
        "impact": one("sequence", "sequence", "one-shot", "poisson"),
    }
    return made, options


if __name__ == "__main__":
    main(scene, UNTIL)
