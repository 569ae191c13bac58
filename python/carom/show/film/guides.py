"""Joints and springs as lines, in the forms that the page draws (viewer/src/links.ts).

A rod or a spring leads from end to end. Other joints hold no two points apart, and their ends may be far from each other:
they are drawn as what they leave (a rail, a frame in a plane, a point on a tripod) or take (locked axes).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64

#: In radii of the smaller ball: half of a rail, half of a locked axis, half of the side of a frame, feet of a tripod.
RAIL, AXIS, FRAME = 3.2, 1.45, 1.6
DOWN, ASIDE = 0.45, 0.3


def segments(link: dict[str, Any], begin: F64, end: F64, radius: float, down: F64) -> F64:
    """Ends (L, 2, 3) of the lines of a link whose ends are at `begin` and `end` (3,), m; `down` is a unit vector."""
    if link["kind"] in ("rod", "spring"):
        return np.array([[begin, end]])
    fixed = end if link["b"] < 0 else begin
    found = []
    for axis in np.asarray(link["axes"], dtype=np.float64).reshape(-1, 3):
        if link["kind"] == "plane":
            u, v = _across(axis)
            corners = [
                fixed + FRAME * radius * (p * u + q * v) for p, q in ((1, 1), (-1, 1), (-1, -1), (1, -1))
            ]
            found += list(zip(corners, corners[1:] + corners[:1], strict=True))
        elif link["kind"] in ("line", "motion"):
            found.append((end - RAIL * radius * axis, end + RAIL * radius * axis))
        else:  # a locked axis goes along with its ball
            found.append((begin - AXIS * radius * axis, begin + AXIS * radius * axis))
    if link["kind"] == "fix":
        u, v = _across(down)
        for p, q in ((1.0, 0.0), (-0.5, 0.87), (-0.5, -0.87)):
            found.append((end, end + radius * (DOWN * down + ASIDE * (p * u + q * v))))
    return np.array(found).reshape(-1, 2, 3)


def _across(normal: F64) -> tuple[F64, F64]:
    """Two unit vectors that span the plane across a unit vector, as the page has them."""
    axis = np.eye(3)[int(np.argmax(np.abs(normal) < 0.8))]
    u = axis - (axis @ normal) * normal
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)
