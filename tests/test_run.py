"""Running, recording and resuming, also where the core fails or dawdles."""

from __future__ import annotations

import re
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import carom
import fake_sim
import h5py
import numpy as np
import pytest
from carom import CaromError, CaromWarning
from carom.result.directory import RunDir
from carom.result.record import Rows, Segments, Writer
from carom.run import checkpoint
from carom.run.loop import begin
from carom.run.sinks import Progress
from carom.scene.plan import Plan, thinned
from fake_runs import everything
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

ATTRIBUTES = {"step": 1e-3, "every": 1, "gravity": np.zeros(3)}
"""What every file says of itself."""


@pytest.fixture
def scene() -> carom.Scene:
    """Two balls that hop on a plane for a second."""
    return fake_sim.hopping("one", "two")


# --- the plan -------------------------------------------------------------------------------------------------------


def test_about_a_thousand_frames_and_the_last_step_is_one_of_them() -> None:
    assert [thinned(n) for n in (1, 1000, 3000, 10_000)] == [1, 1, 3, 10]
    assert thinned(1200) == 2  # 1001 to 2000 steps: every second
    for steps in range(1, 5000, 7):
        assert steps / thinned(steps) <= 1000
        assert steps / thinned(steps) > 333 or thinned(steps) == 1
    assert Plan.of(until=3.0, step=1e-3, every=None, contacts=True) == Plan(3000, 3, 1e-3, True)


# --- directories ----------------------------------------------------------------------------------------------------


def test_run_directories_are_numbered(tmp_path: Path) -> None:
    names = [RunDir.next("a[1]", tmp_path / "runs").path.name for _ in range(3)]
    assert names == ["a[1]-1", "a[1]-2", "a[1]-3"]
    assert RunDir.next("a", tmp_path / "runs").path.name == "a-1"


def test_nothing_is_replaced_unasked_and_nobody_elses_files_ever(scene: Any, tmp_path: Path) -> None:
    run = tmp_path / "run"
    carom.simulate(scene, until=0.01, out=run)
    with pytest.raises(CaromError, match=r"exists already; give --force \(force=True in Python\)"):
        carom.simulate(scene, until=0.01, out=run)
    (run / "plots").mkdir()
    (run / "plots" / "caption.tex").write_text("mine")
    (run / "plots" / "heights.png").write_text("drawn by carom plot")
    (run / "notes.txt").write_text("mine")
    assert len(carom.simulate(scene, until=0.02, out=run, force=True)) == 21
    assert (run / "notes.txt").read_text() == "mine"
    assert [path.name for path in (run / "plots").iterdir()] == ["caption.tex"]
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.tex").write_text("years of work")
    with pytest.raises(CaromError, match="not a run directory"):
        carom.simulate(scene, until=0.01, out=other, force=True)
    assert [p.name for p in other.iterdir()] == ["thesis.tex"]
    (tmp_path / "file").write_text("")
    with pytest.raises(CaromError, match="is a file"):
        carom.simulate(scene, until=0.01, out=tmp_path / "file")


def test_a_wrong_scene_leaves_nothing_and_replaces_nothing(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    carom.simulate(scene, until=0.01, out=run)
    before = everything(run)
    model = scene.to_model()
    model["radius"] = -model["radius"]
    monkeypatch.setattr(carom.Scene, "to_model", lambda self: model)
    for out in (run, tmp_path / "new"):
        with pytest.raises(CaromError, match=r"radius of sphere 0: .* must be above 0"):
            carom.simulate(scene, until=0.01, out=out, force=True)
    assert everything(run) == before
    assert not (tmp_path / "new").exists()


def test_a_place_that_cannot_be_written(scene: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CaromError, match="cannot create the run directory"):
        carom.simulate(scene, until=0.01, out=tmp_path / "file" / "run")


def test_one_writer_at_a_time(scene: Any, tmp_path: Path) -> None:
    carom.simulate(scene, until=0.01, out=tmp_path / "run")
    directory = RunDir.open(tmp_path / "run")
    with directory.writing():
        assert directory.is_being_written()
        with pytest.raises(CaromError, match="being written by another process"):
            carom.resume(tmp_path / "run", until=0.02)
    assert not directory.is_being_written()


def test_of_runs_that_begin_at_once_one_has_the_directory(scene: Any, tmp_path: Path) -> None:
    path = tmp_path / "run"
    carom.simulate(scene, until=0.01, out=path)
    first, second = (RunDir.create(path, force=True) for _ in range(2))
    with first.writing():
        assert [file.name for file in path.iterdir()] == ["log.jsonl"]
        with pytest.raises(CaromError, match="being written by another process"), second.writing():
            pass
        with pytest.raises(CaromError, match="being written by another process"):
            RunDir.create(path, force=True)
        first.write({"status": "done"})
    with second.writing():  # one after the other they may
        assert [file.name for file in path.iterdir()] == ["log.jsonl"]


def test_a_directory_that_comes_meanwhile_is_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        Path, "mkdir", lambda self, **_: (_ for _ in ()).throw(FileExistsError(17, "File exists"))
    )
    with pytest.raises(CaromError, match="exists already; give --force"):
        RunDir.create(tmp_path)


@pytest.mark.parametrize("until", [1e12, 1e300])
def test_a_run_is_continued_by_no_more_steps_than_one_may_have(
    scene: Any, tmp_path: Path, until: float
) -> None:
    """A search for frames among as many had no end."""
    carom.simulate(scene, until=0.01, out=tmp_path / "run")
    with pytest.raises(CaromError, match=r"more than 10\^12 steps"):
        carom.resume(tmp_path / "run", until=until)
    assert carom.load(tmp_path / "run").status == "done"
    assert thinned(10**12 - 11) == 10**9  # it divides nothing, and is found at once


def test_what_is_not_a_run_is_called_so(tmp_path: Path) -> None:
    with pytest.raises(CaromError, match="no such run directory"):
        carom.load(tmp_path / "absent")
    with pytest.raises(CaromError, match="not a run directory"):
        carom.load(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(CaromError, match="cannot be read"):
        carom.load(tmp_path)


# --- recording ------------------------------------------------------------------------------------------------------


def test_the_file_can_be_read_while_it_is_written_and_explains_itself(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_sim.spoil(monkeypatch, delay=1e-3)
    seen: list[int] = []

    def look(now: Progress) -> None:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = carom.load(tmp_path / "run")
        assert result.status == "running"
        assert result.is_being_written
        if now.step < now.steps:
            assert "is still being written" in str(caught[0].message)
        seen.append(len(result))
        result.close()

    carom.simulate(scene, until=0.3, out=tmp_path / "run", progress=look)
    assert len(seen) >= 2
    assert seen == sorted(seen)
    with h5py.File(tmp_path / "run" / "results.h5") as file:  # plain h5py, no Carom
        assert file["frames/position"].shape == (301, 2, 3)
        assert file["frames/position"].attrs["unit"] == "m"
        assert file["bodies/name"].asstr()[:].tolist() == ["one", "two"]
        assert file["commit"][-1].tolist()[0] == 301
        assert file.attrs["gravity"].tolist() == [0.0, 0.0, -9.8]


def test_only_what_was_committed_is_read(scene: Any, tmp_path: Path) -> None:
    simulation = begin(scene.to_model())
    writer = Writer(
        tmp_path / "x.h5", bodies={"name": ["one", "two"]}, planes={"name": []}, attributes=ATTRIBUTES
    )
    writer.append(simulation.advance(100, 1, True, 9.0))
    committed = writer.commit()
    assert committed.frames == 100
    # The next batch reaches the file, but the process dies before it says so.
    writer.append(simulation.advance(100, 1, True, 9.0))
    for table, columns in writer._columns.items():
        for name, dataset in columns.items():
            values = np.asarray(writer._pending[0][table][name])
            dataset.resize(dataset.shape[0] + len(values), axis=0)
            dataset.flush()
    segments = Segments([tmp_path / "x.h5"])
    assert segments.rows == committed
    assert segments.column("frames", "time").shape == (100,)
    segments.close()
    writer.abandon()
    assert not Writer.unclosable  # or the process would end in the midst of something


def test_a_block_torn_by_a_kill_is_an_error_and_no_wait_for_ever(scene: Any, tmp_path: Path) -> None:
    """HDF5 takes it for the work of a living writer and would read on, with pauses that double, for longer than a life."""
    writer = Writer(
        tmp_path / "x.h5", bodies={"name": ["one", "two"]}, planes={"name": []}, attributes=ATTRIBUTES
    )
    writer.append(begin(scene.to_model()).advance(100, 1, True, 9.0))
    writer.commit()
    content = bytearray((tmp_path / "x.h5").read_bytes())  # as a killed process leaves it
    writer.close()
    heads = [found.start() for found in re.finditer(b"OHDR", content)]
    seen = 0
    for k, at in enumerate(heads):
        torn = content.copy()
        torn[at + 20] ^= 0xFF
        (tmp_path / f"{k}.h5").write_bytes(torn)
        started = time.monotonic()
        try:
            segments = Segments([tmp_path / f"{k}.h5"])
            for column in ("position", "time", "velocity"):
                np.asarray(segments.column("frames", column))
        except CaromError:
            seen += 1
        assert time.monotonic() - started < 10
        if seen == 3:
            break
    assert seen == 3


def test_columns_are_data(scene: Any, tmp_path: Path) -> None:
    block = dict(begin(scene.to_model()).advance(10, 1, True, 9.0))
    block["steps"] = {**block["steps"], "novelty": np.arange(20, dtype=np.int16).reshape(10, 2)}
    writer = Writer(
        tmp_path / "x.h5", bodies={"name": ["one"]}, planes={"name": ["bed"]}, attributes=ATTRIBUTES
    )
    writer.append(block)
    writer.close()
    column = Segments([tmp_path / "x.h5"]).column("steps", "novelty")
    assert column.dtype == np.int16
    assert np.array_equal(column, np.arange(20).reshape(10, 2))


def test_contacts_can_be_left_out(scene: Any) -> None:
    assert len(carom.simulate(scene, until=0.5, contacts=False).contacts) == 0
    assert len(carom.simulate(scene, until=0.5, contacts=True).contacts) > 0


def test_results_end_at_the_end_even_off_the_grid_of_frames(scene: Any, tmp_path: Path) -> None:
    result = carom.simulate(scene, until=0.1, every=30, out=tmp_path / "run")
    assert np.asarray(result.step).tolist() == [0, 30, 60, 90, 100]
    assert "every = 30" in result.scenario
    # The frame off the grid is not in the way of an extension.
    longer = carom.resume(tmp_path / "run", until=0.2)
    assert np.asarray(longer.step).tolist() == [0, 30, 60, 90, 120, 150, 180, 200]
    carom.simulate(scene, until=0.2, every=30, out=tmp_path / "whole")
    assert everything(tmp_path / "run") == everything(tmp_path / "whole")


# --- what goes wrong ------------------------------------------------------------------------------------------------


def test_a_step_that_cannot_be_solved_stops_with_all_before_it(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_sim.spoil(monkeypatch, fail_at=256)
    with pytest.raises(carom.RunFailed) as caught:
        carom.simulate(scene, until=1.0, every=10, out=tmp_path / "run")
    assert str(caught.value) == (
        "not converged at step 256, t = 0.256 s in the position sub-problem between one and bed (residual 0.5);"
        " the contact problem is in failing_problem.h5; halve the step"
    )
    result = caught.value.result
    assert result.status == "failed"
    assert np.asarray(result.step).tolist()[-2:] == [250, 255]  # the last good state is there to be looked at
    assert len(result.steps) == 255
    with h5py.File(tmp_path / "run" / "failing_problem.h5") as file:
        assert file["fclib_local/vectors/q"][:].tolist() == [-1.0, 0.0, 0.0]
        assert file["fclib_local/W/x"][:].tolist() == [1.0, 1.0, 1.0]
        assert file["carom"].attrs["level"] == "position"


def test_an_error_in_the_callers_code_leaves_an_honest_directory(scene: Any, tmp_path: Path) -> None:
    def bad(now: Progress) -> None:
        raise ZeroDivisionError("my own mistake")

    with pytest.raises(ZeroDivisionError):
        carom.simulate(scene, until=0.1, out=tmp_path / "run", progress=bad)
    result = carom.load(tmp_path / "run")
    assert result.status == "failed"
    assert result.outcome.advice == "my own mistake"
    assert 1 < len(result) <= 101  # on a loaded machine the first block may be shorter


FULL_DISK = """
import resource, sys
sys.path.insert(0, {tests!r})
import fake_sim, carom
resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, {hard}))
try:
    carom.simulate(fake_sim.hopping("one", "two"), until=20.0, every=1, out={run!r})
except carom.CaromError as error:
    print(error)
"""


def test_a_disk_that_fills_up(tmp_path: Path) -> None:
    # A limit on the size of files stands for the full disk: both fail in the middle of a write of HDF5.
    hard = "resource.getrlimit(resource.RLIMIT_FSIZE)[1]"
    program = FULL_DISK.format(tests=str(Path(__file__).parent), run=str(tmp_path / "run"), hard=hard)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout.startswith("cannot write")
    assert done.stdout.count("\n") == 1
    assert "Traceback" not in done.stderr
    result = carom.load(tmp_path / "run")
    assert result.status == "failed"
    assert len(result) >= 1
    assert np.isfinite(result.position).all()


ANNOUNCED = """
import os, sys, h5py
file = h5py.File(sys.argv[1], "r+", libver="latest")
file.swmr_mode = True
size = os.stat(sys.argv[1]).st_size
file["residuals/end"].resize(500_000, axis=0)
file["steps/time"].resize(1_500, axis=0)
file["steps/time"][1_000:] = 1.0
file.flush()
os.truncate(sys.argv[1], size)
os._exit(0)
"""


def test_what_a_full_disk_cut_off_may_be_announced(tmp_path: Path) -> None:
    """Rows that HDF5 had announced and no commit counts are not missed: the run is read, and goes on with the same bits."""
    scene = fake_sim.hopping("one", "two")
    whole = carom.simulate(scene, until=2.0)
    carom.simulate(scene, until=1.0, out=tmp_path / "run").close()
    subprocess.run([sys.executable, "-c", ANNOUNCED, tmp_path / "run" / "results.h5"], check=True)
    assert len(carom.load(tmp_path / "run").steps["time"]) == 1000
    assert np.array_equal(carom.resume(tmp_path / "run", until=2.0).position[-1], whole.position[-1])


# --- checkpoints ----------------------------------------------------------------------------------------------------

SCALARS = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=5)
)
ARRAYS = arrays.arrays(
    st.sampled_from([np.float64, np.int64, np.uint8, np.bool_]), arrays.array_shapes(min_side=0)
)
TREES = st.recursive(
    SCALARS | ARRAYS | SCALARS.map(lambda x: (x,)) | st.floats().map(np.float64),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=3)
    ),
    max_leaves=8,
)


def same(a: Any, b: Any) -> bool:
    """Equal in type and bits, NaN included."""
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, np.ndarray | np.generic):
        return type(a) is type(b) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, float):
        return isinstance(b, float) and (a.hex() == b.hex())
    return type(a) is type(b) and a == b


@given(state=st.dictionaries(st.text(max_size=6), TREES, max_size=4))
def test_a_checkpoint_gives_back_every_bit(
    state: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> None:
    directory = tmp_path_factory.mktemp("c")
    saved = checkpoint.Checkpoint(7, 0.1, Rows(1, 2, 3, 4, 5, 6), "abc", state, "1.2", "f0")
    back = checkpoint.load(checkpoint.save(directory, saved))
    assert replace(back, state={}) == replace(saved, state={})
    assert same(state, back.state)


def test_two_checkpoints_are_kept_and_no_scraps(tmp_path: Path) -> None:
    for step in (1, 5, 12):
        checkpoint.save(tmp_path, checkpoint.Checkpoint(step, 0.0, Rows(), "", {"x": np.arange(3.0)}))
    assert [p.name for p in sorted(tmp_path.iterdir())] == [
        "checkpoint-000000000005.npz",
        "checkpoint-000000000012.npz",
    ]
    for content in (b"", b"PK\x03\x04", (tmp_path / "checkpoint-000000000012.npz").read_bytes()[:-40]):
        (tmp_path / "checkpoint-000000000012.npz").write_bytes(content)
        with pytest.raises(CaromError, match="cannot be used"):
            checkpoint.load(tmp_path / "checkpoint-000000000012.npz")


def test_advice_names_the_line_that_simulates() -> None:
    scene = carom.example("5.4_three_balls", case="frictional").with_options(until=2e-3)
    with pytest.warns(CaromWarning) as told:
        carom.simulate(scene)
    assert {warning.filename for warning in told} == {__file__}


def test_the_typed_options_are_what_their_tool_writes() -> None:
    tool = Path(__file__).parent.parent / "tools" / "keywords.py"
    assert subprocess.run([sys.executable, tool, "--check"], check=False).returncode == 0


@pytest.mark.parametrize("drawn", [False, True])
def test_a_run_that_lost_only_run_json_keeps_its_results(drawn: bool, tmp_path: Path) -> None:
    scene, run = fake_sim.hopping("one"), tmp_path / "run"
    carom.simulate(scene, until=0.1, out=run)
    about = (run / "run.json").read_bytes()
    (run / "run.json").unlink()
    if drawn:
        (run / "plots").mkdir()
        (run / "plots" / "energies.png").touch()
    there = {path.name for path in run.iterdir()}
    told = r"run\.json is missing, and results\.h5, checkpoint-000000000100\.npz of the run are there; put it back"
    for use in (
        carom.load,
        carom.resume,
        lambda path: carom.simulate(scene, until=0.1, out=path, force=True),
    ):
        with pytest.raises(CaromError, match=told):
            use(run)
    assert {path.name for path in run.iterdir()} == there
    (run / "run.json").write_bytes(about)
    assert carom.load(run).outcome.ok
