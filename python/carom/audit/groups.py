"""Groups of bodies that act on one another within an interval: laws of a whole are judged of each by itself.

Bodies are in one group where contacts and impacts on record, joints or springs join them. What works from outside (moving
walls, loads without a potential, prescribed motion), and who comes or goes, is recorded as a sum for the whole scene: all
groups that have a part in it are one, the *outer* group of their interval.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carom.audit import hits
from carom.audit.block import Block, Rows, once
from carom.audit.hits import components

I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

HELD = "of groups with joints, springs or drag: these answer within an impact, off record"
CURE = "leave out joints, springs and drag there"


@once
def labels(block: Block) -> I64:
    """(B, N + 1) the number of the group of each body in each interval; the last column is that of the outer group."""
    run, n = block.run, block.run.bodies
    outer = np.zeros(n + len(run.walls), dtype=bool)
    outer[n:] = [wall.moves for wall in run.walls]
    pairs: list[tuple[int, int]] = []
    for joint in run.joints:
        pairs.append((joint["a"], joint["b"]))
        outer[joint["a"]] |= any(row[4][0] != "constant" for row in joint["rows"])
    for load in run.loads:
        ends = [int(load[key]) for key in ("a", "b", "body") if int(load.get(key, -1)) >= 0]
        pairs += [(ends[0], ends[-1])] if ends else []
        outer[ends or slice(0, n)] |= load["kind"] != "spring" or load["damping"] > 0.0
    k, a, b = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    tables: list[Rows | hits.Hits] = [block.rows] if run.has_contacts else []
    for table in [*tables, *([hits.of_block(block)] if run.has_impacts else [])]:
        joined = (table.b < n) | outer[table.b]
        k.append(table.k[joined])
        a.append(table.a[joined])
        b.append(np.minimum(table.b[joined], n))
    every = np.arange(block.count)
    for one, other in pairs:
        if one >= 0 and other >= 0 and one != other:
            k.append(every)
            a.append(np.full(block.count, one))
            b.append(np.full(block.count, other))
    given, bodies = np.nonzero(outer[:n] | ~block.there)
    k.append(given)
    a.append(bodies)
    b.append(np.full(len(given), n))
    at = np.concatenate(k) * (n + 1)
    found = components(block.count * (n + 1), at + np.concatenate(a), at + np.concatenate(b))
    return found.reshape(block.count, n + 1)


@once
def held(block: Block) -> Bool:
    """(B, N + 1) whether the group of each body, or the outer one, has a body that answers within an impact."""
    label = labels(block)
    found = np.zeros(label.size, dtype=bool)
    found[label[:, :-1][:, block.run.answering]] = True
    return np.asarray(found[label])
