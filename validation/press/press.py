"""A free wall holds its pressure: grains of 2 mm between a floor and a lid, periodic across, without gravity.

    python validation/press/press.py                           # 200 grains, friction 0, 0.1, 0.3 and 0.5
    python validation/press/press.py --grains 400 --until 0.2

The pressure is 1 kPa up to half of the time, then 2 kPa. Both are held if the means over the last fifth of each
part are within 1 % of them, on lid and floor. Exit code 1 if not.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from common import table

RADIUS, DENSITY = 1e-3, 2500.0
PRESSURES = (1000.0, 2000.0)


def scene(grains: int, friction: float, until: float, seed: int) -> carom.Scene:
    """Loose grains, and a lid of a tenth of their mass."""
    volume = grains * 4.0 / 3.0 * np.pi * RADIUS**3
    side = 14.0 * RADIUS * (grains / 400.0) ** (1 / 3)
    high = volume / 0.42 / side**2
    found = carom.Scene(f"pressed, friction {friction:g}")
    found.world.gravity = (0.0, 0.0, 0.0)
    found.world.periodic = (side, side, 0.0)
    found.material("glass")
    found.contact("glass", "glass", friction=friction, restitution=0.3)
    found.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="glass")
    law = {"table": [[0.0, PRESSURES[0]], [0.5 * until, PRESSURES[0]], [0.5 * until + 1e-3, PRESSURES[1]]]}
    free = {"mass": 0.1 * volume * DENSITY, "pressure": law, "area": side**2}
    found.plane("lid", point=(0, 0, high), normal=(0, 0, -1), material="glass", free=free)
    found.packing("grain", material="glass", density=DENSITY, seed=seed, count=grains, diameter=2 * RADIUS,
                  low=(0, 0, 0), high=(side, side, high), periodic="xy")  # fmt: skip
    return found


def row(grains: int, friction: float, until: float, step: float, seed: int) -> tuple[list[str], float]:
    """A row of the table, and by how much a pressure is off."""
    made = scene(grains, friction, until, seed)
    start = time.perf_counter()
    result = carom.simulate(made, step=step, until=until, every=max(1, round(1e-3 / step)),
                            impact="one-shot", pile_tolerance=1e-4)  # fmt: skip
    seconds = time.perf_counter() - start
    area = float(np.prod(made.world.periodic[:2]))
    times, lid = np.asarray(result.time), result.walls["lid"]
    cells, worst = [], 0.0
    for half, pressure in enumerate(PRESSURES):
        end = 0.5 * until * (half + 1)
        late = (times > end - 0.1 * until) & (times < end + 1e-9)
        for wall, sign in ((lid, 1.0), (result.walls["floor"], -1.0)):
            found = sign * wall.force[late, 2] / area
            worst = max(worst, abs(found.mean() / pressure - 1.0))
            cells.append(f"{found.mean():.1f} +- {found.std():.1f}")
        solid = grains * 4.0 / 3.0 * np.pi * RADIUS**3 / area / lid.position[late, 2]
        cells.append(f"{solid[-1]:.4f}")
    summary = result.summary
    counts = [str(summary[key]) for key in ("unconverged", "fallbacks", "halvings")]
    rise = summary["energy"]["max_rise_relative"]
    return [f"{friction:g}", *cells, *counts, f"{rise:.0e}", f"{seconds:.0f}"], worst


def main() -> int:
    """Prints a row for each coefficient of friction."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--grains", type=int, default=200)
    parser.add_argument("--friction", type=float, nargs="+", default=[0.0, 0.1, 0.3, 0.5])
    parser.add_argument("--until", type=float, default=0.1, help="s")
    parser.add_argument("--step", type=float, default=1e-4, help="s")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rows, worst = [], 0.0
    for friction in args.friction:
        cells, off = row(args.grains, friction, args.until, args.step, args.seed)
        rows.append(cells)
        worst = max(worst, off)
    names = ["friction", "lid, Pa", "floor, Pa", "solid", "lid, Pa", "floor, Pa", "solid",
             "unconverged", "fallbacks", "halvings", "rise", "s"]  # fmt: skip
    print(table(names, rows))
    print(f"a pressure is off by at most {100.0 * worst:.2f} %")
    return int(worst > 0.01)


if __name__ == "__main__":
    sys.exit(main())
