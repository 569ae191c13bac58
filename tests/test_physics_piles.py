"""Piles: redundant contacts that carry each other, at rest to rounding or to the tolerance that piles are solved with."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom.cli.examples import find
from physics_scenes import G, below, example, line, run


def solved(result: carom.Result) -> None:
    """No step unsolved, none halved, no penetration."""
    s = result.summary
    assert result.outcome.ok
    assert s["unconverged"] == s["halvings"] == 0
    assert not np.asarray(result.steps.unconverged).any()
    assert not np.asarray(result.steps.halvings).any()
    below(1e-9, "penetration / r", s["penetration_max_relative"])
    print(f"fallbacks {s['fallbacks']}, truncated {s['truncated_sequences']}, iterations {s['iterations']}")


def fastest(result: carom.Result, frames: slice) -> float:
    """Largest speed of centres and surfaces, m/s."""
    v = np.linalg.norm(np.asarray(result.velocity)[frames], axis=2)
    w = np.linalg.norm(np.asarray(result.angular_velocity)[frames], axis=2) * result.bodies["radius"]
    return float(max(v.max(), w.max()))


def test_a_column_of_five_stays_at_rest() -> None:
    result = example("column")
    solved(result)
    # m g h of up to five balls at each level; what is left is the rounding of their sum.
    below(1e-15, "column: speed", fastest(result, slice(None)))
    below(1e-15, "column: drift", np.asarray(result.position) - np.asarray(result.position[0]))
    assert result.summary["impact_problems"]["max"] == 1
    assert result.summary["fallbacks"] == 0
    assert len(result.impacts) == 0
    # Contact k carries the 5 - k balls above it.
    contacts = result.contacts.at(500)
    m, h = 0.1, 1e-3
    for (a, b), impulse in zip(
        np.asarray(contacts.body).tolist(), np.abs(np.asarray(contacts.impulse)[:, 2])
    ):
        carried = 5 if b == 5 else 5 - max(a, b)
        assert impulse == pytest.approx(carried * m * G * h, rel=1e-7)


@pytest.mark.parametrize("spinning", [pytest.param(False, marks=pytest.mark.long), True])
def test_ten_balls_in_a_corner_come_to_rest(spinning: bool) -> None:
    text = find("corner").read_text(encoding="utf-8")
    if not spinning:
        text = "\n".join(line for line in text.splitlines() if not line.startswith("spinning_radius"))
    result = run(carom.Scene.from_toml(text))
    solved(result)
    end = slice(-200, None)
    centres = np.linalg.norm(np.asarray(result.velocity)[end], axis=2)
    if spinning:
        # A pile is solved to 1e-7 of its loads (m g h) in each step; 1e-4 g h is far above what that leaves.
        below(1e-4 * G * 1e-3, "corner with spinning friction: all speeds", fastest(result, end))
    # Without spinning friction a ball may turn for ever about the axis through its contacts, and creep by what
    # they shift.
    below(1e-2 * G * 1e-3, "corner: speed of the centres in the last 0.2 s", centres)
    below(1e-5, "corner: drift in the last 0.2 s", np.ptp(np.asarray(result.position)[end], axis=0))
    assert result.energy.total[-1] < result.energy.total[0]
    # Balls that roll on balls may gain a little, as second order in h (rule R5).
    below(2e-6, "corner: energy rise", result.summary["energy"]["max_rise_relative"])


def test_a_grid_of_27_balls_comes_to_rest() -> None:
    result = example("grid_3x3x3")
    solved(result)
    assert result.summary["fallbacks"] == 0
    below(1e-13, "grid: speed in the last 0.2 s", fastest(result, slice(-200, None)))
    below(1e-13, "grid: drift in the last 0.2 s", np.ptp(np.asarray(result.position)[-200:], axis=0))
    below(1e-9, "grid: energy rise", result.summary["energy"]["max_rise_relative"])


@pytest.mark.parametrize("n", [3, 5])
def test_a_row_on_a_rough_floor_is_redundant_and_stays(n: int) -> None:
    """All contacts stick: 5 contacts with 15 rows of rank 14 for three balls, 9 with 27 of rank 24 for five."""
    scene = line([0.0] * n, friction=0.4)
    scene.gravity = (0.0, 0.0, -G)
    law = scene.contact("ball", "floor", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, -0.03125), normal=(0, 0, 1), material="floor")
    result = run(scene, steps=300)
    solved(result)
    below(1e-15, f"row of {n} at rest: speed", fastest(result, slice(None)))
    # Pushed along the floor by gravity below the friction angle it stays too, now with loads between the balls.
    scene.gravity = (G * np.sin(0.2), 0.0, -G * np.cos(0.2))
    law.rolling_radius = 0.4 * 0.03125
    result = run(scene, steps=300)
    solved(result)
    below(1e-6 * G * 1e-3, f"row of {n} on a slope: speed", fastest(result, slice(None)))


def test_a_ball_in_an_edge_and_in_a_corner_rests() -> None:
    """Two and three walls with friction: 6 and 9 rows on 6 freedoms."""
    for walls in (2, 3):
        scene = carom.Scene(gravity=tuple(-5.0 * np.eye(3)[:walls].sum(0)))
        scene.contact("ball", "wall", friction=0.4, restitution=0.3)
        scene.sphere("ball", radius=0.25, mass=2.0, material="ball", position=(0.25, 0.25, 0.25))
        for k in range(walls):
            scene.plane(f"wall{k}", point=(0, 0, 0), normal=tuple(np.eye(3)[k]), material="wall")
        result = run(scene, steps=200)
        solved(result)
        # Newton leaves a residual of rounding in m g h, though not always of a single one.
        below(1e-14, f"ball on {walls} walls: speed", fastest(result, slice(None)))


@pytest.mark.parametrize("friction", [0.6, 0.72, 0.87, 1.0])
def test_a_ball_thrown_into_a_corner(friction: float) -> None:
    """From mu = 1/sqrt(2) three walls at right angles can hold a ball by friction alone, and no velocity may be as
    Newton's law asks in all three. Parts of the step take the walls one by one, or restitution goes."""
    for velocity, spin in (
        ((-1, -1, -1), (0, 0, 0)),
        ((-1, -0.9, -0.8), (1, -5, 8)),
        ((-1, -0.5, -0.3), (0, 0, 0)),
    ):
        scene = carom.Scene(gravity=(0, 0, -G), run={"step": 1e-3})
        scene.contact("ball", "wall", friction=friction, restitution=0.8)
        start = tuple(0.01 - 5e-4 * v for v in velocity)
        scene.sphere("ball", radius=0.01, mass=0.01, material="ball", position=start, velocity=velocity,
                     angular_velocity=spin)  # fmt: skip
        for k in range(3):
            scene.plane(f"wall{k}", point=(0, 0, 0), normal=tuple(np.eye(3)[k]), material="wall")
        result = run(scene, steps=20)
        assert result.outcome.ok
        assert result.summary["unconverged"] == 0
        below(1e-9, f"corner, mu = {friction}: penetration / r", result.summary["penetration_max_relative"])
        below(1e-12, f"corner, mu = {friction}: energy rise", result.summary["energy"]["max_rise_relative"])


@pytest.mark.long
def test_a_pile_of_8000_that_was_hit_comes_to_rest() -> None:
    """While such a pile is being hit its loads may leave closing speeds for the impacts to take. Where it might do so
    after that, it never lay still: 3e-3 of the energy that lifts each grain by a radius, and energy rose by 2e-4."""
    result = run(carom.Scene.from_toml(find("pile"), parameters={"N": 8000, "residual": 1e-3}))
    assert result.outcome.ok
    assert result.summary["unconverged"] == result.summary["halvings"] == 0
    mass, radius = result.bodies["mass"].sum(), 5e-3
    below(
        2e-4, "pile of 8000: kinetic energy over N m g r", result.energy.kinetic[-1] / (mass * 9.8 * radius)
    )
    below(2e-6, "pile of 8000: energy rise", result.summary["energy"]["max_rise_relative"])


def test_a_wedged_ball_of_a_tower_gains_no_energy() -> None:
    """Twenty-eight balls in a box three wide: one is wedged between a ball and two walls. The position level alone held
    it, from its own impulses of the step before, and the velocity level let it fall: 5e-3 of the energy in a step."""
    path = find("pile")
    scene = carom.Scene.from_toml(path, parameters={"N": 28, "seed": 3})
    result = run(scene, steps=500)
    assert result.outcome.ok
    assert result.summary["unconverged"] == 0
    below(1e-4, "tower: energy rise", result.summary["energy"]["max_rise_relative"])


def test_grains_that_roll_hardly_come_to_rest_without_parts_of_steps() -> None:
    scene = carom.Scene(gravity=(0, 0, -9.81))
    for other in ("grain", "wall"):
        scene.contact(
            "grain", other, friction=0.1, restitution=0.9, rolling_radius=1e-4, spinning_radius=1e-4
        )
    scene.box("box", low=(0, 0, 0), high=(0.0215, 0.0215, 1), open=["high_z"], material="wall")
    rng = np.random.default_rng(1)
    for k in range(150):
        place = 0.0041 * np.array([k % 5, k // 5 % 5, k // 25]) + (0.0026, 0.0026, 0.0025)
        r, v = 0.002 * rng.uniform(0.67, 1), 0.05 * rng.uniform(-1, 1, 3)
        scene.sphere(f"g{k}", radius=r, density=2500, position=place, velocity=v, material="grain")
    result = carom.simulate(scene, step=1e-3, until=0.2)
    # Forces that hold one another let sweeps crawl: with a quarter of them 17 steps were cut, in ten times the time.
    assert result.summary["halvings"] <= 1
    assert result.summary["unconverged"] == 0
    assert result.steps["contacts"][-1] > 350
