"""Inflows of many sizes: the diameters follow their law, a file means the same balls, a run goes on bit for bit."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom.scene.tables.flow import Inflow

MANY = 20_000
LOW, HIGH = 0.006, 0.014


def poured(count: int, **sizes: Any) -> carom.Scene:
    """Grains enter over a floor."""
    scene = carom.Scene("sizes", run={"until": 0.2, "step": 2.5e-4})
    scene.contact("sand", "sand", friction=0.4, restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="sand")
    scene.inflow(
        "g", count=count, region={"low": (0, 0, 0.05), "high": (0.1, 0.1, 0.06)}, density=2500, material="sand",
        rate=200.0, velocity=(0, 0, -0.5), seed=3, **sizes,
    )  # fmt: skip
    return scene


def diameters(**sizes: Any) -> Any:
    return 2.0 * np.asarray(poured(MANY, **sizes).to_model()["radius"])


def bell(x: float) -> float:
    return 0.5 * (1.0 + math.erf(x / math.sqrt(2.0)))


def logarithm(d: float) -> float:
    """A lognormal law of mean 10 mm and deviation 3 mm."""
    variance = math.log(1.0 + 0.3**2)
    return bell((math.log(d / 0.010) + 0.5 * variance) / math.sqrt(variance))


@pytest.mark.parametrize(
    ("sizes", "law"),
    [
        ("uniform", lambda d: d),
        ("normal", lambda d: bell((d - 0.010) / 0.003)),
        ("lognormal", logarithm),
    ],
)
def test_diameters_follow_their_law_between_the_limits(sizes: str, law: Callable[[float], float]) -> None:
    """Test of Kolmogorov and Smirnov against the law cut at its limits; 1.63/sqrt(n) is exceeded once in 100 times."""
    shape = {} if sizes == "uniform" else {"mean": 0.010, "deviation": 0.003}
    found = np.sort(diameters(sizes=sizes, smallest=LOW, largest=HIGH, **shape))
    assert LOW <= found[0] < found[-1] <= HIGH
    expected = np.array([(law(d) - law(LOW)) / (law(HIGH) - law(LOW)) for d in found.tolist()])
    ranks = np.arange(MANY) / MANY
    distance = max(np.abs(expected - ranks).max(), np.abs(expected - ranks - 1.0 / MANY).max())
    assert distance < 1.63 / math.sqrt(MANY)


def test_a_table_has_its_shares_of_the_mass() -> None:
    found = diameters(sizes="table", classes=[[0.006, 0.7], [0.012, 0.3]], shares="mass")
    mass = found**3
    assert mass[found == 0.006].sum() / mass.sum() == pytest.approx(0.7, abs=0.02)
    assert set(found.tolist()) == {0.006, 0.012}


def test_a_diameter_is_twice_the_radius_to_the_bit() -> None:
    one, other = poured(5, radius=0.0047).to_model(), poured(5, diameter=0.0094).to_model()
    for name in ("radius", "mass", "inertia"):
        assert np.array_equal(one[name], other[name])


def test_balls_of_many_sizes_enter_and_the_run_goes_on_bit_for_bit(tmp_path: Path) -> None:
    scene = poured(30, sizes="uniform", smallest=LOW, largest=HIGH)
    whole = carom.simulate(scene, out=tmp_path / "whole", every=10)
    carom.simulate(scene, out=tmp_path / "parts", every=10, until=0.09)
    parts = carom.resume(tmp_path / "parts", until=0.2)
    radius, mass = (np.asarray(whole.bodies[name]) for name in ("radius", "mass"))
    assert (whole.events["kind"] == 1).sum() == 30
    assert len(np.unique(radius)) == 30
    assert mass == pytest.approx(2500 * 4 / 3 * np.pi * radius**3, rel=1e-14)
    for name in ("position", "velocity", "angular_velocity"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name), equal_nan=True)
    again = carom.simulate(carom.Scene.from_toml(whole.scenario), out=tmp_path / "again")
    assert np.array_equal(again.bodies["radius"], radius)
    assert np.array_equal(again.position, whole.position, equal_nan=True)
    with h5py.File(tmp_path / "whole" / "results.h5") as file:
        assert len(file["events/time"]) == len(whole.events)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "no size is given; give radius, or diameter, or sizes and its keys"),
        ({"radius": 0.01, "diameter": 0.02}, "both radius and diameter are given"),
        ({"radius": 0.01, "sizes": "uniform", "smallest": LOW, "largest": HIGH}, "both radius and sizes are given"),
        ({"sizes": "uniform", "smallest": LOW}, 'sizes = "uniform" needs largest'),
        ({"sizes": "uniform", "smallest": HIGH, "largest": LOW}, "smallest is above largest"),
        ({"diameter": 0.02, "mean": 0.01}, 'sizes = "equal" has no key mean'),
        (
            {"sizes": "normal", "mean": 0.1, "deviation": 1e-4, "smallest": LOW, "largest": HIGH},
            "diameters lie between 0.006 m and 0.014 m; widen smallest and largest",
        ),
        (
            {"sizes": "uniform", "smallest": LOW, "largest": HIGH, "mass": 1.0, "density": None},
            "mass is that of one ball, and sizes differ; give density alone",
        ),
    ],
)  # fmt: skip
def test_a_mistake_says_cause_and_cure(given: dict[str, Any], told: str) -> None:
    region = {"low": (0, 0, 0.05), "high": (0.1, 0.1, 0.06)}
    with pytest.raises(carom.ScenarioError) as caught:
        carom.Scene().inflow(
            "g", count=9, region=region, material="sand", seed=1, **{"density": 2500, **given}
        )
    assert told in str(caught.value)


def test_the_largest_ball_must_have_room_where_they_enter() -> None:
    with pytest.raises(carom.ScenarioError, match="balls would enter"):
        carom.Scene.from_toml(poured(50, sizes="uniform", smallest=0.09, largest=0.12).to_toml()).validate()


def test_its_keys_of_sizes_are_those_of_packings() -> None:
    from carom.scene.tables.packing import Packing
    from carom.scene.tables.sizes import Sized

    for name in Sized.model_fields:
        assert Inflow.model_fields[name].description == Packing.model_fields[name].description
