"""What only rounding makes is no fault: places of walls after many of their periods."""

from __future__ import annotations

import carom
import numpy as np


def test_a_ball_on_a_plate_that_has_shaken_for_long_is_right() -> None:
    """The plate's phase has the rounding of its time, which is more than that of its small way."""
    rate = 40.0 * np.pi
    scene = carom.Scene("plate", run={"until": 2.0, "step": 1e-3}, record={"every": 1})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    scene.sphere("ball", radius=0.005, mass=0.001, at=(0, 0, 0.005), material="m")
    way = f"{3.0 * 9.8 / rate**2!r}*sin({rate!r}*t)"
    scene.plane(
        "plate",
        point=(0, 0, 0),
        normal=(0, 0, 1),
        material="m",
        motion={"translation": (0, 0, {"expression": way})},
    )
    report = carom.audit.check(carom.simulate(scene))
    assert report.ok, report.findings
    assert report["gap"].judged > 1000
