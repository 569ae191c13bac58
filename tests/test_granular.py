"""What granular people read, against closed forms: lattices, columns, gases, cones."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from carom import CaromError, granular
from carom.arrays import connected
from carom.granular import Ball, Box, Contacts, Cylinder, Snapshot, cells, layers
from carom.measure.granular.cut import WHOLE, cap, corner, edge
from carom.scene.packing.neighbours import pairs

CUBE = Box((0, 0, 0), (1, 1, 1))
RANDOM = np.random.default_rng(2024)
_START = RANDOM.bit_generator.state


@pytest.fixture(autouse=True)
def _same_numbers() -> None:
    """Every test draws the same numbers, whichever ran before."""
    RANDOM.bit_generator.state = _START


# ------------------------------------------------------------------------------------------- cut volumes


def test_planes_through_the_centre_halve_quarter_and_eighth_a_ball() -> None:
    zero = np.zeros(1)
    np.testing.assert_allclose(
        [cap(zero)[0], edge(zero, zero)[0], corner(zero, zero, zero)[0]], WHOLE / np.array([2, 4, 8])
    )


def test_edges_and_corners_against_sums_of_thin_slices() -> None:
    """A corner is the integral over x of what two planes leave of a disc, an edge that of a segment."""
    a, b, c = 0.3, 0.25, 0.4
    x, w = np.polynomial.legendre.leggauss(200)
    x, w = a + (1 - a) * 0.5 * (x + 1), w * (1 - a) * 0.5
    disc = np.sqrt(1 - x**2)
    segment = np.where(
        disc > b, disc**2 * np.arccos(np.minimum(b / disc, 1)) - b * np.sqrt(np.maximum(disc**2 - b**2, 0)), 0
    )
    assert edge(np.array([a]), np.array([b]))[0] == pytest.approx((w * segment).sum(), rel=1e-6)
    inner = disc**2 > b**2 + c**2
    d = np.where(inner, disc, 1.0)
    cut = 0.5 * (
        d**2 * (np.arccos(b / d) - np.arcsin(c / d))
        - b * (np.sqrt(d**2 - b**2) - c)
        - c * (np.sqrt(d**2 - c**2) - b)
    )
    assert corner(*(np.array([k]) for k in (a, b, c)))[0] == pytest.approx(
        (w * np.where(inner, cut, 0)).sum(), rel=1e-5
    )


def test_parts_of_a_ball_add_up_to_it() -> None:
    x, r = RANDOM.uniform(-1, 1, (50, 3)), RANDOM.uniform(0.05, 1.5, 50)
    parts = sum(granular.ball_volume(box, x, r) for box in cells(Box((-3, -3, -3), (3, 3, 3)), (7, 5, 9)))
    np.testing.assert_allclose(parts, WHOLE * r**3, rtol=1e-13)


@pytest.mark.parametrize(
    "region",
    [
        Box((-0.3, -0.2, -0.1), (0.5, 0.4, 0.6)),
        Cylinder((0.1, 0, 0), (1, 1, 0), 0.4, 0.9),
        Ball((0.1, 0.2, 0), 0.6),
    ],
    ids=["box", "cylinder", "ball"],
)
def test_cut_volumes_against_random_points(region: granular.Region) -> None:
    points = RANDOM.uniform(-1, 1, (400_000, 3))
    points = points[(points**2).sum(axis=1) < 1]
    for centre, radius in zip(RANDOM.uniform(-0.5, 0.5, (6, 3)), RANDOM.uniform(0.2, 1.0, 6)):
        hit = _within(region, centre + radius * points).mean()
        part = granular.ball_volume(region, centre[None], np.array([radius]))[0] / (WHOLE * radius**3)
        assert part == pytest.approx(hit, abs=5 * math.sqrt(part * (1 - part) / len(points)) + 1e-9)


def _within(region: granular.Region, x: np.ndarray) -> np.ndarray:
    if isinstance(region, Box):
        return np.asarray(((x > region.low) & (x < region.high)).all(axis=1))
    away = x - region.point
    if isinstance(region, Ball):
        return np.asarray(np.linalg.norm(away, axis=1) < region.radius)
    axis = np.array(region.axis) / np.linalg.norm(region.axis)
    along = away @ axis
    return np.asarray(
        (np.linalg.norm(away - np.outer(along, axis), axis=1) < region.radius)
        & (abs(along) < region.length / 2)
    )


def test_a_cylinder_cuts_balls_at_its_ends_and_at_its_wall() -> None:
    tube = Cylinder((0, 0, 0), (0, 0, 2), 1.0, 2.0)
    x = np.array([[0, 0, 0], [0, 0, 1.0], [1e6, 0, 0], [0, 0, 0.9]])
    r = np.array([0.5, 0.5, 0.5, 0.5])
    volume = granular.ball_volume(tube, x, r)
    np.testing.assert_allclose(volume[:3], WHOLE * 0.125 * np.array([1, 0.5, 0]), rtol=1e-14)
    assert volume[3] == pytest.approx(WHOLE / 8 - math.pi / 3 * 0.4**2 * (1.5 - 0.4))
    wide = granular.ball_volume(
        Cylinder((0, 0, 0), (0, 0, 1), 1e4, 100), np.array([[1e4 - 0.2, 0, 0.0]]), np.ones(1)
    )
    assert wide[0] == pytest.approx(
        WHOLE - float(cap(np.array([0.2]))[0]), rel=1e-4
    )  # the wall is nearly flat


# ------------------------------------------------------------------------------------------- lattices

LATTICES = {  # cell over the diameter, places in it, neighbours, fraction
    "sc": ((1, 1, 1), [(0, 0, 0)], 6, math.pi / 6),
    "bcc": ((2 / math.sqrt(3),) * 3, [(0, 0, 0), (0.5, 0.5, 0.5)], 8, math.pi * math.sqrt(3) / 8),
    "fcc": ((math.sqrt(2),) * 3, [(0, 0, 0), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0)], 12, math.pi / math.sqrt(18)),
    "hcp": (
        (1, math.sqrt(3), math.sqrt(8 / 3)),
        [(0, 0, 0), (0.5, 0.5, 0), (0.5, 1 / 6, 0.5), (0, 2 / 3, 0.5)],
        12,
        math.pi / math.sqrt(18),
    ),
}  # fmt: skip


def lattice(kind: str, n: int = 5, diameter: float = 0.01) -> tuple[Snapshot, Box]:
    """A block of n cells each way, and the box of its inner cells."""
    cell, places, _, _ = LATTICES[kind]
    edges = np.array(cell) * diameter
    corners = np.stack(np.meshgrid(*[range(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    x = ((corners + np.array(places)) * edges).reshape(-1, 3)
    inner = Box(tuple((1.25 * edges).tolist()), tuple((max(n - 1.75, 1.5) * edges).tolist()))
    return Snapshot(x, np.full(len(x), diameter / 2)), inner


@pytest.mark.parametrize("kind", LATTICES)
def test_lattices(kind: str) -> None:
    s, inner = lattice(kind)
    _, _, neighbours, fraction = LATTICES[kind]
    z = granular.coordination(s, region=inner, gap=1e-7)
    assert set(z.per_ball[z.counted]) == {neighbours}
    assert z.mean == z.mean_without_rattlers == neighbours
    assert granular.packing_fraction(s, inner) == pytest.approx(fraction, rel=1e-13)
    sliced = granular.over_regions(s, granular.packing_fraction, layers(inner, "z", 7))
    assert np.mean(sliced) == pytest.approx(fraction, rel=1e-13)
    assert max(sliced) > fraction + 1e-3


def test_a_profile_over_the_layers_of_a_cylinder() -> None:
    s, _ = lattice("sc", n=6)
    tube = Cylinder((0.025, 0.025, 0.024), (0, 0, -2.0), 0.02, 0.03)
    profile = granular.over_regions(s, granular.coordination, layers(tube, "z", 3), gap=1e-7)
    assert profile.centre == pytest.approx(np.array([[0.025, 0.025, z] for z in (0.014, 0.024, 0.034)]))
    assert list(profile["mean"]) == [value.mean for value in profile] == [6.0, 6.0, 6.0]
    assert len(profile) == 3
    assert profile[1] is profile.values[1]
    volumes = [granular.ball_volume(part, s.position, s.radius).sum() for part in profile.regions]
    assert sum(volumes) == pytest.approx(granular.ball_volume(tube, s.position, s.radius).sum(), rel=1e-12)
    boxes = granular.over_regions(
        s, granular.packing_fraction, cells(Box((0, 0, 0), (0.04, 0.02, 0.02)), (2, 1, 1))
    )
    assert boxes.centre == pytest.approx(np.array([[0.01, 0.01, 0.01], [0.03, 0.01, 0.01]]))


def test_measures_print_their_numbers_by_name() -> None:
    s, inner = lattice("sc")
    text = repr(granular.coordination(s, region=inner, gap=1e-7))
    assert text.startswith("Coordination(mean=6, mean_without_rattlers=6, rattlers=0, per_ball=<125>")


def test_a_periodic_box_has_no_faces() -> None:
    s, _ = lattice("sc", n=4)
    box = Box((-0.005,) * 3, (0.035,) * 3)
    shifted = Snapshot(s.position + np.array([0.004, 0, 0]), s.radius)
    assert granular.packing_fraction(shifted, box) < math.pi / 6 - 0.01
    periodic = Box(box.low, box.high, (True, False, False))
    assert granular.packing_fraction(shifted, periodic) == pytest.approx(math.pi / 6, rel=1e-12)


def test_radial_distribution_of_a_lattice_counts_its_shells() -> None:
    s, _ = lattice("fcc", n=6, diameter=1.0)
    edge_ = 6 * math.sqrt(2)
    rdf = granular.radial_distribution(s, Box((0, 0, 0), (edge_,) * 3, (True,) * 3), reach=1.8, bins=18)
    neighbours = rdf.pairs / rdf.origins
    assert rdf.origins == len(s.radius)
    assert neighbours[9:11].sum() == pytest.approx(12)  # at 1, on the border of two bins
    assert neighbours[14] == pytest.approx(6)  # at sqrt 2
    assert neighbours[17] == pytest.approx(24)  # at sqrt 3
    assert neighbours.sum() == pytest.approx(42)


@pytest.mark.parametrize("periodic", [(True,) * 3, (False,) * 3, (True, False, True)])
def test_radial_distribution_of_a_gas_is_one(periodic: tuple[bool, bool, bool]) -> None:
    x = RANDOM.uniform(0, 1, (6000, 3))
    box = Box((0, 0, 0), (1, 1, 1), periodic)
    rdf = granular.radial_distribution(Snapshot(x, np.full(6000, 1e-3)), box, reach=0.1, bins=10)
    # where shells must not leave the box, the density around the origins fluctuates too
    local = 0.0 if all(periodic) else 1 / math.sqrt(rdf.origins)
    assert (np.abs(rdf.g - 1)[2:] < 4 * np.hypot(rdf.error, local)[2:]).all()
    assert rdf.g[5:].mean() == pytest.approx(1, abs=4 * math.hypot(0.003, local))


def test_the_error_of_the_radial_distribution_is_the_scatter_between_gases() -> None:
    """It was that of twice as many pairs, each having been counted from both ends."""
    box = Box((0, 0, 0), (1, 1, 1), (True,) * 3)
    gases = [
        granular.radial_distribution(
            Snapshot(RANDOM.uniform(0, 1, (400, 3)), np.full(400, 1e-3)), box, reach=0.2, bins=4
        )
        for _ in range(200)
    ]
    scatter = np.std([gas.g for gas in gases], axis=0, ddof=1)
    told = np.mean([gas.error for gas in gases], axis=0)
    np.testing.assert_allclose(scatter[1:] / told[1:], 1.0, atol=0.2)  # 200 gases tell it to 5 %


def test_radial_distribution_needs_room() -> None:
    with pytest.raises(CaromError, match=r"must be below 0\.5 m"):
        granular.radial_distribution(Snapshot(np.zeros((2, 3)), np.ones(2)), CUBE, reach=0.6)


# ------------------------------------------------------------------------------------------- contacts


def network(x: np.ndarray, r: np.ndarray, force: np.ndarray, gap: float = 1e-6, **more: object) -> Snapshot:
    """Balls with a normal force between all that touch, in the order of `pairs`."""
    a, b = pairs(x, r + gap)
    delta = x[a] - x[b]
    distance = np.linalg.norm(delta, axis=1)
    normal = delta / distance[:, None]
    push = np.broadcast_to(force, len(a))
    contacts = Contacts(a, b, normal, push[:, None] * normal, distance - r[a] - r[b], np.ones(len(a), bool))
    return Snapshot(x, r, contacts=contacts, **more)  # type: ignore[arg-type]


def test_rattlers_go_with_those_that_lean_on_them() -> None:
    """A triangle, on which a row of three balls hangs: only the triangle is left."""
    x = np.array([[0, 0, 0], [2, 0, 0], [1, math.sqrt(3), 0], [4, 0, 0], [6, 0, 0], [8, 0, 0], [20, 0, 0]])
    s = network(x, np.ones(7), np.array(1.0))
    z = granular.coordination(s)
    np.testing.assert_array_equal(z.per_ball, [2, 3, 2, 2, 2, 1, 0])
    np.testing.assert_array_equal(z.rattler, [False] * 3 + [True] * 4)
    assert z.mean == pytest.approx(12 / 7)
    assert z.mean_without_rattlers == 2
    assert z.rattlers == pytest.approx(4 / 7)
    assert granular.coordination(s, least=0).rattlers == 0


def test_contacts_that_are_open_or_do_not_push_are_no_contacts() -> None:
    s = network(np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0]]), np.ones(3), np.array([1.0, 0.0]))
    np.testing.assert_array_equal(granular.coordination(s).per_ball, [1, 1, 0])
    np.testing.assert_array_equal(granular.coordination(s, gap=1e-9).per_ball, [1, 2, 1])


def test_walls_count_if_wanted() -> None:
    floor = (np.zeros((1, 3)), np.array([[0.0, 0, 1]]))
    s = Snapshot(np.array([[0.0, 0, 1], [0, 0, 3]]), np.ones(2), planes=floor)
    np.testing.assert_array_equal(granular.coordination(s, gap=1e-9).per_ball, [2, 1])
    np.testing.assert_array_equal(granular.coordination(s, gap=1e-9, walls=False).per_ball, [1, 1])


def test_fabric_of_a_lattice_of_a_row_and_of_random_directions() -> None:
    s, _ = lattice("fcc", n=3)
    cubic = granular.fabric(network(s.position, s.radius, np.array(1.0), 1e-7))
    assert np.trace(cubic.tensor) == pytest.approx(1)
    np.testing.assert_allclose(cubic.tensor, np.eye(3) / 3, atol=1e-12)  # a cube of whole cells is cubic
    assert cubic.anisotropy == pytest.approx(0, abs=1e-10)
    row = granular.fabric(network(np.array([[0.0, 0, 0], [0, 2, 0], [0, 4, 0]]), np.ones(3), np.array(2.0)))
    np.testing.assert_allclose(row.tensor, np.diag([0, 1, 0]), atol=1e-15)
    assert row.principal[0][0] == pytest.approx(1)
    np.testing.assert_allclose(abs(row.principal[1][:, 0]), [0, 1, 0], atol=1e-12)


def test_fabric_finds_the_anisotropy_that_directions_were_drawn_with() -> None:
    a = 0.6  # density (1 + a (3 z^2 - 1) / 2) / 4 pi: a_zz = a, a_xx = a_yy = -a/2
    n = RANDOM.normal(size=(200_000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    n = n[RANDOM.uniform(0, 1 + a, len(n)) < 1 + a * (1.5 * n[:, 2] ** 2 - 0.5)]
    k = len(n)
    contacts = Contacts(np.zeros(k, int), np.ones(k, int), n, n, np.zeros(k), np.ones(k, bool))
    found = granular.fabric(Snapshot(np.zeros((2, 3)), np.ones(2), contacts=contacts))
    np.testing.assert_allclose(found.deviator, np.diag([-a / 2, -a / 2, a]), atol=0.03)
    assert found.anisotropy == pytest.approx(1.5 * a, abs=0.04)


def test_exponential_forces_are_found_exponential() -> None:
    k = 50_000
    normal = np.tile([0.0, 0, 1], (k, 1))
    push = RANDOM.exponential(3.0, k)
    contacts = Contacts(
        np.zeros(k, int), np.ones(k, int), normal, push[:, None] * normal, np.zeros(k), np.ones(k, bool)
    )
    found = granular.normal_forces(Snapshot(np.zeros((2, 3)), np.ones(2), contacts=contacts))
    assert found.mean == pytest.approx(3.0, rel=0.02)
    assert found.ratio.mean() == pytest.approx(1.0)
    expected = -np.diff(np.exp(-found.edges)) / np.diff(found.edges)
    assert (np.abs(found.density - expected) < 5 * found.error + 0.01).all()
    assert found.weak == pytest.approx(1 - math.exp(-1), abs=0.01)


def test_force_chains_of_two_rows() -> None:
    """A strong row of four balls and a stronger one of two on a floor; a weak row between them."""
    x = np.array([[0, 0, 1], [0, 0, 3], [0, 0, 5], [0, 0, 7], [2, 0, 1], [4, 0, 1]], dtype=float)
    s = network(x, np.ones(6), np.array(1.0))
    c = s.touching
    strong = np.where(c.normal[:, 2] != 0, 5.0, 0.5)
    first, second = np.append(c.first, [0, 5]), np.append(c.second, [6, 6])
    normal = np.vstack([c.normal, [[0, 0, 1], [0, 0, 1]]])
    push = np.append(strong, [6.0, 9.0])
    s = Snapshot(
        x,
        s.radius,
        contacts=Contacts(first, second, normal, push[:, None] * normal, np.zeros(7), np.ones(7, bool)),
    )
    chains = granular.force_chains(s)
    assert chains.threshold == pytest.approx(push.mean())
    np.testing.assert_array_equal(chains.sizes, [4])
    np.testing.assert_array_equal(chains.balls(0), [0, 1, 2, 3])
    assert chains.share_of_contacts == pytest.approx(4 / 7)
    assert chains.share_of_force == pytest.approx(21 / 31)
    floor = chains.second == 6
    np.testing.assert_allclose(chains.start[floor], [[0, 0, 0]])
    np.testing.assert_array_equal(granular.force_chains(s, least=1).sizes, [4, 1])
    np.testing.assert_array_equal(granular.force_chains(s, above=0.0, least=1).sizes, [7])


def test_components_of_a_graph() -> None:
    a, b = RANDOM.integers(0, 300, (2, 220))
    label = connected(300, a, b)
    np.testing.assert_array_equal(label[a], label[b])
    reach = np.eye(300, dtype=bool)
    reach[a, b] = reach[b, a] = True
    for _ in range(9):
        reach = reach @ reach
    np.testing.assert_array_equal(label, reach.argmax(axis=1))


# ------------------------------------------------------------------------------------------- stress and temperature


def test_stress_of_a_column_is_the_weight_above() -> None:
    weight, n = 2.0, 5
    x = np.array([[0, 0, 2 * k + 1] for k in range(n)], dtype=float)
    first, second = np.arange(n), np.append(n, np.arange(n - 1))
    normal = np.tile([0.0, 0, 1], (n, 1))
    push = weight * np.arange(n, 0, -1.0)
    still = np.zeros((n, 3))
    contacts = Contacts(first, second, normal, push[:, None] * normal, np.zeros(n), np.ones(n, bool))
    s = Snapshot(x, np.ones(n), mass=np.ones(n), velocity=still, contacts=contacts)
    area = 4.0
    for low in np.arange(0.0, 9.0, 0.7):
        middle = low + 0.05
        above = weight * (x[:, 2] > middle).sum()
        slab = granular.stress(s, Box((-1, -1, low + 0.04), (1, 1, low + 0.06)))
        assert slab.tensor[2, 2] * area == pytest.approx(above)
        assert slab.pressure == pytest.approx(slab.tensor[2, 2] / 3)
        assert slab.deviatoric == pytest.approx(slab.tensor[2, 2])
        assert slab.asymmetry == 0
    whole = Box((-1, -1, 0), (1, 1, 10))
    of_balls = np.einsum("n,nij->ij", s.volume, granular.ball_stress(s))
    np.testing.assert_allclose(of_balls, granular.stress(s, whole).contact * whole.volume)


def test_stress_of_parts_adds_up_and_friction_is_seen() -> None:
    n = 40
    x, r = RANDOM.uniform(0, 1, (n, 3)), np.full(n, 0.12)
    s = network(x, r, np.array(1.0), mass=np.ones(n), velocity=np.zeros((n, 3)))
    c = s.touching
    force = c.force + 0.3 * RANDOM.normal(size=c.force.shape)
    exact = Contacts(c.first, c.second, c.normal, force, c.gap, c.closed)
    s = Snapshot(x, r, mass=s.mass, velocity=s.velocity, contacts=exact)
    parts = cells(CUBE, (3, 2, 4))
    total = sum(granular.stress(s, box).contact * box.volume for box in parts)
    np.testing.assert_allclose(total, granular.stress(s, CUBE).contact, atol=1e-12)
    whole = granular.stress(s, CUBE)
    assert whole.asymmetry > 0
    np.testing.assert_array_equal(whole.symmetric, whole.symmetric.T)
    turned = granular.stress(s, Ball((0.5, 0.5, 0.5), 2.0)).contact * Ball((0, 0, 0), 2.0).volume
    np.testing.assert_allclose(turned, total, atol=1e-12)
    tube = Cylinder((0.5, 0.5, 0.5), (1, 2, 3), 2.0, 4.0)
    np.testing.assert_allclose(granular.stress(s, tube).contact * tube.volume, total, atol=1e-12)


def gas(n: int = 20_000, spread: float = 0.5) -> Snapshot:
    none = Contacts(
        *[np.zeros(0, int)] * 2, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0, bool)
    )
    return Snapshot(
        RANDOM.uniform(0, 1, (n, 3)),
        np.full(n, 1e-3),
        mass=np.full(n, 2.0),
        velocity=RANDOM.normal(0, spread, (n, 3)) + np.array([3, 0, -1]),
        inertia=np.full(n, 0.8e-6),
        angular_velocity=RANDOM.normal(0, 100, (n, 3)) + np.array([7, 0, 0]),
        contacts=none,
    )


def test_a_gas_has_its_temperature_and_pressure() -> None:
    s = gas()
    found = granular.granular_temperature(s)
    assert found.translational == pytest.approx(0.25, rel=0.03)
    assert found.rotational == pytest.approx(0.8e-6 * 100**2 / 2.0, rel=0.03)
    np.testing.assert_allclose(found.velocity, [3, 0, -1], atol=0.02)
    np.testing.assert_allclose(found.tensor, 0.25 * np.eye(3), atol=0.01)
    pressure = granular.stress(s, Box((0.1, 0.1, 0.1), (0.9, 0.9, 0.9))).pressure
    assert pressure == pytest.approx(20_000 * 2.0 * 0.25, rel=0.03)  # n m T
    around = granular.granular_temperature(s, mean="none")
    assert around.translational == pytest.approx(0.25 + 10 / 3, rel=0.03)


def test_a_shear_is_no_heat() -> None:
    s = gas()
    shear = np.array([[0, 0, 5.0], [0, 0, 0], [1, 0, 0]])
    moving = Snapshot(
        s.position, s.radius, s.mass, s.velocity + s.position @ shear.T, s.inertia, s.angular_velocity
    )
    assert granular.granular_temperature(moving).translational > 0.5
    found = granular.granular_temperature(moving, mean="affine")
    assert found.translational == pytest.approx(0.25, rel=0.03)
    np.testing.assert_allclose(found.gradient, shear, atol=0.06)
    sliced = granular.over_regions(
        moving, granular.granular_temperature, cells(CUBE, (3, 3, 3)), mean="affine"
    )
    assert np.mean([t.translational for t in sliced]) == pytest.approx(0.25, rel=0.03)
    assert sum(t.balls for t in sliced) == 20_000


def test_few_balls_are_not_colder() -> None:
    """Fitting the mean takes its part of the fluctuation away; the number of balls is corrected for it."""
    s = gas(n=6000)
    boxes = cells(CUBE, (10, 10, 10))  # about six balls each
    for mean in ("uniform", "affine"):
        found = granular.over_regions(s, granular.granular_temperature, boxes, mean=mean)
        balls = np.array([t.balls for t in found])
        enough = balls >= 6
        # weighted with the degrees of freedom, the estimate has no bias
        free = balls - (1 if mean == "uniform" else 4)
        values = np.array([t.translational for t in found])
        assert np.average(values[enough], weights=free[enough]) == pytest.approx(0.25, rel=0.05)
    assert math.isnan(granular.granular_temperature(s, region=Ball((9, 9, 9), 1)).translational)
    with pytest.raises(CaromError, match="unknown mean field 'linear'; known: none, uniform, affine"):
        granular.granular_temperature(s, mean="linear")


def test_absent_balls_are_passed_over() -> None:
    x = np.array([[0.2, 0.2, 0.2], [np.nan] * 3, [0.6, 0.2, 0.2]])
    s = Snapshot(x, np.full(3, 0.2))
    assert granular.packing_fraction(s, CUBE) == pytest.approx(2 * WHOLE * 0.2**3)
    z = granular.coordination(s, gap=1e-9)
    np.testing.assert_array_equal(z.per_ball, [1, 0, 1])
    assert z.mean == 1


def test_only_the_part_that_needs_it_is_refused() -> None:
    """Places, masses and velocities of elsewhere have a temperature and a kinetic stress."""
    rng = np.random.default_rng(0)
    known = {"mass": rng.uniform(1, 2, 50), "velocity": rng.normal(size=(50, 3))}
    spins = {"inertia": np.ones(50), "angular_velocity": rng.normal(size=(50, 3))}
    place = rng.random((50, 3)), np.full(50, 0.01)
    few, more = Snapshot(*place, **known), Snapshot(*place, **known, **spins)
    cold, warm = granular.granular_temperature(few), granular.granular_temperature(more)
    assert cold.translational == warm.translational
    assert warm.rotational > 0
    whole = Box((-1, -1, -1), (2, 2, 2))
    slow = granular.stress(few, whole)
    np.testing.assert_allclose(
        slow.kinetic * whole.volume, cold.tensor * known["mass"].sum() * 49 / 50, rtol=1e-12, atol=1e-12
    )
    for refused, what in ((cold, "rotational"), (slow, "contact"), (slow, "pressure")):
        with pytest.raises(CaromError, match="not known here"):
            getattr(refused, what)
        assert f"{what}=not known" in repr(refused)


def test_what_is_not_known_is_said() -> None:
    s = Snapshot(np.zeros((1, 3)), np.ones(1))
    with pytest.raises(
        CaromError, match="forces of contacts are not known here; give the Snapshot its contacts"
    ):
        granular.force_chains(s)
    with pytest.raises(CaromError, match="mass is not known here"):
        granular.granular_temperature(Snapshot(np.zeros((2, 3)), np.ones(2)))
    with pytest.raises(CaromError, match="give an axis x, y or z"):
        layers(CUBE, "w", 3)
    with pytest.raises(CaromError, match=r"a cylinder along .* cannot be cut in layers across x"):
        layers(Cylinder((0, 0, 0), (0, 0, 1), 1.0, 2.0), "x", 3)
    with pytest.raises(CaromError, match="only a Box or a Cylinder can be cut in layers"):
        layers(Ball((0, 0, 0), 1.0), "x", 3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda: Box((0, 0, 1), (1, 1, 0)), r"along z low = 1 m is not below high = 0 m"),
        (lambda: Cylinder((0, 0, 0), (0, 0, 0), 1.0, 1.0), r"the axis a direction"),
        (lambda: Ball((0, 0, 0), -1.0), r"radius = -1 m"),
        (
            lambda: Snapshot([[0.0, 0.0]], [1.0]),
            r"position has shape \(1, 2\); with 1 radii it must be \(1, 3\)",
        ),  # type: ignore[arg-type]
        (lambda: granular.coordination(lattice("sc", n=2)[0], gap=-1.0), r"gap = -1 m"),
    ],
)
def test_what_cannot_be_measured_is_told(wrong: Callable[[], object], told: str) -> None:
    with pytest.raises(CaromError, match=told):
        wrong()


def test_arrays_of_other_programs_may_be_lists() -> None:
    assert granular.packing_fraction(Snapshot([[0.5, 0.5, 0.5]], [0.5]), CUBE) == pytest.approx(math.pi / 6)  # type: ignore[arg-type]
