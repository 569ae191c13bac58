"""The scene that is drawn: walls, floor and light once, balls anew for every picture.

Coordinates of the scene are divided by its size: single precision and depth then serve marbles and boulders alike.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom.arrays import F64
from carom.result.data import RunData
from carom.scene.assembly.rotations import rotated, upward
from carom.scene.billiards.look import KINDS, BallLook
from carom.scene.billiards.marked import table_of
from carom.scene.billiards.shape import BED, Shape
from carom.show.film import camera
from carom.show.film.balls import GRAIN, PLAIN, Balls, Shadows
from carom.show.film.guides import segments
from carom.show.film.look import Look
from carom.show.film.mesh import Colour, actor, colour, mesh, place
from carom.show.film.playback import Moment, Playback
from carom.show.film.table import Felt
from carom.show.film.window import off_screen, pixels, vtk
from carom.show.looks import looks
from carom.show.plot import require_matplotlib
from carom.show.surfaces import Surface, surfaces
from carom.show.viewer.links import links

BACK = ("#f7f8fa", "#d3d9e1")
FLOOR, GRID = "#ccd1d9", "#aab2be"
CLOTH, SEAM = "#2a8f6a", "#1f7a58"
WALL, LINE = "#b9c2ce", "#5d6877"
LINK = "#7a6a4f"
#: Share of the light that a wall stops that stands between the eye and the balls.
GLASS = 0.1
#: Up to so many balls four rims around a floor are a billiard table.
MOST_ON_A_TABLE = 64


class Stage:
    """What is drawn of a run; `picture` draws a moment of it."""

    def __init__(self, result: RunData, playback: Playback, look: Look) -> None:
        self._playback, self._look = playback, look
        self._up = upward(result.gravity)
        low, high = playback.low, playback.high
        self._boxes = result.boxes
        closed = np.zeros(3, dtype=bool)  # along these axes balls are drawn within the box
        if self._boxes is not None:
            closed = self._boxes.first.lengths > 0
            low, high = self._boxes.around(low, high)
        table = table_of(result)
        shape = None if table is None else Shape(table)
        drawn = set() if shape is None else {BED, *shape.walls}  # by the table, in its own way
        walls = [wall for wall in result.walls.values() if wall.motion.moves or wall.name not in drawn]
        found = surfaces(walls, low, high, self._up, closed.tolist())
        for surface in found:
            low, high = _with(surface, low, high)
        if shape is not None:
            low, high = np.minimum(low, shape.box[0]), np.maximum(high, shape.box[1])
        self._middle, self._scale = 0.5 * (low + high), 2.0 / float((high - low).max())
        self._ends = low, high
        low, high = self._scaled(low), self._scaled(high)
        self._eye = camera.whole(look.camera, low, high, self._up, look.width / look.height)
        self._followed = None if look.follow is None else result[look.follow].index
        toward = self._eye.position - self._eye.target
        right = np.cross(self._up, toward)
        lamp = self._up - 0.45 * right / np.linalg.norm(right) + 0.2 * toward / np.linalg.norm(toward)
        self._lamp: F64 = lamp / np.linalg.norm(lamp)

        core = vtk("vtkRenderingCore")
        self._window = off_screen(look.width, look.height)
        self._renderer = core.vtkRenderer()
        self._window.AddRenderer(self._renderer)
        self._renderer.GradientBackgroundOn()
        self._renderer.SetBackground(*colour(BACK[1]))
        self._renderer.SetBackground2(*colour(BACK[0]))
        for direction, strength in (
            (self._lamp, 0.75),
            (self._up, 0.3),
            (toward / np.linalg.norm(toward), 0.25),
        ):
            light = core.vtkLight()
            light.SetPositional(False)
            light.SetPosition(*direction)
            light.SetFocalPoint(0.0, 0.0, 0.0)
            light.SetIntensity(strength)
            self._renderer.AddLight(light)
        self._renderer.GetActiveCamera().SetViewAngle(camera.ANGLE)

        self._moving: list[tuple[Surface, list[Any]]] = []
        self._shadows: list[Shadows] = []
        self._felt = None if shape is None else Felt(shape, self._scaled, self._lamp)
        if self._felt is not None:
            self._renderer.AddActor(self._felt.actor)
            self._shade(self._felt.bed, np.array([0.0, 0.0, 1.0]))
        self._set(found)
        self._edges = self._periodic()
        self._links = links(result, 1)
        self._rods = mesh(np.zeros((0, 3)))
        if self._links:
            self._drawn(self._rods, colour(LINK), 360)
        labels = self._colours(looks(result, table))
        self._balls = Balls(self._lamp, self._up, labels)
        self._renderer.AddActor(self._balls.actor)
        self._stamp = self._text() if look.stamp else None

    def picture(self, moment: Moment) -> NDArray[np.uint8]:
        """The moment as (height, width, 3), the upper row first."""
        box = None if self._boxes is None else self._boxes.at(moment.time).tilted
        centre = self._scaled(moment.position if box is None else box.fold_tilted(moment.position))
        if box is not None and self._edges is not None:
            place(self._edges, self._scaled(box.corners(*self._ends)))
        radius = self._scale * self._playback.radius[moment.body]
        eye = self._eye
        if self._followed is not None and self._followed in moment.body:
            k = int(np.flatnonzero(moment.body == self._followed)[0])
            self._eye = eye = camera.beside(eye, centre[k], float(radius[k]))
        pixel = math.radians(camera.ANGLE) / self._look.height
        self._balls.place(
            eye, pixel, centre, radius, moment.orientation, self._tint(moment), self._badge[moment.body]
        )
        if self._felt is not None:
            self._felt.seen_from(eye.position)
        for shadows in self._shadows:
            shadows.place(centre, radius)
        self._move(moment.time)
        if self._links:
            self._tie(moment)
        if self._stamp is not None:
            self._stamp.SetInput(self._words(moment.time))
        view = self._renderer.GetActiveCamera()
        view.SetPosition(*eye.position)
        view.SetFocalPoint(*eye.target)
        view.SetViewUp(*eye.up)
        self._renderer.ResetCameraClippingRange()
        self._window.Render()
        return pixels(self._window)

    def close(self) -> None:
        """Free what the window holds."""
        self._window.Finalize()

    def _scaled(self, points: F64) -> F64:
        return (points - self._middle) * self._scale

    # Walls.

    def _set(self, found: list[Surface]) -> None:
        floors = [s for s in found if s.wall.shape == "plane" and self._normal(s) @ self._up > 0.5]
        still = [s for s in found if s.wall.shape == "plane" and not s.wall.motion.moves]
        rims = [s for s in still if abs(self._normal(s) @ self._up) < 0.1]
        table = len(floors) == 1 and len(rims) == 4 and len(self._playback.radius) <= MOST_ON_A_TABLE
        for surface in found:
            floor = any(surface is other for other in floors)
            shown = colour((CLOTH if table else FLOOR) if floor else WALL)
            moves = surface.wall.motion.moves
            vertices = surface.vertices * self._scale
            if not moves:
                vertices = self._scaled(np.asarray(surface.wall.facts["point"]) + surface.vertices)
            parts = self._wall(surface, vertices, shown, 0.2 if floor else 0.38)
            if floor and not moves:
                polygon, normal = vertices, self._normal(surface)
                if not table or self._followed is not None:
                    self._grid(polygon, normal, colour(SEAM if table else GRID))
                self._shade(polygon, normal)
            if moves:
                self._moving.append((surface, parts))

    def _shade(self, polygon: F64, normal: F64) -> None:
        shadows = Shadows(polygon, normal, self._lamp)
        self._shadows.append(shadows)
        self._renderer.AddActor(shadows.actor)

    @staticmethod
    def _normal(surface: Surface) -> F64:
        normal = np.asarray(surface.wall.facts["normal"], dtype=np.float64)
        return normal / np.linalg.norm(normal)

    def _wall(self, surface: Surface, vertices: F64, shown: Colour, diffuse: float) -> list[Any]:
        """A wall seen from the side of the balls; from the other it is glass, or it would hide them."""
        flat = surface.wall.shape in ("plane", "rectangle", "disc")
        data = mesh(vertices, surface.faces)
        front, behind = (actor(data, shown, smooth=not flat) for _ in range(2))
        front.GetProperty().BackfaceCullingOn()
        behind.GetProperty().FrontfaceCullingOn()
        behind.GetProperty().SetOpacity(GLASS)
        for part in (front, behind):
            part.GetProperty().SetAmbient(0.72)
            part.GetProperty().SetDiffuse(diffuse)
            self._renderer.AddActor(part)
        return [front, behind, self._drawn(mesh(vertices, lines=surface.lines), colour(LINE), 600)]

    def _drawn(self, lines: Any, shown: Colour, share: float | None = None) -> Any:
        """Lines of one colour without shades, as wide as a `share` of the picture is high, or a pixel."""
        found = actor(lines, shown)
        found.GetProperty().LightingOff()
        if share is not None:
            found.GetProperty().SetLineWidth(max(1.0, self._look.height / share))
        self._renderer.AddActor(found)
        return found

    def _move(self, time: float) -> None:
        when = np.array([time])
        matrix = vtk("vtkCommonMath").vtkMatrix4x4
        for surface, parts in self._moving:
            motion = surface.wall.motion
            for part in parts:
                part.SetVisibility(bool(motion.there(when)[0]))
            point = motion.position(np.asarray(surface.wall.facts["point"], dtype=np.float64), when)[0]
            pose = np.eye(4)
            pose[:3, :3] = rotated(motion.orientation(when), np.eye(3)).T
            pose[:3, 3] = self._scaled(point)
            found = matrix()
            found.DeepCopy(pose.ravel().tolist())
            for part in parts:
                part.SetUserMatrix(found)

    def _grid(self, polygon: F64, normal: F64, shown: Colour) -> None:
        """Lines on a floor by which one sees that the camera moves: several balls wide, tens across."""
        k = int(np.argmin(np.abs(normal)))
        u = np.eye(3)[k] - normal[k] * normal
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        size = float(np.median(self._playback.radius))
        wanted = max(4 * size, 1.0 / self._scale / 25)
        power = 10.0 ** math.floor(math.log10(wanted))
        spacing = (
            self._scale * power * next(step for step in (1, 2, 5, 10) if step * power >= wanted * (1 - 1e-9))
        )
        ends = []
        for along, across in ((u, v), (v, u)):
            offset = (polygon - self._scaled(np.zeros(3))) @ across
            for line in np.arange(math.ceil(offset.min() / spacing), offset.max() / spacing):
                cut = []
                for i in range(len(polygon)):
                    a, b = offset[i] - line * spacing, offset[i - 1] - line * spacing
                    if a * b < 0:
                        cut.append(polygon[i] + a / (a - b) * (polygon[i - 1] - polygon[i]))
                if len(cut) == 2 and abs((cut[1] - cut[0]) @ along) > 0:
                    ends += cut
        if ends:
            points = np.array(ends) + 0.0015 * normal
            self._drawn(mesh(points, lines=np.arange(len(points)).reshape(-1, 2)), shown)

    def _periodic(self) -> Any:
        """The edges of a periodic box, which along other axes holds what is shown; None without."""
        if self._boxes is None:
            return None
        edges = np.array([(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1])
        found = mesh(self._scaled(self._boxes.first.corners(*self._ends)), lines=edges)
        self._drawn(found, colour(LINE), 500)
        return found

    # Balls.

    def _colours(self, shown: list[BallLook]) -> list[str]:
        """Colours and patterns of the balls; what is written on them, each once."""
        labels = list(dict.fromkeys(look.label for look in shown))
        self._own = np.array([colour(look.colour) for look in shown]).reshape(-1, 3)
        self._badge = np.full((len(shown), 2), (PLAIN if self._look.shading == "plain" else GRAIN, 0.0))
        if self._look.shading == "pattern":
            self._badge[:] = [(KINDS.index(look.kind), labels.index(look.label)) for look in shown]
        self._scale_of: tuple[F64, float] | None = None
        if self._look.shading in ("speed", "spin"):
            self._bar()
        return labels

    def _bar(self) -> None:
        """The scale of the colours that stand for speed or spin; none where nothing has any."""
        require_matplotlib()
        from matplotlib import colormaps

        table = np.asarray(colormaps["viridis"](np.linspace(0, 1, 256)))[:, :3]
        most = self._playback.largest(self._look.shading)
        self._scale_of = table, most or 1.0
        if not most:
            return
        core = vtk("vtkCommonCore")
        lookup = core.vtkLookupTable()
        lookup.SetNumberOfTableValues(len(table))
        for i, value in enumerate(table):
            lookup.SetTableValue(i, *value, 1.0)
        lookup.SetTableRange(0.0, most)
        bar = vtk("vtkRenderingAnnotation").vtkScalarBarActor()
        bar.SetLookupTable(lookup)
        bar.SetNumberOfLabels(3)
        bar.SetTitle("speed (m/s)" if self._look.shading == "speed" else "spin (rad/s)")
        bar.SetUnconstrainedFontSize(True)
        bar.SetVerticalTitleSeparation(round(self._look.height / 50))
        bar.SetLabelFormat("%.3g")
        for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
            _plain(text, round(self._look.height / 40))
        bar.SetWidth(0.08)
        bar.SetHeight(0.4)
        bar.SetPosition(0.9, 0.5)
        self._renderer.AddViewProp(bar)

    def _tint(self, moment: Moment) -> F64:
        if self._scale_of is None:
            return self._own[moment.body]
        table, most = self._scale_of
        value = moment.speed if self._look.shading == "speed" else moment.spin
        found: F64 = table[np.clip((value / most * 255).astype(int), 0, 255)]
        return found

    def _tie(self, moment: Moment) -> None:
        """Joints and springs as lines."""
        row = {int(body): k for k, body in enumerate(moment.body)}
        found = []
        for link in self._links:
            pair = [
                self._end(link["a"], link["from"], moment, row),
                self._end(link["b"], link["to"], moment, row),
            ]
            if pair[0] is not None and pair[1] is not None:
                balls = [body for body in (link["a"], link["b"]) if body >= 0]
                radius = float(self._playback.radius[balls].min())
                found.append(segments(link, pair[0], pair[1], radius, -self._up))
        ends = np.concatenate([np.zeros((0, 2, 3)), *found]).reshape(-1, 3)
        fresh = mesh(self._scaled(ends), lines=np.arange(len(ends)).reshape(-1, 2))
        self._rods.ShallowCopy(fresh)

    @staticmethod
    def _end(body: int, arm: list[float], moment: Moment, row: dict[int, int]) -> F64 | None:
        if body < 0:
            return np.asarray(arm, dtype=np.float64)
        if body not in row:
            return None
        k = row[body]
        turned = rotated(moment.orientation[k], np.asarray(arm, dtype=np.float64))
        return np.asarray(moment.position[k] + turned, dtype=np.float64)

    # Words.

    def _text(self) -> Any:
        found = vtk("vtkRenderingCore").vtkTextActor()
        words = found.GetTextProperty()
        _plain(words, round(self._look.height / 30))
        words.SetBackgroundColor(*colour(BACK[0]))
        words.SetBackgroundOpacity(0.75)  # it may stand on what is drawn
        margin = round(self._look.height / 36)
        found.SetPosition(margin, margin)
        self._renderer.AddViewProp(found)
        return found

    def _words(self, time: float) -> str:
        step = self._playback.speed / self._look.fps
        digits = max(0, min(9, math.ceil(-math.log10(step))))
        if self._look.at is not None:
            return f"t = {time:.6g} s"
        speed = self._playback.speed
        return f"t = {time:.{digits}f} s" + ("" if speed == 1.0 else f"   speed {speed:g}")


def _plain(text: Any, size: int) -> None:
    text.SetFontFamilyToArial()
    text.SetFontSize(max(8, size))
    text.SetColor(*colour("#2b323c"))
    text.ItalicOff()
    text.BoldOff()
    text.ShadowOff()


def _with(surface: Surface, low: F64, high: F64) -> tuple[F64, F64]:
    """The box with a wall in it, as far as that is not out of all proportion to where the balls are."""
    extent = float((high - low).max())
    placed = np.asarray(surface.wall.facts["point"]) + surface.vertices
    return (
        np.minimum(low, np.maximum(placed.min(axis=0), low - 1.5 * extent)),
        np.maximum(high, np.minimum(placed.max(axis=0), high + 1.5 * extent)),
    )
