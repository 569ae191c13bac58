"""Walls as the auditor sees them: gap, normal and velocity of a surface at any time, from its shape and its laws of motion.

Normals point from the wall to the ball. Pieces of surfaces are sheets with two faces: a centre is on the
side of the one that it meets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from carom.arrays import F64, Bool
from carom.audit.formula import law
from carom.audit.vectors import EPS, UP, direction, dot, norm, rotated, unit
from carom.scene.assembly.triangles import Triangles

GONE = 1e-9
"""Relative to the time at which a wall is taken away: times of frames are rounded."""
ON_TIME = 1e-6
"""A wall is taken away with a step that begins by this share of itself before its time."""
ROUNDING = 8.0 * EPS
"""Below this share of its height along an axis a distance from that is rounding, without a direction."""


class Surface:
    """One wall: `shape` as models keep it (kind and parameters), a point of it, and its motion or None."""

    def __init__(self, shape: Sequence[Any], point: Any, material: int, motion: Mapping[str, Any] | None):
        self.kind = str(shape[0])
        self.mesh: Triangles | None = shape[1] if self.kind == "mesh" else None
        """The triangles of a mesh, of which balls touch parts."""
        self.part = False
        """Whether it is such a part, which goes on beyond its ends."""
        numbers = () if self.mesh is not None else shape[1:]
        self.parameters = tuple(np.asarray(p, dtype=np.float64) for p in numbers)
        self.motion = motion
        self.point = np.asarray(point, dtype=np.float64)
        self.material = material
        motion = motion or {}
        self.translation = motion.get("translation")
        self.rotation = motion.get("rotation")
        self.sliding = motion.get("surface_velocity")
        self.spinning = motion.get("surface_rotation")
        self.until = float(motion.get("until", math.inf))
        """When it is taken away, s."""
        self.last = self.until
        """End of the last step that it is there, s: it is taken away between two steps."""

    @property
    def moves(self) -> bool:
        """Whether the shape or its material moves."""
        return any(m is not None for m in (self.translation, self.rotation, self.sliding, self.spinning))

    @property
    def travels(self) -> bool:
        """Whether the shape itself moves."""
        return self.translation is not None or self.rotation is not None

    @property
    def flat(self) -> bool:
        """A plane without end: its normal does not depend on where it is met."""
        return self.kind in ("plane", "sheet")

    @property
    def curvature(self) -> float:
        """Largest curvature of the face, 1/m; edges of pieces are sharper than that (infinite)."""
        if self.kind in ("rectangle", "disc"):
            return math.inf
        if self.part:
            return 0.0 if self.kind == "sheet" else math.inf
        if self.kind == "sphere":
            return 1.0 / float(self.parameters[0])
        if self.kind == "cylinder":
            return 1.0 / float(self.parameters[1]) if math.isinf(float(self.parameters[2])) else math.inf
        return math.inf if self.kind == "cone" else 0.0

    def pose(self, time: F64) -> tuple[F64, F64, F64]:
        """Pivot (3,), displacement (K, 3) and rotation as quaternions (K, 4) at the times (K,)."""
        time = np.atleast_1d(time)
        shift = np.zeros((len(time), 3))
        if self.translation is not None:
            shift = np.stack([law(form, time)[0] for form in self.translation], axis=1)
        turn = np.zeros((len(time), 4))
        turn[:, 0] = 1.0
        if self.rotation is None:
            return np.zeros(3), shift, turn
        axis, pivot, form = self.rotation
        half = 0.5 * law(form, time)[0]
        turn[:, 0], turn[:, 1:] = np.cos(half), np.outer(np.sin(half), np.asarray(axis))
        return np.asarray(pivot, dtype=np.float64), shift, turn

    def place(self, time: F64) -> F64:
        """Where the wall's point is at the times (K,), (K, 3)."""
        pivot, shift, turn = self.pose(time)
        return pivot + shift + rotated(turn, np.broadcast_to(self.point - pivot, shift.shape))

    def local(self, time: F64, x: F64) -> F64:
        """Places (K, 3) in the axes of the wall where it stood at the start."""
        if not self.travels:
            return x
        pivot, shift, turn = self.pose(time)
        return pivot + rotated(turn * np.array([1.0, -1.0, -1.0, -1.0]), x - shift - pivot)

    def meet(self, time: F64, x: F64, radius: F64) -> tuple[F64, F64]:
        """Gap (K,), m, and normal (K, 3) of balls at the places `x` (K, 3) at the times (K,).

        A wall that has been taken away is infinitely far. It is there at the end of the step that ends at that time.
        """
        gap, normal = self._meet(self.local(time, x) - self.point, radius)
        if self.rotation is not None:
            normal = rotated(self.pose(time)[2], normal)
        return np.where(self.there(time), gap, np.inf), normal

    def there(self, time: F64) -> Bool:
        """Whether it is there at the times (K,)."""
        return np.asarray(time <= self.last * (1.0 + GONE))

    def taken_by_steps(self, h: float) -> None:
        """Let it be there to the end of the step of `h` (s) in which its time comes."""
        if math.isfinite(self.until):
            self.last = h * math.ceil(self.until / h - ON_TIME)

    def velocity(self, time: F64, p: F64, *, end: bool = False) -> tuple[F64, F64, F64]:
        """Velocity of the shape and of the material at points (K, 3), and angular velocity of the material, each (K, 3): as
        the step has it that begins at the times (K,), or the one that ends there.
        """
        time = np.broadcast_to(time, len(p))
        pivot, shift, turn = self.pose(time)
        shape, spin = np.zeros_like(p), np.zeros_like(p)
        if self.translation is not None:
            shape = np.stack([law(form, time, before=end)[1] for form in self.translation], axis=1)
        if self.rotation is not None:
            axis, _, form = self.rotation
            spin = np.outer(law(form, time, before=end)[1], np.asarray(axis))
            shape = shape + np.cross(spin, p - pivot - shift)
        material, of_material = np.array(shape), np.array(spin)
        if self.sliding is not None:
            material += rotated(turn, np.broadcast_to(self.sliding, p.shape))
        if self.spinning is not None:
            axis, point, rate = self.spinning
            own = rate * rotated(turn, np.broadcast_to(axis, p.shape))
            place = pivot + shift + rotated(turn, np.broadcast_to(np.asarray(point) - pivot, p.shape))
            material += np.cross(own, p - place)
            of_material += own
        return shape, material, of_material

    def turning(self, time: F64) -> F64:
        """Fastest turn of the shape and of its material in the steps that end at the times (K,), rad/s: by so much per metre
        velocities vary.
        """
        rate = np.zeros(len(time))
        if self.rotation is not None:
            rate = np.abs(law(self.rotation[2], time, before=True)[1])
        if self.spinning is not None:
            rate = rate + abs(float(self.spinning[2]))
        return rate

    def height(self, local: F64) -> tuple[F64, F64]:
        """Signed distance (K,) of places, in the wall's own axes, over the face of a piece of a surface, m, and how far
        within its outline they are, m (negative: beyond it). For rectangles, discs, tubes with ends and cones.
        """
        away = local - self.point
        if self.kind == "rectangle":
            normal, side, size = self.parameters
            across = np.cross(normal, side)
            inside = np.minimum(0.5 * size[0] - np.abs(away @ side), 0.5 * size[1] - np.abs(away @ across))
            return away @ normal, inside
        along, radial, _ = self._profile(away)
        if self.kind == "disc":
            _, radius, hole = self.parameters
            inner = radial - hole if hole > 0 else np.full_like(radial, np.inf)
            return along, np.minimum(radius - radial, inner)
        (u0, v0), (du, dv), length, sign = self._line()
        u, v = along - u0, radial - v0
        place = (u * du + v * dv) / length
        return sign * (v * du - u * dv) / length, np.minimum(place, length - place)

    @property
    def sheet(self) -> bool:
        """Whether it is a piece of a surface, with two faces."""
        if self.kind == "cylinder":
            return not math.isinf(float(self.parameters[2]))
        return self.kind in ("rectangle", "disc", "cone")

    def _line(self) -> tuple[tuple[float, float], tuple[float, float], float, float]:
        """Of tubes with ends and cones: start and way of the profile along and across the axis, its length, the side."""
        numbers = [float(p) for p in self.parameters[1:]]
        if self.kind == "cone":
            start, way = (0.0, numbers[0]), (numbers[2], numbers[1] - numbers[0])
        else:
            start, way = (-0.5 * numbers[1], numbers[0]), (numbers[1], 0.0)
        inside = bool(numbers[-1])
        return start, way, math.hypot(*way), -1.0 if inside else 1.0

    def _profile(self, away: F64) -> tuple[F64, F64, F64]:
        """Places along the axis, distances from it, and unit vectors away from it."""
        axis = self.parameters[0]
        along = away @ axis
        across = away - np.outer(along, axis)
        radial = np.linalg.norm(across, axis=1)
        # On the axis any direction across it will do: of none the nearest point would lie on the axis, in the opening.
        off = radial > ROUNDING * np.abs(along)
        outward = unit(across) - np.outer(unit(across) @ axis, axis)
        return along, np.where(off, radial, 0.0), np.where(off[:, None], unit(outward), _across(axis))

    def _meet(self, away: F64, radius: F64) -> tuple[F64, F64]:
        if self.kind == "plane":
            normal = np.broadcast_to(self.parameters[0], away.shape)
            return dot(away, normal) - radius, normal
        if self.kind == "sheet":
            height = away @ self.parameters[0]
            side = np.where(height < 0.0, -1.0, 1.0)
            return np.abs(height) - radius, np.outer(side, self.parameters[0])
        if self.mesh is not None:
            return self.mesh.distance(away + self.point, 2.0 * radius) - radius, np.zeros_like(away)
        if self.kind == "sphere":
            size, inside = self.parameters
            sign = -1.0 if inside else 1.0
            return sign * (np.linalg.norm(away, axis=1) - size) - radius, sign * direction(away, UP)
        if self.kind == "rectangle":
            normal, side, size = self.parameters
            across = np.cross(normal, side)
            u, v = away @ side, away @ across
            near = np.outer(np.clip(u, -0.5 * size[0], 0.5 * size[0]), side)
            near += np.outer(np.clip(v, -0.5 * size[1], 0.5 * size[1]), across)
            within = (np.abs(u) <= 0.5 * size[0]) & (np.abs(v) <= 0.5 * size[1])
            return _from(away - near, np.broadcast_to(normal, away.shape), away @ normal, radius, within)
        along, radial, outward = self._profile(away)
        axis = self.parameters[0]
        if self.kind == "disc":
            near = np.clip(radial, self.parameters[2], self.parameters[1])[:, None] * outward
            within = (radial <= self.parameters[1]) & (radial >= self.parameters[2])
            return _from(away - near, np.broadcast_to(axis, away.shape), along, radius, within, axis)
        if self.kind == "cylinder" and math.isinf(float(self.parameters[2])):
            sign = -1.0 if self.parameters[3] else 1.0
            return sign * (radial - self.parameters[1]) - radius, sign * outward
        (u0, v0), (du, dv), length, sign = self._line()
        u, v = along - u0, radial - v0
        where = (u * du + v * dv) / length
        within = (where >= 0.0) & (where <= length)
        place = np.clip(where, 0.0, length)
        near = np.outer(u0 + place * du / length, axis) + (v0 + place * dv / length)[:, None] * outward
        face = sign * (du * outward - np.outer(np.full(len(u), dv), axis)) / length
        return _from(away - near, face, sign * (v * du - u * dv) / length, radius, within, axis)


def _across(axis: F64) -> F64:
    """Of a unit vector one across it: that which the core takes."""
    x, y, z = axis
    sign = math.copysign(1.0, z)
    share = -1.0 / (sign + z)
    return np.array([x * y * share, sign + y * y * share, -y])


def _from(arm: F64, face: F64, height: F64, radius: F64, within: Bool, rim: F64 = UP) -> tuple[F64, F64]:
    """Gap and normal from the arm of the nearest point: within the outline the height counts, at edges the distance; the
    normal of a centre on the `rim` itself.
    """
    gap = np.where(within, np.abs(height), norm(arm)) - radius
    side = np.where(height < 0.0, -1.0, 1.0)[:, None]
    return gap, np.where(within[:, None], side * face, direction(arm, rim))
