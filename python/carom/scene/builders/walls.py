"""`Waller`: the calls of a `carom.Scene` that add walls, and what lets balls in and out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from carom.arrays import F64
from carom.scene.arguments import explained
from carom.scene.builders.balls import Builder, Number, Vector, make
from carom.scene.tables.flow import Inflow, Outlet
from carom.scene.tables.free import Free
from carom.scene.tables.motion import Motion
from carom.scene.tables.walls import BallWall, Box, Cone, Cylinder, Mesh, Plane

MotionLike = Motion | Mapping[str, Any]
"""`{"translation": [law, law, law], "rotation": {"axis", "point", "angle" or "rate"}, "surface_velocity": [x, y, z],
"surface_rotation": {"axis", "point", "rate"}}`, any of them; a law of the time is a number or, for example,
`"0.1*sin(t)"`.
"""
FreeLike = Free | Mapping[str, Any]
"""`{"mass": kg, "force": N}` or `{"mass": kg, "pressure": Pa, "area": m^2}`, both numbers or laws of the time `t`;
`"velocity"` m/s at the start, `"weight": False` for a wall without weight.
"""


class Waller(Builder):
    """Walls: fixed, or moving by a prescribed `motion`; inflows and outlets."""

    @explained
    def plane(
        self,
        name: str,
        *,
        point: Vector,
        normal: Vector,
        material: str,
        size: Sequence[Number] | None = None,
        side: Vector | None = None,
        radius: Number | None = None,
        hole: Number | None = None,
        motion: MotionLike | None = None,
        free: FreeLike | None = None,
    ) -> Plane:
        """Add a half-space through `point`; `normal` (any length) points to the side where spheres live.

        With `size` (two lengths, m) it is a rectangle around `point`, the first length along `side` (by default x); with
        `radius` m it is a disc, with `hole` m a ring. Both are sheets with two faces.

        With `free` it has a mass and moves along its normal, by its weight, by a force or a pressure, and by the balls that
        press it: `result.walls[name].position` and `velocity` say where it went.
        """
        return self._add(Plane, locals(), Plane.wall_names)

    @explained
    def cylinder(
        self,
        name: str,
        *,
        point: Vector,
        axis: Vector,
        radius: Number,
        material: str,
        length: Number | None = None,
        inside: bool | None = None,
        motion: MotionLike | None = None,
    ) -> Cylinder:
        """Add a tube around `axis`, `point` the middle of its axis; spheres live inside, unless `inside` is false.

        `radius` m, `length` m (by default without end). Its ends are open: close them with discs (`plane` with `radius`).
        """
        return self._add(Cylinder, locals(), Cylinder.wall_names)

    @explained
    def ball_wall(
        self,
        name: str,
        *,
        point: Vector,
        radius: Number,
        material: str,
        inside: bool | None = None,
        motion: MotionLike | None = None,
    ) -> BallWall:
        """Add a sphere as a wall, centre `point`, `radius` m; spheres live inside, unless `inside` is false."""
        return self._add(BallWall, locals(), BallWall.wall_names)

    @explained
    def cone(
        self,
        name: str,
        *,
        point: Vector,
        axis: Vector,
        radius: Number,
        radius_end: Number,
        length: Number,
        material: str,
        inside: bool | None = None,
        motion: MotionLike | None = None,
    ) -> Cone:
        """Add a piece of a cone with open ends; spheres live inside, unless `inside` is false.

        It goes from the ring of `radius` m around `point` to that of `radius_end` m, `length` m further along `axis`.
        """
        return self._add(Cone, locals(), Cone.wall_names)

    @explained
    def box(
        self,
        name: str,
        *,
        low: Vector,
        high: Vector,
        material: str,
        open: Sequence[str] | None = None,
        finite: bool | None = None,
        motion: MotionLike | None = None,
    ) -> Box:
        """Add up to six planes around the room from corner `low` to corner `high`, which move together.

        The walls are called `name.low_x`, `name.high_x` ... `name.high_z`; sides in `open` have none. They are planes
        without end, or with `finite` rectangles that end at the edges.
        """
        return self._add(Box, locals(), Box.wall_names)

    @explained
    def mesh(
        self,
        name: str,
        *,
        material: str,
        file: str | Path | None = None,
        vertices: Any = None,
        triangles: Any = None,
        scale: Number | None = None,
        point: Vector | None = None,
        orientation: Sequence[Number] | None = None,
        clean: bool | None = None,
        motion: MotionLike | None = None,
    ) -> Mesh:
        """Add a surface of triangles: a `file` (STL, OBJ, PLY), or `vertices` (V, 3) and `triangles` (T, 3), counted from 0.

        `scale` is the unit of the points in m: 0.001 for a file in millimetres. `orientation`, a unit quaternion (w first),
        turns them about their origin, which is placed at `point`. Spheres may live on both sides. Triangles without an area
        are refused, or with `clean` left out. Raises `ScenarioError` for what cannot be read.
        """
        file = None if file is None else str(Path(file).absolute())
        return self._add(Mesh, locals(), Mesh.wall_names)

    @explained
    def inflow(
        self,
        name: str,
        *,
        count: int,
        region: Mapping[str, Any],
        material: str,
        seed: int,
        radius: Number | None = None,
        spheres: Sequence[Vector] | F64 | None = None,
        orientation: Vector | None = None,
        mass: Number | None = None,
        density: Number | None = None,
        inertia: Number | None = None,
        sizes: str | None = None,
        diameter: Number | None = None,
        mean: Number | None = None,
        deviation: Number | None = None,
        smallest: Number | None = None,
        largest: Number | None = None,
        classes: Sequence[Sequence[float | str]] | None = None,
        shares: str | None = None,
        rate: Number | None = None,
        start: Number | None = None,
        velocity: Vector | None = None,
        spread: Number | None = None,
        first_number: int | None = None,
    ) -> Inflow:
        """Let `count` balls enter in the course of the run, called `name` + number from `first_number`.

        `region`: `{"low": ..., "high": ...}` of a box or `{"point": ..., "normal": ..., "radius": ...}` of a disc, where
        their centres are then, at places drawn with `seed`; a ball waits until there is room. `rate` 1/s from the time
        `start` s on, by default as fast as there is room; `velocity` m/s, of which each component is changed at random by
        at most `spread` m/s. All have one `radius` or `diameter` m, or `sizes` and its keys as in `packing`, drawn with
        `seed`. With `spheres`, as of `clump`, `count` clumps enter, called as those of `clump_packing`. They have the
        `orientation` (unit quaternion, w first), or are turned at random.
        """
        return self._add(Inflow, locals())

    @explained
    def outlet(self, *, low: Vector, high: Vector, inside: bool | None = None) -> Outlet:
        """Remove balls whose centre gets into the box from corner `low` to `high`, or out of it if `inside` is false.

        A clump goes as a whole, by its centre of mass.
        """
        outlet = make(Outlet, "Scene.outlet", low=low, high=high, inside=inside)
        self._tree.outlet.append(outlet)
        return outlet
