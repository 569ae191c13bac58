"""Laws with springs where one contact of a clump is hit: a normal impulse changes the slip, and Newton's law is another."""

from __future__ import annotations

import math

import carom
import numpy as np
import pytest
from numpy.typing import NDArray

INERTIA, CENTRE, MASS, ANGLE = [1e-6, 6e-6, 6.5e-6], [0.012, 0.001, 0.002], 0.03, -0.2
BEFORE = (0.4, 0.2, -1.0)
TURN = np.array([[math.cos(ANGLE), 0, math.sin(ANGLE)], [0, 1, 0], [-math.sin(ANGLE), 0, math.cos(ANGLE)]])


def hit(law: str, friction: float, restitution: float, *, dust: bool = False) -> carom.Result:
    scene = carom.Scene("clump", gravity=(0, 0, 0))
    scene.contact("b", "b", friction=friction, restitution=restitution)
    turn = (math.cos(ANGLE / 2), 0, math.sin(ANGLE / 2), 0)
    scene.clump(
        "c",
        spheres=[[0, 0, 0, 0.01], [0.03, 0, 0, 0.01]],
        mass=MASS,
        material="b",
        inertia=INERTIA,
        centre=CENTRE,
        position=(0, 0, 0.01001),
        orientation=turn,
        velocity=BEFORE,
    )
    if dust:
        at = TURN @ [0.041, 0, 0] + [0, 0, 0.01001]
        scene.sphere("dust", radius=1e-3, mass=3e-8, material="b", at=tuple(at), velocity=BEFORE)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
    return carom.simulate(scene, step=1e-6, until=2e-5, impact=law, tolerance=1e-13, every=1)


def after(result: carom.Result) -> NDArray[np.float64]:
    clump = result.clumps["c"]
    return np.concatenate([np.asarray(clump.velocity)[-1], np.asarray(clump.angular_velocity)[-1]])


def integrated(mu: float, e: float, part: float = 1e-6) -> NDArray[np.float64]:
    """By the normal impulse as the time: friction opposes the slip or holds it, until `e^2` of the work is back."""
    arm = np.array([0, 0, -0.01]) - TURN @ CENTRE
    inertia = TURN @ np.diag(INERTIA) @ TURN.T
    cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    delassus = np.eye(3) / MASS - cross @ np.linalg.inv(inertia) @ cross
    u, impulse, work = np.array(BEFORE), np.zeros(3), 0.0
    holds = -np.linalg.solve(delassus[:2, :2], delassus[:2, 2])
    while True:
        slip = float(np.hypot(u[0], u[1]))
        sticks = slip < 1e-3 and float(np.hypot(*holds)) <= mu
        along = holds if sticks else -mu * u[:2] / max(slip, 1e-3)
        given = part * np.array([*along, 1.0])
        speed = u[2]
        u, impulse = u + delassus @ given, impulse + given
        work -= 0.5 * (speed + u[2]) * part / (1.0 if u[2] < 0 else e**2)
        if u[2] > 0 and work <= 0:
            turning = np.linalg.solve(inertia, np.cross(arm, impulse))
            return np.concatenate([np.array(BEFORE) + impulse / MASS, turning])


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize("friction", [0.1, 0.4, 10.0])
def test_an_impact_of_one_contact_is_that_of_its_spring(law: str, friction: float) -> None:
    result = hit(law, friction, 0.7)
    size = np.array([1, 1, 1, 100, 100, 100])
    np.testing.assert_allclose(after(result) / size, integrated(friction, 0.7) / size, rtol=0, atol=2e-3)
    assert carom.audit.check(result).ok
    newton = after(hit("sequence", friction, 0.7))
    assert np.abs((after(result) - newton) / size).max() > 0.03


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_dust_elsewhere_on_the_clump_changes_nothing(law: str) -> None:
    with pytest.warns(carom.CaromWarning, match="times the mass"):
        dusty = hit(law, 0.4, 0.7, dust=True)
    np.testing.assert_allclose(after(dusty), after(hit(law, 0.4, 0.7)), rtol=2e-3, atol=2e-3)
