"""The compiled core, which dawdles or fails where a test asks for it, and the scene that such tests simulate.

Recording, resuming and reading are tested for what they do when a core is slow or fails, which the real one cannot be
asked to do.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from carom import Scene, _core

SCENE = """
format = 1
title = "two balls"
[run]
until = 1.0
step = 1e-3
[world]
gravity = [0.0, 0.0, -9.8]
[[material]]
name = "ivory"
[[contact]]
between = ["ivory", "ivory"]
friction = 0.0
restitution = 0.8
[[plane]]
name = "bed"
material = "ivory"
normal = [0.0, 0.0, 1.0]
point = [0.0, 0.0, 0.0]
"""
BALL = """
[[sphere]]
name = "{name}"
material = "ivory"
radius = 0.05
mass = 0.2
position = [{x:g}, 0.0, {z:g}]
velocity = [0.1, 0.0, 0.0]
"""


def hopping(*names: str) -> Scene:
    """Balls that hop on a plane for a second: each starts higher than the one before it."""
    balls = (BALL.format(name=name, x=0.2 * i, z=0.3 + 0.1 * i) for i, name in enumerate(names))
    return Scene.from_toml(SCENE + "".join(balls))


REAL = _core.Simulation


class Simulation:
    """`carom._core.Simulation`, and what it is asked to do wrong."""

    delay = 0.0
    """Seconds that each step takes longer."""
    fail_at = 0
    """The step that is not solved; 0: none."""

    def __init__(self, model: dict[str, Any]) -> None:
        self._core = REAL(model)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)

    def advance(self, steps: int, every: int, contacts: bool, wall_limit: float) -> dict[str, Any]:
        if self.delay:
            steps = min(steps, max(1, int(wall_limit / self.delay)))
            time.sleep(self.delay * steps)
        if self.fail_at:
            steps = min(steps, self.fail_at - 1 - self.step)
        block: dict[str, Any] = self._core.advance(steps, every, contacts, wall_limit)
        if self.step + 1 == self.fail_at:
            block["outcome"] = {
                "kind": "not_converged",
                "step": self.fail_at,
                "time": self.time + 1e-3,
                "level": "position",
                "bodies": [0, 2],
                "residual": 0.5,
                "advice": "halve the step",
            }
        return block

    def failing_problem(self) -> dict[str, Any]:
        """One ball of 1 kg on the bed that comes down at 1 m/s."""
        gradient = np.zeros((6, 2, 6))
        gradient[[0, 1, 2], 0, [2, 0, 1]] = 1.0
        gradient[[3, 4, 5], 0, [3, 4, 5]] = 1.0
        none = np.zeros(0, dtype=np.int64)
        return {
            "level": "position",
            "step": self.step + 1,
            "time": 0.1,
            "part": 0,
            "island": 0,
            "index": 0,
            "iterations": 3,
            "residual": 0.5,
            "converged": False,
            "attempts": "newton: residual 5.0e-01",
            "joints": 0,
            "worst": 0,
            "spheres": np.array([0]),
            "mass": np.ones(1),
            "inertia": np.ones(1),
            "bodies": np.array([[0, 2]]),
            "bounds": np.array([[0.2, 0.0, 0.0]]),
            "node": np.tile([0, -1], (6, 1)),
            "gradient": gradient,
            "q": np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            "r": np.zeros(6),
            **{name: np.zeros((1, 6)) for name in ("motion", "correction", "load")},
            **{f"load_tangent_{name}": none for name in ("row", "column")},
            "load_tangent_value": np.zeros(0),
        }


def spoil(monkeypatch: pytest.MonkeyPatch, *, delay: float = 0.0, fail_at: int = 0) -> None:
    """Have every run of a test dawdle, or fail at a step."""
    monkeypatch.setattr(Simulation, "delay", delay)
    monkeypatch.setattr(Simulation, "fail_at", fail_at)
    monkeypatch.setattr(_core, "Simulation", Simulation)
