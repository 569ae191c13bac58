"""Appendix C: the formulas of section 5.2 one by one (eqs. 63 to 67), each where it is to hold.

Eq. 63 is the hit of two balls that nothing else touches: it is held against such a hit, without table and weight. Eqs.
64 to 67 are what the cloth does to the cue ball afterwards: they are held against a hit without friction between the
balls, after which the cue ball stays on the cloth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from carom.reproduce import study
from carom.reproduce.analytic.single_collision import Hit, after_impact, eq_63
from carom.reproduce.document import Context, Example, Row
from carom.reproduce.examples import s52_study as runs
from carom.reproduce.examples import two_balls
from carom.reproduce.memory import Trace, trace

ID = "C"
BALLS = "5.2_free_balls.toml"
#: The hit on cloth that eqs. 64 to 67 are held against.
ON_CLOTH = (runs.FREE, "mu_b=0 e=0.94")
STICKS = (
    "eq. 63 lets friction act to the end of the hit; above mu_b = 2/(7 (1 + e) cos phi) = {bound:.3f} the slip"
    " ends within it"
)
SIGN = "eq. 64 prints v_y - R w_x: by it a rolling ball would slip at twice its speed; v_y + R w_x vanishes for it"


def reproduce(context: Context) -> Example:
    """One row for every formula."""
    tolerance = study.default_tolerance(context)
    cloth = runs.path(*ON_CLOTH, tolerance)
    free = [_free(case, tolerance) for case in ("slips", "sticks")]
    rows = [row for case in free for row in _hit_rows(*case)]
    rows += _cloth_rows(cloth)
    used = [run for _, pair in free for run in pair] + [cloth.run, cloth.fine]
    rows += [
        study.energy_rise("greatest rise of energy in a step", used),
        study.unconverged(tolerance, used),
    ]
    return Example(
        ID,
        "The cue ball after the hit",
        tuple(rows),
        texts=(
            "Eq. 63 is right for what it describes: two balls, nothing else, slip from beginning to end. On a table the"
            " object ball is pressed on the cloth, and section 5.2 shows by how much that changes the velocities.",
            "Eqs. 65 to 67 are right with the slip `v_cy = v_y + R w_x`. The sign that eq. 64 prints makes the cue ball"
            " slide half as long again and ends with a velocity that contradicts eq. 66.",
        ),
        options={"table": {"step": runs.H, "solver": "newton", "tolerance": tolerance}},
        scenarios=(BALLS, ON_CLOTH[0]),
    )


def _free(case: str, tolerance: float) -> tuple[Hit, tuple[Trace, Trace]]:
    """A hit in free space at h and at h/2, in the middle of a step of either."""
    balls = runs.scene(BALLS, case)
    model = balls.to_model()
    hit = Hit.of(model)
    event = -float(model["position"][0][1]) / hit.speed
    half = runs.scene(BALLS, case, t_hit=event - runs.H / 4)
    run = trace(balls, solver="newton", tolerance=tolerance)
    return hit, (run, trace(half, solver="newton", tolerance=tolerance, step=runs.H / 2))


def _hit_rows(hit: Hit, pair: Sequence[Trace]) -> list[Row]:
    """Eq. 63: velocity and angular velocity of the cue ball after the hit."""
    velocity, spin = eq_63(hit)
    law = after_impact(hit, locked=False, table_friction=None)
    bound = 2 / (7 * (1 + hit.restitution) * np.cos(hit.phi))
    rows = []
    for name, unit, printed, closed, key in (
        ("v", "m/s", velocity, law.velocity[0], "velocity"),
        ("w", "rad/s", spin, law.spin[0], "angular_velocity"),
    ):
        for axis, letter in enumerate("xy"):
            found = [float(getattr(run, key)[two_balls.hit_step(run), 0, axis]) for run in pair]
            rows.append(
                two_balls.extrapolated(
                    f"eq. 63, {name}_{letter} after the hit, mu_b = {hit.friction:g}", unit, float(printed[axis]),
                    float(closed[axis]), found[0], found[1], STICKS.format(bound=bound),
                    "eq. 63")
            )  # fmt: skip
    return rows


def _cloth_rows(path: runs.Path) -> list[Row]:
    """Eqs. 64 to 67: slip on the cloth, its end, velocity and place then."""
    roll = path.printed
    slips = [runs.slip_of(run)[path.start(run)] for run in (path.run, path.fine)]
    rows = [
        two_balls.extrapolated(
            f"eq. 64, v_c{letter} after the hit", "m/s", float(roll.printed_slip[axis]), float(roll.slip[axis]),
            float(slips[0][axis]), float(slips[1][axis]), SIGN, "eq. 64")
        for axis, letter in enumerate("xy")
    ]  # fmt: skip
    rows.append(
        two_balls.extrapolated(
            "eq. 65, t_roll", "s", roll.printed_t_roll, roll.t_roll, path.sliding_time(path.run),
            path.sliding_time(path.fine), SIGN, "eq. 64")
    )  # fmt: skip
    t, places = roll.t_roll, []
    for run in (path.run, path.fine):
        time = run.time - path.after(run)
        places.append([float(np.interp(t, time, run.position[:, 0, axis])) for axis in (0, 1)])
    for axis, letter in enumerate("xy"):
        rows += [
            two_balls.extrapolated(
                f"eq. 66, v_f{letter}", "m/s", float(roll.final_velocity[axis]), float(roll.final_velocity[axis]),
                float(path.run.velocity[-1, 0, axis]), float(path.fine.velocity[-1, 0, axis]), ""),
            two_balls.extrapolated(
                f"eq. 67, {letter}_c at t = {t:.4f} s", "m", float(roll.printed_position(t)[axis]),
                float(roll.position(t)[axis]), places[0][axis], places[1][axis], f"with the slip of eq. 64; {SIGN}",
                "eq. 64"),
        ]  # fmt: skip
    return rows
