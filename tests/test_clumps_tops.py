"""Clumps that joints hold and that turn fast: tops, hinges, and bodies with drag that come and go."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

TILT, ARM, M, G = 0.6, 0.05, 0.2, 9.81
FOOT = np.array([0.0, 0.0, 0.2])


def top(moments: list[float], spin: np.ndarray, *, ball: bool = False, **options: Any) -> carom.Result:
    """A body held at a point of its axis."""
    turn = (np.cos(TILT / 2), np.sin(TILT / 2), 0.0, 0.0)
    centre = ARM * np.array([0.0, -np.sin(TILT), np.cos(TILT)])
    scene = carom.Scene(gravity=(0, 0, -G))
    scene.contact("a", "a", friction=0, restitution=0)
    motion = {"material": "a", "mass": M, "position": FOOT + centre, "velocity": np.cross(spin, centre)}
    if ball:
        scene.sphere("top1", radius=0.01, inertia=moments[0], angular_velocity=spin, **motion)
    else:
        scene.clump("top", spheres=[[0, 0, 0, 0.01]], inertia=moments, orientation=turn, angular_velocity=spin,
                    **motion)  # fmt: skip
    scene.joint("fix", body="top1", point=FOOT)
    return carom.simulate(scene, **options)


def test_a_held_clump_of_one_ball_turns_as_the_ball() -> None:
    """In space, where turns do not commute."""
    spin = np.array([3.0, 20.0, 100.0])
    found = [
        top([7e-5] * 3, spin, ball=ball, step=1e-3, until=0.2, every=1)["top1"].angular_velocity
        for ball in (True, False)
    ]
    assert np.abs(found[1] - found[0]).max() < 1e-10


@pytest.mark.parametrize("moments", [[6e-5, 6e-5, 9e-5], [9e-5, 9e-5, 6e-5]])
def test_a_heavy_top_goes_round_as_fast_as_it_should(moments: list[float]) -> None:
    """Steady precession at rate p: (A + m a^2) p^2 cos - C w3 p + m g a = 0, of second order in the step; energy falls."""
    rate, across, along = 15.0, moments[0] + M * ARM**2, moments[2]
    w3 = (across * rate**2 * np.cos(TILT) + M * G * ARM) / (along * rate)
    axis = np.array([0.0, -np.sin(TILT), np.cos(TILT)])
    spin = rate * np.array([0.0, 0.0, 1.0]) + (w3 - rate * np.cos(TILT)) * axis
    errors = []
    for step in (1e-3, 5e-4):
        result = top(moments, spin, step=step, until=1.0, every=round(0.01 / step))
        place = np.asarray(result["top1"].position) - FOOT
        angle = np.unwrap(np.arctan2(place[:, 1], place[:, 0]))
        errors.append(abs((angle[-1] - angle[0]) / rate - 1.0))
        energy = np.asarray(result.energy.total)
        assert -1e-3 < (energy[-1] - energy[0]) / energy[0] < 1e-6
    assert errors[0] < 1e-3
    assert errors[1] < 0.4 * errors[0]


def test_restitution_of_a_clump_on_a_hinge_does_not_hang_on_the_step() -> None:
    """A skew dumbbell on a hinge swings onto a floor: its joint takes the moment of its skewness."""
    for step in (1e-3, 2.5e-4):
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("a", "a", friction=0, restitution=0.5)
        scene.plane("floor", point=(0, 0, -0.0204), normal=(0, 0, 1), material="a")
        ends = [[0.05, 0.02, 0, 0.01], [-0.05, -0.02, 0, 0.01]]
        # About the hinge along y, through the centre.
        spin = np.array([0.0, 60.0, 0.0])
        scene.clump(
            "bar", spheres=ends, material="a", density=2500, position=(0, 0, 0), angular_velocity=spin
        )
        scene.joint("fix", body="bar1", point=(0, 0, 0))
        scene.joint("lock", body="bar1", axes=[(1, 0, 0), (0, 0, 1)])
        rate = np.asarray(carom.simulate(scene, step=step, until=0.02, every=1)["bar1"].angular_velocity)[
            :, 1
        ]
        hit = np.flatnonzero(np.diff(np.sign(rate)))
        assert rate[hit[0] + 1] / rate[hit[0]] == pytest.approx(-0.5, abs=1e-9)


@pytest.mark.parametrize("function", [False, True], ids=["drag", "and a function"])
@pytest.mark.parametrize("clumps", [False, True], ids=["balls", "clumps"])
def test_what_has_drag_enters_and_leaves(clumps: bool, function: bool) -> None:
    """Drag holds nothing at an outlet, and a function that acts on absent bodies moves none."""
    scene = carom.Scene(gravity=(0, 0, -G))
    scene.contact("a", "a", friction=0.3, restitution=0.4)
    scene.plane("floor", point=(0, 0, 0), normal=(0.3, 0, 1), material="a")
    shape = {"spheres": [[-0.004, 0, 0, 0.004], [0.004, 0, 0, 0.003]]} if clumps else {"radius": 0.004}
    region = {"low": (-0.02, -0.02, 0.15), "high": (0.02, 0.02, 0.2)}
    scene.inflow("g", material="a", density=2500, count=8, seed=3, rate=60, velocity=(0, 0, -0.3), region=region,
                 **shape)  # fmt: skip
    scene.outlet(low=(0.1, -1, -1), high=(1, 1, 1))
    scene.drag("all", translation=2e-3, rotation=1e-8)

    def wind(t: float, x: np.ndarray, v: np.ndarray, w: np.ndarray) -> np.ndarray:
        return np.concatenate([1e-4 + 0 * v, 1e-8 * np.cos(20 * x)], axis=1)

    if function:
        scene.load_function(wind)
    result = carom.simulate(scene, step=5e-4, until=0.8, every=1)
    assert result.summary["unconverged"] == 0
    assert result.summary["entered"] == (16 if clumps else 8)
    assert result.summary["removed"] > result.summary["entered"] // 2
    assert carom.audit.check(result).ok
