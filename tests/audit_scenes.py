"""Scenes of the tests of the auditor: small, each with another part of the physics."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import carom
from carom.cli.examples import find
from physics_scenes import R, ball_on_plane, balls

LAW = {"friction": 0.3, "restitution": 0.5}


def rolling() -> carom.Scene:
    """A ball slides, rolls and spins on a plane, against resistance to all three."""
    return ball_on_plane((1.0, 0.3, 0.0), (0.0, 0.0, 5.0), rolling_radius=1e-4, spinning_radius=2e-4)


def two_balls(**law: float) -> carom.Scene:
    """An oblique impact of spinning balls, free in space."""
    return balls(
        [(0, 0, 0), (0.0595, 0.02, 0)],
        [(1.0, 0, 0), (0, 0, 0)],
        [(0, 3.0, 1.0), (0, 0, 2.0)],
        law={**LAW, **law},
    )


def dull() -> carom.Scene:
    """A ball thrown obliquely onto a floor that gives back next to nothing, and one that falls into its way."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    for other in ("ball", "wall"):
        scene.contact("ball", other, friction=0.2, restitution=0.1)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    scene.sphere("thrown", radius=0.02, mass=0.1, material="ball", position=(0, 0, 0.03), velocity=(2, 0, -1))
    scene.sphere(
        "met", radius=0.02, mass=0.1, material="ball", position=(0.1, 0.01, 0.0301), velocity=(0, 0, -0.5)
    )
    return scene


def pile() -> carom.Scene:
    """Twenty balls fall into a box and come to rest."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "ball", friction=0.3, restitution=0.4)
    scene.contact("ball", "wall", friction=0.4, restitution=0.3)
    scene.box("box", material="wall", low=(-0.07, -0.07, 0), high=(0.07, 0.07, 0.5), open=["high_z"])
    scene.lattice("ball", material="ball", radius=0.02, density=2500, counts=(2, 2, 5), origin=(-0.03, -0.03, 0.03),
                  spacing=0.045, jitter=0.002, seed=3)  # fmt: skip
    return scene


def shaken() -> carom.Scene:
    """Two balls on a tilted floor that shakes and conveys."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "wall", friction=0.4, restitution=0.3)
    scene.contact("ball", "ball", friction=0.4, restitution=0.3)
    motion = {
        "translation": [{"expression": "0.01*sin(20*t)"}, 0, {"expression": "0.004*sin(60*t)"}],
        "surface_velocity": [0.2, 0, 0],
    }
    scene.plane("floor", point=(0, 0, 0), normal=(0.1, 0, 1), material="wall", motion=motion)
    scene.sphere("low", radius=0.02, mass=0.1, material="ball", position=(0, 0, 0.03))
    scene.sphere("high", radius=0.02, mass=0.1, material="ball", position=(0.01, 0, 0.08))
    return scene


Law = tuple[float, float, float]


def layer(
    ball: Law, wall: Law, shaken: str, counts: tuple[int, int, int], seed: int, step: float
) -> carom.Scene:
    """Balls that restore slip, of some laws `mu, e_N, e_T`, on a floor whose height is `shaken`."""
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"step": step})
    for other, (friction, normal, tangential) in (("ball", ball), ("wall", wall)):
        scene.contact("ball", other, friction=friction, restitution=normal, tangential_restitution=tangential)
    motion = {"translation": [0, 0, {"expression": shaken}]}
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall", motion=motion)
    scene.lattice("ball", material="ball", radius=0.01, density=2500, counts=counts, origin=(0, 0, 0.0105),
                  spacing=0.0215, jitter=0.0005, seed=seed)  # fmt: skip
    return scene


def shaken_layer() -> carom.Scene:
    """108 balls: more pairs than contacts of a pile, and smaller islands."""
    return layer((0.6, 0.4, 0.6), (0.3, 0.8, 0.6), "0.001*sin(30*t)", (6, 6, 3), 1, 1e-3)


def loose_layer() -> carom.Scene:
    """Fifty balls, most of whose candidates are apart: the floor of the position level's rule is above its tolerance."""
    return layer((0.1, 0.8, 0.6), (0.3, 0.4, -0.3), "0.002*sin(60*t)", (5, 5, 2), 10, 5e-4)


def landed_layer() -> carom.Scene:
    """Nine balls that land on a floor in motion and stay: with `moreau` they overlap as much when it turns."""
    return layer((0.6, 0.0, -0.3), (0.6, 0.0, -0.3), "0.002*sin(60*t)", (3, 3, 1), 28, 5e-4)


def drum() -> carom.Scene:
    """Four balls in a drum that turns."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "wall", friction=0.4, restitution=0.3)
    scene.contact("ball", "ball", friction=0.4, restitution=0.3)
    scene.cylinder("drum", point=(0, 0, 0), axis=(0, 1, 0), radius=0.1, material="wall",
                   motion={"rotation": {"axis": (0, 1, 0), "rate": 3.0}})  # fmt: skip
    for k in range(4):
        at = (-0.06 + 0.042 * k, 0.001 * k, -0.04 + 0.01 * (k % 2))
        scene.sphere(f"ball{k}", radius=0.02, mass=0.1, material="ball", position=at)
    return scene


def joined() -> carom.Scene:
    """A double pendulum that hits a ball and the floor."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "ball", friction=0.2, restitution=0.5)
    scene.contact("ball", "floor", friction=0.2, restitution=0.5)
    scene.sphere("upper", radius=0.05, mass=1, material="ball", position=(0.3, 0, 0.5))
    scene.sphere("lower", radius=0.05, mass=1, material="ball", position=(0.5, 0, 0.5))
    scene.sphere("target", radius=0.05, mass=0.5, material="ball", position=(0.02, 0, 0.051))
    scene.joint("rod", name="rod", between=["upper", "ground"], points=[[0.3, 0, 0.5], [0, 0, 0.5]])
    scene.joint("ball", name="elbow", between=["upper", "lower"], point=[0.4, 0, 0.5])
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    return scene


def linked() -> carom.Scene:
    """Two balls that a spring with a damper links fall on a floor and a third one, which drag slows down."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    for other in ("ball", "wall"):
        scene.contact("ball", other, friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    for name, at, speed in (
        ("a", (0, 0, 0.03), 0.5),
        ("b", (0.05, 0, 0.06), 0.5),
        ("slow", (0.1, 0, 0.02), 0.0),
    ):
        scene.sphere(name, radius=0.02, mass=0.1, material="ball", position=at, velocity=(speed, 0, 0))
    scene.spring("a", "b", stiffness=200.0, damping=1.0, rest_length=0.05)
    scene.drag("slow", translation=0.5, rotation=1e-5)
    return scene


def loaded() -> carom.Scene:
    """A ball with a spring, drag and a force in time."""
    scene = ball_on_plane((0, 0, 0))
    scene.spring(
        "ball", "ground", points=[[0, 0, R], [-0.3, 0, R]], stiffness=50.0, damping=0.3, rest_length=0.25
    )
    scene.drag("ball", translation=0.05, rotation=1e-5)
    scene.load(
        "ball", force=[0, {"expression": "0.3*sin(10*t)"}, 0], torque=[0, 0, {"polynomial": [0, 1e-3]}]
    )
    return scene


def flowing() -> carom.Scene:
    """Balls rain on a plate, fall over its edge and leave."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "wall", friction=0.4, restitution=0.3)
    scene.contact("ball", "ball", friction=0.4, restitution=0.3)
    scene.plane("plate", point=(0, 0, 0), normal=(0, 0, 1), size=(0.2, 0.2), material="wall")
    scene.inflow("ball", material="ball", count=12, radius=0.02, density=2500, rate=40, velocity=(0, 0, -0.5), spread=0.2,
                 seed=1, region={"low": [-0.08, -0.08, 0.2], "high": [0.08, 0.08, 0.2]})  # fmt: skip
    scene.outlet(low=[-1, -1, -1], high=[1, 1, -0.1])
    return scene


def wall_ahead() -> carom.Scene:
    """A ball rises and falls in front of a plate that stands on its edge, and does not reach it."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "wall", **LAW)
    scene.plane("plate", point=(0, 0, 0), normal=(1, 0, 0), size=(0.4, 0.4), material="wall")
    scene.sphere("ball", radius=0.02, mass=0.1, material="ball", position=(0.05, 0, 0), velocity=(0, 0, 0.5))
    return scene


def dropped() -> carom.Scene:
    """A ball that spins falls on a floor that resists rolling and spinning, and gives back slip; another is driven along."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("ball", "wall", friction=0.3, restitution=0.5, tangential_restitution=0.4, rolling_radius=1e-3,
                  spinning_radius=1e-3)  # fmt: skip
    scene.contact("ball", "ball", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
    scene.sphere("ball", radius=0.02, mass=0.1, material="ball", position=(0, 0, 0.03), velocity=(0.3, 0, 0),
                 angular_velocity=(5, 20, 30))  # fmt: skip
    scene.sphere("driven", radius=0.02, mass=0.1, material="ball", position=(1, 0, 0.02))
    scene.load("driven", force=(0.02, 0, -0.5))
    return scene


def break_() -> carom.Scene:
    """The billiard break of section 5.6."""
    return carom.Scene.from_toml(find("paper/5.6_break"))


def run(scene: carom.Scene, out: Path, until: float, **options: Any) -> Path:
    """Simulate into a directory, every step a frame, without the advice."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        carom.simulate(scene, out=out, until=until, **{"every": 1, **options}).close()
    return out
