"""Scenes of rods, for tests of clumps that leave."""

from __future__ import annotations

import carom
import numpy as np

R, G, FAR = 0.004, 9.8, 9.0
ROD = [[-R, 0, 0, R], [R, 0, 0, R]]


def empty(gravity: float = G, friction: float = 0.3, restitution: float = 0.3) -> carom.Scene:
    """No bodies; their material is `grain`."""
    scene = carom.Scene(gravity=(0, 0, -gravity))
    scene.contact("grain", "grain", friction=friction, restitution=restitution)
    return scene


def colliding(count: int = 12, half: float = 0.03) -> carom.Scene:
    """Rods in free space that collide in the middle of a box, m, and leave one that is a little larger."""
    scene, rng, out = empty(gravity=0.0, restitution=0.7), np.random.default_rng(5), half + 0.01
    rods = scene.clump_packing("rod", spheres=ROD, material="grain", density=2500, seed=3, count=count,
                               low=(-half, -half, -half), high=(half, half, half))  # fmt: skip
    for rod in rods:
        rod.velocity = (-20 * np.array(rod.position) + rng.uniform(-0.2, 0.2, 3)).tolist()
    scene.outlet(low=(-out, -out, -out), high=(out, out, out), inside=False)
    return scene


def hopper(seed: int = 1, count: int = 40) -> carom.Scene:
    """Rods of two balls settle in a cone; at 0.3 s its opening of four lengths of theirs is free."""
    scene, wide, angle = empty(friction=0.5), 7 * R, np.pi / 6
    opening = 4 * R
    height = (wide - opening) / np.tan(angle)
    fill = count * 2 * 4 / 3 * R**3 / (0.11 * wide**2)
    scene.clump_packing("rod", spheres=ROD, material="grain", density=2500, seed=seed, count=count, region="cylinder",
                        point=(0, 0, height + fill / 2), axis=(0, 0, 1), region_radius=wide, length=fill)  # fmt: skip
    scene.cone("cone", material="grain", point=(0, 0, 0), axis=(0, 0, 1), radius=opening, radius_end=wide,
               length=height)  # fmt: skip
    scene.cylinder(
        "tube", material="grain", point=(0, 0, height + fill), axis=(0, 0, 1), radius=wide, length=2 * fill
    )
    scene.plane(
        "shutter", material="grain", point=(0, 0, 0), normal=(0, 0, 1), radius=opening, motion={"until": 0.3}
    )
    scene.outlet(low=(-FAR, -FAR, -FAR), high=(FAR, FAR, -0.02))
    return scene
