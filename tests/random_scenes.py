"""Random scenes for laws of mechanics: balls by themselves, in contact, or among walls, as hypothesis strategies.

A scene is drawn number by number, so that a failing one shrinks to few balls and round numbers, and every draw is a
scene: a ball that would overlap others is moved outwards along its own direction until there is room. `Case.to_toml` is
the scenario file of a scene, to report it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from physics_scenes import F64, balls
from trials import Trials

LAWS = ("friction", "restitution", "tangential_restitution", "rolling_radius", "spinning_radius")
#: Solved to rounding: what differs between a scene and its transform is then rounding too.
SHARP = {"tolerance": 1e-12, "pile_tolerance": 1e-12, "tolerance_floor": 1e-15}
PHASES = [phase for phase in Phase if phase != Phase.explain]
#: Scenes of each law, the same ones each time (`conftest.py`), in the quick and in the long tier.
TIERS = [
    pytest.param(settings(max_examples=6, phases=PHASES), id="few"),
    pytest.param(
        settings(max_examples=400, phases=PHASES, suppress_health_check=list(HealthCheck)),
        id="many",
        marks=pytest.mark.long,
    ),
]
in_both_tiers = pytest.mark.parametrize("tier", TIERS)


def hold(law: Callable[..., None], drawn: list[Any], tier: settings, trials: Trials, what: str) -> None:
    """Try a law on the scenes of a tier, and on what else it is drawn with; each is counted under `what`."""

    @functools.wraps(law)  # hypothesis derives the scenes from the source of the law
    def counted(**drawn: Any) -> None:
        with trials(what):
            law(**drawn)

    tier(given(*drawn)(counted))()


@dataclass(frozen=True)
class Run:
    """What the core did: `S + 1` states `x, v, w (S+1,N,3)`, `q (S+1,N,4)`, and its tables; SI units."""

    x: F64
    v: F64
    w: F64
    q: F64
    contacts: dict[str, Any]
    contact_step: Any
    impacts: dict[str, Any]
    steps: dict[str, Any]

    @property
    def energy(self) -> F64:
        """Kinetic and potential energy after each step, (S,) J."""
        return np.asarray(self.steps["energy_kinetic"] + self.steps["energy_potential"])


@dataclass(frozen=True)
class Case:
    """N balls and P planes as plain arrays, to be transformed and run; SI units.

    `law` and `wall_law`: friction, e_N, e_T, rolling radius, spinning radius between balls, and of balls with planes.
    """

    x: F64
    v: F64
    w: F64
    r: F64
    m: F64
    kappa: F64  # I = kappa m r^2
    gravity: F64
    point: F64
    normal: F64
    law: F64
    wall_law: F64
    step: float = 1e-3
    options: dict[str, Any] = field(default_factory=dict)

    def with_options(self, **options: Any) -> Case:
        return replace(self, options={**self.options, **options})

    def model(self) -> dict[str, Any]:
        """The arrays of `carom._core.Simulation`."""
        n, planes = len(self.r), len(self.point)
        laws = {name: np.array([self.law[k], self.wall_law[k]]) for k, name in enumerate(LAWS)}
        return {
            "gravity": self.gravity,
            "radius": self.r,
            "mass": self.m,
            "inertia": self.kappa * self.m * self.r**2,
            "position": self.x,
            "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
            "velocity": self.v,
            "angular_velocity": self.w,
            "material": np.zeros(n, dtype=np.int64),
            "plane_point": self.point,
            "plane_normal": self.normal,
            "plane_material": np.ones(planes, dtype=np.int64),
            "law_a": np.array([0, 0]),
            "law_b": np.array([0, 1]),
            **laws,
            "options": {"step": self.step, **SHARP, **self.options},
        }

    def run(self, steps: int = 60) -> Run:
        """Simulate; every step must have been solved at once, or the scene says nothing about the law."""
        simulation = _core.Simulation(self.model())
        start = simulation.frame()
        block = simulation.advance(steps, 1, True, 1e9)
        assert block["outcome"] is None, f"{block['outcome']}\n{self.to_toml()}"
        table = block["frames"]

        def states(name: str) -> F64:
            return np.concatenate([np.asarray(start[name])[None], np.asarray(table[name])])

        ends = np.asarray(table["contact_end"])
        contact_step = np.searchsorted(ends, np.arange(len(block["contacts"]["gap"])), side="right") + 1
        return Run(states("position"), states("velocity"), states("angular_velocity"), states("orientation"),
                   block["contacts"], contact_step, block["impacts"], block["steps"])  # fmt: skip

    def to_toml(self) -> str:
        """The scenario file of this scene, for a report of what went wrong."""
        laws = [dict(zip(LAWS, map(float, law))) for law in (self.law, self.wall_law)]
        scene = balls(self.x, self.v, self.w, radius=self.r, mass=self.m, gravity=self.gravity, law=laws[0], wall=laws[1],
                      planes=list(zip(self.point, self.normal)), step=self.step, until=60 * self.step,
                      **{**SHARP, **self.options})  # fmt: skip
        for sphere, kappa in zip(scene.spheres, self.kappa):
            sphere.inertia = float(kappa * sphere.mass * sphere.radius**2)
        return scene.to_toml()

    def turned(self, q: F64) -> Case:
        """By an orthogonal matrix; where it mirrors, angular velocities are pseudovectors."""
        return replace(self, x=self.x @ q.T, v=self.v @ q.T, w=np.linalg.det(q) * self.w @ q.T, gravity=q @ self.gravity,
                       point=self.point @ q.T, normal=self.normal @ q.T)  # fmt: skip

    def ordered(self, order: Any) -> Case:
        """Ball k of the new scene is ball `order[k]` of this one."""
        return replace(
            self, **{name: getattr(self, name)[order] for name in ("x", "v", "w", "r", "m", "kappa")}
        )

    def scaled(self, length: float, mass: float, time: float) -> Case:
        """In other units: all lengths, masses and times times these; ratios are pure numbers and stay."""
        law = np.array([1.0, 1.0, 1.0, length, length])
        return replace(
            self, x=length * self.x, v=length / time * self.v, w=self.w / time, r=length * self.r, m=mass * self.m,
            gravity=length / time**2 * self.gravity, point=length * self.point, law=law * self.law,
            wall_law=law * self.wall_law, step=time * self.step,
        )  # fmt: skip


def momentum(case: Case, run: Run) -> F64:
    """Linear momentum of every state, (S+1, 3) kg m/s."""
    return np.asarray(np.einsum("i,tik->tk", case.m, run.v))


def angular_momentum(case: Case, run: Run, about: F64) -> F64:
    """Angular momentum about a point of every state, (S+1, 3) kg m^2/s."""
    orbit = np.einsum("i,tik->tk", case.m, np.cross(run.x - about, run.v))
    return np.asarray(orbit + np.einsum("i,tik->tk", case.kappa * case.m * case.r**2, run.w))


def gaps(x: F64, r: F64) -> F64:
    """Gap of every pair of balls, over the smaller radius of the pair."""
    i, j = np.triu_indices(len(r), 1)
    return np.asarray((np.linalg.norm(x[i] - x[j], axis=-1) - r[i] - r[j]) / np.minimum(r[i], r[j]))


# ------------------------------------------------------------------------------------------------- strategies


def hundredths(low: int, high: int) -> st.SearchStrategy[float]:
    """Decimal numbers with two places, from low/100 to high/100: they shrink to short ones."""
    return st.integers(low, high).map(lambda k: k / 100)


def vectors(size: float = 1.0) -> st.SearchStrategy[F64]:
    return st.tuples(*3 * [hundredths(-100, 100)]).map(lambda v: size * np.array(v))


def directions() -> st.SearchStrategy[F64]:
    return (
        vectors()
        .map(lambda v: v if v.any() else np.array([0.0, 0.0, 1.0]))
        .map(lambda v: v / np.linalg.norm(v))
    )


@st.composite
def laws(draw: Any, frictionless: bool = False) -> F64:
    """mu in 0..1, e_N in 0..1, e_T in -0.5..0.9, rolling and spinning radius up to 2 mm, each of them often 0 (or 1)."""
    restitution = draw(st.sampled_from([0.0, 1.0]) | hundredths(0, 100))
    if frictionless:
        return np.array([0.0, restitution, 0.0, 0.0, 0.0])
    return np.array(
        [
            draw(st.just(0.0) | hundredths(0, 100)),
            restitution,
            draw(st.just(0.0) | hundredths(-50, 90)),
            draw(st.just(0.0) | hundredths(0, 20)) / 100,
            draw(st.just(0.0) | hundredths(0, 20)) / 100,
        ]
    )


def ball_laws(count: int) -> Any:
    """Radii over 1:5, densities over 1:8, spheres between filled with a heavy core and hollow."""
    radius = st.lists(hundredths(100, 500), min_size=count, max_size=count).map(lambda r: np.array(r) / 100)
    density = st.lists(hundredths(100, 800), min_size=count, max_size=count).map(lambda d: 1e3 * np.array(d))
    kappa = st.lists(st.just(0.4) | hundredths(20, 66), min_size=count, max_size=count).map(np.array)
    return st.tuples(radius, density, kappa)


@st.composite
def places(draw: Any, r: F64, apart: float = 0.0) -> F64:
    """Centres: each ball beside an earlier one, touching it (a gap of rounding), near it or farther away."""
    x = [np.zeros(3)]
    gap = st.sampled_from([0.0, 0.0, 1e-4, 5e-3]) | hundredths(0, 200).map(lambda g: g / 100)
    for k in range(1, len(r)):
        beside, along = draw(st.integers(0, k - 1)), draw(directions())
        reach = r[k] + r[beside] + apart + draw(gap)
        while True:
            here = x[beside] + reach * along
            free = min(np.linalg.norm(here - y) - s - r[k] for y, s in zip(x, r))
            if free >= -1e-12 * r[k]:
                break
            reach += max(-free, 1e-3 * r[k])
        x.append(here)
    return np.array(x)


def quiet_or_fast() -> st.SearchStrategy[float]:
    return st.sampled_from([0.0, 0.1, 1.0, 1.0])


@st.composite
def free_scenes(draw: Any, most: int = 12, frictionless: bool = False) -> Case:
    """2 to `most` balls, nothing else: they fly together, thrown towards their middle, spinning."""
    n = draw(st.integers(2, most))
    r, density, kappa = draw(ball_laws(n))
    x = draw(places(r))
    speed, inwards = draw(quiet_or_fast()), draw(hundredths(0, 300))
    v = np.array([draw(vectors(speed)) for _ in range(n)]) - inwards * (x - x.mean(axis=0)) / 0.1 * 0.3
    w = np.array([draw(vectors(draw(st.sampled_from([0.0, 30.0])))) for _ in range(n)])
    none = np.zeros((0, 3))
    law = draw(laws(frictionless))
    mass = density * 4 / 3 * np.pi * r**3
    return Case(x, v, w, r, mass, kappa, np.zeros(3), none, none, law, law)


@st.composite
def walled_scenes(draw: Any, most: int = 12, apart: float = 0.0) -> Case:
    """The same with up to three planes of any slope, each of which supports the scene (a ball touches it) or lies a little
    behind, and gravity or none."""
    case: Case = draw(free_scenes(most))
    point: list[F64] = []
    normal: list[F64] = []
    for _ in range(draw(st.integers(0, 3))):
        n = draw(directions())
        if any(n @ other < -0.9 for other in normal):
            n = -n  # no slit
        lowest = min(n @ x - s for x, s in zip(case.x, case.r))
        point.append((lowest - draw(st.sampled_from([0.0, 0.0, 0.01]))) * n)
        normal.append(n)
    gravity = draw(st.sampled_from([0.0, 9.8])) * draw(directions())
    return replace(case, point=np.array(point).reshape(-1, 3), normal=np.array(normal).reshape(-1, 3), gravity=gravity,
                   wall_law=draw(laws()))  # fmt: skip


def scenario(case: Case) -> carom.Scene:
    """The scene through the public interface."""
    return carom.Scene.from_toml(case.to_toml())
