"""Time of a small scene through `carom.simulate` in memory, over that in `carom.simulate_batch` on one thread.

    python benches/small_scenes.py [--scenes 1000]

Both are given the same scenes, and keep the same frames; the least of three rounds in turns, processor time.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

import carom
from carom import CaromWarning
from carom.cli.examples import find


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1000)
    count = parser.parse_args().scenes
    warnings.simplefilter("ignore", CaromWarning)
    scene = carom.Scene.from_toml(find("three_balls"))
    scenes = [scene.with_options(until=0.1) for _ in range(count)]

    def cost(work: Callable[[], object]) -> float:
        start = time.process_time()
        work()
        return (time.process_time() - start) / count * 1e3

    for name, every in (("a frame a step", 1), ("first and last frame", 1000)):
        runs: list[Callable[[], object]] = [
            lambda every=every: [carom.simulate(s, every=every).outcome for s in scenes],
            lambda every=every: carom.simulate_batch(scenes, threads=1, frames=every),
        ]
        pairs = [[cost(work) for work in runs] for _ in range(3)]
        one, many = (min(column) for column in zip(*pairs, strict=True))
        print(f"{name}: simulate {one:.2f} ms, batch {many:.2f} ms a scene, ratio {one / many:.2f}")


if __name__ == "__main__":
    main()
