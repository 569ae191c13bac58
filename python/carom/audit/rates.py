"""Relative velocities at contacts (eqs. 34, 41), without the motion of walls and images (algorithm, sections 10 and 16)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64
from carom.audit.data import Run
from carom.audit.vectors import across, cross, dot


@dataclass(frozen=True)
class Rates:
    """At K contacts: normal velocity (K,), slip velocity and relative angular velocity (K, 3)."""

    normal: F64
    slip: F64
    turning: F64


class Pairs(NamedTuple):
    """K pairs of bodies, of which B may be a wall, with the places at which a wall's velocity is taken."""

    a: I64
    b: I64
    time: F64
    centre: F64
    """Centres of A, (K, 3)."""
    foot: F64
    """Normals at which A touches B, (K, 3): `centre - r foot` is the place of a wall that counts."""
    end: bool
    """Whether the times are those of the ends of steps."""
    image: F64 | None
    """(K, 3) which images of B are met (`Run.image`)."""
    riding: F64 | None = None
    """Centres of A for the velocities of the wall's material, (K, 3), where they are others."""

    def of(self, rows: slice | I64) -> Pairs:
        """Some of them."""
        a, b, time = self.a[rows], self.b[rows], self.time[rows]
        image, riding = (None if x is None else x[rows] for x in (self.image, self.riding))
        return Pairs(a, b, time, self.centre[rows], self.foot[rows], self.end, image, riding)


def rates(run: Run, p: Pairs, motion: tuple[F64, F64, F64, F64], normal: F64, lever: F64) -> Rates:
    """`motion`: v and w of A, v and w of B, each (K, 3), of which those of B do not count at walls. The normal row is along
    `normal`, the others in the frame of `lever`.
    """
    v_a, w_a, v_b, w_b = motion
    wall = p.b >= run.bodies
    r_a, r_b = run.radius[p.a], run.reach[np.minimum(p.b, run.bodies)]
    v_b, w_b = (np.where(wall[:, None], 0.0, x) for x in (v_b, w_b))
    through, slipping, turning = v_a - v_b, v_a - v_b, w_a - w_b
    slipping = slipping + cross(lever, r_a[:, None] * w_a + r_b[:, None] * w_b)
    if p.image is not None:
        by = run.box.velocity(p.time, p.image, end=p.end)
        through, slipping = through - by, slipping - by
    for w, rows in run.on_walls(p.b):
        surface = run.walls[w]
        if not surface.moves:
            continue
        foot, time = r_a[rows, None] * p.foot[rows], p.time[rows]
        shape, material, spin = surface.velocity(time, p.centre[rows] - foot, end=p.end)
        if p.riding is not None:
            material = surface.velocity(time, p.riding[rows] - foot, end=p.end)[1]
        through[rows] -= shape
        slipping[rows] -= material
        turning[rows] -= spin
    return Rates(dot(through, normal), across(slipping, lever), turning)


def compliance(run: Run, a: I64, b: I64) -> tuple[F64, F64, F64]:
    """(K,) own compliances `D_cc` of the normal, the sliding and the turning rows (algorithm, section 2)."""
    m, i, r = np.append(run.mass, np.inf), np.append(run.inertia, np.inf), run.reach
    other = np.minimum(b, run.bodies)
    normal = 1.0 / m[a] + 1.0 / m[other]
    across = np.where(run.is_free_wall(b), 1.0 / m[a], normal)  # a guide holds free walls there
    turning = 1.0 / i[a] + 1.0 / i[other]
    return normal, across + r[a] ** 2 / i[a] + r[other] ** 2 / i[other], turning
