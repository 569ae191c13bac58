"""The break of section 5.6 at its instant: a ball that slides hits the first of three that touch each other.

`impact_of` gives the limit of the scheme for h -> 0: the sequence of impacts at the exact positions and speeds of the
contact. The rack lies on the bed, and what the weight presses together takes part in the first problem. The motion
until the contact is `carom.reproduce.analytic.approach`. Without rolling resistance only: its moments are not part of
`carom.reproduce.analytic.impact`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.analytic.impact import Ball, Touch
from carom.reproduce.analytic.sequence import Problem, sequence

UP = np.array([0.0, 0.0, 1.0])


def impact_of(model: Mapping[str, Any]) -> list[Problem]:
    """The impact problems of the break, from the core's arrays: balls 2, 3, 4, 5 of the paper on plane 0."""
    approach = Approach.of(model)
    if approach.rho:
        raise CaromError("the impact of the break is known for a bed without rolling resistance only")
    balls = []
    for i in range(4):
        mass, radius, inertia = (float(model[key][i]) for key in ("mass", "radius", "inertia"))
        balls.append(Ball(mass, radius, inertia, np.zeros(3), np.zeros(3)))
    t = approach.contact_time
    cue = np.array([approach.velocity(t), 0.0, 0.0]), np.array([0.0, approach.spin(t), 0.0])
    balls[0] = replace(balls[0], velocity=cue[0], spin=cue[1])
    position = np.array(model["position"], dtype=np.float64)
    position[0, 0] = position[1, 0] - 2 * approach.radius
    among = _law(model, int(model["material"][0]), int(model["material"][0]))
    on_bed = _law(model, int(model["material"][0]), int(model["plane_material"][0]))
    pairs = [(0, 1), (1, 2), (1, 3), (2, 3)]
    touches = [Touch(a, b, _unit(position[a] - position[b]), *among) for a, b in pairs]
    touches += [Touch(a, None, UP, *on_bed) for a in range(4)]
    return sequence(balls, touches, pressed=range(len(pairs), len(touches)))


def _law(model: Mapping[str, Any], a: int, b: int) -> tuple[float, float]:
    """Friction and restitution of two materials."""
    laws = [{int(x), int(y)} for x, y in zip(model["law_a"], model["law_b"], strict=True)]
    i = laws.index({a, b})
    return float(model["friction"][i]), float(model["restitution"][i])


def _unit(vector: F64) -> F64:
    return np.asarray(vector / np.linalg.norm(vector))
