"""Runs in periodic boxes that deform, made by hand: balls that follow the flow, in the tables of a run that was computed."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from carom.result.record import Memory

LENGTHS = (1.0, 0.8, 1.2)
ORIGIN = (-0.3, 0.1, 2.0)
CENTRE = np.array(ORIGIN) + 0.5 * np.array(LENGTHS)
STEP = 0.01


def scene(*, repeats: tuple[int, int, int] = (1, 1, 1), balls: int = 12, seed: int = 1, **deform: Any) -> Any:
    """Balls far apart in a periodic box, whose velocities are small; with `deform` the box deforms."""
    lengths = np.array(LENGTHS) * repeats
    made = carom.Scene(
        "grains", gravity=(0, 0, 0), periodic=lengths, origin=ORIGIN, run={"until": 0.2, "step": STEP}
    )
    rng = np.random.default_rng(seed)
    for k in range(balls):
        place = np.array(ORIGIN) + (np.array([k % 3, k // 3 % 2, k // 6]) + 0.5) * np.array(LENGTHS) / (
            3,
            2,
            2,
        )
        made.sphere(
            f"b{k}", radius=0.05, density=1000, material="m", at=place, velocity=rng.normal(0, 0.02, 3)
        )
    made.contact("m", "m", friction=0.3, restitution=0.5)
    if deform:
        made.deform(**deform)
    return made


def deformed(made: Any, every: int = 5) -> carom.Result:
    """The run of such a scene: each ball goes with the flow, and keeps its velocity against it."""
    deformation = made.world.deformation
    made.world.deformation = None
    plain = carom.simulate(made, every=every)
    made.world.deformation = deformation
    record = plain._segments
    assert isinstance(record, Memory)
    block = record.blocks()
    frames = dict(block["frames"])
    own = np.array(frames["velocity"][0])
    start, flow = np.array(frames["position"][0]), deformation.axes()
    lengths = np.array(made.periodic)
    rows, position, velocity = [], [], []
    for time in frames["time"].tolist():
        f, g = deformation.gradient_at(time), deformation.velocity_gradient(time, STEP)
        x = CENTRE + (start - CENTRE) @ f.T
        position.append(x)
        velocity.append(own + (x - CENTRE) @ g.T)
        rows.append(
            [*(np.diag(f) * lengths), f[flow] * lengths[flow[1]] if deformation.shear is not None else 0.0]
        )
    frames |= {"position": np.array(position), "velocity": np.array(velocity), "box": np.array(rows)}
    described = dict(record.described)
    described["attributes"] = {**described["attributes"], "box_flow": flow[0], "box_gradient": flow[1]}
    memory = Memory(**described)
    memory.append({**block, "frames": frames})
    return carom.Result(plain._about, memory, None, made)
