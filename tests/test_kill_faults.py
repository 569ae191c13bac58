"""A run that is killed in the middle of a system call, or loses its disk, its folder, its file or its clock."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import carom
import kill_faults
import kill_harness
import kill_scenes
import numpy as np
import pytest
from carom import CaromError
from carom.run import checkpoint
from kill_harness import Whole, differences, examine, finish, of_one_build, recorded
from trials import Trials

NO_SPACE = 28  # ENOSPC


@pytest.fixture(scope="module")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library that injects faults."""
    return kill_faults.built(tmp_path_factory.mktemp("shim"))


@pytest.fixture(scope="module")
def small_calls(small: Whole, shim: Path, tmp_path_factory: pytest.TempPathFactory) -> int:
    """How many calls that write it makes."""
    return calls(small, tmp_path_factory.mktemp("calls") / "counted", shim)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    """A small run with many checkpoints that nobody disturbs."""
    return kill_harness.uninterrupted("penalty", tmp_path_factory.mktemp("small"))


def calls(whole: Whole, run: Path, shim: Path) -> int:
    """How many calls that write a whole run makes."""
    count = run.with_suffix(".count")
    process = kill_harness.start(run, whole, env=kill_faults.environment(shim, run, count=str(count)))
    process.communicate()
    assert process.returncode == 0
    return int(count.read_text())


def struck(whole: Whole, run: Path, shim: Path, at: int, kind: str | int) -> tuple[int, str]:
    """Exit code and words of a run that meets the fault at its call `at`."""
    process = kill_harness.start(run, whole, env=kill_faults.environment(shim, run, at=at, kind=kind))
    _, told = process.communicate()
    return process.returncode, told


Strike = Callable[[Whole, Path, Path, int, int, np.random.Generator, Trials], None]


def kill_at_calls(
    whole: Whole, folder: Path, shim: Path, total: int, tries: int, rng: np.random.Generator, trials: Trials
) -> None:
    """Kill at `tries` of the `total` calls that write, by turns before and in the middle of one."""
    struck_at_all = 0
    for k in range(tries):
        run = folder / f"run{k}"
        code, told = struck(whole, run, shim, int(rng.integers(1, total)), ("kill", "torn")[k % 2])
        assert code in (0, -9), told  # batches depend on time, so a run may have fewer calls
        if code:
            struck_at_all += 1
            with trials("runs continued bit for bit after kills in a system call"), of_one_build(whole.build):
                examine(run, whole)
                finish(run, whole, by_command=False)
    assert struck_at_all > tries // 2


def fill_disk_at_calls(
    whole: Whole, folder: Path, shim: Path, total: int, tries: int, rng: np.random.Generator, trials: Trials
) -> None:
    """Let the disk be full from `tries` of the calls on, those that set up the file among them; then make room again."""
    struck_at_all = 0
    for k in range(tries):
        run = folder / f"run{k}"
        code, told = struck(whole, run, shim, int(rng.integers(1, total)), NO_SPACE)
        assert code in (0, 2), told
        if code:
            struck_at_all += 1
            with trials("runs continued bit for bit after a full disk"), of_one_build(whole.build):
                assert "no space left on the disk; free some" in told
                said = [line for line in told.splitlines() if not line.startswith("carom: warning: ")]
                assert len(said) == 1, told  # advice on the scenario comes before it, as without the fault
                if run.exists():
                    examine(run, whole)
                finish(run, whole, by_command=False)
    assert struck_at_all > tries // 2


def test_killed_at_a_system_call(
    small: Whole, small_calls: int, shim: Path, tmp_path: Path, trials: Trials
) -> None:
    kill_at_calls(small, tmp_path, shim, small_calls, 2, np.random.default_rng(1), trials)


def test_a_disk_that_is_full_from_some_write_on(
    small: Whole, small_calls: int, shim: Path, tmp_path: Path, trials: Trials
) -> None:
    fill_disk_at_calls(small, tmp_path, shim, small_calls, 1, np.random.default_rng(2), trials)


@pytest.mark.long
@pytest.mark.parametrize("name", kill_scenes.SCENES)
def test_killed_or_starved_at_many_system_calls(
    name: str, shim: Path, tmp_path: Path, trials: Trials
) -> None:
    whole = kill_harness.uninterrupted(name, tmp_path)
    total = calls(whole, tmp_path / "counted", shim)
    strikes: dict[str, Strike] = {"kill": kill_at_calls, "full": fill_disk_at_calls}
    for name_, strike in strikes.items():
        (tmp_path / name_).mkdir()
        strike(
            whole,
            tmp_path / name_,
            shim,
            total,
            20,
            np.random.default_rng([3, list(kill_scenes.SCENES).index(name)]),
            trials,
        )


def test_a_disk_that_fills_up_and_is_given_room(small: Whole, tmp_path: Path) -> None:
    """A real one: a file system of 1.5 MB, and the run has 2 MB of results."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = f"mount -t tmpfs -o size=1500k none {disk}"
    script = f"""
        {mount}
        $CAROM run {small.scenario} -o {disk}/run --quiet || echo code $? >&2
        $CAROM info {disk}/run --json > {tmp_path}/info.json
        $CAROM resume {disk}/run --quiet || echo code $? >&2
        mount -o remount,size=64m {disk}
        $CAROM resume {disk}/run --quiet
        cp -r {disk}/run {tmp_path}/kept
    """
    done = kill_faults.in_namespace(script, probe=mount)
    assert done.returncode == 0, done.stderr
    errors = done.stderr.splitlines()
    assert [line for line in errors if line.startswith("code")] == ["code 2", "code 2"]
    assert sum("no space left on the disk; free some" in line for line in errors) == 2
    assert "Traceback" not in done.stderr
    info = json.loads((tmp_path / "info.json").read_text())
    assert info["status"] == "failed"
    assert 1 < info["frames"] < len(small.data["frames/time"])
    assert not differences(recorded(tmp_path / "kept"), small.data, prefix=False)


def test_a_folder_that_cannot_be_written(small: Whole, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        carom.simulate(carom.Scene.from_toml(small.scenario), until=0.1, out=folder / "old")
    mount = f"mount --bind {folder} {folder}; mount -o remount,ro,bind {folder}"
    script = f"""
        {mount}
        $CAROM run {small.scenario} -o {folder}/new --quiet || echo code $?
        $CAROM resume {folder}/old --until 0.2 --quiet || echo code $?
        $CAROM info {folder}/old
    """
    done = kill_faults.in_namespace(script, probe=mount)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("code 2\n") == 2
    assert re.search(r"^frames +51$", done.stdout, re.M)  # it can be read
    first, second = done.stderr.splitlines()
    assert (
        f"cannot create the run directory {folder}/new: the file system is read-only; write elsewhere"
        in first
    )
    assert f"cannot write {folder}/old/log.jsonl: the file system is read-only" in second
    assert "copy" in second


def test_results_that_are_removed_under_the_run(small: Whole, tmp_path: Path) -> None:
    run = tmp_path / "run"
    scene = carom.Scene.from_toml(small.scenario)

    def remove(now: object) -> None:
        (run / "results.h5").unlink(missing_ok=True)

    with pytest.raises(CaromError, match=r"results\.h5 was removed or replaced while"):
        carom.simulate(scene, out=run, progress=remove)
    assert json.loads((run / "run.json").read_text())["status"] == "failed"
    assert "was removed" in json.loads((run / "run.json").read_text())["outcome"]["advice"]
    for path in checkpoint.found(run):
        checkpoint.load(path)
    if checkpoint.found(run):
        with pytest.raises(CaromError, match=r"cannot be used: results.h5 is missing.*--checkpoint start"):
            carom.resume(run)
    carom.resume(run, checkpoint="start")
    assert not differences(recorded(run), small.data, prefix=False)


def test_a_folder_that_is_removed_under_the_run(small: Whole, tmp_path: Path) -> None:
    run = tmp_path / "run"

    def remove(now: object) -> None:
        for path in run.glob("*"):
            path.unlink()
        if run.exists():
            run.rmdir()

    with pytest.raises(CaromError, match=r"results\.h5 was removed or replaced while"):
        carom.simulate(carom.Scene.from_toml(small.scenario), out=run, progress=remove)
    assert not run.exists()


def test_a_clock_that_jumps(small: Whole, shim: Path, tmp_path: Path) -> None:
    """Wall-time checkpoints follow the monotonic clock; the other one, up to a year off at every look, is for names only."""
    run = tmp_path / "run"
    clock = kill_faults.environment(shim, run, clock=1)
    options = ["--set", "checkpoint_wall=0.2", "--until", "1.2"]
    process = kill_harness.start(run, small, *options, env=clock)
    assert kill_harness.kill_after(process, 0.4, run / "results.h5")
    log = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    years = {line["time"][:4] for line in log}
    assert len(years) > 1  # it did jump
    process = kill_harness.spawn("resume", str(run), env=clock)
    _, told = process.communicate()
    assert process.returncode == 0, told
    found = recorded(run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        carom.simulate(carom.Scene.from_toml(small.scenario), until=1.2, out=tmp_path / "whole")
    assert not differences(found, recorded(tmp_path / "whole"), prefix=False)
