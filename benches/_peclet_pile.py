"""The scene 'pile' in peclet-dem: `python _peclet_pile.py REQUEST.json`, in an interpreter with peclet-dem and numpy.

Position-based dynamics (XPBD) of rigid grains: in each step, sweeps over the positions and sweeps over the velocities.
The program computes in single precision.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from _memory import peak_memory
from scale_overlap import depth, kinetic


def scene(ask: dict[str, Any], start: np.ndarray[Any, Any]) -> Any:
    """The simulation before its first step."""
    from peclet import dem

    r, side = ask["radius"], ask["side"]
    simulation = dem.Simulation(capacity=len(start))
    simulation.initialize_shape("sphere", 1.0)
    simulation.set_global_scale(r)
    top = float(start[:, 2].max()) + 10 * r
    simulation.set_domain(extent=(side, side, top), origin=(0, 0, 0), periodic=(False, False, False))
    for point, normal in (
        ((0, 0, 0), (0, 0, 1)),
        ((0, 0, 0), (1, 0, 0)),
        ((side, 0, 0), (-1, 0, 0)),
        ((0, 0, 0), (0, 1, 0)),
        ((0, side, 0), (0, -1, 0)),
    ):
        simulation.add_plane(point=point, normal=normal)
    simulation.set_positions(start.astype(np.float32))
    simulation.set_gravity((0.0, 0.0, -ask["gravity"]))
    simulation.set_material_params(restitution_normal=ask["restitution"], friction=ask["friction"])
    simulation.set_solver_iterations(pos=ask["iterations"], vel=ask["iterations"])
    simulation.set_sleeping(ask["sleeping"])
    simulation.set_dt(ask["step"])
    return simulation


def main(path: str) -> None:
    """Run what the request asks for."""
    ask = json.loads(Path(path).read_text())
    from peclet import dem

    simulation = scene(ask, np.load(ask["start"]))
    r, side, sample = ask["radius"], ask["side"], ask["sample"]
    every = round(sample / ask["step"])
    spent, cpu, deepest, done = [0.0] * len(ask["phases"]), 0.0, 0.0, 0
    begin_all = time.monotonic()
    while done < round(ask["until"] / sample) and time.monotonic() - begin_all < ask["limit"]:
        begin, begin_cpu = time.perf_counter(), time.process_time()
        simulation.step(every)
        phase = sum(done * sample >= end - 1e-9 for end in ask["phases"])
        spent[phase] += time.perf_counter() - begin
        cpu += time.process_time() - begin_cpu
        done += 1
        deepest = max(deepest, depth(simulation.get_positions().astype(float), r, side).deepest)
    x, v, w = (
        np.array(found, dtype=float)
        for found in (
            simulation.get_positions(),
            simulation.get_velocities(),
            simulation.get_angular_velocities(),
        )
    )
    end = depth(x, r, side)
    np.savez(ask["end"], position=x, velocity=v, angular_velocity=w)
    told = {
        "version": f"peclet-dem {dem.__version__}",
        "time": done * sample,
        "step": ask["step"],
        "phases": spent,
        "cpu": cpu,
        "memory": peak_memory(),
        "deepest": deepest,
        "deepest_end": end.deepest,
        "mean_end": end.mean,
        "kinetic": kinetic(ask["mass"], r, v, w),
    }
    Path(ask["told"]).write_text(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1])
