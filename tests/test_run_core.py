"""The same with the real core: a run that is stopped in any way continues bit for bit."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom.audit.rerun import rerun
from carom.cli.examples import find
from carom.result.record.layout import TABLES
from hypothesis import given, settings
from hypothesis import strategies as st

CAROM = [sys.executable, "-m", "carom"]


def everything(run: Path) -> dict[str, Any]:
    """All that a run recorded, as bytes, and the shapes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        segments = carom.load(run)._segments
    columns = {f"{t}/{name}": segments.column(t, name) for t in TABLES for name in segments.columns(t)}
    return {name: (c.shape, np.asarray(c).tobytes()) for name, c in columns.items()}


@pytest.fixture(scope="module")
def breaks() -> carom.Scene:
    """The billiard break of section 5.6."""
    return carom.Scene.from_toml(find("5.6_break"))


def simulate(scene: carom.Scene, **options: Any) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the step of the paper is long for the speed of its cue ball
        return carom.simulate(scene, **options)


@settings(max_examples=3)  # test_checkpoint.py has many more scenes, most of them in the long tier
@given(first=st.integers(1, 260), every=st.sampled_from([1, 3, 10]))
def test_a_run_in_two_parts_is_the_run_in_one(
    breaks: carom.Scene, first: int, every: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("r")
    simulate(breaks, until=0.27, every=every, out=root / "whole")
    simulate(breaks, until=first * 1e-3, every=every, out=root / "parts")
    result = carom.resume(root / "parts", until=0.27)
    assert everything(root / "whole") == everything(root / "parts")
    # Totals go on too, and the state at the end is that of the last frame.
    whole = carom.load(root / "whole").summary
    for key in (
        "iterations",
        "line_search",
        "impact_problems",
        "energy",
        "penetration_max",
        "bodies",
        "steps",
    ):
        assert result.summary[key] == whole[key], key
    assert result.summary["bodies"]["ball2"]["velocity"] == result["ball2"].velocity[-1].tolist()


def test_an_extension_keeps_the_grid_of_frames(breaks: carom.Scene, tmp_path: Path) -> None:
    simulate(breaks, until=1.5, every=None, out=tmp_path / "parts")  # thinned to every second step
    carom.resume(tmp_path / "parts", until=2.0)
    simulate(breaks, until=2.0, every=2, out=tmp_path / "whole")
    assert everything(tmp_path / "parts") == everything(tmp_path / "whole")


def test_an_extension_says_that_it_has_many_more_frames_than_a_new_run(
    breaks: carom.Scene, tmp_path: Path
) -> None:
    """`every` was chosen for the first end; an extension has it too, and a repetition finds the same bits."""
    simulate(breaks, until=0.2, step=1e-3, every=None, out=tmp_path / "run")
    with pytest.warns(carom.CaromWarning, match=r"frames stay 1 step .*: 3001 of them to t = 3 s; a new"):
        carom.resume(tmp_path / "run", until=3.0)
    [repeated] = rerun(tmp_path / "run")
    assert repeated.ok
    log = (tmp_path / "run" / "log.jsonl").read_text()
    assert log.count("with every = 3 has 1001") == 1
    carom.resume(tmp_path / "run", until=3.5)  # it was said already
    assert (tmp_path / "run" / "log.jsonl").read_text().count("frames stay") == 1


LONG = ["--set", "step=1e-5", "--set", "every=20"]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_stopped_by_a_signal(number: signal.Signals, tmp_path: Path) -> None:
    run, until = tmp_path / "run", ["--until", "60"]
    command = [*CAROM, "run", str(find("5.6_break")), "-o", str(run), "--quiet", *LONG, *until]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    results = run / "results.h5"
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and not (results.exists() and len(quietly(run)) > 2000):
        time.sleep(0.1)
    process.send_signal(number)
    _, told = process.communicate(timeout=30)
    kept = quietly(run)
    frames = len(kept)
    assert frames > 2000
    if number == signal.SIGKILL:
        assert kept.status == "running"
        assert not kept.is_being_written
        with pytest.warns(
            carom.run.result.UnfinishedRun, match=f"run did not finish; {frames} frames readable"
        ):
            carom.load(run)
    else:
        assert process.returncode == 130
        assert "interrupted at t = " in told
        assert f"continue with: carom resume {run}" in told
        assert kept.status == "interrupted"
        # An interruption that meets a checkpoint being replaced leaves both: the last two are kept anyway.
        assert 1 <= len(list(run.glob("checkpoint-*.npz"))) <= 2
    # What is there is the beginning of the undisturbed run.
    end = float(kept.time[frames // 4])
    whole = simulate(carom.Scene.from_toml(find("5.6_break")), step=1e-5, every=20, until=end)
    assert np.array_equal(kept.position[: len(whole)], whole.position)
    # Its state does not depend on where it was stopped: a little further is enough to see it.
    if number == signal.SIGINT:
        further = float(kept.outcome.time or 0) + 0.01
        shorten(run, further)
        resumed = subprocess.run([*CAROM, "resume", str(run), "--quiet"], timeout=60, check=False)
        assert resumed.returncode == 0
        after = carom.load(run)
        whole = simulate(carom.Scene.from_toml(find("5.6_break")), step=1e-5, every=20, until=further)
        assert np.array_equal(after.position, whole.position)
        assert np.array_equal(after.contacts["impulse"], whole.contacts["impulse"])


def quietly(run: Path) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return carom.load(run)


def shorten(run: Path, until: float) -> None:
    """Ask for less in the scenario of a run, which is not part of its identity."""
    path = run / "scenario.toml"
    path.write_text(path.read_text().replace("until = 60.0", f"until = {until!r}"))


def test_joint_impulses_with_names_and_without_joints(breaks: carom.Scene) -> None:
    free = simulate(breaks, until=0.01, every=5)
    assert free.joint_names == []
    assert free.joint_impulse.shape == (len(free.time), 0, 6)
    assert np.asarray(free.joint_impulse[1:]).size == 0

    scene = carom.Scene("two rods", run={"until": 0.01})
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    for name, x in (("a", 0.0), ("b", 1.0)):
        scene.sphere(name, radius=0.05, mass=0.1, material="m", position=(x, 0, 0))
    scene.joint("fix", body="a")
    scene.joint("fix", body="b", name="the second")
    held = carom.simulate(scene)
    assert held.joint_names == ["joint1", "the second"]
    # Each joint carries the weight of its sphere.
    weight = 0.1 * 9.8 * held.time[-1]
    assert np.sum(held.joint_impulse[:, :, 2], axis=0) == pytest.approx([weight, weight], rel=1e-6)


@pytest.mark.filterwarnings("error::carom.CaromWarning")
def test_the_summary_of_a_failed_run_says_so(
    breaks: carom.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Why it stopped, with one cure in message and command, before what may be wrong in what was computed."""
    from carom.cli import summary
    from carom.cli.summary import text

    for module in (carom.run.simulate, summary):
        monkeypatch.setattr(
            module, "remarks", lambda result, *names: [] if names else ["rebounds are too low"]
        )

    hard = {"max_iterations": 1, "gauss_seidel_sweeps": 0, "max_halvings": 0, "tolerance": 1e-15}
    with pytest.raises(carom.RunFailed) as caught:
        simulate(breaks, until=0.13, out=tmp_path / "run", **hard)
    assert caught.value.__notes__ == ["warning: rebounds are too low"]
    assert "; try max_iterations = 50, " in str(caught.value)
    result = caught.value.result
    told = text({**result.summary, "directory": "run"}, result)
    assert told.splitlines()[1].startswith("FAILED, not converged in step ")
    assert told.splitlines()[2] == "warning     rebounds are too low"
    assert "troubles    stopped: not converged at step" in told
    assert "troubles    none" not in told
    assert "carom resume run --set max_iterations=50 " in told.splitlines()[-1]
    assert "carom plot" not in told


@pytest.mark.parametrize(
    ("advice", "option"),
    [
        ("try pile_tolerance = 1e-3", "pile_tolerance=1e-3"),
        ('try solver = "auto", max_iterations = 50 or max_halvings = 8', "solver=auto"),
        (
            'no other setting is known to solve it; on_nonconvergence = "warn" goes on with what was reached',
            "on_nonconvergence=warn",
        ),
        ("joints may leave no motion: look at them", None),
    ],
)
def test_the_command_that_leads_on_sets_what_the_core_advises_first(advice: str, option: str | None) -> None:
    from carom.cli.summary import _easier
    from carom.result.outcome import Outcome
    from carom.run.changes import CHANGEABLE

    assert _easier(Outcome("not_converged", advice=advice)) == option
    assert option is None or option.split("=")[0] in CHANGEABLE
