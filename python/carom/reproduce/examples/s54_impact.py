"""Section 5.4: what the impact does, at the paper's step and for h -> 0, held against closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.measure.events import meeting
from carom.reproduce import first_order
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.analytic.impact import Ball, Touch
from carom.reproduce.analytic.line import UP, LineHit
from carom.reproduce.analytic.sequence import sequence
from carom.reproduce.document import Row
from carom.reproduce.examples.s54_study import after_impact, hit_of, scene
from carom.reproduce.memory import Trace, trace

#: The coarsest step is the paper's; steps halve, first to last, for what happens until the jumps end, and for the whole run.
HALVINGS, HALVINGS_LONG = 6, 5
#: Until when the jumps are over, and when all balls roll, s.
JUMPS, ALL_ROLL = 0.36, 0.99
RISE_1, MEET_AGAIN = "height of the rebound of ball 1", "balls 1 and 2 meet again"


@dataclass(frozen=True)
class Again:
    """Balls 1 and 2 after the impact: when they first hit each other again, s, and how high ball 1 gets, m."""

    time: float
    rise: float


def again(model: dict[str, Any], way: Approach, hit: LineHit) -> Again:
    """Ball 2 slides back under ball 1, which is in the air: they touch before one is above the other, along a tilted line.

    Friction in every such hit lifts ball 1 a little more; each is solved at its instant until ball 1 falls.
    """
    state = after_impact(way, hit, way.contact_time)
    velocity, spin = state["velocity"][:2], state["angular_velocity"][:2]
    apart, height, clock = np.array([2 * way.radius, 0.0, 0.0]), 0.0, way.contact_time
    times: list[float] = []
    while velocity[0, 2] > 0:
        t = _flight(apart, velocity, way, hit.next_hit)
        top = float(velocity[0, 2]) / way.gravity
        if t > top:
            return Again(times[0], height + float(velocity[0, 2]) * top / 2)
        apart = _apart(apart, velocity, way, t)[0]
        height += float(velocity[0, 2]) * t - way.gravity * t * t / 2
        clock += t
        times.append(clock)
        velocity = velocity + t * np.array([[0.0, 0.0, -way.gravity], [-way.slowing, 0.0, 0.0]])
        spin = spin + t * np.array([[0.0, 0.0, 0.0], [0.0, way.slowing / (way.kappa * way.radius), 0.0]])
        velocity, spin = _hit(model, -apart / (2 * way.radius), velocity, spin)
    return Again(times[0], height)


def _apart(place: F64, velocity: F64, way: Approach, t: float) -> tuple[F64, F64]:
    """Ball 2 seen from ball 1 after the time t, and its velocity: the one slides, the other flies."""
    speed, loads = velocity[1] - velocity[0], np.array([-way.slowing, 0.0, way.gravity])
    return place + speed * t + loads * t * t / 2, speed + loads * t


def _flight(apart: F64, velocity: F64, way: Approach, guess: float) -> float:
    """Time until the balls touch again, s, by Newton's method from a time at which they are apart or about to be."""
    t = guess
    for _ in range(30):
        place, speed = _apart(apart, velocity, way, t)
        t -= float(place @ place - 4 * way.radius**2) / (2 * float(place @ speed))
    return t


def _hit(model: dict[str, Any], normal: F64, velocity: F64, spin: F64) -> tuple[F64, F64]:
    """Velocities and spins (2, 3) of balls 1 and 2 after a hit; ball 2 is on the bed."""
    mass, radius, inertia = (model[key] for key in ("mass", "radius", "inertia"))
    balls = [Ball(float(mass[i]), float(radius[i]), float(inertia[i]), velocity[i], spin[i]) for i in (0, 1)]
    (mu_b, mu), (e_b, e) = model["friction"], model["restitution"]
    touches = [Touch(0, 1, normal, float(mu_b), float(e_b)), Touch(1, None, UP, float(mu), float(e))]
    last = sequence(balls, touches, pressed=(1,))[-1]
    return last.velocity, last.spin


def rows() -> list[Row]:
    """The frictional case just after the impact, the jumps, the second hit, ball 3 in the end."""
    balls = scene("frictional")
    model = balls.to_model()
    way, hit = hit_of(model)
    second = again(model, way, hit)
    h = first_order.steps(way.contact_time, balls.run.step, HALVINGS)
    found = [_measured(step, way) for step in h]
    ends = [_speed_of_3(step) for step in h[:HALVINGS_LONG]]
    # The later hits have no fixed place in a step: their delay changes what they add by up to h over their interval.
    share = h[-1] / hit.next_hit
    late = (
        share * (second.rise - hit.jump_1),
        f", and {share:.2g} of what later hits add, which come late by up to h",
    )
    after = "after the impact"
    table = (
        (f"v_x of ball 1 {after}", "m/s", hit.back_1, "negative"),
        (f"v_z of ball 1 {after}", "m/s", hit.up_1, "rebounds"),
        (f"v_x of ball 2 {after}", "m/s", hit.back_2, None),
        (f"v_x of ball 3 {after}", "m/s", hit.ahead_2, "forward"),
        (f"v_z of ball 3 {after}", "m/s", hit.lift_3, "rebounds"),
        (RISE_1, "m", second.rise, "figure"),
        ("height of the rebound of ball 3", "m", hit.jump_3, "figure"),
        (MEET_AGAIN, "s", second.time, "many times"),
    )
    notes = {
        RISE_1: f"v_z^2/(2 g) is {1e3 * hit.jump_1:.5g} mm; friction in the hits of ball 2 on the way up adds the rest",
        MEET_AGAIN: "the time within the step, by gap and closing speed before it",
    }
    found_rows = [
        row
        for k, (name, unit, exact, paper) in enumerate(table)
        for row in first_order.rows(
            name,
            unit,
            h,
            [values[k] for values in found],
            exact,
            paper=paper,
            note=notes.get(name, ""),
            scatter=late if name == RISE_1 else (0.0, ""),
        )
    ]
    end = first_order.rows("speed of ball 3 at the end", "m/s", h[:HALVINGS_LONG], ends, hit.rolling_3)
    return [*found_rows, *end]


def _measured(h: float, way: Approach) -> list[float]:
    """The quantities of the table at one step, in its order."""
    run = trace(scene("frictional"), step=h, until=math.ceil(JUMPS / h) * h)
    impact = math.ceil(way.contact_time / h)
    v = run.velocity[impact]
    return [
        float(x)
        for x in (
            *(v[0, 0], v[0, 2], v[1, 0], v[2, 0], v[2, 2]),
            *(_rise(run, ball, way) for ball in (0, 2)),
            meeting(run, "ball1", "ball2", after=impact).time,
        )
    ]


def _rise(run: Trace, ball: int, way: Approach) -> float:
    """Top of the parabola on which the highest state lies, m above the bed."""
    top = int(np.argmax(run.position[:, ball, 2]))
    height, up = run.position[top, ball, 2] - way.radius, run.velocity[top, ball, 2]
    return float(height + up * up / (2 * way.gravity))


def _speed_of_3(h: float) -> float:
    """v_x of ball 3 when it rolls, m/s."""
    return float(trace(scene("frictional"), step=h, at=[math.ceil(ALL_ROLL / h) * h]).velocity[-1, 2, 0])
