"""Figures that pages state of the scheme: each test measures one, names the page, and fails if it is no longer so."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import audit_rods
import carom
import numpy as np
import pytest
from carom import CaromWarning, audit, billiards
from numpy.typing import NDArray

F64 = NDArray[np.float64]
G = 9.8


def touching_balls(count: int, radius: float) -> F64:
    """(count, 3) the balls of a face-centred cubic packing that are nearest to its middle."""
    side = math.sqrt(2.0) * radius
    places = np.array(
        [(i, j, k) for i in range(-4, 5) for j in range(-4, 5) for k in range(-4, 5) if (i + j + k) % 2 == 0]
    )
    middle = radius * np.array([0.01, 0.003, 0.001])
    places = side * places
    return np.asarray(places[np.argsort(np.linalg.norm(places - middle, axis=1))[:count]])


def change_of_energy(count: int, seed: int, **options: float) -> F64:
    """Changes of the energy of smooth balls with e_N = 1, over itself, after each step: one ball hits `count` that touch."""
    rng, r = np.random.default_rng(seed), 0.03
    places, way = touching_balls(count, r), rng.normal(size=3)
    way /= np.linalg.norm(way)
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": 1e-3, "until": 0.01, **options})
    scene.contact("ball", "ball", friction=0, restitution=1)
    for k, place in enumerate(places):
        scene.sphere(f"b{k}", radius=r, mass=0.2, material="ball", position=place.tolist())
    start = places.mean(axis=0) + (((places - places.mean(axis=0)) @ way).max() + 2.5 * r) * way
    scene.sphere(
        "shot", radius=r, mass=0.2, material="ball", position=start.tolist(), velocity=(-5 * way).tolist()
    )
    steps = carom.simulate(scene).steps
    assert not np.asarray(steps["truncated"]).any()
    return np.asarray(steps["energy_kinetic"]) / (0.5 * 0.2 * 25) - 1


def test_energy_of_smooth_elastic_balls() -> None:
    """docs/reference/determinism.md: up to 10 contacts to rounding; more lose up to 1e-7 by default, and never gain."""
    few = [np.abs(change_of_energy(n, seed)).max() for n in (3, 4, 5) for seed in range(4)]
    many = np.array([change_of_energy(n, seed) for n in (13, 21) for seed in range(12)])
    sharp = [
        np.abs(change_of_energy(13, seed, tolerance=1e-12, pile_tolerance=1e-12)).max() for seed in range(12)
    ]
    print(f"few {max(few):.1e}, many lose {-many.min():.1e} gain {many.max():.1e}, sharp {max(sharp):.1e}")
    assert max(few) < 1e-13
    assert max(sharp) < 1e-13
    assert -many.min() < 1e-7
    assert many.max() < 1e-11


@pytest.mark.parametrize(("friction", "lost"), [(0.0, 0.011), (0.5, 0.007)])
def test_amplitude_of_a_ball_in_a_bowl(friction: float, lost: float) -> None:
    """docs/theory/algorithm.md, section 10: as printed sliding loses 1.1 %, rolling 0.7 % of the amplitude in 2 s, half at
    half the step; nothing where loads are solved once."""
    length, start = 0.48, 0.1
    found = []
    for step, position_friction in ((1e-3, "paper"), (5e-4, "paper"), (1e-3, "once")):
        run = {"step": step, "until": 2.0, "position_friction": position_friction}
        scene = carom.Scene(gravity=(0, 0, -G), run=run)
        scene.contact("ball", "wall", friction=friction, restitution=0)
        scene.ball_wall("bowl", point=(0, 0, 0), radius=0.5, inside=True, material="wall")
        scene.sphere("ball", radius=0.02, mass=0.1, material="ball",
                     position=(length * math.sin(start), 0, -length * math.cos(start)))  # fmt: skip
        steps = carom.simulate(scene, every=1000).steps
        height = (steps["energy_kinetic"][-1] + steps["energy_potential"][-1]) / (0.1 * G) + length
        found.append(1 - math.acos(1 - height / length) / start)
    print(f"friction {friction}: {found[0]:.4f} and {found[1]:.4f} of the amplitude lost")
    assert found[0] == pytest.approx(lost, rel=0.1)
    assert found[1] == pytest.approx(lost / 2, rel=0.1)
    assert abs(found[2]) < 1e-7


@pytest.mark.parametrize(("tolerance", "held"), [(1e-8, 1e-7), (1e-12, 1e-11)])
def test_velocities_that_joints_hold(tolerance: float, held: float, tmp_path: Path) -> None:
    """docs/reference/scenario.md: lengths to 1e-10 of themselves, velocities to 1e-7 of the fastest, among impacts."""
    lengths, speeds = [], []
    for seed in range(12):
        scene, options = audit_rods.scene(seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)
            run = carom.simulate(
                scene, out=tmp_path / str(seed), until=0.4, step=options["step"], tolerance=tolerance
            )
        report = audit.check(run)
        fastest = float(np.linalg.norm(run.velocity, axis=2).max())
        if (length := report["joint"].worst) is not None and (
            speed := report["joint speed"].worst
        ) is not None:
            lengths.append(length.value / audit_rods.RADIUS)
            speeds.append(speed.value / fastest)
    print(
        f"tolerance {tolerance:g}: lengths {max(lengths):.1e} of a radius, velocities {max(speeds):.1e} of the fastest"
    )
    assert len(speeds) > 8
    assert max(lengths) < 1e-10
    assert max(speeds) < held


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("ratio", [1e3, 1e5, 1e7])
@pytest.mark.parametrize(("tolerance", "held"), [(1e-8, 1e-7), (1e-12, 1e-11)])
def test_velocities_that_joints_hold_beside_a_heavy_ball(ratio: float, tolerance: float, held: float) -> None:
    """The same where impulses of a heavy ball hide those of two light ones that hang on it and hit the floor."""
    arms = np.array([[0.05, -0.009, 0.0], [-0.02, -0.009, 0.02]])
    missed = []
    for seed in range(4):
        scene = carom.Scene(gravity=(0, 0, -G))
        scene.contact("b", "b", friction=0.3, restitution=0.5)
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
        scene.sphere("big", radius=0.07, mass=1, material="b", position=(0, 0, 0.071 + 0.004 * seed))
        light = np.array([0.12, 0, 0.11])
        scene.sphere("a", radius=0.02, mass=1 / ratio, material="b", position=light.tolist())
        scene.sphere(
            "c", radius=0.0075, mass=0.3 / ratio, material="b", position=(light + arms[0] - arms[1]).tolist()
        )
        scene.joint("ball", between=("a", "c"), point=(light + arms[0]).tolist())
        scene.joint("rod", between=("big", "a"))
        run = carom.simulate(scene, step=1e-3, until=0.3, tolerance=tolerance)
        ends = []
        for ball, arm in zip((1, 2), arms, strict=True):
            w, q = run.orientation[:, ball, :1], run.orientation[:, ball, 1:]
            turned = arm + 2 * np.cross(q, np.cross(q, arm) + w * arm)
            ends.append(run.velocity[:, ball] + np.cross(run.angular_velocity[:, ball], turned))
        assert run.summary["fallbacks"] == 0
        missed.append(np.abs(ends[0] - ends[1]).max() / np.abs(run.velocity).max())
    print(f"ratio {ratio:g}, tolerance {tolerance:g}: velocities to {max(missed):.1e} of the fastest")
    assert max(missed) < held


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("tolerance", [1e-8, 1e-12, 1e-14])
@pytest.mark.parametrize("ratio", [1e4, 1e6])
def test_light_balls_below_a_heavy_one_are_solved_to_rounding(ratio: float, tolerance: float) -> None:
    """What presses a light ball rounds off its velocity: no tolerance asks for more, and nothing falls back for it."""
    scene = carom.Scene(gravity=(0, 0, -G))
    scene.contact("b", "b", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
    for name, x in (("left", 0.0), ("right", 0.041)):
        scene.sphere(name, radius=0.02, mass=1 / ratio, material="b", position=(x, 0, 0.02))
    scene.sphere("heavy", radius=0.07, mass=1, material="b", position=(0.001, 0, 0.1124))
    summary = carom.simulate(scene, step=1e-3, until=0.2, tolerance=tolerance).summary
    assert summary["fallbacks"] <= 1
    assert summary["halvings"] == summary["unconverged"] == 0


def pyramid_hit(step: float, gravity: float, law: str) -> float:
    """Gain of energy, J, in the step in which a ball of 30 g falls with 2 m/s onto a pyramid of 13 on a floor."""
    r, scene = 0.01, carom.Scene(gravity=(0, 0, -gravity), run={"step": step, "until": step, "impact": law})
    for other in ("ball", "floor"):
        scene.contact("ball", other, friction=0.6, restitution=0.8)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    for layer in range(3):
        side = 3 - layer
        for i in range(side):
            for j in range(side):
                at = (2 * i - side + 1) * r, (2 * j - side + 1) * r, (1 + math.sqrt(2.0) * layer) * r
                fall = (0.0, 0.0, -2.0 if side == 1 else 0.0)
                scene.sphere(
                    f"{layer}{i}{j}", radius=r, mass=0.03, position=at, velocity=fall, material="ball"
                )
    energy = carom.simulate(scene).summary["energy"]
    return float(energy["final"] - energy["initial"])


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
def test_a_hit_against_gravity_gains_the_way_of_a_step() -> None:
    """docs/guides/choose.md: up to `m g h v`, where the impact itself loses nothing."""
    gains = [pyramid_hit(step, 9.81, "one-shot") for step in (2e-4, 1e-4)]
    assert gains[0] == pytest.approx(8.8e-5, rel=0.01)
    assert gains[0] / gains[1] == pytest.approx(2.0, rel=0.01)
    assert gains[0] < 0.03 * 9.81 * 2e-4 * 2.0
    assert abs(pyramid_hit(2e-4, 0.0, "one-shot")) < 1e-12
    assert pyramid_hit(2e-4, 9.81, "sequence") < 0.0


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
def test_balls_below_a_nose_that_rebound_do_not_count_as_missed() -> None:
    """docs/guides/diagnostics.md: they have an impact of a contact that weight alone would open."""
    table = billiards.table("7ft")
    scene = table.scene("a slope", until=0.7, method="nsga", step=1e-4)
    scene.world.gravity = (0.0, -0.4, -9.79)
    for i in range(5):
        table.ball(scene, str(i), at=(1.3 + 2.0 * table.spec.ball_radius * i, table.reach))
    for i in range(3):
        at = (1.33 + 0.06 * i, table.reach + 0.2 + 0.01 * i)
        table.ball(scene, f"x{i}", at=at, mass=0.1 + 0.05 * i)
    cue = table.cue_ball(scene, at=(0.7, 0.3))
    billiards.strike(cue, ball_speed=2.0, direction="-5 deg", side=0.3, height=-0.3)
    result = carom.simulate(scene)
    hits = result.impacts
    assert result.summary["missed_impacts"] == 0
    apart = hits.where((hits.approach > 0) & (hits.problem > 0))
    assert len(apart)
    assert (apart.separation > apart.approach).all()
