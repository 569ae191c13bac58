"""`carom plot`: what is wrong is said before anything is drawn."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import carom
import pytest
from carom.cli.app import app
from typer.testing import CliRunner

pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scene = carom.Scene("free fall", run={"until": 0.02})
    scene.sphere("only", radius=0.1, mass=1.0, material="stone", position=(0, 0, 1))
    return Path(carom.simulate(scene, out=tmp_path_factory.mktemp("plot") / "run").path)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--what", "heights,heigths"], "no plot is called 'heigths'; did you mean heights?"),
        (["--what", "all", "--step", "99999999"], "the run has no step 99999999; give one from 1 to 20"),
        (["--what", "heights", "--format", "png,svgg"], "no format is called 'svgg'; did you mean svg?"),
    ],
)
def test_a_wrong_name_leaves_nothing_half_drawn(
    arguments: list[str], told: str, run: Path, tmp_path: Path
) -> None:
    done = CliRunner().invoke(app, ["plot", str(run), *arguments, "-o", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert told in done.stderr
    assert not (tmp_path / "out").exists()


def test_spaces_after_commas_do_no_harm(run: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["plot", str(run), "--what", "heights, energies", "--format", "png, svg", "-o", str(tmp_path)]
    )
    assert done.exit_code == 0, done.output
    expected = {f"{kind}.{end}" for kind in ("heights", "energies") for end in ("png", "svg", "csv")}
    assert {file.name for file in tmp_path.iterdir()} == expected


def test_figures_that_a_step_has_not_are_named(tmp_path: Path) -> None:
    run = carom.simulate(carom.example("three_balls"), out=tmp_path / "run", until=0.2)
    quiet = next(step for step in range(1, 200) if step not in set(run.impacts["step"]))
    done = CliRunner().invoke(
        app, ["plot", str(run.path), "--step", str(quiet), "-o", str(tmp_path / "figures")]
    )
    assert done.exit_code == 0, done.output
    assert f"step {quiet} has no impacts: no such figure" in done.stderr


def test_a_wrong_backend_is_no_error_of_carom(run: Path, tmp_path: Path) -> None:
    """Matplotlib reads it when it is imported, so this needs a process of its own."""
    command = [sys.executable, "-m", "carom", "plot", str(run), "-o", str(tmp_path / "out")]
    environment = os.environ | {"MPLBACKEND": "nope"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("carom: matplotlib does not start (")
    assert done.stderr.endswith("); unset MPLBACKEND, or mend it\n")
