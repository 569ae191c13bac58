"""Columns of many chunks: once a kill between two pages of a write could tear the index of their chunks, and lose them.

The kernel stops a killed process between two pages of one `pwrite`. Blocks of the index that lay across pages, as those of
2070 bytes from about 2000 chunks on did by chance and those of 4118 from 8181 on always do, were then half new, half old.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import carom
import fake_runs
import h5py
import kill_faults
import kill_long_columns
import kill_scenes
import numpy as np
import pytest
from carom.result.directory import RunDir
from carom.result.record import Segments, blank
from carom.result.record.layout import TABLES
from kill_long_columns import CHUNK_ROWS

PROGRAM = Path(kill_long_columns.__file__)


@pytest.fixture(scope="module")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library that injects faults and lists writes."""
    return kill_faults.built(tmp_path_factory.mktemp("shim"))


def written(folder: Path, shim: Path, *arguments: int, **faults: str | int) -> int:
    """Let another process write a run into `folder`; its exit code."""
    folder.mkdir()
    environment = os.environ | kill_faults.environment(shim, folder, **faults)
    done = subprocess.run(
        [sys.executable, PROGRAM, folder, *map(str, arguments)], env=environment, check=False
    )
    return done.returncode


def check_rows(folder: Path) -> int:
    """Assert that every row that was committed is what was written; returns how many there are."""
    segments = Segments(RunDir(folder).segments())
    rows = segments.rows.steps
    wanted = kill_long_columns.block(0, rows)
    for table in TABLES:
        for name in segments.columns(table):
            found = np.asarray(segments.column(table, name))
            assert np.array_equal(found, wanted[table][name]), f"{table}/{name}"
    segments.close()
    return rows


def raw(path: Path) -> Iterator[range]:
    """Where the rows of a file lie in it."""
    places: list[range] = []

    def look(name: str, found: h5py.Dataset | h5py.Group) -> None:
        if isinstance(found, h5py.Dataset) and found.chunks is not None:
            found.id.chunk_iter(lambda c: places.append(range(c.byte_offset, c.byte_offset + c.size)))

    with h5py.File(path, "r") as file:
        file.visititems(look)
    return iter(places)


def test_whatever_a_kill_can_tear_is_rows(shim: Path, tmp_path: Path) -> None:
    run, split = tmp_path / "run", tmp_path / "split"
    rows = (
        blank.MAX_CHUNKS + 300
    ) * CHUNK_ROWS  # a batch of 900 chunks does not fit into the first file any more
    assert written(run, shim, rows, 300 * CHUNK_ROWS, split=str(split)) == 0
    paths = RunDir(run).segments()
    assert [path.name for path in paths] == ["results.h5", "results-0002.h5"]
    assert check_rows(run) == rows
    torn = [line.rsplit(" ", 2) for line in split.read_text().splitlines()]
    for path in paths:
        starts = {place.start: len(place) for place in raw(path)}
        for name, offset, length in torn:
            if name == str(path):
                assert starts.get(int(offset), 0) >= int(length), f"{length} bytes at {offset} of {path.name}"
    assert any(name == str(paths[1]) for name, _, _ in torn), "large chunks do lie in several pages"


@pytest.mark.parametrize("tries", [3, pytest.param(60, marks=pytest.mark.long)])
def test_killed_where_one_segment_follows_another(tries: int, shim: Path, tmp_path: Path) -> None:
    few, batch, chunks = 4 * CHUNK_ROWS, 2 * CHUNK_ROWS, 5
    counts = []
    for rows in (few, few + batch):  # the second needs another segment
        count = tmp_path / f"count{rows}"
        assert written(tmp_path / f"counted{rows}", shim, rows, batch, chunks, count=str(count)) == 0
        counts.append(int(count.read_text()))
    assert len(RunDir(tmp_path / f"counted{few + batch}").segments()) == 2
    rng = np.random.default_rng(5)
    for k in range(tries):
        run, at = tmp_path / f"run{k}", int(rng.integers(counts[0] - 20, counts[1]))
        code = written(run, shim, few + batch, batch, chunks, at=at, kind=("kill", "torn")[k % 2])
        assert code == -9
        assert few - batch <= check_rows(run) <= few + batch


def test_a_run_over_many_segments_is_the_same_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it was interrupted and continued from a checkpoint that lies before some of them."""
    scene = kill_scenes.two_balls().with_options(until=0.3, every=1, checkpoint_steps=700)
    carom.simulate(scene, out=tmp_path / "whole")
    monkeypatch.setattr(blank, "MAX_CHUNK_ROWS", 64)
    monkeypatch.setattr(blank, "MAX_CHUNKS", 4)
    monkeypatch.setattr("carom.result.record.writer.BATCH_SECONDS", 0.0)
    run = tmp_path / "run"
    fake_runs.interrupted(scene, run, 1000)
    first = RunDir(run).segments()
    assert len(first) > 1
    result = carom.resume(run)
    assert len(result.segment_names) > len(first) + 1
    assert result.segment_names == [name for part in RunDir(run).read()["segments"] for name in part["files"]]
    assert fake_runs.everything(run) == fake_runs.everything(tmp_path / "whole")
