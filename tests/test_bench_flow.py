"""The bench of the hopper: its judge, its rate, and a small run of each program that is there."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "benches"))

import _hopper
import flow as bench
import scale

R = 0.004
HOPPER = _hopper.Hopper(r=R, opening=12 * R, tube=10 * R, angle=math.pi / 6)
#: A fill that empties to a half within the time of the test.
SMALL = ("--grains", "200", "--opening", "12", "--tube", "10", "--until", "0.45")


@pytest.mark.parametrize(
    ("place", "shut", "deep"),
    [
        ((0.0, 0.0, 0.75 * R), True, 0.25),  # on the shutter
        ((0.0, 0.0, 0.75 * R), False, 0.0),  # which is gone
        ((9.2 * R, 0.0, 30 * R), True, 0.2),  # in the tube, whose wall is at 10 r
        ((0.0, -9.2 * R, 30 * R), True, 0.2),
        ((9.0 * R, 0.0, 30 * R), True, 0.0),
        # In the cone: 3 r above the opening it is 6 r + 3 r tan(30 deg) wide, and its wall leans by 30 deg.
        (((6 + 3 / math.sqrt(3) - 0.9 / math.cos(math.pi / 6)) * R, 0.0, 3 * R), True, 0.1),
        ((8.0 * R, 0.0, -2 * R), False, 0.0),  # below all of it
    ],
)
def test_overlaps_with_the_walls(place: tuple[float, float, float], shut: bool, deep: float) -> None:
    assert HOPPER.deepest(np.array([place]), shut) == pytest.approx(deep, abs=1e-12)


def test_overlaps_of_grains() -> None:
    pair = np.array([[0.0, 0.0, 20 * R], [0.0, 1.7 * R, 20 * R]])
    assert HOPPER.deepest(pair, shut=False) == pytest.approx(0.3)
    assert HOPPER.deepest(pair[:0], shut=False) == 0.0


def test_the_law_grows_with_the_opening_to_the_power_5_2() -> None:
    """A flat floor (45 deg) of solid fraction 0.6: 0.58 rho g^(1/2) (D - 1.4 d)^(5/2) over the mass of a grain."""
    flat = _hopper.Hopper(r=R, opening=12 * R, tube=10 * R, angle=math.pi / 4)
    mass = 2500 * 4 / 3 * math.pi * R**3
    assert flat.law(0.6, 9.8) == pytest.approx(0.58 * 1500 * math.sqrt(9.8) * (9.2 * R) ** 2.5 / mass)
    wide = _hopper.Hopper(r=R, opening=21.2 * R, tube=20 * R, angle=math.pi / 4)
    assert wide.law(0.6, 9.8) / flat.law(0.6, 9.8) == pytest.approx(2**2.5)
    assert HOPPER.law(0.6, 9.8) / flat.law(0.6, 9.8) == pytest.approx(math.tan(math.pi / 6) ** -0.35)


def test_the_solid_fraction_of_a_lattice() -> None:
    """A cubic lattice of touching spheres fills pi/6 of the space."""
    side = np.arange(-10, 11, 2.0)
    x, y, z = np.meshgrid(side + 0.3, side - 0.2, np.arange(0.0, 60.0, 2.0), indexing="ij")
    found = HOPPER.solid(R * np.stack([x, y, z], axis=-1).reshape(-1, 3))
    assert found == pytest.approx(math.pi / 6, rel=0.05)
    assert math.isnan(HOPPER.solid(np.zeros((5, 3))))


def test_the_rate_is_that_of_the_middle() -> None:
    """1000 grains a second, but late at the start and dribbling at the end."""
    time = np.linspace(0.0, 2.0, 201)
    above = np.where(time < 0.2, 1000, np.maximum(1200 - 1000 * time, 300 - 50 * (time - 0.9)))
    assert _hopper.rate(time.tolist(), above.tolist(), 1000) == pytest.approx(1000.0)
    assert math.isnan(_hopper.rate([0.0, 1.0], [1000, 1000], 1000))


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, *given: str) -> list[Any]:
    monkeypatch.setattr(sys, "argv", ["flow.py", *SMALL, *given])
    return list(bench.rows(bench.arguments(), folder))


def test_a_small_hopper_in_carom_and_a_peer_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("CAROM_LAMMPS_PYTHON", raising=False)
    monkeypatch.setattr(scale, "PEERS", tmp_path / "bin" / "none")
    carom, *others = run(monkeypatch, tmp_path, "--rayleigh", "0.2")
    assert carom.complete
    assert carom.told["above"][0] == 200
    assert carom.told["above"][25] == 200  # the shutter holds them
    assert carom.told["above"][-1] < 100
    assert carom.told["deepest"] < 1e-3
    assert ["not installed" in row.why for row in others] == [True]
    table = "\n".join(bench.lines([carom, *others]))
    assert f"{carom.told['rate']:.0f}" in table
    assert "not installed" in table


def test_both_programs_empty_it_at_the_same_rate(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if isinstance(scale.peers()["LAMMPS"], str):
        pytest.skip("LAMMPS is not installed (make .venv/peers/made)")
    carom, peer = run(monkeypatch, tmp_path, "--rayleigh", "0.2")
    assert peer.complete, peer.why
    assert peer.told["above"][25] == 200
    # 120 grains are counted, so that a rate scatters by some per cent.
    assert peer.told["rate"] == pytest.approx(carom.told["rate"], rel=0.15)
    assert 1e-3 < peer.told["deepest"] < 0.2
