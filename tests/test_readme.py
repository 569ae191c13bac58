"""What README.md shows works as it is printed there."""

import contextlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from carom.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def run(arguments: list[str], folder: Path) -> str:
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_python_example(tmp_path: Path) -> None:
    [program] = re.findall(r"```python\n(.*?)```", README, re.S)
    outcome, velocity = run([sys.executable, "-c", program], tmp_path).splitlines()[:2]
    assert outcome == "done"
    # Sliding friction acts until the ball rolls: 5/7 of the speed for a homogeneous ball, whatever mu.
    numbers = [float(x) for x in velocity.strip("[]").split()]
    assert numbers == pytest.approx([1.8 * 5 / 7, 0.0, 0.0], abs=1e-8)


def test_the_commands(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="carom plot needs matplotlib")
    commands = [line.split("#")[0].strip() for line in README.splitlines() if line.startswith("    carom ")]
    assert len(commands) >= 6
    for command in commands:
        with contextlib.chdir(tmp_path), pytest.raises(SystemExit) as left:
            main([argument for argument in shlex.split(command)[1:] if argument != "--open"])
        assert not left.value.code, command
    made = tmp_path / "runs" / "three_balls-1"
    assert {"run.json", "scenario.toml", "results.h5", "view.html", "plots"} <= {
        path.name for path in made.iterdir()
    }
