"""Of method `events`: which balls `nsga` stepped, and whose motion depends on these steps.

Balls that press one another are stepped, each from its row `press` to its `release`, and all others go on exactly. What a
ball hits that has been stepped is known no better than that ball, from then on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, Bool

if TYPE_CHECKING:
    from carom.result.data import RunData
    from carom.result.tables import Table


def spans(result: RunData) -> tuple[F64, F64]:
    """(K, 2) ball and the time from which it was stepped, s, and (K,) until when; all balls, where no row tells which."""
    rows = result.transitions
    mode, body, time = (np.asarray(rows[name]) for name in ("mode", "body", "time"))
    stepped = rows.MODES.index("stepped")
    turns = np.flatnonzero((mode == stepped).any(axis=1)) if len(rows) else np.zeros(0, dtype=int)
    since: dict[int, float] = {}
    found: list[tuple[int, float, float]] = []
    for row in turns.tolist():
        ball, (before, after) = int(body[row, 0]), mode[row].tolist()
        begun = since.pop(ball, 0.0 if before == stepped else None)
        if begun is not None:
            found.append((ball, begun, float(time[row])))
        if after == stepped:
            since[ball] = begun if before == stepped and begun is not None else float(time[row])
    found += [(ball, begun, np.inf) for ball, begun in since.items()]
    ends, by = np.asarray(result.steps["time"]), np.asarray(result.steps["stepped"])
    begins = np.concatenate([np.asarray(result.time[:1]), ends])[: len(ends)]
    for k in np.flatnonzero(by > 0.0).tolist():
        if not any(begun < ends[k] and begins[k] <= until for _, begun, until in found):
            found += [(ball, float(begins[k]), float(ends[k])) for ball in range(len(result.names))]
    table = np.array(found).reshape(-1, 3)
    return table[:, :2], table[:, 2]


def between(result: RunData, times: F64) -> Bool:
    """(T - 1, N) whether a ball was stepped between two of some times: always by other methods."""
    shape = (max(len(times) - 1, 0), len(result.names))
    if not len(result.transitions):
        return np.ones(shape, dtype=bool)
    mask = np.zeros(shape, dtype=bool)
    of, until = spans(result)
    for (ball, begun), end in zip(of.tolist(), until.tolist(), strict=True):
        mask[:, int(ball)] |= (times[1:] > begun) & (times[:-1] <= end)
    return mask


def known_to(result: RunData, rows: Table, exact: float) -> F64:
    """How well the times of rows of the core are known, s: `exact`, or of what depends on steps the size of these."""
    steps = result.steps["time"]
    step = float(steps[0]) if len(steps) else 0.0
    if not len(result.transitions):
        return np.full(len(rows), step)
    pressing = min(step, result.scene.run.pressing_step)
    body = np.asarray(rows["body"]).astype(np.int64)
    body = body.reshape(-1, body.shape[1] if body.ndim > 1 else 1)
    balls = (body >= 0) & (body < len(result.names))
    doubtful = np.where(balls, _since(result)[np.where(balls, body, 0)], np.inf).min(axis=1)
    return np.where(np.asarray(rows["time"]) >= doubtful, pressing, exact)


def _since(result: RunData) -> F64:
    """(N,) the time from which the motion of each ball depends on steps, s."""
    count = len(result.names)
    since = np.full(count, np.inf)
    (of, _), pairs = spans(result), []
    for ball, begun in of.tolist():
        since[int(ball)] = min(since[int(ball)], begun)
    if not len(of):
        return since
    for table in (result.impacts, result.transitions):
        if len(table):
            body = np.asarray(table["body"]).astype(np.int64)
            both = ((body >= 0) & (body < count)).all(axis=1)
            pairs.append(np.column_stack([np.asarray(table["time"])[both], body[both]]))
    hits = np.concatenate(pairs)
    hits, before = hits[np.argsort(hits[:, 0], kind="stable")], None
    # Until nothing changes: of one time a later row may tell of what an earlier one is hit by.
    while before is None or not np.array_equal(before, since):
        before = since.copy()
        for time, *two in hits.tolist():
            a, b = (int(ball) for ball in two)
            if min(since[a], since[b]) <= time:
                since[a], since[b] = min(since[a], time), min(since[b], time)
    return since
