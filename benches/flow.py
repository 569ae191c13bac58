"""A cone hopper that empties, Carom beside LAMMPS on one core: `python benches/flow.py`, minutes.

Both get the same grains at the same places (`scenarios/hopper_cone.toml`: a shutter holds them for 0.25 s), take turns in
processes of their own, and are judged by the same functions every 10 ms, outside of what is timed: rate of discharge,
the law of Beverloo at the solid fraction that has settled, deepest overlap. LAMMPS runs at both ends of its usual range of
steps. The table shows of each the run of median CPU time.

    python benches/flow.py --repeat 3
    python benches/flow.py --docs docs/validation/scale.md     # the figures of the page
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import _hopper
import numpy as np
import scale_report as report
from run import about
from scale import HERE, RAYLEIGH, SOFT, answered, peers
from scale_report import Row

SCENE = HERE.parent / "scenarios" / "hopper_cone.toml"
#: Time between two looks at the grains, s.
SAMPLE = 0.01
BEGIN, END = "<!-- printed by benches/flow.py -->", "<!-- end of the flow -->"
HEAD = (
    "program", "grains", "wall s", "CPU s", "grains/s", "over law", "solid", "deepest/r", "left", "unconv.", "MB",
)  # fmt: skip


def model(grains: int, opening: float, tube: float, step: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The core's model of the scene, and its parameters; `opening` (diameter) and `tube` in radii of a grain."""
    import carom

    values = {"N": grains, "D": f"= {opening}*r", "radius": f"= {tube}*r"}
    scene = carom.Scene.from_toml(SCENE, set=values).with_options(step=step, threads=1)
    return scene.to_model(), dict(scene.parameters)


def request(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """What each program is told; the places of the grains go to `start.npy` in `folder`."""
    scene = {"grains": options.grains, "opening": options.opening, "tube": options.tube, "step": options.step}
    found, values = model(**scene)
    np.save(folder / "start.npy", found["position"])
    radius, mass = float(found["radius"][0]), float(found["mass"][0])
    hopper = {"r": radius, "opening": values["D"], "tube": values["radius"], "angle": values["angle"]}
    motion = found["wall_motion"][0][1]["translation"][2][1]  # the table of the shutter's law
    return {
        "scene": scene,
        "grains": options.grains,
        "hopper": hopper,
        "opens": float(motion[1][0]),
        "leave": -float(found["outlet"][0][1][2]),
        "density": mass / (4.0 / 3.0 * np.pi * radius**3),
        "friction": float(found["friction"][0]),
        "restitution": float(found["restitution"][0]),
        "gravity": float(-found["gravity"][2]),
        "sample": SAMPLE,
        "until": options.until,
        "limit": options.limit,
        "threads": 1,
        "start": str(folder / "start.npy"),
        "told": str(folder / "told.json"),
    }


def carom_alone(path: str) -> None:
    """The run of Carom, in a process of its own."""
    from carom import _core
    from carom.run import summary
    from carom.run.allocator import release_early

    ask = json.loads(Path(path).read_text())
    found, _ = model(**ask["scene"])
    release_early(ask["grains"])  # as `carom run` does
    simulation = _core.Simulation(found)
    h = ask["scene"]["step"]
    more: dict[str, Any] = {"version": f"Carom {summary.versions()['carom']}", "step": h}

    def advance(_: int) -> None:
        outcome = simulation.advance(round(SAMPLE / h), 0, False, ask["limit"])["outcome"]
        if outcome is not None:
            raise SystemExit(f"stopped at {simulation.time:.3f} s: {outcome['kind']}")
        more["counts"] = {"unconverged": summary.plain(simulation.monitors())["unconverged"]}

    def look() -> Any:
        frame = simulation.frame()
        return frame["position"][frame["present"]]

    _hopper.run(ask, advance, look, more)


def rows(options: argparse.Namespace, folder: Path) -> Iterator[Row]:
    """All runs, in turns."""
    ask = request(options, folder)
    place = str(folder / "request.json")
    start = peers()["LAMMPS"]
    for _ in range(options.repeat):
        row = Row("Carom", f"h = {options.step:g} s", options.grains, 1, 1, options.until)
        told, why = answered([sys.executable, str(HERE / "flow.py"), place], ask, folder)
        yield replace(row, told=told, why=why)
        for part in options.rayleigh:
            law = f"E = {SOFT:.0e} Pa, T/{1 / part:g}"
            row = replace(row, program="LAMMPS", law=law, young=SOFT)
            if isinstance(start, str):
                yield replace(row, why=start)
                continue
            more = {"young": SOFT, "rayleigh": part}
            told, why = answered([*start, str(HERE / "_lammps_hopper.py"), place], ask | more, folder)
            yield replace(row, told=told, why=why)


def cells(row: Row) -> list[str]:
    """A row of the table."""
    if not row.told:
        return [row.label, str(row.grains), row.why]
    told = row.told
    return [
        row.label, str(row.grains), f"{row.wall:.3g}", f"{told['cpu']:.3g}", f"{told['rate']:.0f}",
        f"{told['rate'] / told['law']:.2f}", f"{told['solid']:.3f}", f"{told['deepest']:.1e}",
        f"{row.grains - told['above'][-1]}",
        str(told["counts"]["unconverged"]) if "counts" in told else report.NOT_GIVEN, f"{told['memory'] / 1e6:.0f}",
    ]  # fmt: skip


def lines(found: list[Row]) -> list[str]:
    """The table and what follows from it."""
    found = report.medians(found)
    parts = [report.aligned([HEAD, *map(cells, found)]), report.spread(found), report.ratios(found)]
    return [line for part in parts if part for line in (*part, "")][:-1]


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="A cone hopper empties: Carom beside LAMMPS, one core.")
    add = parser.add_argument
    add("--grains", type=int, default=3000, metavar="N", help="number of grains (3000)")
    add("--opening", type=float, default=16.0, help="diameter of the opening, in radii of a grain (16)")
    add("--tube", type=float, default=15.0, help="radius of the tube, in radii of a grain (15)")
    add(
        "--repeat", type=int, default=1, metavar="K", help="runs of each row, in turns; the median counts (1)"
    )
    add("--until", type=float, default=1.2, metavar="S", help="simulated time (1.2 s)")
    add("--step", type=float, default=1e-3, metavar="S", help="Carom's time step (1e-3 s)")
    add("--rayleigh", type=float, nargs="*", default=RAYLEIGH, metavar="PART",
        help="LAMMPS' steps, in Rayleigh's times (0.05 0.2)")  # fmt: skip
    add("--limit", type=float, default=1200.0, metavar="S", help="time for a run, judging and all (1200 s)")
    add("--quick", action="store_true", help="Carom alone, 200 grains, opening 12, tube 10, 0.4 s")
    add("--csv", type=Path, metavar="FILE", help="write all figures to FILE with -flow in its name")
    add("--docs", type=Path, metavar="FILE", help="write what is printed into this page of the documentation")
    options = parser.parse_args()
    if options.docs and not options.docs.is_file():
        parser.error(f"--docs {options.docs}: there is no such page to write the figures into")
    if options.quick:
        options.grains, options.opening, options.tube = 200, 12.0, 10.0
        options.until, options.rayleigh = 0.4, []
    return options


def main() -> int:
    """The command."""
    options = arguments()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for row in rows(options, Path(folder)):
            found.append(row)
            print("  ".join(cells(row)), file=sys.stderr, flush=True)
    programs = dict.fromkeys(row.told["version"] for row in found if row.told)
    header = "; ".join([about(), *(p for p in programs if not p.startswith("Carom"))])
    settings = (
        f"opening of {options.opening / 2:g} grains, cone of 30 deg, {options.until:g} s; T is Rayleigh's time; "
        "law: Beverloo, Rose and Tanaka"
    )
    text = "\n".join([f"Hopper: {header}", settings, "", *lines(found)])
    print(text)
    if options.csv:
        path = options.csv.with_name(f"{options.csv.stem}-flow.csv")
        path.parent.mkdir(parents=True, exist_ok=True)
        report.write_csv(found, header, path)
        print(f"\nAll figures: {path}")
    if options.docs:
        report.write_page(text, options.docs, BEGIN, END)
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1].endswith(".json"):
        carom_alone(sys.argv[1])
    else:
        sys.exit(main())
