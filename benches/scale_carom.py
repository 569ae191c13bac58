"""The scene 'pile' in Carom, one run in a process of its own: `python benches/scale_carom.py REQUEST.json`.

The request names N, seed, options of `[run]` and files to write: the answer (JSON) and the last state (NumPy). `tiled` makes
the start of a larger scene out of such a state.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from _memory import peak_memory
from scale_overlap import F64, depth, kinetic

SCENE = Path(__file__).parent.parent / "scenarios" / "pile.toml"
#: Ends of the phases (s): most grains fall, then they settle, then the heap rests.
PHASES = (0.3, 0.6, 1.0)
#: Time between two looks at the overlaps (s), of all programs.
SAMPLE = 0.01
#: What a later run starts from.
KEPT = ("position", "velocity", "angular_velocity")


def model(grains: int, seed: int, options: Mapping[str, Any]) -> tuple[dict[str, Any], float]:
    """The core's model of the scene, and the side of its box (m)."""
    import carom

    scene = carom.Scene.from_toml(SCENE, parameters={"N": grains, "seed": seed}).with_options(**options)
    return scene.to_model(), scene.parameters["side"]


def tiled(
    heap: Mapping[str, F64], copies: tuple[int, int, int], radius: float, side: float
) -> tuple[dict[str, F64], float]:
    """Copies of a settled heap beside and upon each other, and the side of the box around them (m).

    The walls between copies vanish; a layer of copies lies on the highest grain of the one below. All is stretched by the
    deepest overlap there is, so that nothing overlaps at the start. The copies along x and y must be equally many.
    """
    if copies[0] != copies[1]:
        raise ValueError(f"the box is square: as many copies along y as along x, not {copies[:2]}")
    position = heap["position"]
    height = float(position[:, 2].max()) + radius
    where = np.stack(np.meshgrid(*map(np.arange, copies), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    placed = (position[None] + where * np.array([side, side, height])).reshape(-1, 3)
    stretch = 1.0 / (1.0 - depth(placed, radius, copies[0] * side).deepest)
    count = len(where)
    start = {key: np.tile(heap[key], (count, 1)) for key in KEPT} | {"position": placed * stretch}
    return start, copies[0] * side * stretch


def with_start(found: dict[str, Any], start: Mapping[str, F64], side: float) -> dict[str, Any]:
    """The model with another start, in a box of another side."""
    point = found["plane_point"]
    return {**found, **start, "plane_point": np.where(point > 0, side, point)}


def run(ask: Mapping[str, Any]) -> dict[str, Any]:
    """One run; times are those of the core's steps alone."""
    from _measure import state_hash
    from carom import _core
    from carom.run import summary
    from carom.run.allocator import release_early

    found, side = model(ask["grains"], ask["seed"], ask["options"])
    if ask.get("heap"):
        heap = dict(np.load(ask["heap"]))
        start, side = tiled(heap, tuple(ask["copies"]), found["radius"][0], float(heap["side"]))
        found = with_start(found, start, side)
    radius, mass, h = float(found["radius"][0]), float(found["mass"][0]), float(found["options"]["step"])
    release_early(len(found["radius"]))  # as `carom run` does
    begin = time.perf_counter()
    simulation = _core.Simulation(found)
    built = time.perf_counter() - begin
    # A million grains are a tenth of a gigabyte here: memory is measured, and the core has its own.
    start, heap, found = {}, {}, {}
    spent, cpu, deepest, failure = [0.0] * len(PHASES), 0.0, 0.0, None
    each: list[float] = []
    begin_all, every, last = time.monotonic(), max(1, round(SAMPLE / h)), round(ask["until"] / h)
    if ask.get("heap"):
        every = 1  # there each step counts
    while simulation.step < last and time.monotonic() - begin_all < ask["limit"]:
        phase = sum(simulation.time >= end - 1e-9 for end in PHASES)
        before = simulation.step
        begin, begin_cpu = time.perf_counter(), time.process_time()
        outcome = simulation.advance(min(every, last - before), 0, False, ask["limit"])["outcome"]
        seconds = time.perf_counter() - begin
        spent[phase] += seconds
        cpu += time.process_time() - begin_cpu
        each.append(seconds / max(1, simulation.step - before))
        if not ask.get("heap"):
            deepest = max(deepest, depth(simulation.frame()["position"], radius, side).deepest)
        if outcome is not None:
            failure = outcome["kind"]
            break
    frame, totals = simulation.frame(), summary.plain(simulation.monitors())
    end = depth(frame["position"], radius, side)
    kept: dict[str, Any] = {key: frame[key] for key in KEPT}
    np.savez(ask["end"], side=side, **kept)
    return {
        "version": f"Carom {summary.versions()['carom']}",
        "time": simulation.time,
        "step": h,
        "phases": spent,
        "cpu": cpu,
        "slowest": max(each, default=0.0),
        "built": built,
        "memory": peak_memory(),
        "deepest": max(deepest, end.deepest, totals["penetration_max_relative"]),
        "deepest_end": end.deepest,
        "mean_end": end.mean,
        "kinetic": kinetic(mass, radius, frame["velocity"], frame["angular_velocity"]),
        "failure": failure,
        "hash": state_hash(frame),
        "energy_rise": totals["energy"]["max_rise_relative"],
        "counts": {k: totals[k] for k in ("unconverged", "truncated_sequences", "fallbacks", "halvings")},
        "residual": max(totals["residual_position_max"], totals["residual_velocity_max"]),
        "monitors": totals,
        "core_phases": summary.plain(simulation.phases()),
    }


def main(path: str) -> None:
    """Answer the request."""
    ask = json.loads(Path(path).read_text())
    Path(ask["told"]).write_text(json.dumps(run(ask)))


if __name__ == "__main__" and sys.argv[1:2] and sys.argv[1].endswith(".json"):
    main(sys.argv[1])
