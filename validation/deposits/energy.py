"""How much energy ordinary deposits gain in a step: spheres of many sizes settle in a box that is periodic in x and y.

    python validation/deposits/energy.py            # 48 runs, 3 minutes; exit code 1 if one leaves the range of the page
    python validation/deposits/energy.py --grains 1500 --seeds 1 --friction 1.5 3 10    # most contacts stick

Nothing works on the grains, so every rise of the total is an error: of the solver, whose residual is `pile_tolerance`, and
of the step. It is told over the largest kinetic energy plus the sum of m g r (`energy.max_rise_relative`).
"""

from __future__ import annotations

import argparse
import math
import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from common import table

#: Diameters, the side of the box, m; the run, s.
SMALLEST, LARGEST, SIDE, UNTIL, STEP = 0.006, 0.014, 0.08, 0.5, 1e-3
FRICTION = (0.0, 0.3, 0.6, 1.0)
TOLERANCES = (1e-4, 1e-3)
#: Volume of the grains over that of the region in which they start: they fall, or settle where they are.
STARTS = (0.3, 0.55)
#: What `docs/guides/diagnostics.md` says of them.
MOST = 1e-4


def deposit(
    friction: float,
    tolerance: float,
    start: float,
    seed: int = 1,
    grains: int = 400,
    restitution: float = 0.3,
) -> carom.Scene:
    """`grains` spheres of diameters from `SMALLEST` to `LARGEST` over a floor."""
    mean_cube = (LARGEST**4 - SMALLEST**4) / (4.0 * (LARGEST - SMALLEST))
    height = grains * math.pi / 6.0 * mean_cube / (start * SIDE**2)
    scene = carom.Scene(
        "a deposit",
        periodic=(SIDE, SIDE, 0),
        run={"until": UNTIL, "step": STEP, "pile_tolerance": tolerance},
        record={"every": 500, "impacts": False, "contacts": False},
    )
    scene.contact("grain", "grain", friction=friction, restitution=restitution)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.packing(
        "grain", material="grain", density=2500, seed=seed, count=grains, sizes="uniform", smallest=SMALLEST,
        largest=LARGEST, low=(0, 0, 0), high=(SIDE, SIDE, height), periodic="xy",
    )  # fmt: skip
    return scene


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=400)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--friction", type=float, nargs="+", default=FRICTION)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    rows, every = [], []
    for tolerance in TOLERANCES:
        for start in STARTS:
            for friction in options.friction:
                found = []
                for seed in range(1, options.seeds + 1):
                    scene = deposit(friction, tolerance, start, seed, options.grains)
                    found.append(carom.simulate(scene).summary["energy"]["max_rise_relative"])
                every += found
                rows.append([f"{tolerance:g}", f"{start:g}", f"{friction:g}", *(f"{x:.1e}" for x in found)])
                print(*rows[-1], file=sys.stderr, flush=True)
    print(table(["pile_tolerance", "start", "mu", *(f"seed {k + 1}" for k in range(options.seeds))], rows))
    print(f"\nlargest rise in a step: from {min(every):.1e} to {max(every):.1e}")
    return int(max(every) > MOST)


if __name__ == "__main__":
    sys.exit(main())
