"""Steps that nothing solves: what Carom does by itself, and what its message advises."""

from __future__ import annotations

import re
from pathlib import Path

import carom
import numpy as np
import pytest
from carom import CaromError

WEDGED = Path(__file__).parent / "data" / "wedged" / "position.toml"


def heap() -> carom.Scene:
    return carom.example("heap", parameters={"rolling": 0.4, "seed": 2})


def test_a_step_that_is_not_solved_is_halved() -> None:
    result = carom.simulate(WEDGED, position_friction="paper")
    assert result.outcome.kind == "done"
    halved = np.asarray(result.steps["halvings"])
    assert halved.max() >= 1
    assert result.summary["halvings"] == halved.sum()


def test_sequences_that_are_cut_early_need_no_halves() -> None:
    """Bisected restitution left this heap unsolved in four halvings; then sweeps left some problems of rolling grains, which
    alternating directions solve. Of some 136 cut sequences none needs a halving.
    """
    cut = halved = 0
    for problems in (30, 40, 50, 60):
        result = carom.simulate(heap(), until=0.06, max_problems=problems)
        assert result.outcome.kind == "done"
        assert result.summary["unconverged"] == 0
        cut += result.summary["truncated_sequences"]
        halved += int((np.asarray(result.steps["halvings"]) > 0).sum())
    assert cut > 100
    assert halved == 0


def test_whoever_sets_the_halvings_gets_them_and_the_advice_that_is_left() -> None:
    with pytest.raises(CaromError) as caught:
        # A tolerance below rounding, which no rescue reaches.
        carom.simulate(
            WEDGED, position_friction="paper", max_halvings=3, tolerance=1e-15, pile_tolerance=1e-15
        )
    told = str(caught.value)
    assert re.search(r"not converged at step \d+", told)
    assert re.search(r"; try (pile_tolerance = 1e-[34] or )?max_halvings = 8$", told)
    assert "max_iterations" not in told
    assert "smaller step" not in told


DEPOSIT = """
format = 1
title = "grains of much friction fall in a periodic box"
run = { until = 0.06, step = 1e-3, pile_tolerance = 1e-4 }
world = { gravity = [0, 0, -9.81], periodic = [0.05, 0.05, 0] }
material = [{ name = "g" }]
contact = [{ between = ["g", "g"], friction = 3.0, restitution = 0.3 }]
plane = [{ name = "floor", material = "g", point = [0, 0, 0], normal = [0, 0, 1] }]

[[packing]]
name = "g"
material = "g"
density = 2500
sizes = "uniform"
smallest = "3 mm"
largest = "5 mm"
count = 1500
seed = 1
low = [0, 0, 0]
high = [0.05, 0.05, 0.08]
periodic = "xy"
"""


@pytest.mark.long
def test_a_pile_that_jams_goes_on_with_less_friction_and_gains_no_energy() -> None:
    """It stopped at step 51: islands of more than 500 contacts had no rescue but halves of the step."""
    result = carom.simulate(carom.Scene.from_toml(DEPOSIT))
    assert result.outcome.kind == "done"
    assert result.summary["fallbacks"] > 0
    energy = np.asarray(result.steps["energy_kinetic"] + result.steps["energy_potential"])
    assert np.diff(energy).max() < 1e-6 * energy[0]
