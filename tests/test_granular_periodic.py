"""Measures of a world that repeats itself: where the balls are written and where the borders lie must not matter.

Balls of such worlds keep their coordinates when they pass a border, so after a flow they are many periods away; measures
found none of them in the box then, and forces across the border were lost.
"""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom import CaromError, granular
from carom.granular import Ball, Box, Contacts, Cylinder, Snapshot
from carom.measure.granular.nearest import middle
from carom.scene.packing.neighbours import pairs, separation

PERIOD = np.array([1.0, 1.2, 0.0])
WORLD = Box((0, 0, 0), (1.0, 1.2, 0.9))


@pytest.fixture(scope="module")
def bed() -> Snapshot:
    """200 balls at random in a world periodic along x and y, with a force between all that overlap, seen from afar."""
    random = np.random.default_rng(5)
    x = random.uniform(0, 1, (200, 3)) * np.array([1.0, 1.2, 0.9])
    r = random.uniform(0.04, 0.07, 200)
    a, b = pairs(x, r, PERIOD)
    delta = separation(x[a] - x[b], PERIOD)
    distance = np.linalg.norm(delta, axis=1)
    force = random.normal(size=(len(a), 3)) + 3.0 * delta / distance[:, None]
    contacts = Contacts(a, b, delta / distance[:, None], force, distance - r[a] - r[b], np.ones(len(a), bool))
    one, velocity = np.ones(200), random.normal(size=(200, 3))
    far = x + PERIOD * random.integers(-5, 6, (200, 3))
    return Snapshot(
        far, r, one, velocity, one, velocity, contacts, gravity=np.array([0, 0, -9.8]), period=PERIOD
    )


def moved(s: Snapshot, shift: np.ndarray) -> Snapshot:
    return Snapshot(
        s.position + shift, s.radius, s.mass, s.velocity, s.inertia, s.angular_velocity, s.contacts,
        gravity=s.gravity, period=s.period,
    )  # fmt: skip


def test_stress_of_a_whole_period_is_the_sum_over_all_contacts(bed: Snapshot) -> None:
    tall = Box((0, 0, -1), (1.0, 1.2, 2.0))
    c = bed.touching
    expected = np.einsum("ci,cj->ij", bed.branch, c.force) / tall.volume
    np.testing.assert_allclose(granular.stress(bed, tall).contact, expected, rtol=1e-10, atol=1e-9)
    flagged = Box(tall.low, tall.high, (True, True, False))
    np.testing.assert_allclose(
        granular.stress(bed, flagged).tensor, granular.stress(bed, tall).tensor, rtol=1e-10
    )
    assert granular.packing_fraction(bed, tall) == pytest.approx(bed.volume.sum() / tall.volume, rel=1e-12)


@pytest.mark.parametrize(
    "region",
    [
        Box((0.7, 0.2, 0.1), (1.3, 0.9, 0.8)),
        Cylinder((0.1, 0, 0.4), (1, 1, 0), 0.3, 0.8),
        Ball((0, 0, 0.5), 0.4),
    ],
)
def test_regions_across_a_border_see_what_those_within_see(
    bed: Snapshot, region: Box | Cylinder | Ball
) -> None:
    """All is shifted, balls and region, by a part of a period: nothing changes."""
    shift = np.array([0.37, 0.61, 0.0])
    if isinstance(region, Box):
        there = Box(tuple(np.add(region.low, shift)), tuple(np.add(region.high, shift)))
    elif isinstance(region, Cylinder):
        there = Cylinder(tuple(np.add(region.point, shift)), region.axis, region.radius, region.length)
    else:
        there = Ball(tuple(np.add(region.point, shift)), region.radius)
    other = moved(bed, shift)
    assert granular.packing_fraction(bed, region) > 0.1
    assert granular.packing_fraction(other, there) == pytest.approx(
        granular.packing_fraction(bed, region), rel=1e-9
    )
    for measure, name in (
        (granular.stress, "tensor"),
        (granular.fabric, "tensor"),
        (granular.granular_temperature, "tensor"),
    ):
        found, same = (getattr(measure(s, region=r), name) for s, r in ((bed, region), (other, there)))
        assert np.isfinite(found).all()
        np.testing.assert_allclose(same, found, rtol=1e-9, atol=1e-9 * np.abs(found).max())
    counted = granular.coordination(bed, region=region).counted
    assert counted.sum() > 5
    np.testing.assert_array_equal(granular.coordination(other, region=there).counted, counted)


def test_a_region_of_two_periods_holds_every_ball_twice(bed: Snapshot) -> None:
    one, two = Box((0, 0, 0), (1.0, 1.2, 0.9)), Box((0, 0, 0), (2.0, 1.2, 0.9))
    assert granular.packing_fraction(bed, two) == pytest.approx(
        granular.packing_fraction(bed, one), rel=1e-12
    )
    np.testing.assert_allclose(granular.stress(bed, two).tensor, granular.stress(bed, one).tensor, rtol=1e-9)
    with pytest.raises(CaromError, match="periods long along x"):
        granular.packing_fraction(bed, Box((-1e3, 0, 0), (1e3, 1, 1)))


def test_contacts_by_gap_are_those_across_the_border_too(bed: Snapshot) -> None:
    assert granular.coordination(bed, gap=0.0).mean == pytest.approx(2 * len(bed.touching.first) / 200)


def test_a_periodic_box_has_the_length_of_the_world(bed: Snapshot) -> None:
    with pytest.raises(CaromError, match=r"periodic along y over 1 m, the world over 1\.2 m"):
        granular.packing_fraction(bed, Box((0, 0, 0), (1, 1, 1), (True, True, False)))


def test_layers_of_a_periodic_box_stay_periodic(bed: Snapshot) -> None:
    layers = granular.layers(Box(WORLD.low, WORLD.high, (True, True, False)), "z", 3)
    assert [layer.periodic for layer in layers] == [(True, True, False)] * 3
    np.testing.assert_allclose(
        granular.over_regions(bed, granular.packing_fraction, layers).values,
        granular.over_regions(bed, granular.packing_fraction, granular.layers(WORLD, "z", 3)).values,
    )
    assert granular.layers(Box(WORLD.low, WORLD.high, (True, True, False)), "x", 2)[0].periodic == (
        False,
        True,
        False,
    )


def test_radial_distribution_finds_balls_that_flowed_away(bed: Snapshot) -> None:
    box = Box((0.1, 0.1, 0.1), (0.9, 1.1, 0.9))
    here = moved(Snapshot(bed.folded, bed.radius), np.zeros(3))
    one, same = (granular.radial_distribution(s, box, reach=0.25, bins=5) for s in (bed, here))
    np.testing.assert_array_equal(one.pairs, same.pairs)
    assert one.pairs.sum() > 50


def test_a_row_of_balls_between_weights_of_a_run() -> None:
    """Eight balls that touch all round a periodic world, each under gravity on the floor: a layer carries all."""
    radius, many = 0.01, 8
    length = 2 * radius * many + 0.001
    scene = carom.Scene(
        "a row", periodic=(length, 5 * radius, 0), run={"until": 0.03, "step": 1e-3}, record={"every": 5}
    )
    scene.contact("glass", "glass", friction=0.0, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="glass")
    for k in range(many):
        place = ((2 * radius + 0.001 / many) * k - 3 * length, 0, radius)
        scene.sphere(f"b{k}", radius=radius, mass=0.1, position=place, velocity=(0.1, 0, 0), material="glass")
    s = granular.snapshot(carom.simulate(scene))
    layer = Box((0, 0, 0.2 * radius), (length, 5 * radius, 0.6 * radius))
    weight = many * 0.1 * 9.8 / (length * 5 * radius)
    assert granular.stress(s, layer).contact[2, 2] == pytest.approx(weight, rel=1e-8)


def test_the_live_view_shows_balls_of_a_periodic_world_within_it() -> None:
    """They had rolled out of the picture; films and pages bring them back."""
    from carom.show.viewer.live import Live

    scene = carom.Scene("away", periodic=(0.1, 0, 0), origin=(-0.05, 0, 0), run={"until": 0.01, "step": 1e-3})
    scene.sphere("b", radius=0.01, mass=0.1, position=(7.23, 3.0, 1.0), velocity=(0.1, 0, 0), material="m")
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    live = object.__new__(Live)  # without its server
    live._result, live._every, live._scale = carom.simulate(scene), 1, 2.0
    assert live._bodies(0)[0][0] == pytest.approx([2.0 * 0.03, 6.0, 2.0])


HEAP_PERIOD = np.array([0.6, 0.8, 0.0])
SHIFTS = ((0.3, 0.4, 0.0), (0.123, -0.456, 0.2), (-7.55, 3.31, 0.0))


def heaped(*, layer: bool) -> np.ndarray:
    """A cone of 25 degrees about an axis at random places, with a layer of balls all over the floor if wanted."""
    random = np.random.default_rng(3)
    x = random.uniform(-1, 1, (60_000, 3)) * [0.2, 0.2, 0.05] + [0, 0, 0.05]
    x = x[x[:, 2] < 0.08 - np.tan(np.radians(25.0)) * np.hypot(x[:, 0], x[:, 1])]
    if layer:
        k = [np.arange(-0.5 * length, 0.5 * length, 0.00875) for length in HEAP_PERIOD[:2]]
        floor = np.stack([*np.meshgrid(*k), np.zeros((len(k[1]), len(k[0])))], axis=-1).reshape(-1, 3)
        floor += random.uniform(-0.001, 0.001, floor.shape)
        x = np.concatenate([x, floor])
    return x


def written(x: np.ndarray, shift: np.ndarray, low: np.ndarray, radius: float = 0.004) -> Snapshot:
    """The same balls elsewhere, within the period that begins at `low`."""
    place = x + shift
    turns = np.where(HEAP_PERIOD > 0, np.floor((place - low) / np.where(HEAP_PERIOD > 0, HEAP_PERIOD, 1)), 0)
    return Snapshot(place - turns * HEAP_PERIOD, np.full(len(x), radius), period=HEAP_PERIOD)


@pytest.mark.parametrize("layer", [False, True], ids=["bare", "layer"])
@pytest.mark.parametrize("shift", SHIFTS)
def test_a_heap_has_its_angle_wherever_the_borders_lie(layer: bool, shift: tuple[float, ...]) -> None:
    """Cut in four by the border it had an angle of -22 degrees instead of 32."""
    x = heaped(layer=layer)
    alone = granular.heap_angle(Snapshot(x, np.full(len(x), 0.004)), centre=(0, 0, 0))
    assert alone.degrees == pytest.approx(25.0, abs=4.0 if layer else 0.5)  # a layer is part of the solid
    there, unmoved = written(x, np.array(shift), -0.5 * HEAP_PERIOD), written(x, np.zeros(3), np.zeros(3))
    given = granular.heap_angle(there, centre=shift)
    assert given.angle == pytest.approx(alone.angle, abs=1e-9)
    assert given.error == pytest.approx(alone.error, abs=1e-9)
    found = granular.heap_angle(there)
    assert found.angle == pytest.approx(granular.heap_angle(unmoved).angle, abs=1e-9)
    assert found.angle == pytest.approx(alone.angle, abs=alone.error + found.error)


def wedge() -> np.ndarray:
    """A slope of 20 degrees, four fifths of a period long, at random places all along y."""
    random = np.random.default_rng(4)
    x = random.uniform(0, 1, (10_000, 3)) * [0.48, 0.8, 0.2]
    return np.asarray(x[x[:, 2] < np.tan(np.radians(20.0)) * (0.48 - x[:, 0])])


@pytest.mark.parametrize("shift", SHIFTS)
def test_a_slope_has_its_angle_wherever_the_borders_lie(shift: tuple[float, ...]) -> None:
    x = wedge()
    alone = granular.heap_angle(written(x, np.zeros(3), np.zeros(3), 0.01), shape="planar")
    assert alone.degrees == pytest.approx(20.0, abs=0.5)
    found = granular.heap_angle(written(x, np.array(shift), np.zeros(3), 0.01), shape="planar")
    assert found.angle == pytest.approx(alone.angle, abs=1e-9)
    assert found.error == pytest.approx(alone.error, abs=1e-9)


@pytest.mark.parametrize("shift", SHIFTS)
def test_a_column_runs_out_as_far_wherever_the_borders_lie(shift: tuple[float, ...]) -> None:
    random = np.random.default_rng(5)
    cone, slope = heaped(layer=False)[::4], wedge()
    column = random.uniform(-1, 1, (1500, 3)) * [0.05, 0.05, 0.1] + [0, 0, 0.1]
    column = column[np.hypot(column[:, 0], column[:, 1]) < 0.05]
    block = random.uniform(0, 1, (1500, 3)) * [0.1, 0.8, 0.2]
    for shape, first, last, edge in (("radial", column, cone, 0.17), ("planar", block, slope, 0.48)):
        origin = [written(x, np.zeros(3), np.zeros(3), 0.01) for x in (first, last)]
        alone = granular.run_out((origin[0], origin[1]), shape=shape)
        assert alone.final == pytest.approx(edge, abs=0.03)
        # Balls of a run keep their coordinates: what has run out over the border is written beyond it.
        for lows in ((np.zeros(3), np.zeros(3)), (-0.5 * HEAP_PERIOD, 3.3 * HEAP_PERIOD)):
            moved = [
                written(x, np.array(shift), low, 0.01) for x, low in zip((first, last), lows, strict=True)
            ]
            found = granular.run_out((moved[0], moved[1]), shape=shape)
            for name in ("initial", "final", "error", "ratio", "initial_height", "final_height"):
                assert getattr(found, name) == pytest.approx(getattr(alone, name), abs=1e-9), name


def test_a_middle_is_that_of_the_nearest_images() -> None:
    x = np.array([[0.95, 0.2, 1.0], [0.05, 0.2, 2.0], [0.15, 0.2, 3.0]])
    np.testing.assert_allclose(
        middle(x, np.array([1.0, 1.0, 2.0]), np.array([1.0, 0.3, 0.0])) % [1, 0.3, 9], [0.075, 0.2, 2.25]
    )
    np.testing.assert_allclose(middle(x, np.ones(3), None), x.mean(axis=0))
