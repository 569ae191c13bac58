"""Nothing passes through anything between two frames: a swept test of the ways that frames imply.

The straight way between two places of a pair may cut into the sum of the radii `d`: bodies that turn around one another do.
A way around is at least as long as the shortest one outside (two tangents and an arc). Where that is longer than what the
speeds of the interval allow, and the chord cuts deeper than one of `min(r_A, r_B)` would (steps with a longer way against a
body are made in parts), the pair has passed through. Of pieces of walls a way through the sheet within its outline is
compared with the shortest one around its edge. Where many steps lie between frames, speeds between are not known;
twice those of the frames are granted. Balls that go far in such an interval are not followed past others (`Near.far`).
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit import carried
from carom.audit.block import Block
from carom.audit.forces import speeds
from carom.audit.near import Near
from carom.audit.report import Tally
from carom.audit.vectors import dot, norm


def judge(block: Block, near: Near, tally: Tally) -> None:
    """Pairs of bodies, obstacles and sheets."""
    run = block.run
    speed = speeds(block)
    factor = np.where(block.n == 1, 1.0, 2.0)
    way = 1.05 * factor[:, None] * speed * block.dt[:, None]
    _spheres(block, near, tally, way)
    tally.skip(
        "tunnelling", "the ball went some radii between frames", "every = 1 in [record]", int(near.far.sum())
    )
    for w, mine in run.on_walls(near.b):
        wall = run.walls[w]
        if wall.part:  # goes on beyond its ends
            continue
        rows = mine[wall.there(block.t1[near.k[mine]])]
        k, a = near.k[rows], near.a[rows]
        if wall.sheet and len(k):
            _sheet(block, tally, w, k, a, way)
        elif wall.kind in ("sphere", "cylinder") and not wall.parameters[-1] and len(k):
            _obstacle(block, tally, w, k, a, way)


def _spheres(block: Block, near: Near, tally: Tally, way: F64) -> None:
    run = block.run
    rows = np.flatnonzero(near.b < run.balls)
    k, a, b = near.k[rows], near.a[rows], near.b[rows]
    start = run.between(block.t0[k], block.x0[k, a], block.x0[k, b])
    # The same image all the way: periods are four radii at least.
    end = start + (block.x1[k, a] - block.x0[k, a]) - (block.x1[k, b] - block.x0[k, b])
    image = block.image(k, a, b)
    allowed = way[k, a] + way[k, b]
    if image is not None:
        edges = [run.box.edges(time[k]) for time in (block.t0, block.t1)]
        end = end - run.box.along(edges[1], image) + run.box.along(edges[0], image)
        allowed = allowed + carried.strain(block)[k] * (norm(start) + norm(end))
    r = np.minimum(run.radius[a], run.radius[b])
    value, bound = _cut(start, end, run.radius[a] + run.radius[b], r, allowed)
    tally.measure("tunnelling", value, bound, block.per_pair(k, a, b))


def _obstacle(block: Block, tally: Tally, w: int, k: I64, a: I64, way: F64) -> None:
    """A sphere, or a tube without end, that is met from outside."""
    run, wall = block.run, block.run.walls[w]
    ends = [wall.local(t[k], x[k, a]) - wall.point for t, x in ((block.t0, block.x0), (block.t1, block.x1))]
    size = float(wall.parameters[1 if wall.kind == "cylinder" else 0])
    if wall.kind == "cylinder":
        axis = wall.parameters[0]
        ends = [x - np.outer(x @ axis, axis) for x in ends]
    allowed = way[k, a] + _travel(block, w, k, a)
    value, bound = _cut(ends[0], ends[1], run.radius[a] + size, np.minimum(run.radius[a], size), allowed)
    tally.measure("tunnelling", value, bound, block.per_pair(k, a, np.full(len(k), run.bodies + w)))


def _travel(block: Block, w: int, k: I64, a: I64) -> F64:
    """Way of a wall's surface at a ball in an interval, m, twice over."""
    wall = block.run.walls[w]
    if not wall.travels:
        return np.zeros(len(k))
    ends = ((False, block.t0, block.x0), (True, block.t1, block.x1))
    rate = np.maximum(*(norm(wall.velocity(t[k], x[k, a], end=end)[0]) for end, t, x in ends))
    return np.asarray(2.0 * rate * block.dt[k])


def _cut(start: F64, end: F64, reach: F64, smallest: F64, allowed: F64) -> tuple[F64, F64]:
    """How deep the chords cut into spheres of radius `reach`, and how deep they may: (K,), m."""
    chord = end - start
    length = norm(chord)
    along = np.clip(-dot(start, chord) / np.where(length > 0.0, length**2, 1.0), 0.0, 1.0)
    nearest = norm(start + along[:, None] * chord)
    d0, d1 = np.maximum(norm(start), reach), np.maximum(norm(end), reach)
    cosine = np.clip(dot(start, end) / np.maximum(norm(start) * norm(end), 1e-300), -1.0, 1.0)
    arc = np.arccos(cosine) - np.arccos(reach / d0) - np.arccos(reach / d1)
    around = np.where(arc > 0.0, np.sqrt(d0**2 - reach**2) + np.sqrt(d1**2 - reach**2) + reach * arc, length)
    # Both ends may overlap by as much as they do: that is no matter of the way.
    outside = np.minimum(np.minimum(norm(start), norm(end)), reach)
    value = np.where(along * (1.0 - along) > 0.0, np.maximum(0.0, outside - nearest), 0.0)
    short = reach - np.sqrt(np.maximum(reach**2 - 0.25 * np.minimum(smallest, 2.0 * reach) ** 2, 0.0))
    return value, np.where(around <= np.maximum(allowed, 0.0), np.maximum(reach, value), short)


def _sheet(block: Block, tally: Tally, w: int, k: I64, a: I64, way: F64) -> None:
    run, wall = block.run, block.run.walls[w]
    before, after = (wall.local(t[k], x[k, a]) for t, x in ((block.t0, block.x0), (block.t1, block.x1)))
    (h0, _), (h1, _) = wall.height(before), wall.height(after)
    crossed = h0 * h1 < 0.0
    share = np.where(crossed, h0 / np.where(crossed, h0 - h1, 1.0), 0.0)
    # On curved sheets the height is no linear function of the way: two steps of the rule of false position.
    for _ in range(2):
        height, inside = wall.height(before + share[:, None] * (after - before))
        rise = np.where(crossed, h0 - h1, 1.0)
        share = np.clip(share + height / rise, 0.0, 1.0)
    around = np.hypot(h0, np.maximum(inside, 0.0)) + np.hypot(h1, np.maximum(inside, 0.0))
    through = crossed & (inside > 0.0)
    allowed = way[k, a] + _travel(block, w, k, a)
    value = np.where(through, np.abs(h1), 0.0)
    bound = np.where(around <= allowed, np.maximum(run.radius[a], value), 1e-9 * run.radius[a])
    tally.measure("tunnelling", value, bound, block.per_pair(k, a, np.full(len(k), run.bodies + w)))
