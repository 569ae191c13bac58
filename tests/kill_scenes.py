"""Runs of different kinds and sizes to be stopped at any moment: each lasts about half a second of computing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
from carom.cli.examples import find
from clump_scenes import hopper

G = (0.0, 0.0, -9.8)
R = 0.01


def grains(
    counts: tuple[int, int, int], run: dict[str, Any], *, rolling: float = 2e-4, **record: Any
) -> carom.Scene:
    """A jittered lattice of balls that falls into a box without a lid; `rolling` and spinning radius in m."""
    scene = carom.Scene("grains", gravity=G, run=run, record=record)
    law = {"friction": 0.4, "rolling_radius": rolling, "spinning_radius": rolling}
    scene.contact("grain", "grain", restitution=0.4, **law)
    scene.contact("grain", "wall", restitution=0.3, **law)
    side = [2.6 * R * n for n in counts]
    scene.lattice("grain", counts=counts, origin=(1.3 * R, 1.3 * R, 2 * R), spacing=2.6 * R, jitter=0.25 * R, seed=7,
                  radius=R, density=2500, material="grain", velocity=(0.1, -0.05, 0.0))  # fmt: skip
    for name, point, normal in (
        ("floor", (0, 0, 0), (0, 0, 1)),
        ("left", (0, 0, 0), (1, 0, 0)),
        ("right", (side[0], 0, 0), (-1, 0, 0)),
        ("front", (0, 0, 0), (0, 1, 0)),
        ("back", (0, side[1], 0), (0, -1, 0)),
    ):
        scene.plane(name, point=point, normal=normal, material="wall")
    return scene


def two_balls() -> carom.Scene:
    """The smallest run: two balls that bounce in a box; many short steps, and so many batches."""
    return grains((2, 1, 1), {"step": 1e-4, "until": 3.0}, every=20, checkpoint_steps=3000)


def billiard_break() -> carom.Scene:
    """The break of section 5.6 with a finer step."""
    scene = carom.Scene.from_toml(find("5.6_break"))
    return scene.with_options(step=2e-4, until=3.0, every=5, checkpoint_time=0.25)


def pile() -> carom.Scene:
    """Fifty grains that roll, solved as a pile by sweeps on two threads."""
    run = {"step": 1e-3, "until": 0.6, "pile_contacts": 10, "threads": 2}
    return grains((5, 5, 2), run, every=2, walls=True, checkpoint_steps=50)


def joints() -> carom.Scene:
    """Three pendulums that knock against one another, the last of them on a spring."""
    scene = carom.Scene("cradle", gravity=G, run={"step": 2e-4, "until": 1.6})
    scene = scene.with_options(every=10, checkpoint_time=0.2)
    scene.contact("steel", "steel", friction=0.1, restitution=0.95)
    for k in range(3):
        x, velocity = 0.0505 * k, (1.0 if k == 0 else 0.0, 0.0, 0.0)
        scene.sphere(
            f"b{k}", radius=0.025, density=7850, material="steel", position=(x, 0, 0), velocity=velocity
        )
        scene.joint("rod", between=(f"b{k}", "ground"), points=[(x, 0, 0), (x, 0, 0.5)])
    scene.spring("b2", "ground", points=[(0.101, 0, 0), (0.2, 0, 0)], stiffness=50.0, damping=0.2)
    return scene


def walls() -> carom.Scene:
    """Grains on a shaken floor, with the impulses on it."""
    scene = carom.Scene.from_toml(find("shaken_layer"))
    return scene.with_options(every=3, until=0.05, checkpoint_steps=20)


def inflow() -> carom.Scene:
    """Balls enter over a slope, roll down and leave at its foot; more places than balls at a time."""
    scene = carom.Scene("flow", gravity=G, run={"until": 1.2, "step": 2e-4})
    scene = scene.with_options(every=20, checkpoint_steps=500)
    scene.contact("sand", "steel", friction=0.3, restitution=0.2)
    scene.contact("sand", "sand", friction=0.3, restitution=0.2)
    scene.plane("slope", point=(0, 0, 0), normal=(0, -0.3, 1), material="steel")
    scene.inflow(
        "grain", count=60, region={"low": (-0.05, 0, 0.03), "high": (0.05, 0.02, 0.03)}, radius=0.009, density=2500,
        material="sand", rate=60.0, start=0.02, velocity=(0, -0.3, -0.15), spread=0.05, seed=1,
    )  # fmt: skip
    scene.outlet(low=(-1, -1, -1), high=(1, -0.04, 1))
    return scene


def moreau() -> carom.Scene:
    """Moreau-Jean time stepping with projection."""
    run = {"step": 5e-4, "until": 0.4, "method": "moreau", "position_projection": True}
    return grains((3, 2, 2), run, every=4, checkpoint_steps=100)


def penalty() -> carom.Scene:
    """Continuous contact forces with tangential springs, which a state has to hold."""
    run = {"step": 1e-3, "until": 0.5, "method": "penalty", "penalty_friction": "spring",
           "penalty_young_modulus": 1e7}  # fmt: skip
    return grains((3, 2, 2), run, every=2, checkpoint_steps=40)


def clumps() -> carom.Scene:
    """Rods leave a hopper."""
    return hopper().with_options(step=1e-3, until=0.6, every=2, checkpoint_steps=50, pile_tolerance=1e-4)


SCENES: dict[str, Callable[[], carom.Scene]] = {
    scene.__name__: scene
    for scene in (two_balls, billiard_break, pile, joints, walls, inflow, moreau, penalty, clumps)
}


def write(name: str, folder: Path, share: float = 1.0) -> Path:
    """The scenario file of a scene, or of a `share` of its time."""
    path = folder / f"{name}.toml"
    scene = SCENES[name]()
    path.write_text(scene.with_options(until=share * (scene.run.until or 0.0)).to_toml())
    return path
