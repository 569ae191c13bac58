"""Random piles: grains of two sizes fall into a box and jam there, and not all tables of the run are recorded.

python tests/audit_piles.py 200          # simulates and judges 200 piles, and says which were found at fault
python tests/audit_piles.py 1 37         # the pile of seed 37 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import audit_random
import carom
import numpy as np

UNTIL = 0.12
"""Duration, s: grains lie on one another after half of it."""
RADIUS = 0.005


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run."""
    rng = np.random.default_rng([seed, 26])

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    made = carom.Scene(gravity=(one(0.0, 0.0, 2.0), 0.0, -9.8))
    for other in ("grain", "wall"):
        made.contact("grain", other, friction=one(0.0, 0.3, 0.5, 0.9), restitution=one(0.0, 0.3, 0.8),
                     rolling_radius=one(0.0, 0.0, 5e-4), spinning_radius=one(0.0, 0.0, 5e-4))  # fmt: skip
    spacing = 2.05 * RADIUS
    counts = one((2, 2, 3), (2, 2, 6), (3, 2, 4), (3, 3, 4), (3, 3, 6))
    wide = [float(n * spacing * one(1.0, 1.2)) for n in counts[:2]]
    made.box("box", material="wall", low=(0, 0, 0), high=(*wide, 0.2), open=["high_z"])
    made.lattice("grain", material="grain", radius=RADIUS, density=2500, counts=counts, origin=(spacing / 2,) * 3,
                 spacing=spacing, jitter=0.45 * (spacing - 2 * RADIUS), seed=seed)  # fmt: skip
    above = counts[2] * spacing
    for k in range(int(rng.integers(0, 4))):
        place = (wide[0] / 2, wide[1] / 2, above + 0.008 + 0.016 * k)
        made.sphere(f"large {k}", material="grain", radius=0.007, density=one(2500, 7800), position=place,
                    velocity=(0, 0, -one(0.0, 1.0)))  # fmt: skip
    options: dict[str, Any] = {
        "step": one(1e-3, 1e-3, 5e-4),
        "pile_tolerance": one(1e-4, 1e-5, 1e-6, 1e-7),
        "pile_contacts": one(20, 50, 100),
        "every": one(1, 1, 1, 4),
        "contacts": one(True, True, True, False),
        "impacts": one(False, False, True, "every"),
    }
    return made, options


if __name__ == "__main__":
    audit_random.main(scene, UNTIL)
