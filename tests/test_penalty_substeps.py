"""Substeps of method `penalty` hang on the motion, and not on the unit of length."""

import carom
import numpy as np
import pytest


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_a_spring_beside_the_centres_takes_as_many_substeps_in_any_unit_of_length(damping: float) -> None:
    def run(unit: float) -> carom.Result:
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("ball", "ball", friction=0.3, restitution=0.5)
        a, b = np.zeros(3), unit * np.array([0.03, 0.02, 0.01])
        v, w = unit * np.array([0.3, 0.1, -0.2]), (3.0, -5.0, 8.0)
        scene.sphere(
            "a", material="ball", radius=0.01 * unit, mass=0.01, position=a, velocity=v, angular_velocity=w
        )
        scene.sphere("b", material="ball", radius=0.008 * unit, mass=0.02, position=b)
        ends = (unit * np.array([0.009, 0, 0]), b - unit * np.array([0, 0.007, 0]))
        scene.spring("a", "b", points=ends, stiffness=2000.0, damping=damping, rest_length=0.02 * unit)
        slow = 1e-3 * unit  # a speed, in that unit
        return carom.simulate(scene, method="penalty", step=1e-3, until=0.01, penalty_slip_speed=slow)

    metres, microns = run(1.0), run(1e-3)
    assert microns.summary["substeps"] == metres.summary["substeps"] > 2 * 10
    scaled = np.asarray(microns.velocity) / 1e-3
    assert np.abs(scaled - np.asarray(metres.velocity)).max() < 1e-12
