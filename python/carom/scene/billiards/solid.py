"""The surfaces of a table as triangles, for pages and films: `parts`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from carom.arrays import F64, I64
from carom.scene.billiards.shape import LIFT, SKIRT, Cushion, Hole, Shape, placed

Intervals = list[tuple[float, float]]


SURFACES = ("cloth", "line", "cushion", "wood", "sight", "liner", "hole")
"""The bed with its spots and lines, rubber under cloth, rails with their diamonds, pockets: ring and inside."""


@dataclass(frozen=True)
class Part:
    """Triangles of one kind of surface: points and normals (n, 3), faces (m, 3)."""

    kind: str
    points: F64
    normals: F64
    faces: I64


def parts(shape: Shape) -> list[Part]:
    """The surfaces that a table has, in the order of `SURFACES`."""
    made = {kind: _Mesh() for kind in SURFACES}
    x, y = shape.length + shape.cushion, shape.width + shape.cushion
    low = -shape.cushion
    discs = [(hole.centre, hole.radius) for hole in shape.holes]
    made["cloth"].columns(lambda at: _without([(low, y)], at, discs), [low, x], discs, 0.0)
    for line in shape.lines:
        made["line"].fan(line, LIFT * shape.size)
    for cushion in shape.cushions:
        _rubber(shape, made["cushion"], cushion)
    _wood(shape, made["wood"])
    for sight in shape.sights:
        made["sight"].fan(sight, shape.top + LIFT * shape.size)
    for hole in shape.holes:
        _pocket(shape, made["liner"], made["hole"], hole)
    return [mesh.part(kind) for kind, mesh in made.items() if mesh.points]


def _rubber(shape: Shape, mesh: _Mesh, cushion: Cushion) -> None:
    r, nose, back = shape.size, shape.nose, shape.cushion
    # Distance behind the nose and height, from the bed up; the nose is a point that no ball may be seen to enter.
    slope = np.linspace(0.12 * r, back, 10)
    rise = np.linspace(nose + 0.12 * r, shape.top, 10)
    depth, height = np.concatenate([[(0.3 * r, 0.0), (0.0, nose)], np.column_stack([slope, rise])]).T
    first, last = shape.ends(cushion, depth)
    begin, end = (np.column_stack([placed(cushion, e, depth), height]) for e in (first, last))
    mesh.strip(begin, end, (*-cushion.out, 1.0))
    under = np.maximum(depth, depth[0])
    for edge, foot, sign in zip((begin, end), shape.ends(cushion, under), (-1.0, 1.0), strict=True):
        ground = np.column_stack([placed(cushion, foot, under), np.zeros(len(foot))])
        mesh.strip(edge, ground, (*sign * cushion.way, 0.0))


def _wood(shape: Shape, mesh: _Mesh) -> None:
    bevel = 0.25 * shape.size
    out, corner = shape.rail - bevel, shape.corner - bevel
    inner = (-shape.cushion, shape.width + shape.cushion)
    discs = [(hole.centre, hole.radius + 0.5 * shape.liner) for hole in shape.holes]

    def intervals(x: float) -> Intervals:
        beyond = max(corner - out - x, x - (shape.length + out - corner), 0.0)
        dip = corner - math.sqrt(max(corner**2 - beyond**2, 0.0))
        found = [(-out + dip, shape.width + out - dip)]
        if -shape.cushion < x < shape.length + shape.cushion:
            found = _minus(found, inner)
        return _without(found, x, discs)

    ends = [-out, -shape.cushion, shape.length + shape.cushion, shape.length + out]
    low, high = np.array([corner - out] * 2), np.array([shape.length + out - corner, shape.width])
    mesh.columns(intervals, ends, [*discs, (low, corner), (high, corner)], shape.top)
    # The bevel begins below the top, which ends in many corners: else there are cracks between them.
    below = 0.02 * shape.size
    heights = [(out - 4 * below, corner - 4 * below, shape.top - below), (out, corner, shape.top - below)]
    heights += [(shape.rail, shape.corner, shape.top - bevel)]
    heights += [(shape.rail, shape.corner, -SKIRT * shape.size)]
    rings = []
    for at, rounding, z in heights:
        ring = shape.frame(at, rounding)
        ring = np.concatenate([ring, ring[:1]])
        rings.append(np.column_stack([ring, np.full(len(ring), z)]))
    middle = np.array([0.5 * shape.length, 0.5 * shape.width, 0.0])
    for upper, lower in pairwise(rings):
        mesh.strip(upper, lower, lambda at: (at - middle) * (1.0, 1.0, 0.0) + (0.0, 0.0, 1e-9))


def _pocket(shape: Shape, liner: _Mesh, inside: _Mesh, hole: Hole) -> None:
    angles = np.linspace(hole.mouth, 2 * math.pi - hole.mouth, 33)
    top = shape.top + 2 * LIFT * shape.size
    ring = [
        (hole.radius, 0.0),
        (hole.radius, top - 0.1 * shape.size),
        (hole.radius + 0.1 * shape.size, top),
        (hole.radius + 0.9 * shape.liner, top),
        (hole.radius + shape.liner, shape.top - 0.1 * shape.size),
    ]
    rows = [np.column_stack([hole.around(rho, angles), np.full(len(angles), z)]) for rho, z in ring]
    centre = np.array([*hole.centre, 0.0])
    liner.strip(rows[0], rows[1], lambda at: (centre - at) * (1.0, 1.0, 0.0))
    for a, b in pairwise(rows[1:]):
        liner.strip(a, b, (0.0, 0.0, 1.0))
    for k, inward in ((0, 1), (-1, -2)):  # its ends: the rail is hollow behind them
        end = np.array([row[k] for row in rows])
        liner.strip(end, end * (1.0, 1.0, 0.0), rows[0][k] - rows[0][inward])
    whole = np.linspace(0.0, 2 * math.pi, 49)
    deep = -SKIRT * shape.size
    # It reaches under the cloth: the two have other corners.
    brim = [(1.02 * hole.radius, -LIFT * shape.size), (hole.radius, -LIFT * shape.size), (hole.radius, deep)]
    edge, rim, floor = (np.column_stack([hole.around(rho, whole), np.full(49, z)]) for rho, z in brim)
    inside.strip(edge, rim, (0.0, 0.0, 1.0))
    inside.strip(rim, floor, lambda at: (centre - at) * (1.0, 1.0, 0.0))
    inside.fan(hole.around(hole.radius, whole[:-1]), deep)


def _minus(intervals: Intervals, gap: tuple[float, float]) -> Intervals:
    parts = [part for low, high in intervals for part in ((low, min(high, gap[0])), (max(low, gap[1]), high))]
    return [(low, high) for low, high in parts if high > low]


def _without(intervals: Intervals, x: float, discs: Sequence[tuple[F64, float]]) -> Intervals:
    """Intervals of y on the line at x, less what lies in discs."""
    for centre, radius in discs:
        half = radius**2 - (x - centre[0]) ** 2
        if half > 0:
            intervals = _minus(intervals, (centre[1] - math.sqrt(half), centre[1] + math.sqrt(half)))
    return intervals


def _parted(intervals: Callable[[float], Intervals], at: list[float], hair: float) -> list[float]:
    """The lines `at` and those between them where an interval begins or ends."""
    found = at[:1]
    for right in at[1:]:
        low, high = found[-1] + hair, right - hair
        while low < high and len(intervals(low)) != len(intervals(high)):
            a, b = low, high
            while b - a > 0.1 * hair:
                middle = 0.5 * (a + b)
                a, b = (middle, b) if len(intervals(middle)) == len(intervals(low)) else (a, middle)
            found.append(b)
            low = b + hair
        found.append(right)
    return found


Facing = Sequence[float] | Callable[[F64], F64]


class _Mesh:
    """Triangles of one kind in the making."""

    def __init__(self) -> None:
        self.points: list[F64] = []
        self.normals: list[F64] = []
        self.faces: list[I64] = []
        self._count = 0

    def add(self, points: F64, normals: F64, faces: I64) -> None:
        self.points.append(points)
        self.normals.append(normals)
        self.faces.append(faces + self._count)
        self._count += len(points)

    def fan(self, outline: F64, z: float) -> None:
        """A convex polygon (n, 2) that lies level."""
        n = len(outline)
        faces = np.array([(0, i, i + 1) for i in range(1, n - 1)])
        self.add(np.column_stack([outline, np.full(n, z)]), np.tile((0.0, 0.0, 1.0), (n, 1)), faces)

    def strip(self, a: F64, b: F64, facing: Facing) -> None:
        """Quadrangles between two lines of n points (n, 3), each with its own normal on the side of `facing`."""
        corners = np.stack([a[:-1], a[1:], b[1:], b[:-1]], axis=1)
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        size = np.linalg.norm(normal, axis=1)
        corners, normal = corners[size > 0], normal[size > 0] / size[size > 0, None]
        wanted = facing(corners.mean(axis=1)) if callable(facing) else np.asarray(facing)
        normal = normal * np.where(np.sum(normal * wanted, axis=1) < 0, -1.0, 1.0)[:, None]
        first = 4 * np.arange(len(corners))[:, None]
        faces = (first + np.array([[0, 1, 2, 0, 2, 3]])).reshape(-1, 3)
        self.add(corners.reshape(-1, 3), np.repeat(normal, 4, axis=0), faces)

    def columns(
        self,
        intervals: Callable[[float], Intervals],
        ends: list[float],
        discs: Sequence[tuple[F64, float]],
        z: float,
    ) -> None:
        """A level region, given by its intervals of y on each line at x; `ends` and `discs` are where these bend."""
        turn = np.cos(np.linspace(math.pi, 0.0, 33))
        at = np.unique(np.concatenate([ends, *(centre[0] + radius * turn for centre, radius in discs)]))
        at = at[(at >= min(ends)) & (at <= max(ends))]
        hair = 1e-8 * float(at[-1] - at[0])
        at = at[np.append(True, np.diff(at) > 0.001 * hair)]
        lines = _parted(intervals, at.tolist(), hair)
        sides = [(intervals(left + hair), intervals(right - hair)) for left, right in pairwise(lines)]
        # Corners on each line at x, of both its sides: a corner within an edge would leave a crack.
        marks: list[set[float]] = [set() for _ in lines]
        for k, pair in enumerate(sides):
            for j in (0, 1):
                marks[k + j].update(y for interval in pair[j] for y in interval)
        for k, (here, there) in enumerate(sides):
            for spans in zip(here, there, strict=True):
                left, right = (
                    [(lines[i], y, z) for y in sorted(marks[i]) if low <= y <= high]
                    for i, (low, high) in zip((k, k + 1), spans, strict=True)
                )
                n, m = len(left), len(right)
                faces = [(0, n + i, n + i + 1) for i in range(m - 1)]
                faces += [(n + m - 1, i + 1, i) for i in range(n - 1)]
                self.add(np.array(left + right), np.tile((0.0, 0.0, 1.0), (n + m, 1)), np.array(faces))

    def part(self, kind: str) -> Part:
        return Part(
            kind, np.concatenate(self.points), np.concatenate(self.normals), np.concatenate(self.faces)
        )
