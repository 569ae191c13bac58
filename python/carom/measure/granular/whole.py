"""The whole of a periodic box as a region."""

from __future__ import annotations

import numpy as np

from carom.errors import CaromError
from carom.measure.granular.snapshot import Source, snapshot
from carom.scene.packing.region import Box


def whole_box(source: Source, frame: int = -1) -> Box:
    """The periodic box at a frame as a region without faces, also of one that changes its size or is sheared.

    Along axes that do not repeat it reaches from the lowest to the highest surface of the balls.

        granular.stress(result, granular.whole_box(result)).tensor
    """
    s = snapshot(source, frame)
    if s.box is None:
        raise CaromError("whole_box: the world does not repeat; give a region, as Box(low, high)")
    repeats = s.box.lengths > 0
    low, high = s.box.origin, s.box.origin + s.box.lengths
    if not repeats.all():
        if not len(s.present):
            raise CaromError("whole_box: no ball is there, and the world does not repeat along all axes")
        x, r = s.position[s.present], s.radius[s.present][:, None]
        low = np.where(repeats, low, (x - r).min(axis=0))
        high = np.where(repeats, high, (x + r).max(axis=0))
    x, y, z = repeats.tolist()
    return Box(tuple(low.tolist()), tuple(high.tolist()), (x, y, z))
