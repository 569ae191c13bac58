"""Scenes that once were slow or full of fallbacks, step by step: a frozen rack, a dense gas, a tall pyramid.

    python validation/hard.py     # half a minute; exit code 1 if a sub-problem was not solved

Times are of one core, and are shown, not judged: of all steps in the core, and of the worst one as Python sees it.
"""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent / "pyramids"))

import carom
from common import table
from rest import pyramid

RACK = 0.028575  # m
GRAIN = 0.01  # m


def rack(cue: bool) -> carom.Scene:
    """15 touching balls with friction on a cloth; with `cue` a ball at 8 m/s hits them."""
    scene = carom.Scene(run={"until": 0.2, "step": 5e-5})
    scene.contact("ball", "ball", friction=0.06, restitution=0.93)
    scene.contact("ball", "cloth", friction=0.2, restitution=0.5)
    scene.plane("table", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
    at = {"radius": RACK, "mass": 0.17, "material": "ball"}
    scene.rack("rack", balls=15, apex=(0, 0, RACK), direction=(1, 0, 0), **at)
    if cue:
        scene.sphere("cue", at=(-0.3, 0, RACK), velocity=(8, 0, 0), **at)
    return scene


def gas(seed: int, balls: int = 150, fraction: float = 0.3) -> carom.Scene:
    """Balls with friction 1.5 and restitution 1 fly about in a box, without gravity."""
    rng = np.random.default_rng(seed)
    side = (balls * 4 / 3 * math.pi / fraction) ** (1 / 3) * GRAIN
    scene = carom.Scene(gravity=(0, 0, 0), run={"until": 0.3, "step": 5e-4})
    scene.contact("grain", "grain", friction=1.5, restitution=1.0)
    for axis in range(3):
        for end, sign in ((0.0, 1), (side + 2 * GRAIN, -1)):
            normal = sign * np.eye(3)[axis]
            scene.plane(
                f"w{axis}{sign}", point=tuple(end * abs(normal)), normal=tuple(normal), material="grain"
            )
    rows = math.ceil(balls ** (1 / 3))
    for number, cell in enumerate(np.ndindex(rows, rows, rows)):
        if number < balls:
            at = GRAIN + side / rows * (np.array(cell) + 0.5)
            moves = {
                "velocity": tuple(rng.normal(size=3)),
                "angular_velocity": tuple(30 * rng.normal(size=3)),
            }
            scene.sphere(f"b{number}", radius=GRAIN, density=2500, at=tuple(at), material="grain", **moves)
    return scene


def scenes() -> Iterator[tuple[str, carom.Scene]]:
    """What is shown."""
    yield "frozen rack, at rest", rack(False)
    yield "frozen rack, broken", rack(True)
    for seed in range(3):
        yield f"gas of 150, seed {seed}", gas(seed)
    for friction in (0.8, 0.5):
        scene = pyramid(20, "planar", friction)
        yield f"pyramid of 20 layers, mu {friction}", scene.with_options(until=0.3)


def main() -> int:
    """The command."""
    rows, unsolved = [], 0
    warnings.simplefilter("ignore", carom.CaromWarning)
    for name, scene in scenes():
        simulation, times = carom.Simulation(scene), []
        until, h = scene.run.until, scene.run.step
        assert until is not None
        for _ in range(round(until / h)):
            begin = time.process_time()
            simulation.step()
            times.append(1e3 * (time.process_time() - begin))
        found = simulation.result().summary
        unsolved += found["unconverged"]
        counts = [found[key] for key in ("fallbacks", "halvings", "unconverged")]
        rise = found["energy"]["max_rise_relative"]
        core = found["core_s"]
        shown = [f"{core:.2g}", f"{1e3 * core / len(times):.2g}", f"{max(times):.3g}"]
        rows.append([name, *map(str, counts), f"{rise:.1e}", *shown])
    columns = ["scene", "fallbacks", "halvings", "unconverged", "rise", "s", "ms a step", "worst"]
    print(table(columns, rows))
    return int(unsolved > 0)


if __name__ == "__main__":
    sys.exit(main())
