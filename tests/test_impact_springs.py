"""Laws with springs, `compliant` and `binary`: chains of balls against other integrations, and one contact of a clump."""

from __future__ import annotations

import math
from pathlib import Path

import carom
import numpy as np
import pytest
from carom import _core
from carom.audit import check
from carom.scene.chains import chain
from numpy.typing import NDArray
from oracle import Reference
from oracle_scenes import random_scene
from test_impact_laws import simulated
from test_oracle import difference

#: Velocities over that of the first ball, of equal balls in a row: the Hertz chain, integrated by another program.
HERTZ = {
    3: (-0.0710, 0.0764, 0.9945),
    4: (-0.0711, -0.0296, 0.1097, 0.9910),
    10: (-0.07108, -0.03027, -0.01583, -0.00889, -0.00513, -0.00299, -0.00174, 0.00267, 0.14739, 0.98587),
}


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_what_a_damper_closes_after_the_springs_does_not_rebound(law: str, tmp_path: Path) -> None:
    """It takes more than half of the velocity that the floor gives a ball: the ball closes again, and stays."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("m", "m", friction=0.3, restitution=0.9)
    scene.contact("m", "floor", friction=0.3, restitution=0.9)
    scene.plane("floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))
    for name, mass, x, z in (("a", 0.1, 0, 0.02), ("beside", 0.1, 0.04, 0.02), ("above", 10.0, 0, 0.2)):
        scene.sphere(name, radius=0.02, mass=mass, material="m", position=(x, 0, z), velocity=(0, 0, -1))
    scene.spring("a", "above", points=[(0, 0, 0.02), (0, 0, 0.2)], stiffness=1.0, damping=300.0)
    simulated(scene, impact=law, step=1e-3, until=1e-3, out=tmp_path / "run").close()
    found = carom.load(tmp_path / "run").impacts
    again = (np.asarray(found["problem"]) == 2) & (np.asarray(found["body"])[:, 1] == 3)
    assert np.asarray(found["approach"])[again] == pytest.approx([-0.524], abs=1e-3)
    assert np.abs(np.asarray(found["separation"])[again]).max() < 1e-9
    assert check(tmp_path / "run").ok


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize("speed", [0.01, 1.0])
@pytest.mark.parametrize("count", HERTZ)
def test_a_row_of_balls_is_the_hertz_chain(count: int, speed: float, law: str) -> None:
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.material("m")
    scene.contact("m", "m", friction=0.2, restitution=1.0)
    for k in range(count):
        scene.sphere(f"{k}", radius=0.01, material="m", density=7800.0, position=(0.02 * k, 0, 0),
                     velocity=(speed, 0, 0) if k == 0 else None)  # fmt: skip
    result = simulated(scene, impact=law, step=1e-6, until=1e-6)
    digits = 1e-4 if count < 10 else 1e-5
    np.testing.assert_allclose(result.velocity[-1][:, 0] / speed, HERTZ[count], atol=0.6 * digits)
    assert result.energy.total[-1] <= (1 + 1e-10) * 0.5 * result.bodies["mass"][0] * speed**2


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_a_row_of_linear_springs_has_its_closed_form(law: str) -> None:
    """Three equal balls, in units of the frequency of a contact: two modes until the first contact opens, then two balls."""
    modes = np.array([1.0, np.sqrt(3.0)])

    def depths(t: float) -> tuple[float, float]:
        one, two = 0.5 * np.sin(modes * t) / modes
        return float(one + two), float(one - two)

    low, high = 1.5, 2.8
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if depths(middle)[0] > 0.0 else (low, middle)
    one, two = np.cos(modes * low)
    v = np.array([1 / 3 + one / 2 + two / 6, 1 / 3 - two / 3, 1 / 3 - one / 2 + two / 6])
    apart = np.sqrt((v[1] - v[2]) ** 2 + 2.0 * depths(low)[1] ** 2)
    expected = [v[0], 0.5 * (v[1] + v[2] - apart), 0.5 * (v[1] + v[2] + apart)]
    after = simulated(chain(3), impact=law, impact_exponent=1.0).velocity[-1][:, 0]
    assert after == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_springs_that_are_cut_short_do_not_take_the_energy(law: str) -> None:
    """A light ball between a wall and one of 1e8 times its mass: many thousand hits, which took all energy with them."""
    scene = carom.Scene("squeezed", gravity=(0.0, 0.0, 0.0))
    scene.contact("a", "a", friction=0.0, restitution=1.0)
    scene.plane("wall", point=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0), material="a")
    scene.sphere("light", radius=0.01, mass=1.0, at=(0.02, 0.0, 0.0), material="a")
    scene.sphere("heavy", radius=0.01, mass=1e8, at=(0.05, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0), material="a")
    with pytest.warns(carom.CaromWarning, match="times the mass"):
        result = carom.simulate(scene, step=1e-3, until=0.1, impact=law)
    assert result.summary["truncated_sequences"] == 1
    assert result.summary["fallbacks"] == 0
    kinetic = result.energy.kinetic
    assert 0.9 * kinetic[0] < kinetic[-1] <= kinetic[0]
    assert result["heavy"].velocity[-1, 0] > 0.0


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_stiffness_of_pairs_and_the_exponent_are_those_of_the_oracle(law: str) -> None:
    stiff = 0
    for seed in range(60):
        model = random_scene(seed) | {"stiffness_ratio": np.array([1.0, 4.0])}
        model["friction"] = np.zeros(2)
        model["options"] |= {"impact": law, "impact_exponent": (1.0, 1.5, 2.0)[seed % 3]}
        oracle, core = Reference(model), _core.Simulation(model)
        plain = _core.Simulation(model | {"stiffness_ratio": np.ones(2)})
        oracle.advance(1)
        assert core.advance(1, 1, True, 1e9)["outcome"] is None
        plain.advance(1, 1, True, 1e9)
        assert difference(oracle, core, model["radius"]) <= 1e-10
        stiff += bool(np.abs(plain.frame()["velocity"] - core.frame()["velocity"]).max() > 1e-6)
    assert stiff > 2


def test_gaps_that_open_count_in_a_decorated_chain() -> None:
    """The light balls rattle. By an integration of the Hertz chain of high order (DOP853, 1e-12)."""
    after = simulated(chain(5, between=0.01 / 3), impact="compliant").velocity[-1][:, 0]
    assert after == pytest.approx([-0.09697, 0.04836, 0.08979, 0.52089, 0.9861], abs=2e-5)


# ---------------------------------------------------------------------------------------------- one contact alone


INERTIA, CENTRE, MASS, ANGLE = [1e-6, 6e-6, 6.5e-6], [0.012, 0.001, 0.002], 0.03, -0.2
BEFORE = (0.4, 0.2, -1.0)
TURN = np.array([[math.cos(ANGLE), 0, math.sin(ANGLE)], [0, 1, 0], [-math.sin(ANGLE), 0, math.cos(ANGLE)]])


def hit(law: str, friction: float, restitution: float, *, dust: bool = False) -> carom.Result:
    scene = carom.Scene("clump", gravity=(0, 0, 0))
    scene.contact("b", "b", friction=friction, restitution=restitution)
    turn = (math.cos(ANGLE / 2), 0, math.sin(ANGLE / 2), 0)
    scene.clump(
        "c",
        spheres=[[0, 0, 0, 0.01], [0.03, 0, 0, 0.01]],
        mass=MASS,
        material="b",
        inertia=INERTIA,
        centre=CENTRE,
        position=(0, 0, 0.01001),
        orientation=turn,
        velocity=BEFORE,
    )
    if dust:
        at = TURN @ [0.041, 0, 0] + [0, 0, 0.01001]
        scene.sphere("dust", radius=1e-3, mass=3e-8, material="b", at=tuple(at), velocity=BEFORE)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
    return carom.simulate(scene, step=1e-6, until=2e-5, impact=law, tolerance=1e-13, every=1)


def after(result: carom.Result) -> NDArray[np.float64]:
    clump = result.clumps["c"]
    return np.concatenate([np.asarray(clump.velocity)[-1], np.asarray(clump.angular_velocity)[-1]])


def integrated(mu: float, e: float, part: float = 1e-6) -> NDArray[np.float64]:
    """By the normal impulse as the time: friction opposes the slip or holds it, until `e^2` of the work is back."""
    arm = np.array([0, 0, -0.01]) - TURN @ CENTRE
    inertia = TURN @ np.diag(INERTIA) @ TURN.T
    cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    delassus = np.eye(3) / MASS - cross @ np.linalg.inv(inertia) @ cross
    u, impulse, work = np.array(BEFORE), np.zeros(3), 0.0
    holds = -np.linalg.solve(delassus[:2, :2], delassus[:2, 2])
    while True:
        slip = float(np.hypot(u[0], u[1]))
        sticks = slip < 1e-3 and float(np.hypot(*holds)) <= mu
        along = holds if sticks else -mu * u[:2] / max(slip, 1e-3)
        given = part * np.array([*along, 1.0])
        speed = u[2]
        u, impulse = u + delassus @ given, impulse + given
        work -= 0.5 * (speed + u[2]) * part / (1.0 if u[2] < 0 else e**2)
        if u[2] > 0 and work <= 0:
            turning = np.linalg.solve(inertia, np.cross(arm, impulse))
            return np.concatenate([np.array(BEFORE) + impulse / MASS, turning])


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize("friction", [0.1, 0.4, 10.0])
def test_an_impact_of_one_contact_is_that_of_its_spring(law: str, friction: float) -> None:
    result = hit(law, friction, 0.7)
    size = np.array([1, 1, 1, 100, 100, 100])
    np.testing.assert_allclose(after(result) / size, integrated(friction, 0.7) / size, rtol=0, atol=2e-3)
    assert carom.audit.check(result).ok
    newton = after(hit("sequence", friction, 0.7))
    assert np.abs((after(result) - newton) / size).max() > 0.03


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_dust_elsewhere_on_the_clump_changes_nothing(law: str) -> None:
    with pytest.warns(carom.CaromWarning, match="times the mass"):
        dusty = hit(law, 0.4, 0.7, dust=True)
    np.testing.assert_allclose(after(dusty), after(hit(law, 0.4, 0.7)), rtol=2e-3, atol=2e-3)


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_without_friction_one_contact_of_a_clump_has_newtons_law(law: str) -> None:
    np.testing.assert_allclose(after(hit(law, 0.0, 0.7)), after(hit("sequence", 0.0, 0.7)), rtol=0, atol=1e-9)


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_what_little_friction_of_the_last_kicks_is_left_is_no_fallback(law: str) -> None:
    """Four balls that touch one another hit a floor; the same half a metre away, or turned: rounding decides nothing."""
    draw = np.random.default_rng(304)
    v, w = np.stack([(draw.normal(size=3), 10.0 * draw.normal(size=3)) for _ in range(4)], axis=1)
    place = np.array([[-1, 0, 1], [1, 0, 1], [0, 3**0.5, 1], [0, 3**-0.5, 1 + (8 / 3) ** 0.5]])
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    found = []
    for turned, moved in ((np.eye(3), 0.0), (np.eye(3), 0.5), (turn, 0.3)):
        scene = carom.Scene(gravity=(0, 0, 0))
        for other in ("m", "floor"):
            scene.contact("m", other, friction=1.0, restitution=0.0)
        scene.plane("floor", point=(0, 0, moved), normal=(0, 0, 1), material="floor")
        for k, mass in enumerate((0.1, 0.3, 1.0, 3.0)):
            at, speed, turning = (turned @ x for x in (0.03 * place[k], v[k], w[k]))
            scene.sphere(f"{k}", radius=0.03, mass=mass, material="m", position=at + moved,
                         velocity=speed, angular_velocity=turning)  # fmt: skip
        result = simulated(scene, impact=law, step=1e-4, until=1e-4)
        assert result.summary["fallbacks"] == 0
        found.append(result.velocity[-1] @ turned)
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=0, atol=1e-7)


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize(("method", "gravity"), [("nsga", 0.0), ("moreau", 0.0), ("events", 9.8)])
def test_what_a_squeeze_leaves_is_no_impact_of_the_next_step(law: str, method: str, gravity: float) -> None:
    """A heavy ball squeezes two light ones against a floor until nothing is left, and a share of that is nothing, too."""
    scene = carom.Scene(gravity=(0, 0, -gravity))
    for one, other, e in (("h", "l", 0.2), ("h", "w", 0.9), ("l", "l", 0.9), ("l", "w", 0.9)):
        scene.contact(one, other, friction=0.0, restitution=e)
    for k, mass in enumerate((1e-3, 1e-3, 1.0)):
        scene.sphere(f"b{k}", radius=0.02, mass=mass, position=(0, 0, 0.02 + 0.04 * k),
                     velocity=(0, 0, -float(k == 2)), material="llh"[k])  # fmt: skip
    scene.plane("w", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    result = simulated(scene, impact=law, method=method, step=1e-4, until=1e-3)
    assert np.abs(result.velocity[-1]).max() < 1e-13
    assert np.asarray(result.impacts["step"]).max() <= 2


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize("drop", [0.02, 0.08, 0.2])
def test_a_ball_on_an_arm_rebounds_by_its_closed_form(law: str, drop: float) -> None:
    """Normal speed and slip come to rest at once, and friction turns around: of the arm's lever x and the contact's depth z
    below its end, the torque is (x + mu z) of the normal impulse before and (x - mu z) after. Across, little resists.
    """
    friction, e, arm, radius = 0.3, 0.6, 0.3, 0.05
    for turn in (0.0, 0.4, 0.8, 2.0):  # friction has axes of its own, which are not those of the arm
        angle = 0.2 - math.asin(drop / arm)
        scene = carom.Scene(gravity=(0, 0, 0), run={"until": 0.45, "step": 1e-4})
        scene.contact("m", "floor", friction=friction, restitution=e)
        scene.contact("m", "m", friction=friction, restitution=e)
        across = np.array([-math.sin(turn), math.cos(turn), 0])
        at = arm * np.array(
            [math.cos(turn) * math.cos(angle), math.sin(turn) * math.cos(angle), math.sin(angle)]
        )
        scene.sphere(
            "ball",
            radius=radius,
            mass=1,
            at=at,
            velocity=np.cross(across, at),
            angular_velocity=across,
            material="m",
        )
        scene.plane("floor", material="floor", point=(0, 0, -drop - radius), normal=(0, 0, 1))
        scene.joint("fix", body="ball", point=(0, 0, 0))
        run = carom.simulate(scene, impact=law, every=1, impacts=True)
        assert run.summary["fallbacks"] == 0
        assert len(run.impacts) == 1
        x, z = math.sqrt(arm**2 - drop**2), drop + radius
        expected = -e * math.sqrt((x - friction * z) / (x + friction * z))
        assert float(run.angular_velocity[-1, 0] @ across) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("law", ["compliant", "binary"])
def test_friction_along_what_joints_hold_is_none(law: str) -> None:
    """The end of the arm is level with the contact: its slip along the arm is rounding, and whatever holds that."""
    friction, e, arm, radius = 0.3, 0.6, 0.3, 0.05
    impulses = []
    for turn in np.linspace(0.05, 3.1, 20):
        scene = carom.Scene(gravity=(0, 0, 0), run={"until": 2e-4, "step": 1e-4})
        scene.contact("m", "floor", friction=friction, restitution=e)
        along = np.array([math.cos(turn), math.sin(turn), 0])
        at = arm * along + [0, 0, radius]
        across = np.array([-math.sin(turn), math.cos(turn), 0])
        motion = {"velocity": np.cross(across, at), "angular_velocity": across}
        scene.sphere("ball", radius=radius, mass=1, at=at, material="m", **motion)
        scene.plane("floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))
        scene.joint("fix", body="ball", point=(0, 0, 0))
        run = carom.simulate(scene, impact=law, every=1, impacts=True)
        assert run.summary["fallbacks"] == 0
        [impulse] = np.asarray(run.impacts["impulse"])
        assert np.abs(impulse[:2]).max() <= 1e-9 * impulse[2]
        impulses.append(impulse[2])
    assert np.ptp(impulses) <= 1e-9 * impulses[0]
