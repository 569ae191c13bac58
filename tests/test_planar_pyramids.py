"""Planar pyramids of touching spheres: at rest above their least friction at the cost of a look, falling below it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import carom
import numpy as np
import pytest

FILE = Path(__file__).parents[1] / "validation" / "pyramids" / "rest.py"
SPEC = importlib.util.spec_from_file_location("rest", FILE)
assert SPEC is not None
assert SPEC.loader is not None
rest = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(rest)


def way(layers: int, friction: float, floor: float, steps: int) -> float:
    """The largest of a sphere, over the radius."""
    scene = rest.pyramid(layers, "planar", friction, floor=floor)
    result = carom.simulate(scene, until=steps * 1e-3, every=steps)
    assert not result.steps["halvings"].any()
    moved = np.linalg.norm(result.position[-1] - result.position[0], axis=1)
    return float(moved.max()) / rest.RADIUS


@pytest.mark.parametrize("floor", [1.0, 0.34])
@pytest.mark.parametrize("layers", [2, 3, 5, 10])
def test_it_stays_above_its_friction_and_falls_below_it(layers: int, floor: float) -> None:
    """A third of the friction is enough at the floor."""
    least = rest.LEAST[layers, "planar"]
    assert way(layers, 1.01 * least, floor, 100) < 1e-9
    assert way(layers, 0.99 * least, floor, 100) > 1e-3


def test_one_of_1275_balls_stays() -> None:
    """Its matrices are sparse: what counts is the size of their factors, not the number of contacts."""
    assert way(50, 0.7, 1.0, 5) < 1e-10
