"""Heap angles and run-outs of shapes that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from carom import granular
from carom.errors import CaromError
from carom.granular import Cylinder, Snapshot
from carom.packing import Equal, Packed, pack

R = 0.004


def cone(angle: float, *, n: int = 12_000, noise: float = 0.0, seed: int = 1, base: float = 0.2) -> Snapshot:
    """Balls at random within a cone whose highest points lie on its surface, on a floor of single balls around it."""
    random = np.random.default_rng(seed)
    distance = base * np.sqrt(random.uniform(0, 1, n))
    turn = random.uniform(0, 2 * np.pi, n)
    surface = math.tan(angle) * (base - distance)
    inside = random.uniform(0, 1, n) < 0.5
    height = np.where(inside, surface * random.uniform(0, 1, n), surface) + noise * random.normal(size=n)
    foot = random.uniform(base, 1.2 * base, 300)  # strays on the floor
    distance, height = np.append(distance, foot), np.append(height, np.zeros(300))
    turn = np.append(turn, random.uniform(0, 2 * np.pi, 300))
    x = np.stack([distance * np.cos(turn) + 0.3, distance * np.sin(turn) - 0.1, height], axis=1)
    return Snapshot(x, np.full(len(x), R))


@pytest.mark.parametrize("degrees", [10.0, 24.5, 38.0])
def test_a_cone_has_its_angle(degrees: float) -> None:
    found = granular.heap_angle(cone(math.radians(degrees)))
    assert found.degrees == pytest.approx(degrees, abs=0.05)
    assert found.error < math.radians(0.05)
    assert found.apex == pytest.approx(0.2 * math.tan(math.radians(degrees)) + R, abs=2e-3)
    assert found.used.any()


def test_many_points_are_looked_at_in_part() -> None:
    found = granular.heap_angle(cone(math.radians(25), n=12_000), cell=0.5)
    assert found.used.sum() > 1000
    assert found.degrees == pytest.approx(25, abs=0.05)


def test_noise_makes_an_error_that_holds() -> None:
    """The standard error covers the deviation: over 20 heaps their ratio is about one."""
    ratios = []
    for seed in range(20):
        found = granular.heap_angle(cone(math.radians(25), noise=1e-3, seed=seed, n=4000))
        other = granular.heap_angle(cone(math.radians(25), noise=1e-3, seed=seed + 100, n=4000))
        ratios.append((found.angle - other.angle) / math.hypot(found.error, other.error))
        assert found.degrees == pytest.approx(25, abs=1.0)
    assert 0.5 < np.std(ratios) < 2.0


def test_a_few_balls_in_the_air_or_a_dent_do_not_tilt_it() -> None:
    heap = cone(math.radians(25))
    x = np.array(heap.position)
    x[:20, 2] += 0.15
    dent = np.hypot(x[:, 0] - 0.42, x[:, 1] + 0.1) < 0.03
    x[dent, 2] -= 0.02
    found = granular.heap_angle(Snapshot(x, heap.radius), centre=(0.3, -0.1, 0))
    assert found.degrees == pytest.approx(25, abs=0.5)


def test_up_is_against_gravity() -> None:
    heap = cone(math.radians(25))
    lying = Snapshot(heap.position[:, [2, 0, 1]], heap.radius, gravity=np.array([-9.8, 0, 0]))
    assert granular.heap_angle(lying).angle == pytest.approx(granular.heap_angle(heap).angle, abs=2e-3)


def test_a_plane_slope_has_its_angle() -> None:
    random = np.random.default_rng(3)
    n = 8000
    along, across = random.uniform(0, 0.5, n), random.uniform(0, 0.1, n)
    surface = np.tan(np.radians(31.0)) * (0.5 - along)
    height = surface * np.where(random.uniform(0, 1, n) < 0.5, random.uniform(0, 1, n), 1.0)
    direction = np.array([3.0, 4.0, 0.0]) / 5
    x = (
        along[:, None] * direction
        + across[:, None] * np.array([-4.0, 3.0, 0]) / 5
        + height[:, None] * np.array([0, 0, 1])
    )
    s = Snapshot(x, np.full(n, R))
    found = granular.heap_angle(s, shape="planar", direction=(3, 4, 7))
    assert found.degrees == pytest.approx(31.0, abs=0.1)
    upwards = granular.heap_angle(s, shape="planar", direction=(-3, -4, 0))
    assert upwards.degrees == pytest.approx(-31.0, abs=0.1)


@pytest.fixture(scope="module")
def packed() -> Packed:
    return pack(Cylinder((0, 0, 0.03), (0, 0, 1), 0.09, 0.06), Equal(0.006), fraction=0.55, seed=1)


@pytest.mark.parametrize("degrees", [22.0, 30.0])
def test_a_heap_cut_out_of_a_packing_has_its_angle(packed: Packed, degrees: float) -> None:
    """Real balls, of which every surface is rough: those of a random packing whose tops are below a cone."""
    radius, d = 0.09, 0.006
    x = packed.position
    surface = math.tan(math.radians(degrees)) * (radius - np.hypot(x[:, 0], x[:, 1]))
    inside = x[:, 2] + d / 2 < surface
    strays = np.array([[0.4, 0.1, d / 2], [-0.3, -0.3, d / 2]])
    heap = Snapshot(np.concatenate([x[inside], strays]), np.full(inside.sum() + 2, d / 2))
    found = granular.heap_angle(heap)
    assert abs(found.degrees - degrees) < max(3 * np.degrees(found.error), 0.5)
    assert np.degrees(found.error) < 1.0


def test_what_is_no_heap_is_refused() -> None:
    with pytest.raises(CaromError, match="at least three balls"):
        granular.heap_angle(Snapshot(np.zeros((2, 3)), np.ones(2)))
    with pytest.raises(CaromError, match="unknown shape 'round'; known: radial, planar"):
        granular.heap_angle(cone(0.4), shape="round")
    with pytest.raises(CaromError, match="the direction is vertical"):
        granular.heap_angle(cone(0.4), shape="planar", direction=(0, 0, 1))


def disc(radius: float, height: float, spacing: float = 2 * R) -> np.ndarray:
    """A cubic lattice of balls in an upright cylinder on the floor."""
    k = np.arange(-radius, radius + spacing, spacing)
    z = np.arange(R, height, spacing)
    x = np.stack(np.meshgrid(k, k, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(x[np.hypot(x[:, 0], x[:, 1]) <= radius])


def test_run_out_of_a_round_column() -> None:
    column, deposit = disc(0.05, 0.1), disc(0.12, 0.02)
    strays = np.array([[0.5, 0, R], [-0.4, 0.4, R]])
    before = Snapshot(column + np.array([0.1, 0.2, 0]), np.full(len(column), R))
    after = Snapshot(
        np.concatenate([deposit, strays]) + np.array([0.1, 0.2, 0]), np.full(len(deposit) + 2, R)
    )
    found = granular.run_out((before, after), centre=(0.1, 0.2, 0))
    assert found.strays == 2
    assert found.initial == pytest.approx(0.05 + R, abs=R)
    assert found.final == pytest.approx(0.12 + R, abs=R)
    assert found.error < R / 2
    assert found.initial_height == pytest.approx(0.1, abs=2 * R)
    assert found.final_height == pytest.approx(0.02, abs=2 * R)
    assert found.ratio == pytest.approx(found.final / found.initial - 1)
    assert found.aspect == pytest.approx(found.initial_height / found.initial)
    assert found.settled < found.aspect
    np.testing.assert_allclose(granular.run_out((before, after)).final, found.final, atol=R)


def test_run_out_of_a_flat_column() -> None:
    spacing = 2 * R
    k = [np.arange(R, edge, spacing) for edge in (0.1, 0.06, 0.2)]
    column = np.stack(np.meshgrid(*k, indexing="ij"), axis=-1).reshape(-1, 3)
    k = [np.arange(R, edge, spacing) for edge in (0.3, 0.06, 0.06)]
    deposit = np.stack(np.meshgrid(*k, indexing="ij"), axis=-1).reshape(-1, 3)
    pair = Snapshot(column, np.full(len(column), R)), Snapshot(deposit, np.full(len(deposit), R))
    found = granular.run_out(pair, shape="planar", sectors=5)
    assert found.initial == pytest.approx(column[:, 0].max() + R)  # the rear is at x = 0
    assert found.final == pytest.approx(deposit[:, 0].max() + R)
    assert found.error == pytest.approx(0, abs=1e-12)
