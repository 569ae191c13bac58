"""Random packings: sizes against their moments, no overlaps, the fraction asked for, the same bits for the same seed."""

from __future__ import annotations

import hashlib
import math
import statistics
import tracemalloc

import numpy as np
import pytest
from carom import CaromError
from carom.packing import (
    Ball,
    Box,
    Cylinder,
    Equal,
    Lognormal,
    Normal,
    PackingError,
    Region,
    Sizes,
    Stream,
    Table,
    Uniform,
    draw,
    pack,
)
from carom.scene.assembly.bodies import uniform
from carom.scene.packing.neighbours import pairs, separation
from carom.scene.packing.numbers import cbrt, exp, log, normal_quantile
from hypothesis import given
from hypothesis import strategies as st

UNIT = Box((0, 0, 0), (1, 1, 1))
PERIODIC = Box((0, 0, 0), (1, 1, 1), (True, True, True))
CYLINDER = Cylinder((1, 2, 3), (1, 1, 0.5), 0.5, 1.5)
BALL = Ball((-1, 0, 2), 0.6)


# ------------------------------------------------------------------------------------------- numbers and sizes


def test_elementary_functions_agree_with_the_library() -> None:
    x = np.concatenate([10.0 ** np.linspace(-300, 300, 1000), 1 + np.linspace(-1e-3, 1e-3, 101)])
    np.testing.assert_allclose(log(x), np.log(x), rtol=1e-15, atol=1e-16)
    np.testing.assert_allclose(exp(np.linspace(-50, 50, 999)), np.exp(np.linspace(-50, 50, 999)), rtol=5e-16)
    assert cbrt(27.0) == pytest.approx(3.0, rel=1e-15)
    p = np.concatenate([np.linspace(0.001, 0.999, 999), [1e-300, 1e-20, 1e-9, 1 - 1e-9, 2.0**-54]])
    expected = [statistics.NormalDist().inv_cdf(float(q)) for q in p]
    np.testing.assert_allclose(normal_quantile(p), expected, rtol=1e-14, atol=1e-15)


def test_the_stream_is_that_of_the_lattices() -> None:
    """One stream for all that is random: `uniform` of the generators, from [-1, 1) to [0, 1)."""
    np.testing.assert_array_equal(Stream(7).uniform(9), 0.5 * (uniform(7, (9,)) + 1.0))


def cut_normal(mean: float, deviation: float, low: float, high: float) -> tuple[float, float]:
    """Mean and standard deviation of a normal law between limits, in closed form."""
    law = statistics.NormalDist()
    a, b = (low - mean) / deviation, (high - mean) / deviation
    mass = law.cdf(b) - law.cdf(a)
    shift = (law.pdf(a) - law.pdf(b)) / mass
    spread = 1 + (a * law.pdf(a) - b * law.pdf(b)) / mass - shift**2
    return mean + deviation * shift, deviation * math.sqrt(spread)


@pytest.mark.parametrize(
    ("sizes", "mean", "deviation"),
    [
        (Equal(2.0), 2.0, 0.0),
        (Uniform(1.0, 3.0), 2.0, 2 / math.sqrt(12)),
        (Normal(2.0, 0.3, 0.2, 4.0), 2.0, 0.3),
        (Normal(2.0, 1.0, 1.5, 2.2), *cut_normal(2.0, 1.0, 1.5, 2.2)),
        (Lognormal(2.0, 0.5, 1e-3, 100.0), 2.0, 0.5),
        (Table((1.0, 2.0, 4.0), (1, 1, 2)), 2.75, math.sqrt(1.6875)),
        (Table((1.0, 2.0), (1, 8), by_mass=True), 1.5, 0.5),  # eight times the mass: as many
    ],
)
def test_sizes_have_their_moments(sizes: Sizes, mean: float, deviation: float) -> None:
    n = 40_000
    drawn = sizes.draw(n, Stream(11))
    assert len(drawn) == n
    assert drawn.mean() == pytest.approx(mean, abs=4 * deviation / math.sqrt(n) + 1e-12)
    assert drawn.std() == pytest.approx(deviation, rel=0.02, abs=1e-12)


def test_lognormal_sizes_have_a_normal_logarithm() -> None:
    logs = np.log(Lognormal(1.0, 0.4, 1e-3, 100.0).draw(40_000, Stream(5)))
    spread = math.sqrt(math.log(1 + 0.4**2))
    z = (logs + 0.5 * spread**2) / spread
    assert abs((z**3).mean()) < 0.08  # skewness and kurtosis of a normal law
    assert (z**4).mean() == pytest.approx(3.0, abs=0.15)


def test_limits_cut_a_law_and_may_not_cut_all_of_it() -> None:
    drawn = Lognormal(1.0, 0.4, 0.9, 1.1).draw(1000, Stream(5))
    assert 0.9 <= drawn.min() < drawn.max() <= 1.1
    with pytest.raises(PackingError, match="diameters lie between 5 m and 6 m; widen the limits"):
        draw(UNIT, Normal(1.0, 0.1, 5.0, 6.0), Stream(1), count=10)


def test_a_fraction_is_met_to_within_half_a_ball() -> None:
    sizes = Uniform(0.05, 0.15)
    for fraction in (0.05, 0.3, 0.6):
        radius = draw(UNIT, sizes, Stream(2), fraction=fraction)
        volume = 4 / 3 * np.pi * (radius**3).sum()
        assert abs(volume - fraction) <= 0.5 * np.pi / 6 * 0.15**3
    first = draw(UNIT, sizes, Stream(2), count=len(radius))
    np.testing.assert_array_equal(radius, first)  # the same stream, whichever way the number is given


# ------------------------------------------------------------------------------------------- neighbours


@given(
    st.integers(2, 60),
    st.sampled_from([1.0, 3.0, 20.0]),
    st.tuples(st.booleans(), st.booleans(), st.booleans()),
    st.integers(0, 2**32),
)
def test_pairs_are_those_of_brute_force(
    n: int, ratio: float, periodic: tuple[bool, bool, bool], seed: int
) -> None:
    random = np.random.default_rng(seed)
    period = np.where(periodic, 1.0, 0.0)
    x = random.uniform(0, 1, (n, 3)) + 3 * period * random.integers(-1, 2, (n, 3))
    reach = random.uniform(0.1 / ratio, 0.1, n)
    i, j = np.triu_indices(n, 1)
    delta = separation(x[i] - x[j], period)
    near = (delta**2).sum(axis=1) <= (reach[i] + reach[j]) ** 2
    a, b = pairs(x, reach, period)
    np.testing.assert_array_equal(np.stack([a, b]), np.stack([i[near], j[near]]))


def test_pairs_of_few_far_reaching_balls_take_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    # Each of the 20 000 looks at all 200 far-reaching ones: 4 million pairs compared, of which 0.5 million are near.
    random = np.random.default_rng(4)
    x = random.uniform(0, 1, (20_000, 3))
    reach = np.full(len(x), 0.002)
    reach[:200] = 0.2
    at_once = pairs(x, reach)
    monkeypatch.setattr("carom.scene.packing.neighbours._CANDIDATES", 1 << 17)
    tracemalloc.start()
    in_shares = pairs(x, reach)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(np.stack(at_once), np.stack(in_shares))
    assert len(in_shares[0]) > 100_000
    assert most < 60e6, "all at once are 180 MB"


# ------------------------------------------------------------------------------------------- packings


def walls(region: Region, x: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Gap of each ball to the walls, by formulas of its own."""
    if isinstance(region, Box):
        gap = np.minimum(x - region.low, np.array(region.high) - x)
        gap[:, list(region.periodic)] = np.inf
        return np.asarray(gap.min(axis=1) - radius)
    away = x - region.point
    if isinstance(region, Ball):
        return np.asarray(region.radius - np.linalg.norm(away, axis=1) - radius)
    assert isinstance(region, Cylinder)
    axis = np.array(region.axis) / np.linalg.norm(region.axis)
    along = away @ axis
    off = np.linalg.norm(away - np.outer(along, axis), axis=1)
    return np.asarray(np.minimum(region.radius - off, region.length / 2 - abs(along)) - radius)


@pytest.mark.parametrize(
    "region", [UNIT, PERIODIC, CYLINDER, BALL], ids=["box", "periodic", "cylinder", "ball"]
)
@pytest.mark.parametrize(
    "sizes",
    [Equal(0.12), Uniform(0.06, 0.16), Lognormal(0.1, 0.04, 0.03, 0.2)],
    ids=["equal", "uniform", "log"],
)
def test_no_overlaps_by_brute_force(region: Region, sizes: Sizes) -> None:
    packed = pack(region, sizes, fraction=0.5, seed=3)
    i, j = np.triu_indices(len(packed.radius), 1)
    delta = separation(packed.position[i] - packed.position[j], region.period)
    gap = np.linalg.norm(delta, axis=1) - packed.radius[i] - packed.radius[j]
    assert gap.min() >= 0
    assert walls(region, packed.position, packed.radius).min() > -1e-15
    assert packed.least_gap >= 0
    assert packed.fraction == pytest.approx(4 / 3 * np.pi * (packed.radius**3).sum() / region.volume)
    assert packed.fraction == pytest.approx(0.5, abs=0.01)


def test_equal_balls_reach_sixty_percent() -> None:
    packed = pack(PERIODIC, Equal(0.1), fraction=0.6, seed=1)
    assert packed.fraction == pytest.approx(0.6, abs=3e-4)
    assert packed.least_gap >= 0
    inside = (packed.position >= 0) & (packed.position < 1)
    assert inside.all()


def test_what_would_be_denser_than_random_packings_is_refused() -> None:
    with pytest.raises(
        PackingError, match=r"no packing of fraction 0\.\d* was found.* jam at 0\.64.*ask for"
    ):
        pack(PERIODIC, Equal(0.25), fraction=0.7, seed=1)
    with pytest.raises(PackingError, match=r"would fill 1\.05 of the region"):
        pack(UNIT, Equal(0.1), count=2000, seed=1)
    with pytest.raises(PackingError, match=r"has no room in the region; the largest may have 0\.4999 m"):
        pack(PERIODIC, Equal(0.6), count=1, seed=1)
    with pytest.raises(PackingError, match="exactly one"):
        pack(UNIT, Equal(0.1), seed=1)
    with pytest.raises(PackingError, match="more than 1000000 balls"):
        pack(UNIT, Equal(1e-4), fraction=0.5, seed=1)


def test_a_gap_is_kept() -> None:
    packed = pack(UNIT, Equal(0.1), count=300, gap=0.02, seed=1)
    assert packed.least_gap >= 0.01  # half of it at a wall
    a, _ = pairs(packed.position, np.full(300, 0.06))
    assert len(a) == 0


def test_one_ball_and_few_balls() -> None:
    packed = pack(UNIT, Equal(0.99), count=1, seed=1)
    assert walls(UNIT, packed.position, packed.radius).min() > -1e-15
    assert len(pack(UNIT, Equal(0.4), count=2, seed=1).radius) == 2


def test_balls_are_spread_evenly() -> None:
    """Few small balls hardly push each other: they lie like a gas."""
    packed = pack(UNIT, Equal(0.005), count=4000, seed=9)
    counts, _ = np.histogramdd(packed.position, bins=(4, 4, 4), range=[(0.0025, 0.9975)] * 3)
    chi_square = ((counts - 62.5) ** 2 / 62.5).sum()
    assert 63 - 4 * math.sqrt(126) < chi_square < 63 + 4 * math.sqrt(126)


def test_a_seed_means_the_same_packing_for_ever() -> None:
    """If this fails, stored scenarios would change their meaning."""
    sizes = Lognormal(0.12, 0.04, 0.05, 0.25)
    packed, again, other = (pack(UNIT, sizes, fraction=0.52, seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(packed.position, again.position)
    assert not np.array_equal(packed.radius, other.radius)
    digest = hashlib.sha256(packed.position.tobytes() + packed.radius.tobytes()).hexdigest()
    assert digest[:16] == "5cd125f42d2febb1"


def test_lengths_may_have_units() -> None:
    for told, plain in (
        (Box(("1 cm", 0, 0), (1, "20 mm", 1)), Box((0.01, 0, 0), (1, 0.02, 1))),
        (Cylinder(("1 mm", 0, 0), (0, 0, 1), "1 cm", "3 cm"), Cylinder((0.001, 0, 0), (0, 0, 1), 0.01, 0.03)),
        (Ball((0, 0, "1 cm"), "2 cm"), Ball((0, 0, 0.01), 0.02)),
        (Equal("5 mm"), Equal(0.005)),
        (Lognormal("5 mm", "1 mm", 0.003, "8 mm"), Lognormal(0.005, 0.001, 0.003, 0.008)),
        (Table(("1 mm", 2e-3), (1, 1)), Table((1e-3, 2e-3), (1, 1))),
    ):
        assert told == plain
    pair = (pack(UNIT, Equal(0.2), seed=1, count=4, gap=gap).position for gap in ("1 cm", 0.01))
    assert np.array_equal(*pair)
    with pytest.raises(CaromError, match="Ball: radius: expected a length"):
        Ball((0, 0, 0), "2 s")
    with pytest.raises(CaromError, match="pack: gap: expected a length"):
        pack(UNIT, Equal(0.2), seed=1, count=4, gap="1 s")
