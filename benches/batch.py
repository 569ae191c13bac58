"""Breaks a second: `carom.simulate_batch` on the scene of the paper's 5.6, 3000 steps each, over aim, speed and spin.

    python benches/batch.py [--cases 400] [--threads 1,2] [--csv FILE]

The floor is 50 breaks a second on two cores, the aim 300. The hash is that of all final states: the same for any number of
threads. CPU time is that of the whole process, so that what else the machine does shows only in the wall time.
"""

from __future__ import annotations

import argparse
import csv
import os
import time
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
from _measure import BREAK, state_hash

FLOOR, AIM = 50.0, 300.0


def cases(count: int) -> dict[str, np.ndarray]:
    """Cue balls from the head spot: aims within 2 degrees, 4 to 12 m/s, follow, draw and side spin. Seeded."""
    rng = np.random.default_rng(56)
    aim, speed = np.radians(rng.uniform(-2.0, 2.0, count)), rng.uniform(4.0, 12.0, count)
    velocity = np.stack([speed * np.cos(aim), speed * np.sin(aim), np.zeros(count)], axis=1)
    spin = rng.uniform(-1.0, 1.0, (count, 3)) * [0.0, 60.0, 60.0]
    return {"ball2.velocity": velocity, "ball2.angular_velocity": spin}


def measure(count: int, threads: int) -> dict[str, Any]:
    """One row of the table."""
    given = cases(count)
    cpu = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # advice on the step: it is the paper's
        batch = carom.simulate_batch(BREAK, given, threads=threads)
    cpu = time.process_time() - cpu
    final = {key: getattr(batch, key) for key in ("position", "velocity", "angular_velocity")}
    return {
        "cases": count,
        "threads": threads,
        "failed": int((~batch.ok).sum()),
        "wall_s": round(batch.wall_s, 3),
        "per_s": round(batch.per_second, 1),
        "cpu_ms": round(cpu / count * 1e3, 2),
        "hash": state_hash(final),
    }


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    options.add_argument("--cases", type=int, default=400)
    options.add_argument("--threads", default=f"1,{os.cpu_count() or 1}")
    options.add_argument("--quick", action="store_true", help="a tenth of the cases")
    options.add_argument("--csv", type=Path)
    given = options.parse_args()
    count = max(10, given.cases // (10 if given.quick else 1))
    rows = [measure(count, int(threads)) for threads in given.threads.split(",")]
    print(f"breaks of 3000 steps, a second; floor {FLOOR:g}, aim {AIM:g} on two cores")
    print("".join(f"{name:>12}" for name in rows[0]))
    for row in rows:
        print("".join(f"{row[name]:>12}" if name != "hash" else f"  {row[name]}" for name in row))
    if given.csv is not None:
        path = given.csv.with_name(f"{given.csv.stem}-batch{given.csv.suffix}")
        with path.open("w", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
