"""Advice before a run, and what to cite for it."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import carom
import pytest
from carom.reproduce.citations import SOURCES, sources
from carom.scene.plan import whole_steps
from typer.testing import CliRunner

ROOT = Path(__file__).parent.parent


def drop(height: float, until: float = 2.0, **run: float | str) -> carom.Scene:
    scene = carom.Scene("drop", gravity=(0, 0, -10.0), run={"until": until, "step": 1e-3, **run})
    scene.sphere("ball", radius=0.01, mass=1.0, at=(0, 0, 0.01 + height), material="m")
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    return scene


def test_falls_are_foreseen() -> None:
    assert drop(height=1.0).validate() == []  # sqrt(20) m/s: 0.45 radii
    [advice] = drop(height=5.0).validate()  # 10 m/s: 1 radius
    assert "falling, 'ball' reaches 10 m/s at 'floor'" in advice.cause.replace('"', "'")
    assert "1 radii" in advice.cause
    assert advice.cure == "step = 0.0005 is safe"
    assert drop(height=5.0).with_options(step=5e-4).validate() == []
    assert drop(height=5.0, until=0.9).validate() == []  # it does not get there
    assert drop(height=5.0, method="penalty").validate() == []


@pytest.mark.parametrize(
    ("joint", "falls"),
    [
        ({"type": "fix", "body": "ball"}, False),
        ({"type": "rod", "between": ("ball", "ground"), "points": ((0, 0, 5), (0, 0, 6))}, False),
        ({"type": "rod", "between": ("ball", "ground"), "points": ((0, 0, 5), (0, 4, 2))}, True),
        ({"type": "rod", "between": ("ball", "held")}, False),
        ({"type": "rod", "between": ("ball", "free")}, True),
        (
            {
                "type": "motion",
                "body": "ball",
                "direction": (0, 0, 1),
                "displacement": {"expression": "0.01*t^2"},
            },
            False,
        ),
        ({"type": "plane", "body": "ball", "normal": (0, 1, 0)}, True),
        ({"type": "plane", "body": "ball", "normal": (0, 1, 1)}, False),
        ({"type": "line", "body": "ball", "direction": (0, 0, 1)}, True),
        ({"type": "lock", "body": "ball"}, True),
        ({"points": ((0, 0, 5), (0, 0, 6)), "stiffness": 100.0}, False),
        ({"points": ((0, 0, 5), (0, 0, 6)), "stiffness": 1e-3}, True),
        ({"points": ((0, 0, 5), (0, 0, 0)), "stiffness": 100.0, "rest_length": 0.0}, True),
        ({"points": ((0, 0, 5), (3, 0, 5)), "stiffness": 100.0, "rest_length": 20.0}, True),
    ],
)
def test_only_what_nothing_ties_to_the_ground_falls(joint: Any, falls: bool) -> None:
    scene = drop(height=5.0)
    for x, name in ((0.5, "held"), (-0.5, "free")):
        scene.sphere(name, radius=0.05, mass=1.0, at=(x, 0, 5.1), material="m")
    scene.joint("fix", body="held")
    if "stiffness" in joint:
        scene.spring("ball", "ground", **joint)
    else:
        scene.joint(joint.pop("type"), **joint)
    told = [advice.cause for advice in scene.validate() if 'falling, "ball"' in advice.cause]
    assert bool(told) == falls


@pytest.mark.parametrize(("hole", "told"), [(0.0099, True), (0.01, False), (None, False)])
def test_holes_that_a_ball_does_not_pass_are_named(hole: float | None, told: bool) -> None:
    scene = drop(height=1.0)
    scene.plane("disc", point=(0, 0, 0.2), normal=(0, 0, 1), radius=0.1, hole=hole, material="m")
    assert ["do not pass the hole" in advice.cause for advice in scene.validate()] == [True] * told


@pytest.mark.parametrize("height", [0.6, 2.0, 5.0])
@pytest.mark.parametrize("step", [0.02, 0.1])
@pytest.mark.parametrize("balls", [1, 2])
def test_the_step_that_is_called_safe_is_not_warned_of(height: float, step: float, balls: int) -> None:
    """Each of three rules named its own step; only the first was heard."""
    scene = drop(height=height, step=step)
    if balls == 2:
        scene.sphere("other", radius=0.02, mass=1.0, at=(1, 0, 0.02), velocity=(0.9, 0, 0), material="m")
    (cure,) = (a.cure for a in scene.validate() if "is safe" in a.cure)
    safe = float(cure.split()[2])
    assert not [a for a in scene.with_options(step=safe).validate() if "is safe" in a.cure]


@pytest.mark.parametrize(
    ("until", "steps"), [(0.0101, 11), (0.0109, 11), (0.001, 1), (0.00101, 2), (0.3, 300)]
)
def test_the_announced_end_is_that_of_the_run(until: float, steps: int) -> None:
    """The warning rounded to the nearest step, the run up."""
    scene = drop(height=1.0, until=until)
    told = [advice.cure for advice in scene.validate()]
    assert told == ([f"the run ends at {steps * 1e-3:.10g} s"] if steps * 1e-3 > until else [])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        assert carom.simulate(scene).outcome.step == steps
    assert f"{steps} step" in repr(scene)


def test_less_than_a_step_is_refused_and_rounding_adds_none() -> None:
    with pytest.raises(carom.ScenarioError, match="shorter than one step"):
        drop(height=1.0, until=0.0009).validate()
    assert whole_steps(5.3, 1e-6) == 5_300_000  # 5.3 / 1e-6 is larger by 1e-9
    assert whole_steps(0.1 + 0.2, 0.1) == 3


def test_a_ball_on_another_falls_nowhere() -> None:
    scene = drop(height=0.0)
    for k in range(100):
        scene.sphere(f"b{k}", radius=0.05, mass=1.0, at=(0, 0, 0.07 + 0.1 * k), material="m")
    assert not [a for a in scene.validate() if "falling" in a.cause]


def test_what_to_cite_is_what_is_used() -> None:
    scene = drop(1.0)
    assert list(sources(scene)) == ["method", "nsga", "newton", "sequence"]
    assert "moreau" in sources(scene.with_options(method="moreau", impact="one-shot"))
    assert "sequence" not in sources(scene.with_options(impact="one-shot"))
    assert list(sources(scene.with_options(method="penalty"))) == ["method", "penalty"]
    assert "rolling" in sources(carom.Scene.from_toml(ROOT / "scenarios/paper/5.6_break_rolling.toml"))
    assert sources() == SOURCES


def test_cite_of_a_run(tmp_path: Path) -> None:
    from carom.cli.app import app

    carom.simulate(drop(0.01), until=0.01, method="moreau", out=tmp_path / "run")
    for path in (tmp_path / "run", tmp_path / "run" / "scenario.toml"):
        shown = CliRunner().invoke(app, ["cite", str(path)])
        assert shown.exit_code == 0
        assert "Moreau, Unilateral" in shown.output
        assert "Bruels, V. Acary" not in shown.output
    missing = CliRunner().invoke(app, ["cite", str(tmp_path / "nothing.toml")])
    assert missing.exit_code == 2


@pytest.mark.parametrize("path", sorted((ROOT / "scenarios" / "paper").glob("*.toml")), ids=lambda p: p.stem)
def test_nothing_falls_too_fast_in_the_paper(path: Path) -> None:
    scene = carom.Scene.from_toml(path)
    assert not [advice for advice in scene.validate() if "falling" in advice.cause]


def grains(tolerance: float = 1e-7, floor: bool = True, **lattice: Any) -> carom.Scene:
    """100 grains of 0.01 m in four layers."""
    scene = carom.Scene(run={"until": 1, "step": 1e-3, "pile_tolerance": tolerance})
    scene.contact("grain", "grain", friction=0.5, restitution=0)
    if floor:
        scene.plane("floor", point=(0, 0, -0.02), normal=(0, 0, 1), material="grain")
    given = {"counts": (5, 5, 4), "origin": (0, 0, 0), "spacing": 0.03, **lattice}
    if min(given["counts"]):
        scene.lattice("g", material="grain", radius=0.01, density=2500, **given)
    return scene


def told_of_piles(scene: carom.Scene) -> list[str]:
    return [str(advice) for advice in scene.validate() if advice.key == "run.pile_tolerance"]


@pytest.mark.parametrize(
    ("layers", "tolerance", "told"), [(4, 1e-7, True), (3, 1e-7, False), (4, 1e-4, False)]
)
def test_a_pile_is_told_which_tolerance_suits_its_size(layers: int, tolerance: float, told: bool) -> None:
    """From 100 balls on; `carom.scene.checks.piles.MANY_BALLS` has the times that were measured."""
    found = told_of_piles(grains(tolerance, counts=(5, 5, layers)))
    assert bool(found) is told
    assert all("100 balls under gravity" in advice for advice in found)
    assert all("10 to 200 times as long as 0.0001" in advice for advice in found)
    assert all("pile_tolerance = 0.0001" in advice for advice in found)


@pytest.mark.parametrize("tolerance", [1e-7, 1e-4])
def test_a_pile_is_told_of_the_printed_position_level(tolerance: float) -> None:
    scene = grains(tolerance)
    [once, paper] = (
        {advice.key.removeprefix("run.") for advice in scene.with_options(position_friction=word).validate()}
        for word in ("once", "paper")
    )
    assert "position_friction" not in once
    assert paper == once | {"position_friction"}
    assert ("pile_tolerance" in paper) is (tolerance < 1e-5)


@pytest.mark.parametrize(
    ("rate", "start", "count", "told"),
    [
        (0.0, 0.0, 200, 200),
        (150.0, 0.0, 200, 151),
        (50.0, 0.0, 200, 0),
        (0.0, 2.0, 200, 0),
        (0.0, 0.0, 90, 0),
    ],
)
def test_balls_of_inflows_count_for_a_pile_if_they_come(
    rate: float, start: float, count: int, told: int
) -> None:
    scene = grains(counts=(1, 1, 1), origin=(1.0, 0, 0))
    region = {"low": (0, 0, 0.5), "high": (0.1, 0.1, 0.5)}
    size = {"radius": 0.01, "density": 2500, "count": count}
    scene.inflow("in", material="grain", region=region, rate=rate, start=start, seed=1, **size)
    found = told_of_piles(scene)
    assert bool(found) is bool(told)
    assert all(f"{told + 1} balls, {told} of them by inflows, under gravity" in advice for advice in found)


def test_a_packing_counts_for_a_pile() -> None:
    scene = grains(counts=(0, 0, 0))
    box = {"low": (0, 0, 0), "high": (0.15, 0.15, 0.3)}
    scene.packing("p", material="grain", diameter=0.02, density=2500, count=120, seed=1, **box)
    [found] = told_of_piles(scene)
    assert "120 balls under gravity" in found


def test_balls_that_never_touch_in_numbers_make_no_pile() -> None:
    assert not told_of_piles(grains(floor=False))  # they fall for ever
    assert not told_of_piles(grains(counts=(10, 10, 1), spacing=0.05))  # side by side on the floor
    assert not told_of_piles(grains(counts=(10, 10, 1), spacing=0.05, velocity=(0, 0, -1.0)))
    assert told_of_piles(grains(counts=(10, 10, 1), spacing=0.021))
    far = grains()  # one that lies far away says nothing of the others
    far.sphere("far", radius=0.01, density=2500, at=(50.0, 0, 0), material="grain")
    assert told_of_piles(far)
    funnel = grains(counts=(10, 10, 1), spacing=0.05, origin=(-0.225, -0.225, 0.3))
    funnel.cone(
        "funnel", point=(0, 0, 0), axis=(0, 0, 1), radius=0.02, radius_end=0.5, length=0.2, material="grain"
    )
    assert told_of_piles(funnel)  # which brings them together


def test_options_that_the_method_does_not_read() -> None:
    [advice] = drop(0.1).with_options(theta=0.7).validate()
    assert advice.cause == "method nsga does not read it"
    assert 'method = "moreau"' in advice.cure
    assert drop(0.1).with_options(theta=0.7, method="moreau").validate() == []


@pytest.mark.parametrize(
    ("law", "told"), [("floor(2*t)", "jumps by 1 m at t = 0.5 s"), ("0.1*sin(20*t)^2", None)]
)
def test_a_law_of_a_joint_that_jumps(law: str, told: str | None) -> None:
    scene = drop(0.1, until=0.8)
    scene.sphere("racket", radius=0.05, mass=1, at=(1, 0, 1), material="m")
    scene.joint("motion", body="racket", direction=(1, 0, 0), displacement={"expression": law})
    found = [advice.cause for advice in scene.validate()]
    assert any(told in cause for cause in found) if told else found == []


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"direction": (1, 0, 0), "displacement": "10*t^2"},
            "changes by 0.8 radii of the smallest ball in",
        ),
        ({"direction": (1, 0, 0), "displacement": "5*t^2"}, None),
        ({"axis": (0, 0, 1), "angle": "1e6*t^2"}, "changes by 8e+02 rad in a step of 0.001 s"),
    ],
)
def test_a_law_of_a_joint_that_is_fast(given: dict[str, Any], told: str | None) -> None:
    """10 t^2 at t = 0.4 s is 8 m/s, 8 mm in a step of 1 ms; the smallest ball has a radius of 10 mm."""
    scene = drop(0.1, until=0.4)
    scene.run.step = 1e-3
    scene.sphere("racket", radius=0.05, mass=1, at=(1, 0, 1), material="m")
    laws = {key: {"expression": of} if isinstance(of, str) else of for key, of in given.items()}
    scene.joint("motion", body="racket", **laws)
    found = [advice.cause for advice in scene.validate() if "joint" in str(advice)]
    assert (told in found[0] and len(found) == 1) if told else found == []
