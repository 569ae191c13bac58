"""All benchmarks in one table: `make bench`, or `python benches/run.py [--quick] [--csv FILE]`.

Times are minimum and median over repetitions. "Rust" is the core alone, wall time of its one thread; "CPU" is
process CPU time, which others on the machine disturb less; "wall" is what a person waits. Floors and aims are
those of the performance contract, judged by the median; nothing is asserted here. The hash is of the last
state's bits, so that no speed is bought with another answer.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import _measure as measure
from _measure import BREAK, ROOT, Row

GRID, CORNER = ROOT / "scenarios" / "grid_3x3x3.toml", ROOT / "scenarios" / "corner.toml"
STEPS = 3000
#: Rows of the Rust bench: its name for it, steps to divide by (0: the whole), floor, aim (s).
RUST = {
    "break, 3000 steps": (0, 15e-3, 5e-3),
    "break, 3000 steps, 1000 frames": (0, None, None),
    "break, 30000 steps of 1e-4 s": (0, None, None),
    "four rolling balls, 20000 steps": (20_000, 1.5e-6, 0.5e-6),
}
#: MuJoCo: step and duration of a hit (s). At the paper's step, hits of 2 and 4 ms were tried too: less deep and at 2 ms
#: twice as fast, but balls 4 and 5 lost their symmetry by 4.2 and 0.7 m.
PEERS = ((1e-3, 8e-3), (1e-4, 5e-4))


PREFIXES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"))


def rust_rows(found: dict[str, tuple[float, float, str]]) -> Iterator[Row]:
    """The core alone."""
    for name, (low, median, digest) in found.items():
        steps, floor, aim = RUST.get(name, (0, None, None))
        per = steps or 1
        title = f"{name}: Rust" + (", a step" if steps else "")
        yield Row(title, low / per, median / per, "s", floor, aim, digest)


def core_rows(repetitions: int, quick: bool) -> Iterator[Row]:
    """The core through Python."""
    low, median, digest = measure.core(BREAK, STEPS, repetitions)
    yield Row(f"break, {STEPS} steps: CPU", low, median, "s", 15e-3, 5e-3, digest)
    low, median, digest = measure.core(BREAK, STEPS, repetitions, impact="sequence-paper")
    yield Row(f"break, {STEPS} steps, law sequence-paper: CPU", low, median, "s", None, None, digest)
    low, median, digest = measure.core(BREAK, STEPS, repetitions, every=1)
    yield Row(f"break, {STEPS} steps, every frame and contact: CPU", low, median, "s", None, None, digest)
    low, median, digest = measure.core(BREAK, 10 * STEPS, repetitions, step=1e-4)
    yield Row(f"break, {10 * STEPS} steps of 1e-4 s: CPU", low, median, "s", None, None, digest)
    for path, words, settle in (
        (GRID, "grid of 27 at rest", 1000),
        (CORNER, "ten balls in a corner at rest", STEPS),
    ):
        steps = 100 if quick else 500
        low, median, digest = measure.core(path, steps, repetitions, settle=settle)
        yield Row(f"{words}, a step: CPU", low / steps, median / steps, "s", None, None, digest)


def process_rows(repetitions: int) -> Iterator[Row]:
    """What a person waits for."""
    low, median = measure.imports("import carom", repetitions)
    yield Row("import carom: wall", low, median, "s", 0.3)
    low, median = measure.imports("import carom; carom.Scene, carom.simulate, carom.load", repetitions)
    yield Row("import carom, Scene, simulate and load: wall", low, median)
    runs = measure.whole_runs(repetitions)
    for i, (words, unit, floor) in enumerate(
        (("wall", "s", 1.0), ("CPU", "s", None), ("peak memory", "MB", 150.0))
    ):
        low, median = measure.extremes([run[i] for run in runs])
        yield Row(f"carom run of the break: {words}", low, median, unit, floor)


def recording_rows(quick: bool) -> Iterator[Row]:
    """What recording adds."""
    cases: list[tuple[str, Path, dict[str, Any]]] = [
        ("break, h = 1e-5 s", BREAK, {"step": 1e-5, "every": 300})
    ]
    if not quick:
        cases.append(("grid of 27, h = 4e-5 s", GRID, {"step": 4e-5}))
    for words, path, options in cases:
        wall, cpu, longest = measure.recording(path, 3 if path is BREAK else 2, **options)
        for kind, shares in (("wall", wall), ("CPU", cpu)):
            low, median = measure.extremes([100 * share for share in shares])
            # The contract is about what a person waits, in runs longer than 5 s.
            floor = 10.0 if kind == "wall" and longest > 5 else None
            yield Row(
                f"recording, {words}: {kind} added", low, median, "%", floor, None, f"run of {longest:.2f} s"
            )


def peer_rows(quick: bool) -> Iterator[Row]:
    """Other programs, each with its accuracy, below Carom's."""

    def told(found: dict[str, Any]) -> str:
        return (
            f"sinks in {found['penetration']:.0e} r, mirror {found['mirror']:.0e} m,"
            f" at 0.13 s ball 2 {found['cue']:+.2f}, ball 3 {found['apex']:+.2f} m/s"
        )

    for step, half_period in PEERS[: 1 if quick else None]:
        low, median, _ = measure.core(BREAK, round(3 / step), 5, step=step)
        yield Row(f"Carom, break, h = {step:g} s: CPU", low, median, note=told(measure.accuracy(step)))
        try:
            found = measure.mujoco(step, half_period, 5)
        except (ModuleNotFoundError, OSError) as reason:
            yield Row("MuJoCo, break: skipped", float("nan"), float("nan"), note=str(reason))
            return
        title = f"MuJoCo {found['version']}, h = {step:g} s, hits of {half_period:g} s: CPU"
        yield Row(title, found["min"], found["median"], note=told(found))


def number(x: float | None, unit: str) -> str:
    """A figure with its unit, in the prefix that suits it."""
    if x is None or x != x:
        return ""
    if unit != "s":
        return f"{x:.3g} {unit}"
    factor, name = next((f, n) for f, n in PREFIXES if abs(x) >= f or f == 1e-6)
    return f"{x / factor:.3f} {name}"


def about() -> str:
    """Machine and versions, without names of places."""
    import carom
    import numpy

    model = platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []:
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    load = os.getloadavg()[0]
    parts = [
        f"{model}, {os.cpu_count()} cores, load {load:.1f} at the start",
        f"Carom {carom.__version__}, Python {platform.python_version()}, NumPy {numpy.__version__}",
        platform.system(),
    ]
    return "; ".join(parts)


def printed(row: Row, widths: list[int]) -> str:
    """One line."""
    figures = [number(x, row.unit) for x in (row.low, row.median, row.floor, row.aim)]
    cells = [row.work.ljust(widths[0]), *(f.rjust(w) for f, w in zip(figures, widths[1:], strict=True))]
    return "  ".join([*cells, row.verdict.ljust(20), row.note]).rstrip()


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer repetitions, no long runs")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="also write the figures, SI, to this file")
    options = parser.parse_args()
    repetitions = 5 if options.quick else 15
    header = about()
    print(header, flush=True)
    widths = [62, 10, 10, 8, 8]
    head = ["work", "minimum", "median", "floor", "aim"]
    cells = [head[0].ljust(widths[0]), *(h.rjust(w) for h, w in zip(head[1:], widths[1:], strict=True))]
    print("  ".join([*cells, "by the median".ljust(20), "hash of the last state, or note"]), flush=True)
    rows = []
    found, others = measure.rust()
    for rows_of in (
        rust_rows(found),
        core_rows(repetitions, options.quick),
        process_rows(repetitions),
        recording_rows(options.quick),
        peer_rows(options.quick),
    ):
        for row in rows_of:
            rows.append(row)
            print(printed(row, widths), flush=True)
    notes = {row.work: row.note for row in rows}
    if notes.get(f"break, {STEPS} steps: Rust", "") not in ("", notes[f"break, {STEPS} steps: CPU"]):
        print(
            "\nThe hashes of the break differ: the extension is not built from these sources (`make bench` builds it)."
        )
    if others:
        print(f"\nOther Rust benches\n{others}")
    if options.csv:
        options.csv.parent.mkdir(parents=True, exist_ok=True)
        with options.csv.open("w", newline="", encoding="utf-8") as file:
            file.write(f"# {header}\n")
            writer = csv.writer(file)
            writer.writerow(["work", "unit", "minimum", "median", "floor", "aim", "verdict", "note"])
            writer.writerows(
                [r.work, r.unit, r.low, r.median, r.floor, r.aim, r.verdict, r.note] for r in rows
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
