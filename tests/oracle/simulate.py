"""The face of the reference: a model goes in, steps come out."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .load import Spring
from .model import F64, Model
from .pose import Pose, rotation_matrices
from .smooth import initial_state
from .step import StepReport, advance


class Reference:
    """Simulate at most ten spheres; `model` is the dict that `carom._core.Simulation` takes.

    >>> ball = Reference(model)
    >>> reports = ball.advance(100)
    >>> ball.x, ball.v
    """

    def __init__(self, model: Mapping[str, Any]) -> None:
        self.model = Model.from_dict(model)
        self.state = initial_state(self.model)

    def advance(self, steps: int) -> list[StepReport]:
        """Advance by `steps` steps, one report each; `NotConverged` leaves the last good state."""
        reports = []
        for _ in range(steps):
            self.state, report = advance(self.model, self.state)
            reports.append(report)
        return reports

    @property
    def time(self) -> float:
        """Time t_n [s]."""
        return self.state.step * self.model.options.step

    @property
    def x(self) -> F64:
        """Centres (N,3) [m]."""
        return self.state.x.copy()

    @property
    def q(self) -> F64:
        """Orientations (N,4), unit quaternions w first."""
        return self.state.q.copy()

    @property
    def v(self) -> F64:
        """Velocities (N,3) [m/s]."""
        return self.state.u.reshape(-1, 6)[:, :3].copy()

    @property
    def w(self) -> F64:
        """Spatial angular velocities (N,3) [rad/s]."""
        return self.state.u.reshape(-1, 6)[:, 3:].copy()

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]: weight, zero at the origin, and springs."""
        kinetic = 0.5 * float(np.sum(self.model.mass_diagonal * self.state.u**2))
        pose = Pose(self.state.x, np.zeros_like(self.state.x), rotation_matrices(self.state.q))
        springs = sum(load.energy(pose) for load in self.model.loads if isinstance(load, Spring))
        return kinetic, springs - float(np.sum(self.model.mass * (self.state.x @ self.model.gravity)))
