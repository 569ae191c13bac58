"""Which contacts of a result are closed at a frame.

`/contacts` has all contacts that were closed at any step since the frame before, with status, gap and normal as in the last
of these steps: a ball that bounced in between is in the table, and far away at the frame. What is closed there follows from
the places: bodies that are no further apart than they were in that step.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.result.data import RunData
from carom.scene.packing.neighbours import TOUCHING


def closed(
    result: RunData,
    body: I64,
    recorded: F64,
    place: tuple[F64, F64],
    frame: I64,
    part: Array | None = None,
) -> Bool:
    """Whether the bodies of contacts touch at the frames (K,); pairs (K, 2) and gaps (K,), m, are those of `/contacts`.

    The centres of the first and of the second bodies are then at `place` (K, 3), m (of walls any). Balls that are absent,
    whose place is not a number, touch nothing. With the `part` (K,) of `/contacts` a mesh is touched there, else anywhere.
    """
    radius = np.append(np.asarray(result.bodies["radius"], dtype=np.float64), 0.0)
    count = len(radius) - 1
    a, b = body[:, 0], body[:, 1]
    own, other = radius[a], radius[np.minimum(b, count)]
    delta = place[0] - place[1]
    if result.boxes is not None:
        delta = result.boxes.nearest(delta, frame)
    gap = np.linalg.norm(delta, axis=1) - own - other
    time = np.asarray(result.time)[frame]
    walls = list(result.walls.values()) if (b >= count).any() else []
    for k in np.unique(b[b >= count]):
        rows = (b == k) & np.isfinite(place[0]).all(axis=1)
        of_mesh = None if part is None else np.asarray(part)[rows].astype(np.int64)
        gap[rows] = walls[k - count].gap(place[0][rows], own[rows], time[rows], of_mesh)
    least = np.where(b < count, np.minimum(own, other), own)
    return np.asarray(gap <= np.maximum(recorded, 0.0) + TOUCHING * least)


def along_and_across(vector: F64, normal: F64) -> tuple[F64, F64]:
    """Forces or impulses (C, 3) of contacts: along the normal (C, 3), and the size of the rest, (C,) each."""
    along = np.sum(vector * normal, axis=1)
    return along, np.asarray(np.linalg.norm(vector - along[:, np.newaxis] * normal, axis=1))
