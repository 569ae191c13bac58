"""Nothing got slower, nothing changed: this build of Carom against an older one, on the examples of the paper.

    python benches/against.py --old FOLDER [--repetitions 7] [--csv FILE]

FOLDER is another working copy with its extension built (`git worktree add FOLDER COMMIT`, then `make dev` there, or
`cargo build --release -p carom-py` and a copy of `target/release/lib_core.so` as `python/carom/_core.abi3.so`). Every
scenario of `scenarios/paper` and of rest (grid, corner), as this copy has it, runs in both, turn by turn, each turn
in a process of its own. Times are the CPU time of the core for the whole scene: of each turn the least of some runs,
of the turns minimum and median. The last state is held against the older one's, `difference` over the largest number
of the same kind; so is every number of `carom reproduce --quick`, but for those that differ between two runs of one
build (times). The Rust bench `break_shot` (the break, four rolling balls) runs in both too, where there is a cargo:
wall time of its one thread. Without --old nothing is run.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from _measure import BREAK, ROOT, child, extremes, rust, state_hash
from run import CORNER, GRID

#: CPU time that a turn spends on one scene at least, s.
TURN = 0.15
#: Steps of the scenes of rest: a second or more of CPU time for the whole ones.
REST_STEPS = 300
KINDS = ("position", "velocity", "angular_velocity", "orientation")
#: Slower by more than this is said.
SLOWER = 1.05


def scenes() -> list[Path]:
    """Scenarios that are run."""
    return [*sorted(BREAK.parent.glob("*.toml")), GRID, CORNER]


def one(path: Path) -> dict[str, Any]:
    """Least CPU time (s) of a scene's steps in this process' Carom, its last state and how hard it was."""
    import carom
    from carom import _core

    scene = carom.Scene.from_toml(path)
    steps = round(float(scene.run.until or 0.0) / scene.run.step)
    if path in (GRID, CORNER):
        steps = min(steps, REST_STEPS)
    simulation = _core.Simulation(scene.to_model())
    start = simulation.state()
    spent: list[float] = []
    while not spent or sum(spent) < TURN:
        simulation.restore(start)
        begin = time.process_time()
        while simulation.step < steps:
            outcome = simulation.advance(min(5000, steps - simulation.step), 0, False, 1e9)["outcome"]
            if outcome is not None:
                raise RuntimeError(f"{path.stem}: the core stopped: {outcome}")
        spent.append(time.process_time() - begin)
    frame = simulation.frame()
    return {
        "steps": steps,
        "cpu": min(spent),
        "hash": state_hash(dict(frame)),
        "frame": {kind: np.asarray(frame[kind]).ravel().tolist() for kind in KINDS},
        "iterations": [simulation.monitors()["iterations"][k]["mean"] for k in ("position", "velocity")],
    }


def turn(package: Path, path: Path) -> dict[str, Any]:
    """`one` by the Carom in the folder `package`."""
    command = [sys.executable, str(Path(__file__)), "--one", str(path), "--package", str(package)]
    environment = {**os.environ, "PYTHONPATH": str(package)}
    found: dict[str, Any] = json.loads(subprocess.check_output(command, env=environment))
    return found


def difference(new: dict[str, Any], old: dict[str, Any]) -> float:
    """Largest difference of two last states, each kind over its largest number."""
    largest = 0.0
    for kind in KINDS:
        a, b = (np.asarray(side["frame"][kind]) for side in (new, old))
        scale = float(np.max(np.abs(b)))
        largest = max(largest, float(np.max(np.abs(a - b))) / (scale or 1.0))
    return largest


def reproduced(package: Path) -> tuple[dict[tuple[str, str, int], float | None], float]:
    """Every number of `carom reproduce --quick` by example, quantity and place; CPU time (s) of the command."""
    program = "import sys; from carom.cli import main; sys.exit(main())"
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PYTHONPATH"] = str(package)
        try:
            _, cpu, _ = child(
                [sys.executable, "-c", program, "reproduce", "--quick", "-q", "-o", f"{folder}/it"]
            )
        finally:
            del os.environ["PYTHONPATH"]
        rows = json.loads(Path(folder, "it", "report.json").read_text(encoding="utf-8"))["rows"]
    table: dict[tuple[str, str, int], float | None] = {}
    for row in rows:
        place = 0
        while (key := (row["example"], row["quantity"], place)) in table:
            place += 1
        table[key] = row["carom"]
    return table, cpu


def tables(new: Path, old: Path) -> list[dict[str, Any]]:
    """What `carom reproduce --quick` prints, of both; two runs each, turn by turn."""
    runs = [[reproduced(package) for package in (old, new)] for _ in range(2)]
    (was, _), (now, _) = runs[0]
    settled = [key for key in now if all(was.get(key) == run[0][0].get(key) for run in runs)]
    settled = [key for key in settled if all(now[key] == run[1][0][key] for run in runs)]
    apart = []
    for key in settled:
        a, b = now[key], was[key]
        if a != b and not (a is not None and b is not None and a != a and b != b):
            apart.append((key, a, b))
    cpu = [[run[side][1] for run in runs] for side in (0, 1)]
    numbers = len([key for key in settled if now[key] is not None])
    print(
        f"\ncarom reproduce --quick: {len(was)} rows before, {len(now)} now; of {numbers} numbers that repeat, "
        f"{len(apart)} differ; CPU {min(cpu[0]):.2f} s before, {min(cpu[1]):.2f} s now"
    )
    for (example, quantity, _), a, b in sorted(apart, key=lambda found: found[0]):
        print(f"  {example}  {quantity}: {b!r} before, {a!r} now")
    return [{"example": key[0], "quantity": key[1], "now": a, "before": b} for key, a, b in apart]


def compare(new: Path, old: Path, repetitions: int) -> list[dict[str, Any]]:
    """The table of scenes."""
    print(f"{'scene':<28}{'steps':>7}{'before, ms':>22}{'now, ms':>22}{'ratio':>15}  difference")
    print(f"{'':<35}{'minimum':>11}{'median':>11}{'minimum':>11}{'median':>11}{'min':>8}{'med':>7}")
    rows = []
    for path in scenes():
        turns = []
        for k in range(repetitions):
            # The one that begins changes: neither always has the warmer machine.
            order = (old, new) if k % 2 == 0 else (new, old)
            turns.append({package: turn(package, path) for package in order})
        was, now = (extremes([1e3 * t[package]["cpu"] for t in turns]) for package in (old, new))
        last = turns[-1]
        apart = difference(last[new], last[old])
        ratio = [now[k] / was[k] for k in (0, 1)]
        row = {
            "scene": path.stem,
            "steps": last[new]["steps"],
            "before_min_ms": was[0],
            "before_median_ms": was[1],
        }
        row |= {"now_min_ms": now[0], "now_median_ms": now[1], "difference": apart}
        row |= {"hash_before": last[old]["hash"], "hash_now": last[new]["hash"]}
        rows.append(row)
        same = "same bits" if last[new]["hash"] == last[old]["hash"] else f"{apart:.1e}"
        if last[new]["iterations"] != last[old]["iterations"]:
            same += ", other iterations"
        slower = "  SLOWER" if min(ratio) > SLOWER else ""
        print(
            f"{path.stem:<28}{last[new]['steps']:>7}{was[0]:>11.3f}{was[1]:>11.3f}{now[0]:>11.3f}{now[1]:>11.3f}"
            f"{ratio[0]:>8.3f}{ratio[1]:>7.3f}  {same}{slower}",
            flush=True,
        )
    return rows


def steps_of_few(new: Path, old: Path, repetitions: int) -> None:
    """The Rust bench of few balls, in both working copies turn by turn: least minimum, median of medians."""
    turns = []
    for k in range(repetitions):
        turns.append({folder: rust(folder, "break_shot")[0] for folder in ((old, new), (new, old))[k % 2]})
    print(
        f"\n{'Rust bench, ms':<35}{'before':>11}{'median':>11}{'now':>11}{'median':>11}{'min':>8}{'med':>7}"
    )
    for name in sorted(turns[0][new].keys() & turns[0][old].keys()):
        times = [[1e3 * t[folder][name][k] for t in turns] for folder in (old, new) for k in (0, 1)]
        was, was_median, now, now_median = (extremes(t)[k % 2] for k, t in enumerate(times))
        same = "same bits" if turns[0][new][name][2] == turns[0][old][name][2] else "other bits"
        print(
            f"{name:<35}{was:>11.3f}{was_median:>11.3f}{now:>11.3f}{now_median:>11.3f}"
            f"{now / was:>8.3f}{now_median / was_median:>7.3f}  {same}"
        )


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--old", type=Path, metavar="FOLDER", help="a working copy of another commit, built")
    options.add_argument("--repetitions", type=int, default=7)
    options.add_argument("--quick", action="store_true", help="three repetitions, no tables of the paper")
    options.add_argument("--csv", type=Path, metavar="FILE")
    options.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options.add_argument("--package", type=Path, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.one is not None:
        import carom

        if not Path(carom.__file__).is_relative_to(given.package):
            raise RuntimeError(f"{carom.__file__} is not the Carom of {given.package}")
        print(json.dumps(one(given.one)))
        return
    if given.old is None:
        print("against an older build: skipped, it needs --old FOLDER (benches/against.py says how)")
        return
    new, old = ROOT / "python", given.old.resolve() / "python"
    if not list((old / "carom").glob("_core*.so")):
        raise SystemExit(f"{given.old} has no built extension (python/carom/_core*.so): run make dev there")
    repetitions = 3 if given.quick else given.repetitions
    rows = compare(new, old, repetitions)
    steps_of_few(ROOT, given.old.resolve(), repetitions)
    if not given.quick:
        tables(new, old)
    if given.csv is not None:
        path = given.csv.with_name(f"{given.csv.stem}-against{given.csv.suffix}")
        with path.open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
