"""Slopes of elongated grains: a column collapses, of balls and of clumps of the same volume.

    python validation/clumps/repose.py [--grains 70] [--seeds 3] [--csv FILE]

Grains of one volume are dropped between two walls, in a world that is periodic across. One wall is taken away, and what
is left lies against the other. Its slope is that of the wedge with the same centre of mass. Grains are balls, and two and
three balls in a row that overlap, with the same friction and without resistance to rolling. Elongated grains are known to
be steeper.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
import warnings

import carom
import numpy as np

DIAMETER, DENSITY, FRICTION = 0.01, 2500.0, 0.5
WIDTH, ACROSS = 0.04, 0.03
STEP = 5e-4
SHAPES = {"ball": 1, "two": 2, "three": 3}


def grain(count: int) -> tuple[list[list[float]], float]:
    """Spheres in a row, a radius apart, with the volume of one ball; and the length."""
    r = 1.0
    # Of n equal spheres whose centres are r apart: each neighbour hides a lens of 5/12 of a ball's radius cubed times pi.
    volume = count * 4 / 3 * np.pi * r**3 - (count - 1) * 5 / 12 * np.pi * r**3
    r = (np.pi / 6 * DIAMETER**3 / volume) ** (1 / 3)
    row = [[(k - (count - 1) / 2) * r, 0.0, 0.0, r] for k in range(count)]
    return row, (count + 1) * r


def scene() -> carom.Scene:
    made = carom.Scene(gravity=(0.0, 0.0, -9.81))
    made.world.periodic = (0.0, ACROSS, 0.0)
    made.material("glass")
    made.contact("glass", "glass", friction=FRICTION, restitution=0.1)
    made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="glass")
    made.plane("back", point=(0, 0, 0), normal=(1, 0, 0), material="glass")
    return made


def column(shape: str, grains: int, seed: int) -> carom.Scene:
    """Grains above one another in layers, turned at random."""
    made, draw = scene(), np.random.default_rng(seed)
    made.plane("gate", point=(WIDTH, 0, 0), normal=(-1, 0, 0), material="glass")
    row, length = grain(SHAPES[shape])
    pitch = 1.02 * length
    nx, ny = int(WIDTH / pitch), int(ACROSS / pitch)
    for k in range(grains):
        i, j, layer = k % nx, k // nx % ny, k // (nx * ny)
        place = ((i + 0.5) * WIDTH / nx, (j + 0.5) * ACROSS / ny, (layer + 0.6) * pitch)
        velocity = 0.05 * draw.normal(size=3)
        if shape == "ball":
            made.sphere(
                f"g{k}",
                radius=DIAMETER / 2,
                density=DENSITY,
                material="glass",
                position=place,
                velocity=velocity,
            )
            continue
        turn = draw.normal(size=4)
        made.clump(f"g{k}-", spheres=row, density=DENSITY, material="glass", position=place, velocity=velocity,
                   orientation=turn / np.linalg.norm(turn))  # fmt: skip
    return made


def slope(result: carom.Result) -> float:
    """Of the wedge with the same centre of mass, degrees: a third of its height over a third of its length."""
    centre = np.asarray(result.position)[-1].mean(axis=0)  # of grains that are alike
    return float(np.degrees(np.arctan(centre[2] / centre[0])))


def run(shape: str, grains: int, seed: int) -> tuple[float, float, int, int]:
    """Slope, seconds, fallbacks, and contacts at the end."""
    begin = time.perf_counter()
    filled = carom.simulate(
        column(shape, grains, seed), step=STEP, until=0.6, every=1200, pile_tolerance=1e-5
    )
    after = scene()
    after.spheres_from(filled)
    fallen = carom.simulate(after, step=STEP, until=0.8, every=1600, pile_tolerance=1e-5)
    fallbacks = int(sum(np.asarray(r.steps["fallbacks"]).sum() for r in (filled, fallen)))
    return (
        slope(fallen),
        time.perf_counter() - begin,
        fallbacks,
        int(np.asarray(fallen.steps["contacts"])[-1]),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=50)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--csv")
    options = parser.parse_args()
    rows = []
    print(f"{options.grains} grains, friction {FRICTION}, slopes of {options.seeds} columns that collapsed")
    for shape, count in SHAPES.items():
        found = []
        for seed in range(1, options.seeds + 1):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", carom.CaromWarning)
                angle, seconds, fallbacks, contacts = run(shape, options.grains, seed)
            found.append(angle)
            rows.append([shape, seed, f"{angle:.2f}", f"{seconds:.1f}", fallbacks, contacts])
            print(
                f"  {shape:6} seed {seed}: {angle:5.1f} deg, {seconds:6.1f} s, {fallbacks} fallbacks, {contacts} contacts",
                flush=True,
            )
        spread = np.std(found, ddof=1) if len(found) > 1 else 0.0
        long = grain(count)[1] / (2 * grain(count)[0][0][3])
        print(
            f"{shape}: length over width {long:.2f}, slope {np.mean(found):.1f} +- {spread:.1f} deg",
            flush=True,
        )
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            csv.writer(file).writerows(
                [["shape", "seed", "slope_deg", "seconds", "fallbacks", "contacts"], *rows]
            )


if __name__ == "__main__":
    sys.exit(main())
