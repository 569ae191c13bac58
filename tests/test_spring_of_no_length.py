"""Springs whose ends part from one point: the closed form of the damped oscillator, whatever the method."""

from __future__ import annotations

import carom
import numpy as np
import pytest


def parted(step: float, method: str, velocity: np.ndarray) -> carom.Result:
    """A ball of 1 kg that leaves the point to which a spring of 10 N/m with a damper of 1 N s/m pulls it."""
    scene = carom.Scene("parted", gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    scene.sphere("a", material="m", radius=0.05, mass=1, position=(0, 0, 0), velocity=velocity)
    ends = [(0, 0, 0), (0, 0, 0)]
    scene.spring("a", "ground", points=ends, stiffness=10, damping=1, rest_length=0)
    return carom.simulate(scene, step=step, until=0.5, method=method)


@pytest.mark.parametrize("method", ["nsga", "moreau", "penalty"])
def test_a_damper_acts_from_the_first_instant_on(method: str) -> None:
    """The limit of its force is `-c v`; without it the error was `h c v/2`, of first order."""
    way, rate = np.array([0.6, 0.0, 0.8]), np.sqrt(10 - 0.25)
    exact = 4.0 / rate * np.exp(-0.25) * np.sin(0.5 * rate) * way
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        result = parted(step, method, 4.0 * way)
        errors.append(float(np.linalg.norm(result["a"].position[-1] - exact)))
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.05)
    assert errors[-1] < 1e-6
    report = carom.audit.check(result)
    assert report.ok, report
