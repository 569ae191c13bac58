"""What a periodic box that deforms gives bodies where its rate changes, and how fast they are against its mean flow.

The rate of the box is constant in a step, and a body keeps the mean flow `dH/dt H^-1 x` with its velocity. Between two steps
it gets the change `dF' F^-1 x`; that after the last step of an interval is `Block.kink`. Over several steps the changes
between them are known to the way of the body against the flow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from carom.arrays import F64, I64
from carom.audit.block import Block, once
from carom.audit.data import Run
from carom.audit.vectors import EPS, norm


class Carried(NamedTuple):
    """What the box gives each body over an interval, (B, N, ...)."""

    velocity: F64
    """m/s."""
    way: F64
    """Beside that of the velocity at the first frame, m."""
    slack: F64
    """(B, N) how far the velocity may be off, m/s."""
    slack_way: F64
    """(B, N) m."""


@once
def of_block(block: Block) -> Carried:
    """Of all bodies of a block."""
    run, box, shape = block.run, block.run.box, block.x0.shape
    if not box.deforms:
        return Carried(np.zeros(shape), np.zeros(shape), np.zeros(shape[:2]), np.zeros(shape[:2]))
    first, last = box.rates(block.t0), box.rates(block.t1, end=True)
    edges = box.edges(block.t0), box.edges(block.t1)
    velocity = block.flow((last[0] - first[0], last[1] - first[1]))
    lengths, offset = (edges[1][k] - edges[0][k] for k in (0, 1))
    dt = np.asarray(block.dt, dtype=np.float64)
    way = block.flow((lengths - dt[:, None] * first[0], offset - dt * first[1]))
    # Rounding is that of what the changes are differences of.
    fast = norm(block.flow(first)) + norm(block.flow(last))
    away = norm(block.x0) + float(norm(box.middle))
    rates = box.strain_rate(block.t0) + box.strain_rate(block.t1, end=True) + box.strain_rate(block.t1)
    # A rate that is no slope is a difference of values over a step.
    changes = np.broadcast_to(jolts(run).any(), rates.shape) * (norm(edges[1][0]) + np.abs(edges[1][1]))
    differenced = changes / (run.h * box.first.min(initial=np.inf, where=box.repeats))
    fast = fast + (rates + differenced)[:, None] * away
    long = norm(block.flow(edges[0])) + norm(block.flow(edges[1])) + norm(block.x0 - box.middle)
    several = jolted(block)[:, None] * own(block) * block.dt[:, None]
    several = np.where(block.single[:, None], 0.0, several)
    # Laws are known to that of their argument, too.
    steps = (block.t1 / block.dt)[:, None]
    slack = 16.0 * EPS * (fast + steps * norm(velocity)) + several
    slack_way = 16.0 * EPS * (long + block.t1[:, None] * fast) + several * block.dt[:, None]
    slack[:, run.balls :] = slack_way[:, run.balls :] = 0.0
    return Carried(velocity, way, slack, slack_way)


@once
def jolts(run: Run) -> F64:
    """(S,) 1/s, sizes of the changes of the rate of the box after each step, over the edges."""
    end = run.steps["time"]
    return run.box.jolts(end) if run.box.deforms else np.zeros(len(end))


@once
def jolted(block: Block) -> F64:
    """(B,) 1/s, by how much the rate of the box changes in an interval, over the edges: the sum of all changes."""
    if not block.run.box.deforms:
        return np.zeros(block.count)
    after = jolts(block.run)
    return np.asarray(block.total(after) - after[np.clip(block.s1 - 1, 0, None)])


@once
def strain_rate(run: Run) -> F64:
    """(S,) 1/s, largest size of the rate of strain of the box in each step."""
    end = run.steps["time"]
    if not run.box.deforms or not len(end):
        return np.zeros(len(end))
    first = np.concatenate([[0.0], end[:-1]])
    return np.maximum(run.box.strain_rate(first), run.box.strain_rate(end, end=True))


@once
def strain(block: Block) -> F64:
    """(B,) by which share of itself a distance changes at most in an interval, as the box deforms."""
    if not block.run.box.deforms:
        return np.zeros(block.count)
    return np.asarray(np.expm1(1.1 * block.run.h * block.total(strain_rate(block.run))))


@once
def strained(block: Block) -> F64:
    """(B,) 1/s, by how much the rate of strain of the box changes in an interval at most, also as its edges change."""
    if not block.run.box.deforms:
        return np.zeros(block.count)
    return np.asarray(1.1 * jolted(block) + block.over(strain_rate(block.run)) * strain(block))


@once
def own(block: Block) -> F64:
    """(B, N) a bound on the speed of each body against the mean flow within an interval but for loads and contacts, m/s."""
    box = block.run.box
    if not box.deforms:
        return np.maximum(norm(block.v0), norm(block.v1))
    first = norm(block.v0 - block.flow(box.rates(block.t0)))
    last = norm(block.v1 - block.flow(box.rates(block.t1, end=True), end=True))
    return np.asarray(np.maximum(first, last) * (1.0 + strain(block))[:, None])


@once
def apart(block: Block) -> F64:
    """(B, N) m/s, how fast the flow is at most at the surface of each body against that at its centre."""
    run = block.run
    if not run.box.deforms:
        return np.zeros((block.count, run.bodies))
    reach = 1.01 * run.radius
    reach[run.clumps.balls] += run.clumps.arm
    return np.asarray(block.over(strain_rate(run))[:, None] * reach)


def of_clumps(block: Block) -> F64:
    """(B, C) the speeds of clumps against the mean flow at either end of an interval, m/s."""
    box, first = block.run.box, block.run.clumps.first
    flow = block.flow(box.rates(block.t0)), block.flow(box.rates(block.t1, end=True), end=True)
    ends = [norm(rows[..., 7:10] - of[:, first]) for rows, of in zip((block.c0, block.c1), flow, strict=True)]
    return np.asarray(np.maximum(*ends) * (1.0 + strain(block))[:, None])


@once
def flowing(block: Block) -> F64:
    """(B, N) how fast the mean flow is at most where each body is, m/s."""
    run, box = block.run, block.run.box
    if not box.deforms:
        return np.zeros((block.count, run.bodies))
    place = np.maximum(*(norm(np.nan_to_num(x) - box.middle) for x in (block.x0, block.x1)))
    place[:, run.balls :] = 0.0
    return np.asarray(block.over(strain_rate(run))[:, None] * place * (1.0 + strain(block))[:, None])


@once
def ways(block: Block) -> F64:
    """(B, N) how far each body is from where it was at the first frame, or from where the box has carried that place; the
    larger of both where there are walls, m.
    """
    run, box, way = block.run, block.run.box, block.x1 - block.x0
    if not box.deforms:
        return norm(way)
    edges = zip(box.edges(block.t0), box.edges(block.t1), strict=True)
    moved = [new - old for old, new in edges]
    against = norm(way - block.flow((moved[0], moved[1])))
    return np.maximum(against, norm(way)) if run.walls or run.free_walls else against


def image_speed(block: Block, k: I64, image: F64 | None) -> F64:
    """(K,) how fast images move at most at either end of the intervals `k`, m/s."""
    if image is None:
        return np.zeros(len(k))
    box = block.run.box
    ends = box.velocity(block.t0[k], image), box.velocity(block.t1[k], image, end=True)
    return np.maximum(*(norm(of) for of in ends))


def image_change(block: Block, k: I64, image: F64 | None) -> F64:
    """(K, 3) by how much the velocities of images change in the intervals `k`, m/s."""
    if image is None:
        return np.zeros((len(k), 3))
    box = block.run.box
    return np.asarray(box.velocity(block.t1[k], image, end=True) - box.velocity(block.t0[k], image))
