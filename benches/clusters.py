"""Time of a step where many contacts are solved at once: pyramids, a frozen rack, a dense gas.

    python benches/clusters.py                  # a minute
    python benches/clusters.py pyramid rack     # these alone

A row has the mean and the longest step [ms], processor time of the core and its caller, and what the steps counted.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import carom
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "validation" / "pyramids"))

from rest import pyramid

RADIUS, G = 0.01, 9.8  # m, m/s^2
Case = tuple[str, carom.Scene, int]


def rack(friction: float) -> carom.Scene:
    """A tight rack of 15 on a bed, short steps."""
    r = 0.028575
    scene = carom.Scene(run={"step": 5e-5})
    scene.contact("ball", "ball", friction=friction, restitution=0.95)
    scene.contact("ball", "cloth", friction=0.2, restitution=0.5, rolling_radius="0.3 mm")
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
    scene.rack(
        "ball", balls=15, material="ball", apex=(1.9, 0.6, r), direction=(1, 0, 0), radius=r, mass=0.17
    )
    return scene


def gas(fraction: float, gravity: float, **run: float) -> carom.Scene:
    """150 rough elastic balls flying about in a box that they fill to `fraction`."""
    count, side = 150, (150 * 4.0 / 3.0 * np.pi / fraction) ** (1 / 3) * RADIUS
    scenes = [carom.Scene(gravity=(0.0, 0.0, -gravity), run={"step": 1e-3, **run}) for _ in range(2)]
    box = scenes[0].packing(
        "g", material="b", density=2500, seed=1, count=count, sizes="equal", diameter=2 * RADIUS,
        low=(0, 0, 0), high=(side, side, side),
    )  # fmt: skip
    speeds = np.random.default_rng(1).normal(0.0, 1.0, (count, 3))
    scene = scenes[1]
    scene.contact("b", "b", friction=1.5, restitution=1.0)
    for axis in range(3):
        for place, sign in ((0.0, 1.0), (side, -1.0)):
            point, normal = np.zeros(3), np.zeros(3)
            point[axis], normal[axis] = place, sign
            scene.plane(f"w{axis}{sign:+.0f}", point=tuple(point), normal=tuple(normal), material="b")
    for i, (x, v) in enumerate(zip(box.packed().position, speeds, strict=True)):
        scene.sphere(
            f"b{i}", radius=RADIUS, density=2500, material="b", position=x.tolist(), velocity=v.tolist()
        )
    return scene


def pyramids() -> Iterator[Case]:
    for layers, friction, steps in ((10, 0.6, 300), (20, 0.6, 300), (50, 0.7, 100)):
        yield (
            f"pyramid of {layers} layers at rest, mu = {friction}",
            pyramid(layers, "planar", friction),
            steps,
        )
    for layers, friction, tolerance, steps in ((10, 0.5, 1e-7, 300), (20, 0.5, 1e-4, 100)):
        scene = pyramid(layers, "planar", friction).with_options(pile_tolerance=tolerance)
        yield f"pyramid of {layers} layers that falls, mu = {friction}, {tolerance:g}", scene, steps


def racks() -> Iterator[Case]:
    for friction in (0.06, 0.5):
        yield f"frozen rack of 15 at rest, mu = {friction}", rack(friction), 4000


def gases() -> Iterator[Case]:
    for fraction in (0.3, 0.45):
        yield f"dense gas, {fraction} full, no gravity", gas(fraction, 0.0), 200
    yield "dense gas that settles, 0.45 full, 0.0001", gas(0.45, G, pile_tolerance=1e-4), 130


CASES: dict[str, Callable[[], Iterator[Case]]] = {"pyramid": pyramids, "rack": racks, "gas": gases}


def measure(name: str, scene: carom.Scene, steps: int) -> str:
    """The row of a case."""
    simulation = carom.Simulation(scene, keep=False)
    took = np.empty(steps)
    for k in range(steps):
        start = time.process_time()
        simulation.step(1)
        took[k] = time.process_time() - start
    counts = simulation.result().summary
    counted = [int(counts[key]) for key in ("fallbacks", "halvings", "truncated_sequences")]
    return f"{name:<50} {1e3 * took.mean():>8.3f} {1e3 * took.max():>8.1f} {counted}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    chosen = parser.parse_args().cases or list(CASES)
    warnings.simplefilter("ignore")
    print(f"{'':<50} {'mean/ms':>8} {'most/ms':>8} [fallbacks, halvings, truncated]")
    for case in chosen:
        for name, scene, steps in CASES[case]():
            print(measure(name, scene, steps), flush=True)


if __name__ == "__main__":
    main()
