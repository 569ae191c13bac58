"""A run that another process computes, looked at again and again: each look has all that is there, older ones stay right."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import carom
import fake_sim
import numpy as np
import pytest
from carom import CaromError
from carom.result.data import UnfinishedRun

#: Simulates 40 frames; every tenth step it says how far it is, and waits until it is told to go on.
WRITER = """
import sys
import carom
def wait(view):
    print(view.step, flush=True)
    sys.stdin.readline()
scene, path = carom.Scene.from_toml(sys.argv[1]), sys.argv[2]
carom.simulate(scene, until=0.04, out=path, checkpoint_time=0.01, callback=wait, callback_every=10)
"""


@pytest.fixture
def scene() -> carom.Scene:
    return fake_sim.hopping("ball")


def looked(path: Path) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnfinishedRun)
        return carom.load(path)


def test_each_look_at_a_running_run_sees_what_is_there(scene: carom.Scene, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, scene.to_toml(), str(run)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as writer:
        assert writer.stdin is not None
        assert writer.stdout is not None
        looks = []
        for line in writer.stdout:
            look = looked(run)
            assert len(look) >= int(line) - 9, "a look shows an older state"
            looks.append((look, len(look), look.position))  # which stays open, as in a notebook
            writer.stdin.write("\n")
            writer.stdin.flush()
    whole = carom.load(run)
    assert (len(whole), whole.status) == (41, "done")
    assert len(looks) >= 3
    position, spin = np.asarray(whole.position), np.asarray(whole.angular_velocity)
    for look, frames, column in looks:
        assert len(look) == len(column) == frames
        assert np.array_equal(column, position[:frames])
        assert np.array_equal(look.angular_velocity, spin[:frames])
        assert np.array_equal(pickle.loads(pickle.dumps(look.steps)).time, look.steps.time)
        look.close()


@pytest.mark.parametrize(
    "where",
    [
        lambda run: run,
        lambda run: run / "copies" / "first",
        lambda run: run.parent / "link",
        lambda run: run.parent / "link" / "copy",
        lambda run: run / ".." / "run",
    ],
)
def test_a_run_is_not_saved_to_itself(
    scene: carom.Scene, tmp_path: Path, where: Callable[[Path], Path]
) -> None:
    """It was emptied before it was copied; a folder in it was copied into itself, and that again."""
    run = carom.simulate(scene, until=0.01, out=tmp_path / "run")
    (tmp_path / "link").symlink_to(tmp_path / "run")
    before = {file: file.read_bytes() for file in (tmp_path / "run").rglob("*")}
    for force in (False, True):
        with pytest.raises(CaromError, match="is the directory of this run, or lies in it"):
            run.save(where(tmp_path / "run"), force=force)
    assert {file: file.read_bytes() for file in (tmp_path / "run").rglob("*")} == before
    assert len(run.save(tmp_path / "other")) == 11


def test_tables_and_columns_can_be_sent_wherever_the_run_is_kept(
    scene: carom.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    memory = carom.simulate(scene, until=0.01)
    kept = memory.save("run")
    for whole in (memory, kept):
        table, column = whole.steps.where(whole.steps.time > 0.005), whole.position
        sent = pickle.dumps((table, column, whole.impacts, whole.walls, whole.energy))
        monkeypatch.chdir("/")
        rows, values, *_ = pickle.loads(sent)
        assert np.array_equal(rows.time, np.asarray(whole.steps.time)[5:])
        assert np.array_equal(values, whole.position)
        assert values.unit == "m"
        monkeypatch.chdir(tmp_path)
