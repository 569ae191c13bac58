"""Carom at work under guard: no socket is opened, and nothing that is read is run, whatever it says it is.

Python tells an audit hook of every socket, process and pickle, from whichever library it comes.
"""

from __future__ import annotations

import io
import json
import os
import pickle
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom.cli.examples import find

GUARD = """
import atexit, json, os, sys

seen = []
WATCHED = ("socket.", "urllib.", "http.", "ftplib.", "smtplib.", "ssl.", "subprocess.", "pickle.",
           "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "code.", "webbrowser.")

def hook(event, arguments):
    if event.startswith(WATCHED):
        frame, where = sys._getframe(1), []
        while frame and len(where) < 12:
            where.append(f"{frame.f_code.co_filename}:{frame.f_lineno}")
            frame = frame.f_back
        seen.append([event, [str(a)[:80] for a in arguments], where])
        if event.startswith("socket.") and event != "socket.gethostname":
            raise PermissionError("the guard allows no socket")

sys.addaudithook(hook)
atexit.register(lambda: open(os.environ["GUARD_LOG"], "w").write(json.dumps(seen)))
"""

PROGRAM = """
import json, os, sys
exec(compile(open(os.environ["GUARD"]).read(), "guard", "exec"))
from carom.cli import main
codes = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["carom", *arguments]
    try:
        main()
        codes.append(0)
    except SystemExit as end:
        codes.append(end.code or 0)
print("CODES", json.dumps(codes))
"""


#: Processes that libraries start by themselves: one of those that are imported asks for the processor, matplotlib for fonts
#: where it has no list of them yet.
LIBRARIES = ("uname", "fc-list")


@dataclass(frozen=True)
class Seen:
    """Exit codes of the commands, all in one process, what the guard saw, and what was printed."""

    codes: list[int]
    events: list[list[Any]]
    text: str

    @property
    def forbidden(self) -> list[list[Any]]:
        return [e for e in self.events if not (e[0] == "subprocess.Popen" and e[1][0] in LIBRARIES)]


def guarded(commands: Sequence[Sequence[str | Path]], folder: Path, *before: str) -> Seen:
    guard, log = folder / "guard.py", folder / "guard.json"
    guard.write_text(GUARD, encoding="utf-8")
    environment = {**os.environ, "GUARD": str(guard), "GUARD_LOG": str(log), "NO_COLOR": "1",
                   "PYTHONPATH": str(Path(carom.__file__).parents[1])}  # fmt: skip
    command = [*before, sys.executable, "-c", PROGRAM, json.dumps([list(map(str, c)) for c in commands])]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    text = done.stdout + done.stderr
    codes = [x for x in done.stdout.splitlines() if x.startswith("CODES ")]
    assert codes, text
    return Seen(json.loads(codes[0][6:]), json.loads(log.read_text()), text)


def work(folder: Path) -> list[list[str]]:
    """What a person does with a run."""
    run, scenario = str(folder / "run"), str(folder / "scenario.toml")
    shutil.copy(find("three_balls"), scenario)
    return [
        ["check", scenario],
        ["run", scenario, "-o", run, "--until", "0.05", "--quiet"],
        ["resume", run, "--until", "0.06", "--quiet"],
        ["info", run],
        ["view", run],
        ["plot", run],
        ["schema"],
    ]


@pytest.mark.long
def test_commands_open_no_socket_and_start_no_process(tmp_path: Path) -> None:
    seen = guarded(work(tmp_path), tmp_path)
    assert seen.codes == [0] * 7, seen.text
    assert (tmp_path / "run" / "view.html").stat().st_size > 100_000
    assert list((tmp_path / "run" / "plots").iterdir())
    assert not seen.forbidden


def test_the_guard_sees_sockets_processes_and_pickles(tmp_path: Path) -> None:
    (tmp_path / "guard.py").write_text(GUARD, encoding="utf-8")
    program = """
import os
exec(open(os.environ["GUARD"]).read())
import pickle, socket, subprocess
try:
    socket.create_connection(("127.0.0.1", 9))
except PermissionError as error:
    print(error)
subprocess.run(["true"])
pickle.loads(pickle.dumps(os.getcwd))
"""
    environment = {
        **os.environ,
        "GUARD": str(tmp_path / "guard.py"),
        "GUARD_LOG": str(tmp_path / "guard.json"),
    }
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, capture_output=True)
    events = {event[0] for event in json.loads((tmp_path / "guard.json").read_text())}
    assert {"subprocess.Popen", "pickle.find_class"} <= events
    assert any(event.startswith("socket.") for event in events)


def lonely() -> bool:
    """Whether processes without any network can be made here."""
    try:
        return subprocess.run(["unshare", "-rn", "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.skipif(not lonely(), reason="needs unshare and user namespaces")
def test_a_machine_without_any_network(tmp_path: Path) -> None:
    """Not even the loopback is up: compiled libraries, which tell no hook, have nothing to talk to either."""
    seen = guarded(work(tmp_path)[:5], tmp_path, "unshare", "-rn")
    assert seen.codes == [0] * 5, seen.text
    assert not seen.forbidden


def traced() -> bool:
    try:
        return subprocess.run(["strace", "-V"], capture_output=True, check=False).returncode == 0 and (
            subprocess.run(["strace", "-o", "/dev/null", "true"], capture_output=True, check=False).returncode == 0
        )  # fmt: skip
    except OSError:
        return False


@pytest.mark.long
@pytest.mark.skipif(not traced(), reason="needs strace, and the right to trace")
def test_the_kernel_is_asked_for_no_socket(tmp_path: Path) -> None:
    log = tmp_path / "calls"
    seen = guarded(work(tmp_path), tmp_path, "strace", "-f", "-o", str(log), "-e", "trace=network")
    assert seen.codes == [0] * 7, seen.text
    assert log.exists()
    calls = [x for x in log.read_text(encoding="utf-8").splitlines() if "AF_INET" in x or "AF_NETLINK" in x]
    assert not calls


# ------------------------------------------------------------------------------------------- data that would be code


class Payload:
    """Writes a file when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    @property
    def text(self) -> str:
        return f"__import__('pathlib').Path('{self.mark}').touch()"

    def __reduce__(self) -> tuple[Any, ...]:
        return open, (str(self.mark), "w")


def test_the_payload_works(tmp_path: Path) -> None:
    pickle.loads(pickle.dumps(Payload(tmp_path / "mark"))).close()
    assert (tmp_path / "mark").exists()


def hostile_checkpoints(run: Path, payload: Payload) -> list[list[str | Path]]:
    """Arrays of Python objects in place of the head and of the first array."""
    array = np.empty(1, dtype=object)
    array[0] = payload
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, allow_pickle=True)
    for path in run.glob("checkpoint-*.npz"):
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        assert {"head.npy", "0.npy"} <= members.keys()
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in members.items():
                archive.writestr(name, buffer.getvalue() if name in ("head.npy", "0.npy") else data)
    return [["resume", run, "--until", "0.06", "--quiet"]]


def hostile_results(run: Path, payload: Payload) -> list[list[str | Path]]:
    """Pickles as an attribute and as a column of bytes, code as text, tags of libraries that read JSON as objects."""
    with h5py.File(run / "results.h5", "r+") as file:
        file.attrs["payload"] = np.void(pickle.dumps(payload))
        file.attrs["title"] = payload.text
        file["frames"].attrs["unit"] = payload.text
        file["bodies/payload"] = np.frombuffer(pickle.dumps(payload), dtype=np.uint8)
        file["bodies/name"][0] = payload.text
    about = json.loads((run / "run.json").read_text())
    about["py/object"], about["py/reduce"], about["title"] = "os.system", [payload.text], payload.text
    (run / "run.json").write_text(json.dumps(about))
    return [["info", run], ["view", run]]


def hostile_scenarios(folder: Path, payload: Payload) -> list[list[str | Path]]:
    """Code where formulas are read, and another language's tag for code."""
    scenario = find("three_balls").read_text(encoding="utf-8")
    changed = [
        scenario.replace("until = ", f'until = "= {payload.text}" #', 1),
        scenario.replace("friction = ", f'friction = {{ expression = "{payload.text}" }} #', 1),
        scenario + f'\n[parameters]\na = "= {payload.text}"\n',
        f"!!python/object/apply:pathlib.Path.touch ['{payload.mark}']\n",
    ]
    assert scenario not in changed
    for k, text in enumerate(changed):
        (folder / f"{k}.toml").write_text(text, encoding="utf-8")
    return [["check", folder / f"{k}.toml"] for k in range(len(changed))]


def hostile_problem(folder: Path, payload: Payload) -> list[list[str | Path]]:
    path = folder / "problem.hdf5"
    shutil.copy(sorted((Path(__file__).parent / "data" / "contact_problems").glob("*.hdf5"))[0], path)
    with h5py.File(path, "r+") as file:
        file.attrs["payload"] = np.void(pickle.dumps(payload))
        file["fclib_local/payload"] = payload.text
    return [["solve", path]]


def test_nothing_that_is_read_is_run(tmp_path: Path) -> None:
    """Neither the payload nor any other pickle, process or socket; exit codes are those of success or of a wrong file."""
    payload = Payload(tmp_path / "mark")
    carom.simulate(carom.Scene.from_toml(find("three_balls")), until=0.05, out=tmp_path / "a")
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    read = [
        *hostile_checkpoints(tmp_path / "a", payload),
        *hostile_scenarios(tmp_path, payload),
        *hostile_results(tmp_path / "b", payload),
        *hostile_problem(tmp_path, payload),
    ]
    seen = guarded(read, tmp_path)
    assert not payload.mark.exists(), seen.text
    assert not seen.forbidden
    assert "Traceback" not in seen.text, seen.text
    # Without a checkpoint that is whole a run may be refused or begun anew; bytes beside the data hurt nobody.
    assert set(seen.codes) <= {0, 2}, seen.text
    assert seen.codes[1:5] == [2] * 4, seen.text
