"""Method penalty from Python: options, records, summary, restart, and the break of section 5.6 beside theory."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core
from carom.cli.examples import find
from carom.result.record.layout import TABLES

R, MASS, G = 0.03, 0.2, 9.81


def pair(e: float = 0.8, speed: float = 1.0) -> carom.Scene:
    """Two balls without gravity, the first on its way to the second."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.material("ball")
    scene.contact("ball", "ball", friction=0.0, restitution=e)
    scene.sphere("a", radius=R, mass=MASS, material="ball", position=(-0.1, 0, 0), velocity=(speed, 0, 0))
    scene.sphere("b", radius=R, mass=MASS, material="ball", position=(0, 0, 0))
    return scene


def drop(e: float, **law: float) -> carom.Scene:
    """A ball that falls on a floor."""
    scene = carom.Scene(gravity=(0, 0, -G))
    scene.material("ball")
    scene.material("floor")
    scene.contact("ball", "floor", **{"friction": 0.0, "restitution": e, **law})
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.sphere("ball", radius=R, mass=MASS, material="ball", position=(0, 0, R + 0.05))
    return scene


def simulate(scene: carom.Scene, **options: Any) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return carom.simulate(scene, method="penalty", **options)


@pytest.fixture(scope="module")
def breaks() -> carom.Scene:
    return carom.Scene.from_toml(find("5.6_break")).with_options(position_friction="once")


def exact_restitution(chi: float) -> float:
    """The root e of chi (1 + e) = ln((1 + chi)/(1 - chi e)) in (0, 1/chi), by bisection."""
    low, high = 0.0, min(1.0, 1.0 / chi)
    for _ in range(100):
        e = 0.5 * (low + high)
        if chi * (1 + e) > np.log1p(chi) - np.log1p(-chi * e):
            low = e
        else:
            high = e
    return low


#: chi(e), written here a second time as an independent check.
DAMPING = {
    "hunt-crossley": lambda e: 3 * (1 - e) / 2,
    "herbert-mcwhannell": lambda e: 6 * (1 - e) / ((2 * e - 1) ** 2 + 3),
    "lee-wang": lambda e: 3 * (1 - e) / 4,
    "lankarani-nikravesh": lambda e: 3 * (1 - e**2) / 4,
    "gonthier": lambda e: (1 - e**2) / e,
    "zhiying-qishao": lambda e: 3 * (1 - e**2) * np.exp(2 * (1 - e)) / 4,
    "flores": lambda e: 8 * (1 - e) / (5 * e),
    "hu-guo": lambda e: 3 * (1 - e) / (2 * e),
}


def test_the_laws_are_those_of_the_core() -> None:
    assert set(_core.choices()["penalty_law"]) == {*DAMPING, "exact"}
    assert _core.choices()["penalty_friction"] == ["regularised", "spring"]


@pytest.mark.parametrize("e", [0.2, 0.93])
@pytest.mark.parametrize("law", DAMPING)
def test_each_law_gives_its_restitution(law: str, e: float) -> None:
    chi = DAMPING[law](e)
    result = simulate(pair(e), until=0.1, penalty_law=law)
    velocity = result.velocity[-1, :, 0]
    assert velocity[1] - velocity[0] == pytest.approx(exact_restitution(chi), abs=1e-3)
    [told] = result.summary["penalty"]["laws"]
    assert told["damping"] == pytest.approx(chi, rel=1e-12)
    assert told["restitution_effective"] == pytest.approx(exact_restitution(chi), rel=1e-9)


def test_a_collision_is_one_row_of_impacts() -> None:
    result = simulate(pair(0.6, 2.0), until=0.1)
    assert len(result.impacts["step"]) == 1
    assert result.impacts["approach"][0] == pytest.approx(-2.0, rel=1e-12)
    assert result.impacts["separation"][0] == pytest.approx(1.2, abs=1e-3)
    gained = MASS * (result.velocity[-1] - result.velocity[0])[0]
    assert result.impacts["impulse"][0] == pytest.approx(gained, abs=1e-15)
    assert np.sum(result.contacts["impulse"], axis=0) == pytest.approx(gained, abs=1e-15)
    kinetic = np.asarray(result.steps["energy_kinetic"])
    assert np.sum(result.contacts["work_normal"]) == pytest.approx(kinetic[-1] - kinetic[0], abs=1e-12)


def test_the_substep_is_reported() -> None:
    result = simulate(pair(1.0), until=0.1)
    # Hertz: t_c = 2.9432 d_max/v, K = 4/3 E* sqrt(R/2), m_e = m/2.
    young, poisson = (float(_core.defaults()[f"penalty_{k}"]) for k in ("young_modulus", "poisson_ratio"))
    modulus = young / (2 * (1 - poisson**2))
    stiffness = 4 / 3 * modulus * np.sqrt(R / 2)
    time = 2.9432751843 * (5 * (MASS / 2) / (4 * stiffness)) ** 0.4
    substeps, shortest = (np.asarray(result.steps[k]) for k in ("substeps", "substep_min"))
    told = result.summary["penalty"]
    assert told["substeps"] == substeps.sum()
    assert told["substep_min"] == shortest.min()
    assert 0.5 * time / 50 < told["substep_min"] <= time / 50 * (1 + 1e-9)
    assert substeps[0] == 1
    finer = simulate(pair(1.0), until=0.1, penalty_resolution=200)
    assert finer.summary["penalty"]["substep_min"] == pytest.approx(told["substep_min"] / 4, rel=0.05)
    # The other method has none.
    other = carom.simulate(pair(1.0), until=0.1)
    assert "penalty" not in other.summary
    assert not np.any(other.steps["substeps"])


def test_a_ball_comes_to_rest_on_cloth() -> None:
    result = simulate(drop(0.0), until=0.6)
    assert abs(result.velocity[-1, 0, 2]) < 1e-4
    assert result.position[-1, 0, 2] == pytest.approx(R, abs=1e-5)
    # It would rebound with the least restitution, 0.01; its weight takes most of that while it leaves.
    v = np.sqrt(2 * G * 0.05)
    assert result.impacts["approach"][0] == pytest.approx(-v, rel=1e-4)
    assert 0.0 <= result.impacts["separation"][0] <= 0.01 * v
    late = np.asarray(result.contacts["impulse"])[-100:, 2]
    assert late.mean() == pytest.approx(MASS * G * 1e-3, rel=1e-3)
    # It does not chatter: the floor carries it in every step.
    assert late.min() > 0.9 * MASS * G * 1e-3


def test_bounces_lose_what_the_law_says() -> None:
    result = simulate(drop(0.8), until=0.5)
    approach, separation = (np.asarray(result.impacts[k]) for k in ("approach", "separation"))
    assert len(approach) >= 2
    assert separation[:2] == pytest.approx(-0.8 * approach[:2], rel=2e-3)


def everything(run: Path) -> dict[str, Any]:
    segments = carom.load(run)._segments
    columns = {f"{t}/{name}": segments.column(t, name) for t in TABLES for name in segments.columns(t)}
    return {name: (c.shape, np.asarray(c).tobytes()) for name, c in columns.items()}


@pytest.mark.parametrize("friction", ["regularised", "spring"])
def test_a_run_in_parts_is_the_run_in_one(friction: str, breaks: carom.Scene, tmp_path: Path) -> None:
    """Stopped before, in the middle of, and after the break; frames at every third step."""
    options = {"step": 1e-4, "every": 3, "penalty_friction": friction}
    simulate(breaks, until=0.1172, out=tmp_path / "whole", **options)
    simulate(breaks, until=0.05, out=tmp_path / "parts", **options)
    within = 0
    for until in (0.1143, 0.1144, 0.1145, 0.1172):
        carom.resume(tmp_path / "parts", until=until)
        [state] = [
            carom.run.checkpoint.load(p).state for p in carom.run.checkpoint.found(tmp_path / "parts")[:1]
        ]
        within += len(state["touch_key"]) > 4
    assert within > 0
    assert everything(tmp_path / "whole") == everything(tmp_path / "parts")
    whole, parts = (carom.load(tmp_path / name).summary for name in ("whole", "parts"))
    for key in ("penalty", "energy", "penetration_max", "bodies"):
        assert whole[key] == parts[key], key


def test_a_state_with_other_contacts_is_refused() -> None:
    model = drop(0.5).with_options(method="penalty", until=1.0).to_model()
    simulation = _core.Simulation(model)
    simulation.advance(120, 0, False, 0.0)
    state = simulation.state()
    assert len(state["touch_key"]) in (0, 1)
    state["touch_key"] = np.array([[0, 7]])
    state["touch_value"] = np.zeros((1, 11))
    with pytest.raises(_core.ModelError, match="touch_key"):
        simulation.restore(state)
    state["touch_key"], state["touch_value"] = np.array([[0, 1]]), np.full((1, 11), np.nan)
    with pytest.raises(_core.ModelError, match="touch_value"):
        simulation.restore(state)


def test_the_break_has_hertz_character(breaks: carom.Scene) -> None:
    """Section 5.6: the cue ball at the break as with the other method; afterwards ball 3 backward, unlike there."""
    result = simulate(breaks, until=0.13)
    before, after = result.velocity[114, :, 0], result.velocity[-1, :, 0]
    assert before[0] == pytest.approx(10.5051, abs=2e-3)
    # The planar frictionless Hertz break at e = 0.93 has -0.1166, -0.0310 (0.5738, +-0.3314) in units of the cue speed.
    assert after[1] < 0.0
    assert after[2] == pytest.approx(0.5738 * before[0], rel=0.02)
    assert result.velocity[-1, 2, 1] == pytest.approx(-result.velocity[-1, 3, 1], rel=1e-3)
    # d_max of a head-on hit of the two balls, less what damping takes, more by the rack behind.
    stiffness = 4 / 3 * 5.5e9 / (2 * (1 - 0.34**2)) * np.sqrt(0.028575 / 2)
    deepest = (5 * 0.085 * before[0] ** 2 / (4 * stiffness)) ** 0.4
    assert result.summary["penetration_max"] == pytest.approx(deepest, rel=0.05)
    assert result.summary["energy"]["max_rise_relative"] < 1e-4


def test_what_the_method_cannot_do_is_refused() -> None:
    with pytest.raises(carom.CaromError, match=r"tangential_restitution.*spring"):
        simulate(drop(0.5, friction=0.2, tangential_restitution=0.3), until=0.1)
    with pytest.raises(carom.CaromError, match="penalty_stiffness"):
        simulate(pair(), until=0.1, penalty_exponent=1.0)
    with pytest.raises(carom.CaromError, match=r"penalty_law.*flores"):
        simulate(pair(), until=0.1, penalty_law="flore")
    linear = simulate(pair(0.6), until=0.2, penalty_exponent=1.0, penalty_stiffness=1e6)
    assert np.diff(linear.velocity[-1, :, 0]) == pytest.approx([0.6], abs=1e-3)


def test_moduli_have_units() -> None:
    soft = simulate(pair(), until=0.1, penalty_young_modulus="5.5 MPa")
    assert soft.summary["penetration_max"] == pytest.approx(
        simulate(pair(), until=0.1, penalty_young_modulus=5.5e6).summary["penetration_max"]
    )


def test_the_command_line_tells_the_substeps(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "carom", "run", str(find("5.6_break"))]
    command += ["--set", "method=penalty", "--until", "0.02", "-o", str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "substeps  " in done.stdout
    assert "impacts may be missed" not in done.stdout
    # What is said of the step of the other method does not hold for this one.
    assert "oblique" not in done.stderr + done.stdout
    summary = json.loads((tmp_path / "run" / "run.json").read_text())["summary"]
    assert summary["penalty"]["substeps"] > 20


def test_joints_are_refused_and_a_comparison_leaves_the_method_out() -> None:
    scene = carom.Scene.from_toml(find("5.1_torque"))
    with pytest.raises(carom.CaromError, match=r"penalty knows no joints; choose nsga"):
        carom.simulate(scene, method="penalty", until=0.01)
    assert "penalty" not in [run.name for run in carom.compare(scene, until=0.01)]
    assert "penalty" in [run.name for run in carom.compare(pair(), until=0.01)]


@pytest.mark.parametrize("far", [0.0, 0.3, 10.0])
def test_an_overlap_of_a_tenth_of_the_radius_is_admitted_wherever_it_is(far: float) -> None:
    """Rounding of the positions decided."""
    radius = 0.01
    for share, begins in ((0.1, True), (0.1001, False)):
        scene = carom.Scene("overlap", run={"method": "penalty", "until": 1e-4, "step": 1e-4})
        scene.contact("m", "m", friction=0.2, restitution=0.6)
        for name, x in (("a", far), ("b", far + (2 - share) * radius)):
            scene.sphere(name, radius=radius, mass=0.1, position=(x, 0, 0), material="m")
        if begins:
            scene.validate()
            assert carom.simulate_batch(scene, {"a.mass": [0.1]}).ok.all()
        else:
            with pytest.raises(carom.CaromError, match="overlap at the start"):
                scene.validate()
