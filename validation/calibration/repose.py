"""The angle of the small heap that repose_fit.toml fits.

carom fit repose_fit.toml --measure repose.py:angle    # in this folder: the rolling radius at 28 degrees
python repose.py 0.0188                                # the mean angle at that radius, over 20 other seeds
"""

import sys
from pathlib import Path

import carom
import numpy as np
from carom import granular

SCENE = Path(__file__).parent.parent.parent / "scenarios" / "heap.toml"
SEEDS = range(101, 121)  # none of those that the fit averages over


def angle(result: carom.Result) -> dict[str, float]:
    """What the fit measures, rad."""
    return {"angle": granular.heap_angle(result).angle}


def main(rolling: float) -> None:
    found = []
    for seed in SEEDS:
        scene = carom.Scene.from_toml(SCENE, parameters={"R": 0.036, "rolling": rolling, "seed": seed})
        found.append(np.degrees(angle(carom.simulate(scene))["angle"]))
    error = np.std(found, ddof=1) / np.sqrt(len(found))
    print(f"rolling = {rolling:g}: {np.mean(found):.2f} +- {error:.2f} degrees over {len(found)} seeds")


if __name__ == "__main__":
    main(float(sys.argv[1]))
