"""Impacts without a table: rows of touching balls, the Bernoulli problem, oblique hits, against closed forms."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import carom
import numpy as np
import pytest
from physics_scenes import EPS, F64, balls, below, example, kinetic, line, run

SHARP = {"tolerance": 1e-13, "tolerance_floor": 1e-16}
"""Newton iterates until nothing but rounding is left. By default it may stop at a relative error of 1e-8, though it
rarely does (its last step is quadratic), and without friction one iteration is exact."""


def last(result: carom.Result) -> F64:
    return np.asarray(result.velocity[-1])


def sequence_of_a_line(speeds: Any, e: float, tol: float) -> tuple[F64, int]:
    """Velocities after the sequence of impacts in a row of equal touching balls, and the number of problems: the
    closing contacts of each problem together, by Newton's law and complementarity, found by trying all active sets."""
    v, problems = np.array(speeds, dtype=float), 0
    while True:
        gamma = np.diff(v)
        closing = [c for c in range(len(gamma)) if gamma[c] < -tol]
        if not closing:
            return v, problems
        problems += 1
        coupling = np.array([[2.0 * (a == b) - (abs(a - b) == 1) for b in closing] for a in closing])
        q = (1 + e) * gamma[closing]
        for size in range(len(closing), 0, -1):
            for active in map(list, combinations(range(len(closing)), size)):
                impulse = np.zeros(len(closing))
                impulse[active] = np.linalg.solve(coupling[np.ix_(active, active)], -q[active])
                if (impulse >= 0).all() and (q + coupling @ impulse >= -1e-14).all():
                    break
            else:
                continue
            break
        for c, p in zip(closing, impulse):
            v[c] -= p
            v[c + 1] += p


# ---------------------------------------------------------------------------------------------- rows of balls


@pytest.mark.parametrize(("options", "bound"), [({}, EPS), (SHARP, EPS)], ids=["default", "sharp"])
@pytest.mark.parametrize("impact", ["sequence", "sequence-paper"])
def test_three_touching_balls_by_the_sequence(impact: str, options: dict[str, float], bound: float) -> None:
    result = example("three_balls", impact=impact, **options)
    below(2 * bound, f"three balls, {impact}", last(result) - [[0, 0, 0], [0, 0, 0], [2, 0, 0]])
    assert result.steps.impact_problems[0] == 2
    assert result.outcome.ok


@pytest.mark.parametrize(("options", "bound"), [({}, EPS), (SHARP, EPS)], ids=["default", "sharp"])
def test_three_touching_balls_in_one_shot(options: dict[str, float], bound: float) -> None:
    result = example("three_balls", impact="one-shot", **options)
    below(2 * bound, "three balls, one-shot", last(result)[:, 0] - [-2 / 3, 4 / 3, 4 / 3])
    assert not last(result)[:, 1:].any()
    assert result.steps.impact_problems[0] == 1


@pytest.mark.parametrize(("options", "bound"), [({}, 2 * EPS), (SHARP, 2 * EPS)], ids=["default", "sharp"])
def test_newtons_cradle(options: dict[str, float], bound: float) -> None:
    result = example("newtons_cradle", **options)
    below(bound, "cradle, one in one out", last(result)[:, 0] - [0, 0, 0, 0, 1])
    assert result.steps.impact_problems[0] == 4
    for moving in (2, 3, 4):
        result = run(line([1.0] * moving + [0.0] * (5 - moving)), steps=20, **options)
        expected = [0.0] * (5 - moving) + [1.0] * moving
        below(bound, f"cradle, {moving} in {moving} out", last(result)[:, 0] - expected)
        assert result.summary["energy"]["max_rise_relative"] <= 1e-12


ROWS = [(n, e) for n in (2, 3, 5, 8) for e in (1.0, 0.93, 0.5, 0.1)]


@pytest.mark.parametrize(("n", "e"), ROWS)
def test_a_row_of_balls_is_the_sequence_of_its_impacts(n: int, e: float) -> None:
    # The sequence goes on until nothing closes by more than 1e-6 of the fastest speed (rule R3).
    expected, problems = sequence_of_a_line([1.0] + [0.0] * (n - 1), e, 1e-6)
    result = run(line([1.0] + [0.0] * (n - 1), restitution=e), steps=1, **SHARP)
    below(4 * n * EPS, f"row of {n}, e = {e}, {problems} problems", last(result)[:, 0] - expected)
    assert result.steps.impact_problems[0] == problems
    assert result.steps.truncated[0] == result.steps.fallbacks[0] == 0


def test_rows_of_balls_have_the_numbers_of_the_theory() -> None:
    # Three balls with e = 0.93 hit 1-2, 2-3, 1-2; the last of five gets ((1 + e)/2)^4.
    three, five = (last(run(line([1.0] + [0.0] * (n - 1), restitution=0.93), steps=1))[:, 0] for n in (3, 5))
    a, b = 1.93 / 2, 0.07 / 2
    below(4 * EPS, "three balls, e = 0.93", three - [b * b + a * a * b, a * b + a * b * b, a * a])
    assert three == pytest.approx([0.0338, 0.0350, 0.9312], abs=5e-5)
    assert five[-1] == pytest.approx(a**4, abs=1e-11)
    assert five[-1] == pytest.approx(0.8672, abs=5e-5)


@pytest.mark.parametrize(("n", "e"), [(5, 0.0), (8, 0.1), (8, 0.0)])
def test_a_sequence_that_would_not_end_is_cut_and_loses_energy(n: int, e: float) -> None:
    result = run(line([1.0] + [0.0] * (n - 1), restitution=e), steps=1, max_problems=50)
    assert result.steps.truncated[0] == 1
    assert result.summary["truncated_sequences"] == 1
    assert result.steps.impact_problems[0] == 51
    after = last(result)[:, 0]
    assert after.sum() == pytest.approx(1.0, abs=4 * EPS)
    below(1e-7, f"cut sequence of {n}: closing speed", np.maximum(0.0, -np.diff(after)))
    if e == 0.0:
        below(1e-7, f"cut sequence of {n}: all together", after - 1 / n)
    assert kinetic(result, 1) <= kinetic(result, 0)


def test_a_row_hit_from_both_sides() -> None:
    speeds = [2.0, 0.0, 0.0, 0.0, -1.0]
    for e in (1.0, 0.9, 0.4):
        expected, problems = sequence_of_a_line(speeds, e, 2e-6)
        result = run(line(speeds, restitution=e), steps=1, **SHARP)
        below(40 * EPS, f"row hit from both sides, e = {e}", last(result)[:, 0] - expected)
        assert result.steps.impact_problems[0] == problems


# ---------------------------------------------------------------------------------------------- Bernoulli, section 5.5


C, S = np.sqrt(3.0) / 2, 0.5  # cos and sin of 30 degrees: all three touch


def bernoulli(h: float, e: float = 1.0, mu: float = 0.0, **options: Any) -> carom.Result:
    """Ball "1" with 1 m/s along x between balls "0" and "2"; r = 1 m, m = 1 kg."""
    x, v = [[2 * C, 2 * S, 0], [0, 0, 0], [2 * C, -2 * S, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 0]]
    law = {"friction": mu, "restitution": e}
    return run(balls(x, v, radius=1.0, mass=1.0, step=h, law=law), steps=1, **options)


def bernoulli_exact(e: float) -> F64:
    """Velocities by eq. 53, for any restitution."""
    u = C * (1 + e) / (1 + 2 * C * C)
    return np.array([[u * C, u * S, 0], [(1 - 2 * C * C * e) / (1 + 2 * C * C), 0, 0], [u * C, -u * S, 0]])


@pytest.mark.parametrize("e", [1.0, 0.93, 0.5, 0.0])
def test_bernoulli_is_equation_53_at_the_impact(e: float) -> None:
    # In a step h the normals turn by about v h/r before the impact is solved: first order, and nothing else is left.
    errors = [last(bernoulli(h, e, **SHARP)) - bernoulli_exact(e) for h in (1e-2, 1e-3, 1e-4, 1e-13)]
    below(4 * 1e-13 + 4 * EPS, f"Bernoulli, e = {e}, h = 1e-13 s", errors[3])
    sizes = [np.abs(error).max() for error in errors[:3]]
    assert sizes[0] < 0.1 * 1e-2 * 3
    if e > 0.0:
        order = np.log10(np.array(sizes[:2]) / sizes[1:])
        below(0.01, f"Bernoulli, e = {e}: order - 1 (orders {order})", order - 1)


def test_bernoulli_has_the_published_values() -> None:
    assert bernoulli_exact(1.0)[:2] == pytest.approx(np.array([[0.6, 0.3464, 0], [-0.2, 0, 0]]), abs=5e-5)
    # At the step of the paper, with the law as printed (normal of t_n in the restitution term) ...
    printed = bernoulli(1e-2, impact="sequence-paper")
    assert last(printed)[1, 0] == pytest.approx(-0.199791, abs=5e-7)
    assert last(printed)[0, :2] == pytest.approx([0.599893, 0.347155], abs=5e-6)
    assert kinetic(printed, 1) / kinetic(printed, 0) == pytest.approx(1 + 6.95e-4, abs=1e-6)
    # ... and with one normal in both terms, which keeps the energy.
    ours = bernoulli(1e-2, **SHARP)
    assert last(ours)[1, 0] == pytest.approx(-0.19944, abs=5e-6)
    below(4 * EPS, "Bernoulli: energy / initial - 1", kinetic(ours, 1) / kinetic(ours, 0) - 1)
    below(4 * EPS, "Bernoulli: left and right", last(ours)[0] - last(ours)[2] * [1, -1, 1])


def test_friction_between_the_balls_would_gain_energy_and_is_kept_from_it() -> None:
    # Sticking balls: x = v2 = (1 - 2 c^2 e)/(1 + 2 c^2 + 2 s^2/3.5); e = 1 gains 1/37 by Newton's law.
    for e in (1.0, 0.98, 0.97, 0.93):
        free = bernoulli(1e-12, e, mu=0.06, energy_safeguard=False, **SHARP)
        x = (1 - 2 * C * C * e) / (1 + 2 * C * C + 2 * S * S / 3.5)
        along = (1 - x) / 2  # by the momentum
        u = np.array([along, (C * (e + x) - C * along) / S])  # and by restitution
        below(1e-11, f"sticking Bernoulli, e = {e}: v2", last(free)[1, 0] - x)
        below(1e-11, f"sticking Bernoulli, e = {e}: v1", last(free)[0, :2] - u)
        if e == 1.0:
            assert kinetic(free, 1) / kinetic(free, 0) == pytest.approx(38 / 37, abs=1e-11)
        ratio = kinetic(free, 1) / kinetic(free, 0)
        safe = bernoulli(1e-12, e, mu=0.06, **SHARP)
        assert kinetic(safe, 1) / kinetic(safe, 0) <= 1 + 1e-10
        assert (safe.steps.restitution_scale[0] < 1.0) == (ratio > 1 + 1e-10)
        if ratio > 1:  # bisected 12 times: the loss is less than one part in 2^12
            assert kinetic(safe, 1) / kinetic(safe, 0) > 1 - 4 * 2.0**-12
            assert safe.summary["safeguarded"] == 1


# ---------------------------------------------------------------------------------------------- oblique hits


@pytest.mark.parametrize("fraction", [1.0, 0.7, 0.3])
@pytest.mark.parametrize("masses", [(1.0, 1.0), (0.2, 1.0)])
def test_an_oblique_elastic_hit_keeps_the_energy(fraction: float, masses: tuple[float, float]) -> None:
    b = 2 * (1 - fraction)
    x, v = [[-2.1, b, 0.1], [0, 0, 0]], [[1.3, 0.1, -0.05], [0, 0.2, 0]]
    result = run(balls(x, v, radius=1.0, mass=masses, step=1e-2, law={}), steps=60, **SHARP)
    assert len(result.impacts) == 1
    below(
        4 * EPS, "oblique hit: energy", np.array([kinetic(result, k) for k in (-1,)]) / kinetic(result, 0) - 1
    )
    assert result.summary["energy"]["max_rise_relative"] <= 4 * EPS
    # Relative velocity: reflected along the normal of the impact, unchanged across it.
    n, before, after = np.asarray(result.impacts.normal[0]), np.subtract(*v), np.subtract(*last(result))
    below(8 * EPS, "oblique hit: reflection", after - (before - 2 * (before @ n) * n))
    momentum = np.array(masses) @ np.asarray(result.velocity)[-1] - np.array(masses) @ np.array(v)
    below(8 * EPS, "oblique hit: momentum", momentum)


@pytest.mark.parametrize("e", [1.0, 0.9])
def test_one_hit_with_friction_is_the_closed_form(e: float) -> None:
    """Two equal homogeneous spheres: L_N = (1 + e) m v_n/2, L_T = min(mu L_N, m v_t/7), opposed to the slip."""
    for mu, offset in ((0.05, 0.9), (0.3, 0.3), (0.05, 0.05)):
        # The balls touch at the start, and the step is so short that the normal does not turn.
        n = np.array([np.sqrt(1 - offset**2), -offset, 0.0])
        v, w = np.array([1.0, 0.0, 0.2]), np.array([0.3, -0.1, 0.4])
        scene = balls([-2 * n, [0, 0, 0]], [v, [0, 0, 0]], [w, [0, 0, 0]], radius=1.0, mass=2.0, step=1e-13,
                      law={"friction": mu, "restitution": e})  # fmt: skip
        result = run(scene, steps=1, **SHARP)
        normal = -n  # from B to A
        slip = v + np.cross(normal, w)
        slip = slip - (slip @ normal) * normal
        size = np.linalg.norm(slip)
        along = (1 + e) / 2 * 2.0 * -(v @ normal)
        across = min(mu * along, 2.0 * size / 7)
        impulse = along * normal - across * slip / size
        below(2e-12, f"hit with mu = {mu}: impulse", np.asarray(result.impacts.impulse[0]) - impulse)
        below(2e-12, "hit with friction: v", last(result) - [v + impulse / 2, -impulse / 2])
        turn = np.cross(-normal, impulse) / (0.4 * 2.0)
        below(2e-12, "hit with friction: w", np.asarray(result.angular_velocity[-1]) - [w + turn, turn])
        assert kinetic(result, 1) < kinetic(result, 0)
        assert result.impacts.status[0] == (1 if across < mu * along else 2)


def test_tangential_restitution_reverses_the_slip_of_a_sticking_hit() -> None:
    for e_t in (-0.5, 0.4, 0.9):
        v = np.array([-1.0, 0.1, 0.05])
        scene = balls([[2.0, 0, 0], [0, 0, 0]], [v, [0, 0, 0]], radius=1.0, mass=1.0, step=1e-13,
                      law={"friction": 1.0, "restitution": 0.8, "tangential_restitution": e_t})  # fmt: skip
        result = run(scene, steps=1, **SHARP)
        after, w = last(result), np.asarray(result.angular_velocity[-1])
        slip = after[0] - after[1] + np.cross([1, 0, 0], w[0] + w[1])
        below(1e-12, f"e_T = {e_t}: slip + e_T slip before", slip[1:] + e_t * v[1:])
        assert kinetic(result, 1) < kinetic(result, 0)
