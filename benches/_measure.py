"""What run.py measures, one function per kind: the Rust bench, the core through Python, whole processes, peers."""

from __future__ import annotations

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
BREAK = ROOT / "scenarios" / "paper" / "5.6_break.toml"
#: One line of the Rust bench: name, median, minimum, time per step (skipped), hash.
RUST_LINE = re.compile(r"(.+?)\s+([\d.]+) ms median\s+([\d.]+) ms min\s+[\d.]+ us/step\s+([0-9a-f]{16})")


@dataclass(frozen=True)
class Row:
    """One line of the table. Times in s (`unit` "s") or whatever `unit` says; bounds likewise."""

    work: str
    low: float
    median: float
    unit: str = "s"
    floor: float | None = None
    aim: float | None = None
    note: str = ""

    @property
    def verdict(self) -> str:
        """What the median says of floor and aim."""
        told = [
            f"{name} {'met' if self.median <= bound else 'SHORT'}"
            for name, bound in (("floor", self.floor), ("aim", self.aim))
            if bound is not None
        ]
        return ", ".join(told)


def state_hash(frame: dict[str, Any]) -> str:
    """FNV-1a over the words of positions, velocities and spins: the hash of the Rust bench."""
    value = 0xCBF29CE484222325
    words = [
        np.ascontiguousarray(frame[k]).view(np.uint64).ravel()
        for k in ("position", "velocity", "angular_velocity")
    ]
    for word in np.concatenate(words).tolist():
        value = ((value ^ word) * 0x100000001B3) % 2**64
    return f"{value:016x}"


def spread(action: Callable[[], float], repetitions: int) -> tuple[float, float]:
    """Minimum and median of what `action` returns."""
    return extremes([action() for _ in range(repetitions)])


def extremes(values: Sequence[float]) -> tuple[float, float]:
    """Minimum and median."""
    return min(values), statistics.median(values)


def rust(root: Path = ROOT, bench: str = "*") -> tuple[dict[str, tuple[float, float, str]], str]:
    """Minimum, median (s) and hash by name of the Rust bench, and what it printed besides; wall time of one thread."""
    if shutil.which("cargo") is None:
        return {}, "Rust bench skipped: no cargo"
    command = ["cargo", "bench", "--quiet", "--workspace", "--bench", bench]
    done = subprocess.run(command, cwd=root, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        return {}, "Rust bench skipped: cargo bench failed, see above"
    found, others = {}, []
    for line in done.stdout.splitlines():
        match = RUST_LINE.fullmatch(line.strip())
        if match:
            name, median, low, digest = match.groups()
            found[name] = (1e-3 * float(low), 1e-3 * float(median), digest)
        elif line.strip():
            others.append(line)
    return found, "\n".join(others)


def core(
    path: Path, steps: int, repetitions: int, *, settle: int = 0, every: int = 0, **options: Any
) -> tuple[float, float, str]:
    """Minimum and median process CPU time (s) of `steps` steps after `settle`, and the hash of the last state."""
    import carom
    from carom import _core

    simulation = _core.Simulation(carom.Scene.from_toml(path).with_options(**options).to_model())
    _advance(simulation, settle, 0)
    start = simulation.state()

    def once() -> float:
        simulation.restore(start)
        begin = time.process_time()
        _advance(simulation, steps, every)
        return time.process_time() - begin

    low, median = spread(once, repetitions)
    return low, median, state_hash(dict(simulation.frame()))


def _advance(simulation: Any, steps: int, every: int) -> None:
    outcome = simulation.advance(steps, every, every > 0, 1e9)["outcome"]
    if outcome is not None:
        raise RuntimeError(f"the core stopped: {outcome}")


def child(command: Sequence[str]) -> tuple[float, float, float]:
    """Wall time (s), CPU time (s) and peak resident memory (MB, 10^6 bytes) of a process of its own."""
    begin = time.perf_counter()
    # What a run has to say (advice on its step) is not for this table; a failure shows in its code.
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command[:4])} ... ended with code {process.returncode}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6


def imports(statement: str, repetitions: int) -> tuple[float, float]:
    """Minimum and median wall time (s) of a statement in fresh interpreters, their own start left out."""
    program = f"import time; t = time.perf_counter(); {statement}; print(time.perf_counter() - t)"
    return spread(lambda: float(subprocess.check_output([sys.executable, "-c", program])), repetitions)


def whole_runs(repetitions: int) -> list[tuple[float, float, float]]:
    """`carom run` of the break: wall, CPU and memory of each."""
    program = "import sys; from carom.cli import main; sys.exit(main())"
    found = []
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", program, "run", str(BREAK), "-o", f"{folder}/run", "--json"]
            found.append(child(command))
    return found


def recording(path: Path, repetitions: int, **options: Any) -> tuple[list[float], list[float], float]:
    """Shares that recording adds to a run, in wall and in CPU time, and the wall time of the run (s).

    The run is `carom.simulate`, its directory and all; it is held against the same steps of the core alone, each
    pair in turn so that a busy machine meets both.
    """
    import carom
    from carom import _core
    from carom.errors import CaromWarning

    scene = carom.Scene.from_toml(path).with_options(**options)
    steps = round(float(scene.run.until or 0.0) / scene.run.step)
    wall, cpu, longest = [], [], 0.0
    for _ in range(repetitions):
        simulation = _core.Simulation(scene.to_model())
        begin, begin_cpu = time.perf_counter(), time.process_time()
        while simulation.step < steps:
            _advance(simulation, min(5000, steps - simulation.step), 0)
        alone, alone_cpu = time.perf_counter() - begin, time.process_time() - begin_cpu
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)
            begin, begin_cpu = time.perf_counter(), time.process_time()
            with carom.simulate(scene):
                whole, whole_cpu = time.perf_counter() - begin, time.process_time() - begin_cpu
        wall.append(whole / alone - 1)
        cpu.append(whole_cpu / alone_cpu - 1)
        longest = max(longest, whole)
    return wall, cpu, longest


def mujoco(step: float, half_period: float, repetitions: int) -> dict[str, Any]:
    """The break in MuJoCo, see _mujoco_break.py; raises `ModuleNotFoundError` where that is not installed."""
    import importlib.util

    if importlib.util.find_spec("mujoco") is None:
        raise ModuleNotFoundError("mujoco is not installed (pip install 'carom[bench]')")
    script = str(Path(__file__).with_name("_mujoco_break.py"))
    command = [sys.executable, script, str(step), str(half_period), str(repetitions)]
    found: dict[str, Any] = json.loads(subprocess.check_output(command))
    return found


def accuracy(step: float) -> dict[str, float]:
    """The same figures of Carom's break: penetration (radii), mirror error at 3 s (m), v_x of balls 2 and 3 at 0.13 s."""
    import carom
    from carom import _core

    simulation = _core.Simulation(carom.Scene.from_toml(BREAK).with_options(step=step).to_model())
    _advance(simulation, round(0.13 / step), 0)
    after = simulation.frame()["velocity"]
    _advance(simulation, round(3.0 / step) - simulation.step, 0)
    end = simulation.frame()["position"]
    mirror = float(np.max(np.abs(end[2] - (end[3] * [1, -1, 1] + [0, 2 * 0.635, 0]))))
    deepest = float(simulation.monitors()["penetration_max_relative"])
    return {"penetration": deepest, "mirror": mirror, "cue": float(after[0, 0]), "apex": float(after[1, 0])}
