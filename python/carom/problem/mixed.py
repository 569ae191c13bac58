"""Problems of a run, whose contacts have only the rows that act, as problems whose contacts have all the same.

In the core a contact has rows N, then T1 T2 if it has friction, R1 R2 if it has rolling resistance and S if it
resists spinning (section 2 of docs/theory/algorithm.md). In the layout of FCLib all contacts have as many rows. A
row that is missing becomes one with bound 0: it takes no force whatever stands in W, so a solution of one
form is a solution of the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom.problem.errors import refuse
from carom.problem.local import LocalProblem
from carom.problem.matrix import Csr

F64 = NDArray[np.float64]

#: Components of the blocks of a contact behind its normal row.
SIZES = np.array([2, 2, 1])


def uniform(
    matrix: Csr,
    q: F64,
    mu: F64,
    *,
    first_row: F64,
    rows: F64,
    rolling_radius: F64,
    spinning_radius: F64,
    **text: Any,
) -> LocalProblem:
    """The problem with contacts of 3, 5 or 6 rows, whichever suffices.

    `matrix` (n, n), `q` (n,) hold `rows` (C,) rows of each contact from `first_row` (C,); bounds (C,), `rolling_radius` and
    `spinning_radius` in m. The diagonal of an added row is that of the normal row of its contact.
    """
    columns = (mu, first_row, rows, rolling_radius, spinning_radius)
    if len({len(column) for column in columns}) != 1:
        cause = f"columns of {', '.join(str(len(column)) for column in columns)} contacts"
        raise refuse("/carom", cause, "all must describe the same contacts")
    bounds = np.stack([mu, rolling_radius, spinning_radius], axis=1)
    there = bounds > 0.0
    first, count = first_row.astype(np.int64), rows.astype(np.int64)
    wanted = 1 + there @ SIZES
    if (count != wanted).any():
        c = int(np.argmax(count != wanted))
        cause = f"{count[c]} rows where the bounds of the contact ask for {wanted[c]}"
        raise refuse(
            f"/carom/rows[{c}]", cause, "the problem of a scene with joints has no form without them"
        )
    ends = np.concatenate([[0], np.cumsum(count)])
    if len(q) != ends[-1] or (first != ends[:-1]).any():
        raise refuse("/carom/first_row", "contacts do not follow one another", "the file is damaged")
    dimension = 6 if there[:, 2].any() else 5 if there[:, 1].any() else 3
    place = _places(there, dimension)
    to = np.concatenate(
        [np.flatnonzero(p) + dimension * c for c, p in enumerate(place)] + [np.zeros(0, np.int64)]
    )
    to = to.astype(np.int64)
    size = dimension * len(mu)
    added = np.setdiff1d(np.arange(size), to)
    normal = matrix.diagonal()[first]
    larger = Csr.from_triplets(
        np.concatenate([to[matrix.rows], added]),
        np.concatenate([to[matrix.indices], added]),
        np.concatenate([matrix.data, normal[added // dimension]]),
        (size, size),
    )
    free = np.zeros(size)
    free[to] = q
    return LocalProblem(
        W=larger,
        q=free,
        mu=mu,
        mu_r=rolling_radius if dimension > 3 else None,
        mu_s=spinning_radius if dimension > 5 else None,
        dimension=dimension,
        **text,
    )


def _places(there: NDArray[np.bool_], dimension: int) -> NDArray[np.bool_]:
    """(C, dimension) which rows of a full contact are there."""
    normal = np.ones((len(there), 1), dtype=bool)
    return np.concatenate([normal, np.repeat(there, SIZES, axis=1)], axis=1)[:, :dimension]
