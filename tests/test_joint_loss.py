"""What method moreau takes from the energy at joints, as it is estimated after a run, against that run."""

from __future__ import annotations

import re
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromWarning
from carom.result.remarks import remarks

G = 9.8


def scene(g: float = G, **run: Any) -> carom.Scene:
    made = carom.Scene(gravity=(0, 0, -g), run={"until": 4.0, "step": 1e-3, "method": "moreau"} | run)
    made.contact("m", "m", friction=0.0, restitution=0.0)
    return made


def ball(made: carom.Scene, name: str, at: tuple[float, ...], **motion: Any) -> None:
    made.sphere(name, radius=0.02, mass=0.1, at=at, material="m", **motion)


def rod(**run: Any) -> carom.Scene:
    made = scene(**run)
    ball(made, "a", (0.5, 0, 0))
    made.joint("rod", between=("ground", "a"), points=((0, 0, 0), (0.5, 0, 0)))
    return made


def arm(**run: Any) -> carom.Scene:
    """It turns with its ball about the point."""
    made = scene(**run)
    ball(made, "a", (0.5, 0, 0))
    made.joint("ball", between=("a", "ground"), point=(0, 0, 0))
    return made


def double(**run: Any) -> carom.Scene:
    """A rod to a ball, and one from there to the next."""
    made = scene(**run)
    ball(made, "a", (0.4, 0, 0))
    ball(made, "b", (0.8, 0, 0))
    made.joint("rod", between=("a", "ground"), points=((0.4, 0, 0), (0, 0, 0)))
    made.joint("rod", between=("a", "b"))
    return made


def dumbbell(**run: Any) -> carom.Scene:
    made = scene(0.0, **run)
    ball(made, "a", (0.2, 0, 0), velocity=(0, 2, 0))
    ball(made, "b", (-0.2, 0, 0), velocity=(0, -2, 0))
    made.joint("rod", between=("a", "b"))
    return made


def tied(**run: Any) -> carom.Scene:
    """The same as one rigid body, by levers."""
    made = scene(0.0, **run)
    for name, side in (("a", 1), ("b", -1)):
        ball(made, name, (side * 0.2, 0, 0), velocity=(0, side * 2, 0), angular_velocity=(0, 0, 10.0))
    made.joint("ball", between=("a", "b"), point=(0.05, 0, 0))
    made.joint("lock", between=("a", "b"))
    return made


@pytest.mark.parametrize("build", [rod, arm, double, dumbbell, tied])
@pytest.mark.parametrize("every", [1, 5])
def test_the_loss_at_joints_is_told_of(build: Any, every: int) -> None:
    with pytest.warns(CaromWarning, match="at joints"):
        result = carom.simulate(build(), every=every)
    [told] = remarks(result)
    total = np.asarray(result.steps["energy_kinetic"]) + np.asarray(result.steps["energy_potential"])
    lost = (total[0] - total[-1]) / np.max(result.steps["energy_kinetic"])
    found, named = re.search(r"about ([\d.]+) %", told), re.search(r"step = ([\d.e-]+)", told)
    assert found
    assert named
    assert float(found[1]) == pytest.approx(100 * lost, rel=0.05)
    assert float(named[1]) < 1e-3
    assert not remarks(carom.simulate(build(step=float(named[1])), every=every))


@pytest.mark.parametrize("build", [rod, arm, double, dumbbell, tied])
def test_nsga_loses_none(build: Any) -> None:
    assert not remarks(carom.simulate(build(method="nsga")))


def test_joints_that_turn_nothing_lose_nothing() -> None:
    made = scene()
    ball(made, "a", (0, 0, 0), angular_velocity=(0, 0, 50.0))
    made.joint("fix", body="a")
    assert not remarks(carom.simulate(made))
