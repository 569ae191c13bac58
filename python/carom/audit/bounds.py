"""What the stopping rule of the solvers (eq. 44) may leave in an impact problem.

In an island of up to `dense_contacts` contacts, or `pile_contacts` where `pile_tolerance` is fine, as of all contacts
(`Block.left`): `8 tol_r` times the root of the sum of the squares of all impulses of the step.

Piles sum impulses of every size over up to 52 problems, and the rule is applied as the solver states it (decision 016): in
problem p, with impulses `r_p` that change the momenta by `M u_p` (moments over the radius),

    |residual| <= rho = tol_r (2 |M u_p| + |P(r_p - ...)| + |r_p| + T) + floor,     |P| = |r_p| up to rho itself

where `T = 2 (|R| + |M W|)` is the same of what is solved already and a problem adds to: nothing for the loads (problem 0),
the loads for problem 1, and the larger of that and of what remained of it with problem 1 for all later ones. The floor is
`m r touching_tolerance / h`, or `m V tolerance_floor` if that is more. Little islands of a later problem are asked for more.

The residual of a contact is `r - P(r - s z/w)` with its measure `z`, its compliance `w = D_cc` and `s = 1/2` (R1). Hence
of its normal row `-z <= 2 w rho`, and where `z > 0` either `z <= 2 w rho` or `r_N <= rho`: one that gives next to nothing
may separate faster than its law.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carom.audit.block import Block
from carom.audit.hits import Hits
from carom.audit.vectors import norm

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


def left(block: Block, r: Hits, kept: Bool, wrench: tuple[F64, F64], speed: F64) -> F64:
    """(K,) what the solver may have left in the problem of each row, N s.

    `kept`: rows of problem 0 that remained; `wrench`: impulse and moment of each row on its bodies, (K, 6); `speed`: the
    largest of a body, (B,).
    """
    run, o = block.run, block.run.options
    squares = norm(r.impulse) ** 2 + (norm(r.moment) / run.radius[r.a]) ** 2
    plain = 8.0 * np.sqrt(np.bincount(r.k, squares, minlength=block.count))[r.k]
    loads, first = r.problem == 0, r.problem == 1
    before = _terms(block, r, r.k, wrench, squares, loads)
    then = _terms(block, r, r.k, wrench, squares, loads & kept | first)
    problem = r.k * (int(r.problem.max(initial=0)) + 1) + r.problem
    _, group = np.unique(problem, return_inverse=True)
    own = _terms(block, r, group, wrench, squares, np.ones(len(r), dtype=bool))[group]
    solved = np.where(loads, 0.0, np.where(first, before[r.k], np.maximum(before, then)[r.k]))
    floor = o["touching_tolerance"] * run.radius.max() / run.h + o["tolerance_floor"] * speed[r.k]
    tolerance = block.tolerance[r.k]
    # |P| is |r_p| up to the residual.
    stated = (tolerance * (own + solved) + floor * run.mass.max()) / (1.0 - tolerance)
    return np.asarray(np.where(block.cascaded[r.k], stated, tolerance * plain))


def _terms(block: Block, r: Hits, group: I64, wrench: tuple[F64, F64], squares: F64, chosen: Bool) -> F64:
    """`2 (|M u| + |r|)` of the chosen rows of each group."""
    run, count = block.run, int(group.max(initial=0)) + 1
    impulses = np.bincount(group[chosen], squares[chosen], minlength=max(count, block.count))
    other = np.minimum(r.b, run.bodies - 1)
    body = np.concatenate([r.a[chosen], other[chosen]])
    whose, where = np.unique(np.tile(group[chosen], 2) * run.bodies + body, return_inverse=True)
    sums = np.zeros((len(whose), 6))
    np.add.at(sums, where, np.concatenate([wrench[0][chosen], wrench[1][chosen]]))
    of_group, of_body = np.divmod(whose, run.bodies)
    each = norm(sums[:, :3]) ** 2 + (norm(sums[:, 3:]) / run.radius[of_body]) ** 2
    momenta = np.bincount(of_group, each, minlength=max(count, block.count))
    return np.asarray(2.0 * (np.sqrt(momenta) + np.sqrt(impulses)))


def misfit(z: F64, push: F64, own: F64) -> F64:
    """(K,) how far normal rows are from `0 <= z, r_N >= 0, z r_N = 0`, m/s, for compliances `own` and impulses `push`."""
    return np.where(z > 0.0, np.minimum(z, 2.0 * own * np.maximum(push, 0.0)), -z)


def gain(block: Block) -> F64:
    """(B,) share of the kinetic energy that an impact problem may gain (rule R4): rounding, in piles `tol_r`/100."""
    return np.where(block.cascaded, np.maximum(1e-10, 0.01 * block.tolerance), 1e-10)
