"""Random scenes for the auditor: grains between walls, of which one or two are free.

python tests/audit_free.py 200       # simulates and judges 200 scenes, and says which were found at fault
python tests/audit_free.py 1 37      # the scene of seed 37 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from audit_random import main

UNTIL = 0.05
"""Duration, s."""
R = 0.005


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 431])

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    across = one(1, 2, 3)
    layers = one(1, 2, 3, 4)
    side, top = 0.0105 * across, 0.0105 * layers + 0.002
    periodic = {"periodic": (side, side, 0)} if across > 2 and one(False, True) else {}
    made = carom.Scene(gravity=one((0, 0, -9.8), (0, 0, 0), (1.0, 0, -9.8)), **periodic)
    for other in ("grain", "wall"):
        made.contact("grain", other, friction=one(0.0, 0.3, 0.6), restitution=one(0.0, 0.3, 0.8),
                     tangential_restitution=one(0.0, 0.0, 0.4), rolling_radius=one(0.0, 0.0, 1e-4))  # fmt: skip

    def free() -> dict[str, Any]:
        given: dict[str, Any] = {"mass": one(0.001, 0.02, 0.5), "velocity": one(0.0, 0.0, 0.3)}
        given["weight"] = one(True, False)
        force = one(0.0, 0.5, 5.0, {"expression": "5+2*sin(50*t)"}, {"expression": "sin(500*t)"})
        return given | ({} if force == 0.0 else {"force": force})

    lid = {"free": free()} if one(True, True, False) else {}
    floor = one(
        {}, {}, {"free": free()}, {"motion": {"translation": [0, 0, {"expression": "0.001*sin(60*t)"}]}}
    )
    if not lid and "free" not in floor:
        lid = {"free": free()}
    made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall", **floor)
    made.plane("lid", point=(0, 0, top), normal=(0, 0, -1), material="wall", **lid)
    if not periodic:
        sides = [("left", 0, 1), ("right", 0, -1), ("front", 1, 1), ("back", 1, -1)]
        for name, axis, sign in sides:
            normal, point = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            normal[axis], point[axis] = float(sign), 0.0 if sign > 0 else side
            more = {"free": free()} if name == "right" and one(False, False, True) else {}
            made.plane(name, point=point, normal=normal, material="wall", **more)
    speed = one(0.0, 0.1, 0.5)
    for k in range(across * across * layers):
        row, column, layer = k % across, (k // across) % across, k // across**2
        place = (0.0052 + 0.0105 * row, 0.0053 + 0.0105 * column, 0.006 + 0.0105 * layer)
        made.sphere(f"b{k}", radius=R * rng.uniform(0.9, 1.0), density=2500, material="grain", position=place,
                    velocity=(speed * rng.uniform(-1, 1, 3)).tolist())  # fmt: skip
    if one(False, False, False, True):
        made.load("b0", force=[0, 0, {"expression": "0.02*sin(100*t)"}])
    options: dict[str, Any] = {
        "method": one("nsga", "nsga", "moreau"),
        "step": one(1e-3, 5e-4, 1e-4),
        "every": one(1, 1, 1, 10),
        "impacts": one("every", True, False),
        "contacts": one(True, True, True, False),
        "impact": one("sequence", "sequence", "sequence", "poisson"),
        "spectral_radius": one(0.8, 0.9, 0.5),
    }
    return made, options


if __name__ == "__main__":
    main(scene, UNTIL)
