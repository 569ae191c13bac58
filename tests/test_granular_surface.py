"""Heap angles and run-outs of shapes that are known."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from carom import CaromError, CaromWarning, granular
from carom.granular import Cylinder, Snapshot
from carom.packing import Equal, Packed, pack

R = 0.004


def cone(
    angle: float, *, noise: float = 0.0, seed: int = 1, base: float = 0.2, radius: float = R
) -> Snapshot:
    """Columns of balls on a lattice, shaken, whose highest points lie on a cone, and single balls on the floor around it.

    It is filled as a heap is: the measure finds the foot by where the solid lies.
    """
    random = np.random.default_rng(seed)
    k = np.arange(-base, base, 2 * radius)
    x, y = (c.ravel() + radius * random.uniform(-0.5, 0.5, c.size) for c in np.meshgrid(k, k))
    top = math.tan(angle) * (base - np.hypot(x, y))
    x, y, top = x[top > 0], y[top > 0], top[top > 0]
    deep = np.ceil(top / (2 * radius)).astype(int)
    column = np.repeat(np.arange(len(top)), deep)
    below = np.arange(deep.sum()) - np.repeat(np.cumsum(deep) - deep, deep)
    height = (top + noise * random.normal(size=len(top)))[column] - 2 * radius * below
    foot, turn = (
        random.uniform(base, 1.2 * base, 300),
        random.uniform(0, 2 * np.pi, 300),
    )  # strays on the floor
    x, y = np.append(x[column], foot * np.cos(turn)), np.append(y[column], foot * np.sin(turn))
    return Snapshot(
        np.stack([x + 0.3, y - 0.1, np.append(height, np.zeros(300))], axis=1), np.full(len(x), radius)
    )


@pytest.mark.parametrize("degrees", [10.0, 24.5, 38.0])
def test_a_cone_has_its_angle(degrees: float) -> None:
    found = granular.heap_angle(cone(math.radians(degrees)))
    assert found.degrees == pytest.approx(degrees, abs=0.05)
    assert found.error < math.radians(0.05)
    assert found.apex == pytest.approx(0.2 * math.tan(math.radians(degrees)) + R, abs=2e-3)
    assert found.used.any()


def test_many_points_are_looked_at_in_part() -> None:
    found = granular.heap_angle(cone(math.radians(25), radius=0.6 * R))
    assert found.used.sum() > 1000
    assert found.degrees == pytest.approx(25, abs=0.05)


def test_noise_makes_an_error_that_holds() -> None:
    """The standard error covers the deviation: over 20 heaps their ratio is about one."""
    ratios = []
    for seed in range(20):
        found = granular.heap_angle(cone(math.radians(25), noise=1e-3, seed=seed, radius=2 * R))
        other = granular.heap_angle(cone(math.radians(25), noise=1e-3, seed=seed + 100, radius=2 * R))
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
    return pack(Cylinder((0, 0, 0.03), (0, 0, 1), 0.09, 0.06), Equal(0.006), fraction=0.53, seed=1)


def cut(packed: Packed, surface: Callable[[np.ndarray], np.ndarray], floor: float) -> np.ndarray:
    """Centres of the balls of a packing above a floor and below a surface that is given over the distance from the axis."""
    x = packed.position - np.array([0, 0, floor])
    x = x[x[:, 2] > 0]
    return np.asarray(x[x[:, 2] < surface(np.hypot(x[:, 0], x[:, 1]))])


def test_heaps_cut_out_of_a_packing_have_their_angles(packed: Packed) -> None:
    """Real balls, of which every surface is rough: no bias, and errors that hold. Every floor gives another surface."""
    off, error = [], []
    for degrees in (22.0, 26.0, 30.0):
        for floor in (0.006, 0.009, 0.012):
            x = cut(packed, lambda d, t=degrees: math.tan(math.radians(t)) * (0.085 - d), floor)
            strays = np.array([[0.4, 0.1, 0.0], [-0.3, -0.3, 0.0]])
            found = granular.heap_angle(Snapshot(np.concatenate([x, strays]), np.full(len(x) + 2, 0.003)))
            off.append(found.degrees - degrees)
            error.append(np.degrees(found.error))
    assert abs(np.mean(off)) < 0.25  # a standard deviation of 0.35, nine heaps
    assert max(error) < 0.6
    assert 0.5 < np.sqrt(np.mean((np.array(off) / error) ** 2)) < 1.8


def test_a_heap_of_few_layers_is_found_too_flat_and_says_so(packed: Packed) -> None:
    """By more than its error, which knows nothing of the layer on the ground."""
    flat = cut(packed, lambda d: math.tan(math.radians(10)) * (0.085 - d), 0.0)
    with pytest.warns(
        CaromWarning, match=r"is 2\.\d mean diameters high, .* makes it about [12] degrees too"
    ):
        found = granular.heap_angle(Snapshot(flat, np.full(len(flat), 0.003)))
    assert found.degrees < 10 - np.degrees(found.error)
    with pytest.warns(CaromWarning, match=r"makes it about [12] degrees too flat; take more"):
        granular.heap_angle(Snapshot(flat, np.full(len(flat), 0.003)), sectors=1)  # no error to compare with
    lower = cut(packed, lambda d: math.tan(math.radians(5)) * (0.085 - d), 0.0)
    with pytest.warns(CaromWarning, match=r"is 1\.\d mean .* makes it too low to tell its angle; take more"):
        granular.heap_angle(Snapshot(lower, np.full(len(lower), 0.003)))
    steep = cut(packed, lambda d: math.tan(math.radians(26)) * (0.085 - d), 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        granular.heap_angle(Snapshot(steep, np.full(len(steep), 0.003)))


def test_single_grains_do_not_tilt_a_dome(packed: Packed) -> None:
    """On a dome another part of the slope has another angle. The part was chosen by the heights of the highest and the
    lowest grains: one more on the tip had taken 2 degrees off this dome, ten at its foot had added 2."""
    x = cut(packed, lambda d: 0.035 * (1 - (d / 0.085) ** 2), 0.006)
    found = granular.heap_angle(Snapshot(x, np.full(len(x), 0.003)), centre=(0, 0, 0))
    assert found.inner < found.angle - 0.05 < found.outer - 0.1
    top = x[np.argmax(x[:, 2])] + np.array([0, 0, 0.005])
    tail = [[0.0885 * math.cos(t), 0.0885 * math.sin(t), 0.0] for t in np.linspace(0, 6, 10)]
    for added in ([top], tail):
        other = np.concatenate([x, added])
        again = granular.heap_angle(Snapshot(other, np.full(len(other), 0.003)), centre=(0, 0, 0))
        assert again.angle == pytest.approx(found.angle, abs=found.error)


def test_what_is_no_heap_is_refused() -> None:
    with pytest.raises(CaromError, match="at least three balls"):
        granular.heap_angle(Snapshot(np.zeros((2, 3)), np.ones(2)))
    with pytest.raises(CaromError, match="unknown shape 'round'; known: radial, planar"):
        granular.heap_angle(cone(0.4), shape="round")
    with pytest.raises(CaromError, match="the direction is vertical"):
        granular.heap_angle(cone(0.4), shape="planar", direction=(0, 0, 1))


def test_a_floor_that_is_nearly_empty_has_no_heap() -> None:
    """It had an angle, of three grains, with an error that is no number."""
    x = np.array([[0, 0, 0], [4, 0, 0.1], [0, 5, 0.2], [-5.5, 0, 0.6]]) * 1e-3
    left = Snapshot(x, np.full(len(x), 2e-3))
    with pytest.raises(
        CaromError, match=r"too few for a standard error; take a frame with a heap, or sectors=1"
    ):
        granular.heap_angle(left)
    alone = granular.heap_angle(left, sectors=1)
    assert np.isfinite(alone.angle)
    assert np.isnan(alone.error)


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


def test_what_has_not_moved_has_not_run_out() -> None:
    """The start counted every ball, the end the largest group."""
    column = disc(0.05, 0.1)
    strays = np.array([[0.5, 0, R], [-0.4, 0.4, R]])
    s = Snapshot(np.concatenate([column, strays]), np.full(len(column) + 2, R))
    for shape in ("radial", "planar"):
        found = granular.run_out((s, s), shape=shape)
        assert (found.ratio, found.settled, found.strays) == (0.0, found.aspect, 2)
        assert found.initial < 0.12


def test_a_column_that_has_not_fallen_together_is_told() -> None:
    column = np.concatenate([disc(0.05, 0.1), disc(0.05, 0.1) + np.array([0, 0, 0.2])])
    s = Snapshot(column, np.full(len(column), R))
    with pytest.warns(
        CaromWarning, match="are apart from the column; give a frame at which they have settled"
    ):
        granular.run_out((s, s))
    assert granular.run_out((s, s), loose=20.0).strays == 0


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


def test_what_has_not_entered_yet_has_no_heap_and_no_run_out() -> None:
    """At the start of a run with an inflow no ball is there; NumPy warned, and broke off."""
    balls = disc(0.05, 0.1)
    none = Snapshot(np.full((5, 3), np.nan), np.full(5, R))
    column = Snapshot(balls, np.full(len(balls), R))
    for pair, name in (((none, column), "start"), ((column, none), "frame")):
        for shape in ("radial", "planar"):
            with pytest.raises(CaromError, match=f"no ball is there at the frame of `{name}`"):
                granular.run_out(pair, shape=shape)
    for shape in ("radial", "planar"):
        with pytest.raises(CaromError, match="at least three balls"):
            granular.heap_angle(none, shape=shape)
    with pytest.raises(CaromError, match="give a point of the axis, x, y and z"):
        granular.heap_angle(column, centre=(0, 0))
