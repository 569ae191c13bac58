"""`carom info`."""

from __future__ import annotations

import warnings
from collections import Counter
from typing import Any

import numpy as np

from carom.cli.options import Json, Run
from carom.cli.output import emit, guarded
from carom.text import table


@guarded
def info(run: Run, as_json: Json = False) -> None:
    """Show what a run directory holds and how the run ended.

    This works on a run in progress, too.

    Example: carom info runs/break-1
    """
    from carom.problem.run_files import kept_files
    from carom.result.directory import size_on_disk
    from carom.run.result import load
    from carom.scene.billiards.marked import table_of

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the state of the run is said below
        result = load(run)
    facts: dict[str, Any] = {
        "directory": str(result.path),
        "title": result.title,
        **({"case": result.case, "parameters": result.parameters} if result.parameters else {}),
        "status": result.status,
        "being_written": result.is_being_written,
        "outcome": str(result.outcome),
        "bodies": len(result.names),
        **({"clumps": clumps} if (clumps := len(result.clumps)) else {}),
        "planes": len(result.planes),
        **({"other_walls": others} if (others := len(result.walls) - len(result.planes)) else {}),
        "steps": len(result.steps),
        "unconverged_steps": int((np.asarray(result.steps["unconverged"]) > 0).sum()),
        "frames": len(result.time),
        "time_first": float(result.time[0]) if len(result.time) else None,
        "time_last": float(result.time[-1]) if len(result.time) else None,
        "impacts": len(result.impacts),
        "contacts": len(result.contacts),
        **({"transitions": count} if (count := len(result.transitions)) else {}),
        **({"stored_problems": len(problems)} if (problems := kept_files(result.path)) else {}),
        "segments": result.segment_names,
        "bytes": size_on_disk(result.path),
        "versions": dict(result.versions),
    }
    if table_of(result) is not None and result.scene.record.impacts and len(result.time):
        facts["shots"] = [str(shot) for shot in result.shots]
    if as_json:
        emit(facts)
        return
    if result.status == "running":
        facts["status"] = (
            "running" if facts["being_written"] else "did not finish; `carom resume` continues it"
        )
        del facts["outcome"]  # there is none yet
    if "other_walls" in facts:
        shapes = Counter(wall.shape for wall in result.walls.values() if wall.shape != "plane")
        facts["other_walls"] = f"{facts['other_walls']} ({', '.join(f'{k} {n}' for k, n in shapes.items())})"
    facts["bytes"] = f"{facts['bytes'] / 1e6:.2f} MB"
    if result.parameters:
        facts["parameters"] = ", ".join(f"{name} = {x:.10g}" for name, x in result.parameters.items())
    if "shots" in facts:
        facts["shots"] = " ".join(facts["shots"]) or "no ball moves at the start"
    facts["segments"] = ", ".join(facts["segments"])
    facts["versions"] = ", ".join(f"{k} {v}" for k, v in facts["versions"].items())
    del facts["being_written"]
    rows = [[key.replace("_", " "), "-" if value is None else str(value)] for key, value in facts.items()]
    blocks = [table(rows, left=(0, 1))]
    if len(result.names) <= 20:
        body = result.bodies
        rows = [["body", "radius (m)", "mass (kg)", "inertia (kg m^2)"]]
        rows += [
            [n, f"{r:g}", f"{m:g}", f"{i:g}"]
            for n, r, m, i in zip(body["name"], body["radius"], body["mass"], body["inertia"], strict=True)
        ]
        blocks.append(table(rows))
    if 0 < len(result.clumps) <= 20:
        rows = [["clump", "balls", "mass (kg)", "principal moments (kg m^2)"]]
        rows += [
            [name, str(len(clump.numbers)), f"{clump.mass:g}", ", ".join(f"{j:g}" for j in clump.moments)]
            for name, clump in result.clumps.items()
        ]
        blocks.append(table(rows))
    print("\n\n".join(blocks))
