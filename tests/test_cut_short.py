"""Impact sequences that are cut short end by another law: a run in which most were says so first, wherever it is read."""

from __future__ import annotations

import json
import re
from pathlib import Path

import carom
import numpy as np
import pytest
from carom import CaromWarning
from carom.result.remarks import MORE, remarks
from typer.testing import CliRunner

#: With so few problems the last three balls of the cradle share what is left of the blow.
FEW = 2
TOLD = "impact sequences were cut short in 1 of 1 steps with impacts"


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("cut") / "run"
    with pytest.warns(CaromWarning, match=TOLD):
        carom.simulate(carom.example("newtons_cradle"), max_problems=FEW, out=out)
    return out


def test_the_cure_brings_the_rebound_back(cut: Path) -> None:
    """With restitution 1 the last ball of the cradle takes all of the velocity, 1 m/s; a cut sequence leaves it a part."""
    assert np.asarray(carom.load(cut).velocity[-1])[-1, 0] < 0.9
    [told] = remarks(carom.load(cut), "cut_short")
    most = int(re.search(r"for example to (\d+);.* take 20 times as long$", told)[1])  # type: ignore[index]
    assert most == MORE * FEW
    whole = carom.simulate(carom.example("newtons_cradle"), max_problems=most)
    assert not remarks(whole, "cut_short")
    assert whole.velocity[-1][-1, 0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("count", [60, 150])
def test_a_long_cradle_is_not_cut_by_default(count: int) -> None:
    """A blow passes through it in as many problems as it has contacts: one ball comes, one ball goes with its speed."""
    r = 0.01
    scene = carom.Scene("a long cradle", run={"until": 0.05, "step": 1e-3})
    scene.contact("steel", "steel", friction=0.0, restitution=1.0)
    scene.sphere("comes", radius=r, mass=0.1, at=(-0.03, 0, 0), velocity=(0.5, 0, 0), material="steel")
    for k in range(count):
        scene.sphere(f"ball{k}", radius=r, mass=0.1, at=(2 * r * k, 0, 0), material="steel")
    result = carom.simulate(scene)
    assert not result.steps["truncated"].any()
    assert result.steps["impact_problems"].max() >= count
    last = np.asarray(result.velocity[-1])[:, 0]
    assert last[-1] == pytest.approx(0.5, abs=1e-9)
    assert np.abs(last[:-1]).max() < 1e-9


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
def test_a_ball_that_falls_on_a_column_leaves_it() -> None:
    """Without losses the blow runs down the column and up again; cut after 50 problems it leaves with 30 %."""
    r = 0.01
    scene = carom.Scene("a column", gravity=(0, 0, -9.8), run={"until": 0.05, "step": 1e-4})
    scene.contact("steel", "steel", friction=0.0, restitution=1.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
    for k in range(30):
        scene.sphere(f"ball{k}", radius=r, mass=0.1, at=(0, 0, r + 2 * r * k), material="steel")
    scene.sphere(
        "falls", radius=r, mass=0.1, at=(0, 0, 61 * r + 0.005), velocity=(0, 0, -1), material="steel"
    )
    arrives = np.sqrt(1.0 + 2 * 9.8 * 0.005)
    for most, least, greatest in ((50, 0.25, 0.35), (0, 0.99, 1.0)):
        result = carom.simulate(scene, max_problems=most)
        leaves = np.asarray(result["falls"].velocity)[:, 2].max()
        assert least * arrives <= leaves <= greatest * arrives, most


def test_the_summary_begins_with_it(cut: Path, tmp_path: Path) -> None:
    from carom.cli.app import app

    carom.example("newtons_cradle").to_toml(tmp_path / "cradle.toml")
    command = ["run", str(tmp_path / "cradle.toml"), "-o", str(tmp_path / "run"), "--force"]
    few = [*command, "--set", f"max_problems={FEW}"]
    shown = CliRunner().invoke(app, few).stdout
    assert " ".join(shown.split()).startswith(f"warning {TOLD}: what still closed there")
    assert max(map(len, shown.splitlines()[:3])) <= 100
    assert f"warning: {TOLD}" in CliRunner().invoke(app, [*few, "--quiet"]).stderr
    [warning] = json.loads(CliRunner().invoke(app, [*few, "--json"]).stdout)["warnings"]
    assert warning.startswith(TOLD)
    assert "warning" not in CliRunner().invoke(app, command).output


def test_the_audit_says_it_once(cut: Path) -> None:
    from carom.cli.app import app

    told = CliRunner().invoke(app, ["check", str(cut)]).stderr
    assert told.startswith(f"carom: warning: {TOLD}")
    assert told.count("warning") == 1


def test_page_and_notebook_begin_with_it(cut: Path, tmp_path: Path) -> None:
    result = carom.load(cut)
    assert result.view(tmp_path / "view.html").notes[0].startswith(TOLD.capitalize())
    assert f"warning</th><td>{TOLD}" in result._repr_html_()
