"""Hoppers of elongated grains: how fast a cone empties, of balls and of clumps of the same volume.

    python validation/clumps/hopper.py [--grains 300] [--seeds 3] [--csv FILE]

Grains of one volume settle in a tube above a cone of 30 degrees, whose opening a shutter closes for the first 0.4 s. Then
they leave, and an outlet takes them. The rate is that between a fifth and four fifths of the mass. Grains are balls, and
two and three balls in a row that overlap (`repose.grain`). For balls the law of Beverloo with the factor of Rose and
Tanaka (`scenarios/hopper_cone.toml`) gives what to compare with.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
import warnings

import carom
import numpy as np
from repose import DENSITY, DIAMETER, SHAPES, grain

OPENING, WIDE, ANGLE, FRICTION, G = 6.0 * DIAMETER, 10.0 * DIAMETER, np.pi / 6, 0.5, 9.8
"""Diameters of the opening and of the tube, m; of the wall from the vertical, rad; m/s^2."""
SHUT, STEP = 0.4, 5e-4
"""s."""
PACKED, K, BORDER = 0.6, 1.4, np.pi / 4
"""Of the law: share of the space that grains fill, grain diameters that the edge takes, border of what would stand."""


def hopper(shape: str, grains: int, seed: int) -> carom.Scene:
    """Grains at rest above a closed cone, turned at random."""
    made, (row, length) = carom.Scene(gravity=(0.0, 0.0, -G)), grain(SHAPES[shape])
    made.contact("glass", "glass", friction=FRICTION, restitution=0.3)
    height = 0.5 * (WIDE - OPENING) / np.tan(ANGLE)
    fill = grains * length**3 / 6 / (0.5 * WIDE**2 / 4)
    region = {"region": "cylinder", "point": (0, 0, height + fill / 2), "axis": (0, 0, 1),
              "region_radius": WIDE / 2, "length": fill}  # fmt: skip
    if shape == "ball":
        made.packing(
            "g", diameter=DIAMETER, material="glass", density=DENSITY, count=grains, seed=seed, **region
        )
    else:
        made.clump_packing(
            "g", spheres=row, material="glass", density=DENSITY, count=grains, seed=seed, **region
        )
    made.cone("cone", material="glass", point=(0, 0, 0), axis=(0, 0, 1), radius=OPENING / 2, radius_end=WIDE / 2,
              length=height)  # fmt: skip
    made.cylinder("tube", material="glass", point=(0, 0, height + fill), axis=(0, 0, 1), radius=WIDE / 2,
                  length=2 * fill)  # fmt: skip
    made.plane("shutter", material="glass", point=(0, 0, 0), normal=(0, 0, 1), radius=OPENING / 2,
               motion={"until": SHUT})  # fmt: skip
    made.outlet(low=(-1, -1, -9), high=(1, 1, -OPENING / 2))
    return made


def rate(result: carom.Result) -> float:
    """kg/s between a fifth and four fifths of the mass; 0 if the grains stay."""
    step, body = (np.asarray(result.events[name]).astype(int) for name in ("step", "body"))
    mass = np.asarray(result.bodies["mass"])
    out = np.cumsum(mass[body]) / mass.sum()
    if not len(out) or out[-1] < 0.8:
        return 0.0
    first, last = (step[np.searchsorted(out, share)] * STEP for share in (0.2, 0.8))
    return float(0.6 * mass.sum() / (last - first))


def law() -> float:
    """kg/s of balls."""
    flat = 0.58 * PACKED * DENSITY * np.sqrt(G) * (OPENING - K * DIAMETER) ** 2.5
    return float(flat * (np.tan(ANGLE) * np.tan(BORDER)) ** -0.35)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=300)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--shapes", nargs="+", choices=list(SHAPES), default=list(SHAPES))
    parser.add_argument("--csv")
    options = parser.parse_args()
    rows = []
    print(f"{options.grains} grains, friction {FRICTION}; the law gives {law():.4f} kg/s for balls")
    for shape in options.shapes:
        found = []
        for seed in range(1, options.seeds + 1):
            begin = time.perf_counter()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", carom.CaromWarning)
                scene = hopper(shape, options.grains, seed)
                result = carom.simulate(
                    scene, step=STEP, until=3.0, every=20, pile_tolerance=1e-4, contacts=False, impacts=False,
                    stop=lambda view: bool(view.present.mean() < 0.1),
                )  # fmt: skip
            found.append(rate(result))
            rows.append([shape, seed, f"{found[-1]:.5f}", f"{time.perf_counter() - begin:.1f}"])
            print(f"  {shape:6} seed {seed}: {found[-1]:.4f} kg/s, {rows[-1][-1]} s", flush=True)
        spread = np.std(found, ddof=1) if len(found) > 1 else 0.0
        print(f"{shape}: {np.mean(found):.4f} +- {spread:.4f} kg/s", flush=True)
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            csv.writer(file).writerows([["shape", "seed", "kg_per_s", "seconds"], *rows])


if __name__ == "__main__":
    sys.exit(main())
