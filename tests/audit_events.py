"""Random scenes of method `events`: balls slide, roll, spin and bounce on a table with cushions and a pocket, or fly."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np

UNTIL = 0.8
"""Duration, s."""
WIDE = 0.5
"""Half of the table, m."""


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run."""
    rng = np.random.default_rng([seed, 5])

    def often(share: float) -> bool:
        return bool(rng.random() < share)

    made = carom.Scene(gravity=(0, 0, -9.8 if often(0.9) else 0.0))
    for other, e in (("ball", [0.5, 0.95, 1.0]), ("bed", [0.0, 0.5, 0.9]), ("rail", [0.3, 0.85, 1.0])):
        made.contact("ball", other, friction=float(rng.choice([0.0, 0.06, 0.2])), restitution=float(rng.choice(e)),
                     tangential_restitution=float(rng.choice([0.0, 0.0, 0.4])),
                     rolling_radius=float(rng.choice([0.0, 0.0, 2e-4])),
                     spinning_radius=float(rng.choice([0.0, 0.0, 5e-4])))  # fmt: skip
    size = {"size": (2.0 * WIDE, 2.0 * WIDE)} if often(0.2) else {}
    made.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed", **size)
    if often(0.7):
        for k, (x, y) in enumerate([(1, 0), (-1, 0), (0, 1), (0, -1)]):
            made.plane(f"rail{k}", point=(x * WIDE, y * WIDE, 0), normal=(-x, -y, 0), material="rail")
    if often(0.3):
        made.cylinder("post", point=(0.1, 0.1, 0), axis=(0, 0, 1), radius=0.03, material="rail", inside=False)
    if often(0.3):
        made.outlet(low=(0.3, 0.3, -1), high=(0.5, 0.5, 1))
    placed: list[tuple[Any, float]] = []
    for k in range(int(rng.integers(1, 7))):
        r = 0.03 if often(0.6) else float(rng.uniform(0.015, 0.03))
        for _ in range(200):
            x = np.array([*rng.uniform(-0.4, 0.4, 2), r if often(0.7) else rng.uniform(0.04, 0.2)])
            if placed and often(0.3):
                beside, other = placed[rng.integers(len(placed))]
                angle = rng.uniform(0, 2 * np.pi)
                apart = (r + other) ** 2 - (r - beside[2]) ** 2
                x = beside + np.sqrt(max(apart, 0.0)) * np.array([np.cos(angle), np.sin(angle), 0.0])
                x[2] = r
            gaps = [np.linalg.norm(x - y) - r - s for y, s in placed]
            inside = np.abs(x[:2]).max() < WIDE - r and np.hypot(x[0] - 0.1, x[1] - 0.1) > 0.03 + r
            if inside and min(gaps, default=1.0) > -1e-12:
                placed.append((x, r))
                speed = float(rng.choice([0.0, 0.3, 2.0]))
                v = speed * rng.normal(size=3) * [1, 1, 0 if x[2] == r and often(0.8) else 1]
                if x[2] == r:
                    v[2] = abs(v[2])
                spin = float(rng.choice([0.0, 10.0, 60.0])) * rng.normal(size=3)
                made.sphere(f"b{k}", radius=r, mass=float(rng.uniform(0.1, 0.2)), material="ball", position=x.tolist(),
                            velocity=v.tolist(), angular_velocity=spin.tolist())  # fmt: skip
                break
    _more(made, [(x.tolist(), r) for x, r in placed], np.random.default_rng([seed, 6]))
    options = {
        "method": "events",
        "every": int(rng.choice([1, 1, 4])),
        "step": float(rng.choice([1e-3, 1e-2, 5e-2])),
        "impact": str(rng.choice(["sequence", "sequence", "one-shot"])),
    }
    return made, options


def _more(made: carom.Scene, placed: list[tuple[list[float], float]], rng: np.random.Generator) -> None:
    """A tight rack that a ball hits, and balls frozen to a rail that run along it, where there is room."""
    r = 0.03
    balls: list[tuple[tuple[float, float, float], tuple[float, float, float]]] = []
    if rng.random() < 0.4:
        rows, way = int(rng.integers(3, 6)), rng.uniform(-0.4, 0.4)
        balls += [
            ((-0.2 + np.sqrt(3) * r * row, (2 * k - row) * r - 0.15, r), (0.0, 0.0, 0.0))
            for row in range(rows)
            for k in range(row + 1)
        ]
        balls.append(((-0.35, -0.15 + way * r, r), (float(rng.choice([0.5, 3.0])), 0.0, 0.0)))
    if rng.random() < 0.3:
        balls.append(((-0.3, WIDE - r, r), (float(rng.choice([0.5, 3.0])), 0.0, 0.0)))
    for number, (x, v) in enumerate(balls):
        if all(np.linalg.norm(np.subtract(x, y)) > r + s for y, s in placed):
            made.sphere(f"more{number}", radius=r, mass=0.17, material="ball", position=x, velocity=v)
