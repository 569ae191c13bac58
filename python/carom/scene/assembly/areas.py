"""The area on which the pressure of a free plane acts, where the scenario leaves it to what stands around it."""

from __future__ import annotations

from collections.abc import Sequence

from carom.scene.assembly.placing import Placed
from carom.scene.assembly.vectors import dot
from carom.scene.tables.walls import PLANE, direction_of

PARALLEL = 1e-9
"""Cosine by which directions may differ from parallel or square ones, as in the core (`wall/free.rs`)."""

Side = tuple[str, int] | tuple[str, int, int]
"""`("period", axis)`, or `("between", wall, wall)` with numbers of parallel planes."""


def sides(number: int, surfaces: Sequence[Placed], periods: Sequence[float] | None) -> list[Side]:
    """What the area of plane `number` lies between: two sides at right angles, or none where there is no such area.

    They are periods of the world across its normal, and pairs of planes without end that face each other there.
    """
    normal = _normal(surfaces[number])
    found: list[tuple[list[float], Side]] = []
    for axis, length in enumerate(periods or ()):
        along = [float(k == axis) for k in range(3)]
        if length > 0.0 and _square(along, normal):
            found.append((along, ("period", axis)))
    planes = [k for k, wall in enumerate(surfaces) if wall.kind == PLANE and not _turns(wall)]
    for a in planes:
        for b in planes:
            along, back = _normal(surfaces[a]), _normal(surfaces[b])
            apart = [q - p for p, q in zip(surfaces[a].point, surfaces[b].point, strict=True)]
            facing = dot(along, back) < PARALLEL - 1.0 and dot(along, apart) > 0.0
            if a < b and facing and _square(along, normal):
                found.append((along, ("between", a, b)))
    fits = len(found) == 2 and _square(found[0][0], found[1][0])
    return [side for _, side in found] if fits else []


def area(number: int, surfaces: Sequence[Placed], periods: Sequence[float] | None) -> float:
    """That of plane `number` at the start, m^2; 1 where there is none."""
    found = 1.0
    for side in sides(number, surfaces, periods):
        if len(side) == 3:
            from_, to = surfaces[side[1]], surfaces[side[2]]
            found *= dot(_normal(from_), [q - p for p, q in zip(from_.point, to.point, strict=True)])
        else:
            found *= (periods or ())[side[1]]
    return found


def _normal(wall: Placed) -> list[float]:
    return direction_of(wall.shape[1])


def _square(a: Sequence[float], b: Sequence[float]) -> bool:
    return abs(dot(a, b)) < PARALLEL


def _turns(wall: Placed) -> bool:
    return wall.motion is not None and wall.motion.rotation is not None
