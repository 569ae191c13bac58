"""What a heap of clumps costs: grains fall into a box and come to rest; milliseconds a step on the way.

    python validation/clumps/fall.py [--grains 500] [--shape three] [--tolerance 1e-4] [--until 0.6]

Grains are balls, or two or three balls in a row that overlap (`repose.grain`), with the same volume, friction and
restitution. Balls are swept as spheres, clumps row by row.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings

import carom
import numpy as np
from repose import DENSITY, DIAMETER, FRICTION, SHAPES, STEP, grain

RESTITUTION, LOOSE = 0.3, 0.4
"""1; share of the space that spheres about the grains fill at the start."""
WINDOW = 100
"""Steps of a line."""


def box(shape: str, grains: int) -> carom.Scene:
    """Grains turned at random, loose above the floor of a box, and at rest."""
    made, (row, length) = carom.Scene(gravity=(0.0, 0.0, -9.81)), grain(SHAPES[shape])
    made.contact("glass", "glass", friction=FRICTION, restitution=RESTITUTION)
    wide = 1.2 * DIAMETER * (grains / 3) ** (1 / 3)
    around = DIAMETER if shape == "ball" else length
    region = {"low": (0, 0, 0), "high": (wide, wide, grains * np.pi / 6 * around**3 / LOOSE / wide**2)}
    kind = {"material": "glass", "density": DENSITY, "count": grains, "seed": 1}
    if shape == "ball":
        made.packing("g", diameter=DIAMETER, **kind, **region)
    else:
        made.clump_packing("g", spheres=row, **kind, **region)
    made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="glass")
    for name, point, normal in (
        ("left", (0, 0, 0), (1, 0, 0)),
        ("right", (wide, 0, 0), (-1, 0, 0)),
        ("front", (0, 0, 0), (0, 1, 0)),
        ("back", (0, wide, 0), (0, -1, 0)),
    ):
        made.plane(name, point=point, normal=normal, material="glass")
    return made


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=500)
    parser.add_argument("--shape", choices=list(SHAPES), default="three")
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--until", type=float, default=0.6)
    options = parser.parse_args()
    scene = box(options.shape, options.grains)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        simulation = carom.Simulation(
            scene.with_options(
                step=STEP, pile_tolerance=options.tolerance, every=WINDOW, contacts=False, impacts=False
            )
        )
        begin = time.perf_counter()
        while simulation.time < options.until - 0.5 * STEP:
            took = []
            for _ in range(WINDOW):
                last = time.perf_counter()
                simulation.step()
                took.append(1e3 * (time.perf_counter() - last))
            print(
                f"{simulation.time:.2f} s: {np.mean(took):6.1f} ms a step, at most {max(took):6.0f}",
                flush=True,
            )
    summary = simulation.result().summary
    counts = ", ".join(f"{name} {summary[name]}" for name in ("fallbacks", "unconverged", "halvings"))
    print(
        f"{options.grains} grains ({options.shape}): {time.perf_counter() - begin:.0f} s; {counts}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
