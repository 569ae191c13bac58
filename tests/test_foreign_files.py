"""A directory with links, pipes and second names where files of Carom are expected: nothing outside of it changes, nothing
hangs.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import carom
import h5py
import numpy as np
import pytest
from carom import CaromError
from carom.cli.app import app
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
    program = [sys.executable, "-m", "carom", verb, str(run), *more]
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
    from carom.many.sweep.folder import Folder

    study = tmp_path / "study"
    (study / "parts").mkdir(parents=True)
    shutil.rmtree(study / folder, ignore_errors=True)
    (study / folder).symlink_to(victim)
    with pytest.raises(CaromError, match="is a link"), Folder(study).driving():
        Folder(study).run("case")
    assert untouched(victim)


MOVING = """
[[material]]
name = "floor"
[[contact]]
between = ["ivory", "floor"]
friction = 0.3
restitution = 0.0
[[plane]]
name = "floor"
material = "floor"
point = [0.0, 0.0, -0.2]
normal = [0.0, 0.0, 1.0]
motion = { translation = [0.0, 0.0, { expression = "0.01*(1 - cos(12*t))" }] }
"""


@pytest.fixture(scope="module")
def floored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "moving.toml").write_text(SCENARIO.read_text() + MOVING)
    carom.simulate(str(folder / "moving.toml"), out=folder / "run", until=0.02)
    return folder / "run"


def in_results(change: Callable[[h5py.File], object]) -> Callable[[Path], None]:
    def alter(run: Path) -> None:
        with h5py.File(run / "results.h5", "r+") as file:
            change(file)

    return alter


def last_commit(rows: int) -> Callable[[Path], None]:
    return in_results(lambda file: file["commit"].__setitem__(-1, rows))


def constant(key: str, value: object) -> Callable[[Path], None]:
    return in_results(lambda file: file[key].__setitem__(0, value))


def without(table: str, *names: str) -> Callable[[h5py.File], None]:
    """As a Carom before these columns wrote it: not even announced."""

    def alter(file: h5py.File) -> None:
        group = file[table]
        group.attrs["columns"] = [name for name in group.attrs["columns"] if name not in names]
        for name in names:
            del group[name]

    return alter


def junk(run: Path) -> None:
    data = bytearray((run / "results.h5").read_bytes())
    third = len(data) // 3
    data[third : third + len(data) // 50] = b"\xa5" * (len(data) // 50)
    (run / "results.h5").write_bytes(bytes(data))


def test_comparison_replaces_nothing_through_a_link(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "compared"
    folder.mkdir()
    (folder / "nsga").symlink_to(run)
    before = {p.name: p.stat().st_mtime_ns for p in run.iterdir()}
    code, told = carom_says(
        "compare", SCENARIO, "--methods", "nsga,moreau", "--until", "0.01", "-o", folder, "--force"
    )
    assert code == 2, told
    assert "is a link" in told
    assert {p.name: p.stat().st_mtime_ns for p in run.iterdir()} == before


#: What is altered, and what the message must name.
def in_run_json(key: str, value: object) -> Callable[[Path], object]:
    """Another value in `run.json`."""

    def alter(run: Path) -> None:
        about = json.loads((run / "run.json").read_text())
        (run / "run.json").write_text(json.dumps({**about, key: value}))

    return alter


HOSTILE: dict[str, tuple[Callable[[Path], object], str]] = {
    "2^63 rows": (last_commit(2**63), "/commit"),
    "2^62 rows": (last_commit(2**62), "/commit"),
    "one row more": (last_commit(10**6), "rows that count"),
    "gravity is text": (in_results(lambda f: f.attrs.__setitem__("gravity", "down")), "gravity"),
    "gravity has 5 numbers": (in_results(lambda f: f.attrs.__setitem__("gravity", np.zeros(5))), "gravity"),
    "step is 0": (in_results(lambda f: f.attrs.__setitem__("step", 0.0)), "step"),
    "motion is no JSON": (constant("planes/motion", "{bad"), "/planes/motion"),
    "motion is a list": (constant("planes/motion", "[1, 2]"), "/planes/motion"),
    "motion is nested": (constant("planes/motion", "[" * 60000), "/planes/motion"),
    "motion has no law": (constant("planes/motion", '{"translation": [["x", 1]]}'), "/planes/motion"),
    "a radius is NaN": (constant("bodies/radius", np.nan), "/bodies/radius"),
    "no masses": (in_results(lambda f: f.__delitem__("bodies/mass")), "/bodies"),
    "no places": (in_results(lambda f: f.__delitem__("frames/position")), "/frames/position"),
    "no steps": (in_results(lambda f: f.__delitem__("steps")), "no whole /steps; restore"),
    "segments are text": (in_run_json("segments", "abc"), "run.json: segments"),
    "segments are numbers": (in_run_json("segments", [1, 2]), "run.json: segments"),
    "brackets": (lambda run: (run / "run.json").write_text("[" * 200_000), "nested too deeply; restore"),
    "junk": (junk, "results.h5"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_what_others_made_of_a_run_is_refused_with_its_place(
    floored: Path, tmp_path: Path, what: str
) -> None:
    run = Path(shutil.copytree(floored, tmp_path / "run"))
    alter, named = HOSTILE[what]
    alter(run)
    told = {}
    for command in (("view",), ("check",), ("info",), ("resume", "--until", "0.03")):
        done = CliRunner().invoke(app, [command[0], str(run), *command[1:]])
        told[command[0]] = done.stderr
        assert done.exit_code in (0, 2), done.output  # info reads less
        assert done.exit_code == 0 or not done.stdout, "half of the output before an error"
    assert named in told["view"]
    if not told["resume"]:  # damage behind the checkpoint: computed again, and gone
        assert carom_says("check", run)[0] == 0, "it went on with damaged results"
    else:
        assert "results.h5" in told["resume"] or "run.json" in told["resume"]


@pytest.mark.parametrize(
    "name", ["step", "every", "gravity", "start_step", "periodic", "format", "first_rows"]
)
@pytest.mark.parametrize("command", ["info", "check", "plot", "view", "resume", "export"])
def test_no_command_takes_an_attribute_of_another_type(
    floored: Path, tmp_path: Path, name: str, command: str
) -> None:
    run = Path(shutil.copytree(floored, tmp_path / "run"))
    in_results(lambda file: file.attrs.__setitem__(name, "down"))(run)
    more = {"resume": ("--until", "0.03"), "export": ("--format", "csv")}.get(command, ())
    done = CliRunner().invoke(app, [command, str(run), *more])
    assert done.exit_code == 2, done.output
    assert "results.h5" in done.stderr
    assert "take a copy, or run again" in done.stderr


def test_results_before_a_column_are_shown_and_not_judged_or_continued(floored: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(floored, tmp_path / "run"))
    in_results(without("steps", "handovers", "stepped"))(run)
    assert carom_says("info", run)[0] == 0
    for command in (("check",), ("resume", "--until", "0.03")):
        code, told = carom_says(command[0], run, *command[1:])
        assert code == 2, told
        assert "/steps has no column handovers, stepped: an older Carom wrote this run" in told
        assert "damaged" not in told


def test_an_older_first_part_is_not_continued(floored: Path, tmp_path: Path) -> None:
    """The second part has the column that the first one lacks."""
    run = Path(shutil.copytree(floored, tmp_path / "run"))
    carom.resume(run, until=carom.load(run).time[-1] + 0.01)
    assert (run / "results-0002.h5").exists()
    in_results(without("steps", "stepped"))(run)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    assert carom_says("info", run)[0] == 0
    for command in (("check",), ("resume", "--until", "1")):
        code, told = carom_says(command[0], run, *command[1:])
        assert (code, "older Carom" in told) == (2, True), told
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_a_step_beyond_all_floats_is_a_false_claim(floored: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(floored, tmp_path / "run"))
    outcome = json.loads((run / "run.json").read_text())["outcome"]
    in_run_json("outcome", {**outcome, "step": 10**400})(run)
    code, told = carom_says("check", run)
    assert code == 3
    assert "outcome.step" in told


def test_a_key_of_many_parts_is_refused_at_once(tmp_path: Path) -> None:
    """Each part nests a table: 100 000 of them took 40 s and more than 6 GB."""
    scenario = tmp_path / "deep.toml"
    scenario.write_text(".".join(["a"] * 100_000) + " = 1")
    code, told = carom_says("run", scenario)
    assert code == 2
    assert "deep.toml:1: a: a key of 100000 parts; write the tables by their headers" in told


def test_names_are_shown_and_not_obeyed_by_a_terminal(floored: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(floored, tmp_path / "run"))
    constant("bodies/name", "\x1b]0;evil\x07\x9b2J\u202ea")(run)
    about = json.loads((run / "run.json").read_text())
    about["scenario"]["title"] = "\x1b[31mred"
    (run / "run.json").write_text(json.dumps(about))
    for command in (("info",), ("info", "--json"), ("check",), ("plot", "--what", "energies")):
        code, told = carom_says(command[0], run, *command[1:])
        assert code in (0, 3), told
        assert not set("\x1b\x07\x9b\u202e\r") & set(told)


def test_files_whose_names_are_no_text_are_as_others(tmp_path: Path) -> None:
    """Their bytes are lone surrogates in Python, which no UTF-8 has: `run.json` could not be written, nor tables."""
    folder = tmp_path / os.fsdecode(b"folder\x9b")
    folder.mkdir()
    scenario = Path(shutil.copy(SCENARIO, folder / os.fsdecode(b"balls\x9b.toml")))
    run, study = folder / "run", folder / os.fsdecode(b"study\x9b.toml")
    study.write_text(
        f'format = 1\nscenario = "three_balls"\n[parameters]\nstep = [{1e-4}, {2e-4}]\n[run]\nuntil = 0.01\n'
    )
    for words in (
        ("run", scenario, "-o", run, "--until", "0.01"),
        ("info", run),
        ("check", run),
        ("resume", run, "--until", "0.02"),
        ("export", run, "--format", "parquet"),
        ("export", run, "--format", "parquet"),
        ("sweep", study, "-o", folder / "study", "--workers", "0"),
        ("sweep", study, "-o", folder / "study", "--workers", "0"),
    ):
        code, told = carom_says(*words)
        assert code == 0, told
    assert json.loads((run / "run.json").read_text())["scenario"]["file"] == scenario.name
    narrow = {**os.environ, "PYTHONIOENCODING": "ascii"}
    program = [sys.executable, "-m", "carom", "info", str(run)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, env=narrow)
    assert (done.returncode, "folder?" in done.stdout) == (0, True), done.stderr
