"""Mass properties of clumps: unions of spheres against closed forms, and principal axes of tensors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from carom.arrays import F64
from carom.scene.assembly.principal import fault, principal, six
from carom.scene.assembly.rotations import inverse, product, rotated, rotated_back
from carom.scene.assembly.union import Union, union
from hypothesis import given, settings
from hypothesis import strategies as st

TURNS = [
    (1.0, 0.0, 0.0, 0.0),
    (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0),  # z to x
    (0.5, 0.5, -0.5, 0.5),
    tuple(np.array([0.9, 0.1, -0.7, 0.3]) / math.sqrt(1.40)),
]


def placed(centres: F64, radii: F64, turn: tuple[float, ...] = TURNS[0], shift: F64 | None = None) -> Union:
    moved = rotated(np.array(turn), centres) + (np.zeros(3) if shift is None else shift)
    return union(tuple(map(tuple, np.column_stack([moved, radii]).tolist())))


def two(r1: float, r2: float, d: float) -> tuple[float, float, float, float]:
    """Volume, height of the centre and moments about the axis and across it (about the first centre), of density 1, of two
    overlapping spheres at 0 and d on the axis: integrals over the discs of solids of revolution.
    """
    cut = (d * d + r1 * r1 - r2 * r2) / (2.0 * d)

    def discs(radius: float, middle: float, low: float, high: float) -> np.ndarray:
        z = np.polynomial.Polynomial([0.0, 1.0])
        square = radius**2 - (z - middle) ** 2
        parts = (square, square * z, 0.5 * square**2, 0.25 * square**2 + square * z**2)
        return np.array([math.pi * (p.integ()(high) - p.integ()(low)) for p in parts])

    volume, first, axial, across = discs(r1, 0.0, -r1, cut) + discs(r2, d, cut, d + r2)
    return volume, first / volume, axial, across - first**2 / volume


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize(
    ("r1", "r2", "d"),
    [
        (1.0, 1.0, 1.0),
        (1.0, 0.5, 1.2),
        (1.0, 0.3, 1.25),
        (1.0, 0.9, 0.2),
        (1.0, 1.0, 1e-3),
        (1.0, 1.0, 2 - 1e-6),
    ],
)
def test_two_overlapping_spheres(r1: float, r2: float, d: float, turn: tuple[float, ...]) -> None:
    volume, height, axial, across = two(r1, r2, d)
    found = placed(np.array([[0, 0, 0], [0, 0, d]]), np.array([r1, r2]), turn, np.array([3.0, -2.0, 1.0]))
    assert found.volume == pytest.approx(volume, rel=1e-12)
    axis = rotated(np.array(turn), np.array([0.0, 0.0, 1.0]))
    assert found.centre == pytest.approx(height * axis + [3.0, -2.0, 1.0], abs=1e-12)
    tensor = across * np.eye(3) + (axial - across) * np.outer(axis, axis)
    assert found.inertia(volume) == pytest.approx(tensor, abs=1e-12 * across)


def test_spheres_that_do_not_overlap_are_those_of_steiner() -> None:
    centres = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0.5]])  # the first two touch
    radii = np.array([1.0, 2.0, 0.5])
    found = placed(centres, radii)
    own = 4.0 / 3.0 * math.pi * radii**3
    assert found.volume == pytest.approx(own.sum(), rel=1e-15)
    middle = own @ centres / own.sum()
    assert found.centre == pytest.approx(middle, rel=1e-14)
    arm = centres - middle
    steiner = (arm**2).sum(axis=1)[:, None, None] * np.eye(3) - arm[:, :, None] * arm[:, None, :]
    tensor = np.einsum("n,nij->ij", own, 0.4 * radii[:, None, None] ** 2 * np.eye(3) + steiner)
    assert found.inertia(found.volume) == pytest.approx(tensor, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize(
    "others",
    [
        [[0.1, 0.2, 0.0, 0.5]],  # inside
        [[0.5, 0.0, 0.0, 0.5]],  # inside, touching from within
        [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]],  # the same again
        [[0.0, 0.0, 0.0, 0.2]],
    ],
)
def test_a_sphere_inside_another_adds_nothing(others: list[list[float]]) -> None:
    for spheres in ([[0.0, 0.0, 0.0, 1.0], *others], [*others, [0.0, 0.0, 0.0, 1.0]]):
        found = union(tuple(map(tuple, spheres)))
        assert found.volume == pytest.approx(4.0 / 3.0 * math.pi, rel=1e-14)
        assert found.centre == pytest.approx(np.zeros(3), abs=1e-14)
        assert found.inertia(1.0) == pytest.approx(0.4 * np.eye(3), abs=1e-14)


def test_a_cap_inside_another_adds_nothing() -> None:
    """A small sphere that shows from the large one, covered by a third."""
    body = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.5]]
    hidden = [1.05, 0.0, 0.0, 0.4]
    alone, more = (union(tuple(map(tuple, spheres))) for spheres in (body, [*body, hidden]))
    assert more.volume == pytest.approx(alone.volume, rel=1e-14)
    assert more.second == pytest.approx(alone.second, rel=1e-12, abs=1e-14)


def test_three_spheres_by_inclusion_and_exclusion() -> None:
    """Unit spheres with centres in a triangle of side 1: 3 V - 3 V_2 + V_3, V_2 and V_3 common to two and to three."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, math.sqrt(0.75), 0]])
    found = placed(corners, np.ones(3))
    lens = 2.0 * math.pi / 3.0 * (1.0 - 0.5) ** 2 * (2.0 + 0.5)  # common to two
    assert found.volume == pytest.approx(4.0 * math.pi - 3.0 * lens + _shared(corners), rel=1e-9)
    assert found.centre == pytest.approx(corners.mean(axis=0), abs=1e-14)


def _shared(corners: F64) -> float:
    """Volume common to three unit spheres: sections at heights z are what three discs share (a triangle with three caps)."""
    top = math.sqrt(1.0 - 1.0 / 3.0)  # over the middle of the triangle
    nodes, weights = np.polynomial.legendre.leggauss(200)
    z, w = top * np.sin(0.5 * math.pi * nodes), 0.5 * math.pi * top * np.cos(0.5 * math.pi * nodes) * weights
    area = []
    for height in z:
        radius = math.sqrt(1.0 - height * height)
        # The corners of the common figure lie on the medians: at the distance h behind the middle of a side.
        reach = math.sqrt(radius**2 - 0.25) - math.sqrt(0.75) + math.sqrt(1.0 / 3.0)
        side = math.sqrt(3.0) * reach
        cap = 2.0 * math.asin(min(1.0, side / (2.0 * radius)))
        area.append(math.sqrt(3.0) / 4.0 * side**2 + 1.5 * radius**2 * (cap - math.sin(cap)))
    return float(w @ np.array(area))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_properties_of_a_heap_turn_with_it(seed: int, count: int) -> None:
    """Heaps of spheres that overlap in many ways: the quadrature runs along another axis of each copy."""
    draw = np.random.default_rng(seed)
    centres, radii = draw.normal(size=(count, 3)) * 0.6, draw.uniform(0.2, 1.0, count)
    turn = draw.normal(size=4)
    turn /= np.linalg.norm(turn)
    shift = draw.normal(size=3)
    here = placed(centres, radii)
    there = placed(centres, radii, tuple(turn.tolist()), shift)
    assert there.volume == pytest.approx(here.volume, rel=1e-9)
    assert there.centre == pytest.approx(rotated(turn, here.centre) + shift, abs=1e-9)
    back = rotated_back(turn, rotated_back(turn, there.second).T)
    assert back == pytest.approx(here.second, abs=1e-9 * np.trace(here.second))


def test_the_union_of_many_points_counts_each_once() -> None:
    """Against a count of points of a grid: an estimate that knows nothing of spheres' surfaces."""
    draw = np.random.default_rng(7)
    centres, radii = draw.normal(size=(8, 3)) * 0.5, draw.uniform(0.3, 0.8, 8)
    found = placed(centres, radii)
    axes = [np.linspace(-2.5, 2.5, 161)] * 3
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = (np.linalg.norm(points[:, None] - centres, axis=2) <= radii).any(axis=1)
    cell = (5.0 / 160) ** 3
    assert found.volume == pytest.approx(inside.sum() * cell, rel=2e-3)
    counted = points[inside]
    assert found.centre == pytest.approx(counted.mean(axis=0), abs=1e-3)
    away = counted - counted.mean(axis=0)
    assert found.second == pytest.approx(away.T @ away * cell, abs=3e-3 * np.trace(found.second))


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 1e-30, 1e30]))
def test_principal_axes_diagonalise(seed: int, size: float) -> None:
    draw = np.random.default_rng(seed)
    turn = draw.normal(size=4)
    turn /= np.linalg.norm(turn)
    moments = size * draw.uniform(0.5, 1.0, 3)
    if seed % 3 == 0:
        moments[1] = moments[0]
    frame = rotated(turn, np.eye(3))  # rows: the axes
    tensor = frame.T @ np.diag(moments) @ frame
    found, axes = principal(six(0.5 * (tensor + tensor.T)))
    back = rotated(np.array(axes), np.eye(3))
    assert back.T @ np.diag(found) @ back == pytest.approx(tensor, abs=1e-14 * size)
    assert sorted(found) == pytest.approx(sorted(moments), rel=1e-13)
    assert np.linalg.norm(axes) == pytest.approx(1.0, abs=1e-15)


def test_a_diagonal_tensor_keeps_its_axes() -> None:
    assert principal((3.0, 1.0, 2.0, 0.0, 0.0, 0.0)) == ((3.0, 1.0, 2.0), (1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("moments", "why"),
    [
        ((1.0, 1.0, 2.0), ""),  # a flat body
        ((1.0, 1.0, 2.0 + 1e-6), "moment 2 kg m^2 is more than the sum of the other two, by 1e-06 kg m^2"),
        ((0.0, 1.0, 1.0), "not positive"),
        ((-1.0, 1.0, 1.0), "not positive"),
        ((math.nan, 1.0, 1.0), "not positive"),
    ],
)
def test_moments_that_no_body_has(moments: tuple[float, float, float], why: str) -> None:
    found = fault(moments)
    assert (why in found) if why else not found


def test_products_of_rotations() -> None:
    draw = np.random.default_rng(3)
    p, q = (draw.normal(size=(5, 4)) for _ in range(2))
    p, q = (a / np.linalg.norm(a, axis=1, keepdims=True) for a in (p, q))
    v = draw.normal(size=(5, 3))
    assert rotated(product(q, p), v) == pytest.approx(rotated(q, rotated(p, v)), abs=1e-14)
    assert product(q, inverse(q)) == pytest.approx(np.tile([1.0, 0, 0, 0], (5, 1)), abs=1e-15)
