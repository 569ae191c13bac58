"""Random scenes for the auditor: 27 balls that stick together in a periodic box, and hit one another slowly.

python tests/audit_sticky.py 40       # simulates and judges 40 scenes, and says which were found at fault
python tests/audit_sticky.py 1 2      # the scene of seed 2 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from audit_random import main

UNTIL = 0.1
"""Duration, s."""
R = 0.01
SIDE = 3


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 78])

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    pitch = one(2.01, 2.03, 2.1)
    length = SIDE * pitch * R
    made = carom.Scene(gravity=(0, 0, 0), periodic=(length, length, length))
    law = {"restitution": one(0.0, 0.0, 0.5, 0.8, 1.0), "tangential_restitution": one(0.0, 0.0, 0.0, 0.4)}
    law |= {"friction": one(0.0, 0.2, 0.5), "rolling_radius": one(0.0, 0.0, 1e-4)}
    law |= {"spinning_radius": one(0, 0, 1e-4), "cohesion": one(0.002, 0.05)}
    made.contact("grain", "grain", rupture_distance=one(1e-5, 1e-3), **law)
    speed, spin = one(0.1, 1.0), one(0.0, 10.0)
    for k in range(SIDE**3):
        cell = np.array([k % SIDE, k // SIDE % SIDE, k // SIDE**2])
        slack = 0.5 * (pitch - 2.001) * R
        place = (cell + 0.5) * pitch * R + slack * rng.uniform(-0.5, 0.5, 3)
        radius = R * one(1.0, 1.0, 0.9)
        velocity, turn = ((size * rng.uniform(-1, 1, 3)).tolist() for size in (speed, spin))
        made.sphere(f"b{k}", radius=radius, density=2500, material="grain", position=place.tolist(),
                    velocity=velocity, angular_velocity=turn)  # fmt: skip
    options = {"step": one(1e-3, 5e-4, 2e-4), "impact": "poisson", "impacts": "every", "contacts": True}
    return made, options


if __name__ == "__main__":
    main(scene, UNTIL)
