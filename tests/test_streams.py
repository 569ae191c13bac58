"""Commands whose standard output or standard error is closed or full: one line if there is a place for it, and a code."""

from __future__ import annotations

import subprocess
import sys
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
        ("info nothing --json", "carom: nothing: no such run directory\n"),
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
