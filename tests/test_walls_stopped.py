"""What the last frame of a run that stopped between two frames says of the impulses on its walls and joints."""

from __future__ import annotations

import carom
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


def swinging() -> carom.Scene:
    """A ball on a rod over a floor on which another one lies; a load that breaks off after 25 steps."""
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3}, record={"walls": True})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("a", radius=0.01, mass=0.1, material="m", position=(0, 0, 0.01))
    scene.sphere("b", radius=0.01, mass=0.1, material="m", position=(0.1, 0, 0.2), velocity=(0, 1, 0))
    scene.joint("rod", between=["b", "ground"], points=[(0.1, 0, 0.2), (0.1, 0, 0.3)])
    scene.load("a", force=(0, 0, {"expression": "sqrt(0.0255 - t) - 0.1"}))
    return scene


def test_they_are_not_known() -> None:
    with pytest.raises(carom.RunFailed) as failed:
        carom.simulate(swinging(), every=10)
    result = failed.value.result
    assert result.step.tolist() == [0, 10, 20, 25]
    floor = result.walls["floor"]
    for given in (floor.impulse, floor.angular_impulse, floor.force, result.joint_impulse[:, 0]):
        assert np.isnan(given[-1]).all()
        assert np.isfinite(given[1:-1]).all()
    assert not np.any(floor.impulse[0])
    assert len(result.contacts.at(3)["gap"]) == 0
    report = carom.audit.check(result)
    assert report.ok, report


def test_a_simulation_tells_them_on_its_grid_alone() -> None:
    simulation = carom.Simulation(swinging(), every=10)
    simulation.step(15)
    assert np.isnan(simulation.result().walls["floor"].impulse[-1]).all()
    simulation.step(5)
    known = simulation.result().walls["floor"].impulse
    assert known[-1, 2] < -0.01 * 0.1 * 9.8 * 0.5
