"""Impact sequences that are cut short lose restitution: a run in which most were says so first, wherever it is read."""

from __future__ import annotations

import json
import re
from pathlib import Path

import carom
import numpy as np
import pytest
from carom.cut_short import MORE, cut_short
from carom.run import CaromWarning
from typer.testing import CliRunner

#: With so few problems the blow comes to rest among the balls of the cradle.
FEW = 3
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
    told = cut_short(carom.load(cut))
    assert told is not None
    most = int(re.search(r"for example to (\d+)$", told)[1])  # type: ignore[index]
    assert most == MORE * FEW
    whole = carom.simulate(carom.example("newtons_cradle"), max_problems=most)
    assert cut_short(whole) is None
    assert whole.velocity[-1][-1, 0] == pytest.approx(1.0, abs=1e-9)


def test_the_summary_begins_with_it(cut: Path, tmp_path: Path) -> None:
    from carom.cli.app import app

    carom.example("newtons_cradle").to_toml(tmp_path / "cradle.toml")
    command = ["run", str(tmp_path / "cradle.toml"), "-o", str(tmp_path / "run"), "--force"]
    few = [*command, "--set", f"max_problems={FEW}"]
    shown = CliRunner().invoke(app, few).stdout
    assert " ".join(shown.split()).startswith(f"warning {TOLD}: restitution is lost there")
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
