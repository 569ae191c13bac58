"""Cohesion: what sticks, what it takes to tear it off, and what it costs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import audit_scenes
import carom
import numpy as np
import pytest
from carom import audit
from carom.audit import cohesion

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

R, M, G = 0.01, 0.01, 9.81


def stuck(force: float, *, distance: float = 1e-5, gravity: float = G, **first: Any) -> carom.Scene:
    """A ball under a roof, or with an own speed."""
    scene = carom.Scene(gravity=(0, 0, -gravity))
    for other in ("ball", "roof"):
        scene.contact("ball", other, friction=0.3, restitution=0.0, cohesion=force,
                      rupture_distance=distance)  # fmt: skip
    scene.plane("roof", point=(0, 0, 0), normal=(0, 0, -1), material="roof")
    scene.sphere("ball", **{"radius": R, "mass": M, "material": "ball", "position": (0, 0, -R), **first})
    return scene


def run(scene: carom.Scene, until: float = 0.05, **options: Any) -> carom.Result:
    return carom.simulate(scene, until=until, **{"step": 1e-3, "every": 1, **options})


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize(("force", "holds"), [(0.999, False), (1.0, True), (5.0, True)])
def test_a_roof_holds_a_ball_up_to_its_pull_off_force(method: str, force: float, holds: bool) -> None:
    result = run(stuck(force * M * G), 0.1, method=method)
    fallen = -R - float(result.position[-1, 0, 2])
    assert (abs(fallen) < 1e-12) if holds else (fallen > 1e-6)
    if force > 1.0:  # what presses is what is left of the attraction
        pressed = np.asarray(result.contacts["impulse"])[:, 2]
        assert pressed == pytest.approx(np.full(100, -(force - 1.0) * M * G * 1e-3), rel=1e-9)


@pytest.mark.parametrize(("force", "holds"), [(1.95, False), (2.05, True)])
def test_a_doublet_carries_the_weight_of_both_at_its_upper_contact(force: float, holds: bool) -> None:
    scene = stuck(force * M * G)
    scene.sphere("lower", radius=R, mass=M, material="ball", position=(0, 0, -3 * R))
    result = run(scene, 0.1)
    fallen = -R - float(result.position[-1, 0, 2])
    assert (abs(fallen) < 1e-10) == holds
    apart = float(result.position[-1, 0, 2] - result.position[-1, 1, 2])
    assert apart == pytest.approx(2 * R, abs=1e-10)  # the lower contact carries one weight


@pytest.mark.parametrize("distance", [1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("step", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("share", [1.05, 3.0])
def test_tearing_a_ball_off_takes_the_work_of_rupture(distance: float, step: float, share: float) -> None:
    force = 0.5
    work = 0.5 * force * distance
    speed = np.sqrt(2 * share * work / M)
    until = max(20 * distance / speed, 20 * step)
    result = run(stuck(force, distance=distance, gravity=0.0, velocity=(0, 0, -speed)), until, step=step)
    left = 0.5 * M * float(result.velocity[-1, 0, 2]) ** 2
    assert left == pytest.approx((share - 1.0) * work, rel=1e-9)
    energy = np.asarray(result.steps["energy_kinetic"]) + np.asarray(result.steps["energy_potential"])
    assert np.ptp(energy) < 1e-9 * work


def test_a_scene_that_begins_without_balls_is_judged() -> None:
    scene = carom.Scene(gravity=(0, 0, -G))
    scene.contact("a", "a", friction=0.3, restitution=0.2, cohesion=1e-3, rupture_distance=1e-4)
    region = {"low": (0, 0, 0.2), "high": (0.1, 0.1, 0.3)}
    scene.inflow("in", material="a", region=region, rate=100, radius=R, density=2500, count=3, seed=1)
    result = run(scene, 0.05)
    assert audit.check(result)["momentum"].judged > 0


@pytest.mark.parametrize("gap", [1.0, 1.0 + 1e-15, 1.1, 1.5, 2.7])
@pytest.mark.parametrize("step", [3e-3, 1e-3, 1e-4])
def test_a_ball_that_comes_within_the_distance_gains_the_work(gap: float, step: float) -> None:
    """Whether a step begins at the distance, a rounding beyond it, or spans it."""
    force, distance = 0.5, 1e-3
    speed = min(0.5 * distance / step, 1.0)
    low = -R - distance
    first = {"position": (0, 0, low - gap * speed * step), "velocity": (0, 0, speed)}
    scene = stuck(force, distance=distance, gravity=0.0, **first)
    result = run(scene, 60 * step, step=step)
    height = np.asarray(result.position)[:, 0, 2]
    free = np.flatnonzero((height > low) & (height < -R - 0.01 * distance))
    energy = np.asarray(result.steps["energy_kinetic"]) + np.asarray(result.steps["energy_potential"])
    assert len(free) > 0
    assert energy[free - 1] == pytest.approx(np.full(len(free), 0.5 * M * speed**2), rel=1e-12)
    assert audit.check(result).ok


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_a_pair_that_passes_beyond_the_distance_keeps_its_energy(speed: float, method: str) -> None:
    """It is never nearer than 1.5 d, but the line of its motion at the begin of a step is."""
    distance = 1e-5
    for start in np.linspace(-3.5e-3, -2.5e-3, 11):
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("a", "a", friction=0.0, restitution=1.0, cohesion=0.5, rupture_distance=distance)
        scene.sphere("a", radius=R, mass=M, material="a", position=(0, 0, 0))
        scene.sphere("b", radius=R, mass=M, material="a", position=(start, 2 * R + 1.5 * distance, 0),
                     velocity=(speed, 0, 0))  # fmt: skip
        result = run(scene, 8e-3, method=method)
        assert np.abs(np.asarray(result.velocity)[-1, 0]).max() == 0.0


@pytest.mark.parametrize("step", [1e-3, 1e-4, 1e-5])
def test_a_ball_too_slow_to_leave_comes_back(step: float) -> None:
    force, distance = 0.5, 1e-4
    speed = np.sqrt(2 * 0.5 * 0.5 * force * distance / M)
    result = run(stuck(force, distance=distance, gravity=0.0, velocity=(0, 0, -speed)), 0.02, step=step)
    assert float(result.position[-1, 0, 2]) == pytest.approx(-R, abs=1e-12)


def test_an_impact_loses_restitution_to_cohesion() -> None:
    """`e^2 v^2 - 2 W/m`: what comes in fast enough leaves slower, what is slower stays."""
    force, distance, e = 0.5, 1e-4, 0.8
    for v, leaves in ((0.2, True), (0.03, False)):
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("a", "a", friction=0.0, restitution=e, cohesion=force, rupture_distance=distance)
        scene.sphere("a", radius=R, mass=M, material="a", position=(0, 0, 0), velocity=(v, 0, 0))
        scene.sphere("b", radius=R, mass=M, material="a", position=(2.01 * R, 0, 0))
        result = run(scene, 0.1, step=1e-5, every=100)
        after = float(result.velocity[-1, 1, 0] - result.velocity[-1, 0, 0])
        gained = v * v + 2 * force * distance / M  # of the fall into the well: W = F d/2, reduced mass m/2
        exact = np.sqrt(max(e * e * gained - 2 * force * distance / M, 0.0))
        assert after == pytest.approx(exact if leaves else 0.0, rel=3e-3, abs=1e-9)
        momentum = M * np.asarray(result.velocity[-1]).sum(axis=0)
        assert momentum == pytest.approx([M * v, 0, 0], abs=1e-17)


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_doublet_that_spins_keeps_its_angular_momentum(method: str, friction: float) -> None:
    r, m, w = 2.5e-3, 1.6e-4, 20.0
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("a", "a", friction=friction, restitution=0.0, cohesion=30 * m * G, rupture_distance=1e-5)
    for name, side in (("a", 1.0), ("b", -1.0)):
        scene.sphere(name, radius=r, mass=m, material="a", position=(side * r, 0, 0),
                     velocity=(0, side * r * w, 0), angular_velocity=(0, 0, w))  # fmt: skip
    result = run(scene, 0.3, step=1e-4, method=method)
    x, v, turn = (np.asarray(c) for c in (result.position, result.velocity, result.angular_velocity))
    orbital = m * np.cross(x, v).sum(axis=1)[:, 2]
    spin = 0.4 * m * r * r * turn.sum(axis=1)[:, 2]
    assert (orbital + spin)[[0, -1]] == pytest.approx([2 * m * r * r * w * 1.4] * 2, rel=2e-6)
    assert orbital[-1] == pytest.approx(orbital[0], rel=3e-6 if method == "nsga" else 3e-4)
    if method == "nsga":  # Moreau-Jean lets both overlap first
        kinetic = np.asarray(result.steps["energy_kinetic"])
        assert kinetic[-1] == pytest.approx(kinetic[0], rel=3e-6)


def test_a_ball_that_slides_around_a_cylinder_keeps_its_speed() -> None:
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("a", "a", friction=0.0, restitution=0.0, cohesion=0.5, rupture_distance=1e-4)
    scene.cylinder("drum", point=(0, 0, 0), axis=(0, 1, 0), radius=0.05, material="a")
    scene.sphere("a", radius=R, mass=M, material="a", position=(0.04, 0, 0), velocity=(0, 0, 0.2))
    speed = np.linalg.norm(np.asarray(run(scene, 1.0, step=1e-3).velocity)[-1, 0])
    assert speed == pytest.approx(0.2, rel=1e-4)


def test_across_a_periodic_box() -> None:
    scene = carom.Scene(gravity=(0, 0, 0), periodic=(0.1, 0, 0))
    scene.contact("a", "a", friction=0.0, restitution=0.0, cohesion=0.1, rupture_distance=1e-3)
    for name, x in (("a", 0.01 + 4e-4), ("b", 0.09)):
        scene.sphere(name, radius=R, mass=M, material="a", position=(x, 0, 0))
    result = run(scene, 0.05)
    x = np.asarray(result.position[-1, :, 0])
    assert (x[0] - x[1]) % 0.1 == pytest.approx(2 * R, abs=1e-11)
    assert x.sum() == pytest.approx(0.1 + 4e-4, abs=1e-15)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.45, 0.5])
def test_in_a_periodic_box_all_images_together_attract(share: float) -> None:
    """In the shortest period that is allowed, a ball gets the sum of the law over all images of the other."""
    force, d, h = 0.02, 0.015, 1e-5
    above = 2.1 * R if share < 0.3 else 0.0

    def pair(length: float) -> carom.Result:
        scene = carom.Scene(gravity=(0, 0, 0), periodic=(length, length, 0))
        scene.contact("a", "a", friction=0.0, restitution=0.0, cohesion=force, rupture_distance=d)
        scene.contact("a", "b", friction=0.0, restitution=0.0)
        scene.sphere("a", radius=R, mass=M, material="a", at=(0, 0, 0))
        scene.sphere("b", radius=R, mass=M, material="a", at=(share * length, 0.0, above))
        scene.sphere("far", radius=0.5 * R, mass=M, material="b", at=(0, 0, 1.0))
        return run(scene, h, step=h)

    least = 4.1 * R + 2 * d
    with pytest.raises(carom.CaromError, match="only the nearest image of a ball attracts"):
        pair(0.999 * least)
    result = pair(least)
    images = [np.array((share + i, j, above / least)) * least for i in range(-3, 3) for j in range(-3, 4)]
    away = [np.linalg.norm(x) for x in images]
    want = sum(x / r * force * max(0.0, 1.0 - (r - 2 * R) / d) for x, r in zip(images, away, strict=True))
    assert M * result.velocity[-1, 0] / h == pytest.approx(want, rel=1e-4, abs=1e-12)
    assert audit.check(result).ok


def test_energy_goes_with_a_ball_that_leaves() -> None:
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("a", "a", friction=0.0, restitution=0.0, cohesion=0.1, rupture_distance=1e-3)
    for name, x in (("a", 0.0), ("b", 2 * R)):
        scene.sphere(name, radius=R, mass=M, material="a", position=(x, 0, 0), velocity=(0.1, 0, 0))
    scene.outlet(low=(0.03, -1, -1), high=(1, 1, 1))
    result = run(scene, 0.15)
    assert int(np.sum(result.steps["removed"])) == 1
    energy = np.asarray(result.steps["energy_kinetic"]) + np.asarray(result.steps["energy_potential"])
    out = np.cumsum(result.steps["energy_out"])
    assert energy + out == pytest.approx(energy[0], abs=1e-15)


def test_the_auditor_knows_the_force(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = audit_scenes.run(stuck(3 * M * G), tmp_path / "run", 0.02, step=1e-3)
    assert audit.check(path).ok
    real = cohesion.attraction
    monkeypatch.setattr(cohesion, "attraction", lambda pairs, gap: 1.001 * real(pairs, gap))
    kinds = {finding.kind for finding in audit.check(path).findings}
    assert "momentum" in kinds


@pytest.mark.parametrize("method", ["penalty", "events"])
def test_other_methods_say_that_they_have_none(method: str) -> None:
    with pytest.raises(carom.CaromError, match="cohesion"):
        run(stuck(0.1, gravity=9.81), method=method)


def test_cohesion_needs_a_distance() -> None:
    scene = carom.Scene()
    with pytest.raises(carom.CaromError, match="rupture_distance"):
        scene.contact("a", "a", friction=0.1, restitution=0.5, cohesion=0.1)


def test_forces_that_cancel_give_no_warning_of_energy(recwarn: pytest.WarningsRecorder) -> None:
    """What hangs by its cohesion does not move: rounding is large beside no energy at all."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("g", "g", friction=0.3, restitution=0.2, cohesion=0.02, rupture_distance=1e-4)
    scene.sphere("b", radius=0.005, mass=0.001, at=(0, 0, -0.005), material="g")
    scene.plane("w", point=(0, 0, 0), normal=(0, 0, -1), material="g")
    scene.load(on="b", force=(0, 0, -0.0199))
    assert carom.simulate(scene, step=1e-4, until=0.05).summary["energy"]["rises"] == 0
    assert not [str(told.message) for told in recwarn if "energy rose" in str(told.message)]


@pytest.mark.parametrize("force", [20.0, 100.0])
def test_what_is_pulled_far_in_a_step_passes_through_nothing(force: float) -> None:
    """A stack of balls with room between them: the pull alone would bring each beyond the next one within a step."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.4, restitution=0.0, cohesion=force, rupture_distance=1e-3)
    scene.plane("disc", material="m", point=(0, 0, 0), normal=(0, 0, 1), radius=0.02)
    for k in range(6):
        place = (0, 0, 0.005 + 5e-4 + k * 0.0105)
        scene.sphere(f"b{k}", radius=0.005, density=2500, material="m", at=place)
    result = run(scene, 0.02)
    np.testing.assert_allclose(result.position[-1, :, 2] / 0.005, [1, 3, 5, 7, 9, 11], atol=1e-6)
    assert result.summary["substeps"] > 0
    assert result.energy.total.max() < 1e-9


def test_powder_whose_pull_is_many_times_its_weight_comes_to_rest() -> None:
    """Grains of 20 micrometres, Bond number 244: in a step each would go 15 radii by the pull."""
    radius = 2e-5
    mass = 4 / 3 * np.pi * radius**3 * 2500
    scene = carom.Scene()
    law = {"friction": 0.4, "restitution": 0.1, "cohesion": 244 * mass * G, "rupture_distance": 0.1 * radius}
    scene.contact("m", "m", **law)
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    for k in range(8):
        place = np.array([2.05 * (k % 2), 2.05 * (k // 2 % 2), 1.02 + 2.05 * (k // 4)]) * radius
        scene.sphere(f"b{k}", radius=radius, density=2500, material="m", at=tuple(place))
    result = run(scene, 0.05)
    assert np.abs(result.velocity[-1]).max() < 1e-4
    assert np.ptp(result.position[-1], axis=0).max() < 5 * radius


@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_a_ball_that_sticks_to_a_ridge_moves_the_same_where_both_move_on(method: str) -> None:
    """Which part of a mesh is near was asked with the ball at t_n and the mesh where it ends."""
    corners = [[-5, -5, -2], [0, -5, 0], [0, 5, 0], [-5, 5, -2], [5, -5, -2], [5, 5, -2]]
    triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]

    def run(drift: np.ndarray) -> np.ndarray:
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("ball", "wall", friction=0, restitution=0, cohesion=0.2, rupture_distance=2e-3)
        start, velocity = (0.004, 0.002, 0.0105), drift + np.array([0.3, 0.1, 0.05])
        scene.sphere("b", radius=0.01, mass=0.01, material="ball", position=start, velocity=velocity)
        ways = [{"expression": f"{float(speed)!r}*t"} for speed in drift]
        vertices = 0.01 * np.array(corners)
        scene.mesh("m", vertices=vertices, triangles=triangles, material="wall", motion={"translation": ways})
        result = carom.simulate(scene, method=method, until=0.04, step=1e-3, tolerance=1e-12)
        return np.asarray(result["b"].position) - np.asarray(result.time)[:, None] * drift

    assert np.abs(run(np.full(3, 0.5)) - run(np.zeros(3))).max() < 1e-12
