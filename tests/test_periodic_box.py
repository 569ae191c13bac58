"""Periodic boxes that may be sheared: nearest images, folding, pairs across faces, against sums over many images."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from carom.scene.packing.neighbours import pairs, separation
from carom.scene.packing.periodic import PeriodicBox
from hypothesis import given
from hypothesis import strategies as st

LENGTHS = np.array([1.0, 0.7, 1.3])
ORIGIN = np.array([0.2, -0.4, 3.0])
AXES = [(f, g) for f in range(3) for g in range(3) if f != g]


def box(flow: int = 0, gradient: int = 2, offset: float = 0.0, lengths: object = LENGTHS) -> PeriodicBox:
    return PeriodicBox(np.asarray(lengths, float), ORIGIN, flow, gradient, offset)


def places(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-6.0, 6.0, (count, 3))


@pytest.mark.parametrize(("flow", "gradient"), AXES)
@given(offset=st.floats(-5.0, 5.0), turns=st.tuples(*[st.integers(-4, 4)] * 3))
def test_nearest_and_fold_know_no_images(
    flow: int, gradient: int, offset: float, turns: tuple[int, int, int]
) -> None:
    b = box(flow, gradient, offset)
    x = places(50)
    for of in (b.nearest, b.fold, b.fold_tilted, b.tilted.fold_tilted):
        here, there = of(x), of(x + np.array(turns) @ b.vectors)
        # Rounding may put a place at a face to either side of it.
        away = b.nearest(there - here)
        assert np.abs(away).max() < 1e-12
        whole = np.linalg.solve(b.vectors.T, (here - x).T)
        assert np.abs(whole - np.rint(whole)).max() < 1e-11


@pytest.mark.parametrize(("flow", "gradient"), AXES)
@pytest.mark.parametrize("offset", [0.0, 0.31, -2.77, 40.3])
def test_what_is_folded_lies_in_the_box(flow: int, gradient: int, offset: float) -> None:
    b, x = box(flow, gradient, offset), places(1000)
    folded = b.fold(x)
    assert (folded >= b.origin - 1e-12).all()
    assert (folded <= b.origin + b.lengths + 1e-12).all()
    for c in (b, b.tilted):
        part = np.linalg.solve(c.vectors.T, (c.fold_tilted(x) - c.centre).T)
        assert np.abs(part).max() <= 0.5 + 1e-12
    assert abs(b.tilt) <= 0.5 * LENGTHS[flow]
    assert np.linalg.det(b.vectors) == pytest.approx(LENGTHS.prod())


@pytest.mark.parametrize(("flow", "gradient"), AXES)
@pytest.mark.parametrize("offset", [0.31, -2.77])
def test_the_nearest_image_is_the_nearest_of_all_up_to_half_a_length(
    flow: int, gradient: int, offset: float
) -> None:
    b, x = box(flow, gradient, offset), places(300)
    steps = np.array(list(product(range(-3, 4), repeat=3))) @ b.tilted.vectors
    least = np.linalg.norm(b.fold(x)[:, None] - b.origin + steps[None], axis=2).min(axis=1)
    found = np.linalg.norm(b.nearest(x - b.origin), axis=1)
    near = least < 0.5 * LENGTHS.min()
    assert near.sum() > 20
    assert found[near] == pytest.approx(least[near], abs=1e-12)
    assert (found >= least - 1e-12).all()


@pytest.mark.parametrize("lengths", [(1.0, 0.7, 1.3), (1.0, 0.0, 1.3)])
@pytest.mark.parametrize("offset", [0.0, 0.31, -2.77])
def test_pairs_across_sheared_faces_are_those_of_all_images(
    lengths: tuple[float, ...], offset: float
) -> None:
    b = box(0, 2, offset, lengths)
    rng = np.random.default_rng(3)
    x, reach = rng.uniform(-2.0, 2.0, (120, 3)), rng.uniform(0.02, 0.08, 120)
    if lengths[1] == 0:
        x[:, 1] *= 0.1
    a, c = pairs(x, reach, b)
    delta = separation(x[:, None] - x[None], b)
    near = np.linalg.norm(delta, axis=2) <= reach[:, None] + reach[None]
    expected = np.argwhere(np.triu(near, 1))
    assert len(expected) > 20
    assert np.array_equal(np.stack([a, c], axis=1), expected)


def test_a_box_without_shear_has_the_bits_of_lengths_alone() -> None:
    x, period = places(200), np.array([1.0, 0.0, 0.7])
    rounds = np.where(period > 0, np.rint(x / np.where(period > 0, period, 1.0)), 0.0)
    b = PeriodicBox.of(period)
    assert b is not None
    assert np.array_equal(b.nearest(x), x - period * rounds)
    assert np.array_equal(b.fold(x)[:, 1], x[:, 1])
    assert PeriodicBox.of(np.zeros(3)) is PeriodicBox.of(None) is None


def test_turns_count_the_vectors_to_the_middle_image() -> None:
    b = PeriodicBox(np.array([1.0, 0.0, 0.5]), np.array([-0.5, 0.0, -0.25]))
    place = np.array([[2.75, 9.0, -0.51], [-1.2, 0.0, 0.49]])
    assert b.turns(place).tolist() == [[3, 0, -1], [-1, 0, 1]]


def test_an_image_moves_with_the_flow() -> None:
    """The velocity of an image is the rate of its vector, here by a difference in time."""
    rate, gradient = 0.4, np.zeros((3, 3))
    gradient[0, 2], gradient[1, 1] = rate, -0.1
    at = PeriodicBox(LENGTHS, ORIGIN, 0, 2, 0.3, gradient)
    h = 1e-6
    later = PeriodicBox(LENGTHS * [1.0, 1.0 - 0.1 * h, 1.0], ORIGIN, 0, 2, 0.3 + rate * h * LENGTHS[2])
    for k in range(3):
        drift = at.flow_velocity(at.centre + at.vectors[k]) - at.flow_velocity(at.centre)
        assert drift == pytest.approx((later.vectors[k] - at.vectors[k]) / h, abs=1e-8)


def test_edges_of_a_drawn_box_are_its_vectors() -> None:
    b = box(0, 2, 0.3, (1.0, 0.0, 1.3))
    low, high = np.array([9.0, -1.0, 9.0]), np.array([9.0, 2.0, 9.0])
    corners = b.corners(low, high)
    assert corners[1] - corners[0] == pytest.approx([1.0, 0.0, 0.0])
    assert corners[2] - corners[0] == pytest.approx([0.0, 3.0, 0.0])
    assert corners[4] - corners[0] == pytest.approx([0.3, 0.0, 1.3])
    assert corners.mean(axis=0) == pytest.approx([b.centre[0], 0.5, b.centre[2]])
