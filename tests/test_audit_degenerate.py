"""Walls at places without a nearest point of their own: axes, centres, rims, edges, corners. The core knows them too."""

from __future__ import annotations

import math
from typing import Any

import carom
import numpy as np
import pytest
from carom.audit.surfaces import Surface

AXIS = np.array([0.48, -0.6, 0.64])
ACROSS = np.array([0.8, 0.6, -0.0375]) / np.linalg.norm([0.8, 0.6, -0.0375])
SHAPES: dict[str, tuple[str, tuple[Any, ...], dict[str, Any]]] = {
    "tube": ("cylinder", (AXIS, 0.03, 0.1, True), {"axis": AXIS, "radius": 0.03, "length": 0.1}),
    "pipe": ("cylinder", (AXIS, 0.03, math.inf, True), {"axis": AXIS, "radius": 0.03}),
    "cone": (
        "cone",
        (AXIS, 0.03, 0.01, 0.1, True),
        {"axis": AXIS, "radius": 0.03, "radius_end": 0.01, "length": 0.1},
    ),
    "tip": (
        "cone",
        (AXIS, 0.03, 0.0, 0.1, True),
        {"axis": AXIS, "radius": 0.03, "radius_end": 0.0, "length": 0.1},
    ),
    "ring": ("disc", (AXIS, 0.03, 0.02), {"normal": AXIS, "radius": 0.03, "hole": 0.02}),
    "disc": ("disc", (AXIS, 0.03, 0.0), {"normal": AXIS, "radius": 0.03}),
    "ball_wall": ("sphere", (0.03, True), {"radius": 0.03}),
}
#: Along the axis: within, at the ends and beyond them.
ALONG = (-0.2, -0.06, -0.05, -0.02, 0.0, 0.01, 0.05, 0.07, 0.1, 0.13)
KEY = {
    "tube": "cylinder",
    "pipe": "cylinder",
    "cone": "cone",
    "tip": "cone",
    "ring": "plane",
    "disc": "plane",
}


def surface(name: str) -> Surface:
    kind, numbers, _ = SHAPES[name]
    return Surface((kind, *numbers), np.zeros(3), 0, None)


def gap(wall: Surface, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return wall.meet(np.zeros(len(x)), x, np.full(len(x), 0.001))


@pytest.mark.parametrize("name", SHAPES)
def test_gaps_on_an_axis_are_the_limits_of_those_beside_it(name: str) -> None:
    wall, on = surface(name), np.outer(ALONG, AXIS)
    found, normal = gap(wall, on)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-14)
    for way in (ACROSS, -ACROSS, np.cross(AXIS, ACROSS), AXIS):
        near, beside = gap(wall, on + 1e-9 * way)
        np.testing.assert_allclose(near, found, atol=1.001e-9)
        np.testing.assert_allclose(np.linalg.norm(beside, axis=1), 1.0, rtol=1e-14)


def test_centres_on_rims_edges_and_corners_have_a_normal() -> None:
    for name, radius, height in (
        ("tube", 0.03, 0.05),
        ("cone", 0.03, 0.0),
        ("cone", 0.01, 0.1),
        ("ring", 0.02, 0.0),
    ):
        found, normal = gap(surface(name), (radius * ACROSS + height * AXIS)[None])
        assert found[0] == pytest.approx(-0.001, abs=1e-16)
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-14)
    plate = Surface(("rectangle", AXIS, ACROSS, (0.04, 0.02)), np.zeros(3), 0, None)
    for p, q in ((0.02, 0.01), (0.02, 0.0), (0.0, 0.01), (0.0, 0.0)):
        found, normal = gap(plate, (p * ACROSS + q * np.cross(AXIS, ACROSS))[None])
        assert found[0] == pytest.approx(-0.001, abs=1e-16)
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize("name", SHAPES)
def test_the_core_and_the_auditor_agree_on_balls_on_an_axis(name: str) -> None:
    """Balls that just do or do not come near: the auditor counts the pairs that the core has looked at."""
    for along in ALONG:
        distance = float(gap(surface(name), (along * AXIS)[None])[0][0]) + 0.001
        for share in (0.992, 1.0 / 1.02):
            radius = min(share * distance, 0.05)
            if radius < 1e-6:
                continue
            scene = carom.Scene("axis", gravity=(0, 0, 0), run={"until": 2e-3, "step": 1e-3})
            scene.contact("m", "m", friction=0.3, restitution=0.5)
            scene.sphere(
                "ball",
                material="m",
                radius=radius,
                density=2500,
                at=along * AXIS,
                velocity=0.01 * radius * AXIS,
            )
            wall = KEY.get(name, name)
            given = dict(SHAPES[name][2])
            getattr(scene, wall)("wall", material="m", point=(0, 0, 0), **given)
            report = carom.audit.check(carom.simulate(scene, every=1))
            assert report.ok, (along, share, report.findings)
            assert report["counts"].judged
