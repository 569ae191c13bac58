"""Random scenes of every feature at once: loose balls, balls that joints of every type hold, springs and drag, walls that
rest, shake, convey or turn, balls that enter and leave, and worlds that repeat themselves.
"""

from __future__ import annotations

from typing import Any

import audit_random
import carom
import numpy as np
from numpy.typing import NDArray

UNTIL = 0.25
"""Duration, s."""
RADIUS = 0.02
PERIOD = 0.4


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run."""
    rng = np.random.default_rng([seed, 28])

    def often(share: float) -> bool:
        return bool(rng.random() < share)

    method = str(rng.choice(["nsga", "nsga", "nsga", "moreau", "penalty"]))
    world = {"periodic": (PERIOD, PERIOD, 0)} if often(0.25) else {}
    made = carom.Scene(gravity=(0, 0, -9.8 if often(0.8) else 0.0), **world)
    for other in ("ball", "wall"):
        made.contact("ball", other, friction=float(rng.choice([0, 0.3, 0.8])), restitution=float(rng.choice([0, 0.5, 1])),
                     rolling_radius=float(rng.choice([0, 0, 1e-3])), spinning_radius=float(rng.choice([0, 0, 1e-3])),
                     tangential_restitution=float(rng.choice([0, 0, 0.5])) if method != "penalty" else 0.0)  # fmt: skip
    _floor(made, rng, often, bool(world))
    for k in range(int(rng.integers(1, 5))):
        middle = np.array([0.1 * (k % 2) - 0.05, 0.1 * (k // 2) - 0.05, float(rng.uniform(0.06, 0.12))])
        _cluster(made, rng, often, k, middle, method)
    audit_random._loads(made, rng, often)
    if often(0.25):
        made.inflow("rain", material="ball", count=4, radius=0.01, density=2500, rate=40, velocity=(0, 0, -1), seed=seed,
                    region={"low": [-0.1, -0.1, 0.25], "high": [0.1, 0.1, 0.25]})  # fmt: skip
        made.outlet(low=[-1, -1, -1], high=[1, 1, -0.1])
    options = {
        "method": method,
        "every": int(rng.choice([1, 1, 3])),
        "step": float(rng.choice([1e-3, 5e-4, 2e-3])),
    }
    return made, options


def _floor(made: carom.Scene, rng: np.random.Generator, often: Any, periodic: bool) -> None:
    motion: dict[str, Any] = {}
    if often(0.3):
        motion["translation"] = [0, 0, {"expression": f"0.002*sin({rng.choice([20, 60])}*t)"}]
    if often(0.25):
        motion["surface_velocity"] = [0.3, 0, 0]
    given: dict[str, Any] = {"motion": motion} if motion else {}
    normal = (0.0 if periodic else float(rng.choice([0, 0.2])), 0, 1)
    if often(0.3) and not periodic:
        given["size"] = (0.3, 0.3)
    made.plane("floor", point=(0, 0, 0), normal=normal, material="wall", **given)


def _cluster(
    made: carom.Scene, rng: np.random.Generator, often: Any, k: int, middle: NDArray[np.float64], method: str
) -> None:
    """One ball, or one with a joint to the ground; two with a rod, or as one body; three in a chain of either."""
    kinds = ["ball", "ball", "rod", "pair", "clump", "chain", "fix", "line", "plane", "turned", "moved"]
    kind = str(rng.choice(kinds)) if method != "penalty" else "ball"  # which knows no joints
    drift, spin = (
        rng.normal(size=3) * rng.choice([0, 0.5, 1.5]),
        rng.normal(size=3) * rng.choice([0, 5.0, 20.0]),
    )
    along = rng.normal(size=3) * [1, 1, 0.3]
    along *= RADIUS * float(rng.choice([1.000001, 1.3, 1.8])) / np.linalg.norm(along)
    across = np.cross(along, [0.0, 0.0, 1.0])
    across *= 2.0 * np.linalg.norm(along) / np.linalg.norm(across)
    places = {
        "rod": [along, -along],
        "pair": [along, -along],
        "clump": [along, -along],
        "chain": [along, -along, across - along],
    }
    a, b, c = (f"{letter}{k}" for letter in "abc")
    if kind in ("fix", "line", "plane", "moved"):
        drift, spin = 0.0 * drift, (spin if kind == "fix" else 0.0 * spin)
    if kind == "turned":
        spin = np.zeros(3)
    mine = places.get(kind, [0 * along])
    met = [np.linalg.norm(middle + x - ball.position) for x in mine for ball in made.spheres]
    if min(met, default=1.0) < 2.0 * RADIUS:
        return
    for name, place in zip((a, b, c), mine, strict=False):
        speed = drift + np.cross(spin, place) * (kind != "fix")
        made.sphere(name, radius=RADIUS, mass=float(rng.uniform(0.02, 0.2)), material="ball", position=middle + place,
                    velocity=speed, angular_velocity=spin * (kind in ("pair", "clump", "chain", "fix", "ball")))  # fmt: skip
    if kind == "rod":
        made.joint("rod", between=[a, b])
    if kind in ("pair", "clump", "chain"):
        made.joint("ball", between=[a, b], point=middle)
    if kind == "clump":
        made.joint("lock", between=[a, b])
    if kind == "chain":
        made.joint("ball", between=[b, c], point=middle - along + 0.5 * across)
    if kind == "fix":
        made.joint("fix", body=a, point=middle)
    if kind == "line":
        made.joint("line", body=a, direction=(1, 0, -0.2))
    if kind == "plane":
        made.joint("plane", body=a, normal=(0.2, 1, 0))
    if kind == "turned":
        made.joint(
            "motion", body=a, axis=(0, 0, 1), angle={"polynomial": [0, 0, float(rng.choice([10, 60]))]}
        )
    if kind == "moved":
        w = float(rng.choice([10, 40]))
        made.joint("motion", body=a, direction=(1, 0, 0), displacement={"expression": f"0.01*(1-cos({w}*t))"})
