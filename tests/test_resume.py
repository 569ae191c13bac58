"""Resuming: from which checkpoint, with which options, and what is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import carom
import fake_sim
import pytest
from carom import CaromError, _core
from carom.result.directory import RunDir
from carom.result.record import Rows
from carom.run import checkpoint
from carom.run.sinks import Progress
from fake_runs import everything, interrupted


@pytest.fixture
def scene() -> carom.Scene:
    """Two balls that hop on a plane for a second."""
    return fake_sim.hopping("one", "two")


def about(run: Path) -> dict[str, Any]:
    """The content of `run.json`."""
    found: dict[str, Any] = json.loads((run / "run.json").read_text())
    return found


@pytest.mark.parametrize("every", [1, 7])
def test_an_interrupted_run_continues_bit_for_bit(
    scene: Any, tmp_path: Path, every: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("carom.run.sinks.BLOCK_BYTES", 40_000)  # small blocks
    carom.simulate(scene, until=1.0, every=every, out=tmp_path / "whole")
    run = tmp_path / "run"
    interrupted(scene, run, 300, until=1.0, every=every)
    assert carom.load(run).outcome.kind == "interrupted"
    assert everything(run) != everything(tmp_path / "whole")
    result = carom.resume(run)
    assert result.outcome.ok
    assert result.segment_names == ["results.h5", "results-0002.h5"]
    assert everything(run) == everything(tmp_path / "whole")
    assert len(about(run)["segments"]) == 2
    # There is nothing left to do, and nothing is done.
    assert carom.resume(run).segment_names == result.segment_names
    with pytest.raises(CaromError, match="has reached t = 1 s already"):
        carom.resume(run, until=0.5)
    with pytest.raises(CaromError, match=r"carom\.resume: until: must be positive"):
        carom.resume(run, until=-1)
    with pytest.raises(CaromError, match=r"carom\.resume: step: cannot change within a run"):
        carom.resume(run, step=0.1)


def test_a_segment_without_a_checkpoint_of_its_own_is_overruled(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("carom.run.sinks.BLOCK_BYTES", 40_000)
    carom.simulate(scene, until=1.0, out=tmp_path / "whole")
    run = tmp_path / "run"
    interrupted(scene, run, 300, until=1.0)
    held = {p.name: p.read_bytes() for p in run.glob("checkpoint-*")}

    def press(now: Progress) -> None:
        if now.step >= 600:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        carom.resume(run, progress=press)
    for path in run.glob("checkpoint-*"):  # as if killed: only the old checkpoint is there
        path.unlink()
    for name, content in held.items():
        (run / name).write_bytes(content)
    assert carom.resume(run).segment_names == ["results.h5", "results-0002.h5", "results-0003.h5"]
    assert everything(run) == everything(tmp_path / "whole")


def stopped_with_two_checkpoints(scene: Any, run: Path) -> tuple[Path, Path]:
    """A run of 1000 steps that was interrupted after 500, and its checkpoints, the newest first."""
    interrupted(scene, run, 500, until=1.0, checkpoint_steps=200)
    newest, older = checkpoint.found(run)
    return newest, older


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("carom.run.sinks.BLOCK_BYTES", 40_000)


@pytest.mark.usefixtures("small_blocks")
def test_a_damaged_checkpoint_is_refused_and_the_previous_one_offered(scene: Any, tmp_path: Path) -> None:
    carom.simulate(scene, until=1.0, out=tmp_path / "whole")
    run = tmp_path / "run"
    newest, older = stopped_with_two_checkpoints(scene, run)
    content = bytearray(newest.read_bytes())
    content[len(content) // 2] ^= 1
    newest.write_bytes(content)
    before = sorted((p.name, p.read_bytes()) for p in run.glob("[!l]*"))
    with pytest.raises(CaromError) as refused:
        carom.resume(run)
    assert f"checkpoint {newest} cannot be used: it" in str(refused.value)
    step = checkpoint.load(older).step
    assert f"the previous one, of step {step} (t = {step * 1e-3:g} s), can be" in str(refused.value)
    assert f"`carom resume {run} --checkpoint previous`" in str(refused.value)
    assert sorted((p.name, p.read_bytes()) for p in run.glob("[!l]*")) == before  # nothing was done
    assert carom.resume(run, checkpoint="previous").outcome.ok
    assert everything(run) == everything(tmp_path / "whole")
    # It is not in the way again, and still there to be looked at.
    assert (run / f"{newest.name}.aside").read_bytes() == bytes(content)
    assert "put aside" in (run / "log.jsonl").read_text()


@pytest.mark.usefixtures("small_blocks")
def test_if_no_checkpoint_can_be_used_the_run_can_begin_anew(scene: Any, tmp_path: Path) -> None:
    carom.simulate(scene, until=1.0, out=tmp_path / "whole")
    run = tmp_path / "run"
    newest, older = stopped_with_two_checkpoints(scene, run)
    for path in (newest, older):
        path.write_bytes(b"torn")
    for wish in ("newest", "previous"):
        with pytest.raises(
            CaromError, match=r"no other can be; `carom resume .* --checkpoint start` computes"
        ):
            carom.resume(run, checkpoint=wish)
    assert carom.resume(run, checkpoint="start").outcome.ok
    assert everything(run) == everything(tmp_path / "whole")


@pytest.mark.usefixtures("small_blocks")
def test_the_newest_is_offered_where_the_previous_is_damaged(scene: Any, tmp_path: Path) -> None:
    run = tmp_path / "run"
    _, older = stopped_with_two_checkpoints(scene, run)
    older.write_bytes(older.read_bytes()[:-100])
    with pytest.raises(
        CaromError, match=r"the newest one, of step 5\d\d .* can be: `carom resume [^`]*run` cont"
    ):
        carom.resume(run, checkpoint="previous")
    older.unlink()
    with pytest.raises(CaromError, match="has no previous checkpoint, only checkpoint-0"):
        carom.resume(run, checkpoint="previous")
    with pytest.raises(CaromError, match=r"unknown choice 'previos'; did you mean previous\?"):
        carom.resume(run, checkpoint="previos")


@pytest.mark.usefixtures("small_blocks")
def test_a_foreign_checkpoint_is_refused(scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = tmp_path / "run"
    newest, _ = stopped_with_two_checkpoints(scene, run)
    own = newest.read_bytes()
    # Of another scenario, with the same shapes.
    other = scene.with_options(step=0.002)
    interrupted(other, tmp_path / "other", 500, until=2.0)
    newest.write_bytes(checkpoint.found(tmp_path / "other")[0].read_bytes())
    with pytest.raises(CaromError, match="belongs to another scenario; the previous one, of step"):
        carom.resume(run)
    newest.write_bytes(own)
    # Of another format.
    with monkeypatch.context() as old:
        old.setattr(checkpoint, "FORMAT", 1)
        checkpoint.save(run, checkpoint.Checkpoint(999, 0.999, Rows(), "", {}))
    with pytest.raises(CaromError, match="it has format 1, wanted 2; the previous one, of step"):
        carom.resume(run)


def test_a_checkpoint_of_another_version_is_taken_only_if_that_is_asked_for(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    carom.simulate(scene, until=0.1, out=run)
    carom.simulate(scene, until=0.2, out=tmp_path / "whole")
    monkeypatch.setattr(_core, "__version__", "newer")
    with pytest.raises(CaromError, match=r"it is of Carom [\d.]+, this is newer, .* or give --any-version"):
        carom.resume(run, until=0.2)
    carom.resume(run, until=0.2, any_version=True)
    assert everything(run) == everything(tmp_path / "whole")


def test_another_build_of_the_same_version_is_mentioned(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    monkeypatch.setattr(checkpoint, "build", lambda: "one")
    carom.simulate(scene, until=0.1, out=run)
    monkeypatch.setattr(checkpoint, "build", lambda: "two")
    with pytest.warns(carom.CaromWarning, match="was built anew since the checkpoint was written"):
        carom.resume(run, until=0.2)


def test_without_any_checkpoint_a_killed_run_begins_again(scene: Any, tmp_path: Path) -> None:
    carom.simulate(scene, until=0.2, out=tmp_path / "whole")
    run = tmp_path / "run"
    carom.simulate(scene, until=0.1, out=run)
    for path in checkpoint.found(run):  # as if killed before the first
        path.unlink()
    killed = about(run) | {"status": "running", "outcome": None}
    del killed["summary"], killed["finished"]
    (run / "run.json").write_text(json.dumps(killed))
    content = (run / "results.h5").read_bytes()
    with pytest.warns(
        carom.CaromWarning, match=r"there is no checkpoint \(yet\); the run begins anew"
    ) as told:
        carom.resume(run, until=0.2)
    assert [Path(warning.filename).name for warning in told] == [
        Path(__file__).name
    ]  # it points at the caller
    assert everything(run) == everything(tmp_path / "whole")
    assert (run / "results.h5").read_bytes() == content  # the same bits, as far as it had come


@pytest.mark.parametrize("keep", [True, False])
def test_a_record_without_checkpoints_is_not_replaced_unasked(keep: bool, scene: Any, tmp_path: Path) -> None:
    """A ball was struck in it: what the scenario gives is another motion, without that ball's velocity."""
    simulation = carom.Simulation(scene, every=7, keep=keep)
    simulation.step(10)
    state = simulation.state()
    state["velocity"][0] += (0.0, 0.0, 3.0)
    simulation.restore(state)
    simulation.step(13)
    run = tmp_path / "run"
    simulation.result().save(run)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with pytest.raises(CaromError, match=r"has no checkpoint.*--checkpoint start.*aside"):
        carom.resume(run, until=0.3)
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    carom.resume(run, until=0.3, checkpoint="start")
    assert (run / "results.h5.aside").read_bytes() == before["results.h5"]
    carom.simulate(scene, until=0.3, every=7, out=tmp_path / "whole")
    assert everything(run) == everything(tmp_path / "whole")
    assert carom.audit.check(run).ok  # which refuses a record of a state that was restored


@pytest.mark.usefixtures("small_blocks")
def test_results_that_are_gone_are_missed(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    carom.simulate(scene, until=1.0, out=tmp_path / "whole")
    run = tmp_path / "run"
    stopped_with_two_checkpoints(scene, run)
    results = run / "results.h5"
    content = results.read_bytes()
    results.unlink()
    with pytest.raises(CaromError, match=r"results.h5 is missing.*--checkpoint start"):
        carom.resume(run)
    with pytest.raises(CaromError, match=r"run: results.h5 is missing; .*--checkpoint start"):
        carom.load(run)
    with monkeypatch.context() as going_on:
        going_on.setattr(RunDir, "is_being_written", lambda _: True)
        with pytest.raises(CaromError, match=r"run: there are no results yet"):
            carom.load(run)
    # Of another run, shorter than this one.
    carom.simulate(scene, until=0.1, out=tmp_path / "short")
    results.write_bytes((tmp_path / "short" / "results.h5").read_bytes())
    with pytest.raises(
        CaromError,
        match=r"of the 5\d\d rows of frames before the checkpoint 101 are in results.h5: a results file",
    ):
        carom.resume(run)
    results.write_bytes(b"torn")
    with pytest.raises(CaromError, match=r"cannot be read as results of a run.*--checkpoint start"):
        carom.resume(run)
    # What is put back will do.
    results.write_bytes(content)
    assert carom.resume(run).outcome.ok
    assert everything(run) == everything(tmp_path / "whole")
    # If it is gone for good, the run can begin anew, and what is left of the old one is put aside.
    for k in ("", "2"):
        results.write_bytes(b"torn")
        carom.resume(run, checkpoint="start")
        assert (run / f"results.h5.aside{k}").read_bytes() == b"torn"
        assert carom.load(run).segment_names == ["results.h5"]
        assert [part["file"] for part in about(run)["segments"]] == ["results.h5"]
        assert everything(run) == everything(tmp_path / "whole")
    # The first that was put aside is deleted by its owner: the next takes its name, and the second stays.
    (run / "results.h5.aside").unlink()
    for content in (b"third", b"fourth"):
        results.write_bytes(content)
        carom.resume(run, checkpoint="start")
    kept = {path.name: path.read_bytes() for path in run.glob("results.h5.aside*")}
    assert kept == {
        "results.h5.aside": b"third",
        "results.h5.aside2": b"torn",
        "results.h5.aside3": b"fourth",
    }


def test_another_scenario_is_not_continued(scene: Any, tmp_path: Path) -> None:
    carom.simulate(scene, until=0.1, out=tmp_path / "run")
    path = tmp_path / "run" / "scenario.toml"
    path.write_text(path.read_text().replace("step = 0.001", "step = 0.002"))
    with pytest.raises(CaromError, match="was changed since the run began"):
        carom.resume(tmp_path / "run", until=0.2)


# --- what run.json says -----------------------------------------------------------------------------------------------


def noted(run: Path) -> list[tuple[int, float]]:
    """After which steps the tolerance changed, and to what."""
    return [
        (entry["after_step"], entry["options"]["tolerance"][1]) for entry in about(run).get("changes", [])
    ]


def test_changes_of_options_are_noted_where_they_hold(scene: Any, tmp_path: Path) -> None:
    run = tmp_path / "run"
    scene = scene.with_options(tolerance=1e-8, checkpoint_steps=50)
    carom.simulate(scene, until=0.1, out=run)
    carom.resume(run, until=0.2, tolerance=1e-7)
    assert noted(run) == [(100, 1e-7)]
    carom.resume(run, until=0.3, tolerance=1e-6)
    assert noted(run) == [(100, 1e-7), (200, 1e-6)]
    # From 250 on it is computed again; then from 50 on, before the changes, with the options it has by now.
    carom.resume(run, checkpoint="previous")
    assert noted(run) == [(100, 1e-7), (200, 1e-6)]
    other = checkpoint.load(checkpoint.found(run)[0])
    for path in checkpoint.found(run):
        path.unlink()
    checkpoint.save(run, other)
    early = tmp_path / "early"
    carom.simulate(scene, until=0.05, out=early)
    (run / checkpoint.name(50)).write_bytes(checkpoint.found(early)[0].read_bytes())
    carom.resume(run, checkpoint="previous")
    assert noted(run) == [(50, 1e-7), (50, 1e-6)]
    # Computed anew it has one set of options from its start to its end.
    carom.resume(run, checkpoint="start")
    assert noted(run) == []
    assert "changes" not in about(run)


def test_a_change_that_was_announced_and_never_came_true_is_taken_back(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed after `run.json` and before `scenario.toml`: the run goes on with the options of the latter."""
    run = tmp_path / "run"
    carom.simulate(scene.with_options(tolerance=1e-8), until=0.1, out=run)
    identity = about(run)["scenario"]["identity"]
    with monkeypatch.context() as killed:

        def kill(*_: object) -> None:
            raise SystemExit

        killed.setattr("carom.result.directory.RunDir.write_scenario", kill)
        with pytest.raises(SystemExit):
            carom.resume(run, until=0.2, tolerance=1e-7)
    assert noted(run) == [(100, 1e-7)]
    assert about(run)["scenario"]["identity"] != identity
    carom.resume(run, until=0.2)
    assert noted(run) == []
    assert about(run)["scenario"]["identity"] == identity
    assert carom.resume(run, until=0.3, tolerance=1e-7).outcome.ok
    assert noted(run) == [(200, 1e-7)]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("status", 3),
        ("outcome", "over"),
        ("scenario", {}),
        ("scenario", None),
        ("scenario.identity", 7),
        ("scenario.earlier", "abc"),
        ("scenario.file", 0.5),
        ("versions", {}),
        ("segments", None),
        ("segments", [3]),
        ("segments", [{"wall_s": "long", "core_s": 0.1}]),
        ("changes", [{"after_step": 5}]),
        ("changes", {}),
        ("save_problems", "all"),
        ("save_problems", {"choice": 3, "form": "local"}),
    ],
)
def test_a_run_json_that_was_altered_is_refused_in_words(
    scene: Any, tmp_path: Path, place: str, value: Any
) -> None:
    run = tmp_path / "run"
    carom.simulate(scene, until=0.05, out=run)
    content = about(run)
    *groups, key = place.split(".")
    owner = content
    for group in groups:
        owner = owner[group]
    owner[key] = value
    (run / "run.json").write_text(json.dumps(content))
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with pytest.raises(CaromError, match=rf"run\.json: {place}.*found .*altered or damaged"):
        carom.resume(run, until=0.1)
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_a_part_of_a_run_that_was_killed_stays_listed(tmp_path: Path) -> None:
    """`run.json` names the results files of all parts. One that was killed has no `to_step` until the next one begins."""
    run = tmp_path / "run"
    program = (
        "import os, signal, sys, carom\n"
        "kill = lambda view: view.step > 60 and os.kill(os.getpid(), signal.SIGKILL)\n"
        "carom.simulate(sys.argv[1], out=sys.argv[2], checkpoint_steps=20, callback=kill, callback_every=1)\n"
    )
    scenario = Path(carom.__file__).parent / "scenarios" / "three_balls.toml"
    subprocess.run([sys.executable, "-c", program, str(scenario), str(run)], check=False)
    [killed] = about(run)["segments"]
    assert killed["file"] == "results.h5"
    assert "to_step" not in killed
    assert carom.resume(run).outcome.ok
    first, second = about(run)["segments"]
    assert {key: first[key] for key in ("file", "from_step", "started")} == {
        key: killed[key] for key in ("file", "from_step", "started")
    }
    assert first["to_step"] == second["from_step"] == 60
    assert 0.0 < first["core_s"] < first["wall_s"]
    assert (second["file"], second["to_step"]) == ("results-0002.h5", 200)
    summary = about(run)["summary"]
    assert summary["wall_s"] == first["wall_s"] + second["wall_s"]
    assert carom.audit.check(run).ok
