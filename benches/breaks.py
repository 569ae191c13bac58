"""Nine-ball breaks to rest by method `events`, and beside them those of pooltool where an environment has it.

    python benches/breaks.py [--pooltool PYTHON] [--breaks N]    # `make bench` makes the environment

Both break a rack with small gaps on a pocket table, each by its own physics: pooltool 0.6.0 answers one pair at a time, has
no hops and no rolling resistance in a slide. Times are of the simulation alone, one after the other, compiled code warm.
Accuracy is what any break must have, judged in frames every 0.01 s: balls do not overlap, and energy does not rise. And a
ball that hits two touching balls in their middle must send them off alike: how far their speeds are apart, over their mean.
"""

from __future__ import annotations

import argparse
import csv
import os
import statistics
import subprocess
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import carom
import numpy as np
from carom import billiards

PEER = Path(__file__).parents[1] / ".venv" / "pooltool" / "bin" / "python"
FRAME_S, UNTIL = 0.01, 20.0

OTHER = """
import sys, time, numpy as np, pooltool as pt
def shot(seed):
    np.random.seed(seed)
    table = pt.Table.default()
    balls = pt.get_rack(pt.GameType.NINEBALL, table=table, spacing_factor=1e-3)
    system = pt.System(cue=pt.Cue(cue_ball_id="cue"), table=table, balls=balls)
    system.cue.set_state(V0=6.7, phi=pt.aim.at_ball(system, "1", cut=float(np.random.uniform(-3, 3))))
    return system
pt.simulate(shot(0), inplace=True)
found = {"version": pt.__version__}
for seed in range(1, int(sys.argv[1]) + 1):
    system, begin = shot(seed), time.perf_counter()
    pt.simulate(system, inplace=True)
    found[f"{seed} time"] = time.perf_counter() - begin
    pt.continuize(system, dt=float(sys.argv[2]), inplace=True)
    histories = [ball.history_cts.states for ball in system.balls.values()]
    moved = np.array([[np.where(s.s == pt.constants.pocketed, np.nan, s.rvw) for s in states] for states in histories])
    found[f"{seed} frames"] = moved.swapaxes(0, 1)  # frames, balls, place and velocities
r, middle = pt.Ball.create("cue").params.R, 0.5 * pt.Table.default().w
places = {"cue": (middle, 0.3), "left": (middle - r, 0.6), "right": (middle + r, 0.6)}
balls = {name: pt.Ball.create(name, xy=xy) for name, xy in places.items()}
system = pt.System(cue=pt.Cue(cue_ball_id="cue"), table=pt.Table.default(), balls=balls)
system.cue.set_state(V0=2.0, phi=90.0)
pt.simulate(system, inplace=True, t_final=0.2)
found["pair"] = [np.linalg.norm(system.balls[name].state.rvw[1]) for name in ("left", "right")]
params = next(iter(system.balls.values())).params
np.savez(sys.argv[3], radius=params.R, mass=params.m, **found)
"""

Break = tuple[float, np.ndarray]
"""Seconds, and frames x balls x (place, velocity, angular velocity) x 3."""
Found = tuple[str, float, list[Break], np.ndarray]
"""The program, the radius, its breaks, and the speeds of the two balls hit at once."""


def judged(frames: np.ndarray, radius: float) -> tuple[float, float]:
    """The greatest overlap of two balls over their radius, and the greatest rise of energy between two frames over that at
    the start. A ball that leaves takes its energy along.
    """
    place, velocity, turning = np.moveaxis(frames, 2, 0)
    overlap = 0.0
    for i in range(place.shape[1]):
        apart = np.linalg.norm(place[:, i + 1 :] - place[:, i : i + 1], axis=2)
        overlap = max(overlap, float(np.nanmax((2 * radius - apart) / radius, initial=0.0)))
    height = np.nan_to_num(place[..., 2] - radius)
    squares = [np.nansum(x**2, axis=2) for x in (velocity, turning)]
    energy = (0.5 * squares[0] + 0.2 * radius**2 * squares[1] + 9.81 * height).sum(axis=1)
    return overlap, float(
        np.diff(energy[1:]).max(initial=0.0) / energy.max()
    )  # the strike comes after frame 0


def of_carom(seed: int) -> tuple[Break, float]:
    """Timed without frames; then the same break with them."""
    table = billiards.table("9ft")
    scene = table.scene("a break", gravity=9.81, until=UNTIL, method="events", step=UNTIL)
    table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=seed)
    cue = table.cue_ball(scene, at="head spot")
    billiards.strike(cue, speed="20 mph", direction="0 deg", height=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        seconds = carom.simulate(scene).summary["core_s"]
        seen = carom.simulate(scene, step=FRAME_S)
    frames = np.stack([seen.position, seen.velocity, seen.angular_velocity], axis=2)
    frames[~np.asarray(seen.present)] = np.nan
    return (seconds, frames), table.spec.ball_radius


def pair_of_carom() -> np.ndarray:
    """Speeds of two touching balls that a third hits in their middle."""
    table = billiards.table("9ft")
    scene = table.scene("two at once", until=0.2)
    r, y = table.spec.ball_radius, 0.5 * table.spec.width
    table.cue_ball(scene, (0.3, y), velocity=(2.0, 0.0, 0.0))
    for name, side in (("left", r), ("right", -r)):
        table.ball(scene, name, (0.6, y + side))
    result = carom.simulate(scene)
    return np.asarray(np.linalg.norm(result.velocity[-1, 1:], axis=1))


def of_pooltool(python: str, count: int) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "found.npz")
        subprocess.run([python, "-c", OTHER, str(count), str(FRAME_S), str(path)], check=True)
        with np.load(path) as found:
            breaks = [(float(found[f"{k} time"]), found[f"{k} frames"]) for k in range(1, count + 1)]
            return f"pooltool {found['version']}", float(found["radius"]), breaks, found["pair"]


def rows(count: int, python: str | None) -> Iterator[Found]:
    made = [of_carom(seed) for seed in range(1, count + 1)]
    name = f"carom {carom.__version__}, events"
    yield name, made[0][1], [found for found, _ in made], pair_of_carom()
    if python:
        yield of_pooltool(python, count)


def batch(count: int) -> None:
    """Breaks a second through `carom.simulate_batch`."""
    table = billiards.table("9ft")
    scene = table.scene("a break", until=UNTIL, method="events", step=UNTIL)
    table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=1)
    cue = table.cue_ball(scene, at="head spot")
    billiards.strike(cue, speed="20 mph", direction="0 deg", height=0.1)
    aims = np.radians(np.random.default_rng(1).uniform(-2, 2, count))
    speed = float(np.linalg.norm(cue.velocity))
    given = speed * np.stack([np.cos(aims), np.sin(aims), np.zeros(count)], axis=1)
    begin = time.perf_counter()
    found = carom.simulate_batch(scene, {"cue.velocity": given})
    seconds = time.perf_counter() - begin
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"carom.simulate_batch, {threads} threads: {found.ok.sum() / seconds:.0f} breaks a second")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = str(PEER) if PEER.exists() else None
    parser.add_argument(
        "--pooltool", metavar="PYTHON", default=default, help="a Python that has pooltool-billiards"
    )
    parser.add_argument("--breaks", type=int, default=20)
    parser.add_argument("--quick", action="store_true", help="5 breaks")
    parser.add_argument("--csv", type=Path, help="the table to a file too, FILE-breaks.csv")
    given = parser.parse_args()
    count = 5 if given.quick else given.breaks
    print(f"{count} nine-ball breaks to rest, pocket table, one thread")
    heads = ("ms, median", "least", "most", "overlap/r", "energy up", "two at once")
    print(f"{'':>24}" + "".join(f"{head:>12}" for head in heads))
    lines = [("program", *heads)]
    for name, radius, breaks, pair in rows(count, given.pooltool):
        ms = [1e3 * seconds for seconds, _ in breaks]
        overlaps, rises = zip(*(judged(frames, radius) for _, frames in breaks), strict=True)
        times = (statistics.median(ms), min(ms), max(ms))
        off = (max(overlaps), max(rises), np.ptp(pair) / pair.mean())
        lines.append((name, *map(str, times + off)))
        print(
            f"{name:>24}"
            + "".join(f"{t:>12.2f}" for t in times)
            + "".join(f"{error:>12.1e}" for error in off)
        )
    if given.csv:
        with given.csv.with_name(f"{given.csv.stem}-breaks{given.csv.suffix}").open("w", newline="") as file:
            csv.writer(file).writerows(lines)
    if not given.pooltool:
        print("pooltool: no environment; `make .venv/pooltool/made`, or --pooltool PYTHON")
    batch(10 * count)


if __name__ == "__main__":
    main()
