"""A small study for the tests of sweeps: a ball that slides, and 16 points of speed and aim."""

from __future__ import annotations

from pathlib import Path

SCENARIO = """
format = 1
title = "slide"

[parameters]
v = 1.0
mu = 0.2

[world]
gravity = [0.0, 0.0, -9.8]

[run]
until = 0.02
step = 1e-3

[[material]]
name = "ball"
[[contact]]
between = ["ball", "ball"]
friction = "= mu"
restitution = 0.5

[[sphere]]
name = "cue"
material = "ball"
radius = 0.03
mass = 0.17
position = [0.0, 0.0, 0.03]
velocity = ["= v", 0.0, 0.0]
[[sphere]]
name = "post"
material = "ball"
radius = 0.03
mass = 0.17
position = [0.5, 0.0, 0.03]

[[plane]]
name = "bed"
material = "ball"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
"""

STUDY = """
format = 1
title = "slides"
scenario = "slide.toml"

[parameters]
speed = { low = 0.5, high = 1.5 }
aim = { low = -0.1, high = 0.1 }

[design]
kind = "sobol"
count = 16
seed = 3

[set]
"cue.velocity.x" = "= speed*cos(aim)"
"cue.velocity.y" = "= speed*sin(aim)"
"""


def written(folder: Path) -> Path:
    """The folder, with both as files."""
    (folder / "slide.toml").write_text(SCENARIO)
    (folder / "study.toml").write_text(STUDY)
    return folder
