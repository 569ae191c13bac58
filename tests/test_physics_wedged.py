"""Balls that friction wedges: states of random drops in which a solver once stopped, or let the energy rise."""

from __future__ import annotations

from pathlib import Path

import carom
import numpy as np
import pytest
from carom import _core
from physics_scenes import below

FOLDER = Path(__file__).parent / "data" / "wedged"


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("level", ["position", "velocity"])
def test_balls_that_wedge_one_another_go_on(level: str) -> None:
    """States of falling towers (5 and 7 balls) of which no part of a step had a solution that the solvers found."""
    tower = carom.Scene.from_toml(FOLDER / f"{level}.toml")
    result = carom.simulate(tower, every=1, contacts=True, impacts="every")
    s = result.summary
    assert result.outcome.ok
    assert s["unconverged"] == 0
    below(1e-9, "penetration / r", s["penetration_max_relative"])
    # Balls that are held by friction at one level alone: first order in the step, here one of 2 ms (decision record 015).
    below(1e-3, "energy rise", s["energy"]["max_rise_relative"])
    assert carom.audit.check(result).ok


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
def test_no_ball_stays_where_it_is_while_its_velocity_grows() -> None:
    """Five of eleven balls fall with 0.9 m/s, and friction held them at the position level alone: the kinetic energy grew by
    the weight's power in every step, to eight times all that there was."""
    result = carom.simulate(FOLDER / "one_level.toml", every=1, contacts=True)
    falling = np.asarray(result.velocity[0])[:, 2] < -0.9
    assert falling.sum() == 5
    way = np.asarray(result.position[1] - result.position[0])[falling, 2]
    assert (way < 0.0).all()
    assert way.min() < -0.45 * 0.002
    # What they fall onto stops them.
    below(0.1, "speed of what fell, m/s", np.abs(np.asarray(result.velocity[1])[falling, 2]))
    assert result.summary["energy"]["max_rise"] == 0.0
    assert carom.audit.check(result).ok


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
def test_a_pile_that_another_solver_ends_has_frames_of_its_own() -> None:
    """Pairs that join in a second round are solved with those of the first: what a pile wrote of its frames is no start."""
    result = carom.simulate(FOLDER / "frame.toml", every=1, contacts=True, impacts="every")
    assert result.summary["fallbacks"] > 0
    assert carom.audit.check(result).ok


def test_the_solution_that_the_safeguard_looked_at_is_the_one_that_is_taken() -> None:
    """From its impulses of the last step: the bisection ended in forces of 8000 times the weight of a ball, and in 3.1 mJ
    of 0.48 J out of nothing."""
    simulation = _core.Simulation(carom.Scene.from_toml(FOLDER / "impact.toml").to_model())
    with np.load(FOLDER / "impact.npz") as state:
        simulation.restore(dict(state))
    rises = simulation.monitors()["energy"]["rises"]
    assert simulation.advance(1, 0, False, 1e9)["outcome"] is None
    assert simulation.monitors()["energy"]["rises"] == rises


@pytest.mark.parametrize("law", ["sequence", "one-shot"])
@pytest.mark.parametrize("mu", [1.5, 1.7, 1.75, 2.0, 2.5, 5.0])
@pytest.mark.parametrize("held", ["line", "rod"])
def test_a_ball_that_its_guide_wedges_stops(held: str, mu: float, law: str) -> None:
    """It comes 30 degrees off the normal. Above mu = tan 60 the cone of friction holds the guide's direction, and no
    impulse gives a rebound. Forces without bound were one, of 7e10 N s."""
    r, way = 0.01, np.array([0.5, 0.0, -(0.75**0.5)])
    scene = carom.Scene("guided", gravity=(0, 0, 0))
    scene.contact("ball", "floor", friction=mu, restitution=0.6)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.sphere("ball", radius=r, mass=0.1, material="ball", position=(0, 0, r), velocity=way)
    if held == "line":
        scene.joint("line", body="ball", direction=way)
    else:
        scene.joint("rod", between=["ball", "ground"], points=[(0, 0, r), (0.1 * 0.75**0.5, 0, r + 0.05)])
    scene.joint("lock", body="ball")
    result = carom.simulate(scene, step=1e-6, until=3e-6, impact=law)
    wedged = mu > 3.0**0.5
    assert (result.summary["fallbacks"] > 0) == wedged
    below(1e-4, "speed along the guide, m/s", abs(result.velocity[-1][0] @ way + (0.0 if wedged else 0.6)))
    normal = 0.1 * (0.75**-0.5 if wedged else 1.6 / (0.75**0.5 - 0.5 * mu))
    below(1.01 * normal, "normal impulse, N s", np.asarray(result.impacts.impulse)[:, 2])
