"""`carom check` of scenarios: what only the core knows is asked of it, in every case of a file."""

from __future__ import annotations

import re
from pathlib import Path

import carom
import pytest
from test_cli import cli


@pytest.mark.parametrize(
    ("command", "method"), [("check", "penalty"), ("check", "events"), ("run", "events")]
)
def test_what_a_method_cannot_do_is_an_error_of_the_scenario(
    command: str, method: str, tmp_path: Path
) -> None:
    cli("examples", "copy", "three_balls", cwd=tmp_path)
    file = tmp_path / "three_balls.toml"
    name = carom.Scene.from_toml(file).names[-1]
    file.write_text(file.read_text() + f'\n[[joint]]\ntype = "fix"\nbody = "{name}"\n')
    done = cli(command, file.name, "--set", f"run.method={method}", cwd=tmp_path, code=2)
    assert re.search(rf"method {method} (knows no|does not know) joints; choose nsga", done.stderr)


def test_the_check_names_all_cases_that_the_scene_or_the_core_refuses(tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(
        """format = 1
run = { until = 1.0, method = "events" }
parameters = { x = 0.0, r = 0.01 }
case = [{ name = "far", x = 1e7 }, { name = "flat", r = 0.0 }]
contact = [{ between = ["m", "m"], friction = 0.1, restitution = 0.5 }]
material = [{ name = "m" }]
sphere = [{ name = "a", material = "m", radius = "= r", mass = 1, position = ["= x", 0, 0] }]
[world]
gravity = [0, 0, 0]
"""
    )
    said = cli("check", "ball.toml", cwd=tmp_path, code=2).stderr
    assert re.search(r'ball.toml.*case "far".*option method events knows places', said)
    assert re.search(r'ball.toml.*case "flat".*radius', said)
