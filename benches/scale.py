"""Large piles, Carom beside other programs: `make bench-scale`, or `python benches/scale.py --help`.

All programs get the same grains at the same places (`scenarios/pile.toml`), run one after the other in processes of
their own, and are judged by the same eyes: overlaps are looked at every 10 ms of simulated time, outside of what is timed.
Times are wall time of the steps alone, and CPU time of the (first) process, which others on the machine disturb less.
With `--repeat`, the programs take turns, and the table shows of each the run of median CPU time.

    python benches/scale.py --sizes 1000 8000 --threads 1 2 --csv scale.csv
    python benches/scale.py --sizes 1000 --repeat 3 --only carom lammps peclet-dem
    python benches/scale.py --million                  # steps of 10^6 grains, from copies of a settled heap of 8000
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import scale_report as report
from run import about
from scale_carom import PHASES, SAMPLE, model
from scale_report import Row

HERE = Path(__file__).parent
#: Made by `make bench-scale`; an interpreter with lammps, mpich, peclet-dem and numpy.
PEERS = HERE.parent / ".venv" / "peers" / "bin" / "python"
#: Young's modulus of the peers' grains, Pa: far too soft, as is usual, since their time step is as 1 over its root.
SOFT = 1e7
PROGRAMS = ("carom", "lammps", "yade", "peclet-dem")
#: Steps of the peers in parts of Rayleigh's time: the ends of the range that users take.
RAYLEIGH = (0.05, 0.2)
#: Sweeps over positions and over velocities in a step of peclet-dem.
ITERATIONS = 20
#: The scene of 10^6: copies of a settled heap, and steps.
HEAP, COPIES, MILLION_STEPS = 8000, (5, 5, 5), 50
#: What a program may take (s) beyond the limit for its steps: to start, to be judged, to end.
GRACE = 300.0


def peers() -> dict[str, list[str] | str]:
    """How to start each other program, without threads and request, or why it cannot be started."""
    made = PEERS if PEERS.exists() else None
    python = os.environ.get("CAROM_LAMMPS_PYTHON") or made
    # A folder that an older build made has LAMMPS alone.
    peclet = os.environ.get("CAROM_PECLET_PYTHON") or (
        made if any(PEERS.parent.parent.glob("lib/*/site-packages/peclet")) else None
    )
    yade = os.environ.get("CAROM_YADE") or shutil.which("yade")
    install = "not installed (delete .venv/peers and call `make bench-scale`, or set {})"
    return {
        "LAMMPS": [str(python)] if python else install.format("CAROM_LAMMPS_PYTHON"),
        "YADE": [yade] if yade else "not installed (Debian's package yade, or CAROM_YADE)",
        "peclet-dem": [str(peclet)] if peclet else install.format("CAROM_PECLET_PYTHON"),
    }


def command(program: str, start: Sequence[str], threads: int, request: str) -> list[str]:
    """The command line of one run."""
    if program == "Carom":
        return [sys.executable, str(HERE / "scale_carom.py"), request]
    if program == "YADE":
        return [*start, "-x", "-n", f"-j{threads}", str(HERE / "_yade_pile.py"), request]
    if program == "peclet-dem":
        return [*start, str(HERE / "_peclet_pile.py"), request]
    one = [*start, str(HERE / "_lammps_pile.py"), request]
    return one if threads == 1 else [str(Path(start[0]).with_name("mpiexec")), "-n", str(threads), *one]


def answered(line: Sequence[str], ask: dict[str, Any], folder: Path) -> tuple[dict[str, Any], str]:
    """What a process of its own answers to a request, or why it did not."""
    request, told = folder / "request.json", Path(ask["told"])
    told.unlink(missing_ok=True)
    request.write_text(json.dumps(ask))
    environment = os.environ | {"OMP_NUM_THREADS": str(ask["threads"]), "OMP_PROC_BIND": "false"}
    with open(folder / "output.txt", "w+", encoding="utf-8", errors="replace") as output:
        process = subprocess.Popen(
            line, stdout=output, stderr=subprocess.STDOUT, env=environment, start_new_session=True
        )
        try:
            code = process.wait(ask["limit"] + GRACE)
        except BaseException as error:  # Ctrl-C too: nothing is left running
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            if isinstance(error, subprocess.TimeoutExpired):
                return {}, f"ended after {ask['limit'] + GRACE:g} s"
            raise
        output.seek(0)
        last = next((text for text in reversed(output.read().splitlines()) if text.strip()), "nothing said")
    if not told.exists():
        return {}, f"ended with code {code}: {last.strip()[:160]}"
    answer: dict[str, Any] = json.loads(told.read_text())
    if "end" in ask:
        answer["height"] = float(np.load(ask["end"])["position"][:, 2].mean())
    return answer, ""


class Bench:
    """Runs of one scene after the other."""

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        self.options, self.folder = options, folder
        self.peers = peers()

    def base(self, grains: int, threads: int) -> dict[str, Any]:
        """What each request holds."""
        return {
            "grains": grains,
            "seed": self.options.seed,
            "threads": threads,
            "until": self.options.until,
            "limit": self.options.limit,
            "told": str(self.folder / "told.json"),
            "end": str(self.folder / "end.npz"),
        }

    def carom(self, grains: int, threads: int, law: str, label: str = "", **more: Any) -> Row:
        """One run of Carom; `label` in place of the name of the impact law in the table."""
        chosen = {"impact": law, "threads": threads, "step": self.options.step}
        ask = (
            self.base(grains, threads)
            | {"options": chosen | {"pile_tolerance": self.options.residual}}
            | more
        )
        told, why = answered(
            command("Carom", [], threads, str(self.folder / "request.json")), ask, self.folder
        )
        return Row("Carom", label or law, grains, threads, ask["seed"], ask["until"], told=told, why=why)

    def soft(self, program: str, grains: int, threads: int, young: float, part: float) -> Row:
        """A peer whose grains have Young's modulus `young` (Pa), in steps of `part` of Rayleigh's time."""
        row = Row(
            program,
            f"E = {young:.0e} Pa, T/{1 / part:g}",
            grains,
            threads,
            self.options.seed,
            self.options.until,
            young,
        )
        return self.peer(row, {"young": young, "rayleigh": part})

    def peclet(self, grains: int, threads: int, sleeping: bool) -> Row:
        """peclet-dem, in the steps of Carom; `sleeping` freezes grains that hardly move."""
        law = f"XPBD {ITERATIONS}+{ITERATIONS}, {'sleeping' if sleeping else 'awake'}"
        row = Row("peclet-dem", law, grains, threads, self.options.seed, self.options.until)
        return self.peer(row, {"iterations": ITERATIONS, "sleeping": sleeping, "step": self.options.step})

    def peer(self, row: Row, more: dict[str, Any]) -> Row:
        """`row` with what another program answers, or why it does not."""
        start, grains, threads = self.peers[row.program], row.grains, row.threads
        if isinstance(start, str):
            return replace(row, why=start)
        found, side = model(grains, self.options.seed, {})
        np.save(self.folder / "start.npy", found["position"])
        radius, mass = float(found["radius"][0]), float(found["mass"][0])
        ask = self.base(grains, threads) | {
            "code": str(HERE),
            "start": str(self.folder / "start.npy"),
            "side": side,
            "radius": radius,
            "mass": mass,
            "density": mass / (4.0 / 3.0 * np.pi * radius**3),
            "friction": float(found["friction"][0]),
            "restitution": float(found["restitution"][0]),
            "gravity": float(-found["gravity"][2]),
            "sample": SAMPLE,
            "phases": PHASES,
            **more,
        }
        told, why = answered(
            command(row.program, start, threads, str(self.folder / "request.json")), ask, self.folder
        )
        return replace(row, told=told, why=why)

    def rows(self) -> Iterator[Row]:
        """All that the command line asks for; of repeated runs, all programs run before the first runs again."""
        chosen = self.options.only or PROGRAMS
        for grains in self.options.sizes:
            for threads, _ in product(self.options.threads, range(self.options.repeat)):
                for law in self.options.impact if "carom" in chosen else ():
                    yield self.carom(grains, threads, law)
                for program in ("LAMMPS", "YADE"):
                    if program.lower() in chosen:
                        for young, part in product(self.options.young, self.options.rayleigh):
                            yield self.soft(program, grains, threads, young, part)
                for sleeping in (True, False) if "peclet-dem" in chosen else ():
                    yield self.peclet(grains, threads, sleeping)
        if self.options.million:
            yield from self.million()

    def million(self) -> Iterator[Row]:
        """A settled heap, and steps of copies of it."""
        heap = self.options.heap or self.folder / "heap.npz"
        if not heap.exists():
            row = self.carom(HEAP, max(self.options.threads), "sequence", end=str(heap))
            yield row
            if not row.complete:
                return
        until = MILLION_STEPS * self.options.step
        more = {"heap": str(heap), "copies": COPIES, "until": until}
        grains = HEAP * int(np.prod(COPIES))
        for threads in self.options.threads:
            yield self.carom(grains, threads, "sequence", report.COPIES, **more)


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="Large piles: Carom beside LAMMPS, YADE and peclet-dem.")
    add = parser.add_argument
    add("--sizes", type=int, nargs="*", default=[1000], metavar="N", help="numbers of grains (1000)")
    add("--threads", type=int, nargs="+", default=[1], metavar="T", help="numbers of threads (1)")
    add("--impact", nargs="+", default=["sequence", "one-shot"], help="impact laws (sequence one-shot)")
    add("--only", nargs="+", default=[], choices=PROGRAMS, help="these programs alone")
    add(
        "--repeat", type=int, default=1, metavar="K", help="runs of each row, in turns; the median counts (1)"
    )
    add("--until", type=float, default=1.0, metavar="S", help="simulated time (1 s)")
    add("--step", type=float, default=1e-3, metavar="S", help="Carom's time step (1e-3 s)")
    add("--residual", type=float, default=1e-4, help="Carom's tolerance in piles (1e-4)")
    add("--young", type=float, nargs="+", default=[SOFT], metavar="PA", help="of the peers' grains (1e7 Pa)")
    add(
        "--rayleigh",
        type=float,
        nargs="+",
        default=RAYLEIGH,
        metavar="PART",
        help="the peers' steps, in Rayleigh's times (0.05 0.2)",
    )
    add("--seed", type=int, default=1, help="of the jitter (1)")
    add("--limit", type=float, default=1200.0, metavar="S", help="time for a run, judging and all (1200 s)")
    add(
        "--million",
        action="store_true",
        help="besides, steps of 10^6 grains: copies of a settled heap of 8000",
    )
    add("--heap", type=Path, metavar="FILE", help="the settled heap; made and kept there where it is missing")
    add("--quick", action="store_true", help="Carom alone, 100 grains, 0.1 s")
    add("--csv", type=Path, metavar="FILE", help="write all figures to FILE with -scale in its name")
    add("--docs", type=Path, metavar="FILE", help="write what is printed into this page of the documentation")
    options = parser.parse_args()
    if options.docs and not options.docs.is_file():
        parser.error(f"--docs {options.docs}: there is no such page to write the figures into")
    if options.quick:
        options.sizes, options.only, options.until = [100], ["carom"], 0.1
    return options


def main() -> int:
    """The command."""
    options = arguments()
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(options, Path(folder))
        for row in bench.rows():
            rows.append(row)
            # One line at once, for who waits; the table comes at the end, when all widths are known.
            print("  ".join(row.cells()), file=sys.stderr, flush=True)
    programs = dict.fromkeys(row.told["version"] for row in rows if row.told)
    header = "; ".join([about(), *(p for p in programs if not p.startswith("Carom"))])
    settings = (
        f"h = {options.step:g} s, residual {options.residual:g}, seed {options.seed}, {options.until:g} s; "
        "T is Rayleigh's time"
    )
    text = "\n".join([f"Piles: {header}", settings, "", *report.lines(report.medians(rows))])
    print(text)
    if options.csv:
        path = options.csv.with_name(f"{options.csv.stem}-scale.csv")
        path.parent.mkdir(parents=True, exist_ok=True)
        report.write_csv(rows, header, path)
        print(f"\nAll figures: {path}")
    if options.docs:
        report.write_page(text, options.docs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
