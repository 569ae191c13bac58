"""Steps that nothing solves: what Carom does by itself, and what its message advises."""

from __future__ import annotations

import re

import carom
import numpy as np
import pytest
from carom.errors import CaromError

STUCK = {"until": 0.06, "max_problems": 50}
"""Until behind the step of this heap that is not solved in four halvings, with the sequences with which it was found."""


def heap() -> carom.Scene:
    return carom.example("heap", set={"rolling": 0.4, "seed": 2})


def test_a_step_that_four_halvings_do_not_solve_is_halved_on() -> None:
    result = carom.simulate(heap(), **STUCK)
    assert result.outcome.kind == "done"
    halved = np.asarray(result.steps["halvings"])
    # Five levels of halvings and more, and each step of the rescue counts as a fallback.
    assert halved.max() >= 5
    assert result.steps["fallbacks"][int(halved.argmax())] >= 1
    assert result.summary["halvings"] == halved.sum()


def test_whoever_sets_the_halvings_gets_them_and_the_advice_that_is_left() -> None:
    with pytest.raises(CaromError) as caught:
        carom.simulate(heap(), **STUCK, max_halvings=3)
    told = str(caught.value)
    assert "not converged at step 51" in told
    assert re.search(r"; try (pile_tolerance = 1e-[34] or )?max_halvings = 8$", told)
    assert "max_iterations" not in told
    assert "smaller step" not in told
