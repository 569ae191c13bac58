"""Advice on impacts that gain energy by Newton's law with friction (Kane), before and after a run."""

from __future__ import annotations

import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromWarning
from carom.cli.summary import text
from carom.result.remarks import RISE_PILE, remarks
from carom.scene.checks.energy_gain import Gain, Side, _compliance, largest_gain
from typer.testing import CliRunner

SPIN = 2.5  # m r^2/I of a homogeneous ball
RIGHT = (np.pi / 2, np.pi / 2)
AROUND = (np.pi / 3, np.pi)


def ball(friction: float, normal: float, tangential: float = 0.0) -> Side:
    return Side(friction, normal, tangential, 1.0, SPIN)


def worst_case(gain: Gain, first: Side, second: Side) -> carom.Scene:
    """Unit balls and walls with just the velocities of which the advice speaks, and the paper's law."""
    normals = [np.array([np.cos(a), np.sin(a), 0.0]) for a in (0.0, gain.angle)]
    along = [np.cross([0.0, 0.0, 1.0], n) for n in normals]
    y = np.linalg.pinv(_compliance(first, second, SPIN, gain.angle)) @ np.array(gain.before)
    push = [y[0] * normals[0] + y[2] * along[0], y[1] * normals[1] + y[3] * along[1]]
    # a weight that presses on the contact at rest, and is small beside the impact
    gravity = -30.0 * normals[1] if second.rests else np.zeros(3)
    scene = carom.Scene(
        "kane", gravity=gravity, run={"until": 2e-6, "step": 1e-6, "impact": "sequence-paper"}
    )
    spin = SPIN * sum(np.cross(-n, p) for n, p in zip(normals, push, strict=True))
    scene.sphere(
        "ball", radius=1, mass=1, at=(0, 0, 0), velocity=sum(push), angular_velocity=spin, material="m"
    )
    for name, side, n, p in zip("ab", (first, second), normals, push, strict=True):
        scene.contact(
            "m", name, friction=side.friction, restitution=side.normal, tangential_restitution=side.tangential
        )
        if side.inverse_mass:
            turn = SPIN * np.cross(n, -p)
            scene.sphere(name, radius=1, mass=1, at=-2 * n, velocity=-p, angular_velocity=turn, material=name)
        else:
            scene.plane(name, point=-n, normal=n, material=name)
    scene.contact("a", "b", friction=0.0, restitution=0.0)
    return scene


@pytest.mark.parametrize(
    ("first", "second", "angles"),
    [
        pytest.param(ball(0.06, 1.0), ball(0.06, 1.0), AROUND, id="balls"),
        pytest.param(ball(0.3, 0.9), ball(0.5, 0.6, 0.4), AROUND, id="unlike balls"),
        pytest.param(ball(0.5, 0.5, 0.9), ball(0.5, 0.5, 0.9), AROUND, id="tangential"),
        pytest.param(ball(0.3, 0.95), Side(0.4, 0.8, 0.2), (np.pi / 2, np.pi), id="ball and wall"),
        pytest.param(Side(0.5, 1.0, 0.0), Side(0.5, 1.0, 0.0), RIGHT, id="corner"),
        pytest.param(Side(0.3, 0.9, 0.0), Side(0.3, 0.9, 0.0), RIGHT, id="lossy corner"),
        pytest.param(ball(0.9, 1.0), Side(0.9, 0.0, 0.0, rests=True), RIGHT, id="on a floor"),
    ],
)
def test_the_gain_is_that_of_a_run(first: Side, second: Side, angles: tuple[float, float]) -> None:
    gain = largest_gain(first, second, SPIN, angles)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)
        energy = carom.simulate(worst_case(gain, first, second)).summary["energy"]
    assert energy["final"] / energy["initial"] - 1 == pytest.approx(gain.share, abs=1e-4)


def test_nothing_gains_where_theory_says_so() -> None:
    """One restitution for all rows loses energy, whatever the friction; so does e_N = e_T = 0."""
    for e in (0.0, 0.5, 0.99):
        for side in (ball(1.0, e, e), Side(1.0, e, e)):
            assert largest_gain(side, side, SPIN, RIGHT).share < 0
    # Bernoulli's problem with friction gains 1/37 at e_N = 1; that impact is one of those searched
    assert largest_gain(ball(0.06, 1.0), ball(0.06, 1.0), SPIN, (np.pi / 3,) * 2).share > 1 / 37
    assert largest_gain(ball(0.06, 0.95), ball(0.06, 0.95), SPIN, (np.pi / 3,) * 2).share < 0


def bernoulli(**changed: Any) -> carom.Scene:
    scene = carom.example("paper/5.5_bernoulli", parameters={"mu": 0.06})
    return scene.with_options(step=1e-4, until=0.01, **changed)


def test_the_law_of_the_paper_is_advised_against_before_and_after() -> None:
    scene = bernoulli(impact="sequence-paper")
    [advice] = scene.validate()
    assert "e_N = 1 with friction" in advice.cause
    assert "(Kane)" in advice.cause
    assert "restitution = 0.9" in advice.cure
    assert 'impact = "sequence"' in advice.cure
    with pytest.warns(
        CaromWarning, match=r"energy rose by up to 2\.6 % in a step.*can gain: by friction \(Kane\)"
    ):
        result = carom.simulate(scene)
    assert result.summary["energy"]["max_rise_relative"] == pytest.approx(
        1 / 38, rel=1e-2
    )  # of the energy after


def test_a_gain_without_friction_is_not_laid_to_friction_alone() -> None:
    """On a ceiling the law of the paper keeps the speed of the step's begin, and the way up within it."""
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"until": 0.02, "step": 1e-3, "impact": "sequence-paper"})
    scene.contact("m", "m", friction=0.0, restitution=1.0)
    scene.plane("lid", point=(0, 0, 1), normal=(0, 0, -1), material="m")
    scene.sphere("a", radius=0.01, mass=0.03, at=(0, 0, 0.9725), velocity=(0, 0, 3), material="m")
    with pytest.warns(CaromWarning, match="energy rose by up to .* and weight on ceilings; impact"):
        energy = carom.simulate(scene).summary["energy"]
    assert 0.5 < energy["max_rise"] / (0.03 * 9.8 * 1e-3 * 3) < 1


def test_the_default_law_scales_and_says_so(tmp_path: Any) -> None:
    from carom.cli.app import app

    scene = bernoulli()
    [advice] = scene.validate()
    assert "scaled down" in advice.cure
    scene.to_toml(tmp_path / "scene.toml")
    shown = CliRunner().invoke(app, ["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "run")])
    assert "(Kane)" in shown.output
    assert "restitution scaled down in 1 step" in shown.output
    assert "troubles    none" in shown.output
    assert not remarks(carom.load(tmp_path / "run"), "gained")


def test_what_is_advised_does_not_gain() -> None:
    scene = carom.example("paper/5.5_bernoulli", parameters={"mu": 0.06, "e": 0.95})
    assert [a for a in scene.validate() if "Kane" in a.cause] == []
    safe = carom.example("paper/5.5_bernoulli", parameters={"mu": 0.06, "e": 0.94})
    result = carom.simulate(safe, step=1e-4, until=0.01, impact="sequence-paper")
    assert not remarks(result, "gained")


def test_usual_scenes_get_no_such_advice() -> None:
    from carom import billiards

    table = billiards.table("9ft")
    scene = table.scene("break", until=1.0)
    table.rack(scene, 15)
    table.cue_ball(scene, at="head spot")
    for usual in (scene, carom.example("corner"), carom.example("pile"), carom.example("paper/5.6_break")):
        assert [a for a in usual.validate() if "Kane" in a.cause] == []
    assert [a for a in bernoulli(method="penalty").validate() if "Kane" in a.cause] == []


def test_a_floor_in_a_box_is_a_floor() -> None:
    scene = carom.Scene("bounce", run={"until": 1.0, "step": 1e-3})
    scene.contact("ball", "wall", friction=0.0, restitution=1.0)
    scene.box("box", low=(0, 0, 0), high=(1, 1, 1), finite=True, material="wall")
    scene.sphere("ball", radius=0.1, mass=1, at=(0.5, 0.5, 0.5), material="ball")
    assert any("each bounce loses energy" in a.cause for a in scene.validate())


def test_a_deposit_that_gains_more_than_piles_at_rest_says_so_and_its_cures_help(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The densest start of `validation/deposits/energy.py`, of fewer grains; the audit allows what the summary tells."""
    from carom.cli.app import app

    monkeypatch.syspath_prepend(str(Path(__file__).parent.parent / "validation" / "deposits"))
    scene = import_module("energy").deposit(friction=0.0, tolerance=3e-3, start=0.55, grains=220)
    result = carom.simulate(scene, out=tmp_path / "run")
    rise = result.summary["energy"]["max_rise_relative"]
    assert RISE_PILE < rise < 1e-4
    assert not remarks(result, "gained")  # no warning: it is not for every deposit
    told = f"energy rose by up to {rise:.2g} of what there is in a step, more than the 2e-06 of piles at rest"
    assert remarks(result, "unsettled")[0].startswith(told)
    assert told in " ".join(text({**result.summary, "directory": "x"}, result).split())
    checked = CliRunner().invoke(app, ["check", str(tmp_path / "run")])
    assert f"warning: {told}" in checked.stderr
    assert checked.exit_code == 0
    for cure in ({"pile_tolerance": 1e-4}, {"step": 5e-4}):
        assert carom.simulate(scene, **cure).summary["energy"]["max_rise_relative"] < 0.6 * rise
