"""`carom.sensitivity`: derivatives through slides, rolls and impacts, beside closed forms."""

from __future__ import annotations

import math
from typing import Any

import carom
import numpy as np
import pytest
from carom import billiards

MU, G, R, V = 0.2, 9.8, 0.028575, 2.0
RAIL = 1.2


def shot(
    until: float, offset: float = 0.5, friction: float = MU, rail: float = 0.0, speed: float = V
) -> carom.Scene:
    """A ball that slides in x, towards another one whose centre lies so many radii beside its line."""
    scene = carom.Scene("a shot", gravity=(0, 0, -G), run={"method": "events", "until": until, "step": until})
    for name in ("ball", "bed", "rail"):
        scene.material(name)
    scene.contact("ball", "ball", friction=0.0, restitution=1.0)
    scene.contact("ball", "bed", friction=friction, restitution=0.5)
    scene.contact("ball", "rail", friction=0.0, restitution=0.8)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.sphere("cue", radius=R, mass=0.17, position=(0, 0, R), velocity=(speed, 0, 0), material="ball")
    if rail:
        scene.plane("end", point=(rail, 0, 0), normal=(-1, 0, 0), material="rail")
    else:
        scene.sphere("object", radius=R, mass=0.17, position=(0.5, offset * R, R), material="ball")
    return scene


def test_a_slide_and_the_roll_after_it() -> None:
    t = 0.1
    inputs = ["cue.velocity.x", "ball/bed.friction", "cue.angular_velocity.y"]
    early = carom.sensitivity(shot(t), inputs)
    np.testing.assert_allclose(early.of("cue")[:, 0], [t, -0.5 * G * t**2, 0.0], rtol=0, atol=1e-9)
    # It rolls from T = 2 (v - r w)/(7 mu g) on, with v_1 = v - 2 (v - r w)/7, at x = (v^2 - v_1^2)/(2 mu g) + v_1 (t - T).
    t = 0.7

    def place(v: float, mu: float, w: float) -> float:
        ends, rolls = 2.0 * (v - R * w) / (7.0 * mu * G), v - 2.0 / 7.0 * (v - R * w)
        return float((v**2 - rolls**2) / (2.0 * mu * G) + rolls * (t - ends))

    late = carom.sensitivity(shot(t, offset=9.0), inputs)
    exact = []
    for k, h in enumerate((1e-5, 1e-6, 1e-3)):
        up, down = [V, MU, 0.0], [V, MU, 0.0]
        up[k] += h
        down[k] -= h
        exact.append((place(*up) - place(*down)) / (2.0 * h))
    np.testing.assert_allclose(late.of("cue")[:, 0], exact, rtol=1e-7)
    assert late.error.max() < 1e-8


def test_a_rail_turns_the_velocity_round() -> None:
    """Without friction `x = rail - r - e (v t - (rail - r))`: the time of the impact depends on the speed, too."""
    scene = shot(1.0, friction=0.0, rail=RAIL)
    found = carom.sensitivity(scene, ["cue.velocity.x", "cue.position.x", "ball/rail.restitution"])
    exact = [-0.8 * 1.0, -0.8, -(V * 1.0 - (RAIL - R))]
    np.testing.assert_allclose(found.of("cue")[:, 0], exact, rtol=1e-9)


def test_a_cut_depends_on_the_aim_as_its_geometry_says() -> None:
    """The object ball goes along the line of centres, `sin phi = b/(2 r)`, with `v cos phi`: by `b`, the place across."""
    b = 0.5 * R
    scene = shot(0.4, friction=0.0)
    found = carom.sensitivity(scene, ["object.position.y"])
    angle = math.asin(b / (2.0 * R))
    per = 1.0 / (2.0 * R * math.cos(angle))  # d phi / d b
    # velocity v cos phi (cos phi, sin phi)
    exact = V * per * np.array([-math.sin(2.0 * angle), math.cos(2.0 * angle), 0.0])
    np.testing.assert_allclose(found.of("object", "velocity")[0], exact, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("after", [1e-3, 1e-7, 1e-9, -1e-8])
@pytest.mark.parametrize("bounce", [1, 2, 3])
def test_the_error_is_told_where_rounding_limits_it(after: float, bounce: int) -> None:
    """A ball dropped by z is at `u s - g s^2/2` after its k-th hit, `s = t - c sqrt(z)`, `u = e^k sqrt(2 g z)`. Just
    before or after a hit only the smallest steps have the same events.
    """
    z, e = 0.5, 0.7
    hits = [math.sqrt(2.0 / G) * (1.0 + 2.0 * sum(e**i for i in range(1, k))) for k in (bounce, bounce + 1)]
    last = 0 if after > 0 else 1
    until = hits[last] * math.sqrt(z) + after
    scene = carom.Scene("a drop", gravity=(0, 0, -G), run={"method": "events", "until": until, "step": until})
    scene.contact("ball", "bed", friction=0.2, restitution=e)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.sphere(
        "ball", radius=0.02, mass=0.1, position=(0, 0, 0.02 + z), velocity=(0.3, 0, 0), material="ball"
    )
    found = carom.sensitivity(scene, ["ball.position.z"])
    u, s, ds = (
        e**bounce * math.sqrt(2.0 * G * z),
        until - hits[0] * math.sqrt(z),
        -0.5 * hits[0] / math.sqrt(z),
    )
    speed = 0.5 * u / z - G * ds
    place = 0.5 * u / z * s + u * ds - G * s * ds
    off = max(abs(found.velocity[0, 0, 2] / speed - 1.0), abs(found.position[0, 0, 2] / place - 1.0))
    assert off <= found.error[0] < 1e-5


def test_the_error_covers_what_steps_still_differ_by() -> None:
    """After a full hit the slide of the object ball turns by a power of the offset, of a tenth or so more than one: a
    difference is off by a quarter less each decade, and a step and its half differ little.
    """
    radius = 0.028575
    scene = carom.Scene("full", gravity=(0, 0, -G), run={"method": "events", "until": 0.5, "step": 1e-3})
    scene.contact("i", "i", friction=0.06, restitution=0.95)
    scene.contact("i", "c", friction=0.2, restitution=0.5, rolling_radius=3e-4)
    scene.plane("t", point=(0, 0, 0), normal=(0, 0, 1), material="c")
    scene.sphere(
        "cue", radius=radius, mass=0.17, position=(-0.3, 0, radius), velocity=(2, 0, 0), material="i"
    )
    scene.sphere("o", radius=radius, mass=0.17, position=(0, 0, radius), material="i")
    found = carom.sensitivity(scene, ["o.position.y"])
    steps = (1e-7, 1e-8, 1e-9)
    batch = carom.simulate_batch(scene, {"o.position.y": steps})
    ways = batch.position[:, 1, 1] / steps
    limit = ways[2] + (ways[2] - ways[1]) ** 2 / (2.0 * ways[1] - ways[0] - ways[2])
    off = abs(found.of("o")[0, 1] - limit) / abs(limit)
    assert 1e-4 < off <= found.error[0] < 1e-2


def test_differences_without_a_limit_are_no_derivative() -> None:
    """Rolling resistance turns a small spin across the way by a power of it, here of a hundredth or so more than one. Its
    derivative is 0, and no difference comes near it. A number was given, as large as its error.
    """

    def slide(rolling: float) -> carom.Scene:
        scene = carom.Scene("slide", gravity=(0, 0, -G), run={"method": "events", "until": 0.4, "step": 1e-3})
        scene.contact("b", "c", friction=0.2, restitution=0.5, rolling_radius=rolling)
        scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="c")
        scene.sphere("a", radius=0.0286, mass=0.17, at=(0, 0, 0.0286), velocity=(2, 0, 0), material="b")
        return scene

    steps = np.array([1e-3, 1e-4, 1e-5, 1e-6])
    y = carom.simulate_batch(slide(1e-4), {"a.angular_velocity.x": steps}).position[:, 0, 1] / steps
    fall = y[1:] / y[:-1]
    assert np.ptp(fall) < 1e-3
    assert 0.9 < fall[0] < 0.99
    with pytest.raises(carom.CaromError, match=r"no derivative by .* = 0; its differences go on changing"):
        carom.sensitivity(slide(1e-4), ["a.angular_velocity.x"])
    assert carom.sensitivity(slide(0.0), ["a.angular_velocity.x"]).error[0] < 1e-8


def test_a_function_of_a_shot() -> None:
    def draw(height: float) -> carom.Scene:
        scene = shot(0.6, speed=0.0)
        billiards.strike(scene.spheres[0], ball_speed=2.0, direction="0 deg", height=height)
        return scene

    found = carom.sensitivity(draw, {"height": -0.3})
    h = 1e-5
    ends = [carom.simulate(draw(-0.3 + x)).position[-1] for x in (h, -h)]
    np.testing.assert_allclose(found.position[0], (ends[0] - ends[1]) / (2.0 * h), rtol=1e-5, atol=1e-6)


def test_a_break_through_tens_of_impacts() -> None:
    table = billiards.table("9ft")

    def opening(direction: float) -> carom.Scene:
        scene = table.scene("a break", until=0.5, step=0.5)
        table.rack(scene, order="9-ball", gap=1e-4, jitter=2e-5, seed=1)
        billiards.strike(table.cue_ball(scene, at="head spot"), speed=8.9, direction=direction, height=0.1)
        return scene

    found = carom.sensitivity(opening, {"direction": 0.01})
    assert found.error.max() < 1e-6
    assert np.abs(found.position).max() > 50.0  # m/rad
    h = 3e-7
    up, down = (carom.simulate(opening(0.01 + x), method="events").position[-1] for x in (h, -h))
    exact = (up - down) / (2.0 * h)
    np.testing.assert_allclose(found.position[0], exact, rtol=0, atol=1e-4 * np.abs(exact).max())


@pytest.mark.parametrize("gap", [0.0, 1e-12])
def test_what_parts_bodies_that_touch_has_no_derivative(gap: float) -> None:
    """Steps within the gap that counts as closed change nothing: the difference is exactly 0, and 0.2 with larger ones."""
    scene = shot(0.1)
    scene.spheres[0].position = (0.0, 0.0, R + gap)
    for name in ("cue.position.z", "cue.radius"):
        with pytest.raises(carom.CaromError, match=f'by "{name}": cue and bed touch at the start'):
            carom.sensitivity(scene, [name])
    along = carom.sensitivity(scene, ["cue.position.x", "cue.velocity.z", "cue.mass"])
    np.testing.assert_allclose(along.of("cue")[[0, 2], 0], [1.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("friction", "speed"), [(0.1, 1.0), (0.2, 2.0), (0.3, 3.0)])
def test_the_error_covers_what_frames_would_round(friction: float, speed: float) -> None:
    """A ball that rolls at last has 5/7 of its speed, whatever the friction: all that is found is rounding."""
    scene = carom.Scene("roll", gravity=(0, 0, -G), run={"method": "events", "until": 0.7, "step": 1e-3})
    scene.contact("b", "c", friction=friction, restitution=0)
    scene.plane("p", point=(0, 0, 0), normal=(0, 0, 1), material="c")
    scene.sphere("a", radius=R, mass=0.17, at=(0, 0, R), velocity=(speed, 0, 0), material="b")
    found = carom.sensitivity(scene, ["a.velocity.x", "b/c.friction"])
    for k, got, exact, size in (
        (0, found.position[0, 0, 0], 3.5 / 7 + 4 * speed / (49 * friction * G), 0.7),
        (1, found.position[1, 0, 0], -2 * speed**2 / (49 * friction**2 * G), 3.5 / 7 * speed / friction),
        (1, found.velocity[1, 0, 0], 0.0, 5 / 7 * speed / friction),
        (1, found.angular_velocity[1, 0, 1], 0.0, 5 / 7 * speed / R / friction),
    ):
        assert abs(got - exact) <= found.error[k] * size < 1e-8 * size


@pytest.mark.parametrize("t", [0.1, 0.7])
def test_a_ball_on_its_bed_that_is_thrown_up_or_down(t: float) -> None:
    """The bed gives m (g t - v_z) either way: the speed of the slide grows by mu v_z, and it rolls v_z/g later."""
    found = carom.sensitivity(shot(t, offset=9.0), ["cue.velocity.z"])
    rolls = 2.0 * V / (7.0 * MU * G)
    exact = MU * t if t < rolls else 2.0 / 7.0 * V / G
    assert found.of("cue")[0, 0] == pytest.approx(exact, rel=1e-5)


def test_a_gap_that_is_one_has_a_derivative() -> None:
    """A ball that slides has `x = v t - mu (g t^2/2 - gap)`: friction has the impulse of the bed, and that of its fall."""
    scene = shot(0.1)
    scene.spheres[0].position = (0.0, 0.0, R + 1e-6)
    found = carom.sensitivity(scene, ["cue.position.z"])
    assert found.of("cue")[0, 0] == pytest.approx(MU, rel=1e-6)


def test_balls_that_touch_may_move_along_their_contact_or_together() -> None:
    def pair(along: float, radius: float) -> carom.Scene:
        table = billiards.table("9ft")
        scene = table.scene("a pair", until=0.1)
        first = table.ball(scene, "1", at=(0.5 + along, 0.5), radius=radius)
        first.velocity = (1.0, 0.0, 0.0)
        table.ball(scene, "2", at=(0.5 + along + 2.0 * R, 0.7))
        table.ball(scene, "3", at=(0.5 + along + 4.0 * R, 0.7))
        return scene

    found = carom.sensitivity(pair, {"along": 0.1, "radius": R})
    # All balls go along with the first input. The second lifts the ball with its radius, which slides as before.
    np.testing.assert_allclose(found.position[0], [[1, 0, 0]] * 3, atol=1e-8)
    np.testing.assert_allclose(found.of("1")[1], [0, 0, 1], atol=1e-8)
    scene = pair(0.1, R)
    for name in ("2.position.x", "3.position.x"):
        with pytest.raises(carom.CaromError, match="2 and 3 touch at the start"):
            carom.sensitivity(scene, [name])
    carom.sensitivity(scene, ["2.position.y"])


def test_a_law_of_friction_is_no_single_number() -> None:
    table = billiards.table("9ft")
    scene = table.scene("a shot", until=0.1)
    table.cue_ball(scene).velocity = (1.0, 0.0, 0.0)
    with pytest.raises(
        carom.CaromError, match=r'"ball/ball\.friction" is a law of the slip speed, which has'
    ):
        carom.sensitivity(scene, ["ball/ball.friction"])
    assert carom.sensitivity(scene, ["ball/cloth.friction"]).of("cue")[0, 0] == pytest.approx(
        -0.049, rel=1e-6
    )
    with pytest.raises(
        carom.CaromError, match=r'"gravity" is not one number; name its component, as gravity.x'
    ):
        carom.sensitivity(scene, ["gravity"])
    with pytest.raises(carom.CaromError, match=r'^sensitivity: "cue.mass.z": "mass" has no z$'):
        carom.sensitivity(scene, ["cue.mass.z"])


def test_gravity_has_components() -> None:
    """A ball dropped by z is at `u s - g s^2/2` after its hit, `s = t - sqrt(2 z/g)`, `u = e sqrt(2 g z)`."""
    z, e, until = 0.5, 0.7, 0.5
    scene = carom.Scene("a drop", gravity=(0, 0, -G), run={"method": "events", "until": until, "step": until})
    scene.contact("ball", "bed", friction=0.2, restitution=e)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.sphere("ball", radius=0.02, mass=0.1, position=(0, 0, 0.02 + z), material="ball")
    found = carom.sensitivity(scene, ["gravity.z"])
    fall, u = math.sqrt(2.0 * z / G), e * math.sqrt(2.0 * G * z)
    s, du, ds = until - fall, 0.5 * u / G, 0.5 * fall / G
    place, speed = du * s + u * ds - 0.5 * s * s - G * s * ds, du - s - G * ds
    assert found.position[0, 0, 2] == pytest.approx(-place, rel=1e-7)
    assert found.velocity[0, 0, 2] == pytest.approx(-speed, rel=1e-7)
    both = {"gravity": [[0.0, 0.0, -G]], "gravity.z": [-G]}
    with pytest.raises(carom.CaromError, match=r'"gravity.z" and "gravity" both give the same numbers'):
        carom.simulate_batch(scene, both)
    wide = carom.simulate_batch(scene, {"gravity": [[0.0, 0.0, -2 * G]]})
    np.testing.assert_array_equal(
        carom.simulate_batch(scene, {"gravity.z": [-2 * G]}).position, wide.position
    )


def test_where_there_is_no_derivative_it_says_so() -> None:
    with pytest.raises(carom.CaromError, match=r"no derivative by .*other events follow"):
        carom.sensitivity(shot(0.6, offset=2.0 - 1e-9, friction=0.0), ["cue.position.y"])
    with pytest.raises(carom.CaromError, match="to names no input"):
        carom.sensitivity(shot(0.6), [])
    with pytest.raises(carom.CaromError, match="not one number"):
        carom.sensitivity(shot(0.6), ["cue.velocity"])
    for twice in (["cue.velocity.x"] * 2, ["ball/bed.friction", "bed/ball.friction"]):
        with pytest.raises(carom.CaromError, match="both name the same number"):
            carom.sensitivity(shot(0.6), twice)
    with pytest.raises(carom.CaromError, match=r'friction" = 0; its value lies at the border of its range: '):
        carom.sensitivity(shot(0.3, friction=0.0), ["ball/bed.friction"])  # none is below 0
    with pytest.raises(carom.CaromError, match="arguments of the function"):
        carom.sensitivity(shot, ["until"])
    with pytest.raises(
        carom.CaromError, match="method must be events, whose motions are exact, found 'moreau'"
    ):
        carom.sensitivity(shot(0.6), ["cue.velocity.x"], method="moreau")


@pytest.mark.parametrize("step", [0.05, 3.0])
def test_until_is_kept_to(step: float) -> None:
    """The slide lasts until 0.29 s: x = v t - mu g t^2/2, whatever steps the scene has."""
    for build in (shot(0.5), lambda speed: shot(0.5, speed=speed)):
        to = {"speed": V} if callable(build) else ["cue.velocity.x"]
        found = carom.sensitivity(build, to, until=0.123, step=step)
        assert found.of("cue")[0, 0] == pytest.approx(0.123, abs=1e-9)
    with pytest.raises(carom.CaromError, match=r"^sensitivity: until: must be positive"):
        carom.sensitivity(shot(0.5), ["cue.velocity.x"], until=0)


def test_another_method_of_the_scene_is_told_once() -> None:
    scene = shot(0.1)
    scene.run.method = "nsga"
    with pytest.warns(carom.CaromWarning) as told:
        found = carom.sensitivity(scene, ["cue.velocity.x"])
    assert [str(w.message) for w in told if "method" in str(w.message)] == [
        "sensitivity: the scene has method nsga; derivatives are by events, which is exact"
    ]
    assert found.of("cue")[0, 0] == pytest.approx(0.1, abs=1e-9)


def test_balls_that_left_are_named() -> None:
    scene = shot(0.6)
    scene.outlet(low=(0.2, -1, -1), high=(0.4, 1, 1))
    found = carom.sensitivity(scene, ["cue.velocity.x"])
    assert found.gone == ["cue"]
    for quantity in ("position", "velocity", "angular_velocity"):  # those of its velocities were 0
        assert np.isnan(found.of("cue", quantity)).all()
        assert np.isfinite(found.of("object", quantity)).all()
    assert repr(found).endswith("NaN of cue, which left>")
    assert carom.sensitivity(shot(0.1), ["cue.velocity.x"]).gone == []


def test_what_presses_what_is_named() -> None:
    """Of one ball on a slope it was told that "balls press one another"."""
    scene = shot(0.1, offset=9.0)
    scene.world.gravity = (1.0, 0.0, -G)
    with pytest.raises(
        carom.CaromError, match=r'from t = 0 s on "cue" and "bed" press one another, as on a slope'
    ):
        carom.sensitivity(scene, ["cue.velocity.x"])


@pytest.mark.parametrize(
    ("build", "to", "told"),
    [
        (
            lambda speed: shot(0.1, speed=speed),
            {"speed": "1 m/s"},
            'speed must be a number in SI, found "1 m/s"',
        ),
        (
            lambda speed: shot(0.1, speed=speed),
            {"speed": None},
            "speed must be a number in SI, found nothing",
        ),
        (lambda speed: speed, {"speed": 1.0}, "the function must return a scene, found float"),
        (
            lambda speed: speed,
            {"w": 1.0},
            "cannot be called with w alone: missing a required argument: 'speed'",
        ),
        (
            lambda speed=1.0: speed,
            {"w": 1.0},
            "cannot be called with w alone: got an unexpected .* argument 'w'",
        ),
    ],
)
def test_functions_and_their_arguments_are_checked(build: Any, to: dict[str, Any], told: str) -> None:
    with pytest.raises(carom.CaromError, match=told):
        carom.sensitivity(build, to)
