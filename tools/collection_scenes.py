"""The scenes whose contact problems are collected: piles, rows, racks, chutes, tight boxes, lattices (SI, seeded).

Each function gives a scene ready to run; `SCENES` says how long it runs and what is taken of it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import carom
import numpy as np
from carom import CaromWarning
from numpy.typing import NDArray

F64 = NDArray[np.float64]
G = 9.81
DENSITY = 2500.0  # glass, kg/m^3


def empty(title: str, gravity: Any = (0.0, 0.0, -G), **law: float) -> carom.Scene:
    """A scene in which balls and walls obey one law; `friction`, `restitution`, `rolling_radius`, `spinning_radius`."""
    scene = carom.Scene(title, gravity=gravity)
    for other in ("ball", "wall"):
        scene.contact("ball", other, **law)
    return scene


def walls(scene: carom.Scene, low: Any, high: Any, lid: bool = False) -> None:
    """Planes around a box from corner `low` to corner `high`, open above without a `lid`."""
    for axis in range(3):
        for side, corner in ((1.0, low), (-1.0, high)):
            if axis == 2 and side < 0.0 and not lid:
                continue
            normal = side * np.eye(3)[axis]
            name = f"{'xyz'[axis]}{'+' if side > 0 else '-'}"
            scene.plane(name, point=tuple(map(float, corner)), normal=tuple(normal), material="wall")


def balls(scene: carom.Scene, centres: F64, radii: F64, density: Any = DENSITY, velocity: Any = None) -> None:
    """Balls at `centres` (N, 3) with `radii` (N,); one density or (N,)."""
    dense = np.broadcast_to(density, len(radii))
    moves = np.broadcast_to(np.zeros(3) if velocity is None else velocity, centres.shape)
    for k, (x, r, d, v) in enumerate(zip(centres, radii, dense, moves, strict=True)):
        scene.sphere(
            f"ball{k}",
            radius=float(r),
            density=float(d),
            material="ball",
            position=tuple(map(float, x)),
            velocity=tuple(map(float, v)),
        )


def pile(
    count: int,
    seed: int,
    *,
    ratio: float = 1.0,
    masses: float = 1.0,
    until: float = 0.45,
    tight: bool = False,
    **law: float,
) -> carom.Scene:
    """Balls that fell into a box: settled with soft contacts (method penalty), then made as much smaller as they overlap.

    With `tight` they stay as they are, in contacts that are soft no longer. `ratio` is that of the largest radius to the
    smallest, evenly spread in the logarithm; `masses` the same for densities.
    """
    rng = np.random.default_rng(seed)
    largest = 0.01
    spread = rng.uniform(-1.0, 0.0, count)
    radii = largest * (ratio**spread if ratio > 1.0 else 1.0 + 0.1 * spread)
    density = DENSITY * masses ** rng.uniform(0.0, 1.0, count)
    across = max(2, round((0.55 * count) ** (1 / 3)))
    pitch, cells = 2.05 * largest, np.arange(count)
    layer = np.stack([cells % across, cells // across % across, cells // across**2], axis=1)
    centres = (layer + 0.5) * pitch + rng.uniform(-0.01, 0.01, (count, 3)) * largest
    centres[:, 2] += 0.1 * largest
    corner = np.array([across * pitch, across * pitch, 0.0]) + 0.05 * largest
    falling = empty("", **law)
    balls(falling, centres, radii, density, rng.normal(0.0, 0.05, (count, 3)))
    walls(falling, -0.05 * largest * np.array([1.0, 1.0, 0.0]), corner)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)
        end = carom.simulate(
            falling,
            until=until,
            step=2e-3,
            every=10**6,
            contacts=False,
            method="penalty",
            penalty_young_modulus=5e6,
            penalty_resolution=12,
            penalty_slip_speed=1e-2,
        )
    x, v = np.asarray(end.position[-1]), np.asarray(end.velocity[-1])
    shrunk = 1.0 if tight else 1.0 - 1.001 * overlap(x, radii, falling) - 1e-9
    scene = empty(f"pile of {count} balls", **law)
    balls(scene, x, radii * shrunk, density, v)
    walls(scene, -0.05 * largest * np.array([1.0, 1.0, 0.0]), corner)
    return scene


def overlap(x: F64, radii: F64, scene: carom.Scene) -> float:
    """Deepest overlap over the sum of the two radii, or over that of the ball at a wall."""
    order = np.argsort(x[:, 0])
    x, radii = x[order], radii[order]
    deepest = 0.0
    for k in range(len(x)):
        near = slice(k + 1, int(np.searchsorted(x[:, 0], x[k, 0] + 2.0 * radii.max())))
        reach = radii[near] + radii[k]
        between = np.linalg.norm(x[near] - x[k], axis=1)
        deepest = max(deepest, float(np.max(1.0 - between / reach, initial=0.0)))
    model = scene.to_model()
    for point, normal in zip(model["plane_point"], model["plane_normal"], strict=True):
        deepest = max(deepest, float(np.max(1.0 - (x - point) @ normal / radii)))
    return deepest


def row(count: int, friction: float = 0.2, restitution: float = 0.9, masses: float = 1.0) -> carom.Scene:
    """A row of balls that touch, on a table, hit by one more; masses grow by the factor `masses` from ball to ball."""
    r = 0.025
    scene = empty(f"row of {count} balls", friction=friction, restitution=restitution)
    x = np.zeros((count + 1, 3))
    x[1:, 0] = 2.0 * r * np.arange(count)
    x[0] = (-2.0 * r - 1e-3, 0.3 * r, 0.0)
    v = np.zeros_like(x)
    v[0, 0] = 1.0
    balls(scene, x, np.full(count + 1, r), DENSITY * masses ** np.arange(count + 1), v)
    scene.plane("table", point=(0.0, 0.0, -r), normal=(0.0, 0.0, 1.0), material="wall")
    return scene


def rack(count: int, seed: int, friction: float = 0.06, restitution: float = 0.93) -> carom.Scene:
    """A triangle of balls that touch (gap 0), on a cloth, hit off its axis by a cue ball of 5 m/s."""
    r = 0.028575
    rng = np.random.default_rng(seed)
    scene = carom.Scene(f"rack of {count} balls", gravity=(0.0, 0.0, -G))
    scene.contact("ball", "ball", friction=friction, restitution=restitution)
    scene.contact("ball", "cloth", friction=0.2, restitution=0.5, rolling_radius=0.005 * r)
    scene.rack(
        "ball",
        apex=(0.0, 0.0, r),
        direction=(1.0, 0.0, 0.0),
        radius=r,
        mass=0.17,
        material="ball",
        balls=count,
    )
    y = float(rng.uniform(-0.5, 0.5) * r)
    scene.sphere(
        "cue", radius=r, mass=0.17, material="ball", position=(-2.1 * r, y, r), velocity=(5.0, 0.0, 0.0)
    )
    scene.plane("bed", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), material="cloth")
    return scene


def chute(counts: tuple[int, int, int], angle: float, seed: int, **law: float) -> carom.Scene:
    """Layers of balls that slide and roll down a rough plane, inclined by `angle` (degrees), between two walls."""
    r, slope = 0.01, math.radians(angle)
    rng = np.random.default_rng(seed)
    scene = empty(
        f"chute of {math.prod(counts)} balls", (G * math.sin(slope), 0.0, -G * math.cos(slope)), **law
    )
    grid = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    centres = 2.02 * r * grid + r + rng.uniform(0.0, 0.01 * r, grid.shape)
    centres[:, 2] += 0.25 * r * (grid[:, 0] % 2)
    balls(scene, centres, np.full(len(grid), r))
    scene.plane("bed", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), material="wall")
    scene.plane("left", point=(0.0, -0.001 * r, 0.0), normal=(0.0, 1.0, 0.0), material="wall")
    right = float((2.02 * (counts[1] - 1) + 2.02) * r)
    scene.plane("right", point=(0.0, right, 0.0), normal=(0.0, -1.0, 0.0), material="wall")
    return scene


def box(seed: int, count: int = 20, **law: float) -> carom.Scene:
    """Balls that drop into a box hardly wider than two of them: many contacts hold each."""
    r = 0.02
    rng = np.random.default_rng(seed)
    scene = empty(f"tight box of {count} balls", **law)
    cells = np.arange(count)
    grid = np.stack([cells % 2, cells // 2 % 2, cells // 4], axis=1)
    centres = r * (1.05 + 2.1 * grid) + rng.uniform(-0.04, 0.04, (count, 3)) * r
    balls(scene, centres, np.full(count, r))
    walls(scene, (0.0, 0.0, 0.0), (4.2 * r, 4.2 * r, 0.0))
    return scene


def crystal(counts: tuple[int, int, int], kind: str, **law: float) -> carom.Scene:
    """A lattice of balls that touch, at rest on a floor: as redundant as balls can be."""
    r = 0.01
    scene = empty(f"{kind} lattice of {math.prod(counts)} balls", **law)
    scene.lattice(
        "ball", counts=counts, origin=(r, r, r), radius=r, material="ball", kind=kind, density=DENSITY
    )
    scene.plane("floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), material="wall")
    return scene


def column(count: int, masses: float, **law: float) -> carom.Scene:
    """Balls upon one another, each heavier than the one below by the factor `masses`."""
    r = 0.02
    scene = empty(f"column of {count} balls", **law)
    x = np.zeros((count, 3))
    x[:, 2] = r + 2.0 * r * np.arange(count)
    balls(scene, x, np.full(count, r), DENSITY * masses ** np.arange(count))
    scene.plane("floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), material="wall")
    return scene


@dataclass(frozen=True)
class Source:
    """A scene, its run, and what is taken: per level so many of the hardest problems, `apart` steps at least."""

    name: str
    make: Callable[[], carom.Scene]
    steps: int
    position: int = 1
    velocity: int = 1
    form: str = "local"
    apart: int = 5
    least: int = 2
    """Problems of fewer contacts are passed over."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the run besides those of the tool."""


#: Newton alone, and impact sequences cut short: large scenes get on where a problem is given up soon.
NEWTON = {"gauss_seidel_sweeps": 0, "max_problems": 8}
#: Moreau's scheme takes the contacts as they are, overlapping or not: one step from rest is one problem of all of them.
REST = {**NEWTON, "method": "moreau", "impact": "one-shot", "max_iterations": 5, "energy_safeguard": False}

STICKY: dict[str, Any] = {"friction": 0.5, "restitution": 0.1}
ROLLING: dict[str, Any] = {"friction": 0.5, "restitution": 0.1, "rolling_radius": 5e-4}
SPINNING: dict[str, Any] = {**ROLLING, "spinning_radius": 2e-4}

SCENES = (
    Source(
        "pile_40_mu03", lambda: pile(40, 1, friction=0.3, restitution=0.1), 45, 2, 2, least=60, options=NEWTON
    ),
    Source(
        "pile_40_mu07", lambda: pile(40, 2, friction=0.7, restitution=0.1), 45, 2, 2, least=60, options=NEWTON
    ),
    Source(
        "pile_40_smooth", lambda: pile(40, 3, friction=0.0, restitution=0.1), 45, least=60, options=NEWTON
    ),
    Source("pile_40_rolling", lambda: pile(40, 4, **ROLLING), 45, 1, 2, least=60, options=NEWTON),
    Source("pile_40_spinning", lambda: pile(40, 5, **SPINNING), 45, 1, 2, least=60, options=NEWTON),
    Source(
        "pile_40_bouncing",
        lambda: pile(40, 6, friction=0.4, restitution=0.8),
        45,
        1,
        2,
        least=40,
        options=NEWTON,
    ),
    Source("pile_60_radii10", lambda: pile(60, 7, ratio=10.0, **STICKY), 60, 1, 2, least=20, options=NEWTON),
    Source("pile_120", lambda: pile(120, 9, **STICKY), 45, 1, 2, least=100, options=NEWTON),
    Source("pile_300", lambda: pile(300, 10, **STICKY), 40, 1, 1, "global", least=200, options=NEWTON),
    Source("rest_40", lambda: pile(40, 12, tight=True, **STICKY), 1, 0, 1, options=REST),
    Source("rest_60_radii10", lambda: pile(60, 17, ratio=10.0, tight=True, **STICKY), 1, 0, 1, options=REST),
    Source(
        "rest_60_masses1000", lambda: pile(60, 18, masses=1000.0, tight=True, **STICKY), 1, 0, 1, options=REST
    ),
    Source("rest_120", lambda: pile(120, 13, tight=True, **STICKY), 1, 0, 1, options=REST),
    Source("rest_120_rolling", lambda: pile(120, 14, tight=True, **ROLLING), 1, 0, 1, options=REST),
    Source("rest_300", lambda: pile(300, 15, tight=True, **STICKY), 1, 0, 1, options=REST),
    Source(
        "rest_300_mu03",
        lambda: pile(300, 15, tight=True, friction=0.3, restitution=0.1),
        *(1, 0, 1, "global"),
        options=REST,
    ),
    Source("rest_400", lambda: pile(400, 16, tight=True, **STICKY), 1, 0, 1, "global", options=REST),
    Source("row_5", lambda: row(5), 8, 1, 2),
    Source("row_10", lambda: row(10), 12, 1, 2),
    Source("row_20_sticky", lambda: row(20, friction=0.5, restitution=0.5), 20, 1, 2),
    Source("row_8_masses", lambda: row(8, restitution=1.0, masses=3.0), 12, 1, 2),
    Source("rack_6", lambda: rack(6, 1), 40, 1, 2, apart=1),
    Source("rack_15", lambda: rack(15, 2), 60, 1, 3, apart=1),
    Source("rack_15_sticky", lambda: rack(15, 3, friction=0.4), 60, 1, 3, apart=1),
    Source(
        "chute_steep", lambda: chute((6, 4, 3), 35.0, 1, friction=0.4, restitution=0.2), 300, 2, 2, least=40
    ),
    Source("chute_rolling", lambda: chute((6, 4, 3), 25.0, 2, **ROLLING), 300, 1, 2, least=40),
    Source("box_mu03", lambda: box(1, friction=0.3, restitution=0.3), 600, 2, 3, least=10),
    Source("box_mu06", lambda: box(2, friction=0.6, restitution=0.3), 600, 2, 3, least=10),
    Source(
        "box_rolling", lambda: box(3, friction=0.4, restitution=0.3, rolling_radius=1e-3), 600, 2, 3, least=10
    ),
    Source(
        "box_spinning",
        lambda: box(4, friction=0.6, restitution=0.3, rolling_radius=1e-3, spinning_radius=5e-4),
        600,
        2,
        3,
        least=10,
    ),
    Source("column_masses10", lambda: column(6, 10.0, friction=0.3, restitution=0.0), 5, 1, 1),
    Source("crystal_cubic", lambda: crystal((5, 5, 4), "cubic", **STICKY), 2, 1, 1, least=50),
    Source("crystal_hcp", lambda: crystal((5, 5, 4), "hcp", **STICKY), 2, 1, 1, least=50, options=NEWTON),
    Source(
        "crystal_10000",
        lambda: crystal((14, 13, 11), "hcp", **STICKY),
        *(1, 0, 1, "global"),
        options={**REST, "max_iterations": 1},
    ),
)
