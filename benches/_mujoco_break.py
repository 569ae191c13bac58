"""The billiard break of section 5.6 in MuJoCo, as a child process of run.py: prints one JSON document.

    python benches/_mujoco_break.py STEP HALF_PERIOD REPETITIONS

MuJoCo has no restitution: a contact is a spring and a damper in the coordinates of the constraint, whose
stiffness k and damping b are the negative numbers of `solref`. With an impedance near one a hit is half an
oscillation: omega = sqrt(k) = pi / HALF_PERIOD, and b = 2 zeta omega with exp(-pi zeta / sqrt(1 - zeta^2)) = e.
The half period must span several steps, and a ball sinks in by about v / omega meanwhile: that is the price
of a step, told beside the time. Friction is the elliptic cone, masses and inertias are the paper's.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
import time
from typing import Any

import mujoco
import numpy as np

R, UNTIL, AFTER = 0.028575, 3.0, 0.13
S = math.sqrt(3) * R
STARTS = [(0.635, 0.635), (1.905, 0.635), (1.905 + S, 0.635 + R), (1.905 + S, 0.635 - R)]
SPEED = 10.729
#: Pair of geoms: friction and restitution.
BALLS, BED, CUSHION = (0.06, 0.93), (0.2, 0.0), (0.0, 0.85)


def solref(restitution: float, half_period: float) -> str:
    """Stiffness and damping of a contact; without restitution it is critically damped."""
    omega = math.pi / half_period
    if restitution == 0:
        return f"{-(omega**2)} {-2 * omega}"
    log = -math.log(restitution)
    return f"{-(omega**2)} {-2 * omega * log / math.hypot(math.pi, log)}"


def xml(step: float, half_period: float) -> str:
    """The scene."""
    bodies = "".join(
        f'<body name="b{i}" pos="{x!r} {y!r} {R}"><freejoint/>'
        '<inertial pos="0 0 0" mass="0.17" diaginertia="5.5e-5 5.5e-5 5.5e-5"/>'
        f'<geom name="g{i}" type="sphere" size="{R}" contype="0" conaffinity="0"/></body>'
        for i, (x, y) in enumerate(STARTS)
    )
    walls = [("0 0 0", "1 0 0"), ("2.54 0 0", "-1 0 0"), ("0 0 0", "0 1 0"), ("0 1.27 0", "0 -1 0")]
    planes = "".join(
        f'<geom name="p{i}" type="plane" size="5 5 1" pos="{pos}" zaxis="{axis}" contype="0" conaffinity="0"/>'
        for i, (pos, axis) in enumerate([("0 0 0", "0 0 1"), *walls])
    )

    def pair(a: str, b: str, law: tuple[float, float]) -> str:
        mu, e = law
        kind = f'condim="3" friction="{mu} {mu} 0 0 0"' if mu else 'condim="1"'
        # A cone that is made convex lifts what slides, by mu b v / k: with the damping of the normal direction the cue
        # ball flies off the bed at once. A slower one for friction, as MuJoCo's own default, keeps it there.
        limits = 'solimp="0.9999 0.9999 0.001 0.5 2"' + (' solreffriction="-1 -100"' if law is BED else "")
        return f'<pair geom1="{a}" geom2="{b}" {kind} solref="{solref(e, half_period)}" {limits}/>'

    pairs = [pair(f"g{i}", f"g{j}", BALLS) for i in range(4) for j in range(i)]
    pairs += [pair(f"g{i}", f"p{j}", BED if j == 0 else CUSHION) for i in range(4) for j in range(5)]
    return (
        f'<mujoco><option timestep="{step}" gravity="0 0 -9.8" cone="elliptic" solver="Newton" tolerance="1e-12"'
        ' iterations="100"/>'
        f"<worldbody>{planes}{bodies}</worldbody><contact>{''.join(pairs)}</contact></mujoco>"
    )


def start(model: Any) -> Any:
    """The state at the start."""
    data = mujoco.MjData(model)
    data.qvel[0] = SPEED
    return data


def main() -> None:
    """The command."""
    step, half_period, repetitions = float(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
    model = mujoco.MjModel.from_xml_string(xml(step, half_period))
    steps = round(UNTIL / step)
    times = []
    for _ in range(repetitions):
        data = start(model)
        begin = time.process_time()
        mujoco.mj_step(model, data, steps)  # the loop over the steps is MuJoCo's own
        times.append(time.process_time() - begin)
    # Accuracy is looked at in a run of its own, step by step.
    data, deepest, after = start(model), 0.0, np.zeros(24)
    for n in range(1, steps + 1):
        mujoco.mj_step(model, data)
        if data.ncon:
            deepest = max(deepest, -float(np.min(data.contact.dist)))
        if n == round(AFTER / step):
            after = data.qvel.copy()
    left, right = data.qpos[14:17], data.qpos[21:24]
    mirror = float(np.max(np.abs(left - (right * [1, -1, 1] + [0, 2 * 0.635, 0]))))
    found = {
        "version": mujoco.__version__,
        "steps": steps,
        "min": min(times),
        "median": statistics.median(times),
        "penetration": deepest / R,
        "mirror": mirror,
        "cue": float(after[0]),
        "apex": float(after[6]),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
