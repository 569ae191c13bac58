"""Bulk processes of the published benchmark, beside LIGGGHTS and MUSEN: a silo that empties, and a drum of two sizes.

    python validation/bulk/bulk.py --small                                  # all cases with a twentieth of the grains
    python validation/bulk/bulk.py --whole --case silo-large                # 100 000 grains: hours on one core
    python validation/bulk/bulk.py --whole --case silo-large --resume       # goes on where it was interrupted
    python validation/bulk/bulk.py --whole --measure                        # what the runs there are show so far
    python validation/bulk/bulk.py --whole --measure --docs docs/validation/bulk.md

Each case is one run in `RUNS/SIZE-CASE`: the bed settles, then the orifice opens or the drum turns. Ctrl-C and SIGTERM
leave a checkpoint, and there is one every few minutes. `--resume` and `carom resume` both go on from it; only the first
adds to the times. Beside the runs stand, for each case, curves as CSV, a figure, and JSON with all numbers. Exit code 1
if a target is missed; one that is not reached yet is no miss. The cases are in `scenes.py`, the targets in `targets.py`.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import carom
import report
from carom.cli.progress import LineBar, facts
from scenes import SETTLING, SMALL, WHOLE, Case

#: Grains that overlap and push back as in LIGGGHTS and MUSEN: Hertz and Mindlin, softer than glass so that steps are longer.
SOFT = {
    "penalty_young_modulus": 2e7, "penalty_poisson_ratio": 0.25, "penalty_friction": "spring",
    "penalty_resolution": 15,
}  # fmt: skip


class Bar(LineBar):
    """Progress of a run: a bar on a terminal, a line now and then elsewhere."""

    def __call__(self, now: Any) -> None:
        self.tell(now.step, now.steps, facts(now), now.wall_s)


def timed(place: Path, work: Callable[[], carom.Result]) -> carom.Result:
    """The result of one part of the run; its times are added to those of the others, also of an interrupted one."""
    cpu = time.process_time()
    try:
        return work()
    finally:
        part = {"cpu_s": time.process_time() - cpu}
        if place.is_dir():
            reached = float(carom.load(place).steps["time"][-1])
            with (place / report.TIMES).open("a", encoding="utf-8") as file:
                file.write(json.dumps(part | {"until": reached}) + "\n")


def run(case: Case, place: Path, options: argparse.Namespace) -> None:
    """Settle the bed, then let it flow; or go on with what there is."""
    until = SETTLING + (case.duration if options.duration is None else options.duration)
    bar = Bar()
    try:
        if not options.resume or not place.exists():
            soft = SOFT if options.method == "penalty" else {}
            scene = replace(case, seed=options.seed).scene(
                step=options.step,
                pile_tolerance=options.tolerance,
                method=options.method,
                threads=options.threads,
                **soft,
            )
            for law in scene.contacts:
                law.friction *= options.friction
                law.restitution *= options.restitution
                law.rolling_radius = options.rolling_radius
            timed(place, lambda: carom.simulate(scene, out=place, until=SETTLING, progress=bar))
            bar.stop()
            bar = Bar()
        timed(place, lambda: carom.resume(place, until=until, threads=options.threads, progress=bar))
    finally:
        bar.stop()


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    size = parser.add_mutually_exclusive_group(required=True)
    size.add_argument("--small", action="store_true", help="a twentieth of the grains")
    size.add_argument("--whole", action="store_true", help="as published")
    add("--case", choices=[*WHOLE], action="append", help="may be repeated; all without it")
    add(
        "--runs",
        type=Path,
        default=Path("runs/bulk"),
        metavar="FOLDER",
        help="where runs are kept (runs/bulk)",
    )
    add("--resume", action="store_true", help="go on with interrupted runs; begin those that are not there")
    add("--measure", action="store_true", help="run nothing, and measure what is there")
    add("--audit", action="store_true", help="judge each run by `carom check` as well")
    add("--duration", type=float, metavar="S", help="time after the bed has settled, if not all of it")
    add("--step", type=float, default=2e-3, metavar="S", help="time step (2e-3 s)")
    add("--tolerance", type=float, default=1e-3, help="pile_tolerance (1e-3)")
    add(
        "--method",
        choices=("nsga", "moreau", "penalty"),
        default="nsga",
        help="method in time (nsga); penalty: soft grains as in the other codes, ten times as slow",
    )
    for name in ("friction", "restitution"):
        add(f"--{name}", type=float, default=1.0, metavar="SHARE", help=f"{name} over that of each pair (1)")
    add("--rolling-radius", type=float, default=0.0, metavar="M", help="rolling radius of all pairs (0)")
    add("--seed", type=int, default=1, help="seed of the bed (1)")
    add("--threads", type=int, default=1, help="threads (1)")
    add("--json", action="store_true", help="print all numbers as JSON")
    add(
        "--docs",
        type=Path,
        metavar="PAGE",
        help="write the tables into this page, figures and curves into a folder of its name",
    )
    options = parser.parse_args()
    if options.docs and not options.docs.is_file():
        parser.error(f"--docs {options.docs}: there is no such page")
    return options


def main() -> int:
    """The command."""
    options = arguments()
    # The run leaves its checkpoint at SIGTERM; then the times are written, too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
    warnings.simplefilter("ignore", carom.CaromWarning)
    cases = WHOLE if options.whole else SMALL
    size = "whole" if options.whole else "small"
    options.runs.mkdir(parents=True, exist_ok=True)
    found = []
    for name in options.case or cases:
        place = options.runs / f"{size}-{name}"
        if not options.measure:
            run(cases[name], place, options)
        elif not place.is_dir():
            continue
        found.append(report.Found.of(name, cases[name], place, whole=options.whole, audit=options.audit))
        found[-1].write(options.runs / f"{size}-{name}")
    if options.json:
        print(json.dumps([f.numbers for f in found], indent=2))
    else:
        print(report.text(found))
    if options.docs:
        report.write_page(found, options.docs)
    return int(any(f.missed for f in found))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt as stopped:
        print(f"\n{stopped or 'interrupted'}", file=sys.stderr)
        sys.exit(130)
