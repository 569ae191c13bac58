"""Bulk processes of the published benchmark, beside LIGGGHTS and MUSEN: a silo that empties, and a drum of two sizes.

    python validation/bulk/bulk.py --small                                  # all cases with a twentieth of the grains
    python validation/bulk/bulk.py --whole --case silo-large                # 100 000 grains: hours on one core
    python validation/bulk/bulk.py --whole --case silo-large --resume       # goes on where it was interrupted
    python validation/bulk/bulk.py --whole --measure                        # what the runs there are show so far
    python validation/bulk/bulk.py --whole --measure --docs docs/validation/bulk.md

Each case is one run in `RUNS/SIZE-CASE`: the bed settles, then the orifice opens or the drum turns. Ctrl-C and SIGTERM
leave a checkpoint, and there is one every few minutes. `--resume` and `carom resume` both go on from it; only the first
adds to the times. A seed, a step and the like that a run did not begin with are refused then. Beside the runs stand,
for each case, curves as CSV, a figure, and JSON with all numbers. Exit code 1 if a target is missed; one that is not
reached yet is no miss. The cases are in `scenes.py`, the targets in `targets.py`.
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

#: What a run begins with, and cannot change when it goes on.
BEGUN = {
    "seed": 1, "step": 2e-3, "tolerance": 1e-3, "method": "nsga", "friction": 1.0, "restitution": 1.0,
    "rolling_radius": 0.0,
}  # fmt: skip


def begins_with(options: argparse.Namespace) -> dict[str, Any]:
    """The values of `BEGUN` for a new run: those that are given, else the usual ones."""
    given = {key: getattr(options, key) for key in BEGUN}
    return {key: BEGUN[key] if value is None else value for key, value in given.items()}


def differs(place: Path, options: argparse.Namespace) -> str | None:
    """What is wrong with options that a run which goes on would ignore; None where it began with the same."""
    known = options_of(place)
    began = json.loads(known.read_text("utf-8")) if known.is_file() else {}
    for key in BEGUN:
        given, was = getattr(options, key), began.get(key)
        if given is not None and given != was:
            told = "it is not known with which" if was is None else f"with {was}"
            cure = "leave it out, or take another folder for --runs"
            return f"--{key.replace('_', '-')} {given}: {place} began {told}; {cure}"
    return None


def options_of(place: Path) -> Path:
    """Where it stands what a run began with: it is there before the run is."""
    return place.with_name(f"{place.name}.options.json")


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
            own = begins_with(options)
            soft = SOFT if own["method"] == "penalty" else {}
            scene = replace(case, seed=own["seed"]).scene(
                step=own["step"],
                pile_tolerance=own["tolerance"],
                method=own["method"],
                threads=options.threads,
                **soft,
            )
            for law in scene.contacts:
                law.friction *= own["friction"]
                law.restitution *= own["restitution"]
                law.rolling_radius = own["rolling_radius"]
            if not place.exists():
                options_of(place).write_text(json.dumps(own) + "\n", encoding="utf-8")
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
    add("--step", type=float, metavar="S", help="time step (2e-3 s)")
    add("--tolerance", type=float, help="pile_tolerance (1e-3)")
    add(
        "--method",
        choices=("nsga", "moreau", "penalty"),
        help="method in time (nsga); penalty: soft grains as in the other codes, ten times as slow",
    )
    for name in ("friction", "restitution"):
        add(f"--{name}", type=float, metavar="SHARE", help=f"{name} over that of each pair (1)")
    add("--rolling-radius", type=float, metavar="M", help="rolling radius of all pairs (0)")
    add("--seed", type=int, help="seed of the bed (1)")
    add("--threads", type=int, default=1, help="threads (1)")
    add("--json", action="store_true", help="print all numbers as JSON")
    add(
        "--docs",
        type=Path,
        metavar="PAGE",
        help="write the tables into this page, figures and curves into a folder of its name",
    )
    options = parser.parse_args()
    given = next((key for key in BEGUN if getattr(options, key) is not None), None)
    if options.measure and given is not None:
        parser.error(
            f"--{given.replace('_', '-')} does nothing with --measure, which runs nothing; leave it out"
        )
    if options.resume:
        size, cases = ("whole", WHOLE) if options.whole else ("small", SMALL)
        places = [options.runs / f"{size}-{name}" for name in options.case or cases]
        for place in places:
            if place.exists() and (wrong := differs(place, options)) is not None:
                parser.error(wrong)
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
