"""Random scenes for the auditor: a few balls, walls that rest, shake, convey or turn, and loads of every kind.

python tests/audit_random.py 200         # simulates and judges 200 scenes, and says which were found at fault
python tests/audit_random.py 1 37        # the scene of seed 37 alone, and the report on it
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
G = 9.8
DRUM = 0.1
"""Radius of the drum, and how far the floor is below the middle, m."""
UNTIL = 0.15
"""Duration, s."""


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 6])

    def often(share: float) -> bool:
        return bool(rng.random() < share)

    method = str(rng.choice(["nsga", "nsga", "nsga", "moreau", "penalty"]))
    made = carom.Scene(gravity=(0, 0, -G if often(0.8) else 0.0))
    for other in ("ball", "wall"):
        law: dict[str, float] = {
            "friction": float(rng.choice([0.0, 0.1, 0.3, 0.8])),
            "restitution": float(rng.choice([0.0, 0.5, 0.9, 1.0])),
        }
        if often(0.25) and method != "penalty":  # which has none
            law["tangential_restitution"] = float(rng.choice([0.3, 0.6, -0.3]))
        if often(0.3):
            law["rolling_radius"] = float(rng.choice([1e-4, 1e-3]))
        if often(0.3):
            law["spinning_radius"] = float(rng.choice([1e-4, 1e-3]))
        made.contact("ball", other, **law)
    _balls(made, rng, often, _walls(made, rng, often))
    _loads(made, rng, often)
    options: dict[str, Any] = {
        "method": method,
        "every": int(rng.choice([1, 1, 1, 3])),
        "step": float(rng.choice([1e-3, 1e-3, 5e-4, 2e-3])),
    }
    return made, options


def _vector(rng: np.random.Generator, size: float) -> list[float]:
    return [float(x) for x in size * rng.uniform(-1, 1, 3)]


def _walls(made: carom.Scene, rng: np.random.Generator, often: Any) -> F64 | None:
    """A floor, of which the normal is returned, a drum of radius `DRUM` about the y axis, or nothing."""
    kind = str(rng.choice(["none", "floor", "floor", "floor", "drum"]))
    motion: dict[str, Any] = {}
    if kind == "floor":
        if often(0.3):
            a, w = float(rng.choice([0.001, 0.004])), float(rng.choice([20, 60]))
            shake: Any = {"expression": f"{a}*sin({w}*t)"}
            motion["translation"] = [[shake, 0, shake], [0, 0, shake], [shake, 0, 0]][rng.integers(3)]
        if often(0.25):
            motion["surface_velocity"] = [float(rng.choice([0.1, 0.5])), 0, 0]
        normal = np.array([float(rng.choice([0.0, 0.0, 0.1, 0.3])), 0.0, 1.0])
        made.plane("floor", point=(0, 0, -DRUM), normal=normal.tolist(), material="wall", **_moved(motion))
        return np.asarray(normal / np.linalg.norm(normal))
    if kind == "drum":
        if often(0.7):
            motion["rotation"] = {"axis": (0, 1, 0), "rate": float(rng.choice([1.0, 5.0]))}
        made.cylinder("drum", point=(0, 0, 0), axis=(0, 1, 0), radius=DRUM, material="wall", **_moved(motion))
    return None


def _moved(motion: dict[str, Any]) -> dict[str, Any]:
    return {"motion": motion} if motion else {}


def _balls(made: carom.Scene, rng: np.random.Generator, often: Any, normal: F64 | None) -> None:
    """One to five, on the wall, touching or near one another, within the drum and above the floor."""
    placed: list[tuple[F64, float]] = []
    floor = np.array([0.0, 0.0, -DRUM])
    for _ in range(int(rng.integers(1, 6))):
        r = 0.02 if often(0.5) else float(rng.uniform(0.01, 0.02))
        for _ in range(500):
            x = rng.uniform(-0.06, 0.06, 3)
            if placed and often(0.6):
                beside, other = placed[rng.integers(len(placed))]
                way = rng.normal(size=3)
                x = beside + way / np.linalg.norm(way) * (r + other + rng.choice([0.0, 1e-4, 5e-3]))
            height = DRUM - float(np.hypot(x[0], x[2])) - r if normal is None else (x - floor) @ normal - r
            if often(0.3):  # onto the wall
                down = (
                    np.array([x[0], 0, x[2]]) / max(float(np.hypot(x[0], x[2])), 1e-9)
                    if normal is None
                    else -normal
                )
                x, height = x + height * down, 0.0
            gaps = [float(np.linalg.norm(x - y)) - r - s for y, s in placed]
            if min([height, *gaps]) > -1e-12:
                break
        else:
            continue
        speed, spin = float(rng.choice([0.0, 0.1, 1.0, 2.0])), float(rng.choice([0.0, 0.0, 30.0]))
        made.sphere(f"b{len(placed)}", radius=r, mass=float(rng.uniform(0.02, 0.1)), material="ball",
                    position=x.tolist(), velocity=_vector(rng, speed), angular_velocity=_vector(rng, spin))  # fmt: skip
        placed.append((x, r))


def _loads(made: carom.Scene, rng: np.random.Generator, often: Any) -> None:
    """Up to three: drag, springs and dampers to the ground or between balls, forces and torques in time."""
    balls = made.spheres
    for _ in range(int(rng.integers(0, 4))):
        one = balls[rng.integers(len(balls))]
        m, r, x = float(one.mass or 0.0), float(one.radius), np.asarray(one.position)
        kind = rng.integers(3)
        if kind == 0:
            made.drag(
                one.name,
                translation=m * float(rng.choice([0.5, 5.0])),
                rotation=m * r * r * float(rng.choice([0.0, 5.0])),
            )
        elif kind == 1:
            others = [s for s in balls if s is not one]
            far = x + _vector(rng, 0.1)
            arm = x + np.multiply(_vector(rng, r), float(often(0.5)))
            second, end = "ground", far
            if others and often(0.5):
                other = others[rng.integers(len(others))]
                second, end = other.name, np.asarray(other.position)
            length, w = float(np.linalg.norm(arm - end)), float(rng.choice([10.0, 50.0]))
            damping, rest = m * w * float(rng.choice([0.0, 0.2])), length * float(rng.uniform(0.7, 1.2))
            made.spring(one.name, second, points=[arm.tolist(), end.tolist()], stiffness=m * w * w, damping=damping,
                        rest_length=rest)  # fmt: skip
        else:
            a, w = m * float(rng.choice([1.0, 20.0])), float(rng.choice([10, 100]))
            made.load(one.name, force=[{"expression": f"{a}*sin({w}*t)"}, 0, {"polynomial": [0.0, a]}],
                      torque=[0, {"expression": f"{0.1 * a * r}*cos({w}*t)"}, 0])  # fmt: skip


def main(scene: Callable[[int], tuple[carom.Scene, dict[str, Any]]] = scene, until: float = UNTIL) -> None:
    """Tries the scenes of `COUNT [FIRST]` seeds."""
    from audit_scenes import run
    from carom import audit

    count, first = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    accused = stopped = 0
    for seed in range(first, first + count):
        with tempfile.TemporaryDirectory() as scratch:
            made, options = scene(seed)
            try:
                path = run(made, Path(scratch) / "run", until, **options)
            except carom.CaromError as error:
                stopped += 1
                print(f"seed {seed}: not simulated: {error}", flush=True)
                continue
            report = audit.check(path)
            if count == 1:
                print(made.to_toml(), options, report, sep="\n")
            if not report.ok:
                accused += 1
                print(f"seed {seed}, {options}: {report.findings}", flush=True)
    print(f"{count - stopped} scenes tried, {accused} found at fault, {stopped} not simulated")


if __name__ == "__main__":
    main()
