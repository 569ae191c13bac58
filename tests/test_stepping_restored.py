"""`Simulation.restore` and `Simulation.result`: what belongs to which record, and what a state may not be."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest
from carom.scene.assembly.rotations import product


def resting(**given: object) -> carom.Simulation:
    """A ball of 0.1 kg on a floor, which it presses with 0.98 N, and one that hangs."""
    scene = carom.Scene("rest")
    scene.contact("g", "g", friction=0.3, restitution=0.0)
    scene.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0.01), material="g")
    scene.sphere("b", radius=0.01, mass=0.1, at=(1, 0, 0.5), material="g")
    scene.joint("fix", body="b")
    scene.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    return carom.Simulation(scene, step=1e-3, every=10, walls=True, **given)


@pytest.mark.parametrize("keep", [True, False])
def test_a_record_begins_anew_without_the_sums_of_the_old_one(keep: bool) -> None:
    source, sim = resting(keep=keep), resting()
    source.step(29)
    sim.restore(source.state())
    sim.step(11)
    result = sim.result()
    assert np.asarray(result.step).tolist() == [29, 30, 40]
    np.testing.assert_allclose(result.walls["f"].force[1:, 2], [-0.98, -0.98], rtol=1e-9)
    impulse = [0.98e-3, 9.8e-3]
    np.testing.assert_allclose(np.asarray(result.contacts["impulse"])[:, 2], impulse, rtol=1e-9)
    np.testing.assert_allclose(np.asarray(result.joint_impulse)[1:, 0, 2], impulse, rtol=1e-9)


def test_the_auditor_judges_no_contacts_of_a_last_frame_off_the_grid() -> None:
    scene = carom.Scene("roll")
    scene.contact("g", "g", friction=0.3, restitution=0.5)
    scene.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0.01), velocity=(0.3, 0, 0), material="g")
    scene.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    sim = carom.Simulation(scene, step=1e-3, every=7, walls=True)
    for steps in (60, 3):
        sim.step(steps)
        report = carom.audit.check(sim.result())
        assert report.ok, report


def test_the_totals_of_a_record_begin_with_it() -> None:
    """A ball of 1 kg that is struck to 2 m/s has 2 J from the first frame on, and gains nothing."""
    scene = carom.Scene("free", gravity=(0, 0, 0))
    scene.sphere("a", radius=0.05, mass=1.0, at=(0, 0, 0), material="m")
    sim = carom.Simulation(scene, step=1e-3)
    sim.step(5)
    state = sim.state()
    state["velocity"][0] = (2.0, 0.0, 0.0)
    sim.restore(state)
    sim.step(100)
    summary = sim.result().summary
    energy = summary["energy"]
    assert (energy["initial"], energy["final"], energy["max_rise"], energy["rises"]) == (2.0, 2.0, 0.0, 0)


def test_a_result_and_the_record_go_on_apart() -> None:
    """The state off the grid that a result shows, read or not, is not in a later one, and later steps not in it."""
    sim = resting()
    sim.step(25)
    first = sim.result()
    sim.step(25)
    assert np.asarray(sim.result().step).tolist() == [*range(0, 51, 10)]
    assert np.asarray(first.step).tolist() == [0, 10, 20, 25]
    assert len(first.steps) == 25


def rod(at: tuple[float, float, float] = (0, 0, 0.05)) -> carom.Scene:
    scene = carom.Scene("rod", gravity=(0, 0, 0), periodic=(0.1, 0.1, 0.1))
    scene.contact("g", "g", friction=0.3, restitution=0.5)
    parts = [[-0.01, 0, 0, 0.01], [0.01, 0, 0, 0.01], [0, 0.01, 0, 0.006]]
    scene.clump("k", spheres=parts, material="g", density=3000, at=at, velocity=(0.3, 0.1, 0))
    return scene


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi])
def test_balls_follow_a_clump_that_is_placed(angle: float) -> None:
    sim = carom.Simulation(rod(), step=1e-3)
    sim.step(60)  # in part beyond the border of the box
    state = sim.state()
    sim.restore(state)
    place, turn = np.array([0.03, 0.02, 0.01]), [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]
    apart = state["position"][:3] - state["position"][3]
    c, s = np.cos(angle), np.sin(angle)
    before = state["orientation"][3]
    state["position"][3], state["orientation"][3] = place, quaternion(turn, before)
    sim.restore(state)
    np.testing.assert_allclose(sim.clumps[0, :3], place, rtol=1e-12)
    turned = apart @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    off = (sim.position - place - turned) / 0.1
    np.testing.assert_allclose(off - np.round(off), 0.0, atol=1e-10)
    sim.step(1)
    np.testing.assert_allclose(sim.velocity, [[0.3, 0.1, 0]] * 3, rtol=1e-9)


def quaternion(q: list[float], p: np.ndarray) -> list[float]:
    """`q p` where q turns about z."""
    (w, _, _, z), (a, b, c, d) = q, p
    return [w * a - z * d, w * b - z * c, w * c + z * b, w * d + z * a]


def test_a_ball_of_a_clump_is_not_placed_by_itself() -> None:
    sim = carom.Simulation(rod(), step=1e-3)
    for rows in ([1], [0, 1, 2]):
        state = sim.state()
        state["position"][rows] += 0.02
        with pytest.raises(carom.CaromError, match="place the clump, row 3 of position and orientation"):
            sim.restore(state)
    state = sim.state()
    state["position"] = state["position"][:-1]
    with pytest.raises(carom.CaromError, match="position is for 3 bodies, the model has 4"):
        sim.restore(state)


def test_what_a_joint_holds_is_not_placed_off_it() -> None:
    scene = carom.Scene("pair", gravity=(0, 0, 0))
    scene.contact("g", "g", friction=0.3, restitution=0.0)
    for name, x in (("a", 0.0), ("b", 0.1), ("c", 0.3)):
        scene.sphere(name, radius=0.01, mass=0.1, at=(x, 0, 0), material="g")
    scene.joint("rod", between=["a", "b"])
    scene.joint("motion", body="c", direction=(0, 0, 1), displacement={"expression": "10*t^2"})
    sim = carom.Simulation(scene, step=1e-3)
    state = sim.state()
    state["position"][:2] += 0.5  # both together
    sim.restore(state)
    sim.step(10)
    later = sim.state()
    for row, place, told in (
        (
            1,
            (0.9, 0.5, 0.5),
            r'joint "joint1" of "a" and "b": the distance of its ends is 0.4 m, it holds 0.1 m',
        ),
        (2, (0.3, 0, 0), r'joint "joint2" of "c": the displacement of its points is 0 m, it holds 0.001 m'),
    ):
        state = {**later, "position": later["position"].copy()}
        state["position"][row] = place
        with pytest.raises(carom.CaromError, match=told):
            sim.restore(state)
    assert sim.steps == 10
    sim.restore(later)


def turned(axis: tuple[float, float, float], angle: float) -> list[float]:
    """The quaternion of a turn about a unit axis."""
    return [np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))]


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


@pytest.mark.parametrize(
    ("joint", "fits", "wrong"),
    [
        ({"type": "lock"}, [], {"its turn since the start is 0.5 rad, it holds 0": (Z, 0.5)}),
        (
            {"type": "lock", "axes": [X, Y]},
            [(Z, 0.5), (Z, np.pi)],
            {"the axis that it leaves free is 0.5 rad": (X, 0.5), "is 3.14159 rad": (X, np.pi)},
        ),
        ({"type": "lock", "axes": [Z]}, [(X, 0.5)], {"its angle, but for whole turns, is 0.5": (Z, 0.5)}),
        (
            {"type": "motion", "axis": Z, "angle": {"expression": "90*t^2"}},
            [(Z, 0.9 + 2 * np.pi), (X, 0.5)],
            {"is 0.5 rad, it holds 0.9 rad; place": (Z, 0.5)},
        ),
    ],
)
def test_what_a_joint_holds_is_not_turned_off_it(
    joint: dict[str, Any], fits: list[Any], wrong: dict[str, Any]
) -> None:
    scene = carom.Scene("held", gravity=(0, 0, 0))
    scene.sphere("a", radius=0.05, mass=1, at=(0, 0, 0), material="m", orientation=turned(Y, 0.3))
    scene.joint(**joint, body="a", name="pin")
    sim = carom.Simulation(scene, step=1e-3)
    for _ in range(10):
        sim.step(10)
        sim.restore(sim.state())
    later = sim.state()
    for turn in fits:
        sim.restore(
            later | {"orientation": later["orientation"] * 0 + product(turned(*turn), turned(Y, 0.3))}
        )
    for told, turn in wrong.items():
        placed = product(turned(*turn), turned(Y, 0.3))
        with pytest.raises(carom.CaromError, match=f'joint "pin" of "a": .*{told}'):
            sim.restore(later | {"orientation": later["orientation"] * 0 + placed})


def test_bodies_locked_together_turn_as_one() -> None:
    """However far they have turned, in steps of a twentieth of a turn."""
    scene = carom.Scene("pair", gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    spin = np.array([150.0, -200.0, 180.0])
    for name, x in (("a", 0.0), ("b", 0.2)):
        v = np.cross(spin, (x, 0, 0))
        scene.sphere(name, radius=0.05, mass=1, at=(x, 0, 0), material="m", velocity=v, angular_velocity=spin)
    scene.joint("lock", between=["a", "b"])
    sim = carom.Simulation(scene, step=1e-3)
    for _ in range(10):
        sim.step(100)
        sim.restore(sim.state())
    state = sim.state()
    together = product(turned(Y, 1.0), state["orientation"])
    sim.restore(state | {"orientation": together})
    together[1] = product(turned(X, 0.002), together[1])
    with pytest.raises(carom.CaromError, match=r'"a" and "b": its turn since the start is 0\.002 rad'):
        sim.restore(state | {"orientation": together})


@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_what_a_joint_holds_is_not_struck_off_it(method: str) -> None:
    """A state as it was left is always taken, however far it has turned in its steps."""
    scene = carom.Scene("swing")
    scene.contact("g", "g", friction=0.3, restitution=0.0)
    for name, x in (("a", 0.1), ("b", 0.2), ("c", 0.5)):
        scene.sphere(name, radius=0.01, mass=0.1, at=(x, 0, 0), material="g")
    scene.joint("rod", between=["a", "ground"], points=[(0.1, 0, 0), (0, 0, 0)])
    scene.joint("rod", between=["a", "b"])
    scene.joint("fix", body="c")
    scene.joint("motion", body="c", axis=(0, 0, 1), angle={"expression": "10*t^2"})
    sim = carom.Simulation(scene, step=1e-3, method=method)
    state = sim.state()
    state["velocity"][1] = (0, 0, 2.0)  # across the rods
    sim.restore(state)
    for _ in range(20):
        sim.step(5)
        sim.restore(sim.state())
    later = sim.state()
    along = later["position"][0] / 0.1
    for key, row, by, told in (
        ("velocity", 0, along, r'"joint1" of "a": the speed at which its ends part is 1 m/s, it holds 0'),
        (
            "velocity",
            2,
            (0, 1, 0),
            r'"joint3" of "c": the speed of its points is 1 m/s, it holds 0 m/s; strike',
        ),
        ("angular_velocity", 2, (0, 0, 1), r"angular speed about its axis is 3 rad/s, it holds 2 rad/s; str"),
    ):
        state = {**later, key: later[key].copy()}
        state[key][row] += by
        with pytest.raises(carom.CaromError, match=told):
            sim.restore(state)
    assert sim.steps == 100


def test_a_clump_on_a_joint_is_struck_about_it() -> None:
    scene = carom.Scene("bar")
    scene.contact("g", "g", friction=0.3, restitution=0.0)
    parts = [[0, 0, 0, 0.02], [0.05, 0, 0, 0.02], [0, 0.06, 0, 0.01]]
    scene.clump("k", spheres=parts, material="g", density=1000, at=(0, 0, 0))
    scene.joint("fix", body="k2")
    sim = carom.Simulation(scene, step=1e-3)
    pin, spin = sim.position[1], np.array([1.0, 2.0, 3.0])
    for _ in range(3):
        state = sim.state()
        state["angular_velocity"][3] = spin
        if sim.steps:
            with pytest.raises(carom.CaromError, match='"joint1" of "k2": the speed of its points'):
                sim.restore(state)
        state["velocity"][3] = np.cross(spin, state["position"][3] - pin)
        sim.restore(state)
        sim.step(50)
        sim.restore(sim.state())


def test_what_is_no_number_of_steps_and_no_choice_is_refused() -> None:
    sim = resting()
    for step in (2.9, -1, 2**62, [1, 2]):
        with pytest.raises(carom.CaromError, match="step must be one whole number from 0 to 10"):
            sim.restore(sim.state() | {"step": np.array(step)})
    with pytest.raises(carom.CaromError, match=r"step must be one whole number.*found \[1, \[2\]\]"):
        sim.restore(sim.state() | {"step": [1, [2]]})
    for key in ("monitor_int", "warm_key"):
        shape = (1, *sim.state()[key].shape[1:])
        with pytest.raises(carom.CaromError, match=f"restore: {key} must be 0 or more, found -1"):
            sim.restore(sim.state() | {key: np.full(shape, -1)})
    with pytest.raises(carom.CaromError, match="beyond step 10"):
        sim.step(2**62)
    with pytest.raises(carom.CaromError, match=r"^carom\.Simulation: keep must be True or False, found 'no'"):
        resting(keep="no")
    with pytest.raises(carom.CaromError, match=r"^carom\.Simulation: checkpoint_steps: it writes"):
        resting(checkpoint_steps=3)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"stepp": 1e-3}, r"^carom\.Simulation: stepp: unknown option; write step="),
        ({"step": -1.0}, r"^carom\.Simulation: step: must be positive"),
        ({"every": 0}, r"^carom\.Simulation: every: "),
    ],
)
def test_messages_name_what_was_called(given: dict[str, float], told: str) -> None:
    scene = carom.Scene("free", gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    scene.sphere("a", radius=0.05, mass=1.0, at=(0, 0, 0), velocity=(3, 0, 0), material="m")
    scene.sphere("b", radius=0.05, mass=1.0, at=(1, 0, 0), material="m")
    with pytest.raises(carom.CaromError, match=told):
        carom.Simulation(scene, **given)  # type: ignore[arg-type]
    with pytest.warns(carom.CaromWarning, match=r"^carom\.Simulation: step: a step of 0\.001 s moves"):
        carom.Simulation(scene, step=1e-3)


def test_what_a_controller_gives_is_taken_as_numbers_and_the_rest_refused_by_name() -> None:
    """Single precision, whole numbers and lists have the bits of the same numbers in float64."""
    sim = resting()
    state = sim.state()
    rows = len(state["velocity"])
    struck = np.zeros((rows, 3))
    struck[0] = (0.5, -2.0, 0.25)
    for at in (7, 7.0, [7], np.int64(7), np.array(7)):
        sim.restore(state | {"step": at})
        assert sim.steps == 7
    ends = []
    whole = (struck * 4).astype(int)
    sim.restore(state | {"velocity": whole})
    np.testing.assert_array_equal(sim.velocity[0], (2.0, -8.0, 1.0))
    for given in (struck, struck.astype(np.float16), struck.astype(np.float32), struck.tolist()):
        sim.restore(state | {"velocity": given})
        sim.step(3)
        ends.append(sim.position.tobytes())
    assert len(set(ends)) == 1
    for given, found in (
        (struck[0], r"float64 \(3,\)"),
        (struck.astype(complex), rf"complex128 \({rows}, 3\)"),
        (struck > 0, rf"bool \({rows}, 3\)"),
        ([[1.0, 2.0], [3.0]], "rows of unlike lengths"),
        (None, "NoneType"),
    ):
        told = rf"^restore: velocity must be an array of float64 \(n, 3\), found {found}$"
        with pytest.raises(carom.CaromError, match=told):
            sim.restore(state | {"velocity": given})
    for key in state:
        masked = np.ma.array(state[key], mask=True)
        if masked.size:
            with pytest.raises(carom.CaromError, match=f"^restore: {key} has masked numbers"):
                sim.restore(state | {key: masked})
            with pytest.raises(carom.CaromError, match=f"^restore: {key} has masked numbers"):
                sim.restore(state | {key: [masked]})
    sim.restore(state | {"velocity": np.ma.array(struck)})  # nothing is masked
    np.testing.assert_array_equal(sim.velocity[0], struck[0])


@pytest.mark.parametrize(("key", "unit"), [("velocity", "m/s"), ("angular_velocity", "rad/s")])
def test_a_strike_beyond_any_run_is_refused_where_it_is_given(key: str, unit: str) -> None:
    """Up to there it is taken: the bound is that of the core, which would call it the work of a load."""
    sim = resting()
    state = sim.state()
    state[key][0, 1] = 1e200
    with pytest.raises(carom.CaromError, match=rf"^restore: row 0 of {key} has 1e\+200 {unit}, more than"):
        sim.restore(state)
    state[key][0, 1] = 1e12
    sim.restore(state)
