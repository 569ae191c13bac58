"""Good inputs, made anew by the Carom at hand: what the mutations begin with."""

from __future__ import annotations

from pathlib import Path

import carom
from carom.run import checkpoint
from carom.scene.shipped import shipped

#: Name of the run in the folder of material, and the files of it that a case may stand for: by their numbers.
RUN = "run"
FILES = ("results.h5", "run.json", "scenario.toml", checkpoint.name(30))

#: Two balls that hit one another on a floor: contacts, impacts, residuals and checkpoints in 30 steps.
SCENE = """\
format = 1
title = "two balls"
[run]
until = 0.03
step = 1e-3
[record]
every = 5
contacts = true
[world]
gravity = [0.0, 0.0, -9.8]
[[material]]
name = "m"
[[contact]]
between = ["m", "m"]
friction = 0.3
restitution = 0.5
rolling_radius = 1e-3
spinning_radius = 1e-3
[[sphere]]
name = "a"
material = "m"
radius = 0.1
mass = 1.0
position = [0.0, 0.0, 0.1]
velocity = [1.0, 0.0, 0.0]
[[sphere]]
name = "b"
material = "m"
radius = 0.1
mass = 1.0
position = [0.21, 0.0, 0.1]
[[plane]]
name = "floor"
material = "m"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
"""


def make(folder: Path) -> Path:
    """A folder with a run whose contact problems were kept, in both forms."""
    for form in ("local", "global"):
        name = RUN if form == "local" else "other"
        scene = carom.Scene.from_toml(SCENE)
        carom.simulate(scene, out=folder / name, save_problems="9:12,worst:2", problem_form=form).close()
    return folder


def scenarios() -> list[bytes]:
    """All scenarios that come with Carom, and the one above."""
    return [SCENE.encode(), *(path.read_bytes() for path in shipped().values())]


def problems(folder: Path) -> list[bytes]:
    """Files of contact problems, the smallest first."""
    found = [path.read_bytes() for name in (RUN, "other") for path in (folder / name).glob("problems/*.hdf5")]
    return sorted(found, key=len)
