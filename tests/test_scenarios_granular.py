"""Shipped scenarios of grains, each with numbers that theory or literature knows; the files name the sources."""

from __future__ import annotations

from math import exp
from typing import Any

import carom
import numpy as np
import pytest
from carom.cli.examples import find
from numpy.typing import NDArray

G = 9.8
F64 = NDArray[np.float64]


def simulated(
    name: str, *, case: str | None = None, values: dict[str, Any] | None = None, **options: Any
) -> carom.Result:
    """A scenario file of the package, run to its end without an unconverged step."""
    result = carom.simulate(carom.Scene.from_toml(find(name), case=case, set=values), **options)
    assert result.outcome.ok
    assert result.summary["unconverged"] == 0
    return result


def weight(result: carom.Result) -> float:
    """Weight of all grains, N."""
    return float(np.sum(result.bodies["mass"]) * G)


def carried(result: carom.Result, plane: str, frames: int) -> float:
    """Vertical force of the grains on a plane, N: mean over the last `frames` intervals between frames."""
    contacts = result.contacts.between(plane)
    last = np.asarray(contacts.frame) >= len(result.time) - frames
    impulse = np.asarray(contacts.impulse)[last, 2].sum()
    time = np.asarray(result.time)
    return float(abs(impulse) / (time[-1] - time[-1 - frames]))


def packing_fraction(position: F64, r: float, low: F64, high: F64) -> float:
    """Solid fraction of a box, by points of a fine grid inside spheres."""
    n = 60
    axes = [np.linspace(a, b, n, endpoint=False) + (b - a) / (2 * n) for a, b in zip(low, high)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    near = position[((position > low - r) & (position < high + r)).all(axis=1)]
    filled = np.zeros(len(points), dtype=bool)
    for centre in near:
        filled |= np.sum((points - centre) ** 2, axis=1) < r * r
    return float(filled.mean())


# --- settling box ---------------------------------------------------------------------------------------------


def test_a_floor_between_smooth_walls_carries_all_of_the_weight() -> None:
    """Hydrostatics: with walls that carry nothing, the pressure on the floor is that of all that is above."""
    result = simulated("settling_box", case="smooth walls")
    assert carried(result, "floor", 4) == pytest.approx(weight(result), rel=2e-3)


def test_rough_walls_carry_a_part_of_it() -> None:
    """Janssen 1895: the share of the floor is at least (1 - exp(-x))/x, x = 4 mu K H/D with K = 1."""
    result = simulated("settling_box")
    p = result.parameters
    position = np.asarray(result.position[-1])
    height = float(np.sort(position[:, 2])[-8:].mean() + p["r"])
    x = 4 * p["wall_friction"] * height / p["side"]
    share = carried(result, "floor", 4) / weight(result)
    assert (1 - exp(-x)) / x < share < 0.9
    # What the floor does not carry, the four walls do: the grains are at rest.
    walls = sum(carried(result, name, 4) for name in ("low x", "high x", "low y", "high y"))
    assert walls + share * weight(result) == pytest.approx(weight(result), rel=2e-3)


# --- pile -----------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_a_settled_pile_is_between_random_loose_and_random_close(seed: int) -> None:
    """Onoda and Liniger 1990: 0.55; Scott 1960: 0.64. Two diameters of margin to walls and floor, one below the surface."""
    result = simulated("pile", values={"seed": seed})
    side, r = result.parameters["side"], result.parameters["r"]
    position = np.asarray(result.position[-1])
    top = float(np.quantile(position[:, 2], 0.9))
    low, high = np.full(3, 4 * r), np.array([side - 4 * r, side - 4 * r, top - 2 * r])
    assert 0.55 < packing_fraction(position, r, low, high) < 0.64
    assert result.summary["penetration_max_relative"] < 1e-4
