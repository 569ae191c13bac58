"""Random piles: grains of two sizes fall into a box and jam there, and not all tables of the run are recorded.

Some boxes shake, convey or are open to their images on the other side; some grains are joined, rain in, or have drag; some
runs have another impact law, or method `moreau`.

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

    gravity = (one(0.0, 0.0, 2.0), 0.0, -9.8)
    laws = {other: _law(one) for other in ("grain", "wall")}
    spacing = 2.05 * RADIUS
    counts = one((2, 2, 3), (2, 2, 6), (3, 2, 4), (3, 3, 4), (3, 3, 6))
    wide = [float(n * spacing * one(1.0, 1.2)) for n in counts[:2]]
    large = [(one(2500, 7800), one(0.0, 1.0)) for _ in range(int(rng.integers(0, 4)))]
    options: dict[str, Any] = {
        "step": one(1e-3, 1e-3, 5e-4),
        "pile_tolerance": one(1e-4, 1e-5, 1e-6, 1e-7),
        "pile_contacts": one(20, 50, 100),
        "every": one(1, 1, 1, 4),
        "contacts": one(True, True, True, False),
        "impacts": one(False, False, True, "every"),
    }
    kind = one("rest", "rest", "shaken", "conveyed", "periodic", "joined", "rain", "drag", "law", "method")
    periodic = {"periodic": (max(wide[0], 0.03), 0, 0)} if kind == "periodic" else {}
    made = carom.Scene(gravity=gravity, **periodic)
    for other, law in laws.items():
        made.contact("grain", other, **law)
    _box(made, wide, kind, one)
    made.lattice("grain", material="grain", radius=RADIUS, density=2500, counts=counts, origin=(spacing / 2,) * 3,
                 spacing=spacing, jitter=0.45 * (spacing - 2 * RADIUS), seed=seed)  # fmt: skip
    above = counts[2] * spacing
    for k, (density, speed) in enumerate(large):
        place = (wide[0] / 2, wide[1] / 2, above + 0.008 + 0.016 * k)
        made.sphere(f"large {k}", material="grain", radius=0.007, density=density, position=place,
                    velocity=(0, 0, -speed))  # fmt: skip
    if kind == "joined":
        for k in range(3):
            for name, shift in (("low", 0.0), ("high", 2.2 * RADIUS)):
                place = (RADIUS * (1.1 + k % 2), RADIUS * 1.1, above + 0.07 + 0.025 * k + shift)
                made.sphere(f"{name} {k}", material="grain", radius=RADIUS, density=2500, position=place,
                            velocity=(0, 0, -1), angular_velocity=(3.0, 0, 0))  # fmt: skip
            made.joint("rod", between=[f"low {k}", f"high {k}"])
    elif kind == "rain":
        made.inflow("rain", material="grain", count=8, radius=0.004, density=2500, rate=100, velocity=(0, 0, -1),
                    seed=seed, region={"low": [0.005, 0.005, above + 0.08],
                                       "high": [wide[0] - 0.005, wide[1] - 0.005, above + 0.09]})  # fmt: skip
    elif kind == "drag":
        made.drag("grain1", translation=one(1e-3, 1e-2))
        made.drag("grain2", translation=1e-3, rotation=1e-8)
    elif kind == "law":
        options["impact"] = one("one-shot", "poisson")  # those through springs take minutes
    elif kind == "method":
        options["method"] = "moreau"
    return made, options


def _law(one: Any) -> dict[str, float]:
    found = {"friction": one(0.0, 0.3, 0.5, 0.9), "restitution": one(0.0, 0.3, 0.8)}
    found |= {"rolling_radius": one(0.0, 0.0, 5e-4), "spinning_radius": one(0.0, 0.0, 5e-4)}
    return found


def _box(made: carom.Scene, wide: list[float], kind: str, one: Any) -> None:
    motion: dict[str, Any] = {}
    if kind == "shaken":
        shake = {"expression": f"{one(2e-4, 1e-3)}*sin({one(60, 200)}*t)"}
        motion = {"motion": {"translation": one([0, 0, shake], [shake, 0, 0], [shake, 0, shake])}}
    elif kind == "conveyed":
        motion = {"motion": {"surface_velocity": (one(0.05, 0.3), 0, 0)}}
    made.plane("floor", material="wall", point=(0, 0, 0), normal=(0, 0, 1), **motion)
    shaken = motion if kind == "shaken" else {}
    for axis, name in enumerate("xy"):
        if kind == "periodic" and axis == 0:
            continue
        for end, side in ((0.0, "low"), (wide[axis], "high")):
            point, normal = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            point[axis], normal[axis] = end, -1.0 if side == "high" else 1.0
            made.plane(f"{side} {name}", material="wall", point=point, normal=normal, **shaken)


if __name__ == "__main__":
    audit_random.main(scene, UNTIL)
