"""How much contacts push each body in an interval: sums of the lengths of what was recorded of them."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import hits
from carom.audit.block import Block, Rows, once
from carom.audit.vectors import add_at, norm


def of_bodies(block: Block, c: Rows | hits.Hits, of_a: F64, of_b: F64) -> F64:
    """(B, N, ...) sums of what rows give their bodies, (K, ...); walls that are not free take nothing."""
    out = np.zeros((block.count, block.run.bodies, *of_a.shape[1:]))
    add_at(out, (c.k, c.a), of_a)
    ball = c.b < block.run.bodies
    add_at(out, (c.k[ball], c.b[ball]), of_b[ball])
    return out


@once
def pushes(block: Block) -> tuple[F64, F64]:
    """(B, N) sums of the lengths of the recorded impulses of contacts on each body, N s, and of their moments, N m s."""
    return _sizes(block, block.rows, block.rows.impulse, block.rows.moment)


@once
def strokes(block: Block) -> tuple[F64, F64]:
    """(B, N) `pushes`, or the same of the recorded impacts if they are more: impulses of the sub-steps may cancel in
    those of its contacts.
    """
    sums = pushes(block)
    if not block.run.has_impacts:
        return sums
    r = hits.of_block(block)
    struck = _sizes(block, r, r.impulse, r.moment)
    return np.maximum(sums[0], struck[0]), np.maximum(sums[1], struck[1])


@once
def shifts(block: Block) -> tuple[F64, F64]:
    """(B, N) by how much contacts have moved, m, and turned, rad, each body at most beside what its velocity at the start of
    the interval did: by position impulses, and in Moreau-Jean by the velocities that they gave within the step.
    """
    run, c = block.run, block.rows
    way, turned = _sizes(block, c, c.position_impulse, c.position_moment)
    if run.method == "moreau":
        given = [block.dt[:, None] * size for size in pushes(block)]
        way, turned = way + given[0], turned + given[1]
    return way / run.mass, turned / run.inertia


def _sizes(block: Block, c: Rows | hits.Hits, impulse: F64, moment: F64) -> tuple[F64, F64]:
    """(B, N) sums over the rows of each body of the lengths of impulses (K, 3), and of moments (K, 3) beside them."""
    run = block.run
    pushed, turned = np.zeros((2, block.count, run.bodies))
    if run.has_contacts and len(c):
        size, couple = norm(impulse), norm(moment)
        pushed = of_bodies(block, c, size, size)
        arms = (run.radius[np.minimum(b, run.bodies - 1)] for b in (c.a, c.b))
        turned = of_bodies(block, c, *(couple + arm * size for arm in arms))
        # An impulse on one ball of a clump moves all.
        mine, r = run.clumps.balls, run.radius[run.clumps.balls]
        turned[:, mine] -= r * pushed[:, mine]
        run.clumps.share(np.add, pushed)
        run.clumps.share(np.add, turned)
        turned[:, mine] += r * pushed[:, mine]
    return pushed, turned
