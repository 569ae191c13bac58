"""Method `penalty`: what contacts did within the substeps of a step, by the frames around it.

Works of contacts are whole, with what springs store: with their sum the kinetic energy and that of the weight change, whole
or not the hit. A substep takes the weight at both of its ends, and there the speeds that contacts change in it:

    (K + U)' - (K + U) = sum of works,     to rounding and g h/4 of the impulses of walls

A row of /impacts is a hit that is over. Its pair has a contact on record, or may have touched; where it is apart at both
frames, the impulse of the hit is that of the contact. Bodies that nothing else pushed meet with the speed of the frame
before, and part with that of the frame after, to the turn of the normal.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import forces, groups, hits
from carom.audit.block import Block
from carom.audit.near import Near
from carom.audit.report import Tally
from carom.audit.rigid import kinetic, sizes, weight
from carom.audit.vectors import EPS, dot, norm


def judge(block: Block, near: Near, tally: Tally) -> None:
    """Both, of a block."""
    if block.run.method == "penalty" and block.run.has_contacts:
        _balance(block, near, tally)
        if block.run.has_impacts:
            _impacts(block, near, tally)


def _balance(block: Block, near: Near, tally: Tally) -> None:
    """Of each group that nothing works on from outside."""
    run, c, label = block.run, block.rows, groups.labels(block)
    if run.loads:
        tally.skip("energy balance", "loads work within substeps", "use nsga or moreau", block.count)
        return
    many = label.size
    mine = label[c.k, c.a]

    def summed(of_bodies: F64, of_rows: F64) -> F64:
        total = np.bincount(label[:, :-1].ravel(), np.nan_to_num(of_bodies).ravel(), minlength=many)
        return np.asarray(total + np.bincount(mine, of_rows, minlength=many)).reshape(label.shape)

    ends = (block.x0, block.v0, block.w0, block.c0), (block.x1, block.v1, block.w1, block.c1)
    change = kinetic(run, *ends[1][1:]) - kinetic(run, *ends[0][1:])
    change = change - weight(run, block.x1 - block.x0, block.c1 - block.c0)
    value = summed(change, -c.work.sum(axis=1))
    size = np.maximum(*(sizes(run, *end) for end in ends))
    lifted = np.where(c.b < run.balls, 0.0, 0.25 * run.h * norm(c.impulse)) * float(norm(run.gravity))
    top = summed(size, np.abs(c.work).sum(axis=1))
    bound = 16.0 * EPS * (4.0 + block.updates)[:, None] * top + summed(np.zeros_like(change), lifted)
    outer = label == label[:, -1:]
    root = label == np.arange(many).reshape(label.shape)
    why = "walls that move, or bodies that come or go, work within substeps"
    driven = root & outer & (np.bincount(label[:, :-1].ravel(), minlength=many).reshape(label.shape) > 0)
    tally.skip("energy balance", why, "use nsga or moreau", int(driven.sum()))
    hidden = np.zeros(many, dtype=bool)
    hidden[_without_rows(block, near, label)] = True
    why = "contacts may work whose impulses cancel, which have no row"
    tally.skip("energy balance", why, "use nsga or moreau", int((root & ~outer & hidden[label]).sum()))
    judged = root & ~outer & ~hidden[label] & block.kept[:, None]
    k, first = np.nonzero(judged)
    tally.measure(
        "energy balance",
        np.abs(value[judged]),
        bound[judged],
        lambda i: block.place(int(k[i]), int(first[i])),
    )


def _without_rows(block: Block, near: Near, label: I64) -> I64:
    """Groups of bodies that overlap at a frame, and have no contact on record in the interval."""
    c, many = block.rows, len(block.run.names)
    keys = ((of.k * many + of.a) * many + of.b for of in (near, c))
    own, known = keys
    closed = ((near.gap0 <= 0.0) | (near.gap1 <= 0.0)) & ~np.isin(own, known)
    k, a, b = near.k[closed], near.a[closed], near.b[closed]
    ball = b < block.run.bodies
    return np.append(label[k, a], label[k[ball], b[ball]])


def _impacts(block: Block, near: Near, tally: Tally) -> None:
    run, c, r = block.run, block.rows, hits.of_block(block)
    r = r.of(block.kept[r.k] & block.stayed(r.k, r.a, r.b))
    contact, known = r.contacts(block)
    # What opens slowly has pushed in an earlier interval, and its bodies are still near.
    many = len(run.names)
    met = np.isin((r.k * many + r.a) * many + r.b, (near.k * many + near.a) * many + near.b)
    tally.measure("impact sum", np.where(known | met, 0.0, norm(r.impulse)), 0.0, hits.place(block, r))
    r, contact = r.of(known), contact[known]
    place = hits.place(block, r)
    apart = (block.start[0] > 0.0) & (block.end[0] > 0.0)
    rows_of = np.bincount(contact, minlength=len(c))
    whole = apart[contact] & (rows_of[contact] == 1)
    why = "a hit over several frames, or several hits of a pair between two"
    block.skip(tally, "impact sum", why, r.k[~whole])
    # Slow bounces under a load are no hits, and may follow one.
    load = 2.0 * run.whole_mass * float(norm(run.gravity)) * block.dt[r.k]
    size = norm(r.impulse) + norm(c.impulse)[contact]
    bound = load + 16.0 * EPS * (4.0 + block.updates[r.k]) * size
    tally.measure("impact sum", norm(c.impulse[contact] - r.impulse), bound, place, whole)
    alone = whole & _alone(block)[contact]
    block.skip(
        tally, "impact speeds", "other contacts, loads or walls that move changed the speeds", r.k[~alone]
    )
    fast = forces.together(block, forces.speeds(block))[contact]
    bound = fast * forces.turn(block)[contact] + float(norm(run.gravity)) * block.dt[r.k]
    bound = bound + 64.0 * EPS * (4.0 + block.updates[r.k]) * fast
    for told, start in ((r.approach, True), (r.separation, False)):
        v_a, _, v_b, _ = block.motion(r.k, r.a, r.b, start=start)
        speed = dot(v_a - np.where((r.b < run.balls)[:, None], v_b, 0.0), r.normal)
        tally.measure("impact speeds", np.abs(told - speed), bound, place, alone)


def _alone(block: Block) -> Bool:
    """(K,) contacts of bodies without another one, nor loads, and of no wall that moves."""
    run, c = block.run, block.rows
    ball = c.b < run.bodies
    ends = np.append(c.k * run.bodies + c.a, (c.k * run.bodies + c.b)[ball])
    count = np.bincount(ends, minlength=block.count * run.bodies).reshape(block.count, run.bodies)
    moves = np.array([*np.zeros(run.bodies, dtype=bool), *(wall.moves for wall in run.walls)], dtype=bool)
    loaded = np.append(run.loaded, np.zeros(len(run.walls), dtype=bool))
    other = np.where(ball, count[c.k, np.minimum(c.b, run.bodies - 1)], 1)
    return np.asarray((count[c.k, c.a] == 1) & (other == 1) & ~moves[c.b] & ~loaded[c.a] & ~loaded[c.b])
