"""What is simulated: arrays of spheres and planes, contact laws by material pair, numerical options.

SI units throughout. A *generalised* vector of N bodies has shape (6 N,): for each body three translations,
then three rotations about the **spatial** axes. The isotropic inertia makes the mass matrix the constant
diagonal `diag(m, m, m, I, I, I)` per body, so there is no gyroscopic term anywhere in this package.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .joint import JointRow, never_meet, read_joints
from .law import ScalarLaw, read_law
from .load import Load, read_loads
from .pose import F64 as F64

TOUCH = 1e-9
"""A contact is closed, and a starting overlap admitted, up to this fraction of its reference radius."""


BEYOND = ("walls", "wall_motion", "periodic", "inflow", "outlet")
"""Keys of a model that only the core understands."""


@dataclass(frozen=True)
class Law:
    """Contact law of two materials: mu, e_N, e_T [-] and the radii rho, delta [m] of rolling and spinning."""

    friction: float = 0.0
    restitution: float = 0.0
    tangential_restitution: float = 0.0
    rolling_radius: float = 0.0
    spinning_radius: float = 0.0
    stiffness_ratio: float = 1.0
    friction_law: ScalarLaw | None = None
    """mu as a function of the slip speed [m/s] at t_n; takes the place of `friction`."""
    restitution_law: ScalarLaw | None = None
    """e_N as a function of the approach speed [m/s]; takes the place of `restitution`."""

    def rebound(self, approach: float) -> float:
        """e_N at an approach speed [m/s], 0 where it opens."""
        if self.restitution_law is None:
            return self.restitution
        return min(1.0, max(0.0, self.restitution_law.value(max(0.0, approach))))


@dataclass(frozen=True)
class Options:
    """Numerical options. `step` is h [s]; `spectral_radius` the rho_inf of eq. 7.

    `tolerance` is tol_r of eq. 44. It is deliberately not read from the `tolerance` of a model (that of the
    core), since this package judges others; `reference_tolerance` overrides it. `closing` has those of the core, in
    small islands and in others: what counts as closing follows from them. `max_problems` = 0: by size.
    """

    step: float
    spectral_radius: float = 0.8
    impact: str = "sequence"
    position_friction: str = "paper"
    restitution_threshold: float = 0.0
    impact_exponent: float = 1.5
    energy_safeguard: bool = True
    max_problems: int = 0
    max_iterations: int = 50
    tolerance: float = 1e-12
    gap_tolerance: float = 1e-10
    closing: tuple[float, float] = (1e-8, 1e-7)


@dataclass(frozen=True)
class Coefficients:
    """alpha_m, alpha_f, gamma, beta of the generalised-alpha scheme (eq. 7)."""

    alpha_m: float
    alpha_f: float
    gamma: float
    beta: float

    @staticmethod
    def from_spectral_radius(rho: float) -> "Coefficients":
        """Eq. 7 for a spectral radius at infinity in [0, 1)."""
        alpha_m = (2.0 * rho - 1.0) / (rho + 1.0)
        alpha_f = rho / (rho + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        return Coefficients(alpha_m, alpha_f, gamma, 0.25 * (gamma + 0.5) ** 2)


@dataclass(frozen=True)
class Pair:
    """Two partners that may touch: sphere `a`, and sphere `b > a` or, where `b >= N`, the plane `b - N`."""

    a: int
    b: int
    plane: int
    law: Law
    radius: float
    """Reference radius r_c [m]: the smaller radius, or that of the sphere at a plane."""

    @property
    def key(self) -> tuple[int, int]:
        """(a, b), planes counted after the spheres."""
        return (self.a, self.b)

    @property
    def bodies(self) -> tuple[int, ...]:
        """The spheres of the pair (a plane is no body and joins nothing)."""
        return (self.a,) if self.plane >= 0 else (self.a, self.b)


@dataclass
class State:
    """All that a step needs: centres x (N,3), orientations q (N,4) w first, generalised velocity u (6N,) spatial.

    `a` is the pseudo acceleration of eq. 6c and `acc` the smooth acceleration (v-dot-check), both (6N,). `reaction` (J,6) is
    what each joint gives its sphere A in the smooth motion [N, N m], `pseudo_reaction` the same filtered by eq. 6c: for the
    record only.
    """

    x: F64
    q: F64
    u: F64
    a: F64
    acc: F64
    step: int = 0
    reaction: F64 = field(default_factory=lambda: np.zeros((0, 6)))
    pseudo_reaction: F64 = field(default_factory=lambda: np.zeros((0, 6)))


@dataclass(frozen=True)
class Model:
    """The scene, immutable. Build it with `Model.from_dict`."""

    gravity: F64
    radius: F64
    mass: F64
    inertia: F64
    plane_point: F64
    plane_normal: F64
    pairs: list[Pair]
    options: Options
    coefficients: Coefficients
    position: F64
    orientation: F64
    velocity: F64
    angular_velocity: F64
    mass_diagonal: F64 = field(repr=False)
    """Diagonal of M, (6N,): kg and kg m^2."""
    joints: list[JointRow]
    """Rows of all joints, joint after joint."""
    loads: list[Load]
    """The weight of the spheres and whatever else pushes them."""

    @property
    def following(self) -> list[Load]:
        """The loads that change with the corrections of a step: springs, dampers, drag."""
        return [load for load in self.loads if load.joins()]

    @property
    def bodies(self) -> int:
        """Number of spheres N."""
        return len(self.radius)

    @staticmethod
    def from_dict(model: Mapping[str, Any]) -> "Model":
        """Read the dict of `carom._core.Simulation`; options that only the core knows are ignored."""
        radius = _array(model["radius"])
        n = len(radius)
        if n > 10:
            raise ValueError(f"the reference is for at most ten bodies, not {n}")
        beyond = [key for key in BEYOND if key in model]
        if beyond:
            raise ValueError(
                f"the reference knows planes that stand and balls that stay, not {', '.join(beyond)}"
            )
        mass, inertia = _array(model["mass"]), _array(model["inertia"])
        normal = _array(model.get("plane_normal", ())).reshape(-1, 3)
        normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        orientation = _array(model.get("orientation", np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)))).reshape(n, 4)
        blocks = np.repeat(np.stack([mass, inertia], axis=1), 3, axis=1)
        options = _options(model["options"])
        result = Model(
            gravity=_array(model["gravity"]),
            radius=radius,
            mass=mass,
            inertia=inertia,
            plane_point=_array(model.get("plane_point", ())).reshape(-1, 3),
            plane_normal=normal,
            pairs=_pairs(model, radius, len(normal)),
            options=options,
            coefficients=Coefficients.from_spectral_radius(options.spectral_radius),
            position=_array(model["position"]).reshape(n, 3),
            orientation=orientation / np.linalg.norm(orientation, axis=1, keepdims=True),
            velocity=_array(model.get("velocity", np.zeros((n, 3)))).reshape(n, 3),
            angular_velocity=_array(model.get("angular_velocity", np.zeros((n, 3)))).reshape(n, 3),
            mass_diagonal=blocks.reshape(6 * n),
            joints=read_joints(model),
            loads=read_loads(model),
        )
        for name, values in (("radius", radius), ("mass", mass), ("inertia", inertia)):
            if len(values) != n or not np.all(values > 0.0):
                raise ValueError(f"{name}: {n} positive numbers are needed")
        return result


def _array(values: Any) -> F64:
    return np.array(values, dtype=np.float64)


def _options(given: Mapping[str, Any]) -> Options:
    known = {
        name: given[name]
        for name in (
            "spectral_radius",
            "impact",
            "position_friction",
            "restitution_threshold",
            "impact_exponent",
            "energy_safeguard",
            "max_problems",
        )
        if name in given
    }
    names = ("tolerance", "pile_tolerance")
    small, coarse = (float(given.get(*item)) for item in zip(names, Options.closing, strict=True))
    options = Options(
        step=float(given["step"]),
        tolerance=float(given.get("reference_tolerance", 1e-12)),
        closing=(small, max(small, coarse)),
        **known,
    )
    if not options.step > 0.0 or not 0.0 <= options.spectral_radius < 1.0:
        raise ValueError("step must be positive and spectral_radius in [0, 1)")
    return options


def _pairs(model: Mapping[str, Any], radius: F64, planes: int) -> list[Pair]:
    """Every pair that can meet, in the order of its key, with its law; a missing law is an error."""
    n = len(radius)
    columns = ("friction", "restitution", "tangential_restitution", "rolling_radius", "spinning_radius")
    count = len(model.get("law_a", ()))
    table = [model.get(name, np.zeros(count)) for name in columns]
    ratio = model.get("stiffness_ratio", np.ones(count))
    slip, rebound = (
        [None if law is None else read_law(law) for law in model.get(name, [None] * count)]
        for name in ("friction_law", "restitution_law")
    )
    laws = {
        frozenset((int(a), int(b))): Law(
            **{name: float(column[i]) for name, column in zip(columns, table, strict=True)},
            stiffness_ratio=float(ratio[i]),
            friction_law=slip[i],
            restitution_law=rebound[i],
        )
        for i, (a, b) in enumerate(zip(model.get("law_a", ()), model.get("law_b", ()), strict=True))
    }
    sphere_material = [int(m) for m in model.get("material", np.zeros(n))]
    material = sphere_material + [int(m) for m in model.get("plane_material", np.zeros(planes))]
    apart = never_meet(model.get("joints", ()), radius)
    pairs = []
    for a in range(n):
        for b in range(a + 1, n + planes):
            law = laws.get(frozenset((material[a], material[b])))
            if law is None:
                raise ValueError(f"no contact law for the materials {material[a]} and {material[b]}")
            if frozenset((a, b)) in apart:
                continue
            reference = float(radius[a]) if b >= n else float(min(radius[a], radius[b]))
            pairs.append(Pair(a, b, b - n if b >= n else -1, law, reference))
    return pairs
