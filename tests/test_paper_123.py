"""Examples 5.1 to 5.3 and Appendices B and C of the paper: the closed forms against what does not come from them."""

import importlib
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from carom.reproduce.analytic import impact, single_collision, slip_error, table_motion, throw
from carom.reproduce.analytic.sphere_pair import SpherePair
from carom.reproduce.document import Context

R, MASS = 0.028575, 0.17


def derivative(function, t, h=1e-5):
    return (function(t + h) - function(t - h)) / (2 * h)


# --- section 5.1 ----------------------------------------------------------------------------------------------------

PAIR = SpherePair(mass=1.0, radius=1.0, inertia=0.4, friction=0.3, gravity=9.8, rate=20.0)


def test_pair_has_the_papers_numbers():
    assert PAIR.t_lim == pytest.approx(0.294)
    assert PAIR.normal_force == pytest.approx(9.8)
    assert PAIR.greatest_friction_force == pytest.approx(2.94)
    # E3 of the project's list of errata.
    assert PAIR.angular_velocity_a(1.0) == pytest.approx(6.26955)
    assert PAIR.angular_velocity_b(1.0) == pytest.approx(-18.73045)
    assert PAIR.angle_a(1.0) == pytest.approx(2.7004341)
    assert PAIR.angle_b(1.0) == pytest.approx(-5.6328992, abs=1e-7)


@pytest.mark.parametrize("t", [0.1, 0.2, 0.5, 0.9])
def test_pair_obeys_the_balance_of_angular_momentum(t):
    moment = PAIR.radius * PAIR.friction_force(t)
    assert derivative(PAIR.angle_a, t) == pytest.approx(PAIR.angular_velocity_a(t), rel=1e-8)
    assert derivative(PAIR.angle_b, t) == pytest.approx(PAIR.angular_velocity_b(t), rel=1e-8)
    assert PAIR.inertia * derivative(PAIR.angular_velocity_a, t) == pytest.approx(moment, rel=1e-8)
    driven = -PAIR.rate * t + moment
    assert PAIR.inertia * derivative(PAIR.angular_velocity_b, t) == pytest.approx(driven, rel=1e-8)


def test_pair_sticks_until_t_lim_and_never_jumps():
    t = np.linspace(0, PAIR.t_lim, 50)
    np.testing.assert_allclose(PAIR.angular_velocity_a(t), -PAIR.angular_velocity_b(t), rtol=1e-14)
    for function in (PAIR.angular_velocity_a, PAIR.angular_velocity_b, PAIR.angle_a, PAIR.angle_b):
        assert function(PAIR.t_lim * (1 + 1e-12)) == pytest.approx(function(PAIR.t_lim), rel=1e-9)


def test_printed_formulas_jump():
    after = PAIR.t_lim * (1 + 1e-12)
    assert PAIR.printed_angular_velocity_b(after) == pytest.approx(-0.00691488)
    assert PAIR.angular_velocity_b(after) == pytest.approx(-1.08045)
    assert abs(PAIR.printed_angle_b(after) - PAIR.angle_b(after)) > 0.1


# --- section 5.2 and Appendix C -------------------------------------------------------------------------------------


def hit(friction=0.0, restitution=1.0, phi=math.pi / 6):
    return single_collision.Hit(1.8, phi, friction, restitution, MASS, R)


def roll(velocity, spin):
    return single_collision.Roll(velocity, spin, R, friction=0.2, gravity=9.8)


def test_thirty_degree_rule_has_known_values():
    fractions = [0, 0.125, 0.25, 0.5, 0.75, 0.875, 1]
    expected = [0, 19.972, 27.267, 33.670, 27.627, 16.615, 0]
    found = np.degrees(single_collision.deflection(single_collision.cut_angle(fractions)))
    np.testing.assert_allclose(found, expected, atol=6e-4)


@pytest.mark.parametrize("phi", [0.1, 0.5, 1.0, 1.4])
def test_thirty_degree_rule_follows_from_eqs_63_and_66(phi):
    vx, vy = roll(*single_collision.eq_63(hit(phi=phi))).final_velocity
    assert math.atan2(vx, vy) == pytest.approx(float(single_collision.deflection(phi)), rel=1e-13)


@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 1.0), (0.06, 1.0), (0.0, 0.94), (0.06, 0.94)])
def test_eq_63_is_the_impact_law_of_two_free_balls(friction, restitution):
    one = hit(friction, restitution)
    assert one.keeps_slipping
    law = single_collision.after_impact(one, locked=False, table_friction=None)
    velocity, spin = single_collision.eq_63(one)
    np.testing.assert_allclose(law.velocity[0, :2], velocity[:2], atol=1e-14)
    np.testing.assert_allclose(law.spin[0, :2], spin[:2], atol=1e-12)


def test_eq_63_does_not_hold_where_the_slip_ends():
    assert not hit(0.2, 0.94).keeps_slipping  # 0.2 > 2/(7 (1 + e) cos phi) = 0.170


@pytest.mark.parametrize(
    ("friction", "locked", "cloth", "vx", "vy"),
    [
        (0.06, False, 0.2, 0.7228, 0.4619),
        (0.06, True, None, 0.7088, None),
        (0.2, True, None, 0.545, None),
        (0.2, True, 0.2, 0.5710, 0.3598),
    ],
)
def test_impact_law_has_known_values(friction, locked, cloth, vx, vy):
    """Values of two earlier programs, quoted in the project's notes on eq. 63 (e_N = 0.94, half-ball hit)."""
    law = single_collision.after_impact(hit(friction, 0.94), locked=locked, table_friction=cloth)
    assert law.velocity[0, 0] == pytest.approx(vx, abs=2e-4)
    if vy is not None:
        assert law.velocity[0, 1] == pytest.approx(vy, abs=1e-4)


@pytest.mark.parametrize("locked", [False, True])
@pytest.mark.parametrize("friction", [0.06, 0.2])
def test_impact_law_satisfies_its_conditions(friction, locked):
    one = hit(friction, 0.94)
    law = single_collision.after_impact(one, locked=locked, table_friction=0.2)
    momentum = MASS * (law.velocity[0] + law.velocity[1])
    np.testing.assert_allclose(momentum, [0, MASS * 1.8, 0] + law.impulse[1] + law.impulse[2], atol=1e-14)
    contacts = [
        (0, 1, -one.direction, friction),
        (0, None, single_collision.UP, 0.2),
        (1, None, single_collision.UP, 0.2),
    ]
    for (a, b, normal, mu), impulse in zip(contacts, law.impulse, strict=True):
        slip = law.velocity[a] + np.cross(law.spin[a], -R * normal)
        if b is not None:
            slip = slip - law.velocity[b] - np.cross(law.spin[b], R * normal)
        pressed, speed = float(normal @ impulse), float(normal @ slip)
        assert pressed >= 0
        across, sideways = impulse - pressed * normal, slip - speed * normal
        assert np.linalg.norm(across) <= mu * pressed * (1 + 1e-12)
        if pressed == 0:
            assert speed > 0
        elif np.linalg.norm(sideways) > 1e-9:  # slips: friction is full and opposes the slip
            assert np.linalg.norm(across) == pytest.approx(mu * pressed, rel=1e-12)
            assert np.linalg.norm(np.cross(across, sideways)) <= 1e-12 * MASS
            assert across @ sideways < 0
    if locked:
        assert np.all(law.spin[:, 2] == 0)


def test_corrected_slip_of_a_rolling_ball_vanishes():
    rolling = roll(np.array([0.0, 1.8, 0.0]), np.array([-1.8 / R, 0.0, 0.0]))
    assert np.linalg.norm(rolling.slip) < 1e-12
    assert rolling.t_roll < 1e-12
    assert np.linalg.norm(rolling.printed_slip) == pytest.approx(3.6)


def test_roll_ends_with_eq_66_and_without_slip():
    after = roll(*single_collision.eq_63(hit()))
    assert after.t_roll == pytest.approx(0.2272, abs=5e-5)
    assert after.printed_t_roll == pytest.approx(0.3471, abs=5e-5)
    np.testing.assert_allclose(after.velocity_at(after.t_roll), after.final_velocity, atol=1e-14)
    assert derivative(after.position, 0.1) == pytest.approx(after.velocity_at(0.1), abs=1e-9)
    assert derivative(after.position, 0.3) == pytest.approx(after.final_velocity, abs=1e-9)


def table_ball(velocity, spin, *, restitution=1.0, until=0.5):
    return table_motion.motion(
        np.array(velocity),
        np.array(spin),
        radius=R,
        friction=0.2,
        restitution=restitution,
        gravity=9.8,
        until=until,
    )


def test_motion_on_cloth_without_flight_is_eq_67():
    velocity, spin = single_collision.eq_63(hit(0.0, 0.94))
    moved, closed = table_ball(velocity, spin), roll(velocity, spin)
    t = np.linspace(0, 0.5, 101)
    np.testing.assert_allclose(moved.position(t)[:, :2], closed.position(t), atol=1e-14)
    np.testing.assert_allclose(moved.velocity(t)[:, :2], closed.velocity_at(t), atol=1e-14)
    assert len(moved.pieces) == 2


@pytest.mark.parametrize("restitution", [1.0, 0.5, 0.0])
def test_bouncing_ends_in_the_rolling_of_eq_66(restitution):
    """Friction of the cloth acts at the lowest point: `5 v + 2 R (w_y, -w_x)` stays, however it is spread in time."""
    velocity, spin = np.array([0.7, 0.4, 0.09]), np.array([-57.0, 3.5, 4.0])
    moved = table_ball(velocity, spin, restitution=restitution, until=1.0)
    np.testing.assert_allclose(moved.final_velocity[:2], roll(velocity, spin).final_velocity, rtol=1e-12)
    highest = moved.position(np.linspace(0, 0.02, 2001))[:, 2].max()
    assert highest == pytest.approx(0.09**2 / (2 * 9.8), rel=1e-5)


def test_bouncing_ball_follows_the_parabola_on_average():
    """Many small bounces are sliding: the smaller they are, the nearer eq. 67."""
    velocity, spin = np.array([0.7, 0.4, 0.0]), np.array([-57.0, 3.5, 0.0])
    t = np.linspace(0, 0.3, 61)
    far = []
    for up in (0.04, 0.02, 0.01):
        moved = table_ball(velocity + np.array([0, 0, up]), spin)
        far.append(np.abs(moved.position(t)[:, :2] - roll(velocity, spin).position(t)).max())
    assert far[0] / far[1] == pytest.approx(2, abs=0.5)
    assert far[1] / far[2] == pytest.approx(2, abs=0.5)


# --- section 5.3 ----------------------------------------------------------------------------------------------------


def shot(ratio, roll_share, phi, **kwargs):
    v = 1.341
    return throw.Shot(v, math.radians(phi), ratio * v / R, roll_share * v / R, MASS, R, **kwargs)


def test_friction_law_has_the_measured_values():
    """Marlow: 0.11, 0.06, 0.01 at slip speeds of 0.0707, 0.707, 7.07 m/s."""
    found = [throw.friction_of(v) for v in (0.0707, 0.707, 7.07)]
    np.testing.assert_allclose(found, [0.11, 0.06, 0.01], atol=5e-4)


RATIOS = (-1.25, -0.9, -0.4, 0.0, 0.4, 0.9, 1.25)


@pytest.mark.parametrize(
    ("phi", "share", "expected"),
    [
        (0, 0.0, [1.5686, 2.2335, 3.2705, 0, -3.2705, -2.2335, -1.5686]),
        (0, 0.5, [1.3350, 1.7023, 1.8743, 0, -1.8743, -1.7023, -1.3350]),
        (30, 0.0, [1.0516, 1.3724, 2.2335, 3.5491, 0.9450, -3.7751, -2.6399]),
        (30, 0.5, [0.9862, 1.2414, 1.8118, 2.2119, 0.8563, -2.1625, -2.0077]),
    ],
)
def test_throw_table(phi, share, expected):
    """Eq. 50 against the project's notes, and against the impact law of two free balls, for all 28 shots."""
    for ratio, value in zip(RATIOS, expected, strict=True):
        one = shot(ratio, share, phi)
        closed = throw.free_throw(one)
        assert math.degrees(closed) == pytest.approx(value, abs=6e-5)
        law = throw.impact(one, table=False).velocity[1]
        assert throw.angle_of(law, one.direction) == pytest.approx(closed, abs=1e-13)


def test_table_matters_only_where_the_cue_ball_rolls():
    for ratio in RATIOS:
        for phi in (0, 30):
            assert throw.on_table(shot(ratio, 0.0, phi)) == pytest.approx(
                throw.free_throw(shot(ratio, 0.0, phi)), abs=1e-13
            )
    one = shot(0.9, 0.5, 30)
    assert math.degrees(throw.on_table(one) - throw.free_throw(one)) == pytest.approx(0.096, abs=5e-4)
    # For a given spin, the one side of the table's reaction: 6/m in place of 7/m upwards, solved by bisection.
    law = throw.impact(one, table=True)
    up, across = _table_slip(one)
    found = law.impulse[0] - (law.impulse[0] @ -one.direction) * -one.direction
    assert -found @ one.sideways == pytest.approx(across, rel=1e-10)
    assert found[2] == pytest.approx(up, rel=1e-10)


def _table_slip(one):
    """Friction impulse on the object ball in a slipping hit: (downwards, sideways), from the slip after the impact."""
    bound = one.mu * MASS * one.speed * math.cos(one.phi)
    sideways, upwards = one.slip

    def turned(angle):
        left = sideways - 7 / MASS * bound * math.cos(angle), upwards - 6 / MASS * bound * math.sin(angle)
        return math.cos(angle) * left[1] - math.sin(angle) * left[0]

    low, high = math.atan2(upwards, sideways) - 0.5, math.atan2(upwards, sideways) + 0.5
    rising = turned(high) > 0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (low, middle) if (turned(middle) > 0) == rising else (middle, high)
    return -bound * math.sin(low), bound * math.cos(low)


def test_throw_vanishes_without_sideways_slip():
    """R w_z = v sin phi: the natural roll of the hit."""
    one = shot(0.5, 0.5, 30)
    assert throw.free_throw(one) == pytest.approx(0, abs=1e-15)
    assert throw.on_table(one) == pytest.approx(0, abs=1e-13)


def test_impact_of_two_equal_balls_swaps_their_velocities():
    along = np.array([1.0, 0.0, 0.0])
    balls = [impact.Ball(1.0, 0.5, 0.1, v, np.zeros(3)) for v in (2 * along, -along)]
    after = impact.collide(balls, [impact.Touch(0, 1, -along, 0.3, 1.0)])
    np.testing.assert_allclose(after.velocity, [-along, 2 * along], atol=1e-15)
    np.testing.assert_allclose(after.spin, 0, atol=1e-15)


# --- Appendix B -----------------------------------------------------------------------------------------------------


def test_eq_61_multiplied_out():
    theta = np.linspace(0.05, 3, 60)
    np.testing.assert_allclose(slip_error.slip_error(theta), slip_error.printed_slip_error(theta), atol=2e-15)
    np.testing.assert_allclose(slip_error.slip_error(theta), np.sin(theta) - theta, atol=2e-15)


@pytest.mark.parametrize("theta", [1e-6, 1e-3, 0.1, 0.2999, 0.3001])
def test_slip_error_is_accurate_for_small_angles(theta):
    expected = -(theta**3) / 6 * (1 - theta**2 / 20 * (1 - theta**2 / 42 * (1 - theta**2 / 72)))
    assert slip_error.slip_error(theta) == pytest.approx(expected, rel=1e-11)
    assert slip_error.leading_term(theta) == pytest.approx(expected, rel=theta**2 / 19)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_rolling_keeps_the_distance_and_the_arc_lengths(ratio):
    place = slip_error.rolling(0.3, 2.0, 2.0 * ratio)
    for centre in (place.x_a0, place.x_a1):
        assert np.linalg.norm(centre) == pytest.approx(2.0 * (1 + ratio))
    theta_a = -place.psi_a[2] - 0.3
    assert theta_a * 2.0 == pytest.approx(0.3 * 2.0 * ratio)  # eq. 58
    assert place.tangent @ place.x_a0 == pytest.approx(0, abs=1e-15)
    assert slip_error.contact_angle(slip_error.total_angle(0.3, ratio), ratio) == pytest.approx(0.3)


# --- the rows: every number of the tables against its reference -------------------------------------------------------

FIGURES = {
    "s51": ["3a", "3b", "4a", "4b"],
    "s52": ["5b", "6a", "6b", "7a", "7b", "7c", "8", "9"],
    "s53": ["11a", "11b", "12", "12-height", "13", "14"],
    "appendix_b": ["28", "29"],
    "appendix_c": [],
}


@cache
def reproduced(module):
    example = importlib.import_module(f"carom.reproduce.examples.{module}")
    return example.reproduce(Context(quick=True))


@pytest.mark.parametrize("module", FIGURES)
def test_every_row_agrees(module):
    example = reproduced(module)
    short = [f"{r.quantity}: {r.carom} against {r.reference}" for r in example.rows if r.verdict == "short"]
    assert not short
    assert [figure.number for figure in example.figures] == FIGURES[module]
    assert all(counts.unconverged == 0 for counts in example.counts)


@pytest.mark.parametrize("module", FIGURES)
def test_tolerances_tell_right_from_wrong(module):
    """A value that the paper has wrong would be short: the tolerance is smaller than the error of the paper."""
    for row in reproduced(module).rows:
        if row.paper_in_error and isinstance(row.paper, float):
            assert abs(row.paper - row.reference) > row.tolerance, row.quantity


def errata(module):
    return [row.quantity for row in reproduced(module).rows if row.verdict == "paper in error"]


def test_errata_are_those_that_are_known():
    orders = [f"order of convergence, {name}" for name in ("angle", "angular velocity")]
    assert errata("s51")[:2] == ["angular velocity of B at 1 s", "angle of B at 1 s"]
    assert errata("s51")[2:4] == [f"{order} of A" for order in orders]
    assert len(errata("s51")) == 5
    assert errata("appendix_b") == []
    found = errata("s53")
    assert len(found) == 13  # half of rolling, without the shot that throws by nothing
    assert all("w_x = 0.5 w_roll" in quantity for quantity in found)
    assert not any("mu_b=0 " in quantity and "time" not in quantity for quantity in errata("s52"))


def test_table_of_5_3_has_all_shots_and_5_2_all_fractions():
    assert sum(row.quantity.startswith("throw, ") for row in reproduced("s53").rows) == 28
    assert sum(row.quantity.startswith("deflection ") for row in reproduced("s52").rows) == 7


def test_a_wrong_number_is_short():
    """The rows do judge: half a degree off is not within 0.05."""
    row = next(row for row in reproduced("s52").rows if row.quantity.startswith("deflection "))
    assert replace(row, carom=row.carom + 0.5).verdict == "short"
