"""What a result shows of a run."""

from __future__ import annotations

import gc
import importlib.util
import pickle
import signal
import subprocess
import sys
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import carom
import fake_sim
import h5py
import numpy as np
import pytest
from carom import CaromError
from carom.many.sweep import Study
from carom.result.record import Column, reader
from carom.run.launch import Run
from hypothesis import given
from hypothesis import strategies as st


@pytest.fixture
def scene() -> carom.Scene:
    return fake_sim.hopping("one", "two")


@pytest.fixture
def result(scene: Any) -> carom.Result:
    """A second of two balls that hop on a plane."""
    found: carom.Result = carom.simulate(scene, until=1.0, every=10)
    return found


def test_shapes_are_those_of_the_contract(result: carom.Result) -> None:
    t, n = 101, 2
    assert result.time.shape == result.step.shape == (t,)
    assert result.position.shape == result.velocity.shape == result.angular_velocity.shape == (t, n, 3)
    assert result.orientation.shape == (t, n, 4)
    assert result.names == ["one", "two"]
    assert result.plane_names == ["bed"]
    assert len(result) == t
    assert len(result.steps) == 1000
    assert result.time[-1] == pytest.approx(1.0)
    assert result.position[0].tolist() == [[0.0, 0.0, 0.3], [0.2, 0.0, 0.4]]
    assert result.outcome.ok
    assert str(result.outcome) == result.status == "done"
    assert result.energy.total.shape == result.energy.time.shape == (1000,)
    assert np.array_equal(result.energy.total, result.energy.kinetic + result.energy.potential)
    assert result.summary["outcome"] == "done"
    assert result.versions["core"] == carom.__version__


def test_a_body_by_its_name(result: carom.Result) -> None:
    body = result["two"]
    assert (body.radius, body.mass, body.inertia) == (0.05, 0.2, pytest.approx(2e-4))
    assert np.array_equal(body.position, np.asarray(result.position)[:, 1])
    assert body.orientation.shape == (101, 4)
    assert body.speed[0] == pytest.approx(0.1)
    assert set(np.asarray(body.impacts["body"])[:, 0]) == {1}
    assert [b.name for b in result] == ["one", "two"]
    with pytest.raises(KeyError, match="did you mean two"):
        result["tow"]
    for number in (0, np.int64(0), -1):
        with pytest.raises(KeyError, match=rf"sel\(body={number}\)"):
            result[number]
    assert result.sel(body=0).names == ["one"]


def test_impacts_are_a_table(result: carom.Result) -> None:
    impacts = result.impacts
    assert impacts.columns[:3] == ["step", "time", "problem"]
    assert {"pair", "impulse", "status", "approach"} <= set(impacts)
    assert impacts.pair[0].tolist() == ["one", "bed"]
    late = impacts.where(np.asarray(impacts.time) > 0.5)
    for rows in (slice(3), slice(1, None, 2), slice(-2, None)):
        assert (impacts[rows]["time"] == np.asarray(impacts["time"])[rows]).all()
        assert (impacts[rows].pair == impacts.pair[rows]).all()
    for wrong in (3, ["time"], np.arange(2)):
        with pytest.raises(KeyError, match=r"write impacts\[2:5\] .* name of a column: step, time"):
            impacts[wrong]
    with pytest.raises(KeyError, match="no column slice"):
        result.bodies[:1]  # type: ignore[index]
    assert 0 < len(late) < len(impacts)
    assert late.time.min() > 0.5
    assert len(late.pair) == len(late)
    assert len(late.where(late["body"][:, 0] == 1)) == np.sum(late["body"][:, 0] == 1)
    assert len(impacts.between("two", "bed")) == len(impacts.between("bed", "two"))
    assert len(impacts.between("one")) + len(impacts.between("two")) == len(impacts)
    assert len(impacts.between("one", "two")) == 0
    assert impacts.unit("impulse") == "N s"
    with pytest.raises(KeyError, match="did you mean impulse"):
        impacts["impulses"]
    with pytest.raises(AttributeError, match="no column"):
        _ = impacts.nothing
    with pytest.raises(KeyError, match="did you mean bed"):
        impacts.between("beds")


def test_contacts_belong_to_frames_and_sum_up_to_the_impacts(result: carom.Result) -> None:
    contacts = result.contacts
    assert len(contacts) == int(result._segments.column("frames", "contact_end")[-1])
    total = sum(result.contacts.at(k).impulse.sum() for k in range(len(result)))
    assert total == pytest.approx(np.asarray(result.impacts.impulse).sum())
    assert contacts.impulse.sum() == pytest.approx(total)
    for k in (0, 50, 100, -1):
        rows = contacts.at(k)
        assert set(rows.frame) <= {k % 101}
        assert np.array_equal(rows.time, np.full(len(rows), float(result.time[k])))
    with pytest.raises(IndexError):
        contacts.at(101)


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")  # advice for the paper's coarse step
def test_residual_histories() -> None:
    result = carom.simulate(carom.example("5.4_three_balls", case="frictional"), until=2e-3)
    step = int(result.residuals.step[0])
    history = result.residuals.history(step)[0]
    assert len(history) > 1
    assert history[-1] < 1e-9 < history[0]
    levels = [len(result.residuals.history(step, level)) for level in ("position", "velocity")]
    assert sum(levels) == len(result.residuals.history(step))
    assert result.residuals.history(0) == []
    assert "value" not in result.residuals.columns
    with pytest.raises(KeyError, match="known: smooth, position, velocity"):
        result.residuals.history(step, "rolling")


def test_columns_act_as_arrays(result: carom.Result) -> None:
    velocity, whole = result.velocity, np.asarray(result.velocity)
    assert np.array_equal(2 * velocity, 2 * whole)
    assert np.array_equal(velocity - velocity, 0 * whole)
    assert np.linalg.norm(velocity, axis=2).shape == (101, 2)
    assert velocity.max() == whole.max()
    assert velocity.unit == "m/s"
    assert [row.shape for row in velocity][:2] == [(2, 3), (2, 3)]
    assert np.array(velocity, dtype=np.float32).dtype == np.float32
    assert "unit m/s" in repr(velocity)
    with pytest.raises(ValueError, match="read-only"):
        whole[0] = 1.0  # it would change what every other reader of the result sees
    with pytest.raises(AttributeError):
        _ = velocity._nothing


INDICES = st.one_of(
    st.integers(-12, 11),
    st.slices(11),
    st.just(Ellipsis),
    st.tuples(st.slices(11), st.integers(-2, 1)),
    st.tuples(st.integers(-11, 10), st.slices(2)),
    st.lists(st.integers(-11, 10), max_size=5).map(lambda x: np.array(x, dtype=np.int64)),
    st.lists(st.booleans(), min_size=11, max_size=11).map(np.array),
)


@given(key=INDICES, cuts=st.lists(st.integers(0, 11), max_size=3), small=st.booleans())
def test_indexing_is_that_of_numpy(key: Any, cuts: list[int], small: bool) -> None:
    """Whether a column is read whole or piece by piece, from one segment or several."""
    values = np.arange(22.0).reshape(11, 2)
    old = reader.CACHE_BYTES
    with h5py.File("indexing", "w", driver="core", backing_store=False) as file:
        edges = [0, *sorted(cuts), 11]
        parts = []
        for i, (a, b) in enumerate(pairwise(edges)):
            torn = np.concatenate([values[a:b], np.full((2, 2), np.nan)])  # rows that were never committed
            parts.append((file.create_dataset(str(i), data=torn), b - a))
        reader.CACHE_BYTES = old if small else 0
        try:
            column = Column(parts)
            try:
                expected = values[key]
            except IndexError:
                with pytest.raises(IndexError):
                    column[key]
                return
            found = column[key]
            assert np.array_equal(found, expected)
            assert np.shape(found) == expected.shape
        finally:
            reader.CACHE_BYTES = old


def test_a_temporary_result_goes_with_its_object_and_can_be_kept(scene: Any, tmp_path: Path) -> None:
    result = carom.simulate(scene, until=0.1)
    path, position = result.path, np.asarray(result.position)
    assert path.exists()
    kept = result.save(tmp_path / "kept")
    with pytest.raises(CaromError, match="exists already"):
        result.save(tmp_path / "kept")
    time = result.time
    del result
    gc.disable()  # it must not need a collection: sweeps make results faster than those come
    assert float(time[-1]) == 0.1  # a column keeps the files open
    del time
    gc.enable()
    assert not path.exists()
    assert np.array_equal(kept.position, position)
    assert np.array_equal(
        carom.load(tmp_path / "kept" / "results.h5").position, position
    )  # a file of it will do


def test_what_is_done_to_the_scene_of_a_result_changes_no_result(scene: Any, tmp_path: Path) -> None:
    result = carom.simulate(scene, until=0.01)
    ran = result.scenario
    result.scene.world.gravity = (0, 0, -1.6)
    assert result.scene.world.gravity[2] == -1.6  # it may be the begin of another one
    assert result.scenario == ran
    kept = result.save(tmp_path / "kept")
    assert kept.scene.world.gravity[2] == result.gravity[2] != -1.6


def test_a_result_can_be_closed(scene: Any, tmp_path: Path) -> None:
    with carom.simulate(scene, until=0.1, out=tmp_path / "run") as result:
        position = np.asarray(result.position)
    assert np.array_equal(result.position, position)  # what was read stays


def test_a_result_is_found_from_another_working_directory(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`out="run"` was looked for in the directory of the moment; it reads "run" as long as that is the same."""
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path)
    moved = carom.simulate(
        scene, until=0.1, out="moved", callback=lambda view: monkeypatch.chdir("other"), callback_every=100
    )
    assert moved.path == tmp_path / "moved"
    monkeypatch.chdir(tmp_path)
    result = carom.simulate(scene, until=0.1, out="run")
    assert str(result.path) == result.origin == "run"
    assert str(tmp_path) not in (tmp_path / "run" / "run.json").read_text()
    sent = pickle.dumps(result)
    monkeypatch.chdir("other")
    assert result.path == pickle.loads(sent).path == tmp_path / "run"
    assert result.view().path == tmp_path / "run" / "view.html"
    assert result.export(format="csv")[0].is_relative_to(tmp_path / "run")
    assert np.array_equal(result.save(tmp_path / "copy").position, pickle.loads(sent).position)
    assert carom.audit.check(result).ok
    assert not list((tmp_path / "other").iterdir())


def test_ctrl_c_in_memory_leaves_what_was_computed(scene: Any) -> None:
    def press(view: Any) -> None:
        if view.step == 300:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt, match="the attribute `result`") as caught:
        carom.simulate(scene, until=1.0, callback=press, callback_every=100)
    result = caught.value.result  # type: ignore[attr-defined]
    assert result.status == "interrupted"
    assert 0.3 <= result.outcome.time < 0.5
    whole = carom.simulate(scene, until=1.0)
    assert np.array_equal(result.steps["energy_kinetic"][:300], whole.steps["energy_kinetic"][:300])


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_a_signal_at_the_end_of_a_run_ends_the_loop_around_it(
    number: str, scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No step is left that could notice it, and the run is whole; a study of many short runs must hear it all the same."""
    heard = signal.Signals[number]
    monkeypatch.setattr(Run, "conclude", _after(Run.conclude, lambda: signal.raise_signal(heard)))
    own: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda n, _: own.append(n))
    try:
        if heard == signal.SIGTERM:  # a handler that returns has the whole result
            assert carom.simulate(scene, until=0.1, out=tmp_path / "run").outcome.ok
            assert carom.resume(tmp_path / "run", until=0.2).outcome.ok
            assert own == [heard, heard]
            return
        for kept in (None, tmp_path / "run"):
            with pytest.raises(KeyboardInterrupt, match="as the run ended") as caught:
                carom.simulate(scene, until=0.1, out=kept)
            assert caught.value.result.outcome.ok  # type: ignore[attr-defined]
            assert caught.value.result.time[-1] == pytest.approx(0.1)  # type: ignore[attr-defined]
        with pytest.raises(KeyboardInterrupt):
            carom.resume(tmp_path / "run", until=0.2)
        study = Study.of(scene, {"until": [0.1, 0.2]}, keep_runs=True)
        with pytest.raises(KeyboardInterrupt):
            carom.sweep(study, tmp_path / "study", workers=0)
        assert len(list(tmp_path.glob("study/runs/*/run.json"))) == 1
    finally:
        signal.signal(signal.SIGTERM, before)


def _after(function: Any, then: Any) -> Any:
    def both(*given: Any) -> Any:
        found = function(*given)
        then()
        return found

    return both


def test_the_repr_says_what_it_is(result: carom.Result) -> None:
    text = repr(result)
    assert text.startswith("<carom.Result 'two balls': done>")
    assert "101 frames, t = 0 to 1 s; 1000 steps" in text
    assert "one, two" in text
    assert repr(result["one"]) == "<body 'one': radius 0.05 m, mass 0.2 kg, 101 frames>"
    assert repr(result.impacts).startswith("<impacts: ")
    assert repr(result.energy).startswith("<energy of 1000 steps: total ")
    assert "residuals" in repr(result.plot)


def test_options_are_checked_before_anything_runs() -> None:
    scene = carom.Scene(run={"until": 1.0})
    with pytest.raises(carom.ScenarioError, match="write until="):
        carom.simulate(scene, untl=1.0)


def test_a_scene_without_an_end_is_refused(scene: Any) -> None:
    with pytest.raises(CaromError, match="until: is missing"):
        carom.simulate(scene, until=None)


def test_advice_reaches_the_caller(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(carom.Scene, "validate", lambda self: ["mind the step"])
    with pytest.warns(UserWarning, match="mind the step"):
        carom.simulate(scene, until=0.01)


def test_a_missing_extra_is_named(result: carom.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("pandas", "xarray"):
        monkeypatch.setitem(sys.modules, package, None)
    for convert in (result.to_pandas, result.to_xarray, result.impacts.to_pandas):
        with pytest.raises(CaromError, match=r"pip install 'carom\[interop\]'"):
            convert()


def test_pandas_and_xarray(result: carom.Result) -> None:
    pytest.importorskip("pandas", reason="the extra [interop] is not installed")
    pytest.importorskip("xarray", reason="the extra [interop] is not installed")
    frame = result.to_pandas()
    assert frame.shape == (202, 13)
    assert frame.loc[(0.0, "two"), "position_z"] == 0.4
    assert result.impacts.to_pandas()["pair_a"][0] == "one"
    assert len(result.steps.to_pandas()) == 1000
    data = result.to_xarray()
    assert data["position"].dims == ("time", "body", "axis")
    assert data["velocity"].attrs["units"] == "m/s"
    assert float(data["position"].sel(body="two", axis="z")[0]) == 0.4


def test_importing_carom_imports_nothing_heavy() -> None:
    program = (
        "import sys, carom; dir(carom);"
        "print(sorted({m.split('.')[0] for m in sys.modules} & {'numpy', 'h5py', 'typer', 'rich', 'pydantic'}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_public_names_are_found_and_others_are_not() -> None:
    for name in carom.__all__:
        assert getattr(carom, name) is not None
        assert name in dir(carom)
    for name in ("billiards", "events", "granular", "packing"):  # modules that the prompt completes
        assert name in dir(carom)
    # A module of the name of a function would hide it as soon as somebody imports that module.
    with warnings.catch_warnings():
        for name in ("simulate", "resume", "load"):
            assert importlib.util.find_spec(f"carom.{name}") is None
            assert callable(getattr(carom, name))
    with pytest.raises(AttributeError, match="no attribute 'simulte'"):
        _ = carom.simulte
