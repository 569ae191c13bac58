"""The auditor on runs of Moreau-Jean with the projection of positions."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom.audit import gradients
from carom.audit.block import blocks
from carom.audit.data import Run

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


def test_the_projection_meets_pairs_that_are_no_candidates() -> None:
    """Balls that overlap at the end of a step of whose middle they do not: it solves positions of no candidate."""
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"until": 0.04, "step": 1e-3, "method": "moreau"})
    scene.run.position_projection = True
    scene.contact("m", "m", friction=0.2, restitution=0.7)
    scene.plane("floor", point=(0, 0, 0), normal=(0.1, 0, 1), material="m")
    scene.sphere("a", radius=0.01, mass=0.01, material="m", position=(0, 0, 0.02), velocity=(0.1, 0, -0.5))
    scene.sphere("b", radius=0.01, mass=0.01, material="m", position=(0.05, 0, 0.03), velocity=(-0.9, 0, 0))
    result = carom.simulate(scene, every=1)
    steps, solved = result.steps, result.residuals
    position = solved["level"] == 1
    assert (solved["contacts"][position] > steps["candidates"][solved["step"][position] - 1]).any()
    report = carom.audit.check(result)
    assert report.ok, report


def test_joints_beside_a_load_function_answer_where_the_smooth_motion_ends() -> None:
    """What the function gives is on no record; it was taken for an impulse of contacts, and rods stood elsewhere."""
    scene = carom.Scene("rod", gravity=(0, 0, -9.8))
    scene.contact("g", "g", friction=0.0, restitution=0.5)
    scene.contact("g", "w", friction=0.0, restitution=0.5)
    scene.plane("t", material="w", point=(0, 0, 0), normal=(0, 0, 1))
    for k in range(2):
        at = (0.021 * k, 0.004 * k, 0.05 + 0.003 * k)
        scene.sphere(f"c{k}", material="g", radius=0.01, density=2500, at=at, velocity=(0.3, 0, 0.02))
    scene.joint("rod", between=("c0", "c1"))
    scene.load_function(lambda t, x, v, w: np.hstack([-0.02 * v, 0.0 * v]))
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.2, method="moreau", walls=True))
    assert report.ok, report.findings
    assert report["work"].judged


@pytest.mark.parametrize("theta", [0.5, 0.8])
def test_overlaps_grow_as_a_ball_goes_round_in_a_wall(theta: float) -> None:
    """By `(1 - theta) h^2 v^2/R` a step, for centres that go round on the radius `R`."""
    scene = carom.Scene("round", gravity=(0, 0, 0))
    scene.contact("g", "w", friction=0.0, restitution=0.0)
    scene.ball_wall("w", material="w", point=(0, 0, 0), radius=0.06)
    scene.sphere("b", material="g", radius=0.01, density=2500, at=(0.0499999999, 0, 0), velocity=(0, 0.5, 0))
    result = carom.simulate(scene, step=1e-3, until=0.1, method="moreau", theta=theta)
    gap = 0.05 - np.linalg.norm(result.position[:, 0], axis=1)
    v = np.linalg.norm(result.velocity[-1, 0])
    grown = (gap[20] - gap[100]) / 80
    assert grown == pytest.approx((1.0 - theta) * 1e-6 * v**2 / 0.05, rel=0.05)
    report = carom.audit.check(result)
    assert report.ok, report.findings


@pytest.mark.parametrize("motion", ["rotation", "surface_rotation"])
def test_overlaps_in_a_cone_may_add_up(motion: str) -> None:
    scene = carom.Scene("cone", gravity=(0, 0, -9.8))
    scene.contact("g", "w", friction=0.0, restitution=0.0)
    turns = {motion: {"axis": (0, 0, 1), "rate": -20.0}}
    shape = {"point": (0, 0, -0.1), "axis": (0, 0, 1), "radius": 0.0, "radius_end": 0.2, "length": 0.2}
    scene.cone("w", material="w", motion=turns, **shape)
    at, velocity = (-0.03, -0.03, -0.029), (0.1, -0.2, 0)
    scene.sphere("b", material="g", radius=0.008, density=2500, at=at, velocity=velocity)
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.3, method="moreau"))
    assert report.ok, report.findings


@pytest.mark.parametrize("speed", [0.5, 0.2])
def test_what_the_projection_lifts_goes_along_the_walls_of_its_end(speed: float) -> None:
    """In a tube the normal has turned since the middle of the step, along which the impulse is on record."""
    scene = carom.Scene(gravity=(0, 0, -9.8), record={"every": 1})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.cylinder("tube", point=(0, 0, 0), axis=(0, 1, 0), radius=0.05, inside=True, material="m")
    scene.sphere("ball", radius=3e-3, density=2500, at=(0, 0, -0.047), velocity=(speed, 0, 0), material="m")
    options = {"method": "moreau", "position_projection": True, "step": 1e-3, "until": 0.2}
    report = carom.audit.check(carom.simulate(scene, **options))
    assert report.ok, report.findings
    assert report["energy balance"].judged > 100


def test_contacts_without_impulse_join_a_heap_to_its_joints() -> None:
    """A heap that a driven ball ploughs, with rods in it: its rows of impacts were taken for sums over a step."""
    scene, r, n = carom.Scene(gravity=(0, 0, -9.81)), 0.01, 6
    scene.contact("g", "g", friction=0.5, restitution=0.0)
    scene.contact("g", "w", friction=0.5, restitution=0.0)
    far = n * 2.1 * r
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    for name, at, normal in (("xm", 0, (1, 0, 0)), ("xp", far, (-1, 0, 0))):
        scene.plane(name, point=(at, 0, 0), normal=normal, material="w")
        scene.plane("y" + name, point=(0, at, 0), normal=(0, normal[0], 0), material="w")
    rng, k = np.random.default_rng(0), 0
    for layer, i, j in np.ndindex(3, n, n):
        place = np.array([2.1 * i + 1.05, 2.1 * j + 1.05, 1.03 + 2.12 * layer]) + rng.uniform(-0.03, 0.03, 3)
        if (layer, i, j) != (2, 0, 2):
            scene.sphere(f"b{k}", radius=r, mass=0.0105, position=tuple(r * place), material="g")
            k += 1
    scene.sphere("drv", radius=r, mass=0.0105, position=(1.05 * r, 5.25 * r, 5.3 * r), material="g")
    scene.joint("motion", body="drv", direction=(1, 0, 0), displacement={"polynomial": [0.0, 0.0, 1.5]})
    scene.joint("line", body="drv", direction=(1, 0, 0))
    scene.joint("lock", body="drv")
    for i in range(36, 41):
        scene.joint("rod", between=(f"b{i}", f"b{i + 1}"))
    report = carom.audit.check(
        carom.simulate(scene, step=1e-3, until=0.075, method="moreau", pile_tolerance=1e-4)
    )
    assert report.ok, report.findings


@pytest.mark.parametrize("every", [1, 4])
def test_the_weight_works_on_what_joints_answer(every: int) -> None:
    """A ball at rest on three that are held: `m (g h)^2 / 2` of each step were taken for a gain."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("g", "g", friction=0.3, restitution=0.5)
    for k, angle in enumerate(2.0 * np.pi * np.arange(3) / 3.0):
        at = (0.0125 * np.cos(angle), 0.0125 * np.sin(angle), 0.0)
        scene.sphere(f"c{k}", material="g", radius=0.01, mass=0.01, position=at)
        scene.joint("fix", body=f"c{k}")
        scene.joint("lock", body=f"c{k}")
    scene.sphere("ball", material="g", radius=0.01, mass=0.01, position=(0, 0, 0.0157))
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.1, method="moreau", every=every))
    assert report.ok, report.findings


@pytest.mark.parametrize("repeated", [False, True], ids=["chain", "with a row twice"])
def test_answers_of_joints_are_those_of_all_equations(repeated: bool) -> None:
    """Over the rows of joints, as by one system of momenta and multipliers; also where these are not one."""
    scene, rng = carom.Scene(gravity=(0, 0, -9.8)), np.random.default_rng(0)
    scene.contact("g", "g", friction=0.0, restitution=0.0)
    places = [(0.021 * k, 0.0, 0.003 * k * k) for k in range(6)]
    for k, at in enumerate(places):
        scene.sphere(f"c{k}", material="g", radius=0.01, mass=0.01 + 0.01 * k, position=at)
    for k in range(5):
        side = (places[k][0], 0.002, places[k][2])
        scene.joint("rod", between=(f"c{k}", f"c{k + 1}"), points=(side, places[k + 1]))
    if repeated:
        scene.joint("lock", between=("c0", "c1"))
        scene.joint("lock", between=("c1", "c2"))
        scene.joint("lock", between=("c2", "c0"))
    run = Run(carom.simulate(scene, step=1e-3, until=0.003))
    block, nodes = next(blocks(run)), np.arange(6)
    ends_of = block.x1, block.q1
    answer, given = gradients.answer(run, nodes, ends_of), rng.normal(size=(block.count, 6, 6))
    assert not answer.unsure.any()
    (ends, rows), _ = gradients._placed(run, nodes, ends_of)
    masses = np.repeat(np.stack([run.mass, run.inertia], axis=1), 3, axis=1).ravel()
    for k, found in enumerate(answer.of(given)):
        g = np.zeros((len(ends), 6, 6))
        for end in (0, 1):
            g[np.arange(len(ends)), ends[:, end]] += rows[k, :, end]
        g = g.reshape(len(ends), 36) / np.sqrt(masses)
        free = given[k].ravel() / np.sqrt(masses)
        expected = (free - np.linalg.pinv(g, rcond=1e-10) @ (g @ free)) / np.sqrt(masses)
        scale = np.abs(free / np.sqrt(masses)).max()
        assert np.abs(found.ravel() - expected).max() < 1e-13 * scale
