"""A directory with links, pipes and second names where files of Carom are expected: nothing outside of it changes, nothing
hangs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import carom
import pytest
from carom.cli.app import app
from carom.errors import CaromError
from typer.testing import CliRunner

SCENARIO = Path(carom.__file__).parent / "scenarios" / "three_balls.toml"
HOLDS = ("plots", "problems", "export", "export/balls")
OWN = ("a.png", "step_000001_velocity_0_0.hdf5", "a.vtp", "b.csv")


def carom_says(*words: object) -> tuple[int, str]:
    """Exit code and all that was printed; a call that hangs fails."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("links") / "run"
    carom.simulate(str(SCENARIO), out=path, until=0.02)
    return path


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "run"))


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    folder = tmp_path / "victim"
    folder.mkdir()
    for name in OWN:
        (folder / name).write_text("mine")
    return folder


def untouched(folder: Path) -> bool:
    return {p.name: p.read_text() for p in folder.iterdir() if p.is_file()} == dict.fromkeys(OWN, "mine")


@pytest.mark.parametrize("name", HOLDS)
def test_force_removes_nothing_through_a_link(run: Path, victim: Path, name: str) -> None:
    (run / name).parent.mkdir(exist_ok=True)
    (run / name).symlink_to(victim)
    carom.simulate(str(SCENARIO), out=run, until=0.01, force=True)
    assert untouched(victim)
    assert len(carom.load(run).time) > 0


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("plots", lambda run: carom_says("plot", run, "--what", "energy")),
        ("export", lambda run: carom_says("export", run, "--format", "csv")),
        (
            "problems",
            lambda run: carom_says("run", SCENARIO, "-o", run, "--force", "--save-problems", "worst:1"),
        ),
        ("export/balls", lambda run: carom_says("export", run, "--format", "vtp")),
    ],
)
def test_nothing_is_written_through_a_link(
    run: Path, victim: Path, name: str, write: Callable[[Path], tuple[int, str]]
) -> None:
    (run / name).parent.mkdir(exist_ok=True)
    (run / name).symlink_to(victim)
    code, told = write(run)
    assert untouched(victim)
    assert (code, "is a link" in told) == (2, True), told


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_the_log_of_another_is_not_written_on(
    run: Path, tmp_path: Path, link: Callable[[Path, Path], None]
) -> None:
    other = tmp_path / "diary"
    other.write_text("dear diary\n")
    (run / "log.jsonl").unlink()
    link(other, run / "log.jsonl")
    code, told = carom_says("resume", run, "--until", "0.03")
    assert other.read_text() == "dear diary\n"
    assert code == 2
    assert "log.jsonl" in told


def test_a_link_under_the_temporary_name_is_not_written_through(run: Path, victim: Path) -> None:
    for name in ("run.json", "results-0002.h5", "scenario.toml"):
        (run / f".{name}.{os.getpid()}.tmp").symlink_to(victim / "a.png")
    carom.resume(run, until=0.03)
    assert untouched(victim)


@pytest.mark.parametrize("name", ["results.h5", "run.json", "scenario.toml", "log.jsonl", "checkpoint"])
@pytest.mark.parametrize("command", [("info",), ("check",), ("resume", "--until", "0.03"), ("view",)])
def test_a_pipe_is_refused_at_once(run: Path, name: str, command: tuple[str, ...]) -> None:
    if name == "checkpoint":
        name = max(path.name for path in run.glob("checkpoint-*.npz"))
    (run / name).unlink()
    os.mkfifo(run / name)
    verb, *more = command
    program = [shutil.which("carom") or "carom", verb, str(run), *more]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2, done.stderr
    assert name in done.stderr
    assert "Carom itself" not in done.stderr


def test_results_elsewhere_may_be_read_through_a_link(run: Path, tmp_path: Path) -> None:
    moved = tmp_path / "archive.h5"
    (run / "results.h5").rename(moved)
    (run / "results.h5").symlink_to(moved)
    before = moved.read_bytes()
    assert carom_says("check", run)[0] == 0
    carom.resume(run, until=0.03)
    assert moved.read_bytes() == before


@pytest.mark.parametrize("folder", ["parts", "runs"])
def test_a_study_stays_in_its_folder(folder: str, tmp_path: Path, victim: Path) -> None:
    from carom.sweeps.folder import Folder

    study = tmp_path / "study"
    (study / "parts").mkdir(parents=True)
    shutil.rmtree(study / folder, ignore_errors=True)
    (study / folder).symlink_to(victim)
    with pytest.raises(CaromError, match="is a link"), Folder(study).driving():
        Folder(study).run("case")
    assert untouched(victim)
