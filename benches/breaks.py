"""Nine-ball breaks to rest by method `events`, and beside them those of pooltool where another Python has it.

    python benches/breaks.py [--pooltool PYTHON] [--breaks N]

Both break a rack with small gaps on a pocket table, each by its own physics: pooltool answers one pair at a time, has no
hops and no rolling resistance in a slide. Times are of the simulation alone, one after the other, compiled code warm.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import warnings

import carom
from carom import billiards

OTHER = """
import sys, time, statistics, numpy as np, pooltool as pt
def shot(seed):
    np.random.seed(seed)
    table = pt.Table.default()
    balls = pt.get_rack(pt.GameType.NINEBALL, table=table, spacing_factor=1e-3)
    system = pt.System(cue=pt.Cue(cue_ball_id="cue"), table=table, balls=balls)
    system.cue.set_state(V0=6.7, phi=pt.aim.at_ball(system, "1", cut=float(np.random.uniform(-3, 3))))
    return system
pt.simulate(shot(0), inplace=True)
times = []
for seed in range(1, int(sys.argv[1]) + 1):
    system, begin = shot(seed), time.perf_counter()
    pt.simulate(system, inplace=True)
    times.append(time.perf_counter() - begin)
print(f"pooltool {pt.__version__}: {1e3 * statistics.median(times):.1f} ms a break (median of {len(times)})")
"""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pooltool", metavar="PYTHON", help="a Python that has pooltool-billiards")
    parser.add_argument("--breaks", type=int, default=20)
    given = parser.parse_args()
    table = billiards.table("9ft")
    times, ends = [], []
    for seed in range(1, given.breaks + 1):
        scene = table.scene("a break", until=20.0, step=20.0)
        table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=seed)
        cue = table.cue_ball(scene, at="head spot")
        billiards.strike(cue, speed="20 mph", direction="0 deg", height=0.1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", carom.CaromWarning)
            try:
                result = carom.simulate(scene, method="events")
            except carom.CaromError as error:
                ends.append(str(error))
                continue
        times.append(result.summary["core_s"])
    median = 1e3 * statistics.median(times)
    print(f"carom, events: {median:.1f} ms a break (median of {len(times)}, core)")
    for end in ends:
        print(f"    not done: {end}")
    if given.pooltool:
        subprocess.run([given.pooltool, "-c", OTHER, str(given.breaks)], check=True)


if __name__ == "__main__":
    main()
