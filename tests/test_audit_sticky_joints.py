"""The auditor on joined balls that attract: what joints hand on of a pull is on no record."""

from __future__ import annotations

import carom
import numpy as np
import pytest


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_a_ball_on_a_rod_that_is_pulled_and_swings_is_right(share: float) -> None:
    """The rod pulls ball `b` inwards, by the swing, and pushes it outwards, by what pulls `a`: at a share of 1 nothing is
    left of both. How far `b` comes into the reach of `q` is told by the swing alone, as pulls come later in the step.
    """
    pull, mass, length, radius, reach = 0.3, 0.1, 0.1, 0.02, 2e-3
    speed = np.sqrt(share * pull / (mass * length)) * length / 2
    scene = carom.Scene("rod", gravity=(0, 0, 0), run={"step": 5e-4, "until": 5e-4})
    scene.contact("m", "m", friction=0, restitution=0, cohesion=pull, rupture_distance=reach)
    ends = (-length / 2, 0, 0), (length / 2, 0, 0)
    ball = {"radius": radius, "material": "m"}
    scene.sphere("a", mass=mass, at=ends[0], velocity=(0, -speed, 0), **ball)
    scene.sphere("b", mass=mass, at=ends[1], velocity=(0, speed, 0), **ball)
    scene.sphere("p", radius=0.01, mass=1, material="m", at=(-0.0199, 0, 0), velocity=(0, -speed, 0))
    away = 2 * radius + reach + 3e-5
    scene.sphere("q", mass=1, at=(length / 2 + 0.6 * away, 0.8 * away, 0), **ball)
    scene.joint("rod", between=("a", "b"), points=ends)
    report = carom.audit.check(carom.simulate(scene))
    assert report.ok, report.findings
    assert report["momentum"].judged == 4
