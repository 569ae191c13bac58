"""Advice on walls that turn: those that sweep through more than half a radius in a step, and no others."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest

from tests.meshes import revolved

FAST = {"rate": "3000 rpm"}
BLADE = [[0, 0, 0.001], [0.06, 0, 0.001], [0.06, 0, 0.02], [0, 0, 0.02]]


def told(kind: str, law: dict[str, Any], **wall: Any) -> list[str]:
    scene = carom.Scene("turning", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    scene.sphere("ball", material="m", radius=0.003, density=2500, position=(0.5, 0.5, 0.5))
    turn = {"rotation": {"axis": (0, 0, 1), "point": (0, 0, 0), **law}}
    getattr(scene, kind)("wall", material="m", motion=turn, **wall)
    scene.contact("m", "m", friction=0.4, restitution=0.3)
    return [str(advice) for advice in scene.validate() if "smallest ball" in str(advice)]


@pytest.mark.parametrize(
    ("law", "radii"),
    [
        (FAST, "6.3"),
        ({"angle": {"polynomial": [0, 314.159]}}, "6.3"),
        ({"angle": {"table": [[0, 0], [0.05, 0], [0.0508, 0.6]]}}, "12"),
        ({"rate": "200 rpm"}, None),
    ],
)
def test_a_blade_that_sweeps_far_in_a_step(law: dict[str, Any], radii: str | None) -> None:
    mesh = told("mesh", law, vertices=BLADE, triangles=[[0, 1, 2], [0, 2, 3]])
    plane = told("plane", law, point=(0.03, 0, 0.0105), normal=(0, 1, 0), size=(0.06, 0.019), side=(1, 0, 0))
    for advice in (mesh, plane):
        assert [f"by {radii} radii" in line for line in advice] == [True] * (radii is not None)


def test_what_turns_into_itself_sweeps_nothing() -> None:
    points, triangles = revolved([(0.1, 0.0), (0.1, 0.05)], 96)
    assert told("mesh", {"rate": 50}, vertices=points, triangles=triangles) == []
    assert told("plane", FAST, point=(0, 0, 0), normal=(0, 0, 1), radius=0.1) == []
    assert told("cylinder", FAST, point=(0, 0, 0), axis=(0, 0, 1), radius=0.1, length=0.2) == []
    assert told("cone", FAST, point=(0, 0, 0), axis=(0, 0, 1), radius=0.1, radius_end=0.05, length=0.2) == []
    assert told("plane", FAST, point=(0, 0, 0), normal=(1, 0, 0)) == []  # no end, no largest distance


@pytest.mark.parametrize(
    ("kind", "wall", "way"),
    [
        ("plane", {"point": (0.02, 0, 0), "normal": (0, 0, 1), "size": (0.04, 0.02)}, 0.04),  # its edges
        ("plane", {"point": (0.02, 0, 0), "normal": (0, 1, 0), "radius": 0.01}, 0.03),
        ("cylinder", {"point": (0.1, 0, 0), "axis": (0, 0, 1), "radius": 0.02, "inside": False}, 0.1),
        ("ball_wall", {"point": (0.1, 0, 0), "radius": 0.02, "inside": False}, 0.1),
        (
            "box",
            {"low": (-0.02, -0.01, 0), "high": (0.02, 0.01, 9), "finite": True, "open": ["high_z"]},
            0.02236,
        ),
    ],
)
def test_each_shape_by_its_farthest_part(kind: str, wall: dict[str, Any], way: float) -> None:
    [line] = told(kind, FAST, **wall)
    assert f"by {way * 2 * np.pi * 50 * 1e-3 / 0.003:.2g} radii" in line


@pytest.mark.parametrize(
    ("normal", "speed", "axis", "radii"),
    [
        ((0, 0, 1), (100, 0, 0), None, 0.0),
        ((0, 0, 1), (100, 50, 20), None, 1.0),
        ((1, 0, 1), (100, 0, 0), None, 5.0 / np.sqrt(2.0)),
        ((0, 0, 1), (100, 0, 0), (0, 0, 1), 0.0),
        ((0, 0, 1), (100, 0, 0), (0, 1, 0), 5.0),
    ],
)
def test_a_plane_that_slides_within_itself_passes_nothing(
    normal: tuple[float, float, float],
    speed: tuple[float, float, float],
    axis: tuple[float, float, float] | None,
    radii: float,
) -> None:
    """What counts is the part along the normal, which turns with the plane."""
    turn = {} if axis is None else {"rotation": {"axis": axis, "rate": 20.0}}
    motion = {"translation": [{"polynomial": [0, v]} for v in speed], **turn}
    scene = carom.Scene("floor", run={"step": 1e-3, "until": 0.3})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    scene.sphere("ball", radius=0.02, mass=0.1, at=(0, 0, 0.2), material="m")
    scene.plane("floor", point=(0, 0, 0), normal=normal, material="m", motion=motion)
    told = [advice.cause for advice in scene.validate() if "radii" in advice.cause]
    assert told == (
        [f'a step of 0.001 s moves plane "floor" by {radii:.2g} radii of the smallest ball'] if radii else []
    )


@pytest.mark.parametrize(
    ("speed", "length", "told"), [((9, 0, 0), None, 0), ((9, 0, 0), 3, 1), ((0, 0, 20), None, 1)]
)
def test_a_tube_without_end_slides_along_its_axis(
    speed: tuple[float, float, float], length: float | None, told: int
) -> None:
    motion = {"translation": [{"polynomial": [0, 5 * v]} for v in speed]}
    scene = carom.Scene("tube", run={"step": 1e-3, "until": 0.3})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    scene.sphere("ball", radius=0.02, mass=0.1, at=(0, 0, 0), material="m")
    end = {} if length is None else {"length": length}
    scene.cylinder(
        "tube", point=(0, 0, 0), axis=(1, 0, 0), radius=1, inside=True, material="m", motion=motion, **end
    )
    assert len([advice for advice in scene.validate() if "radii" in advice.cause]) == told
