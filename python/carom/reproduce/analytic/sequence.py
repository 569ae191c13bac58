"""The paper's sequence of impacts (section 3.2) at one instant: the limit of a time step for h -> 0.

In this limit weight does nothing during the impact, but it decides who takes part: contacts that it presses together
(a ball on the table) belong to the first problem, later ones hold only contacts that approach. Every problem is
solved by `carom.reproduce.analytic.impact`, which shares no code with the simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.reproduce.analytic.impact import Ball, Touch, collide

#: A contact approaches if it closes faster than this share of the greatest speed.
CLOSING = 1e-10
MOST_PROBLEMS = 50


@dataclass(frozen=True)
class Problem:
    """One impact problem: which contacts took part, and velocities after it, (N, 3) m/s and rad/s."""

    members: tuple[int, ...]
    velocity: F64
    spin: F64


def sequence(balls: Sequence[Ball], touches: Sequence[Touch], pressed: Sequence[int] = ()) -> list[Problem]:
    """All problems of the sequence, in order; `pressed` are the contacts that a load holds closed."""
    scale = max(float(np.linalg.norm(ball.velocity)) for ball in balls)
    found: list[Problem] = []
    state = list(balls)
    while True:
        members = {c for c, touch in enumerate(touches) if _closing(state, touch) > CLOSING * scale}
        if not members:
            return found
        if not found:
            members |= set(pressed)
        if len(found) == MOST_PROBLEMS:
            raise CaromError(f"the sequence of impacts did not end within {MOST_PROBLEMS} problems")
        chosen = tuple(sorted(members))
        after = collide(state, [touches[c] for c in chosen])
        found.append(Problem(chosen, after.velocity, after.spin))
        state = [
            replace(b, velocity=v, spin=w) for b, v, w in zip(state, after.velocity, after.spin, strict=True)
        ]


def _closing(balls: Sequence[Ball], touch: Touch) -> float:
    """Speed at which a contact closes, m/s."""
    other = np.zeros(3) if touch.b is None else balls[touch.b].velocity
    return -float(touch.normal @ (balls[touch.a].velocity - other))
