"""`carom.Simulation`: what is stepped from Python is what `carom.simulate` computes, and it can go back."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import carom
import numpy as np
import pytest
from carom.cli.examples import find
from test_memory_result import NAMES, assert_same, columns, short


@pytest.mark.parametrize("name", NAMES)
def test_steps_give_the_result_of_a_run(name: str) -> None:
    """In uneven portions, beyond the end that the scene states; frames are on a grid of 7 steps."""
    scene = short(name)
    sim = carom.Simulation(scene)
    seen = []
    for n in (1, 30, 0, 32):
        sim.step(n)
        seen.append((sim.time, sim.position, sim.contacts))
    assert sim.steps == 63
    found = sim.result()
    assert_same(columns(found), columns(carom.simulate(scene, until=found.scene.run.until)))
    assert_same(columns(found), columns(carom.simulate(found.scene)))
    assert found.status == "done"
    assert seen[-1][0] == np.asarray(found.time)[-1]
    np.testing.assert_array_equal(seen[-1][1], np.asarray(found.position)[-1])
    sim.step(2)
    later, whole = sim.result(), carom.simulate(scene, until=65 * sim.result().scene.run.step)
    for quantity in ("step", "position", "velocity", "orientation", "angular_velocity"):
        np.testing.assert_array_equal(getattr(later, quantity), getattr(whole, quantity))
    assert len(found.steps) == 63  # what was given stays as it was
    np.testing.assert_array_equal(seen[-1][1], np.asarray(found.position)[-1])


def test_a_state_is_restored_bit_for_bit() -> None:
    sim = carom.Simulation(find("three_balls"), every=5)
    sim.step(40)
    state = sim.state()
    sim.step(60)
    there = sim.time, sim.position, sim.velocity
    sim.restore(state)
    assert sim.steps == 40
    sim.step(60)
    for a, b in zip(there, (sim.time, sim.position, sim.velocity), strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.asarray(sim.result().step).tolist() == list(range(40, 101, 5))
    with pytest.raises(carom.CaromError, match="restored, at step 40, and may differ"):
        carom.audit.check(sim.result())


def test_a_struck_ball_moves_and_nothing_else_reaches_the_core() -> None:
    """A ball that is struck rolls away by v t where nothing brakes it; arrays that were read cannot be written."""
    scene = carom.Scene("free", gravity=(0, 0, 0), run={"step": 1e-3})
    scene.sphere("ball", radius=0.03, mass=0.2, at=(0, 0, 0), material="m")
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    sim = carom.Simulation(scene, keep=False)
    state = sim.state()
    state["velocity"][0] = (2.0, 0, 0)
    assert sim["ball"].speed == 0.0
    sim.restore(state)
    sim.step(500)
    np.testing.assert_allclose(sim["ball"].position, (1.0, 0, 0), rtol=1e-12)
    assert sim.kinetic_energy == pytest.approx(0.5 * 0.2 * 4.0, rel=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        sim.position[0] = 0.0
    last = sim.result()
    assert np.asarray(last.time).tolist() == [sim.time]


def test_a_clump_is_struck_whole() -> None:
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("g", "g", friction=0.3, restitution=0.2)
    scene.clump(
        "rod", material="g", spheres=[[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01]], density=2500, at=(0, 0, 0)
    )
    sim = carom.Simulation(scene, step=1e-3)
    state = sim.state()
    state["velocity"][2], state["angular_velocity"][2] = (0, 0, 3), (0, 50, 0)
    sim.restore(state)
    np.testing.assert_allclose(sim.velocity[:, 2], [3.5, 2.5])
    sim.step(1)
    np.testing.assert_allclose(sim.position.mean(axis=0), [0, 0, 3e-3], atol=1e-15)
    for balls in ([0], [0, 1]):
        state = sim.state()
        state["velocity"][balls] = (0, 0, 1)
        with pytest.raises(
            carom.CaromError, match=r"strike the clump, row 2 of velocity and angular_velocity$"
        ):
            sim.restore(state)


def test_states_of_clumps_at_rest_are_taken_back_as_they_are() -> None:
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("g", "g", friction=0.5, restitution=0.2)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    parts = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.008], [0, 0.01, 0, 0.01]]
    scene.clump("rod", material="g", spheres=parts, density=2500, at=(0, 0, 0.03), velocity=(0.1, 0, 0))
    sim = carom.Simulation(scene, step=1e-3)
    for _ in range(60):
        sim.step(10)
        state = sim.state()
        sim.restore(state)
        again = sim.state()
        for name in ("position", "velocity", "angular_velocity"):
            np.testing.assert_array_equal(state[name], again[name])


def test_a_controller_acts_through_a_load_function() -> None:
    """A spring law with damping, as Python code, brings the ball to its goal."""
    goal = np.array([0.5, 0.0, 0.0])

    def pull(time: float, position: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
        loads = np.zeros((len(position), 6))
        loads[:, :3] = 20.0 * (goal - position) - 4.0 * velocity
        return loads

    scene = carom.Scene("controlled", gravity=(0, 0, 0), run={"step": 1e-3})
    scene.sphere("ball", radius=0.03, mass=0.2, at=(0, 0, 0), material="m")
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    scene.load_function(pull)
    sim = carom.Simulation(scene)
    sim.step(2000)
    np.testing.assert_allclose(sim["ball"].position, goal, atol=1e-4)
    assert sim.result()["ball"].position.shape == (2001, 3)


def test_what_is_wrong_is_said() -> None:
    sim = carom.Simulation(find("three_balls"))
    for wrong in (-1, 1.5, "3", float("nan"), True):
        with pytest.raises(carom.CaromError, match="from 0 on"):
            sim.step(wrong)  # type: ignore[arg-type]
    other = carom.Simulation(find("newtons_cradle")).state()
    with pytest.raises(carom.CaromError, match=r"restore: .*what state\(\)"):
        sim.restore(other)
    state = sim.state()
    with pytest.raises(carom.CaromError, match="state of this scene has no velocty; did you mean velocity"):
        sim.restore({**state, "velocty": state["velocity"]})
    with pytest.raises(carom.CaromError, match="no body is called 'ceu'"):
        sim["ceu"]


def ball(radius: float = 0.02, friction: float = 0.3, step: float = 1e-3) -> carom.Simulation:
    scene = carom.Scene("ball", gravity=(0, 0, 0), run={"step": step})
    scene.contact("m", "m", friction=friction, restitution=0.6)
    scene.sphere("ball", radius=radius, mass=1.0, at=(0, 0, 0), velocity=(1, 0, 0), material="m")
    return carom.Simulation(scene, keep=False)


def test_a_state_is_taken_where_step_and_bodies_are_the_same() -> None:
    sim = ball()
    sim.step(150)
    state = sim.state()
    other = ball(friction=0.1)
    other.restore(state)
    assert other.time == sim.time
    shorter = ball(step=5e-4)
    with pytest.raises(
        carom.CaromError,
        match=r"^restore: the state was made with another step than 0\.0005 s; give both simulations the same step$",
    ):
        shorter.restore(state)
    with pytest.raises(carom.CaromError, match=r"other bodies: .*; give what state\(\)"):
        ball(radius=0.5).restore(state)
    assert (shorter.time, shorter["ball"].speed) == (0.0, 1.0)
    for key in ("step_size", "bodies"):  # as version 0.2.0 left them
        del state[key]
    other.restore(state)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_simulation_is_not_copied_but_its_state_is(copied: Callable[[object], object]) -> None:
    sim = ball()
    sim.step(10)
    with pytest.raises(
        carom.CaromError, match=r"neither copied nor pickled; .* restore\(state\) .* state\(\)"
    ):
        copied(sim)
    other = ball()
    other.restore(pickle.loads(pickle.dumps(sim.state())))
    other.step(10)
    assert (sim.steps, other.steps) == (10, 20)


def test_what_is_no_state_is_refused() -> None:
    sim = ball()
    for nothing, told in ((None, "nothing"), ([1.0], "list")):
        with pytest.raises(
            carom.CaromError, match=rf"^restore: a state is needed, found {told}; give what state\(\)"
        ):
            sim.restore(nothing)  # type: ignore[arg-type]
    state = sim.state()
    state["velocity"][0, 0] = np.inf
    with pytest.raises(carom.CaromError, match="velocity holds a number that is not finite"):
        sim.restore(state)


def test_a_step_that_cannot_be_solved_raises_with_the_result() -> None:
    sim = carom.Simulation(
        find("pile"),
        until=1.0,
        max_iterations=1,
        max_halvings=0,
        pile_contacts=10_000,
        gauss_seidel_sweeps=0,
        solver="newton",
    )
    with pytest.raises(carom.RunFailed) as failed:
        sim.step(10_000)
    assert failed.value.result.status == "failed"
    assert failed.value.result.outcome.time == pytest.approx(
        sim.time, abs=2 * failed.value.result.scene.run.step
    )
