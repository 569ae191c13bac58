"""What the stopping rule of the solvers (eq. 44) may leave in an impact problem.

In an island of up to `dense_contacts` contacts, or `pile_contacts` where `pile_tolerance` is fine, as of all contacts
(`Block.left`): `8 tol_r` times the root of the sum of the squares of all impulses of the step.

Piles sum impulses of every size over up to 52 problems, and the rule is applied as the solver states it (decision 011): in
problem p, with impulses `r_p` that change the momenta by `M u_p` (moments over the radius),

    |residual| <= rho = tol_r (2 |M u_p| + |P(r_p - ...)| + |r_p| + T) + floor,     |P| = |r_p| up to rho itself

where `T = 2 (|R| + |M W|)` is the same of what is solved already and a problem adds to: nothing for the loads (problem 0),
the loads for problem 1, and the larger of that and of what remained of it with problem 1 for all later ones. The floor is
`m r touching_tolerance / h`, or `m V tolerance_floor` if that is more. Clusters of a later problem have finer bounds.

The residual of a contact is `r - P(r - s z/w)` with its measure `z`, its compliance `w = D_cc` and `s = 1/2` (R1). Hence
of its normal row `-z <= 2 w rho`, and where `z > 0` either `z <= 2 w rho` or `r_N <= rho`: one that gives next to nothing
may separate faster than its law.
"""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.hits import Hits
from carom.audit.vectors import norm


def squares(run: Run, r: Hits) -> F64:
    """(K,) squares of the multipliers of each row, moments over the radius, (N s)^2."""
    return np.asarray(norm(r.impulse) ** 2 + (norm(r.moment) / run.radius[r.a]) ** 2)


def terms(block: Block, k: I64, multipliers: F64, at: I64, momenta: F64) -> F64:
    """(B,) `2 (|M u| + |r|)`, N s: of rows with squares of multipliers (K,) in the intervals `k`, which change the momenta
    (M, 6) of the bodies `at` (interval times N plus body), each once.
    """
    run = block.run
    interval, body = np.divmod(at, run.bodies)
    each = norm(momenta[:, :3]) ** 2 + (norm(momenta[:, 3:]) / run.radius[body]) ** 2
    moved, pushed = (
        np.bincount(i, values, minlength=block.count) for i, values in ((interval, each), (k, multipliers))
    )
    return np.asarray(2.0 * (np.sqrt(moved) + np.sqrt(pushed)))


def left(block: Block, plain: F64, own: F64, solved: F64, speed: F64) -> F64:
    """(B,) what the solver may have left in a problem of each interval, N s.

    `plain`: root of the sum of all squares of the interval; `own` and `solved`: the terms of the problem and of what it adds
    to; `speed`: the largest of a body, m/s; each (B,).
    """
    # |P| is |r_p| up to the residual.
    stated = (block.tolerance * (own + solved) + floor(block, speed)) / (1.0 - block.tolerance)
    return np.asarray(np.where(block.cascaded, stated, 8.0 * block.tolerance * plain))


def floor(block: Block, speed: F64) -> F64:
    """(B,) what it may leave however small the impulses are, N s, for largest speeds of a body: more in halves of a step."""
    run, t = block.run, block.run.loosest
    h = run.h / 2.0 ** np.minimum(block.over(run.steps["halvings"]), 8.0)
    longest = float(np.append(run.radius, run.clumps.reach).max())
    least = t["touching_tolerance"] * longest / h + t["tolerance_floor"] * speed
    return np.asarray(least * run.heavy.max())


def misfit(z: F64, push: F64, own: F64) -> F64:
    """(K,) how far normal rows are from `0 <= z, r_N >= 0, z r_N = 0`, m/s, for compliances `own` and impulses `push`."""
    return np.where(z > 0.0, np.minimum(z, 2.0 * own * np.maximum(push, 0.0)), -z)


def gain(block: Block) -> F64:
    """(B,) share of the kinetic energy that an impact problem may gain (rule R4): rounding, in piles `tol_r`/100."""
    return np.where(block.cascaded, np.maximum(1e-10, 0.01 * block.tolerance), 1e-10)
