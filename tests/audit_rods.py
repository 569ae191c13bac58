"""Random scenes of balls that rods, ball joints and locks hold together and that hit a floor and one another."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np

UNTIL = 0.4
"""Duration, s."""
RADIUS = 0.02


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run."""
    rng = np.random.default_rng([seed, 77])
    made = carom.Scene(gravity=(0, 0, -9.8 if rng.random() < 0.8 else 0.0))
    for other in ("ball", "wall"):
        made.contact("ball", other, friction=float(rng.choice([0, 0.3, 0.8])), restitution=float(rng.choice([0, 0.5, 1])),
                     rolling_radius=float(rng.choice([0, 0, 1e-3])))  # fmt: skip
    made.plane("floor", point=(0, 0, 0), normal=(float(rng.choice([0, 0.2])), 0, 1), material="wall")
    for k in range(int(rng.integers(1, 5))):
        _cluster(made, rng, k, np.array([*rng.uniform(-0.02, 0.02, 2), 0.08 + 0.13 * k]))
    options = {
        "method": str(rng.choice(["nsga", "nsga", "moreau"])),
        "every": int(rng.choice([1, 1, 3])),
        "step": float(rng.choice([1e-3, 5e-4, 2e-3])),
    }
    return made, options


def _cluster(made: carom.Scene, rng: np.random.Generator, k: int, middle: Any) -> None:
    """One ball; two with a rod; three in a chain; two that a ball joint and a lock make one body."""
    kind = str(rng.choice(["ball", "rod", "chain", "clump"]))
    drift = rng.normal(size=3) * rng.choice([0, 0.5, 1.5])
    spin = rng.normal(size=3) * rng.choice([0, 5.0])
    along = rng.normal(size=3)
    along /= np.linalg.norm(along)
    half = RADIUS * along * float(rng.choice([1.0, 1.5, 2.5]))
    across = np.cross(along, [0.0, 0.0, 1.0])
    across *= 0.045 / np.linalg.norm(across)
    places = {
        "ball": [0 * half],
        "rod": [half, -half],
        "chain": [half, -half, half + across],
        "clump": [half, -half],
    }
    names = [f"{letter}{k}" for letter in "abc"]
    for name, place in zip(names, places[kind], strict=False):
        turning = spin.tolist() if kind == "clump" else (0, 0, 0)
        where, speed = (middle + place).tolist(), (drift + np.cross(spin, place)).tolist()
        made.sphere(name, radius=RADIUS, mass=float(rng.uniform(0.02, 0.2)), material="ball", position=where,
                    velocity=speed, angular_velocity=turning)  # fmt: skip
    a, b, c = names
    if kind in ("rod", "chain"):
        made.joint("rod", between=[a, b])
    if kind == "chain":
        made.joint("rod", between=[a, c])
    if kind == "clump":
        made.joint("ball", between=[a, b], point=middle.tolist())
        made.joint("lock", between=[a, b])
