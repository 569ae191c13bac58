"""Work of each contact: its impulses by the mean of the velocities before and after the problem that gave them.

    W_N = P_N (G_N V + G_N V')/2        and so of sliding, rolling and spinning, with P_T, M_R and M_S

Over a step they add up over its problems (`replay`). In a group without impacts there is one problem, that of the loads: it
begins with `V = v_n + h g` and the loads, and leaves what the frame after the step has.

Bound: rounding, and what the solver may have left of the velocities for which it has the works (`Block.left`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carom.audit import forces, groups, hits
from carom.audit.block import Block, Rows
from carom.audit.hits import Hits
from carom.audit.loads import of_loads
from carom.audit.rates import Pairs, Rates, compliance, rates
from carom.audit.report import Tally
from carom.audit.vectors import EPS, across, dot, norm

F64 = NDArray[np.float64]


def done(push: F64, slide: F64, moment: F64, lever: F64, before: Rates, after: Rates) -> F64:
    """(K, 4) works of impulses `push` (K,), `slide` (K, 3) and moments, J: normal, sliding, rolling, spinning."""
    turning, axis = before.turning + after.turning, dot(moment, lever)
    twice = (
        push * (before.normal + after.normal),
        dot(slide, before.slip + after.slip),
        dot(across(moment, lever), turning),
        axis * dot(turning, lever),
    )
    return np.asarray(0.5 * np.stack(twice, axis=1))


def judge(block: Block, tally: Tally) -> None:
    """Contacts of the groups that had no impact in their step."""
    run, c = block.run, block.rows
    why = ""
    if not run.has_contacts:
        why, cure = "work of contacts was not recorded", "contacts = true in [record]"
    elif run.method == "penalty":
        why, cure = "work within substeps", "use nsga or moreau"
    elif not run.has_impacts:
        why, cure = "which contacts had an impact was not recorded", "impacts = true in [record]"
    if why:
        tally.skip("work", why, cure, block.count)
        return
    label, r = groups.labels(block), hits.of_block(block)
    struck = np.zeros(label.size, dtype=bool)
    struck[label[r.k, r.a]] = True
    quiet = ~struck[label[c.k, c.a]] & block.kept[c.k]
    block.skip(
        tally,
        "work",
        "several steps, or parts of one, lie between the frames",
        c.k[quiet & ~block.single[c.k]],
    )
    quiet &= block.single[c.k] & block.there[c.k, c.a]
    held = groups.held(block)[c.k, c.a]
    tally.skip("work", groups.HELD, groups.CURE, int((held & quiet).sum()))
    rows = np.flatnonzero(quiet & ~held)
    if not rows.size:
        return
    k, a, b = c.k[rows], c.a[rows], c.b[rows]
    ball = np.minimum(b, run.bodies - 1)
    given = of_loads(block).impulse
    v = block.v0 + run.gravity * block.dt[:, None, None] + given[..., :3] / run.mass[:, None]
    w = block.w0 + given[..., 3:] / run.inertia[:, None]
    normal, moment = c.normal[rows], c.moment[rows]
    values = []
    for part in forces.split(c.impulse[rows], normal, block.start[1][rows]):
        p = Pairs(a, b, block.t1[k], block.centres[k, a], normal, end=True)
        before, after = (
            rates(run, p, (vs[k, a], ws[k, a], vs[k, ball], ws[k, ball]), normal, part.lever)
            for vs, ws in ((v, w), (block.v1, block.w1))
        )
        value = np.abs(c.work[rows] - done(part.normal, part.sliding, moment, part.lever, before, after))
        values.append(value.max(axis=1))
    tally.measure(
        "work",
        np.minimum(*values),
        bound(block, c)[rows],
        lambda i: block.place(int(k[i]), int(a[i]), int(b[i])),
    )


def bound(block: Block, r: Rows | Hits) -> F64:
    """(K,) how far works may be off for impulses of the rows `r`, J."""
    run, other = block.run, np.minimum(r.b, block.run.bodies - 1)
    push, own = norm(r.impulse) + norm(r.moment) / run.radius[r.a], compliance(run, r.a, r.b)
    spin = np.maximum(norm(block.w0), norm(block.w1))
    fast = np.maximum(norm(block.v0), norm(block.v1)) + run.radius * spin + norm(run.gravity) * run.h
    at = fast[r.k, r.a] + fast[r.k, other] + own[1] * push
    left = 2.0 * own[1] * block.left(norm(block.rows.impulse))[r.k]
    return np.asarray(push * (256.0 * EPS * at + left) + 1e-300)
