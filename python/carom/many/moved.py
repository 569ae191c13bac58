"""Which bodies touch at the start of a shot, and which inputs move these apart: of them there is no derivative.

One way the bodies part, the other way they overlap. A run finds neither where the change is small: to it a gap of less than
`JOINS` radii is closed, however large it is. So differences with small steps are exactly zero, and wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from carom.run.loop import begin

#: Gap over the smaller radius up to which method `events` takes a contact for closed (crates/carom-events/src/step.rs).
JOINS = 1e-9
#: Gaps over the radius that are looked at. Larger: more pairs; smaller: so must be the trial step, and its rounding grows.
LOOK = 1e-3
#: Step of the trial, over the size of the input (1).
TRIAL = 1e-6
#: Change of a gap over the radius, when an input changes by its size, from which it moves (1). A rounding of places within
#: some hundred radii is 1e-13 of a radius, and 1e-7 over the trial.
MOVES = 1e-6

Model = Mapping[str, Any]
Gaps = dict[tuple[int, int], float]


def gaps(model: Model) -> Gaps:
    """Gaps of pairs of balls, and of balls and walls, over the smaller radius, where they are below `LOOK` at the start."""
    radius = np.asarray(model["radius"], dtype=np.float64)
    # The search lists what overlaps: of balls that are a little larger.
    found = begin({**model, "radius": radius * (1.0 + LOOK)}).overlaps(0.0, 16 * len(radius) ** 2 + 1_000_000)
    near: Gaps = {}
    for a, b, gap in found:
        both = radius[[a, b]] if b < len(radius) else radius[[a]]
        near[a, b] = float((gap + LOOK * both.sum()) / both.min())
    return near


def parted(base: Gaps, up: Gaps, down: Gaps) -> tuple[int, int] | None:
    """The first pair that touches, and whose gap differs between two starts, with `TRIAL` of the input more and less."""
    for pair, gap in base.items():
        if gap > JOINS:
            continue
        ends = [near.get(pair, LOOK) for near in (up, down)]
        if abs(ends[0] - ends[1]) > 2.0 * TRIAL * MOVES:
            return pair
    return None
