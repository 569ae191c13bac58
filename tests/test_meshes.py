"""Walls of triangles: files and lists, mistakes, runs against planes and boxes, and what results have of them."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom import ScenarioError, Scene, audit
from carom.scene.assembly.triangles import Triangles
from carom.show.surfaces import sharp_edges, surfaces
from carom.show.viewer.scenery import scenery
from meshes import box, floor, globe, revolved

G = 9.8
R = 0.01


def scene(*, mu: float = 0.3, e: float = 0.5, **run: Any) -> Scene:
    made = Scene("meshes", gravity=(0, 0, -G), run={"until": 0.3, "step": 1e-3, **run})
    made.contact("sand", "steel", friction=mu, restitution=e)
    made.contact("sand", "sand", friction=mu, restitution=e)
    return made


def ball(made: Scene, at: Any, velocity: Any = (0, 0, 0), name: str = "ball") -> None:
    made.sphere(name, radius=R, density=2500, at=at, velocity=velocity, material="sand")


def write(path: Path, mesh: Any) -> Path:
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed (extra mesh)")
    trimesh.Trimesh(*mesh, process=False).export(path)
    return path


class TestGeometry:
    @pytest.mark.parametrize("seed", range(5))
    def test_distances_are_those_of_the_nearest_triangle(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        mesh = Triangles(*globe(5, 8, 0.6, seed))
        x, reach = rng.uniform(-2, 2, (60, 3)), rng.uniform(0.01, 1.0, 60)
        found, every = mesh.distance(x, reach), np.arange(len(mesh.corners))
        for point, far, value in zip(x, reach, found, strict=True):
            feet = mesh.closest(np.tile(point, (len(every), 1)), every)
            least = np.linalg.norm(feet - point, axis=1).min()
            assert value == pytest.approx(least, abs=1e-12) if least <= far else math.isinf(value)

    def test_closest_points_by_many_of_the_triangle(self) -> None:
        rng = np.random.default_rng(1)
        mesh = Triangles(rng.uniform(-1, 1, (3, 3)), np.array([[0, 1, 2]]))
        a, b = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201))
        inside = a + b <= 1
        p, q, s = mesh.at[0]
        many = p + a[inside][:, None] * (q - p) + b[inside][:, None] * (s - p)
        for x in rng.uniform(-2, 2, (50, 3)):
            foot = mesh.closest(x[None], np.array([0]))[0]
            least = np.linalg.norm(many - x, axis=1).min()
            assert np.linalg.norm(foot - x) <= least + 1e-12
            assert np.linalg.norm(foot - x) >= least - 0.02

    def test_sharp_edges_of_a_box_are_its_twelve(self) -> None:
        assert len(sharp_edges(Triangles(*box((0, 0, 0), (1, 2, 3))))) == 12
        assert len(sharp_edges(Triangles(*floor(5, seed=1)))) == 20


class TestFiles:
    @pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
    def test_a_file_is_found_beside_the_scenario_and_kept_with_the_run(
        self, ending: str, tmp_path: Path
    ) -> None:
        write(tmp_path / f"crate.{ending}", box((-100, -100, 0), (100, 100, 200)))
        made = scene()
        ball(made, (0.02, 0.03, R))
        text = (
            made.to_toml()
            + f'\n[[mesh]]\nname = "crate"\nmaterial = "steel"\nfile = "crate.{ending}"\nscale = 1e-3\n'
        )
        (tmp_path / "scene.toml").write_text(text)
        read = Scene.from_toml(tmp_path / "scene.toml")
        assert read.wall_names == ["crate"]
        carom.simulate(read, out=tmp_path / "run").close()
        (tmp_path / f"crate.{ending}").unlink()
        again = carom.resume(tmp_path / "run", until=0.4)
        assert again["ball"].position[-1, 2] == pytest.approx(R, abs=1e-9)
        wall = again.walls["crate"]
        assert wall.shape == "mesh"
        assert wall.mesh is not None
        assert wall.mesh.vertices.min(axis=0) == pytest.approx([-0.1, -0.1, 0], abs=1e-8)
        assert len(wall.mesh.corners) == 12

    def test_points_of_an_stl_file_are_joined(self, tmp_path: Path) -> None:
        path = write(tmp_path / "box.stl", box((0, 0, 0), (1, 1, 1)))
        made = scene()
        mesh = made.mesh("box", file=path, material="steel")
        assert len(mesh.resolved().vertices) == 8

    def test_turned_scaled_and_placed(self) -> None:
        points, triangles = box((0, 0, 0), (1, 2, 3))
        made = scene()
        half = math.sqrt(0.5)
        made.mesh("m", vertices=points, triangles=triangles, scale=0.1, point=(1, 0, 0),
                  orientation=(half, 0, 0, half), material="steel")  # fmt: skip
        ball(made, (2, 0, 0))
        placed = made.to_model()["meshes"][0]["vertices"]
        assert placed.min(axis=0) == pytest.approx([0.8, 0, 0])
        assert placed.max(axis=0) == pytest.approx([1.0, 0.1, 0.3])

    def test_a_resolved_scene_has_the_points_themselves(self, tmp_path: Path) -> None:
        path = write(tmp_path / "box.ply", box((0, 0, 0), (1, 1, 1)))
        made = scene()
        ball(made, (0.5, 0.5, 0.5))
        made.mesh("m", file=path, scale=0.3, point=(0.1, 0.2, 0.3), material="steel")
        again = Scene.from_toml(made.to_toml(resolved=True))
        assert 'file = "' not in again.to_toml()
        for name, value in made.to_model()["meshes"][0].items():
            assert np.array_equal(again.to_model()["meshes"][0][name], value)


def test_bad_meshes_are_named_with_their_cure(tmp_path: Path) -> None:
    points, triangles = box((0, 0, 0), (1, 1, 1))
    text = tmp_path / "text.stl"
    text.write_text("no mesh")
    flat = np.append(triangles, [[0, 1, 1]], axis=0)
    holed = points.copy()
    holed[3] = np.nan
    cases: list[tuple[dict[str, Any], str]] = [
        ({}, "neither file nor vertices is given"),
        ({"file": "a.stl", "vertices": points, "triangles": triangles}, "both file and vertices are given"),
        ({"vertices": points}, "vertices are given without triangles"),
        ({"file": tmp_path / "none.stl"}, "there is no file"),
        ({"file": tmp_path}, "is no file"),
        (
            {"vertices": points, "triangles": flat},
            "triangles 12 (counted from 0) have their corners on one line",
        ),
        ({"vertices": points, "triangles": triangles + 1}, "name points that are not there"),
        ({"vertices": holed, "triangles": triangles}, "points 3 (counted from 0) are not finite"),
        ({"vertices": points[:, :2], "triangles": triangles}, "expected rows of three numbers"),
        ({"vertices": points, "triangles": triangles + 0.5}, "expected rows of three whole numbers"),
        ({"vertices": points, "triangles": triangles, "scale": 0}, "must be positive"),
    ]
    for given, message in cases:
        with pytest.raises(ScenarioError) as caught:
            scene().mesh("m", material="steel", **given)
        assert message in str(caught.value), given
    pytest.importorskip("trimesh", reason="trimesh is not installed (extra mesh)")
    with pytest.raises(ScenarioError) as caught:
        scene().mesh("m", material="steel", file=text)
    assert "text.stl" in str(caught.value)
    made = scene()
    made.mesh("m", material="steel", vertices=points, triangles=flat, clean=True)
    ball(made, (0.5, 0.5, 0.5))
    assert len(made.to_model()["meshes"][0]["triangles"]) == 12


def test_a_ball_in_a_mesh_is_refused_before_the_run() -> None:
    made = scene()
    made.mesh(
        "crate",
        vertices=box((0, 0, 0), (1, 1, 1))[0],
        triangles=box((0, 0, 0), (1, 1, 1))[1],
        material="steel",
    )
    ball(made, (0.5, 0.5, 0.4 * R))
    with pytest.raises(ScenarioError, match=r'0.006 m into mesh "crate"; move it by 0.006 m away'):
        carom.simulate(made)


def test_methods_that_know_no_meshes_say_so() -> None:
    for method in ("penalty", "events"):
        made = scene(method=method)
        points, triangles = floor(2, seed=1)
        made.mesh("floor", vertices=points, triangles=triangles, material="steel")
        ball(made, (0.5, 0.5, 2 * R))
        with pytest.raises(carom.CaromError, match=r"knows? no meshes|does not know meshes"):
            carom.simulate(made)


class TestRuns:
    def test_a_flat_mesh_is_a_plane(self) -> None:
        """A ball that slides, rolls, spins and bounces over 800 triangles, and on a plane."""
        found = []
        for flat in (True, False):
            made = scene(mu=0.2, e=0.8)
            ball(made, (-0.3, 0.05, 3 * R), (1.5, -0.3, -0.5))
            if flat:
                made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
            else:
                points, triangles = floor(20, seed=3)
                made.mesh("floor", vertices=points - [0.5, 0.5, 0], triangles=triangles, material="steel")
            found.append(carom.simulate(made, until=0.5))
        for name in ("position", "velocity", "angular_velocity", "orientation"):
            a, b = (np.asarray(getattr(r, name)) for r in found)
            assert b == pytest.approx(a, abs=1e-11), name

    def test_a_box_of_triangles_bears_what_a_box_bears(self, tmp_path: Path) -> None:
        low, high = (-0.05, -0.05, 0.0), (0.05, 0.05, 0.2)
        forces, places = [], []
        for planes in (True, False):
            made = scene()
            for k in range(6):
                ball(
                    made,
                    (0.03 * (k % 3 - 1), 0.02 * (k % 2) - 0.01, 0.02 + 0.03 * (k // 3)),
                    (0.3, 0.1 * k, 0),
                    f"b{k}",
                )
            if planes:
                made.box("crate", low=low, high=high, material="steel")
            else:
                points, triangles = box(low, high)
                made.mesh("crate", vertices=points, triangles=triangles, material="steel")
            result = carom.simulate(made, until=1.0, walls=True, out=tmp_path / str(planes))
            forces.append(sum(wall.force[-1] for wall in result.walls.values()))
            places.append(np.asarray(result.position[20]))
        assert places[1] == pytest.approx(places[0], abs=1e-10)
        weight = 6 * 2500 * 4 / 3 * math.pi * R**3 * G
        assert forces[1] == pytest.approx([0, 0, -weight], abs=1e-6 * weight)
        assert audit.check(tmp_path / "False").ok

    def test_a_drum_of_many_sides_is_nearly_a_drum(self) -> None:
        """A ball that slides without friction in a trough; what it loses at the edges goes down with their number."""
        radius, half = 0.1, math.sqrt(0.5)
        found = {}
        for sides in (0, 16, 64, 256):
            made = scene(mu=0.0, e=0.0)
            ball(made, ((radius - R) * math.sin(0.3), 0, -(radius - R) * math.cos(0.3)))
            if not sides:
                made.cylinder("trough", point=(0, 0, 0), axis=(0, 1, 0), radius=radius, material="steel")
            else:  # around the circle, turned from z to y
                wide = radius / math.cos(math.pi / sides)
                points, triangles = revolved([(wide, -1.0), (wide, 1.0)], sides)
                turn = (half, half, 0, 0)
                made.mesh("trough", vertices=points, triangles=triangles, orientation=turn, material="steel")
            found[sides] = np.asarray(carom.simulate(made, until=0.1, step=2e-4)["ball"].position)
        off = [float(np.abs(found[0] - found[sides]).max()) for sides in (16, 64, 256)]
        assert off[0] > 10 * off[1], off
        assert off[1] > 2 * off[2], off
        assert off[2] < 0.002 * radius, off

    def test_what_results_have_of_a_mesh(self, tmp_path: Path) -> None:
        made = scene()
        points, triangles = box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1))
        made.plane("far", point=(0, 0, -1), normal=(0, 0, 1), material="steel")
        turn = {"rotation": {"axis": (0, 0, 1), "rate": 2.0}}
        made.mesh("crate", vertices=points, triangles=triangles, material="steel", motion=turn)
        ball(made, (0.01, 0.02, R))
        result = carom.simulate(made, until=0.1, out=tmp_path / "run")
        assert list(result.walls) == ["far", "crate"]
        assert set(np.asarray(result.contacts["body"])[:, 1]) == {2}
        part = np.asarray(result.contacts["part"])
        assert set(part % 7) == {0}
        assert set(triangles[part // 7][:, 0]) <= {0}  # of the floor of the box
        assert result.walls["crate"].gap(
            np.array([[0, 0, 0.03]]), np.array([0.025]), np.array([0.0])
        ) == pytest.approx([0.005])
        with h5py.File(tmp_path / "run" / "results.h5") as file:
            assert file["walls/shape"].asstr()[:].tolist() == ["mesh"]
            assert file["mesh_triangles/corners"][:].tolist() == triangles.tolist()
            assert file["mesh_points/wall"][:].tolist() == [1] * 8
        assert audit.check(tmp_path / "run").ok

    def test_films_and_exports_get_its_triangles(self) -> None:
        made = scene()
        points, triangles = globe(4, 6, 0.3, 1)
        made.mesh(
            "lump", vertices=points, triangles=triangles, scale=0.1, point=(0.2, 0, 0), material="steel"
        )
        ball(made, (0.2, 0.0, 0.15))
        result = carom.simulate(made, until=0.01)
        (drawn,) = surfaces(list(result.walls.values()), np.zeros(3), np.ones(3), np.array([0, 0, 1.0]))
        placed = drawn.placed(np.array([0.2, 0, 0]), np.array([1.0, 0, 0, 0]))
        assert placed == pytest.approx(0.1 * points + [0.2, 0, 0])
        assert drawn.faces.tolist() == triangles.tolist()
        (facts,) = scenery(result, np.array([0])).walls
        assert np.reshape(facts["vertices"], (-1, 3)) == pytest.approx(0.1 * points, abs=1e-8)
        assert np.reshape(facts["triangles"], (-1, 3)).tolist() == triangles.tolist()

    @pytest.mark.parametrize(
        ("name", "row", "value"), [("corners", 3, 99), ("wall", 5, 7), ("corners", 0, -1)]
    )
    def test_damaged_triangles_are_said_to_be_so(
        self, name: str, row: int, value: int, tmp_path: Path
    ) -> None:
        made = scene()
        points, triangles = box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1))
        made.mesh("crate", vertices=points, triangles=triangles, material="steel")
        ball(made, (0.01, 0.02, R))
        carom.simulate(made, until=0.02, out=tmp_path / "run").close()
        with h5py.File(tmp_path / "run" / "results.h5", "r+") as file:
            table = file[f"mesh_triangles/{name}"]
            table[row] = value
        with pytest.raises(carom.CaromError, match="mesh_triangles"):
            _ = carom.load(tmp_path / "run").walls

    def test_a_planted_part_is_found(self, tmp_path: Path) -> None:
        """The auditor knows which plane a contact has: that of another triangle is none."""
        made = scene()
        points, triangles = box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1))
        made.mesh("crate", vertices=points, triangles=triangles, material="steel")
        ball(made, (0.01, 0.02, R))
        carom.simulate(made, until=0.05, out=tmp_path / "run").close()
        with h5py.File(tmp_path / "run" / "results.h5", "r+") as file:
            part = file["contacts/part"]
            part[...] = (part[:] + 7 * 4) % (7 * 12)
        assert not audit.check(tmp_path / "run").ok


class TestPlacesOfFiles:
    """A scene keeps the points that it has read, and names files as they are found from where it is written."""

    def made(self, folder: Path, z: float = 0.0) -> Path:
        """A scenario beside the mesh that it names."""
        folder.mkdir(parents=True, exist_ok=True)
        points, triangles = floor(2, seed=1)
        write(folder / "floor.stl", (points + np.array([0, 0, z]), triangles))
        made = scene(until=0.02)
        ball(made, (0.5, 0.5, 0.02))
        text = made.to_toml() + '\n[[mesh]]\nname = "floor"\nmaterial = "steel"\nfile = "floor.stl"\n'
        (folder / "scene.toml").write_text(text)
        return folder / "scene.toml"

    def test_a_run_records_the_mesh_that_it_simulated(self, tmp_path: Path) -> None:
        read = Scene.from_toml(self.made(tmp_path))
        first = carom.simulate(read)
        self.made(tmp_path, z=-1.0)  # the file is edited meanwhile
        result = carom.simulate(read)
        again = carom.simulate(result.scene)
        assert np.array_equal(result.position, first.position)
        assert np.array_equal(result.position, again.position)
        assert read != Scene.from_toml(tmp_path / "scene.toml")

    def test_the_file_is_not_needed_once_it_is_read(self, tmp_path: Path) -> None:
        path = self.made(tmp_path)
        read, there = Scene.from_toml(path), Scene.from_toml(path).resolved()
        (tmp_path / "floor.stl").unlink()
        read.validate()
        assert read.resolved() == there
        read._tree.mesh[0].point = (0.0, 0.0, -0.5)
        assert read.to_model()["meshes"][0]["vertices"][:, 2] == pytest.approx(-0.5, abs=1e-15)
        with pytest.raises(ScenarioError, match="there is no file"):
            read._tree.mesh[0].file = str(tmp_path / "other.stl")

    def test_a_folder_can_be_moved_with_what_was_written_into_it(self, tmp_path: Path) -> None:
        read = Scene.from_toml(self.made(tmp_path / "a"))
        (tmp_path / "a" / "b").mkdir()
        read.to_toml(tmp_path / "a" / "copy.toml")
        read.to_toml(tmp_path / "a" / "b" / "copy.toml")
        (tmp_path / "a").rename(tmp_path / "c")
        for copy in ("copy.toml", "b/copy.toml"):
            assert Scene.from_toml(tmp_path / "c" / copy) == read
        assert 'file = "../floor.stl"' in (tmp_path / "c" / "b" / "copy.toml").read_text()

    def test_without_a_place_of_its_own_a_text_names_files_from_the_root_on(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.made(tmp_path / "a")
        (tmp_path / "b").mkdir()
        monkeypatch.chdir(tmp_path / "b")
        made = scene(until=0.02)
        ball(made, (0.5, 0.5, 0.02))
        made.mesh("floor", file="../a/floor.stl", material="steel")
        file = tomllib.loads(made.to_toml())["mesh"][0]["file"]
        assert file == str((tmp_path / "a" / "floor.stl").resolve())
        made.to_toml("scene.toml")
        assert 'file = "../a/floor.stl"' in (tmp_path / "b" / "scene.toml").read_text()

    def test_scenes_of_the_same_content_in_two_folders_are_equal(self, tmp_path: Path) -> None:
        one, two, other = (
            Scene.from_toml(self.made(tmp_path / n, z)) for n, z in (("a", 0), ("b", 0), ("c", -1))
        )
        assert one == two == one.resolved()
        assert one != other
