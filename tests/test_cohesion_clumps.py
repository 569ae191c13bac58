"""Clumps that stick: their balls attract, and what that gives moves and turns the whole body."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest
from carom import audit

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

R, G = 0.002, 9.81
ROD = [[-R, 0, 0, R], [R, 0, 0, R]]


def sticky(gravity: float = G, *, force: float, distance: float = 2e-4, **law: float) -> carom.Scene:
    scene = carom.Scene(gravity=(0, 0, -gravity))
    scene.contact(
        "m", "m", **{"friction": 0.4, "restitution": 0.5, **law}, cohesion=force, rupture_distance=distance
    )
    return scene


def run(scene: carom.Scene, until: float, **options: Any) -> carom.Result:
    return carom.simulate(scene, until=until, **{"step": 1e-4, "every": 1, **options})


def momenta(result: carom.Result, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum about the origin of all clumps."""
    linear, angular = np.zeros(3), np.zeros(3)
    for clump in result.clumps.values():
        x, v, own = (of[frame] for of in (clump.position, clump.velocity, clump.angular_momentum))
        linear += clump.mass * v
        angular += own + clump.mass * np.cross(x, v)
    return linear, angular


def test_clumps_of_one_ball_do_what_balls_do() -> None:
    mass = 4 / 3 * np.pi * R**3 * 2500
    ends = []
    for kind in ("ball", "clump"):
        scene, rng = sticky(force=0.06), np.random.default_rng(1)
        scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
        for k in range(6):
            place = np.array([0.0045 * (k % 3), 0.0045 * (k // 3), 0.003 + 0.002 * k])
            place[:2] += rng.uniform(-1e-4, 1e-4, 2)
            motion = {"at": tuple(place), "angular_velocity": tuple(rng.uniform(-50, 50, 3)), "material": "m"}
            if kind == "ball":
                scene.sphere(f"b{k}", radius=R, mass=mass, **motion)
            else:
                inertia = (0.4 * mass * R**2,) * 3
                scene.clump(f"b{k}", spheres=[[0, 0, 0, R]], mass=mass, inertia=inertia, **motion)
        ends.append(run(scene, 0.1))
    balls, clumps = ends
    np.testing.assert_allclose(clumps.position[-1], balls.position[-1], atol=1e-14)
    np.testing.assert_allclose(clumps.angular_velocity[-1], balls.angular_velocity[-1], atol=1e-9)
    assert len(balls.impacts.time) > 10


@pytest.mark.parametrize(("share", "holds"), [(0.98, False), (1.02, True)])
def test_a_roof_holds_a_rod_by_both_its_balls(share: float, holds: bool) -> None:
    """It hangs level by two contacts, each of which carries half of its weight."""
    mass = 1e-4
    scene = sticky(force=0.5 * share * mass * G, distance=1e-5, restitution=0.0)
    scene.plane("roof", material="m", point=(0, 0, 0), normal=(0, 0, -1))
    scene.clump("rod", spheres=ROD, mass=mass, at=(0, 0, -R), material="m")
    fallen = -R - float(run(scene, 0.1).position[-1, 0, 2])
    assert (abs(fallen) < 1e-10) == holds


def test_a_rod_that_hangs_by_one_end_swings_down_and_tears_off_there_last() -> None:
    """The attraction of one end turns it: without its moment both ends would fall alike."""
    mass = 1e-4
    scene = sticky(force=3.0 * mass * G, restitution=0.0)
    scene.plane("hook", material="m", point=(-R, 0, 0), normal=(0, 0, -1), radius=0.5 * R)
    scene.clump("rod", spheres=ROD, mass=mass, at=(0, 0, -R), material="m")
    held, free = np.moveaxis(run(scene, 0.01).position[:, :, 2], 1, 0)
    assert held[-1] == pytest.approx(-R, abs=1e-9)
    assert free[-1] < -R - 1e-4


@pytest.mark.parametrize(("step", "most"), [(2e-4, 5e-3), (2.5e-5, 1e-3)])
def test_clumps_that_stick_in_free_space_keep_their_momenta(step: float, most: float) -> None:
    """Angular momentum to the turns that correct positions: without attraction it is off by as much."""
    scene, rng = sticky(0.0, force=0.05), np.random.default_rng(3)
    for k in range(3):
        turn = rng.normal(size=4)
        scene.clump(f"c{k}", spheres=ROD, density=2500, material="m", at=(0.0082 * k, 0, 0),
                    orientation=tuple(turn / np.linalg.norm(turn)), velocity=(0.15 * (1 - k), 0, 0),
                    angular_velocity=tuple(40 * rng.normal(size=3)))  # fmt: skip
    result = run(scene, 0.1, step=step)
    first, last = momenta(result, 0), momenta(result, -1)
    size = sum(clump.mass for clump in result.clumps.values())
    np.testing.assert_allclose(last[0], first[0], atol=1e-13 * size)
    assert np.linalg.norm(last[1] - first[1]) <= most * np.linalg.norm(first[1])
    assert result.energy.total[-1] < result.energy.total[0]
    report = audit.check(result)
    assert report.ok, report.findings
    assert report["momentum"].judged > 0
    assert report["spin"].judged > 0
