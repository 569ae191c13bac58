"""Rows of balls that one ball hits: the scenes with which impact laws are compared."""

from __future__ import annotations

import math
from typing import Any

from carom.errors import CaromError
from carom.numeric import is_whole
from carom.scene.scene import Scene
from carom.units import number

MATERIAL = "ball"


def chain(
    count: int,
    *,
    radius: float = 0.01,
    taper: float = 1.0,
    between: float | None = None,
    gap: float = 0.0,
    speed: float = 1.0,
    density: float = 7800.0,
    friction: float = 0.0,
    restitution: float = 1.0,
) -> Scene:
    """A row of balls along x, "1" to `count`, without gravity; the first one hits the others, which are at rest.

    Lengths in m, `speed` in m/s, `density` in kg/m^3, or texts with a unit. Each radius is `taper` times the one before;
    with `between` (m) every second ball has that radius (decorated chain). With `gap` 0 the balls touch, and one step sees
    the impact; else the run lasts until every gap can have been crossed three times.
    """
    radii = _radii("chain", count, radius, taper, between)
    gap = _number("chain", "gap", gap, "length", zero=True)
    speed = _number("chain", "speed", speed, "speed")
    scene = _empty((0.0, 0.0, 0.0), friction, restitution)
    _row(scene, radii, density, gap, 0.0, (1.0, 0.0, 0.0))
    scene.spheres[0].velocity = (speed, 0.0, 0.0)
    return _timed(scene, min(radii), speed, 3.0 * gap * (count - 1) / speed)


def column(
    count: int,
    *,
    radius: float = 0.01,
    taper: float = 1.0,
    speed: float = 1.0,
    density: float = 7800.0,
    friction: float = 0.0,
    restitution: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """Balls that stand on one another on a floor, "1" below; the topmost one, `count`, hits them from above.

    Lengths in m, `speed` in m/s, `density` in kg/m^3, `gravity` in m/s^2.
    """
    radii = _radii("column", count, radius, taper, None)
    speed = _number("column", "speed", speed, "speed")
    gravity = _number("column", "gravity", gravity, "acceleration", zero=True)
    scene = _empty((0.0, 0.0, -gravity), friction, restitution)
    scene.plane("floor", material=MATERIAL, point=(0, 0, 0), normal=(0, 0, 1))
    _row(scene, radii, density, 0.0, radii[0], (0.0, 0.0, 1.0))
    scene.spheres[-1].velocity = (0.0, 0.0, -speed)
    return _timed(scene, min(radii), speed, 0.0)


def cradle(
    count: int,
    *,
    lifted: int = 1,
    angle: float | str = 30.0,
    length: float = 0.2,
    radius: float = 0.01,
    hits: float = 20,
    density: float = 7800.0,
    friction: float = 0.0,
    restitution: float = 1.0,
    gravity: float = 9.81,
) -> Scene:
    """Newton's cradle: balls that touch hang along x, "1" to `count`; the first ones are let go from an angle in degrees.

    `length` of the rods and `radius` in m, `density` in kg/m^3, `gravity` in m/s^2, or texts with a unit. The run lasts for
    `hits` hits.
    """
    _count("cradle", "count", count, 2)
    if _count("cradle", "lifted", lifted, 1) >= count:
        raise CaromError(f"cradle: lifted must be less than count, {count} balls, found {lifted}")
    radius, length = (_number("cradle", k, v, "length") for k, v in (("radius", radius), ("length", length)))
    gravity, hits = _number("cradle", "gravity", gravity, "acceleration"), _number("cradle", "hits", hits)
    degrees = math.degrees(number("cradle", "angle", angle, "angle")) if isinstance(angle, str) else angle
    if not 0.0 < _number("cradle", "angle", degrees) <= 90.0:
        raise CaromError(f"cradle: angle must be at most 90 degrees, found {angle!r}")
    scene = _empty((0.0, 0.0, -gravity), friction, restitution)
    way = math.radians(degrees)
    for k in range(count):
        name, hook, turn = str(k + 1), (2 * radius * k, 0.0, 0.0), way if k < lifted else 0.0
        place = (hook[0] - length * math.sin(turn), 0.0, -length * math.cos(turn))
        scene.sphere(name, radius=radius, material=MATERIAL, density=density, position=place)
        scene.joint("rod", between=[name, "ground"], points=[place, hook])
    half = math.pi * math.sqrt(length / gravity) * (1 + way**2 / 16)
    step = 2.5e-4 * half
    return scene.with_options(step=step, until=round(hits * half / step) * step)


def _radii(call: str, count: int, radius: float, taper: float, between: float | None) -> list[float]:
    _count(call, "count", count, 2)
    radius, taper = _number(call, "radius", radius, "length"), _number(call, "taper", taper)
    if between is None:
        return [radius * taper**k for k in range(count)]
    if taper != 1.0:
        raise CaromError(f"{call}: give taper or between, not both")
    between = _number(call, "between", between, "length")
    return [between if k % 2 else radius for k in range(count)]


def _count(call: str, name: str, value: Any, least: int) -> int:
    if not is_whole(value) or value < least:
        raise CaromError(f"{call}: {name} must be a whole number of at least {least} balls, found {value!r}")
    return int(value)


def _number(call: str, name: str, value: Any, dimension: str | None = None, *, zero: bool = False) -> float:
    found = number(call, name, value, dimension)
    if found < 0.0 or (found == 0.0 and not zero):
        raise CaromError(f"{call}: {name} must be {'zero or ' if zero else ''}positive, found {value!r}")
    return found


def _empty(gravity: tuple[float, float, float], friction: float, restitution: float) -> Scene:
    scene = Scene(gravity=gravity)
    scene.contact(MATERIAL, MATERIAL, friction=friction, restitution=restitution)
    return scene


def _row(
    scene: Scene,
    radii: list[float],
    density: float,
    gap: float,
    first: float,
    way: tuple[float, float, float],
) -> None:
    """Balls with so much between them, the first one `first` m along the `way` from the origin."""
    along = first
    for k, r in enumerate(radii):
        along += (radii[k - 1] + r + gap) if k else 0.0
        x, y, z = (along * part for part in way)
        scene.sphere(str(k + 1), radius=r, material=MATERIAL, density=density, position=(x, y, z))


def _timed(scene: Scene, least: float, speed: float, until: float) -> Scene:
    step = 1e-3 * least / speed
    return scene.with_options(step=step, until=max(1.0, round(until / step)) * step)
