"""Where balls touch meshes: once for each local minimum of their distance, as the core has it."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import Scene, audit, granular
from carom.scene.assembly.triangles import Triangles
from carom.show.plot.contact import strips
from meshes import box, globe

R = 0.005
CRATE = box((-0.03, -0.03, -0.03), (0.03, 0.03, 0.03))
LOW = -0.03 + R


def run(
    mesh: Any,
    at: Any,
    velocity: Any = (0, 0, 0),
    *,
    gravity: Any = (0, 0, -9.8),
    e: float = 0,
    **options: Any,
) -> Any:
    made = Scene("crate", gravity=gravity, run={"until": 0.05})
    made.contact("sand", "steel", friction=0, restitution=e)
    made.sphere("ball", radius=R, mass=1e-3, material="sand", position=at, velocity=velocity)
    made.mesh("crate", vertices=mesh[0], triangles=mesh[1], material="steel")
    return carom.simulate(made, **options)


@pytest.mark.parametrize(
    ("at", "touched"), [((LOW, LOW, LOW), 3), ((LOW, 0, LOW), 2), ((0, 0, LOW), 1), ((0.01, 0, LOW), 1)]
)
def test_a_ball_in_a_corner_has_three_contacts_by_gap_and_by_force(at: Any, touched: int) -> None:
    result = run(CRATE, at, gravity=[-9.8 * (x == LOW) for x in at])
    assert granular.coordination(result, gap=1e-6, least=0).per_ball.tolist() == [touched]
    assert granular.coordination(result, least=0).per_ball.tolist() == [touched]


@pytest.mark.parametrize("seed", range(4))
def test_minima_of_the_distance_are_where_no_place_near_by_is_nearer(seed: int) -> None:
    """Against places of the surface around; and the nearest place of all is a minimum."""
    rng = np.random.default_rng(seed)
    mesh = Triangles(*globe(4, 7, 0.6, seed))
    every = np.arange(len(mesh.corners))
    x = rng.uniform(-1.5, 1.5, (80, 3))
    point, part, foot = mesh.minima(x, np.full(len(x), 1.0))
    assert (np.diff(point) >= 0).all()
    assert len(np.unique(part % 7)) > 3
    for k, place in zip(point, foot, strict=True):
        for off in rng.normal(0, 1e-6, (10, 3)):
            around = mesh.closest(np.tile(place + off, (len(every), 1)), every)
            around = around[np.linalg.norm(around - place, axis=1) < 1e-5]
            assert np.linalg.norm(around - x[k], axis=1).min() > np.linalg.norm(place - x[k]) * (1 - 1e-12)
    away = np.linalg.norm(x[point] - foot, axis=1)
    for k in range(len(x)):
        nearest = pytest.approx(mesh.distance(x[k : k + 1], np.ones(1))[0], rel=1e-12)
        assert away[point == k].min(initial=np.inf) == nearest
    np.testing.assert_allclose(mesh.at_part(x[point], part, np.ones(len(point))), away, rtol=1e-12)


def test_a_face_that_a_ball_has_left_is_open_while_it_lies_on_another(tmp_path: Path) -> None:
    """It lies on the floor and has bounced off a side since the frame before."""
    result = run(CRATE, (0.023, 0, LOW), (0.1, 0, 0), e=0.8, every=50)
    assert granular.coordination(result, least=0).per_ball.tolist() == [1]
    result.export(tmp_path, "csv")
    rows = list(csv.DictReader((tmp_path / "contacts.csv").open()))
    assert {float(row["normal_z"]): int(row["closed"]) for row in rows} == {1: 1, 0: 0}


def test_a_plot_has_one_strip_of_a_ball_in_a_corner() -> None:
    """Of whose three contacts each frame has a row."""
    result = run(CRATE, (LOW, LOW, LOW), gravity=(-9.8, -9.8, -9.8), every=5)
    (strip,), pairs = strips(result)
    assert (pairs, strip.pair) == (1, ("ball", "crate"))


def test_parts_are_counted_where_bodies_fall(tmp_path: Path) -> None:
    """A ball lies on the level plate of a floor with a bend of 5 degrees, so that it meets the other one where it lies and,
    as the smooth motion lowers it, no more.
    """
    bend, step = np.radians(5), 1e-2
    line = np.array([[-1.0, 0], [0, 0], [np.cos(bend), np.sin(bend)]])
    points = np.concatenate([np.c_[line[:, 0], np.full(3, y), line[:, 1]] for y in (-1.0, 1.0)])
    triangles = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    lowered = 0.5 * 9.8 * step**2 * np.sin(bend)
    at = ((0.5 * lowered - R * np.sin(bend)) / np.cos(bend), 0.1, R)
    run((points, triangles), at, out=tmp_path / "run", every=1, step=step)
    report = audit.check(tmp_path / "run")
    assert report.ok, repr(report)
