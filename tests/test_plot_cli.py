"""`carom plot`: what is wrong is said before anything is drawn."""

from __future__ import annotations

import csv
import os
import shlex
import subprocess
import sys
from pathlib import Path

import carom
import pytest
from carom.cli.app import app
from carom.cli.options import listed, listing
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
        (["--what", "heights,energies", "--step", "3"], "draw one of impacts, residuals"),
        (["--what", "energies", "--bodies", "only"], "bodies: no figure of energies takes it; leave it out"),
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


def test_names_with_commas_are_given_as_in_csv(tmp_path: Path) -> None:
    names = ['a,b "é"', "plain", "it's"]
    scene = carom.Scene("names", run={"until": 0.02})
    scene.contact("stone", "stone", friction=0.0, restitution=0.0)
    for k, name in enumerate(names):
        scene.sphere(name, radius=0.1, mass=1.0, material="stone", position=(k, 0, 1))
    run = carom.simulate(scene, out=tmp_path / "run").path
    [text] = shlex.split(listing(names))  # what a hint says comes back through a shell
    assert listed("--bodies", text) == names
    arguments = ["--what", "heights", "--bodies", listing(names[:1])[1:-1], "-o", str(tmp_path)]
    done = CliRunner().invoke(app, ["plot", str(run), *arguments])
    assert done.exit_code == 0, done.output
    with (tmp_path / "heights.csv").open(newline="") as file:
        assert next(csv.reader(file)) == ["time (s)", f"{names[0]} height of the centre (m)"]


def test_letters_that_the_font_lacks_are_told_in_one_line(tmp_path: Path) -> None:
    scene = carom.Scene("\U000102a0\U000102a1", run={"until": 0.02})
    scene.sphere("only", radius=0.1, mass=1.0, material="stone", position=(0, 0, 1))
    run = carom.simulate(scene, out=tmp_path / "run").path
    command = ["plot", str(run), "--what", "heights,energies,heights", "--format", "png,png"]
    done = CliRunner().invoke(app, [*command, "-o", str(tmp_path)])
    drawn = [f"{kind}.{end}" for kind in ("heights", "energies") for end in ("png", "csv")]
    assert [Path(line).name for line in done.stdout.split()] == drawn
    told = (
        "carom: warning: the font of figures has no \U000102a0 \U000102a1: there are boxes in their place\n"
    )
    assert (done.exit_code, done.stderr) == (0, told)
