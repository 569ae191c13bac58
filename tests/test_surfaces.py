"""Walls as triangles: their place, size and side, where they are cut, and how they move."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest
from carom.result.record.walls import PARAMETERS
from carom.show.surfaces import Surface, surfaces, wall_mesh
from carom.show.viewer.scenery import scenery
from meshes import box, globe, revolved

LOW, HIGH = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 1.0])
UP = np.array([0.0, 0.0, 9.8])


def area_vectors(vertices: Any, faces: Any) -> Any:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def walls_of(fill: Any, *, until: float = 0.002) -> list[Any]:
    scene = carom.Scene("walls", run={"until": until, "step": 1e-3}, gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.sphere("ball", radius=0.01, mass=0.1, material="m", at=(0.3, 0.4, 0.5))
    fill(scene)
    return list(carom.simulate(scene).walls.values())


AREAS: list[tuple[str, dict[str, Any], float]] = [
    ("rectangle", {"axis": [0, 0, 1], "side": [1, 0, 0], "size": [2.0, 3.0]}, 6.0),
    ("disc", {"axis": [0, 1, 0], "radius": 2.0, "hole": 1.0}, 3 * np.pi),
    ("cylinder", {"axis": [0, 0, 1], "radius": 0.5, "length": 2.0}, 2 * np.pi),
    ("cone", {"axis": [0, 0, 1], "radius": 3.0, "radius_end": 0.0, "length": 4.0}, 15 * np.pi),
    ("sphere", {"radius": 1.0}, 4 * np.pi),
]


def test_every_shape_is_drawn() -> None:
    assert {shape for shape, _, _ in AREAS} == set(PARAMETERS) - {"mesh"}  # which brings its triangles


@pytest.mark.parametrize(("shape", "facts", "area"), AREAS)
def test_walls_have_the_area_of_their_shape(shape: str, facts: dict[str, Any], area: float) -> None:
    vertices, faces = wall_mesh(shape, {"point": [0.2, 0.0, 0.0], **facts}, LOW, HIGH)
    found = np.linalg.norm(area_vectors(vertices, faces), axis=1).sum()
    assert found == pytest.approx(area, rel=0.01)


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize(
    ("shape", "facts"),
    [
        ("cylinder", {"axis": [0, 1, 0], "radius": 0.5, "length": 2.0}),
        ("cone", {"axis": [0, 0, 1], "radius": 3.0, "radius_end": 1.0, "length": 4.0}),
        ("sphere", {"radius": 1.0}),
    ],
)
def test_triangles_look_to_where_the_balls_live(shape: str, facts: dict[str, Any], inside: bool) -> None:
    vertices, faces = wall_mesh(shape, {"point": [0.0, 0.0, 0.0], "inside": inside, **facts}, LOW, HIGH)
    middle = vertices[faces].mean(axis=1)
    axis = np.array(facts.get("axis", (0, 0, 0)), dtype=float)
    out = middle - np.outer(middle @ axis, axis)  # away from the axis, or the centre
    along = np.sum(area_vectors(vertices, faces) * out, axis=1)
    assert (along <= 0).all() if inside else (along >= 0).all()
    assert np.abs(along).max() > 0


@pytest.mark.parametrize(
    "facts",
    [
        {"axis": [0, 0, 1], "radius": 1.0, "hole": 0.2},
        {"axis": [0, 0.6, 0.8], "radius": 1.0, "hole": 0.0},
        {"axis": [0, 0.6, 0.8], "side": [1, 0, 0], "size": [2.0, 3.0]},
    ],
)
def test_flat_walls_look_along_their_normal(facts: dict[str, Any]) -> None:
    shape = "disc" if "radius" in facts else "rectangle"
    vertices, faces = wall_mesh(shape, {"point": [0.0, 0.0, 0.0], **facts}, LOW, HIGH)
    assert (area_vectors(vertices, faces) @ np.array(facts["axis"]) >= -1e-12).all()


def test_a_plane_lies_under_the_balls_and_looks_along_its_normal() -> None:
    normal = np.array([0.0, 0.6, 0.8])
    vertices, faces = wall_mesh("plane", {"point": [5.0, 0.0, 0.0], "normal": normal}, LOW, HIGH)
    assert np.abs(vertices @ normal).max() < 1e-12
    assert (area_vectors(vertices, faces) @ normal > 0).all()
    assert np.linalg.norm(vertices.mean(axis=0)[0] + 5.0) < 1e-9  # though its point is far away


def placed(found: list[Surface]) -> Any:
    """All triangles of walls at rest, (F, 3, 3)."""
    return np.concatenate([(s.vertices + np.asarray(s.wall.facts["point"]))[s.faces] for s in found])


def test_six_planes_without_end_are_cut_to_the_room_they_enclose() -> None:
    walls = walls_of(lambda scene: scene.box("room", low=(0, 0, 0), high=(1, 2, 3), material="m"))
    found = surfaces(walls, np.array([0.3, 0.4, 0.5]), np.array([0.9, 1.8, 2.0]), UP)
    triangles = placed(found)
    vectors = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(2 * (2 + 3 + 6))
    assert np.abs(vectors.sum(axis=0)).max() < 1e-12  # closed
    assert np.sum(triangles.mean(axis=1) * vectors) / 3 == pytest.approx(-6.0)  # its volume, seen from inside


def test_a_wedge_is_cut_along_its_edge() -> None:
    def fill(scene: Any) -> None:
        scene.plane("left", point=(0, 0, 0), normal=(1, 0, 1), material="m")
        scene.plane("right", point=(0, 0, 0), normal=(-1, 0, 2), material="m")

    found = surfaces(walls_of(fill), np.array([-1.0, -1, 0.1]), np.array([1.0, 1, 1]), UP)
    corners = placed(found).reshape(-1, 3)
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-12)  # nothing reaches below the edge


def test_a_tube_without_end_reaches_past_the_balls_and_not_past_a_period() -> None:
    walls = walls_of(
        lambda scene: scene.cylinder("tube", point=(0, 0, 0), axis=(0, 1, 0), radius=2, material="m")
    )
    [open_] = surfaces(walls, LOW, HIGH, UP)
    assert open_.vertices[:, 1].min() < -1
    [closed] = surfaces(walls, LOW, HIGH, UP, (False, True, False))
    assert (closed.vertices[:, 1].min(), closed.vertices[:, 1].max()) == pytest.approx((-1, 1))


def test_moved_triangles_are_where_the_law_puts_the_wall() -> None:
    motion = {"rotation": {"axis": (0, 0, 1), "rate": 3.0}, "translation": [0, 0, {"expression": "0.1*t"}]}
    walls = walls_of(
        lambda scene: scene.plane(
            "plate", point=(1, 0, 0), normal=(0, 0, 1), size=(0.2, 0.1), material="m", motion=motion
        )
    )
    [surface] = surfaces(walls, LOW, HIGH, UP)
    time = np.array([0.7])
    wall = surface.wall
    found = surface.placed(
        wall.motion.position(np.array([1.0, 0, 0]), time)[0], wall.motion.orientation(time)[0]
    )
    angle = 2.1
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    corners = np.array([[-0.1, -0.05, 0], [0.1, -0.05, 0], [0.1, 0.05, 0], [-0.1, 0.05, 0]])
    assert found == pytest.approx(corners @ turn.T + [1, 0, 0.07], abs=1e-12)


def test_lines_follow_outlines() -> None:
    def fill(scene: Any) -> None:
        scene.plane("plate", point=(0, 0, 0), normal=(0, 0, 1), size=(2, 3), material="m")
        scene.plane("disc", point=(0, 0, -1), normal=(0, 0, 1), radius=1, hole=0.5, material="m")

    plate, disc = surfaces(walls_of(fill), LOW, HIGH, UP)
    lengths = [
        np.linalg.norm(np.diff(s.vertices[s.lines], axis=1)[:, 0], axis=1).sum() for s in (plate, disc)
    ]
    assert lengths[0] == pytest.approx(10)
    assert lengths[1] == pytest.approx(
        2 * np.pi * 1.5 + 12 * 0.5, rel=1e-3
    )  # both rims, and twelve lines across


@pytest.mark.parametrize("winding", ["outwards", "inwards", "mixed"])
def test_triangles_of_meshes_face_the_balls(winding: str) -> None:
    """A crate with balls in it, a lump in the crate, and an open drum that turns; files may have any winding."""

    def wound(mesh: Any) -> Any:
        points, triangles = mesh
        turned = {"outwards": np.zeros(len(triangles)), "inwards": np.ones(len(triangles)),
                  "mixed": np.random.default_rng(1).integers(0, 2, len(triangles))}[winding]  # fmt: skip
        return {"vertices": points, "triangles": np.where(turned[:, None] > 0, triangles[:, ::-1], triangles)}

    def fill(scene: carom.Scene) -> None:
        turn = {"rotation": {"axis": (0, 0, 1), "rate": 3.0, "point": (0.25, 0.4, 0.5)}}
        scene.mesh("crate", **wound(box((0, 0, 0), (1, 1, 1))), material="m")
        scene.mesh("lump", **wound(globe(4, 7, 0.3, 2)), scale=0.1, point=(0.7, 0.4, 0.5), material="m")
        scene.mesh("drum", **wound(revolved([(0.1, 0.45), (0.15, 0.6)], 24)), point=(0.25, 0.4, 0),
                   material="m", motion=turn)  # fmt: skip

    walls = walls_of(fill)
    for surface, page in zip(
        surfaces(walls, LOW, HIGH, UP), scenery(walls[0]._result, np.zeros(1, int)).walls, strict=True
    ):
        middle = surface.vertices.mean(axis=0) - surface.vertices[surface.faces].mean(axis=1)
        inwards = np.sum(area_vectors(surface.vertices, surface.faces) * middle, axis=1) > 0
        assert (inwards == (surface.wall.name != "lump")).all()
        assert page["triangles"] == surface.faces.ravel().tolist()


def test_a_plate_faces_the_side_on_which_the_balls_are() -> None:
    def fill(scene: carom.Scene) -> None:
        points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        for name, z in (("below", 0.4), ("above", 0.6)):
            scene.mesh(name, vertices=points, triangles=[[0, 1, 2], [0, 3, 2]], point=(0, 0, z), material="m")

    for surface in surfaces(walls_of(fill), LOW, HIGH, UP):
        up = area_vectors(surface.vertices, surface.faces)[:, 2]
        assert (up > 0).all() if surface.wall.name == "below" else (up < 0).all()
