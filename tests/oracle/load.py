"""Applied loads f(q, v, t) with C = -df/dv and K = -df/dq (section 8 of the specification)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from .law import ScalarLaw, read_law, read_vector
from .pose import F64, Ends, Pose, Span, direction


@dataclass
class Applied:
    """Sum of loads: f (6N,) [N, N m], its derivatives by (x, psi) and by (v, w), (6N, 6N)."""

    force: F64
    by_position: F64
    by_velocity: F64
    parts: F64
    """Sum of the absolute values of what f was added up from (6N,): rounding of f is relative to these."""

    @property
    def stiffness(self) -> F64:
        """K = -df/dq."""
        return -self.by_position

    @property
    def damping(self) -> F64:
        """C = -df/dv."""
        return -self.by_velocity


class Load(Protocol):
    """Something that pushes; `u` (6N,) generalised velocity."""

    def joins(self) -> tuple[int, ...]:
        """Spheres that it couples; a load that couples any follows their motion within f_p and f_v (eqs. 3, 4)."""
        ...

    def add(self, total: Applied, pose: Pose, u: F64, time: float) -> None:
        """Add the load and its derivatives."""
        ...


@dataclass(frozen=True)
class Weight:
    """m g on every sphere; mass (N,), gravity (3,)."""

    mass: F64
    gravity: F64

    def joins(self) -> tuple[int, ...]:
        """None."""
        return ()

    def add(self, total: Applied, pose: Pose, u: F64, time: float) -> None:
        """Add it."""
        weight = self.mass[:, None] * self.gravity
        total.force.reshape(-1, 6)[:, :3] += weight
        total.parts.reshape(-1, 6)[:, :3] += np.abs(weight)


@dataclass(frozen=True)
class TimeLoad:
    """Force and torque as functions of time, six laws, in fixed axes."""

    body: int
    laws: tuple[ScalarLaw, ...]

    def joins(self) -> tuple[int, ...]:
        """None: no motion enters."""
        return ()

    def add(self, total: Applied, pose: Pose, u: F64, time: float) -> None:
        """Add it."""
        own, given = slice(6 * self.body, 6 * self.body + 6), np.array([law.value(time) for law in self.laws])
        total.force[own] += given
        total.parts[own] += np.abs(given)


@dataclass(frozen=True)
class Spring:
    """F = k (l - l_0) + c l' along the line between two points, pulling both together; no force where l = 0."""

    ends: Ends
    stiffness: float
    damping: float
    rest_length: float

    def joins(self) -> tuple[int, ...]:
        """Its spheres."""
        return self.ends.bodies

    def add(self, total: Applied, pose: Pose, u: F64, time: float) -> None:
        """Add it: f = -F G^T with G = n . d(p_A - p_B)/dt."""
        span = Span(self.ends, pose)
        n, length, turning = direction(span.vector)
        gradient, between = n @ span.velocity, span.velocity @ u
        pull = self.stiffness * (length - self.rest_length) + self.damping * float(n @ between)
        total.force -= pull * gradient
        parts = self.stiffness * (length + self.rest_length) + self.damping * float(
            np.abs(n) @ np.abs(between)
        )
        total.parts += parts * np.abs(gradient)
        rate_slope = u @ span.turning(n) + between @ turning @ span.slope
        pull_slope = self.stiffness * (n @ span.slope) + self.damping * rate_slope
        turned = span.turning(n) + span.velocity.T @ turning @ span.slope
        total.by_position -= np.outer(gradient, pull_slope) + pull * turned
        total.by_velocity -= self.damping * np.outer(gradient, gradient)

    def energy(self, pose: Pose) -> float:
        """Elastic energy [J]."""
        length = direction(Span(self.ends, pose).vector)[1]
        return 0.5 * self.stiffness * (length - self.rest_length) ** 2


@dataclass(frozen=True)
class Drag:
    """Force -translation v and torque -rotation w on one sphere [N s/m, N m s]."""

    body: int
    translation: float
    rotation: float

    def joins(self) -> tuple[int, ...]:
        """Its sphere."""
        return (self.body,)

    def add(self, total: Applied, pose: Pose, u: F64, time: float) -> None:
        """Add it."""
        dofs = np.arange(6 * self.body, 6 * self.body + 6)
        coefficients = np.repeat([self.translation, self.rotation], 3)
        total.force[dofs] -= coefficients * u[dofs]
        total.parts[dofs] += np.abs(coefficients * u[dofs])
        total.by_velocity[dofs, dofs] -= coefficients


@dataclass(frozen=True)
class UserLoad:
    """A function of time, positions, velocities and angular velocities (N,3) that gives (N,6).

    It acts in the smooth motion; the corrections of contacts do not call it again.
    """

    function: Callable[[float, F64, F64, F64], Any]

    def joins(self) -> tuple[int, ...]:
        """None: corrections leave it as it is."""
        return ()

    def _force(self, x: F64, u: F64, time: float) -> F64:
        v = u.reshape(-1, 6)
        given = self.function(time, x.copy(), v[:, :3].copy(), v[:, 3:].copy())
        return np.asarray(given, dtype=np.float64).reshape(-1)

    def add(self, total: Applied, pose: Pose, u: F64, time: float) -> None:
        """Add it; derivatives by central differences, which serve Newton's matrix alone."""
        given = self._force(pose.x, u, time)
        total.force += given
        total.parts += np.abs(given)
        for i in range(len(u)):
            body, k = divmod(i, 6)
            nudge = 1e-6 * max(1.0, abs(float(u[i])))
            ahead, behind = u.copy(), u.copy()
            ahead[i] += nudge
            behind[i] -= nudge
            change = self._force(pose.x, ahead, time) - self._force(pose.x, behind, time)
            total.by_velocity[:, i] += change / (2.0 * nudge)
            if k < 3:
                nudge = 1e-6 * max(1.0, abs(float(pose.x[body, k])))
                there, here = pose.x.copy(), pose.x.copy()
                there[body, k] += nudge
                here[body, k] -= nudge
                change = self._force(there, u, time) - self._force(here, u, time)
                total.by_position[:, i] += change / (2.0 * nudge)


def applied_force(loads: Sequence[Load], pose: Pose, u: F64, time: float) -> Applied:
    """Sum of all loads at a pose and velocity u (6N,)."""
    n = pose.size
    total = Applied(np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n))
    for load in loads:
        load.add(total, pose, u, time)
    return total


def read_loads(model: Mapping[str, Any]) -> list[Load]:
    """The weight of the spheres, then `model["loads"]`."""
    count = len(model["radius"])
    mass = np.array(model["mass"], dtype=np.float64)
    result: list[Load] = [Weight(mass, read_vector(model["gravity"]))]

    def body_of(load: Mapping[str, Any], key: str, lowest: int = 0) -> int:
        body = int(load[key])
        if not lowest <= body < count:
            raise ValueError(f"load {len(result) - 1}: {key} = {body} of {count} bodies")
        return body

    for load in model.get("loads", ()):
        kind = load["kind"]
        if kind == "force":
            laws = tuple(read_law(law) for law in (*load["force"], *load["torque"]))
            result.append(TimeLoad(body_of(load, "body"), laws))
        elif kind == "spring":
            a, b = body_of(load, "a"), body_of(load, "b", -1)
            ends = Ends(a, b, read_vector(load["arm_a"]), read_vector(load["arm_b"]))
            numbers = (float(load[key]) for key in ("stiffness", "damping", "rest_length"))
            result.append(Spring(ends, *numbers))
        elif kind == "drag":
            body = body_of(load, "body")
            result.append(Drag(body, float(load["translation"]), float(load["rotation"])))
        elif kind == "callable":
            result.append(UserLoad(load["function"]))
        else:
            raise ValueError(f"load {len(result) - 1}: {kind!r} is not a kind of load")
    return result
