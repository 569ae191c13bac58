"""Symmetries of mechanics on random scenes: balls thrown at each other, free or into a corner of walls.

A scene and its transform differ in rounding, and in what the solver leaves (here 1e-12). Hits multiply a difference by
about (distance between hits)/r each, so runs are short and bounds far above rounding, but far below any real fault.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import carom
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_scenes import EPS, F64, balls, below, rotation, run

SHARP = {"tolerance": 1e-12, "pile_tolerance": 1e-12}
SEEDS = st.integers(0, 10_000)
few = settings(max_examples=3)  # test_property_symmetries.py has hundreds in the long tier


@dataclass(frozen=True)
class Throw:
    """Balls, walls and gravity as plain arrays, to be transformed and simulated."""

    x: F64
    v: F64
    w: F64
    r: F64
    m: F64
    gravity: F64
    walls: tuple[tuple[F64, F64], ...]
    law: dict[str, float]

    def run(self, steps: int = 120, step: float = 1e-3, **options: Any) -> carom.Result:
        scene = balls(self.x, self.v, self.w, radius=self.r, mass=self.m, gravity=self.gravity, planes=self.walls,
                      law=self.law, step=step)  # fmt: skip
        return run(scene, steps=steps, **{**SHARP, **options})

    def turned(self, q: F64) -> Throw:
        """By an orthogonal matrix; where it mirrors, angular velocities are pseudovectors."""
        walls = tuple((q @ point, q @ normal) for point, normal in self.walls)
        spin = np.linalg.det(q) * self.w @ q.T
        return replace(self, x=self.x @ q.T, v=self.v @ q.T, w=spin, gravity=q @ self.gravity, walls=walls)


def cloud(seed: int, n: int = 6, gravity: float = 0.0) -> Throw:
    """Balls of several sizes on their way to the middle, spinning; nothing else is there."""
    rng = np.random.default_rng(seed)
    r = rng.uniform(0.02, 0.03, n)
    places = np.array([[i, j, k] for i in range(2) for j in range(2) for k in range(2)], dtype=float)[:n]
    x = 0.075 * (places - 0.5) + rng.uniform(-0.004, 0.004, (n, 3))
    v = -16.0 * x + 0.3 * rng.normal(size=(n, 3))
    law = {"friction": 0.3, "restitution": 0.7, "tangential_restitution": 0.1, "rolling_radius": 1e-3,
           "spinning_radius": 5e-4}  # fmt: skip
    return Throw(x, v, 15.0 * rng.normal(size=(n, 3)), r, 8e3 * r**3, np.array([0.0, 0.0, -gravity]), (), law)


def corner(seed: int) -> Throw:
    """The cloud thrown into three walls and a slanted one, by gravity that is not along any axis."""
    throw = cloud(seed)
    walls = [
        ((-0.08, 0, 0), (1, 0, 0)),
        ((0, -0.08, 0), (0, 1, 0)),
        ((0, 0, -0.08), (0, 0, 1)),
        ((0.07, 0.07, 0), (-0.8, -0.6, 0)),
    ]
    planes = tuple((np.array(p, dtype=float), np.array(n, dtype=float)) for p, n in walls)
    return replace(throw, v=throw.v - [0.3, 0.2, 0.8], gravity=np.array([-3.0, -2.0, -9.0]), walls=planes)


def motion(result: carom.Result, frame: int = -1) -> tuple[F64, F64, F64]:
    x, v, w = result.position, result.velocity, result.angular_velocity
    return np.asarray(x[frame]), np.asarray(v[frame]), np.asarray(w[frame])


def hits(result: carom.Result) -> int:
    return int(np.sum(np.asarray(result.impacts.problem) > 0))


def agree(what: str, one: Any, two: Any, bound: float = 1e-10) -> None:
    for name, a, b, scale in zip("xvw", one, two, (1.0, 1.0, 50.0)):
        below(bound * scale, f"{what}: {name}", a - b)


# ---------------------------------------------------------------------------------------------- balances


@few
@given(SEEDS)
def test_momentum_of_free_balls_is_conserved(seed: int) -> None:
    throw = cloud(seed)
    result = throw.run(tolerance=1e-8, pile_tolerance=1e-7)
    assert hits(result) >= 3
    p = np.einsum("i,tik->tk", throw.m, np.asarray(result.velocity))
    # Every impulse acts twice, with opposite signs, whatever the solver left.
    scale = throw.m @ np.linalg.norm(throw.v, axis=1)
    below(1e-13, f"seed {seed}: momentum", (p - p[0]) / scale)
    centre = np.einsum("i,tik->tk", throw.m, np.asarray(result.position)) / throw.m.sum()
    uniform = centre[0] + np.asarray(result.time)[:, None] * p[0] / throw.m.sum()
    # Position corrections are such pairs too, but to the tolerance of the solver.
    below(1e-9 * 0.1, f"seed {seed}: centre of mass", centre - uniform)


def angular_momentum(throw: Throw, result: carom.Result, about: F64) -> F64:
    x, v, w = (np.asarray(a) for a in (result.position, result.velocity, result.angular_velocity))
    return np.asarray(
        np.einsum("i,tik->tk", throw.m, np.cross(x - about, v))
        + np.einsum("i,tik->tk", 0.4 * throw.m * throw.r**2, w)
    )


def test_angular_momentum_drifts_with_first_order() -> None:
    drift = []
    for h in (1e-3, 1e-4, 1e-5):
        worst = []
        for seed in range(4):
            throw = cloud(seed)
            spin = angular_momentum(throw, throw.run(steps=int(0.12 / h), step=h), np.zeros(3))
            scale = throw.m @ np.linalg.norm(throw.v, axis=1) * 0.1
            worst.append(np.abs(spin - spin[0]).max() / scale)
        drift.append(max(worst))
    print(f"angular momentum: largest drift for h = 1e-3, 1e-4, 1e-5: {drift}")
    assert drift[0] < 0.1
    assert drift[1] < 0.2 * drift[0]
    assert drift[2] < 0.2 * drift[1]


@few
@given(SEEDS)
def test_energy_never_rises(seed: int) -> None:
    for throw in (cloud(seed), cloud(seed, gravity=9.8)):
        result = throw.run(tolerance=1e-8)
        energy = result.summary["energy"]
        assert energy["final"] < energy["initial"]
        below(1e-12, f"seed {seed}: energy rise, free balls", energy["max_rise_relative"])
    # Balls that stay in contact while they roll over each other may gain, as second order in h (rule R5).
    result = corner(seed).run(steps=300, tolerance=1e-8)
    below(2e-6, f"seed {seed}: energy rise in a corner", result.summary["energy"]["max_rise_relative"])


# ---------------------------------------------------------------------------------------------- invariances


@few
@given(SEEDS)
def test_a_scene_that_moves_as_a_whole(seed: int) -> None:
    throw, shift = cloud(seed, gravity=9.8), np.array([0.7, -0.4, 1.1])
    still, moving = throw.run(), replace(throw, v=throw.v + shift).run()
    assert hits(still) >= 3
    x, v, w = motion(moving)
    agree(f"seed {seed}, Galilean shift", motion(still), (x - shift * float(moving.time[-1]), v - shift, w))


@few
@given(SEEDS)
def test_a_scene_that_is_somewhere_else(seed: int) -> None:
    throw, shift = corner(seed), np.array([3.0, -2.0, 5.0])
    walls = tuple((point + shift, normal) for point, normal in throw.walls)
    here, there = throw.run(), replace(throw, x=throw.x + shift, walls=walls).run()
    assert hits(here) >= 6
    x, v, w = motion(there)
    agree(f"seed {seed}, translation", motion(here), (x - shift, v, w))


@few
@given(SEEDS)
def test_a_scene_that_is_turned(seed: int) -> None:
    throw, q = corner(seed), rotation(seed)
    here, there = throw.run(), throw.turned(q).run()
    assert hits(here) >= 6
    agree(f"seed {seed}, rotation", motion(here), [a @ q for a in motion(there)])


@few
@given(SEEDS)
def test_a_scene_in_the_mirror(seed: int) -> None:
    throw, mirror = corner(seed), np.diag([1.0, -1.0, 1.0])
    here, there = throw.run(), throw.turned(mirror).run()
    x, v, w = motion(there)
    agree(f"seed {seed}, mirror", motion(here), (x @ mirror, v @ mirror, -w @ mirror))


@few
@given(SEEDS)
def test_a_scene_with_its_balls_in_another_order(seed: int) -> None:
    throw = corner(seed)
    order = np.random.default_rng(seed).permutation(len(throw.r))
    shuffled = replace(
        throw, **{name: getattr(throw, name)[order] for name in "xvwrm"}, walls=throw.walls[::-1]
    )
    here, there = motion(throw.run()), motion(shuffled.run())
    agree(f"seed {seed}, order", [a[order] for a in here], there)


@few
@given(SEEDS, st.integers(1, 100))
def test_a_scene_that_begins_later(seed: int, first: int) -> None:
    throw = corner(seed)
    whole = throw.run()
    x, v, w = motion(whole, first)
    rest = replace(throw, x=x, v=v, w=w).run(steps=120 - first)
    agree(f"seed {seed}, time shift", motion(whole), motion(rest))


@few
@given(SEEDS)
def test_units_of_mass_do_not_matter(seed: int) -> None:
    """A power of two changes no rounding: the motion has the same bits."""
    throw = corner(seed)
    light, heavy = throw.run(), replace(throw, m=1024.0 * throw.m).run()
    for a, b in zip(motion(light), motion(heavy)):
        assert np.array_equal(a, b)


@few
@given(SEEDS)
def test_orientations_do_not_act_on_the_motion_and_stay_of_unit_length(seed: int) -> None:
    result = corner(seed).run()
    size = np.linalg.norm(np.asarray(result.orientation), axis=2)
    below(8 * EPS, f"seed {seed}: |q| - 1", size - 1)


# ---------------------------------------------------------------------------------------------- the same bits


@few
@given(SEEDS)
def test_the_same_bits_twice_and_whatever_is_recorded(seed: int) -> None:
    throw = corner(seed)
    runs = [throw.run(**o) for o in ({}, {}, {"contacts": False}, {"every": 7})]
    for other in runs[1:3]:
        for name in ("position", "orientation", "velocity", "angular_velocity"):
            assert np.asarray(getattr(other, name)).tobytes() == np.asarray(getattr(runs[0], name)).tobytes()
    thinned = np.asarray(runs[3].step)
    assert np.asarray(runs[3].position).tobytes() == np.asarray(runs[0].position)[thinned].tobytes()
    assert len(runs[2].contacts) == 0
    # Contacts since the last frame are added up.
    total = [
        np.asarray(r.contacts.impulse)[np.asarray(r.contacts.time) < 0.1195].sum(0)
        for r in (runs[0], runs[3])
    ]
    assert total[1] == pytest.approx(total[0], rel=1e-12, abs=1e-15)


@few
@given(SEEDS)
def test_newton_for_every_island_is_the_closed_form(seed: int) -> None:
    throw = corner(seed)
    agree(f"seed {seed}, newton", motion(throw.run()), motion(throw.run(solver="newton")))


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")  # of walls that are as fast as that
@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_a_box_that_moves_fast_with_its_balls(method: str) -> None:
    def run(shift: tuple[float, float, float]) -> carom.Result:
        scene = carom.Scene("box")
        scene.contact("b", "b", friction=0.2, restitution=0.7)
        moves = {"translation": [{"expression": f"{v} * t"} for v in shift]} if any(shift) else None
        for axis, name in enumerate("xyz"):
            normal = tuple(float(k == axis) for k in range(3))
            scene.plane(name, material="b", point=(0, 0, 0), normal=normal, motion=moves)
        for name, at, v in (
            ("a", (0.04, 0.05, 0.06), (-1, 0.3, -0.5)),
            ("c", (0.1, 0.06, 0.07), (-2, -0.4, -1)),
        ):
            velocity = tuple(np.add(v, shift))
            scene.sphere(name, radius=0.02, mass=0.1, at=at, velocity=velocity, material="b")
        return carom.simulate(scene, method=method, step=1e-3, until=0.1, every=1)

    shift = (100.0, -50.0, 25.0)
    still, moving = run((0, 0, 0)), run(shift)
    assert len(still.impacts) >= 4
    assert moving.steps["substeps"].sum() == 0  # nothing moves against anything by more than before
    passed = np.multiply.outer(moving.time, shift)
    np.testing.assert_allclose(moving.position - passed[:, None], still.position, rtol=0, atol=1e-9)
