"""Shipped scenarios of grains, each with numbers that theory or literature knows; the files name the sources."""

from __future__ import annotations

import functools
import itertools
from math import exp, pi
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import granular
from carom.cli.examples import find
from numpy.typing import NDArray

G = 9.8
F64 = NDArray[np.float64]
#: Single packings scatter; the law is for the mean of the long tier.
several_seeds = pytest.mark.parametrize("seeds", [(2,), pytest.param((1, 2, 3), marks=pytest.mark.long)])
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


@several_seeds
def test_a_floor_between_rough_walls_feels_what_janssen_says(seeds: tuple[int, ...]) -> None:
    """Janssen 1895, with K between 1/4 (Rankine, grains that yield at 37 degrees) and 1.

    For the mean of some packings: how much of its friction each has mobilised is left to its history.
    """
    text = find("settling_box").read_text(encoding="utf-8")
    assert text.count("seed = 1") == 1
    floors, bounds = [], []
    for seed in seeds:
        result = carom.simulate(carom.Scene.from_toml(text.replace("seed = 1", f"seed = {seed}")))
        assert result.outcome.ok
        p = result.parameters
        position = np.asarray(result.position[-1])
        height = float(np.sort(position[:, 2])[-8:].mean() + p["r"])
        x = 4 * p["wall_friction"] * height / p["side"]
        bounds.append([(1 - exp(-x)) / x, (1 - exp(-x / 4)) / (x / 4)])
        share = carried(result, 0.55)
        floors.append(share["floor"])
        # Friction of the sinking grains holds them up at every wall; floor and walls hold all of the weight.
        assert min(share[name] for name in SIDES) > 0.02
        assert sum(share.values()) == pytest.approx(1 + slowing(result, 0.55), rel=1e-9)
    low, high = np.mean(bounds, axis=0)
    assert low < np.mean(floors) < high


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


def discharge(result: carom.Result, start: float, stop: float) -> float:
    """Grains per second through the plane z = 0 while what is above it goes from one share of all grains to another."""
    above = (np.asarray(result.position)[:, :, 2] > 0).sum(axis=1)  # those that have left are NaN
    between = (above < start * above[0]) & (above > stop * above[0])
    assert between.sum() > 5
    return -float(np.polyfit(np.asarray(result.time)[between], above[between], 1)[0])


def emptying(result: carom.Result) -> tuple[float, float]:
    """Grains per second while the hopper goes from 85 to 65 and from 65 to 45 per cent."""
    return discharge(result, 0.85, 0.65), discharge(result, 0.65, 0.45)


@pytest.mark.long
def test_a_slot_empties_at_the_rate_of_beverloo() -> None:
    """For the mean of six packings: arches come and go in the slot, and rates of 200 grains scatter by 6 per cent. Of 20
    packings the second rate is 1.02 of the first in the mean, and 0.88 to 1.23 in single ones.
    """
    rates, laws = [], []
    for seed in range(1, 7):
        result = simulated("hopper_slot", values={"seed": seed})
        p = result.parameters
        r, width = p["r"], p["L"]
        fraction = packing_fraction(
            np.asarray(result.position)[int(np.searchsorted(np.asarray(result.time), 0.14))],
            r,
            np.array([-p["side"] / 4, 2 * r, 4 * r]),
            np.array([p["side"] / 4, width - 2 * r, 0.08]),
        )
        rates.append(emptying(result))
        free = (p["B"] - 1.4 * 2 * r) ** 1.5 * (width - 1.4 * 2 * r)
        laws.append(1.03 * fraction * np.sqrt(G) * free / (4 / 3 * pi * r**3))
    first, second = np.mean(rates, axis=0)
    assert second == pytest.approx(first, rel=0.15)
    assert 0.5 * (first + second) == pytest.approx(np.mean(laws), rel=0.2)


def out_of_a_cone(*, until: float = 0.8, **values: float) -> tuple[carom.Result, float, float]:
    """The emptied cone, its rate and that of Beverloo, Rose and Tanaka, in grains per second."""
    result = simulated("hopper_cone", values=values, until=until)
    p = result.parameters
    r, opening = p["r"], p["D"]
    settled = np.asarray(result.position)[int(np.searchsorted(np.asarray(result.time), 0.24))]
    top = float(np.quantile(settled[:, 2], 0.8))
    fraction = packing_fraction(
        settled, r, np.array([-opening / 3, -opening / 3, 4 * r]), np.array([opening / 3, opening / 3, top])
    )
    flat = 0.58 * fraction * np.sqrt(G) * (opening - 1.4 * 2 * r) ** 2.5 / (4 / 3 * pi * r**3)
    return result, discharge(result, 0.9, 0.4), flat * (np.tan(p["angle"]) * np.tan(pi / 4)) ** -0.35


def test_a_cone_empties_at_the_rate_of_beverloo() -> None:
    _, rate, law = out_of_a_cone(until=0.5, N=400)
    assert rate == pytest.approx(law, rel=0.2)


@pytest.mark.long
def test_the_rate_of_a_cone_grows_with_the_opening_to_the_power_5_2() -> None:
    """A fluid would empty through a hole at a rate that grows with its area, and falls with the height above it."""
    narrow, slow, slow_law = out_of_a_cone()
    wide, fast, fast_law = out_of_a_cone(until=0.65, D=0.064, radius=0.056, N=1400)
    for result, rate, law in ((narrow, slow, slow_law), (wide, fast, fast_law)):
        assert rate == pytest.approx(law, rel=0.15)
        first, second = emptying(result)
        assert second == pytest.approx(first, rel=0.15)
    d = 2 * narrow.parameters["r"]
    free = [result.parameters["D"] - 1.4 * d for result in (narrow, wide)]
    assert np.log(fast / slow) / np.log(free[1] / free[0]) == pytest.approx(2.5, abs=0.3)


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


@functools.cache
def heap(seed: int, rolling: float = 0.0) -> tuple[granular.HeapAngle, int]:
    """Angle of a heap that came to rest, and how many ran over the rim: no steeper column that was never in motion."""
    result = simulated("heap", values={"seed": seed, "rolling": rolling})
    assert result.summary["removed"] > (50 if rolling else 100)
    heaped = result.position[-1, :, 2] > 0  # not what has just left over the edge
    assert np.abs(result.velocity[-1, heaped]).max() < 0.01  # m/s
    return granular.heap_angle(result, centre=(0.0, 0.0, 0.0)), result.summary["removed"]


@several_seeds
def test_heaps_have_the_angle_of_repose(seeds: tuple[int, ...]) -> None:
    """Zhou and others 2002, Carrigy 1970: 20 to 30 degrees. Heaps of some hundred grains differ by some degrees."""
    angles = [heap(seed)[0] for seed in seeds]
    assert all(angle.error < np.radians(5) for angle in angles)
    assert 20 < np.mean([angle.degrees for angle in angles]) < 30


@several_seeds
def test_rolling_friction_makes_heaps_steeper(seeds: tuple[int, ...]) -> None:
    """Zhou and others 2002: the angle of repose grows with rolling friction. So more grains stay.

    (169 to 177 ran over without, 67 to 72 with it.)
    """
    free, rough = (
        np.mean([(angle.degrees, over) for angle, over in (heap(seed, rolling) for seed in seeds)], axis=0)
        for rolling in (0.0, 0.2)
    )
    assert free[0] + 1 < rough[0] < 45
    assert rough[1] < 0.6 * free[1]


# --- column ---------------------------------------------------------------------------------------------------


def collapsed(*, case: str | None = None, until: float = 1.0, **values: float) -> granular.RunOut:
    """Runout of a column that had settled when the gate went."""
    result = simulated("column_collapse", case=case, values=values, until=until)
    speed = np.linalg.norm(np.asarray(result.velocity[-1]), axis=1)
    assert np.nanquantile(speed, 0.95) < 0.02  # m/s: at rest, but for a few that roll
    before = int(np.argmin(np.abs(np.asarray(result.time) - 0.15)))
    spread = granular.run_out(result, start=before, shape="planar", sectors=3)
    assert spread.strays + result.summary["removed"] < 0.05 * len(speed)
    return spread


def test_a_column_runs_out_in_proportion_to_its_height() -> None:
    """Lube and others 2005, Lajeunesse and others 2005: 1.2 a for a below 2 to 3."""
    spread = collapsed(until=0.7)
    assert spread.ratio == pytest.approx(1.2 * spread.aspect, rel=0.25)


def test_a_gate_that_is_drawn_away_at_once_leaves_the_column_its_weight(tmp_path: Path) -> None:
    """Its speed is that of a hundred steps of falling: no measure of what the grains left behind may be allowed to fall."""
    path = tmp_path / "column.toml"
    path.write_text(find("column_collapse").read_text("utf-8").replace("every = 10", "every = 1"), "utf-8")
    result = carom.simulate(carom.Scene.from_toml(path, parameters={"a": 0.5}), until=0.152)
    floor = sum(
        np.asarray(w.impulse)[-10:, 2] for name, w in result.walls.items() if name not in ("wall", "gate")
    )
    share = -floor / (weight(result) * 1e-3)
    assert share[:7] == pytest.approx(1.0, abs=0.1)
    assert np.all(share[7:] > 0.7)  # it begins to collapse
    assert np.all(share[8:] < 0.95)  # in the step after the one in which the gate goes


@pytest.mark.long
def test_columns_run_out_as_far_as_the_law_says() -> None:
    """Over six seeds, which differ by 4 to 7 percent. It grows faster with a than the law (head of the scenario)."""
    for a in (1, 2):
        spreads = [collapsed(a=a, seed=seed) for seed in range(1, 7)]
        mean, aspect = np.mean([(s.ratio, s.aspect) for s in spreads], axis=0)
        assert mean == pytest.approx(1.2 * aspect, rel=0.15)


@pytest.mark.long
def test_a_tall_column_runs_out_less_than_in_proportion() -> None:
    """The same sources: 1.9 a^(2/3) for a above 3."""
    spread = collapsed(case="tall")
    assert spread.aspect > 5
    assert spread.ratio == pytest.approx(1.9 * spread.aspect ** (2 / 3), rel=0.25)
