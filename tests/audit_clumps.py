"""Random scenes for the auditor: clumps of one to five balls beside free balls, on a floor and between walls, some of
which leave, or enter, and some of which joints and loads hold.

python tests/audit_clumps.py 200       # simulates and judges 200 scenes, and says which were found at fault
python tests/audit_clumps.py 1 37      # the scene of seed 37 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from audit_random import main

UNTIL = 0.3
"""Duration, s."""
R = 0.01
"""Radius of the largest ball, m."""
ROOM = 0.05
"""Edge of the cube that each body starts in, m."""


def _spheres(rng: np.random.Generator) -> list[list[float]]:
    """One to five balls that overlap, touch or stand apart."""
    found = [[0.0, 0.0, 0.0, R * rng.uniform(0.5, 1.0)]]
    for _ in range(int(rng.integers(0, 5))):
        x, y, z, r = found[rng.integers(len(found))]
        other, way = R * rng.uniform(0.3, 1.0), rng.normal(size=3)
        apart = float(rng.choice([0.5, 0.9, 1.0, 1.1])) * (r + other)
        x, y, z = np.array([x, y, z]) + apart * way / np.linalg.norm(way)
        if np.hypot(np.hypot(x, y), z) + other < 0.5 * ROOM:
            found.append([float(x), float(y), float(z), other])
    return found


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 71])

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    across, clumps, balls = one(1, 1, 2), one(1, 2, 4, 6), one(0, 1, 3)
    made = carom.Scene(gravity=one((0, 0, -9.8), (0, 0, -9.8), (0, 0, 0), (2.0, 0, -9.0)))
    walls = one(True, True, False)
    # At 1, or more, what is wedged between a floor and a wall may press with any force.
    most = 0.9 if walls else 1.0
    for other in ("grain", "wall"):
        made.contact("grain", other, friction=one(0.0, 0.2, 0.5, most), restitution=one(0.0, 0.3, 0.7, 1.0),
                     tangential_restitution=one(0.0, 0.0, 0.0, 0.4), rolling_radius=one(0.0, 0.0, 1e-4),
                     spinning_radius=one(0.0, 0.0, 1e-4))  # fmt: skip
    motion = one({}, {}, {"motion": {"translation": [0, 0, {"expression": "0.001*sin(60*t)"}]}})
    made.plane("floor", point=(0, 0, 0), normal=one((0, 0, 1), (0.1, 0, 1)), material="wall", **motion)
    if walls:
        side = ROOM * across
        for name, axis, sign in (("left", 0, 1), ("right", 0, -1), ("front", 1, 1), ("back", 1, -1)):
            normal, point = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            normal[axis], point[axis] = float(sign), 0.0 if sign > 0 else side
            made.plane(name, point=point, normal=normal, material="wall")
    speed, spin = one(0.0, 0.3, 1.0), one(0.0, 5.0, 30.0)
    for k in range(clumps + balls):
        cell = np.array([k % across, (k // across) % across, k // across**2])
        place = (ROOM * (cell + 0.5) + np.array([0, 0, 0.1 * ROOM * (across - 1)])).tolist()
        velocity = (speed * rng.uniform(-1, 1, 3)).tolist()
        turning = (spin * rng.uniform(-1, 1, 3)).tolist()
        common = {"material": "grain", "position": place, "velocity": velocity, "angular_velocity": turning}
        if k < clumps:
            turn = rng.normal(size=4)
            heavy = one(
                {"density": 2500.0}, {"density": 2500.0}, {"mass": 0.02, "inertia": [4e-7, 2e-6, 2.2e-6]}
            )
            made.clump(f"c{k}_", spheres=_spheres(rng), orientation=(turn / np.linalg.norm(turn)).tolist(),
                       **heavy, **common)  # fmt: skip
        else:
            made.sphere(f"b{k}", radius=R * rng.uniform(0.5, 1.0), density=2500, **common)
    _flow(made, seed)
    _held(made, seed)
    options: dict[str, Any] = {
        "step": one(2e-3, 1e-3, 1e-3, 5e-4),
        "every": one(1, 1, 1, 10),
        "impacts": one("every", True, True, True, False),
        "contacts": one(True, True, True, True, False),
        "impact": one("sequence", "sequence", "sequence", "one-shot", "poisson"),
    }
    return made, options


def _flow(made: carom.Scene, seed: int) -> None:
    """In two scenes of five what comes near the floor leaves, or what gets out of the middle, or to one side; in one of five
    balls enter, and in three of ten clumps.
    """
    rng = np.random.default_rng([seed, 72])
    far, near = 9.0, float(rng.uniform(0.4, 1.5)) * R
    boxes = [
        ((-far, -far, -far), (far, far, near), True),
        ((-far, -far, 0.5 * R), (far, far, 4.0 * ROOM), False),
        ((0.7 * ROOM, -far, -far), (far, far, far), True),
    ]
    low, high, inside = boxes[rng.integers(len(boxes))]
    if rng.random() < 0.4:
        made.outlet(low=low, high=high, inside=inside)
    if rng.random() < 0.2:
        region = {"low": (0.2 * ROOM, 0.2 * ROOM, 2.0 * ROOM), "high": (0.6 * ROOM, 0.8 * ROOM, 3.0 * ROOM)}
        made.inflow("in", count=4, region=region, material="grain", seed=int(seed), radius=0.6 * R, density=2500, rate=40.0,
                    velocity=(0, 0, -0.3), spread=0.1)  # fmt: skip
    if rng.random() < 0.3:
        high = 3.5 * ROOM
        region = {"low": (0.5 * ROOM, 0.5 * ROOM, high), "high": (0.5 * ROOM, 0.5 * ROOM, 2.0 * high)}
        made.inflow("late", count=3, region=region, material="grain", seed=int(seed), spheres=_spheres(rng), density=2500,
                    rate=40.0, velocity=(0, 0, -0.5), spread=0.1)  # fmt: skip


def _held(made: carom.Scene, seed: int) -> None:
    """In half of the scenes one to three loads, springs, drags and joints, of bodies that are there from the start."""
    rng = np.random.default_rng([seed, 73])
    if rng.random() < 0.5:
        return
    balls = {sphere.name: np.array(sphere.position) for sphere in made.spheres}
    whole = {name: name for name in balls}
    for clump in made.clumps[: len(made._tree.clump)]:
        balls.update(zip(clump.ball_names(), clump.centres(), strict=True))
        whole.update(dict.fromkeys(clump.ball_names(), clump.name))
    names = list(balls)

    def one(*of: Any) -> Any:
        return of[rng.integers(len(of))]

    def still(name: str) -> None:
        for body in (*made.spheres, *made.clumps):
            if body.name == whole[name]:
                body.velocity = body.angular_velocity = (0.0, 0.0, 0.0)

    def near(name: str) -> list[float]:
        return (balls[name] + R * rng.uniform(-1, 1, 3)).tolist()

    for _ in range(int(rng.integers(1, 4))):
        name, other = one(*names), one(*names)
        kind = one("load", "torque", "spring", "drag", "joint", "joint")
        if whole[name] == whole[other]:
            other = "ground"
        if kind == "load":
            made.load(name, force=[0.05 * rng.uniform(-1, 1), {"expression": "0.05*sin(40*t)"}, 0.0])
        elif kind == "torque":
            made.load(name, torque=[0.0, {"expression": "1e-4*cos(60*t)"}, 1e-4 * rng.uniform(-1, 1)])
        elif kind == "spring":
            ends = [near(name), near(other) if other != "ground" else near(name)]
            ends[1][2] += 0.03
            made.spring(name, other, points=ends, stiffness=one(0.0, 10.0, 100.0), damping=one(0.01, 0.1),
                        rest_length=one(None, 0.03))  # fmt: skip
        elif kind == "drag":
            made.drag(name, translation=one(0.0, 0.01, 0.2), rotation=one(1e-7, 1e-6))
        else:
            still(name)
            if other != "ground":
                still(other)
            type = one("fix", "plane", "lock", "rod", "ball")
            if type == "rod" or (type == "ball" and other == "ground"):
                end = near(name)
                end[2] += 0.05
                points = [near(name), end] if other == "ground" else [near(name), near(other)]
                made.joint("rod", between=(name, other), points=points)
            elif type == "ball":
                made.joint(type, between=(name, other), point=(0.5 * (balls[name] + balls[other])).tolist())
            elif type == "fix":
                made.joint(type, body=name, point=near(name))
            elif type == "plane":
                made.joint(type, body=name, normal=rng.normal(size=3).tolist())
            else:
                made.joint(type, body=name, axes=[rng.normal(size=3).tolist()])


if __name__ == "__main__":
    main(scene, UNTIL)
