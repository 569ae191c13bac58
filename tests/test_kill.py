"""kill -9 at random moments: the result opens, what was committed is intact, and continuing gives every bit."""

from __future__ import annotations

from pathlib import Path

import kill_harness
import kill_scenes
import numpy as np
import pytest
from carom import _core
from carom.result.directory import RunDir
from carom.run import checkpoint
from trials import Trials

SURVIVED = "runs continued bit for bit after kills at random moments"
#: Kills of each scene: 22 in all.
KILLS = dict(zip(kill_scenes.SCENES, (3, 3, 3, 3, 2, 2, 2, 2, 2), strict=True))


@pytest.mark.parametrize("name", KILLS)
def test_a_killed_run_is_readable_and_continues_bit_for_bit(
    name: str, tmp_path: Path, trials: Trials
) -> None:
    whole = kill_harness.uninterrupted(name, tmp_path, share=0.5)
    met = []
    for k in range(KILLS[name]):
        rng = np.random.default_rng([2026, list(kill_scenes.SCENES).index(name), k])
        with trials(SURVIVED):
            met.append(kill_harness.kill_once(whole, tmp_path / f"run{k}", rng, by_command=False, again=0.2))
    print(*met, sep="\n")


@pytest.mark.long
@pytest.mark.parametrize("name", kill_scenes.SCENES)
def test_a_run_that_is_killed_again_and_again(name: str, tmp_path: Path, trials: Trials) -> None:
    """225 kills over all scenes, and up to several of each continuation."""
    whole = kill_harness.uninterrupted(name, tmp_path)
    for k in range(25):
        rng = np.random.default_rng([2027, list(kill_scenes.SCENES).index(name), k])
        with trials(SURVIVED):
            kill_harness.kill_once(whole, tmp_path / f"run{k}", rng, by_command=True, again=0.4)


def test_a_core_that_is_built_anew_is_no_broken_promise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = checkpoint.build()
    if not build:
        pytest.skip("the linker gave the core no identity")
    with pytest.raises(AssertionError, match="other bits"), kill_harness.of_one_build(build):
        raise AssertionError("other bits")
    with open(_core.__file__, "rb") as file:
        head = file.read(4096)
    anew = tmp_path / "anew.so"
    anew.write_bytes(head.replace(bytes.fromhex(build), bytes(20)))
    monkeypatch.setattr(_core, "__file__", str(anew))
    with (
        pytest.raises(kill_harness.Rebuilt, match="was built anew while this ran"),
        kill_harness.of_one_build(build),
    ):
        raise AssertionError("other bits")
    with kill_harness.of_one_build(build):
        pass  # what held for all that is no failure


@pytest.mark.parametrize("removed", range(6))
def test_what_a_removal_leaves_is_in_order_wherever_it_ends(
    removed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`--force` removes a run file by file: a kill in between must not leave checkpoints without results, nor these
    without the scenario."""
    names = [
        "run.json",
        "scenario.toml",
        "results.h5",
        "checkpoint-000000000010.npz",
        "log.jsonl",
        "view.html",
    ]
    for name in names:
        (tmp_path / name).write_text("", encoding="utf-8")
    unlink, left = Path.unlink, [removed]

    def killed(path: Path) -> None:
        if left[0] == 0:
            raise KeyboardInterrupt
        left[0] -= 1
        unlink(path)

    run = RunDir(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", killed)
        with pytest.raises(KeyboardInterrupt):
            run._remove_own()
    there = {path.name for path in tmp_path.iterdir()}
    assert len(there) == len(names) - removed
    assert not checkpoint.found(tmp_path) or run.segments()
    assert not run.segments() or {"run.json", "scenario.toml"} <= there
    # It can be replaced.
    assert run.about.exists() or run._is_own()
