"""The form of a table as pages, films and figures draw it, made from the measures of `Spec` alone.

`Shape` has the outlines seen from above, `carom.scene.billiards.solid` makes surfaces of them. Measures that no rule of the
game fixes, as the width of the rails, are in radii of a ball. Frame of the table: x along it, y across, z up, the bed at
z = 0; lengths in m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from carom.arrays import F64
from carom.scene.billiards.data import BAULK, D_RADIUS, SNOOKER
from carom.scene.billiards.table import Table
from carom.scene.billiards.walls import noses

BED = "bed"
"""Name of the plane on which balls lie."""
# In radii of a ball.
CUSHION = 1.8
"""From the nose to the wood: 2 in with pool's balls."""
RAIL = 5.1
"""From the nose to the outer edge."""
RISE = 0.3
"""Of the rail over the nose."""
SKIRT = 3.2
"""Of the outer side below the bed."""
SIGHT = 3.28
"""From the nose to the middle of a sight: WPA's 3 11/16 in with pool's balls."""
DIAMOND = (0.42, 0.28)
"""Half axes of a sight, along and across the rail."""
LINER = 0.45
"""Width of the ring around a pocket."""
SPOT = 0.17
LIFT = 0.015
"""By how much marks lie over what they are on, so that neither hides the other."""


@dataclass(frozen=True)
class Hole:
    """A pocket as a circle: `axis` (2,) points out of the table, `mouth` (rad) is the half angle open to it."""

    name: str
    centre: F64
    radius: float
    axis: F64
    mouth: float

    def around(self, radius: float, angles: F64) -> F64:
        """Points (n, 2) at angles from the direction towards the table, to the right of it seen from the pocket."""
        inward = -self.axis
        side = np.array([-inward[1], inward[0]])
        return self.centre + radius * (np.outer(np.cos(angles), inward) + np.outer(np.sin(angles), side))


@dataclass(frozen=True)
class Cushion:
    """A straight piece of rubber: its nose from `start` along `way` (2,) for `length`, its ends leaning by `slopes`: how far
    each goes along for every metre outwards.
    """

    start: F64
    way: F64
    length: float
    slopes: tuple[float, float]

    @property
    def out(self) -> F64:
        return np.array([self.way[1], -self.way[0]])


class Shape:
    """What is drawn of a table."""

    def __init__(self, table: Table) -> None:
        self.table = table
        spec, r = table.spec, table.spec.ball_radius
        self.size = r
        self.length, self.width = spec.length, spec.width
        self.cushion, self.liner = CUSHION * r, LINER * r
        self.nose, self.top = spec.nose_height, spec.nose_height + RISE * r
        self.holes = [self._hole(name, at) for name, at in table.pockets.items()]
        middle = 0.5 * np.array([self.length, self.width])
        reach = [float((np.abs(hole.centre - middle) - middle).max()) + hole.radius for hole in self.holes]
        self.rail = max(RAIL * r, max(reach, default=0.0) + self.liner + 0.4 * r)  # a pocket is within it
        self.cushions = self._cushions()

    @property
    def walls(self) -> set[str]:
        """Names of the walls of a scene that stand for what is drawn here, but for the bed."""
        return {name for name, _, _ in noses(self.table.spec)}

    @property
    def box(self) -> tuple[F64, F64]:
        """The least and greatest coordinates, (3,) each."""
        low = np.array([-self.rail, -self.rail, -SKIRT * self.size])
        return low, np.array([self.length + self.rail, self.width + self.rail, self.top])

    def frame(self, out: float, corner: float, around: int = 12) -> F64:
        """A rectangle `out` outside of the noses, its corners rounded with the radius `corner`: (n, 2)."""
        angle = np.linspace(0.0, 0.5 * math.pi, around)
        arc = corner * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        turned = [arc, arc @ [[0, 1], [-1, 0]], -arc, arc @ [[0, -1], [1, 0]]]
        x, y = self.length + out - corner, self.width + out - corner
        low = corner - out
        middles = [(x, y), (low, y), (low, low), (x, low)]
        return np.concatenate([middle + part for middle, part in zip(np.array(middles), turned, strict=True)])

    @cached_property
    def corner(self) -> float:
        """Radius of the outer corners."""
        return 2.4 * self.size

    @cached_property
    def sights(self) -> list[F64]:
        """Diamonds (4, 2) at eighths of the long rails and quarters of the short ones; snooker has none."""
        if self.table.spec.name == "snooker":
            return []
        along, across = DIAMOND[0] * self.size, DIAMOND[1] * self.size
        away = SIGHT * self.size
        long = [(k / 8 * self.length, y) for k in range(1, 8) for y in (-away, self.width + away)]
        if self.holes:
            long = [(x, y) for x, y in long if abs(x - 0.5 * self.length) > 1e-9]
        short = [(x, k / 4 * self.width) for k in range(1, 4) for x in (-away, self.length + away)]
        flat = np.array([(along, 0), (0, across), (-along, 0), (0, -across)])
        return [at + flat for at in np.array(long)] + [at + flat[:, ::-1] for at in np.array(short)]

    @cached_property
    def lines(self) -> list[F64]:
        """Spots and lines on the cloth, convex polygons (n, 2)."""
        middle, marked = 0.5 * self.width, self.table.spots
        if self.table.spec.name == "snooker":
            marked = {name: marked[name] for name in SNOOKER}
        elif self.holes:
            marked = {name: marked[name] for name in ("foot spot", "head spot")}
        angle = np.linspace(0.0, 2 * math.pi, 20, endpoint=False)
        circle = SPOT * self.size * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        found = [np.array(at) + circle for at in marked.values()]
        if self.table.spec.name == "snooker":
            half = 0.04 * self.size
            found.append(
                np.array(
                    [
                        (BAULK - half, 0),
                        (BAULK + half, 0),
                        (BAULK + half, self.width),
                        (BAULK - half, self.width),
                    ]
                )
            )
            turn = np.linspace(0.5 * math.pi, 1.5 * math.pi, 49)
            arc = np.stack([np.cos(turn), np.sin(turn)], axis=1)
            inner, outer = ((BAULK, middle) + (D_RADIUS + k * half) * arc for k in (-1, 1))
            found += [np.array([inner[i], outer[i], outer[i + 1], inner[i + 1]]) for i in range(len(arc) - 1)]
        return found

    def rubber(self, cushion: Cushion) -> F64:
        """The outline of a cushion seen from above, (n, 2), its nose first."""
        depth = np.linspace(0.0, self.cushion, 13)
        first, last = self.ends(cushion, depth)
        return np.concatenate(
            [
                placed(cushion, first[:1], depth[:1]),
                placed(cushion, last, depth),
                placed(cushion, first, depth)[:0:-1],
            ]
        )

    # --- what it is made of ---------------------------------------------------------------------------------------

    def _hole(self, name: str, at: tuple[float, float]) -> Hole:
        spec = self.table.spec
        toward = np.array([0.5 * self.length, 0.5 * self.width]) - at
        if name.startswith("side"):
            axis = np.array([0.0, -math.copysign(1.0, toward[1])])
            mouth, shelf, lean = spec.side_mouth, spec.side_shelf, spec.side_angle - 0.5 * math.pi
            middle = np.array(at)
        else:
            axis = -np.sign(toward) / math.sqrt(2)
            mouth, shelf, lean = spec.corner_mouth, spec.corner_shelf, spec.corner_angle - 0.75 * math.pi
            middle = at - 0.5 * mouth * axis
        # The circle touches the edge of the slate and is a little wider than the throat between the facings.
        tangent = math.tan(lean)
        radius = 1.1 * (0.5 * mouth - shelf * tangent) / max(1.0 + tangent, 0.3)
        radius = min(max(radius, 1.15 * self.size), 0.75 * mouth)
        depth = shelf + radius
        # Where the facing, which starts at the point of the mouth, meets it; at its nearest place if it does not.
        start = np.array([-depth, 0.5 * mouth])
        along = np.array([math.cos(lean), -math.sin(lean)])
        nearest = -float(start @ along)
        miss = float(start @ start) - nearest**2
        meets = start + (nearest - math.sqrt(max(radius**2 - miss, 0.0))) * along
        return Hole(name, middle + depth * axis, radius, axis, math.atan2(meets[1], -meets[0]))

    def _cushions(self) -> list[Cushion]:
        lines = noses(self.table.spec)
        facings = {name: (np.array(a), np.array(b)) for name, a, b in lines if name.startswith("facing")}
        found = []
        for name, a, b in lines:
            if not name.startswith("cushion"):
                continue
            start, end = np.array(a), np.array(b)
            length = math.dist(a, b)
            way = (end - start) / length
            out = np.array([way[1], -way[0]])
            slopes = []
            for tip, point, sign in (("a", start, -1.0), ("b", end, 1.0)):
                facing = facings.get(name.replace("cushion", "facing") + f" {tip}")
                if facing is None:
                    slopes.append(1.0)  # mitred
                    continue
                deep = facing[0] if tip == "a" else facing[1]
                slopes.append(sign * float((deep - point) @ way) / float((deep - point) @ out))
            found.append(Cushion(start, way, length, (slopes[0], slopes[1])))
        return found

    def ends(self, cushion: Cushion, depth: F64) -> tuple[F64, F64]:
        """Where a cushion begins and ends along its nose at distances behind it, not in a pocket: (n,) each."""
        first = -cushion.slopes[0] * depth
        last = cushion.length + cushion.slopes[1] * depth
        for hole in self.holes:
            at = hole.centre - cushion.start
            along, behind = float(at @ cushion.way), float(at @ cushion.out)
            reach = hole.radius + 0.25 * self.liner  # the liner stands before the rubber
            half = np.sqrt(np.maximum(reach**2 - (depth - behind) ** 2, 0.0))
            inside = half > 0
            if along < 0.5 * cushion.length:
                first = np.where(inside, np.maximum(first, along + half), first)
            else:
                last = np.where(inside, np.minimum(last, along - half), last)
        return first, last


def placed(cushion: Cushion, along: F64, behind: F64) -> F64:
    """Points (n, 2) at distances along the nose of a cushion and behind it."""
    return cushion.start + np.outer(along, cushion.way) + np.outer(behind, cushion.out)
