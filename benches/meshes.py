"""What walls of triangles cost: grains that fall onto a floor that is a plane, and onto the same floor of triangles.

    python benches/meshes.py [--grains 100000] [--triangles 100000] [--steps 60] [--repetitions 3]

Both run turn by turn. Times are CPU time of the core for all steps; the ratio is that of the medians. The last positions
are compared too: where the floor is flat they differ by what the solver leaves.
"""

from __future__ import annotations

import argparse
import math
import statistics
import warnings

import carom
import numpy as np

R = 1e-3


def floor(n: int, length: float) -> tuple[np.ndarray, np.ndarray]:
    """A square of `2 n^2` triangles, about the origin."""
    x = np.linspace(-0.5 * length, 0.5 * length, n + 1)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a, b, c, d = (p * (n + 1) + q for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.c_[grid, np.zeros(len(grid))], triangles


def scene(grains: int, triangles: int) -> carom.Scene:
    """Ten layers of grains, a little apart, that fall."""
    side = max(1, math.ceil(math.sqrt(grains / 10)))
    length = 2.3 * R * side
    made = carom.Scene(gravity=(0, 0, -9.81))
    for other in ("grain", "wall"):
        made.contact("grain", other, friction=0.4, restitution=0.3)
    low, high = (-0.5 * length, -0.5 * length, 0.0), (0.5 * length, 0.5 * length, 1.0)
    made.box("sides", low=low, high=high, open=["low_z", "high_z"], material="wall")
    made.lattice("g", material="grain", radius=R, density=2500, counts=(side, side, 10), spacing=2.2 * R, seed=1,
                 origin=(-1.1 * R * (side - 1), -1.1 * R * (side - 1), 1.1 * R), jitter=0.05 * R)  # fmt: skip
    if triangles:
        points, corners = floor(max(1, round(math.sqrt(triangles / 2))), 1.01 * length)
        made.mesh("floor", vertices=points, triangles=corners, material="wall")
    else:
        made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    return made


def main() -> None:
    """Prints the times and their ratio."""
    parser = argparse.ArgumentParser(description="Walls of triangles against planes.")
    parser.add_argument("--grains", type=int, default=100_000)
    parser.add_argument("--triangles", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--repetitions", type=int, default=3)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    times: dict[str, list[float]] = {"plane": [], "mesh": []}
    last = {}
    for _ in range(args.repetitions):
        for name, triangles in (("plane", 0), ("mesh", args.triangles)):
            result = carom.simulate(
                scene(args.grains, triangles), until=args.steps * 2e-4, step=2e-4, every=args.steps,
                contacts=False, impacts=False, pile_tolerance=1e-5,
            )  # fmt: skip
            times[name].append(result.summary["core_s"])
            last[name] = np.asarray(result.position[-1])
            result.close()
    for name, found in times.items():
        print(f"{name:6} {statistics.median(found):8.2f} s   {min(found):8.2f} to {max(found):.2f} s")
    print(f"ratio  {statistics.median(times['mesh']) / statistics.median(times['plane']):8.2f}")
    print(f"largest difference of positions {np.abs(last['mesh'] - last['plane']).max() / R:.1e} radii")


if __name__ == "__main__":
    main()
