"""What a run says of itself at its end in Python, as the command line says it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromWarning, RunFailed, audit
from carom.cli.app import app
from carom.result.remarks import remarks
from typer.testing import CliRunner

RADIUS = 0.02


def tube(motion: Any = None, **run: Any) -> carom.Scene:
    """A ball that runs round in a tube with ends, into whose wall it sinks by method moreau."""
    scene = carom.Scene(
        gravity=(0, 0, -9.8), run={"step": 2e-3, "until": 0.8, "method": "moreau", "impact": "sequence"} | run
    )
    scene.contact("b", "w", friction=2.0, restitution=0.0)
    given = {} if motion is None else {"motion": motion}
    scene.cylinder("tube", point=(0, 0, 0), axis=(0, 0, 1), radius=0.3, length=20.0, material="w", **given)
    spin = (5, 0, ((0.6 if motion else 0.0) - 3.36) / RADIUS)
    at = (0.3 - RADIUS, 0, 0)
    scene.sphere(
        "b", radius=RADIUS, mass=0.1, at=at, velocity=(0, 3.36, 0), angular_velocity=spin, material="b"
    )
    return scene


def test_a_ball_that_sinks_into_a_wall_is_told_of() -> None:
    with pytest.warns(
        CaromWarning, match="overlapped by up to .* can pass through it: position_projection = true"
    ):
        result = carom.simulate(tube())
    assert np.hypot(*result["b"].position[-1, :2]) > 0.4  # it went out
    assert not [
        told for told in remarks(carom.simulate(tube(position_projection=True))) if "overlapped" in told
    ]
    assert not remarks(carom.simulate(tube(method="nsga")))


@pytest.mark.parametrize("step", [2e-3, 5e-4])
def test_a_run_that_stops_there_names_the_cure_too(step: float) -> None:
    """It said: take a step of 3.1e-3 s or less."""
    turning = {"surface_rotation": {"axis": (0, 0, 1), "rate": 2.0}}
    with pytest.raises(RunFailed) as stopped:
        carom.simulate(tube(turning, until=3.0, step=step))
    said = str(stopped.value)
    assert "between b and tube (its centre has sunk into it); method = " in said
    assert "step of" not in said
    [note] = [note for note in stopped.value.__notes__ if "overlapped" in note]
    assert "can pass through it: position_projection = true" in note


def test_hits_of_long_steps_by_method_moreau_are_told_of_from_a_tenth_of_a_radius() -> None:
    def told(step: float) -> list[str]:
        scene = carom.Scene(gravity=(0, 0, 0), run={"step": step, "until": 0.1, "method": "moreau"})
        scene.contact("b", "b", friction=0.0, restitution=0.0)
        scene.sphere("a", radius=RADIUS, mass=0.1, at=(0, 0, 0), velocity=(1, 0, 0), material="b")
        scene.sphere("b", radius=RADIUS, mass=0.1, at=(0.065, 0, 0), velocity=(-1, 0, 0), material="b")
        return remarks(carom.simulate(scene))

    assert not told(1e-3)  # 0.05 radii a step each
    [said] = told(4e-3)
    assert "which rigid ones cannot: position_projection = true" in said


def grazing(step: float) -> carom.Scene:
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": step, "until": 0.2})
    scene.contact("b", "b", friction=0.0, restitution=0.9)
    scene.sphere("a", radius=RADIUS, mass=0.1, at=(-0.0445, 0.0385, 0), velocity=(1, 0, 0), material="b")
    scene.sphere("b", radius=RADIUS, mass=0.1, at=(0, 0, 0), material="b")
    return scene


def test_missed_impacts_are_told_in_python_as_by_the_audit() -> None:
    with pytest.warns(CaromWarning, match="1 impact missed in 1 step, .*: shorten step"):
        result = carom.simulate(grazing(1.5e-2))
    [told] = remarks(result)
    assert told in audit.check(result).warnings
    assert not remarks(carom.simulate(grazing(1e-4)))


def test_a_run_with_a_python_load_that_gained_energy_is_judged_without_the_function(tmp_path: Path) -> None:
    """The remark looks for walls that jump in the scene of the run, whose file holds no function."""
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"step": 2e-2, "until": 0.6})
    scene.contact("b", "b", friction=0.0, restitution=0.0)
    scene.sphere("b", radius=RADIUS, mass=0.1, at=(RADIUS, 0, 0), material="b")
    scene.joint("ball", between=["b", "ground"], point=(0, 0, 0))
    scene.load_function(lambda t, x, v, w: np.hstack([-0.05 * v, 0 * v]), name="air")
    with pytest.warns(CaromWarning, match="energy rose"):
        result = carom.simulate(scene)
    [told] = remarks(result, "gained")
    assert told in audit.check(result).warnings
    result.save(tmp_path / "run")
    assert remarks(carom.load(tmp_path / "run"), "gained") == [told]
    ended = {name: CliRunner().invoke(app, [name, str(tmp_path / "run")]) for name in ("check", "info")}
    assert [result.exit_code for result in ended.values()] == [0, 0]
    assert "energy rose" in ended["check"].output


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("held", ["hangs", "truss", "sprung"])
def test_what_rests_under_loads_alone_says_nothing(method: str, held: str) -> None:
    """Its motion is rounding, over which every number is large."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"step": 1e-3, "until": 0.5})
    scene.contact("b", "b", friction=0.3, restitution=0.0)
    scene.sphere("a", material="b", radius=0.005, mass=0.1, at=(0.06, 0, 0))
    scene.load("a", force=(0.1, 0, -100))
    if held == "sprung":
        scene.spring("a", "ground", points=((0.06, 0, 0), (0.06, 0, 1)), stiffness=1e3, rest_length=0.9)
        scene.plane("floor", material="b", point=(0, 0, -0.005), normal=(0, 0, 1))
        scene.joint("rod", between=("a", "ground"), points=((0.06, 0, 0), (0, 0, 0)))
    else:
        scene.joint("rod", between=("a", "ground"), points=((0.06, 0, 0), (0, 0, 0.08)))
        scene.joint("plane", body="a", normal=(0, 1, 0))
    if held == "hangs":
        scene.plane("wall", material="b", point=(0.055, 0, 0), normal=(1, 0, 0))
    elif held == "truss":
        scene.joint("rod", between=("a", "ground"), points=((0.06, 0, 0), (1, 0, 0.08)))
    result = carom.simulate(scene, method=method)
    assert result["a"].position[-1] == pytest.approx(result["a"].position[0], abs=1e-9)
    assert result.summary["energy"]["max_rise_relative"] < 1e-12
    assert not remarks(result)
    assert audit.check(result).ok


@pytest.mark.parametrize(("method", "part"), [("nsga", 0.4), ("moreau", 0.625)])
def test_a_rod_and_a_wall_share_a_load_to_second_order_in_the_step(method: str, part: float) -> None:
    """The law that the page of limits states, for a rod of l = 0.1 m whose slope has the sides 3, 4 and 5."""
    for load, step in ((1.0, 1e-3), (100.0, 1e-3), (100.0, 5e-4)):
        scene = carom.Scene(gravity=(0, 0, 0), run={"step": step, "until": 0.1})
        scene.contact("b", "b", friction=0.0, restitution=0.0)
        scene.sphere("a", material="b", radius=0.005, mass=0.1, at=(0.06, 0, 0))
        scene.load("a", force=(0, 0, -load))
        scene.joint("rod", between=("a", "ground"), points=((0.06, 0, 0), (0, 0, 0.08)))
        scene.joint("plane", body="a", normal=(0, 1, 0))
        scene.plane("wall", material="b", point=(0.055, 0, 0), normal=(1, 0, 0))
        result = carom.simulate(scene, method=method, walls=True, every=1)
        short = 1.0 - result.walls["wall"].force[-1, 0] / (-0.75 * load)
        assert short == pytest.approx(part * load / 0.1 * step**2 / 0.1, rel=0.01)
        assert result["a"].position[-1] == pytest.approx(result["a"].position[0], abs=1e-11)
