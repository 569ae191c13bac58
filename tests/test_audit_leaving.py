"""The auditor on runs from which balls and clumps leave: what is right is not accused."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest
from carom import audit
from clump_scenes import FAR, ROD, R, empty

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

KINDS = pytest.mark.parametrize("kind", ["ball", "clump"])
OPTIONS: dict[str, Any] = {"step": 1e-3, "every": 1}


def add(scene: carom.Scene, kind: str, name: str, density: float = 2500, **motion: Any) -> None:
    """A ball or a rod."""
    common = {"material": "grain", "density": density, **motion}
    if kind == "ball":
        scene.sphere(name, radius=R, **common)
    else:
        scene.clump(name, spheres=ROD, **common)


@KINDS
def test_the_last_bodies_leave_together_and_no_energy_stays(kind: str) -> None:
    for seed in range(6):
        scene, rng = empty(), np.random.default_rng(seed)
        for i in range(3):
            spin, fast = rng.uniform(-9, 9, 3).tolist(), [0, 0, -0.3 + rng.uniform(-0.003, 0.003)]
            place = [0.03 * i, 0, 0.0123 + 1e-5 * i]
            add(scene, kind, f"b{i}", position=place, velocity=fast, angular_velocity=spin)
        scene.outlet(low=(-FAR, -FAR, -FAR), high=(FAR, FAR, 0.0))
        result = carom.simulate(scene, until=0.06, **OPTIONS)
        left = int(result.events.step[-1])
        assert not result.steps.energy_kinetic[left - 1 :].any()
        assert not result.steps.energy_potential[left - 1 :].any()
        report = audit.check(result)
        assert report.ok, repr(report)


@KINDS
@pytest.mark.parametrize("speed", [1.1, 0.0])
def test_what_a_heavy_body_leaves_has_its_own_rounding(kind: str, speed: float) -> None:
    """From rest at the origin it has as much kinetic energy as it lacks of the other: their sum has no size."""
    for seed in range(4):
        scene, rng = empty(), np.random.default_rng(seed)
        add(scene, kind, "heavy", 2e4, position=(0, 0, 0.02 * (speed > 0)), velocity=(0, 0, -speed),
            angular_velocity=rng.uniform(-50, 50, 3).tolist())  # fmt: skip
        scene.sphere("light", radius=R / 8, density=10, material="grain", position=(0.3, 0, 0.02))
        scene.outlet(low=(-0.1, -FAR, -FAR), high=(0.1, FAR, -0.003 * seed - 1e-4))
        result = carom.simulate(scene, until=0.08, **OPTIONS)
        light, steps = result["light"], result.steps
        after = int(result.events.step[0])
        height = light.mass * 9.8 * light.position[after:, 2]
        assert steps.energy_potential[after - 1 :] == pytest.approx(height, rel=1e-14)
        motion = 0.5 * light.mass * (light.velocity[after:] ** 2).sum(axis=1)
        assert steps.energy_kinetic[after - 1 :] == pytest.approx(motion, rel=1e-14)
        report = audit.check(result)
        assert report.ok, repr(report)


@KINDS
@pytest.mark.parametrize(
    ("start", "speed"), [(0.05, 0.1), (0.004, -0.1), (-0.05, -0.1), (0.11, 0.1), (0.064, -0.1)]
)
def test_an_outlet_of_a_periodic_world_is_entered_from_both_sides(
    kind: str, start: float, speed: float
) -> None:
    scene = carom.Scene(gravity=(0, 0, 0), periodic=(0.06, 0.06, 0))
    scene.contact("grain", "grain", friction=0.4, restitution=0.3)
    add(scene, kind, "goes", position=(start, 0.01, 0.01), velocity=(speed, 0, 0))
    scene.sphere("stays", radius=R, density=2500, material="grain", position=(0.03, 0.04, 0.01))
    scene.outlet(low=(0.055, -FAR, -FAR), high=(0.062, FAR, FAR))
    result = carom.simulate(scene, until=0.1, **OPTIONS)
    assert 0 < result.events.step[0] < 90
    report = audit.check(result)
    assert report.ok, repr(report)


@pytest.mark.parametrize("impacts", [False, "every"])
@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_a_ball_is_judged_in_the_step_in_which_its_neighbour_leaves(method: str, impacts: Any) -> None:
    """Pressed on a wall, the outer one slides off the inner one, and out: the contact of that step still turns that."""
    for seed in range(4):
        scene = carom.Scene(gravity=(-9.8, -1.0, -3.0 - seed))
        scene.contact("grain", "grain", friction=0.3, restitution=0.0)
        scene.plane("wall", point=(0, 0, 0), normal=(1, 0, 0), material="grain")
        add(scene, "ball", "outer", position=(R + 2 * R * 0.8, 0, 2 * R * 0.6))
        add(scene, "ball", "inner", position=(R, 0, 0))
        scene.outlet(low=(2 * R, -FAR, -FAR), high=(FAR, FAR, (1.19 - 0.01 * seed) * R))
        projected = {"position_projection": True} if method == "moreau" else {}
        result = carom.simulate(scene, until=0.05, method=method, impacts=impacts, **projected, **OPTIONS)
        pushed = result.contacts.at(int(result.events.step[0]))
        assert pushed.impulse[(pushed.body == (0, 1)).all(axis=1)].any()
        report = audit.check(result)
        assert report.ok, repr(report)
