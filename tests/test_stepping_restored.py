"""`Simulation.restore` and `Simulation.result`: what belongs to which record, and what a state may not be."""

from __future__ import annotations

import carom
import numpy as np
import pytest


def resting(**given: object) -> carom.Simulation:
    """A ball of 0.1 kg on a floor, which it presses with 0.98 N, and one that hangs."""
    scene = carom.Scene("rest")
    scene.contact("g", "g", friction=0.3, restitution=0.0)
    scene.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0.01), material="g")
    scene.sphere("b", radius=0.01, mass=0.1, at=(1, 0, 0.5), material="g")
    scene.joint("fix", body="b")
    scene.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    return carom.Simulation(scene, step=1e-3, every=10, walls=True, **given)


@pytest.mark.parametrize("keep", [True, False])
def test_a_record_begins_anew_without_the_sums_of_the_old_one(keep: bool) -> None:
    source, sim = resting(keep=keep), resting()
    source.step(29)
    sim.restore(source.state())
    sim.step(11)
    result = sim.result()
    assert np.asarray(result.step).tolist() == [29, 30, 40]
    np.testing.assert_allclose(result.walls["f"].force[1:, 2], [-0.98, -0.98], rtol=1e-9)
    impulse = [0.98e-3, 9.8e-3]
    np.testing.assert_allclose(np.asarray(result.contacts["impulse"])[:, 2], impulse, rtol=1e-9)
    np.testing.assert_allclose(np.asarray(result.joint_impulse)[1:, 0, 2], impulse, rtol=1e-9)


def test_the_auditor_judges_no_contacts_of_a_last_frame_off_the_grid() -> None:
    scene = carom.Scene("roll")
    scene.contact("g", "g", friction=0.3, restitution=0.5)
    scene.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0.01), velocity=(0.3, 0, 0), material="g")
    scene.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    sim = carom.Simulation(scene, step=1e-3, every=7, walls=True)
    for steps in (60, 3):
        sim.step(steps)
        report = carom.audit.check(sim.result())
        assert report.ok, report


def test_a_result_and_the_record_go_on_apart() -> None:
    """The state off the grid that a result shows, read or not, is not in a later one, and later steps not in it."""
    sim = resting()
    sim.step(25)
    first = sim.result()
    sim.step(25)
    assert np.asarray(sim.result().step).tolist() == [*range(0, 51, 10)]
    assert np.asarray(first.step).tolist() == [0, 10, 20, 25]
    assert len(first.steps) == 25
