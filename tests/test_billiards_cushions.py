"""The rails of a table beside cushion models of the literature (`billiards.cushions`)."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import carom
import numpy as np
import pytest
from carom import billiards
from carom.billiards.cushions import han_2005, mathavan_2010

TABLE = billiards.table("carom")
R, NOSE = TABLE.spec.ball_radius, TABLE.spec.nose_height
E, MU, MU_BED = (
    getattr(billiards.LAWS, key) for key in ("cushion_restitution", "cushion_friction", "cloth_friction")
)
LAWS = replace(billiards.LAWS, rolling_deceleration=0.0)  # models know none
RISE = 0.004
"""Height of a ball above the bed, m, that the nose still presses down."""


def by_the_rail(velocity: np.ndarray, spin: np.ndarray, above: float = 0.0) -> list[np.ndarray]:
    """Velocity and angular velocity after the foot cushion, `above` the bed."""
    gravity = 0.0 if above else 9.8
    scene = TABLE.scene("a cushion", laws=LAWS, until=1e-8, step=1e-8, method="events", gravity=gravity)
    reach = np.sqrt(R**2 - (NOSE - above - R) ** 2)
    place = (TABLE.spec.length - reach - 1e-10, 0.5 * TABLE.spec.width, R + above)
    TABLE.ball(scene, "cue", place, velocity=tuple(velocity), angular_velocity=tuple(spin))
    result = carom.simulate(scene)
    assert len(result.impacts)
    return [np.asarray(x)[-1, 0] for x in (result.velocity, result.angular_velocity)]


@pytest.mark.parametrize("seed", range(12))
def test_a_nose_alone_is_han_2005(seed: int) -> None:
    """In the air the rail is his closed form, but for the rise that his bed takes; some of these slip, some stick."""
    rng = np.random.default_rng(seed)
    velocity = np.array([rng.uniform(0.5, 3), rng.uniform(-2, 2) * (seed % 3 > 0), 0.0])
    spin = rng.uniform(-40, 40, 3) if seed % 2 else np.cross([0, 0, 1], velocity) / R
    if seed % 3 == 0:  # hardly any slip
        spin = np.array([0.0, -velocity[0] * (NOSE - RISE - R) / R**2 * 1.01, 0.0])
    v, w = by_the_rail(velocity, spin, RISE)
    expected = han_2005(velocity, spin, radius=R, nose_height=NOSE - RISE, restitution=E, friction=MU)
    assert v[:2] == pytest.approx(expected[0][:2], abs=1e-10)
    assert w == pytest.approx(expected[1], abs=1e-8)
    assert expected[0][2] == 0


def test_much_topspin_has_one_closed_form() -> None:
    """No slip turns then: both contacts rub to the end, and e of the speed comes back in rails and in Mathavan's model."""
    velocity, spin = np.array([2.0, 0.0, 0.0]), np.array([0.0, 4.0 / R, 0.0])
    rise = NOSE / R - 1
    flat = np.sqrt(1 - rise**2)
    bed = rise - MU * flat  # impulse of the bed over that along the normal of the nose
    impulse = (1 + E) * velocity[0] / (flat + MU * rise - MU_BED * bed)
    turning = spin[1] - 2.5 * (MU + MU_BED * bed) * impulse / R
    v, w = by_the_rail(velocity, spin)
    assert (v[0], w[1]) == pytest.approx((-E * velocity[0], turning), abs=1e-5)  # the bed rubs on for 1e-8 s
    errors = []
    for steps in (1000, 4000, 16000):
        given = {"radius": R, "nose_height": NOSE, "restitution": E, "friction": MU, "bed_friction": MU_BED}
        v, w = mathavan_2010(velocity, spin, **given, steps=steps)
        errors.append(max(abs(v[0] / (E * velocity[0]) + 1), abs(w[1] / turning - 1)))
    assert errors[0] < 2e-3
    assert errors[2] < errors[0] / 8  # of first order


def test_without_friction_the_bed_gives_back_what_the_nose_presses_down() -> None:
    """The whole speed comes back by e with the bed; Han's nose alone sends the ball up, and less of it back."""
    given = {"radius": R, "nose_height": NOSE, "restitution": E, "friction": 0.0}
    velocity, spin = (
        np.array([[2.0, 0.7, 0.0], [1.0, 0.0, 0.0]]),
        np.array([[3.0, 9.0, -20.0], [0.0, 0.0, 0.0]]),
    )
    v, w = mathavan_2010(velocity, spin, **given, bed_friction=0.0)
    assert v == pytest.approx(velocity * [-E, 1, 1], rel=1e-3)
    assert w == pytest.approx(spin)
    alone, _ = han_2005(velocity, spin, **given)
    cosine = 1 - (NOSE / R - 1) ** 2
    assert alone[:, 0] == pytest.approx((1 - (1 + E) * cosine) * velocity[:, 0], rel=1e-12)


@pytest.mark.parametrize("height", [0.6 * R, 1.27 * R, 1.6 * R])
def test_han_2005_tells_of_balls_that_go_on_into_the_cushion(height: float) -> None:
    """Without friction 1 - (1 + e) cos^2 theta of v_x is left: it turns round from e = tan^2 theta on."""
    sine = height / R - 1
    border = sine**2 / (1 - sine**2)
    given = {"radius": R, "nose_height": height, "friction": 0.0}
    for e in (0.0, 0.9 * border):
        with pytest.warns(
            carom.CaromWarning, match=rf"^han_2005: 1 of 2 balls .* = {border:.3g} \(here {e:g}\)"
        ):
            v, _ = han_2005([[2.0, 0.5, 0.0], [-2.0, 0.5, 0.0]], np.zeros(3), **given, restitution=e)
        assert v[0, 0] == pytest.approx(2.0 * (1 - (1 + e) * (1 - sine**2)), rel=1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert han_2005((2.0, 0.5, 0.0), np.zeros(3), **given, restitution=1.1 * border)[0][0] < 0


def test_a_ball_that_leaves_is_left_alone() -> None:
    for model, more in ((han_2005, {}), (mathavan_2010, {"bed_friction": MU_BED})):
        v, w = model(
            (-1.0, 0.2, 0.0), (1.0, 2.0, 3.0), radius=R, nose_height=NOSE, restitution=E, friction=MU, **more
        )
        assert v.tolist() == [-1.0, 0.2, 0.0]
        assert w.tolist() == [1.0, 2.0, 3.0]


def test_a_dead_nose_is_the_limit_of_little_restitution() -> None:
    """Without restitution compression goes on to its end: the ball keeps no speed towards the nose."""
    velocity, spin = np.array([1.0, 0.5, 0.0]), np.zeros(3)
    given = {"radius": R, "nose_height": NOSE, "friction": MU, "bed_friction": MU_BED}
    ends = [mathavan_2010(velocity, spin, **given, restitution=e) for e in (0.0, 1e-3)]
    assert abs(ends[0][0][0]) < 1e-3
    for dead, nearly in zip(*ends, strict=True):
        assert dead == pytest.approx(nearly, abs=5e-3 * max(1.0, abs(nearly).max()))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"radius": -0.03}, "radius must be above 0"),
        ({"nose_height": 0.09}, "nose_height must be above 0 and below the top of the ball"),
        ({"restitution": 1.5}, "restitution must be from 0 to 1, found 1.5"),
        ({"restitution": -1.0}, "restitution must be from 0 to 1"),
        ({"restitution": float("nan")}, "restitution must be a finite number"),
        ({"friction": -0.2}, "friction must not be negative, found -0.2"),
    ],
)
def test_no_cushion_is_like_that(wrong: dict[str, float], told: str) -> None:
    for model, more in ((han_2005, {}), (mathavan_2010, {"bed_friction": MU_BED})):
        given = {"radius": R, "nose_height": NOSE, "restitution": E, "friction": MU, **more, **wrong}
        with pytest.raises(carom.CaromError, match=f"{model.__name__}: {told}"):
            model((1.0, 0.5, 0.0), (0.0, 0.0, 0.0), **given)
    with pytest.raises(carom.CaromError, match="bed_friction must not be negative"):
        mathavan_2010(
            (1.0, 0.5, 0.0),
            (0.0, 0.0, 0.0),
            radius=R,
            nose_height=NOSE,
            restitution=E,
            friction=MU,
            bed_friction=-1,
        )


def test_friction_that_holds_a_ball_between_nose_and_bed_is_told() -> None:
    """The integration had gone on for ever."""
    given = {"radius": R, "nose_height": NOSE, "restitution": E, "friction": 2.0, "bed_friction": 1.0}
    with pytest.raises(carom.CaromError, match="wedge the ball"):
        mathavan_2010((1.0, 0.5, 0.0), (0.0, 60.0, 0.0), **given, steps=100)


@pytest.mark.parametrize(
    ("model", "more"), [(han_2005, {}), (mathavan_2010, {"bed_friction": MU_BED, "steps": 200})]
)
def test_what_moves_is_looked_at_and_is_broadcast_alike(model: Any, more: dict[str, float]) -> None:
    """NaN passed, vectors of two gave NumPy's words, and one model took other shapes than the other."""
    given = {"radius": R, "nose_height": NOSE, "restitution": E, "friction": MU, **more}
    velocity, spin = np.array([[1.0, 0.5, 0.0], [2.0, -0.3, 0.0]]), np.array([3.0, 9.0, -20.0])
    for many, one in zip(model(velocity, spin, **given), zip(*(model(v, spin, **given) for v in velocity), strict=True),
                         strict=True):  # fmt: skip
        assert many == pytest.approx(np.array(one), rel=1e-12)
    for few, one in zip(
        model(velocity[0], [spin, spin], **given), model(velocity[0], spin, **given), strict=True
    ):
        assert few == pytest.approx(np.array([one, one]), rel=1e-12)
    three = (1.0, 0.5, 0.0)
    for v, w in (((1.0, 0.5), (0.0, 3.0)), ((np.nan, 0.5, 0.0), three), (three, (np.inf, 0.0, 0.0)), ("fast", three),
                 ([three] * 2, [three] * 3), (1.0, 2.0)):  # fmt: skip
        with pytest.raises(carom.CaromError, match=r"must be \(..., 3\) finite numbers"):
            model(v, w, **given)
    with pytest.raises(carom.CaromError, match="must have v_z = 0"):
        model((1.0, 0.5, 0.1), three, **given)


@pytest.mark.parametrize("steps", [1, 0, -1, 99, 150.0, True, "many"])
def test_too_few_steps_are_refused(steps: Any) -> None:
    """With one step a ball left with 3.9 times its energy."""
    given: dict[str, Any] = {"radius": R, "nose_height": NOSE, "friction": MU, "bed_friction": MU_BED}
    with pytest.raises(carom.CaromError, match="steps must be a whole number from 100 on"):
        mathavan_2010((1.0, 0.5, 0.0), (0.0, 1 / R, 0.0), **given, restitution=E, steps=steps)


def test_the_fewest_steps_gain_no_energy_and_come_near() -> None:
    rng = np.random.default_rng(0)
    velocity, spin = rng.uniform(-3, 3, (60, 3)) * [1, 1, 0], rng.normal(0, 60, (60, 3))
    velocity[:, 0] = np.abs(velocity[:, 0])
    given = {"radius": R, "nose_height": NOSE, "restitution": 1.0, "friction": MU, "bed_friction": MU_BED}
    (v, w), fine = (mathavan_2010(velocity, spin, **given, steps=steps) for steps in (100, 4000))

    def energy(v: np.ndarray, w: np.ndarray) -> Any:
        return (v**2).sum(axis=1) + 0.4 * R**2 * (w**2).sum(axis=1)

    start = energy(velocity, spin)
    assert (energy(v, w) < start).all()
    assert (energy(v - fine[0], w - fine[1]) < 0.02**2 * start).all()
