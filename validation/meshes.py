"""Walls of triangles against the walls that they stand for: planes, boxes, tubes and cones.

    python validation/meshes.py     # a minute; exit code 1 if a flat one differs by more than rounding

Flat meshes have to give what planes give. Round ones give it as their sides grow many; `order` is that of the error in the
number of sides, against the line before.
"""

from __future__ import annotations

import math
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import carom
from common import table
from meshes import box, floor, revolved

R = 0.01  # m
FLAT = 1e-9
"""Difference over the radius (1) of flat meshes that is rounding, or what solvers leave."""


def scene(mu: float, e: float) -> carom.Scene:
    """Gravity and one law."""
    made = carom.Scene(gravity=(0, 0, -9.8))
    for other in ("ball", "wall"):
        made.contact("ball", other, friction=mu, restitution=e)
    return made


def ball(
    made: carom.Scene, at: tuple[float, ...], velocity: tuple[float, ...] = (0, 0, 0), **more: object
) -> None:
    made.sphere(
        f"b{len(made.names)}", radius=R, density=2500, material="ball", at=at, velocity=velocity, **more
    )


def rolls(n: int) -> float:
    """Change of the velocity (m/s) of a ball that rolls at 1 m/s over `2 n^2` triangles of one plane."""
    made = scene(0.4, 0.5)
    ball(made, (-0.45, 0.013, R), (1.0, 0.2, 0.0), angular_velocity=(-0.2 / R, 1.0 / R, 0.0))
    points, triangles = floor(n, seed=n)
    made.mesh("floor", vertices=points - [0.5, 0.5, 0.0], triangles=triangles, material="wall")
    result = carom.simulate(made, until=0.9, step=1e-3)
    return float(np.abs(np.asarray(result.velocity) - [1.0, 0.2, 0.0]).max())


def crate(mesh: bool) -> np.ndarray:
    """Places of twelve balls thrown about in a box, in 0.25 s."""
    made = scene(0.3, 0.6)
    rng = np.random.default_rng(1)
    for k in range(12):
        at = (0.04 * (k % 3 - 1), 0.04 * (k // 3 % 2) - 0.02, 0.03 + 0.04 * (k // 6))
        ball(made, at, tuple(rng.uniform(-1, 1, 3).tolist()))
    low, high = (-0.1, -0.08, 0.0), (0.1, 0.08, 0.2)
    if mesh:
        points, triangles = box(low, high)
        made.mesh("box", vertices=points, triangles=triangles, material="wall")
    else:
        made.box("box", low=low, high=high, material="wall")
    return np.asarray(carom.simulate(made, until=0.25, step=5e-4).position)


def rounded(kind: str, sides: int) -> np.ndarray:
    """Places of a ball that slides, without friction, in a trough or around in a funnel; of a smooth one for 0 sides."""
    made = scene(0.0, 0.0)
    half = math.sqrt(0.5)
    wide = 1.0 / math.cos(math.pi / sides) if sides else 1.0  # around the circle
    if kind == "cylinder":
        ball(made, (0.09 * math.sin(0.3), 0.0, -0.09 * math.cos(0.3)))
        profile, turn = [(0.1, -0.5), (0.1, 0.5)], (half, half, 0.0, 0.0)
        if not sides:
            made.cylinder("w", point=(0, 0, 0), axis=(0, 1, 0), radius=0.1, material="wall")
    else:
        # On a circle at the speed at which gravity holds it.
        ball(made, (0.1, 0.0, 0.1 + R * half * 2), (0.0, math.sqrt(9.8 * 0.1), 0.0))
        profile, turn = [(0.02, 0.02), (0.3, 0.3)], (1.0, 0.0, 0.0, 0.0)
        if not sides:
            made.cone(
                "w",
                point=(0, 0, 0.02),
                axis=(0, 0, 1),
                radius=0.02,
                radius_end=0.3,
                length=0.28,
                material="wall",
            )
    if sides:
        points, triangles = revolved(profile, sides)
        made.mesh(
            "w", vertices=points * [wide, wide, 1.0], triangles=triangles, orientation=turn, material="wall"
        )
    return np.asarray(carom.simulate(made, until=0.1, step=2e-4).position)


def main() -> int:
    """Prints what differs."""
    warnings.simplefilter("ignore")
    worst, rows = 0.0, []
    for n in (10, 71):
        off = rolls(n)
        worst = max(worst, off)
        rows.append(
            [f"rolls over {2 * n * n} triangles of a plane", "change of its velocity", f"{off:.1e} m/s"]
        )
    off = float(np.abs(crate(True) - crate(False)).max()) / R
    worst = max(worst, off)
    rows.append(["12 balls in a box of 12 triangles", "places against the box of planes", f"{off:.1e} radii"])
    print(table(["scene", "what", "found"], rows))
    rows = []
    for kind in ("cylinder", "cone"):
        smooth, last = rounded(kind, 0), math.nan
        for sides in (16, 64, 256, 1024):
            off = float(np.abs(rounded(kind, sides) - smooth).max()) / R
            rows.append(
                [kind, str(sides), f"{off:.2e}", f"{math.log(last / off, 4):.1f}" if last == last else ""]
            )
            last = off
    print(table(["wall", "sides", "largest difference, radii", "order"], rows))
    return int(worst > FLAT)


if __name__ == "__main__":
    sys.exit(main())
