"""When checkpoints are written, and that a run in two parts is the run in one: every method, any number of threads."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import carom
import kill_scenes
import numpy as np
import pytest
from carom import CaromError, ScenarioError
from carom.run import checkpoint
from carom.run.sinks import Cadence
from kill_harness import differences, recorded


def saved(run: Path) -> list[int]:
    """Steps of all checkpoints that were written, in their order."""
    lines = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    return [line["step"] for line in lines if line["event"] == "checkpoint"]


def ball(**options: Any) -> carom.Scene:
    """One ball in free fall."""
    scene = carom.Scene("fall", gravity=(0, 0, -9.8), run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    scene.sphere("a", radius=0.05, mass=0.1, material="m", position=(0, 0, 1))
    return scene.with_options(**options)


# --- when -----------------------------------------------------------------------------------------------------------


def test_by_steps(tmp_path: Path) -> None:
    carom.simulate(ball(), checkpoint_steps=30, out=tmp_path / "run")
    assert saved(tmp_path / "run") == [30, 60, 90, 100]  # and the end
    assert [path.name for path in checkpoint.found(tmp_path / "run")] == [
        checkpoint.name(100),
        checkpoint.name(90),
    ]


def test_by_simulated_time(tmp_path: Path) -> None:
    carom.simulate(ball(), checkpoint_time="25.5 ms", out=tmp_path / "run")
    assert saved(tmp_path / "run") == [26, 51, 77, 100]  # the first steps at or after 25.5, 51, 76.5 ms


def test_by_wall_time(tmp_path: Path) -> None:
    scene = ball(until=6.0, step=1e-5, checkpoint_wall=0.2)
    # On any machine: whoever watches takes longer than that each time.
    carom.simulate(scene, out=tmp_path / "run", progress=lambda now: time.sleep(0.25))
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    assert len(saved(tmp_path / "run")) >= 2
    times = [np.datetime64(line["time"][:-6]) for line in lines if line["event"] in ("start", "checkpoint")]
    assert (np.diff(times)[:-1] >= np.timedelta64(199, "ms")).all()  # the last one is that of the end


def test_steps_time_and_wall_time_go_together() -> None:
    cadence = Cadence(steps=100, time=0.03, wall=None)
    due = [cadence.next_step(0, 1e-3)]
    for _ in range(5):
        due.append(cadence.next_step(due[-1] or 0, 1e-3))
    assert due == [30, 60, 90, 100, 120, 150]
    assert (
        cadence.first_wall() == cadence.next_wall(0.1) == float("inf")
    )  # what was given replaces the default
    assert Cadence().next_step(7, 1e-3) is None
    assert Cadence().next_wall(10.0) == pytest.approx(500.0)  # 2 % of the time
    assert Cadence(wall=5.0).next_wall(10.0) == 5.0
    # Rounding neither skips a multiple nor finds it twice: 0.1 is no sum of thousandths in binary.
    tenth, step, found = Cadence(time=0.1), 0, []
    while step < 100_000:
        step = tenth.next_step(step, 1e-3) or 0
        found.append(step)
    assert found == list(range(100, 100_001, 100))
    assert Cadence(time=1e-5).next_step(7, 1e-3) == 8  # shorter than a step: every step


@pytest.mark.parametrize(
    ("key", "value", "cause"),
    [
        ("checkpoint_steps", 0, "at least 1"),
        ("checkpoint_time", "0 s", "above 0"),
        ("checkpoint_wall", -1, "above 0"),
    ],
)
def test_intervals_that_cannot_be(key: str, value: Any, cause: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        ball(**{key: value})
    assert key in str(refused.value)


def test_the_grid_does_not_shift_when_a_run_is_resumed_and_can_be_changed(tmp_path: Path) -> None:
    run = tmp_path / "run"
    carom.simulate(ball(until=0.045), checkpoint_steps=30, out=run)
    carom.resume(run, until=0.1)
    assert saved(run) == [30, 45, 60, 90, 100]
    carom.resume(run, until=0.2, checkpoint_steps=70)
    assert saved(run)[5:] == [140, 200]
    with pytest.raises(CaromError, match="cannot change within a run"):
        carom.resume(run, until=0.3, every=7)
    with pytest.raises(CaromError, match="max_problems: cannot change within a run"):  # a part of the law
        carom.resume(run, until=0.3, max_problems=20)


TERMINATED = """
import signal, sys, carom
from pathlib import Path
scene = carom.Scene.from_toml(sys.argv[1])
if len(sys.argv) > 3:
    signal.signal(signal.SIGTERM, lambda *_: print("my own handler", flush=True))
def ready(now):
    print(now.step, flush=True)
try:
    carom.simulate(scene, until=1000.0, out=sys.argv[2], progress=ready)
except KeyboardInterrupt as error:
    print(error)
"""


@pytest.mark.parametrize("own", [False, True])
def test_sigterm_of_a_script_leaves_a_checkpoint_first(own: bool, tmp_path: Path) -> None:
    """Then it does what it would have done: end the process, or what the script asked for."""
    (tmp_path / "s.toml").write_text(ball().to_toml())
    command = [
        sys.executable,
        "-c",
        TERMINATED,
        str(tmp_path / "s.toml"),
        str(tmp_path / "run"),
        *(["own"] * own),
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    os.kill(process.pid, signal.SIGTERM)
    told, _ = process.communicate(timeout=60)
    assert process.returncode == (0 if own else -signal.SIGTERM)
    assert ("my own handler" in told and "interrupted at t = " in told) == own
    kept = carom.load(tmp_path / "run")
    assert kept.outcome.kind == "interrupted"
    assert [checkpoint.load(path).step for path in checkpoint.found(tmp_path / "run")] == [kept.outcome.step]


# --- what -----------------------------------------------------------------------------------------------------------

#: Scene, and the steps at which it is cut (of those it has).
CUTS = {
    "two_balls": (1, 7001, 12_000),
    "billiard_break": (641, 650, 5003),
    "pile": (60, 75, 97),
    "joints": (33, 500, 1001),
    "walls": (20, 50, 77),
    "inflow": (102, 1201, 1500),
    "moreau": (100, 151, 300),
    "penalty": (45, 150, 211),
}


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize(
    "name",
    # Those left to the long tier are continued in two parts by test_kill.py all the same.
    [
        name if name in ("pile", "inflow", "penalty") else pytest.param(name, marks=pytest.mark.long)
        for name in CUTS
    ],
)
def test_a_run_in_parts_is_the_run_in_one(name: str, tmp_path: Path) -> None:
    """Three cuts, each part on another number of threads, checkpoints at other steps: all tables have the same bits."""
    scene = kill_scenes.SCENES[name]()
    h = scene.run.step
    until = (CUTS[name][-1] + 40) * h
    carom.simulate(scene, until=until, threads=1, out=tmp_path / "whole")
    whole = recorded(tmp_path / "whole")
    run = tmp_path / "parts"
    first, *others = CUTS[name]
    carom.simulate(scene, until=first * h, threads=2, out=run)
    for threads, steps in zip((1, 4, 3), (*others, CUTS[name][-1] + 40)):
        carom.resume(run, until=steps * h, threads=threads)
    assert not differences(recorded(run), whole, prefix=False)
    assert len(carom.load(run).segment_names) == 4
    a, b = (json.loads((path / "run.json").read_text())["summary"] for path in (run, tmp_path / "whole"))
    assert [key for key in a if a[key] != b[key]] == [
        key for key in a if key in ("wall_s", "core_s", "phases")
    ]
