"""Commands whose standard output or standard error is closed or full, and commands that are terminated: one line if there
is a place for it, and a code.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import carom
import pytest

LOST = "files that the command wrote are kept, what it printed is lost\n"
FULL = f"carom: standard output cannot be written (No space left on device); {LOST}"
CLOSED = f"carom: standard output cannot be written (it is closed); {LOST}"
USAGE = "carom: Missing argument 'RUN'; carom info --help explains it\n"
pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("streams")
    carom.simulate(carom.example("three_balls"), until=0.01, out=folder / "run")
    (folder / "scenario.toml").write_text(carom.load(folder / "run").scenario, encoding="utf-8")
    return folder


def told(folder: Path, line: str, buffered: str = "") -> tuple[str, int]:
    """What a command says on standard error, and its exit code."""
    shell = f"PYTHONUNBUFFERED={buffered} exec {sys.executable} -m carom {line}"
    done = subprocess.run(["sh", "-c", shell], cwd=folder, capture_output=True, text=True, check=False)
    return done.stderr, done.returncode


@pytest.mark.parametrize("buffered", ["", "1"])
@pytest.mark.parametrize(("to", "said"), [(">/dev/full", FULL), (">&-", CLOSED)])
@pytest.mark.parametrize(
    ("command", "before"),
    [
        ("info run --json", ""),
        pytest.param("info run", "", marks=pytest.mark.long),
        ("--version", ""),
        pytest.param("run --help", "", marks=pytest.mark.long),
        ("info --json", USAGE),
        (
            "info nothing --json",
            "carom: nothing: no such run directory; check the path, `carom run SCENARIO` makes one\n",
        ),
    ],
)
def test_output_that_cannot_be_written(
    run: Path, command: str, before: str, to: str, said: str, buffered: str
) -> None:
    assert told(run, f"{command} {to}", buffered) == (before + said, 2)


def test_a_run_without_standard_output_is_whole(run: Path, tmp_path: Path) -> None:
    """No file of results gets its number, 1, and nothing is printed into one."""
    assert told(run, f"run scenario.toml -o {tmp_path / 'a'} --json >&-") == (CLOSED, 2)
    assert told(run, f"run scenario.toml -o {tmp_path / 'b'} -q >&- <&-") == ("", 0)
    for name in ("a", "b"):
        result = carom.load(tmp_path / name)
        assert result.status == "done"
        assert carom.audit.check(result.path).ok


def test_messages_that_cannot_be_written_are_left_out(run: Path) -> None:
    for to in ("2>&-", "2>/dev/full"):
        assert told(run, f"info run --json {to} | head -c 1", "") == ("", 0)
        for command in ("info nothing", "info", "info nothing --json >&-"):
            assert told(run, f"{command} {to}") == ("", 2), command


SLOW = """
import sys, time
import carom.run.result as result
def load(path):
    print("slow", file=sys.stderr, flush=True)
    time.sleep(60)
result.load = load
from carom.cli import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize("arguments", ["info run", "export run", "plot run --json"])
def test_a_command_that_is_terminated_is_interrupted(run: Path, arguments: str) -> None:
    program = [sys.executable, "-c", SLOW, *arguments.split()]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=run
    ) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "slow\n"
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=30)
    assert (err, process.returncode) == ("carom: interrupted\n", 130)
    assert ('"code": 130' in out) == ("--json" in arguments)


STUDY = """
format = 1
scenario = "scenario.toml"
[parameters]
v = { low = 0.1, high = 0.4, count = 4000 }
[set]
"first.velocity.x" = "v"
"""


@pytest.mark.parametrize(
    ("seconds", "by_terminal"),
    [(0.0, False), (1.0, True), *(pytest.param(3.0, of, marks=pytest.mark.long) for of in (False, True))],
)
def test_a_study_that_is_terminated_leaves_nothing_behind(
    run: Path, tmp_path: Path, seconds: float, by_terminal: bool
) -> None:
    """Also while its workers begin, which dask cannot end: folder, processes and semaphores are gone.

    A terminal sends Ctrl-C to the workers too, each of which ended with a traceback.
    """
    pytest.importorskip("distributed", reason="the extra [cluster] is not installed")
    (run / "study.toml").write_text(STUDY, encoding="utf-8")
    command = [sys.executable, "-m", "carom", "sweep", "study.toml", "-o", str(tmp_path / "out"), "-q"]
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    with subprocess.Popen(
        [*command, "--workers", "2", "--no-plots"],
        stderr=subprocess.PIPE,
        text=True,
        cwd=run,
        env=os.environ | {"TMPDIR": str(scratch)},
        start_new_session=True,
    ) as process:
        deadline = time.monotonic() + 60
        while not list(scratch.glob("carom-dask-*")):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(seconds)
        if by_terminal:
            os.killpg(process.pid, signal.SIGINT)
        else:
            process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
    told = f"what was computed is in {tmp_path / 'out'}, and the same command goes on from there"
    assert (err, process.returncode) == (f"carom: interrupted; {told}\n", 130)
    assert list(scratch.iterdir()) == []
