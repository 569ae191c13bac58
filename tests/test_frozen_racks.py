"""Racks of touching balls: their gaps are rounding of coordinates, and no step may spend its time on closing them."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom import billiards

STAYS = 1e-12  # m; what a rack at rest may move by in all steps of a test


def frozen(
    step: float, steps: int, friction: float = 0.06, balls: int = 15, away: float = 0.0
) -> carom.Scene:
    """A tight rack on a rough bed, `away` m from the origin."""
    r = 0.028575
    scene = carom.Scene("frozen rack", run={"until": steps * step, "step": step})
    scene.contact("ball", "ball", friction=friction, restitution=0.95)
    scene.contact(
        "ball", "cloth", friction=0.2, restitution=0.5, rolling_radius="0.3 mm", spinning_radius="0.6 mm"
    )
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
    rack = {"apex": (1.905 + away, 0.635, r), "direction": (1, 0, 0), "radius": r, "mass": 0.17}
    scene.rack("ball", balls=balls, material="ball", **rack)
    return scene


@pytest.mark.parametrize("step", [1e-3, 5e-5, 1e-5, 2e-6])
@pytest.mark.parametrize(("away", "most"), [(0.0, 0), (20.0, 5)])
def test_at_rest_it_needs_no_fallback(step: float, away: float, most: int) -> None:
    """Twenty metres away roundings are larger: what steps leave of gaps adds up and is closed now and then."""
    result = carom.simulate(frozen(step, 50, away=away))
    assert np.count_nonzero(result.steps["fallbacks"]) <= most
    moved = np.abs(result.position[-1] - result.position[0]).max()
    assert moved < STAYS
    # It rests on the bed by its weight: the velocity level holds it whatever the gaps are.
    assert np.abs(result.velocity[-1]).max() < 1e-7 * 9.8 * step * 15


@pytest.mark.parametrize("friction", [0.06, 0.5])
def test_a_break_needs_no_fallback(friction: float) -> None:
    scene = frozen(5e-5, 800, friction=friction)
    scene.sphere(
        "cue", radius=0.028575, mass=0.17, at=(1.7, 0.64, 0.028575), velocity=(9, 0.1, 0), material="ball"
    )
    result = carom.simulate(scene)
    assert not result.steps["fallbacks"].any()
    speeds = np.linalg.norm(result.velocity[-1], axis=1)
    assert np.sum(speeds > 0.1) > 8  # the rack is open


def test_the_kit_breaks_a_frozen_rack() -> None:
    table = billiards.table("9ft")
    scene = table.scene("a break", until=0.05, step=5e-5)
    table.rack(scene, 15)
    cue = table.cue_ball(scene, at=(1.75, 0.64))
    billiards.strike(cue, ball_speed="9 m/s", direction="0 deg")
    result = carom.simulate(scene)
    assert not result.steps["fallbacks"].any()
