"""Collect contact problems of hard scenes into tests/data/contact_problems, with an index.

    python tools/collect_problems.py                 # all, some minutes
    python tools/collect_problems.py --only box_     # those whose name starts so; the index keeps the others

Of every scene of tools/collection_scenes.py the problems with most iterations are taken. A step that does not converge
is taken as it is and the run goes on: such problems are the hardest there are. Seeded, so that the same Carom
collects the same problems; a Carom with other solvers goes other ways and collects others.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import carom
from carom import CaromWarning, _core
from carom.problem import GlobalProblem, rank_of, residual_of, write_fclib
from carom.problem.kept import describe, multipliers, state
from carom.problem.run_files import origin
from collection_scenes import SCENES, Source

FOLDER = Path(__file__).parent.parent / "tests" / "data" / "contact_problems"
#: Problems of a run among which those to keep are looked for.
LOOKED_AT = 60
#: Rows of W up to which the rank is exact.
RANK_ROWS = 2000


def harvest(source: Source) -> Iterator[dict[str, Any]]:
    """The problems to keep of a scene, as the core gives them: hardest first, levels in turn."""
    options = {"until": 1.0, "step": 1e-3, "on_nonconvergence": "warn", "max_halvings": 0, **source.options}
    simulation = _core.Simulation(source.make().with_options(**options).to_model())
    simulation.keep_problems([(1, source.steps, 1)], 0)
    found: list[dict[str, Any]] = []
    for _ in range(source.steps):
        outcome = simulation.advance(1, 0, False, 0.0)["outcome"]
        found += [p for p in simulation.take_problems(False) if len(p["bounds"]) >= source.least]
        found = [
            p
            for level in ("position", "velocity")
            for p in sorted((p for p in found if p["level"] == level), key=lambda p: -p["iterations"])[
                :LOOKED_AT
            ]
        ]
        if outcome is not None:
            print(f"  {source.name}: {outcome['kind']} at step {outcome['step']}", file=sys.stderr)
            break
    for level, wanted in (("position", source.position), ("velocity", source.velocity)):
        steps: list[int] = []
        for problem in (p for p in found if p["level"] == level):
            if len(steps) < wanted and all(abs(problem["step"] - step) >= source.apart for step in steps):
                steps.append(problem["step"])
                yield problem


def store(source: Source, kept: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Write a problem and return its entry of the index."""
    name = f"{source.name}_{kept['level']}_{kept['step']}"
    title = f"{name}: Carom, {source.make.__doc__ or 'tools/collection_scenes.py'}"
    problem = replace(state(kept, source.form), title=title, description=describe(kept))
    path = folder / f"{name}.hdf5"
    write_fclib(problem, path, extra=origin(kept), compress=True)
    local = problem.to_local() if isinstance(problem, GlobalProblem) else problem
    rank = rank_of(local.W) if local.rows <= RANK_ROWS else None
    return {
        "file": path.name,
        "scene": source.name,
        "form": source.form,
        "level": kept["level"],
        "step": kept["step"],
        "index": kept["index"],
        "contacts": problem.contacts,
        "dimension": problem.dimension,
        "rows": problem.rows,
        "rank": None if rank is None else rank.rank,
        "nullity": None if rank is None else rank.nullity,
        "carom": {
            "version": carom.__version__,
            "converged": bool(kept["converged"]),
            "iterations": kept["iterations"],
            "err": residual_of(local, multipliers(kept)).err,
        },
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", metavar="PREFIX", help="scenes whose name starts so")
    parser.add_argument("-o", "--out", type=Path, default=FOLDER, metavar="DIR")
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    index = given.out / "index.json"
    old = json.loads(index.read_text(encoding="utf-8"))["problems"] if index.is_file() else []
    entries = {entry["file"]: entry for entry in old}
    for source in SCENES:
        if not source.name.startswith(given.only):
            continue
        for name in [name for name, entry in entries.items() if entry["scene"] == source.name]:
            (given.out / name).unlink(missing_ok=True)
            del entries[name]
        start = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)
            new = [store(source, kept, given.out) for kept in harvest(source)]
        entries |= {entry["file"]: entry for entry in new}
        told = ", ".join(f"{e['level'][0]} {e['contacts']}/{e['carom']['iterations']}" for e in new)
        print(
            f"{source.name:22s} {time.perf_counter() - start:6.1f} s  contacts/iterations: {told}", flush=True
        )
        whole = {
            "made_by": "tools/collect_problems.py",
            "problems": [entries[name] for name in sorted(entries)],
        }
        index.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    size = sum(file.stat().st_size for file in given.out.iterdir())
    print(f"{len(entries)} problems, {size / 1e6:.2f} MB in {given.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
