"""Random drops of 20 to 100 balls over 1000 steps: not one may fail.

    python validation/drops/drops.py                             # twenty, some 20 s
    python validation/drops/drops.py --drops 200 --seed 100
    python validation/drops/drops.py --tolerance 1e-7            # the default of the option: minutes
    python validation/drops/drops.py --narrow --drops 500        # balls that wedge one another: minutes

Balls of radii from r to 2 r and of any density, with any friction, restitution, velocities and spins, fall into an
open box that is two to six of the largest diameters wide: narrow towers and flat layers. A drop has failed if its run
ended before its last step, if a sub-problem of a step was not solved to its tolerance, or if the energy rose by a
thousandth of what there was in a step. Exit code 1 if one has. What is no failure is counted beside it: steps made in
parts, solves that other solvers had to end, impact sequences that were cut short; overlap over the radius, and the
largest rise of the energy in a step over the energy that there was.

With `--narrow` 4 to 17 balls fall into towers one or two of them wide, with friction of 0.6 and more, in 300 steps of
2 ms and at the default tolerance. Most get stuck, and the energy may rise: an error of first order in the step (decision
record 015), shown and no failure.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from carom.run.loop import advance, begin
from common import table

RADIUS = 5e-3


@dataclass(frozen=True)
class Kind:
    """What is drawn, and what must hold."""

    steps: int
    step: float
    """s."""
    balls: tuple[int, int]
    rows: tuple[int, int]
    """Balls beside one another, the second exclusive."""
    friction: float
    """The least."""
    most_rise: float
    tolerance: float
    """`pile_tolerance`; that of granular scenes, or the default."""


WIDE = Kind(1000, 1e-3, (20, 100), (2, 6), 0.0, 1e-3, 1e-4)
NARROW = Kind(300, 2e-3, (4, 17), (1, 3), 0.6, np.inf, 1e-7)


def scene(balls: int, seed: int, kind: Kind = WIDE, **options: Any) -> carom.Scene:
    """A drop."""
    rng = np.random.default_rng([56, seed])
    radii = rng.uniform(RADIUS, 2 * RADIUS, balls)
    cell = 2.05 * float(radii.max())
    row = int(rng.integers(*kind.rows))
    side = cell * (row + rng.uniform(0.0, 1.0))
    drop = carom.Scene(
        f"drop {seed} of {balls} balls", gravity=(0, 0, -9.81), run={"step": kind.step, **options}
    )
    friction, restitution = rng.uniform(kind.friction, 1.0), rng.uniform(0.0, 0.9)
    drop.contact("ball", "ball", friction=friction, restitution=restitution)
    drop.contact("ball", "wall", friction=rng.uniform(kind.friction, 1.0), restitution=rng.uniform(0.0, 0.9))
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


def drop(balls: int, seed: int, kind: Kind = WIDE, **options: Any) -> dict[str, Any]:
    """One drop to its last step, or as far as it comes."""
    simulation = begin(scene(balls, seed, kind, **options).to_model())
    start = time.process_time()
    ending = advance(simulation, kind.steps, 0, [])
    m = simulation.monitors()
    return {
        "balls": balls,
        "seed": seed,
        "steps": int(simulation.step),
        "outcome": None if ending.kind == "done" else str(ending.outcome),
        "unconverged": int(m["unconverged"]),
        "fallbacks": int(m["fallbacks"]),
        "truncated": int(m["truncated_sequences"]),
        "halvings": int(m["halvings"]),
        "overlap": float(m["penetration_max_relative"]),
        "rise": float(m["energy"]["max_rise_relative"]),
        "cpu_s": time.process_time() - start,
    }


def failed(found: dict[str, Any], kind: Kind = WIDE) -> bool:
    """Whether a drop has."""
    unsolved = found["outcome"] is not None or found["steps"] < kind.steps or found["unconverged"] > 0
    return unsolved or found["rise"] > kind.most_rise


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--drops", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1, help="of the first drop")
    parser.add_argument("--narrow", action="store_true", help="few balls in narrow rough towers")
    parser.add_argument(
        "--tolerance",
        type=float,
        help=f"pile_tolerance; {WIDE.tolerance:g}, that of granular scenes, or with --narrow {NARROW.tolerance:g}",
    )
    parser.add_argument(
        "--position-friction", choices=("paper", "once"), help="whether loads are solved once"
    )
    parser.add_argument("--json", action="store_true", help="one JSON document instead of the table")
    given = parser.parse_args()
    kind = NARROW if given.narrow else WIDE
    tolerance = kind.tolerance if given.tolerance is None else given.tolerance
    sizes = np.linspace(*kind.balls, given.drops).round().astype(int).tolist()
    options: dict[str, Any] = {"pile_tolerance": tolerance}
    if given.position_friction:
        options["position_friction"] = given.position_friction
    drops = [drop(n, given.seed + k, kind, **options) for k, n in enumerate(sizes)]
    failures = sum(failed(d, kind) for d in drops)
    if given.json:
        print(json.dumps({"drops": drops, "failed": failures}, indent=2))
        return int(failures > 0)
    columns = [c for c in drops[0] if c != "outcome"]
    cells = [[f"{d[c]:.1e}" if c in ("overlap", "rise") else f"{d[c]:.4g}" for c in columns] for d in drops]
    print(table(columns, cells))
    for d in drops:
        if failed(d, kind):
            why = d["outcome"] or ("unconverged" if d["unconverged"] else "energy")
            print(f"drop {d['seed']} of {d['balls']} balls failed: {why}")
    print(f"{len(drops)} drops, {failures} failed")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
