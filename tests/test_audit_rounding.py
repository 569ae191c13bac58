"""What only rounding makes is no fault: places of walls after many of their periods."""

from __future__ import annotations

import itertools

import carom
import numpy as np
import pytest


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
    assert report["gap"].judged > 100


def test_balls_that_a_lid_presses_in_a_box_that_shrinks_are_right() -> None:
    """Between frames contacts move balls against the flow of the box, too, and so change what its rate gives them."""
    side = 0.022
    run = {"until": 0.1, "step": 2e-4, "pile_tolerance": 1e-4, "impact": "one-shot"}
    scene = carom.Scene("lid", gravity=(0, 0, 0), periodic=(side, side, 0), run=run, record={"every": 20})
    scene.contact("m", "m", friction=0.3, restitution=0.3)
    scene.contact("m", "w", friction=0.0, restitution=0.3)
    region = {"low": (0, 0, 0), "high": (side, side, 0.03)}
    scene.packing("g", material="m", density=2500, seed=2, count=60, diameter=0.005, periodic="xy", **region)
    scene.plane("floor", material="w", point=(0, 0, 0), normal=(0, 0, 1))
    free = {"mass": 2e-3, "pressure": 1000.0, "weight": False}
    scene.plane("lid", material="w", point=(0, 0, 0.041), normal=(0, 0, -1), free=free)
    scene.deform(stretch=("exp(-0.8*t)", 1, 1))
    report = carom.audit.check(carom.simulate(scene))
    assert report.ok, report.findings
    assert report["momentum"].judged > 1000


def test_a_ball_that_hangs_at_the_origin_is_right() -> None:
    """Its velocity is what is left of the weight and of the reaction, and its way has the rounding of both."""
    scene = carom.Scene("hung", gravity=(0, 0, -9.81))
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    scene.sphere("ball", radius=0.05, mass=1.0, at=(0, 0, 0), material="m")
    scene.joint("rod", between=("ball", "ground"), points=((0, 0, 0), (0, 0, 0.5)))
    result = carom.simulate(scene, step=5e-4, until=0.01, method="moreau")
    report = carom.audit.check(result)
    assert report.ok, report.findings
    assert report["position"].judged


@pytest.mark.parametrize("tolerance", [1e-8, 1e-12])
def test_a_stress_that_fades_from_the_record_leaves_what_it_was_solved_to(tolerance: float) -> None:
    """A square with both braces turns in its plane: one condition too many, so that any stress of it is a solution."""
    corners = np.array([(0, 0, 0), (0.5, 0, 0), (0.5, 0, -0.5), (0, 0, -0.5)])
    scene = carom.Scene("truss", gravity=(0, 0, 0), run={"tolerance": tolerance})
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    for k, at in enumerate(corners):
        velocity = np.cross((1, 2, 3), at) + np.array((0.1, 0.2, 0.3))
        scene.sphere(f"b{k}", radius=0.05, mass=1.0 + k, at=at, velocity=velocity, material="m")
    for i, j in itertools.combinations(range(4), 2):
        scene.joint("rod", between=(f"b{j}", f"b{i}"))
    with pytest.warns(carom.CaromWarning, match="hold the same motion"):
        result = carom.simulate(scene, step=1e-3, until=1.0, every=1)
    most = np.linalg.norm(result.joint_impulse[:, :, :3], axis=2).sum(axis=1)
    assert most[800:].min() < 1e-3 * most.max()
    report = carom.audit.check(result)
    assert report.ok, report.findings
