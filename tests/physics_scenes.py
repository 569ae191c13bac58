"""Scenes of the physics tests, built through the public interface, and a little vector algebra."""

from __future__ import annotations

import warnings
from typing import Any

import carom
import numpy as np
from carom.cli.examples import find
from numpy.typing import NDArray

F64 = NDArray[np.float64]

G = 9.8
R = 0.028575
M = 0.17
EPS = 2.0**-52
"""Distance of 1 from the next number: one rounding is half of it, relative."""


def run(scene: carom.Scene, steps: int | None = None, **options: Any) -> carom.Result:
    """Simulate with every step a frame; `steps` of the scene's own step, if given. Advice is not the matter here."""
    if steps is not None:
        options["until"] = steps * options.get("step", scene.run.step)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return carom.simulate(scene, **{"every": 1, **options})


def example(name: str, **options: Any) -> carom.Result:
    """Simulate a scenario file of the package."""
    return run(carom.Scene.from_toml(find(name)), **options)


def ball_on_plane(
    velocity: Any = (0.0, 0.0, 0.0),
    spin: Any = (0.0, 0.0, 0.0),
    *,
    slope: float = 0.0,
    kappa: float = 0.4,
    step: float = 1e-3,
    **law: float,
) -> carom.Scene:
    """One ball that touches the plane z = 0; `slope` (rad) leans gravity towards +x. I = kappa m r^2."""
    g = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    scene = carom.Scene(gravity=g, run={"step": step})
    scene.contact("ball", "plane", **{"friction": 0.2, "restitution": 0.0, **law})
    scene.sphere("ball", radius=R, mass=M, inertia=kappa * M * R * R, material="ball",
                 position=(0.0, 0.0, R), velocity=velocity, angular_velocity=spin)  # fmt: skip
    scene.plane("plane", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), material="plane")
    return scene


def balls(
    position: Any, velocity: Any, spin: Any = None, *, step: float = 1e-3, radius: Any = R, mass: Any = M,
    gravity: Any = (0.0, 0.0, 0.0), planes: Any = (), law: Any = None, wall: Any = None, **run_options: Any,
) -> carom.Scene:  # fmt: skip
    """Balls "0", "1", ... of one material, and planes (point, normal) of another."""
    n = len(position)
    spin = np.zeros((n, 3)) if spin is None else spin
    radius, mass = np.broadcast_to(radius, n), np.broadcast_to(mass, n)
    scene = carom.Scene(gravity=tuple(gravity), run={"step": step, **run_options})
    scene.contact("ball", "ball", **{"friction": 0.0, "restitution": 1.0, **(law or {})})
    for i in range(n):
        scene.sphere(str(i), radius=float(radius[i]), mass=float(mass[i]), material="ball",
                     position=tuple(position[i]), velocity=tuple(velocity[i]),
                     angular_velocity=tuple(spin[i]))  # fmt: skip
    if len(planes):
        scene.contact("ball", "wall", **{"friction": 0.0, "restitution": 1.0, **(wall or law or {})})
    for k, (point, normal) in enumerate(planes):
        scene.plane(f"plane{k}", point=tuple(point), normal=tuple(normal), material="wall")
    return scene


def line(speeds: Any, *, restitution: float = 1.0, friction: float = 0.0, **options: Any) -> carom.Scene:
    """Touching equal balls in a row along x, free in space. The radius is a power of two: gaps are exactly 0."""
    n = len(speeds)
    x, v = np.zeros((n, 3)), np.zeros((n, 3))
    x[:, 0], v[:, 0] = 0.0625 * np.arange(n), speeds
    return balls(
        x, v, radius=0.03125, mass=0.25, law={"restitution": restitution, "friction": friction}, **options
    )


def kinetic(result: carom.Result, frame: int) -> float:
    """Kinetic energy of all balls at a frame, J."""
    m, inertia = result.bodies["mass"], result.bodies["inertia"]
    v, w = np.asarray(result.velocity[frame]), np.asarray(result.angular_velocity[frame])
    return float(0.5 * (m @ (v * v).sum(1) + inertia @ (w * w).sum(1)))


def rotation(seed: int) -> F64:
    """A random proper rotation."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def below(bound: float, what: str, measured: Any) -> None:
    """Assert that no |measured| exceeds `bound`; `pytest -s -k physics` prints the figures."""
    worst = float(np.max(np.abs(measured), initial=0.0))
    print(f"{what}: {worst:.2e} (bound {bound:.1e})")
    assert worst <= bound, f"{what}: {worst:.3e} is above {bound:.1e}"
