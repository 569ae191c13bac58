"""A Gymnasium environment on Carom: pocket the object ball of a 9-foot table. One step is one shot, until all lies still."""

from typing import Any

import carom
import gymnasium as gym
import numpy as np
from carom import billiards, events

SPEEDS = np.array([0.5, 4.0])  # of the cue ball after the strike, m/s


class CueShot(gym.Env[Any, Any]):
    """Action: direction (-1 to 1, in pi), speed (-1 to 1 over `SPEEDS`), height of the tip (-1 to 1, in half radii).

    Observation: x, y (m) of the cue ball and of the object ball; a ball in a pocket stays where it was seen last.
    """

    def __init__(self, shots: int = 5) -> None:
        self.table, self.shots = billiards.table("9ft"), shots
        scene = self.table.scene("cue shot", step=2e-4)
        self.table.cue_ball(scene, at="head spot")
        self.table.ball(scene, "object", at="foot spot")
        self.sim = carom.Simulation(scene, keep=False)
        self.start = self.sim.state()
        self.action_space = gym.spaces.Box(-1.0, 1.0, (3,))
        self.observation_space = gym.spaces.Box(0.0, 3.0, (4,), np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self.sim.restore(self.start)
        self.made, self.seen = 0, self.sim.position[:, :2].copy()
        return self.seen.ravel(), {}

    def step(self, action: Any) -> Any:
        angle, pace, height = np.clip(action, -1.0, 1.0)
        struck = billiards.cue_impulse(
            radius=self.sim["cue"].radius,
            mass=self.sim["cue"].mass,
            inertia=self.sim["cue"].inertia,
            direction=np.pi * float(angle),
            ball_speed=float(np.interp(pace, (-1.0, 1.0), SPEEDS)),
            height=0.5 * float(height),
        )
        state = self.sim.state()
        state["velocity"][0], state["angular_velocity"][0] = struck.velocity, struck.angular_velocity
        self.sim.restore(state)
        still = events.AtRest(ignore_spin=True)
        while not still(self.sim):
            self.sim.step(50)
        self.made += 1
        there = self.sim.present
        self.seen = np.where(there[:, None], self.sim.position[:, :2], self.seen)
        reward = float(there[0]) - float(there[1])  # the object ball in a pocket: 1; the cue ball: -1
        return self.seen.ravel(), reward, not there.all(), self.made >= self.shots, {}
