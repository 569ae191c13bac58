"""The scene 'pile' in YADE: `yade -x -n -jTHREADS _yade_pile.py REQUEST.json`, in YADE's own interpreter.

Mindlin's contact with Hertz' normal force and a damping that has the restitution e, as Debian's YADE has them; the same
stiffness, and the same fraction of Rayleigh's time as step, as in `_lammps_pile.py`.
"""

# YADE's names come into this file by running it, so nothing here can be looked up by tools.
# ruff: noqa: F821
# mypy: ignore-errors

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path

import numpy as np

here = str(Path(sys.argv[1]).resolve()) if sys.argv[1:] else ""
ask = json.loads(Path(here).read_text())
sys.path.insert(0, ask["code"])

from _lammps_pile import POISSON, time_step  # noqa: E402
from _memory import peak_memory  # noqa: E402
from scale_overlap import depth, kinetic  # noqa: E402
from yade import config  # noqa: E402

r, side, sample = ask["radius"], ask["side"], ask["sample"]
material = O.materials.append(
    FrictMat(
        young=ask["young"], poisson=POISSON, frictionAngle=math.atan(ask["friction"]), density=ask["density"]
    )
)
start = np.load(ask["start"])
O.bodies.append([utils.sphere(Vector3(*x), r, material=material) for x in start.tolist()])
for place, axis, sense in ((0, 2, 1), (0, 0, 1), (side, 0, -1), (0, 1, 1), (side, 1, -1)):
    O.bodies.append(utils.wall(place, axis=axis, sense=sense, material=material))
restitution = MatchMaker(algo="val", val=ask["restitution"])
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()], verletDist=0.3 * r),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_MindlinPhys(en=restitution, es=restitution)],
        [Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    NewtonIntegrator(damping=0.0, gravity=(0.0, 0.0, -ask["gravity"])),
]
O.dt = time_step(ask["young"], r, ask["density"], sample, ask["rayleigh"])
every = round(sample / O.dt)
grains = [O.bodies[k] for k in range(len(start))]
spent, cpu, deepest, done, begin_all = [0.0] * len(ask["phases"]), 0.0, 0.0, 0, time.monotonic()
while done < round(ask["until"] / sample) and time.monotonic() - begin_all < ask["limit"]:
    begin, begin_cpu = time.perf_counter(), time.process_time()
    O.run(every, True)
    phase = sum(done * sample >= end - 1e-9 for end in ask["phases"])
    spent[phase] += time.perf_counter() - begin
    cpu += time.process_time() - begin_cpu
    done += 1
    position = np.array([tuple(b.state.pos) for b in grains])
    deepest = max(deepest, depth(position, r, side).deepest)
velocity = np.array([tuple(b.state.vel) for b in grains])
spin = np.array([tuple(b.state.angVel) for b in grains])
end = depth(position, r, side)
np.savez(ask["end"], position=position, velocity=velocity, angular_velocity=spin)
told = {
    "version": f"YADE {config.version}",
    "time": done * sample,
    "step": O.dt,
    "phases": spent,
    "cpu": cpu,
    "memory": peak_memory(),
    "deepest": deepest,
    "deepest_end": end.deepest,
    "mean_end": end.mean,
    "kinetic": kinetic(ask["mass"], r, velocity, spin),
}
# Into a file: YADE has more to say on its output.
Path(ask["told"]).write_text(json.dumps(told))
