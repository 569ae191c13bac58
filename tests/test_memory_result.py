"""A result in memory: what a run without `out` keeps is what a run directory holds, data set by data set."""

from __future__ import annotations

import pickle
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import Result, Scene
from carom.cli.examples import find
from carom.problem.run_files import FAILING
from carom.result.record.layout import SOMETIMES, TABLES
from carom.scene import plan

#: Scenes of balls, walls that move, balls that come and go, joints and contacts in every frame.
NAMES = ["three_balls", "newtons_cradle", "slide_to_roll", "nine_ball_break", "hopper_slot", "rotating_drum"]


def short(name: str) -> Scene:
    """The scene of a shipped scenario, 60 steps of it, with contacts."""
    scene = Scene.from_toml(find(name))
    assert scene.run.step is not None
    return scene.with_options(until=60 * scene.run.step, every=7, contacts=True)


def columns(result: Result) -> dict[str, Any]:
    """All that the run recorded, by table and column, and what does not change."""
    record = result._segments
    found = {
        f"{t}/{c}": np.asarray(record.column(t, c)) for t in (*TABLES, *SOMETIMES) for c in record.columns(t)
    }
    return found | {
        f"{table}/{name}": values
        for table in ("bodies", "planes", "walls")
        for name, values in record.static(table).items()
    }


def assert_same(a: dict[str, Any], b: dict[str, Any]) -> None:
    """The same data sets with the same bits."""
    assert a.keys() == b.keys()
    assert len(a) > 50
    for name, values in a.items():
        assert values.dtype.kind == b[name].dtype.kind, name
        np.testing.assert_array_equal(values, b[name], err_msg=name)


@pytest.mark.parametrize("name", NAMES)
def test_memory_and_directory_hold_the_same(name: str, tmp_path: Path) -> None:
    memory = carom.simulate(short(name))
    written = carom.simulate(short(name), out=tmp_path / "run")
    assert_same(columns(memory), columns(written))
    assert memory.scenario == written.scenario
    assert memory.status == written.status == "done"
    saved = memory.save(tmp_path / "saved")
    assert_same(columns(memory), columns(saved))
    assert saved.scenario == written.scenario


def test_nothing_is_written_before_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> str:
        raise AssertionError("a temporary folder was made")

    with monkeypatch.context() as patched:
        patched.setattr(tempfile, "mkdtemp", refuse)
        result = carom.simulate(short("three_balls"))
        mass, speed = result.bodies["mass"], np.linalg.norm(result.velocity[-1], axis=1)
        assert result.energy.kinetic[-1] == pytest.approx(0.5 * float(mass @ speed**2), rel=1e-12)
        assert result.scene.names == short("three_balls").names
        assert "kept in memory" in repr(result)
    place = result.path
    assert (place / "run.json").is_file()
    assert_same(columns(result), columns(carom.load(place)))
    del result
    assert not place.exists()


def test_a_result_in_memory_can_be_sent() -> None:
    result = carom.simulate(short("three_balls"))
    sent = pickle.loads(pickle.dumps(result))
    assert_same(columns(result), columns(sent))
    assert sent.scene.names == result.scene.names


def test_threads_may_read_at_the_same_time(request: pytest.FixtureRequest) -> None:
    """Blocks are joined by the first who reads: a second thread found an empty list (IndexError)."""
    expected = carom.simulate(short("three_balls")).impacts.impulse[:]
    threads, often = 4, sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # threads take turns within the first reading
    request.addfinalizer(lambda: sys.setswitchinterval(often))
    for _ in range(20):
        result = carom.simulate(short("three_balls"))
        ready = threading.Barrier(threads)

        def read(result: Result = result, ready: threading.Barrier = ready) -> Any:
            ready.wait()
            return result.impacts.impulse[:]

        with ThreadPoolExecutor(threads) as pool:
            for found in [pool.submit(read) for _ in range(threads)]:
                np.testing.assert_array_equal(found.result(), expected)


def test_a_run_that_fails_in_memory_has_its_problem(tmp_path: Path) -> None:
    """Too few iterations and no halving: the run stops, and what it computed can be saved with the problem."""
    scene = Scene.from_toml(find("pile")).with_options(
        until=1.0,
        max_iterations=1,
        max_halvings=0,
        pile_contacts=10_000,
        gauss_seidel_sweeps=0,
        solver="newton",
    )
    with pytest.raises(carom.RunFailed) as failed:
        carom.simulate(scene)
    saved = failed.value.result.save(tmp_path / "failed")
    assert saved.status == "failed"
    assert (saved.path / FAILING).is_file()


def test_what_would_fill_the_memory_is_refused_before_it_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = short("three_balls")
    with pytest.raises(
        carom.CaromError, match=r"in memory \(at most 8 GiB\); write it to a directory \(out=...\)"
    ):
        carom.simulate(scene, until=1e6)
    monkeypatch.setattr(plan, "MOST_BYTES", 10**4)
    with pytest.raises(carom.CaromError, match=r"keep fewer frames \(every=...\)"):
        carom.simulate(scene)
