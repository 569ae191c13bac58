"""The billiard break of section 5.6: what the paper reports, and what must hold in every step."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

import carom
import numpy as np
import pytest
from physics_scenes import EPS, F64, G, M, R, below, example, kinetic

CUE, APEX, LEFT, RIGHT, BED = 0, 1, 2, 3, 4
KAPPA = 5.5e-5 / (M * R * R)
STEPS = [1e-3, 1e-4, pytest.param(1e-5, marks=pytest.mark.long)]
CASES = ["5.6_break", "5.6_break_rolling"]


@cache
def shot(case: str, step: float, **options: Any) -> carom.Result:
    return example(case, step=step, **options)


def first_hit(result: carom.Result) -> int:
    """Number of the step in which the cue ball first meets the apex ball."""
    body, problem = np.asarray(result.impacts.body), np.asarray(result.impacts.problem)
    return int(np.asarray(result.impacts.step)[(body == (CUE, APEX)).all(axis=1) & (problem > 0)][0])


def slip(result: carom.Result) -> F64:
    """Speed of each ball's lowest point along the bed, (T, N)."""
    lever = np.cross(np.asarray(result.angular_velocity), [0.0, 0.0, -R])
    return np.asarray(np.linalg.norm((np.asarray(result.velocity) + lever)[:, :, :2], axis=2))


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("case", CASES)
def test_every_step_is_solved_and_loses_energy(case: str, step: float) -> None:
    result = shot(case, step)
    s = result.summary
    assert result.outcome.ok
    assert s["unconverged"] == s["halvings"] == s["fallbacks"] == s["truncated_sequences"] == 0
    assert s["missed_impacts"] == s["safeguarded"] == 0
    below(1e-10, f"{case}, h = {step}: penetration / r", s["penetration_max_relative"])
    below(1e-12, f"{case}, h = {step}: energy rise / initial", s["energy"]["max_rise_relative"])
    assert s["energy"]["rises"] == 0
    counts = {key: s[key] for key in ("iterations", "line_search", "impact_problems")}
    print(f"{case}, h = {step}: {counts}")


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("case", CASES)
def test_the_scene_is_mirrored_and_so_is_the_motion(case: str, step: float) -> None:
    result = shot(case, step)
    x, v, w = (np.asarray(a) for a in (result.position, result.velocity, result.angular_velocity))
    # Rounding breaks the symmetry by EPS; hits of balls on balls multiply that by some ten each.
    below(1e-9, f"{case}, h = {step}: balls 4 and 5, y", x[:, LEFT, 1] + x[:, RIGHT, 1] - 1.27)
    below(1e-9, "x and z", (x[:, LEFT] - x[:, RIGHT])[:, [0, 2]])
    below(1e-9, "v", v[:, LEFT] - v[:, RIGHT] * [1, -1, 1])
    below(1e-9 / R, "w", w[:, LEFT] - w[:, RIGHT] * [-1, 1, -1])
    below(1e-9, "balls 2 and 3 stay on the line", x[:, [CUE, APEX], 1] - 0.635)


@pytest.mark.parametrize("step", STEPS)
def test_the_hit_comes_when_and_as_fast_as_published(step: float) -> None:
    result = shot("5.6_break", step)
    hit = first_hit(result)
    # The free path is 1.27 m - 2 r: v0 t - mu g t^2/2.
    v0, a, path = 10.729, 0.2 * G, 1.27 - 2 * R
    t = (v0 - np.sqrt(v0 * v0 - 2 * a * path)) / a
    assert hit == int(np.ceil(t / step))
    assert t == pytest.approx(0.1142, abs=5e-5)
    assert v0 - a * t == pytest.approx(10.505, abs=5e-4)
    cue = result["ball2"]
    before = slice(0, hit)
    time = np.asarray(result.time)[before]
    below(hit * EPS * v0, "cue ball before the hit, v", cue.velocity[before, 0] - (v0 - a * time))
    below(
        hit * EPS,
        "cue ball before the hit, x",
        cue.position[before, 0] - (0.635 + v0 * time - a * time**2 / 2),
    )
    below(hit * EPS * 20, "its spin", cue.angular_velocity[before, 1] - a * time / (KAPPA * R))
    assert cue.angular_velocity[hit - 1, 1] == pytest.approx(19.776, abs=0.2)
    for name in ("ball3", "ball4", "ball5"):
        assert np.abs(result[name].velocity[:hit]).max() == 0.0


@pytest.mark.parametrize("step", STEPS)
def test_after_the_hit_the_balls_go_where_the_paper_says(step: float) -> None:
    result = shot("5.6_break", step)
    v = np.asarray(result.velocity)[first_hit(result)]
    print(f"h = {step}: velocities after the hit {v.round(5).tolist()}")
    assert v[APEX, 0] == pytest.approx(0.2863, abs=1e-3)  # forward, slowly
    # Back and up, to first order in h: 0.37 r of travel in a step turns the normals.
    assert v[CUE, 0] == pytest.approx(-1.4547, abs=90.0 * step)
    assert v[CUE, 2] == pytest.approx(0.1205, abs=20.0 * step)
    assert v[LEFT, :2] == pytest.approx([5.8208, 3.6085], abs=70.0 * step)
    # It flies until it lands, with constant spin.
    hit, cue = first_hit(result), result["ball2"]
    flight = int(2 * 0.1205 / G / step)
    assert cue.position[hit + flight // 2, 2] > R + 5e-4
    below(1e-13, "spin in flight", np.ptp(cue.angular_velocity[hit : hit + flight - 2, 1]))
    # Without friction, e = 0.93, the sequence has its own closed values (theory, section 6).
    assert v[CUE, 0] / 10.505 == pytest.approx(-0.1459, abs=0.02)


def test_velocities_after_the_hit_converge_with_first_order() -> None:
    """The error is that of the normals, which turn by the travel after contact. With steps that always overshoot by the
    same share of a step it is a smooth function of h (with h = 1e-3, 1e-4 ... it is not)."""
    v0, a, path = 10.729, 0.2 * G, 1.27 - 2 * R
    t = (v0 - np.sqrt(v0 * v0 - 2 * a * path)) / a
    after = []
    for n in (114, 228, 456, 912, 1824):
        h = t / (n - 0.5)
        after.append(np.asarray(example("5.6_break", step=h, until=n * h).velocity)[n])
    change = [np.abs(fine - coarse).max() for coarse, fine in pairwise(after)]
    order = [float(np.log2(coarse / fine)) for coarse, fine in pairwise(change)]
    print(f"changes {change}, orders {order}")
    assert order[-1] == pytest.approx(1.0, abs=0.05)
    assert min(order) > 0.8


@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_a_ball_that_rolls_goes_on_rolling_until_its_next_hit(step: float) -> None:
    result = shot("5.6_break", step)
    speed, sliding = np.linalg.norm(np.asarray(result.velocity)[:, :, :2], axis=2), slip(result)
    body, number = np.asarray(result.impacts.body), np.asarray(result.impacts.step)
    frames, rolled = len(result.time), 0
    for ball in range(4):
        involved = (body == ball).any(axis=1) & (body[:, 1] != BED)
        hits = [0, *sorted(set(number[involved].tolist())), frames]
        for begin, end in pairwise(hits):
            rolling = np.flatnonzero(sliding[begin:end, ball] < 1e-9)
            if len(rolling) == 0 or speed[begin + rolling[0], ball] < 1e-9:
                continue
            stretch = slice(begin + rolling[0], end)
            rolled += 1
            assert sliding[stretch, ball].max() < 20 * EPS * 10.7
            assert np.ptp(speed[stretch, ball]) < 20 * EPS * 10.7
    assert rolled >= 6
    below(1e-13, f"h = {step}: slip at the end", sliding[-1])


@pytest.mark.parametrize(("tolerance", "bound"), [(1e-8, 1e-8), (1e-13, 40 * EPS)])
@pytest.mark.parametrize("case", CASES)
def test_what_is_lost_in_a_step_is_the_work_of_its_contacts(
    case: str, tolerance: float, bound: float
) -> None:
    """dE = work of the contacts by cause - g . (position impulses), as the free motion of a step is exact. The work is
    known as well as the impulses, to the tolerance of the solver."""
    result = shot(case, 1e-3, tolerance=tolerance)
    contacts = result.contacts
    causes = ("work_normal", "work_friction", "work_rolling", "work_spinning")
    done = np.array([np.asarray(contacts[cause]) for cause in causes])
    on_bed = np.asarray(contacts.body)[:, 1] >= BED  # between balls, position impulses cancel
    lift = np.asarray(contacts.position_impulse) @ result.gravity * on_bed
    frames = len(result.time)
    change = np.bincount(np.asarray(contacts.frame), weights=done.sum(0) - lift, minlength=frames)[1:]
    start = kinetic(result, 0) + 4 * M * G * R
    total = np.concatenate([[start], result.energy.total])
    below(bound * start, f"{case}, tolerance {tolerance}: energy by cause, per step", np.diff(total) - change)
    spent = dict(zip(causes, done.sum(1)))
    print(f"{case}: {spent}, of {start:.4f} J")
    assert all(work <= 0.0 for work in spent.values())
    assert (spent["work_rolling"] < 0.0) == (case == "5.6_break_rolling")
    assert spent["work_spinning"] == 0.0


@pytest.mark.parametrize("step", STEPS)
def test_with_rolling_resistance_all_balls_come_to_rest(step: float) -> None:
    result = shot("5.6_break_rolling", step)
    speed = np.linalg.norm(np.asarray(result.velocity), axis=2)
    w = np.asarray(result.angular_velocity)
    below(1e-15, f"h = {step}: speeds at the end", speed[-1])
    below(1e-15, f"h = {step}: rolling at the end", R * w[-1, :, :2])
    # Balls 4 and 5 go on spinning about the vertical: the bed has no spinning friction (delta = 0).
    assert R * abs(w[-1, LEFT, 2]) > 0.1
    below(1e-12, "spin at rest", np.ptp(w[-100:, :, 2], axis=0))
    moving = [int(np.flatnonzero(speed[:, ball] > 1e-12)[-1]) for ball in range(4)]
    rest = [float(result.time[last + 1]) for last in moving]
    print(f"h = {step}: at rest from {rest} s")
    assert max(rest) == pytest.approx(2.66, abs=0.02)
    # Those that roll freely are braked by rho g/(r (1 + kappa)) = 1.228 m/s^2 to their end.
    a = 0.005 * G / (R * (1 + KAPPA))
    assert a == pytest.approx(1.228, abs=1e-3)
    for ball in (LEFT, RIGHT):
        span = np.arange(moving[ball] - int(0.02 / step), moving[ball])
        below(1e-9, f"ball {ball + 2}: deceleration / 1.228 + 1", np.diff(speed[span, ball]) / step / a + 1)


# ---------------------------------------------------------------------------------------------- convergence of Newton


@pytest.mark.parametrize("step", STEPS)
def test_newton_converges_quadratically_at_the_hit(step: float) -> None:
    """Once the statuses are right, r_{k+1} <= C r_k^2 (fig. 26): the tail of both histories, down to rounding."""
    result = shot("5.6_break", step)
    for level, limit in (("position", 20.0), ("velocity", 20.0)):
        (history,) = result.residuals.history(first_hit(result), level)
        ratios = history[1:] / history[:-1] ** 2
        print(
            f"h = {step}, {level}: " + ", ".join(f"{r:.1e}" for r in history) + f"; C {ratios[-2:].round(2)}"
        )
        assert 3 <= len(history) <= 8
        # The last two iterations, unless only rounding was left for the last one.
        assert ratios[-2] <= limit
        assert history[-1] <= max(limit * history[-2] ** 2, 4 * EPS)
        assert history[-1] < 1e-8


def test_newton_stays_quadratic_down_to_rounding() -> None:
    result = shot("5.6_break", 1e-3, tolerance=1e-13, tolerance_floor=1e-17, until=0.116)
    for level, iterations in (("position", 3), ("velocity", 1)):
        (history,) = result.residuals.history(first_hit(result), level)
        print(f"{level}: " + ", ".join(f"{r:.1e}" for r in history))
        # Once the statuses are right the velocity level is piecewise linear but for the direction of slip.
        end = int(np.argmax(history < 1e-12))
        for k in range(end - iterations, end):
            assert history[k + 1] <= max(20.0 * history[k] ** 2, 1e-14)
        assert history[-1] < 1e-13


def test_the_closed_form_and_newton_agree_on_the_break() -> None:
    auto = example("5.6_break", until=0.6, tolerance=1e-12)
    newton = example("5.6_break", until=0.6, tolerance=1e-12, solver="newton")
    for name in ("position", "velocity", "angular_velocity", "orientation"):
        a, b = np.asarray(getattr(auto, name)), np.asarray(getattr(newton, name))
        below(1e-10 * max(1.0, np.abs(a).max()), f"newton and auto: {name}", a - b)


def test_options_of_the_time_integrator_do_not_matter_for_constant_loads() -> None:
    one, two = (example("5.6_break", until=0.3, tolerance=1e-12, spectral_radius=rho) for rho in (0.8, 0.2))
    below(1e-9, "rho_inf = 0.8 and 0.2: v", np.asarray(one.velocity) - np.asarray(two.velocity))


def test_two_runs_have_the_same_bits_and_recording_changes_none() -> None:
    runs = [example("5.6_break", until=0.5, **o) for o in ({}, {}, {"contacts": False}, {"threads": 2})]
    for other in runs[1:]:
        for name in ("position", "orientation", "velocity", "angular_velocity"):
            assert np.asarray(getattr(other, name)).tobytes() == np.asarray(getattr(runs[0], name)).tobytes()
        assert other.energy.total.tobytes() == runs[0].energy.total.tobytes()
    assert len(runs[2].contacts) == 0
