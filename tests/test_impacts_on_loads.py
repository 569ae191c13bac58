"""Impacts on balls that loads press. No impact adds energy to what the loads have left (rule R4), and the auditor and the
oracle say the same.

Poisson's law solved the loads anew with its compression. Where an impact relieves a ball that slides, that took the friction
of the step back, which was a loss already: 27 balls that stick together gained up to 1e-7 J an impact. The laws of springs
leave loads as they are, and the safeguard counted them as taken back: a ball that slid on a floor, hit by another, gained
4e-7 J of 2e-4 J.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core, audit
from oracle import Reference
from test_oracle import difference

H = 1e-3
BIG, SMALL = 0.02, 0.01
APART = np.sqrt((BIG + SMALL) ** 2 - (BIG - SMALL) ** 2)
"""Distance along a floor of two balls that touch."""


def lifted(gap: float = 0.0, *, e: float = 0.0, towards: float = 0.1) -> carom.Scene:
    """A small ball runs slowly under a large one, which slides on a rough floor across its way, and relieves the floor."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("rough", "floor", friction=0.5, restitution=e)
    scene.contact("smooth", "floor", friction=0.0, restitution=e)
    scene.contact("rough", "smooth", friction=0.0, restitution=e)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.sphere("large", radius=BIG, mass=0.1, material="rough", position=(0, 0, BIG), velocity=(0, 2.0, 0))
    place = (-APART - gap, 0, SMALL)
    scene.sphere(
        "small", radius=SMALL, mass=0.1, material="smooth", position=place, velocity=(towards, 2.0, 0)
    )
    return scene


def run(scene: carom.Scene, out: Path, **options: Any) -> carom.Result:
    """One step."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        carom.simulate(scene, out=out, until=H, step=H, every=1, impacts="every", **options).close()
    return carom.load(out)


@pytest.mark.parametrize(
    ("options", "towards"),
    [
        ({}, 0.1),
        ({}, 0.01),
        (
            {"position_friction": "paper"},
            0.01,
        ),  # whose positions would lift the ball off before the loads are solved
        ({"method": "moreau"}, 0.1),
        ({"pile_contacts": 0}, 0.1),
    ],
)
@pytest.mark.parametrize("e", [0.0, 0.4])
def test_an_impact_that_relieves_a_sliding_ball_gains_nothing(
    options: dict[str, Any], towards: float, e: float, tmp_path: Path
) -> None:
    hit = run(lifted(e=e, towards=towards), tmp_path / "hit", impact="poisson", **options)
    alone = run(lifted(1e-3, e=e, towards=towards), tmp_path / "alone", impact="poisson", **options)
    assert len(hit.impacts) > 0
    assert not len(alone.impacts)
    kinetic = [float(of.steps["energy_kinetic"][-1]) for of in (hit, alone)]
    assert kinetic[0] <= kinetic[1] * (1.0 + 1e-10)
    # What is lost is no more than what there was across the large ball's way.
    assert kinetic[0] > kinetic[1] - 0.5 * 0.1 * (towards + 9.8 * H) ** 2
    for out in ("hit", "alone"):
        report = audit.check(tmp_path / out)
        assert report.ok, report


@pytest.mark.parametrize("e", [0.0, 0.4])
@pytest.mark.parametrize("towards", [0.01, 1.0])
def test_the_oracle_says_the_same(e: float, towards: float) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        along, mass = rng.uniform(0.5, 3.0), rng.uniform(0.05, 0.2, 2)
        radius = np.array([BIG, SMALL])
        model = {
            "gravity": np.array([0.0, 0.0, -9.8]),
            "radius": radius,
            "mass": mass,
            "inertia": 0.4 * mass * radius**2,
            "position": np.array([[0.0, 0.0, BIG], [-APART, 0.0, SMALL]]),
            "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
            "velocity": np.array([[0.0, along, 0.0], [towards, along, 0.0]]),
            "angular_velocity": np.zeros((2, 3)),
            "material": np.array([0, 1]),
            "plane_point": np.zeros((1, 3)),
            "plane_normal": np.array([[0.0, 0.0, 1.0]]),
            "plane_material": np.array([2]),
            "law_a": np.array([0, 1, 0]),
            "law_b": np.array([2, 2, 1]),
            "friction": np.array([0.5, 0.0, 0.0]),
            "restitution": np.full(3, e),
            "tangential_restitution": np.zeros(3),
            "rolling_radius": np.zeros(3),
            "spinning_radius": np.zeros(3),
            "options": {
                "step": H,
                "tolerance": 1e-13,
                "tolerance_floor": 1e-15,
                "impact": "poisson",
                "position_friction": "paper",
            },
        }
        oracle, core = Reference(model), _core.Simulation(model)
        oracle.advance(1)
        assert core.advance(1, 1, True, 1e9)["outcome"] is None
        assert difference(oracle, core, radius) < 1e-11


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize("options", [{}, {"position_friction": "paper"}, {"pile_contacts": 0}])
def test_a_hit_on_a_sliding_ball_gains_nothing_through_springs(
    law: str, options: dict[str, Any], tmp_path: Path
) -> None:
    """Both fall on in the step, which slows their approach by 1 %: the springs give the speed of `t_n` back."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("grain", "grain", friction=0.0, restitution=1.0)
    scene.contact("grain", "wall", friction=0.9, restitution=0.3)
    scene.plane("floor", point=(0, 0, 0), normal=(0.1, 0, 1), material="wall")
    scene.sphere("large", radius=0.00837694869167728, mass=0.00615582385450606, inertia=1.7278971424660493e-07,
                 material="grain", position=(0.01348264855913583, 0.029382687014773468, 0.007070464387673205),
                 velocity=(0.09706789034483862, 0.1439523739231575, -0.00970678903448386),
                 angular_velocity=(-15.739418615420488, 11.645293061654234, 15.306340796635435))  # fmt: skip
    scene.sphere("small", radius=0.006230446532606777, mass=0.0025327139254408587, inertia=3.9326425730425055e-08,
                 material="grain", position=(0.021404802416733627, 0.041446196851172276, 0.004141218655589198),
                 velocity=(-0.004555330430789636, 0.030092869220376666, -0.007518591760801324),
                 angular_velocity=(-5.5682256361328974, -1.0769701103173634, -7.14165960559242))  # fmt: skip
    found = run(scene, tmp_path / "run", impact=law, **options)
    assert len(found.impacts) > 0
    report = audit.check(tmp_path / "run")
    assert report.ok, report
