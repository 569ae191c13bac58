"""Studies whose driver, workers or scheduler are killed: what was computed stays, and the rest follows."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import carom
import pytest
from carom import CaromError
from sweep_studies import STUDY, written

COMMAND = [sys.executable, "-m", "carom", "sweep", "--no-plots"]


@pytest.fixture
def files(tmp_path: Path) -> Path:
    return written(tmp_path)


@pytest.fixture(autouse=True)
def extras() -> None:
    for name in ("pyarrow", "scipy", "distributed"):
        pytest.importorskip(name, reason="the extra [cluster] is not installed")


def scheduler(folder: Path) -> tuple[subprocess.Popen[str], str]:
    """A scheduler with a worker in a process of its own, and its address."""
    (folder / "cluster.py").write_text(
        "import time\nfrom distributed import LocalCluster\nif __name__ == '__main__':\n"
        "    c = LocalCluster(n_workers=1, threads_per_worker=1, host='127.0.0.1', dashboard_address=None)\n"
        "    print(c.scheduler_address, flush=True)\n    time.sleep(600)\n"
    )
    process = subprocess.Popen(
        [sys.executable, str(folder / "cluster.py")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


def first_part(out: Path, driver: subprocess.Popen[str]) -> None:
    """Wait until the driver of a study has written something."""
    while not list((out / "parts").glob("*.parquet")):
        assert driver.poll() is None
        time.sleep(0.01)


def test_a_killed_driver_loses_nothing_that_was_written(files: Path) -> None:
    (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 600"))
    process = subprocess.Popen(
        [*COMMAND, str(files / "study.toml"), "-o", str(files / "out"), "--workers", "0", "-q"]
    )
    first_part(files / "out", process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    rest = carom.sweep(files / "study.toml", files / "out", workers=0)
    assert 0 < rest.progress.new < 600
    assert len(rest) == rest.ok.sum() == 600


class TestOnACluster:
    """Worker processes of their own, some of which do not live long."""

    def test_a_killed_worker_changes_nothing(self, files: Path) -> None:
        from distributed import LocalCluster

        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 200"))
        killed = []
        with LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
        ) as cluster:

            def kill_one(now: carom.many.sweep.Progress) -> None:
                if not killed:
                    killed.append(next(iter(cluster.workers.values())).pid)
                    os.kill(killed[0], signal.SIGKILL)

            found = carom.sweep(
                files / "study.toml", files / "out", scheduler=cluster.scheduler_address, progress=kill_one
            )
        assert killed
        assert len(found) == found.ok.sum() == 200
        alone = carom.sweep(files / "study.toml", files / "alone", workers=0)
        assert found.table.drop_columns("seconds").equals(alone.table.drop_columns("seconds"))
        assert carom.sweep(files / "study.toml", files / "out", workers=2).progress.new == 0

    def test_a_case_that_kills_workers_is_found_and_the_others_are_done(self, files: Path) -> None:
        def deadly(result: carom.Result) -> dict[str, float]:
            if result["cue"].velocity[0, 0] == 2.0:
                os.kill(os.getpid(), signal.SIGKILL)
            return {"done": 1.0}

        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0, 3.0, 4.0]}, measure=deadly)
        found = carom.sweep(study, files / "out", workers=2)
        assert sorted(found["outcome"].tolist()) == ["done", "done", "done", "worker_died"]
        assert found["outcome"][1] == "worker_died"

    def test_a_scheduler_that_goes_loses_nothing(self, files: Path) -> None:
        (files / "study.toml").write_text(STUDY.replace("count = 16", "count = 2000"))
        process, address = scheduler(files)
        driver = subprocess.Popen(
            [*COMMAND, str(files / "study.toml"), "-o", str(files / "out"), "--scheduler", address, "-q"],
            stderr=subprocess.PIPE,
            text=True,
        )
        first_part(files / "out", driver)
        process.kill()
        process.wait()
        told = driver.communicate(timeout=120)[1]
        assert driver.returncode == 2, told
        assert told.startswith("carom: the scheduler is gone; what was computed stays")
        assert told.count("\n") == 1, "one line, without what dask says of it"
        rest = carom.sweep(files / "study.toml", files / "out", workers=0)
        assert 0 < rest.progress.new < 2000
        assert len(rest) == rest.ok.sum() == 2000

    @pytest.mark.parametrize("says", ["cancelled", "closed"])
    def test_a_scheduler_that_goes_while_a_piece_is_fetched_loses_nothing(
        self, files: Path, says: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # A continuous integration saw an exit code of 1: dask has several errors for a lost scheduler.
        import distributed
        from distributed.client import ClosedClientError, FutureCancelledError

        process, address = scheduler(files)

        def lost(future: Any) -> None:
            process.kill()
            process.wait()
            if says == "cancelled":
                raise FutureCancelledError(future.key, "scheduler-connection-lost")
            while future.client.status == "running":
                time.sleep(0.01)
            raise ClosedClientError("Client is closed.")

        monkeypatch.setattr(distributed.Future, "result", lost)
        with pytest.raises(CaromError, match="the scheduler is gone; what was computed stays"):
            carom.sweep(files / "study.toml", files / "out", scheduler=address)

    def test_a_scheduler_that_goes_while_pieces_are_awaited_loses_nothing(self, files: Path) -> None:
        # dask cancels what it awaits of a lost scheduler; it came out as an error in Carom, below tracebacks of dask.
        process, address = scheduler(files)
        go = files / "go"

        def waits(result: carom.Result) -> dict[str, float]:
            while not go.exists():
                time.sleep(0.02)
            return {"done": 1.0}

        study = carom.Study.of(files / "slide.toml", {"v": [1.0, 2.0, 3.0]}, measure=waits)
        end = threading.Timer(2.0, process.kill)
        end.start()
        try:
            with pytest.raises(CaromError, match="the scheduler is gone; what was computed stays"):
                carom.sweep(study, files / "out", scheduler=address)
        finally:
            end.cancel()
            process.kill()
            process.wait()
            go.touch()
        rest = carom.sweep(study, files / "out", workers=0)
        assert len(rest) == rest.ok.sum() == 3


def test_workers_that_die_while_they_start_are_started_again(files: Path) -> None:
    import psutil  # comes with distributed

    process = subprocess.Popen(
        [*COMMAND, str(files / "study.toml"), "-o", str(files / "out"), "--workers", "2", "-q"],
        stderr=subprocess.PIPE,
        text=True,
    )
    dead = False
    while not dead and process.poll() is None:
        for child in psutil.Process(process.pid).children(recursive=True):
            with suppress(psutil.Error):
                if not dead and "spawn_main" in " ".join(child.cmdline()):
                    child.kill()  # before it can have reached the scheduler
                    dead = True
    _, told = process.communicate(timeout=120)
    assert (dead, process.returncode) == (True, 0), told
    assert "a worker died while it started" in told
    assert len(carom.sweep(files / "study.toml", files / "out", workers=0)) == 16


def test_a_scheduler_that_is_late_is_waited_for(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    monkeypatch.setattr("carom.many.sweep.cluster.ANSWER_SECONDS", 0.5)
    with pytest.raises(CaromError, match="start one with `dask scheduler`"):
        carom.sweep(files / "study.toml", files / "out", scheduler="tcp://127.0.0.1:1")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    here = {"host": "127.0.0.1", "scheduler_port": port, "dashboard_address": None, "processes": False}
    late: list[Any] = []
    timer = threading.Timer(1.0, lambda: late.append(distributed.LocalCluster(n_workers=1, **here)))
    timer.start()
    try:
        found = carom.sweep(files / "study.toml", files / "out", scheduler=f"tcp://127.0.0.1:{port}")
        assert len(found) == found.ok.sum() == 16
    finally:
        timer.join()
        late[0].close()
