"""Films and pictures: what is where at which time, and, where VTK is installed, what the pictures show."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.cli.app import app
from carom.export.frames import Selection
from carom.scene.billiards.look import KINDS, POOL
from carom.show.film import camera
from carom.show.film.look import CAMERAS, Look
from carom.show.film.playback import Playback, natural_speed, turned
from carom.show.looks import looks
from carom.show.viewer.table import ball_facts
from typer.testing import CliRunner

R, SPEED, SPIN = 0.03, 0.5, 40.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> carom.Result:
    """A ball that flies along x and spins about z, and one at rest, without weight; a plate that rises."""
    scene = carom.Scene("flight", run={"until": 1.0, "step": 1e-2}, gravity=(0, 0, 0), record={"every": 10})
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    scene.sphere(
        "a2",
        radius=R,
        mass=1,
        material="m",
        at=(0, 0, 0),
        velocity=(SPEED, 0, 0),
        angular_velocity=(0, 0, SPIN),
    )
    scene.sphere("b5", radius=R, mass=1, material="m", at=(0.25, 0.3, 0))
    motion = {"translation": [0, 0, {"expression": "0.1*t"}]}
    scene.plane(
        "plate", point=(0.25, 0, -0.3), normal=(0, 0, 1), size=(0.2, 0.2), material="m", motion=motion
    )
    return carom.simulate(scene, out=tmp_path_factory.mktemp("film") / "run")


def playback(result: carom.Result, format: str = "mp4", **options: Any) -> Playback:
    return Playback(Selection.of(result), Look.of(format, options))


class TestPlayback:
    def test_balls_are_where_they_fly_between_frames_too(self, flight: carom.Result) -> None:
        found = playback(flight)
        for time in (0.0, 0.05, 0.1234, 0.9999, 1.0):
            moment = found.at(time)
            assert moment.position[0] == pytest.approx([SPEED * time, 0, 0], abs=1e-12)
            assert moment.position[1] == pytest.approx([0.25, 0.3, 0], abs=1e-12)
            assert moment.speed == pytest.approx([SPEED, 0])

    def test_attitudes_take_the_whole_turns_that_the_spin_says(self, flight: carom.Result) -> None:
        # 4 rad from frame to frame: the short way round would be 2.28 rad backwards.
        for time in (0.03, 0.55, 0.98):
            half = 0.5 * SPIN * time
            w, x, y, z = playback(flight).at(time).orientation[0]
            assert abs(w * np.cos(half) + z * np.sin(half)) == pytest.approx(1.0, abs=1e-9)
            assert (x, y) == pytest.approx((0, 0), abs=1e-9)

    def test_slow_turns_are_at_constant_rate(self) -> None:
        axis = np.array([0.6, 0.0, 0.8])
        start = np.array([[0.5, 0.5, -0.5, 0.5]])
        turn = np.concatenate([[np.cos(0.4)], np.sin(0.4) * axis])
        w, v = turn[0], turn[1:]
        end = np.array(
            [
                [
                    w * start[0, 0] - v @ start[0, 1:],
                    *(w * start[0, 1:] + start[0, 0] * v + np.cross(v, start[0, 1:])),
                ]
            ]
        )
        nothing = np.zeros((1, 3))  # the recorded spin is not asked for slow turns
        quarter = turned(start, -end, nothing, 0.25)
        again = [turned(start, end, nothing, 0.25)]
        for share in (1 / 3, 0.5, 1.0):  # by the same angle each, to the end
            again.append(turned(again[-1], end, nothing, share))
        steps = [abs(float(np.sum(a * b))) for a, b in zip([start, *again], [*again, end], strict=False)]
        assert steps[:4] == pytest.approx([np.cos(0.1)] * 4)
        assert abs(float(np.sum(quarter * again[0]))) == pytest.approx(
            1.0
        )  # the sign of a quaternion means nothing
        assert abs(float(np.sum(again[-1] * end))) == pytest.approx(1.0)

    def test_whole_turns_are_made_about_the_axis_of_the_spin(self) -> None:
        still = np.array([[1.0, 0, 0, 0]])
        half = turned(still, still, np.array([[0, 2 * np.pi, 0]]), 0.25)
        assert half[0] == pytest.approx([np.cos(np.pi / 4), 0, np.sin(np.pi / 4), 0])

    def test_absent_balls_are_not_shown_and_leaving_ones_wait(self, flight: carom.Result) -> None:
        scene = carom.Scene("flow", run={"until": 0.2, "step": 1e-3}, record={"every": 5})
        scene.contact("m", "m", friction=0.3, restitution=0.2)
        scene.inflow("g", count=3, region={"low": (0, 0, 0), "high": (0.1, 0.1, 0)}, radius=0.01, density=2500, material="m",
                     rate=60.0, start=0.02, velocity=(0, 0, -1), seed=1)  # fmt: skip
        scene.outlet(low=(-1, -1, -1), high=(1, 1, -0.05))
        result = carom.simulate(scene)
        found = playback(result)
        for frame, time in enumerate(np.asarray(result.time)):
            for later in (0.0, 0.002):  # between two frames
                moment = found.at(min(float(time) + later, float(result.time[-1])))
                assert moment.body.tolist() == np.flatnonzero(result.present[frame]).tolist()
                assert np.isfinite(moment.position).all()

    def test_pictures_are_evenly_spaced_and_reach_the_end(self, flight: carom.Result) -> None:
        found = playback(flight, fps=20, speed=0.5)
        assert found.times == pytest.approx(np.arange(41) / 40)
        with pytest.raises(CaromError, match="a film of 30000001 pictures; take a greater speed"):
            playback(flight, speed=1e-6)

    def test_a_still_has_one_time_within_the_frames(self, flight: carom.Result) -> None:
        assert playback(flight, "png", at=0.3).times.tolist() == [0.3]
        with pytest.raises(
            CaromError, match="at: 2 s is outside of the chosen frames, which are from 0 to 1 s"
        ):
            playback(flight, "png", at=2.0)

    def test_a_ball_that_is_followed_is_there_or_it_is_said(self) -> None:
        scene = carom.Scene(gravity=(0, 0, 0), run={"until": 0.2, "step": 1e-3}, record={"every": 5})
        scene.contact("m", "m", friction=0.3, restitution=0.2)
        scene.inflow("g", count=2, region={"low": (0, 0, 0), "high": (0.1, 0.1, 0)}, radius=0.01, density=2500, material="m",
                     rate=5.0, start=0.1, velocity=(0, 0, 0.1), seed=1)  # fmt: skip
        result = carom.simulate(scene)
        with pytest.warns(carom.CaromWarning, match="'g1' is there from 0.1 s on; until then all is in view"):
            playback(result, follow="g1")
        with pytest.raises(CaromError, match="follow: ball 'g2' is in none of the chosen frames"):
            playback(result, follow="g2")

    def test_it_has_the_colours_of_the_page(self, flight: carom.Result) -> None:
        shown = [[KINDS.index(look.kind), look.colour, look.label] for look in looks(flight, None)]
        assert ball_facts(flight, None, 1)["balls"] == shown == [[1, POOL[1], "2"], [1, POOL[4], "5"]]

    @pytest.mark.parametrize(
        ("span", "speed"),
        [(3.0, 1.0), (0.3, 0.05), (0.0, 1.0), (400.0, 10.0), (1e-3, 2e-4), (0.012, 2e-3), (4000.0, 100.0)],
    )
    def test_short_runs_are_slowed_down_and_long_ones_sped_up(self, span: float, speed: float) -> None:
        assert natural_speed(span) == speed


class TestCamera:
    @pytest.mark.parametrize("preset", CAMERAS)
    @pytest.mark.parametrize("aspect", [16 / 9, 0.5])
    def test_the_whole_box_is_in_view_and_fills_it(self, preset: str, aspect: float) -> None:
        low, high = np.array([-1.0, -2.0, 0.0]), np.array([3.0, 1.0, 0.5])
        eye = camera.whole(preset, low, high, np.array([0.0, 0, 1]), aspect)
        toward = (eye.position - eye.target) / np.linalg.norm(eye.position - eye.target)
        right = np.cross(eye.up, toward)
        corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)]) - eye.position
        tan = np.tan(np.radians(camera.ANGLE / 2))
        x = corners @ right / -(corners @ toward) / (tan * aspect)
        y = corners @ eye.up / -(corners @ toward) / tan
        assert max(np.abs(x).max(), np.abs(y).max()) == pytest.approx(1.0, abs=0.1)
        assert max(np.abs(x).max(), np.abs(y).max()) < 1.0
        assert eye.up[2] > -1e-9

    def test_following_keeps_the_ball_in_the_middle(self) -> None:
        eye = camera.whole("fit", np.zeros(3), np.ones(3), np.array([0.0, 0, 1]), 1.5)
        near = camera.beside(eye, np.array([5.0, 6, 7]), 0.1)
        assert near.target.tolist() == [5, 6, 7]
        assert np.linalg.norm(near.position - near.target) == pytest.approx(camera.NEAR * 0.1)


@pytest.mark.parametrize(
    ("format", "options", "told"),
    [
        ("mp4", {"width": 641}, "width: 641 is odd, which H.264 cannot hold; take 642"),
        ("gif", {"height": 10}, "height: 10 is no whole number from 64 to 8192"),
        ("mp4", {"fps": 0}, "fps: 0 is not above 0 and at most 240"),
        ("mp4", {"speed": float("nan")}, "speed: nan is not above 0"),
        ("mp4", {"camera": "tob"}, "camera: there is no 'tob'; did you mean top?"),
        ("mp4", {"shading": "smooth"}, "shading: there is no 'smooth'"),
        ("gif", {"at": 1.0}, "at: a still is a picture, and gif a film; take the format png"),
        ("mp4", {"colour": "red"}, "films have no option 'colour'"),
        ("mp4", {"follow": "c"}, "no body is called 'c'"),
        ("csv", {"fps": 3}, "fps is an option of films; csv has none of that name"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_made(
    format: str, options: dict[str, Any], told: str, flight: carom.Result, tmp_path: Path
) -> None:
    with pytest.raises(CaromError, match=re.escape(told)):
        flight.export(tmp_path / "x", format, **options)
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("format", "module"),
    [("mp4", "imageio_ffmpeg"), ("gif", "imageio_ffmpeg"), ("png", "vtkmodules.vtkRenderingOpenGL2")],
)
def test_names_the_extra_that_is_missing(
    format: str, module: str, flight: carom.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, "vtkmodules.vtkCommonDataModel", None)
    with pytest.raises(CaromError, match=r"pip install 'carom\[video\]'"):
        flight.export(tmp_path / "films" / "new", format)
    assert not list(tmp_path.iterdir())  # not even an empty folder


def test_without_opengl_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from carom.show.film import window

    monkeypatch.setattr(window, "vtk", lambda module: None)
    monkeypatch.setattr(window, "TRIAL", "import os; os.abort()  # {name}")  # VTK does not raise, it crashes
    with pytest.raises(
        CaromError, match="need OpenGL, in software at least, and none was found; on Debian: apt install"
    ):
        window._usable.__wrapped__()


def test_the_command_refuses_options_of_films_for_tables(flight: carom.Result, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["export", str(flight.path), "--format", "csv", "--fps", "3", "-o", str(tmp_path / "x")]
    )
    assert done.exit_code == 2
    assert "--fps is an option of films; add --format mp4" in done.stderr


@pytest.fixture
def drawing() -> None:
    pytest.importorskip("vtkmodules.vtkRenderingOpenGL2", reason="the extra [video] is not installed")
    pytest.importorskip("imageio_ffmpeg", reason="the extra [video] is not installed")
    from carom.show.film import window

    try:
        window._usable()
    except CaromError as error:
        pytest.skip(str(error))


SMALL: dict[str, Any] = {"width": 320, "height": 240, "stamp": False, "speed": 1.0}


def shot(result: carom.Result, at: float, **options: Any) -> Any:
    from carom.show.film.shoot import pictures

    [picture] = pictures(Selection.of(result), Look.of("png", {**SMALL, "at": at, **options}))
    return picture.astype(int)


def blue(picture: Any) -> Any:
    """Where the ball of number 2 is, whose colour is the only one of its kind: rows and columns of its pixels."""
    return np.argwhere((picture[..., 2] > picture[..., 0] + 50) & (picture[..., 2] > picture[..., 1] + 25))


def test_from_above_the_long_axis_runs_to_the_right_whichever_is_up() -> None:
    """As in the viewer; where y is up and z long, z once ran to the left."""
    from carom.show.film.camera import whole

    for up, low, high in (
        ("y", (0, 0, 0), (1, 0.1, 3)),
        ("y", (0, 0, 0), (3, 0.1, 1)),
        ("z", (0, 0, 0), (1, 3, 0.1)),
        ("x", (0, 0, 0), (0.1, 1, 3)),
    ):
        eye = whole("top", np.array(low, float), np.array(high, float), np.eye(3)["xyz".index(up)], 1.5)
        right = np.cross(eye.target - eye.position, eye.up)
        assert right[np.argmax(high)] == pytest.approx(np.linalg.norm(right), rel=1e-5)
        assert eye.position["xyz".index(up)] > 1


@pytest.mark.usefixtures("drawing")
class TestPictures:
    def test_a_ball_is_drawn_where_and_as_large_as_it_is(self, flight: carom.Result) -> None:
        # From above, where its outline is nearly a circle.
        found = playback(flight, "png", at=0.5)
        picture = shot(flight, 0.5, camera="top", shading="plain")
        pixels = blue(picture)
        assert len(pixels) > 20
        spread = pixels.max(axis=0) - pixels.min(axis=0) + 1
        assert spread[0] == pytest.approx(spread[1], abs=2)
        assert len(pixels) == pytest.approx(np.pi / 4 * spread[0] * spread[1], rel=0.15)
        # Distance of the two balls in radii, by their colours.
        orange = np.argwhere(
            (picture[..., 0] > picture[..., 2] + 60) & (picture[..., 0] > picture[..., 1] + 30)
        )
        apart = np.linalg.norm(pixels.mean(axis=0) - orange.mean(axis=0))
        assert apart / (0.5 * spread.mean()) == pytest.approx(0.3 / found.radius[0], rel=0.1)

    def test_it_moves_as_the_run_says(self, flight: carom.Result) -> None:
        places = [
            blue(shot(flight, at, camera="top", shading="plain")).mean(axis=0) for at in (0.1, 0.4, 0.7)
        ]
        steps = np.diff(places, axis=0)
        assert steps[0] == pytest.approx(steps[1], abs=1.5)
        assert np.linalg.norm(steps[0]) > 20

    def test_rotation_shows_by_the_pattern_alone(self, flight: carom.Result) -> None:
        # Followed, the ball stays where it is; 0.3 and 0.3 + a quarter turn.
        times = (0.3, 0.3 + np.pi / 2 / SPIN)
        for shading, differs in (("pattern", True), ("plain", False)):
            a, b = (shot(flight, at, follow="a2", shading=shading) for at in times)
            middle = np.abs(a - b)[110:130, 150:170]
            assert (middle.max() > 40) == differs, shading

    def test_walls_move_in_time(self, flight: carom.Result) -> None:
        early, late = (shot(flight, at, camera="side") for at in (0.0, 1.0))
        changed = np.argwhere(np.abs(early - late).max(axis=-1) > 15)
        assert (changed[:, 0] > 140).sum() > 200  # below the balls, which move too

    def test_speed_has_a_scale_of_colours(self, flight: carom.Result) -> None:
        picture = shot(flight, 0.5, shading="speed", camera="top")
        yellow = (picture[..., 0] > 150) & (picture[..., 1] > 150) & (picture[..., 2] < 110)
        assert yellow.sum() > 10  # the fast ball, and the end of the bar

    def test_where_nothing_moves_there_is_no_scale(self) -> None:
        scene = carom.Scene(gravity=(0, 0, 0), run={"until": 0.1, "step": 1e-2})
        scene.sphere("still", radius=R, mass=1, material="m", at=(0, 0, 0))
        picture = shot(carom.simulate(scene), 0.05, shading="speed", camera="top")
        assert not ((picture[..., 0] > 150) & (picture[..., 1] > 150) & (picture[..., 2] < 110)).any()

    def test_the_time_is_in_the_corner_or_not(self, flight: carom.Result) -> None:
        corner = (slice(200, None), slice(0, 120))
        with_, without = (shot(flight, 0.5, camera="top", stamp=stamp)[corner] for stamp in (True, False))
        assert np.abs(with_ - without).max() > 80

    def test_a_periodic_box_is_outlined_and_balls_are_drawn_in_it(self, tmp_path: Path) -> None:
        scene = carom.Scene(
            "p", run={"until": 1.0, "step": 1e-2}, gravity=(0, 0, 0), periodic=(1.0, 1.0, 1.0)
        )
        scene.contact("m", "m", friction=0.0, restitution=1.0)
        scene.sphere("a2", radius=0.1, mass=1, material="m", at=(0.5, 0.5, 0.5), velocity=(2, 0, 0))
        result = carom.simulate(scene, out=tmp_path / "run")
        first, half, last = (blue(shot(result, at, shading="plain")) for at in (0.0, 0.25, 1.0))
        assert np.abs(first.mean(axis=0) - last.mean(axis=0)).max() < 0.5  # two periods on
        assert np.abs(first.mean(axis=0) - half.mean(axis=0)).max() > 20
        dark = np.argwhere(shot(result, 0.0).max(axis=-1) < 190)
        outside = [
            p
            for p in dark
            if not (first.min(axis=0) - 3 <= p).all() or not (p <= first.max(axis=0) + 3).all()
        ]
        assert len(outside) > 200  # twelve edges


def probed(path: Path) -> tuple[int, tuple[int, int]]:
    """Frames and size of a film, by ffmpeg."""
    from carom.show.film.encode import ffmpeg

    command = [ffmpeg(), "-i", str(path), "-map", "0:v:0", "-f", "null", "-"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    [size] = set(re.findall(r"Video: .*?, (\d+x\d+)", told.split("Output #0")[0]))
    width, height = size.split("x")
    return int(re.findall(r"frame=\s*(\d+)", told)[-1]), (int(width), int(height))


@pytest.mark.usefixtures("drawing")
class TestFiles:
    @pytest.mark.parametrize("format", ["mp4", "gif"])
    def test_a_film_has_all_pictures_in_the_size_asked_for(
        self, format: str, flight: carom.Result, tmp_path: Path
    ) -> None:
        made = []
        [path] = flight.export(
            tmp_path, format, fps=10, progress=lambda done, known: made.append((done, known)), **SMALL
        )
        assert path == tmp_path / f"film.{format}"
        assert list(tmp_path.iterdir()) == [path]
        assert probed(path) == (11, (320, 240))
        assert made == [(k, 11) for k in range(1, 12)]

    def test_pictures_are_numbered_and_a_still_has_its_time(
        self, flight: carom.Result, tmp_path: Path
    ) -> None:
        files = flight.export(tmp_path, "png", fps=4, start=0.2, stop=0.7, **SMALL)
        assert [f.relative_to(tmp_path).as_posix() for f in files] == [
            f"pictures/{k:05d}.png" for k in range(3)
        ]
        assert all(probed(f) == (1, (320, 240)) for f in files)
        [still] = flight.export(tmp_path, "png", at=0.45, start=0.2, stop=0.7, **SMALL)
        assert still.name == "still-0.45s.png"
        assert files[1].read_bytes() == still.read_bytes()  # the same time, the same bits

    def test_an_interrupted_film_leaves_the_old_one(self, flight: carom.Result, tmp_path: Path) -> None:
        for format in ("mp4", "gif", "png"):
            flight.export(tmp_path, format, fps=2, **SMALL)
        before = {f: f.read_bytes() for f in tmp_path.rglob("*") if f.is_file()}
        assert len(before) == 5

        def stop(done: int, known: int) -> None:
            if done == 2:
                raise KeyboardInterrupt

        for format in ("mp4", "gif", "png"):
            with pytest.raises(KeyboardInterrupt):
                flight.export(tmp_path, format, fps=5, progress=stop, **SMALL)
        assert {f: f.read_bytes() for f in tmp_path.rglob("*") if f.is_file()} == before

    def test_what_ffmpeg_says_is_told(
        self, flight: carom.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from carom.show.film import encode

        monkeypatch.setattr(encode, "H264", ["-c:v", "nonsense", "-f", "mp4"])
        with pytest.raises(CaromError, match=r"cannot write .*film.mp4.*: ffmpeg: "):
            flight.export(tmp_path, "mp4", fps=2, **SMALL)
        assert not list(tmp_path.iterdir())

    def test_the_command_makes_a_still(self, flight: carom.Result, tmp_path: Path) -> None:
        arguments = [
            "export",
            str(flight.path),
            "--format",
            "png",
            "--at",
            "0.5",
            "--width",
            "320",
            "--height",
            "240",
        ]
        done = CliRunner().invoke(app, [*arguments, "--follow", "a2", "-o", str(tmp_path), "--json"])
        assert done.exit_code == 0, done.output
        assert json.loads(done.stdout)["files"] == [str(tmp_path / "still-0.5s.png")]

    def test_a_new_run_leaves_no_film_of_the_old_one(self, flight: carom.Result, tmp_path: Path) -> None:
        from carom.result.directory import RunDir

        copy = flight.save(tmp_path / "copy")
        copy.export(None, "png", fps=2, **SMALL)
        copy.close()
        with RunDir.create(tmp_path / "copy", force=True).writing():
            assert not list((tmp_path / "copy").rglob("*.png"))


def test_joints_are_drawn_as_what_they_leave_or_hold() -> None:
    """All were rods from end to end, also where a rail begins far from its ball."""
    from carom.show.film.guides import segments

    begin, end, down = np.array([0.0, 0.0, 1.0]), np.array([0.5, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])

    def lines(kind: str, *axes: tuple[float, float, float]) -> Any:
        return segments({"kind": kind, "a": 0, "b": -1, "axes": axes}, begin, end, 0.1, down)

    for kind in ("rod", "spring"):
        assert lines(kind).tolist() == [[begin.tolist(), end.tolist()]]
    assert len(lines("ball")) == 0
    for kind in ("line", "motion"):
        [rail] = lines(kind, (0, 1, 0))
        assert rail.mean(axis=0) == pytest.approx(end)
        assert rail[1] - rail[0] == pytest.approx((0, 0.64, 0))
    cross = lines("lock", (1, 0, 0), (0, 0, 1))
    assert len(cross) == 2
    assert cross.mean(axis=1) == pytest.approx(np.array([begin, begin]))
    frame = lines("plane", (0, 0, 1))
    assert frame[:, 1] == pytest.approx(np.roll(frame[:, 0], -1, axis=0))  # closed
    assert frame[:, 0].mean(axis=0) == pytest.approx(end)
    assert frame[..., 2] == pytest.approx(1.0)
    assert lines("fix")[:, 0] == pytest.approx(np.tile(end, (3, 1)))


@pytest.mark.usefixtures("drawing")
def test_shadows_that_overlap_lie_one_above_the_other() -> None:
    """In one plane each showed in stripes through the others."""
    from carom.show.film.balls import Shadows
    from vtkmodules.util.numpy_support import vtk_to_numpy

    floor = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    up = np.array([0.0, 0.0, 1.0])
    shadows = Shadows(floor, up, up)
    shadows.place(np.tile([0.0, 0.0, 0.1], (5, 1)), np.full(5, 0.1))
    height = vtk_to_numpy(shadows._data.GetPoints().GetData()).reshape(5, 4, 3)[..., 2]
    assert np.ptp(height, axis=1).max() == 0.0
    assert (np.diff(height[:, 0]) > 1e-6).all()
    assert height.max() < 0.01
