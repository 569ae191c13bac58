"""Stops runs by SIGKILL at random moments, looks at what is left, continues them, and compares every bit.

    python tests/kill_harness.py --kills 200 [--seed 1] [--scene pile]

prints one line a kill. `tests/test_kill.py` does the same with fewer of them.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import carom
import h5py
import kill_scenes
import numpy as np
from carom import CaromError
from carom.result.directory import RunDir
from carom.result.record import Segments
from carom.run import checkpoint
from kill_process import Forked
from numpy.typing import NDArray

CAROM = [sys.executable, "-m", "carom"]
TABLES = ("frames", "contacts", "steps", "impacts", "residuals", "events")
#: Totals of a run that do not depend on the machine.
TOTALS = ("steps", "iterations", "line_search", "impact_problems", "energy", "penetration_max", "bodies")

Data = dict[str, NDArray[Any]]


def recorded(run: Path) -> Data:
    """Everything that a run recorded: all columns of all tables over all its segments."""
    segments = Segments(RunDir(run).segments())
    found = {f"{t}/{c}": np.asarray(segments.column(t, c)) for t in TABLES for c in segments.columns(t)}
    segments.close()
    return found


def differences(
    found: Mapping[str, NDArray[Any]], whole: Mapping[str, NDArray[Any]], *, prefix: bool
) -> list[str]:
    """Names of the columns that differ in type, shape or bits; with `prefix` the whole may go on."""
    wrong = []
    for name in sorted({*found, *whole}):
        if name not in found or name not in whole:
            wrong.append(f"{name} is in one of them only")
            continue
        a, b = found[name], whole[name][: len(found[name])] if prefix else whole[name]
        if a.dtype != b.dtype or a.shape != b.shape or a.tobytes() != b.tobytes():
            wrong.append(f"{name} {a.shape} {b.shape}")
    return wrong


class Rebuilt(RuntimeError):
    """The core is another one than at the start: it makes other bits, and nothing can be said of kills."""


def core() -> str:
    """The build of the core that a new process would load; `checkpoint.build` remembers that of this one."""
    return checkpoint.build.__wrapped__()


@contextmanager
def of_one_build(build: str) -> Iterator[None]:
    """Where what is done inside fails and the core is no longer that `build`, this is what is said of it."""
    try:
        yield
    except (AssertionError, CaromError) as error:
        if core() == build:
            raise
        told = "the core was built anew while this ran, and another build makes other bits: run it again, and leave"
        raise Rebuilt(f"{told} the build alone meanwhile") from error


@dataclass(frozen=True)
class Whole:
    """The run that nobody disturbed: its scenario file, what it recorded, its totals, how long it took, and how long of it
    it computed and wrote (s); and the build of the core that made it.
    """

    name: str
    scenario: Path
    data: Data
    totals: dict[str, Any]
    seconds: float
    driven: float
    build: str


def uninterrupted(name: str, root: Path, share: float = 1.0) -> Whole:
    """Run a scene of `kill_scenes`, or a `share` of its time, to its end."""
    scenario = kill_scenes.write(name, root, share)
    build = checkpoint.build()
    run = root / f"{name}-whole"
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = carom.simulate(carom.Scene.from_toml(scenario), out=run)
    seconds = time.perf_counter() - start
    totals = {k: result.summary.get(k) for k in TOTALS}
    return Whole(name, scenario, recorded(run), totals, seconds, result.summary["wall_s"], build)


@functools.cache
def startup() -> float:
    """Seconds that the process needs before it runs anything."""
    start = time.perf_counter()
    subprocess.run([*CAROM, "run", "--help"], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


Process = subprocess.Popen[str] | Forked


def start(
    run: Path, whole: Whole, *options: str, env: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    """A new run in its own process."""
    return spawn("run", str(whole.scenario), "-o", str(run), *options, env=env)


def spawn(*arguments: str, env: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
    """`carom` in its own process."""
    return subprocess.Popen(
        [*CAROM, *arguments, "--quiet"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **(env or {})},
    )


def kill_after(process: Process, delay: float, wait_for: Path | None = None) -> bool:
    """SIGKILL after `delay` seconds, counted from when `wait_for` is there; False if the process ended before."""
    while wait_for is not None and not wait_for.exists() and process.poll() is None:
        time.sleep(0.001)
    try:
        process.wait(delay)
    except subprocess.TimeoutExpired:
        process.kill()
    _, told = process.communicate()
    assert process.returncode in (0, -signal.SIGKILL), told
    return process.returncode != 0


def fingerprints(run: Path) -> dict[str, str]:
    """A hash of every file of a run."""
    return {p.name: hashlib.blake2b(p.read_bytes()).hexdigest() for p in run.iterdir() if p.is_file()}


def examine(run: Path, whole: Whole) -> str:
    """Assert that what a killed process left is in order; returns how far it had come."""
    if not (run / "run.json").exists():
        return "nothing written"
    for path in checkpoint.found(run):
        checkpoint.load(path)  # each that has its name is whole
    assert len(checkpoint.found(run)) <= checkpoint.KEEP + 1  # killed before it removed the oldest
    assert not RunDir(run).is_being_written()
    if not RunDir(run).segments():
        assert not checkpoint.found(run)
        return "no results yet"
    before = fingerprints(run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = carom.load(run)
        frames = len(result.position)
        result.close()
    wrong = differences(recorded(run), whole.data, prefix=True)
    assert not wrong, wrong
    with h5py.File(run / "results.h5", "r", libver="latest", swmr=True) as file:  # without Carom
        rows = int(file["commit"][-1, 0]) if len(file["commit"]) else 0
        assert file["frames/position"][:rows].tobytes() == whole.data["frames/position"][:rows].tobytes()
    assert fingerprints(run) == before  # reading changes nothing
    if result.status != "running":
        return f"{result.status}"
    return f"{frames} of {len(whole.data['frames/time'])} frames"


def finish(run: Path, whole: Whole, *, by_command: bool) -> None:
    """Continue the run to its end, or start it anew where nothing was written, and compare every bit."""
    if (run / "run.json").exists():
        if by_command:
            process = spawn("resume", str(run))
            _, told = process.communicate()
            assert process.returncode == 0, told
        else:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                carom.resume(run)
    else:
        refused_and_run_anew(run, whole)
    wrong = differences(recorded(run), whole.data, prefix=False)
    assert not wrong, wrong
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is finished
        result = carom.load(run)
    for key, value in whole.totals.items():
        assert result.summary.get(key) == value, key
    result.close()
    scraps = [p.name for p in run.iterdir() if p.name.endswith((".tmp", ".aside"))]
    assert not scraps, scraps


def refused_and_run_anew(run: Path, whole: Whole) -> None:
    """A run that was killed before it had begun cannot be continued, which is said, and is started again."""
    try:
        carom.resume(run)
    except CaromError as error:
        told = str(error)
    else:
        raise AssertionError("there was nothing to continue")
    if not run.exists():
        assert "no such run directory" in told
    else:
        assert "stopped" in told
        assert "before it wrote anything" in told
        assert "--force" in told
    process = start(run, whole, "--force")
    _, told = process.communicate()
    assert process.returncode == 0, told


def kill_once(whole: Whole, run: Path, rng: np.random.Generator, *, by_command: bool, again: float) -> str:
    """Start a run, kill it at a random moment, with probability `again` its continuation too, and finish it.

    `by_command` all processes are those of the command line; without, forks of a warm one, and the last continuation is
    in this process. Returns what was met.
    """

    def begin(*arguments: str) -> Process:
        return spawn(*arguments) if by_command else Forked([*arguments, "--quiet"])

    with of_one_build(whole.build):
        return _kill_once(whole, run, rng, begin, by_command=by_command, again=again)


def _kill_once(
    whole: Whole,
    run: Path,
    rng: np.random.Generator,
    begin: Callable[..., Process],
    *,
    by_command: bool,
    again: float,
) -> str:
    begun = (startup() if by_command else 0.0) + whole.seconds - whole.driven  # s until it computes
    late = rng.random() < 0.8  # most of them after start-up, which takes as long as such a run
    span = 0.9 * whole.driven if late else begun
    killed = False
    while not killed:  # a run that ended before it was killed is started again and killed sooner
        process = begin("run", str(whole.scenario), "-o", str(run), "--force")
        killed = kill_after(process, span * rng.random(), run / "results.h5" if late else None)
        span *= 0.8
    met = [examine(run, whole)]
    while killed and (run / "run.json").exists() and rng.random() < again:
        process = begin("resume", str(run))
        killed = kill_after(process, max(0.0, begun + whole.driven * (rng.random() - 0.3)))
        met.append(f"resumed: {examine(run, whole) if killed else 'ended before'}")
    finish(run, whole, by_command=by_command)
    return "; ".join(met)


def main() -> int:
    """Kill many runs and print what was met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scene", choices=list(kill_scenes.SCENES), action="append")
    asked = parser.parse_args()
    names = asked.scene or list(kill_scenes.SCENES)
    survived: Counter[str] = Counter()
    tried: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        startup()
        wholes = {name: uninterrupted(name, root) for name in names}
        for k in range(asked.kills):
            whole = wholes[names[k % len(names)]]
            tried[whole.name] += 1
            rng = np.random.default_rng([asked.seed, k])
            try:
                met = kill_once(whole, root / f"run{k}", rng, by_command=True, again=0.4)
                survived[whole.name] += 1
            except AssertionError as error:
                met = f"FAILED: {error}"
            except Rebuilt as stopped:
                print(f"stopped after {k} kills: {stopped}")
                return 2
            print(f"{k:4} {whole.name:15} {met}", flush=True)
    print(f"{sum(survived.values())} of {sum(tried.values())} survived", dict(survived))
    return 0 if survived == tried else 1


if __name__ == "__main__":
    raise SystemExit(main())
