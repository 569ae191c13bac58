"""The global form of a contact problem: bodies and contacts apart.

    M v = H r + f,     u = H^T v + w,     and the conditions of the local form on r and u

with M (n, n) of the bodies (mass, and what damping and stiffness add) and H (n, d C) of the contacts. The bodies
are eliminated by

    W = H^T M^-1 H,     q = w + H^T M^-1 f.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64
from carom.problem.errors import ContactProblemError, ContactProblemWarning, refuse
from carom.problem.given import finite, vector
from carom.problem.local import MAX_CHECKED, Bounds, LocalProblem, positive, square
from carom.problem.matrix import Csr, blocks, components, of_blocks

#: Rows of a block of M that is inverted as a dense matrix (0.3 GB).
MAX_BLOCK = 6000


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalProblem(Bounds):
    """A contact problem in terms of bodies, checked. `M` and `H` as W in `LocalProblem`; `f` (n,), `w` (d C,)."""

    M: Csr
    H: Csr
    f: F64
    w: F64

    def __post_init__(self) -> None:
        self._set("f", vector(self.f, "f"))
        self._set("w", vector(self.w, "w"))
        self._check_bounds(len(self.w), "w")
        self._set("M", square(self.M, "M", len(self.f)))
        positive(self.M, "M")
        h, wanted = Csr.from_any(self.H, "H"), (len(self.f), len(self.w))
        if h.shape != wanted:
            hint = " (is it the transpose?)" if h.shape == wanted[::-1] else ""
            cause = f"it is {h.shape[0]} x {h.shape[1]}{hint}"
            raise refuse("H", cause, f"with f and w as they are it must be {wanted[0]} x {wanted[1]}")
        finite(h.data, "H")
        self._set("H", h)
        _check_regular(self.M)

    def to_local(self) -> LocalProblem:
        """The local form. A singular M is an error, one that is not positive definite a warning."""
        inverse = invert(self.M)
        g = self.H.transpose
        return LocalProblem(
            W=g.multiply(inverse.multiply(self.H)),
            q=self.w + g.dot(inverse.dot(self.f)),
            # A stiff M that is unsymmetric by little may give a W that is so by much (a published one: 1e-7 and 0.16).
            # This W is what M says all the same, so a warning is enough.
            max_asymmetry=math.inf,
            mu=self.mu,
            mu_r=self.mu_r,
            mu_s=self.mu_s,
            dimension=self.dimension,
            title=self.title,
            description=self.description,
            math_info=self.math_info,
        )


def invert(m: Csr) -> Csr:
    """M^-1, block by block: a body, or bodies that joints or springs couple, is a block.

    Each block is scaled by its largest entries before it is judged, so that masses and moments of inertia, or
    light and heavy bodies, may differ by any factor.
    """
    block = components(m)
    largest = np.bincount(block).max(initial=0)
    if largest > MAX_BLOCK:
        cause = f"it couples {largest} rows"
        raise refuse("M", cause, f"blocks of up to {MAX_BLOCK} are eliminated here; give W and q instead")
    found, definite = [], True
    for members, dense in blocks(m, block):
        result, positive = _inverse(dense, members)
        definite &= positive
        found.append((members, result))
    if not definite:
        text = (
            "M is not positive definite: W need not be positive semidefinite, nor the problem have a solution"
        )
        warnings.warn(text, ContactProblemWarning, stacklevel=3)
    return of_blocks(found, m.shape, "M")


def _check_regular(m: Csr) -> None:
    """Refuse a singular M. Blocks of more than `MAX_CHECKED` rows are seen to when bodies are eliminated."""
    block = components(m)
    small = np.bincount(block)[block] <= MAX_CHECKED
    if small.all():
        for members, dense in blocks(m, block):
            _inverse(dense, members)
        return
    empty = np.flatnonzero(np.bincount(m.rows, np.abs(m.data), minlength=m.shape[0]) == 0.0)
    if len(empty):
        raise _singular(empty[:1])


def _inverse(dense: F64, members: I64) -> tuple[F64, bool]:
    """Inverses of blocks (k, s, s), whose rows in M are `members` (k, s); and whether all are positive definite."""
    scale = np.sqrt(np.abs(dense).max(axis=2))
    if (scale == 0.0).any():
        raise _singular(members[np.argmax((scale == 0.0).any(axis=1))])
    both = scale[:, :, None] * scale[:, None, :]
    scaled = dense / both
    try:
        inverse = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        worst = [k for k, one in enumerate(scaled) if np.linalg.matrix_rank(one) < len(one)]
        raise _singular(members[worst[0] if worst else 0]) from None
    condition = np.abs(scaled).sum(axis=2).max(axis=1) * np.abs(inverse).sum(axis=2).max(axis=1)
    bad = ~(condition * dense.shape[1] * np.finfo(np.float64).eps < 1.0)
    if bad.any():
        raise _singular(members[np.argmax(bad)])
    try:
        np.linalg.cholesky(0.5 * (scaled + scaled.transpose(0, 2, 1)))
    except np.linalg.LinAlgError:
        return inverse / both, False
    return inverse / both, True


def _singular(rows: I64) -> ContactProblemError:
    listed = ", ".join(map(str, rows[:6])) + (", ..." if len(rows) > 6 else "")
    cure = "a body without mass or inertia cannot be eliminated"
    return refuse("M", f"singular in row{'s' * (len(rows) > 1)} {listed} (from 0)", cure)
