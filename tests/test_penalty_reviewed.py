"""Penalty: contacts that there are at the start, flat walls, walls that turn in themselves, balls that fill hollows."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest


def thrown(**wall: Any) -> carom.Scene:
    """A ball that slides and hits a wall, by springs."""
    scene = carom.Scene("hit", gravity=(0, 0, 0), run={"method": "penalty", "step": 1e-3, "until": 0.02})
    scene.contact("b", "w", friction=0.0, restitution=0.8)
    scene.plane("wall", material="w", point=(0, 0, 0), normal=(0, 0, 1), **wall)
    scene.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0.015), velocity=(4, 0, -1), material="b")
    return scene


def test_a_disc_is_flat_and_a_plane_that_turns_in_itself_stands() -> None:
    plane = carom.simulate(thrown())
    turning = {"rotation": {"axis": (0, 0, 1), "point": (0, 0, 0), "angle": {"expression": "200*t"}}}
    for other in ({"radius": 1.0}, {"motion": turning}):
        result = carom.simulate(thrown(**other))
        assert len(result.impacts) == len(plane.impacts) == 1
        np.testing.assert_allclose(result["a"].velocity[-1], plane["a"].velocity[-1], rtol=0, atol=1e-6)
    disc = carom.simulate(thrown(radius=1.0))
    assert disc.summary["penalty"]["substeps"] == plane.summary["penalty"]["substeps"]


def overlapping(**contact: Any) -> carom.Scene:
    scene = carom.Scene("apart", gravity=(0, 0, 0), run={"method": "penalty", "step": 1e-4, "until": 0.002})
    scene.contact("b", "b", friction=0.0, **contact)
    for name, x in (("a", 0.0), ("b", 0.0195)):
        scene.sphere(
            name, radius=0.01, mass=0.1, at=(x, 0, 0), velocity=(1.0 if x == 0 else 0.0, 0, 0), material="b"
        )
    return scene


def test_springs_that_are_bent_at_the_start_are_in_the_first_energy() -> None:
    result = carom.simulate(overlapping(restitution=1.0))
    energy = result.summary["energy"]
    assert energy["final"] == pytest.approx(energy["initial"], rel=2e-3)
    assert energy["initial"] > 0.1 > 0.5 * 0.1 * 1.0**2
    assert carom.audit.check(result).ok


def test_a_law_of_what_touches_at_the_start_is_checked() -> None:
    with pytest.raises(carom.RunFailed, match=r"e_N = 1\.2"):
        carom.simulate(overlapping(restitution={"expression": "0.2 + v"}))


def test_a_ball_that_fills_what_is_hollow_keeps_its_energy() -> None:
    scene = carom.Scene("full", gravity=(0, 0, 0), run={"method": "penalty", "step": 1e-3, "until": 0.02})
    scene.contact("b", "w", friction=0.0, restitution=1.0)
    scene.ball_wall("wall", material="w", point=(0, 0, 0), radius=0.02)
    scene.sphere("a", radius=0.02, mass=0.1, at=(0, 0, 0), velocity=(1, 0, 0), material="b")
    energy = carom.simulate(scene).summary["energy"]
    assert energy["final"] == pytest.approx(0.05, rel=2e-2)


@pytest.mark.parametrize("step", [2e-3, 5e-4])
def test_moments_on_a_table_that_turns_are_those_of_the_ball(step: float) -> None:
    run = {"step": step, "until": 0.1, "method": "penalty", "penalty_young_modulus": 1e6}
    scene = carom.Scene("turntable", run=run, record={"every": 1, "walls": True})
    scene.contact("b", "w", friction=0.6, restitution=0.2)
    scene.plane(
        "table",
        material="w",
        point=(0, 0, 0),
        normal=(0, 0, 1),
        radius=0.1,
        motion={"rotation": {"axis": [0, 0, 1], "rate": 10}},
    )
    scene.sphere("a", material="b", mass=0.001, radius=0.005, at=(0.05, 0, 0.005))
    result = carom.simulate(scene)
    moment = np.asarray(result.walls["table"].angular_impulse)[1:, 2].sum()
    x, v, w = (
        np.asarray(of)[-1]
        for of in (result["a"].position, result["a"].velocity, result["a"].angular_velocity)
    )
    gained = 0.001 * np.cross(x, v)[2] + 0.4 * 0.001 * 0.005**2 * w[2]
    assert moment == pytest.approx(-gained, rel=1e-12)
    work = np.asarray(result.steps["energy_work"]).sum()
    assert work == pytest.approx(-10 * moment, rel=1e-12)
