"""Advice before a run, and what to cite for it."""

from __future__ import annotations

from pathlib import Path

import carom
import pytest
from carom.citing import SOURCES, sources
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


@pytest.mark.parametrize(
    ("layers", "tolerance", "told"), [(4, 1e-7, True), (3, 1e-7, False), (4, 1e-4, False)]
)
def test_a_pile_is_told_which_tolerance_suits_its_size(layers: int, tolerance: float, told: bool) -> None:
    """From 100 balls on; `carom.scenario.advice.MANY_BALLS` has the times that were measured."""
    scene = carom.Scene(run={"until": 1, "step": 1e-3, "pile_tolerance": tolerance})
    scene.contact("grain", "grain", friction=0.5, restitution=0)
    scene.lattice(
        "g",
        material="grain",
        radius=0.01,
        density=2500,
        counts=(5, 5, layers),
        origin=(0, 0, 0),
        spacing=0.03,
    )
    found = [advice for advice in scene.validate() if advice.key == "run.pile_tolerance"]
    assert bool(found) is told
    assert all("pile_tolerance = 0.0001" in str(advice) for advice in found)


def test_large_results_are_announced() -> None:
    """250 bytes a step: the table of steps has a row for each, whatever `every` is."""
    scene = drop(height=1.0, until=1e5)
    scene.world.gravity = (0.0, 0.0, 0.0)
    [advice] = [a for a in scene.validate() if "GB" in a.cause]
    assert "1e+08 steps write about 25 GB" in advice.cause
    [advice] = [a for a in scene.with_options(until=1e4, every=1).validate() if "GB" in a.cause]
    assert advice.key == "every"
