"""One ball on a plane against closed forms: the scheme integrates constant loads exactly, so only rounding is left.

Bounds are a few times what rounding can do. A sum of n terms of size x carries at most n EPS/2 x; divided by the
result this is the relative bound, and a measured value is usually some ten times smaller.
"""

from __future__ import annotations

import carom
import numpy as np
import pytest
from physics_scenes import EPS, G, M, R, ball_on_plane, below, example, kinetic, run

H = 1e-3
WORK = ("work_normal", "work_friction", "work_rolling", "work_spinning")


def work(result: carom.Result) -> list[float]:
    """Work of all contacts over the run by cause: normal, friction, rolling, spinning, J."""
    return [float(np.sum(np.asarray(result.contacts[cause]))) for cause in WORK]


@pytest.mark.parametrize("h", [1e-3, 1e-4])
def test_a_ball_at_rest_carries_its_weight_at_both_levels_in_each_step(h: float) -> None:
    result = run(ball_on_plane(step=h, restitution=0.7, rolling_radius=1e-3, spinning_radius=1e-3), steps=100)
    contacts = result.contacts
    assert len(contacts) == 100  # one row per step
    assert np.array_equal(contacts.frame, np.arange(1, 101))
    # The velocity impulse is m (g h): two roundings. The gap is a difference of numbers of size r, so the position
    # impulse m g h^2/2 knows its gap to EPS r at best.
    below(2 * EPS, "velocity impulse / (m g h) - 1", np.asarray(contacts.impulse)[:, 2] / (M * G * h) - 1)
    below(
        2 * EPS * R / (G * h * h / 2),
        "position impulse / (m g h^2/2) - 1",
        np.asarray(contacts.position_impulse)[:, 2] / (M * G * h * h / 2) - 1,
    )
    for sideways in (contacts.impulse, contacts.position_impulse):
        assert not np.asarray(sideways)[:, :2].any()
    assert not np.asarray(contacts.moment).any()
    # It neither sinks nor drifts, by not a single bit.
    assert not np.asarray(result.velocity).any()
    assert not np.asarray(result.angular_velocity).any()
    assert np.array_equal(result["ball"].position, np.tile([0, 0, R], (101, 1)))
    assert len(result.impacts) == 0


def test_a_sliding_ball_follows_the_parabola_in_each_step() -> None:
    mu, v0 = 0.2, np.array([1.6, 1.2, 0.0])
    ball = run(ball_on_plane(velocity=v0, friction=mu), steps=280)["ball"]
    t, forward = np.asarray(ball.time)[:, None], v0 / 2.0
    # 280 sums of numbers up to 2.
    below(280 * EPS * 2.0, "sliding ball, v", ball.velocity - (v0 - mu * G * t * forward))
    below(
        280 * EPS * 0.5, "sliding ball, x", ball.position - (v0 * t - mu * G * t**2 / 2 * forward + [0, 0, R])
    )
    turning = mu * G * t / (0.4 * R) * np.cross([0, 0, 1], forward)
    below(280 * EPS * 192.0, "sliding ball, w", ball.angular_velocity - turning)


@pytest.mark.parametrize("kappa", [0.1, 0.4, 2 / 3, 1.0])
def test_a_sliding_ball_rolls_from_its_time_on_with_its_speed(kappa: float) -> None:
    v0, mu = 2.0, 0.2
    result = run(ball_on_plane(velocity=(v0, 0, 0), kappa=kappa, friction=mu), steps=800)
    ball = result["ball"]
    slip = ball.velocity[:, 0] - R * ball.angular_velocity[:, 1]
    start = v0 / (mu * G * (1 + 1 / kappa))
    first = int(np.ceil(start / H))  # the step in which slip ends is cut by friction that stops it exactly
    end = v0 / (1 + kappa)
    below(800 * EPS * 2, "rolling: slip", slip[first:])
    assert slip[first - 1] > 0.1 * mu * G * H
    # The angular momentum about the line of contact points does not change: 5/7 v0 for kappa = 0.4.
    below(800 * EPS, f"speed / (v0/(1 + {kappa:.2f})) - 1", ball.velocity[first:, 0] / end - 1)
    assert np.ptp(ball.velocity[first:, 0]) == 0.0
    # Friction takes kappa/(1 + kappa) of the energy; what gravity gains in a step the normal force takes.
    normal, friction, rolling, spinning = work(result)
    below(800 * EPS, "work of friction", friction / (0.5 * M * v0**2 * kappa / (1 + kappa)) + 1)
    below(100 * EPS, "work of the normal force", normal / (800 * 0.5 * M * (G * H) ** 2) + 1)
    assert rolling == spinning == 0.0


def test_the_scenario_file_rolls_when_its_comment_says_so() -> None:
    result = example("slide_to_roll")
    ball = result["cue"]
    t = 2 * 2.0 / (7 * 0.2 * G)
    slip = np.abs(ball.velocity[:, 0] - R * ball.angular_velocity[:, 1])
    assert float(np.asarray(result.time)[np.argmax(slip < 1e-13)]) == pytest.approx(t, abs=H)
    below(600 * EPS, "speed / (5/7 v0) - 1", ball.velocity[-1, 0] / (2.0 * 5 / 7) - 1)


@pytest.mark.parametrize("direction", [0.0, 1.0])
def test_a_rolling_ball_keeps_its_speed(direction: float) -> None:
    v = np.array([np.cos(direction), np.sin(direction), 0.0])
    ball = run(ball_on_plane(velocity=v, spin=np.cross([0, 0, 1], v) / R), steps=500)["ball"]
    t = np.asarray(ball.time)[:, None]
    below(500 * EPS, "rolling ball, v", ball.velocity - v)
    below(500 * EPS * 0.5, "rolling ball, x", ball.position - (v * t + [0, 0, R]))
    below(500 * EPS / R, "rolling ball, w", ball.angular_velocity - np.cross([0, 0, 1], v) / R)


@pytest.mark.parametrize("kappa", [0.4, 2 / 3])
@pytest.mark.parametrize("rho_over_r", [0.02, 0.1])
def test_rolling_resistance_on_the_flat(rho_over_r: float, kappa: float) -> None:
    v0 = 0.3
    a = rho_over_r * G / (1 + kappa)
    scene = ball_on_plane(
        velocity=(v0, 0, 0), spin=(0, v0 / R, 0), kappa=kappa, friction=0.5, rolling_radius=rho_over_r * R
    )
    stop = int(np.ceil(v0 / a / H))
    result = run(scene, steps=stop + 50)
    ball, t = result["ball"], np.asarray(result.time)
    below(stop * EPS, "braked ball, v", ball.velocity[:stop, 0] - (v0 - a * t[:stop]))
    below(stop * EPS, "braked ball, x", ball.position[:stop, 0] - (v0 * t - a * t * t / 2)[:stop])
    # The step of the stop ends at rest to rounding; then it stays where it is.
    below(2 * EPS, "stopped ball, v", ball.velocity[stop:])
    below(2 * EPS, "stopped ball, drift", ball.position[stop:] - ball.position[stop])
    # Rolling resistance has taken all there was, friction (which rolls without slip) nothing.
    normal, friction, rolling, spinning = work(result)
    below(10 * stop * EPS, "work of rolling resistance", rolling / kinetic(result, 0) + 1)
    below(10 * stop * EPS, "work of friction while rolling", friction / kinetic(result, 0))
    below((stop + 50) * EPS, "work of the normal force", normal / ((stop + 50) * 0.5 * M * (G * H) ** 2) + 1)
    assert spinning == 0.0


@pytest.mark.parametrize("tangent", [0.02, 0.05, 0.11, 0.1199])
def test_rolling_resistance_holds_a_ball_on_an_incline(tangent: float) -> None:
    scene = ball_on_plane(slope=np.arctan(tangent), friction=0.5, rolling_radius=0.12 * R)
    result = run(scene, steps=300)
    # g h sin(slope) must vanish from sums of two terms of that size.
    below(8 * EPS * G * H * tangent, "held ball, v", result.velocity)
    below(300 * 8 * EPS * G * H * tangent * H, "held ball, drift", result["ball"].position - [0, 0, R])


@pytest.mark.parametrize("kappa", [0.4, 1.0])
@pytest.mark.parametrize("tangent", [0.1201, 0.2, 0.5])
def test_a_ball_rolls_down_an_incline(tangent: float, kappa: float) -> None:
    slope = np.arctan(tangent)
    scene = ball_on_plane(slope=slope, kappa=kappa, friction=0.5, rolling_radius=0.12 * R)
    ball = run(scene, steps=300)["ball"]
    t, a = np.asarray(ball.time)[1:], G * (np.sin(slope) - 0.12 * np.cos(slope)) / (1 + kappa)
    # Just above the limit a is a small difference of large numbers, known to EPS g/a.
    bound = max(1e-13, 4 * EPS * G * 0.12 / a)
    below(bound, f"incline {tangent}: v/(a t) - 1", ball.velocity[1:, 0] / (a * t) - 1)
    below(bound, f"incline {tangent}: x/(a t^2/2) - 1", ball.position[-1, 0] / (a * t[-1] ** 2 / 2) - 1)
    below(1e-12, "incline: slip / speed", ball.velocity[1:, 0] / (R * ball.angular_velocity[1:, 1]) - 1)


def test_a_ball_slides_down_an_incline_that_is_too_steep_to_roll() -> None:
    mu, rho, slope = 0.1, 0.02 * R, np.arctan(0.6)
    ball = run(ball_on_plane(slope=slope, friction=mu, rolling_radius=rho), steps=300)["ball"]
    t = np.asarray(ball.time)[1:]
    n = G * np.cos(slope)
    below(
        300 * EPS, "sliding down: v/(a t) - 1", ball.velocity[1:, 0] / ((G * np.sin(slope) - mu * n) * t) - 1
    )
    spin_up = (mu - rho / R) * n / (0.4 * R)
    below(300 * EPS, "sliding down: w/(alpha t) - 1", ball.angular_velocity[1:, 1] / (spin_up * t) - 1)


def test_the_incline_of_the_scenario_file() -> None:
    result = example("incline")
    slope, t = np.arctan(0.1), 1.0
    below(8 * EPS * G * H * 0.1, "incline.toml: the ball that stays, v", result["stays"].velocity)
    a = G * (np.sin(slope) - 0.05 * np.cos(slope)) / 1.4
    below(1e-13, "incline.toml: v/(a t) - 1", result["rolls"].velocity[-1, 0] / (a * t) - 1)


def test_spin_about_the_normal_decays_linearly_and_ends() -> None:
    delta, w0 = 4e-4, 20.0
    decay = delta * G / (0.4 * R * R)  # delta m g / I
    stop = int(np.ceil(w0 / decay / H))
    result = run(ball_on_plane(spin=(0, 0, w0), spinning_radius=delta), steps=stop + 20)
    ball, t = result["ball"], np.asarray(result.time)
    below(
        stop * EPS * w0,
        "spin - (w0 - t delta m g/I)",
        ball.angular_velocity[:stop, 2] - (w0 - decay * t[:stop]),
    )
    below(4 * EPS * decay * H, "spin after the end", ball.angular_velocity[stop:])
    assert not ball.velocity.any()
    _, friction, rolling, spinning = work(result)
    below(10 * stop * EPS, "work of spinning friction", spinning / kinetic(result, 0) + 1)
    assert friction == rolling == 0.0
    # psi is the integral of w: the ball has turned by w0 t - decay t^2/2 about z.
    half = 0.5 * (w0 * t[stop - 1] - decay * t[stop - 1] ** 2 / 2)
    expected = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
    q = ball.orientation[stop - 1]
    below(stop * EPS * half, "orientation", q * np.sign(q @ expected) - expected)


def test_slide_spin_and_roll_together_lose_what_their_contacts_record() -> None:
    """With constant gravity the flight of a step is exact, so all loss is the work of contacts, less what the position
    level lifts: dE = sum of work - g . (position impulses)."""
    law = {"friction": 0.2, "rolling_radius": 1e-3, "spinning_radius": 5e-4}
    result = run(ball_on_plane(velocity=(1, -0.5, 0.3), spin=(10, 30, 40), restitution=0.8, **law), steps=600)
    contacts, frames = result.contacts, len(result.time)
    done = (
        sum(np.asarray(contacts[cause]) for cause in WORK)
        - np.asarray(contacts.position_impulse) @ result.gravity
    )
    lost = np.bincount(np.asarray(contacts.frame), weights=done, minlength=frames)[1:]
    energy = np.concatenate([[kinetic(result, 0) + M * G * R], result.energy.total])
    below(8 * EPS * energy[0], "energy by cause, per step", np.diff(energy) - lost)
    for cause in WORK:
        assert np.max(np.asarray(contacts[cause])) <= EPS * energy[0], cause
    assert np.max(np.diff(energy)) <= 1e-12 * energy[0]


def test_free_flight_is_the_parabola_whatever_the_spectral_radius() -> None:
    v, w = np.array([1.0, 0.5, 3.0]), np.array([7.0, -3.0, 5.0])
    scene = ball_on_plane(velocity=v, spin=w)
    for radius in (0.0, 0.8, 0.99):
        result = run(scene, steps=500, spectral_radius=radius)
        ball, t = result["ball"], np.asarray(result.time)[:, None]
        gravity = np.array([0, 0, -G])
        # a_n takes part in every step: its weights are of size 1/(1 - rho_inf).
        below(500 * EPS * 4, f"flight, rho_inf = {radius}: v", ball.velocity - (v + gravity * t))
        below(
            500 * EPS * 4,
            f"flight, rho_inf = {radius}: x",
            ball.position - (v * t + gravity * t**2 / 2 + [0, 0, R]),
        )
        assert np.array_equal(ball.angular_velocity, np.tile(w, (501, 1)))


@pytest.mark.parametrize("e", [1.0, 0.7, 0.3, 0.0])
def test_a_dropped_ball_rebounds_with_its_restitution(e: float) -> None:
    scene = ball_on_plane(velocity=(0.0, 0.0, -2.0), restitution=e)
    scene.spheres[0].position = (0.0, 0.0, R + 0.01)
    result = run(scene, steps=8)
    impact = result.impacts
    assert len(impact) == 1
    # The law asks for v_{n+1} = -e v_n: the approach of the step's start, without this step's gravity.
    before = -2.0 - G * H * (int(impact.step[0]) - 1)
    after = result["ball"].velocity[int(impact.step[0]), 2]
    below(8 * EPS, "rebound + e v_n", after + e * before)
    below(8 * EPS, "recorded approach", float(impact.approach[0]) - (before - G * H))
    below(8 * EPS, "recorded separation", float(impact.separation[0]) - after)
