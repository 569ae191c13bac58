"""Pyramids of touching spheres on a rough floor: which friction holds them, against the least that could.

    python validation/pyramids/rest.py                         # 20 s; exit code 1 if one does not do as friction says
    python validation/pyramids/rest.py --stretched 1e-5 1e-3   # put down with gaps: which stay, and nothing is judged

A pyramid can be held where impulses within Coulomb's cones balance the weight of all its spheres: a linear program, with
cones of 64 edges inside and outside of the round ones. Its bounds are written here, since it needs a solver that Carom
does not.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from common import table

RADIUS, G = 0.01, 9.8  # m, m/s^2
#: Layers and their shape: the least coefficient of friction that can hold the pyramid, to 4e-4.
LEAST = {
    (2, "square"): 0.4145,
    (3, "square"): 0.5235,
    (4, "square"): 0.5946,
    (2, "triangular"): 0.3180,
    (3, "triangular"): 0.4460,
    (4, "triangular"): 0.5052,
    (2, "planar"): 0.2680,
    (3, "planar"): 0.4340,
    (5, "planar"): 0.4975,
    (10, "planar"): 0.5410,
}
#: Friction over that.
TIMES = (0.99, 1.01, 1.1, 1.3, 1.7, 2.5)
#: A sphere that went so far, over the radius, is no longer held.
FALLEN = 1e-3
UNTIL = 0.3  # s


def centres(layers: int, shape: str) -> Iterator[tuple[float, float, float]]:
    """Of all spheres, over the radius."""
    for layer in range(layers):
        side = layers - layer
        for i in range(side):
            if shape == "planar":
                yield 2 * i + layer, 0.0, 1 + layer * np.sqrt(3.0)
                continue
            for j in range(side - i if shape == "triangular" else side):
                if shape == "triangular":
                    across = j * np.sqrt(3.0) + layer / np.sqrt(3.0)
                    yield 2 * i + j + layer, across, 1 + layer * 2 * np.sqrt(2 / 3)
                else:
                    yield 2 * i + layer, 2 * j + layer, 1 + layer * np.sqrt(2.0)


def pyramid(
    layers: int, shape: str, friction: float, stretched: float = 0.0, floor: float = 1.0
) -> carom.Scene:
    """`stretched`: half of the gaps between spheres, over the radius; `floor`: its friction, over that of spheres."""
    scene = carom.Scene(gravity=(0.0, 0.0, -G), run={"step": 1e-3})
    scene.contact("ball", "ball", friction=friction, restitution=0.3)
    scene.contact("ball", "floor", friction=floor * friction, restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    for number, centre in enumerate(centres(layers, shape)):
        x, y, z = ((1.0 + stretched) * RADIUS * float(c) for c in centre)
        scene.sphere(f"b{number}", radius=RADIUS, density=2500, material="ball", position=(x, y, z))
    return scene


def outcome(scene: carom.Scene) -> tuple[float, float] | str:
    """Largest way of a sphere over the radius, and largest rise of energy in a step; or why the run stopped."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = carom.simulate(scene, until=UNTIL, every=100)
        except carom.RunFailed as error:
            return str(error).split(";")[0][:40]
    way = np.linalg.norm(np.asarray(result.position[-1]) - np.asarray(result.position[0]), axis=1)
    return float(way.max()) / RADIUS, result.summary["energy"]["max_rise_relative"]


def put_down(stretched: list[float]) -> None:
    rows = []
    for (layers, shape), least in LEAST.items():
        for times in TIMES[1:]:
            row = [f"{shape}, {layers}", f"{times}"]
            for gap in stretched:
                found = outcome(pyramid(layers, shape, round(times * least, 4), gap))
                row.append(found if isinstance(found, str) else f"{found[0]:.1e}")
            rows.append(row)
    print("way of a sphere over the radius, by half of the gaps over the radius\n")
    print(table(["pyramid", "mu over least", *(f"{gap:g}" for gap in stretched)], rows))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stretched", type=float, nargs="+", metavar="GAP")
    if stretched := parser.parse_args().stretched:
        put_down(stretched)
        return 0
    rows, wrong = [], 0
    for (layers, shape), least in LEAST.items():
        for times in TIMES:
            friction = round(times * least, 4)
            name = f"{shape}, {layers}"
            found = outcome(pyramid(layers, shape, friction))
            if isinstance(found, str):
                rows.append([name, f"{friction}", f"{times}", "-", "-", found])
                wrong += 1
                continue
            drift, rise = found
            what = "fell" if drift > FALLEN else "held"
            wrong += (what == "held") != (times > 1.0)
            rows.append([name, f"{friction}", f"{times}", f"{drift:.1e}", f"{rise:.1e}", what])
    print(table(["pyramid", "mu", "over least", "drift/r", "rise", ""], rows))
    print(f"\n{wrong} did not do as friction says")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
