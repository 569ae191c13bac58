"""The Gymnasium environment of docs/reference/stepping.md (extra `rl`)."""

from __future__ import annotations

import runpy
from typing import Any

import numpy as np
import pytest
from docs_pages import DOCS

pytest.importorskip("gymnasium")


@pytest.fixture(scope="module")
def env() -> Any:
    return runpy.run_path(str(DOCS / "examples" / "cue_shot.py"))["CueShot"]()


def test_it_keeps_the_rules_of_gymnasium(env: Any) -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(env, skip_render_check=True)


def test_a_shot_leaves_a_table_at_rest_and_repeats_bit_for_bit(env: Any) -> None:
    """From the head spot straight at the foot spot, both balls move along x alone."""
    first, _ = env.reset(seed=1)
    after, reward, done, cut, _ = env.step(np.array([0.0, -0.5, 0.0]))
    assert (reward, done, cut) == (0.0, False, False)
    assert env.sim["object"].speed < 1e-3
    assert abs(after[2] - first[2]) > 0.1
    np.testing.assert_allclose(after[[1, 3]], first[[1, 3]], atol=1e-6)
    env.reset()
    np.testing.assert_array_equal(env.step(np.array([0.0, -0.5, 0.0]))[0], after)


def test_a_ball_in_a_pocket_ends_the_game(env: Any) -> None:
    """The cue ball shot straight into a corner: a foul."""
    start, _ = env.reset()
    corner = np.array(env.table.pockets["head left"])
    dx, dy = corner - start[:2]
    _, reward, done, _, _ = env.step(np.array([np.arctan2(dy, dx) / np.pi, -0.5, 0.0]))
    assert (reward, done) == (-1.0, True)
