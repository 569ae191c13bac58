"""Random drops of 20 to 100 balls over 1000 steps: not one may fail.

    python validation/drops/drops.py                             # twenty, some 20 s
    python validation/drops/drops.py --drops 200 --seed 100
    python validation/drops/drops.py --tolerance 1e-7            # the default of the option: minutes

Balls of radii from r to 2 r and of any density, with any friction, restitution, velocities and spins, fall into an
open box that is two to six of the largest diameters wide: narrow towers and flat layers. A drop has failed if its run
ended before its last step, if a sub-problem of a step was not solved to its tolerance, or if the energy rose by a thousandth
of what there was in a step. Exit code 1 if one has. What
is no failure is counted beside it: steps made in parts, solves that other solvers had to end, impact sequences that
were cut short; overlap over the radius, and the largest rise of the energy in a step over the energy that there was.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from carom import _core
from common import table

STEPS, STEP = 1000, 1e-3
LEAST, MOST = 20, 100
RADIUS = 5e-3
MOST_RISE = 1e-3


def scene(balls: int, seed: int, **options: Any) -> carom.Scene:
    """A drop."""
    rng = np.random.default_rng([56, seed])
    radii = rng.uniform(RADIUS, 2 * RADIUS, balls)
    cell = 2.05 * float(radii.max())
    row = int(rng.integers(2, 6))
    side = cell * (row + rng.uniform(0.0, 1.0))
    drop = carom.Scene(f"drop {seed} of {balls} balls", gravity=(0, 0, -9.81), run={"step": STEP, **options})
    friction, restitution = rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.9)
    drop.contact("ball", "ball", friction=friction, restitution=restitution)
    drop.contact("ball", "wall", friction=rng.uniform(0.0, 1.0), restitution=rng.uniform(0.0, 0.9))
    walls = {
        "floor": ((0, 0, 0), (0, 0, 1)),
        "left": ((0, 0, 0), (1, 0, 0)),
        "right": ((side, 0, 0), (-1, 0, 0)),
        "front": ((0, 0, 0), (0, 1, 0)),
        "back": ((0, side, 0), (0, -1, 0)),
    }
    for name, (point, normal) in walls.items():
        drop.plane(name, point=point, normal=normal, material="wall")
    for k, radius in enumerate(radii):
        at = np.array([k % row, k // row % row, k // row**2]) + 0.5
        room = 0.5 * cell - radius
        drop.sphere(
            f"b{k}",
            radius=radius,
            density=rng.uniform(1000.0, 8000.0),
            material="ball",
            position=at * cell + rng.uniform(-room, room, 3) + np.array([0.0, 0.0, rng.uniform(0.0, 1e-4)]),
            velocity=rng.normal(0.0, 0.5, 3),
            angular_velocity=rng.normal(0.0, 20.0, 3),
        )
    return drop


def drop(balls: int, seed: int, **options: Any) -> dict[str, Any]:
    """One drop to its last step, or as far as it comes."""
    simulation = _core.Simulation(scene(balls, seed, **options).to_model())
    begin = time.process_time()
    outcome = simulation.advance(STEPS, 0, False, 1e9)["outcome"]
    m = simulation.monitors()
    return {
        "balls": balls,
        "seed": seed,
        "steps": int(simulation.step),
        "outcome": None if outcome is None else str(outcome),
        "unconverged": int(m["unconverged"]),
        "fallbacks": int(m["fallbacks"]),
        "truncated": int(m["truncated_sequences"]),
        "halvings": int(m["halvings"]),
        "overlap": float(m["penetration_max_relative"]),
        "rise": float(m["energy"]["max_rise_relative"]),
        "cpu_s": time.process_time() - begin,
    }


def failed(found: dict[str, Any]) -> bool:
    """Whether a drop has."""
    unsolved = found["outcome"] is not None or found["steps"] < STEPS or found["unconverged"] > 0
    return unsolved or found["rise"] > MOST_RISE


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--drops", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1, help="of the first drop")
    parser.add_argument(
        "--tolerance", type=float, default=1e-4, help="pile_tolerance; that of granular scenes"
    )
    parser.add_argument("--json", action="store_true", help="one JSON document instead of the table")
    given = parser.parse_args()
    sizes = np.linspace(LEAST, MOST, given.drops).round().astype(int).tolist()
    drops = [drop(n, given.seed + k, pile_tolerance=given.tolerance) for k, n in enumerate(sizes)]
    failures = sum(failed(d) for d in drops)
    if given.json:
        print(json.dumps({"drops": drops, "failed": failures}, indent=2))
        return int(failures > 0)
    columns = [c for c in drops[0] if c != "outcome"]
    cells = [[f"{d[c]:.1e}" if c in ("overlap", "rise") else f"{d[c]:.4g}" for c in columns] for d in drops]
    print(table(columns, cells))
    for d in drops:
        if failed(d):
            why = d["outcome"] or ("unconverged" if d["unconverged"] else "energy")
            print(f"drop {d['seed']} of {d['balls']} balls failed: {why}")
    print(f"{len(drops)} drops, {failures} failed")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
