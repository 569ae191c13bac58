"""Wet heaps are steeper than dry ones: the angle of poured heaps over the Bond number, cohesion over the weight of a grain.

    python validation/heap/cohesion.py                  # 500 grains, two seeds, Bond numbers 0, 1 and 3
    python validation/heap/cohesion.py --bonds 0 1 3 10 30

Exit code 1 if a heap of a higher Bond number is not steeper.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from carom import granular
from common import table

SCENE = Path(__file__).parent / "poured.toml"
LAST = 1.0  # s


def angle(grains: int, seed: int, bond: float) -> tuple[float, carom.Result]:
    """Of the mean over the last second, degrees."""
    result = carom.simulate(SCENE, parameters={"seed": seed, "N": grains, "bond": bond})
    times = np.asarray(result.time)
    frames = np.flatnonzero(times >= times[-1] - LAST - 1e-9)
    found = [granular.heap_angle(result, int(k), centre=(0.0, 0.0, 0.0)).degrees for k in frames]
    return float(np.mean(found)), result


def main() -> int:
    """Prints a row for each Bond number."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--grains", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--bonds", type=float, nargs="+", default=[0.0, 1.0, 3.0])
    args = parser.parse_args()
    rows, means = [], []
    for bond in args.bonds:
        found = [angle(args.grains, seed, bond) for seed in range(1, args.seeds + 1)]
        angles = [degrees for degrees, _ in found]
        counts = [sum(r.summary[key] for _, r in found) for key in ("unconverged", "fallbacks", "halvings")]
        deepest = max(r.summary["penetration_max_relative"] for _, r in found)
        means.append(float(np.mean(angles)))
        spread = ", ".join(f"{degrees:.1f}" for degrees in angles)
        rows.append([f"{bond:g}", f"{means[-1]:.1f}", spread, *map(str, counts), f"{deepest:.1e}"])
    names = ["Bond number", "angle, degrees", "by seed", "unconverged", "fallbacks", "halvings", "overlap"]
    print(table(names, rows))
    return int(bool(np.any(np.diff(means) <= 0.0)))


if __name__ == "__main__":
    sys.exit(main())
