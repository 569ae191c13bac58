"""A run while it is being computed, in a browser on this machine: `carom view RUN --live`, and in notebooks.

The server is viser's (extra `live`), bound to the loopback address, and answers who knows its address (`gate`). It looks at
the run directory from time to time, as any other reader of a run does; the simulation knows nothing of it.
"""

from __future__ import annotations

import secrets
import threading
import warnings
from collections.abc import Callable
from contextlib import redirect_stdout
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any, Self

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, extra
from carom.files import Anchored
from carom.result.clumps import rigid
from carom.result.data import RunData
from carom.scene.assembly.rotations import upward
from carom.show.surfaces import surfaces
from carom.show.viewer.gate import gated, refuse_taken, unusable
from carom.show.viewer.live_shapes import ball_halves
from carom.show.viewer.scenery import bounds, deforming, held, period

HOST = "127.0.0.1"
PORT = 8080
MOST_BALLS = 20_000
LOOK_S = 0.5
"""Time between two looks at a run that is being computed."""
PICTURE_S = 1 / 25
SIZE = 4.0
"""Diagonal of the box of the balls at the start, in the page."""
COLOURS = np.array(  # darker than they shall look: the page is lit brightly
    [[30, 80, 150], [190, 95, 20], [35, 115, 55], [160, 40, 20], [85, 55, 140], [180, 135, 20], [20, 115, 115],
     [160, 70, 105]],
    dtype=np.uint8,
)  # fmt: skip
LIGHT = np.array([235, 228, 210], dtype=np.uint8)
WALL = (130, 140, 155)


class Live:
    """A server that shows a run, and follows it while it is computed.

    `source` is a run directory or a result that has one. Without `port` it is 8080, or the next one that is free. `url` is
    where to look; `stop()` ends it, as does leaving a `with` block. Of more than `MOST_BALLS` balls one in several is shown,
    which `notes` and the page say.
    """

    def __init__(self, source: str | Path | RunData, *, port: int | None = None) -> None:
        viser = extra("viser", "a live view needs viser", "live")
        path = source if isinstance(source, (str, Path)) else source.path
        self._anchored = Anchored(path)
        self._seen = self._stamp()
        self._result = _load(self._path)
        self._writing = self._result.is_being_written
        if len(self._result.time) == 0:
            raise CaromError(f"{self._path} has no frame yet; wait until the run has begun")
        self.notes: tuple[str, ...] = ()
        self._token = secrets.token_urlsafe(16)
        if port is not None:  # viser would take the next one that is free
            refuse_taken(port)
        first = PORT if port is None else port
        try:
            # viser prints an address without the token, at which nothing answers.
            with gated(self._token), redirect_stdout(StringIO()):
                self._server: Any = viser.ViserServer(host=HOST, port=first, verbose=False, label=self._title)
        except OSError as error:
            raise unusable(first, error) from error
        self._lock = threading.RLock()
        self._ended = threading.Event()
        self._shown: tuple[int, int] | None = None
        self._set_up()
        self._thread = threading.Thread(target=self._work, name="carom-live", daemon=True)
        self._thread.start()

    @property
    def _path(self) -> Path:
        return self._anchored.path

    @property
    def url(self) -> str:
        """Where to look. Who does not know it gets no answer."""
        return f"http://{HOST}:{self._server.get_port()}/{self._token}/"

    @property
    def frames(self) -> int:
        """Frames read so far."""
        return len(self._result.time)

    @property
    def frame(self) -> int:
        """The frame shown."""
        return int(self._slider.value)

    def show(self, frame: int) -> None:
        """Show a frame and stay with it; negative counts from the newest."""
        with self._lock:
            self._follow.value = self._play.value = False
            self._slider.value = range(self.frames)[frame]
            self._draw()

    def stop(self) -> None:
        """End the server."""
        self._ended.set()
        self._thread.join(5.0)
        self._server.stop()
        self._result.close()

    def wait(self) -> None:
        """Until `stop` is called, or the program interrupted."""
        while not self._ended.wait(1.0):
            pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="480" title="{HOST}"></iframe>'

    @property
    def _title(self) -> str:
        return self._result.title or self._path.name

    def _set_up(self) -> None:
        result, scene, gui = self._result, self._server.scene, self._server.gui
        count = len(result.names)
        self._every = max(1, -(-count // MOST_BALLS))
        if self._every > 1:
            self.notes = (f"Shows {-(-count // self._every)} of {count} bodies (one in {self._every}).",)
        self._radius = np.asarray(result.bodies["radius"], dtype=np.float64)[:: self._every]
        up = upward(result.gravity)
        scene.set_up_direction(tuple(up))
        self._scale = 1.0
        position, orientation = self._bodies(0)
        low, high = bounds(position[np.newaxis], None, period(result), deforming(result))
        self._ends = low, high
        low, high = low - self._radius.max(), high + self._radius.max()
        # Lights and depth of the page are made for scenes of some metres.
        self._scale = SIZE / float(np.linalg.norm(high - low))
        position, self._radius = self._scale * position, self._scale * self._radius
        colour = COLOURS[rigid(result)[:: self._every] % len(COLOURS)]
        self._halves = [
            scene.add_batched_meshes_simple(
                f"/balls/{name}",
                vertices,
                faces,
                batched_wxyzs=orientation,
                batched_positions=position,
                batched_scales=self._radius,
                batched_colors=tint,
            )
            for (name, vertices, faces), tint in zip(
                ball_halves(), (colour, np.broadcast_to(LIGHT, colour.shape)), strict=True
            )
        ]
        self._walls = []
        for surface in surfaces(list(result.walls.values()), low, high, up):
            wall = surface.wall
            # What stands between us and the balls is not drawn; of planes without end only what carries them.
            if wall.shape == "plane" and not wall.motion.moves and wall.facts["normal"] @ up < 0.5:
                continue
            handle = scene.add_mesh_simple(
                f"/walls/{wall.index}",
                self._scale * surface.vertices,
                surface.faces,
                color=WALL,
                opacity=0.3,
                side="front",
                cast_shadow=False,
            )
            handle.position = self._scale * np.asarray(wall.facts["point"], dtype=np.float64)
            if wall.motion.moves:
                self._walls.append((wall.name, handle))
        self._edges = self._outline()
        self._camera(self._scale * low, self._scale * high, up)
        # Not as Markdown: in viser's that is a program, and a title of a user could be one.
        gui.add_html(_paragraph(self._title, "font-weight: bold"))
        for note in self.notes:
            gui.add_html(_paragraph(note))
        self._words = gui.add_html("")
        self._slider = gui.add_slider("Frame", 0, max(1, self.frames - 1), 1, 0)
        self._play = gui.add_checkbox("Play", False)
        self._follow = gui.add_checkbox("Newest", result.is_being_written, hint="stay with the newest frame")
        self._slider.on_update(lambda _: self._draw())
        self._draw()

    def _outline(self) -> Any:
        """The edges of a periodic box that deforms; None of others."""
        if (points := self._corners(0)) is None:
            return None
        return self._server.scene.add_line_segments(
            "/box", points, WALL, thickness=1.5, thickness_units="screen"
        )

    def _corners(self, frame: int) -> F64 | None:
        """The ends of these edges, (12, 2, 3), scaled to the page."""
        boxes = deforming(self._result)
        if boxes is None:
            return None
        corners = self._scale * boxes[frame].tilted.corners(*self._ends)
        return np.asarray(corners[[(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1]])

    def _camera(self, low: F64, high: F64, up: F64) -> None:
        middle, reach = 0.5 * (low + high), float(np.linalg.norm(high - low))
        aside = np.cross([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [0.0, 0.0, 1.0], up)
        aside /= np.linalg.norm(aside)
        sight = np.cross(aside, up) - 0.25 * aside + 0.7 * up
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.up = middle + 0.9 * reach * sight, middle, up

    def _bodies(self, frame: int) -> tuple[F64, F64]:
        """Centres (N, 3), scaled to the page, within the period where there is one, and attitudes (N, 4) of the balls shown.

        Absent ones are somewhere, and are drawn without size.
        """
        result, bodies = self._result, slice(None, None, self._every)
        position = np.asarray(result.position[frame], dtype=np.float64)[bodies]
        if (box := result.box(frame)) is not None:
            position = box.tilted.fold_tilted(position)
        position = self._scale * position
        orientation = np.asarray(result.orientation[frame], dtype=np.float64)[bodies]
        there = np.isfinite(position[:, 0]).reshape(1, -1)
        if there.all():
            return position, orientation
        return held(position[np.newaxis], there)[0], held(orientation[np.newaxis], there)[0]

    def _draw(self) -> None:
        """The frame of the slider, if it is not what is shown."""
        with self._lock:
            frame = min(self.frame, self.frames - 1)
            if self._shown == (frame, self.frames):
                return
            self._shown = (frame, self.frames)
            result = self._result
            position, orientation = self._bodies(frame)
            there = np.asarray(result.present[frame])[:: self._every]
            with self._server.atomic():
                for half in self._halves:
                    half.batched_positions = position
                    half.batched_wxyzs = orientation
                    half.batched_scales = np.where(there, self._radius, 0.0)
                if self._edges is not None:
                    self._edges.points = self._corners(frame)
                for name, handle in self._walls:
                    wall = result.walls[name]
                    handle.position = self._scale * wall.position[frame]
                    handle.wxyz = wall.orientation[frame]
                    handle.visible = bool(wall.present[frame])
            state = "running" if result.is_being_written else result.outcome.where
            self._words.content = _paragraph(
                f"t = {result.time[frame]:.6g} s, frame {frame + 1} of {self.frames}; {state}"
            )

    def _work(self) -> None:
        """Looks for new frames while the run is computed, and plays."""
        rest = 0.0
        while not self._ended.wait(PICTURE_S):
            rest -= PICTURE_S
            with self._lock:
                if rest <= 0 and self._writing:
                    rest = LOOK_S
                    self._look()
                if self._play.value and self.frames > 1:
                    self._slider.value = (self.frame + max(1, self.frames // 500)) % self.frames
                elif self._follow.value:
                    self._slider.value = self.frames - 1
            self._draw()

    def _look(self) -> None:
        """Takes over what was written since, if anything was."""
        writing, stamp = self._result.is_being_written, self._stamp()
        if (writing, stamp) == (self._writing, self._seen):
            return
        self._writing, self._seen = writing, stamp
        for _ in range(20):  # what is written at this moment may not be readable yet
            try:
                self._result = _load(self._path)
                break
            except CaromError:
                self._ended.wait(0.1)
        else:
            self._result = _load(self._path)
        self._slider.max = max(1, self.frames - 1)

    def _stamp(self) -> list[int]:
        """Changes with whatever is written."""
        return [file.stat().st_mtime_ns for file in sorted(self._path.glob("results*.h5"))]


def _load(path: Path) -> RunData:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the run is not finished is the point
        return RunData.load(path)


def _paragraph(text: str, style: str = "") -> str:
    """Text as HTML, each character as it is, in the place and size of viser's own."""
    return (
        f'<p style="margin: 0.5em; overflow-wrap: anywhere; font-size: 0.875em; {style}">{escape(text)}</p>'
    )


def serve(path: Path, port: int | None, say: Callable[[str], None]) -> None:
    """What `carom view --live` does: serve until interrupted."""
    with Live(path, port=port) as live:
        for note in live.notes:
            say(f"note: {note}")
        say(f"{live.url}  (this machine only; Ctrl-C ends it)")
        try:
            live.wait()
        except KeyboardInterrupt:
            return
