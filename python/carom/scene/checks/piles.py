"""Advice on piles: what a run will cost that solves many contacts too finely, or by the printed position level."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from carom.scene.assembly.placing import FLAT
from carom.scene.assembly.vectors import scaled
from carom.scene.checks.walls import COARSE
from carom.scene.messages import Finding
from carom.scene.tables.flow import Inflow
from carom.scene.tables.options import loads_once

if TYPE_CHECKING:
    from carom.scene.checks.rules import Whole

MANY_BALLS = 100
"""Balls from which a scene under gravity is taken for a pile. `carom run pile.toml --set N=100 --until 0.3` takes 0.3 s
of CPU time at `residual=1e-4`, 4 s at 1e-6 and 73 s at 1e-7, the default.
"""
PRINTED_TIMES = "80 to 200"
"""Factor of the time with `position_friction = "paper"` to that with `"once"`, at `residual=1e-4`: 22.6 and 0.30 s until
0.2 s, 118 and 0.55 s until 0.3 s. It has no sweeps.
"""
PILE_TOLERANCE = 1e-4
"""What the benchmark of piles takes (docs/validation/scale.md)."""
TIMES = "10 to 200"
"""Factor of the time at 1e-6 and 1e-7 to that at `PILE_TOLERANCE`; 9 where grains already lie in layers."""
SPARSE = 0.3
"""Part of a cell of the ground that balls cover, seen along gravity, up to which they touch in small groups at most."""
CELL = 10.0
"""Side of such a cell, in the median of the radii."""
LEVEL = 1e-6
"""Cosine of the angle of a level or upright wall to the one that is exactly so, or one less it."""


def advise_piles(parts: Whole) -> Iterator[Finding]:
    """Many balls that gravity brings together: what makes a run slow, or stop."""
    if not any(parts.world.gravity) or not parts.walls():
        return
    options = parts.run.options()
    tolerance = options["pile_tolerance"]
    printed = not loads_once(options) and loads_once(options | {"position_friction": "once"})
    if tolerance >= COARSE and not printed:
        return
    here, coming = int(parts.bodies().present.sum()), _entering(parts)
    if here + coming >= MANY_BALLS and (coming or not _spread_out(parts)):
        many = f"{here + coming} balls" + (f", {coming} of them by inflows," if coming else "")
        pile = f"{many} under gravity make a pile"
        if printed:
            cause = pile + f': position_friction = "paper" takes {PRINTED_TIMES} times as long as "once"'
            yield Finding(("run", "position_friction"), cause, 'position_friction = "once"')
        if tolerance < COARSE:
            cause = (
                pile + f": pile_tolerance = {tolerance:g} takes {TIMES} times as long as {PILE_TOLERANCE:g}"
            )
            cause += ", or stops unconverged"
            cure = f"pile_tolerance = {PILE_TOLERANCE:g}; overlaps may then be as large, in radii"
            yield Finding(("run", "pile_tolerance"), cause, cure)


def _entering(parts: Whole) -> int:
    """Balls that enter within the run, as far as the rates of the inflows say."""
    until, total = parts.until, 0
    for _, inflow in parts.tables(Inflow):
        if inflow.start <= until:
            due = 1.0 + inflow.rate * (until - inflow.start)
            bodies = inflow.count if inflow.rate == 0 else min(inflow.count, int(due))
            total += bodies * inflow.size() // inflow.count
    return total


def _spread_out(parts: Whole) -> bool:
    """Whether the balls lie or fall side by side, too far apart to touch in numbers, where nothing leads them together.

    Level floors and upright walls lead nothing together; slopes, bowls and funnels may.
    """
    bodies = parts.bodies()
    up = np.array(scaled(parts.world.gravity))
    for wall in parts.walls():
        slope = abs(float(np.array(wall.shape[1]) @ up)) if wall.kind in FLAT else 0.5
        if LEVEL < slope < 1.0 - LEVEL:
            return False
    across = np.linalg.svd(up[None])[2][1:]
    position, radius = bodies.position[bodies.present], bodies.radius[bodies.present]
    side = CELL * float(np.median(radius))
    cells = np.floor((position - position.min(axis=0)) @ across.T / side)
    _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    covered = np.bincount(cell.ravel(), math.pi * radius**2) / side**2
    return int(counts[covered > SPARSE].sum()) < MANY_BALLS // 2
