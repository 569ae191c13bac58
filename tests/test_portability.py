"""Carom on systems that are not Linux, as far as this one can act them: same numbers, no traceback."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import carom
import numpy as np
import pytest

ACTOR = Path(__file__).with_name("other_systems.py")
STUDY = """
format = 1
title = "speeds"
scenario = "three_balls.toml"

[parameters]
speed = { values = [1.0, 1.5] }

[set]
"first.velocity.x" = "= speed"
"""


def there(folder: Path, *command: str) -> str:
    done = subprocess.run(
        [sys.executable, str(ACTOR), *command], cwd=folder, capture_output=True, text=True, check=False
    )
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of three balls that was made on the other system."""
    path = tmp_path_factory.mktemp("there")
    there(path, "examples", "copy", "three_balls")
    there(path, "run", "three_balls.toml", "-o", "run", "-q")
    return path


def test_the_other_system_is_another_one(tmp_path: Path) -> None:
    """What is taken away is gone, and an open file cannot be moved."""
    program = (
        "import other_systems as o; o.become_another_system()\nimport os\nassert not hasattr(os, 'memfd_create')\n"
        "try: import fcntl\nexcept ImportError: pass\nelse: raise SystemExit('fcntl')\n"
        "f = open('a', 'w')\ntry: os.replace('a', 'b')\nexcept PermissionError: f.close(); os.replace('a', 'b')\n"
        "else: raise SystemExit('moved')\n"
    )
    path = {"PYTHONPATH": str(ACTOR.parent)}
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, env=path, check=True)
    assert (tmp_path / "b").exists()


def test_a_run_has_the_same_numbers(folder: Path, tmp_path: Path) -> None:
    here = carom.simulate(folder / "three_balls.toml", out=tmp_path / "run")
    run = carom.load(folder / "run")
    for name in ("time", "position", "velocity", "angular_velocity", "orientation"):
        assert np.array_equal(getattr(run, name), getattr(here, name)), name
    assert not list((folder / "run").glob(".*.tmp"))


def test_a_finished_run_is_extended(folder: Path) -> None:
    there(folder, "run", "three_balls.toml", "-o", "more", "-q")
    until = 1.5 * float(carom.load(folder / "more").time[-1])
    there(folder, "resume", "more", "--until", str(until), "-q")
    assert carom.load(folder / "more").time[-1] == pytest.approx(until)


@pytest.mark.parametrize(
    "command",
    [
        ["info", "run"],
        ["check", "run"],
        ["export", "run", "--format", "csv,vtkhdf,vtp"],
        ["view", "run"],
        ["compare", "three_balls.toml"],
        ["doctor"],
        ["reproduce", "5.1", "--quick", "-o", "reproduction", "-q"],
    ],
    ids=lambda command: command[0],
)
def test_commands_do_their_work(folder: Path, command: list[str]) -> None:
    assert there(folder, *command) or "-q" in command


@pytest.mark.skipif(
    not (find_spec("pyarrow") and find_spec("scipy")), reason="the extra [cluster] is not installed"
)
def test_a_study_runs(folder: Path) -> None:
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    there(folder, "sweep", "study.toml", "-o", "sweep", "--workers", "0", "-q", "--no-plots")
    assert list((folder / "sweep" / "parts").glob("*.parquet"))
