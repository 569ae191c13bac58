"""Shipped scenarios of grains, each with numbers that theory or literature knows; the files name the sources."""

from __future__ import annotations

import itertools
from math import exp, pi
from typing import Any

import carom
import numpy as np
import pytest
from carom import granular
from carom.cli.examples import find
from numpy.typing import NDArray

G = 9.8
F64 = NDArray[np.float64]
SIDES = ("low x", "high x", "low y", "high y")


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


def carried(result: carom.Result, start: float) -> dict[str, float]:
    """Share of the weight on each wall from the frame at `start` to the end, less what the fall of the grains keeps of it.

    The impulses of the walls hold up the grains and change their momentum, so the shares of all walls and that part add up
    to one, whether the grains are at rest or not.
    """
    time = np.asarray(result.time)
    first = int(np.argmin(np.abs(time - start)))
    total = weight(result) * float(time[-1] - time[first])
    return {name: -float(np.sum(w.impulse[first + 1 :, 2])) / total for name, w in result.walls.items()}


def slowing(result: carom.Result, start: float) -> float:
    """Change of the grains' upward momentum from the frame at `start` to the end, over the impulse of their weight."""
    time = np.asarray(result.time)
    first = int(np.argmin(np.abs(time - start)))
    change = (np.asarray(result.velocity[-1]) - np.asarray(result.velocity[first]))[:, 2]
    return float(change @ result.bodies["mass"]) / (weight(result) * float(time[-1] - time[first]))


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
    share = carried(result, 0.5)
    assert share["floor"] == pytest.approx(1, rel=2e-2)
    assert share["floor"] == pytest.approx(1 + slowing(result, 0.5), rel=1e-9)
    assert [share[name] for name in SIDES] == pytest.approx([0, 0, 0, 0], abs=1e-12)


def test_a_floor_between_rough_walls_feels_what_janssen_says() -> None:
    """Janssen 1895, with K between 1/4 (Rankine, grains that yield at 37 degrees) and 1."""
    result = simulated("settling_box")
    p = result.parameters
    position = np.asarray(result.position[-1])
    height = float(np.sort(position[:, 2])[-8:].mean() + p["r"])
    x = 4 * p["wall_friction"] * height / p["side"]
    share = carried(result, 0.55)
    assert (1 - exp(-x)) / x < share["floor"] < (1 - exp(-x / 4)) / (x / 4)
    # Friction of the sinking grains holds them up at every wall, and with the floor the four walls hold all of the weight.
    assert min(share[name] for name in SIDES) > 0.02
    assert sum(share.values()) == pytest.approx(1 + slowing(result, 0.55), rel=1e-9)


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


# --- moving floor ---------------------------------------------------------------------------------------------


def shaken(gamma: float) -> tuple[F64, F64, F64]:
    """Times (s), height of the floor and height of the lowest point of the layer, m."""
    text = find("shaken_layer").read_text(encoding="utf-8")
    assert "1.8*9.8" in text
    result = carom.simulate(carom.Scene.from_toml(text.replace("1.8*9.8", f"{gamma}*9.8")))
    assert result.outcome.ok
    time, w = np.asarray(result.time), 40 * pi
    floor = gamma * G / w**2 * (1 - np.cos(w * time))
    return time, floor, np.asarray(result.position)[:, :, 2].min(axis=1) - result.parameters["r"]


def test_a_shaken_layer_flies_as_one_inelastic_ball() -> None:
    gamma, w, h = 1.8, 40 * pi, 2.5e-4
    time, floor, lowest = shaken(gamma)
    start, amplitude = np.arccos(-1 / gamma) / w, gamma * G / w**2
    z, v = amplitude * (1 + 1 / gamma), amplitude * w * np.sin(w * start)
    fine = np.linspace(start + 4e-3, 0.075, 100_000)
    above = z + v * (fine - start) - 0.5 * G * (fine - start) ** 2 > amplitude * (1 - np.cos(w * fine))
    end = float(fine[np.argmin(above)])
    flying = (time > start) & (time < end)
    gap = z + v * (time - start) - 0.5 * G * (time - start) ** 2 - floor
    assert np.abs(lowest - floor - gap)[flying].max() < 0.01 * gap[flying].max()
    landed = (time > end + 2 * h) & (time < start + 2 * pi / w - 2 * h)  # until it takes off again
    assert landed.sum() > 20
    assert np.abs(lowest - floor)[landed].max() < 1e-7  # no rebound


def test_below_gravity_a_shaken_layer_stays_on_the_floor() -> None:
    _, floor, lowest = shaken(0.9)
    assert np.abs(lowest - floor).max() < 1e-7


# --- drum -----------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_drum_lifts_its_grains_by_the_angle_of_repose_and_feels_their_weight() -> None:
    result = simulated("rotating_drum")
    steady = np.asarray(result.time) > 1.5
    centre = np.average(np.asarray(result.position)[steady], axis=1, weights=result.bodies["mass"])
    torque = np.asarray(result.walls["drum"].torque)[steady, 1].mean()
    assert torque == pytest.approx(weight(result) * centre[:, 0].mean(), rel=0.03)
    slope = np.degrees(np.arctan2(-centre[:, 0].mean(), -centre[:, 2].mean()))
    assert 20 < slope < 35


# --- hoppers --------------------------------------------------------------------------------------------------


def emptying(result: carom.Result) -> tuple[float, float]:
    """Grains per second through the plane z = 0 while the hopper goes from 85 to 65 and from 65 to 45 per cent."""
    z = np.asarray(result.position)[:, :, 2]
    above = (z > 0).sum(axis=1)  # those that have left are NaN
    time = np.asarray(result.time)
    at = [time[np.argmax(above <= share * above[0])] for share in (0.85, 0.65, 0.45)]
    passed = 0.2 * above[0]
    return passed / (at[1] - at[0]), passed / (at[2] - at[1])


@pytest.mark.long
def test_a_slot_empties_at_the_rate_of_beverloo() -> None:
    result = simulated("hopper_slot")
    p = result.parameters
    r, width = p["r"], p["L"]
    position = np.asarray(result.position)
    fraction = packing_fraction(
        position[int(np.searchsorted(np.asarray(result.time), 0.14))],
        r,
        np.array([-p["side"] / 4, 2 * r, 4 * r]),
        np.array([p["side"] / 4, width - 2 * r, 0.08]),
    )
    first, second = emptying(result)
    assert second == pytest.approx(first, rel=0.15)
    law = fraction * np.sqrt(G) * (p["B"] - 1.4 * 2 * r) ** 1.5 * (width - 1.4 * 2 * r) / (4 / 3 * pi * r**3)
    assert 0.5 * (first + second) == pytest.approx(1.03 * law, rel=0.2)


# --- avalanche, heap ------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_tilted_box_slides_to_the_angle_of_repose() -> None:
    result = simulated("avalanche")
    time = np.asarray(result.time)
    angle = np.interp(time, [0.2, 2.0], [0.0, pi / 4])
    position = np.asarray(result.position)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = position[:, :, 0] * c - position[:, :, 2] * s  # in the frame of the box
    above = position[:, :, 0] * s + position[:, :, 2] * c
    settled, little = (int(np.argmin(np.abs(time - t))) for t in (0.18, 0.64))
    r = result.parameters["r"]
    assert np.abs(along[little] - along[settled]).mean() < 0.5 * r  # at 10 degrees nothing has slid
    assert (along[-1] - along[settled]).mean() > r
    edges = np.linspace(0.1, 0.9, 11) * result.parameters["side"]
    middle, top = [], []
    for low, high in itertools.pairwise(edges):
        inside = (along[-1] > low) & (along[-1] <= high)
        middle.append(along[-1][inside][np.argmax(above[-1][inside])])
        top.append(above[-1][inside].max())
    slope = 45 - np.degrees(np.arctan(np.polyfit(middle, top, 1)[0]))
    assert 20 < slope < 30


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.long), pytest.param(3, marks=pytest.mark.long)]
)
def test_a_heap_has_the_angle_of_repose(seed: int) -> None:
    result = simulated("heap", values={"seed": seed})
    assert result.summary["removed"] > 100  # it ran over: no steeper column that was never in motion
    assert np.nanmax(np.abs(result.velocity[-1])) < 0.01  # m/s
    # The slope is some five diameters long: cells of the usual width leave too few points on it.
    heap = granular.heap_angle(result, centre=(0.0, 0.0, 0.0), cell=1.5)
    assert 20 < heap.degrees < 35
    assert heap.error < np.radians(5)
