"""Section 5.6: rows until the break, just after it, of the cue ball, and at rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.measure import events
from carom.reproduce import demo, first_order, study
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.analytic.break_shot import impact_of
from carom.reproduce.document import Row
from carom.reproduce.examples.s56_figures import BALLS
from carom.reproduce.examples.s56_study import BRAKED, FREE, NAMES, scene
from carom.reproduce.memory import Trace, trace
from carom.reproduce.study import row

ID = "5.6"
H = 1e-3  # s, the paper's
PAPER_LINE_SEARCHES = (
    9,
    26,
)  # in the third and fourth iteration at position level, step of the break (section 5.6)
ROLLING = 1e-9  # m/s: a ball with less slip rolls
AIR = 1e-9  # m: a ball with a wider gap to the bed flies


def contact_of(run: Trace, case: str) -> events.Meeting:
    return events.meeting(run, *BALLS[:2], Approach.of(scene(case).to_model()).slowing)


def slip_of(run: Trace) -> F64:
    """Speed of the lowest point of each ball along the bed, (T, 4), m/s; 0 in the air."""
    radius = run.bodies["radius"]
    slip = events.slip(run.velocity, run.angular_velocity, radius, [0.0, 0.0, 1.0])
    return np.asarray(np.linalg.norm(slip, axis=2) * (run.position[:, :, 2] - radius < AIR))


def until_contact(run: Trace, case: str) -> list[Row]:
    """Constant friction is integrated exactly: time, speed and spin at the contact."""
    way, contact, name = Approach.of(scene(case).to_model()), contact_of(run, case), NAMES[case]
    before = contact.step - 1
    spin, exact_spin = float(run.angular_velocity[before, 0, 1]), way.spin(float(run.time[before]))
    note = f"the paper gives the end of the step before; here the impact is that of step {contact.step}"
    why = "rounding: friction is constant"
    grid, printed = "the paper gives times on its grid: h", demo.PAPER_CONTACT_TIME
    exact, time = way.contact_time, contact.time
    meet: dict[str, Any] = {"exact": exact, "paper": printed, "against": "paper", "note": note}
    speed: dict[str, Any] = {"exact": way.contact_speed, "paper": "below 10.729"}
    return [
        row(f"{name}: balls 2 and 3 meet", "s", time, H, grid, **meet),
        row(f"{name}: the same, closed form", "s", time, 1e-12, why, exact=exact),
        row(f"{name}: speed of ball 2 there", "m/s", contact.speed, 1e-10, why, **speed),
        row(f"{name}: its angular velocity in the step before", "rad/s", spin, 1e-9, why, exact=exact_spin),
    ]


#: Component, ball and axis of what is compared after the impact; the paper.
AFTER = (
    ("v_x of ball 2", 0, 0, "back"),
    ("v_z of ball 2", 0, 2, "jumps"),
    ("v_x of ball 3", 1, 0, "forward, slow"),
    ("v_x of ball 4", 2, 0, None),
    ("v_y of ball 4", 2, 1, None),
)
#: Steps, from the paper's down, each half of the one before; until when the jump has reached its top, s.
HALVINGS, TOP = 6, 0.15


def after() -> list[Row]:
    """Velocities just after the impact and the height of the jump: at the paper's step and for h -> 0."""
    way = Approach.of(scene(FREE).to_model())
    exact = impact_of(scene(FREE).to_model())[-1].velocity
    steps = first_order.steps(way.contact_time, H, HALVINGS)
    velocities, heights = zip(*(_after(h, way) for h in steps), strict=True)
    rows = []
    for name, ball, axis, told in AFTER:
        values = [float(v[ball, axis]) for v in velocities]
        rows += first_order.rows(
            f"{name} after the impact", "m/s", steps, values, float(exact[ball, axis]), paper=told
        )
    height = float(exact[0, 2]) ** 2 / (2 * way.gravity)
    rows += first_order.rows("height of the jump of ball 2", "m", steps, heights, height, paper="jumps")
    return rows


def _after(h: float, way: Approach) -> tuple[F64, float]:
    """Velocities (4, 3) at the end of the step of the impact, and the top of the parabola of ball 2, m above the bed."""
    run = trace(scene(FREE), step=h, until=math.ceil(TOP / h) * h)
    step = math.ceil(way.contact_time / h)
    top = step + int(np.argmax(run.position[step:, 0, 2]))
    up = float(run.velocity[top, 0, 2])
    return run.velocity[step], float(run.position[top, 0, 2]) - way.radius + up * up / (2 * way.gravity)


def cue_ball(run: Trace, step: int) -> list[Row]:
    """Figure 25: the cue ball jumps, spins unchanged, slides and rolls."""
    way, last = Approach.of(scene(FREE).to_model()), impact_of(scene(FREE).to_model())[-1]
    height = run.position[:, 0, 2] - way.radius
    lands = step + int(np.flatnonzero(height[step:] < AIR)[0])
    spin = run.angular_velocity[step : lands - 1, 0, 1]
    rolls = lands + int(np.flatnonzero(slip_of(run)[lands:, 0] < ROLLING)[0])
    # Friction on the bed, and at the landing, changes v + kappa r w by nothing.
    v, w = run.velocity[step, 0, 0], run.angular_velocity[step, 0, 1]
    rolling = float(v + way.kappa * way.radius * w) / (1 + way.kappa)
    in_air = f"in the air from {run.time[step]:.3f} to {run.time[lands]:.3f} s"
    limit = (last.velocity[0, 0] + way.kappa * way.radius * last.spin[0, 1]) / (1 + way.kappa)
    then = f"at {run.time[rolls]:.3f} s; at the limit h -> 0 of the impact {limit:.4f} m/s"
    name, found = "change of the angular velocity of ball 2 in the air", np.ptp(spin)
    why = "solver: (v + kappa r w)/(1 + kappa) after the impact"
    pure: dict[str, Any] = {"exact": rolling, "paper": "pure rolling", "note": then}
    return [
        row(name, "rad/s", found, 1e-12, "rounding", exact=0.0, paper="constant", note=in_air),
        row("its velocity when it rolls", "m/s", run.velocity[rolls, 0, 0], 1e-9, why, **pure),
    ]


def rest_times(run: Trace) -> list[float]:
    """When each ball has come to rest for good, s."""
    found = events.rest(run, speed=demo.REST_SPEED, ignore_spin=True)
    return [next(event.time for event in found if event.body == ball) for ball in BALLS]


def rest(run: Trace) -> list[Row]:
    """With rolling resistance: the deceleration of a rolling ball, and when each ball rests."""
    way = Approach.of(scene(BRAKED).to_model())
    speed = np.linalg.norm(run.velocity, axis=2)
    rows = []
    for ball, at in enumerate(rest_times(run)):
        rests = run.index(at)
        # It rolls without a hit for the last 20 ms: what the closed form then predicts.
        start = rests - round(0.02 / H)
        predicted = float(run.time[start] + speed[start, ball] / way.rolling_slowing)
        spins = abs(float(run.angular_velocity[-1, ball, 2]))
        note = f"spins on at {spins:.1f} rad/s about the vertical" if spins > 1e-6 else ""
        name = f"rolling resistance: ball {ball + 2} at rest, from its state 20 ms before"
        why = "h; v/a after the state 20 ms before, a = rho g/(r (1 + kappa))"
        rows.append(row(name, "s", run.time[rests], H, why, exact=predicted, paper="at rest", note=note))
    middle = rests - round(0.01 / H)
    slowing = float(speed[middle, 3] - speed[middle + 1, 3]) / H
    name, a = "rolling resistance: deceleration of a rolling ball", way.rolling_slowing
    return [row(name, "m/s^2", slowing, 1e-6, "solver", exact=a), *rows]


def line_searches(run: Trace, step: int) -> list[Row]:
    """The paper's line searches in the step of the break; Carom's of that whole step at position level."""
    found = int(run.steps["line_search_position"][step - 1])
    why = "none is wanted: every step of Newton's method is taken whole"
    note = "Carom's are those of the whole step, position level"
    return [
        row(
            f"line searches in the {nth} iteration of the step of the break", "1", found, 0.0, why,
            exact=0.0, paper=float(printed), note=note,
        )
        for nth, printed in zip(("third", "fourth"), PAPER_LINE_SEARCHES, strict=True)
    ]  # fmt: skip


def longest(run: Trace, step: int, level: study.Level) -> F64:
    """Residuals of the problem of a step that took most iterations."""
    return max(run.residuals.history(step, level), key=len)


def newton(history: F64) -> Row:
    """Fig. 26: order of convergence from the last three residuals of the position level."""
    a, b, c = (math.log(x) for x in history[-3:])
    note = "residuals " + ", ".join(f"{x:.1e}" for x in history)
    name, order = "order of Newton's method in the step of the break", (c - b) / (b - a)
    return row(name, "1", order, 0.4, "three residuals", exact=2.0, paper="quadratic", note=note)


def mirror(run: Trace) -> Row:
    """The scene is symmetric: ball 4 and the mirror image of ball 5 at the end, largest coordinate of the difference."""
    axis = float(run.position[0, 0, 1])
    image = run.position[-1, 3] * [1, -1, 1] + [0, 2 * axis, 0]
    off = float(np.abs(run.position[-1, 2] - image).max())
    return row(
        "balls 4 and 5 mirror images at 3 s", "m", off, 1e-9, "rounding, enlarged by later hits", exact=0.0
    )


def at_the_end(run: Trace) -> Row:
    """Without rolling resistance all balls roll in the end."""
    slip = float(slip_of(run)[-1].max())
    return row("greatest slip on the bed at 3 s", "m/s", slip, ROLLING, "solver", exact=0.0, paper="rolling")
