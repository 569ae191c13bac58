"""How often the intervals of a fit hold the truth: restitution and friction from noisy tracks of two balls.

    python validation/calibration/coverage.py                 # 50 tracks, least squares
    python validation/calibration/coverage.py --search gaussian_process --tracks 20
    python validation/calibration/coverage.py --write         # track.csv, which collision_fit.toml reads

Each track is the motion of collision.toml, 50 frames a second, with independent Gaussian noise of 0.5 mm. Prints how many of
the 95 % intervals hold the true value, and the bias. Exit code 1 if so few or so many would come by chance in less than 1 of
1000 such tests.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from carom.many.fit.calibration import SEARCHES
from common import table
from scipy.stats import binom

HERE = Path(__file__).parent
SCENE = HERE / "collision.toml"
TRUTH = {"e": 0.9, "mu": 0.1}
BOUNDS = {"e": (0.5, 1.0), "mu": (0.0, 0.3)}
NOISE = 5e-4  # m
EVERY = 20  # steps, of 1 ms
SEEN = [f"{ball}.position.{axis}" for ball in "ab" for axis in "xy"]


def track(seed: int) -> tuple[list[float], dict[str, list[float]]]:
    """Times (s) and noisy places (m) of both balls, by the names of their quantities."""
    result, noise = carom.simulate(SCENE), np.random.default_rng(seed)
    frames = slice(0, None, EVERY)
    found = {}
    for name in SEEN:
        ball, _, axis = name.split(".")
        exact = np.asarray(result[ball].position)[frames, "xyz".index(axis)]
        found[name] = (exact + noise.normal(0.0, NOISE, len(exact))).tolist()
    return np.asarray(result.time)[frames].tolist(), found


def fitted(seed: int, search: str, folder: Path) -> carom.Fit:
    """The fit to one track."""
    times, seen = track(seed)
    targets = [
        {"quantity": name, "time": times, "value": values, "uncertainty": NOISE}
        for name, values in seen.items()
    ]
    calibration = carom.Calibration.of(SCENE, BOUNDS, targets, search=search)
    return carom.fit(calibration, folder / str(seed), workers=0)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tracks", type=int, default=50)
    parser.add_argument("--search", choices=SEARCHES, default=SEARCHES[0])
    parser.add_argument("--write", action="store_true", help="write track.csv and fit nothing")
    options = parser.parse_args()
    if options.write:
        times, seen = track(1)
        lines = ["t (ms),a x (mm),a y (mm),b x (mm),b y (mm)"]
        for t, *places in zip(times, *seen.values(), strict=True):
            lines.append(",".join([f"{1e3 * t:.0f}", *(f"{1e3 * x:.3f}" for x in places)]))
        (HERE / "track.csv").write_text("\n".join(lines) + "\n")
        return 0
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        fits = [fitted(seed, options.search, Path(folder)) for seed in range(options.tracks)]
    rows, bad = [], False
    for name, truth in TRUTH.items():
        ends = np.array([f.interval[name] or (np.nan, np.nan) for f in fits])
        held = int(((ends[:, 0] <= truth) & (truth <= ends[:, 1])).sum())
        low, high = (int(binom.ppf(q, options.tracks, 0.95)) for q in (5e-4, 1 - 5e-4))
        bad |= not low <= held <= high
        half = float(np.nanmean(ends[:, 1] - ends[:, 0]) / 2)
        mean = float(np.mean([f.best[name] for f in fits])) - truth
        rows.append(
            [name, f"{truth:g}", f"{held} of {len(fits)}", f"{low} to {high}", f"{half:.2g}", f"{mean:+.1g}"]
        )
    print(table(["", "truth", "intervals that hold it", "allowed", "mean half width", "bias"], rows))
    runs = sum(len(f.sweep) for f in fits)
    print(f"{options.search}: {runs} runs, {runs / len(fits):.3g} a fit, {time.perf_counter() - start:.3g} s")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
