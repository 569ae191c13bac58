"""Groups of bodies that act on one another within an interval: laws of a whole are judged of each by itself.

Bodies are in one group where contacts and impacts on record, joints or springs join them. What works from outside (moving
walls, loads without a potential, prescribed motion), and who comes or goes, is recorded as a sum for the whole scene: all
groups that have a part in it are one, the *outer* group of their interval.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import I64, Bool, connected
from carom.audit import carried, hits
from carom.audit.block import Block, Rows, once

REDONE = "joints, dampers and drag answer impulses of loads anew in an impact, and so the works of contacts do not add up"


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
    pairs += zip(run.clumps.first[run.clumps.of].tolist(), run.clumps.balls.tolist(), strict=True)
    k, a, b = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    tables: list[Rows | hits.Hits] = [block.rows] if run.has_contacts else []
    for table in [*tables, *([hits.of_block(block)] if run.has_impacts else [])]:
        joined = (table.b < n) | outer[table.b]
        k.append(table.k[joined])
        a.append(table.a[joined])
        b.append(np.minimum(table.b[joined], n))
        images = block.image(table.k, table.a, table.b, end=True)
        if images is not None:  # which work from outside
            driven = images.any(axis=1)
            k.append(table.k[driven])
            a.append(table.a[driven])
            b.append(np.full(int(driven.sum()), n))
    every = np.arange(block.count)
    for one, other in pairs:
        if one >= 0 and other >= 0 and one != other:
            k.append(every)
            a.append(np.full(block.count, one))
            b.append(np.full(block.count, other))
    changes = carried.jolted(block) > 0.0  # of the rate of a box: all bodies have a part in it
    given, bodies = np.nonzero(outer[:n] | ~block.there | changes[:, None])
    k.append(given)
    a.append(bodies)
    b.append(np.full(len(given), n))
    at = np.concatenate(k) * (n + 1)
    found = connected(block.count * (n + 1), at + np.concatenate(a), at + np.concatenate(b))
    return found.reshape(block.count, n + 1)


@once
def struck(block: Block) -> Bool:
    """(B, N) bodies that hung together with one that had an impact, by contacts, joints or loads between two: walls join
    nothing within a step.
    """
    run, n = block.run, block.run.bodies
    r = hits.of_block(block)
    every = np.arange(block.count)[:, None] * n
    ends = [(every + np.arange(n)).ravel()], [(every + run.joined(run.loads)).ravel()]
    for table in (block.rows, r):
        ball = table.b < n
        ends[0].append(table.k[ball] * n + table.a[ball])
        ends[1].append(table.k[ball] * n + table.b[ball])
    label = connected(block.count * n, *map(np.concatenate, ends))
    found = np.zeros(len(label), dtype=bool)
    found[label[r.k * n + r.a]] = True
    return np.asarray(found[label].reshape(block.count, n))


@once
def held(block: Block) -> Bool:
    """(B, N + 1) whether the group of each body, or the outer one, has a body that answers within an impact."""
    label = labels(block)
    found = np.zeros(label.size, dtype=bool)
    found[label[:, :-1][:, block.run.answering]] = True
    return np.asarray(found[label])


@once
def redone(block: Block) -> Bool:
    """(B, N + 1) groups of these in which an impact may have followed loads: joints answer what remains of their impulses
    with it (algorithm, section 7).
    """
    run, label = block.run, labels(block)
    found = np.zeros(label.size, dtype=bool)
    if run.has_impacts:
        r = hits.of_block(block)
        loads = r.problem == 0
        found[label[r.k[loads], r.a[loads]]] = True
    else:
        found[label[block.over(run.steps["impact_problems"]) > 1]] = True
    return np.asarray(found[label] & held(block))
