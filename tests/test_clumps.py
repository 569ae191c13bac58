"""Clumps: touching balls that a ball joint and a lock make one body, as docs/reference/scenario.md shows them."""

from __future__ import annotations

import math

import carom
import numpy as np
import pytest
from carom import audit

G, R, DENSITY = 9.8, 0.01, 2500.0
REACH = 2 * R
"""Distance of the centres, m: balls of a clump may touch."""


def dumbbell(
    left: tuple[float, float, float], along: tuple[float, float, float], **law: float
) -> carom.Scene:
    """Two equal balls as one body, `right` in the direction `along` from `left`."""
    scene = carom.Scene(gravity=(0, 0, -G))
    for other in ("ball", "wall"):
        scene.contact("ball", other, **{"friction": 0.3, "restitution": 0.0, **law})
    start, unit = np.array(left), np.array(along) / np.linalg.norm(along)
    for name, share in (("left", 0.0), ("right", REACH)):
        scene.sphere(
            name, radius=R, density=DENSITY, material="ball", position=(start + share * unit).tolist()
        )
    scene.joint("ball", between=["left", "right"], point=(start + 0.5 * REACH * unit).tolist())
    scene.joint("lock", between=["left", "right"])
    return scene


def test_a_dumbbell_swings_as_a_compound_pendulum() -> None:
    """About the centre of one ball: I = 2 (2/5 m r^2) + m (2 r)^2 = 24/5 m r^2, torque 2 m g r sin(angle)."""
    angle = 0.02
    period = 2 * math.pi * math.sqrt(12 * R / (5 * G)) * (1 + angle**2 / 16)
    errors = []
    for step in (1e-3, 5e-4):
        scene = dumbbell((0, 0, 0), (math.sin(angle), 0, -math.cos(angle)))
        scene.joint("fix", body="left", point=(0, 0, 0))
        run = carom.simulate(scene, step=step, until=1.6, every=1)
        x, t = run["right"].position[:, 0], run.time
        down = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))
        crossings = t[down] + x[down] / (x[down] - x[down + 1]) * step
        errors.append(float(np.diff(crossings).mean()) / period - 1)
        assert len(run.contacts) == 0
        together = np.linalg.norm(run["right"].position - run["left"].position, axis=1)
        assert np.abs(together - REACH).max() < 1e-10 * R
    print(f"period {period:.6f} s, off by {errors[0]:.1e} and {errors[1]:.1e} of it")
    assert abs(errors[0]) < 1e-4
    assert abs(errors[1]) < 0.3 * abs(errors[0])


def test_a_dumbbell_slides_to_rest_as_a_block() -> None:
    """Across its axis it would roll; along it neither ball can turn, and friction mu stops it after v^2/(2 mu g)."""
    speed, mu = 0.5, 0.3
    scene = dumbbell((0, 0, R), (1, 0, 0), friction=mu)
    for ball in scene.spheres:
        ball.velocity = (speed, 0, 0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    run = carom.simulate(scene, step=1e-4, until=0.3)
    way = run["left"].position[-1, 0]
    print(f"stops after {way:.6f} m, {speed**2 / (2 * mu * G):.6f} m by Coulomb's law")
    assert way == pytest.approx(speed**2 / (2 * mu * G), rel=1e-3)
    assert np.linalg.norm(run["left"].velocity[-1]) < 1e-9
    # The front bears more: friction at the floor has a moment about the centre of mass.
    middle = run.contacts.at(100)
    loads = {pair[0]: impulse[2] for pair, impulse in zip(middle.pair, middle["impulse"], strict=True)}
    assert loads["right"] - loads["left"] == pytest.approx(mu * sum(loads.values()), rel=1e-3)
    assert audit.check(run).ok


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("friction", ["paper", "once"])
def test_a_tumbling_dumbbell_of_touching_balls_has_no_contact_within(method: str, friction: str) -> None:
    """Its own contact would repeat the joints, and has pushed with impulses without bound."""
    scene = dumbbell((0, 0, 3 * R), (1, 0, 0.4), restitution=0.5)
    for ball in scene.spheres:
        ball.velocity = tuple(np.cross((3.0, 7.0, 0.0), np.subtract(ball.position, (0, 0, 3 * R))))
        ball.angular_velocity = (3.0, 7.0, 0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    run = carom.simulate(
        scene,
        step=5e-4,
        until=0.5,
        every=1,
        contacts=True,
        impacts=True,
        method=method,
        position_friction=friction,
    )
    assert {b for _, b in run.contacts["pair"]} == {"floor"}
    report = audit.check(run)
    assert report.ok, report


def test_three_balls_of_a_clump_touch_all_round() -> None:
    """A pair that no joint names is held apart by the others."""
    scene = carom.Scene(gravity=(0, 0, -G))
    for other in ("ball", "wall"):
        scene.contact("ball", other, friction=0.3, restitution=0.5)
    places = R * np.array([[0, 0, 3], [2, 0, 3], [1, 0, 3 + math.sqrt(3)]])
    for name, place in zip("abc", places, strict=True):
        scene.sphere(name, radius=R, density=DENSITY, material="ball", position=place.tolist(),
                     velocity=np.cross((0, 5.0, 0), place - places[0]).tolist(), angular_velocity=(0, 5.0, 0))  # fmt: skip
    for pair in ("ab", "bc"):
        between = [places["abc".index(name)] for name in pair]
        scene.joint("ball", between=list(pair), point=(0.5 * (between[0] + between[1])).tolist())
        scene.joint("lock", between=list(pair))
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    run = carom.simulate(scene, step=5e-4, until=0.4, every=1, contacts=True, impacts=True)
    assert {b for _, b in run.contacts["pair"]} == {"floor"}
    closing = np.linalg.norm(run["a"].position - run["c"].position, axis=1)
    assert np.abs(closing - 2 * R).max() < 1e-9 * R
    assert audit.check(run).ok


# Moreau-Jean takes reactions at the end of a step, and loses energy to first order.
@pytest.mark.parametrize(("method", "loss"), [("nsga", 2e-3), ("moreau", 0.1)])
def test_beads_that_are_joined_where_they_touch_hang_as_a_free_chain(method: str, loss: float) -> None:
    """Their contact would only keep them from bending, by next to no lever: runs stopped."""
    scene = carom.Scene(gravity=(0, 0, -G))
    scene.contact("ball", "ball", friction=0.3, restitution=0.5)
    for k in range(3):
        scene.sphere(f"b{k}", radius=R, density=DENSITY, material="ball", position=(2 * R * k, 0, 0))
    scene.joint("fix", body="b0", point=(-R, 0, 0))
    for k in range(2):
        scene.joint("ball", between=[f"b{k}", f"b{k + 1}"], point=((2 * k + 1) * R, 0, 0))
    run = carom.simulate(scene, step=2e-4, until=0.4, every=1, contacts=True, impacts=True, method=method)
    assert len(run.contacts) == 0
    energy = np.asarray(run.energy.kinetic + run.energy.potential)
    assert np.abs(energy - energy[0]).max() < loss * np.asarray(run.energy.kinetic).max()
    assert audit.check(run).ok
