"""A triaxial test: grains in a cell of planes that hold a pressure, pressed along z at a constant rate.

    python validation/shear/triaxial.py [--grains 300] [--strain 0.3] [--friction 0.5]

Rigid grains of 16 to 24 mm without gravity are packed by six free planes with a pressure of 1 kPa each; friction is 0 until
then, so that they are dense. Then the planes across z move towards each other as prescribed, and the other four hold the
pressure on areas that change. Printed are the axial and lateral stress on the planes, q/p with p = (s_zz + s_xx + s_yy)/3
and q = s_zz - (s_xx + s_yy)/2, the angle of friction of the same state (sin = 3 q/(6 p + q)), and the packing fraction.
"""

from __future__ import annotations

import argparse
import sys
import warnings

import carom
import numpy as np

DIAMETER, DENSITY, PRESSURE = 0.02, 2500.0, 1000.0
#: Time in which the pressure moves a grain by its diameter, s.
TIME = DIAMETER * np.sqrt(DENSITY / PRESSURE)
STEP = 0.01 * TIME
OPTIONS = {"impact": "one-shot", "pile_tolerance": 1e-4}


def cell(friction: float, mass: float, low: np.ndarray, high: np.ndarray, rate: float | None) -> carom.Scene:
    """Planes that press; with a rate (1/s) those across z move."""
    made = carom.Scene(gravity=(0, 0, 0))
    made.contact("glass", "glass", friction=friction, restitution=0.1)
    made.contact("glass", "wall", friction=0.0, restitution=0.1)
    for axis, name in enumerate("xyz"):
        for sign, at in ((1, low), (-1, high)):
            point, normal = 0.5 * (low + high), np.zeros(3)
            point[axis], normal[axis] = at[axis], sign
            given: dict = {"free": {"mass": mass, "pressure": PRESSURE}}
            if axis == 2 and rate is not None:
                speed = sign * 0.5 * rate * (high - low)[2]
                given = {"motion": {"translation": [0, 0, {"polynomial": [0.0, speed]}]}}
            made.plane(f"{name}{sign:+d}", point=point, normal=normal, material="wall", **given)
    return made


def corners(result: carom.Result, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the cell."""
    found = [[result.walls[f"{name}{sign}"].position[frame, axis] for axis, name in enumerate("xyz")]
             for sign in ("+1", "-1")]  # fmt: skip
    return np.array(found[0]), np.array(found[1])


def stresses(result: carom.Result, frames: range) -> np.ndarray:
    """Mean over frames of the pressure on the planes across each axis."""
    found = []
    for k in frames:
        low, high = corners(result, k)
        areas = (high - low).prod() / (high - low)
        force = [0.5 * (result.walls[f"{name}-1"].force[k, axis] - result.walls[f"{name}+1"].force[k, axis])
                 for axis, name in enumerate("xyz")]  # fmt: skip
        found.append(np.array(force) / areas)
    return np.mean(found, axis=0)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=300)
    parser.add_argument("--strain", type=float, default=0.3)
    parser.add_argument("--friction", type=float, default=0.5)
    parser.add_argument("--inertial", type=float, default=3e-3, help="rate of strain times TIME")
    args = parser.parse_args()
    warnings.simplefilter("ignore", carom.CaromWarning)
    volume = args.grains * np.pi / 6 * DIAMETER**3 * 1.04
    side = (volume / 0.4) ** (1 / 3)
    mass = 0.1 * volume * DENSITY
    made = cell(0.0, mass, np.full(3, -0.5 * side), np.full(3, 0.5 * side), None)
    made.packing("grain", material="glass", density=DENSITY, seed=1, count=args.grains, sizes="uniform",
                 smallest=0.8 * DIAMETER, largest=1.2 * DIAMETER,
                 low=(-0.5 * side,) * 3, high=(0.5 * side,) * 3)  # fmt: skip
    packed = carom.simulate(made, step=STEP, until=20 * TIME, every=20, **OPTIONS)
    low, high = corners(packed, -1)
    print(
        f"packed: {volume / (high - low).prod():.4f}, stresses {stresses(packed, range(-11, -1)).round(1)} Pa"
    )
    rate = args.inertial / TIME
    made = cell(args.friction, mass, low, high, rate)
    made.spheres_from(packed)
    steps = round(args.strain / rate / STEP)
    every = max(1, steps // 1000)
    result = carom.simulate(made, step=STEP, until=steps * STEP, every=every, **OPTIONS)
    print("axial strain  s_zz Pa  s_xx Pa  s_yy Pa   q/p   angle  fraction")
    parts = np.array_split(np.arange(1, len(result.time)), 10)
    for part in parts:
        s = stresses(result, part)
        p, q = s.mean(), s[2] - 0.5 * (s[0] + s[1])
        low, high = corners(result, int(part[-1]))
        angle = np.degrees(np.arcsin(3 * q / (6 * p + q)))
        print(f"{rate * np.asarray(result.time)[part].mean():12.3f} {s[2]:8.0f} {s[0]:8.0f} {s[1]:8.0f} "
              f"{q / p:6.3f} {angle:6.1f} {volume / (high - low).prod():9.4f}", flush=True)  # fmt: skip
    counts = {key: result.summary[key] for key in ("fallbacks", "unconverged", "halvings", "wall_time_s")
              if key in result.summary}  # fmt: skip
    print(counts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
