"""What a run of pytest ends with as figures counts trials that fail, and none that were not made."""

from __future__ import annotations

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from trials import Trials


def test_a_trial_that_fails_was_tried_and_did_not_hold() -> None:
    trials = Trials()
    with trials("a"):
        pass
    with pytest.raises(ZeroDivisionError), trials("a"):
        _ = 1 / 0
    with trials("b"):
        pass
    assert trials.lines() == ["a: 1 of 2", "b: 1 of 1"]


def test_a_scene_that_hypothesis_drops_was_not_tried() -> None:
    trials, seen = Trials(), []

    @settings(max_examples=20)
    @given(st.integers(0, 100))
    def law(number: int) -> None:
        with trials("even"):
            assume(number % 2 == 0)
            seen.append(number)

    law()
    assert trials.lines() == [f"even: {len(seen)} of {len(seen)}"]


def test_counts_of_several_tests_are_added_up() -> None:
    total, one = Trials(), Trials()
    with one("a"):
        pass
    for _ in range(3):
        total.add([("of another plugin", 1), *one.properties()])
    assert total.lines() == ["a: 3 of 3"]
