"""What a packing of clumps needs: the ball about a clump, and orientations at random."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.scene.assembly.bodies import uniform
from carom.scene.assembly.union import union
from carom.scene.tables.clumps import Clump

OTHER = 1 << 40
"""Added to a seed: turns are of another stream than sizes and places."""
TRIES = 64
"""Points of a cube for each turn, of which 31 % lie in its ball: none of 64 by a chance of 1 in 10^10."""


def circumscribed(clump: Clump) -> tuple[float, float]:
    """Radius of the ball about the centre of mass that holds all of a clump, m, and the volume of the clump, m^3."""
    return clump.reach(), float(union(clump.spheres).volume)


def random_turns(seed: int, count: int) -> F64:
    """Unit quaternions (count, 4), uniform over all orientations, that depend on `seed` alone."""
    found = np.zeros((count, 4))
    for k, points in enumerate(uniform(seed + OTHER, (count, TRIES, 4))):
        squared = (points * points).sum(axis=1)
        inside = np.flatnonzero((squared > 1e-6) & (squared < 1.0))
        first = int(inside[0]) if len(inside) else 0
        found[k] = points[first] / np.sqrt(squared[first])
    return found
