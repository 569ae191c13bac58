"""Ctrl-C while contact problems are solved."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import solve_cases

folder = solve_cases.folder


# --- Ctrl-C -----------------------------------------------------------------------------------------------------------

#: Programs that a shell starts in the background ignore Ctrl-C, and so do theirs.
HEARS = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"

SLOW = f"""
{HEARS}
import sys, time, pytest
sys.path.insert(0, {{tests!r}})
from carom.problem.matrix import Csr
from hypothesis import given, settings
from solver_double import install, sweeps
def solve(*arguments):
    if arguments[4] == 5:
        print("slow", file=sys.stderr, flush=True)
        time.sleep(60)
    return sweeps(*arguments)
install(pytest.MonkeyPatch(), solve)
"""


def started(program: str) -> subprocess.Popen[str]:
    text = SLOW.format(tests=str(Path(__file__).parent)) + program
    process = subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert process.stderr.readline() == "slow\n"
    return process


@pytest.mark.parametrize(
    ("number", "form"),
    [
        (signal.SIGINT, "text"),
        (signal.SIGTERM, "json"),
        pytest.param(signal.SIGINT, "json", marks=pytest.mark.long),
        pytest.param(signal.SIGTERM, "text", marks=pytest.mark.long),
    ],
)
def test_ctrl_c_is_heard_at_once_and_shows_what_is_done(number: int, form: str, folder: Path) -> None:
    options = [] if form == "text" else ["--json"]
    arguments = ["solve", *(str(folder / name) for name in ("a.hdf5", "c.hdf5", "b.h5")), *options]
    process = started(f"from carom.cli import main; main({arguments!r})")
    begin = time.perf_counter()
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert time.perf_counter() - begin < 10.0  # the solver would have slept for 60 s
    assert process.returncode == 130
    assert err == "carom: interrupted: 2 of 3 files are done\n"
    if form == "json":
        document = json.loads(out)
        assert (document["interrupted"], document["code"]) == (True, 130)
        assert [r["verdict"] for r in document["results"]] == ["solved", "solved"]
    else:
        assert out.startswith("2 of 2 solved")


def test_ctrl_c_that_interrupts_no_wait_is_heard_too() -> None:
    """As one that comes while a wait is about to begin: the solver's own thread takes it, and the main one sleeps on."""
    program = """
import signal, threading, time
from carom.problem.solve import _interruptible
def call():
    time.sleep(0.5)  # the other waits by now
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)
    time.sleep(60)
try:
    _interruptible(call, lambda: print("told"))
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", HEARS + program], capture_output=True, text=True, timeout=30)
    assert time.perf_counter() - begin < 20.0  # it would have slept for 60 s
    assert done.stdout == "told\ninterrupted\n", done.stderr


def test_ctrl_c_in_python_leaves_the_session_alive(folder: Path) -> None:
    program = f"""
import carom, time
from carom.problem.solve import is_abandoned
try:
    carom.ContactProblem.from_fclib({str(folder / "b.h5")!r}).solve()
except KeyboardInterrupt:
    print("interrupted", is_abandoned(), carom.ContactProblem.from_fclib({str(folder / "a.hdf5")!r}).solve().converged)
    import os, sys
    sys.stdout.flush()
    os._exit(0)
"""
    process = started(program)
    os.kill(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (out, err) == ("interrupted True True\n", "")


ENDLESS = f"""
{HEARS}
import sys, threading, time
sys.path.insert(0, {str(Path(__file__).parent)!r})
import numpy as np
from carom import _core
from solve_cases import chain
local = chain(4000, -0.5).local  # sweeps take thousands of rounds
zero = np.zeros(local.contacts)
def endless(cancel):
    return _core.solve_contact_problem(local.W.indptr, local.W.indices, local.W.data, local.q, 3, local.mu, zero, zero,
        None, "gauss-seidel", 1e-300, 0, float("inf"), 2, cancel)
"""


def test_the_core_ends_when_it_is_told_to() -> None:
    program = f"""{ENDLESS}
cancel, found = _core.Cancel(), []
thread = threading.Thread(target=lambda: found.append(endless(cancel)))
thread.start()
time.sleep(0.2)
assert thread.is_alive() and not cancel.cancelled
cancel.cancel()
thread.join(10.0)
assert cancel.cancelled
print(thread.is_alive(), found[0]["converged"], bool(np.isfinite(found[0]["r"]).all()), found[0]["wall_s"] >= 0.2)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("False False True True\n", "")


def test_ctrl_c_ends_the_core_too() -> None:
    program = f"""{ENDLESS}
from carom.problem.solve import _interruptible, is_abandoned
cancel = _core.Cancel()
print("ready", flush=True)
try:
    _interruptible(lambda: endless(cancel), cancel.cancel)
except KeyboardInterrupt:
    print("interrupted", is_abandoned())
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (out, err, process.returncode) == ("interrupted False\n", "", 0)
